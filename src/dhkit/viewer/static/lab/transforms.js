// A solid that is turned and moved step by step, about its own axes or those of the world: the course's first assignment.

import { Labels } from "../labels.js";
import { IDENTITY, multiply, rotation, translation } from "../offline/kinematics.js";
import { THREE } from "../stage.js";
import { fixed, h, indexed, matrix } from "./dom.js";
import { formula } from "./formula.js";

const STEP_TIME = 900; // ms of a step
const FIRST = [{ kind: "turn", axis: "z", amount: "30°", about: "fixed" }];

export class TransformsPanel {
  constructor(lab, root) {
    this.lab = lab;
    this.steps = FIRST.map((step) => ({ ...step }));
    this.list = h("ol", { class: "steps" });
    this.apply = h("button", { class: "main", onclick: () => this.run() }, "Apply step by step");
    this.add = h(
      "button",
      {
        onclick: () =>
          this.change(() =>
            this.steps.push({ kind: "turn", axis: "x", amount: "90°", about: "current" }),
          ),
      },
      "Add a step",
    );
    this.unit = h(
      "select",
      {
        "aria-label": "Unit of the solid's file",
        onchange: () => lab.ask("transforms.unit", { unit: this.unit.value }),
      },
      ["m", "cm", "mm", "in"].map((unit) => h("option", { value: unit }, unit)),
    );
    this.units = h("label", { class: "line", hidden: true }, "file in ", this.unit);
    this.hide = h("input", { type: "checkbox", onchange: () => this.hideArm() });
    this.result = h("div", { class: "step" });
    this.note = h("p", { class: "note", role: "status" });
    this.name = h("h2", {}, "");
    root.append(
      this.name,
      this.units,
      this.list,
      h("div", { class: "buttons" }, this.add, this.apply),
      h("label", { class: "line" }, this.hide, " hide the arm"),
      this.note,
      this.result,
      h(
        "p",
        { class: "hint" },
        "Amounts in radians and metres; 30° and 2*inch are fine. Current: about the solid's own axes; fixed: about the world's.",
      ),
    );
    const container = h("div", { class: "labels", "aria-hidden": "true" });
    document.getElementById("stage").append(container);
    this.labels = new Labels(container);
    lab.stage.rendered.push(() => this.labels.place((vertex) => this.place(vertex)));
    this.T = IDENTITY;
    this.build();
  }

  take_solid(solid) {
    this.solid = solid;
    this.units.hidden = solid.unit === null;
    this.unit.value = solid.unit;
    this.name.textContent = `${solid.name}: ${solid.vertices.length} vertices`;
    this.labels.set(
      solid.vertices.slice(0, solid.listed).map((_, frame) => ({ frame, text: String(frame + 1) })),
    );
    if (this.group) this.lab.stage.viewer.scene.remove(this.group);
    this.group = null;
    this.show(this.T);
  }

  draw() {
    const { vertices, faces } = this.solid,
      geometry = new THREE.BufferGeometry();
    geometry.setAttribute(
      "position",
      new THREE.BufferAttribute(
        new Float32Array(faces.flatMap((face) => face.flatMap((i) => vertices[i]))),
        3,
      ),
    );
    geometry.computeVertexNormals();
    const look = { color: 0x4477aa, transparent: true, opacity: 0.72, side: THREE.DoubleSide };
    const edges = new THREE.LineSegments(
      new THREE.EdgesGeometry(geometry, 20),
      new THREE.LineBasicMaterial({ color: 0x1d3557 }),
    );
    const size = Math.max(...vertices.flat().map(Math.abs), 1e-6);
    this.group = new THREE.Group();
    this.group.matrixAutoUpdate = false;
    this.group.add(
      new THREE.Mesh(geometry, new THREE.MeshLambertMaterial(look)),
      edges,
      this.lab.stage.axes(0.7 * size, 0.012 * size),
    );
    this.lab.stage.viewer.scene.add(this.group);
  }

  // The solid at a pose; it is seen while the panel is open.
  show(T) {
    this.T = T;
    const { stage } = this.lab;
    if (this.visible && this.solid && !this.group) this.draw();
    if (!this.group) return;
    this.group.visible = Boolean(this.visible);
    this.group.matrix.set(...T);
    this.group.matrixWorldNeedsUpdate = true;
    this.labels.show(Boolean(this.visible));
    stage.dirty();
  }

  place(vertex) {
    const [x, y, z] = this.solid.vertices[vertex],
      { T } = this;
    return this.lab.stage.project(
      new THREE.Vector3(
        T[0] * x + T[1] * y + T[2] * z + T[3],
        T[4] * x + T[5] * y + T[6] * z + T[7],
        T[8] * x + T[9] * y + T[10] * z + T[11],
      ),
    );
  }

  hideArm() {
    for (const node of this.lab.stage.nodes) node.visible = !(this.hide.checked && this.visible);
    this.lab.stage.dirty();
  }

  shown(visible) {
    this.visible = visible;
    if (!visible) this.stop();
    this.show(this.T);
    this.hideArm();
  }

  change(edit) {
    edit();
    this.stop();
    this.build();
  }

  build() {
    const choose = (step, name, label, options) => {
      const list = h(
        "select",
        { "aria-label": label, onchange: () => this.change(() => (step[name] = list.value)) },
        options.map(([value, text]) =>
          h("option", { value, selected: step[name] === value }, text),
        ),
      );
      return list;
    };
    this.list.replaceChildren(
      ...this.steps.map((step, k) => {
        const amount = h("input", {
          type: "text",
          class: "number",
          autocomplete: "off",
          "aria-label": `amount of step ${k + 1}`,
          onchange: () => this.change(() => (step.amount = amount.value)),
        });
        amount.value = step.amount;
        return h(
          "li",
          {},
          h(
            "div",
            { class: "line" },
            choose(step, "kind", `kind of step ${k + 1}`, [
              ["turn", "turn about"],
              ["move", "move along"],
            ]),
            choose(step, "axis", `axis of step ${k + 1}`, [
              ["x", "x"],
              ["y", "y"],
              ["z", "z"],
            ]),
            "by",
            amount,
            choose(step, "about", `axes of step ${k + 1}`, [
              ["current", "current axes"],
              ["fixed", "fixed axes"],
            ]),
            h(
              "button",
              {
                class: "quiet",
                "aria-label": `Remove step ${k + 1}`,
                onclick: () => this.change(() => this.steps.splice(k, 1)),
              },
              "×",
            ),
          ),
        );
      }),
    );
    this.apply.disabled = !this.steps.length;
  }

  stop() {
    this.running?.();
    this.running = null;
  }

  // Python says where each step leads; between, the solid goes along the step's own way.
  async run() {
    const found = await this.lab.ask("transforms.apply", { steps: this.steps });
    this.list
      .querySelectorAll("input")
      .forEach((input, k) =>
        input.setAttribute(
          "aria-invalid",
          String(!found && this.lab.message.textContent.startsWith(`step ${k + 1}:`)),
        ),
      );
    if (!found) return;
    this.note.textContent = found.note ?? "";
    this.lab.message.hidden = true;
    this.stop();
    let stopped = false;
    this.running = () => (stopped = true);
    const items = found.steps.map(({ formulas, T }, k) =>
      h("li", {}, ...formulas.map((text) => formula(text)), matrix(T, indexed("T", k + 1))),
    );
    this.result.replaceChildren(h("ol", {}, items), this.table(found.vertices));
    const start = performance.now(),
      { steps } = this;
    const tick = (now) => {
      if (stopped) return;
      const at = Math.min(Math.max(0, now - start) / STEP_TIME, found.steps.length),
        k = Math.min(found.steps.length - 1, Math.floor(at));
      items.forEach((item, j) => item.classList.toggle("now", j === k && at < found.steps.length));
      const before = k ? found.steps[k - 1].T : IDENTITY,
        { kind, axis, about } = steps[k],
        way = (at - k) * found.steps[k].amount;
      const E = (kind === "turn" ? rotation : translation)("xyz".indexOf(axis), way);
      this.show(
        at >= found.steps.length
          ? found.steps[k].T
          : about === "current"
            ? multiply(before, E)
            : multiply(E, before),
      );
      if (at < found.steps.length) requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  table(vertices) {
    const before = this.solid.vertices.slice(0, vertices.length);
    const cells = (point) => point.map((x) => h("td", {}, fixed(x, 3)));
    const rows = vertices.map((point, k) =>
      h("tr", {}, h("th", { scope: "row" }, String(k + 1)), cells(before[k]), cells(point)),
    );
    return h(
      "div",
      { class: "wide" },
      h(
        "table",
        { class: "numbers points" },
        h(
          "thead",
          {},
          h(
            "tr",
            {},
            h("th", { scope: "col", rowSpan: 2 }, "vertex"),
            ["before [m]", "after [m]"].map((title) =>
              h("th", { scope: "colgroup", colSpan: 3 }, title),
            ),
          ),
          h(
            "tr",
            {},
            ["x", "y", "z", "x", "y", "z"].map((axis) => h("th", { scope: "col" }, axis)),
          ),
        ),
        h("tbody", {}, rows),
      ),
    );
  }
}
