"""Pages of HTML that need no other file: their frame and the style that they share, with a font for mathematics.

The font is a part of TeX Gyre Termes Math (GUST e-foundry, under the GUST Font License beside it), with the letters,
signs and sizes of brackets that our formulas have.
"""

from __future__ import annotations

import base64
from functools import cache
from html import escape
from importlib import resources

MATH_FAMILIES = '"dhkit math", "STIX Two Math", "Latin Modern Math", "Cambria Math", math'
"""Fonts for mathematics: the page's own where it has one, then those that systems have."""

MATH_STYLE = f"""
math {{ font-size: 1.12rem; font-family: {MATH_FAMILIES}; }}
math[display="block"] {{ width: fit-content; margin: 0; }}
mtd {{ padding: .18em .45em; }} mtable[columnspacing] mtd {{ padding: .25em 0; }}
mtd[columnalign="left"] {{ text-align: left; }} mtd[columnalign="right"] {{ text-align: right; }}
/* Brackets of matrices as borders: without a font for mathematics a browser cannot stretch them. */
mo.bracket {{ display: none; }}
mtable.matrix {{ border: solid currentColor; border-width: 0 1.5px; border-radius: .9em / 50%;
                padding: .2em .5em; margin-left: .35em; }}
"""
"""Rules for formulas."""

PAGE_STYLE = f"""
:root {{ color-scheme: light dark; --ink: #1b1f24; --paper: #fff; --faint: #57606a; --line: #d8dee4; --tint: #f3f6fa;
        --mark: #0b5cad; --right: #116329; --wrong: #b3261e; --open: #7a5200; --unread: #6e40a9; }}
@media (prefers-color-scheme: dark) {{
  :root {{ --ink: #e6e9ed; --paper: #14171a; --faint: #9aa4af; --line: #3a4149; --tint: #1d2329;
          --mark: #6aa9e9; --right: #6cc47e; --wrong: #ff8f86; --open: #e0b050; --unread: #c4a2f5; }} }}
* {{ box-sizing: border-box; }}
body {{ font: 16px/1.5 "Source Sans 3", "Noto Sans", "DejaVu Sans", sans-serif; color: var(--ink);
       background: var(--paper); max-width: 62rem; margin: 2rem auto; padding: 0 1rem; overflow-wrap: anywhere; }}
h1 {{ font-size: 1.6rem; line-height: 1.2; margin-bottom: .2rem; }} h2 {{ font-size: 1.2rem; margin: 2.2rem 0 .4rem; }}
h3 {{ font-size: 1.05rem; margin: 0 0 .3rem; }}
a {{ color: inherit; }} .source, .note {{ color: var(--faint); margin: .2rem 0; }}
table {{ border-collapse: collapse; margin: .7rem 0; }} caption {{ text-align: left; color: var(--faint); }}
th, td {{ overflow-wrap: normal; text-align: left; padding: .25rem 1rem .25rem 0;
         border-bottom: 1px solid var(--line); }}
th {{ color: var(--faint); font-weight: normal; }}
td.number {{ text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }}
code {{ font: .92em/1.4 "Source Code Pro", "DejaVu Sans Mono", monospace; }}
.display {{ overflow-x: auto; overflow-y: hidden; padding: .5rem 0 .5rem 1rem; }}
{MATH_STYLE}@media print {{ body {{ max-width: none; margin: 0; font-size: 11pt; }} }}
"""
"""Style sheet of the pages with equations and of the reports on answers, which add their own rules."""


@cache
def font_style() -> str:
    """Return the style that brings the font along, 115 kB, for pages that are mostly formulas."""
    font = (resources.files("dhkit") / "fonts" / "math.woff2").read_bytes()
    address = f"data:font/woff2;base64,{base64.b64encode(font).decode()}"
    return f'@font-face {{ font-family: "dhkit math"; src: url({address}) format("woff2"); }}\n'


def page(title: str, body: str, style: str, policy: str = "") -> str:
    """Return a page around a body that is HTML already.

    Parameters
    ----------
    title
        Plain text.
    body
        HTML.
    style
        Style sheet.
    policy
        Content security policy; none if empty.
    """
    content = escape(policy, quote=False)
    meta = f'<meta http-equiv="Content-Security-Policy" content="{content}">\n' if policy else ""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'{meta}<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{style}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )
