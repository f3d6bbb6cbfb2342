"""Write each tutorial as a notebook that can be downloaded: text, and code without prompts and outputs."""

from __future__ import annotations

import doctest
import json
import re
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
BLOCK = re.compile(r"^```python\n(.*?)^```$\n?", re.DOTALL | re.MULTILINE)
FOLDER = HERE / "_generated" / "extra" / "notebooks"


def cells(text: str) -> list[dict[str, Any]]:
    """Return the cells of a page."""
    found: list[dict[str, Any]] = []
    end = 0
    for block in BLOCK.finditer(text):
        add_text(found, text[end : block.start()])
        examples = doctest.DocTestParser().get_examples(block[1])
        source = "".join(example.source for example in examples) or block[1]
        found.append(
            {
                "cell_type": "code",
                "metadata": {},
                "execution_count": None,
                "outputs": [],
                "source": source.rstrip("\n"),
            }
        )
        end = block.end()
    add_text(found, text[end:])
    return [{**cell, "id": f"cell-{k}"} for k, cell in enumerate(found)]


def add_text(found: list[dict[str, Any]], text: str) -> None:
    """Append a cell of text; pictures of the site and links to its pages become plain text."""
    text = re.sub(r"!\[([^\]]*)\]\([^)]*\)(\{[^}]*\})?\n?", "", text)
    text = re.sub(r"\[([^\]]+)\]\((?!http)[^)]*\)", r"\1", text).strip()
    if text:
        found.append({"cell_type": "markdown", "metadata": {}, "source": text})


def notebook(text: str) -> dict[str, Any]:
    """Return a page as a notebook."""
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {
        "cells": cells(text),
        "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }


def main() -> None:
    """Write the notebooks of all tutorials."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for page in sorted((HERE / "tutorials").glob("[0-9]*.md")):
        content = json.dumps(notebook(page.read_text("utf-8")), indent=1, ensure_ascii=False)
        (FOLDER / f"{page.stem}.ipynb").write_text(content, "utf-8")


if __name__ == "__main__":
    main()
