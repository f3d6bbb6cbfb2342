r"""Names in LaTeX: m_{2}, I_{xx,2}, \theta_{1}; no two names look alike."""

from __future__ import annotations

import re
from collections.abc import Iterable

_LETTERS = """
    alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi psi
    omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega
"""
GREEK = frozenset(_LETTERS.split())
_AXES = re.compile(r"([A-Za-z])([xyz]{2})(\d*)")
_MOMENT = re.compile(r"(r)([xyz])(\d+)")
_REGROUPED = re.compile(r"([MXYZ][XYZ]|Ia)(\d+)")
_HEAD = re.compile(r"([A-Za-z]*?)(\d*)")
_LETTER = re.compile(r"([A-Za-z])([a-z]?)(\d*)")


def latex_names(names: Iterable[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """Return the LaTeX of each name.

    Parameters
    ----------
    names
        Names of constants.
    taken
        LaTeX that has another meaning: a name that would get the same LaTeX, or that of another name, is spelled letter
        by letter.
    """
    listed = list(names)
    used = set(taken)
    written = {}
    counts: dict[str, int] = {}
    for name in listed:
        counts[_nice(name)] = counts.get(_nice(name), 0) + 1
    for name in listed:
        wanted = _nice(name)
        written[name] = wanted if counts[wanted] == 1 and wanted not in used else literal(name)
    return written


def _nice(name: str) -> str:
    """Return a name as textbooks typeset it."""
    if match := _AXES.fullmatch(name):
        letter, axes, number = match.groups()
        return f"{letter}_{{{axes}{',' + number if number else ''}}}"
    if match := _MOMENT.fullmatch(name):
        return "{}_{{{}{}}}".format(*match.groups())
    if match := _REGROUPED.fullmatch(name):
        return r"\mathit{{{}}}_{{{}}}".format(*match.groups())
    head, *subscripts = name.split("_")
    if not head or not all(subscripts):
        return literal(name)
    letters, number = _HEAD.fullmatch(head).groups() if _HEAD.fullmatch(head) else ("", "")  # type: ignore[union-attr]
    if not letters:
        return literal(name)
    base, subscript = _base(letters)
    scripts = [subscript + number] if subscript + number else []
    scripts += [_word(part) for part in subscripts]
    return base + (f"_{{{','.join(scripts)}}}" if scripts else "")


def _greek(name: str) -> str | None:
    """Return the command of a Greek letter; None if the name is none."""
    return f"\\{name}" if name in GREEK else None


def literal(name: str) -> str:
    """Return a name as it is typed, in upright letters."""
    return rf"\mathrm{{{name.replace('_', chr(92) + '_')}}}"


def _base(letters: str) -> tuple[str, str]:
    """Split letters into a symbol and its subscript: l and c for lc."""
    if command := _greek(letters):
        return command, ""
    if len(letters) == 1:
        return letters, ""
    if _LETTER.fullmatch(letters):
        return letters[0], letters[1]
    return rf"\mathrm{{{letters}}}", ""


def _word(part: str) -> str:
    match = _HEAD.fullmatch(part)
    if match and _greek(match[1]):
        return _greek(match[1]) + (f" {match[2]}" if match[2] else "")  # type: ignore[operator]
    return part if len(part) == 1 or part.isdecimal() or _LETTER.fullmatch(part) else rf"\mathrm{{{part}}}"
