// What the tool reaches, as points or a slice, and how far it is from the boundary.

import { UNITS, fixed, h } from "./dom.js";
import { FollowingPanel } from "./following.js";

const KINDS = [
  ["none", "nothing"],
  ["points", "points the tool reaches"],
  ["slice", "slice through axis 1 and tool"],
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
      { onclick: () => lab.ask("workspace.show", { kind: this.kind.value }) },
      "Draw again",
    );
    this.note = h("p", { class: "note", role: "status" });
    this.heat = h("div", { class: "heat", hidden: true });
    this.distance = h("p", { class: "distance" });
    this.hint = h(
      "p",
      { class: "hint" },
      "The boundary ignores the limits of revolute joints; the points keep all limits.",
    );
    root.append(
      h("label", { class: "line choice" }, "Show", this.kind),
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
          : [`${count.toLocaleString("en")} points`, about].filter(Boolean).join("; "));
  }

  show(numbers) {
    this.numbers = numbers;
    const { distance, boundary, point } = numbers;
    const { scale, digits, sign } = UNITS[this.lab.units.length];
    this.distance.replaceChildren(
      ...(distance === null
        ? ["not known in closed form for this arm: the points show it"]
        : [
            h("b", {}, `${fixed(scale * distance, digits)}${sign}`),
            ` from the ${point} to the ${boundary} boundary`,
          ]),
    );
  }

  unitsChanged() {
    if (this.numbers) this.show(this.numbers);
  }
}
