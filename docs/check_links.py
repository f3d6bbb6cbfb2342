"""Check that the links of the built pages lead to files and anchors, and that no page loads from a network."""

from __future__ import annotations

import sys
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """Anchors, links and loaded files of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what an element names and what it leads to."""
        values = {name: value for name, value in attrs if value}
        self.anchors |= {values[name] for name in ("id", "name") if name in values}
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        if "src" in values:
            self.loaded.append(values["src"])
        if tag == "link" and values.get("rel") in {"stylesheet", "icon", "preload"}:
            self.loaded.append(values["href"])


@cache
def read(path: Path) -> Page:
    """Return a page."""
    return Page(path.read_text("utf-8"))


def faults(folder: Path) -> list[str]:
    """Return one line for each broken link and each file that would come from a network."""
    found = []
    for path in sorted(folder.rglob("*.html")):
        page = read(path)
        name = path.relative_to(folder)
        for target in page.links + page.loaded:
            parts = urlsplit(target)
            if parts.scheme in {"http", "https"}:
                if target in page.loaded:
                    found.append(f"{name}: loads {target}")
                continue
            if parts.scheme:
                continue
            there = path if not parts.path else (path.parent / unquote(parts.path)).resolve()
            if there.is_dir():
                there /= "index.html"
            if not there.is_file():
                found.append(f"{name}: {target} is not there")
            elif there.suffix == ".html" and parts.fragment:
                anchors = read(there).anchors
                if unquote(parts.fragment) not in anchors:
                    found.append(f"{name}: {target} has no such anchor")
    return found


def main(folder: Path) -> int:
    """Print the faults, and return 1 if there are any."""
    found = faults(folder)
    for line in found:
        sys.stdout.write(f"{line}\n")
    return int(bool(found))


if __name__ == "__main__":
    raise SystemExit(main(Path(sys.argv[1])))
