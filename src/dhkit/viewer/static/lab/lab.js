// The lab: panels beside the scene. Python has the arm; the page asks, and shows the states that it is told.

import { StatusCard, WorldAxes } from "./card.js";
import { PlotDock } from "./dock.js";
import { depthText, h } from "./dom.js";
import { draggedEdge } from "./edge.js";
import { icon } from "./icons.js";
import { remember, remembered } from "./memory.js";

const SHORT = 6000; // ms that a message stays
const WIDTH = 348,
  SLIM = 322,
  NARROW = 280,
  SCENE = 420; // px: of a panel at first, on a small page, at least, and left to the scene
const LENGTHS = { m: "m", cm: "mm", mm: "mm", in: "in" }; // units of files, as the page shows them

export class Lab {
  // groups: of panels, [name, title, class] each; requests(failed): what answers them.
  constructor(page, groups, requests, first) {
    this.page = page;
    this.stage = page.stage;
    this.state = {};
    this.requests = requests((error, request) => this.complain(error, request));
    this.units = { angle: remembered("angle", "deg"), length: remembered("length", "m") };
    this.build(groups, first);
    document.body.classList.add("lab");
    document.getElementById("readout").open = false;
    this.stage.resize();
  }

  build(groups, first) {
    this.card = new StatusCard(this);
    this.world = new WorldAxes(this);
    this.dock = new PlotDock(this);
    const bodies = [];
    this.panels = groups.flat().map(([name, title, Panel], k) => {
      const tab = h(
        "button",
        {
          role: "tab",
          id: `tab-${name}`,
          "aria-controls": `panel-${name}`,
          "aria-selected": "false",
          tabIndex: k ? -1 : 0,
          hidden: Boolean(Panel.optional),
          onclick: () => this.choose(k),
          onkeydown: (event) => this.moveTab(event, k),
        },
        icon(name),
        h("span", {}, title),
      );
      const body = h("section", {
        role: "tabpanel",
        id: `panel-${name}`,
        "aria-labelledby": `tab-${name}`,
        hidden: true,
      });
      bodies.push(body);
      return {
        name,
        title,
        tab,
        body,
        panel: new Panel(this, body),
        against: new Set(Panel.optional ? [name] : []),
      };
    });
    const tabs = groups.map((group) =>
      h(
        "div",
        { class: "group", role: "presentation" },
        group.map(([name]) => this.panels.find((panel) => panel.name === name).tab),
      ),
    );
    this.title = h("h1", {}, "");
    this.family = h("p", { class: "family" });
    this.copy = h(
      "button",
      {
        class: "quiet",
        title: "The lines of Python that do the same",
        hidden: !this.can("python"),
        onclick: () => this.copyPython(),
      },
      "Copy as Python",
    );
    this.message = h("p", { class: "message", role: "alert", hidden: true });
    this.edge = h("div", {
      class: "edge",
      role: "separator",
      "aria-orientation": "vertical",
      "aria-label": "Width of the panel",
      tabIndex: 0,
    });
    const rail = h(
      "nav",
      { "aria-label": "Panels" },
      h(
        "div",
        { role: "tablist", class: "tabs", "aria-label": "Panels", "aria-orientation": "vertical" },
        tabs,
      ),
    );
    this.body = h(
      "div",
      { class: "body" },
      h("header", {}, h("div", { class: "headline" }, this.title, this.copy), this.family),
      this.message,
      h("div", { class: "panels" }, bodies),
    );
    document.body.prepend(
      h("aside", { id: "lab", "aria-label": "Lab" }, rail, this.body, this.edge),
    );
    draggedEdge(this.edge, {
      keys: ["ArrowLeft", "ArrowRight"],
      sizeAt: ({ clientX }) => clientX - this.body.getBoundingClientRect().left,
      size: () => this.width,
      take: (width) => this.setWidth(width),
    });
    this.width = Number(remembered("width", String(innerWidth < 1000 ? SLIM : WIDTH)));
    this.folded = false;
    this.layout();
    this.stage.pane.after(this.world.root);
    document.getElementById("stage").after(this.card.root, this.dock.root);
    this.addViews();
    const wanted = [remembered("tab", first), first].map((name) =>
      this.panels.findIndex((panel) => panel.name === name),
    );
    this.open(Math.max(0, wanted.find((k) => k >= 0) ?? 0));
  }

  addViews() {
    const views = h(
      "select",
      {
        "aria-label": "Look from",
        title: "Look from",
        onchange: () => {
          this.stage.look(views.value);
          views.value = "";
        },
      },
      h("option", { value: "", hidden: true }, "View"),
      ["front", "side", "top", "iso"].map((name) => h("option", { value: name }, name)),
    );
    document.getElementById("reset").before(views);
  }

  // A click on the panel that is open hides it, and shows it again.
  choose(k) {
    this.folded = !this.folded && this.panels[k].tab.getAttribute("aria-selected") === "true";
    this.layout();
    this.open(k);
  }

  layout() {
    const { body } = document,
      width = Math.max(NARROW, Math.min(this.width, innerWidth - SCENE));
    body.classList.toggle("folded", this.folded);
    body.style.setProperty("--panel", this.folded ? "0px" : `${width}px`);
  }

  setWidth(width) {
    this.width = width;
    remember("width", String(Math.round(width)));
    this.layout();
  }

  open(k) {
    this.panels.forEach(({ tab, body, panel }, i) => {
      tab.setAttribute("aria-selected", String(i === k));
      tab.tabIndex = i === k ? 0 : -1;
      body.hidden = i !== k;
      panel.shown?.(i === k);
    });
    showWithin(this.panels[k].tab);
    remember("tab", this.panels[k].name);
  }

  // A panel that is not for every lab. Who hides it: it is there when nobody does, in whatever order they say so.
  showTab(name, visible, who = name) {
    const { tab, against } = this.panels.find((panel) => panel.name === name);
    if (visible) against.delete(who);
    else against.add(who);
    tab.hidden = against.size > 0;
    if (tab.hidden && tab.getAttribute("aria-selected") === "true")
      this.open(
        Math.max(
          0,
          this.panels.findIndex((panel) => !panel.against.size),
        ),
      );
  }

  openPanel(name) {
    const k = this.panels.findIndex((panel) => panel.name === name);
    if (this.panels[k].tab.hidden) return;
    this.folded = false;
    this.layout();
    this.open(k);
  }

  panelTitle(name) {
    return this.panels.find((panel) => panel.name === name).title;
  }

  moveTab(event, k) {
    const shown = this.panels.map((_, i) => i).filter((i) => !this.panels[i].tab.hidden),
      at = shown.indexOf(k),
      count = shown.length;
    const after = shown[(at + 1) % count],
      before = shown[(at + count - 1) % count];
    const next = {
      ArrowRight: after,
      ArrowDown: after,
      ArrowLeft: before,
      ArrowUp: before,
      Home: shown[0],
      End: shown[count - 1],
    }[event.key];
    if (next === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    this.open(next);
    this.panels[next].tab.focus();
  }

  take({ name, data }) {
    this.state[name] = data;
    if (name === "arm") {
      this.useUnitOf(data);
      this.title.textContent = data.name;
      const family = data.family ?? "no closed form: followed by iteration";
      this.family.textContent = this.family.title = data.assumed_bodies
        ? `${family}; masses assumed`
        : family;
    }
    for (const part of [this.card, ...this.panels.map(({ panel }) => panel)])
      part[`take_${name}`]?.(data);
  }

  samples(message) {
    for (const { panel } of this.panels) panel.samples?.(message);
  }

  // Joints beyond a limit, counted from 0, and two links that touch each other, or null.
  warn(joints, contact) {
    this.stage.warn(joints, contact, depthText(contact, this.units.length));
    this.card.warn(joints, contact);
  }

  // q: joint values that an animation shows at a time, or null when it is over.
  moved(q, time) {
    for (const { panel } of this.panels) panel.moved?.(q, time);
  }

  // What is on show becomes the state that Python has, where an animation has left it elsewhere.
  async settled() {
    const { player } = this.page;
    if (!player.active || !this.state.motion || this.state.control?.running) return;
    player.pause();
    await this.ask("motion.show", { time: player.time });
  }

  // Whether there is an answer to a request: a page without Python has not all of them.
  can(name) {
    return this.requests.can?.(name) ?? true;
  }

  // What was complained of goes when the same is asked with success.
  async ask(name, data) {
    const answer = await this.requests.ask(name, data);
    if (answer !== null && name === this.cause) this.hush();
    return answer;
  }

  // What Python says of a request begins with the request's name, which is for programs.
  complain(error, request = "") {
    this.tell(
      request && error.startsWith(`${request}: `) ? error.slice(request.length + 2) : error,
    );
    this.cause = request;
  }

  hush() {
    this.cause = null;
    this.message.hidden = true;
  }

  tell(text) {
    this.message.textContent = text;
    this.message.hidden = false;
    clearTimeout(this.quiet);
    this.quiet = setTimeout(() => this.hush(), SHORT);
  }

  async copyPython() {
    await this.settled();
    const answer = await this.ask("python");
    if (!answer) return;
    try {
      await navigator.clipboard.writeText(answer.text);
      this.copy.textContent = "Copied";
    } catch {
      this.show("Python", answer.text);
    }
    setTimeout(() => (this.copy.textContent = "Copy as Python"), 1500);
  }

  show(title, text) {
    const close = () => dialog.remove();
    const area = h("textarea", { readOnly: true, rows: 14, "aria-label": title });
    area.value = text;
    const dialog = h(
      "dialog",
      { class: "text" },
      h("h2", {}, title),
      area,
      h("button", { onclick: close }, "Close"),
    );
    document.body.append(dialog);
    dialog.addEventListener("close", close);
    dialog.showModal();
    area.select();
  }

  // Lengths are in the unit of the robot's file until a person chooses another.
  useUnitOf(arm) {
    const unit = LENGTHS[arm.length];
    if (remembered("length", "") === "" && unit && unit !== this.units.length) {
      this.units.length = unit;
      this.tellUnits();
    }
  }

  setUnits(units) {
    Object.assign(this.units, units);
    remember("angle", this.units.angle);
    remember("length", this.units.length);
    this.tellUnits();
  }

  tellUnits() {
    for (const part of [this.card, this.world, this.dock, ...this.panels.map(({ panel }) => panel)])
      part.unitsChanged?.();
  }
}

// Scroll the rail to a tab. scrollIntoView would also scroll a page that has this one in a frame.
function showWithin(tab) {
  const rail = tab.closest("nav"),
    [outer, inner] = [rail, tab].map((element) => element.getBoundingClientRect());
  const past = (low, high) =>
    Math.max(inner[high] - outer[high], 0) + Math.min(inner[low] - outer[low], 0);
  rail.scrollBy(past("left", "right"), past("top", "bottom"));
}
