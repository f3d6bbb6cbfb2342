// An answer for this robot: how it was read, whether it is right, and what went wrong.

import { h } from "./dom.js";
import { formulaLines } from "./formula.js";

const KINDS = [
  ["lines", "Equations, one a line: M11 = …"],
  ["latex", "LaTeX"],
  ["python", "Python (as text)"],
  ["matlab", "MATLAB (as text)"],
  ["sheet", "Answer sheet (TOML)"],
];
const BORDERS = 26; // px at the left and the right of an answer in the report
const EXAMPLE = "M11 = ...\ng2 = ...";

export class AnswersPanel {
  constructor(lab, root) {
    this.lab = lab;
    this.kind = h(
      "select",
      { "aria-label": "How the answer is written" },
      KINDS.map(([value, text]) => h("option", { value }, text)),
    );
    this.text = h("textarea", {
      rows: 9,
      "aria-label": "Answer",
      placeholder: EXAMPLE,
      spellcheck: "false",
      maxLength: 60000,
    });
    this.send = h(
      "button",
      {
        class: "main",
        onclick: () => lab.ask("answers.grade", { kind: this.kind.value, text: this.text.value }),
      },
      "Judge",
    );
    this.cancel = h("button", { hidden: true, onclick: () => lab.ask("answers.cancel") }, "Cancel");
    this.parameters = h("p", { class: "hint" });
    this.note = h("p", { class: "note", role: "status" });
    this.report = h("div", { class: "report" });
    root.append(
      this.kind,
      this.text,
      this.parameters,
      h("div", { class: "buttons" }, this.send, this.cancel),
      this.note,
      this.report,
    );
  }

  take_arm(arm) {
    const names = arm.parameters ?? [];
    this.text.placeholder = names.length ? EXAMPLE : "M66 = 0.19\ng1 = 0";
    this.parameters.textContent = `M, C, h, g, tau, K, V, L, A1 …, T, J; joints q1 …, rates qd1 …, c12 for cos(q1 + q2)${names.length ? `; this robot's parameters: ${names.join(", ")}` : "; this robot has numbers, no parameters"}.`;
  }

  take_verdict(verdict) {
    this.cancel.hidden = !verdict?.running;
    this.send.disabled = Boolean(verdict?.running);
    this.note.textContent = !verdict ? "" : verdict.running ? "judging …" : (verdict.error ?? "");
    this.note.classList.toggle("bad", Boolean(verdict?.error));
    if (!verdict || verdict.running || verdict.error) return this.report.replaceChildren();
    const found = verdict.diagnosis.map(({ place, sentence }) =>
      h("p", { class: "diagnosis" }, h("b", {}, `${place}: `), sentence),
    );
    const notes = verdict.notes.map((text) => h("p", { class: "hint" }, text));
    const right = verdict.entries.filter((entry) => entry.passes).length;
    const all = verdict.entries.length;
    const count = all ? `${right} of ${all} right` : verdict.verdict;
    this.report.replaceChildren(
      h("p", { class: right < all || !all ? "verdict bad" : "verdict" }, count),
      ...found,
      ...verdict.entries.map((entry) => this.entry(entry)),
      ...notes,
      ...(verdict.missing.length
        ? [
            h(
              "details",
              { class: "hint" },
              h("summary", {}, `${verdict.missing.length} entries without an answer`),
              verdict.missing.join(", "),
            ),
          ]
        : []),
    );
  }

  entry({ name, verdict, passes, read, text, statement, difference, difference_text, witness }) {
    const width = this.report.clientWidth - BORDERS;
    const shown = (mathml, otherwise) =>
      h(
        "div",
        { class: "wide entry" },
        formulaLines(mathml, width) ?? h("code", {}, otherwise ?? ""),
      );
    return h(
      "article",
      { class: passes ? "right" : "wrong" },
      h("h3", {}, `${name}: ${verdict}`),
      h("small", {}, "read as"),
      shown(read, text),
      statement ? h("small", {}, statement) : null,
      difference_text
        ? [h("small", {}, "your answer minus the correct one"), shown(difference, difference_text)]
        : null,
      witness ? h("small", {}, witness) : null,
    );
  }
}
