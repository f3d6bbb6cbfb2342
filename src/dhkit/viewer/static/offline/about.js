// What the page shows: its caption, what colours mean, and where to read on.

import { AXES } from "../colors.js";
import { h } from "../lab/dom.js";

export class AboutPanel {
  constructor(lab, root) {
    this.lab = lab;
    this.root = root;
  }

  take_about({ caption, ghosts, links, overlays, source }) {
    const swatch = (color) => h("i", { style: `background:${color}` });
    const meaning = (color, text) => h("li", {}, swatch(color), text);
    const colors = [meaning("var(--accent)", "orange: the tool's path, and links beyond a limit")];
    colors.push(
      h("li", {}, ...AXES.map(swatch), "red, green and blue: the x, y and z axis of a frame"),
    );
    colors.push(
      ...ghosts.map(({ text, color }) => meaning(color, text)),
      ...overlays.map(({ text, color }) => meaning(color, text)),
    );
    this.root.replaceChildren(
      ...(caption || source)
        .split("\n")
        .filter((text) => text.trim())
        .map((text) => h("p", { class: "caption" }, text)),
      h("h2", {}, "Colours"),
      h("ul", { class: "colors" }, colors),
      ...(links.length
        ? [
            h("h2", {}, "Read on"),
            h(
              "ul",
              { class: "links" },
              links
                .filter(({ href }) =>
                  ["file:", "http:", "https:", "mailto:", "about:"].includes(
                    new URL(
                      href,
                      document.baseURI === "about:srcdoc" ? "http://localhost" : document.baseURI,
                    ).protocol,
                  ),
                )
                .map(({ text, href }) => h("li", {}, h("a", { href }, text))),
            ),
          ]
        : []),
      h(
        "p",
        { class: "hint" },
        "This page needs no server and no network. F shows the frames, R brings the whole arm into view; the space bar plays and pauses.",
      ),
    );
  }
}
