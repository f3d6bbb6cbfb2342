// Solids in the arm's way, translucent with their edges: each is all that is within a radius of a box.

import { PER_TRANSFORM } from "./messages.js";

const SOLID = 0.28,
  FLOOR = 0.12; // opacities
const ROUND = 48,
  ARC = 12; // sides of what is round, and of a quarter of its outline

// numbers: a transform by rows, half edges, a radius; dhkit/viewer/protocol.py.
export function solid(numbers, color, THREE) {
  const [x, y, z, radius] = numbers.subarray(PER_TRANSFORM);
  const flat = isFloor(numbers);
  const geometry = flat
    ? new THREE.PlaneGeometry(2 * x, 2 * y)
    : radius > 0
      ? rounded(radius, z, THREE)
      : new THREE.BoxGeometry(2 * x, 2 * y, 2 * z);
  geometry.computeBoundingBox();
  const look = {
    color,
    transparent: true,
    opacity: flat ? FLOOR : SOLID,
    side: THREE.DoubleSide,
    depthWrite: false,
  };
  const object = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial(look));
  object.renderOrder = 1;
  const lines = radius > 0 ? circles(radius, z, THREE) : new THREE.EdgesGeometry(geometry);
  const edges = new THREE.LineSegments(
    lines,
    new THREE.LineBasicMaterial({ color, transparent: true, opacity: 0.8 }),
  );
  edges.renderOrder = 1;
  object.add(edges);
  object.matrixAutoUpdate = false;
  object.matrix.set(...numbers.subarray(0, PER_TRANSFORM), 0, 0, 0, 1);
  return object;
}

export function isFloor(numbers) {
  const [, , z, radius] = numbers.subarray(PER_TRANSFORM);
  return z === 0 && radius === 0;
}

// A ball, or a capsule along z.
function rounded(radius, half, THREE) {
  const outline = [];
  for (let k = -ARC; k <= ARC; k++) {
    const angle = (k * Math.PI) / (2 * ARC);
    const height = radius * Math.sin(angle),
      across = radius * Math.cos(angle);
    if (k <= 0) outline.push(new THREE.Vector2(across, height - half));
    if (k >= 0) outline.push(new THREE.Vector2(across, height + half));
  }
  return new THREE.LatheGeometry(outline, ROUND).rotateX(Math.PI / 2);
}

// The circles around its ends, by which a round solid is seen as one.
function circles(radius, half, THREE) {
  const points = [];
  const at = (k, height) => {
    const angle = (2 * Math.PI * k) / ROUND;
    points.push(new THREE.Vector3(radius * Math.cos(angle), radius * Math.sin(angle), height));
  };
  for (const height of half > 0 ? [-half, half] : [0]) {
    for (let k = 0; k < ROUND; k++) [k, k + 1].forEach((end) => at(end, height));
  }
  return new THREE.BufferGeometry().setFromPoints(points);
}
