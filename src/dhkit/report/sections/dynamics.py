"""Dynamics: Lagrange's derivation, M, C and g in a form that can be read, and their values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dhkit.description import Description
from dhkit.dynamics import coriolis_matrix, gravity_torque, mass_matrix
from dhkit.errors import DhkitError
from dhkit.grading.explanation import explanation_text
from dhkit.report.document import (
    Block,
    Formulas,
    Heading,
    Inline,
    Paragraph,
    Prompt,
    Table,
)
from dhkit.report.sections.kinematics import has_long_numbers
from dhkit.report.sections.robot import ready
from dhkit.report.words import (
    DIGITS,
    LINE_WIDTH,
    Attachments,
    equation,
    joint_values,
    matrix_row,
    number,
)
from dhkit.symbolic import Lagrangian, base_parameters, lagrangian
from dhkit.symbolic.equations import Quantity, constants_of, equations_python, quantities, rounded
from dhkit.symbolic.equations.quantities import elements_of
from dhkit.symbolic.equations.typst import (
    Math,
    Row,
    angle_rows,
    constant_math,
    equation_rows,
    quantity_rows,
)
from dhkit.symbolic.exact.compact import shortened
from dhkit.symbolic.ring import Element, Elements, Ring, RingError, element_array
from dhkit.symbolic.ring.notation import angles_of, generators_of, symbols_of
from dhkit.symbolic.textbook import BodyMotion, derive

_MOST_LINES = 74
"""Largest number of lines of M, C and g together: three pages."""
_DERIVATION_LINES = 60
"""Largest number of lines of the derivation's results."""
_MOST_TERMS = 12_000
"""Largest number of terms of M that are written into lines, to see whether they fit."""
_WORKED_TERMS = 2_000
"""Largest number of terms of M of which the whole derivation is written into a file."""
_DEFINITION_LINES = 16
"""Largest number of lines of the base parameters' definitions."""
_MOST_CONSTANTS = 30
"""Largest number of rows of the table of constants."""
_RATE = 0.5
"""Joint rate of the example of C, rad/s and m/s."""


def dynamics_section(
    description: Description, files: Attachments, title: str = "Dynamics"
) -> Iterator[Block]:
    """Yield the section on dynamics.

    Parameters
    ----------
    description
        The robot.
    files
        Files beside the report.
    title
        Heading of the section; files of a second robot are named by its first word.
    """
    yield Heading(title)
    bare = [i for i, joint in enumerate(description.joints, start=1) if not joint.bodies]
    if bare:
        links = ", ".join(map(str, bare))
        yield Paragraph(
            f"Link{'s' if len(bare) > 1 else ''} {links} of this robot {'have' if len(bare) > 1 else 'has'} no body in "
            "its file (mass, centre of mass, inertia), so that there are no equations of motion. State masses, or take "
            "uniform links (arm.with_uniform_links, or dhkit import-cad with --density)."
        )
        yield Prompt(
            "State how you would obtain masses and inertias, or which simplified model you take instead."
        )
        return
    prefix = "" if title == "Dynamics" else "model_"
    yield Heading("Lagrange's derivation", 2)
    yield from _method()
    try:
        lag = lagrangian(description)
        full = equations_python(lag, quantities(lag, "M,C,g"))
    except RingError as error:
        yield from _sums()
        yield Paragraph(f"M, C and g of this robot are too long to be derived in symbols: {error}.")
    else:
        program = files.add(f"{prefix}equations.py", full)
        yield from _results(description, lag, files, prefix)
        yield from _sums()
        yield from _proofs(lag)
        yield from _equations(description, lag, program)
    yield from _values(description)


def _method() -> Iterator[Block]:
    """Yield the formulas of Lagrange's derivation."""
    yield Paragraph(
        "With the kinetic energy K and the potential energy V of all links, the joint torques follow from"
    )
    yield equation(
        r"\tau_{i}",
        r"\frac{d}{dt} \frac{\partial L}{\partial \dot{q}_{i}} - \frac{\partial L}{\partial q_{i}},"
        r" \qquad L = K - V",
        "tau_i",
        "frac(d, d t) frac(partial L, partial dot(q)_i) - frac(partial L, partial q_i), quad quad L = K - V",
    )
    yield Paragraph(
        "For each link i with mass ",
        Math("m_{i}", "m_i"),
        ", centre of mass ",
        Math("c_{i}", "c_i"),
        " in its own frame and inertia ",
        Math("I_{i}", "I_i"),
        " about it:",
    )
    yield Formulas(
        (
            Row(Math("p_{i}", "p_i"), Math("o_{i} + R_{i}\\, c_{i}", "o_i + R_i thin c_i")),
            Row(
                Math("v_{i}", "v_i"),
                Math(
                    r"R_{i}^{T}\, \dot{p}_{i}, \qquad \omega_{i} = R_{i}^{T} \textstyle\sum_{j} z_{j}\, \dot{q}_{j}",
                    "R_i^T thin dot(p)_i, quad quad omega_i = R_i^T sum_j z_j thin dot(q)_j",
                ),
            ),
            Row(
                Math("K_{i}", "K_i"),
                Math(
                    r"\tfrac{1}{2} m_{i} v_{i}^{T} v_{i} + \tfrac{1}{2} \omega_{i}^{T} I_{i}\, \omega_{i}, \qquad "
                    r"V_{i} = -m_{i}\, g_{0}^{T} p_{i}",
                    "inline(frac(1, 2)) m_i v_i^T v_i + inline(frac(1, 2)) omega_i^T I_i omega_i, quad quad "
                    "V_i = - m_i thin g_0^T p_i",
                ),
            ),
        )
    )
    yield Paragraph(
        "Velocities are in the link's own axes, and ",
        Math("g_{0}", "g_0"),
        " is the acceleration of free fall. The sum in ",
        Math(r"\omega_{i}", "omega_i"),
        " runs over the revolute joints up to joint i. Rotors of drives add ",
        Math(r"\tfrac{1}{2} G^{2} J \dot{q}^{2}", "inline(frac(1, 2)) G^2 J dot(q)^2"),
        " each.",
    )


def _results(
    description: Description, lag: Lagrangian, files: Attachments, prefix: str
) -> Iterator[Block]:
    """Yield positions, velocities and energies of as many links as fit."""
    if has_long_numbers([*lag.M.flat, lag.V]):
        yield Paragraph(f"Numbers are in SI units, rounded to {DIGITS} digits.")
    textbook = derive(description)
    left = _DERIVATION_LINES
    omitted = 0
    for i, link in enumerate(textbook.links, start=1):
        for k, body in enumerate(link.bodies, start=1):
            several = len(link.bodies) > 1
            name = f"Link {i}, body {k}" if several else f"Link {i}"
            subscript = f"{i}{k}" if several else f"{i}"
            rows = [] if omitted or _terms(body) > 40 * left else list(_body(lag, subscript, body))
            if not rows or len(rows) > left:
                omitted = omitted or i
                continue
            left -= len(rows)
            yield Paragraph(f"{name}:")
            yield Formulas(tuple(rows))
    if omitted:
        where = ""
        if _size(lag) <= _WORKED_TERMS:
            file = files.add(f"{prefix}derivation.txt", explanation_text(description))
            where = f" The file {file} beside this report has all steps."
        yield Paragraph(
            f"From link {omitted} on these expressions are too long to be read on paper.{where}"
        )


def _size(lag: Lagrangian) -> int:
    """Return the number of terms of M."""
    return sum(len(element) for element in lag.M.flat)


def _sums() -> Iterator[Block]:
    """Yield how M, C and g follow from the energies."""
    yield Paragraph("The sums K and V of all links give the equation of motion")
    yield equation(
        r"M(q)\, \ddot{q} + C(q, \dot{q})\, \dot{q} + g(q)",
        r"\tau",
        "M (q) thin dot.double(q) + C (q, dot(q)) thin dot(q) + g (q)",
        "tau",
    )
    yield Formulas(
        (
            Row(
                Math("M_{ij}", "M_(i j)"),
                Math(
                    r"\frac{\partial^{2} K}{\partial \dot{q}_{i}\, \partial \dot{q}_{j}}, \qquad "
                    r"g_{i} = \frac{\partial V}{\partial q_{i}}",
                    "frac(partial^2 K, partial dot(q)_i thin partial dot(q)_j), quad quad "
                    "g_i = frac(partial V, partial q_i)",
                ),
            ),
            Row(
                Math("C_{ij}", "C_(i j)"),
                Math(
                    r"\sum_{k} \tfrac{1}{2} \left( \frac{\partial M_{ij}}{\partial q_{k}} + "
                    r"\frac{\partial M_{ik}}{\partial q_{j}} - \frac{\partial M_{jk}}{\partial q_{i}} \right) "
                    r"\dot{q}_{k}",
                    "sum_k inline(frac(1, 2)) (frac(partial M_(i j), partial q_k) + "
                    "frac(partial M_(i k), partial q_j) - frac(partial M_(j k), partial q_i)) dot(q)_k",
                ),
            ),
        )
    )


def _proofs(lag: Lagrangian) -> Iterator[Block]:
    """Yield what is proved of the equations, unless they are long."""
    if _size(lag) > _WORKED_TERMS:
        return
    verdict = "proved in exact arithmetic" if lag.prove_euler_lagrange() else "NOT TRUE"
    yield Paragraph(
        "dhkit derives M, C and g by composite bodies, and independently by the steps above. That both are equal "
        f"is {verdict}; that dM/dt − 2 C is skew-symmetric is "
        f"{'proved too' if lag.prove_skew_symmetry() else 'NOT TRUE'}."
    )


def _terms(body: BodyMotion) -> int:
    """Return the number of terms of a body's motion and energies."""
    elements = [*body.com, *body.velocity, *body.omega, body.K, body.V]
    return sum(len(element) for element in elements)


def _body(lag: Lagrangian, subscript: str, body: BodyMotion) -> Iterator[Row]:
    """Yield position, velocities and energies of a body, entry by entry; entries that are zero are left out."""
    for letter, typst, array in (
        ("p", "p", body.com),
        ("v", "v", body.velocity),
        (r"\omega", "omega", body.omega),
        ("K", "K", element_array(body.K)),
        ("V", "V", element_array(body.V)),
    ):
        for place, element in np.ndenumerate(_readable(lag, element_array(array))):
            axis = f",{'xyz'[place[0]]}" if place else ""
            head = Math(f"{letter}_{{{subscript}{axis}}}", f"{typst}_({subscript}{axis})")
            if element:
                yield from equation_rows(head, element, LINE_WIDTH)


def _readable(lag: Lagrangian, elements: Elements) -> Elements:
    """Return elements in the angles that make them shortest, with rounded coefficients."""
    return rounded(Quantity("M", shortened(lag.arm, elements)), DIGITS).elements


@dataclass(frozen=True, eq=False)
class _Form:
    """M, C and g in one form, as far as they fit.

    Attributes
    ----------
    words
        The form in words.
    lag
        The equations.
    shown
        Quantities that fit, with their lines.
    """

    words: str
    lag: Lagrangian
    shown: tuple[tuple[Quantity, tuple[Row, ...]], ...]

    @property
    def names(self) -> list[str]:
        """The names of the quantities that fit."""
        return [quantity.name for quantity, _ in self.shown]


def _equations(description: Description, lag: Lagrangian, program: str) -> Iterator[Block]:
    """Yield M, C and g in the form of which most fits into three pages."""
    yield Heading("Equations of motion", 2)
    forms = []
    if lag.arm.parameters:
        forms.append(_form("in the parameters of the robot's file", lag))
    complete = any(len(form.shown) == 3 for form in forms)
    if not complete:
        try:
            base = base_parameters(description)
            forms.append(
                _form(
                    f"in the {len(base)} base parameters, the fewest combinations of inertial parameters that the "
                    "torques depend on (Gautier and Khalil 1990)",
                    base.lagrangian,
                )
            )
        except DhkitError:
            pass
        numbers = lagrangian(description, "none") if lag.arm.parameters else lag
        forms.append(_form("in numbers", numbers))
    best = max(forms, key=lambda form: len(form.shown))
    missing = [name for name in ("M", "C", "g") if name not in best.names]
    if best.shown:
        what = _listed(best.names)
        exact: list[Element] = []
        for name in best.names:
            exact += getattr(best.lag, name).flat
        digits = f", rounded to {DIGITS} digits" if has_long_numbers(exact) else ""
        yield Paragraph(f"{what} {best.words}{digits}, in SI units:")
    for _, rows in best.shown:
        yield Formulas(rows)
    elements = elements_of([quantity for quantity, _ in best.shown])
    angles = [a for a in angles_of(generators_of(elements)) if len(a.joints) > 1]
    if angles:
        yield Paragraph("where")
        yield Formulas(tuple(angle_rows(angles)))
    table = _constants(best.lag, elements)
    if table is not None:
        yield table
    yield from _definitions(best)
    if missing:
        lines = "would take more than three pages"
        yield Paragraph(
            f"{_listed(missing)} {'is' if len(missing) == 1 else 'are'} not printed: the equations {lines}. The file "
            f"{program} beside this report has M, C and g in full, as functions of the joint values and rates."
        )
    else:
        yield Paragraph(f"The file {program} beside this report has the same as a program.")


def _definitions(form: _Form) -> Iterator[Block]:
    """Yield what base parameters stand for, if it is short enough."""
    definitions = form.lag.definitions
    rows: list[Row] = []
    for name, element in definitions.items():
        if len(element) > 20 or len(rows) > _DEFINITION_LINES:
            return
        left = constant_math(form.lag.arm.ring, name)
        rows += equation_rows(left, element, LINE_WIDTH)
    if 0 < len(rows) <= _DEFINITION_LINES:
        yield Paragraph(
            "In the inertial parameters of the links (mass m, first moments r, second moments I about the origin of "
            "the link's frame, rotor inertia J and gear ratio G of its drive) the base parameters are"
        )
        yield Formulas(tuple(rows))


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _form(words: str, lag: Lagrangian) -> _Form:
    """Return a form of the equations: g, M and C, each if it still fits."""
    left = _MOST_LINES
    shown: dict[str, tuple[Quantity, tuple[Row, ...]]] = {}
    for name in ("g", "M", "C"):
        terms = sum(len(element) for element in getattr(lag, name).flat)
        if terms > _MOST_TERMS:
            continue
        quantity = rounded(quantities(lag, name)[0], DIGITS)
        rows = tuple(quantity_rows(quantity, LINE_WIDTH))
        # A matrix is one row here, and a line for each of its rows on the page.
        lines = len(quantity.elements) if len(rows) == 1 else len(rows)
        if lines <= left:
            left -= lines
            shown[name] = (quantity, rows)
    ordered = tuple(shown[name] for name in ("M", "C", "g") if name in shown)
    return _Form(words, lag, ordered)


def _constants(lag: Lagrangian, elements: Sequence[Element]) -> Table | None:
    """Return a table of the symbols in elements with their values; of base parameters also with their meaning."""
    values = dict(lag.description.numbers.values) | lag.arm.parameters
    rings: dict[str, Ring] = {}
    for element in elements:
        for name in sorted(symbols_of(constants_of(generators_of([element])))):
            rings[name] = element.ring  # type: ignore[assignment]
    order = {name: k for k, name in enumerate([*lag.description.parameters, *lag.arm.parameters])}
    names = sorted(rings, key=lambda name: (order.get(name, len(order)), name))
    if not names:
        return None
    rows = [
        (constant_math(rings[name], name), number(values.get(name, np.nan), 6))
        for name in names[:_MOST_CONSTANTS]
    ]
    # Three symbols side by side.
    columns = 3 if len(rows) > 4 else 1
    lines = []
    height = -(-len(rows) // columns)
    for k in range(height):
        cells: list[Inline] = []
        for column in range(columns):
            place = column * height + k
            cells += [*rows[place]] if place < len(rows) else ["", ""]
        lines.append(tuple(cells))
    more = (
        ""
        if len(names) <= _MOST_CONSTANTS
        else f"; {len(names) - _MOST_CONSTANTS} more are in the program"
    )
    return Table(
        ("symbol", "value [SI]") * columns,
        tuple(lines),
        f"Values of the symbols{more}",
        "lr" * columns,
    )


def _values(description: Description) -> Iterator[Block]:
    """Yield the values of M, C and g in the first configuration."""
    name, q = ready(description)
    qd = np.full(description.n, _RATE)
    yield Heading("Values", 2)
    unit = "rad/s" if not description.numbers.prismatic.any() else "rad/s and m/s"
    yield Paragraph(
        f"In the configuration {name}, {joint_values(description, q)}, in SI units; C with all joint rates "
        f"{_RATE} {unit}:"
    )
    for head, array in (
        (Math("M(q)", "M (q)"), mass_matrix(description, q)),
        (Math(r"C(q, \dot{q})", "C (q, dot(q))"), coriolis_matrix(description, q, qd)),
        (Math("g(q)", "g (q)"), gravity_torque(description, q)),
    ):
        yield Formulas((matrix_row(head, array),))
