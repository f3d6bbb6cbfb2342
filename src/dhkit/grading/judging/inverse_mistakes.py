"""Search for the mistakes in a branch of inverse kinematics that does not reach the requested poses.

The best explanation is a single local change of the first wrong formula that makes the whole branch right; then one of
a preceding formula, or of the same part in several formulas; then a sign or quadrant that is lost at some poses. A
joint whose value agrees with a solution, given the preceding joints, is never blamed. The search is bounded by counted
changes, never by time.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain

import numpy as np

from dhkit.description import Array, Description
from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Call, Name, Number, Tree
from dhkit.expressions.trees import equal_parts, names_of, parts_of, replaced_everywhere
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.grading.judging.changed_formulas import (
    has_call,
    is_joint,
    minus,
    renamed,
    with_calls_changed,
    with_term,
)
from dhkit.grading.judging.inverse_branch import Branch
from dhkit.grading.judging.inverse_edits import ORDER, Edit, Lengths, edits, renamings
from dhkit.grading.judging.inverse_poses import Mask

_MIN_AGREEING_SHARE = 0.5
"""Smallest share of the poses at which a changed formula must give a solution's value for the change to be followed."""
_MIN_EXPLAINED_SHARE = 0.3
"""Smallest share of the failing poses that a mistake must explain to be named where others are made besides."""
_FREQUENT = frozenset(
    (
        "atan2_arguments",
        "quadrant",
        "elbow_sign",
        "degrees_for_radians",
        "millimetres_for_metres",
        "joint_sign",
    )
)
"""Mistakes that are named if they explain a good part of the failing poses by themselves."""

_PI = Name("pi", 0)
_ARCS: Mapping[str, tuple[str, Callable[[Call], Tree]]] = {
    "acos": ("sign_lost", minus),
    "asin": ("quadrant", lambda call: with_term(_PI, False, call)),
    "atan": ("quadrant", lambda call: with_term(_PI, True, call)),
}
"""Mistake of using a function whose values cover half a turn, and its value in the other half, by the function."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """A mistake in a branch.

    Attributes
    ----------
    mistake
        Identifier of the mistake in the catalogue; None if none explains the branch.
    joint
        Joint of the wrong formula, from 0; None for several formulas, or none in particular.
    repaired
        The branch with the mistake corrected; None without a mistake.
    is_near
        Whether all joint values match a solution, but the tool's error exceeds ``CLOSES``.
    """

    mistake: str | None
    joint: int | None
    repaired: Branch | None = None
    is_near: bool = False


class MistakeSearch:
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
        """Work that is left: changes, each times the parts of its formula."""
        self.made: dict[int, set[str]] = {}
        """Mistakes that were found in each joint's formula of the branches so far."""

    def explanations(self, branch: Branch) -> Iterator[Explanation]:
        """Yield the mistakes of a branch; each is corrected before the next is looked for."""
        current: Branch | None = branch.sample(BOUNDS.edit_poses)
        while current is not None and not current.is_right:
            joint = current.wrong_joint()
            explanation = (
                self._explain_anywhere(current) if joint is None else self._explain(current, joint)
            )
            if explanation.mistake is not None and explanation.joint is not None:
                self.made.setdefault(explanation.joint, set()).add(explanation.mistake)
            yield explanation
            current = explanation.repaired

    def _explain_anywhere(self, branch: Branch) -> Explanation:
        """Return a change that makes a branch right of which no joint is known to be wrong.

        If solutions are single points, all joint values match one: then nothing is changed.
        """
        if branch.poses.isolated:
            return Explanation(None, None, is_near=True)
        for joint in branch.order:
            for edit in self._edits(branch, joint):
                repaired = branch.with_tree(joint, edit.tree)
                has_new_names = names_of(edit.tree) - names_of(branch.trees[joint])
                if not has_new_names and repaired.is_right:
                    return Explanation(edit.mistake, joint, repaired)
        return Explanation(None, None, is_near=False)

    def _explain(self, branch: Branch, joint: int) -> Explanation:
        """Return the mistake of a branch with a known first wrong joint."""

        def leads_on(candidate: Explanation) -> bool:
            """Whether no joint up to this one is wrong any more."""
            following = (
                candidate.repaired.wrong_joint() if candidate.repaired is not None else joint
            )
            return following is None or branch.rank(following) > branch.rank(joint)

        # Branches of one sheet have the same mistakes: those of an earlier branch are tried before all others.
        for edit in self._agreeing_edits(branch, joint, self.made.get(joint, set())):
            known = _edited(branch, joint, edit)
            if leads_on(known):
                return known

        here = self._agreeing_edits(branch, joint)
        candidates = [_edited(branch, joint, edit) for edit in here]
        partial = next(filter(leads_on, candidates), None)
        halves: list[Explanation] = []
        for other in branch.order[: branch.rank(joint) + 1]:
            halves += [
                Explanation(mistake, other, repaired)
                for mistake, repaired in _lost_halves(branch, other, joint)
            ]

        # A change that makes the whole branch right. If a change of this formula makes its values right, those of the
        # formulas before it are right, and need no change.
        earlier = self._explain_earlier(branch, joint) if partial is None else iter(())
        several = self._explain_several(branch, here)
        for candidate in chain(candidates, earlier, several, halves):
            if candidate.repaired is not None and candidate.repaired.is_right:
                return candidate

        # A change after which a later joint is the first wrong one.
        found = partial or next(filter(leads_on, halves), None)
        if found:
            return found

        # A frequent mistake that explains a good part of the failing poses.
        frequent = [
            _edited(branch, joint, edit)
            for edit in self._edits(branch, joint)
            if edit.mistake in _FREQUENT
        ]
        best = max((*frequent, *halves), key=_count_of_closed, default=Explanation(None, joint))
        gained = _count_of_closed(best) - int(np.sum(branch.closed))
        return (
            best
            if gained > _MIN_EXPLAINED_SHARE * np.sum(branch.failing)
            else Explanation(None, joint)
        )

    def _edits(self, branch: Branch, joint: int, mistakes: Collection[str] = ORDER) -> list[Edit]:
        """Return the changes of a joint's formula that correct some mistakes, as many as the remaining work allows."""
        same_kind = [
            k for k in branch.independent(joint) if self.revolute[k] is self.revolute[joint]
        ]
        names = [f"q{k + 1}" for k in same_kind]
        offsets = _offsets(branch, joint)
        tree = branch.trees[joint]
        size = sum(1 for _ in parts_of(tree))
        if size > BOUNDS.edited_nodes:
            return []
        changes = edits(tree, self.revolute[joint], names, offsets, self.lengths, mistakes)
        changes = changes[: self.left // size]
        self.left -= len(changes) * size
        return changes

    def _agreeing_edits(
        self, branch: Branch, joint: int, mistakes: Collection[str] = ORDER
    ) -> list[Edit]:
        """Return the changes of a joint's formula that give a solution's values at poses that must be reached.

        If the changed part occurs more than once, it is changed in one place and then in all of them.
        """
        if not mistakes:
            return []
        formula = branch.editable(joint)
        required = branch.reachable
        tree = branch.trees[joint]
        equal = equal_parts([tree])
        agreeing: list[Edit] = []
        for edit in self._edits(branch, joint, mistakes):
            trees = [edit.tree]
            if len(equal[id(edit.old)]) > 1:
                trees.append(replaced_everywhere(tree, equal[id(edit.old)], edit.new))
            for changed in trees:
                try:
                    x = branch.repaired(joint, formula.of(changed))
                except AnswerError:  # it would need a joint that follows from this one
                    continue
                if np.mean(branch.agrees(joint, x)[required]) >= _MIN_AGREEING_SHARE:
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
        size = len(list(chain.from_iterable(map(parts_of, branch.trees))))
        if size > BOUNDS.edited_nodes * branch.n:
            return
        equal = equal_parts(branch.trees)
        for edit in agreeing:
            trees = [
                replaced_everywhere(tree, equal[id(edit.old)], edit.new) for tree in branch.trees
            ]
            if _count_of_changed(trees, branch.trees) > 1:
                yield Explanation(edit.mistake, None, branch.with_trees(trees))
        for mistake, change in renamings(branch.trees, self.lengths):
            if any(map(is_joint, change)):
                continue  # formulas might then need each other
            trees = [renamed(tree, change) for tree in branch.trees]
            if self.left > size and _count_of_changed(trees, branch.trees) > 1:
                self.left -= size
                yield Explanation(mistake, None, branch.with_trees(trees))


def lengths_of(description: Description) -> Lengths:
    """Return the lengths that formulas for a robot may contain, m.

    They are first its parameters, then as numbers those lengths of table, base and tool that no parameter has.
    """
    parameters = tuple(description.parameters)
    numbers = description.numbers
    values = description.numbers.values
    trees: list[Name | Number] = [Name(name, 0) for name in parameters]
    sizes = [abs(float(values[name])) for name in parameters]

    seen = {round(size, 12) for size in sizes} | {0.0}
    for length in (
        *numbers.d,
        *numbers.a,
        *numbers.T_world_base[:3, 3],
        *numbers.T_last_tool[:3, 3],
    ):
        size = round(abs(float(length)), 12)
        if size not in seen:
            seen.add(size)
            sizes.append(size)
            trees.append(Number(Fraction(str(size)), str(size), 0))

    beyond_last_axis = (numbers.d[-1], numbers.a[-1], *numbers.T_last_tool[:3, 3])
    of_tool = tuple(abs(float(length)) for length in beyond_last_axis if abs(length) > 0)
    return Lengths(parameters, tuple(trees), tuple(sizes), of_tool)


def _edited(branch: Branch, joint: int, edit: Edit) -> Explanation:
    """Return the explanation that a change of a joint's formula gives."""
    return Explanation(edit.mistake, joint, branch.with_tree(joint, edit.tree))


def _count_of_closed(explanation: Explanation) -> int:
    """Return the number of poses that the corrected branch solves; 0 without one."""
    return int(np.sum(explanation.repaired.closed)) if explanation.repaired is not None else 0


def _count_of_changed(trees: Sequence[Tree], before: Sequence[Tree]) -> int:
    """Return the number of formulas that differ from those before a change."""
    return sum(new is not old for new, old in zip(trees, before, strict=True))


def _wrong(branch: Branch, joint: int) -> Mask:
    """Return a mask (S,) of the poses at which a joint is the first wrong one."""
    wrong: Mask = branch.failing & (branch.agreement.first_wrong == branch.rank(joint))
    return wrong


def _offsets(branch: Branch, joint: int) -> list[float]:
    """Return possible constant errors of a joint, rad or m, from the first pose where it is wrong."""
    wrong = _wrong(branch, joint) & np.isfinite(branch.q[:, joint])
    if not np.any(wrong):
        return []
    s = int(np.argmax(wrong))
    alive = branch.alive[branch.rank(joint)][s]
    errors = branch.poses.truths[s, alive, joint] - branch.q[s, joint]
    return [float(error) for error in np.unique(errors.round(12))]


def _lost_halves(branch: Branch, joint: int, first: int) -> list[tuple[str, Branch]]:
    """Return the branch with a joint's values in the other half turn, each with the mistake of missing this half.

    atan, asin and acos cover one half of a turn alone. The wrong half may be the value of another solution; a later
    joint is then the first wrong one.

    Parameters
    ----------
    branch
        The branch.
    joint
        The joint, from 0, whose values are changed.
    first
        The first wrong joint, from 0; values are changed at the poses at which it is wrong.
    """
    wrong = _wrong(branch, first)
    tree = branch.trees[joint]
    is_revolute = branch.poses.description.kinds[joint] == "R"
    is_first = joint == first
    has_arc = has_call(tree, ("acos", "asin", "atan"))

    def with_half_turn(x: Array) -> Array:
        return x + np.where(wrong, np.full_like(x, np.pi), 0.0)

    def with_supplement(x: Array) -> Array:
        return x + np.where(wrong, np.pi - 2 * x, 0.0)

    def with_other_sign(x: Array) -> Array:
        return x - np.where(wrong, 2 * x, 0.0)

    branches = []
    if is_revolute and (is_first or has_call(tree, ("atan", "asin"))):
        # tan(q + pi) = tan(q)
        mistake = "quadrant" if has_arc or not has_call(tree, ("atan2",)) else "divisor_sign_lost"
        branches.append((mistake, branch.with_repair(joint, with_half_turn)))

        # sin(pi - q) = sin(q)
        mistake = "quadrant" if has_arc or not has_call(tree, ("sqrt",)) else "sign_lost"
        branches.append((mistake, branch.with_repair(joint, with_supplement)))

    if is_first or has_call(tree, ("acos",)):
        # cos(-q) = cos(q)
        branches.append(("sign_lost", branch.with_repair(joint, with_other_sign)))

    # The same for the arc function alone, where it is a part of the formula.
    arcs = [function for function in _ARCS if has_call(tree, (function,))]
    if is_first and len(arcs) == 1 and not isinstance(tree, Call):
        mistake, change = _ARCS[arcs[0]]
        changed = branch.editable(joint).of(with_calls_changed(tree, arcs, change))
        values = branch.repaired(joint, changed)
        branches.append((mistake, branch.with_repair(joint, lambda x: np.where(wrong, values, x))))

    # Both may give a solution: the half that the formula's own function does not cover comes first.
    is_arc_cosine = has_call(tree, ("acos",)) and not has_call(tree, ("atan", "asin"))
    return branches[::-1] if is_arc_cosine else branches
