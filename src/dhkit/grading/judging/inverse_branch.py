"""A branch of inverse kinematics, evaluated at many poses: the poses that it solves, and its first wrong joint."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Tree
from dhkit.expressions.trees import names_of
from dhkit.grading.judging.inverse_poses import MATCHES, Mask, Poses
from dhkit.grading.judging.numeric import EditedDoubles, doubles

_CHANCE_SHARE = 0.01
"""Largest share of poses at which a branch may agree with an exact branch by chance, without following it."""
MISSED_SHARE = 0.1
"""Largest share of poses at which Newton's method may have missed a solution of an arm without a closed form."""
_NO_VALUE_GAP = 1e300
"""Distance, rad or relative to the reach, of a formula without a value from a solution: larger than any other."""
Repair: TypeAlias = Callable[[Array], Array]
"""Function that returns corrected values of one joint at all poses, from shape (S,) to shape (S,), rad or m."""


class Agreement(NamedTuple):
    """Comparison of a branch with the exact solutions, joint by joint in the order of evaluation."""

    first_wrong: NDArray[np.intp]
    """Rank in the order of evaluation of the first joint that matches no solution which matches all earlier joints,
    shape (S,); n if there is no such joint."""
    nearest: NDArray[np.intp]
    """Index of the solution that is nearest at that joint, or at the last one, shape (S,)."""


@dataclass(frozen=True, eq=False)
class Branch:
    """A branch evaluated at all poses.

    Shapes: S poses, n joints, and B exact branches of the closed form.

    Attributes
    ----------
    poses
        Poses at which the branch is tried.
    trees
        Formulas, one for each joint.
    repairs
        Joints, from 0, with corrections of their values, made before later joints use them.
    given_order
        Joints, from 0, in the order in which their formulas are evaluated; by default as the formulas need it.
    judged_joint
        The only joint, from 0, whose values are judged, while those of the others are known; by default all are judged.
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
        for repaired_joint, repair in self.repairs:
            if repaired_joint == joint:
                x = repair(x)
        x[~np.isfinite(x)] = np.nan
        return x

    def independent(self, joint: int) -> list[int]:
        """Return the joints, from 0, whose formulas do not depend on a joint's value: its own formula may use them."""
        dependent = {joint}
        for k in self.order:
            if names_of(self.trees[k]) & {f"q{other + 1}" for other in dependent}:
                dependent.add(k)
        return [k for k in range(self.n) if k not in dependent]

    def editable(self, joint: int) -> EditedDoubles:
        """Return the evaluation of a joint's formula, for trying changes."""
        others = {f"q{k + 1}": self.q[:, k] for k in self.independent(joint)}
        return EditedDoubles(self.trees[joint], {**self.poses.values, **others})

    @cached_property
    def closed(self) -> Mask:
        """Mask (S,) of the poses that this branch solves.

        If a single joint is judged, they are the poses at which its value is that of an exact solution.
        """
        if self.judged_joint is not None:
            return self.agrees(self.judged_joint, self.q[:, self.judged_joint])
        return self.poses.closes(self.q)

    @cached_property
    def reachable(self) -> Mask:
        """Mask (S,) of the poses that this branch must solve.

        They are the poses at which an exact branch that it follows elsewhere has a solution. They are all poses if a
        single joint is judged, if the branch solves no pose, or if the exact branches are not known.
        """
        every_pose = np.ones(len(self.closed), dtype=bool)
        solutions = self.poses.solutions
        if (
            self.judged_joint is not None
            or not np.any(self.closed)
            or not self.poses.has_closed_form
        ):
            return every_pose

        # Share of the solved poses at which each exact branch has the joint values of this one, shape (B,).
        matches = self.poses.matches(self.q, solutions)[self.closed]
        shares = np.mean(matches, axis=0)
        follows = shares > _CHANCE_SHARE
        if not np.any(follows):
            return every_pose

        has_solution = np.any(np.isfinite(solutions[:, follows, 0]), axis=1)
        reached: Mask = self.closed | has_solution
        return reached

    @cached_property
    def failing(self) -> Mask:
        """Mask (S,) of the poses that this branch must solve and does not."""
        return self.reachable & ~self.closed

    @property
    def is_right(self) -> bool:
        """Whether this branch solves every pose that it must."""
        return not np.any(self.failing)

    @cached_property
    def agreement(self) -> Agreement:
        """Comparison with the exact solutions, joint by joint in the order of evaluation."""
        truths = self.poses.truths
        first_wrong = np.full(len(truths), self.n)
        nearest = np.argmax(np.all(np.isfinite(truths), axis=-1), axis=1)
        for rank, k in enumerate(self.order):
            # Distances of this joint's values from those of the solutions that match all earlier joints.
            alive = self.alive[rank]
            gap = np.where(alive, self.poses.gaps(self.q[:, None, k], truths[..., k], k), np.inf)
            gap = np.where(alive & np.isnan(gap), _NO_VALUE_GAP, gap)

            is_undecided = first_wrong == self.n
            nearest = np.where(is_undecided, np.argmin(gap, axis=1), nearest)
            matches_none = ~np.any(gap < MATCHES, axis=1)
            first_wrong[is_undecided & matches_none] = rank
        return Agreement(first_wrong, nearest)

    @cached_property
    def alive(self) -> list[Mask]:
        """For each joint in order of evaluation, a mask (S, B + 1) of the solutions that match all earlier joints.

        If none matches, it is the previous mask.
        """
        truths = self.poses.truths
        alive = [np.all(np.isfinite(truths), axis=-1)]
        for k in self.order:
            earlier = alive[-1]
            gaps = self.poses.gaps(self.q[:, None, k], truths[..., k], k)
            near = earlier & (gaps < MATCHES)
            alive.append(np.where(np.any(near, axis=1, keepdims=True), near, earlier))
        return alive

    def agrees(self, joint: int, x: Array) -> Mask:
        """Return a mask (S,) of the poses at which x (S,), rad or m, is a joint's value in a matching exact solution.

        Only the solutions that match all joints before this one in the order of evaluation are compared.
        """
        gap = self.poses.gaps(x[:, None], self.poses.truths[..., joint], joint)
        near: Mask = np.any(self.alive[self.rank(joint)] & (gap < MATCHES), axis=1)
        return near

    def wrong_joint(self) -> int | None:
        """Return the first joint, from 0, that is wrong at a pose that the branch must solve; None if all are right.

        Without a closed form Newton's method may have missed solutions: the joint must then be wrong at more than
        ``MISSED_SHARE`` of the failing poses.
        """
        ranks = np.sort(self.agreement.first_wrong[self.failing])
        if not len(ranks) or not self.poses.isolated:
            return None
        disregarded = 0 if self.poses.has_closed_form else int(MISSED_SHARE * len(ranks))
        rank = int(ranks[disregarded])
        return self.order[rank] if rank < self.n else None

    def sample(self, most: int) -> Branch:
        """Return the branch at up to ``most`` poses that it fails to solve and up to ``most`` that it solves."""
        chosen = [*np.flatnonzero(self.failing)[:most], *np.flatnonzero(self.closed)[:most]]
        return replace(self, poses=self.poses.at(chosen), repairs=())

    def with_repair(self, joint: int, repair: Repair) -> Branch:
        """Return the branch with a further correction of a joint's values."""
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
    n = len(branch)
    needed: list[set[int]] = []
    for tree in branch:
        names = names_of(tree)
        needed.append({k for k in range(n) if f"q{k + 1}" in names})

    order: list[int] = []
    while len(order) < n:
        left = [k for k in range(n) if k not in order]
        ready = [k for k in left if needed[k] <= set(order)]
        if not ready:
            raise AnswerError(f"{where}: {', '.join(f'q{k + 1}' for k in left)} need each other")
        order.append(ready[0])
    return tuple(order)
