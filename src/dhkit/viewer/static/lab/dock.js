// Plots below the scene, as wide as it is: of a motion or of a simulation, up to three in a row.

import { h } from "./dom.js";
import { draggedEdge } from "./edge.js";
import { remember, remembered } from "./memory.js";

const USUAL = innerHeight < 900 ? 236 : 280,
  LEAST = 150; // px
const SCENE = 200; // px that are left to the scene

export class PlotDock {
  constructor(lab) {
    this.lab = lab;
    this.sources = []; // curves that there are, the latest first
    this.height = Number(remembered("dock-height", String(USUAL)));
    // A saved page shows the arm first.
    this.open =
      remembered("dock", innerWidth > 720 && lab.can("motion.plan") ? "open" : "") === "open";
    this.grip = h("div", {
      class: "grip",
      role: "separator",
      "aria-orientation": "horizontal",
      "aria-label": "Height of the plots",
      tabIndex: 0,
    });
    this.choice = h("div", { class: "choice", role: "group", "aria-label": "Curves of" });
    this.legend = h("div", { class: "names" });
    this.fold = h("button", { class: "quiet", onclick: () => this.toggle() });
    this.row = h("div", { class: "row" });
    this.root = h(
      "section",
      { id: "dock", "aria-label": "Plots", hidden: true },
      this.grip,
      h("header", {}, this.choice, this.legend, this.fold),
      this.row,
    );
    draggedEdge(this.grip, {
      keys: ["ArrowDown", "ArrowUp"],
      sizeAt: ({ clientY }) => innerHeight - clientY,
      size: () => this.height,
      take: (height) => this.resize(height),
    });
    this.layout();
  }

  get shown() {
    return this.sources[0];
  }

  // Show curves; they stay until they are released.
  show(curves) {
    if (this.shown === curves) return;
    this.sources = [curves, ...this.sources.filter((other) => other !== curves)];
    this.update();
  }

  release(curves) {
    if (!this.sources.includes(curves)) return;
    this.sources = this.sources.filter((other) => other !== curves);
    this.update();
  }

  // Whether curves are on show, so that drawing them pays.
  shows(curves) {
    return this.open && this.shown === curves;
  }

  update() {
    const { shown } = this;
    this.root.hidden = !shown;
    const all = [...this.sources].sort((a, b) => (a.title < b.title ? -1 : 1));
    this.choice.replaceChildren(
      ...(all.length > 1
        ? all.map((curves) =>
            h(
              "button",
              {
                "aria-pressed": String(curves === shown),
                onclick: () => this.show(curves),
              },
              curves.title,
            ),
          )
        : []),
    );
    this.legend.replaceChildren(...(shown ? [shown.legend] : []));
    this.row.replaceChildren(...(shown ? shown.plots.map((plot) => plot.root) : []));
    this.layout();
  }

  toggle() {
    this.open = !this.open;
    remember("dock", this.open ? "open" : "");
    this.layout();
  }

  layout() {
    const { body } = document,
      visible = !this.root.hidden;
    const height = Math.max(LEAST, Math.min(this.height, innerHeight - SCENE));
    this.root.classList.toggle("folded", !this.open);
    this.fold.textContent = this.open ? "Hide plots" : "Show plots";
    this.fold.setAttribute("aria-expanded", String(this.open));
    body.classList.toggle("plotted", visible && this.open);
    body.style.setProperty("--plots", visible && this.open ? `${height}px` : "0px");
    if (visible && this.open) requestAnimationFrame(() => this.shown?.resize());
  }

  resize(height) {
    this.height = Math.max(LEAST, Math.min(height, innerHeight - SCENE));
    remember("dock-height", String(Math.round(this.height)));
    this.layout();
  }

  unitsChanged() {
    for (const curves of this.sources) curves.unitsChanged();
  }
}
