"""Inverse kinematics of `dhkit demo`: all branches at one pose, and a straight line that is followed from it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.kinematics import classify

LINE_POSES = 200
LINE_LENGTHS = (0.5, 0.35, 0.25, 0.15, 0.08)
"""Lengths of lines that are tried, as shares of the arm's reach, the longest first."""
LINE_DIRECTIONS = (
    (0, 1, 0),
    (1, 0, 0),
    (0, 0, 1),
    (1, 1, 0),
    (1, -1, 0),
    (1, 0, 1),
    (1, 0, -1),
    (0, 1, 1),
    (0, 1, -1),
)
"""Directions that are tried, world."""
PREFERRED_CONFIGURATIONS = ("nominal", "ready", "home")
"""Names of the configurations that lines are looked for at first."""
RANDOM_STARTS = 8
"""Random configurations that are tried if there is no line at a named one."""
ITERATION_STARTS = 24
"""Starts of the iteration for an arm without closed form."""
MAX_SOLUTIONS = 4
"""Largest number of solutions of the iteration that are kept."""
SAME_SOLUTION = 0.3
"""Largest difference of joint values, rad or m, of solutions that count as one."""
MAX_STEP = 0.2
"""Largest step of a joint between two poses of a line, rad or m; with a larger step the joint jumps."""


@dataclass(frozen=True, eq=False)
class Branches:
    """Solutions of one pose: all of them, or some if the arm has no closed form."""

    q: Array
    """Joint values, shape (k, n), rad and m."""
    names: tuple[str, ...]
    """Names of the k branches."""
    error: float | None
    """Largest error of the poses that they lead to, m and rad; None for an arm that only aims."""
    closed_form: bool


@dataclass(frozen=True, eq=False)
class Line:
    """A straight line of the tool, with constant orientation as far as the arm can."""

    T: Array
    """Poses, shape (N, 4, 4), m, world."""
    q: Array
    """Joint values, shape (N, n), rad and m, inside the limits."""
    near_singular: bool

    @property
    def length(self) -> float:
        """Length of the line, m."""
        return float(np.linalg.norm(self.T[-1, :3, 3] - self.T[0, :3, 3]))

    @property
    def switches(self) -> int:
        """Number of changes of the branch."""
        return int(np.sum(np.abs(np.diff(self.q, axis=0)).max(axis=1) > MAX_STEP))


def branches(arm: Arm, q: Array) -> Branches:
    """Return the solutions of the tool's pose at joint values q, shape (n,), rad and m."""
    T = arm.fk(q)
    fit = classify(arm.description).fit
    if fit is None:
        solutions = _iterative_solutions(arm, T, q)
        names = tuple(f"solution {k}" for k in range(1, len(solutions) + 1))
        return Branches(
            solutions, names, float(np.abs(arm.fk(solutions) - T).max()), closed_form=False
        )
    result = arm.ik(T, seed=q)
    solutions = result.q[result.valid]
    names = tuple(name for name, valid in zip(result.branches, result.valid, strict=True) if valid)
    errors = np.abs(arm.fk(solutions) - T)
    if len(fit.coordinates) < 6:
        errors = errors[:, :3, 3]
    return Branches(
        solutions, names, float(errors.max()) if "x" in fit.coordinates else None, closed_form=True
    )


def straight_line(arm: Arm) -> Line | None:
    """Return the first line that is found which the arm follows without a jump inside its limits; None for no line.

    Lines are looked for near the arm's configurations, the longest first; a line near a singularity is returned only if
    there is no other.
    """
    second_best = None
    closed_form = classify(arm.description).fit is not None
    for q in _starts(arm):
        for T in _lines(arm, q):
            line = _line_in_closed_form(arm, T, q) if closed_form else _line_by_iteration(arm, T, q)
            if line is not None and line.switches == 0:
                if not line.near_singular:
                    return line
                second_best = second_best or line
    return second_best


def _starts(arm: Arm) -> Iterator[Array]:
    """Yield joint values inside the limits, shape (n,): named ones, then random ones."""
    numbers = arm.description.numbers
    named = dict(arm.configurations)
    preferred = PREFERRED_CONFIGURATIONS
    for name in sorted(
        named, key=lambda name: preferred.index(name) if name in preferred else len(preferred)
    ):
        if np.all((named[name] >= numbers.lower) & (named[name] <= numbers.upper)):
            yield named[name]
    room = np.where(numbers.prismatic, arm.description.reach / 2, np.pi / 2)
    lower = np.maximum(numbers.lower, -room)
    upper = np.minimum(numbers.upper, room)
    low = np.minimum(lower, upper)
    high = np.maximum(lower, upper)
    yield from low + (high - low) * np.random.default_rng(0).random((RANDOM_STARTS, arm.n))


def _lines(arm: Arm, q: Array) -> Iterator[Array]:
    """Yield poses, shape (N, 4, 4), along lines through the tool at q, shape (n,), with constant orientation."""
    middle = arm.fk(q)
    for share in LINE_LENGTHS if arm.description.reach else ():
        length = float(f"{share * arm.description.reach:.1g}")
        for direction in LINE_DIRECTIONS:
            T = np.repeat(middle[None], LINE_POSES, axis=0)
            unit = np.array(direction) / np.linalg.norm(direction)
            T[:, :3, 3] += np.linspace(-length / 2, length / 2, LINE_POSES)[:, None] * unit
            yield T


def _line_in_closed_form(arm: Arm, T: Array, q: Array) -> Line | None:
    """Return a line that is followed in closed form from the branch nearest to q; None if it cannot be followed."""
    path = arm.ik_path(T[:1], q)
    path = arm.ik_path(T, q) if path.ok else path
    return Line(T, path.q, bool(path.near_singular)) if path.ok else None


def _line_by_iteration(arm: Arm, T: Array, q: Array) -> Line | None:
    """Return a line that is followed by iteration from its middle at q outwards; None if it cannot be followed."""
    half = len(T) // 2
    ahead = _follow_by_iteration(arm, T[half:], q)
    behind = _follow_by_iteration(arm, T[:half][::-1], q)
    if ahead is None or behind is None:
        return None
    return Line(T, np.concatenate([behind[::-1], ahead]), near_singular=False)


def _follow_by_iteration(arm: Arm, T: Array, q: Array) -> Array | None:
    path = np.empty((len(T), arm.n))
    for k, pose in enumerate(T):
        path[k] = arm.ik_numeric(pose, q, restarts=0).q[0]
        if not np.all(np.abs(path[k] - q) <= MAX_STEP):
            return None
        q = path[k]
    return path


def _iterative_solutions(arm: Arm, T: Array, q: Array) -> Array:
    """Return some different solutions of a pose, shape (k, n), the first of them q itself."""
    numbers = arm.description.numbers
    lower = np.maximum(numbers.lower, -np.pi)
    upper = np.minimum(numbers.upper, np.pi)
    starts = lower + (upper - lower) * np.random.default_rng(0).random((ITERATION_STARTS, arm.n))
    solutions = arm.ik_numeric(np.broadcast_to(T, (ITERATION_STARTS, 4, 4)), starts)
    kept = [q]
    for other in solutions.q[solutions.valid]:
        if len(kept) < MAX_SOLUTIONS and all(
            np.abs(other - known).max() > SAME_SOLUTION for known in kept
        ):
            kept.append(other)
    return np.stack(kept)
