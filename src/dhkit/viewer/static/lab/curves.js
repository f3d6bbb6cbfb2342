// Joint values, rates and torques of a motion over time, with their limits.

import { beyond, DEGREES, h, unitsOf } from "./dom.js";
import { Plot, legend } from "./plot.js";

const ROUNDING = 1e-6; // share of a limit

export class Curves {
  constructor() {
    this.plots = { q: new Plot("joints", "° or m"), qd: new Plot("rates", "°/s or m/s"), tau: new Plot("torques", "N m or N") };
    this.legend = h("div");
    this.root = h("div", { hidden: true }, this.legend, Object.values(this.plots).map((plot) => plot.root));
  }

  // motion: times and rows of q, qd and tau (or null), with limits of each joint, null where there is none.
  draw(motion, joints) {
    this.plots.q.setUnit(unitsOf(joints, "°", "m"));
    this.plots.qd.setUnit(unitsOf(joints, "°/s", "m/s"));
    this.plots.tau.setUnit(unitsOf(joints, "N m", "N"));
    const names = joints.map((joint) => joint.name), scales = joints.map((joint) => (joint.unit === "m" ? 1 : DEGREES));
    this.legend.replaceChildren(legend(names));
    const curves = (rows, scale) => [motion.times, ...joints.map((_, i) => rows.map((row) => row[i] * scale[i]))];
    const pairs = (lower, upper, scale) => joints.map((_, i) => [lower[i], upper[i]].map((x) => (x === null ? null : x * scale[i])));
    const both = (limit, scale) => pairs(limit.map((x) => (x === null ? null : -x)), limit, scale);
    const ones = joints.map(() => 1), { limits } = motion;
    this.plots.q.set(names, curves(motion.q, scales), pairs(limits.lower, limits.upper, scales));
    this.plots.qd.set(names, curves(motion.qd, scales), both(limits.velocity, scales));
    this.plots.tau.root.hidden = !motion.tau;
    if (motion.tau) this.plots.tau.set(names, curves(motion.tau, ones), both(limits.effort, ones));
  }

  mark(time) {
    for (const plot of Object.values(this.plots)) plot.mark(time);
  }

  resize() {
    for (const plot of Object.values(this.plots)) plot.resize();
  }
}

// The joints, from 0, that are beyond a limit at a time of a motion, and the links that touch each other, or null.
export function exceeding({ duration, limits, q, qd, tau, times, contacts }, time) {
  const at = (samples) => (duration > 0 ? Math.round((time / duration) * (samples - 1)) : 0), k = at(times.length);
  const fast = (value, limit) => limit !== null && Math.abs(value) > limit * (1 + ROUNDING);
  const exceeds = (_, i) => beyond(q[k][i], limits.lower[i], limits.upper[i]) || fast(qd[k][i], limits.velocity[i]) || (tau && fast(tau[k][i], limits.effort[i]));
  const joints = q[k].flatMap((x, i) => (exceeds(x, i) ? [i] : []));
  return [joints, contacts ? contacts[at(contacts.length)] : null];
}
