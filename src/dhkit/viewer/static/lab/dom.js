// Elements, numbers and files of the page.

// h("button", { class: "wide", onclick: act }, "Text", other): texts are texts, never HTML.
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === false || value === null || value === undefined) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name in element && !["list", "form", "type", "class"].includes(name) && typeof value !== "string") element[name] = value;
    else element.setAttribute(name === "className" ? "class" : name, value === true ? "" : value);
  }
  element.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
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

// links: two numbers, 0 for the base, or none.
export function touchingText(links) {
  if (!links?.length) return "";
  const name = (link) => (link ? `link ${link}` : "the base");
  return `${name(links[0])} and ${name(links[1])} touch each other`;
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
  for (let i = 0; i < content.length; i += 8192) text += String.fromCharCode(...content.subarray(i, i + 8192));
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

export function matrix(numbers) {
  const rows = [0, 1, 2, 3].map((i) => h("tr", {}, [0, 1, 2, 3].map((j) => h("td", {}, fixed(numbers[4 * i + j], 4)))));
  return h("table", { class: "matrix" }, h("tbody", {}, rows));
}
