// A slider for the freedom that an arm of seven joints has left, over the values that reach the target.

import { UNITS, fixed, h } from "./dom.js";

const STILL = 250; // ms for which a target must not move before its feasible values are asked for

export class Redundancy {
  constructor(lab) {
    this.lab = lab;
    this.slider = h("input", {
      type: "range",
      step: "any",
      "aria-label": "Redundancy",
      oninput: () => lab.ask("tool.redundancy", { value: Number(this.slider.value) }),
    });
    this.name = h("span", { class: "name" });
    this.value = h("span", { class: "value" });
    this.band = h("div", { class: "feasible", "aria-hidden": "true" });
    this.root = h(
      "div",
      { class: "joint spare", hidden: true },
      this.name,
      this.value,
      this.slider,
      this.band,
    );
  }

  show(redundancy) {
    this.root.hidden = !redundancy;
    if (!redundancy) return;
    const angle = UNITS[this.lab.units.angle];
    this.slider.min = String(redundancy.lower);
    this.slider.max = String(redundancy.upper);
    this.slider.setAttribute("aria-label", redundancy.name);
    if (document.activeElement !== this.slider) this.slider.value = String(redundancy.value);
    this.name.textContent = redundancy.name;
    this.value.textContent = `${fixed(redundancy.value * angle.scale, angle.digits)} ${angle.sign.trim()}`;
    this.feasible(redundancy);
  }

  feasible(redundancy) {
    const key = JSON.stringify(this.lab.state.target.T);
    if (this.shownAt === key) return;
    this.band.style.background = "none";
    clearTimeout(this.waiting);
    this.waiting = setTimeout(async () => {
      const answer = await this.lab.ask("tool.intervals");
      if (!answer?.intervals || JSON.stringify(this.lab.state.target?.T) !== key) return;
      this.shownAt = key;
      this.band.style.background = bands(answer.intervals, redundancy);
    }, STILL);
  }
}

// The gradient that paints intervals of a range, in rad.
function bands(intervals, { lower, upper }) {
  const share = (x) => `${(100 * (x - lower)) / (upper - lower)}%`;
  const stops = intervals.flatMap(([begin, end]) => [
    `transparent ${share(begin)}`,
    `var(--accent) ${share(begin)}`,
    `var(--accent) ${share(end)}`,
    `transparent ${share(end)}`,
  ]);
  return stops.length ? `linear-gradient(to right, ${stops.join(", ")})` : "none";
}
