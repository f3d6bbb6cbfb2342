// A standing person, which shows how large an arm is.

export const HEIGHT = 1.75; // m

const COLOR = 0xa3acb9;
const DEPTH = 0.62; // of the trunk, share of its width
// Half the width of the trunk by height, m: hips, waist, chest, shoulders, neck.
const TRUNK = [
  [0.0, 0.86],
  [0.15, 0.9],
  [0.165, 0.97],
  [0.14, 1.1],
  [0.175, 1.28],
  [0.19, 1.38],
  [0.15, 1.45],
  [0.055, 1.49],
  [0.05, 1.56],
];
// Limbs of the right half: ends [x, y, z] and their radii, m. The left half is its mirror image.
const LIMBS = [
  { from: [0.09, 0, 0.92], to: [0.1, 0, 0.5], radii: [0.085, 0.06] }, // thigh
  { from: [0.1, 0, 0.5], to: [0.1, 0.015, 0.08], radii: [0.06, 0.042] }, // lower leg
  { from: [0.19, 0, 1.4], to: [0.235, 0.01, 1.12], radii: [0.05, 0.042] }, // upper arm
  { from: [0.235, 0.01, 1.12], to: [0.26, -0.03, 0.84], radii: [0.042, 0.032] }, // forearm
];

// Return a person who stands at the origin, z up, and looks along -y.
export function person(THREE) {
  const figure = new THREE.Group();
  const material = new THREE.MeshLambertMaterial({
    color: COLOR,
    transparent: true,
    opacity: 0.85,
  });
  const add = (geometry) => {
    const part = new THREE.Mesh(geometry, material);
    part.castShadow = true;
    figure.add(part);
    return part;
  };
  const ball = ([x, y, z], radius) => {
    const part = add(new THREE.SphereGeometry(radius, 20, 14));
    part.position.set(x, y, z);
    return part;
  };

  // A lathe turns its profile about y: the trunk is laid on its back first.
  const profile = TRUNK.map(([radius, z]) => new THREE.Vector2(radius, z));
  const trunk = add(new THREE.LatheGeometry(profile, 28));
  trunk.rotation.x = Math.PI / 2;
  trunk.scale.z = DEPTH;

  const head = ball([0, -0.005, 1.64], 0.11);
  head.scale.set(0.72, 0.86, 1);
  for (const side of [-1, 1]) {
    for (const { from, to, radii } of LIMBS) {
      const ends = [from, to].map(([x, y, z]) => [side * x, y, z]);
      limb(add, THREE, ends, radii);
      ends.forEach((end, k) => ball(end, radii[k]));
    }
    ball([side * 0.265, -0.04, 0.79], 0.045).scale.set(0.6, 1, 1.5); // hand
    ball([side * 0.105, -0.05, 0.04], 0.06).scale.set(0.75, 2, 0.66); // foot
  }
  return figure;
}

// Add a cone between two points, with a radius at each.
function limb(add, THREE, ends, radii) {
  const [from, to] = ends.map((end) => new THREE.Vector3(...end));
  const along = to.clone().sub(from);
  const length = along.length();
  const part = add(new THREE.CylinderGeometry(radii[1], radii[0], length, 18));
  part.position.addVectors(from, to).multiplyScalar(0.5);
  part.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.divideScalar(length));
}
