"""Opening a page in the default browser without its address on a command line."""

from __future__ import annotations

import atexit
import html
import shutil
import tempfile
import webbrowser
from pathlib import Path

_PAGE = """<!doctype html>
<meta charset="utf-8">
<meta http-equiv="refresh" content="0; url={url}">
<title>dhkit</title>
<a href="{url}">Continue to dhkit</a>
"""


def open_in_browser(url: str) -> None:
    """Open an address in the default browser by a file that leads there, which this user alone can read.

    The address has the token of the page. A browser's arguments can be read by every user of the machine, those of a
    process that has ended by whoever recorded them. The file is removed when this process ends.
    """
    folder = Path(tempfile.mkdtemp(prefix="dhkit-open-"))  # of mode 0700
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    file = folder / "open.html"
    file.touch(mode=0o600)
    file.write_text(_PAGE.format(url=html.escape(url)), encoding="utf-8")
    webbrowser.open(file.as_uri())
