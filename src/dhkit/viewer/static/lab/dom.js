// Elements, numbers and files of the page.

// h("button", { class: "wide", onclick: act }, "Text", other): texts are texts, never HTML.
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === false || value === null || value === undefined) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (
      name in element &&
      !["list", "form", "type", "class"].includes(name) &&
      typeof value !== "string"
    )
      element[name] = value;
    else element.setAttribute(name === "className" ? "class" : name, value === true ? "" : value);
  }
  element.append(
    ...children
      .flat(Infinity)
      .filter((child) => child !== null && child !== undefined && child !== false),
  );
  return element;
}

export const DEGREES = 180 / Math.PI;

// Units of joints: what is shown is the value times the scale.
export const UNITS = {
  rad: { scale: 1, digits: 4, sign: " rad", step: 0.01 },
  deg: { scale: DEGREES, digits: 2, sign: "°", step: 1 },
  m: { scale: 1, digits: 4, sign: " m", step: 0.01 },
  mm: { scale: 1000, digits: 1, sign: " mm", step: 1 },
  in: { scale: 1 / 0.0254, digits: 3, sign: " in", step: 0.1 },
};

export function fixed(value, digits) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text;
}

// A number that a person types: a comma is a point; null where it is none.
export function typed(text) {
  const cleaned = text.trim().replace(",", ".").replace("\u2212", "-");
  const value = Number(cleaned);
  return cleaned !== "" && Number.isFinite(value) ? value : null;
}

// Whether a value is outside of limits, of which null is none.
export function beyond(value, lower, upper) {
  return (lower !== null && value < lower) || (upper !== null && value > upper);
}

// nearest: the two links, or the link and the obstacle, that are nearest to each other, with their distance (null: by
// their capsules alone), or null.
export function touchingText(nearest) {
  if (!touches(nearest)) return "";
  const [a, b] = nearest.links.map((link) => (link ? `link ${link}` : "the base"));
  if (nearest.obstacle) return `${a} touches ${nearest.obstacle}`;
  return nearest.distance === null
    ? `${a} and ${b} may touch each other`
    : `${a} and ${b} touch each other`;
}

// How deep they penetrate each other, in a unit of UNITS; empty where they do not, or nothing is known.
export function depthText(nearest, unit) {
  if (!touches(nearest) || nearest.distance === null) return "";
  const { scale, digits, sign } = UNITS[unit];
  return `${fixed(-nearest.distance * scale, digits)}${sign} deep`;
}

// Whether they touch each other, or may.
export function touches(nearest) {
  return Boolean(nearest) && (nearest.distance === null || nearest.distance < 0);
}

export function save(name, content, type) {
  const address = URL.createObjectURL(new Blob([content], { type }));
  const link = h("a", { href: address, download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

export function bytes(base64) {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
}

export async function base64Of(file) {
  const content = new Uint8Array(await file.arrayBuffer());
  let text = "";
  for (let i = 0; i < content.length; i += 8192)
    text += String.fromCharCode(...content.subarray(i, i + 8192));
  return btoa(text);
}

// A field whose text is only taken when it is done: Enter or leaving it; Escape puts back what was there.
// refresh(): shows the present value, which may be another than when the field was entered.
export function onTyped(input, take, refresh = () => {}) {
  let before = "";
  input.addEventListener("focus", () => (before = input.value));
  input.addEventListener("change", async () => {
    await take(input.value);
    if (document.activeElement !== input) refresh();
  });
  input.addEventListener("blur", () => input.value === before && refresh());
  input.addEventListener("keydown", (event) => {
    if (event.key === "Enter") input.blur();
    if (event.key !== "Escape") return;
    input.value = before;
    input.blur();
  });
}

// The unit of values of several joints: of angles, of slides, or of both.
export function unitsOf(joints, angle, length) {
  const slides = new Set(joints.map((joint) => joint.unit === "m"));
  if (slides.size > 1) return `${angle} or ${length}`;
  return slides.has(true) ? length : angle;
}

// A matrix of 4 x 4 numbers by row as a formula, behind its name where it has one: MathML.
export function matrix(numbers, name = "") {
  const m = (tag, ...children) => {
    const element = document.createElementNS("http://www.w3.org/1998/Math/MathML", tag);
    element.append(...children);
    return element;
  };
  // A sign takes its room where there is none: the digits stand below each other.
  const sign = (text) => m(text.startsWith("-") ? "mrow" : "mphantom", m("mn", "\u2212"));
  const entry = (x) =>
    m("mtd", m("mrow", sign(fixed(x, 5)), m("mn", fixed(x, 5).replace("-", ""))));
  const rows = [0, 1, 2, 3].map((i) =>
    m("mtr", ...[0, 1, 2, 3].map((j) => entry(numbers[4 * i + j]))),
  );
  const math = m(
    "math",
    m(
      "mrow",
      ...(name ? [name, m("mo", "=")] : []),
      m("mo", "["),
      m("mtable", ...rows),
      m("mo", "]"),
    ),
  );
  math.setAttribute("class", "matrix");
  return math;
}

// A letter with an index, for a formula.
export function indexed(letter, index) {
  const element = document.createElementNS("http://www.w3.org/1998/Math/MathML", "msub");
  for (const [tag, text] of [
    ["mi", letter],
    ["mn", String(index)],
  ]) {
    const part = document.createElementNS(element.namespaceURI, tag);
    part.textContent = text;
    element.append(part);
  }
  return element;
}
