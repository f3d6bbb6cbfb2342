"""Forward kinematics: frames, table, link transforms, and the pose of the tool."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from dhkit.description import Convention, Description, DHTable, world_to_tool
from dhkit.report.document import (
    Block,
    Figure,
    Formulas,
    Heading,
    Image,
    Inline,
    Paragraph,
    Prompt,
    Table,
)
from dhkit.report.pictures import PAGE_WIDTH, figure_png
from dhkit.report.sections.robot import ready
from dhkit.report.sketch import frame_sketch
from dhkit.report.words import (
    DIGITS,
    LINE_WIDTH,
    Attachments,
    equation,
    joint_values,
    matrix_row,
    name_of,
    with_minus_signs,
)
from dhkit.symbolic import SymbolicKinematics, symbolic_kinematics
from dhkit.symbolic.equations import Quantity, kinematic_quantities, rounded
from dhkit.symbolic.equations.quantities import elements_of
from dhkit.symbolic.equations.typst import Math, Row, angle_rows, quantity_rows
from dhkit.symbolic.ring import Element, RingError, element_array
from dhkit.symbolic.ring.notation import angles_of, generators_of

_MOST_LINES = 48
"""Largest number of lines of T."""
_STANDARD = (
    r"R_{z}(\theta_{i})\, T_{z}(d_{i})\, T_{x}(a_{i})\, R_{x}(\alpha_{i})",
    "R_z (theta_i) thin T_z (d_i) thin T_x (a_i) thin R_x (alpha_i)",
)
_MODIFIED = (
    r"R_{x}(\alpha_{i-1})\, T_{x}(a_{i-1})\, R_{z}(\theta_{i})\, T_{z}(d_{i})",
    "R_x (alpha_(i-1)) thin T_x (a_(i-1)) thin R_z (theta_i) thin T_z (d_i)",
)
_SYMBOLS = {
    "θ": (r"\theta", "theta"),
    "α": (r"\alpha", "alpha"),
    "d": ("d", "d"),
    "a": ("a", "a"),
}
"""Columns of the table in LaTeX and typst."""


def kinematics_section(description: Description, files: Attachments) -> Iterator[Block]:
    """Yield the section on forward kinematics."""
    name, q = ready(description)
    standard = description.convention is Convention.STANDARD
    yield Heading("Forward kinematics")
    yield Heading("Frames and the Denavit-Hartenberg table", 2)
    yield Paragraph(
        f"The frames follow the {'distal (standard)' if standard else 'proximal (modified, Craig)'} convention: "
        f"joint i moves about or along the z axis of frame {'i − 1' if standard else 'i'}."
    )
    sketch = frame_sketch(description, q)
    height = float(sketch.get_size_inches()[1])
    yield Figure(
        (Image(figure_png(sketch, width=PAGE_WIDTH, height=height)),),
        f"Frames and lengths of {name_of(description)} in the configuration {name}: "
        f"{joint_values(description, q)}; lengths along z are d, along x are a, negative ones point against the axis",
        0.92,
    )
    yield table_block(description, name_of(description))

    kinematics = symbolic_kinematics(description)
    yield Heading("Link transforms", 2)
    general = _STANDARD if standard else _MODIFIED
    yield Paragraph("The pose of frame i in frame i − 1 is the product of four elementary motions:")
    yield equation("A_{i}", general[0], "A_i", general[1])
    links = kinematic_quantities(kinematics, "A")
    rows: list[Row] = []
    for quantity in links:
        rows += quantity_rows(rounded(quantity, DIGITS), LINE_WIDTH)
    yield Paragraph(
        "Here ",
        Math("s_{i}", "s_i"),
        " and ",
        Math("c_{i}", "c_i"),
        " are the sine and cosine of the joint value ",
        Math("q_{i}", "q_i"),
        _parameters(links),
        ".",
    )
    for row in rows:
        yield Formulas((row,))

    yield Heading("Pose of the tool", 2)
    yield from _pose(description, kinematics, files)
    T = world_to_tool(description, q)
    yield Paragraph(f"In the configuration {name} the pose of the tool in the world is, in m:")
    yield Formulas(
        (
            matrix_row(
                Math(
                    r"T(q_{\mathrm{ready}})" if name == "ready" else "T(0)",
                    'T (q_"ready")' if name == "ready" else "T (0)",
                ),
                T,
            ),
        )
    )
    yield Prompt(
        "Explain how the vertices of each link are moved with its frame in your simulator, and show that the pictures "
        "of the simulator agree with this pose."
    )


def has_long_numbers(elements: Iterable[Element]) -> bool:
    """Return whether rounding changes a coefficient."""
    before = Quantity("M", element_array(list(elements)))
    pairs = zip(before.elements, rounded(before, DIGITS).elements, strict=True)
    return any(old.terms != new.terms for old, new in pairs)


def _parameters(links: Sequence[Quantity]) -> str:
    """Return the rest of the sentence on the entries of the link transforms."""
    is_rounded = has_long_numbers(elements_of(links))
    return (
        f"; lengths are in m{f', and numbers are rounded to {DIGITS} digits' if is_rounded else ''}"
    )


def table_block(description: Description, subject: str) -> Table:
    """Return the DH table of a subject, such as a robot's name."""
    table = DHTable.of(description)
    modified = description.convention is Convention.MODIFIED
    headings: list[Inline] = []
    for heading in table.headings:
        letter, _, unit = heading.partition(" ")
        symbol = letter[0]
        index = "i-1" if modified and symbol in "aα" else "i"
        if heading == "joint":
            headings.append(heading)
            continue
        latex, typst = _SYMBOLS[symbol]
        latex_unit = rf"\ \text{{{unit}}}" if unit else ""
        typst_unit = f' thin "{unit}"' if unit else ""
        headings.append(Math(f"{latex}_{{{index}}}{latex_unit}", f"{typst}_({index}){typst_unit}"))
    return Table(
        tuple(headings),
        tuple((row[0], *with_minus_signs(row[1:])) for row in table.rows),
        f"Denavit-Hartenberg table of {subject}, {table.convention.value} convention",
        "lrrrr",
    )


def _pose(
    description: Description, kinematics: SymbolicKinematics, files: Attachments
) -> Iterator[Block]:
    """Yield the product of the transforms and its entries, if they fit."""
    yield Paragraph("With the transforms of base and tool, the pose of the tool in the world is")
    yield equation(
        "T",
        r"T_{\mathrm{base}}\, A_{1} A_{2} \cdots A_{n}\, T_{\mathrm{tool}}",
        "T",
        'T_"base" thin A_1 A_2 dots.c A_n thin T_"tool"',
    )
    try:
        name = files.add("kinematics.py", kinematics.code(("T", "J"), "python"))
        quantity = rounded(kinematic_quantities(kinematics, "T")[0], DIGITS)
    except RingError as error:
        yield Paragraph(f"Its entries are too long to be derived in symbols: {error}.")
        return
    rows = quantity_rows(quantity, LINE_WIDTH)
    if len(rows) > _MOST_LINES:
        yield Paragraph(
            f"Its entries take {len(rows)} lines; the file {name} beside this report has them as a program."
        )
        return
    yield Formulas(tuple(rows))
    angles = [a for a in angles_of(generators_of(elements_of([quantity]))) if len(a.joints) > 1]
    if angles:
        yield Paragraph("where")
        yield Formulas(tuple(angle_rows(angles)))
    yield Paragraph(
        "The last column is the position of the tool; the block before it is its rotation."
    )
