// A program of the person's own: what it says beside what the arm does, its score, and what it prints.

import { DEGREES, fixed, h } from "./dom.js";

export class OwnPanel {
  constructor(lab, root) {
    this.lab = lab;
    this.title = h("h2", {}, "");
    this.status = h("p", { class: "note", role: "status" });
    this.live = h("div", { class: "facts" });
    this.ghosts = h(
      "button",
      {
        "aria-pressed": "false",
        onclick: () =>
          lab.ask("own.ghosts", { on: this.ghosts.getAttribute("aria-pressed") !== "true" }),
      },
      "Show my solutions",
    );
    this.again = h("button", { onclick: () => lab.ask("own.score") }, "Score again");
    this.score = h("div", { class: "score" });
    this.output = h("details", {}, h("summary", {}, "What it prints"), h("pre"));
    root.append(
      this.title,
      this.status,
      this.live,
      h("div", { class: "buttons" }, this.ghosts, this.again),
      this.score,
      this.output,
      h(
        "p",
        { class: "hint" },
        "The file is loaded anew whenever it is saved. A controller of yours is in the list of the Control panel.",
      ),
    );
  }

  take_own(own) {
    this.lab.showTab("own", Boolean(own));
    if (!own) return;
    this.title.textContent = own.file ?? "";
    this.status.textContent =
      own.error ?? (own.loading ? "loading …" : `defines ${(own.functions ?? []).join(", ")}`);
    this.status.classList.toggle("bad", Boolean(own.error));
    const functions = own.error ? [] : (own.functions ?? []);
    this.ghosts.hidden = !functions.includes("ik");
    this.ghosts.setAttribute("aria-pressed", String(own.ghosts));
    this.again.disabled = own.scoring || !functions.length;
    this.live.replaceChildren(
      ...(own.error
        ? []
        : [this.forward(own.fk), this.inverse(own.ik), this.imports(own.imported)]
      ).filter(Boolean),
    );
    this.output.hidden = !own.output;
    this.output.lastChild.textContent = own.output ?? "";
    this.showScore(own);
  }

  forward(fk) {
    if (!fk) return null;
    if (fk.error) return h("p", { class: "bad" }, `fk here: ${fk.error}`);
    const far = fk.distance > 1e-6 || fk.angle > 1e-6;
    return h(
      "p",
      { class: far ? "bad" : null },
      far
        ? `fk here: ${fixed(1000 * fk.distance, 3)} mm and ${fixed(fk.angle * DEGREES, 3)}° from the arm's`
        : "fk here: as the arm's",
    );
  }

  inverse(ik) {
    if (!ik) return null;
    if (ik.error) return h("p", { class: "bad" }, `ik here: ${ik.error}`);
    return h(
      "p",
      { class: ik.right < ik.count || !ik.count ? "bad" : null },
      ik.count
        ? `ik here: ${ik.right} of ${ik.count} solutions lead to the tool's pose`
        : "ik here: no solution",
    );
  }

  imports(imported) {
    return imported?.length ? h("p", { class: "bad" }, `it imports ${imported.join(", ")}`) : null;
  }

  showScore({ report, scoring, error, edited }) {
    if (error) return this.score.replaceChildren();
    if (!report)
      return this.score.replaceChildren(
        h(
          "p",
          { class: "hint" },
          scoring ? "scoring …" : edited ? "the arm was changed: score again" : "",
        ),
      );
    if (report.error) return this.score.replaceChildren(h("p", { class: "bad" }, report.error));
    const rows = Object.entries(report.functions).flatMap(([name, parts]) => [
      h("tr", {}, h("th", { colSpan: 2, scope: "rowgroup" }, name)),
      ...parts.map((part) =>
        h(
          "tr",
          {},
          h(
            "td",
            {},
            `${part.name}`,
            h("small", {}, part.text),
            part.details.map((detail) => h("small", { class: "bad" }, detail)),
          ),
          h(
            "td",
            { class: part.points < part.most ? "bad" : null },
            `${fixed(part.points, 1)} of ${part.most}`,
          ),
        ),
      ),
    ]);
    this.score.replaceChildren(
      h(
        "h3",
        {},
        `${fixed(report.points, 1)} of ${report.most} points${scoring ? " (scoring again …)" : ""}`,
      ),
      h("table", {}, h("tbody", {}, rows)),
    );
  }
}
