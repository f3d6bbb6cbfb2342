// Kinematics of a Denavit-Hartenberg table, for pages without Python; tests hold them to Python's to 1e-12.
// Transforms are 16 numbers by row; rad and m.

const QUARTER = Math.PI / 2;
const ROUNDING = 4e-16; // relative: an angle that is a right one but for its rounding has exact cosine and sine
const AXES = { X: 0, Y: 1, Z: 2 };
export const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

export function multiply(A, B) {
  const C = new Array(16);
  for (let i = 0; i < 16; i += 4) {
    for (let j = 0; j < 4; j++)
      C[i + j] = A[i] * B[j] + A[i + 1] * B[4 + j] + A[i + 2] * B[8 + j] + A[i + 3] * B[12 + j];
  }
  return C;
}

function cosineSine(angle) {
  const quarters = Math.round(angle / QUARTER);
  if (Math.abs(angle - quarters * QUARTER) > ROUNDING * Math.abs(angle))
    return [Math.cos(angle), Math.sin(angle)];
  return [
    [1, 0],
    [0, 1],
    [-1, 0],
    [0, -1],
  ][((quarters % 4) + 4) % 4];
}

export class Kinematics {
  // rows: {kind: "R" or "P", theta, d, a, alpha}; base, tool: of frame 0 in the world, of the tool in the last frame.
  constructor({ convention, rows, base, tool }) {
    Object.assign(this, { convention, base, tool });
    this.rows = rows.map((row) => ({
      ...row,
      sliding: row.kind === "P",
      turned: cosineSine(row.theta),
      twisted: cosineSine(row.alpha),
    }));
  }

  // A_i of joint value q: frame i in frame i - 1.
  row(i, q) {
    const {
      sliding,
      a,
      d: own,
      turned,
      twisted: [ca, sa],
    } = this.rows[i];
    const d = sliding ? own + q : own,
      [cq, sq] = sliding ? [1, 0] : [Math.cos(q), Math.sin(q)];
    const c = cq * turned[0] - sq * turned[1],
      s = sq * turned[0] + cq * turned[1];
    if (this.convention === "standard")
      return [c, -s * ca, s * sa, a * c, s, c * ca, -c * sa, a * s, 0, sa, ca, d, 0, 0, 0, 1];
    return [c, -s, 0, a, s * ca, c * ca, -sa, -sa * d, s * sa, c * sa, ca, ca * d, 0, 0, 0, 1];
  }

  // Frames 0 ... n and the tool in the world.
  frames(q) {
    const frames = [this.base];
    this.rows.forEach((_, i) => frames.push(multiply(frames[i], this.row(i, q[i]))));
    frames.push(multiply(frames[frames.length - 1], this.tool));
    return frames;
  }

  // A row's four elementary transforms in their order, with titles.
  steps(i, q) {
    const { sliding, theta, d, a, alpha } = this.rows[i];
    const turn = sliding ? theta : theta + q,
      way = sliding ? d + q : d;
    const degrees = (angle) => `${Number(((angle * 180) / Math.PI).toPrecision(4))}°`,
      metres = (x) => `${Number(x.toPrecision(4))} m`;
    const turned = { title: `turn about z by ${degrees(turn)}`, T: rotation(2, turn) },
      along = { title: `move along z by ${metres(way)}`, T: translation(2, way) };
    const shifted = { title: `move along x by ${metres(a)}`, T: translation(0, a) },
      twisted = { title: `turn about x by ${degrees(alpha)}`, T: rotation(0, alpha) };
    return this.convention === "standard"
      ? [turned, along, shifted, twisted]
      : [twisted, shifted, turned, along];
  }

  // One label for each place that frames share in every configuration, as dhkit/viewer/scene.py has them.
  labels() {
    const n = this.rows.length,
      states = [0.37, 0.91].map((x) =>
        this.frames(this.rows.map((_, i) => x + ((0.618 * i) % 0.7))),
      );
    const near = 1e-9 * Math.max(this.reach, 1e-9),
      name = (i) => (i > n ? "tool" : String(i));
    const share = (i, j, entries, limit) =>
      states.every((T) => entries.every((e) => Math.abs(T[i][e] - T[j][e]) < limit));
    const places = [];
    for (let i = 0; i <= n + 1; i++) {
      const place = places.find(([[first]]) => share(first, i, [3, 7, 11], near));
      const same = place?.find(([first]) => share(first, i, [0, 1, 2, 4, 5, 6, 8, 9, 10], 1e-9));
      if (same) same.push(i);
      else if (place) place.push([i]);
      else places.push([[i]]);
    }
    return places.map((place) => ({
      frame: place[0][0],
      text: place.map((same) => same.map(name).join(" = ")).join(", "),
    }));
  }

  // A bound of the distance from frame 0 to frame n without the strokes of slides, m.
  get reach() {
    return this.rows.reduce((sum, { a, d }) => sum + Math.abs(a) + Math.abs(d), 0);
  }
}

// axis: 0, 1 or 2.
export function rotation(axis, angle) {
  const T = [...IDENTITY],
    i = (axis + 1) % 3,
    j = (axis + 2) % 3,
    [c, s] = cosineSine(angle);
  T[5 * i] = T[5 * j] = c;
  T[4 * i + j] = -s;
  T[4 * j + i] = s;
  return T;
}

export function translation(axis, length) {
  const T = [...IDENTITY];
  T[4 * axis + 3] = length;
  return T;
}

// Euler angles of a transform (K. Shoemake, Graphics Gems IV, 1994); capitals: moving axes, small letters: fixed ones.
export function euler(T, order) {
  const fixedAxes = order === order.toLowerCase(),
    letters = [...order.toUpperCase()].map((letter) => AXES[letter]);
  const [i, j, k] = fixedAxes ? letters.reverse() : letters;
  const o = 3 - i - j,
    parity = (j - i + 3) % 3 === 1 ? 1 : -1,
    proper = i === k,
    R = (row, column) => T[4 * row + column];
  const level = proper ? Math.hypot(R(j, i), R(o, i)) : Math.hypot(R(i, i), R(i, j)),
    locked = level === 0;
  const middle = proper ? Math.atan2(level, R(i, i)) : Math.atan2(parity * R(i, k), level);
  let first = proper
    ? Math.atan2(R(j, i), -parity * R(o, i))
    : Math.atan2(-parity * R(j, k), R(k, k));
  if (locked) first = Math.atan2(parity * R(o, j), R(j, j));
  const c = Math.cos(first),
    s = Math.sin(first),
    left = (column) => c * R(j, column) + parity * s * R(o, column);
  const third = locked ? 0 : Math.atan2(parity * (proper ? -left(o) : left(i)), left(j));
  const angles = [first, middle, third].map((angle) => angle + 0);
  return fixedAxes ? angles.reverse() : angles;
}
