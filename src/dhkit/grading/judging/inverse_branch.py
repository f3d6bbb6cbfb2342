"""One branch of inverse kinematics worked out for many poses, and what goes wrong in it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Tree
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.judging.changed_calls import changed_calls, exchanged, negated
from dhkit.grading.judging.inverse_poses import CLOSES, MATCHES, Mask, Poses
from dhkit.grading.judging.numeric import doubles, names_of
from dhkit.grading.mistakes.library import LIBRARY
from dhkit.grading.report import Verdict

__all__ = ["Branch", "BranchJudgement", "InverseExplanation", "InverseWitness", "joint_order"]

RARE = 0.01
"""Share of poses: solutions that a branch meets less often are met by chance."""
SUBSTANTIAL = 0.3
"""Share of the failing poses: a mistake that explains so many is one, though others are made besides."""
Repair: TypeAlias = Callable[[Array], Array]


@dataclass(frozen=True)
class InverseExplanation:
    """What went wrong in a branch.

    Attributes
    ----------
    mistake
        The identity of a mistake of the library; None where none is found.
    sentence
        What a student learns from it.
    joint
        Which joint's formula is meant, from 0; None where it is the branch.
    """

    mistake: str | None
    sentence: str
    joint: int | None = None


@dataclass(frozen=True)
class InverseWitness:
    """A pose that a branch does not reach.

    Attributes
    ----------
    pose
        Values of :data:`POSE_NAMES`, m.
    answer
        What the formulas give, rad and m; None where they have no value.
    truth
        The solution that is nearest to it, joint after joint.
    """

    pose: Mapping[str, float]
    answer: tuple[float | None, ...]
    truth: tuple[float, ...]


@dataclass(frozen=True)
class BranchJudgement:
    """What is decided of one branch.

    Attributes
    ----------
    verdict
        CORRECT where it closes every pose tried that a solution of this branch reaches, else WRONG.
    closed, poses
        How many poses it closes, of how many that a solution of this branch reaches.
    without_value
        On how many of these it has no value: a root of a negative number, an arc cosine beyond 1.
    joint
        The first joint, from 0, whose value is wrong; None where all are right, or only not exact enough.
    witness
        A pose that it does not close.
    explanations
        What went wrong, the earliest joint first.
    repeats
        Which earlier branch, from 0, gives the same.
    """

    verdict: Verdict
    closed: int
    poses: int
    without_value: int = 0
    joint: int | None = None
    witness: InverseWitness | None = None
    explanations: tuple[InverseExplanation, ...] = ()
    repeats: int | None = None

    @property
    def statement(self) -> str:
        """What was found, in a line."""
        if self.repeats is not None:
            return f"gives the same solutions as branch {self.repeats + 1}"
        said = f"closes {self.closed} of {self.poses} poses"
        share = 100 * self.without_value / max(self.poses, 1)
        return said + (f", has no value on {share:.3g} %" if self.without_value else "")


@dataclass(frozen=True, eq=False)
class Branch:
    """One branch worked out for all poses."""

    poses: Poses
    trees: tuple[Tree, ...]
    repairs: tuple[tuple[int, Repair], ...] = ()
    """What is done to a joint's result before later joints use it."""

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.trees)

    @cached_property
    def order(self) -> tuple[int, ...]:
        """The joints in the order in which their formulas are worked out."""
        return joint_order(self.trees)

    def rank(self, joint: int) -> int:
        """Return when a joint's turn comes."""
        return self.order.index(joint)

    @cached_property
    def q(self) -> Array:
        """What the formulas give, shape (S, n); NaN where they have no value."""
        values, columns = dict(self.poses.values), np.empty((len(self.poses.T), self.n))
        for k in self.order:
            x = np.array(np.broadcast_to(np.asarray(doubles(self.trees[k], values), dtype=float), len(self.poses.T)))
            for joint, repair in self.repairs:
                x = repair(x) if joint == k else x
            x[~np.isfinite(x)] = np.nan
            values[f"q{k + 1}"] = columns[:, k] = x
        return columns

    @cached_property
    def closed(self) -> Mask:
        """Which poses it closes, shape (S,)."""
        return self.poses.closes(self.q)

    @cached_property
    def reachable(self) -> Mask:
        """Which poses it should close, shape (S,): all but those that none of the solutions it follows reaches."""
        solutions = self.poses.solutions
        if not np.any(self.closed) or not solutions.shape[1]:
            return np.ones(len(self.closed), dtype=bool)
        follows = np.mean(self.poses.matches(self.q, solutions)[self.closed], axis=0) > RARE
        if not np.any(follows):
            return np.ones(len(self.closed), dtype=bool)
        reached: Mask = self.closed | np.any(np.isfinite(solutions[:, follows, 0]), axis=1)
        return reached

    @cached_property
    def failing(self) -> Mask:
        """Which poses it should close and does not, shape (S,)."""
        return self.reachable & ~self.closed

    @cached_property
    def agreement(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Of each pose the turn of the first joint that no solution agrees with so far (n: none), and the nearest."""
        truths = self.poses.truths
        alive = np.all(np.isfinite(truths), axis=-1)
        first = np.full(len(truths), self.n)
        nearest = np.argmax(alive, axis=1)
        for turn, k in enumerate(self.order):
            gap = np.where(alive, self.poses.gaps(self.q[:, None, k], truths[..., k], k), np.inf)
            gap = np.where(alive & np.isnan(gap), 1e300, gap)
            going = first == self.n
            nearest = np.where(going, np.argmin(gap, axis=1), nearest)
            lost = going & ~np.any(gap < MATCHES, axis=1)
            first[lost] = turn
            alive = np.where((first == self.n)[:, None], gap < MATCHES, alive)
        return first, nearest

    def wrong_joint(self) -> int | None:
        """Return the first joint that is wrong on some pose that should close."""
        first = self.agreement[0][self.failing]
        turn = int(np.min(first, initial=self.n))
        return self.order[turn] if turn < self.n else None

    def judgement(self) -> BranchJudgement:
        """Return what is decided of it, and why."""
        poses, closed = int(np.sum(self.reachable)), int(np.sum(self.closed & self.reachable))
        if not np.any(self.failing):
            return BranchJudgement(Verdict.CORRECT, closed, poses)
        explanations = tuple(sorted(self.explanations(), key=lambda found: self.rank(found.joint or 0)))
        return BranchJudgement(
            Verdict.WRONG,
            closed,
            poses,
            int(np.sum(self.reachable & np.any(np.isnan(self.q), axis=1))),
            explanations[0].joint,
            self.witness(),
            explanations,
        )

    def witness(self) -> InverseWitness:
        """Return a pose that it does not close, one where it has values if there is one."""
        valued = self.failing & np.all(np.isfinite(self.q), axis=1)
        s = int(np.argmax(valued if np.any(valued) else self.failing))
        pose = {name: float(np.asarray(self.poses.values[name])[s]) for name in POSE_NAMES}
        answer = tuple(float(x) if np.isfinite(x) else None for x in self.q[s])
        return InverseWitness(pose, answer, tuple(self.poses.truths[s, self.agreement[1][s]].tolist()))

    def explanations(self) -> Iterator[InverseExplanation]:
        """Yield what went wrong, each mistake put right before the next is looked for."""
        branch: Branch | None = self
        while branch is not None and np.any(branch.failing):
            joint = branch.wrong_joint()
            if joint is None:
                yield InverseExplanation(None, f"near to a solution, but not to {CLOSES:g}")
                return
            name, joint, branch = branch.repaired(joint)
            said = f"q{joint + 1}: {LIBRARY[name].sentence}" if name else f"q{joint + 1} is the first that is wrong"
            yield InverseExplanation(name, said, joint)

    def repaired(self, joint: int) -> tuple[str | None, int, Branch | None]:
        """Return a mistake, its joint and the branch with it put right, given the first joint that is wrong.

        Rather one that explains all poses than one that only makes the joint right (a wrong value may well be that of
        another solution), and rather that than one that closes a good part of them, next to other mistakes.
        """
        candidates = [
            *(
                (name, earlier, branch)
                for earlier in self.order[: self.rank(joint)]
                for name, branch in self.lost_halves(earlier, joint)
            ),
            *((name, joint, branch) for name, branch in self.candidates(joint)),
        ]
        for candidate in candidates:
            if not np.any(candidate[2].failing):
                return candidate
        for candidate in candidates:
            following = candidate[2].wrong_joint()
            if following is None or self.rank(following) > self.rank(joint):
                return candidate
        best = max(candidates, key=lambda candidate: int(np.sum(candidate[2].closed)))
        gained = int(np.sum(best[2].closed)) - int(np.sum(self.closed))
        return best if gained > SUBSTANTIAL * np.sum(self.failing) else (None, joint, None)

    def lost_halves(self, joint: int, first: int) -> Iterator[tuple[str, Branch]]:
        """Yield what the branch would be if a joint knew the whole turn: atan, asin and acos know one half.

        The wrong half may be the value of another solution, and then a later joint is the first that is wrong.
        """
        wrong = self.failing & (self.agreement[0] == self.rank(first))
        if any(True for _ in changed_calls(self.trees[joint], ("atan", "asin"), negated)):
            yield "quadrant", self.with_repair(joint, lambda x: np.where(wrong, x + np.pi, x))
            yield "quadrant", self.with_repair(joint, lambda x: np.where(wrong, np.pi - x, x))
        if any(True for _ in changed_calls(self.trees[joint], ("acos",), negated)):
            yield "sign_lost", self.with_repair(joint, lambda x: np.where(wrong, -x, x))

    def candidates(self, joint: int) -> Iterator[tuple[str, Branch]]:
        """Yield what the branch would be with each mistake at a joint put right."""
        wrong = self.failing & (self.agreement[0] == self.rank(joint))
        if self.poses.description.numbers.prismatic[joint]:
            yield "millimetres_for_metres", self.with_repair(joint, lambda x: x / 1000)
        else:
            yield "degrees_for_radians", self.with_repair(joint, np.radians)
            for tree in changed_calls(self.trees[joint], ("atan2",), exchanged):
                yield "atan2_arguments", self.with_tree(joint, tree)
        for tree in changed_calls(self.trees[joint], ("sqrt", "acos", "asin"), negated):
            yield "elbow_sign", self.with_tree(joint, tree)
        yield "joint_sign", self.with_repair(joint, np.negative)
        for offset in self.offsets(joint, wrong):
            yield "missing_offset", self.with_repair(joint, _plus(offset))
        if not self.poses.description.numbers.prismatic[joint]:
            yield "supplement", self.with_repair(joint, lambda x: np.pi - x)
            yield "quadrant", self.with_repair(joint, lambda x: np.where(wrong, x + np.pi, x))
            yield "quadrant", self.with_repair(joint, lambda x: np.where(wrong, np.pi - x, x))
        yield "sign_lost", self.with_repair(joint, lambda x: np.where(wrong, -x, x))

    def offsets(self, joint: int, wrong: Mask) -> list[float]:
        """Return by how much a joint may be off, from one pose."""
        wrong = wrong & np.isfinite(self.q[:, joint])
        if not np.any(wrong):
            return []
        s = int(np.argmax(wrong))
        found = self.poses.truths[s, :, joint] - self.q[s, joint]
        return [float(x) for x in found if np.isfinite(x)]

    def with_repair(self, joint: int, repair: Repair) -> Branch:
        """Return the branch with something done to a joint's result."""
        return replace(self, repairs=(*self.repairs, (joint, repair)))

    def with_tree(self, joint: int, tree: Tree) -> Branch:
        """Return the branch with another formula for a joint."""
        return replace(self, trees=(*self.trees[:joint], tree, *self.trees[joint + 1 :]))


def joint_order(branch: Sequence[Tree], where: str = "ik") -> tuple[int, ...]:
    """Return the joints, from 0, in an order in which each formula uses those before it: q2 may be found first.

    Raises
    ------
    AnswerError
        Formulas that need each other.
    """
    needed = [{k for k in range(len(branch)) if f"q{k + 1}" in names_of(tree)} for tree in branch]
    order: list[int] = []
    while len(order) < len(branch):
        ready = [k for k in range(len(branch)) if k not in order and needed[k] <= set(order)]
        if not ready:
            left = ", ".join(f"q{k + 1}" for k in range(len(branch)) if k not in order)
            raise AnswerError(f"{where}: {left} need each other")
        order.append(ready[0])
    return tuple(order)


def _plus(offset: float) -> Repair:
    return lambda x: x + offset
