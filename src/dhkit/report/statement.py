"""The statement of a task for one student: what is asked, the arm in pictures and numbers, and how to hand in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dhkit.description import Body, Convention, Description, Placement
from dhkit.grading.answers.sheet import JACOBIAN_ROWS
from dhkit.grading.answers.sheet_values import AnswerSheet, Requirements
from dhkit.grading.judging.truth import DYNAMICS
from dhkit.grading.schema import MEANINGS
from dhkit.report.document import (
    Block,
    Document,
    Figure,
    Heading,
    Image,
    Inline,
    Items,
    Paragraph,
    Table,
    html_blocks,
)
from dhkit.report.sections.kinematics import table_block
from dhkit.report.sections.robot import ready
from dhkit.report.words import joint_values, name_of, with_minus_signs

_FURTHER_MEANINGS = {
    "dh": "Denavit-Hartenberg table of the arm, a row for each joint: theta, d, a, alpha; m and rad.",
    "ik": "Inverse kinematics: each joint value from the pose of the tool, joint by joint.",
}
"""Meanings of answers that are not quantities."""
_MOMENTS = ("xx", "yy", "zz", "xy", "yz", "xz")


def statement(
    description: Description, task: AnswerSheet, student: str, sheet: str, picture: bytes
) -> Document:
    """Return the statement of a task.

    Parameters
    ----------
    description
        The student's arm.
    task
        The instructor's task.
    student
        The student's id, by which answers are matched with the arm.
    sheet
        Name of the answer sheet's file.
    picture
        Content of a PNG file that shows the arm with its DH frames.

    Returns
    -------
    Document
        A document of two or three pages.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.grading.answers.sheet import sheet_of
    >>> task = sheet_of({"answer": {"V": "0"}, "task": {"asked": ["V"]}})
    >>> statement(library_robot("planar2r"), task, "ada", "sheet.toml", b"").title
    'Task: planar2r'
    """
    blocks = [
        Heading("What is asked"),
        *_asked(task),
        Heading("The arm"),
        *_arm(description, task, picture),
        Heading("Names to use"),
        *_names(description, task),
        Heading("How to hand in"),
        *_hand_in(task, student, sheet),
    ]
    return Document(
        f"Task: {name_of(description)}", tuple(blocks), f"Student: {student}", is_wide=False
    )


def task_html(description: Description, task: AnswerSheet) -> str:
    """Return what is asked and the arm as HTML, for the page of a teaching platform.

    A table that is asked for is not shown.

    Parameters
    ----------
    description
        The arm.
    task
        The instructor's task.
    """
    return html_blocks([*_asked(task), *_numbers(description, task)])


def arm_html(description: Description, quantities: Sequence[str]) -> str:
    """Return the arm in numbers as HTML: with bodies where one of these quantities needs them.

    Parameters
    ----------
    description
        The arm.
    quantities
        Names such as ``"T"`` and ``"M"``.
    """
    return html_blocks(
        list(_numbers(description, AnswerSheet(task=Requirements(asked=tuple(quantities)))))
    )


def _asked(task: AnswerSheet) -> Iterator[Block]:
    required = task.task
    if required.asked:
        yield Paragraph("Derive the following quantities of the arm below:")
        yield Items(tuple((f"{name}: {_meaning(name)}",) for name in required.asked))
    else:
        yield Paragraph(
            "Derive quantities of the arm below; the answer sheet lists those that can be handed in."
        )
    conditions = []
    if required.jacobian_rows:
        rows = ", ".join(JACOBIAN_ROWS[row] for row in required.jacobian_rows)
        conditions.append(f"Rows of J, in this order: {rows}.")
    if required.friction:
        conditions.append("tau includes the viscous friction of the joints.")
    if required.total_derivative:
        conditions.append("L is right up to the total time derivative of a function of q.")
    if required.proof_required:
        conditions.append("An answer passes only if it can be proved to be right: give formulas.")
    if required.frames_given:
        conditions.append("A table must have the frames of the table below.")
    if required.zero_given:
        conditions.append("Joint values count from the zero pose of the table below.")
    if required.in_letters:
        conditions.append("Write parameters as letters; answers in numbers do not pass.")
    if task.names.absolute:
        conditions.append("Angles count from a fixed direction, not from the link before.")
    if conditions:
        yield Items(tuple((condition,) for condition in conditions))


def _meaning(quantity: str) -> str:
    if quantity.startswith("A"):
        i = int(quantity[1:])
        return f"Transform from frame {i} to frame {i - 1}, 4 rows of 4: lengths in m."
    return (MEANINGS | _FURTHER_MEANINGS)[quantity]


def _numbers(description: Description, task: AnswerSheet) -> Iterator[Block]:
    """Yield the arm in numbers: table, places of base and tool, parameters and bodies."""
    standard = description.convention is Convention.STANDARD
    order = "Rz(theta) Tz(d) Tx(a) Rx(alpha)" if standard else "Rx(alpha) Tx(a) Rz(theta) Tz(d)"
    yield Paragraph(
        f"The table follows the {'standard (distal)' if standard else 'modified (Craig, proximal)'} convention: "
        f"{order} is the transform of a row."
    )
    if "dh" not in task.task.asked:
        yield table_block(description, "the arm")
        for sentence in (_base(description), _tool(description)):
            if sentence:
                yield Paragraph(sentence)
    if description.parameters:
        rows = [
            (name, value.text if value.symbols else f"{float(value):.15g}")
            for name, value in description.parameters.items()
        ]
        yield Table(
            ("parameter", "value"),
            tuple((name, *with_minus_signs([value])) for name, value in rows),
            "Parameters of your arm, SI units (m, kg, s) and radians",
            "lr",
        )
    bodies = list(_bodies(description))
    if bodies and (not task.task.asked or set(task.task.asked) & set(DYNAMICS)):
        yield Table(
            ("link", "mass", "centre of mass", "inertia"),
            tuple(bodies),
            "Bodies: mass (kg), centre of mass in the frame of the link (m), inertia about the centre of mass, axes of "
            "that frame (kg m²); moments that are not listed are 0",
            "llll",
        )
        rotors = [
            (joint.name, joint.drive.armature.text)
            for joint in description.joints
            if joint.drive is not None and not joint.drive.armature.is_zero
        ]
        if rotors:
            yield Table(
                ("joint", "rotor"),
                tuple(rotors),
                "Drives: inertia of the rotor at the joint, gear² J (kg m², kg of a slide)",
                "lr",
            )
        if description.couplings:
            yield Paragraph("Some rotors turn with two joints: the robot file says which.")
        gravity = ", ".join(entry.text for entry in description.gravity)
        yield Paragraph(f"Free fall in the world frame: ({gravity}) m/s².")


def _arm(description: Description, task: AnswerSheet, picture: bytes) -> Iterator[Block]:
    yield from _numbers(description, task)
    name, q = ready(description)
    yield Figure(
        (Image(picture),),
        f"The arm with its frames (x red, y green, z blue) in the configuration {name}: "
        f"{joint_values(description, q)}",
        0.7,
    )


def _base(description: Description) -> str:
    """Return a sentence on the place of frame 0; empty if it is the world's."""
    T = description.numbers.T_world_base
    if np.array_equal(T, np.eye(4)):
        return ""
    rows = "; ".join(", ".join(f"{x + 0.0:.6g}" for x in row) for row in T[:3])
    return f"Frame 0 lies in the world at the pose with the rows ({rows}), m."


def _tool(description: Description) -> str:
    """Return a sentence on the place of the tool; empty if it is at the origin of the last frame."""
    placement = description.tool.placement
    place = ", ".join(entry.text for entry in placement.xyz)
    angles = ", ".join(entry.text for entry in placement.rpy)
    if placement == Placement():
        return ""
    turned = (
        "" if placement.rpy == Placement().rpy else f", turned by roll, pitch, yaw ({angles}) rad"
    )
    return f"The tool lies at ({place}) m in frame {description.n}{turned}."


def _bodies(description: Description) -> Iterator[tuple[Inline, ...]]:
    """Yield a row for each body."""
    for i, joint in enumerate(description.joints, start=1):
        for body in joint.bodies:
            several = len(joint.bodies) > 1
            label = f"{i}: {body.name}" if several and body.name else str(i)
            com = ", ".join(entry.text for entry in body.com)
            yield label, body.mass.text, f"({com})", _inertia(body)


def _inertia(body: Body) -> str:
    moments = {key: getattr(body.inertia, key) for key in _MOMENTS}
    texts = [f"{key} = {moment.text}" for key, moment in moments.items() if not moment.is_zero]
    return "; ".join(texts) or "0"


def _names(description: Description, task: AnswerSheet) -> Iterator[Block]:
    n = description.n
    names = task.names
    rows: list[tuple[Inline, ...]] = []
    for meaning, own, usual in (
        ("joint values, rad and m", names.q, "q"),
        ("their rates", names.qd, "qd"),
        ("their accelerations", names.qdd, "qdd"),
    ):
        rows.append((meaning, ", ".join(own or (f"{usual}{i}" for i in range(1, n + 1)))))
    rows.append(("parameters", ", ".join(description.parameters) or "none: write numbers"))
    for name, text in names.parameters.items():
        rows.append((f"{name} stands for", str(text)))
    yield Table(("meaning", "names"), tuple(rows))
    yield Paragraph(
        "Usual shorthand is read too: s1 and c12 for sin(q1) and cos(q1 + q2), theta_1 for q1, and the notations of "
        "Python, MATLAB, Mathematica, Maple and LaTeX."
    )


def _hand_in(task: AnswerSheet, student: str, sheet: str) -> Iterator[Block]:
    items = [f"Fill in {sheet}, and hand it in as {student}.toml, or in a folder named {student}."]
    items.append(
        "An entry that stays empty is not handed in; what is asked for and missing is incomplete."
    )
    if not task.task.in_letters:
        items.append(
            "Answers may have the letters of the table of parameters, or the values of your own arm."
        )
    items.append(
        "These numbers are yours alone. The answer is judged by the arm that belongs to your id; a robot file that is "
        "handed in is not used."
    )
    yield Items(tuple((item,) for item in items))
