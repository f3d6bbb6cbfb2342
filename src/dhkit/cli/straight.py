"""What `dhkit demo` shows of inverse kinematics: every way to reach one pose, and a straight line followed from it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.kinematics import classify

POSES = 200
"""Along a line."""
SHARES = (0.5, 0.35, 0.25, 0.15, 0.08)
"""Lengths of lines that are tried, over the reach, the longest first."""
WAYS = ((0, 1, 0), (1, 0, 0), (0, 0, 1), (1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1), (0, 1, 1), (0, 1, -1))
"""Directions that are tried, in the world."""
PREFERRED = ("nominal", "ready", "home")
"""Names of configurations that lines are first looked for at."""
GUESSES = 8
"""Random configurations that are tried where there is no line at a named one."""
SEARCHES, KEPT = 24, 4
"""Searches for solutions of an arm without closed form, and how many different ones are enough."""
APART = 0.3
"""rad or m: solutions nearer to each other than this are one."""
JUMP = 0.2
"""rad or m: a joint that moves more between two poses of a line has jumped."""


@dataclass(frozen=True, eq=False)
class Branches:
    """Ways to reach one pose: all, or some where the arm has no closed form."""

    q: Array
    """Joint values, shape (k, n), rad and m."""
    names: tuple[str, ...]
    """What each is called, k texts."""
    error: float | None
    """How far fk of these is from the pose at most, m and rad; None for an arm that only aims."""
    closed_form: bool


@dataclass(frozen=True, eq=False)
class Line:
    """A straight line of the tool, its orientation kept as far as the arm can."""

    T: Array
    """Poses, shape (N, 4, 4)."""
    q: Array
    """Joint values, shape (N, n), inside the limits."""
    near_singular: bool

    @property
    def length(self) -> float:
        """In m."""
        return float(np.linalg.norm(self.T[-1, :3, 3] - self.T[0, :3, 3]))

    @property
    def switches(self) -> int:
        """How often the branch changes."""
        return int(np.sum(np.abs(np.diff(self.q, axis=0)).max(axis=1) > JUMP))


def branches(arm: Arm, q: Array) -> Branches:
    """Return the solutions for the pose that q, shape (n,), puts the tool at."""
    T = arm.fk(q)
    fit = classify(arm.description).fit
    if fit is None:
        solutions = _searched(arm, T, q)
        names = tuple(f"solution {k}" for k in range(1, len(solutions) + 1))
        return Branches(solutions, names, float(np.abs(arm.fk(solutions) - T).max()), closed_form=False)
    found = arm.ik(T, seed=q)
    solutions = found.q[found.valid]
    names = tuple(name for name, valid in zip(found.branches, found.valid, strict=True) if valid)
    missed = np.abs(arm.fk(solutions) - T)
    if len(fit.met) < 6:
        missed = missed[:, :3, 3]
    return Branches(solutions, names, float(missed.max()) if "x" in fit.met else None, closed_form=True)


def straight_line(arm: Arm) -> Line | None:
    """Return a line that the arm follows without a jump, inside its limits: the first that is found, None if none is.

    It is looked for near the arm's configurations, the longest first; one that comes near a singularity is taken only
    where there is no other.
    """
    second_best = None
    closed_form = classify(arm.description).fit is not None
    for q in _starts(arm):
        for T in _lines(arm, q):
            line = _followed(arm, T, q) if closed_form else _crept(arm, T, q)
            if line is not None and line.switches == 0:
                if not line.near_singular:
                    return line
                second_best = second_best or line
    return second_best


def _starts(arm: Arm) -> Iterator[Array]:
    """Yield joint values inside the limits: named ones, then random ones."""
    numbers = arm.description.numbers
    named = dict(arm.configurations)
    for name in sorted(named, key=lambda name: PREFERRED.index(name) if name in PREFERRED else len(PREFERRED)):
        if np.all((named[name] >= numbers.lower) & (named[name] <= numbers.upper)):
            yield named[name]
    room = np.where(numbers.prismatic, arm.description.reach / 2, np.pi / 2)
    lower, upper = np.maximum(numbers.lower, -room), np.minimum(numbers.upper, room)
    low, high = np.minimum(lower, upper), np.maximum(lower, upper)
    yield from low + (high - low) * np.random.default_rng(0).random((GUESSES, arm.n))


def _lines(arm: Arm, q: Array) -> Iterator[Array]:
    """Yield poses (N, 4, 4) along lines through the tool at q, orientation kept."""
    middle = arm.fk(q)
    for share in SHARES if arm.description.reach else ():
        length = float(f"{share * arm.description.reach:.1g}")
        for way in WAYS:
            T = np.repeat(middle[None], POSES, axis=0)
            T[:, :3, 3] += np.linspace(-length / 2, length / 2, POSES)[:, None] * (np.array(way) / np.linalg.norm(way))
            yield T


def _followed(arm: Arm, T: Array, q: Array) -> Line | None:
    """Return a line followed in closed form, from the branch nearest to q; None where it is not."""
    path = arm.ik_path(T[:1], q)
    path = arm.ik_path(T, q) if path.ok else path
    return Line(T, path.q, bool(path.near_singular)) if path.ok else None


def _crept(arm: Arm, T: Array, q: Array) -> Line | None:
    """Return a line followed by iteration, each pose from the last one, from its middle at q outwards; None if not."""
    half = len(T) // 2
    forth, back = _chain(arm, T[half:], q), _chain(arm, T[:half][::-1], q)
    if forth is None or back is None:
        return None
    return Line(T, np.concatenate([back[::-1], forth]), near_singular=False)


def _chain(arm: Arm, T: Array, q: Array) -> Array | None:
    found = np.empty((len(T), arm.n))
    for k, pose in enumerate(T):
        found[k] = arm.ik_numeric(pose, q, restarts=0).q[0]
        if not np.all(np.abs(found[k] - q) <= JUMP):
            return None
        q = found[k]
    return found


def _searched(arm: Arm, T: Array, q: Array) -> Array:
    """Return some solutions of a pose that are unlike each other, q itself the first, shape (k, n)."""
    numbers = arm.description.numbers
    lower, upper = np.maximum(numbers.lower, -np.pi), np.minimum(numbers.upper, np.pi)
    starts = lower + (upper - lower) * np.random.default_rng(0).random((SEARCHES, arm.n))
    found = arm.ik_numeric(np.broadcast_to(T, (SEARCHES, 4, 4)), starts)
    kept = [q]
    for other in found.q[found.valid]:
        if len(kept) < KEPT and all(np.abs(other - known).max() > APART for known in kept):
            kept.append(other)
    return np.stack(kept)
