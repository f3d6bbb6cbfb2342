"""The Jacobian, singular configurations and the workspace."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dhkit.description import Description
from dhkit.errors import DhkitError
from dhkit.kinematics import jacobian, singularities, workspace
from dhkit.kinematics.manipulability import manipulability, singular_values
from dhkit.report.document import (
    Block,
    Formulas,
    Heading,
    Items,
    Paragraph,
    Prompt,
    Table,
)
from dhkit.report.pictures import figure_block
from dhkit.report.sections.robot import ready
from dhkit.report.words import DIGITS, LINE_WIDTH, PROGRAMS, matrix_row, number
from dhkit.symbolic import symbolic_kinematics
from dhkit.symbolic.equations import kinematic_quantities, rounded
from dhkit.symbolic.equations.quantities import elements_of
from dhkit.symbolic.equations.typst import Math, angle_rows, quantity_rows
from dhkit.symbolic.ring import RingError
from dhkit.symbolic.ring.notation import angles_of, generators_of

_MOST_LINES = 44
"""Largest number of lines of the Jacobian."""
_SAMPLES = 100_000
"""Number of random states of the workspace."""


def velocities_section(description: Description) -> Iterator[Block]:
    """Yield the section on the Jacobian, singularities and the workspace."""
    name, q = ready(description)
    yield Heading("Jacobian, singularities and workspace")
    yield Heading("Jacobian", 2)
    yield Paragraph(
        "The Jacobian maps joint rates to the velocity of the tool's origin (first three rows) and to the angular "
        "velocity (last three rows), both in the world's axes. Its column of a revolute joint on the axis ",
        Math("z", "z"),
        " through the point ",
        Math("o", "o"),
        " is ",
        Math(r"(z \times (p - o),\, z)", "(z times (p - o), z)"),
        ", that of a prismatic joint ",
        Math("(z,\\, 0)", "(z, 0)"),
        ", where ",
        Math("p", "p"),
        " is the tool's origin.",
    )
    yield from _entries(description)
    yield Paragraph(f"In the configuration {name} it is, in m and rad,")
    head = Math("J", "J")
    yield Formulas((matrix_row(head, jacobian(description, q)),))
    values = singular_values(description, q)
    sizes = ", ".join(number(float(value)) for value in np.ravel(values))
    yield Paragraph(
        f"The singular values of its first three rows there are {sizes}; the manipulability of the tool's position, "
        f"their product, is {number(float(manipulability(description, q)))}."
    )
    yield from _singularities(description)
    yield from _workspace(description)


def _entries(description: Description) -> Iterator[Block]:
    """Yield the entries of the Jacobian, if they fit."""
    kinematics = symbolic_kinematics(description)
    try:
        quantity = rounded(kinematic_quantities(kinematics, "J")[0], DIGITS)
    except RingError as error:
        yield Paragraph(f"Its entries are too long to be derived in symbols: {error}.")
        return
    rows = quantity_rows(quantity, LINE_WIDTH)
    if len(rows) > _MOST_LINES:
        yield Paragraph(
            f"Its entries take {len(rows)} lines; the file {PROGRAMS}/kinematics.py beside this report has them as a "
            "program."
        )
        return
    yield Formulas(tuple(rows))
    angles = [a for a in angles_of(generators_of(elements_of([quantity]))) if len(a.joints) > 1]
    if angles:
        yield Paragraph("where")
        yield Formulas(tuple(angle_rows(angles)))


def _singularities(description: Description) -> Iterator[Block]:
    yield Heading("Singular configurations", 2)
    try:
        found = singularities(description)
    except DhkitError as error:
        yield Paragraph(f"{error}.")
        return
    product = ", ".join(found.kinds)
    square = (
        "its determinant"
        if len(found.task) == 6
        else "its determinant for the twists that the arm controls"
    )
    factors = (
        f"one factor for each kind ({product})"
        if len(found.kinds) > 1
        else f"one factor ({product})"
    )
    yield Paragraph(
        f"The Jacobian loses rank where {square} is zero; it has {factors}. Limits aside, this is so where:"
    )
    yield Items(tuple((f"{kind}: {words}",) for kind, words in found.words.items()))


def _workspace(description: Description) -> Iterator[Block]:
    from dhkit.viewer import plot

    yield Heading("Workspace", 2)
    space = workspace(description, _SAMPLES)
    for note in space.assumed:
        yield Paragraph(f"Assumed: {note}.")
    rows = [
        ("distance from frame 0 [m]", *map(number, space.distances)),
        ("distance from axis 1 [m]", *map(number, space.radii)),
    ]
    for axis, low, high in zip("xyz", *space.bounds, strict=True):
        rows.append((f"{axis} [m]", number(low), number(high)))
    yield Table(
        ("tool", "least", "most"),
        tuple(rows),
        f"Positions that {space.samples} random states inside the limits reach",
        "lrr",
    )
    estimate = (
        ""
        if space.estimate is None
        else f"; size of the set that is reached: about {space.estimate}"
    )
    yield figure_block(
        plot(space),
        f"Workspace by {space.samples} random states, coloured by the best translational manipulability{estimate}",
    )
    yield Prompt("Discuss the limits of the workspace, and where the robot should work in it.")
