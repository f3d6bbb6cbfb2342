// Motions: planned from the state on show, taught by waypoints, or read from a file; with their curves.

import { ObstacleList } from "./around.js";
import { MotionCurves, exceeding } from "./curves.js";
import { MotionFile } from "./motion_file.js";
import { recorded, videoFormat } from "./recording.js";
import { UNITS, bytes, fixed, h, save, touchingText, typed } from "./dom.js";

const KINDS = [
  ["quintic", "Quintic"],
  ["trapezoidal", "Trapezoidal"],
  ["least-time", "Least time"],
  ["line", "Straight line"],
  ["circle", "Circle"],
];

export class MotionPanel {
  constructor(lab, root) {
    this.lab = lab;
    this.kind = h(
      "select",
      { "aria-label": "Kind of motion", onchange: () => this.fit() },
      KINDS.map(([value, text]) => h("option", { value }, text)),
    );
    this.goal = h("select", { "aria-label": "Goal" });
    this.duration = h("input", {
      type: "text",
      inputmode: "decimal",
      class: "number",
      "aria-label": "Duration in seconds",
      placeholder: "shortest",
      onkeydown: (event) => event.key === "Enter" && this.plan(),
    });
    this.go = h("button", { class: "main", onclick: () => this.plan() }, "Plan from here");
    this.plane = h(
      "select",
      { "aria-label": "Plane of the circle" },
      [
        ["", "any"],
        ["horizontal", "horizontal"],
        ["xz", "x and z"],
        ["yz", "y and z"],
      ].map(([value, text]) => h("option", { value }, text)),
    );
    this.radius = h("input", {
      type: "text",
      inputmode: "decimal",
      class: "number",
      "aria-label": "Radius of the circle",
      placeholder: "automatic",
    });
    this.centre = h("input", {
      type: "text",
      class: "centre",
      "aria-label": "Centre of the circle, three numbers",
      placeholder: "automatic",
    });
    this.circle = h(
      "div",
      { class: "line", hidden: true },
      h("label", {}, "plane ", this.plane),
      h("label", {}, "radius ", this.radius),
      h("label", {}, "or centre ", this.centre),
    );
    this.job = h("p", { class: "note", role: "status" });
    this.cancel = h(
      "button",
      {
        hidden: true,
        onclick: async () => {
          await lab.ask("motion.cancel");
          this.job.textContent = "cancelled";
        },
      },
      "Cancel",
    );
    this.facts = h("p", { class: "facts" });
    this.points = h("ol", { class: "points" });
    this.forget = h(
      "button",
      { disabled: true, onclick: () => lab.ask("waypoints.clear") },
      "Clear",
    );
    this.file = new MotionFile(lab);
    this.curves = new MotionCurves(lab);
    this.obstacles = new ObstacleList(lab);
    const download = (format) =>
      h("button", { onclick: () => this.download(format) }, format.toUpperCase());
    this.replay = h("button", { onclick: () => this.play() }, "Play");
    this.video = h(
      "button",
      {
        hidden: videoFormat() === null,
        title: "Play the motion once and save it as a video",
        onclick: () => this.record(),
      },
      "Video",
    );
    this.files = h(
      "div",
      { class: "rows", hidden: true },
      h(
        "div",
        { class: "buttons" },
        this.replay,
        h("button", { onclick: () => lab.ask("motion.clear") }, "Remove"),
      ),
      h("div", { class: "buttons" }, "Save:", download("csv"), download("npz"), this.video),
    );
    root.append(
      h("div", { class: "line choice" }, this.kind, h("label", {}, "to", this.goal)),
      this.circle,
      h("div", { class: "line" }, h("label", {}, "in ", this.duration, " s"), this.go, this.cancel),
      this.job,
      this.facts,
      this.files,
      h(
        "fieldset",
        {},
        h("legend", {}, "Waypoints"),
        h(
          "div",
          { class: "buttons" },
          h("button", { onclick: () => this.teach() }, "Teach this state"),
          this.forget,
        ),
        this.points,
      ),
      this.obstacles.root,
      this.file.root,
    );
  }

  take_arm(arm) {
    this.arm = arm;
    this.goals();
  }

  take_obstacles(obstacles) {
    this.obstacles.take(obstacles);
  }

  unitsChanged() {
    this.obstacles.unitsChanged();
  }

  take_waypoints(points) {
    this.waypoints = points;
    this.forget.disabled = !points.length;
    this.points.replaceChildren(
      ...points.map((point, index) =>
        h(
          "li",
          {},
          h(
            "button",
            {
              class: "quiet",
              onclick: () => this.lab.ask("waypoints.go", { index }),
            },
            point.name,
          ),
          h(
            "button",
            {
              class: "quiet",
              "aria-label": `Forget ${point.name}`,
              onclick: () => this.lab.ask("waypoints.remove", { index }),
            },
            "×",
          ),
        ),
      ),
    );
    this.goals();
  }

  take_target(target) {
    this.target = target;
    this.goals();
  }

  goals() {
    const before = this.goal.value;
    const options = (this.arm?.configurations ?? [])
      .filter((name) => name !== "random")
      .map((name) => [`named ${name}`, name]);
    if (this.target?.reached) options.push(["target", "the target"]);
    (this.waypoints ?? []).forEach((point, k) => options.push([`waypoint ${k}`, point.name]));
    if ((this.waypoints ?? []).length > 1) options.push(["waypoints", "through all waypoints"]);
    this.goal.replaceChildren(...options.map(([value, text]) => h("option", { value }, text)));
    if (options.some(([value]) => value === before)) this.goal.value = before;
    this.fit();
  }

  // What a kind of motion does not have cannot be chosen.
  fit() {
    const through = [...this.goal.options].find((option) => option.value === "waypoints");
    if (through) through.disabled = !["quintic", "least-time"].includes(this.kind.value);
    if (through?.disabled && this.goal.value === "waypoints")
      this.goal.value = this.goal.options[0].value;
    this.circle.hidden = this.kind.value !== "circle";
    this.goal.closest("label").hidden = !this.circle.hidden;
    this.duration.disabled = this.kind.value === "least-time";
  }

  async plan() {
    const text = this.duration.disabled ? "" : this.duration.value.trim(),
      duration = text === "" ? null : typed(text);
    if (text !== "" && !(duration > 0))
      return this.lab.complain(`duration ${text}: expected a positive number of seconds`);
    await this.lab.settled();
    const goal = this.chosen();
    if (goal) this.lab.ask("motion.plan", { kind: this.kind.value, goal, duration });
  }

  chosen() {
    const value = this.goal.value;
    if (this.kind.value === "circle") return this.chosenCircle();
    if (value === "waypoints") return { waypoints: true };
    if (value === "target")
      return this.kind.value === "line"
        ? { T: this.target.T }
        : { q: this.target.branches.find((branch) => branch.chosen).q };
    if (value.startsWith("waypoint ")) return { q: this.waypoints[Number(value.slice(9))].q };
    return { q: this.arm.named[value.slice(6)] };
  }

  // Lengths are in the unit of the page; null where one is not a number.
  chosenCircle() {
    const { scale } = UNITS[this.lab.units.length],
      { plane, radius, centre } = this,
      circle = plane.value ? { plane: plane.value } : {};
    const numbers = centre.value
        .trim()
        .split(/[\s;]+/)
        .filter(Boolean)
        .map(typed),
      r = radius.value.trim() === "" ? null : typed(radius.value);
    if (numbers.length) {
      if (numbers.length !== 3 || numbers.includes(null))
        return void this.lab.complain(
          `centre ${centre.value.slice(0, 40)}: expected three numbers with spaces between them`,
        );
      return { ...circle, centre: numbers.map((x) => x / scale) };
    }
    if (radius.value.trim() !== "" && !(r > 0))
      return void this.lab.complain(
        `radius ${radius.value.slice(0, 40)}: expected a positive number`,
      );
    return r === null ? circle : { ...circle, radius: r / scale };
  }

  async teach() {
    await this.lab.settled();
    this.lab.ask("waypoints.add");
  }

  play() {
    const { player } = this.lab.page;
    if (player.active) player.toggle();
    else this.lab.ask("motion.play");
  }

  // An animation is at a time: so are the curves.
  moved(q, time) {
    if (q && this.motion) this.lab.warn(...exceeding(this.motion, time));
    if (q && this.lab.dock.shows(this.curves)) this.curves.mark(time);
  }

  async record() {
    const { player } = this.lab.page;
    if (!player.active) await this.lab.ask("motion.play");
    if (!player.active) return;
    this.video.disabled = true;
    try {
      const video = await recorded(this.lab.stage.viewer.renderer.domElement, player);
      const suffix = video.type.includes("mp4") ? "mp4" : "webm";
      save(`${this.arm.name}-motion.${suffix}`, video, video.type);
    } finally {
      this.video.disabled = false;
    }
  }

  async download(format) {
    const answer = await this.lab.ask("motion.download", { format });
    if (answer) save(answer.name, bytes(answer.content), "application/octet-stream");
  }

  take_job(job) {
    this.cancel.hidden = !job?.running;
    this.job.textContent = job
      ? job.error
        ? `${job.title}: ${job.error}`
        : `${job.title}: ${job.progress || "begun"}`
      : "";
    this.job.classList.toggle("bad", Boolean(job?.error));
  }

  take_motion(motion) {
    this.motion = motion;
    this.files.hidden = !motion;
    this.facts.textContent = "";
    if (!motion) return this.lab.dock.release(this.curves);
    const still = this.lab.state.control?.running ? "not played: a controller moves the arm" : null;
    const touching = motion.contacts && touchingText(motion.contacts.find(Boolean));
    this.facts.textContent = [
      `${motion.kind}, ${fixed(motion.duration, 3)} s`,
      motion.excess,
      touching,
      ...motion.notes,
      still,
    ]
      .filter(Boolean)
      .join("; ");
    this.facts.classList.toggle("bad", Boolean(motion.excess || touching));
    this.curves.draw(motion, this.arm.joints);
    if (!this.lab.state.control?.running) this.lab.dock.show(this.curves);
  }
}
