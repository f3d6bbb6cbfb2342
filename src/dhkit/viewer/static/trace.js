// A path as a thin tube whose drawn part can grow: three.js draws plain lines one pixel wide.

const SIDES = 6;
const MOST_POINTS = 20000; // of a trail
const JUMP = 0.2; // share of the arm's size: a trail begins anew behind a longer step
const REST = 1e-5; // share of the arm's size: a shorter step is none

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

// The way of the tool while it is moved: a line that grows by 12 bytes a point.
export class Trail {
  constructor(scene, THREE) {
    this.THREE = THREE;
    this.size = 1;
    this.count = 0;
    this.sent = 0;
    this.points = new Float32Array(3 * MOST_POINTS);
    const geometry = new THREE.BufferGeometry();
    this.attribute = new THREE.BufferAttribute(this.points, 3).setUsage(THREE.DynamicDrawUsage);
    geometry.setAttribute("position", this.attribute);
    geometry.setDrawRange(0, 0);
    this.line = new THREE.Line(geometry, new THREE.LineBasicMaterial());
    this.line.frustumCulled = false;
    scene.add(this.line);
  }

  color(color) {
    this.line.material.color.set(color);
  }

  begin(size) {
    this.size = size;
    this.clear();
  }

  clear() {
    this.count = this.sent = 0;
  }

  show(visible) {
    this.line.visible = visible;
    if (!visible) this.clear();
  }

  // point: x y z in the world (z up), m.
  append(point) {
    if (!this.line.visible) return;
    const last = this.points.subarray(3 * this.count - 3, 3 * this.count);
    const step = this.count
      ? Math.hypot(point[0] - last[0], point[1] - last[1], point[2] - last[2])
      : Infinity;
    if (step < REST * this.size) return;
    if (this.count && step > JUMP * this.size) this.clear();
    if (this.count === MOST_POINTS) {
      this.points.copyWithin(0, 3 * (MOST_POINTS / 2));
      this.count = MOST_POINTS / 2;
      this.sent = 0;
    }
    this.points.set(point, 3 * this.count++);
  }

  // Hand over all points since the last picture at once: three.js keeps a single range of what has changed.
  upload() {
    this.line.geometry.setDrawRange(0, this.count);
    if (this.sent === this.count) return;
    Object.assign(this.attribute.updateRange, {
      offset: 3 * this.sent,
      count: 3 * (this.count - this.sent),
    });
    this.attribute.needsUpdate = true;
    this.sent = this.count;
  }
}

function tubeGeometry(points, radius, THREE) {
  const count = points.length / 3;
  const at = (i) => new THREE.Vector3().fromArray(points, 3 * Math.max(0, Math.min(count - 1, i)));
  const positions = new Float32Array(3 * SIDES * count);
  const tangent = new THREE.Vector3(0, 0, 1),
    normal = new THREE.Vector3(1, 0, 0),
    side = new THREE.Vector3();
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
      const a = i * SIDES + k,
        b = i * SIDES + ((k + 1) % SIDES);
      index.set([a, b, a + SIDES, b, b + SIDES, a + SIDES], at);
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setIndex(new THREE.BufferAttribute(index, 1));
  return geometry;
}
