"""An arm's equations of motion as one page of HTML with MathML: no script, nothing from the network."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from html import escape
from itertools import chain
from typing import TYPE_CHECKING, Any

from dhkit.description import DHTable
from dhkit.symbolic.equations import (
    QUANTITIES,
    Quantity,
    constant_latex,
    constants_of,
    displays,
    equation_mathml,
    generators_of,
    html_page,
    renamings,
    symbols_of,
)

if TYPE_CHECKING:
    from dhkit.symbolic.exact.lagrangian import Lagrangian
    from dhkit.symbolic.kinematics import SymbolicKinematics

UNITS = {
    "m": "kg",
    "r": "kg m",
    "I": "kg m²",
    "Jm": "kg m²",
    "G": "",
    "a": "m",
    "d": "m",
    "g": "m/s²",
} | {
    "M": "kg",
    "MX": "kg m",
    "MY": "kg m",
    "MZ": "kg m",
    "Ia": "kg m²",
    "XX": "kg m²",
    "XY": "kg m²",
    "XZ": "kg m²",
    "YY": "kg m²",
    "YZ": "kg m²",
    "ZZ": "kg m²",
}
"""Units of the symbols that we name ourselves, by their first letters."""
KINEMATIC_EQUATION = r"T = T_{\mathrm{base}}\, A_{1} A_{2} \cdots A_{n}\, T_{\mathrm{tool}}"
EQUATION_OF_MOTION = r"M(q)\,\ddot{q} + C(q,\dot{q})\,\dot{q} + g(q) = \tau"


def equations_page(
    lag: Lagrangian | SymbolicKinematics,
    quantities: Sequence[Quantity],
    notes: Sequence[str] | None = None,
) -> str:
    """Return a page with the robot's table, quantities, values of constants, and notes (the source's by default)."""
    notes = lag.notes if notes is None else notes
    description = lag.description
    is_dynamics = any(quantity.name in QUANTITIES for quantity in quantities)
    subject = "equations of motion" if is_dynamics else "kinematics"
    body = [
        f"<h1>{escape(description.name)}: {subject}</h1>",
        f'<p class="source">{escape(description.source)}</p>' if description.source else "",
        f'<div class="display">{equation_mathml(EQUATION_OF_MOTION if is_dynamics else KINEMATIC_EQUATION)}</div>',
        "<h2>Denavit-Hartenberg table</h2>",
        DHTable.of(description)._repr_html_(),
        *_sections(quantities),
        *_constants(lag, quantities),
        *(
            f'<p class="note">{escape(note)}</p>'
            for note in [*notes, *renamings(_elements(quantities))]
        ),
    ]
    return html_page(f"{description.name}: {subject}", "\n".join(part for part in body if part))


def _sections(quantities: Sequence[Quantity]) -> Iterator[str]:
    shown = displays(quantities)
    for quantity, latex in zip(quantities, shown, strict=False):
        yield f"<h2>{escape(quantity.title.capitalize())}</h2>"
        yield f'<div class="display">{equation_mathml(latex)}</div>'
    for latex in shown[len(quantities) :]:
        yield f'<h2>Sines and cosines</h2>\n<div class="display">{equation_mathml(latex)}</div>'


def _constants(
    lag: Lagrangian | SymbolicKinematics, quantities: Sequence[Quantity]
) -> Iterator[str]:
    """Yield a table of the constants in the quantities, with their values."""
    elements = _elements(quantities)
    values = dict(lag.description.numbers.values) | lag.arm.parameters
    order = {name: k for k, name in enumerate([*lag.description.parameters, *lag.arm.parameters])}
    rings = {}
    for element in elements:
        constants = constants_of(generators_of([element]))
        for name in symbols_of(constants):
            rings[name] = element.ring
    names = sorted(rings, key=lambda name: (order.get(name, len(order)), name))
    if not names:
        return
    yield "<h2>Constants</h2>\n<table>\n<tr><th></th><th>name</th><th>value</th><th>unit</th></tr>"
    for name in names:
        value = float(values.get(name, math.nan))
        cells = (
            f"<td>{equation_mathml(constant_latex(rings[name], name))}</td><td>{escape(name)}</td>"
        )
        yield f'<tr>{cells}<td class="number">{value:.6g}</td><td>{_unit(lag, name)}</td></tr>'
    yield "</table>"


def _unit(lag: Lagrangian | SymbolicKinematics, name: str) -> str:
    """Return the unit of a symbol that we name; the robot file's own parameters are in SI units."""
    letters = re.match(r"Jm|Ia|M[XYZ]|[XYZ]{2}|[A-Za-z]", name)
    if lag.arm.symbols != "inertial" or name in lag.description.parameters or not letters:
        return "SI"
    return UNITS.get(letters[0], "SI")


def _elements(quantities: Sequence[Quantity]) -> list[Any]:
    return list(chain.from_iterable(quantity.elements.flat for quantity in quantities))
