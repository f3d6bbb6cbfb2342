// The table of the arm: every number can be changed, and the arm follows.

import { fixed, h, indexed, matrix, onTyped, save } from "./dom.js";

const COLUMNS = ["theta", "d", "a", "alpha"];
const HEADS = {
  standard: ["θ [rad]", "d [m]", "a [m]", "α [rad]"],
  modified: ["θ [rad]", "d [m]", "aᵢ₋₁ [m]", "αᵢ₋₁ [rad]"],
};
const WIDEST = 10; // characters of a cell
const STEP_TIME = 700; // ms of one elementary transform

export class TablePanel {
  constructor(lab, root) {
    this.lab = lab;
    const request = (name) => () => lab.ask(name);
    this.convention = h(
      "select",
      {
        "aria-label": "Convention",
        onchange: () => lab.ask("table.convention", { convention: this.convention.value }),
      },
      h("option", { value: "standard" }, "standard (distal)"),
      h("option", { value: "modified" }, "modified (Craig)"),
    );
    this.frames = h(
      "button",
      { type: "button", "aria-pressed": "false", onclick: () => this.showFrames() },
      "Frames",
    );
    this.body = h("tbody");
    this.head = h("tr");
    this.undo = h("button", { type: "button", onclick: request("table.undo") }, "Undo");
    this.redo = h("button", { type: "button", onclick: request("table.redo") }, "Redo");
    this.reset = h("button", { type: "button", onclick: request("table.reset") }, "Reset");
    const file = (format) =>
      h("button", { type: "button", onclick: () => this.download(format) }, format.toUpperCase());
    this.note = h("p", { class: "note", role: "status" });
    this.step = h("div", { class: "step" });
    root.append(
      h("div", { class: "line" }, this.convention, this.frames),
      h(
        "div",
        { class: "wide" },
        h("table", { class: "dh" }, h("thead", {}, this.head), this.body),
      ),
      h(
        "div",
        { class: "buttons" },
        this.undo,
        this.redo,
        this.reset,
        lab.can("table.download") ? [file("toml"), file("urdf")] : null,
      ),
      this.note,
      h(
        "p",
        { class: "hint" },
        "Metres and radians; expressions such as pi/2, 90*deg or 17*inch are fine. A row's number shows its four steps.",
      ),
      this.step,
    );
  }

  showFrames() {
    const on = this.frames.getAttribute("aria-pressed") !== "true";
    this.frames.setAttribute("aria-pressed", String(on));
    this.lab.page.showFrames(on);
  }

  async download(format) {
    const answer = await this.lab.ask("table.download", { format });
    if (answer) save(answer.name, answer.text, "text/plain");
  }

  take_table(table) {
    this.table = table;
    this.convention.value = table.convention;
    this.head.replaceChildren(
      h("th", { scope: "col" }, ""),
      ...HEADS[table.convention].map((text) => h("th", { scope: "col" }, text)),
    );
    const errors = new Map(
      table.errors.map(({ row, column, error }) => [`${row} ${column}`, error]),
    );
    // A column is as wide as its longest text.
    this.widths = Object.fromEntries(
      COLUMNS.map((column) => [
        column,
        Math.max(4, Math.min(WIDEST, Math.max(...table.rows.map((row) => row[column].length)))),
      ]),
    );
    const joints = JSON.stringify(table.rows.map(({ joint, kind }) => [joint, kind]));
    if (joints !== this.joints) {
      this.joints = joints;
      this.cells = [];
      this.body.replaceChildren(...table.rows.map((row, i) => this.row(row, i)));
    }
    for (const { input, i, column } of this.cells) {
      const error = errors.get(`${i} ${column}`);
      if (document.activeElement !== input) input.value = table.rows[i][column];
      input.style.width = `calc(${this.widths[column]}ch + 12px)`;
      input.setAttribute("aria-invalid", String(Boolean(error)));
      input.title =
        error ?? (errors.size ? "" : `${table.rows[i][column]} = ${this.meaning(i, column)}`);
    }
    this.undo.disabled = !table.undo;
    this.redo.disabled = !table.redo;
    this.reset.disabled = !table.changed;
    const [first] = table.errors;
    const more = table.errors.length > 1 ? ` (and ${table.errors.length - 1} more)` : "";
    this.note.textContent = first
      ? `row ${first.row + 1}, ${first.error}${more}; the arm is the last one that could be built, and other edits wait`
      : [this.inDegrees(), table.note].filter(Boolean).join("; ");
    this.note.classList.toggle("bad", Boolean(first));
  }

  row(row, i) {
    const cells = COLUMNS.map((column) => {
      const variable = column === (row.kind === "R" ? "theta" : "d");
      const input = h("input", {
        type: "text",
        autocomplete: "off",
        spellcheck: "false",
        "aria-label": `${column} of row ${i + 1}`,
      });
      this.cells.push({ input, i, column });
      onTyped(
        input,
        (text) =>
          text !== this.table.rows[i][column] &&
          this.lab.ask("table.edit", { row: i, column, text }),
      );
      return h("td", {}, variable ? h("span", { class: "variable" }, `q${i + 1} + `) : null, input);
    });
    return h(
      "tr",
      {},
      h(
        "th",
        { scope: "row" },
        h(
          "button",
          {
            type: "button",
            class: "quiet",
            title: `${row.joint}: its four transforms`,
            "aria-label": `row ${i + 1}, ${row.joint}: show its four transforms`,
            onclick: () => this.animate(i),
          },
          String(i + 1),
        ),
      ),
      cells,
    );
  }

  // Somebody who writes 90 for a right angle has meant degrees.
  inDegrees() {
    for (const [i, row] of this.table.values.entries()) {
      const k = [0, 3].find((column) => Math.abs(row[column]) > 2 * Math.PI);
      if (k !== undefined)
        return `row ${i + 1}, ${COLUMNS[k]}: ${fixed(row[k], 4)} rad are ${fixed((row[k] * 180) / Math.PI, 1)}°; degrees are written 90*deg or 90°`;
    }
    return null;
  }

  meaning(i, column) {
    const value = this.table.values[i][COLUMNS.indexOf(column)];
    return column === "theta" || column === "alpha"
      ? `${fixed((value * 180) / Math.PI, 4)}°`
      : `${fixed(value, 5)} m`;
  }

  // Another panel is opened: the frame that moves goes.
  shown(visible) {
    if (!visible) this.stopSteps();
  }

  stopSteps() {
    this.running?.();
    this.lab.stage.showMoving(null);
    this.step.replaceChildren();
    this.steps = null;
  }

  take_arm() {
    this.stopSteps();
  }

  // The transforms of a row are those of the joint values that they were asked for.
  take_joints({ q }) {
    if (this.steps && JSON.stringify(q) !== this.steps) this.stopSteps();
  }

  moved(q) {
    if (q && this.steps && JSON.stringify([...q]) !== this.steps) this.stopSteps();
  }

  // One elementary transform after the other, as a frame that moves.
  async animate(row) {
    await this.lab.settled();
    const answer = await this.lab.ask("table.steps", { row });
    if (!answer) return;
    this.running?.();
    this.steps = JSON.stringify(this.lab.state.joints.q);
    let stopped = false;
    this.running = () => (stopped = true);
    const { steps, A } = answer;
    this.step.replaceChildren(
      h("h3", {}, `The transforms of row ${row + 1}`),
      h(
        "ol",
        {},
        steps.slice(1).map((step) => h("li", {}, step.title)),
      ),
      matrix(A, indexed("A", row + 1)),
    );
    const items = [...this.step.querySelectorAll("li")],
      start = performance.now();
    const tick = (now) => {
      if (stopped) return;
      // The first picture's time may lie before the start.
      const at = Math.min(Math.max(0, now - start) / STEP_TIME, steps.length - 1),
        k = Math.min(steps.length - 2, Math.floor(at));
      items.forEach((item, j) => item.classList.toggle("now", j === k && at < steps.length - 1));
      this.lab.stage.showMoving(steps[k].T, steps[k + 1].T, at - k);
      if (at < steps.length - 1) requestAnimationFrame(tick);
      else setTimeout(() => !stopped && this.lab.stage.showMoving(null), 1500);
    };
    requestAnimationFrame(tick);
  }
}
