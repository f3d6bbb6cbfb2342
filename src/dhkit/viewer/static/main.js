// The viewer's page, live and offline: messages from Python move the scene, the person moves the rest.

import { Connection } from "./connection.js";
import { ANIMATION, ELLIPSOIDS, FRAMES, GHOSTS, OBSTACLES } from "./messages.js";
import { POINTS, POSE, SAMPLES, SCENE, STATE, TRACE, decode, placements } from "./messages.js";
import { Player } from "./player.js";
import { Readout } from "./readout.js";
import { Stage, THREE } from "./stage.js";

const element = (id) => document.getElementById(id);
const POSE_TIME = 250; // ms in which the pose of an edited arm comes: it is not drawn before
const STEP = 1 / 30; // s that an arrow key moves an animation

class Page {
  constructor() {
    this.stage = new Stage(
      element("pane"),
      element("labels"),
      element("names"),
      element("marks"),
      insets,
    );
    this.readout = new Readout(element("readout"));
    this.player = new Player(element("player"), { show: (time) => this.showTime(time) });
    this.motion = null; // what is on show: {q, positions, quaternions}, for an animation with times and more
    this.drawn = []; // sequences to acknowledge after the next picture
    this.early = []; // what panels are told before they are there
    this.controls();
    requestAnimationFrame((now) => this.tick(now));
  }

  receive(buffer) {
    const message = decode(buffer);
    const take = {
      [SCENE]: () => this.takeScene(message),
      [POSE]: () => this.takePose(message),
      [ANIMATION]: () => this.takeAnimation(message),
      [TRACE]: () => this.stage.setTrace(this.stage.given, message.points),
      [FRAMES]: () => this.showFrames(message.flag),
      [POINTS]: () => this.takePoints(message),
      [ELLIPSOIDS]: () => this.takeOverlay(() => this.stage.setEllipsoids(message)),
      [GHOSTS]: () => this.takeOverlay(() => this.stage.setGhosts(message)),
      [OBSTACLES]: () => this.takeOverlay(() => this.stage.setObstacles(message)),
    };
    if (message.type === STATE || message.type === SAMPLES) {
      this.takePanel(message);
      this.connection?.shown(message.sequence);
      return;
    }
    take[message.type]();
    this.drawn.push(message.sequence);
    // A page in the background draws nothing; it has the state all the same. Beside panels what comes with a pose (an
    // edited arm, ghosts) is drawn in the pose's picture, not each in one of its own.
    if (document.hidden || (this.lab && message.type !== POSE)) this.acknowledge();
  }

  // Panels are loaded where Python answers requests; what they are told meanwhile waits.
  takePanel(message) {
    if (!this.lab) return void this.early.push(message);
    if (message.type === STATE) this.lab.take(message);
    else this.lab.samples(message);
  }

  async openLab() {
    document.head.append(
      Object.assign(document.createElement("link"), { rel: "stylesheet", href: "lab/lab.css" }),
    );
    const font = new FontFace("dhkit math", 'url("lab/math.woff2")');
    document.fonts.add(font);
    const [{ Requests }, { PANELS }] = await Promise.all([
      import("./lab/requests.js"),
      import("./lab/panels.js"),
    ]);
    await this.showLab(PANELS, (failed) => new Requests(this.connection, failed));
    for (const message of this.early.splice(0)) this.takePanel(message);
  }

  // Joint values that come from the page around this one.
  showJoints(q) {
    this.lab?.requests.show?.(q);
  }

  // The panels of a page without Python, which answers itself; its style is in the page.
  async openOffline(data) {
    const [{ OfflineDesk }, { PANELS }] = await Promise.all([
      import("./offline/desk.js"),
      import("./offline/panels.js"),
    ]);
    await this.showLab(
      PANELS,
      (failed) => new OfflineDesk(this, data, failed),
      data.about.caption || data.motions.length ? "about" : "joints",
    );
    this.lab.requests.begin();
    if (parent !== window) parent.postMessage("ready", "*");
  }

  // ask: what makes the requests that answer the panels; first: the panel that is open at first.
  async showLab(panels, ask, first = "joints") {
    const { Lab } = await import("./lab/lab.js");
    this.lab = new Lab(this, panels, ask, first);
    this.stage.beside();
    this.takeOverlay(() => {});
  }

  takeScene(message) {
    if (message.about.panels && this.connection && !this.opening)
      this.opening = this.openLab().catch((error) =>
        banner(`The panels could not be loaded: ${error.message}`),
      );
    this.stage.build(message);
    this.takeOverlay(() => this.stage.leaveArm());
    if (this.lab) this.stage.awaited = performance.now() + POSE_TIME;
    this.readout.set(message.about);
    element("tools").hidden = false;
    document.body.dataset.ready = "true";
  }

  takePose(message) {
    this.stage.naming = true;
    this.stage.awaited = 0;
    if (this.player.active) {
      this.player.unload();
      this.stage.drawn.clear();
      this.stage.forget();
      this.takeOverlay(() => this.stage.setCompanion(null));
      this.lab?.moved(null);
    }
    this.motion = { q: message.q, ...placements(message.transforms, THREE) };
    this.stage.include(this.motion);
    this.showState(this.motion);
    if (this.lab) this.stage.trail.append(this.motion.positions.slice(-3));
  }

  takeAnimation(message) {
    const placed = (states) => states && { ...states, ...placements(states.transforms, THREE) };
    const motion = { ...placed(message), ghost: placed(message.ghost) };
    this.motion = motion;
    this.stage.naming = false;
    this.player.reveal();
    this.stage.forget();
    this.takeOverlay(() => this.stage.setCompanion(motion.ghost));
    this.stage.include(motion);
    const tool = 3 * (motion.nodes - 1),
      points = new Float32Array(message.flag ? 3 * motion.times.length : 0);
    for (let i = 0; i < points.length / 3; i++) {
      points.set(
        motion.positions.subarray(3 * i * motion.nodes + tool, 3 * i * motion.nodes + tool + 3),
        3 * i,
      );
    }
    this.stage.setTrace(this.stage.drawn, points);
    this.stage.trail.clear();
    this.player.load(motion.times[motion.times.length - 1]);
  }

  takePoints(message) {
    this.takeOverlay(() => this.stage.setPoints(message));
    if (this.lab && message.points.length) this.stage.frameAll();
    else if (this.lab && !this.stage.touched) this.stage.reframe();
  }

  takeOverlay(draw) {
    draw();
    // Beside panels ghosts come and go all the time: the other buttons stay where they are.
    element("overlays").hidden = !this.lab && this.stage.overlays.empty;
    element("overlays").disabled = this.stage.overlays.empty;
  }

  // Samples are at equal steps: dhkit/viewer/motion.py.
  showTime(time) {
    const { times, q, joints, nodes, ghost } = this.motion;
    const last = times.length - 1;
    const at = (time / times[last]) * last;
    const k = Math.min(last - 1, Math.floor(at)),
      share = at - k;
    const between = ({ positions, quaternions }) => ({
      positions: mix(positions, 3 * nodes, k, share),
      quaternions: turn(quaternions, nodes, k, share),
    });
    this.stage.drawn.draw(Math.round(at));
    if (ghost) this.stage.placeCompanion(between(ghost));
    const state = { q: mix(q, joints, k, share), ...between(this.motion) };
    this.showState(state);
    this.lab?.moved(state.q, time);
  }

  showState({ q, positions, quaternions }) {
    this.stage.place(positions, quaternions);
    this.readout.show(q, [...positions.slice(-3)]);
    this.lab?.card.show(q, positions, quaternions);
  }

  showFrames(visible) {
    element("frames").setAttribute("aria-pressed", String(visible));
    this.stage.showFrames(visible);
  }

  showTraces(visible) {
    element("trace").setAttribute("aria-pressed", String(visible));
    this.stage.showTraces(visible);
  }

  showOverlays(visible) {
    element("overlays").setAttribute("aria-pressed", String(visible));
    this.stage.showOverlays(visible);
  }

  showPerson(visible) {
    element("person").setAttribute("aria-pressed", String(visible));
    this.stage.showPerson(visible);
  }

  tick(now) {
    requestAnimationFrame((next) => this.tick(next));
    this.player.tick(now);
    this.stage.render(now);
    this.acknowledge();
  }

  acknowledge() {
    for (const sequence of this.drawn.splice(0)) this.connection?.shown(sequence);
  }

  controls() {
    const flip = (id) => element(id).getAttribute("aria-pressed") !== "true";
    const frames = () => this.showFrames(flip("frames"));
    const trace = () => this.showTraces(flip("trace"));
    const overlays = () => this.showOverlays(flip("overlays"));
    const person = () => this.showPerson(flip("person"));
    const reset = () => this.stage.resetCamera();
    element("frames").addEventListener("click", frames);
    element("trace").addEventListener("click", trace);
    element("overlays").addEventListener("click", overlays);
    element("person").addEventListener("click", person);
    element("reset").addEventListener("click", reset);
    element("readout").addEventListener("toggle", () => this.stage.refit());
    const { player } = this;
    const keys = {
      f: frames,
      t: trace,
      o: () => !element("overlays").hidden && overlays(),
      p: person,
      r: reset,
      l: () => player.active && player.repeat(!player.loop),
      " ": () => player.active && player.toggle(),
      Home: () => player.active && player.step(-Infinity),
      End: () => player.active && player.step(Infinity),
      ArrowLeft: () => player.active && player.step(-STEP),
      ArrowRight: () => player.active && player.step(STEP),
    };
    addEventListener("keydown", (event) => {
      const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      if (!act || !this.motion || event.ctrlKey || event.metaKey || event.altKey || keepsKey(event))
        return;
      event.preventDefault();
      act();
    });
  }
}

// Whether the focused control has its own use for a key: a slider for arrows, a button for space, a list for letters.
function keepsKey({ target, key }) {
  if (target.matches("select, textarea, input:not([type=range], [type=checkbox])")) return true;
  if (target.matches("input[type=checkbox]")) return key === " ";
  if (target.matches("input")) return key.length > 1;
  return key === " " && target.matches("button, summary");
}

// What panels cover, px; on a phone the read-out opens over the arm.
function insets() {
  const right = 12,
    top = 60,
    bottom = element("player").hidden ? 14 : 66;
  const readout = element("card") ?? element("readout"),
    beside = readout.open && !readout.hidden && innerWidth > Number(readout.dataset.room);
  const { left } = element("stage").getBoundingClientRect();
  return { left: beside ? readout.getBoundingClientRect().right - left : 12, top, right, bottom };
}

function mix(values, width, k, share) {
  const row = new Float32Array(width);
  for (let i = 0; i < width; i++)
    row[i] = (1 - share) * values[k * width + i] + share * values[(k + 1) * width + i];
  return row;
}

function turn(quaternions, nodes, k, share) {
  const row = new Float32Array(4 * nodes);
  for (let i = 0; i < nodes; i++) {
    THREE.Quaternion.slerpFlat(
      row,
      4 * i,
      quaternions,
      4 * (k * nodes + i),
      quaternions,
      4 * ((k + 1) * nodes + i),
      share,
    );
  }
  return row;
}

function banner(text) {
  document.body.classList.toggle("waiting", Boolean(text));
  if (element("banner").textContent === text) return;
  element("banner").textContent = text;
  element("banner").hidden = !text;
}

function start() {
  const page = new Page();
  globalThis.dhkit = page;
  const inlined = element("messages");
  if (inlined) {
    for (const text of JSON.parse(inlined.textContent)) page.receive(bytes(text));
    follow(page);
    const offline = element("offline");
    if (offline)
      page
        .openOffline(JSON.parse(offline.textContent))
        .catch((error) => banner(`The panels could not be loaded: ${error.message}`));
    return;
  }
  const url = new URL("socket", location.href.replace(/^http/, "ws"));
  page.connection = new Connection(url, {
    receive: (data) => page.receive(data),
    status: banner,
    told: (message) => message.type !== "beat" && page.lab?.requests.take(message),
    lost: () => page.lab?.requests.drop(),
  });
  banner("Connecting to Python …");
}

// A page in a frame, such as a notebook's output, is moved by the page around it: {q}, or a message of Python.
function follow(page) {
  if (parent === window) return;
  addEventListener("message", ({ source, data }) => {
    if (source !== parent) return;
    if (data instanceof ArrayBuffer) page.receive(data);
    else if (Array.isArray(data?.q)) page.showJoints(data.q);
  });
}

function bytes(base64) {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0)).buffer;
}

try {
  start();
} catch (error) {
  banner(`This page could not start: ${error.message}`);
  throw error;
}
