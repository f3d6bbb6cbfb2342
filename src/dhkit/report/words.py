"""Small parts of which sections are made: numbers, matrices of numbers, words with symbols, and a report's files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from dhkit.description import Array, Description
from dhkit.display import plain
from dhkit.report.document import Formulas, Inline
from dhkit.symbolic.equations.sentences import sentence_parts
from dhkit.symbolic.equations.typst import Math, Row

PROGRAMS = "programs"
"""Folder of the programs beside a report."""
LINE_WIDTH = 34.0
"""Width of a line of equations, em; a page has 38."""
DIGITS = 4
"""Significant digits of rounded coefficients."""
_LONGEST_NAME = 80
"""Longest name of a robot that is shown, characters."""
_LONGEST_SOURCE = 400
"""Longest text of a robot's source that is shown, characters."""


@dataclass
class Attachments:
    """Files beside a report, by name: programs and equations that are too long for it."""

    texts: dict[str, str] = field(default_factory=dict)

    def add(self, name: str, text: str) -> str:
        """Keep a file and return its place beside the report."""
        self.texts[name] = text
        return f"{PROGRAMS}/{name}"


def name_of(description: Description) -> str:
    """Return a robot's name in one printable line."""
    return plain(description.name, _LONGEST_NAME)


def source_of(description: Description) -> str:
    """Return the source of a robot's data in one printable line, without a full stop at its end."""
    return plain(description.source or "", _LONGEST_SOURCE).rstrip(". ")


def number(value: float, digits: int = 4) -> str:
    """Return a number with significant digits; 0 for one that rounding alone makes different from 0.

    Examples
    --------
    >>> number(0.43180001), number(-1e-17), number(-0.5)
    ('0.4318', '0', '−0.5')
    """
    if abs(value) < 1e-12:
        return "0"
    return f"{value:.{digits}g}".replace("-", "−").replace("e+0", "e").replace("e−0", "e−")


def with_minus_signs(cells: Iterable[str]) -> Iterator[str]:
    """Yield numbers as text with minus signs instead of hyphens."""
    for cell in cells:
        yield cell.replace("-", "−")


def number_math(value: float, digits: int = 4) -> Math:
    """Return a number as a formula: 1.2e-5 is 1.2 times 10 to the power of -5."""
    text = number(value, digits).replace("−", "-")
    mantissa, _, exponent = text.partition("e")
    if not exponent:
        return Math(mantissa, mantissa)
    return Math(
        rf"{mantissa} \times 10^{{{int(exponent)}}}", f"{mantissa} times 10^({int(exponent)})"
    )


def matrix_row(head: Math, array: Array, digits: int = 4) -> Row:
    """Return the equation of a matrix (m, n) or a column (m,) of numbers."""
    table = np.asarray(array, dtype=float)
    table = table.reshape(len(table), -1)
    largest = float(np.abs(table).max(initial=0.0))
    clean = np.where(np.abs(table) < 1e-12 * max(largest, 1e-300), 0.0, table)
    latex_rows = []
    typst_rows = []
    for row in clean:
        cells = [number_math(value, digits) for value in row]
        latex_rows.append(" & ".join(cell.latex for cell in cells))
        typst_rows.append(", ".join(cell.typst for cell in cells))
    latex = " \\\\\n".join(latex_rows)
    typst = "; ".join(typst_rows)
    return Row(
        head,
        Math(f"\\begin{{pmatrix}}\n{latex}\n\\end{{pmatrix}}", f'mat(delim: "(", {typst})'),
    )


def equation(latex_left: str, latex_right: str, typst_left: str, typst_right: str) -> Formulas:
    """Return one displayed equation."""
    return Formulas((Row(Math(latex_left, typst_left), Math(latex_right, typst_right)),))


def words(text: str) -> tuple[Inline, ...]:
    r"""Return plain words with the symbols in them as formulas: theta2, q_i, phi.

    Examples
    --------
    >>> words("turn theta2 first")[1].latex
    '\\theta_{2}'
    """
    return tuple(sentence_parts(text))


def heading_words(text: str) -> str:
    """Return words for a heading, with the names of angles as letters.

    Examples
    --------
    >>> heading_words("theta12")
    'θ₁₂'
    """
    subscripts = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
    text = re.sub(r"\btheta(\d+)\b", lambda match: f"θ{match[1].translate(subscripts)}", text)
    return re.sub(r"\bphi\b", "φ", text)


def joint_values(description: Description, q: Array) -> str:
    """Return joint values as text: degrees, and m for prismatic joints."""
    shown = []
    for value, slides in zip(q, description.numbers.prismatic, strict=True):
        shown.append(f"{number(value)} m" if slides else f"{number(float(np.degrees(value)))}°")
    return f"({', '.join(shown)})"
