r"""Names as textbooks typeset them, in LaTeX and in typst: m_{2}, I_{xx,2}, \theta_{1}; no two names look the same."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

_LETTERS = """
    alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi psi
    omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega
"""
GREEK = frozenset(_LETTERS.split())
_TYPST_GREEK = {"varphi": "phi"}
"""Letters that have another name in typst."""
_AXES = re.compile(r"([A-Za-z])([xyz]{2})(\d*)")
_MOMENT = re.compile(r"(r)([xyz])(\d+)")
_REGROUPED = re.compile(r"([MXYZ][XYZ]|Ia)(\d+)")
_HEAD = re.compile(r"([A-Za-z]*?)(\d*)")
_LETTER = re.compile(r"([A-Za-z])([a-z]?)(\d*)")


class Face(Enum):
    """The way in which letters are set."""

    PLAIN = "plain"
    """Letters of mathematics, each a variable of its own; digits are upright."""
    GREEK = "greek"
    """The name of a Greek letter."""
    UPRIGHT = "upright"
    """A word in upright letters."""
    ITALIC = "italic"
    """A word in italic letters."""


@dataclass(frozen=True)
class Part:
    """A base or a subscript of a symbol: letters in one face, and digits after a Greek letter."""

    text: str
    face: Face = Face.PLAIN
    digits: str = ""

    @property
    def latex(self) -> str:
        """The part in LaTeX."""
        if self.face is Face.UPRIGHT:
            escaped = self.text.replace("_", r"\_")
            return rf"\mathrm{{{escaped}}}"
        if self.face is Face.ITALIC:
            return rf"\mathit{{{self.text}}}"
        if self.face is Face.GREEK:
            return f"\\{self.text} {self.digits}" if self.digits else f"\\{self.text}"
        return self.text

    @property
    def typst(self) -> str:
        """The part in typst."""
        if self.face is Face.UPRIGHT:
            return f'upright("{self.text}")'
        if self.face is Face.ITALIC:
            return f'italic("{self.text}")'
        if self.face is Face.GREEK:
            letter = _TYPST_GREEK.get(self.text, self.text)
            return f"{letter} {self.digits}" if self.digits else letter
        # Letters side by side would be read as one name.
        return " ".join(re.findall(r"[A-Za-z]|[0-9]+", self.text))


@dataclass(frozen=True)
class TypesetName:
    """A name as a symbol with subscripts."""

    base: Part
    subscripts: tuple[Part, ...] = ()

    @property
    def latex(self) -> str:
        """The name in LaTeX."""
        if not self.subscripts:
            return self.base.latex
        return f"{self.base.latex}_{{{','.join(part.latex for part in self.subscripts)}}}"

    @property
    def typst(self) -> str:
        """The name in typst."""
        if not self.subscripts:
            return self.base.typst
        return f"{self.base.typst}_({','.join(part.typst for part in self.subscripts)})"


def latex_names(names: Iterable[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """Return the LaTeX of each name; see :func:`typeset_names`."""
    return {name: typeset.latex for name, typeset in typeset_names(names, taken).items()}


def typeset_names(names: Iterable[str], taken: Iterable[str] = ()) -> dict[str, TypesetName]:
    """Return each name as a symbol with subscripts.

    Parameters
    ----------
    names
        Names of constants.
    taken
        LaTeX that has another meaning: a name that would get the same LaTeX, or that of another name, is spelled letter
        by letter.

    Examples
    --------
    >>> names = typeset_names(["lc1", "theta_2"])
    >>> names["lc1"].latex, names["lc1"].typst, names["theta_2"].typst
    ('l_{c1}', 'l_(c 1)', 'theta_(2)')
    """
    listed = [(name, _typeset(name)) for name in names]
    counts = Counter(typeset.latex for _, typeset in listed)
    used = set(taken)
    written = {}
    for name, typeset in listed:
        is_unique = counts[typeset.latex] == 1 and typeset.latex not in used
        written[name] = typeset if is_unique else TypesetName(_literal(name))
    return written


def _typeset(name: str) -> TypesetName:
    """Return a name as textbooks typeset it."""
    # Ixx2: an entry of an inertia matrix.
    match = _AXES.fullmatch(name)
    if match:
        letter, axes, number = match.groups()
        subscripts = [Part(axes), Part(number)] if number else [Part(axes)]
        return TypesetName(Part(letter), tuple(subscripts))

    # rx2: a first moment.
    match = _MOMENT.fullmatch(name)
    if match:
        letter, axis, number = match.groups()
        return TypesetName(Part(letter), (Part(f"{axis}{number}"),))

    # XX2, Ia2: a base parameter.
    match = _REGROUPED.fullmatch(name)
    if match:
        letters, number = match.groups()
        return TypesetName(Part(letters, Face.ITALIC), (Part(number),))

    # lc1, l_c1, theta_2: letters, a number, and subscripts after underscores.
    head, *subscripts_of_name = name.split("_")
    match = _HEAD.fullmatch(head)
    if match is None or not match[1] or not all(subscripts_of_name):
        return TypesetName(_literal(name))
    letters, number = match.groups()
    base, subscript = _base(letters)
    scripts = [Part(subscript + number)] if subscript + number else []
    scripts += [_word(part) for part in subscripts_of_name]
    return TypesetName(base, tuple(scripts))


def literal(name: str) -> str:
    """Return a name as it is typed, in upright letters of LaTeX."""
    return _literal(name).latex


def _literal(name: str) -> Part:
    """Return a name as it is typed, in upright letters."""
    return Part(name, Face.UPRIGHT)


def _base(letters: str) -> tuple[Part, str]:
    """Split letters into a symbol and its subscript: l and c for lc."""
    if letters in GREEK:
        return Part(letters, Face.GREEK), ""
    if len(letters) == 1:
        return Part(letters), ""
    if _LETTER.fullmatch(letters):
        return Part(letters[0]), letters[1]
    return Part(letters, Face.UPRIGHT), ""


def _word(part: str) -> Part:
    """Return a subscript."""
    match = _HEAD.fullmatch(part)
    if match and match[1] in GREEK:
        return Part(match[1], Face.GREEK, match[2])
    is_plain = len(part) == 1 or part.isdecimal() or _LETTER.fullmatch(part)
    return Part(part) if is_plain else Part(part, Face.UPRIGHT)
