// Motions that were saved with the page: what each shows, and its curves.

import { Curves, exceeding } from "../lab/curves.js";
import { fixed, h } from "../lab/dom.js";

export class RecordedPanel {
  constructor(lab, root) {
    this.lab = lab;
    this.list = h("div", { class: "branches", role: "group", "aria-label": "Motions" });
    this.facts = h("p", { class: "facts" });
    this.curves = new Curves();
    root.append(this.list, this.facts, this.curves.root);
  }

  take_recorded(motions) {
    this.lab.showTab("recorded", motions.length > 0);
    this.list.replaceChildren(...motions.map((motion, index) => h("button", { type: "button", "aria-pressed": "false", onclick: () => this.play(index) }, h("span", {}, motion.name), h("small", {}, `${fixed(motion.duration, 2)} s`))));
  }

  play(index) {
    const { player } = this.lab.page;
    if (player.active && this.motion?.index === index) player.toggle();
    else this.lab.ask("motion.play", { index });
  }

  take_motion(motion) {
    this.motion = motion;
    [...this.list.children].forEach((button, k) => button.setAttribute("aria-pressed", String(motion?.index === k)));
    this.curves.root.hidden = !motion;
    this.facts.textContent = motion ? [motion.excess, motion.step ? `long: drawn by a sample every ${fixed(motion.step, 2)} s` : null, motion.reference ? "the grey arm is what was asked for" : null].filter(Boolean).join("; ") : "A motion plays when it is chosen; sliders end it.";
    this.facts.classList.toggle("bad", Boolean(motion?.excess));
    if (motion) this.curves.draw(motion, this.lab.state.arm.joints);
  }

  moved(q, time) {
    if (!q || !this.motion) return;
    this.lab.stage.warn(...exceeding(this.motion, time));
    if (this.visible) this.curves.mark(time);
  }

  shown(visible) {
    this.visible = visible;
    if (visible && this.motion) requestAnimationFrame(() => this.curves.resize());
  }
}
