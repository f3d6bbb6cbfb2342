"""Search for the mistakes in a branch of inverse kinematics that does not reach the requested poses.

The best explanation is a single local change of the first wrong formula that makes the whole branch right; then one of
a preceding formula, or of the same part in several formulas; then a sign or quadrant that is lost at some poses. A
joint whose value agrees with a solution, given the preceding joints, is never blamed. The search is bounded by counted
changes, never by time.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain

import numpy as np

from dhkit.description import Array, Description
from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Call, Name, Number, Sum, Tree
from dhkit.expressions.trees import equal_parts, names_of, parts_of, replaced_everywhere
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.grading.judging.changed_formulas import has_call, is_joint, minus, renamed, with_calls_changed
from dhkit.grading.judging.inverse_branch import Branch
from dhkit.grading.judging.inverse_edits import ORDER, Edit, Lengths, edits, renamings
from dhkit.grading.judging.inverse_poses import Mask

_MIN_AGREEING_SHARE = 0.5
"""Share of the poses at which the values of a change must be a solution's for the change to be followed further."""
_MIN_EXPLAINED_SHARE = 0.3
"""Share of the failing poses that a mistake must explain to be named, though others are made besides."""
_FREQUENT = frozenset(
    ("atan2_arguments", "quadrant", "elbow_sign", "degrees_for_radians", "millimetres_for_metres", "joint_sign")
)
"""Mistakes that are named if they explain a good part of the poses by themselves."""


_ARCS: Mapping[str, tuple[str, Callable[[Call], Tree]]] = {
    "acos": ("sign_lost", minus),
    "asin": ("quadrant", lambda call: Sum(((True, Name("pi", 0)), (False, call)))),
    "atan": ("quadrant", lambda call: Sum(((True, Name("pi", 0)), (True, call)))),
}
"""By function whose values cover half a turn: the mistake of using it, and its value in the other half."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """A mistake in a branch.

    Attributes
    ----------
    mistake
        Identity of a mistake of the library; None if none is known.
    joint
        Joint of the wrong formula, from 0; None for several formulas, or none in particular.
    repaired
        The branch with the mistake corrected; None without a mistake.
    is_near
        Whether all joint values are near a solution, but the tool is not near enough to the pose.
    """

    mistake: str | None
    joint: int | None
    repaired: Branch | None = None
    is_near: bool = False


class Search:
    """Search for mistakes in the branches of one answer.

    Parameters
    ----------
    description
        The robot.
    lengths
        Lengths that formulas may contain; those of :func:`lengths_of` unless given.
    """

    def __init__(self, description: Description, lengths: Lengths | None = None) -> None:
        self.revolute = [kind == "R" for kind in description.kinds]
        self.lengths = lengths or lengths_of(description)
        self.left = BOUNDS.edit_work
        self.made: dict[int, set[str]] = {}
        """Mistakes that were found in each joint's formula of the branches so far."""

    def explanations(self, branch: Branch) -> Iterator[Explanation]:
        """Yield the mistakes of a branch; each is corrected before the next is looked for."""
        current: Branch | None = branch.sample(BOUNDS.edit_poses)
        while current is not None and not current.is_right:
            joint = current.wrong_joint()
            explanation = self._explain_anywhere(current) if joint is None else self._explain(current, joint)
            if explanation.mistake is not None and explanation.joint is not None:
                self.made.setdefault(explanation.joint, set()).add(explanation.mistake)
            yield explanation
            current = explanation.repaired

    def _explain_anywhere(self, branch: Branch) -> Explanation:
        """Return a change that makes a branch with an unknown wrong joint right."""
        for joint in branch.order if not branch.poses.isolated else ():
            for edit in self._edits(branch, joint):
                repaired = branch.with_tree(joint, edit.tree)
                if not names_of(edit.tree) - names_of(branch.trees[joint]) and repaired.is_right:
                    return Explanation(edit.mistake, joint, repaired)
        return Explanation(None, None, is_near=branch.poses.isolated)

    def _explain(self, branch: Branch, joint: int) -> Explanation:
        """Return the mistake of a branch with a known first wrong joint."""

        def leads_on(candidate: Explanation) -> bool:
            following = candidate.repaired.wrong_joint() if candidate.repaired is not None else joint
            return following is None or branch.rank(following) > branch.rank(joint)

        # Branches of one sheet have the same mistakes: those of an earlier branch are tried before all others.
        again = self._agreeing_edits(branch, joint, self.made.get(joint, set()))
        if known := next(filter(leads_on, (_edited(branch, joint, edit) for edit in again)), None):
            return known
        here = self._agreeing_edits(branch, joint)
        candidates = [_edited(branch, joint, edit) for edit in here]
        partial = next(filter(leads_on, candidates), None)
        halves = [
            Explanation(mistake, other, repaired)
            for other in branch.order[: branch.rank(joint) + 1]
            for mistake, repaired in _lost_halves(branch, other, joint)
        ]
        # Where a change of this formula makes its values right, those of the formulas before it are.
        earlier = self._explain_earlier(branch, joint) if partial is None else iter(())
        others = chain(earlier, self._explain_several(branch, here))
        for candidate in chain(candidates, others, halves):
            if candidate.repaired is not None and candidate.repaired.is_right:
                return candidate
        if found := partial or next(filter(leads_on, halves), None):
            return found
        frequent = [_edited(branch, joint, edit) for edit in self._edits(branch, joint) if edit.mistake in _FREQUENT]
        best = max((*frequent, *halves), key=_count_of_closed, default=Explanation(None, joint))
        gained = _count_of_closed(best) - int(np.sum(branch.closed))
        return best if gained > _MIN_EXPLAINED_SHARE * np.sum(branch.failing) else Explanation(None, joint)

    def _edits(self, branch: Branch, joint: int, mistakes: Collection[str] = ORDER) -> list[Edit]:
        """Return the changes of a joint's formula, all or of some mistakes, as many as the bound on the work leaves."""
        same_kind = [k for k in branch.independent(joint) if self.revolute[k] is self.revolute[joint]]
        offsets = _offsets(branch, joint)
        names = [f"q{k + 1}" for k in same_kind]
        tree = branch.trees[joint]
        size = sum(1 for _ in parts_of(tree))
        if size > BOUNDS.edited_nodes:
            return []
        changes = edits(tree, self.revolute[joint], names, offsets, self.lengths, mistakes)
        changes = changes[: self.left // size]
        self.left -= len(changes) * size
        return changes

    def _agreeing_edits(self, branch: Branch, joint: int, mistakes: Collection[str] = ORDER) -> list[Edit]:
        """Return the changes of a joint's formula that give a solution's values at poses that should be reached."""
        if not mistakes:
            return []
        formula = branch.editable(joint)
        agreeing = list[Edit]()
        asked = branch.reachable
        tree = branch.trees[joint]
        equal = equal_parts([tree])
        for edit in self._edits(branch, joint, mistakes):
            trees = [edit.tree]
            if len(equal[id(edit.old)]) > 1:
                trees.append(replaced_everywhere(tree, equal[id(edit.old)], edit.new))
            for changed in trees:
                try:
                    x = branch.repaired(joint, formula.of(changed))
                except AnswerError:  # it would need a joint that follows from this one
                    continue
                if np.mean(branch.agrees(joint, x)[asked]) >= _MIN_AGREEING_SHARE:
                    agreeing.append(replace(edit, tree=changed))
                    break
        return agreeing

    def _explain_earlier(self, branch: Branch, joint: int) -> Iterator[Explanation]:
        """Yield changes of formulas before the first wrong joint, whose values may be those of another solution."""
        for other in branch.order[: branch.rank(joint)]:
            for edit in self._agreeing_edits(branch, other):
                yield _edited(branch, other, edit)

    def _explain_several(self, branch: Branch, agreeing: list[Edit]) -> Iterator[Explanation]:
        """Yield changes of the same part, or of the same names, in several formulas."""
        size = sum(1 for tree in branch.trees for _ in parts_of(tree))
        if size > BOUNDS.edited_nodes * branch.n:
            return
        equal = equal_parts(branch.trees)
        for edit in agreeing:
            trees = [replaced_everywhere(tree, equal[id(edit.old)], edit.new) for tree in branch.trees]
            if sum(new is not old for new, old in zip(trees, branch.trees, strict=True)) > 1:
                yield Explanation(edit.mistake, None, branch.with_trees(trees))
        for mistake, change in renamings(branch.trees, self.lengths):
            if any(map(is_joint, change)):
                continue  # formulas might then need each other
            trees = [renamed(tree, change) for tree in branch.trees]
            if self.left > size and sum(new is not old for new, old in zip(trees, branch.trees, strict=True)) > 1:
                self.left -= size
                yield Explanation(mistake, None, branch.with_trees(trees))


def lengths_of(description: Description) -> Lengths:
    """Return the lengths that formulas for a robot may contain, m."""
    parameters = tuple(description.parameters)
    numbers = description.numbers
    values = description.numbers.values
    known = [*numbers.d, *numbers.a, *numbers.T_world_base[:3, 3], *numbers.T_last_tool[:3, 3]]
    trees: list[Name | Number] = [Name(name, 0) for name in parameters]
    sizes = [abs(float(values[name])) for name in parameters]
    seen = {round(size, 12) for size in sizes} | {0.0}
    for length in known:
        size = round(abs(float(length)), 12)
        if size not in seen:
            seen.add(size)
            sizes.append(size)
            trees.append(Number(Fraction(str(size)), str(size), 0))
    behind_last_joint = (numbers.d[-1], numbers.a[-1], *numbers.T_last_tool[:3, 3])
    of_tool = tuple(abs(float(x)) for x in behind_last_joint if abs(x) > 0)
    return Lengths(parameters, tuple(trees), tuple(sizes), of_tool)


def _edited(branch: Branch, joint: int, edit: Edit) -> Explanation:
    return Explanation(edit.mistake, joint, branch.with_tree(joint, edit.tree))


def _count_of_closed(explanation: Explanation) -> int:
    return int(np.sum(explanation.repaired.closed)) if explanation.repaired is not None else 0


def _wrong(branch: Branch, joint: int) -> Mask:
    """Return at which poses a joint is the first wrong one, shape (S,)."""
    wrong: Mask = branch.failing & (branch.agreement.first_wrong == branch.rank(joint))
    return wrong


def _offsets(branch: Branch, joint: int) -> list[float]:
    """Return possible constant errors of a joint, rad or m, from the first pose where it is wrong."""
    wrong = _wrong(branch, joint) & np.isfinite(branch.q[:, joint])
    if not np.any(wrong):
        return []
    s = int(np.argmax(wrong))
    alive = branch.alive[branch.rank(joint)][s]
    return [float(x) for x in np.unique((branch.poses.truths[s, alive, joint] - branch.q[s, joint]).round(12))]


def _lost_halves(branch: Branch, joint: int, first: int) -> list[tuple[str, Branch]]:
    """Return the branch with a joint's values in the other half turn: atan, asin and acos cover one half alone.

    The wrong half may be the value of another solution; a later joint is then the first wrong one.
    """
    wrong = _wrong(branch, first)
    tree = branch.trees[joint]
    revolute = branch.poses.description.kinds[joint] == "R"
    own = joint == first
    has_arc = has_call(tree, ("acos", "asin", "atan"))
    half = "quadrant" if has_arc or not has_call(tree, ("atan2",)) else "divisor_sign_lost"
    mirrored = "quadrant" if has_arc or not has_call(tree, ("sqrt",)) else "sign_lost"

    def where_wrong(change: Array) -> Array:
        return np.where(wrong, change, 0.0)

    branches = []
    if revolute and (own or has_call(tree, ("atan", "asin"))):
        branches.append((half, branch.with_repair(joint, lambda x: x + where_wrong(np.full_like(x, np.pi)))))
        branches.append((mirrored, branch.with_repair(joint, lambda x: x + where_wrong(np.pi - 2 * x))))
    if own or has_call(tree, ("acos",)):
        branches.append(("sign_lost", branch.with_repair(joint, lambda x: x - where_wrong(2 * x))))
    arcs = [function for function in _ARCS if has_call(tree, (function,))]
    if own and len(arcs) == 1 and not isinstance(tree, Call):
        mistake, change = _ARCS[arcs[0]]
        changed = branch.editable(joint).of(with_calls_changed(tree, arcs, change))
        values = branch.repaired(joint, changed)
        branches.append((mistake, branch.with_repair(joint, lambda x: np.where(wrong, values, x))))
    # Both may give a solution: the half that the formula's own function does not cover comes first.
    return branches[::-1] if has_call(tree, ("acos",)) and not has_call(tree, ("atan", "asin")) else branches
