// Names written beside points of the scene: of frames, and of ghosts. A line leads from each point to its name.

const AWAY = 22, // px between a point and its name, across and upwards
  HEIGHT = 20, // px
  MARGIN = 4; // px between a name and the edge of the picture

export class Labels {
  constructor(container) {
    this.container = container;
    this.container.hidden = true;
    this.labels = [];
  }

  set(labels) {
    this.container.replaceChildren();
    this.labels = labels.map(({ frame, text, color }) => {
      const leader = document.createElement("i");
      const element = document.createElement("span");
      element.textContent = text;
      if (color) element.style.borderLeft = `4px solid ${color}`;
      this.container.append(leader, element);
      return { frame, element, leader, width: 0 };
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
      label.element.style.visibility = label.leader.style.visibility = point ? "" : "hidden";
      if (!point) continue;
      label.width ||= label.element.offsetWidth;
      const fits = point.x + AWAY + label.width + MARGIN < this.container.clientWidth;
      const left = fits ? point.x + AWAY : point.x - AWAY - label.width;
      const top = Math.max(MARGIN, point.y - AWAY - HEIGHT / 2);
      const box = { left, top, right: left + label.width };
      // Frames that only happen to coincide: write below the label that is there.
      while (taken.some((other) => overlaps(box, other))) box.top += HEIGHT;
      taken.push(box);
      label.element.style.transform = `translate(${px(box.left)}, ${px(box.top)})`;
      lead(label.leader, point, { x: fits ? box.left : box.right, y: box.top + HEIGHT / 2 });
    }
  }
}

// Draw a line of the page from one point to another.
function lead(line, from, to) {
  const x = to.x - from.x,
    y = to.y - from.y;
  line.style.width = px(Math.hypot(x, y));
  line.style.transform = `translate(${px(from.x)}, ${px(from.y)}) rotate(${Math.atan2(y, x).toFixed(3)}rad)`;
}

function px(length) {
  return `${length.toFixed(1)}px`;
}

function overlaps(a, b) {
  return a.left < b.right && b.left < a.right && Math.abs(a.top - b.top) < HEIGHT;
}
