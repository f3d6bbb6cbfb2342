// The lab without Python: one arm in one state, and the answers to what panels ask. dhkit/lab does the same with Python.

import { THREE } from "../stage.js";
import { normalized, value } from "./expressions.js";
import { Kinematics, euler, multiply } from "./kinematics.js";
import { solids } from "./solids.js";

const COLUMNS = ["theta", "d", "a", "alpha"];
const FREE = { rad: Math.PI, m: 1 }; // what a random value spans on either side where a joint has no limit
const UNIQUE = 1e-6; // cosine (or sine) of the second Euler angle below which the others are not unique
const LARGEST = 1e4; // rad or m of an entry
const MOST_STEPS = 200; // of undo
const REFERENCE = new Uint8Array([140, 153, 173]); // red, green, blue of a ghost

export class OfflineDesk {
  // data: what dhkit/viewer/interactive.py writes; failed(error, request): shows an error.
  constructor(page, data, failed) {
    Object.assign(this, { page, data, failed });
    this.answers = {
      "joints.set": ({ q }) => this.show(q),
      "joints.named": ({ name }) =>
        this.show(Object.hasOwn(data.arm.named, name) ? data.arm.named[name] : this.random()),
      "tool.order": ({ order }) => this.choose(order),
      "tool.read": ({ q }) => this.tool(q),
      "table.edit": (edit) => this.edit(edit),
      "table.convention": ({ convention }) => this.take({ ...this.now, convention }),
      "table.undo": () => this.goBack(this.before, this.after),
      "table.redo": () => this.goBack(this.after, this.before),
      "table.reset": () => this.take(this.first),
      "table.steps": ({ row }) => this.steps(row),
      "motion.play": ({ index }) => this.play(index),
      "motion.show": ({ time }) => this.show(this.motionAt(time)),
    };
    this.order = "XYZ";
    this.before = [];
    this.after = [];
    // texts: of each row theta, d, a and alpha as they are typed; rows, good: the last good numbers, and their texts.
    this.first = this.now = { ...data.table, good: data.table.texts, errors: [] };
    this.kinematics = new Kinematics(this.now);
    this.q = data.q;
  }

  can(name) {
    return Object.hasOwn(this.answers, name);
  }

  async ask(name, data = {}) {
    try {
      return this.answers[name](data) ?? {};
    } catch (error) {
      this.failed(error.message, name);
      return null;
    }
  }

  begin() {
    const { data } = this;
    this.tell("arm", data.arm);
    this.tellTable();
    this.tell("recorded", data.motions);
    this.tell("about", data.about);
    this.show(this.q);
    this.page.stage.nameGhosts(data.about.ghosts);
    if (data.motions.length) this.play(0);
  }

  tell(name, data) {
    this.page.lab.take({ name, data });
  }

  // The state on show; it ends a motion.
  show(q) {
    this.motion = null;
    this.q = [...q];
    const frames = this.kinematics.frames(this.q);
    this.page.takePose({ q: new Float32Array(this.q), transforms: packed([frames]) });
    this.tellState();
    this.tell("motion", null);
  }

  tellState() {
    const { q } = this,
      { joints } = this.data.arm;
    const outside = q.flatMap((x, i) =>
      (joints[i].lower ?? -Infinity) <= x && x <= (joints[i].upper ?? Infinity) ? [] : [i],
    );
    this.tell("joints", { q, within: !outside.length, outside, nearest: null });
    this.tell("tool", this.tool(q));
  }

  tool(q) {
    const frames = this.kinematics.frames(q),
      T = frames[frames.length - 1],
      { order } = this,
      angles = euler(T, order);
    const middle = order[0] === order[2] ? Math.sin(angles[1]) : Math.cos(angles[1]);
    return {
      T,
      xyz: [T[3], T[7], T[11]],
      euler: angles,
      order,
      unique: Math.abs(middle) > UNIQUE,
      singular: null,
    };
  }

  choose(order) {
    this.order = order;
    this.tell("tool", this.tool(this.motion ? this.motionAt(this.page.player.time) : this.q));
  }

  random() {
    return this.data.arm.joints.map(({ lower, upper, unit }) => {
      const low = lower ?? -FREE[unit],
        high = upper ?? FREE[unit];
      return low + Math.random() * (high - low);
    });
  }

  // The table

  edit({ row, column, text }) {
    const texts = this.now.texts.map((entries) => [...entries]),
      errors = [];
    texts[row][COLUMNS.indexOf(column)] = normalized(text);
    const rows = this.now.rows.map((last, i) => {
      const numbers = { ...last };
      COLUMNS.forEach((name, k) => {
        if (texts[i][k] === this.now.good[i][k]) return; // read before, at first by Python
        try {
          numbers[name] = value(texts[i][k], this.data.parameters);
          if (Math.abs(numbers[name]) > LARGEST) throw new Error(`beyond ${LARGEST}`);
        } catch (error) {
          errors.push({ row: i, column: name, error: `${name}: ${error.message}` });
        }
      });
      return numbers;
    });
    const { now } = this;
    this.take({
      ...now,
      texts,
      errors,
      rows: errors.length ? now.rows : rows,
      good: errors.length ? now.good : texts,
    });
    return {
      error: errors.find((error) => error.row === row && error.column === column)?.error ?? null,
    };
  }

  // Whoever types the first numbers again has the first arm again.
  take(given) {
    const { first } = this,
      same =
        given.convention === first.convention &&
        given.rows.every((row, i) => COLUMNS.every((name) => row[name] === first.rows[i][name]));
    const table = same ? { ...given, rows: first.rows } : given;
    this.before = [...this.before.slice(1 - MOST_STEPS), this.now];
    this.after = [];
    this.showTable(table);
  }

  goBack(from, to) {
    if (!from.length) throw new Error("there is no such change");
    to.push(this.now);
    this.showTable(from.pop());
  }

  showTable(table) {
    const same = table.rows === this.now.rows && table.convention === this.now.convention;
    this.now = table;
    if (!same) {
      const { stage } = this.page,
        { edited } = this;
      this.kinematics = new Kinematics(table);
      stage.redraw(
        edited ? solids(this.kinematics, stage.size, THREE) : null,
        edited ? this.kinematics.labels() : this.data.labels,
      );
      stage.leaveArm(); // ghosts and paths were those of the table before
      this.tell("arm", {
        ...this.data.arm,
        family: edited ? "edited on this page" : this.data.arm.family,
      });
      this.show(this.q);
    }
    this.tellTable();
  }

  // Whether the numbers are others than the first.
  get edited() {
    return this.now.rows !== this.first.rows || this.now.convention !== this.first.convention;
  }

  tellTable() {
    const { now, first } = this;
    const rows = now.texts.map((texts, i) => ({
      joint: this.data.arm.joints[i].name,
      kind: now.rows[i].kind,
      ...Object.fromEntries(COLUMNS.map((name, k) => [name, texts[k]])),
    }));
    const changed =
      JSON.stringify(now.texts) !== JSON.stringify(first.texts) ||
      now.convention !== first.convention;
    const values = now.rows.map((row) => COLUMNS.map((name) => row[name]));
    this.tell("table", {
      convention: now.convention,
      rows,
      values,
      errors: now.errors,
      undo: this.before.length > 0,
      redo: this.after.length > 0,
      changed,
      base: null,
      tool: null,
      joints: rows.length,
      locked: null,
      note: this.edited
        ? "drawn from the table; limits are those of the arm as it was written"
        : null,
    });
  }

  steps(row) {
    const { kinematics, q } = this,
      T = kinematics.frames(q)[row];
    let A = null;
    const steps = [{ title: `frame ${row}`, T }];
    for (const { title, T: moved } of kinematics.steps(row, q[row])) {
      A = A ? multiply(A, moved) : moved;
      steps.push({ title, T: multiply(T, A) });
    }
    return { steps, A };
  }

  // Motions

  play(index) {
    const motion = this.data.motions[index],
      { times, q, reference } = motion;
    const drawn = (rows) => packed(rows.map((row) => this.kinematics.frames(row)));
    this.motion = motion;
    this.tell("motion", { ...motion, index });
    const joints = this.q.length;
    this.page.takeAnimation({
      joints,
      nodes: joints + 2,
      times: new Float64Array(times),
      q: new Float32Array(q.flat()),
      transforms: drawn(q),
      flag: true,
      ghost: reference && { transforms: drawn(reference), tint: REFERENCE },
    });
  }

  motionAt(time) {
    if (!this.motion) return this.q;
    const { times, q } = this.motion,
      at = (time / times[times.length - 1]) * (times.length - 1);
    const k = Math.min(times.length - 2, Math.floor(at)),
      share = at - k;
    return q[k].map((x, i) => (1 - share) * x + share * q[k + 1][i]);
  }
}

// Frames of states as the page draws them: the upper three rows of each.
function packed(states) {
  const nodes = states[0].length,
    numbers = new Float32Array(12 * nodes * states.length);
  states.forEach((frames, k) =>
    frames.forEach((T, i) => numbers.set(T.slice(0, 12), 12 * (k * nodes + i))),
  );
  return numbers;
}
