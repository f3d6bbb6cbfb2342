"""A branch of inverse kinematics, evaluated at many poses: the poses that it solves, and its first wrong joint."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Tree
from dhkit.expressions.trees import names_of
from dhkit.grading.judging.inverse_poses import MATCHES, Mask, Poses
from dhkit.grading.judging.numeric import EditedDoubles, doubles

_CHANCE_SHARE = 0.01
"""Share of poses up to which a branch agrees with a solution by chance."""
MISSED_SHARE = 0.1
"""Share of the failing poses for which Newton's method may have missed a solution."""
Repair: TypeAlias = Callable[[Array], Array]
"""Changes the values of one joint at all poses, shape (S,), rad or m."""


@dataclass(frozen=True, eq=False)
class Branch:
    """A branch evaluated at all poses.

    Attributes
    ----------
    poses
        Poses at which it is tried.
    trees
        Formulas, one for each joint.
    repairs
        Joints, from 0, with changes of their values before later joints use them.
    given_order
        Joints, from 0, in the order in which their formulas are evaluated; by default as the formulas need it.
    judged_joint
        The joint, from 0, whose values alone count, where those of the others are known; by default all count.
    """

    poses: Poses
    trees: tuple[Tree, ...]
    repairs: tuple[tuple[int, Repair], ...] = ()
    given_order: tuple[int, ...] = ()
    judged_joint: int | None = None

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.trees)

    @cached_property
    def order(self) -> tuple[int, ...]:
        """Joints, from 0, in the order in which their formulas are evaluated."""
        return self.given_order or joint_order(self.trees)

    def rank(self, joint: int) -> int:
        """Return the position of a joint in the order."""
        return self.order.index(joint)

    @cached_property
    def q(self) -> Array:
        """Joint values by the formulas, shape (S, n), rad and m; NaN where they have no value."""
        values = dict(self.poses.values)
        columns = np.empty((len(self.poses.T), self.n))
        for k in self.order:
            columns[:, k] = values[f"q{k + 1}"] = self.repaired(k, doubles(self.trees[k], values))
        return columns

    def repaired(self, joint: int, numbers: Array | float) -> Array:
        """Return the values of a joint's formula after its repairs, shape (S,), rad or m; NaN for no value."""
        x = np.array(np.broadcast_to(np.asarray(numbers, dtype=float), len(self.poses.T)))
        for other, repair in self.repairs:
            x = repair(x) if other == joint else x
        x[~np.isfinite(x)] = np.nan
        return x

    def independent(self, joint: int) -> list[int]:
        """Return the joints whose formulas do not depend on a joint's, so that its own may use them."""
        needing = {joint}
        for k in self.order:
            if names_of(self.trees[k]) & {f"q{other + 1}" for other in needing}:
                needing.add(k)
        return [k for k in range(self.n) if k not in needing]

    def editable(self, joint: int) -> EditedDoubles:
        """Return the evaluation of a joint's formula, for trying changes."""
        others = {f"q{k + 1}": self.q[:, k] for k in self.independent(joint)}
        return EditedDoubles(self.trees[joint], {**self.poses.values, **others})

    @cached_property
    def closed(self) -> Mask:
        """Mask (S,) of the poses that this branch solves.

        Where one joint alone counts, those at which its value is that of an exact solution.
        """
        if self.judged_joint is not None:
            return self.agrees(self.judged_joint, self.q[:, self.judged_joint])
        return self.poses.closes(self.q)

    @cached_property
    def reachable(self) -> Mask:
        """Mask (S,) of the poses that this branch must solve.

        They are the poses at which an exact branch that it follows elsewhere has a solution; all of them where one
        joint alone counts, where it solves no pose, or where the exact branches are not known.
        """
        every_pose = np.ones(len(self.closed), dtype=bool)
        solutions = self.poses.solutions
        if self.judged_joint is not None or not np.any(self.closed) or not self.poses.has_closed_form:
            return every_pose
        shares = np.mean(self.poses.matches(self.q, solutions)[self.closed], axis=0)
        follows = shares > _CHANCE_SHARE
        if not np.any(follows):
            return every_pose
        has_solution = np.any(np.isfinite(solutions[:, follows, 0]), axis=1)
        reached: Mask = self.closed | has_solution
        return reached

    @cached_property
    def failing(self) -> Mask:
        """Mask (S,) of the poses that it must solve and does not."""
        return self.reachable & ~self.closed

    @property
    def is_right(self) -> bool:
        """Whether it solves every pose that it must."""
        return not np.any(self.failing)

    @cached_property
    def agreement(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Comparison with the exact solutions, joint by joint in the order of evaluation; shape (S,) each.

        The rank of the first joint that matches no solution which matches all earlier joints, n if there is none; and
        the index of the solution that is nearest at that joint.
        """
        truths = self.poses.truths
        first = np.full(len(truths), self.n)
        nearest = np.argmax(np.all(np.isfinite(truths), axis=-1), axis=1)
        for rank, k in enumerate(self.order):
            alive = self.alive[rank]
            gap = np.where(alive, self.poses.gaps(self.q[:, None, k], truths[..., k], k), np.inf)
            gap = np.where(alive & np.isnan(gap), 1e300, gap)  # a formula without a value is far from any solution

            is_undecided = first == self.n
            nearest = np.where(is_undecided, np.argmin(gap, axis=1), nearest)
            matches_none = ~np.any(gap < MATCHES, axis=1)
            first[is_undecided & matches_none] = rank
        return first, nearest

    @cached_property
    def alive(self) -> list[Mask]:
        """For each joint in order of evaluation, a mask (S, B + 1) of the solutions that match all earlier joints.

        If none matches, it is the previous mask.
        """
        truths = self.poses.truths
        alive = [np.all(np.isfinite(truths), axis=-1)]
        for k in self.order:
            near = alive[-1] & (self.poses.gaps(self.q[:, None, k], truths[..., k], k) < MATCHES)
            alive.append(np.where(np.any(near, axis=1, keepdims=True), near, alive[-1]))
        return alive

    def agrees(self, joint: int, x: Array) -> Mask:
        """Return whether x (S,), rad or m, are values of a joint in solutions that agree with the preceding joints."""
        gap = self.poses.gaps(x[:, None], self.poses.truths[..., joint], joint)
        near: Mask = np.any(self.alive[self.rank(joint)] & (gap < MATCHES), axis=1)
        return near

    def wrong_joint(self) -> int | None:
        """Return the first joint that is wrong at a pose that should be reached; None if all are right.

        Newton's method may have missed solutions: a joint must then be wrong at a good part of the poses.
        """
        ranks = np.sort(self.agreement[0][self.failing])
        if not len(ranks) or not self.poses.isolated:
            return None
        spared = 0 if self.poses.has_closed_form else int(MISSED_SHARE * len(ranks))
        rank = int(ranks[spared])
        return self.order[rank] if rank < self.n else None

    def sample(self, most: int) -> Branch:
        """Return the branch at up to so many poses that it fails to reach, and at up to as many that it reaches."""
        chosen = [*np.flatnonzero(self.failing)[:most], *np.flatnonzero(self.closed)[:most]]
        return replace(self, poses=self.poses.at(chosen), repairs=())

    def with_repair(self, joint: int, repair: Repair) -> Branch:
        """Return the branch with a change of a joint's values."""
        return replace(self, repairs=(*self.repairs, (joint, repair)))

    def with_tree(self, joint: int, tree: Tree) -> Branch:
        """Return the branch with another formula for a joint."""
        return self.with_trees((*self.trees[:joint], tree, *self.trees[joint + 1 :]))

    def with_trees(self, trees: Sequence[Tree]) -> Branch:
        """Return the branch with other formulas."""
        return replace(self, trees=tuple(trees))


def joint_order(branch: Sequence[Tree], where: str = "ik") -> tuple[int, ...]:
    """Return the joints, from 0, in an order in which each formula uses only preceding ones; q2 may come first.

    Raises
    ------
    AnswerError
        Formulas that need each other.
    """
    names = [names_of(tree) for tree in branch]
    needed = [{k for k in range(len(branch)) if f"q{k + 1}" in used} for used in names]
    order: list[int] = []
    while len(order) < len(branch):
        ready = [k for k in range(len(branch)) if k not in order and needed[k] <= set(order)]
        if not ready:
            left = ", ".join(f"q{k + 1}" for k in range(len(branch)) if k not in order)
            raise AnswerError(f"{where}: {left} need each other")
        order.append(ready[0])
    return tuple(order)
