// Colours that Python draws with too: dhkit/viewer/overlays.py; a test compares them.

export const AXES = ["#e5484d", "#30a46c", "#3b82f6"]; // x, y and z
export const GHOSTS = [
  "#4477aa",
  "#ee6677",
  "#228833",
  "#ccbb44",
  "#66ccee",
  "#aa3377",
  "#ee7733",
  "#009988",
];
export const CURVES = [...GHOSTS.slice(0, 6), "#bbbbbb"];
