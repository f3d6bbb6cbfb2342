// A motion from a file of this computer; of a .mat file whose names say nothing, its columns are chosen.

import { base64Of, h } from "./dom.js";

const LARGEST = 500000; // bytes

export class MotionFile {
  constructor(lab) {
    this.lab = lab;
    this.input = h("input", {
      type: "file",
      accept: ".csv,.mat,.npz,.yaml,.yml",
      "aria-label": "File with a motion",
      onchange: () => this.read(),
    });
    this.degrees = h("input", { type: "checkbox" });
    this.times = h("select", { "aria-label": "Times" });
    this.values = h("select", { "aria-label": "Joint values" });
    this.rates = h("select", { "aria-label": "Rates" });
    this.chooser = h(
      "div",
      { class: "settings", hidden: true },
      h("label", {}, "times ", this.times),
      h("label", {}, "joint values ", this.values),
      h("label", {}, "rates ", this.rates),
      h("button", { onclick: () => this.readChosen() }, "Read these"),
    );
    this.root = h(
      "fieldset",
      {},
      h("legend", {}, "From a file"),
      h("label", { class: "line" }, this.input),
      h("label", { class: "line" }, this.degrees, " angles in degrees"),
      this.chooser,
    );
  }

  async read() {
    const [file] = this.input.files;
    if (!file) return;
    this.chooser.hidden = true;
    if (file.size > LARGEST) {
      this.input.value = "";
      this.lab.complain(`${file.name} has ${file.size} bytes; expected at most ${LARGEST}`);
      return;
    }
    this.file = { name: file.name, content: await base64Of(file) };
    const answer = await this.ask(null);
    if (answer === null && file.name.toLowerCase().endsWith(".mat")) await this.offer();
    this.input.value = "";
  }

  ask(columns) {
    return this.lab.ask("motion.file", { ...this.file, degrees: this.degrees.checked, columns });
  }

  // What was complained of stays on show: it says why there is something to choose.
  async offer() {
    const choices = await this.lab.requests.ask("motion.columns", this.file);
    if (!choices?.t.length || !choices.q.length) return;
    const options = (names) => names.map((name) => h("option", { value: name }, name));
    this.times.replaceChildren(...options(choices.t));
    this.values.replaceChildren(...options(choices.q));
    this.rates.replaceChildren(h("option", { value: "" }, "none"), ...options(choices.q));
    this.chooser.hidden = false;
  }

  async readChosen() {
    const columns = { t: this.times.value, q: this.values.value };
    if (this.rates.value) columns.qd = this.rates.value;
    if ((await this.ask(columns)) !== null) this.chooser.hidden = true;
  }
}
