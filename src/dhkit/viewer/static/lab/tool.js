// The tool: its pose in numbers, a target that the arm follows, and the branches that reach it.

import { GHOSTS } from "../colors.js";
import { euler } from "../offline/kinematics.js";
import { DEGREES, UNITS, fixed, h, matrix, onTyped, typed } from "./dom.js";
import { axisName } from "./card.js";
import { Gizmo } from "./gizmo.js";

const AXES = ["x", "y", "z"];
const AWAY = 1e-4; // m
const ORDERS = ["XYZ", "ZYX", "ZYZ", "ZXZ", "xyz", "zyx", "zyz", "zxz"];

export class ToolPanel {
  // Spare: the slider of a freedom that the target leaves, in pages that Python answers.
  constructor(lab, root, Spare = null) {
    this.lab = lab;
    this.fields = [];
    this.gizmo = new Gizmo(
      lab.stage,
      (T) => lab.ask("tool.target", { T }),
      () => this.lab.state.target?.T,
    );
    this.pose = h("div", { class: "pose" });
    this.captions = [];
    const field = (label, k) => {
      const caption = (this.captions[k] = h("span"));
      const input = h("input", {
        type: "text",
        inputmode: "decimal",
        autocomplete: "off",
        class: "number",
        "aria-label": label,
      });
      onTyped(
        input,
        () => this.typed(),
        () => this.show(),
      );
      this.fields[k] = input;
      return h("label", {}, caption, input);
    };
    this.order = h(
      "select",
      {
        "aria-label": "Convention of Euler angles",
        onchange: () => lab.ask("tool.order", { order: this.order.value }),
      },
      ORDERS.map((order) =>
        h(
          "option",
          { value: order },
          order === order.toUpperCase() ? `${order} moving axes` : `${order} fixed axes`,
        ),
      ),
    );
    this.pose.append(
      h(
        "div",
        { class: "three" },
        AXES.map((axis, k) => field(`${axis} of the tool`, k)),
      ),
      h(
        "div",
        { class: "three" },
        ["first", "second", "third"].map((name, k) => field(`${name} Euler angle`, 3 + k)),
      ),
      h("label", { class: "line" }, "Euler angles ", this.order),
    );
    this.matrix = h("details", {}, h("summary", {}, "Matrix"), h("div"));
    this.matrix.addEventListener("toggle", () => this.show());
    this.note = h("p", { class: "note", role: "status" });
    this.grab = h(
      "button",
      { "aria-pressed": "false", onclick: () => this.toggle() },
      "Move the tool by a target",
    );
    this.clear = h(
      "button",
      { hidden: true, onclick: () => lab.ask("tool.clear") },
      "Remove the target",
    );
    this.spare = Spare && new Spare(lab);
    this.branches = h("div", { class: "branches", role: "group", "aria-label": "Branches" });
    this.count = h("h2", { hidden: true });
    this.jog = this.jogs();
    root.append(h("h2", {}, "Pose of the tool"), this.pose, this.matrix);
    if (lab.can("tool.target"))
      root.append(
        h("div", { class: "buttons" }, this.grab, this.clear),
        this.note,
        ...(this.spare ? [this.spare.root] : []),
        this.jog,
        this.count,
        this.branches,
      );
    else root.append(this.note);
    this.matrix.open = !lab.can("tool.target"); // there is room
    for (const input of this.fields) input.readOnly = !lab.can("tool.pose");
  }

  jogs() {
    this.frame = h(
      "select",
      { "aria-label": "Axes of a step" },
      h("option", { value: "world" }, "world axes"),
      h("option", { value: "tool" }, "tool axes"),
    );
    this.step = h(
      "select",
      { "aria-label": "Size of a step" },
      [
        ["1", "1 mm, 1°"],
        ["10", "10 mm, 10°"],
        ["0.1", "0.1 mm, 0.1°"],
      ].map(([value, text]) => h("option", { value, selected: value === "10" }, text)),
    );
    const button = (axis, sign) => {
      const turning = axis > 2;
      const name = `${sign > 0 ? "+" : "\u2212"}${turning ? "r" : ""}${AXES[axis % 3]}`;
      const label = `${turning ? "turn about" : "move along"} ${sign > 0 ? "plus" : "minus"} ${AXES[axis % 3]}`;
      return h("button", { "aria-label": label, onclick: () => this.jogged(axis, sign) }, name);
    };
    const rows = [0, 3].map((first) =>
      h(
        "div",
        { class: "jog" },
        [0, 1, 2].map((k) => [button(first + k, 1), button(first + k, -1)]),
      ),
    );
    return h(
      "fieldset",
      {},
      h("legend", {}, "Step"),
      h("div", { class: "line" }, this.step, this.frame),
      rows,
    );
  }

  async jogged(axis, sign) {
    await this.lab.settled();
    const size = Number(this.step.value) * sign;
    this.lab.ask("tool.jog", {
      axis,
      step: axis > 2 ? size / DEGREES : size / 1000,
      frame: this.frame.value,
    });
  }

  async toggle() {
    await this.lab.settled();
    const { tool } = this.lab.state;
    if (!this.lab.state.target && tool) await this.lab.ask("tool.target", { T: tool.T });
    else this.lab.ask("tool.clear");
  }

  typed() {
    const values = this.fields.map((input) => typed(input.value));
    if (values.some((value) => value === null)) {
      this.lab.complain("pose of the tool: expected numbers");
      return this.show();
    }
    const { length, angle } = this.scales();
    return this.lab.ask("tool.pose", {
      xyz: values.slice(0, 3).map((x) => x / length.scale),
      euler: values.slice(3).map((x) => x / angle.scale),
      order: this.order.value,
    });
  }

  // The units of positions and angles, one digit finer than those of joints.
  scales() {
    return { length: UNITS[this.lab.units.length], angle: UNITS[this.lab.units.angle] };
  }

  unitsChanged() {
    this.show();
  }

  take_tool(tool) {
    if (this.away && tool === this.lab.state.tool) return;
    this.tool = tool;
    this.show();
  }

  shown(visible) {
    this.visible = visible;
    const { player, motion } = this.lab.page;
    if (visible && player.active && motion?.times) this.lab.page.showTime(player.time);
  }

  // An animation shows these joint values; Python has the numbers of the tool there.
  async moved(q) {
    this.away = Boolean(q);
    if (!q) return this.lab.state.tool && this.take_tool(this.lab.state.tool);
    if (!this.visible) return;
    const tool = await this.lab.ask("tool.read", { q: [...q] });
    if (tool && this.away) this.take_tool(tool);
  }

  show() {
    if (!this.tool) return;
    const { T, order, singular } = this.tool,
      target = this.lab.state.target;
    // A target that cannot be reached stays in the fields: whoever types its coordinates one by one goes on from there.
    const missed = target && !target.reached,
      pose = missed ? target.T : T;
    const { xyz, angles } = missed
      ? { xyz: [pose[3], pose[7], pose[11]], angles: euler(pose, order) }
      : { xyz: this.tool.xyz, angles: this.tool.euler };
    const { length, angle } = this.scales();
    [
      ...xyz.map((x) => fixed(x * length.scale, length.digits + 1)),
      ...angles.map((x) => fixed(x * angle.scale, angle.digits + 1)),
    ].forEach((text, k) => {
      if (document.activeElement !== this.fields[k]) this.fields[k].value = text;
    });
    this.captions.forEach((caption, k) => {
      const words =
        k < 3
          ? `${AXES[k]} [${length.sign.trim()}]`
          : `${axisName(order, k - 3)} [${angle.sign.trim()}]`;
      if (caption.textContent !== words) caption.textContent = words;
    });
    if (this.missed !== Boolean(missed))
      for (const input of this.fields) input.setAttribute("aria-invalid", String(Boolean(missed)));
    this.missed = Boolean(missed);
    this.order.value = order;
    if (this.matrix.open || !this.matrix.lastChild.firstChild)
      this.matrix.lastChild.replaceChildren(matrix(T));
    this.singular = singular;
    this.remark();
  }

  remark() {
    const target = this.lab.state.target;
    const { T, unique } = this.tool ?? {},
      far = target?.reached && T && [3, 7, 11].some((k) => Math.abs(T[k] - target.T[k]) > AWAY);
    const about = far ? null : target?.message; // what is said of the target's state is not said of another
    for (const button of this.branches.children) button.classList.toggle("away", Boolean(far));
    const words = [
      far ? "the tool is not at the target: move the target, and it follows" : null,
      unique === false ? "the first and the third angle are not unique here" : null,
      about,
      about ? null : this.singular,
      target?.snapped ? "the target stays where this arm can be" : null,
      target?.numeric ? "no closed form: followed by iteration" : null,
    ];
    this.note.textContent = words.filter(Boolean).join("; ");
    this.note.classList.toggle("bad", Boolean(target && !target.reached));
  }

  take_target(target) {
    this.clear.hidden = !target;
    this.grab.hidden = Boolean(target);
    this.gizmo.set(
      target?.T ?? null,
      target ? target.reached : true,
      this.lab.state.arm?.reach ?? 1,
    );
    const focused = document.activeElement?.dataset?.branch;
    const branches = target?.branches ?? [],
      within = branches.filter((branch) => branch.within).length,
      ghosts = branches.filter((branch) => !branch.chosen);
    this.branches.replaceChildren(
      ...branches.map((branch) =>
        this.branch(branch, branch.chosen ? null : ghosts.indexOf(branch)),
      ),
    );
    this.count.hidden = branches.length < 2;
    this.count.textContent = `${branches.length} solutions, ${within} within the limits`;
    this.name(ghosts);
    this.spare?.show(target?.redundancy);
    if (focused) this.branches.querySelector(`[data-branch="${CSS.escape(focused)}"]`)?.focus();
    this.show();
  }

  // While a simulation runs the only ghost is what it follows.
  name(ghosts) {
    const names = ghosts.map(({ name }, k) => ({ text: name, color: GHOSTS[k % GHOSTS.length] })),
      key = JSON.stringify(names);
    if (this.named === key) return;
    this.named = key;
    this.lab.stage.nameGhosts(names);
  }

  // ghost: its number among the ghosts in the scene, in whose colour it is marked.
  branch(branch, ghost) {
    const joints = this.lab.state.arm?.joints ?? [];
    const values = branch.q
      .map((x, i) => (joints[i]?.unit === "m" ? `${fixed(x, 3)} m` : `${fixed(x * DEGREES, 1)}°`))
      .join("  ");
    const choose = () => this.lab.ask("tool.choose", { branch: branch.name });
    const button = h(
      "button",
      { "aria-pressed": String(branch.chosen), title: values, onclick: choose },
      h(
        "span",
        {},
        h("i", { style: ghost === null ? null : `background:${GHOSTS[ghost % GHOSTS.length]}` }),
        branch.name,
      ),
      branch.within ? null : h("small", {}, "outside limits"),
    );
    button.dataset.branch = branch.name;
    for (const event of ["pointerenter", "focus"])
      button.addEventListener(event, () => this.lab.stage.pointAt(ghost));
    for (const event of ["pointerleave", "blur"])
      button.addEventListener(event, () => this.lab.stage.pointAt(null));
    return button;
  }
}
