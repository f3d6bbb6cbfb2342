"""Estimated widths of LaTeX mathematics, to decide where lines are broken."""

from __future__ import annotations

import re

SCRIPT = 0.38
"""Width of a letter in a sub- or superscript, em."""
LETTER = 0.56
DIGIT = 0.5
NARROW = 0.4
BINARY = 1.25
"""Width of a binary operator with the space around it, em."""
ACCENT = re.compile(r"\\d?dot\{(\w)\}")
FRACTION = re.compile(r"\\t?frac\{((?:[^{}]|\{[^{}]*\})*)\}\{((?:[^{}]|\{[^{}]*\})*)\}")
SCRIPTS = re.compile(r"(?:_\{([^{}]*)\})?\^\{([^{}]*)\}|_\{([^{}]*)\}")
COMMAND = re.compile(r"\\([A-Za-z]+|.)")
SPACES = {"qquad": 2.0, "quad": 1.0, ",": 0.17}
NOTHING = frozenset(("bigl", "bigr", "Bigl", "Bigr", "left", "right", "mathrm", "mathit", "sqrt"))


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
        width += SCRIPT * max(len(COMMAND.sub("x", script or "")) for script in match.groups())
        return ""

    def measure_command(match: re.Match[str]) -> str:
        nonlocal width
        name = match[1]
        if name in SPACES:
            width += SPACES[name]
            return ""
        if name in NOTHING:
            return ""
        return name if name in ("sin", "cos", "tan") else "x"

    rest = ACCENT.sub(r"\1", latex)
    rest = FRACTION.sub(measure_fraction, rest)
    rest = SCRIPTS.sub(measure_scripts, rest)
    rest = COMMAND.sub(measure_command, rest)
    for character in rest:
        if character in "+-=":
            width += BINARY
        elif character in "()|.,":
            width += NARROW
        elif character.isdecimal():
            width += DIGIT
        elif character not in " {}\n":
            width += LETTER
    return width
