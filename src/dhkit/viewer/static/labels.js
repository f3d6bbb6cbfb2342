// Names written beside points of the scene: of frames, and of ghosts.

const GAP = 9,
  HEIGHT = 20; // px

export class Labels {
  constructor(container) {
    this.container = container;
    this.container.hidden = true;
    this.labels = [];
  }

  set(labels) {
    this.container.replaceChildren();
    this.labels = labels.map(({ frame, text, color }) => {
      const element = document.createElement("span");
      element.textContent = text;
      if (color) element.style.borderLeft = `4px solid ${color}`;
      this.container.append(element);
      return { frame, element, width: 0 };
    });
  }

  get count() {
    return this.labels.length;
  }

  show(visible) {
    this.container.hidden = !visible;
  }

  // project: frame -> {x, y} in px, or null behind the camera.
  place(project) {
    if (this.container.hidden) return;
    const taken = [];
    for (const label of this.labels) {
      const point = project(label.frame);
      label.element.style.visibility = point ? "" : "hidden";
      if (!point) continue;
      label.width ||= label.element.offsetWidth;
      const fits = point.x + GAP + label.width < this.container.clientWidth;
      const left = fits ? point.x + GAP : point.x - GAP - label.width;
      const box = { left, top: point.y - HEIGHT, right: left + label.width };
      // Frames that only happen to coincide: write below the label that is there.
      while (taken.some((other) => overlaps(box, other))) box.top += HEIGHT;
      taken.push(box);
      label.element.style.transform = `translate(${box.left.toFixed(1)}px, ${box.top.toFixed(1)}px)`;
    }
  }
}

function overlaps(a, b) {
  return a.left < b.right && b.left < a.right && Math.abs(a.top - b.top) < HEIGHT;
}
