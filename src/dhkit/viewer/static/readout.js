// Numbers of the state on show: joints in degrees and metres, the tool's position in metres.

const DEGREES = 180 / Math.PI;
const MINUS = "\u2212";

export class Readout {
  constructor(root) {
    this.root = root;
    this.name = root.querySelector("#name");
    this.joints = root.querySelector("#joints");
    this.tool = root.querySelector("#tool");
    if (matchMedia("(max-width: 560px), (max-height: 420px)").matches) root.open = false;
  }

  set(about) {
    this.name.textContent = about.name;
    if (!document.getElementById("messages")) document.title = `${about.name} · dhkit`; // a saved page has its own
    this.units = about.joints.map((joint) => joint.unit);
    this.joints.replaceChildren(...about.joints.map((joint) => row(joint.name)));
    this.tool.replaceChildren(...["x", "y", "z"].map(row));
    this.root.hidden = false;
  }

  show(q, position) {
    this.units.forEach((unit, i) => {
      write(this.joints.rows[i].cells[1], unit === "deg" ? degrees(q[i]) : metres(q[i]));
    });
    position.forEach((value, i) => write(this.tool.rows[i].cells[1], metres(value)));
  }
}

function row(name) {
  const line = document.createElement("tr");
  const head = document.createElement("th");
  head.scope = "row";
  head.textContent = name;
  head.title = name;
  line.append(head, document.createElement("td"));
  return line;
}

function write(cell, text) {
  if (cell.textContent !== text) cell.textContent = text;
}

function degrees(value) {
  return `${signed(value * DEGREES, 1)}°`;
}

function metres(value) {
  return `${signed(value, 3)} m`;
}

function signed(value, digits) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", MINUS);
}
