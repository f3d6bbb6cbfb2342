// Controllers on the simulated arm in real time, with errors and torques as they come.

import { RunCurves } from "./curves.js";
import { bytes, fixed, h, onTyped, save, typed } from "./dom.js";

const FRICTIONS = [
  ["none", "none"],
  ["smooth", "smooth"],
  ["stiction", "with stiction"],
];
const REFERENCES = [
  ["hold", "holds where it is"],
  ["sine", "sines, all joints"],
  ["motion", "the motion, to and fro"],
  ["target", "the tool's target"],
  ["sliders", "the joint sliders"],
];
const WINDOW = 10; // s that are drawn
const MOST = 36000; // rows that are kept: ten minutes
const ANSWER = 1000; // ms in which the state that follows from a choice is expected
const PLOT_EVERY = 100; // ms

export class ControlPanel {
  constructor(lab, root) {
    this.lab = lab;
    this.chosen = new Map(); // when a list was last changed, ms
    const change = (name, value) => this.lab.ask("control.change", { [name]: value });
    const choice = (name, label, options) => {
      const list = h(
        "select",
        { onchange: () => this.choose(name, list.value) },
        options.map(([value, text]) => h("option", { value }, text)),
      );
      this[name] = list;
      return h("label", {}, h("span", {}, label), list);
    };
    const number = (name, label, unit) => {
      const input = h("input", {
        type: "text",
        inputmode: "decimal",
        class: "number",
        "aria-label": label,
      });
      onTyped(
        input,
        (text) =>
          typed(text) === null
            ? this.lab.complain(`${label}: found ${text.slice(0, 40)}; expected a number`)
            : change(name, typed(text)),
        () => this.show(),
      );
      this[name] = input;
      return h("label", {}, h("span", {}, label), h("span", {}, input, ` ${unit}`));
    };
    this.compensate = h("input", {
      type: "checkbox",
      onchange: () => change("compensate", this.compensate.checked),
    });
    this.start = h("button", { class: "main", onclick: () => this.toggle() }, "Start");
    this.pause = h("button", { onclick: () => lab.ask("control.pause") }, "Pause");
    this.assume = h(
      "button",
      { hidden: true, onclick: () => lab.ask("bodies.assume") },
      "Assume uniform links",
    );
    this.planar = h(
      "button",
      {
        "aria-pressed": "false",
        title: "Joints 2 and 3 move, the others are locked: the two-link arm of many courses",
        onclick: () =>
          lab.ask("arm.planar", { on: this.planar.getAttribute("aria-pressed") !== "true" }),
      },
      "Only joints 2 and 3",
    );
    this.note = h("p", { class: "note", role: "status" });
    this.link = h("select", { "aria-label": "What is pushed" });
    this.force = [0, 1, 2].map((k) =>
      h("input", {
        type: "text",
        inputmode: "decimal",
        class: "number",
        "aria-label": `Force along ${"xyz"[k]}, N`,
        value: k === 2 ? "-50" : "0",
      }),
    );
    this.time = h("input", {
      type: "text",
      inputmode: "decimal",
      class: "number",
      "aria-label": "Duration of the push, s",
      value: "0.2",
    });
    this.pushing = h("button", { onclick: () => this.push() }, "Push");
    this.curves = new RunCurves(lab);
    this.gains = new GainTable(
      (gains) => lab.ask("control.gains", gains),
      (text) => lab.complain(text),
    );
    const download = (format) =>
      h("button", { onclick: () => this.download(format) }, format.toUpperCase());
    root.append(
      h(
        "div",
        { class: "settings" },
        choice("controller", "Controller", []),
        choice("reference", "Follows", REFERENCES),
        number("bandwidth", "Bandwidth", "rad/s"),
        number("damping", "Damping", ""),
        choice("friction", "Friction", FRICTIONS),
        number("payload", "Payload", "kg"),
        h("label", { class: "check" }, this.compensate, "The controller compensates friction"),
      ),
      this.gains.root,
      h(
        "p",
        { class: "hint" },
        "The controller does not know of the payload. The ghost is what it follows.",
      ),
      h("div", { class: "buttons" }, this.start, this.pause, this.planar, this.assume),
      this.note,
      h(
        "fieldset",
        { class: "push" },
        h("legend", {}, "Push"),
        h(
          "div",
          { class: "line" },
          this.link,
          h("label", {}, "for ", this.time, " s"),
          this.pushing,
        ),
        h(
          "div",
          { class: "three" },
          this.force.map((input, k) => h("label", {}, h("span", {}, `${"xyz"[k]} [N]`), input)),
        ),
      ),
      h("div", { class: "buttons" }, "Save:", download("csv"), download("npz")),
    );
    this.rows = [];
    this.columns = [];
  }

  take_arm(arm) {
    this.arm = arm;
    this.link.replaceChildren(
      h("option", { value: "" }, "the tool"),
      ...arm.joints.map((joint, i) => h("option", { value: String(i + 1) }, `link ${i + 1}`)),
    );
    this.assume.hidden = arm.bodies;
    this.planar.hidden = arm.n < 4;
    this.start.disabled = !arm.bodies;
    if (!arm.bodies)
      this.note.textContent =
        "Not every link has a mass: nothing can be simulated until all are assumed to be uniform rods.";
  }

  take_control(control) {
    this.state = control;
    if (!control.running && !control.time) this.forget();
    if (this.controller.options.length !== control.controllers.length)
      this.controller.replaceChildren(
        ...control.controllers.map(({ name, title }) => h("option", { value: name }, title)),
      );
    this.show();
  }

  show() {
    const { state } = this;
    if (!state) return;
    const now = performance.now();
    for (const name of ["controller", "reference", "friction"]) {
      // A state that was sent before Python knew of the choice must not undo it.
      const fresh = now - (this.chosen.get(name) ?? -ANSWER) < ANSWER;
      if (!fresh && this[name].value !== state[name]) this[name].value = state[name];
    }
    for (const name of ["bandwidth", "damping", "payload"])
      if (document.activeElement !== this[name]) this[name].value = String(state[name]);
    this.compensate.checked = state.compensate;
    this.gains.show(state.gains, this.arm?.joints ?? []);
    this.start.textContent = state.running ? "Stop" : "Start";
    this.pause.textContent = state.paused ? "Go on" : "Pause";
    this.pause.disabled = this.pushing.disabled = !state.running;
    this.planar.setAttribute("aria-pressed", String(state.planar));
    const time = state.running ? `${fixed(state.time, 1)} s` : null;
    const words = [state.error, time, state.note].filter(Boolean);
    if (this.arm?.bodies) this.note.textContent = words.join("; ");
    this.note.classList.toggle("bad", Boolean(state.error));
  }

  async choose(name, value) {
    this.chosen.set(name, performance.now());
    setTimeout(() => this.show(), ANSWER);
    if ((await this.lab.ask("control.change", { [name]: value })) !== null) return;
    this.chosen.delete(name); // refused
    this.show();
  }

  async toggle() {
    await this.lab.settled();
    this.lab.ask(this.state?.running ? "control.stop" : "control.start");
  }

  push() {
    const force = this.force.map((input) => typed(input.value)),
      duration = typed(this.time.value);
    if (force.some((x) => x === null) || duration === null)
      return this.lab.complain("push: expected numbers, in N and s");
    this.lab.ask("control.push", {
      link: this.link.value === "" ? null : Number(this.link.value),
      force,
      duration,
    });
  }

  async download(format) {
    const answer = await this.lab.ask("control.download", { format });
    if (answer) save(answer.name, bytes(answer.content), "application/octet-stream");
  }

  // There is no run, or Python has begun anew.
  forget() {
    this.rows = [];
    this.columns = [];
    this.curves.clear();
    this.lab.dock.release(this.curves);
  }

  samples({ columns, rows, restart }) {
    if (restart || columns.length !== this.columns.length) {
      this.rows = [];
      this.columns = columns;
      const moved = columns.filter((name) => /^q\d+$/.test(name));
      this.joints = moved.map((name) => this.arm?.joints[Number(name.slice(1)) - 1]);
      this.lab.dock.show(this.curves);
    }
    const width = columns.length;
    for (let i = 0; i < rows.length; i += width) this.rows.push(rows.subarray(i, i + width));
    if (this.rows.length > MOST) this.rows.splice(0, this.rows.length - MOST);
    const now = performance.now();
    if (!this.lab.dock.shows(this.curves) || now - (this.drawn ?? 0) < PLOT_EVERY) return;
    this.drawn = now;
    this.draw();
  }

  draw() {
    if (!this.rows.length || !this.joints?.every(Boolean)) return;
    const end = this.rows[this.rows.length - 1][0];
    let begin = this.rows.length - 1;
    while (begin > 0 && this.rows[begin - 1][0] > end - WINDOW) begin--;
    this.curves.draw(this.rows.slice(begin), this.joints);
  }
}

// Gains of each joint's controller, and the slowest pole that follows.
class GainTable {
  constructor(send, complain) {
    this.send = send;
    this.complain = complain;
    this.rows = [];
    this.body = h("tbody");
    this.title = h("legend");
    this.root = h(
      "fieldset",
      { class: "gains", hidden: true },
      this.title,
      h(
        "table",
        {},
        h(
          "thead",
          {},
          h(
            "tr",
            {},
            ["joint", "Kp", "Ki", "Kd"].map((name) => h("th", { scope: "col" }, name)),
            h("th", { scope: "col", title: "Real part of the slowest pole, 1/s" }, "pole, 1/s"),
          ),
        ),
        this.body,
      ),
    );
  }

  // gains: of Python, with the poles; null where the controller has none.
  show(gains, joints) {
    this.root.hidden = !gains;
    if (!gains || gains.kp.length !== joints.length) return;
    this.gains = gains;
    if (this.rows.length !== joints.length) this.build(joints);
    this.title.textContent = gains.tuned ? "Gains, tuned" : "Gains, your own";
    this.rows.forEach(({ inputs, pole }, i) => {
      for (const [name, input] of Object.entries(inputs))
        if (document.activeElement !== input)
          input.value = String(Number(gains[name][i].toPrecision(4)));
      const real = gains.slowest[i];
      pole.textContent = fixed(real, Math.abs(real) < 1 ? 3 : 1);
      pole.classList.toggle("bad", real >= 0);
    });
  }

  build(joints) {
    this.rows = joints.map((joint, i) => {
      const inputs = Object.fromEntries(
        ["kp", "ki", "kd"].map((name) => {
          const input = h("input", {
            type: "text",
            inputmode: "decimal",
            "aria-label": `${name} of ${joint.name}`,
          });
          onTyped(
            input,
            (text) => this.take(name, i, text),
            () => this.show(this.gains, joints),
          );
          return [name, input];
        }),
      );
      const pole = h("td", { class: "value" });
      const row = h(
        "tr",
        {},
        h("th", { scope: "row", title: joint.name }, breakable(joint.name)),
        Object.values(inputs).map((input) => h("td", {}, input)),
        pole,
      );
      return { row, inputs, pole };
    });
    this.body.replaceChildren(...this.rows.map(({ row }) => row));
  }

  take(name, i, text) {
    const value = typed(text);
    if (value === null)
      return this.complain(`${name}: found ${text.slice(0, 40)}; expected a number`);
    const { kp, ki, kd } = structuredClone(this.gains),
      gains = { kp, ki, kd };
    gains[name][i] = value;
    return this.send(gains);
  }
}

// A long name may go on in the next line behind an underscore.
function breakable(name) {
  return name.replaceAll("_", "_\u200b");
}
