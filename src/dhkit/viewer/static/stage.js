// The scene on screen: meshcat's viewer without its panels, our camera, light and colors.

import { corners, inView, localBox } from "./boxes.js";
import { AXES } from "./colors.js";
import { Labels } from "./labels.js";
import { placements } from "./messages.js";
import { Outlines } from "./outlines.js";
import { Overlays } from "./overlays.js";
import { HEIGHT, person } from "./person.js";
import { Quality, drawnInSoftware } from "./quality.js";
import { smoothNormals } from "./smooth.js";
import { Trace, Trail } from "./trace.js";

const { THREE } = MeshCat;
const FIELD = 34; // degrees of view, vertically
const MARGIN = 1.07; // around the arm
const SAMPLES = 60; // states of an animation that the camera must take in
const SOLID_GHOSTS = 2; // more are drawn as skeletons beside panels
const GREY = [148, 156, 168]; // of ghosts
const REST = 400; // ms without a change after which the picture is drawn finely
const LONG_REST = 900; // the same, with shadows, which take a processor three times as long
const FLOOR = 4; // edge of the floor that takes shadows, share of the arm's size: none falls farther away
const FINEST = 2; // pixels of the picture for one of the page
const TRACE_RADIUS = 0.0035; // share of the arm's size
const BESIDE = 0.5; // from the base to the person, share of the arm's size
const BESIDE_MARGIN = 0.3; // m, added to it
const SHOULDER = 0.3; // half of a person's width, m
const POINT = 0.008; // diameter of a point, share of the arm's size
const TRIAD = 0.13; // length of a triad, share of the arm's size: dhkit/viewer/scene.py

export class Stage {
  // insets(): how many px at the left, top, right and bottom are covered by panels.
  constructor(pane, labels, names, marks, insets) {
    this.pane = pane;
    this.insets = insets;
    // Without a graphics processor smooth edges halve the number of pictures: they wait until nothing moves.
    this.software = drawnInSoftware();
    const renderer = new THREE.WebGLRenderer({ antialias: !this.software, alpha: true });
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    pane.append(renderer.domElement);
    this.viewer = new MeshCat.Viewer(pane, false, renderer);
    this.ratio = Math.min(devicePixelRatio, FINEST);
    this.sharp = false; // whether the picture on show is drawn finely
    this.fine = false; // whether it is drawn as finely as can be, with shadows
    this.changed = 0; // ms, when the last picture of a motion was drawn
    this.labels = new Labels(labels);
    this.names = new Labels(names); // of ghosts
    this.marks = new Labels(marks); // of a gap
    this.gap = null; // the middle between two links that touch each other
    this.anchors = []; // where each ghost is named
    this.awaited = 0; // ms until which a pose is awaited
    this.naming = true; // whether ghosts are of the state on show: no animation goes away from them
    this.nodes = [];
    this.old = []; // materials of a scene that is gone
    this.seen = new THREE.Box3();
    this.framed = new THREE.Box3();
    this.touched = false;
    this.placement = null; // what the camera takes in
    this.framesShown = false;
    this.tameViewer();
    this.light();
    this.quality = new Quality([() => this.withoutShadows(), () => this.withoutGloss()]);
    this.plain = false;
    this.shadowsAtRest = false; // whether only pictures at rest have shadows
    this.given = new Trace(this.viewer.scene, THREE);
    this.drawn = new Trace(this.viewer.scene, THREE);
    this.trail = new Trail(this.viewer.scene, THREE);
    this.steady = false; // whether the camera only moves when the arm leaves the picture
    this.held = false; // whether it does not move at all: a person drags something
    this.preset = null; // direction to look from
    this.overlays = new Overlays(this.viewer.scene, THREE);
    this.outlines = new Outlines(this.viewer.scene, THREE);
    this.rendered = []; // called after each picture
    const scheme = matchMedia("(prefers-color-scheme: dark)");
    scheme.addEventListener("change", () => this.color());
    this.color();
    new ResizeObserver(() => this.resize()).observe(pane);
    this.resize();
  }

  // meshcat sizes itself by the window, hangs a panel of unnamed inputs on the page and paints a gradient.
  tameViewer() {
    const { viewer } = this;
    viewer.set_3d_pane_size = () => this.resize();
    viewer.gui.domElement.remove();
    viewer.renderer.setPixelRatio(this.ratio);
    viewer.hide_background();
    for (const name of ["Lights", "Grid", "Axes"]) viewer.set_property([name], "visible", false);
  }

  light() {
    this.sky = new THREE.HemisphereLight(0xffffff, 0xffffff, 0.68);
    this.sky.position.set(0, 0, 1);
    this.key = new THREE.DirectionalLight(0xffffff, 0.52);
    this.key.castShadow = true;
    this.key.shadow.mapSize.set(1024, 1024);
    this.key.shadow.radius = 4;
    this.fill = new THREE.DirectionalLight(0xffffff, 0.16);
    this.floor = new THREE.Mesh(
      new THREE.PlaneGeometry(1, 1),
      new THREE.ShadowMaterial({ opacity: 0.16, depthWrite: false }),
    );
    this.floor.receiveShadow = true;
    this.viewer.scene.add(this.sky, this.key, this.key.target, this.fill, this.floor);
  }

  // Panels are beside the scene: a person moves the arm, and pictures must keep up.
  beside() {
    this.steady = true;
    if (this.software) this.quality.saveAll();
    document.body.classList.toggle("software", this.software);
    // The arm of an edited table has surfaces that meshes have not: their program is compiled with the first picture.
    const material = new THREE.MeshPhongMaterial({
      shininess: 40,
      specular: 0x222222,
      side: THREE.FrontSide,
    });
    const like = new THREE.Mesh(new THREE.SphereGeometry(0, 3, 2), material);
    finish(like, !this.plain);
    this.viewer.scene.add(like);
  }

  // Shadows wait, as smooth edges do, until nothing moves.
  withoutShadows() {
    this.shadowsAtRest = true;
    this.castShadows(false);
    this.dirty();
  }

  castShadows(cast) {
    this.key.castShadow = cast;
    this.floor.visible = cast;
  }

  // Gloss waits too, where a picture at rest is drawn once more.
  withoutGloss() {
    this.plain = true;
    this.ratio = 1;
    this.viewer.renderer.setPixelRatio(1);
    this.gloss(false);
    this.resize();
  }

  gloss(glossy) {
    for (const node of this.nodes) node.traverse((object) => finish(object, glossy));
  }

  color() {
    const style = getComputedStyle(document.documentElement);
    const value = (name) => style.getPropertyValue(name).trim();
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    this.grid?.material.color.set(value("--grid"));
    this.sky.groundColor.set(dark ? 0x6a7080 : 0xb4b8c4);
    this.floor.material.opacity = dark ? 0.35 : 0.13;
    for (const trace of [this.given, this.drawn, this.trail]) trace.color(value("--accent"));
    this.overlays.color(value("--accent"), value("--obstacle"), Number(value("--glow")));
    this.outlines.color();
    this.dirty();
  }

  dirty() {
    this.viewer.set_dirty();
  }

  resize() {
    const width = Math.max(1, this.pane.clientWidth),
      height = Math.max(1, this.pane.clientHeight);
    this.viewer.camera.aspect = width / height;
    this.viewer.renderer.setSize(width, height);
    this.outlines?.resize(width, height);
    this.refit();
    this.dirty();
  }

  build({ about, commands, joints }) {
    const { viewer } = this;
    this.quality.begin();
    const node = (...path) => viewer.scene_tree.find(["dhkit", ...path]).object;
    // An edited arm has the parts it had: nodes stay (meshcat hangs controls on every new one), and what is equal.
    const paths = about.nodes.join(),
      stay = this.paths === paths;
    const changed = commands
      .map((command, k) => k)
      .filter((k) => !stay || !equal(commands[k], this.commands[k]));
    const objects = stay
      ? changed
          .map((k) => about.nodes[k])
          .filter(Boolean)
          .map((path) => node(...path.split("/"), "<object>"))
      : [node()];
    this.keepPrograms(objects);
    if (!stay) viewer.delete_path(["dhkit"]);
    for (const k of changed) viewer.handle_command_bytearray(commands[k]);
    for (const k of changed)
      if (about.nodes[k])
        node(...about.nodes[k].split("/"), "<object>").traverse(
          (object) => object.isMesh && smoothNormals(object.geometry, THREE),
        );
    [this.paths, this.commands] = [paths, commands];
    this.nodes = [];
    for (let i = 0; i <= joints; i++) this.nodes.push(node(`link${i}`));
    this.nodes.push(node("tool"));
    if (this.plain) this.gloss(false);
    this.parts = null; // of Python, where others are drawn
    this.grid = node("grid", "<object>");
    this.grid.castShadow = this.grid.receiveShadow = false;
    this.grid.material.depthWrite = false;
    this.size = about.size;
    this.trail.begin(about.size);
    this.up = new THREE.Vector3(...about.up);
    this.takeParts(about.labels);
    this.placePerson();
    this.setUp();
    this.color();
  }

  // What belongs to the nodes' present parts.
  takeParts(labels) {
    // Looked up among the children: finding a path in the tree would create it.
    this.triads = this.nodes.map((n) => n.children.find((child) => child.name === "frame"));
    for (const triad of this.triads)
      triad?.traverse((o) => void ((o.renderOrder = 2), (o.castShadow = o.receiveShadow = false)));
    // A scene begins with its triads hidden: what a person has switched on stays on.
    for (const triad of this.triads) if (triad) triad.visible = this.framesShown;
    this.labels.set(labels);
    this.boxes = this.nodes.map((n) => localBox(n));
    this.warned = null;
    this.outlines.set([], this.nodes);
    this.seen.makeEmpty();
    this.framed.makeEmpty();
  }

  // Draw other parts than Python's: objects of each node, and labels; null: Python's again.
  redraw(objects, labels) {
    this.parts ??= this.nodes.map((node) => [...node.children]);
    this.nodes.forEach((node, i) => {
      node.clear();
      for (const object of objects ? [...objects[i], this.triad()] : this.parts[i])
        node.add(object);
    });
    if (!objects) this.parts = null;
    this.takeParts(labels);
    this.dirty();
  }

  triad() {
    const triad = this.axes(TRIAD * this.size, 0.004 * this.size);
    triad.name = "frame";
    return triad;
  }

  // A program whose last material goes is compiled anew for the next: the old materials go behind the next picture.
  keepPrograms(objects) {
    const spent = new THREE.Material();
    for (const root of objects)
      root.traverse((object) => {
        if (!object.material) return;
        this.old.push(...[object.material, ...(object.userData.finishes ?? [])].flat());
        object.material = spent;
        delete object.userData.finishes;
      });
  }

  setUp() {
    const { viewer, size } = this;
    const camera = viewer.camera;
    camera.fov = FIELD;
    camera.near = size / 100;
    camera.far = 60 * size;
    if (!this.touched) {
      // The turning rule is fixed when controls are made, so a new up needs new controls.
      camera.up.copy(inView(this.up));
      viewer.controls.dispose();
      viewer.set_camera(camera);
      viewer.controls.addEventListener("start", () => (this.touched = true));
    }
    const place = (light, x, y, z) => light.position.set(x * size, y * size, z * size);
    place(this.key, 0.7, -2.1, 2.6);
    place(this.fill, -2, 1, 0.5);
    const shadow = this.key.shadow.camera;
    Object.assign(shadow, {
      left: -1.5 * size,
      right: 1.5 * size,
      top: 1.5 * size,
      bottom: -1.5 * size,
    });
    Object.assign(shadow, { near: 0.1 * size, far: 6 * size });
    shadow.updateProjectionMatrix();
    this.key.shadow.bias = -0.0015;
    this.key.shadow.normalBias = 0.004 * size;
    this.floor.scale.setScalar(FLOOR * size);
    this.floor.position.z = -0.0005 * size;
  }

  // positions, quaternions: of all nodes, in order.
  place(positions, quaternions) {
    this.nodes.forEach((node, i) => {
      node.position.fromArray(positions, 3 * i);
      node.quaternion.fromArray(quaternions, 4 * i);
    });
    this.outlines.place(this.nodes);
    this.dirty();
  }

  // Keep what was seen so far in view, unless someone has turned the camera.
  include(placement) {
    this.placement = placement;
    this.seen.union(this.boxOf(placement));
    this.overlays.growBox(this.seen, this.steady);
    if (this.person?.visible) this.seen.union(this.personBox);
    if (this.held || this.touched || this.framed.containsBox(this.seen)) return;
    this.frame(this.seen);
  }

  // Take what is drawn beside the arm into view, unless someone has turned the camera.
  frameAll() {
    if (this.touched) return;
    this.overlays.growBox(this.seen);
    this.frame(this.seen);
  }

  // The box around the arm in all states of a motion, or nearly all.
  boxOf({ positions, quaternions }) {
    const count = positions.length / (3 * this.nodes.length),
      whole = new THREE.Box3();
    const stride = Math.max(1, Math.floor(count / SAMPLES));
    for (let k = 0; k < count; k += stride) whole.union(this.boxAt(positions, quaternions, k));
    return whole.union(this.boxAt(positions, quaternions, count - 1));
  }

  // What is in view stays in view when the free part of the pane changes.
  refit() {
    if (!this.touched && !this.framed.isEmpty()) this.frame(this.framed);
  }

  // Frame anew what is on show.
  reframe() {
    this.forget();
    if (this.placement) this.include(this.placement);
  }

  forget() {
    this.seen.makeEmpty();
    this.framed.makeEmpty();
  }

  boxAt(positions, quaternions, k) {
    const around = this.framesShown ? TRIAD * this.size : 0;
    const whole = new THREE.Box3(),
      pose = new THREE.Matrix4(),
      one = new THREE.Vector3(1, 1, 1);
    this.boxes.forEach((box, i) => {
      const at = k * this.boxes.length + i;
      const position = new THREE.Vector3().fromArray(positions, 3 * at);
      whole.union(new THREE.Box3(position.clone(), position.clone()).expandByScalar(around));
      if (box.isEmpty()) return;
      pose.compose(position, new THREE.Quaternion().fromArray(quaternions, 4 * at), one);
      whole.union(box.clone().applyMatrix4(pose));
    });
    return whole;
  }

  // Look at a box from the side, so that its corners fill the picture.
  frame(box) {
    this.framed.copy(box);
    const { camera, controls } = this.viewer;
    const centre = inView(box.getCenter(new THREE.Vector3()));
    const direction = inView(this.direction(box)).normalize();
    const right = new THREE.Vector3().crossVectors(camera.up, direction).normalize();
    const above = new THREE.Vector3().crossVectors(direction, right);
    const { wide, tall } = this.freeField();
    let distance = this.size * 0.3;
    for (const corner of corners(box)) {
      const p = inView(corner).sub(centre);
      const across = Math.max(Math.abs(p.dot(right)) / wide, Math.abs(p.dot(above)) / tall);
      distance = Math.max(distance, p.dot(direction) + across * MARGIN);
    }
    camera.position.copy(centre).addScaledVector(direction, distance);
    controls.target.copy(centre);
    controls.update();
    this.dirty();
  }

  // Put the middle of the view into the middle of what panels leave free; return half its width and height at 1 m.
  freeField() {
    const { camera } = this.viewer;
    const width = this.pane.clientWidth,
      height = this.pane.clientHeight;
    const { left, top, right, bottom } = this.insets();
    camera.setViewOffset(width, height, (right - left) / 2, (bottom - top) / 2, width, height);
    const perPixel = (2 * Math.tan((FIELD * Math.PI) / 360)) / height;
    const half = (free) => (perPixel * Math.max(80, free)) / 2;
    return { wide: half(width - left - right), tall: half(height - top - bottom) };
  }

  // From where to look, z up: an arm that moves in a vertical plane from the front, others from the side and above.
  direction(box) {
    if (this.preset) return this.preset.clone();
    if (Math.abs(this.up.z) < 0.5)
      return new THREE.Vector3(0.18, 0, 1).addScaledVector(this.up, 0.14);
    const span = box.getSize(new THREE.Vector3());
    const flat = span.z < 0.25 * Math.max(span.x, span.y);
    return new THREE.Vector3(0.62, -0.78, (flat ? 0.85 : 0.36) * Math.sign(this.up.z));
  }

  // name: front, side, top or iso, as the arm stands.
  look(name) {
    const up = this.up.clone(),
      front = Math.abs(up.z) < 0.5 ? new THREE.Vector3(0, 0, 1) : new THREE.Vector3(1, 0, 0);
    const side = new THREE.Vector3().crossVectors(front, up);
    const views = {
      front,
      side,
      top: up.clone().addScaledVector(side, 1e-3),
      iso: front.clone().add(side).addScaledVector(up, 0.8),
    };
    this.preset = views[name];
    this.touched = false;
    this.setUp();
    this.reframe();
  }

  resetCamera() {
    this.preset = null;
    this.touched = false;
    this.setUp();
    this.reframe();
  }

  showFrames(visible) {
    for (const triad of this.triads ?? []) if (triad) triad.visible = visible;
    this.labels.show(visible);
    this.framesShown = visible;
    if (!this.touched) this.reframe();
    this.dirty();
  }

  // Show a person beside the arm, for size: to the right of it, as one looks at it first.
  showPerson(visible) {
    if (!this.person) {
      this.person = person(THREE);
      this.viewer.scene.add(this.person);
    }
    this.person.visible = visible;
    this.placePerson();
    if (!this.touched) this.reframe();
    this.dirty();
  }

  placePerson() {
    if (!this.person) return;
    const up = this.up.clone();
    const right = new THREE.Vector3().crossVectors(up, this.direction(this.seen)).normalize();
    const back = new THREE.Vector3().crossVectors(up, right);
    const axes = new THREE.Matrix4().makeBasis(right, back, up);
    this.person.quaternion.setFromRotationMatrix(axes);
    this.person.position.copy(right).multiplyScalar(BESIDE_MARGIN + BESIDE * this.size);
    const feet = this.person.position.clone();
    const head = feet.clone().addScaledVector(up, HEIGHT);
    this.personBox = new THREE.Box3().setFromPoints([feet, head]).expandByScalar(SHOULDER);
  }

  // A frame on its way from one pose to another, 16 numbers by row each; null takes it away.
  showMoving(from, to, share) {
    if (!from && !this.moving) return;
    this.moving ??= this.addMoving();
    this.moving.visible = Boolean(from);
    this.dirty();
    if (!from) return;
    const [p, q] = [from, to].map((T) => {
      const matrix = new THREE.Matrix4().set(...T);
      return {
        at: new THREE.Vector3().setFromMatrixPosition(matrix),
        turn: new THREE.Quaternion().setFromRotationMatrix(matrix),
      };
    });
    this.moving.position.lerpVectors(p.at, q.at, share);
    this.moving.quaternion.slerpQuaternions(p.turn, q.turn, share);
  }

  // A frame that is longer and thicker than the triads of the arm.
  addMoving() {
    const axes = this.axes(1.6 * TRIAD * this.size, 0.006 * this.size);
    this.viewer.scene.add(axes);
    return axes;
  }

  // Three rods along x, y and z.
  axes(length, thickness) {
    const axes = new THREE.Group();
    AXES.forEach((color, k) => {
      const rod = new THREE.Mesh(
        new THREE.CylinderGeometry(thickness, thickness, length, 8),
        new THREE.MeshBasicMaterial({ color, depthTest: false, transparent: true }),
      );
      rod.position.setComponent(k, length / 2);
      if (k === 0) rod.rotation.z = -Math.PI / 2;
      if (k === 2) rod.rotation.x = Math.PI / 2;
      rod.renderOrder = 9;
      axes.add(rod);
    });
    return axes;
  }

  // Outline links: those of joints beyond a limit, counted from 0, and two that touch each other, 0 for the base.
  // contact: {links, points} or null; points are where the two are nearest, or null; text: what is written there.
  warn(joints, contact, text = "") {
    const links = contact?.links ?? [],
      key = `${joints}|${links}`;
    if (this.warned !== key) {
      this.warned = key;
      const outlined = this.nodes
        .slice(0, -1)
        .map((_, i) => (links.includes(i) || joints.includes(i - 1) ? "--wrong" : null));
      this.outlines.set(outlined, this.nodes);
    }
    const points = contact?.points;
    this.outlines.setGap(points, this.size);
    this.gap = points
      ? new THREE.Vector3()
          .fromArray(points[0])
          .add(new THREE.Vector3().fromArray(points[1]))
          .multiplyScalar(0.5)
      : null;
    this.marks.set(points && text ? [{ frame: 0, text }] : []);
    this.marks.show(this.marks.count > 0);
    this.dirty();
  }

  showTraces(visible) {
    this.given.show(visible);
    this.drawn.show(visible);
    this.trail.show(visible);
    this.dirty();
  }

  setTrace(trace, points) {
    trace.set(points, TRACE_RADIUS * this.size);
    this.dirty();
  }

  leaveArm() {
    this.overlays.leaveArm();
    this.anchors = [];
    this.setTrace(this.given, new Float32Array());
  }

  setPoints(message) {
    this.overlays.setPoints(message, POINT * this.size, FIELD);
    this.overlaid();
  }

  setEllipsoids(message) {
    this.overlays.setEllipsoids(message);
    this.overlaid();
  }

  setGhosts(message) {
    const { nodes } = this;
    const none = !message.tints.length && !this.ghosts?.tints.length; // then there is nothing to draw again
    this.ghosts = message;
    if (none) return;
    this.overlays.setGhosts(
      { ...message, tints: this.tints() },
      {
        nodes,
        boxAt: (...state) => this.boxAt(...state),
        skeletons: this.steady && message.tints.length > 3 * SOLID_GHOSTS,
      },
    );
    this.anchors = anchors(
      placements(message.transforms, THREE).positions,
      nodes.map((node) => node.position),
    );
    this.overlaid();
  }

  // Beside panels ghosts are grey, but the one that a person points at in a list.
  tints() {
    const { tints } = this.ghosts,
      several = this.steady && tints.length > 3;
    return several
      ? tints.map((value, i) => (Math.floor(i / 3) === this.pointed ? value : GREY[i % 3]))
      : tints;
  }

  // ghost: the number of the one to show in its color and with its name, or null.
  pointAt(ghost) {
    if (this.pointed === ghost || !this.ghosts) return;
    this.pointed = ghost;
    this.setGhosts(this.ghosts);
    this.showNames();
  }

  // names: of the ghosts, {text, color} each, in their order.
  nameGhosts(names) {
    this.pointed = null;
    this.named = names;
    this.showNames();
  }

  showNames() {
    const shown = this.steady ? this.named?.[this.pointed] : null;
    this.names.set(
      this.steady
        ? shown
          ? [{ frame: this.pointed, ...shown }]
          : []
        : (this.named ?? []).map((name, frame) => ({ frame, ...name })),
    );
    this.names.show(this.overlays.shown);
    this.dirty();
  }

  // A ghost that moves along with a motion, or null for none.
  setCompanion(ghost) {
    const box = ghost ? this.boxOf(ghost) : new THREE.Box3();
    this.overlays.setCompanion(ghost?.tint, this.nodes, box);
  }

  placeCompanion({ positions, quaternions }) {
    this.overlays.placeCompanion(positions, quaternions);
    this.dirty();
  }

  // The ray from the camera through the pointer.
  ray(event) {
    const { pane, viewer } = this;
    const box = pane.getBoundingClientRect();
    const point = new THREE.Vector2(
      ((event.clientX - box.left) / box.width) * 2 - 1,
      1 - ((event.clientY - box.top) / box.height) * 2,
    );
    const caster = new THREE.Raycaster();
    caster.setFromCamera(point, viewer.camera);
    return caster;
  }

  obstacleAt(event) {
    return this.overlays.obstacleAt(this.ray(event));
  }

  markObstacle(index) {
    this.overlays.markObstacle(index);
    this.dirty();
  }

  setObstacles(message) {
    this.overlays.setObstacles(message);
    this.overlaid();
  }

  showOverlays(visible) {
    this.overlays.show(visible);
    this.names.show(visible);
    this.overlaid();
  }

  // What is drawn beside the arm is in view too.
  overlaid() {
    if (!this.touched && !this.steady) this.reframe();
    this.dirty();
  }

  render(now) {
    const { viewer } = this;
    this.quality.frame(now);
    if (now < this.awaited) return;
    if (!viewer.needs_render) return this.refine(now);
    if (this.refines) this.drawFinely(false, !this.shadowsAtRest);
    this.fine = false;
    this.changed = now;
    this.trail.upload();
    viewer.render();
    for (const material of this.old.splice(0)) material.dispose();
    this.quality.drawn(now);
    this.labels.place((frame) => this.project(this.nodes[frame].position));
    this.marks.place(() => this.gap && this.project(this.gap));
    for (const call of this.rendered) call();
    const named = this.naming && (this.named?.length ?? 0) === this.anchors.length; // the ghosts of a message and their names come one by one
    this.names.place((ghost) => (named ? this.project(this.anchors[ghost]) : null));
  }

  // Draw a picture that has not changed for a while at a higher resolution, which the browser averages, then with shadows.
  refine(now) {
    const still = now - this.changed;
    if (!this.refines || this.fine || still < REST) return;
    const shadows = !this.shadowsAtRest || still >= LONG_REST;
    if (this.sharp && !shadows) return;
    this.drawFinely(true, shadows);
    this.fine = shadows;
    this.viewer.render();
  }

  get refines() {
    return this.software && this.ratio < FINEST;
  }

  // A coarse line covers a whole pixel and a fine one half of it: the grid looks the same in both.
  drawFinely(sharp, shadows) {
    if (sharp !== this.sharp) this.viewer.renderer.setPixelRatio(sharp ? FINEST : this.ratio);
    if (shadows !== this.key.castShadow) this.castShadows(shadows);
    if (this.plain && sharp !== this.sharp) this.gloss(sharp);
    if (this.grid) this.grid.material.opacity = sharp ? 1 : this.ratio / FINEST;
    this.sharp = sharp;
  }

  // The axes of the world in the camera's frame: x to the right, y up, z towards the eye.
  axesInView() {
    const { matrixWorldInverse } = this.viewer.camera;
    return [0, 1, 2].map((k) =>
      inView(new THREE.Vector3().setComponent(k, 1)).transformDirection(matrixWorldInverse),
    );
  }

  // Distance between the lines of the grid, m: its first half are lines along x at multiples of it.
  gridStep() {
    const { array } = this.grid.geometry.attributes.position;
    const heights = array.slice(0, array.length / 2).filter((y, i) => i % 3 === 1 && y > 0);
    return heights.reduce((a, b) => Math.min(a, b));
  }

  // A point of the world in px from the pane's upper left corner; null behind the camera.
  project(point) {
    const p = inView(point).project(this.viewer.camera);
    if (p.z > 1) return null;
    return {
      x: ((p.x + 1) * this.pane.clientWidth) / 2,
      y: ((1 - p.y) * this.pane.clientHeight) / 2,
    };
  }
}

function equal(a, b) {
  return a.length === b.length && a.every((byte, i) => byte === b[i]);
}

// Where ghosts are named: at the frame at which they and the arm are furthest apart.
function anchors(positions, arm) {
  const nodes = arm.length,
    count = positions.length / (3 * nodes);
  const at = (ghost, node) => new THREE.Vector3().fromArray(positions, 3 * (ghost * nodes + node));
  let best = 0,
    widest = -1;
  for (let node = 0; node < nodes; node++) {
    const box = new THREE.Box3(arm[node].clone(), arm[node].clone());
    for (let ghost = 0; ghost < count; ghost++) box.expandByPoint(at(ghost, node));
    const width = box.getSize(new THREE.Vector3()).length();
    if (width > widest) [best, widest] = [node, width];
  }
  return Array.from({ length: count }, (_, ghost) => at(ghost, best));
}

// Draw an object in its glossy material, or in a matt one of the same color.
function finish(object, glossy) {
  const { material, userData } = object;
  if (material?.type === "MeshPhongMaterial" && !userData.finishes) {
    const { color, side } = material;
    userData.finishes = [material, new THREE.MeshLambertMaterial({ color, side })];
  }
  if (userData.finishes) object.material = userData.finishes[glossy ? 0 : 1];
}

export { THREE };
