"""Score a program's inverse kinematics, and name the joint that is wrong first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.display import listed
from dhkit.kinematics import classify
from dhkit.programs.caller import CLOSE, EXAMPLES, Caller
from dhkit.programs.process import ProgramError
from dhkit.programs.random_poses import poses_out_of_reach, random_states, regular_states, singular_states
from dhkit.programs.report import Part, share_within
from dhkit.programs.rubric import CheckRubric

SAME = 1e-5
"""rad and m between joint values that count as one solution; near singular poses they are less exact than the pose."""
FEWEST = 10
"""Singular poses, where there are as many samples."""
LARGEST = 1e6
"""rad and m of a solution."""
RANK = 1e-9
"""Singular values of a Jacobian, m, that are zero."""
STRANGERS = 0.1
"""Share of the poses that are out of reach."""
ORDERS = {"axes 2 and 3 parallel": (0, 2, 1), "axes 2, 3 and 4 parallel": (0, 4, 5, 2, 1, 3)}
"""In which order joints are solved for, where it is not theirs, by what the axes are like: q2 follows from q3."""


def score_inverse(
    arm: Arm, call: Caller, rubric: CheckRubric, rng: np.random.Generator, samples: int
) -> Iterator[Part]:
    """Score solutions of random poses: regular and singular ones, and some out of reach."""
    points = rubric.points("ik")
    closed = classify(arm.description).fit is not None
    singular = singular_states(arm, rng, max(min(samples, FEWEST), samples // 10))
    # Points of what this arm has not go to what it has.
    spare = (0.0 if closed else points["branches"]) + (0.0 if len(singular) else points["singular"])
    judge = _Poses(arm, call, closed)
    regular = [judge.reached(T) for T in arm.fk(regular_states(arm, rng, samples))]
    seconds = np.median(call.seconds) if call.seconds else np.inf
    far = poses_out_of_reach(arm, rng, max(1, round(STRANGERS * samples)))
    empty = [judge.empty(T) for T in far]  # none where an unlimited slide reaches everything
    # Who returns nothing for any pose has not recognised those out of reach.
    share = float(np.mean([*(bool(found) for found in regular), *empty])) if any(regular) else 0.0
    text = f"{sum(map(bool, regular))} of {len(regular)} poses are met by every solution returned; "
    text += f"{sum(empty)} of {len(empty)} out of reach are empty" if len(empty) else "none is out of reach"
    yield Part("closes", (points["closes"] + spare) * share, points["closes"] + spare, text, judge.details())
    if closed:
        yield _branches(judge, regular, points["branches"])
    if len(singular):
        at = [judge.reached(T) for T in arm.fk(singular)]
        share_at = float(np.mean([bool(found) for found in at]))
        said = f"{sum(map(bool, at))} of {len(at)} singular poses are met"
        yield Part("singular", points["singular"] * share_at, points["singular"], said)
    limit = rubric.ik.seconds
    quick = share_within(float(seconds), limit)
    met = float(np.mean([bool(found) for found in regular]))
    said = f"{1e3 * seconds:.3g} ms a pose; {1e3 * limit:g} ms are asked for" if np.isfinite(seconds) else "no answer"
    if met < 1:
        said += f"; counts for the {100 * met:.0f} % of the poses that are met"
    yield Part("time", points["time"] * quick * met, points["time"], said)


@dataclass
class Found:
    """The solutions of a pose: how many of the arm's branches they are."""

    right: bool
    branches: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return self.right


class _Poses:
    """Judges solutions pose by pose, and counts how they fail."""

    def __init__(self, arm: Arm, call: Caller, closed: bool) -> None:
        self.arm, self.call, self.closed = arm, call, closed
        fit = classify(arm.description).fit
        q = random_states(arm, np.random.default_rng(0), 1)[0]
        decides = np.linalg.matrix_rank(arm.jacobian(q)[:3], RANK) == arm.n
        self._position_alone = fit is not None and set(fit.met) <= {"x", "y", "z"} and bool(decides)
        """Whether the arm's solutions are those of a position, which decides all joints; else they are of a pose."""
        self._incomplete = False
        """Whether the last answer had NaN, infinity or enormous numbers."""
        self.wrong: Counter[str] = Counter()
        self.example = ""
        """A solution that is wrong, for a person to try."""
        self.none = 0

    def reached(self, T: Array) -> Found:
        """Return whether a pose is met by at least one solution, and by every one returned."""
        rows = self._rows(T)
        names: tuple[str, ...] = ()
        missing: tuple[str, ...] = ()
        if self.closed:
            truth = self.arm.ik(T)
            exists = [k for k in range(len(truth.branches)) if truth.valid[k]]
            missing = tuple(truth.branches[k] for k in exists)
        if rows is None:
            return Found(False, names, missing)
        incomplete = self._incomplete
        if not len(rows):
            self.none += 1
            return Found(False, names, missing)
        errors = [self._error(q, T) for q in rows]
        if self.closed:
            near = [[k for k in exists if self._apart(q, truth.q[k]).max() < SAME] for q in rows]
            hit = {k for found in near for k in found}
            names = tuple(truth.branches[k] for k in sorted(hit))
            missing = tuple(truth.branches[k] for k in exists if k not in hit)
        right = all(error < CLOSE for error in errors) and not incomplete
        worst = rows[int(np.argmax(errors))]
        if max(errors) >= CLOSE:
            self._diagnose(worst, T)
            if not self.example:
                q = truth.q[truth.valid][0] if self.closed and truth.valid.any() else None
                pose = "" if q is None else f"; fk of {listed(q)} is the pose"
                self.example = f"for example {listed(worst)} was returned{pose}"
        return Found(right, names, missing)

    def empty(self, T: Array) -> bool:
        """Return whether nothing is returned for a pose out of reach."""
        rows = self._rows(T)
        if rows is not None and self._incomplete:
            return False
        if rows is not None and len(rows):
            self.wrong["solutions were returned for poses that are out of reach; expected none"] += 1
        return rows is not None and not len(rows)

    def details(self) -> tuple[str, ...]:
        """Return how it failed, the most frequent first."""
        none = (f"no solution for {self.none} poses that are in reach",) if self.none else ()
        wrong = tuple(f"{text} ({count} poses)" for text, count in self.wrong.most_common(EXAMPLES))
        return (*self.call.said(), *wrong, *none, *((self.example,) if self.example else ()))

    def _rows(self, T: Array) -> Array | None:
        """Return the solutions of a pose, shape (B, n); None where the function failed."""
        try:
            rows = self.call(T, self.arm.n)
        except ProgramError:
            return None
        finite = np.isfinite(rows).all(axis=1) & (np.abs(rows) < LARGEST).all(axis=1)
        self._incomplete = not finite.all()
        if not finite.all():
            self.wrong["NaN or infinity was returned; expected no row where there is no solution"] += 1
        return rows[finite]

    def _error(self, q: Array, T: Array) -> float:
        found = np.abs(self.arm.fk(q) - T)
        position = float(found[:3, 3].max()) / (self.arm.description.reach or 1.0)
        return position if self._position_alone else max(position, float(found[:3, :3].max()))

    def _apart(self, q: Array, other: Array) -> Array:
        """Return by how much joint values differ, angles by less than half a turn."""
        d = q - other
        return np.abs(np.where(self.arm.description.numbers.prismatic, d, np.remainder(d + np.pi, 2 * np.pi) - np.pi))

    def _diagnose(self, q: Array, T: Array) -> None:
        """Count what is wrong with a solution: its unit, or the first joint that differs from the nearest branch."""
        scale = np.where(self.arm.description.numbers.prismatic, 1.0, np.pi / 180)
        if self._error(q * scale, T) < CLOSE:
            self.wrong["the angles are in degrees; expected radians"] += 1
            return
        if not self.closed:
            self.wrong["the solution does not lead to the pose"] += 1
            return
        truth = self.arm.ik(T)
        order = self._order()
        apart = np.array([self._apart(q, row) for row in truth.q[truth.valid]])[:, order]
        first = [int(np.argmax(row > SAME)) for row in apart]
        # The branch that the solution follows longest, and of those the nearest.
        best = max(range(len(apart)), key=lambda k: (first[k], -float(apart[k].sum())))
        joint = order[first[best]]
        name = self.arm.description.joints[joint].name
        self.wrong[f"joint {joint + 1} ({name}) is wrong first"] += 1

    def _order(self) -> list[int]:
        """Return the joints in the order in which they are solved for."""
        fit = classify(self.arm.description).fit
        words = "" if fit is None else fit.words
        order = next((known for text, known in ORDERS.items() if text in words), ())
        return [*order, *(i for i in range(self.arm.n) if i not in order)]


def _branches(judge: _Poses, regular: Sequence[Found], most: float) -> Part:
    """Return the share of branches that are found, and which never are."""
    found = Counter(name for pose in regular for name in pose.branches)
    missing = Counter(name for pose in regular for name in pose.missing)
    total = found.total() + missing.total()
    share = found.total() / total if total else 0.0
    never = tuple(f"never found: {name}" for name in missing if name not in found)
    return Part(
        "branches", most * share, most, f"{found.total()} of {total} solutions are found", never if found else ()
    )
