// Icons of the panels: strokes in a square of 20.

const PATHS = {
  task: "M5 4h10v13H5zM8 3h4v3H8zM7.5 11l2 2 3.5-4",
  about: "M10 17a7 7 0 1 0 0-14 7 7 0 0 0 0 14zM10 9v5M10 6.2v.1",
  joints: "M3 6h8M15 6h2M3 14h2M9 14h8M13 4v4M7 12v4",
  tool: "M10 3v5M6 17v-4l4-5 4 5v4M7.5 17H6M14 17h-1.5",
  motion: "M3 16c5 0 4-11 9-11h5M14 2l3 3-3 3M3 16h.1",
  recorded: "M3 16c5 0 4-11 9-11h5M14 2l3 3-3 3M3 16h.1",
  table: "M3 4h14v12H3zM3 8h14M3 12h14M8 4v12",
  dynamics: "M10 3v13M5 16h10M4 6h12M4 6l-2 5h4zM16 6l-2 5h4z",
  workspace: "M10 16V9M10 9l4-3M4 16a7 7 0 1 1 12 0M3 16h14",
  control: "M3 10h4M13 10h4M7 6h6v8H7zM15 10v6H5v-6",
  transforms: "M4 14l5-3 5 3-5 3zM4 14V8l5-3 5 3v6M9 11V5M15 4l2 2-2 2",
  answers: "M4 5h8M4 9h6M4 13h4M10 14l2 2 5-7",
  own: "M7 6l-4 4 4 4M13 6l4 4-4 4M11 4l-2 12",
};

export function icon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const path = document.createElementNS(svg.namespaceURI, "path");
  svg.setAttribute("viewBox", "0 0 20 20");
  svg.setAttribute("aria-hidden", "true");
  path.setAttribute("d", PATHS[name] ?? "M4 4h12v12H4z");
  svg.append(path);
  return svg;
}
