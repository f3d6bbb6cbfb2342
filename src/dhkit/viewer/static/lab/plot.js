// Curves over time, drawn by uPlot: colours that colour-blind people tell apart, limits dashed.

import { CURVES } from "../colors.js";
import { h, save } from "./dom.js";

const LEAST = { width: 200, height: 96 }; // px
const SYNC = "dhkit"; // one pointer in all plots
const NEAR = 0.25; // share of the range of a joint
const DIGITS = 8; // of numbers in a CSV

let loading = null;

// uPlot's script and style, once.
function load() {
  if (globalThis.uPlot) return Promise.resolve(globalThis.uPlot); // a page without Python has it inside
  loading ??= new Promise((resolve, reject) => {
    document.head.append(h("link", { rel: "stylesheet", href: "lab/uplot.css" }));
    document.head.append(
      h("script", {
        src: "lab/uplot.js",
        onload: () => resolve(globalThis.uPlot),
        onerror: reject,
      }),
    );
  });
  return loading;
}

export class Plot {
  // unit: of the values; seek(time): called where a person points at a time with the button down.
  constructor(title, unit, seek = null) {
    this.title = title;
    this.unit = unit;
    this.seek = seek;
    this.hidden = new Set(); // curves that are not drawn
    this.area = h("div", { class: "plot" });
    this.csv = h(
      "button",
      {
        class: "quiet",
        title: `Save ${title} as CSV`,
        onclick: () => this.saveCsv(),
      },
      "CSV",
    );
    this.png = h(
      "button",
      {
        class: "quiet",
        title: `Save ${title} as PNG`,
        onclick: () => this.savePng(),
      },
      "PNG",
    );
    this.caption = h("span", {}, `${title} [${unit}]`);
    this.root = h(
      "figure",
      {},
      h("figcaption", {}, this.caption, h("span", {}, this.csv, this.png)),
      this.area,
    );
    this.plot = null;
    new ResizeObserver(() => this.resize()).observe(this.area);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.again());
  }

  setUnit(unit) {
    this.unit = unit;
    this.caption.textContent = `${this.title} [${unit}]`;
  }

  clear() {
    this.shownData = null;
    this.names = null;
    this.key = null;
    this.plot?.destroy();
    this.plot = null;
  }

  // data: times, then the values of each curve, and desired ones of each where there are twice as many: they are dashed.
  // limits: a pair of values for each curve, that are drawn dotted, or null.
  async set(names, data, limits = null) {
    this.shownData = data;
    const key = JSON.stringify([names, limits, data.length]);
    if (this.plot && this.key === key) return void this.plot.setData(data);
    this.key = key;
    this.names = names;
    this.limits = limits;
    await this.again();
  }

  async again() {
    if (!this.names) return;
    const uPlot = await load();
    this.plot?.destroy();
    if (!this.names) return; // cleared meanwhile
    const style = getComputedStyle(document.documentElement);
    const value = (name) => style.getPropertyValue(name).trim();
    const axis = {
      stroke: value("--faint"),
      grid: { stroke: value("--line"), width: 1 },
      ticks: { show: false },
      font: "11px system-ui",
    };
    const curve = (label, k, dash) => ({
      label,
      stroke: CURVES[k % CURVES.length],
      width: dash ? 1.2 : 1.7,
      dash,
      show: !this.hidden.has(k),
      points: { show: false },
    });
    const series = this.labels().map((label, i) =>
      curve(label, i % this.names.length, i >= this.names.length ? [6, 4] : undefined),
    );
    this.plot = new uPlot(
      {
        ...this.size(),
        scales: { x: { time: false } },
        series: [{ label: "t [s]" }, ...series],
        axes: [
          { ...axis, size: 24, label: "t [s]", labelSize: 15, labelGap: 0, labelFont: axis.font },
          { ...axis, size: 46, space: 22 },
        ],
        legend: { show: false },
        cursor: {
          points: { size: 6 },
          y: false,
          drag: { x: false, y: false },
          sync: { key: SYNC },
        },
        hooks: { draw: [(plot) => this.drawLimits(plot)] },
      },
      this.shownData,
      this.area,
    );
    if (this.seek) this.follow(this.plot);
  }

  // Names of all curves: those that are shown, and the desired ones.
  labels() {
    const desired = this.shownData.length - 1 > this.names.length;
    return desired ? [...this.names, ...this.names.map((name) => `${name}, desired`)] : this.names;
  }

  size() {
    return {
      width: Math.max(LEAST.width, this.area.clientWidth),
      height: Math.max(LEAST.height, this.area.clientHeight),
    };
  }

  // The scene goes to the time that a person points at.
  follow({ over }) {
    const go = (event) => event.buttons & 1 && this.seek(this.plot.posToVal(event.offsetX, "x"));
    over.addEventListener("pointerdown", (event) => {
      over.setPointerCapture(event.pointerId);
      go(event);
    });
    over.addEventListener("pointermove", go);
  }

  // hidden: numbers of the curves that are not drawn, nor their desired ones.
  hide(hidden) {
    this.hidden = hidden;
    const n = this.names?.length;
    this.plot?.series.forEach(
      (_, i) => i > 0 && this.plot.setSeries(i, { show: !hidden.has((i - 1) % n) }),
    );
  }

  drawLimits(plot) {
    if (!this.limits) return;
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.setLineDash([2, 4]);
    let drawn = false;
    this.limits.forEach((pair, k) => {
      if (this.hidden.has(k)) return;
      for (const value of pair ?? []) {
        if (value === null || value < plot.scales.y.min || value > plot.scales.y.max) continue;
        // A limit far from its own curve would look like that of another.
        if (!this.comesNear(k, value, pair)) continue;
        drawn = true;
        const y = Math.round(plot.valToPos(value, "y", true)) + 0.5;
        ctx.strokeStyle = CURVES[k % CURVES.length];
        ctx.beginPath();
        ctx.moveTo(bbox.left, y);
        ctx.lineTo(bbox.left + bbox.width, y);
        ctx.stroke();
      }
    });
    ctx.restore();
    this.caption.classList.toggle("limited", drawn);
  }

  // Whether a curve comes within a quarter of the range between its limits of one of them.
  comesNear(k, limit, [low, high]) {
    const range = low === null || high === null ? Math.abs(limit) : high - low;
    return this.shownData[k + 1].some((value) => Math.abs(value - limit) < NEAR * range);
  }

  // Mark a time by the line that a pointer has.
  mark(time) {
    if (this.plot && this.area.clientWidth > 0)
      this.plot.setCursor({ left: this.plot.valToPos(time, "x"), top: 10 }, false);
  }

  resize() {
    if (this.plot && this.area.clientWidth > 0) this.plot.setSize(this.size());
  }

  saveCsv() {
    if (!this.shownData) return;
    const [times, ...curves] = this.shownData;
    const lines = [["t [s]", ...this.labels().map((name) => `"${name} [${this.unit}]"`)].join(",")];
    times.forEach((t, i) =>
      lines.push(
        [t, ...curves.map((curve) => curve[i])]
          .map((x) => String(Number(x.toPrecision(DIGITS))))
          .join(","),
      ),
    );
    save(`${this.title}.csv`, lines.join("\n") + "\n", "text/csv");
  }

  // A picture for a report: the curves at their size on screen times the screen's pixels, under a title and names.
  savePng() {
    const curves = this.area.querySelector("canvas");
    if (!curves || !this.names) return;
    const style = getComputedStyle(document.documentElement),
      value = (name) => style.getPropertyValue(name).trim();
    const scale = curves.width / curves.clientWidth,
      line = 18 * scale,
      picture = document.createElement("canvas");
    picture.width = curves.width;
    const paint = picture.getContext("2d"),
      font = `${12 * scale}px system-ui, sans-serif`;
    paint.font = font;
    const places = [];
    let x = 8 * scale,
      row = 1;
    for (const name of this.names) {
      const width = paint.measureText(name).width + 30 * scale;
      if (x + width > picture.width && x > 8 * scale) [x, row] = [8 * scale, row + 1];
      places.push({ x, row });
      x += width;
    }
    const top = (row + 1) * line + 4 * scale;
    picture.height = top + curves.height + line;
    paint.fillStyle = value("--ground");
    paint.fillRect(0, 0, picture.width, picture.height);
    paint.font = font;
    paint.fillStyle = value("--ink");
    paint.fillText(`${this.title} [${this.unit}]`, 8 * scale, line * 0.8);
    places.forEach((place, k) => {
      const y = (place.row + 0.8) * line;
      paint.fillStyle = CURVES[k % CURVES.length];
      paint.fillRect(place.x, y - 5 * scale, 12 * scale, 3 * scale);
      paint.fillStyle = value("--ink");
      paint.fillText(this.names[k], place.x + 17 * scale, y);
    });
    paint.drawImage(curves, 0, top);
    paint.fillText("t [s]", picture.width / 2, picture.height - 5 * scale);
    picture.toBlob((blob) => blob && save(`${this.title}.png`, blob, "image/png"));
  }
}

// Names of curves with their colors; a click hides a curve, and shows it again.
export function legend(names, hidden, toggle) {
  return h(
    "ul",
    { class: "legend" },
    names.map((name, k) =>
      h(
        "li",
        {},
        h(
          "button",
          {
            "aria-pressed": String(!hidden.has(k)),
            title: `Show or hide ${name}`,
            onclick: () => toggle(k),
          },
          h("i", { style: `background:${CURVES[k % CURVES.length]}` }),
          name,
        ),
      ),
    ),
  );
}
