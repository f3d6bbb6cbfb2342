// The table of the arm: every number can be changed, and the arm follows.

import { UNITS, fixed, h, indexed, matrix, onTyped, save } from "./dom.js";

const COLUMNS = ["theta", "d", "a", "alpha"];
const HEADS = {
  standard: ["θ [rad]", "d", "a", "α [rad]"],
  modified: ["θ [rad]", "d", "aᵢ₋₁", "αᵢ₋₁ [rad]"],
};
const LENGTHS = ["d", "a"];
const WORDS = { m: "", mm: "*mm", in: "*inch" }; // units in expressions
const PLAIN = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?(\*(mm|cm|inch))?$/i; // a length without letters, or in a unit
const WIDEST = 10; // characters of a cell
const STEP_TIME = 700; // ms of one elementary transform
const LAST_TIME = 1500; // ms for which the last frame stays
// The entries of a row in the order of its transforms.
const ORDERS = {
  standard: ["theta", "d", "a", "alpha"],
  modified: ["alpha", "a", "theta", "d"],
};

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
      { "aria-pressed": "false", onclick: () => this.showFrames() },
      "Frames",
    );
    this.build = h(
      "button",
      { onclick: () => this.animate(this.table.rows.map((_, i) => i)) },
      "Animate",
    );
    this.body = h("tbody");
    this.head = h("tr");
    this.undo = h("button", { onclick: request("table.undo") }, "Undo");
    this.redo = h("button", { onclick: request("table.redo") }, "Redo");
    this.reset = h("button", { onclick: request("table.reset") }, "Reset");
    const file = (format) =>
      h("button", { onclick: () => this.download(format) }, format.toUpperCase());
    this.free = h("input", {
      type: "text",
      class: "number",
      value: "2 3",
      "aria-label": "Joints that move",
      onkeydown: (event) => event.key === "Enter" && this.lock(),
    });
    this.locks = h("button", { onclick: () => this.lock() }, "Lock the others");
    this.frees = h("button", { onclick: request("table.free") }, "Free all joints");
    this.locking = h(
      "div",
      { class: "line", hidden: true, title: "The others are locked at zero: an arm of its own" },
      h("label", {}, "Only joints ", this.free),
      this.locks,
      this.frees,
    );
    this.note = h("p", { class: "note", role: "status" });
    this.step = h("div", { class: "step" });
    this.placements = h("ul", { class: "placements" });
    root.append(
      h("div", { class: "line" }, this.convention, this.frames),
      h(
        "div",
        { class: "wide" },
        h("table", { class: "dh" }, h("thead", {}, this.head), this.body),
      ),
      this.placements,
      h(
        "div",
        { class: "buttons" },
        this.build,
        this.undo,
        this.redo,
        this.reset,
        lab.can("table.download") ? [file("toml"), file("urdf")] : null,
      ),
      this.locking,
      this.note,
      h(
        "p",
        { class: "hint" },
        "Lengths in the unit chosen beside the arm, angles in radians; pi/2, 90*deg or 17*inch are fine. A row's number shows its four transforms, Animate those of all rows.",
      ),
      this.step,
    );
  }

  showFrames() {
    const on = this.frames.getAttribute("aria-pressed") !== "true";
    this.frames.setAttribute("aria-pressed", String(on));
    this.lab.page.showFrames(on);
  }

  // A length is shown in the unit of the page unless it is an expression; one that is typed is of that unit.
  shownText(i, column) {
    const text = this.table.rows[i][column];
    const { length } = this.lab.units;
    if (length === "m" || !LENGTHS.includes(column) || !PLAIN.test(text)) return text;
    const word = WORDS[length];
    if (text.endsWith(word)) return text.slice(0, -word.length);
    const value = this.table.values[i][COLUMNS.indexOf(column)] * UNITS[length].scale;
    return String(Number(value.toPrecision(12)));
  }

  sentText(text, column) {
    const plain = text.trim().replace(",", ".");
    const isPlain = LENGTHS.includes(column) && PLAIN.test(plain) && !plain.includes("*");
    return isPlain && Number(plain) !== 0 ? `${plain}${WORDS[this.lab.units.length]}` : text;
  }

  // What the table's rows do not say: where frame 0 and the tool are.
  placement(what, numbers) {
    const length = UNITS[this.lab.units.length];
    const angle = UNITS[this.lab.units.angle];
    const list = (values, { scale, digits }) =>
      values.map((x) => String(Number(fixed(x * scale, digits)))).join(", ");
    const place = `${what}: (${list(numbers.slice(0, 3), length)})${length.sign}`;
    const turned = numbers.slice(3).some((x) => x !== 0);
    return turned
      ? `${place}, roll, pitch, yaw (${list(numbers.slice(3), angle)})${angle.sign}`
      : place;
  }

  unitsChanged() {
    if (this.table) this.take_table(this.table);
  }

  lock() {
    const numbers = this.free.value
      .split(/[\s,;]+/)
      .filter(Boolean)
      .map(Number);
    const n = this.table.joints;
    if (!numbers.length || numbers.some((k) => !Number.isInteger(k) || k < 1 || k > n))
      return this.lab.complain(
        `joints ${this.free.value.slice(0, 40)}: expected numbers from 1 to ${n}`,
      );
    return this.lab.ask("table.lock", { free: numbers.map((k) => k - 1) });
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
      ...HEADS[table.convention].map((text, k) =>
        h(
          "th",
          { scope: "col" },
          LENGTHS.includes(COLUMNS[k]) ? `${text} [${this.lab.units.length}]` : text,
        ),
      ),
    );
    const errors = new Map(
      table.errors.map(({ row, column, error }) => [`${row} ${column}`, error]),
    );
    // A column is as wide as its longest text.
    this.widths = Object.fromEntries(
      COLUMNS.map((column) => [
        column,
        Math.max(
          4,
          Math.min(WIDEST, Math.max(...table.rows.map((_, i) => this.shownText(i, column).length))),
        ),
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
      if (document.activeElement !== input) input.value = this.shownText(i, column);
      input.style.width = `calc(${this.widths[column]}ch + 7px)`;
      input.setAttribute("aria-invalid", String(Boolean(error)));
      input.title =
        error ?? (errors.size ? "" : `${table.rows[i][column]} = ${this.meaning(i, column)}`);
    }
    this.locking.hidden = !this.lab.can("table.lock") || table.joints < 2;
    this.locks.hidden = this.free.disabled = table.locked !== null;
    this.frees.hidden = table.locked === null;
    this.placements.replaceChildren(
      ...[
        ["frame 0 in the world", table.base],
        [`the tool in frame ${table.rows.length}`, table.tool],
      ].flatMap(([what, numbers]) => (numbers ? [h("li", {}, this.placement(what, numbers))] : [])),
    );
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
          text !== this.shownText(i, column) &&
          this.lab.ask("table.edit", { row: i, column, text: this.sentText(text, column) }),
      );
      const sign = variable
        ? h("span", { class: "variable", title: row.joint }, `q${i + 1} +`)
        : null;
      return h("td", {}, sign, input);
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
            class: "quiet",
            title: `${row.joint}: its four transforms`,
            "aria-label": `row ${i + 1}, ${row.joint}: show its four transforms`,
            onclick: () => this.animate([i]),
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
    for (const { input } of this.cells ?? []) input.closest("td").classList.remove("now");
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

  // The elementary transforms of rows, one after the other, as a frame that moves; the entry of each is lit.
  async animate(rows) {
    await this.lab.settled();
    const answers = [];
    for (const row of rows) {
      const answer = await this.lab.ask("table.steps", { row });
      if (!answer) return;
      answers.push({ row, ...answer });
    }
    this.running?.();
    this.steps = JSON.stringify(this.lab.state.joints.q);
    let stopped = false;
    this.running = () => (stopped = true);
    const order = ORDERS[this.table.convention];
    const moves = answers.flatMap(({ row, steps, A }) =>
      order.map((column, k) => ({
        row,
        steps,
        A,
        k,
        column,
        from: steps[k].T,
        to: steps[k + 1].T,
      })),
    );
    const start = performance.now();
    let [before] = moves;
    this.light(before, null, false);
    const tick = (now) => {
      if (stopped) return;
      // The first picture's time may lie before the start.
      const at = Math.min(Math.max(0, now - start) / STEP_TIME, moves.length);
      const over = at === moves.length;
      const move = moves[Math.min(moves.length - 1, Math.floor(at))];
      if (move !== before || over) this.light(move, before, over);
      before = move;
      this.lab.stage.showMoving(move.from, move.to, over ? 1 : at % 1);
      if (!over) requestAnimationFrame(tick);
      else setTimeout(() => !stopped && this.lab.stage.showMoving(null), LAST_TIME);
    };
    requestAnimationFrame(tick);
  }

  // Light the entry of a move and its line in the list of its row's transforms; none when all is over.
  light(move, before, over) {
    if (move.row !== before?.row)
      this.step.replaceChildren(
        h("h3", {}, `The transforms of row ${move.row + 1}`),
        h(
          "ol",
          {},
          move.steps.slice(1).map((step) => h("li", {}, step.title)),
        ),
        matrix(move.A, indexed("A", move.row + 1)),
      );
    const items = this.step.querySelectorAll("li");
    items.forEach((item, k) => item.classList.toggle("now", !over && k === move.k));
    for (const { input, i, column } of this.cells) {
      const isNow = !over && i === move.row && column === move.column;
      input.closest("td").classList.toggle("now", isNow);
    }
  }
}
