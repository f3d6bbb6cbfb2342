"""Empty answer sheets to hand out, for a robot or for an instructor's task."""

from __future__ import annotations

from collections.abc import Iterator

import tomlkit

from dhkit.description import Description
from dhkit.grading.answers.sheet import JACOBIAN_ROWS, quantity_names, shape_of
from dhkit.grading.answers.sheet_values import NO_NAMES, AnswerSheet, Names, Requirements
from dhkit.kinematics import classify

_ENTRIES = ("K", "V", "M", "C", "g", "tau")
"""Quantities with entries where no task asks for others; the others are in comments."""
_MEANINGS = {
    "h": "C qd: what C is judged by",
    "L": "K - V",
    "T": "the pose: base to tool",
    "J": "linear, then angular, world axes",
}
"""Comments behind entries."""


def template(
    description: Description, robot: str | None = None, task: AnswerSheet | None = None
) -> str:
    """Return an empty answer sheet as TOML; entries that stay empty are not handed in.

    Parameters
    ----------
    description
        The robot.
    robot
        Robot as the sheet names it: a library name, or a file beside the sheet; by default the description's name.
    task
        An instructor's task: the sheet has its names and requirements, and entries for the quantities that it asks
        for and no others. Without one, or if it asks for nothing in particular, there are lines for all quantities.
    """
    names = NO_NAMES if task is None else task.names
    requirements = Requirements() if task is None else task.task
    n = description.n
    variables = ", ".join(names.q or (f"q{i + 1}" for i in range(n)))
    usual = "" if names.q else " (or th1, theta_1, ...), rates qd1 (q1dot, dq1), accelerations qdd1"
    symbols = ", ".join(description.parameters) or "none: numbers, SI and radians"
    lines = [
        f"# Answers for {description.name}; what stays empty is not handed in, and part of a quantity is incomplete.",
        f"# Joint variables: {variables}{usual}.",
        f"# Sums of angles: c12 for cos(q1 + q2), s1 for sin(q1). Parameters: {symbols}.",
        "format = 1",
        f'robot = "{robot or description.name}"',
        'student = ""',
        "",
        *_names_lines(names, n),
        "",
        *_task_lines(requirements),
        "[answer]",
        *_answer_lines(description, requirements),
    ]
    return "\n".join(lines) + "\n"


def _names_lines(names: Names, n: int) -> Iterator[str]:
    """Yield the table of names: those of a task, and in comments those that a student may add."""
    yield "[names]                      # your own names, where they differ"
    given: dict[str, object] = {
        key: list(value)
        for key, value in (("q", names.q), ("qd", names.qd), ("qdd", names.qdd))
        if value
    }
    if names.absolute:
        given["angles"] = "absolute"
    if names.state:
        given["state"] = ", ".join(names.state)
    yield from tomlkit.dumps(given).splitlines()
    if names.parameters:
        table = tomlkit.inline_table()
        table.update({name: str(value) for name, value in names.parameters.items()})
        yield f"parameters = {table.as_string()}"

    if not names.q:
        yield "# q = [" + ", ".join(f'"th{i + 1}"' for i in range(n)) + "]"
    if not names.absolute:
        yield '# angles = "absolute"        # if angles count from a fixed direction'
    if not names.parameters:
        yield '# parameters = { lc1 = "l1/2" }'


def _task_lines(task: Requirements) -> Iterator[str]:
    """Yield the table of a task's requirements; nothing where all are the usual ones."""
    given: dict[str, object] = {
        "asked": list(task.asked),
        "friction": task.friction,
        "total_derivative": task.total_derivative,
        "proof": "required" if task.proof_required else "",
        "frames": "given" if task.frames_given else "",
        "zero": "given" if task.zero_given else "",
        "J_rows": [JACOBIAN_ROWS[row] for row in task.jacobian_rows],
    }
    given = {key: value for key, value in given.items() if value}
    if task.in_letters:
        given["values"] = False
    if given:
        yield "[task]                       # what was asked for"
        yield from tomlkit.dumps(given).splitlines()
        yield ""


def _answer_lines(description: Description, task: Requirements) -> Iterator[str]:
    """Yield an entry for each quantity that is asked for; without a choice, lines for all of them."""
    n = description.n
    names = quantity_names(n)
    asked = task.asked or _ENTRIES
    for name in sorted(set(asked) & {*names}, key=[*_ENTRIES, *names].index):
        yield _entry(name, n, task)
    if not task.asked:
        for name in names:
            if name not in asked:
                yield f"# {_entry(name, n, task)}"
    if "dh" in task.asked or not task.asked:
        yield from _table_lines(description, is_asked=bool(task.asked))
    if "ik" in task.asked or (not task.asked and classify(description).family is not None):
        yield from _steps_lines(n, "" if task.asked else "# ")


def _entry(name: str, n: int, task: Requirements) -> str:
    """Return the line of a quantity without a value."""
    shape = shape_of(name, n)
    meaning = _MEANINGS.get(name, "")
    if name == "J" and task.jacobian_rows:
        shape = (len(task.jacobian_rows), n)
        meaning = ", ".join(JACOBIAN_ROWS[row] for row in task.jacobian_rows)
    if name == "tau" and task.friction:
        meaning = "with viscous friction"
    comment = f"  # {meaning}" if meaning else ""
    return f"{name} = {_empty(shape)}{comment}"


def _table_lines(description: Description, *, is_asked: bool) -> Iterator[str]:
    """Yield a table whose rows are in comments: rows of empty entries would be read as a table that cannot be."""
    mark = "" if is_asked else "# "
    yield ""
    yield f"{mark}[answer.dh]                # theta, d, a, alpha; SI and radians"
    yield f'{mark}convention = "{description.convention.value}"'
    if is_asked:
        yield "# Fill the rows in, and take away the # before them."
    yield "# rows = [" + ", ".join('["", "", "", ""]' for _ in range(description.n)) + "]"


def _steps_lines(n: int, mark: str) -> Iterator[str]:
    """Yield empty steps of inverse kinematics; ``mark`` begins each line, of a comment or not."""
    yield ""
    yield f"{mark}[answer.ik]                # joint by joint from T: px, py, pz, r11 ... r33, and joints found before;"
    yield "#                            # lengths by name or row (a2, d3); D = ... in equation defines a quantity"
    yield f"{mark}steps = [                  # for two solutions: ±, or a list"
    for i in range(n):
        yield f'{mark}  {{ joint = {i + 1}, equation = "", solution = "" }},'
    yield f"{mark}]"


def _empty(shape: tuple[int, ...]) -> str:
    """Return an entry without a value, or nested lists of a shape of them."""
    if not shape:
        return '""'
    return "[" + ", ".join([_empty(shape[1:])] * shape[0]) + "]"
