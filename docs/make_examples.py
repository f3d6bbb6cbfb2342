"""Execute the notebooks of examples/, and write each with its outputs as a page into docs/_generated/notebooks."""

from __future__ import annotations

import base64
import html
import re
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import nbformat
from make_pictures import is_fresh
from nbclient import NotebookClient

HERE = Path(__file__).parent
EXAMPLES = HERE.parent / "examples"
NOTEBOOKS = ("student", "engineer", "researcher")
PAGES = HERE / "_generated" / "notebooks"
BESIDE = HERE / "_generated" / "extra" / "notebooks"
"""Folder of the files that lie beside the pages on the site: the notebooks, and the pages of their views."""
VIEW = re.compile(r'<iframe([^>]*?) srcdoc="(.*?)"(.*?)></iframe>(?:<p.*?</p>)?', re.DOTALL)
"""A view in an output: a whole page as an attribute of a frame, then a note on the package anywidget."""
WITHOUT_WIDGETS = "import sys\nsys.modules['anywidget'] = None"
"""First cell, which is not shown: views are pages, since a page of the site has no Python that moves a widget."""
SECONDS = 300
"""Longest time of a cell."""


def executed(path: Path) -> list[Any]:
    """Return the cells of a notebook after it ran in an empty folder."""
    content = nbformat.read(path, as_version=4)
    content.cells.insert(0, nbformat.v4.new_code_cell(WITHOUT_WIDGETS))
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        NotebookClient(content, timeout=SECONDS, resources=resources).execute()
    return list(content.cells[1:])


def page(name: str, cells: list[Any]) -> str:
    """Return a page: text, code with prompts, and outputs; pictures and views go into files of their own."""
    blocks = []
    count = 0
    for cell in cells:
        if cell.cell_type == "markdown":
            blocks.append(cell.source)
            continue
        blocks.append(f"```python\n{cell.source}\n```")
        for output in cell.outputs:
            count += 1
            blocks.append(output_block(output, f"{name}-{count}"))
    link = (
        f'<a href="{name}.ipynb" download>Download this notebook</a>. It runs in the tests; its'
        " outputs below were made with this site."
    )
    return "\n\n".join([blocks[0], link, *blocks[1:]]) + "\n"


def output_block(output: Any, file: str) -> str:
    """Return an output as Markdown: its picture, its HTML, its formula, or its text."""
    if output.output_type == "error":
        raise RuntimeError(f"{file}: {output.ename}: {output.evalue}")
    if output.output_type == "stream":
        return text_block(output.text)
    data = output.data
    if "image/png" in data:
        (PAGES / f"{file}.png").write_bytes(base64.b64decode(data["image/png"]))
        return f"![Output of the cell above](/_generated/notebooks/{file}.png)"
    if "text/html" in data:
        return raw(
            f'<div class="notebook-output">{with_views_beside(data["text/html"], file)}</div>'
        )
    if "text/latex" in data:
        # Environments such as equation* stand for themselves, each in a paragraph of its own.
        return re.sub(r"(\\end\{\S+?\*?\})\n(?=\\begin)", r"\1\n\n", data["text/latex"].strip())
    return text_block(data["text/plain"])


def with_views_beside(text: str, file: str) -> str:
    """Return HTML whose views lie in files beside the page, so that a reader loads them when they come into sight."""

    def written(found: re.Match[str]) -> str:
        target = BESIDE / f"{file}.html"
        target.write_text(html.unescape(found[2]), "utf-8")
        return f'<iframe{found[1]} src="{target.name}" loading="lazy"{found[3]}></iframe>'

    return VIEW.sub(written, text)


def text_block(text: str) -> str:
    """Return plain text of an output."""
    return raw(f'<pre class="notebook-output">{html.escape(text.rstrip())}</pre>')


def raw(text: str) -> str:
    """Return HTML that the page contains as it is."""
    return f"````{{raw}} html\n{text}\n````"


def main() -> None:
    """Write the pages that are not fresh."""
    for folder in (PAGES, BESIDE):
        folder.mkdir(parents=True, exist_ok=True)
    for name in NOTEBOOKS:
        source = EXAMPLES / f"{name}.ipynb"
        target = PAGES / f"{name}.md"
        shutil.copyfile(source, BESIDE / source.name)
        if is_fresh(target, source) and target.stat().st_mtime > Path(__file__).stat().st_mtime:
            continue
        start = time.perf_counter()
        target.write_text(page(name, executed(source)), "utf-8")
        sys.stdout.write(f"{source.name}: {time.perf_counter() - start:.1f} s\n")


if __name__ == "__main__":
    main()
