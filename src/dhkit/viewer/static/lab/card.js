// The state on show, in numbers over the scene: joints between their limits, the tool's pose, and what is wrong with it.
// In another corner of the scene the axes of the world, and the distance between the lines of the grid.

import { AXES as COLORS } from "../colors.js";
import { THREE } from "../stage.js";
import { euler } from "../offline/kinematics.js";
import { UNITS, beyond, fixed, h, touchingText } from "./dom.js";
import { remember, remembered } from "./memory.js";

const AXES = ["x", "y", "z"];
const WIDE = 1100; // px of a page that has room for the card
const ARM = 24; // px from the origin of the drawn axes to the end of each
const BEYOND = 7; // px from there to its name
const PRIMES = ["", "\u2032", "\u2033"]; // of axes that have moved once and twice

export class StatusCard {
  constructor(lab) {
    this.lab = lab;
    this.title = h("span", { class: "title" }, "State");
    this.alarm = h("span", { class: "alarm", hidden: true });
    this.joints = h("tbody");
    this.position = AXES.map(() => h("output"));
    this.angles = AXES.map(() => h("output"));
    this.axes = AXES.map(() => h("span"));
    const cell = (k) => [h("span", {}, AXES[k]), this.position[k], this.axes[k], this.angles[k]];
    this.remarks = h("ul", { class: "remarks", role: "status" });
    this.root = h(
      "details",
      {
        id: "card",
        open: remembered("card", innerWidth > WIDE ? "open" : "") === "open",
        "aria-label": "State of the arm",
        "data-room": WIDE,
      },
      h("summary", {}, this.title, this.alarm),
      h("table", {}, h("caption", {}, "Joints"), this.joints),
      h("h2", {}, "Tool"),
      h(
        "div",
        { class: "tool" },
        AXES.map((_, k) => cell(k)),
      ),
      this.remarks,
      h(
        "div",
        { class: "units" },
        this.unitChoice("angle", ["deg", "rad"], "Unit of angles"),
        this.unitChoice("length", ["m", "mm", "in"], "Unit of lengths"),
      ),
    );
    this.root.addEventListener("toggle", () => {
      remember("card", this.root.open ? "open" : "");
      lab.stage.refit();
    });
    this.outside = [];
    this.contact = null;
  }

  unitChoice(name, units, label) {
    const buttons = units.map((unit) =>
      h(
        "button",
        {
          "aria-pressed": String(this.lab.units[name] === unit),
          onclick: () => this.lab.setUnits({ [name]: unit }),
        },
        unit === "deg" ? "°" : unit,
      ),
    );
    (this.choices ??= []).push({ name, units, buttons });
    return h("div", { role: "group", "aria-label": label }, buttons);
  }

  take_arm(arm) {
    this.arm = arm;
    this.title.textContent = arm.name;
    this.rows = arm.joints.map((joint) => {
      const mark = h("i"),
        value = h("td", { class: "value" });
      const bar = h(
        "span",
        { class: joint.lower === null || joint.upper === null ? "bar endless" : "bar" },
        mark,
      );
      const row = h(
        "tr",
        {},
        h("th", { scope: "row", title: joint.name }, joint.name),
        h("td", {}, bar),
        value,
      );
      return { row, mark, value };
    });
    this.joints.replaceChildren(...this.rows.map(({ row }) => row));
    this.warn([], null);
    // The first pose comes before the panels are loaded.
    const { motion, player } = this.lab.page;
    if (motion && !player.active) this.show(motion.q, motion.positions, motion.quaternions);
  }

  // What every panel shows of a state: joint values, and the poses of all nodes, of which the tool's is the last.
  show(q, positions, quaternions) {
    if (!this.arm || q.length !== this.arm.n) return;
    this.state = {
      q: [...q],
      position: [...positions.slice(-3)],
      quaternion: [...quaternions.slice(-4)],
    };
    this.write();
  }

  write() {
    if (!this.state || !this.root.open) return;
    const { q, position, quaternion } = this.state,
      { units } = this.lab;
    this.arm.joints.forEach((joint, i) => {
      const { row, mark, value } = this.rows[i],
        { scale, digits, sign } = UNITS[joint.unit === "m" ? units.length : units.angle];
      const free = joint.unit === "m" ? this.arm.reach || 1 : Math.PI,
        low = joint.lower ?? -free,
        high = joint.upper ?? free;
      text(value, `${fixed(q[i] * scale, Math.max(digits - 1, 0))}${sign}`);
      mark.style.left = `${100 * Math.min(1, Math.max(0, (q[i] - low) / (high - low || 1)))}%`;
      row.classList.toggle("outside", beyond(q[i], joint.lower, joint.upper));
    });
    const order = this.lab.state.tool?.order ?? "XYZ",
      pose = new THREE.Matrix4().compose(
        new THREE.Vector3(...position),
        new THREE.Quaternion(...quaternion),
        new THREE.Vector3(1, 1, 1),
      );
    const T = pose.transpose().toArray(),
      angles = euler(T, order);
    const length = UNITS[units.length],
      angle = UNITS[units.angle];
    AXES.forEach((_, k) => {
      text(this.position[k], `${fixed(position[k] * length.scale, length.digits)}${length.sign}`);
      text(this.axes[k], axisName(order, k));
      text(this.angles[k], `${fixed(angles[k] * angle.scale, angle.digits)}${angle.sign}`);
    });
  }

  // joints: those beyond a limit, from 0; contact: two links that touch each other, or null.
  warn(joints, contact) {
    this.outside = joints;
    this.contact = contact;
    this.remark();
  }

  take_tool() {
    this.write();
    this.remark();
  }

  take_control(control) {
    this.control = control;
    this.remark();
  }

  remark() {
    if (!this.arm) return;
    const { player } = this.lab.page,
      { tool } = this.lab.state,
      { control } = this;
    const wrong = this.outside.map((i) => `${this.arm.joints[i].name} is beyond a limit`);
    if (this.contact) wrong.push(touchingText(this.contact));
    if (!player.active && tool?.singular) wrong.push("singular configuration");
    const running = control?.running
      ? `simulated at ${fixed(Math.min(control.speed, 1) * 100, 0)} % of real time`
      : null;
    const key = `${wrong.join("|")}|${running}`;
    if (key === this.remarked) return;
    this.remarked = key;
    this.remarks.replaceChildren(
      ...wrong.map((words) => h("li", { class: "bad" }, words)),
      ...(running ? [h("li", {}, running)] : []),
    );
    this.alarm.hidden = !wrong.length;
    this.alarm.textContent = this.alarm.title = wrong[0] ?? "";
  }

  unitsChanged() {
    for (const { name, units, buttons } of this.choices)
      buttons.forEach((button, k) =>
        button.setAttribute("aria-pressed", String(this.lab.units[name] === units[k])),
      );
    this.write();
  }
}

// The axis of the k-th Euler angle: about x, y\u2032, z\u2033 for axes that move, about x, y, z for fixed ones.
export function axisName(order, k) {
  const moving = order === order.toUpperCase();
  return `about ${order[k].toLowerCase()}${moving ? PRIMES[k] : ""}`;
}

function text(element, words) {
  if (element.textContent !== words) element.textContent = words;
}

// The axes of the world as the camera sees them, and the distance between the lines of the grid.
export class WorldAxes {
  constructor(lab) {
    this.lab = lab;
    this.axes = AXES.map((name, k) =>
      h("span", { style: `color:${COLORS[k]}` }, h("i"), h("b", {}, name)),
    );
    this.caption = h("small");
    this.root = h("div", { id: "world" }, this.axes, this.caption);
    lab.stage.rendered.push(() => this.draw());
  }

  draw() {
    const { stage } = this.lab;
    if (stage.grid.geometry !== this.grid) this.unitsChanged();
    stage.axesInView().forEach(({ x, y, z }, k) => {
      const [line, name] = this.axes[k].children;
      const length = Math.hypot(x, y);
      const to = ARM + BEYOND / Math.max(length, 1e-6);
      line.style.transform = `rotate(${Math.atan2(-y, x)}rad) scaleX(${length})`;
      name.style.transform = `translate(${to * x}px, ${-to * y}px)`;
      this.axes[k].style.zIndex = Math.round(9 * z);
    });
  }

  unitsChanged() {
    const { scale, sign } = UNITS[this.lab.units.length];
    const { stage } = this.lab;
    if (!stage.grid) return;
    this.grid = stage.grid.geometry;
    this.caption.textContent = `grid ${Number((stage.gridStep() * scale).toPrecision(3))}${sign}`;
  }
}
