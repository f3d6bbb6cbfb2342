// Messages from Python: the layout is described in dhkit/viewer/protocol.py.

export const SCENE = 1,
  POSE = 2,
  ANIMATION = 3,
  TRACE = 4,
  FRAMES = 5;
export const POINTS = 6,
  ELLIPSOIDS = 7,
  GHOSTS = 8,
  OBSTACLES = 9,
  STATE = 10,
  SAMPLES = 11;
const HEADER = 16,
  FLAG = 1,
  GHOST_FLAG = 2;
export const PER_TRANSFORM = 12;
export const PER_SOLID = PER_TRANSFORM + 4; // half edges and a radius

export function decode(buffer) {
  const view = new DataView(buffer);
  const header = {
    type: view.getUint8(0),
    flag: Boolean(view.getUint8(1) & FLAG),
    ghostFlag: Boolean(view.getUint8(1) & GHOST_FLAG),
    joints: view.getUint16(2, true),
    sequence: view.getUint32(4, true),
    time: view.getFloat64(8, true),
  };
  return { ...header, ...BODIES[header.type](buffer, view, header) };
}

const BODIES = {
  [SCENE]: (buffer, view) => {
    const blocks = [];
    for (let at = HEADER; at < buffer.byteLength;) {
      const length = view.getUint32(at, true);
      // A copy: meshcat hands an STL's buffer to its loader whole.
      blocks.push(new Uint8Array(buffer.slice(at + 4, at + 4 + length)));
      at += 4 + length;
    }
    return { about: JSON.parse(new TextDecoder().decode(blocks[0])), commands: blocks.slice(1) };
  },
  [POSE]: (buffer, view, { joints }) => {
    const numbers = new Float32Array(buffer, HEADER);
    return { q: numbers.subarray(0, joints), transforms: numbers.subarray(joints) };
  },
  [ANIMATION]: (buffer, view, { joints, ghostFlag }) => {
    const count = view.getUint32(HEADER, true),
      nodes = joints + 2;
    const start = HEADER + 8,
      perArm = count * nodes * PER_TRANSFORM;
    const floats = start + 8 * count;
    const numbers = new Float32Array(buffer, floats, count * joints + perArm * (ghostFlag ? 2 : 1));
    const arm = (k) =>
      numbers.subarray(count * joints + k * perArm, count * joints + (k + 1) * perArm);
    const tint = new Uint8Array(buffer, floats + numbers.byteLength);
    return {
      joints,
      nodes,
      times: new Float64Array(buffer, start, count),
      q: numbers.subarray(0, count * joints),
      transforms: arm(0),
      ghost: ghostFlag ? { transforms: arm(1), tint } : null,
    };
  },
  [TRACE]: (buffer) => ({ points: new Float32Array(buffer, HEADER) }),
  [FRAMES]: () => ({}),
  [POINTS]: (buffer, view) => {
    const { floats, bytes } = counted(buffer, view, 3);
    return { points: floats, colors: bytes };
  },
  [ELLIPSOIDS]: (buffer, view) => ({ transforms: counted(buffer, view, PER_TRANSFORM).floats }),
  [GHOSTS]: (buffer, view, { joints }) => {
    const { floats, bytes } = counted(buffer, view, (joints + 2) * PER_TRANSFORM);
    return { transforms: floats, tints: bytes };
  },
  [OBSTACLES]: (buffer, view) => ({ solids: counted(buffer, view, PER_SOLID).floats }),
  [STATE]: (buffer) => JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, HEADER))),
  [SAMPLES]: (buffer, view) => {
    const length = view.getUint32(HEADER, true),
      start = HEADER + 4;
    const about = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, start, length)));
    return { ...about, rows: new Float32Array(buffer, start + length) };
  },
};

// So many floats for each of what a message counts, and the bytes behind them.
function counted(buffer, view, width) {
  const count = view.getUint32(HEADER, true),
    start = HEADER + 4;
  const floats = new Float32Array(buffer, start, count * width);
  return { floats, bytes: new Uint8Array(buffer, start + floats.byteLength) };
}

// Positions (3 a node) and unit quaternions (x y z w, 4 a node) of transforms given as rows of 3 x 4 matrices.
export function placements(transforms, THREE) {
  const count = transforms.length / PER_TRANSFORM;
  const positions = new Float32Array(3 * count),
    quaternions = new Float32Array(4 * count);
  const matrix = new THREE.Matrix4(),
    quaternion = new THREE.Quaternion();
  for (let i = 0; i < count; i++) {
    const m = transforms.subarray(PER_TRANSFORM * i, PER_TRANSFORM * (i + 1));
    matrix.set(...m, 0, 0, 0, 1);
    quaternion
      .setFromRotationMatrix(matrix)
      .normalize()
      .toArray(quaternions, 4 * i);
    positions.set([m[3], m[7], m[11]], 3 * i);
  }
  return { positions, quaternions };
}
