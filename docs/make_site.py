"""Build the site: reference pages, tables, pictures, then Sphinx, for which a warning is an error.

python docs/make_site.py [OPTIONS OF SPHINX]
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from pathlib import Path

import check_links
import make_examples
import make_notebooks
import make_pictures
import make_reference
import make_tables
from sphinx.cmd.build import main as sphinx

HERE = Path(__file__).parent
OUTPUT = HERE.parent / "out" / "docs"
DOCTREES = HERE.parent / "out" / "docs-doctrees"


def main(options: list[str]) -> int:
    """Build the site, and return Sphinx's exit status."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    start = time.perf_counter()
    # Pages of an earlier build whose sources are gone would stay, and their links break.
    for folder in (OUTPUT, DOCTREES):
        shutil.rmtree(folder, ignore_errors=True)
    make_reference.main()
    make_pictures.main()
    make_tables.main()
    make_notebooks.main()
    make_examples.main()
    status = sphinx(
        [
            "-W",
            "--keep-going",
            "-q",
            "-j",
            "2",
            "-d",
            str(DOCTREES),
            *options,
            str(HERE),
            str(OUTPUT),
        ]
    )
    status = status or check_links.main(OUTPUT)
    pages = len(list(OUTPUT.rglob("*.html")))
    sys.stdout.write(f"{pages} pages in {OUTPUT}, {time.perf_counter() - start:.0f} s\n")
    return status


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
