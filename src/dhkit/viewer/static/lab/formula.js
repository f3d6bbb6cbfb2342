// Formulas that Python sends as MathML: only its elements are taken over, whatever else the text holds.

const SIGNS = new Set(["+", "-", "\u2212"]);
const SYMBOL = 6.2; // px of a symbol of a formula
const INDENT = 2; // symbols before the second line and those after it

const NAMESPACE = "http://www.w3.org/1998/Math/MathML";
const HARMLESS = new Set([
  "display",
  "stretchy",
  "fence",
  "lspace",
  "rspace",
  "width",
  "linethickness",
  "mathvariant",
  "columnalign",
]);

// An element for the text, or null where there is none.
export function formula(text) {
  if (!text) return null;
  const read = new DOMParser().parseFromString(
    text.replace("<math", `<math xmlns="${NAMESPACE}"`),
    "application/xml",
  );
  return read.querySelector("parsererror") ? null : copy(read.documentElement);
}

// The same as lines of a sum, broken before its signs, each at most so many px wide unless a term alone is wider.
export function formulaLines(text, width) {
  const math = formula(text);
  const row = math?.firstElementChild;
  if (!row || symbols(row.children) * SYMBOL <= width) return math ? [math] : null;
  const lines = [[]];
  let term = [];
  const place = () => {
    const line = lines[lines.length - 1];
    if (line.length && (symbols([...line, ...term]) + INDENT) * SYMBOL > width) lines.push(term);
    else line.push(...term);
    term = [];
  };
  for (const part of [...row.children]) {
    if (SIGNS.has(part.textContent) && part.localName === "mo") place();
    term.push(part);
  }
  place();
  return lines.map((parts, k) => {
    const line = math.cloneNode(false);
    const inside = row.cloneNode(false);
    if (k > 0) inside.append(space(INDENT));
    inside.append(...parts);
    line.append(inside);
    return line;
  });
}

// Widths of parts of a formula in symbols: a sign has room on both sides.
function symbols(parts) {
  return [...parts].reduce(
    (sum, part) => sum + part.textContent.trim().length + (part.localName === "mo" ? 2 : 0),
    0,
  );
}

function space(width) {
  const element = document.createElementNS(NAMESPACE, "mspace");
  element.setAttribute("width", `${width / 2}em`);
  return element;
}

function copy(source) {
  const element = document.createElementNS(
    NAMESPACE,
    source.namespaceURI === NAMESPACE ? source.localName : "mrow",
  );
  for (const { name, value } of source.attributes)
    if (HARMLESS.has(name)) element.setAttribute(name, value);
  for (const child of source.childNodes) {
    if (child.nodeType === Node.TEXT_NODE) element.append(child.textContent);
    else if (child.nodeType === Node.ELEMENT_NODE) element.append(copy(child));
  }
  return element;
}
