"""The straight-line programs of an arm's kinematics, as kernels to compile in advance, and as C99 source."""

from __future__ import annotations

import textwrap
from pathlib import Path

from dhkit.description import Description, takes_robot
from dhkit.kernels import Kernel
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.closed_form.family import Fit, limit_parameters
from dhkit.kinematics.eliminated import elimination_kernels
from dhkit.kinematics.forward import frames_kernel, tool_kernel
from dhkit.kinematics.jacobian import jacobian_dot_kernel, jacobian_kernel
from dhkit.kinematics.newton import descent_kernel, error_kernel, step_kernel
from dhkit.kinematics.redundant import redundant_kernels
from dhkit.kinematics.solutions import IKFlag, IKStatus
from dhkit.kinematics.solver import solver_of
from dhkit.symbolic import Graph, SymbolicTable, export_c, jacobian, joint_symbols

_COMMENT_WIDTH = 97
"""Width of a comment's text in a header, characters; with its margin a line has 100."""
STATUS_MEANINGS = {
    IKStatus.ok: "reached",
    IKStatus.singular: "reached, and a branch is at a singularity: see flags",
    IKStatus.out_of_reach: "no solution exists",
    IKStatus.not_a_pose: "T is not finite, or its rotation is not orthonormal to 2e-6",
}
"""Meanings of the status numbers that a program of a closed form returns, for comments in C."""
FLAG_MEANINGS = {
    IKFlag.shoulder: "the wrist centre is where joint 1 cannot move it out of the arm's plane",
    IKFlag.elbow: "the arm is stretched or folded",
    IKFlag.wrist: "two axes of the wrist coincide",
    IKFlag.clamped: "beyond reach by no more than rounding; counts as reached",
    IKFlag.out_of_limits: "a joint is outside its limits, whatever whole turns are added",
}
"""Meanings of the flags that a program of a closed form sets, for comments in C."""


@takes_robot
def kinematic_kernels(description: Description) -> list[Kernel]:
    """Return the kernels of frames, Jacobians, their derivatives, and numeric and closed-form inverse kinematics.

    Parameters
    ----------
    description
        The robot.

    Returns
    -------
    list[Kernel]
        The kernels that ``arm.compile`` compiles; those of inverse kinematics only where the arm has them.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> len(kinematic_kernels(library_robot("puma560")))
    13
    """
    with_parameters = [
        tool_kernel(description),
        frames_kernel(description),
        *(jacobian_kernel(description, frame) for frame in ("world", "tool")),
        *(jacobian_dot_kernel(description, frame) for frame in ("world", "tool")),
    ]
    kernels = [kernel for kernel, _ in with_parameters]
    for size in (6, 3):  # Newton's method for whole poses, and for positions
        kernels += [error_kernel(size), step_kernel(description.n, size)]
        kernels.append(descent_kernel(description, size)[0])
    return [*kernels, *_inverse_kernels(description)]


def _inverse_kernels(description: Description) -> list[Kernel]:
    """Return the kernels of a closed form, at a redundancy too, or of an elimination; none for other arms."""
    solver = solver_of(description)
    if solver is not None:
        return [solver.kernel]
    if description.kinds == "RRRRRR":
        return elimination_kernels(description)
    return redundant_kernels(description) if description.kinds == "RRRRRRR" else []


@takes_robot
def export_kinematics(
    description: Description, folder: str | Path, name: str | None = None
) -> tuple[Path, Path]:
    """Write forward kinematics, Jacobian and, where it has a closed form, inverse kinematics as ``NAME.c`` and ``.h``.

    Parameters
    ----------
    description
        The robot.
    folder
        An existing folder.
    name
        The files' name, an identifier of C; the robot's by default. Functions begin with it.

    Returns
    -------
    tuple[Path, Path]
        Source and header: self-contained C99; link with ``-lm``. Functions take and fill arrays of doubles, row by row,
        SI and radians; the header has their shapes.

        - ``NAME_forward_kinematics``: q to T, the tool in the world;
        - ``NAME_jacobian``: q to J, in world axes, the linear rows first;
        - ``NAME_inverse_kinematics``: T and ``free`` to the branches, in the order of those of ``Arm.ik``, with its
          fields. ``free`` are the values of the two joints that are free at singularities: joint 1 where the wrist
          centre lies on its axis, and the joint that is free at a wrist singularity. The header explains the numbers of
          ``flags`` and ``status``.

    Raises
    ------
    ValueError
        ``name`` is not an identifier of C.
    OSError
        The folder cannot be written to.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> source, header = export_kinematics(library_robot("puma560"), ".", "puma")
    >>> source.name, header.name
    ('puma.c', 'puma.h')
    """
    name = description.name if name is None else name
    graphs = [_forward(description, name), _jacobian(description, name)]
    found = classify(description)
    remark = f"{description.name}: {found.words}. Written by dhkit."
    explanations = {
        f"{name}_forward_kinematics": ["q: joint values.", "T: pose of the tool in the world."],
        f"{name}_jacobian": [
            "q: joint values.",
            "J: the tool's linear velocity, then its angular velocity, in the world's axes, by joint rate.",
        ],
    }
    if found.family is not None and found.fit is not None:
        from dhkit.kinematics.closed_form.program import (
            arm_program,  # CasADi, which takes time to import
        )

        numbers = description.numbers
        prismatic = tuple(bool(slides) for slides in numbers.prismatic)
        limits = limit_parameters(numbers.lower, numbers.upper, prismatic)
        graphs.append(
            arm_program(found.family, found.fit, prismatic, limits).renamed(
                f"{name}_inverse_kinematics"
            )
        )
        explanations[graphs[-1].name] = _inverse_explanation(found.fit)
    return export_c(graphs, folder, name, remark, explanations)


def _forward(description: Description, name: str) -> Graph:
    q = joint_symbols("q", description.n)
    return Graph.of(
        f"{name}_forward_kinematics",
        {"q": q},
        {"T": SymbolicTable.of(description).world_to_tool(q)},
    )


def _jacobian(description: Description, name: str) -> Graph:
    q = joint_symbols("q", description.n)
    return Graph.of(f"{name}_jacobian", {"q": q}, {"J": jacobian(SymbolicTable.of(description), q)})


def _inverse_explanation(fit: Fit) -> list[str]:
    """Return the lines that explain the inputs and outputs of inverse kinematics in a header."""
    free = "free: values, rad, of joints that the pose leaves free: the first that of joint 1 where the point that it"
    free += " turns lies on its axis"
    if fit.free_joint is not None:
        free += (
            f", the second that of joint {fit.free_joint + 1} where two axes of the wrist coincide"
        )
    free += ". 0 and 0 will do."

    lines = [
        "T: pose of the tool in the world.",
        free,
        f"q: one branch a row: {', '.join(fit.branches)}. NaN in rows of branches that do not reach the pose. Angles in"
        " (-pi, pi].",
        "distance: m from the point that decides the reach (the wrist's centre, or the tool) to the nearest reachable"
        " one, or more; 0 where the pose is reached, NaN where T is not a pose.",
        "valid: for each branch, 1 where it reaches the pose, else 0. Joint limits do not count.",
        "flags: for each branch, the sum of",
        *(f"  {flag.value:2} {flag.name}: {meaning}" for flag, meaning in FLAG_MEANINGS.items()),
        "status: one of",
        *(f"  {code.value:2} {code.name}: {meaning}" for code, meaning in STATUS_MEANINGS.items()),
    ]
    wrapped: list[str] = []
    for line in lines:
        wrapped += textwrap.wrap(line, _COMMENT_WIDTH, subsequent_indent="  ")
    return wrapped
