"""Estimated widths of LaTeX mathematics, to check that lines fit a page where TeX is missing."""

from __future__ import annotations

import re

_SCRIPT = 0.38
"""Width of a letter in a sub- or superscript, em."""
_LETTER = 0.56
_DIGIT = 0.5
_NARROW = 0.4
_BINARY = 1.25
"""Width of a binary operator with the space around it, em."""
_ACCENT = re.compile(r"\\d?dot\{(\w)\}")
_FRACTION = re.compile(r"\\t?frac\{((?:[^{}]|\{[^{}]*\})*)\}\{((?:[^{}]|\{[^{}]*\})*)\}")
_SCRIPTS = re.compile(r"(?:_\{([^{}]*)\})?\^\{([^{}]*)\}|_\{([^{}]*)\}")
_COMMAND = re.compile(r"\\([A-Za-z]+|.)")
_SPACES = {"qquad": 2.0, "quad": 1.0, ",": 0.17}
_NOTHING = frozenset(("bigl", "bigr", "Bigl", "Bigr", "left", "right", "mathrm", "mathit", "sqrt"))


def latex_width(latex: str) -> float:
    """Return an estimate of the width, em; errors are on the large side."""
    width = 0.0

    def measure_fraction(match: re.Match[str]) -> str:
        nonlocal width
        parts = [latex_width(part) for part in match.groups()]
        width += 0.25 + max(parts) * (0.72 if match[0].startswith("\\tf") else 1.0)
        return ""

    def measure_scripts(match: re.Match[str]) -> str:
        nonlocal width
        width += _SCRIPT * max(len(_COMMAND.sub("x", script or "")) for script in match.groups())
        return ""

    def measure_command(match: re.Match[str]) -> str:
        nonlocal width
        name = match[1]
        if name in _SPACES:
            width += _SPACES[name]
            return ""
        if name in _NOTHING:
            return ""
        return name if name in ("sin", "cos", "tan") else "x"

    rest = _ACCENT.sub(r"\1", latex)
    rest = _FRACTION.sub(measure_fraction, rest)
    rest = _SCRIPTS.sub(measure_scripts, rest)
    rest = _COMMAND.sub(measure_command, rest)
    for character in rest:
        if character in "+-=":
            width += _BINARY
        elif character in "()|.,":
            width += _NARROW
        elif character.isdecimal():
            width += _DIGIT
        elif character not in " {}\n":
            width += _LETTER
    return width
