"""Score of a program's inverse kinematics, with the first joint that is wrong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.display import listed
from dhkit.execution.process import ProgramError
from dhkit.kinematics import classify
from dhkit.programs.bounds import BOUNDS
from dhkit.programs.caller import LENGTH_UNITS, POSE_TOLERANCE, Caller
from dhkit.programs.check_report import Part, share_within
from dhkit.programs.random_poses import (
    poses_out_of_reach,
    random_states,
    regular_states,
    singular_states,
)
from dhkit.programs.rubric import CheckRubric

_SAME_SOLUTION = 1e-5
"""Largest difference of joint values, rad and m, of one solution; near singular poses they are less exact."""
_MIN_SINGULAR_POSES = 10
"""Smallest number of singular poses, or the number of samples if that is smaller."""
_RANK_TOLERANCE = 1e-9
"""Largest singular value of a Jacobian, m, that counts as zero."""
_UNIT_POSES = 3
"""Number of poses that a program is given in other units of length."""
_OUT_OF_REACH_SHARE = 0.1
"""Number of poses out of reach over that of regular poses."""
SOLUTION_ORDERS = {
    "elbow_wrist": (0, 2, 1),
    "yaw_two": (0, 2, 1),
    "three_parallel": (0, 4, 5, 2, 1, 3),
    "yaw_three": (0, 2, 1, 3),
    "five_joints": (0, 2, 1, 3, 4),
}
"""Indices of joints, from 0, in the order in which they are solved for, by family of arms, where it is not that of the
chain: the third before the second."""


def score_inverse(
    arm: Arm, call: Caller, rubric: CheckRubric, rng: np.random.Generator, samples: int
) -> Iterator[Part]:
    """Score solutions of random poses: regular and singular ones, and some out of reach."""
    points = rubric.points("ik")
    has_closed_form = classify(arm.description).fit is not None
    singular = singular_states(arm, rng, max(min(samples, _MIN_SINGULAR_POSES), samples // 10))
    # Points of parts that this arm does not have are added to those of "closes".
    spare = (0.0 if has_closed_form else points["branches"]) + (
        0.0 if len(singular) else points["singular"]
    )
    judge = _PoseJudge(arm, call, has_closed_form)
    regular = [judge.solve(T) for T in arm.fk(regular_states(arm, rng, samples))]
    seconds = np.median(call.seconds) if call.seconds else np.inf
    unreachable = poses_out_of_reach(arm, rng, max(1, round(_OUT_OF_REACH_SHARE * samples)))
    # None where an unlimited slide reaches everything.
    empty = [judge.returns_nothing(T) for T in unreachable]
    right = [pose.is_right for pose in regular]
    # A program that returns nothing for any pose has not recognised those out of reach.
    share = float(np.mean([*right, *empty])) if any(right) else 0.0
    text = f"{sum(right)} of {len(regular)} poses are met by every solution returned; "
    text += (
        f"{sum(empty)} of {len(empty)} out of reach are empty"
        if len(empty)
        else "none is out of reach"
    )
    worth = points["closes"] + spare
    if not any(right):
        judge.try_units(arm.fk(regular_states(arm, rng, _UNIT_POSES)))
    yield Part("closes", worth * share, worth, text, judge.details())
    if has_closed_form:
        yield _branches_part(regular, points["branches"])
    if len(singular):
        right_singular = [judge.solve(T).is_right for T in arm.fk(singular)]
        text = f"{sum(right_singular)} of {len(right_singular)} singular poses are met"
        yield Part(
            "singular",
            points["singular"] * float(np.mean(right_singular)),
            points["singular"],
            text,
            _singular_example(singular, right_singular),
        )
    limit = rubric.ik.seconds
    share = float(np.mean(right))
    text = (
        f"{1e3 * seconds:.3g} ms a pose; {1e3 * limit:g} ms are asked for"
        if np.isfinite(seconds)
        else "no answer"
    )
    if share < 1:
        text += f"; counts for the {100 * share:.0f} % of the poses that are met"
    yield Part(
        "time", points["time"] * share_within(float(seconds), limit) * share, points["time"], text
    )


def _singular_example(singular: Array, is_right: Sequence[bool]) -> tuple[str, ...]:
    """Return a line with the first singular state whose pose is not met, for a person to try."""
    for q, met in zip(singular, is_right, strict=True):
        if not met:
            return (f"for example the pose fk({listed(q)}) is not met",)
    return ()


@dataclass(frozen=True)
class _SolvedPose:
    """The judgement of a program's solutions of one pose.

    Attributes
    ----------
    is_right
        Whether there is a solution, and every solution leads to the pose.
    branches, missing
        The arm's branches that are among the solutions, and those that are not; empty without a closed form.
    """

    is_right: bool
    branches: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()


class _PoseJudge:
    """Judges a program's solutions pose by pose, and counts its errors.

    Parameters
    ----------
    arm
        The arm.
    call
        The program's inverse kinematics.
    has_closed_form
        Whether the arm has a closed form, so that all its solutions are known.
    """

    def __init__(self, arm: Arm, call: Caller, has_closed_form: bool) -> None:
        self.arm = arm
        self.call = call
        self.has_closed_form = has_closed_form
        self._classification = classify(arm.description)
        self._prismatic = arm.description.numbers.prismatic
        fit = self._classification.fit
        q = random_states(arm, np.random.default_rng(0), 1)[0]
        position_decides = np.linalg.matrix_rank(arm.jacobian(q)[:3], _RANK_TOLERANCE) == arm.n
        self._position_only = (
            fit is not None and set(fit.coordinates) <= {"x", "y", "z"} and bool(position_decides)
        )
        """Whether solutions must meet the position alone, which decides all joints; otherwise the whole pose."""
        self._errors: Counter[str] = Counter()
        self._example = ""
        """A wrong solution, for a person to try."""
        self._unsolved = 0
        """Poses in reach without a solution."""

    def solve(self, T: Array) -> _SolvedPose:
        """Judge the program's solutions of a pose in reach, shape (4, 4), m, world."""
        solutions, is_complete = self._solutions(T)
        truth = self.arm.ik(T) if self.has_closed_form else None
        true_q = np.zeros((0, self.arm.n)) if truth is None else truth.q[truth.valid]
        names = (
            []
            if truth is None
            else [name for name, v in zip(truth.branches, truth.valid, strict=True) if v]
        )
        if solutions is None or not len(solutions):
            self._unsolved += solutions is not None
            return _SolvedPose(False, missing=tuple(names))
        errors = [self._pose_error(q, T) for q in solutions]

        def is_found(row: Array) -> bool:
            return any(self._difference(q, row).max() < _SAME_SOLUTION for q in solutions)

        found = [is_found(row) for row in true_q]
        if max(errors) >= POSE_TOLERANCE:
            worst = solutions[int(np.argmax(errors))]
            self._errors[self._diagnosis(worst, T, true_q)] += 1
            if not self._example:
                pose = f"; fk of {listed(true_q[0])} is the pose" if len(true_q) else ""
                self._example = f"for example {listed(worst)} was returned{pose}"
        return _SolvedPose(
            max(errors) < POSE_TOLERANCE and is_complete,
            tuple(name for name, is_found in zip(names, found, strict=True) if is_found),
            tuple(name for name, is_found in zip(names, found, strict=True) if not is_found),
        )

    def try_units(self, poses: Array) -> None:
        """Note the unit of positions with which a program that meets no pose meets these, shape (N, 4, 4), m."""
        for unit, factor in LENGTH_UNITS.items():
            scale = np.where(self._prismatic, 1 / factor, 1.0)
            scaled = poses.copy()
            scaled[:, :3, 3] *= factor
            answers = [self._solutions(T)[0] for T in scaled]
            if all(
                rows is not None
                and len(rows)
                and self._pose_error(rows[0] * scale, T) < POSE_TOLERANCE
                for rows, T in zip(answers, poses, strict=True)
            ):
                self._errors[
                    f"it meets the poses when their positions are given in {unit}; expected m"
                ] += len(poses)
                return

    def returns_nothing(self, T: Array) -> bool:
        """Return whether the program has no solutions of a pose out of reach, shape (4, 4), m, world."""
        solutions, is_complete = self._solutions(T)
        if solutions is None or not is_complete:
            return False
        if len(solutions):
            self._errors[
                "solutions were returned for poses that are out of reach; expected none"
            ] += 1
        return not len(solutions)

    def details(self) -> tuple[str, ...]:
        """Return the program's errors, the most frequent first, and an example."""
        errors = [
            f"{text} ({count} poses)"
            for text, count in self._errors.most_common(BOUNDS.listed_failures)
        ]
        unsolved = (
            [f"no solution for {self._unsolved} poses that are in reach"] if self._unsolved else []
        )
        return (
            *self.call.failure_texts(),
            *errors,
            *unsolved,
            *([self._example] if self._example else []),
        )

    def _solutions(self, T: Array) -> tuple[Array | None, bool]:
        """Return the finite solutions of a pose, shape (B, n), None if the call failed; and whether all are finite."""
        try:
            rows = self.call(T, self.arm.n)
        except ProgramError:
            return None, True
        finite = np.isfinite(rows).all(axis=1) & (np.abs(rows) < BOUNDS.joint_value).all(axis=1)
        if not finite.all():
            found = f"NaN, infinity or a value above {BOUNDS.joint_value:.0e} was returned"
            self._errors[f"{found}; expected no row where there is no solution"] += 1
        return rows[finite], bool(finite.all())

    def _pose_error(self, q: Array, T: Array) -> float:
        difference = np.abs(self.arm.fk(q) - T)
        position = float(difference[:3, 3].max()) / (self.arm.description.reach or 1.0)
        return position if self._position_only else max(position, float(difference[:3, :3].max()))

    def _difference(self, q: Array, other: Array) -> Array:
        """Return the differences of joint values, shape (n,); those of angles are at most half a turn."""
        d = q - other
        return np.abs(np.where(self._prismatic, d, np.remainder(d + np.pi, 2 * np.pi) - np.pi))

    def _diagnosis(self, q: Array, T: Array, true_q: Array) -> str:
        """Return the fault of a solution: its unit, or the first joint that differs from the nearest branch."""
        if self._pose_error(q * np.where(self._prismatic, 1.0, np.pi / 180), T) < POSE_TOLERANCE:
            return "the angles are in degrees; expected radians"
        if not self.has_closed_form:
            return "the solution does not lead to the pose"
        family_order = SOLUTION_ORDERS.get(self._classification.name, ())
        order = [*family_order, *(i for i in range(self.arm.n) if i not in family_order)]
        differences = np.array([self._difference(q, row) for row in true_q])[:, order]
        first = [int(np.argmax(row > _SAME_SOLUTION)) for row in differences]
        # The branch that the solution agrees with for the most joints, and of those the nearest.
        best = max(range(len(differences)), key=lambda k: (first[k], -float(differences[k].sum())))
        joint = order[first[best]]
        return f"joint {joint + 1} ({self.arm.description.joints[joint].name}) is wrong first"


def _branches_part(regular: Sequence[_SolvedPose], most: float) -> Part:
    """Return the part for the share of branches that are found, with the branches that never are."""
    found = Counter(chain.from_iterable(pose.branches for pose in regular))
    missing = Counter(chain.from_iterable(pose.missing for pose in regular))
    total = found.total() + missing.total()
    share = found.total() / total if total else 0.0
    never_found = (
        tuple(f"never found: {name}" for name in missing if name not in found) if found else ()
    )
    return Part(
        "branches",
        most * share,
        most,
        f"{found.total()} of {total} solutions are found",
        never_found,
    )
