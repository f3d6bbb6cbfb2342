"""Inverse kinematics, worked out step by step, and all branches of one pose."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dhkit.description import Array, Description, world_to_tool
from dhkit.errors import DescriptionError
from dhkit.kinematics import IKFlag, IKSolutions, inverse_kinematics, solve_numerically
from dhkit.kinematics.closed_form import classify
from dhkit.report.document import Block, Formulas, Heading, Paragraph, Prompt, Table
from dhkit.report.sections.robot import moved, ready
from dhkit.report.words import (
    LINE_WIDTH,
    Attachments,
    heading_words,
    joint_values,
    matrix_row,
    number,
    words,
)
from dhkit.symbolic import InverseDerivation, inverse_derivation
from dhkit.symbolic.equations.inverse_figures import sample_pose
from dhkit.symbolic.equations.inverse_text import (
    branches_sentence,
    introduction,
    rule_in_dollars,
)
from dhkit.symbolic.equations.inverse_writing import LATEX, TYPST, Phrases, Solution, solved_before
from dhkit.symbolic.equations.latex import SYMBOLS_PER_EM
from dhkit.symbolic.equations.typst import Math, Row, broken
from dhkit.symbolic.inverse.steps import DerivationStep
from dhkit.symbolic.ring import Element

_REDUNDANT = 7
"""Number of joints of arms with infinitely many solutions, of which those at one redundancy are printed."""
_STARTS = 24
"""Number of starts of the iteration for an arm without a closed form."""
_MOST_SOLUTIONS = 8
"""Largest number of solutions of the iteration that are printed."""
_SAME = 0.05
"""Largest difference of joint values, rad or m, of solutions that count as one."""
_FLAGS = {
    IKFlag.shoulder: "shoulder singular",
    IKFlag.elbow: "elbow stretched or folded",
    IKFlag.wrist: "wrist singular",
    IKFlag.singular: "singular",
    IKFlag.out_of_limits: "outside the limits",
}


def inverse_section(description: Description, files: Attachments) -> Iterator[Block]:
    """Yield the section on inverse kinematics."""
    yield Heading("Inverse kinematics")
    axes = classify(description)
    yield Paragraph(f"Geometry of the axes: {axes.words}.")
    try:
        derivation = inverse_derivation(description)
    except DescriptionError as error:
        yield Paragraph(f"This arm has no derivation in closed form: {error}.")
        all_revolute = set(description.kinds) == {"R"}
        if all_revolute and description.n in (6, 7):
            yield from _all_solutions(description)
        else:
            yield from _iteration(description)
        yield _prompt()
        return
    is_named = axes.fit is not None and axes.fit.geometry == derivation.geometry
    yield from _derivation(derivation, is_geometry_named=is_named)
    yield from _example(derivation)
    proof = derivation.prove()
    yield Paragraph(*words(f"Check of the derivation: {proof.statement}."))
    programs = derivation.code("python")
    names = [
        files.add(f"ik_{name}" if name == "ik.py" else name, text)
        for name, text in programs.items()
    ]
    yield Paragraph(f"The same steps as a program: {', '.join(names)} beside this report.")
    yield _prompt()


def _prompt() -> Prompt:
    return Prompt(
        "Say which solution your simulator takes and why, how it behaves at a pose out of reach and near a "
        "singularity, and show the tool's trajectory with inverse kinematics."
    )


class _Writer:
    """Writes the formulas of a derivation in both notations."""

    def __init__(self, derivation: InverseDerivation) -> None:
        self.latex = Phrases(derivation, LATEX)
        self.typst = Phrases(derivation, TYPST)

    def rows(self, left: Math, element: Element) -> Iterator[Row]:
        """Yield the lines of the equation ``left = element``."""
        marked = Math(self.latex.marked(element), self.typst.marked(element))
        first, *more = broken(marked, SYMBOLS_PER_EM * (LINE_WIDTH - 5))
        yield Row(left, first)
        yield from (Row(None, line) for line in more)

    def element(self, element: Element) -> Math:
        """Return an element in one line."""
        return Math(self.latex.element(element), self.typst.element(element))


def _derivation(derivation: InverseDerivation, *, is_geometry_named: bool) -> Iterator[Block]:
    """Yield the steps, after the geometry of the axes unless the section has named it."""
    write = _Writer(derivation)
    geometry, *sentences = introduction(derivation)
    for sentence in sentences if is_geometry_named else [geometry, *sentences]:
        yield Paragraph(*words(sentence))
    for number_of_step, step in enumerate(derivation.steps, start=1):
        yield Heading(f"Step {number_of_step}: {heading_words(step.title)}", 2)
        yield Paragraph(*words(step.look))
        used = solved_before(derivation, step)
        if used:
            yield Paragraph(*words(f"Known from before: {', '.join(used)}."))
        rows = list(_step_rows(write, step))
        if rows:
            yield Formulas(tuple(rows))
        if step.choice:
            yield Paragraph("The two solutions: ", *_rule(write, step), ".")
        if step.nothing:
            yield Paragraph(*words(f"No solution where {step.nothing}."))
        if step.singular:
            yield Paragraph(*words(f"Singular where {step.singular}."))
    joints = list(zip(write.latex.joint_values(), write.typst.joint_values(), strict=True))
    if joints:
        yield Heading("Joint values", 2)
        yield Paragraph("The angles without the offsets of the table, turned into (−π, π]:")
        yield Formulas(
            tuple(
                Row(Math(latex[0], typst[0]), Math(latex[1], typst[1])) for latex, typst in joints
            )
        )
    for condition in derivation.conditions:
        yield Paragraph(condition.look)
        yield Formulas(tuple(write.rows(write.element(condition.left), condition.right)))
    yield Paragraph(branches_sentence(derivation))
    for note in derivation.notes:
        yield Paragraph(f"Note: {note}.")


def _step_rows(write: _Writer, step: DerivationStep) -> Iterator[Row]:
    """Yield the definitions, equations and the solution of a step."""
    for definition in step.definitions:
        left = Math(write.latex.name(definition.name), write.typst.name(definition.name))
        yield from write.rows(left, definition.element)
    if step.form is None:
        return
    latex = write.latex.solution(step.form)
    typst = write.typst.solution(step.form)
    solution = Row(_side(latex.unknown, typst.unknown), _alternatives(latex, typst))
    equations = zip(write.latex.equations(step), write.typst.equations(step), strict=True)
    for (latex_left, latex_right), (typst_left, typst_right) in equations:
        row = Row(_side(latex_left, typst_left), _side(latex_right, typst_right))
        if row != solution:
            yield row
    for (latex_letter, latex_value), (typst_letter, typst_value) in zip(
        latex.letters, typst.letters, strict=False
    ):
        yield Row(_side(latex_letter, typst_letter), _side(latex_value, typst_value))
    yield solution


def _side(latex: str, typst: str) -> Math:
    return Math(latex, typst)


def _alternatives(latex: Solution, typst: Solution) -> Math:
    """Return the formulas of a solution: one, or two joined by "or"."""
    return Math(
        r" \quad\text{or}\quad ".join(latex.alternatives),
        ' quad "or" quad '.join(typst.alternatives),
    )


def _rule(write: _Writer, step: DerivationStep) -> Iterator[str | Math]:
    """Yield the rule that names the two roots, as words and formulas."""
    if step.choice is None:
        return
    latex = rule_in_dollars(write.latex, step.choice).split("$")
    typst = rule_in_dollars(write.typst, step.choice).split("$")
    for k, part in enumerate(latex):
        if k % 2 == 0:
            yield part
        elif len(typst) == len(latex):
            yield Math(part, typst[k])
        else:
            # The notations differ in the length of their names: the formula in the parts of one text.
            yield Math(part, f'"{step.title}"')


def _example(derivation: InverseDerivation) -> Iterator[Block]:
    """Yield the branches of one pose."""
    description = derivation.description
    T = sample_pose(derivation)
    result = inverse_kinematics(description, T)
    yield Heading("Example", 2)
    yield Paragraph("All branches of the pose")
    yield Formulas((matrix_row(Math("T", "T"), T),))
    rows = list(_branch_rows(result))
    solutions = result.q[result.valid]
    yield _table(description, rows, "Branches of the pose of the example, in ° and m", "branch")
    if len(solutions) and not derivation.family.aims:
        errors = np.abs(world_to_tool(description, solutions) - T)
        whole = derivation.family.undoes_tool
        error = float(errors.max() if whole else errors[:, :3, 3].max())
        met = "the pose" if whole else "the position of the pose"
        unit = "m and entries of the rotation" if whole else "m"
        accuracy = f"to {error:.1e}, in {unit}" if error else "exactly"
        yield Paragraph(
            f"Forward kinematics of the {len(solutions)} solutions meets {met} {accuracy}."
        )


def _branch_rows(result: IKSolutions) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the branches that reach one pose: name, joint values and remarks."""
    for k, name in enumerate(result.branches):
        if result.valid[k]:
            remarks = [text for flag, text in _FLAGS.items() if result.flags[k] & flag]
            values = _values(result.description, result.q[k])
            yield name or "the only one", *values, ", ".join(remarks)


def _all_solutions(description: Description) -> Iterator[Block]:
    """Yield all solutions of one pose of an arm of six or seven revolute joints without a derivation."""
    _, q = ready(description)
    goal = moved(description, q)
    T = world_to_tool(description, goal)
    seed = goal if description.n == _REDUNDANT else None
    result = inverse_kinematics(description, T, seed)
    error = float(np.abs(world_to_tool(description, result.q[result.valid]) - T).max(initial=0.0))
    yield Heading("Example", 2)
    yield Paragraph(f"The pose of the joint values {joint_values(description, goal)} is")
    yield Formulas((matrix_row(Math("T", "T"), T),))
    count = int(result.valid.sum())
    if result.redundancy is None:
        how = "All joints but one are eliminated, and the real roots of a polynomial in its angle give"
    else:
        how = (
            f"An arm of seven joints has infinitely many solutions; at {_redundancy(result)} it has"
        )
    yield Paragraph(f"{how} {count} solutions, which meet the pose to {error:.1e}.")
    yield _table(
        description,
        list(_branch_rows(result)),
        "Solutions of the pose of the example, in °",
        "solution",
    )


def _redundancy(result: IKSolutions) -> str:
    """Return the redundancy of the solutions of one pose in words."""
    redundant = classify(result.description).redundant
    name = "joint 7" if redundant is None else redundant[0].redundancy
    value = float(np.degrees(np.asarray(result.redundancy)))
    return f"{name} = {value:.2f}°".replace("-", "−")


def _iteration(description: Description) -> Iterator[Block]:
    """Yield solutions that the iteration finds from several starts."""
    _, q = ready(description)
    goal = moved(description, q)
    T = world_to_tool(description, goal)
    numbers = description.numbers
    lower = np.maximum(numbers.lower, np.where(numbers.prismatic, -description.reach, -np.pi))
    upper = np.minimum(numbers.upper, np.where(numbers.prismatic, description.reach, np.pi))
    starts = lower + (upper - lower) * np.random.default_rng(0).random((_STARTS, description.n))
    found = solve_numerically(description, np.broadcast_to(T, (_STARTS, 4, 4)), starts)
    kept: list[Array] = []
    for solution in found.q[found.valid]:
        if all(np.abs(solution - other).max() > _SAME for other in kept):
            kept.append(solution)
    yield Heading("Example", 2)
    yield Paragraph(
        f"An example by iteration (damped least squares with restarts): the pose of the joint values "
        f"{joint_values(description, goal)}, which is"
    )
    yield Formulas((matrix_row(Math("T", "T"), T),))
    if not kept:
        yield Paragraph("The iteration found no solution from its starts.")
        return
    error = float(np.abs(world_to_tool(description, np.stack(kept)) - T).max())
    several = (
        "an arm with more joints than the pose asks for has infinitely many"
        if description.n > 6
        else "there may be more"
    )
    yield Paragraph(
        f"From {_STARTS} starts the iteration found {len(kept)} different solutions ({several}); "
        f"they meet the pose to {error:.1e}."
    )
    rows = [
        (str(k), *_values(description, solution), "")
        for k, solution in enumerate(kept[:_MOST_SOLUTIONS], start=1)
    ]
    yield _table(description, rows, "Solutions of the pose of the example, in ° and m", "solution")


def _table(
    description: Description, rows: list[tuple[str, ...]], caption: str, first: str
) -> Table:
    headings = [Math(f"q_{{{i + 1}}}", f"q_({i + 1})") for i in range(description.n)]
    has_remarks = any(row[-1] for row in rows)
    shown = rows if has_remarks else [row[:-1] for row in rows]
    return Table(
        (first, *headings, *(["remark"] if has_remarks else [])),
        tuple(shown),
        caption,
        "l" + "r" * description.n + "l",
        is_small=description.n > 4,
    )


def _values(description: Description, q: Array) -> Iterator[str]:
    """Yield joint values with two decimals in degrees, and four digits in m."""
    for value, slides in zip(q, description.numbers.prismatic, strict=True):
        yield number(value) if slides else f"{np.degrees(value) + 0.0:.2f}".replace("-", "−")
