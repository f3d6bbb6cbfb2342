// Motions that were saved with the page: what each shows, and its curves.

import { MotionCurves, exceeding } from "../lab/curves.js";
import { fixed, h } from "../lab/dom.js";

export class RecordedPanel {
  constructor(lab, root) {
    this.lab = lab;
    this.list = h("div", { class: "branches", role: "group", "aria-label": "Motions" });
    this.facts = h("p", { class: "facts" });
    this.curves = new MotionCurves(lab);
    root.append(this.list, this.facts);
  }

  take_recorded(motions) {
    this.lab.showTab("recorded", motions.length > 0);
    this.list.replaceChildren(
      ...motions.map((motion, index) =>
        h(
          "button",
          { "aria-pressed": "false", onclick: () => this.play(index) },
          h("span", {}, motion.name),
          h("small", {}, `${fixed(motion.duration, 2)} s`),
        ),
      ),
    );
  }

  play(index) {
    const { player } = this.lab.page;
    if (player.active && this.motion?.index === index) player.toggle();
    else this.lab.ask("motion.play", { index });
  }

  take_motion(motion) {
    this.motion = motion;
    [...this.list.children].forEach((button, k) =>
      button.setAttribute("aria-pressed", String(motion?.index === k)),
    );
    this.facts.textContent = motion
      ? [
          motion.excess,
          motion.step ? `long: drawn by a sample every ${fixed(motion.step, 2)} s` : null,
          motion.reference ? "the grey arm is what was asked for" : null,
        ]
          .filter(Boolean)
          .join("; ")
      : "A motion plays when it is chosen; sliders end it.";
    this.facts.classList.toggle("bad", Boolean(motion?.excess));
    if (!motion) return this.lab.dock.release(this.curves);
    this.curves.draw(motion, this.lab.state.arm.joints);
    this.lab.dock.show(this.curves);
  }

  moved(q, time) {
    if (!q || !this.motion) return;
    this.lab.warn(...exceeding(this.motion, time));
    if (this.lab.dock.shows(this.curves)) this.curves.mark(time);
  }
}
