"""`dhkit ik`: all solutions of an arm's inverse kinematics at a pose, one a line."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated, Any

import numpy as np
import typer

from dhkit.arm import Arm
from dhkit.cli.arguments import OutsideLimits, numbers, option_values, target, with_long_options
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.options import Degrees, EulerAngles, EulerOrder, Json, Robot, read_arm
from dhkit.cli.output import print_json, print_table, say
from dhkit.cli.units import angle_key, joint_entry
from dhkit.description import Array, pose_parts
from dhkit.errors import ModelError
from dhkit.kinematics import IKFlag, IKSolutions, IKStatus, classify
from dhkit.kinematics.solutions import LIMIT_SLACK

FLAG_DESCRIPTIONS = {
    IKFlag.shoulder: "shoulder singular",
    IKFlag.elbow: "elbow stretched or folded",
    IKFlag.wrist: "wrist singular",
    IKFlag.singular: "singular",
    IKFlag.clamped: "on the boundary",
}
REPORTED_FLAGS = (*FLAG_DESCRIPTIONS, IKFlag.refined)
"""Flags in JSON; the line below the table tells of refined branches, which all are if one is."""
NEAREST_MARK = "→"

app = typer.Typer(rich_markup_mode=None)


class Method(StrEnum):
    """The method that found solutions."""

    CLOSED_FORM = "closed form"
    NEIGHBOUR = "iteration from an arm of the family"
    ELIMINATION = "elimination"
    NUMERIC = "numeric"


@dataclass(frozen=True, eq=False)
class ReachedPose:
    """The solutions of one pose.

    Attributes
    ----------
    arm, T
        The arm, and the pose of its tool, shape (4, 4), m, world.
    solutions, method
        The solutions, and the method that found them.
    note
        Reason for using another method than the expected one; empty if there is none.
    q
        Joint values, shape (B, n), rad and m; angles with the whole turns that bring them inside the limits and near
        ``near``.
    shown
        The branches that are shown.
    near
        Joint values whose nearest branch is marked, shape (n,), rad and m.
    order
        Convention of Euler angles.
    degrees
        Whether angles are printed in degrees.
    """

    arm: Arm
    T: Array
    solutions: IKSolutions
    method: Method
    note: str
    q: Array
    shown: tuple[int, ...]
    near: Array | None
    order: str
    degrees: bool

    @property
    def nearest(self) -> int | None:
        """The branch nearest to ``near``; None without it."""
        if self.near is None or not self.shown:
            return None
        distances = np.sum((self.q - self.near) ** 2, axis=1)
        return min(self.shown, key=lambda k: float(distances[k]))

    def flags(self, k: int) -> list[str]:
        """Return descriptions of a branch's special properties."""
        return [text for flag, text in FLAG_DESCRIPTIONS.items() if self.solutions.flags[k] & flag]

    @property
    def given(self) -> str:
        """The redundancy of the solutions, such as ``joint 7 = 0.7854 rad``; empty for arms without."""
        value = self.solutions.redundancy
        if value is None:
            return ""
        redundant = classify(self.arm.description).redundant
        name = "joint 7" if redundant is None else redundant[0].redundancy
        shown = math.degrees(float(value)) if self.degrees else float(value)
        return f"{name} = {_rounded(shown, 6):.6g} {'°' if self.degrees else 'rad'}"

    @property
    def refusal(self) -> str:
        """Reason why no solution is shown; empty if one is."""
        if self.shown:
            return ""
        if self.solutions.valid.any():
            return "reached, but by no branch inside the joint limits"
        distance = float(self.solutions.distance)
        is_proved = self.solutions.status_code == IKStatus.out_of_reach
        if self.method is Method.NUMERIC:
            verdict = "out of reach" if is_proved else "no solution found by iteration"
            missing = (
                f"misses the position by {distance:.4g} m"
                if distance > 0
                else "misses the orientation"
            )
            return f"{verdict}: the best try {missing}"
        if not is_proved and self.solutions.redundancy is not None:
            return f"no solution found: {self.given}"
        if not is_proved:
            return f"no solution found by {self.method}, which does not prove that there is none"
        if np.isfinite(distance) and self.solutions.redundancy is None:
            return f"out of reach by {distance:.4g} m"
        return "out of reach: no joint values reach this pose"


@app.command(
    cls=with_long_options(
        {"--xyz": 3, "--euler": 3, "--matrix": None, "--like": None, "--near": None}
    )
)
def ik(
    robot: Robot,
    xyz: Annotated[
        str | None, typer.Option(metavar="X Y Z", help="The tool's position, m.")
    ] = None,
    euler: EulerAngles = "0 0 0",
    order: EulerOrder = "XYZ",
    matrix: Annotated[
        str | None,
        typer.Option(
            metavar="M11 ... M44", help="The pose by row, 16 or 12 numbers; or a file of them."
        ),
    ] = None,
    like: Annotated[
        str | None, typer.Option(metavar="Q ...", help="The tool pose of these joint values.")
    ] = None,
    near: Annotated[
        str | None,
        typer.Option(metavar="Q ...", help="Mark the branch nearest to these joint values."),
    ] = None,
    redundancy: Annotated[
        str | None,
        typer.Option(
            metavar="ANGLE", help="Joint 7, or the arm angle, of an arm of seven joints, rad."
        ),
    ] = None,
    degrees: Degrees = False,
    limits: Annotated[
        bool, typer.Option("--limits", help="Print only branches inside the joint limits.")
    ] = False,
    numeric: Annotated[
        bool, typer.Option("--numeric", help="Find one solution by iteration, for any arm.")
    ] = False,
    json: Json = False,
) -> ExitStatus:
    """Print every way to put the tool at a pose, given by --xyz, --matrix or --like; exit status 1 where there is none.

    Numbers may be expressions such as 17*inch or pi/2; joint values may be the name of a configuration.
    """
    arm = read_arm(robot)
    T = target(arm, xyz=xyz, euler=euler, order=order, matrix=matrix, like=like, degrees=degrees)
    near_q = (
        None if near is None else option_values(arm, near, "--near", degrees, OutsideLimits.ALLOWED)
    )
    value = None if redundancy is None else float(numbers([redundancy], "--redundancy", [1])[0])
    if value is not None and degrees:
        value = math.radians(value)
    seed = near_q
    if seed is None and value is None and like is not None and arm.family.redundant is not None:
        # At the redundancy of the joint values that the pose is taken from.
        seed = option_values(arm, like, "--like", degrees, OutsideLimits.ALLOWED)
    solutions, method, note = _solve(arm, T, seed, value, limits=limits, numeric=numeric)
    shown = solutions.allowed if limits else solutions.valid
    reached = ReachedPose(
        arm=arm,
        T=T,
        solutions=solutions,
        method=method,
        note=note,
        q=_with_whole_turns(solutions, near_q),
        shown=tuple(int(k) for k in np.flatnonzero(shown)),
        near=near_q,
        order=order,
        degrees=degrees,
    )
    if json:
        print_json(_facts(reached))
    else:
        _print(reached)
    return ExitStatus.FINE if reached.shown else ExitStatus.NO


def _solve(
    arm: Arm,
    T: Array,
    near: Array | None,
    redundancy: float | None,
    *,
    limits: bool,
    numeric: bool,
) -> tuple[IKSolutions, Method, str]:
    """Return solutions, the method that found them, and the reason for an unexpected method."""
    note = ""
    if not numeric:
        try:
            seed = near if redundancy is None else None
            return arm.ik(T, seed=seed, redundancy=redundancy), _method_of(arm), ""
        except ModelError as error:
            note = f"one solution by iteration: {error}"
    solutions = arm.ik_numeric(T, near)
    if not limits and not solutions.valid.any():
        solutions = arm.ik_numeric(T, near, limits=False)
    return solutions, Method.NUMERIC, note


def _method_of(arm: Arm) -> Method:
    """Return the method by which :meth:`dhkit.Arm.ik` solves an arm."""
    family = classify(arm.description)
    if family.closed_form or family.redundant is not None:
        return Method.CLOSED_FORM
    return Method.ELIMINATION if family.neighbour is None else Method.NEIGHBOUR


def _with_whole_turns(solutions: IKSolutions, near: Array | None) -> Array:
    """Return all branches, shape (B, n), with the whole turns that bring joints inside their limits and near values."""
    # Without this flag no branch is left out for being outside the limits.
    everywhere = replace(solutions, flags=solutions.flags & ~np.uint8(IKFlag.out_of_limits))
    q = everywhere.within_limits(near)
    turns = np.where(
        solutions.prismatic | (near is None),
        0.0,
        np.rint(((0.0 if near is None else near) - solutions.q) / math.tau),
    )
    outside = (q < solutions.lower - LIMIT_SLACK) | (q > solutions.upper + LIMIT_SLACK)
    return np.where(outside, solutions.q + math.tau * turns, q)


def _print(reached: ReachedPose) -> None:
    arm = reached.arm
    unit = "°" if reached.degrees else "rad"
    say(f"{arm.name}: {arm.family}", "bold")
    if reached.note:
        say(f"note: {reached.note}", "yellow")
    xyz, angles = pose_parts(reached.T, order=reached.order, degrees=reached.degrees)
    say(f"pose: x y z {_row(xyz)} m, {reached.order} {_row(angles)} {unit}\n")
    if reached.refusal:
        say(reached.refusal)
        return
    prismatic = arm.description.numbers.prismatic
    units = ["m" if slides else unit for slides in prismatic]
    headings = [
        "",
        "branch",
        *(f"q{i + 1} [{unit}]" for i, unit in enumerate(units)),
        "limits",
        "special",
    ]
    print_table(headings, [_line(reached, k) for k in reached.shown])
    say(f"\n{_summary(reached)}")


def _line(reached: ReachedPose, k: int) -> tuple[str, ...]:
    prismatic = reached.arm.description.numbers.prismatic
    shown = (
        np.where(prismatic, reached.q[k], np.degrees(reached.q[k]))
        if reached.degrees
        else reached.q[k]
    )
    digits = np.where(prismatic, 6, 4 if reached.degrees else 6)
    values = [f"{_rounded(x, int(d)):.{d}f}" for x, d in zip(shown, digits, strict=True)]
    mark = NEAREST_MARK if k == reached.nearest else ""
    return (
        mark,
        reached.solutions.branches[k],
        *values,
        _limits(reached, k),
        ", ".join(reached.flags(k)),
    )


def _limits(reached: ReachedPose, k: int) -> str:
    """Return whether a branch is inside the limits, and the joints that are not, as text."""
    if reached.solutions.allowed[k]:
        return "inside"
    numbers = reached.arm.description.numbers
    q = reached.q[k]
    outside = np.flatnonzero((q < numbers.lower - LIMIT_SLACK) | (q > numbers.upper + LIMIT_SLACK))
    return f"outside: {', '.join(f'q{i + 1}' for i in outside)}"


def _summary(reached: ReachedPose) -> str:
    solutions = reached.solutions
    nearest = reached.nearest
    count = int(np.sum(solutions.valid))
    inside = int(np.sum(solutions.allowed))
    if reached.method is Method.CLOSED_FORM:
        text = f"{count} of {len(solutions)} branches reach the pose, {inside} inside the limits"
    else:
        by = "iteration" if reached.method is Method.NUMERIC else reached.method
        text = (
            f"{count} solution{'s' if count > 1 else ''} found by {by}, {inside} inside the limits"
        )
    if reached.given:
        text += f", at {reached.given}"
    return (
        text
        if nearest is None
        else f"{text}; {NEAREST_MARK} nearest: {solutions.branches[nearest]}"
    )


def _facts(reached: ReachedPose) -> dict[str, Any]:
    """Return the solutions as JSON has them."""
    solutions = reached.solutions
    nearest = reached.nearest
    xyz, angles = pose_parts(reached.T, order=reached.order, degrees=reached.degrees)
    branches = []
    for k in reached.shown:
        branch = {
            "name": solutions.branches[k],
            **joint_entry(reached.arm, "q", reached.q[k], degrees=reached.degrees),
            "within_limits": bool(solutions.allowed[k]),
            "flags": [flag.name for flag in REPORTED_FLAGS if solutions.flags[k] & flag],
        }
        branches.append(branch)
    return {
        "robot": reached.arm.name,
        "inverse_kinematics": str(reached.arm.family),
        "method": reached.method,
        "note": reached.note,
        "T": reached.T.tolist(),
        "xyz_m": xyz.tolist(),
        angle_key(f"euler_{reached.order}", degrees=reached.degrees): angles.tolist(),
        "redundancy_rad": None if solutions.redundancy is None else float(solutions.redundancy),
        "met": list(solutions.met),
        "status": IKStatus(int(solutions.status_code)).name,
        "distance_m": float(solutions.distance),
        "branches": branches,
        "nearest": None if nearest is None else solutions.branches[nearest],
        "reason": reached.refusal,
    }


def _row(values: Array) -> str:
    return " ".join(f"{_rounded(x, 6):.6g}" for x in values)


def _rounded(x: float, digits: int) -> float:
    """Return a number rounded, without a minus sign before zero."""
    return round(float(x), digits) + 0.0
