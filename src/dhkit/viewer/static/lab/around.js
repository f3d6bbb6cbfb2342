// Obstacles around the arm: added, chosen in the list or in the scene, moved by handles, and given sizes.

import { UNITS, fixed, h, onTyped, typed } from "./dom.js";
import { Gizmo } from "./gizmo.js";

const KINDS = [
  ["box", "Box"],
  ["sphere", "Sphere"],
  ["cylinder", "Cylinder"],
  ["floor", "Floor"],
];
const SIZES = { box: "edges", sphere: "radius", cylinder: "radius and length", floor: "" };
const STILL = 4; // px that the pointer moves in a click

export class ObstacleList {
  constructor(lab) {
    this.lab = lab;
    this.obstacles = [];
    this.chosen = null; // index
    this.gizmo = new Gizmo(
      lab.stage,
      (T) => lab.ask("obstacles.set", { index: this.chosen, T }),
      () => this.obstacles[this.chosen]?.T,
    );
    this.list = h("ul", { class: "around" });
    const adding = KINDS.map(([kind, text]) =>
      h("button", { onclick: () => this.add(kind) }, text),
    );
    this.root = h(
      "fieldset",
      { hidden: !lab.can("obstacles.add") },
      h("legend", {}, "Obstacles"),
      h("div", { class: "buttons" }, adding),
      this.list,
      (this.hint = h(
        "p",
        { class: "hint" },
        "A motion in least time goes around them, certified; the ends of a cylinder are round.",
      )),
    );
    this.chooseInScene(lab.stage);
  }

  async add(kind) {
    const answer = await this.lab.ask("obstacles.add", { kind });
    if (!answer) return;
    this.choose(answer.index);
    if (!this.lab.stage.touched) this.lab.stage.reframe(); // it may stand outside the view
  }

  // A click on an obstacle in the scene chooses it; on another place of the scene none.
  chooseInScene(stage) {
    let from = null;
    stage.pane.addEventListener(
      "pointerdown",
      ({ clientX, clientY }) => (from = [clientX, clientY]),
    );
    stage.pane.addEventListener("pointerup", (event) => {
      const moved = from && Math.hypot(event.clientX - from[0], event.clientY - from[1]);
      if (from === null || moved > STILL || !this.obstacles.length) return;
      const index = stage.obstacleAt(event);
      if (index !== null) this.choose(index);
      else if (this.chosen !== null) this.choose(null);
    });
  }

  choose(index) {
    this.chosen = index;
    this.show();
  }

  take(obstacles) {
    this.obstacles = obstacles;
    if (this.chosen >= obstacles.length) this.chosen = null;
    this.show();
  }

  show() {
    const chosen = this.chosen === null ? null : this.obstacles[this.chosen];
    this.gizmo.set(chosen?.T ?? null, true, this.lab.state.arm?.reach ?? 1);
    this.lab.stage.markObstacle(this.chosen);
    this.hint.hidden = !this.obstacles.length;
    const names = JSON.stringify(this.obstacles.map(({ name, kind }) => [name, kind]));
    if (names !== this.names) {
      this.names = names;
      this.rows = this.obstacles.map((obstacle, index) => this.row(obstacle, index));
      this.list.replaceChildren(...this.rows.map(({ item }) => item));
    }
    this.rows?.forEach(({ name, sizes }, index) => {
      name.setAttribute("aria-pressed", String(index === this.chosen));
      if (document.activeElement !== sizes) sizes.value = this.sizesText(this.obstacles[index]);
    });
  }

  row({ name: text, kind }, index) {
    const name = h(
      "button",
      {
        class: "quiet",
        onclick: () => this.choose(this.chosen === index ? null : index),
      },
      text,
    );
    const sizes = h("input", {
      type: "text",
      class: "number",
      hidden: kind === "floor",
      "aria-label": `Sizes of ${text}: ${SIZES[kind]}`,
      title: SIZES[kind],
    });
    onTyped(
      sizes,
      () => this.resize(index, sizes.value),
      () => this.show(),
    );
    const remove = h(
      "button",
      {
        class: "quiet",
        "aria-label": `Remove ${text}`,
        onclick: () => this.remove(index),
      },
      "×",
    );
    return { name, sizes, item: h("li", {}, name, sizes, remove) };
  }

  sizesText({ sizes }) {
    const { scale, digits } = UNITS[this.lab.units.length];
    return sizes.map((x) => fixed(x * scale, Math.max(digits - 1, 0))).join(" ");
  }

  resize(index, text) {
    const { scale } = UNITS[this.lab.units.length];
    const { sizes } = this.obstacles[index];
    const values = text
      .trim()
      .split(/[\s;]+/)
      .map(typed);
    if (values.length !== sizes.length || values.some((x) => x === null || x <= 0)) {
      const count = ["", "a positive number", "two positive numbers", "three positive numbers"];
      this.lab.complain(`sizes ${text.slice(0, 40)}: expected ${count[sizes.length]}`);
      return;
    }
    this.lab.ask("obstacles.set", { index, sizes: values.map((x) => x / scale) });
  }

  remove(index) {
    this.chosen = null;
    this.lab.ask("obstacles.remove", { index });
  }

  unitsChanged() {
    this.show();
  }
}
