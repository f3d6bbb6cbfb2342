"""`dhkit ik`: every way of an arm to put its tool where it is asked to, one a line."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.cli.output import print_json, print_table, say
from dhkit.cli.units import angle_key, joint_entry
from dhkit.description import Array, pose_parts
from dhkit.errors import ModelError
from dhkit.kinematics import IKFlag, IKSolutions, IKStatus, classify
from dhkit.kinematics.solutions import LIMIT_SLACK

FLAG_WORDS = {
    IKFlag.shoulder: "shoulder singular",
    IKFlag.elbow: "elbow stretched or folded",
    IKFlag.wrist: "wrist singular",
    IKFlag.clamped: "on the boundary",
}
MARK = "→"
TURN = 2 * np.pi


@dataclass(frozen=True, eq=False)
class Answer:
    """What is said about one pose."""

    arm: Arm
    T: Array
    """The pose, shape (4, 4)."""
    found: IKSolutions
    method: str
    note: str
    """Why another method was used than one would expect, or nothing."""
    q: Array
    """Joint values, shape (B, n): angles with the whole turns that bring them into the limits and near the seed."""
    shown: tuple[int, ...]
    """Which branches count."""
    near: Array | None
    order: str
    """Of Euler angles."""
    degrees: bool

    @property
    def nearest(self) -> int | None:
        """The branch nearest to what was asked for, None where nothing was."""
        if self.near is None or not self.shown:
            return None
        gaps = np.sum((self.q - self.near) ** 2, axis=1)
        return min(self.shown, key=lambda k: float(gaps[k]))

    def flags(self, k: int) -> list[str]:
        """Return what is special about a branch, in words."""
        return [words for flag, words in FLAG_WORDS.items() if self.found.flags[k] & flag]

    @property
    def refusal(self) -> str:
        """Why there is no solution to show, in words; nothing where there is one."""
        if self.shown:
            return ""
        if self.found.valid.any():
            return "reached, but by no branch inside the joint limits"
        distance = float(self.found.distance)
        if self.method == "numeric":
            missing = f"misses the position by {distance:.4g} m" if distance > 0 else "misses the orientation"
            return f"no solution found by iteration: the best try {missing}"
        if self.method == "ssik":
            return "out of reach: no solution found"
        return f"out of reach by {distance:.4g} m"


def run(
    arm: Arm,
    T: Array,
    *,
    near: Array | None,
    order: str,
    degrees: bool,
    limits: bool,
    numeric: bool,
    json: bool,
) -> int:
    """Print all solutions of fk(q) = T; return 0, or 1 where there is none."""
    found, method, note = _solved(arm, T, near, limits=limits, numeric=numeric)
    counts = found.allowed if limits else found.valid
    answer = Answer(
        arm=arm,
        T=T,
        found=found,
        method=method,
        note=note,
        q=_wound(found, near),
        shown=tuple(int(k) for k in np.flatnonzero(counts)),
        near=near,
        order=order,
        degrees=degrees,
    )
    if json:
        print_json(_facts(answer))
    else:
        _print(answer)
    return 0 if answer.shown else 1


def _solved(arm: Arm, T: Array, near: Array | None, *, limits: bool, numeric: bool) -> tuple[IKSolutions, str, str]:
    """Return solutions, how they were found, and why that way if it needs saying."""
    note = ""
    if not numeric:
        try:
            return arm.ik(T, seed=near), "closed form" if classify(arm.description).fit else "ssik", ""
        except ModelError as error:
            note = f"one solution by iteration: {error}"
    found = arm.ik_numeric(T, near)
    if not limits and not found.valid.any():
        found = arm.ik_numeric(T, near, limits=False)
    return found, "numeric", note


def _wound(found: IKSolutions, near: Array | None) -> Array:
    """Return all branches, each joint with the whole turns that bring it inside its limits, near the values given."""
    # With the flag taken off no branch is left out for being outside.
    everywhere = replace(found, flags=found.flags & ~np.uint8(IKFlag.out_of_limits))
    q = everywhere.within_limits(near)
    turns = np.where(found.prismatic | (near is None), 0.0, np.rint(((0.0 if near is None else near) - found.q) / TURN))
    outside = (q < found.lower - LIMIT_SLACK) | (q > found.upper + LIMIT_SLACK)
    return np.where(outside, found.q + TURN * turns, q)


def _print(answer: Answer) -> None:
    arm, unit = answer.arm, "°" if answer.degrees else "rad"
    say(f"{arm.name}: {arm.family}", "bold")
    if answer.note:
        say(f"note: {answer.note}", "yellow")
    xyz, angles = pose_parts(answer.T, order=answer.order, degrees=answer.degrees)
    say(f"pose: x y z {_row(xyz)} m, {answer.order} {_row(angles)} {unit}\n")
    if answer.refusal:
        say(answer.refusal)
        return
    prismatic = arm.description.numbers.prismatic
    units = ["m" if slides else unit for slides in prismatic]
    headings = ["", "branch", *(f"q{i + 1} [{unit}]" for i, unit in enumerate(units)), "limits", "special"]
    print_table(headings, [_line(answer, k) for k in answer.shown])
    say(f"\n{_summary(answer)}")


def _line(answer: Answer, k: int) -> tuple[str, ...]:
    prismatic = answer.arm.description.numbers.prismatic
    shown = np.where(prismatic, answer.q[k], np.degrees(answer.q[k])) if answer.degrees else answer.q[k]
    digits = np.where(prismatic, 6, 4 if answer.degrees else 6)
    values = [f"{_rounded(x, int(d)):.{d}f}" for x, d in zip(shown, digits, strict=True)]
    mark = MARK if k == answer.nearest else ""
    return mark, answer.found.branches[k], *values, _limits(answer, k), ", ".join(answer.flags(k))


def _limits(answer: Answer, k: int) -> str:
    """Return whether a branch is inside the limits, and which joints are not."""
    if answer.found.allowed[k]:
        return "inside"
    numbers, q = answer.arm.description.numbers, answer.q[k]
    outside = np.flatnonzero((q < numbers.lower - LIMIT_SLACK) | (q > numbers.upper + LIMIT_SLACK))
    return f"outside: {', '.join(f'q{i + 1}' for i in outside)}"


def _summary(answer: Answer) -> str:
    found, nearest = answer.found, answer.nearest
    reach, inside = int(np.sum(found.valid)), int(np.sum(found.allowed))
    if answer.method == "closed form":
        text = f"{reach} of {len(found)} branches reach the pose, {inside} inside the limits"
    else:
        by = "iteration" if answer.method == "numeric" else answer.method
        text = f"{reach} solution{'s' if reach > 1 else ''} found by {by}, {inside} inside the limits"
    return text if nearest is None else f"{text}; {MARK} nearest: {found.branches[nearest]}"


def _facts(answer: Answer) -> dict[str, Any]:
    """Return everything for machines."""
    found, nearest = answer.found, answer.nearest
    xyz, angles = pose_parts(answer.T, order=answer.order, degrees=answer.degrees)
    branches = [
        {
            "name": found.branches[k],
            **joint_entry(answer.arm, "q", answer.q[k], degrees=answer.degrees),
            "within_limits": bool(found.allowed[k]),
            "flags": [flag.name for flag in FLAG_WORDS if found.flags[k] & flag],
        }
        for k in answer.shown
    ]
    return {
        "robot": answer.arm.name,
        "inverse_kinematics": str(answer.arm.family),
        "method": answer.method,
        "note": answer.note,
        "T": answer.T.tolist(),
        "xyz_m": xyz.tolist(),
        angle_key(f"euler_{answer.order}", degrees=answer.degrees): angles.tolist(),
        "met": list(found.met),
        "status": IKStatus(int(found.status_code)).name,
        "distance_m": float(found.distance),
        "branches": branches,
        "nearest": None if nearest is None else found.branches[nearest],
        "reason": answer.refusal,
    }


def _row(values: Array) -> str:
    return " ".join(f"{_rounded(x, 6):.6g}" for x in values)


def _rounded(x: float, digits: int) -> float:
    """Return a number rounded, without a minus sign before zero."""
    return round(float(x), digits) + 0.0
