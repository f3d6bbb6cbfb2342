// Formulas that Python sends as MathML: only its elements are taken over, whatever else the text holds.

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
