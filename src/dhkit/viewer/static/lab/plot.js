// Curves over time, drawn by uPlot: colours that colour-blind people tell apart, limits dashed.

import { h, save } from "./dom.js";

export const COLORS = ["#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#bbbbbb"];
const HEIGHT = 150;

let loading = null;

// uPlot's script and style, once.
function load() {
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
    this.root = h("figure", {}, h("figcaption", {}, h("span", {}, `${title} [${unit}]`), h("span", {}, this.csv, this.png)), this.area);
    this.plot = null;
    new ResizeObserver(() => this.resize()).observe(this.area);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.again());
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
    const style = getComputedStyle(document.documentElement);
    const value = (name) => style.getPropertyValue(name).trim();
    const axis = { stroke: value("--faint"), grid: { stroke: value("--line"), width: 1 }, ticks: { show: false }, font: "11px system-ui" };
    const series = this.names.map((name, k) => ({ label: name, stroke: COLORS[k % COLORS.length], width: 1.6, dash: k >= COLORS.length ? [6, 4] : undefined, points: { show: false } }));
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
        ctx.strokeStyle = COLORS[k % COLORS.length];
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
    times.forEach((t, i) => lines.push([t, ...curves.map((curve) => curve[i])].join(",")));
    save(`${this.title}.csv`, lines.join("\n") + "\n", "text/csv");
  }

  savePng() {
    this.area.querySelector("canvas")?.toBlob((blob) => blob && save(`${this.title}.png`, blob, "image/png"));
  }
}

export function legend(names) {
  return h("ul", { class: "legend" }, names.map((name, k) => h("li", {}, h("i", { style: `background:${COLORS[k % COLORS.length]}` }), name)));
}
