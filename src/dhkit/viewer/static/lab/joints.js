// Sliders and numbers of the joints, with their limits.

import { UNITS, beyond, fixed, h, onTyped, touches, touchingText, typed } from "./dom.js";

const FREE = { rad: Math.PI, m: 1 }; // what a slider spans on either side where a joint has no limit
const ANSWER = 1000; // ms in which the state that follows from a step is expected
const KEYS = { plain: 1, shift: 10, alt: 0.1 }; // arrow keys: degrees or mm

export class JointPanel {
  constructor(lab, root) {
    this.lab = lab;
    this.root = root;
    this.rows = [];
    this.list = h("div", { class: "joints" });
    this.named = h("div", { class: "buttons", role: "group", "aria-label": "Configurations" });
    this.note = h("p", { class: "note bad", role: "status" });
    root.append(
      this.named,
      this.list,
      this.note,
      h(
        "p",
        { class: "hint" },
        "Arrow keys move a slider by 1°, with Shift by 10°, with Alt by 0.1° (slides: mm).",
      ),
    );
  }

  take_arm(arm) {
    this.arm = arm;
    this.named.replaceChildren(
      ...arm.configurations.map((name) => h("button", { onclick: () => this.go(name) }, name)),
    );
    this.rows = arm.joints.map((joint, i) => this.row(joint, i));
    this.list.replaceChildren(...this.rows.map((row) => row.root));
    this.q = new Array(arm.n).fill(0);
  }

  row(joint, i) {
    const lower = joint.lower ?? -FREE[joint.unit],
      upper = joint.upper ?? FREE[joint.unit];
    const slider = h("input", {
      type: "range",
      min: String(lower),
      max: String(upper),
      step: "any",
      value: "0",
      "aria-label": joint.name,
    });
    const number = h("input", {
      type: "text",
      inputmode: "decimal",
      autocomplete: "off",
      "aria-label": `${joint.name}, value`,
      class: "number",
    });
    const unit = h("span", { class: "unit" });
    const low = h("span"),
      high = h("span");
    slider.addEventListener("input", () => this.slide(i, Number(slider.value)));
    slider.addEventListener("keydown", (event) => this.key(event, i));
    onTyped(
      number,
      (text) => {
        const value = typed(text);
        if (value === null) {
          this.lab.complain(`${joint.name}: found ${text.slice(0, 40)}; expected a number`);
          return this.show();
        }
        const { scale } = this.unit(i);
        this.rows[i].typed = { text: String(value), value: value / scale, scale };
        this.set(i, value / scale);
      },
      () => this.show(),
    );
    number.addEventListener("keydown", (event) => {
      if (event.key !== "ArrowUp" && event.key !== "ArrowDown") return;
      this.key(event, i);
      number.value = this.text(i);
    });
    const root = h(
      "div",
      { class: "joint" },
      h("span", { class: "name", title: joint.name }, joint.name),
      h("span", { class: "value" }, number, unit),
      slider,
      h("span", { class: "limits" }, low, high),
    );
    return { root, slider, number, unit, low, high, lower, upper, joint };
  }

  unit(i) {
    return UNITS[this.arm.joints[i].unit === "m" ? this.lab.units.length : this.lab.units.angle];
  }

  key(event, i) {
    const direction = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (!direction) return;
    event.preventDefault();
    event.stopPropagation();
    const size = event.altKey ? KEYS.alt : event.shiftKey ? KEYS.shift : KEYS.plain;
    this.set(
      i,
      this.q[i] + direction * size * (this.arm.joints[i].unit === "m" ? 1e-3 : Math.PI / 180),
    );
  }

  // Joints that a simulation has locked cannot be moved.
  take_control({ running, planar }) {
    this.rows.forEach(
      (row, i) =>
        (row.slider.disabled = row.number.disabled = running && planar && i !== 1 && i !== 2),
    );
  }

  go(name) {
    for (const row of this.rows) row.sent = null;
    this.lab.ask("joints.named", { name });
  }

  // What is shown is what is sent: a slider moves by the last digit on show.
  slide(i, value) {
    const { scale, digits } = this.unit(i);
    this.set(i, Number(fixed(value * scale, digits)) / scale);
  }

  set(i, value) {
    this.q = this.q.slice();
    this.q[i] = value;
    this.rows[i].sent = { value, time: performance.now() };
    clearTimeout(this.answer);
    this.answer = setTimeout(() => this.take_joints(this.lab.state.joints), ANSWER);
    this.show();
    this.lab.ask("joints.set", { q: this.q, joint: i });
  }

  take_joints({ q, outside, nearest }) {
    if (!this.arm || q.length !== this.arm.n) return;
    if (this.lab.page.player.active) return; // an animation is on show
    this.outside = new Set(outside);
    this.lab.warn(outside, touches(nearest) ? nearest : null);
    this.note.textContent = touchingText(nearest);
    this.q = q.map((x, i) => this.unanswered(i, x));
    this.show();
  }

  // A state that was sent before Python knew of a step must not undo it: the next step would begin there.
  unanswered(i, told) {
    const row = this.rows[i],
      { sent } = row;
    const dragged = row.slider === document.activeElement && row.slider.matches(":active");
    if (sent && sent.value !== told && (dragged || performance.now() < sent.time + ANSWER))
      return sent.value;
    if (!dragged) row.sent = null;
    return told;
  }

  // An animation shows these values; null: it is over.
  moved(q) {
    if (!this.arm) return;
    if (!q) return this.lab.state.joints && this.take_joints(this.lab.state.joints);
    this.q = [...q];
    this.outside = new Set(
      this.q.flatMap((x, i) =>
        beyond(x, this.arm.joints[i].lower, this.arm.joints[i].upper) ? [i] : [],
      ),
    );
    this.note.textContent = "";
    if (!this.root.hidden) this.show();
  }

  // A value with the digits of its unit, or as it was typed.
  text(i) {
    const { scale, digits } = this.unit(i),
      { typed: exact } = this.rows[i];
    return exact && exact.value === this.q[i] && exact.scale === scale
      ? exact.text
      : fixed(this.q[i] * scale, digits);
  }

  shown(visible) {
    if (visible && this.arm) this.show();
  }

  show() {
    this.rows.forEach((row, i) => {
      const { scale, digits, sign } = this.unit(i),
        text = this.text(i);
      if (document.activeElement !== row.number) row.number.value = text;
      if (Number(row.slider.value) !== this.q[i]) row.slider.value = String(this.q[i]);
      row.slider.setAttribute("aria-valuetext", `${text}${sign}`);
      row.unit.textContent = sign.trim();
      row.low.textContent =
        row.joint.lower === null ? "no limit" : fixed(row.lower * scale, Math.min(digits, 2));
      row.high.textContent =
        row.joint.upper === null ? "" : fixed(row.upper * scale, Math.min(digits, 2));
      row.root.classList.toggle("outside", Boolean(this.outside?.has(i)));
    });
  }

  unitsChanged() {
    if (this.arm) this.show();
  }
}
