"""Which mistakes explain a branch of inverse kinematics that does not reach the poses asked for.

The best explanation is a single local change of the formula that is wrong first which makes the whole branch right;
then one in a formula before it, or of the same part in several formulas; then a sign or a quadrant that is lost for
some poses. A joint is never blamed whose value agrees with a solution, given the joints before it. The search is
bounded by counted changes, never by time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain

import numpy as np

from dhkit.description import Array, Description
from dhkit.expressions.syntax import Call, Name, Number, Sum, Tree
from dhkit.grading.judging.changed_formulas import (
    equal_parts,
    has_call,
    minus,
    renamed,
    replaced_everywhere,
    with_calls_changed,
)
from dhkit.grading.judging.inverse_branch import Branch
from dhkit.grading.judging.inverse_edits import Edit, Lengths, edits, renamings
from dhkit.grading.judging.inverse_poses import Mask
from dhkit.grading.judging.numeric import parts_of

MOST_POSES = 100
"""Poses that fail, and poses that close, on which mistakes are looked for."""
MOST_WORK = 4_000_000
"""Changes that are worked out for one answer, each times the parts of its formula: a few seconds' work at most."""
MOST_PARTS = 1_000
"""Parts of a formula, at most, in which mistakes are looked for: a PUMA's longest has 200."""
AGREEING = 0.5
"""Share of the poses: a change whose values are a solution's less often is not followed further."""
SUBSTANTIAL = 0.3
"""Share of the failing poses: a mistake that explains so many is one, though others are made besides."""
FREQUENT = frozenset(
    ("atan2_arguments", "quadrant", "elbow_sign", "degrees_for_radians", "millimetres_for_metres", "joint_sign")
)
"""Mistakes that are named where they explain a good part of the poses alone."""


ARCS: Mapping[str, tuple[str, Callable[[Call], Tree]]] = {
    "acos": ("sign_lost", minus),
    "asin": ("quadrant", lambda call: Sum(((True, Name("pi", 0)), (False, call)))),
    "atan": ("quadrant", lambda call: Sum(((True, Name("pi", 0)), (True, call)))),
}
"""What functions that know half a turn lose, and their value in the other half."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """A mistake in a branch.

    Attributes
    ----------
    mistake
        The identity of a mistake of the library; None where none is found.
    joint
        Whose formula is meant, from 0; None where it is several formulas, or none in particular.
    repaired
        The branch with the mistake put right; None where there is none.
    is_near
        Whether all joint values are near to a solution, but the tool is not near enough to the pose.
    """

    mistake: str | None
    joint: int | None
    repaired: Branch | None = None
    is_near: bool = False


class Search:
    """The search for mistakes in the branches of one answer.

    Parameters
    ----------
    description
        The robot.
    """

    def __init__(self, description: Description) -> None:
        self.revolute = [kind == "R" for kind in description.kinds]
        self.lengths = lengths_of(description)
        self.left = MOST_WORK

    def explanations(self, branch: Branch) -> Iterator[Explanation]:
        """Yield what went wrong, each mistake put right before the next is looked for."""
        current: Branch | None = branch.sample(MOST_POSES)
        while current is not None and not current.is_right:
            joint = current.wrong_joint()
            found = self._anywhere(current) if joint is None else self._explained(current, joint)
            yield found
            current = found.repaired

    def _anywhere(self, branch: Branch) -> Explanation:
        """Return a change that makes a branch right whose wrong joint is not known."""
        for joint in branch.order if not branch.poses.isolated else ():
            for edit in self._edits(branch, joint):
                repaired = branch.with_tree(joint, edit.tree)
                if repaired.is_right:
                    return Explanation(edit.mistake, joint, repaired)
        return Explanation(None, None, is_near=branch.poses.isolated)

    def _explained(self, branch: Branch, joint: int) -> Explanation:
        """Return a mistake, given the first joint that is wrong."""
        here = self._agreeing(branch, joint)
        candidates = [Explanation(edit.mistake, joint, branch.with_tree(joint, edit.tree)) for edit in here]
        halves = [
            Explanation(mistake, other, repaired)
            for other in branch.order[: branch.rank(joint) + 1]
            for mistake, repaired in _lost_halves(branch, other, joint)
        ]
        for found in chain(candidates, self._before(branch, joint), self._in_several(branch, here), halves):
            if found.repaired is not None and found.repaired.is_right:
                return found
        for found in (*candidates, *halves):
            following = found.repaired.wrong_joint() if found.repaired is not None else joint
            if following is None or branch.rank(following) > branch.rank(joint):
                return found
        frequent = [
            Explanation(edit.mistake, joint, branch.with_tree(joint, edit.tree))
            for edit in self._edits(branch, joint)
            if edit.mistake in FREQUENT
        ]
        best = max((*frequent, *halves), key=_count_of_closed, default=Explanation(None, joint))
        gained = _count_of_closed(best) - int(np.sum(branch.closed))
        return best if gained > SUBSTANTIAL * np.sum(branch.failing) else Explanation(None, joint)

    def _edits(self, branch: Branch, joint: int) -> list[Edit]:
        """Return the changes of a joint's formula, as many as are left to try."""
        same_kind = [k for k in branch.independent(joint) if self.revolute[k] is self.revolute[joint]]
        offsets = _offsets(branch, joint)
        names = [f"q{k + 1}" for k in same_kind]
        tree = branch.trees[joint]
        size = sum(1 for _ in parts_of(tree))
        if size > MOST_PARTS:
            return []
        found = edits(tree, self.revolute[joint], names, offsets, self.lengths)[: self.left // size]
        self.left -= len(found) * size
        return found

    def _agreeing(self, branch: Branch, joint: int) -> list[Edit]:
        """Return the changes of a joint's formula that give values of a solution where the branch should close."""
        formula, found = branch.editable(joint), list[Edit]()
        asked = branch.reachable
        tree = branch.trees[joint]
        equal = equal_parts([tree])
        for edit in self._edits(branch, joint):
            trees = [edit.tree]
            if len(equal[id(edit.old)]) > 1:
                trees.append(replaced_everywhere(tree, equal[id(edit.old)], edit.new))
            for changed in trees:
                x = branch.repaired(joint, formula.of(changed))
                if np.mean(branch.agrees(joint, x)[asked]) >= AGREEING:
                    found.append(replace(edit, tree=changed))
                    break
        return found

    def _before(self, branch: Branch, joint: int) -> Iterator[Explanation]:
        """Yield changes of formulas before the first wrong joint: their values may be those of another solution."""
        for other in branch.order[: branch.rank(joint)]:
            for edit in self._agreeing(branch, other):
                yield Explanation(edit.mistake, other, branch.with_tree(other, edit.tree))

    def _in_several(self, branch: Branch, agreeing: list[Edit]) -> Iterator[Explanation]:
        """Yield changes of the same part, or of the same names, in several formulas."""
        size = sum(1 for tree in branch.trees for _ in parts_of(tree))
        if size > MOST_PARTS * branch.n:
            return
        equal = equal_parts(branch.trees)
        for edit in agreeing:
            trees = [replaced_everywhere(tree, equal[id(edit.old)], edit.new) for tree in branch.trees]
            if sum(new is not old for new, old in zip(trees, branch.trees, strict=True)) > 1:
                yield Explanation(edit.mistake, None, branch.with_trees(trees))
        for mistake, change in renamings(branch.trees, self.lengths):
            trees = [renamed(tree, change) for tree in branch.trees]
            if self.left > size and sum(new is not old for new, old in zip(trees, branch.trees, strict=True)) > 1:
                self.left -= size
                yield Explanation(mistake, None, branch.with_trees(trees))


def lengths_of(description: Description) -> Lengths:
    """Return what formulas for a robot may hold as lengths."""
    parameters = tuple(description.parameters)
    numbers, values = description.numbers, description.numbers.values
    known = [*numbers.d, *numbers.a, *numbers.T_world_base[:3, 3], *numbers.T_last_tool[:3, 3]]
    found: list[Name | Number] = [Name(name, 0) for name in parameters]
    seen = {round(abs(float(values[name])), 12) for name in parameters} | {0.0}
    for length in known:
        size = round(abs(float(length)), 12)
        if size not in seen:
            seen.add(size)
            found.append(Number(Fraction(str(size)), str(size), 0))
    return Lengths(parameters, tuple(found))


def _count_of_closed(found: Explanation) -> int:
    return int(np.sum(found.repaired.closed)) if found.repaired is not None else 0


def _wrong(branch: Branch, joint: int) -> Mask:
    """Return on which poses a joint is the first that is wrong."""
    wrong: Mask = branch.failing & (branch.agreement[0] == branch.rank(joint))
    return wrong


def _offsets(branch: Branch, joint: int) -> list[float]:
    """Return by how much a joint may be off, from the first pose where it is wrong."""
    wrong = _wrong(branch, joint) & np.isfinite(branch.q[:, joint])
    if not np.any(wrong):
        return []
    s = int(np.argmax(wrong))
    alive = branch.alive[branch.rank(joint)][s]
    return [float(x) for x in np.unique((branch.poses.truths[s, alive, joint] - branch.q[s, joint]).round(12))]


def _with_part_repaired(branch: Branch, joint: int, wrong: Mask, changed: Tree) -> Branch:
    """Return the branch whose joint has the values of a changed formula on some poses, shape (S,)."""
    values = branch.repaired(joint, branch.editable(joint).of(changed))
    return branch.with_repair(joint, lambda x: np.where(wrong, values, x))


def _lost_halves(branch: Branch, joint: int, first: int) -> list[tuple[str, Branch]]:
    """Return what the branch would be if a joint knew the whole turn: atan, asin and acos know one half.

    The wrong half may be the value of another solution, and then a later joint is the first that is wrong.
    """
    wrong, tree = _wrong(branch, first), branch.trees[joint]
    revolute = branch.poses.description.kinds[joint] == "R"
    own = joint == first

    def where_wrong(change: Array) -> Array:
        return np.where(wrong, change, 0.0)

    found = []
    if revolute and (own or has_call(tree, ("atan", "asin"))):
        found.append(("quadrant", branch.with_repair(joint, lambda x: x + where_wrong(np.full_like(x, np.pi)))))
        found.append(("quadrant", branch.with_repair(joint, lambda x: x + where_wrong(np.pi - 2 * x))))
    if own or has_call(tree, ("acos",)):
        found.append(("sign_lost", branch.with_repair(joint, lambda x: x - where_wrong(2 * x))))
    arcs = [function for function in ARCS if has_call(tree, (function,))]
    if own and len(arcs) == 1 and not isinstance(tree, Call):
        mistake, change = ARCS[arcs[0]]
        changed = with_calls_changed(tree, arcs, change)
        found.append((mistake, _with_part_repaired(branch, joint, wrong, changed)))
    # Both may give a solution: what the formula's own function does not know is meant.
    return found[::-1] if has_call(tree, ("acos",)) and not has_call(tree, ("atan", "asin")) else found
