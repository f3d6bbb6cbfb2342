// What is drawn beside the arm: a cloud of points, ellipsoids, ghosts, which are the arm in further states, a ghost that
// moves along with an animation, and obstacles.

import { PER_SOLID, PER_TRANSFORM, placements } from "./messages.js";
import { isFloor, solid } from "./obstacles.js";

const SPRITE = 32; // px
const NAMES = ["points", "ellipsoids", "ghosts", "companion", "obstacles"];
const ROD = 0.0035; // radius of a skeleton's rods, share of its size
const NONE = new Uint8Array(0);
const SAME = 1e-4; // m and rad
const BEHIND = 300; // by which a ghost is drawn farther away, in steps of the depth: about 15 mm for an arm of 1 m
const GHOST = 0.3,
  BALL = 0.3; // opacities

export class Overlays {
  constructor(scene, THREE) {
    this.THREE = THREE;
    this.layers = Object.fromEntries(NAMES.map((name) => [name, new Layer(scene, THREE)]));
    this.skeletons = new Skeletons(scene, THREE);
    this.dot = sprite(THREE);
    this.ballColor = new THREE.Color();
    this.glow = 1; // factor of the colours of points: dark ones would not be seen on a dark ground
    this.solidColor = new THREE.Color();
    this.marked = null; // index of the obstacle that is chosen
  }

  get empty() {
    return (
      !this.skeletons.count &&
      Object.values(this.layers).every((layer) => !layer.group.children.length)
    );
  }

  // Take all that is shown into a box, or, beside panels, where ghosts come and go all the time, the obstacles alone.
  growBox(box, onlyObstacles) {
    const layers = onlyObstacles ? [this.layers.obstacles] : Object.values(this.layers);
    for (const layer of layers) if (layer.group.visible) box.union(layer.box);
  }

  get shown() {
    return this.skeletons.group.visible;
  }

  show(visible) {
    for (const { group } of [this.skeletons, ...Object.values(this.layers)])
      group.visible = visible;
  }

  color(balls, solids, glow) {
    this.glow = glow;
    this.layers.points.group.traverse((object) => object.material?.color.setScalar(glow));
    this.ballColor.set(balls);
    this.solidColor.set(solids);
    this.layers.ellipsoids.group.traverse((object) => object.material?.color.set(balls));
    this.colorObstacles();
  }

  // size: diameter of a point; three.js takes it for a field of view of 90 degrees.
  setPoints({ points, colors }, size, field) {
    const { THREE } = this;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(colors, 3, true));
    const look = {
      size: size / Math.tan((field * Math.PI) / 360),
      vertexColors: true,
      map: this.dot,
      alphaTest: 0.5,
    };
    const box = new THREE.Box3().setFromBufferAttribute(geometry.attributes.position);
    this.layers.points.fill(
      points.length ? [new THREE.Points(geometry, new THREE.PointsMaterial(look))] : [],
      box,
    );
    this.layers.points.group.traverse((object) => object.material?.color.setScalar(this.glow));
  }

  setEllipsoids({ transforms }) {
    const { THREE } = this;
    const balls = [],
      box = new THREE.Box3();
    for (let at = 0; at < transforms.length; at += PER_TRANSFORM) {
      const ball = unitBall(this.ballColor, THREE);
      ball.matrixAutoUpdate = false;
      ball.matrix.set(...transforms.subarray(at, at + PER_TRANSFORM), 0, 0, 0, 1);
      const cube = new THREE.Box3(new THREE.Vector3(-1, -1, -1), new THREE.Vector3(1, 1, 1));
      box.union(cube.applyMatrix4(ball.matrix));
      balls.push(ball);
    }
    this.layers.ellipsoids.fill(balls, box);
  }

  // What was drawn for an arm goes with it; obstacles stay.
  leaveArm() {
    for (const name of ["points", "ellipsoids", "ghosts"])
      this.layers[name].fill([], new this.THREE.Box3());
    this.skeletons.set(new Float32Array(), 1, NONE, 0);
    this.last = null;
  }

  // stage: whose nodes are copied; each copy shares their geometry.
  // skeletons: whether a ghost is only rods between its frames, which a slow machine can draw many of.
  setGhosts({ transforms, tints }, { nodes, boxAt, skeletons = false }) {
    const { THREE } = this;
    const { positions, quaternions } = placements(transforms, THREE);
    const ghosts = [],
      box = new THREE.Box3(),
      count = tints.length / 3;
    for (let k = 0; k < count; k++) box.union(boxAt(positions, quaternions, k));
    const {
        layers: { ghosts: layer },
        last,
      } = this,
      key = tints.join();
    this.skeletons.set(
      positions,
      nodes.length,
      skeletons ? tints : NONE,
      ROD * box.getSize(new THREE.Vector3()).length(),
    );
    if (skeletons) {
      this.last = null;
      return void layer.fill([], box);
    }
    if (last?.nodes === nodes && last.key === key) {
      const each = nodes.length - 1;
      for (let k = 0; k < count; k++)
        place(layer.group.children.slice(k * each, (k + 1) * each), positions, quaternions, k);
      showOnce(layer.group.children, each);
      layer.box = box;
      return;
    }
    this.last = { nodes, key };
    for (let k = 0; k < count; k++) {
      const ghost = ghostOf(nodes, tints.subarray(3 * k, 3 * k + 3), THREE);
      place(ghost, positions, quaternions, k);
      ghosts.push(...ghost);
    }
    showOnce(ghosts, nodes.length - 1);
    layer.fill(ghosts, box, { shared: true });
  }

  // A ghost for the motion on show, as large as the box of all its states; without a tint there is none.
  setCompanion(tint, nodes, box) {
    const ghost = tint ? ghostOf(nodes, tint, this.THREE) : [];
    this.layers.companion.fill(ghost, box, { shared: true });
  }

  // positions, quaternions: of all nodes, in order.
  placeCompanion(positions, quaternions) {
    place(this.layers.companion.group.children, positions, quaternions, 0);
  }

  setObstacles({ solids }) {
    const { THREE } = this;
    const objects = [],
      box = new THREE.Box3();
    for (let at = 0; at < solids.length; at += PER_SOLID) {
      const numbers = solids.subarray(at, at + PER_SOLID);
      const object = solid(numbers, this.solidColor, THREE);
      // A floor has no end that could be in view.
      if (!isFloor(numbers))
        box.union(new THREE.Box3().copy(object.geometry.boundingBox).applyMatrix4(object.matrix));
      objects.push(object);
    }
    this.layers.obstacles.fill(objects, box);
    this.colorObstacles();
  }

  // index: of the obstacle that is drawn in the accent's color, or null.
  markObstacle(index) {
    this.marked = index;
    this.colorObstacles();
  }

  colorObstacles() {
    this.layers.obstacles.group.children.forEach((object, index) => {
      const color = index === this.marked ? this.ballColor : this.solidColor;
      object.traverse((part) => part.material?.color.set(color));
    });
  }

  // The index of the obstacle that a ray meets first, or null.
  obstacleAt(caster) {
    const { group } = this.layers.obstacles;
    const [hit] = caster.intersectObjects(group.children, false);
    return hit ? group.children.indexOf(hit.object) : null;
  }
}

// Objects that come and go together, and the box around them.
class Layer {
  constructor(scene, THREE) {
    this.group = new THREE.Group();
    this.box = new THREE.Box3();
    this.shared = false;
    scene.add(this.group);
  }

  // shared: whether the objects' geometry belongs to someone else.
  fill(objects, box, { shared = false } = {}) {
    this.group.traverse((object) => {
      object.material?.dispose();
      if (!this.shared) object.geometry?.dispose();
    });
    this.group.clear();
    if (objects.length) this.group.add(...objects);
    this.box = box;
    this.shared = shared;
  }
}

// Translucent copies of an arm's nodes but the first: the base stands where the arm's own does.
function ghostOf(nodes, [r, g, b], THREE) {
  const color = new THREE.Color(r / 255, g / 255, b / 255);
  // A ghost that is nearly where the arm is lies behind it, and does not flicker through its surface.
  const behind = { polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: BEHIND };
  const material = new THREE.MeshLambertMaterial({
    color,
    transparent: true,
    opacity: GHOST,
    ...behind,
  });
  return nodes.slice(1).map((node) => bareCopy(node, material, THREE));
}

// Put a ghost's nodes where the k-th of the given states has them.
function place(ghost, positions, quaternions, k) {
  const nodes = ghost.length + 1;
  ghost.forEach((copy, j) => {
    const i = k * nodes + j + 1;
    copy.position.fromArray(positions, 3 * i);
    copy.quaternion.fromArray(quaternions, 4 * i);
  });
}

// Ghosts as rods between the origins of their frames: objects that are kept, since a new material would have to be
// compiled for each picture of a drag.
class Skeletons {
  constructor(scene, THREE) {
    this.THREE = THREE;
    this.group = new THREE.Group();
    this.rod = new THREE.CylinderGeometry(1, 1, 1, 8);
    this.ball = new THREE.SphereGeometry(1.7, 12, 8);
    this.materials = new Map();
    scene.add(this.group);
  }

  // positions: 3 for each of the nodes of each ghost.
  set(positions, nodes, tints, radius) {
    let used = 0;
    const next = (geometry, material) => {
      const mesh = this.group.children[used] ?? new this.THREE.Mesh();
      if (!mesh.parent) this.group.add(mesh);
      used++;
      return Object.assign(mesh, { geometry, material, visible: true, renderOrder: 1 });
    };
    const at = (i) => new this.THREE.Vector3().fromArray(positions, 3 * i),
      up = new this.THREE.Vector3(0, 1, 0);
    for (let k = 0; k < tints.length / 3; k++) {
      const material = this.material(tints.subarray(3 * k, 3 * k + 3));
      let from = at(k * nodes);
      for (let i = 1; i < nodes; i++) {
        const to = at(k * nodes + i),
          along = to.clone().sub(from),
          length = along.length();
        if (length < radius) continue;
        const rod = next(this.rod, material);
        rod.position.addVectors(from, to).multiplyScalar(0.5);
        rod.quaternion.setFromUnitVectors(up, along.divideScalar(length));
        rod.scale.set(radius, length, radius);
        const ball = next(this.ball, material);
        ball.position.copy(to);
        ball.scale.setScalar(radius);
        from = to;
      }
    }
    for (const mesh of this.group.children.slice(used)) mesh.visible = false;
    this.count = tints.length / 3;
  }

  material([r, g, b]) {
    const key = `${r} ${g} ${b}`;
    if (!this.materials.has(key))
      this.materials.set(
        key,
        new this.THREE.MeshBasicMaterial({
          color: new this.THREE.Color(r / 255, g / 255, b / 255),
        }),
      );
    return this.materials.get(key);
  }
}

// Links of several ghosts at the same place would flicker through each other: the first alone is drawn.
function showOnce(copies, each) {
  copies.forEach((copy, i) => {
    copy.visible = true;
    for (let j = i % each; j < i && copy.visible; j += each) {
      const other = copies[j];
      if (
        other.visible &&
        other.position.distanceTo(copy.position) < SAME &&
        other.quaternion.angleTo(copy.quaternion) < SAME
      )
        copy.visible = false;
    }
  });
}

// A node without its triad, in one material, without shadow.
export function bareCopy(node, material, THREE) {
  const copy = new THREE.Group();
  for (const part of node.children) if (part.name !== "frame") copy.add(part.clone());
  copy.traverse((object) => {
    if (!object.isMesh) return;
    object.material = material;
    object.castShadow = object.receiveShadow = false;
    object.renderOrder = 1;
  });
  return copy;
}

// A ball of radius 1 with the circles around its axes, so that its shape is seen.
function unitBall(color, THREE) {
  const look = { color, transparent: true, opacity: BALL, depthWrite: false };
  const ball = new THREE.Mesh(
    new THREE.SphereGeometry(1, 48, 32),
    new THREE.MeshLambertMaterial(look),
  );
  ball.renderOrder = 2;
  const circle = new THREE.BufferGeometry().setFromPoints(
    new THREE.EllipseCurve(0, 0, 1, 1).getPoints(64),
  );
  for (const axis of ["x", "y", "z"]) {
    const line = new THREE.LineLoop(circle, new THREE.LineBasicMaterial({ color }));
    if (axis !== "z") line.rotation[axis] = Math.PI / 2;
    line.renderOrder = 2;
    ball.add(line);
  }
  return ball;
}

// A round dot: three.js draws points as squares.
function sprite(THREE) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = SPRITE;
  const pen = canvas.getContext("2d");
  pen.fillStyle = "#fff";
  pen.arc(SPRITE / 2, SPRITE / 2, SPRITE / 2, 0, 2 * Math.PI);
  pen.fill();
  return new THREE.CanvasTexture(canvas);
}
