// Dynamics of the state on show: torques as bars (of gravity, of a motion, or of a running controller), the mass matrix, the
// ellipsoid of the tool's velocities.

import { fixed, h } from "./dom.js";
import { FollowingPanel } from "./following.js";
import { formula } from "./formula.js";

const FACTS = ["half axes [m/s]", "manipulability", "condition number"];
const COLUMN = 58; // px, widest of the mass matrix
// Digits of the mass matrix, by the number of joints from which on they are so few: the matrix fits the panel.
const DIGITS = [
  [8, 2],
  [7, 3],
  [0, 4],
];

export class DynamicsPanel extends FollowingPanel {
  constructor(lab, root) {
    super(lab, "dynamics.read");
    this.note = h("p", { class: "note", role: "status" });
    this.bars = h("div", { class: "bars" });
    this.heading = h("h2", {}, "Gravity torques");
    this.key = h("span", { class: "key", hidden: true }, h("b"), "limit");
    this.inertia = h("h2", {}, "Mass matrix");
    this.torques = null; // of a controller or a motion, by joint; gravity's where there are none
    this.matrix = h("div", { class: "wide" });
    this.ellipsoid = h(
      "button",
      {
        "aria-pressed": "false",
        onclick: () =>
          lab.ask("dynamics.ellipsoid", {
            on: this.ellipsoid.getAttribute("aria-pressed") !== "true",
          }),
      },
      "Velocity ellipsoid",
    );
    this.facts = FACTS.map(() => h("td"));
    this.entry = h("div", { class: "wide entry", "aria-live": "polite" });
    root.append(
      this.note,
      h("div", { class: "line" }, this.heading, this.key),
      this.bars,
      this.inertia,
      this.matrix,
      h("p", { class: "hint" }, "An entry, or the name of a torque, shows its formula."),
      this.entry,
      h("h2", {}, "Manipulability"),
      h("div", { class: "buttons" }, this.ellipsoid),
      h(
        "table",
        { class: "facts" },
        h(
          "tbody",
          {},
          FACTS.map((name, k) => h("tr", {}, h("th", { scope: "row" }, name), this.facts[k])),
        ),
      ),
      h(
        "p",
        { class: "hint" },
        "The ellipsoid has the velocities that the tool reaches with joint rates of norm 1.",
      ),
    );
  }

  take_arm(arm) {
    this.note.textContent = arm.bodies
      ? arm.assumed_bodies
        ? "the links' masses are assumed: uniform rods"
        : ""
      : "this arm has no masses: assume uniform links in Control";
    this.built = null;
    super.take_arm(arm);
  }

  take_dynamics({ ellipsoid }) {
    this.ellipsoid.setAttribute("aria-pressed", String(ellipsoid));
  }

  moved(q, time) {
    const { motion } = this.lab.state,
      tau = q && motion?.tau;
    this.torques = tau
      ? {
          title: "Torques of the motion",
          tau: tau[Math.round((time / motion.duration) * (tau.length - 1))],
        }
      : null;
    super.moved(q);
  }

  // Joints that a run has locked have no torque of a controller.
  samples({ columns, rows }) {
    if (!this.visible || !this.running || !rows.length) return;
    const last = rows.subarray(rows.length - columns.length),
      tau = new Array(this.arm.n).fill(0);
    columns.forEach(
      (name, k) => name.startsWith("tau") && (tau[Number(name.slice(3)) - 1] = last[k]),
    );
    this.torques = { title: "Torques of the controller", tau, controlled: true };
  }

  // Rows may arrive after the state that says the run has ended, and an arm that stays where it is asks for no new numbers.
  take_control({ running }) {
    this.running = running;
    if (running || !this.torques?.controlled) return;
    this.torques = null;
    this.read();
  }

  show({ M, g, effort, lengths, manipulability, condition }) {
    const { joints } = this.arm;
    if (this.built !== this.arm) this.build(Boolean(M));
    const tau = this.torques?.tau ?? g ?? [],
      largest = Math.max(1e-9, ...tau.map(Math.abs));
    this.heading.textContent = this.torques?.title ?? "Gravity torques";
    let limits = false;
    this.rows.forEach(({ bar, marks, value }, i) => {
      const limit = effort[i],
        share = Math.min(1, Math.abs(tau[i]) / largest),
        unit = joints[i].unit === "m" ? "N" : "N m";
      bar.style.width = `${50 * share}%`;
      bar.style.left = tau[i] < 0 ? `${50 - 50 * share}%` : "50%";
      bar.classList.toggle("over", limit !== null && Math.abs(tau[i]) > limit);
      value.textContent = `${fixed(tau[i], 2)} ${unit}`;
      // A limit is a mark on both sides where the scale of the bars, the largest torque, reaches it.
      const place = limit === null ? Infinity : limit / largest;
      marks.forEach((mark, side) => {
        mark.hidden = place > 1;
        mark.style.left = `${50 + (side ? 50 : -50) * place}%`;
      });
      limits ||= place <= 1;
      value.title =
        limit === null ? "" : `${fixed((100 * Math.abs(tau[i])) / limit, 0)} % of the limit`;
    });
    this.key.hidden = !limits;
    const [, digits] = DIGITS.find(([least]) => joints.length >= least);
    if (M)
      this.cells.forEach((row, i) =>
        row.forEach((cell, j) => {
          const text = fixed(M[i][j], digits);
          cell.textContent = text;
          cell.classList.toggle("small", Number(text) === 0);
        }),
      );
    const axes = lengths
      .filter((x) => x !== null)
      .map((x) => fixed(x, 3))
      .join(", ");
    const facts = [
      axes,
      manipulability.toPrecision(3),
      condition === null ? "infinite: singular" : condition.toPrecision(3),
    ];
    facts.forEach((text, k) => (this.facts[k].textContent = text));
  }

  build(bodies) {
    const { arm } = this,
      ask = (name) => () => this.lab.ask("dynamics.entry", { name });
    this.built = arm;
    const slides = arm.joints.map((joint) => joint.unit === "m");
    this.inertia.textContent = `Mass matrix [${slides.every(Boolean) ? "kg" : slides.some(Boolean) ? "kg m², kg m, kg" : "kg m²"}]`;
    this.rows = bodies
      ? arm.joints.map(() => ({
          bar: h("i"),
          marks: [h("b"), h("b")],
          value: h("span", { class: "value" }),
        }))
      : [];
    this.bars.replaceChildren(
      ...this.rows.map(({ bar, marks, value }, i) =>
        h(
          "div",
          { class: "bar" },
          h(
            "button",
            {
              class: "quiet",
              title: `${arm.joints[i].name}: formula of g${i + 1}`,
              onclick: ask(`g${i + 1}`),
            },
            arm.joints[i].name,
          ),
          h("span", { class: "track" }, bar, marks),
          value,
        ),
      ),
    );
    this.cells = bodies
      ? arm.joints.map((_, i) =>
          arm.joints.map((_, j) =>
            h("button", {
              class: "quiet",
              title: `formula of M${i + 1}${j + 1}`,
              "aria-label": `M${i + 1}${j + 1}`,
              onclick: ask(`M${i + 1}${j + 1}`),
            }),
          ),
        )
      : [];
    this.matrix.replaceChildren(
      h(
        "table",
        { class: "numbers dense", style: `max-width:${COLUMN * arm.n}px` },
        h(
          "tbody",
          {},
          this.cells.map((row) =>
            h(
              "tr",
              {},
              row.map((cell) => h("td", {}, cell)),
            ),
          ),
        ),
      ),
    );
  }

  take_entry(entry) {
    if (!entry) return this.entry.replaceChildren();
    if (entry.deriving)
      return this.entry.replaceChildren(h("p", { class: "hint" }, `deriving ${entry.name} …`));
    this.entry.replaceChildren(
      ...(entry.error
        ? [h("p", { class: "bad" }, entry.error)]
        : entry.lines.map((line) => formula(line) ?? "")),
    );
  }
}
