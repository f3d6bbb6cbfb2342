r"""Names in LaTeX: m_{2}, I_{xx,2}, \theta_{1}; no two names have the same LaTeX."""

from __future__ import annotations

import re
from collections import Counter
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
    counts = Counter(_typeset(name) for name in listed)
    used = set(taken)
    written = {}
    for name in listed:
        typeset = _typeset(name)
        is_unique = counts[typeset] == 1 and typeset not in used
        written[name] = typeset if is_unique else literal(name)
    return written


def _typeset(name: str) -> str:
    """Return a name as textbooks typeset it."""
    # Ixx2: an entry of an inertia matrix.
    match = _AXES.fullmatch(name)
    if match:
        letter, axes, number = match.groups()
        subscript = f"{axes},{number}" if number else axes
        return f"{letter}_{{{subscript}}}"

    # rx2: a first moment.
    match = _MOMENT.fullmatch(name)
    if match:
        letter, axis, number = match.groups()
        return f"{letter}_{{{axis}{number}}}"

    # XX2, Ia2: a base parameter.
    match = _REGROUPED.fullmatch(name)
    if match:
        letters, number = match.groups()
        return rf"\mathit{{{letters}}}_{{{number}}}"

    # lc1, l_c1, theta_2: letters, a number, and subscripts after underscores.
    head, *subscripts = name.split("_")
    match = _HEAD.fullmatch(head)
    if match is None or not match[1] or not all(subscripts):
        return literal(name)
    letters, number = match.groups()
    base, subscript = _base(letters)
    scripts = [subscript + number] if subscript + number else []
    scripts += [_word(part) for part in subscripts]
    return f"{base}_{{{','.join(scripts)}}}" if scripts else base


def _greek(name: str) -> str | None:
    """Return the command of a Greek letter; None if the name is none."""
    return f"\\{name}" if name in GREEK else None


def literal(name: str) -> str:
    """Return a name as it is typed, in upright letters."""
    escaped = name.replace("_", r"\_")
    return rf"\mathrm{{{escaped}}}"


def _base(letters: str) -> tuple[str, str]:
    """Split letters into a symbol and its subscript: l and c for lc."""
    command = _greek(letters)
    if command:
        return command, ""
    if len(letters) == 1:
        return letters, ""
    if _LETTER.fullmatch(letters):
        return letters[0], letters[1]
    return rf"\mathrm{{{letters}}}", ""


def _word(part: str) -> str:
    """Return a subscript in LaTeX."""
    match = _HEAD.fullmatch(part)
    command = _greek(match[1]) if match else None
    if match and command:
        return f"{command} {match[2]}" if match[2] else command
    is_plain = len(part) == 1 or part.isdecimal() or _LETTER.fullmatch(part)
    return part if is_plain else rf"\mathrm{{{part}}}"
