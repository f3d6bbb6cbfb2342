// A target in the scene: three arrows to move it and three rings to turn it.

import { inView } from "../boxes.js";
import { AXES } from "../colors.js";

const { THREE } = MeshCat;
const LENGTH = 0.16; // of the arm's reach
const OUT_OF_REACH = 0x9aa3b2;

export class Gizmo {
  // moved(T): called with the target's pose, 16 numbers by row, as it is dragged; told(): the pose that Python has.
  constructor(stage, moved, told) {
    this.told = told;
    this.stage = stage;
    this.moved = moved;
    this.group = new THREE.Group();
    this.group.visible = false;
    this.group.matrixAutoUpdate = false;
    this.pose = new THREE.Matrix4();
    this.handles = [];
    for (let axis = 0; axis < 3; axis++) this.handles.push(this.arrow(axis), this.ring(axis));
    stage.viewer.scene.add(this.group);
    const canvas = stage.viewer.renderer.domElement;
    // Before the camera's own listeners, which would turn the view.
    stage.pane.addEventListener("pointerdown", (event) => this.grab(event, canvas), {
      capture: true,
    });
    addEventListener("pointermove", (event) => this.drag(event));
    addEventListener("pointerup", () => this.release());
    addEventListener("pointercancel", () => this.release());
    canvas.addEventListener("pointermove", (event) => this.hover(event));
  }

  material(axis) {
    return new THREE.MeshBasicMaterial({
      color: AXES[axis],
      transparent: true,
      opacity: 0.9,
      depthTest: false,
    });
  }

  arrow(axis) {
    const handle = new THREE.Group(),
      material = this.material(axis);
    const shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.025, 0.025, 0.8, 10), material);
    shaft.position.y = 0.4;
    const tip = new THREE.Mesh(new THREE.ConeGeometry(0.075, 0.22, 16), material);
    tip.position.y = 0.9;
    const wide = new THREE.Mesh(
      new THREE.CylinderGeometry(0.1, 0.1, 1.1, 8),
      new THREE.MeshBasicMaterial({ visible: false }),
    );
    wide.position.y = 0.55;
    handle.add(shaft, tip, wide);
    if (axis === 0) handle.rotation.z = -Math.PI / 2;
    if (axis === 2) handle.rotation.x = Math.PI / 2;
    return this.keep(handle, { axis, turns: false, material });
  }

  ring(axis) {
    const handle = new THREE.Group(),
      material = this.material(axis);
    handle.add(
      new THREE.Mesh(new THREE.TorusGeometry(0.72, 0.02, 8, 60), material),
      new THREE.Mesh(
        new THREE.TorusGeometry(0.72, 0.07, 6, 40),
        new THREE.MeshBasicMaterial({ visible: false }),
      ),
    );
    if (axis === 0) handle.rotation.y = Math.PI / 2;
    if (axis === 1) handle.rotation.x = Math.PI / 2;
    return this.keep(handle, { axis, turns: true, material });
  }

  keep(handle, about) {
    handle.traverse((object) => Object.assign(object, { renderOrder: 10, castShadow: false }));
    handle.userData = about;
    this.group.add(handle);
    return handle;
  }

  // T: 16 numbers by row, or null for no target.
  set(T, reached, reach) {
    if (!T && !this.group.visible) return;
    this.group.visible = Boolean(T);
    this.reach = reach;
    if (T && !this.dragged) this.pose.set(...T);
    for (const { userData } of this.handles)
      userData.material.color.set(reached ? AXES[userData.axis] : OUT_OF_REACH);
    this.place();
  }

  place() {
    this.group.matrix
      .copy(this.pose)
      .scale(new THREE.Vector3().setScalar(LENGTH * (this.reach || 1)));
    this.group.matrixWorldNeedsUpdate = true;
    this.stage.dirty();
  }

  hit(event) {
    if (!this.group.visible) return null;
    this.group.updateMatrixWorld(true);
    const [first] = this.stage.ray(event).intersectObjects(this.handles, true);
    if (!first) return null;
    let object = first.object;
    while (!this.handles.includes(object)) object = object.parent;
    return object;
  }

  hover(event) {
    if (this.dragged) return;
    const handle = this.hit(event);
    this.stage.pane.style.cursor = handle ? "grab" : "";
    for (const other of this.handles) other.userData.material.opacity = other === handle ? 1 : 0.75;
    if (this.group.visible) this.stage.dirty();
  }

  grab(event) {
    const handle = event.button === 0 ? this.hit(event) : null;
    if (!handle) return;
    event.stopPropagation();
    event.preventDefault();
    const { axis, turns } = handle.userData;
    const start = this.pose.clone(),
      origin = inView(new THREE.Vector3().setFromMatrixPosition(start));
    const direction = inView(new THREE.Vector3().setFromMatrixColumn(start, axis)).normalize();
    const at = (e) => (turns ? this.angle(e, origin, direction) : this.along(e, origin, direction));
    const first = at(event);
    if (first === null) return;
    this.dragged = { axis, turns, start, at, first };
    this.stage.viewer.controls.enabled = false;
    this.stage.held = true;
    this.stage.pane.style.cursor = "grabbing";
  }

  drag(event) {
    if (!this.dragged) return;
    const { axis, turns, start, at, first } = this.dragged,
      now = at(event);
    if (now === null) return;
    const step = new THREE.Matrix4(),
      by = now - first;
    if (turns) step.makeRotationAxis(new THREE.Vector3().setComponent(axis, 1), by);
    else step.makeTranslation(...[0, 1, 2].map((k) => (k === axis ? by : 0)));
    this.pose.multiplyMatrices(start, step);
    this.place();
    this.moved(this.pose.clone().transpose().toArray());
  }

  release() {
    if (!this.dragged) return;
    this.dragged = null;
    this.stage.viewer.controls.enabled = true;
    this.stage.held = false;
    const T = this.told();
    if (T) this.pose.set(...T); // what the arm can meet
    this.place();
    this.stage.pane.style.cursor = "";
  }

  // How far along an axis the pointer is: where its ray is nearest to the axis.
  along(event, origin, direction) {
    const { ray } = this.stage.ray(event),
      between = origin.clone().sub(ray.origin);
    const b = direction.dot(ray.direction),
      d = direction.dot(between),
      e = ray.direction.dot(between);
    const slant = 1 - b * b;
    return slant < 1e-4 ? null : (b * e - d) / slant;
  }

  // How far round an axis the pointer is, on the plane at right angles to it.
  angle(event, origin, direction) {
    const { ray } = this.stage.ray(event),
      plane = new THREE.Plane().setFromNormalAndCoplanarPoint(direction, origin);
    const point = ray.intersectPlane(plane, new THREE.Vector3());
    if (!point) return null;
    point.sub(origin);
    const seen =
      Math.abs(direction.y) < 0.9 ? new THREE.Vector3(0, 1, 0) : new THREE.Vector3(1, 0, 0);
    const u = new THREE.Vector3().crossVectors(seen, direction).normalize(),
      v = new THREE.Vector3().crossVectors(direction, u);
    return Math.atan2(point.dot(v), point.dot(u));
  }
}
