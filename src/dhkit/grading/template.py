"""Empty answer sheets: what a robot's names are, and which quantities may be handed in."""

from __future__ import annotations

from dhkit.description import Description
from dhkit.grading.answers.sheet import shape_of

ASKED = ("K", "V", "M", "C", "g", "tau")


def template(description: Description, robot: str | None = None) -> str:
    """Return an empty answer sheet; entries that stay empty are not handed in.

    Parameters
    ----------
    description
        The robot.
    robot
        What the sheet calls it: a library name, or a file beside the sheet; its name unless given.
    """
    n = description.n
    variables = ", ".join(f"q{i + 1}" for i in range(n))
    symbols = ", ".join(description.parameters) or "none: numbers, SI and radians"
    lines = [
        f"# Answers for {description.name}; what stays empty is not handed in, and part of a quantity is incomplete.",
        f"# Joint variables: {variables} (or th1, theta_1, ...), rates qd1 (q1dot, dq1), accelerations qdd1.",
        f"# Sums of angles: c12 for cos(q1 + q2), s1 for sin(q1). Parameters: {symbols}.",
        "format = 1",
        f'robot = "{robot or description.name}"',
        'student = ""',
        "",
        "[names]                      # your own names, where they differ",
        "# q = [" + ", ".join(f'"th{i + 1}"' for i in range(n)) + "]",
        '# angles = "absolute"        # if angles count from a fixed direction',
        '# parameters = { lc1 = "l1/2" }',
        "",
        "[answer]",
        *(f"{name} = {_empty(shape_of(name, n))}" for name in ASKED),
        *(f"# A{i + 1} = {_empty((4, 4))}" for i in range(n)),
        f"# J = {_empty((6, n))}",
        "",
        "# [answer.dh]                # theta, d, a, alpha; SI and radians",
        f'# convention = "{description.convention.value}"',
        "# rows = [" + ", ".join('["", "", "", ""]' for _ in range(n)) + "]",
    ]
    return "\n".join(lines) + "\n"


def _empty(shape: tuple[int, ...]) -> str:
    if not shape:
        return '""'
    return "[" + ", ".join([_empty(shape[1:])] * shape[0]) + "]"
