// Curves of all joints over time: of a motion, and of a simulation as it runs. The dock shows them.

import { UNITS, beyond, h, unitsOf } from "./dom.js";
import { Plot, legend } from "./plot.js";

const ROUNDING = 1e-6; // share of a limit
const MILLI = 1000; // of errors, in rad and m

// Plots whose curves are one for each joint, with one legend.
class JointCurves {
  constructor(lab, title, plots) {
    this.lab = lab;
    this.title = title;
    this.plots = plots;
    this.hidden = new Set();
    this.legend = h("div", { class: "legends" });
    this.names = [];
  }

  name(names) {
    if (names.join() === this.names.join()) return;
    this.names = names;
    this.hidden = new Set();
    this.hide();
  }

  toggle(k) {
    if (!this.hidden.delete(k)) this.hidden.add(k);
    this.hide();
  }

  hide() {
    for (const plot of this.plots) plot.hide(this.hidden);
    this.legend.replaceChildren(legend(this.names, this.hidden, (k) => this.toggle(k)));
  }

  // What the values of a joint are multiplied by, and the sign of their unit; per: "", or "/s" of rates.
  units(joints, per = "") {
    const { angle, length } = this.lab.units,
      sign = (unit) => UNITS[unit].sign.trim() + per;
    return {
      scales: joints.map((joint) => UNITS[joint.unit === "m" ? length : angle].scale),
      text: unitsOf(joints, sign(angle), sign(length)),
    };
  }

  mark(time) {
    for (const plot of this.plots) plot.mark(time);
  }

  resize() {
    for (const plot of this.plots) plot.resize();
  }
}

export class MotionCurves extends JointCurves {
  constructor(lab) {
    const { player } = lab.page,
      seek = (time) => player.active && (player.pause(), player.seek(time));
    const plots = [
      new Plot("joints", "° or m", seek),
      new Plot("rates", "°/s or m/s", seek),
      new Plot("torques", "N m or N", seek),
    ];
    super(lab, "Motion", plots);
  }

  // motion: times and rows of q, qd and tau (or null), with limits of each joint, null where there is none.
  draw(motion, joints) {
    this.shown = { motion, joints };
    this.name(joints.map((joint) => joint.name));
    const [q, qd, tau] = this.plots,
      { limits } = motion,
      ones = joints.map(() => 1);
    const positions = this.units(joints),
      rates = this.units(joints, "/s");
    q.setUnit(positions.text);
    qd.setUnit(rates.text);
    tau.setUnit(unitsOf(joints, "N m", "N"));
    const curves = (rows, scales) => [
      motion.times,
      ...joints.map((_, i) => rows.map((row) => row[i] * scales[i])),
    ];
    const pairs = (lower, upper, scales) =>
      joints.map((_, i) => [lower[i], upper[i]].map((x) => (x === null ? null : x * scales[i])));
    const both = (limit, scales) =>
      pairs(
        limit.map((x) => (x === null ? null : -x)),
        limit,
        scales,
      );
    q.set(
      this.names,
      curves(motion.q, positions.scales),
      pairs(limits.lower, limits.upper, positions.scales),
    );
    qd.set(this.names, curves(motion.qd, rates.scales), both(limits.velocity, rates.scales));
    tau.root.hidden = !motion.tau;
    if (motion.tau) tau.set(this.names, curves(motion.tau, ones), both(limits.effort, ones));
  }

  unitsChanged() {
    if (this.shown) this.draw(this.shown.motion, this.shown.joints);
  }
}

export class RunCurves extends JointCurves {
  constructor(lab) {
    super(lab, "Simulation", [
      new Plot("joints, desired dashed", "° or m"),
      new Plot("errors", "mrad or mm"),
      new Plot("torques", "N m or N"),
    ]);
  }

  // joints: those of the rows; rows: time, joint values, errors and torques of each, in rad, m, N m and N.
  draw(rows, joints) {
    this.shown = { rows, joints };
    this.name(joints.map((joint) => joint.name));
    const [q, errors, torques] = this.plots,
      n = joints.length,
      { scales, text } = this.units(joints);
    q.setUnit(text);
    errors.setUnit(unitsOf(joints, "mrad", "mm"));
    torques.setUnit(unitsOf(joints, "N m", "N"));
    const times = rows.map((row) => row[0]),
      every = (value) => joints.map((_, i) => rows.map((row) => value(row, i)));
    q.set(this.names, [
      times,
      ...every((row, i) => row[1 + i] * scales[i]),
      ...every((row, i) => (row[1 + i] + row[1 + n + i]) * scales[i]),
    ]);
    errors.set(this.names, [times, ...every((row, i) => row[1 + n + i] * MILLI)]);
    torques.set(
      this.names,
      [times, ...every((row, i) => row[1 + 2 * n + i])],
      joints.map(({ effort }) =>
        effort === null || effort === undefined ? null : [-effort, effort],
      ),
    );
  }

  clear() {
    this.shown = null;
    for (const plot of this.plots) plot.clear();
  }

  unitsChanged() {
    if (this.shown) this.draw(this.shown.rows, this.shown.joints);
  }
}

// The joints, from 0, that are beyond a limit at a time of a motion, and the links that touch each other, or null.
export function exceeding({ duration, limits, q, qd, tau, times, contacts }, time) {
  const at = (samples) => (duration > 0 ? Math.round((time / duration) * (samples - 1)) : 0),
    k = at(times.length);
  const fast = (value, limit) => limit !== null && Math.abs(value) > limit * (1 + ROUNDING);
  const exceeds = (_, i) =>
    beyond(q[k][i], limits.lower[i], limits.upper[i]) ||
    fast(qd[k][i], limits.velocity[i]) ||
    (tau && fast(tau[k][i], limits.effort[i]));
  const joints = q[k].flatMap((x, i) => (exceeds(x, i) ? [i] : []));
  return [joints, contacts ? contacts[at(contacts.length)] : null];
}
