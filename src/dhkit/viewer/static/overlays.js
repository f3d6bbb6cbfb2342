// What is drawn beside the arm: a cloud of points, ellipsoids, ghosts, which are the arm in further states, and obstacles.

import { PER_SOLID, PER_TRANSFORM, placements } from "./messages.js";
import { isFloor, solid } from "./obstacles.js";

const SPRITE = 32; // px
const NAMES = ["points", "ellipsoids", "ghosts", "obstacles"];
const GHOST = 0.3, BALL = 0.3; // opacities

export class Overlays {
  constructor(scene, THREE) {
    this.THREE = THREE;
    this.layers = Object.fromEntries(NAMES.map((name) => [name, new Layer(scene, THREE)]));
    this.dot = sprite(THREE);
    this.ballColor = new THREE.Color();
    this.solidColor = new THREE.Color();
  }

  get empty() {
    return Object.values(this.layers).every((layer) => !layer.group.children.length);
  }

  // Take all that is shown into a box.
  growBox(box) {
    for (const layer of Object.values(this.layers)) if (layer.group.visible) box.union(layer.box);
  }

  show(visible) {
    for (const layer of Object.values(this.layers)) layer.group.visible = visible;
  }

  color(balls, solids) {
    this.ballColor.set(balls);
    this.solidColor.set(solids);
    this.layers.ellipsoids.group.traverse((object) => object.material?.color.set(balls));
    this.layers.obstacles.group.traverse((object) => object.material?.color.set(solids));
  }

  // size: diameter of a point; three.js takes it for a field of view of 90 degrees.
  setPoints({ points, colors }, size, field) {
    const { THREE } = this;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(colors, 3, true));
    const look = { size: size / Math.tan((field * Math.PI) / 360), vertexColors: true, map: this.dot, alphaTest: 0.5 };
    const box = new THREE.Box3().setFromBufferAttribute(geometry.attributes.position);
    this.layers.points.fill(points.length ? [new THREE.Points(geometry, new THREE.PointsMaterial(look))] : [], box);
  }

  setEllipsoids({ transforms }) {
    const { THREE } = this;
    const balls = [], box = new THREE.Box3();
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

  // stage: whose nodes are copied; each copy shares their geometry.
  setGhosts({ transforms, tints }, { nodes, boxAt }) {
    const { THREE } = this;
    const { positions, quaternions } = placements(transforms, THREE);
    const ghosts = [], box = new THREE.Box3();
    for (let k = 0; k < tints.length / 3; k++) {
      const [r, g, b] = tints.subarray(3 * k, 3 * k + 3);
      const color = new THREE.Color(r / 255, g / 255, b / 255);
      const material = new THREE.MeshLambertMaterial({ color, transparent: true, opacity: GHOST });
      // The base stands where the arm's own does.
      nodes.slice(1).forEach((node, j) => {
        const i = j + 1;
        const copy = bareCopy(node, material, THREE);
        copy.position.fromArray(positions, 3 * (k * nodes.length + i));
        copy.quaternion.fromArray(quaternions, 4 * (k * nodes.length + i));
        ghosts.push(copy);
      });
      box.union(boxAt(positions, quaternions, k));
    }
    this.layers.ghosts.fill(ghosts, box, { shared: true });
  }

  setObstacles({ solids }) {
    const { THREE } = this;
    const objects = [], box = new THREE.Box3();
    for (let at = 0; at < solids.length; at += PER_SOLID) {
      const numbers = solids.subarray(at, at + PER_SOLID);
      const object = solid(numbers, this.solidColor, THREE);
      // A floor has no end that could be in view.
      if (!isFloor(numbers)) box.union(new THREE.Box3().copy(object.geometry.boundingBox).applyMatrix4(object.matrix));
      objects.push(object);
    }
    this.layers.obstacles.fill(objects, box);
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

// A node without its triad, in one material, without shadow.
function bareCopy(node, material, THREE) {
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
  const ball = new THREE.Mesh(new THREE.SphereGeometry(1, 48, 32), new THREE.MeshLambertMaterial(look));
  ball.renderOrder = 2;
  const circle = new THREE.BufferGeometry().setFromPoints(new THREE.EllipseCurve(0, 0, 1, 1).getPoints(64));
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
