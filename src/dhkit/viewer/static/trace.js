// A path as a thin tube whose drawn part can grow: three.js draws plain lines one pixel wide.

const SIDES = 6;

export class Trace {
  constructor(scene, THREE) {
    this.scene = scene;
    this.THREE = THREE;
    this.material = new THREE.MeshBasicMaterial();
    this.tube = null;
    this.visible = true;
  }

  color(color) {
    this.material.color.set(color);
  }

  // points: x y z of every point, in the world (z up), m.
  set(points, radius) {
    this.clear();
    if (points.length < 6) return;
    this.tube = new this.THREE.Mesh(tubeGeometry(points, radius, this.THREE), this.material);
    this.tube.visible = this.visible;
    this.scene.add(this.tube);
  }

  // Draw the first so many segments; Infinity: all.
  draw(segments) {
    this.tube?.geometry.setDrawRange(0, 6 * SIDES * segments);
  }

  show(visible) {
    this.visible = visible;
    if (this.tube) this.tube.visible = visible;
  }

  clear() {
    if (!this.tube) return;
    this.scene.remove(this.tube);
    this.tube.geometry.dispose();
    this.tube = null;
  }
}

function tubeGeometry(points, radius, THREE) {
  const count = points.length / 3;
  const at = (i) => new THREE.Vector3().fromArray(points, 3 * Math.max(0, Math.min(count - 1, i)));
  const positions = new Float32Array(3 * SIDES * count);
  const tangent = new THREE.Vector3(0, 0, 1), normal = new THREE.Vector3(1, 0, 0), side = new THREE.Vector3();
  for (let i = 0; i < count; i++) {
    const along = at(i + 1).sub(at(i - 1));
    if (along.lengthSq() > 0) tangent.copy(along).normalize(); // at rest, the last direction stays
    // Carry the normal along, so that the tube does not twist.
    normal.addScaledVector(tangent, -normal.dot(tangent));
    if (normal.lengthSq() < 1e-6) normal.set(tangent.y, tangent.z, tangent.x).cross(tangent);
    normal.normalize();
    side.crossVectors(tangent, normal);
    const centre = at(i);
    for (let k = 0; k < SIDES; k++) {
      const turn = (2 * Math.PI * k) / SIDES;
      const point = centre.clone().addScaledVector(normal, radius * Math.cos(turn));
      point.addScaledVector(side, radius * Math.sin(turn)).toArray(positions, 3 * (i * SIDES + k));
    }
  }
  const index = new Uint32Array(6 * SIDES * (count - 1));
  for (let i = 0, at = 0; i < count - 1; i++) {
    for (let k = 0; k < SIDES; k++, at += 6) {
      const a = i * SIDES + k, b = i * SIDES + ((k + 1) % SIDES);
      index.set([a, b, a + SIDES, b, b + SIDES, a + SIDES], at);
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setIndex(new THREE.BufferAttribute(index, 1));
  return geometry;
}
