"""Judging of the equations of a step of inverse kinematics: identities of the arm that determine a joint."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Call, Number, Power, Product, Sum, Tree
from dhkit.expressions.trees import names_of, parts_of
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.answers.inverse_steps import GivenStep
from dhkit.grading.judging.changed_formulas import minus, square_of, with_calls_changed
from dhkit.grading.judging.inverse_edits import Edit, Lengths, edits_of_parts
from dhkit.grading.judging.numeric import EditedDoubles, doubles
from dhkit.grading.judging.quotients import OutsideTheRingError, RingReader
from dhkit.grading.judging.step_context import Part, StepContext
from dhkit.grading.judging.step_roots import Residual, other_root
from dhkit.grading.report import Verdict, Witness
from dhkit.symbolic import table_lengths
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.inverse.chain import POSE, ExactChain
from dhkit.symbolic.inverse.steps import names_in
from dhkit.symbolic.ring import Element, RingError
from dhkit.symbolic.ring.ring import translated

_MAX_SHOWN = 200
"""Longest difference of an equation's sides that is printed, in characters."""
_FREE_POSES = 32
"""Number of random poses, unrelated to the joints; an equation that holds at one of them says nothing of the arm."""
_ZERO = 1e-9
"""Largest difference of an equation's sides, relative to their size, that is rounding."""
_OF_BOTH_SIDES = ("square_forgotten", "square_too_much", "root_forgotten")
"""Changes of both sides of an equation at once, which are not correction."""
_STEP = 1e-6
"""Step of finite differences, rad, and relative to the reach."""
_WITH_NUMBERS = "proved: an identity of the arm with its own lengths"
"""Statement on an equation that is not an identity whatever the lengths are."""
_NO_CHANGE = 1e-7
"""Change of an equation, relative to the size of its terms, by a step of one, that is rounding."""
_SAME_RANK = 1e-5
"""Singular value, as a share of the largest, below which an equation adds nothing to the others."""


class Equations:
    """Judges the equations of one step."""

    def __init__(self, context: StepContext, step: GivenStep, before: Sequence[int]) -> None:
        self.context = context
        self.step = step
        self.before = before
        self.differences = [Sum(((True, left), (False, right))) for left, right in step.equations]

    def part(self) -> Part:
        """Return the verdict on the equations together."""
        joints = {f"q{i + 1}" for i in range(self.context.description.n)}
        known = {*POSE_NAMES, *self.context.poses.values, *joints, "pi"}
        for tree in self.differences:
            if strange := sorted(names_of(tree) - known):
                raise AnswerError(f"equation: unknown name {strange[0]!r}")
        if own_factor := next(filter(None, map(self._factor_of_other_roots, self.differences)), None):
            return own_factor
        statements = []
        remarks: list[str] = []
        verdict = Verdict.CORRECT
        for k, tree in enumerate(self.differences):
            found, statement, difference = self._identity(tree)
            if found is Verdict.WRONG:
                share = self._share_of_a_root(tree)
                if share is None:
                    return self._wrong(k, tree, difference)
                found = Verdict.UNDECIDED
                statement = "true of one of the joint's roots; tried, not proved"
                remarks.append(f"the equation is true of one root alone, at {share:.3g} % of the poses tried")
            elif statement == _WITH_NUMBERS and self._is_in_names(tree):
                remarks.append("the equation is true of this arm alone: it needs lengths that are equal, or zero, here")
            statements.append(statement)
            verdict = max(verdict, found, key=lambda one: one.severity)
        own = f"q{self.step.joint + 1}"
        if all(self._holds_always(tree) for tree in self.differences):
            return Part(Verdict.INCOMPLETE, "the equation holds for every pose and all joint values: it says nothing")
        used = set().union(*map(names_of, self.differences))
        if own not in used:
            return Part(Verdict.INCOMPLETE, f"the equation is right, but does not contain {own}")
        if not self._determines():
            later = sorted(used & joints - {own} - {f"q{j + 1}" for j in self.before})
            what = f", as {', '.join(later)} {'is' if len(later) == 1 else 'are'} not known yet" if later else ""
            return Part(Verdict.INCOMPLETE, f"the equation is right, but does not determine {own}{what}")
        if (root := self._other_root(used)) is not None:
            return Part(
                Verdict.INCOMPLETE,
                f"the equation is right, but has roots that are not solutions, such as {own} = {root:.4g} at a pose "
                f"that was tried: it does not determine {own} alone",
            )
        return Part(verdict, f"equation: {statements[0]}", remark="; ".join(dict.fromkeys(remarks)))

    def _other_root(self, used: set[str]) -> float | None:
        """Return a root of the equations that is not a solution; None without a closed form, or with later joints."""
        n = self.context.description.n
        own = self.step.joint
        poses = self.context.solved_poses
        later = {f"q{j + 1}" for j in range(n) if j != own and j not in self.before}
        if not poses.has_closed_form or used & later:
            return None

        def values_at(rows: NDArray[np.intp], q: Array) -> dict[str, Array | float]:
            pose = {name: np.broadcast_to(x, len(poses.q))[rows] for name, x in poses.values.items() if name in used}
            return {**pose, **_joints(q)}

        def residual_on(rows: NDArray[np.intp], q: Array) -> Residual:
            # A factor that is common to all terms has roots too: sizes are the largest of each pose.
            sizes = []
            for tree in self.differences:
                size = np.nan_to_num(np.broadcast_to(_sizes(tree, values_at(rows, q)), len(rows)))
                largest = np.zeros(int(rows.max()) + 1)
                np.maximum.at(largest, rows, size)
                sizes.append(np.maximum(largest, 1e-12))

            def residual(rows: NDArray[np.intp], q: Array) -> Array:
                values = values_at(rows, q)
                gaps = [
                    np.abs(np.asarray(doubles(tree, values))) / size[rows]
                    for tree, size in zip(self.differences, sizes, strict=True)
                ]
                largest: Array = np.max(np.broadcast_arrays(*gaps, np.zeros(len(rows)))[:-1], axis=0)
                return largest

            return residual

        return other_root(poses, own, self.before, residual_on)

    def _factor_of_other_roots(self, tree: Tree) -> Part | None:
        """Return the part of a product that is zero since one factor is, where another has roots that are not solution.

        The product (c2 - D) (c2 - px) = 0 holds for every solution, as its first factor does alone; the second one adds
        roots, so that the equation does not determine q2. A factor that does not depend on the joint adds none.
        """
        own = f"q{self.step.joint + 1}"
        factors = _factors_of_zero(tree)
        if len(factors) < 2:
            return None
        is_zero = [bool(np.max(np.abs(self.residual(factor))) < _ZERO) for factor in factors]
        others = [f for f, zero in zip(factors, is_zero, strict=True) if not zero and own in names_of(f)]
        if not any(is_zero) or not others:
            return None
        return Part(
            Verdict.INCOMPLETE,
            f"the equation is a product, and holds since one factor is zero; another factor with {own} is zero for "
            f"other values of {own}, so that the equation does not determine {own}",
        )

    def _identity(self, tree: Tree) -> tuple[Verdict, str, str | None]:
        """Return whether a difference is zero for the pose of the arm, why, and what it is if not."""
        named, numbers = self.context.chains
        table = table_lengths(self.context.description)
        values = {
            name: value.rational
            for name, value in self.context.description.parameters.items()
            if value.rational is not None
        }
        difference: str | None = None
        for chain, known, statement in (
            (named, {}, "proved: an identity of the arm, whatever its lengths are"),
            (numbers, {**table, **values}, _WITH_NUMBERS),
        ):
            try:
                element = self._element(tree, chain, known)
            except (OutsideTheRingError, RingError, AnswerError):
                continue
            if element.is_zero:
                return Verdict.CORRECT, statement, None
            difference = difference or _shown(element)
        if np.max(np.abs(self.residual(tree))) > _ZERO:
            return Verdict.WRONG, "", difference
        return Verdict.UNDECIDED, f"holds at {len(self.context.poses.q)} random poses; tried, not proved", None

    def _element(self, tree: Tree, chain: ExactChain, known: dict[str, Fraction]) -> Element:
        """Return a difference with the pose of the arm put in, up to a denominator."""
        quotient = RingReader(chain.ring, numbers=known).read(tree)
        T = chain.tool_pose
        entries = zip(POSE, [*T[:3, 3], *T[:3, :3].flat], strict=True)
        places = {chain.ring.place("constant", chain.names[name]): entry for name, entry in entries}
        used = {k for monomial in quotient.numerator.terms for k, e in enumerate(monomial) if e and k in places}
        return translated(quotient.numerator, chain.ring, {k: places[k] for k in used})

    @property
    def _values(self) -> dict[str, Array | float]:
        return {**self.context.poses.values, **_joints(self.context.poses.q)}

    def residual(self, tree: Tree, values: dict[str, Array | float] | None = None) -> Array:
        """Return the difference of an equation's sides relative to the size of its terms, shape (S,)."""
        given = self._values if values is None else values
        relative = np.asarray(doubles(tree, given)) / np.maximum(_sizes(tree, given), 1e-12)
        residual: Array = np.broadcast_to(np.nan_to_num(relative, nan=np.inf), np.shape(given["px"]))
        return residual

    def _holds_always(self, tree: Tree) -> bool:
        """Whether an equation holds at poses unrelated to the joints; at one of them, if it has roots."""
        rng = np.random.default_rng(5)
        n = self.context.description.n
        scale = self.context.poses.scale
        T = np.tile(np.eye(4), (_FREE_POSES, 1, 1))
        T[:, :3, :3] = Rotation.random(_FREE_POSES, rng=rng).as_matrix()
        T[:, :3, 3] = rng.uniform(-scale, scale, (_FREE_POSES, 3))
        poses = replace(self.context.poses, q=rng.uniform(-2, 2, (_FREE_POSES, n)), T=T, known=None)
        values = {**poses.values, **_joints(poses.q)}
        return bool(np.min(np.abs(self.residual(tree, values))) < _ZERO)

    def _share_of_a_root(self, tree: Tree) -> float | None:
        """Return at how many poses, in %, an equation holds that is true of one root at all poses; None for another.

        An equation with an explicit root, such as c1 = px/sqrt(px^2 + py^2), holds for some of the solutions of a pose.
        """
        poses = self.context.solved_poses
        truths = poses.truths
        holds = np.zeros(truths.shape[:2], dtype=bool)
        for b in range(truths.shape[1]):
            holds[:, b] = np.abs(self.residual(tree, {**poses.values, **_joints(truths[:, b])})) < _ZERO
        share = 100 * float(np.mean(np.abs(self.residual(tree)) < _ZERO))
        return share if share > 0 and poses.has_closed_form and np.all(holds.any(axis=1)) else None

    def _is_in_names(self, tree: Tree) -> bool:
        """Whether an equation has lengths by name, and no number that may stand for one."""
        lengths = {*table_lengths(self.context.description), *self.context.description.parameters}
        numbers = [part for part in parts_of(tree) if isinstance(part, Number) and part.value.denominator != 1]
        return bool(names_of(tree) & lengths) and not numbers

    def _determines(self) -> bool:
        """Whether the equations determine the joint where those of earlier steps are known."""
        n = self.context.description.n
        own = self.step.joint
        free = [j for j in range(n) if j not in self.before]
        holds = np.all([np.abs(self.residual(tree)) < _ZERO for tree in self.differences], axis=0)
        poses = self.context.poses.at(np.flatnonzero(holds)[:8])
        J = np.zeros((len(poses.q), len(self.differences), len(free)))
        for m, tree in enumerate(self.differences):
            at = _sizes(tree, {**poses.values, **_joints(poses.q)})
            for k, j in enumerate(free):
                unit = poses.scale if poses.description.kinds[j] == "P" else 1.0
                sides = [
                    np.asarray(doubles(tree, {**poses.values, **_joints(poses.q + sign * _STEP * unit * np.eye(n)[j])}))
                    for sign in (0, 1)
                ]
                J[:, m, k] = (sides[1] - sides[0]) / _STEP / np.maximum(at, 1e-12)
        J[np.abs(J) < _NO_CHANGE] = 0
        without = np.delete(J, free.index(own), axis=2)
        return bool(np.mean(_ranks(J) > _ranks(without)) > 0.5)

    def _wrong(self, k: int, tree: Tree, difference: str | None) -> Part:
        """Return the part of a wrong equation k, with its mistake."""
        residual = np.abs(self.residual(tree))
        s = int(np.argmax(residual))
        values = self._values
        left, right = (
            float(np.broadcast_to(doubles(side, values), len(residual))[s]) for side in self.step.equations[k]
        )
        state = {name: float(np.broadcast_to(values[name], len(residual))[s]) for name in POSE_NAMES}
        state |= {f"q{i + 1}": float(x) for i, x in enumerate(self.context.poses.q[s])}
        witness = Witness(state, left if np.isfinite(left) else None, right if np.isfinite(right) else None)
        which = f"equation {k + 1}" if len(self.differences) > 1 else "equation"
        part = Part(Verdict.WRONG, f"{which}: no identity of the arm", difference=difference, witness=witness)
        if self.context.explain:
            part.mistakes = [self._mistake(tree) or ("equation_wrong", "")]
        return part

    # Mistakes

    def _mistake(self, tree: Tree) -> tuple[str, str] | None:
        """Return the mistake whose correction makes a wrong equation an identity, and a detail."""
        if (changed := self._single_change(tree)) is not None:
            return changed, ""
        for mistake, values in self.context.misread(self.context.poses):
            if np.max(np.abs(self.residual(tree, {**values, **_joints(self.context.poses.q)}))) < _ZERO:
                return mistake, ""
        zero = self._with_a_length_of_zero(tree)
        step = self.context.derived(self.step.joint)
        if zero is not None and self.step.joint == 0 and step is not None and zero in names_in(step.elements):
            return "shoulder_offset_forgotten", ""
        return None if zero is None else ("length_taken_as_zero", zero)

    def _with_a_length_of_zero(self, tree: Tree) -> str | None:
        """Return the length for which an equation would be an identity if it were zero; None if there is none."""
        named = self.context.chains[0]
        try:
            element = self._element(tree, named, {})
        except (OutsideTheRingError, RingError, AnswerError):
            return None
        for name in names_in([element]) & {*named.lengths}:
            place = named.ring.place("constant", name)
            if translated(element, named.ring, {place: named.ring.zero}).is_zero:
                return name
        return None

    def _single_change(self, tree: Tree) -> str | None:
        """Return the mistake whose correction, one change, makes a wrong equation an identity."""
        poses = self.context.poses.at(range(min(40, len(self.context.poses.q))))
        formula = EditedDoubles(tree, {**poses.values, **_joints(poses.q)})
        lengths = self.context.lengths([tree])
        size = np.max(np.abs(np.asarray(formula.numbers))) + self.context.poses.scale
        own = self.step.joint
        for edit in (*_with_a_length(tree, lengths, own), *_inner_angles(tree, own), *edits_of_parts(tree, lengths)):
            if edit.old is tree and edit.mistake in _OF_BOTH_SIDES:
                continue
            try:
                off = np.max(np.abs(np.nan_to_num(np.asarray(formula.of(edit.tree)), nan=np.inf)))
            except AnswerError:  # it needs a joint that the arm does not have
                continue
            if off < _ZERO * size and not self._holds_always(edit.tree):
                return edit.mistake
        return None


def _joints(q: Array) -> dict[str, Array | float]:
    """Return joint values (S, n), rad and m, by name."""
    return {f"q{i + 1}": column for i, column in enumerate(q.T)}


def _sizes(tree: Tree, values: Mapping[str, Array | float]) -> Array:
    """Return the size of a formula before its terms cancel, shape (S,) or (): sums of sizes, and products of them."""
    size: Array = np.ones(())
    match tree:
        case Sum(terms):
            size = np.sum(np.broadcast_arrays(*(_sizes(term, values) for _, term in terms)), axis=0)
        case Product(factors):
            for is_factor, factor in factors:
                other = _sizes(factor, values) if is_factor else np.abs(np.asarray(doubles(factor, values)))
                size = size * other if is_factor else size / other
        case _:
            size = np.abs(np.asarray(doubles(tree, values)))
    return size


def _with_a_length(tree: Tree, lengths: Lengths, joint: int) -> Iterator[Edit]:
    """Yield an equation with a constant length, or its square, added to one of its sides."""
    mistake = "shoulder_offset_forgotten" if joint == 0 else "length_forgotten"
    for length in lengths.trees:
        for term, name in ((length, mistake), (square_of(length), "length_forgotten")):
            for added in (True, False):
                new = Sum(((True, tree), (added, term)))
                yield Edit(name, new, tree, new)


def _inner_angles(tree: Tree, joint: int) -> Iterator[Edit]:
    """Yield a law of cosines with the angle inside the triangle instead of the joint's, which has the other sign."""
    squares = [part for part in parts_of(tree) if isinstance(part, Power)]
    if len(squares) < 2:
        return
    own = f"q{joint + 1}"
    calls = [part for part in parts_of(tree) if isinstance(part, Call) and names_of(part) == {own}]
    if {call.function for call in calls} == {"cos"}:
        new = with_calls_changed(tree, ("cos",), lambda call: minus(call) if names_of(call) == {own} else call)
        yield Edit("supplement", new, tree, new)


def _ranks(J: Array) -> NDArray[np.int_]:
    """Return the ranks of matrices (S, m, k), shape (S,)."""
    if not J.shape[2]:
        return np.zeros(len(J), dtype=int)
    sizes = np.linalg.svd(np.nan_to_num(J), compute_uv=False)
    ranks: NDArray[np.int_] = np.sum(sizes > _SAME_RANK * np.maximum(sizes[:, :1], 1e-12), axis=1)
    return ranks


def _shown(element: Element) -> str:
    text = plain_text(element)
    return text if len(text) <= _MAX_SHOWN else f"{text[: _MAX_SHOWN - 3]}..."


def _factors_of_zero(difference: Tree) -> list[Tree]:
    """Return the factors of an equation's side where the other is zero; none where no side is."""
    match difference:
        case Sum(((True, one), (False, other))):
            sides = [side for side in (one, other) if not (isinstance(side, Number) and side.value == 0)]
            return _factors(sides[0]) if len(sides) == 1 else []
    return []


def _factors(tree: Tree) -> list[Tree]:
    """Return the factors of a numerator, without their powers."""
    match tree:
        case Sum(((_, term),)):
            return _factors(term)
        case Product(factors):
            return [one for multiplied, factor in factors if multiplied for one in _factors(factor)]
        case Power(base, Number(value)) if value > 0:
            return _factors(base)
    return [tree]
