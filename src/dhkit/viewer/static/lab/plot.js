// Curves over time, drawn by uPlot: colours that colour-blind people tell apart, limits dashed.

import { CURVES } from "../colors.js";
import { h, save } from "./dom.js";

const HEIGHT = 150;
const DIGITS = 8; // of numbers in a CSV

let loading = null;

// uPlot's script and style, once.
function load() {
  if (globalThis.uPlot) return Promise.resolve(globalThis.uPlot); // a page without Python has it inside
  loading ??= new Promise((resolve, reject) => {
    document.head.append(h("link", { rel: "stylesheet", href: "lab/uplot.css" }));
    document.head.append(h("script", { src: "lab/uplot.js", onload: () => resolve(globalThis.uPlot), onerror: reject }));
  });
  return loading;
}

export class Plot {
  // names: of the curves; unit: of the values.
  constructor(title, unit) {
    this.title = title;
    this.unit = unit;
    this.area = h("div", { class: "plot" });
    this.csv = h("button", { type: "button", class: "quiet", title: `Save ${title} as CSV`, onclick: () => this.saveCsv() }, "CSV");
    this.png = h("button", { type: "button", class: "quiet", title: `Save ${title} as PNG`, onclick: () => this.savePng() }, "PNG");
    this.caption = h("span", {}, `${title} [${unit}]`);
    this.root = h("figure", {}, h("figcaption", {}, this.caption, h("span", {}, this.csv, this.png)), this.area);
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

  // data: times, then the values of each curve; limits: largest values that are drawn dashed, of each curve, or null.
  async set(names, data, limits = null) {
    this.shownData = data;
    const key = JSON.stringify([names, limits]);
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
    const axis = { stroke: value("--faint"), grid: { stroke: value("--line"), width: 1 }, ticks: { show: false }, font: "11px system-ui" };
    const series = this.names.map((name, k) => ({ label: name, stroke: CURVES[k % CURVES.length], width: 1.6, dash: k >= CURVES.length ? [6, 4] : undefined, points: { show: false } }));
    this.plot = new uPlot({
      width: Math.max(200, this.area.clientWidth),
      height: HEIGHT,
      scales: { x: { time: false } },
      series: [{ label: "t [s]" }, ...series],
      axes: [{ ...axis, size: 26 }, { ...axis, size: 46 }],
      legend: { show: false },
      cursor: { points: { size: 6 }, y: false },
      hooks: { draw: [(plot) => this.drawLimits(plot)] },
    }, this.shownData, this.area);
  }

  drawLimits(plot) {
    if (!this.limits) return;
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.setLineDash([6, 4]);
    this.limits.forEach((pair, k) => {
      for (const value of pair ?? []) {
        if (value === null || value < plot.scales.y.min || value > plot.scales.y.max) continue;
        const y = Math.round(plot.valToPos(value, "y", true)) + 0.5;
        ctx.strokeStyle = CURVES[k % CURVES.length];
        ctx.beginPath();
        ctx.moveTo(bbox.left, y);
        ctx.lineTo(bbox.left + bbox.width, y);
        ctx.stroke();
      }
    });
    ctx.restore();
  }

  // Mark a time by the line that a pointer has.
  mark(time) {
    if (this.plot && this.area.clientWidth > 0) this.plot.setCursor({ left: this.plot.valToPos(time, "x"), top: 10 }, false);
  }

  resize() {
    if (this.plot && this.area.clientWidth > 0) this.plot.setSize({ width: this.area.clientWidth, height: HEIGHT });
  }

  saveCsv() {
    if (!this.shownData) return;
    const [times, ...curves] = this.shownData;
    const lines = [["t [s]", ...this.names.map((name) => `${name} [${this.unit}]`)].join(",")];
    times.forEach((t, i) => lines.push([t, ...curves.map((curve) => curve[i])].map((x) => String(Number(x.toPrecision(DIGITS)))).join(",")));
    save(`${this.title}.csv`, lines.join("\n") + "\n", "text/csv");
  }

  // A picture for a report: the curves at their size on screen times the screen's pixels, under a title and names.
  savePng() {
    const curves = this.area.querySelector("canvas");
    if (!curves || !this.names) return;
    const style = getComputedStyle(document.documentElement), value = (name) => style.getPropertyValue(name).trim();
    const scale = curves.width / curves.clientWidth, line = 18 * scale, picture = document.createElement("canvas");
    picture.width = curves.width;
    const paint = picture.getContext("2d"), font = `${12 * scale}px system-ui, sans-serif`;
    paint.font = font;
    const places = [];
    let x = 8 * scale, row = 1;
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

export function legend(names) {
  return h("ul", { class: "legend" }, names.map((name, k) => h("li", {}, h("i", { style: `background:${CURVES[k % CURVES.length]}` }), name)));
}
