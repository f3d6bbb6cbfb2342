// What the tool reaches, as points or a slice, and how far it is from the boundary.

import { fixed, h } from "./dom.js";
import { FollowingPanel } from "./following.js";

const KINDS = [
  ["none", "nothing"],
  ["points", "points that the tool reaches"],
  ["slice", "a slice through axis 1 and the tool"],
];

export class WorkspacePanel extends FollowingPanel {
  constructor(lab, root) {
    super(lab, "workspace.read");
    this.kind = h(
      "select",
      {
        "aria-label": "Workspace",
        onchange: () => lab.ask("workspace.show", { kind: this.kind.value }),
      },
      KINDS.map(([value, text]) => h("option", { value }, text)),
    );
    this.again = h(
      "button",
      { type: "button", onclick: () => lab.ask("workspace.show", { kind: this.kind.value }) },
      "Draw again",
    );
    this.note = h("p", { class: "note", role: "status" });
    this.heat = h("div", { class: "heat", hidden: true });
    this.distance = h("p", { class: "distance" });
    this.hint = h(
      "p",
      { class: "hint" },
      "The boundary leaves the limits of revolute joints out; the points keep all limits.",
    );
    root.append(
      h("label", { class: "line" }, "Show ", this.kind),
      h("div", { class: "buttons" }, this.again),
      this.note,
      this.heat,
      h("h2", {}, "Distance from the boundary"),
      this.distance,
      this.hint,
    );
  }

  take_workspace({ kind, count, progress, about, heat, error }) {
    this.heat.hidden = !heat || progress !== null || kind === "none";
    if (heat)
      this.heat.replaceChildren(
        "manipulability 0",
        h("i", { style: `background:linear-gradient(to right, ${heat.colors.join(", ")})` }),
        heat.largest.toPrecision(3),
      );
    this.kind.value = kind;
    this.again.hidden = kind !== "slice";
    this.note.textContent =
      error ??
      (progress
        ? `sampling … ${progress}`
        : kind === "none"
          ? ""
          : [`${count} points`, about].filter(Boolean).join("; "));
  }

  show({ distance, boundary, point }) {
    this.distance.textContent =
      distance === null
        ? "not known in closed form for this arm: the points show it"
        : `${fixed(1000 * distance, 1)} mm from the ${boundary} boundary${point === "tool" ? "" : ` (of the ${point})`}`;
  }
}
