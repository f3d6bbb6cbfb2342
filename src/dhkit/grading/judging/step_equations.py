"""Judging of the equations of a step of inverse kinematics: identities of the arm that determine a joint."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Call, Number, Power, Product, Sum, Tree
from dhkit.expressions.trees import names_of, parts_of
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.answers.inverse_steps import GivenStep
from dhkit.grading.grade_report import Verdict, Witness
from dhkit.grading.judging.changed_formulas import minus, square_of, with_calls_changed, with_term
from dhkit.grading.judging.inverse_edits import Edit, Lengths, edits_of_parts
from dhkit.grading.judging.inverse_poses import Poses
from dhkit.grading.judging.numeric import EditedDoubles, doubles
from dhkit.grading.judging.quotients import OutsideTheRingError, RingReader
from dhkit.grading.judging.step_context import Part, StepContext
from dhkit.grading.judging.step_roots import Residual, other_root
from dhkit.symbolic import table_lengths
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.inverse.chain import POSE, ExactChain
from dhkit.symbolic.inverse.steps import names_in
from dhkit.symbolic.ring import Element, RingError
from dhkit.symbolic.ring.ring import translated

_MAX_SHOWN = 200
"""Longest difference of an equation's sides that is printed, in characters."""
_FREE_POSES = 32
"""Number of random poses that are unrelated to the joints: an equation that holds there says nothing about the arm."""
_ZERO = 1e-9
"""Largest difference of an equation's sides, relative to the size of its terms, that is rounding."""
_SMALLEST_SIZE = 1e-12
"""Smallest size of an equation's terms by which its residual is divided: keeps quotients finite where all are zero."""
_OF_BOTH_SIDES = ("square_forgotten", "square_too_much", "root_forgotten")
"""Changes of parts that are not corrections if made to the difference of an equation's sides as a whole."""
_CHANGE_POSES = 40
"""Number of poses at which changes of an equation are tried."""
_RANK_POSES = 8
"""Number of poses at which it is tested whether the equations determine their joint."""
_STEP = 1e-6
"""Step of finite differences, rad, and relative to the reach."""
_WITH_NUMBERS = "proved: an identity of the arm with its own lengths"
"""Statement on an equation that is an identity for the lengths of this arm, and not for any lengths."""
_NO_CHANGE = 1e-7
"""Largest derivative of an equation, relative to the size of its terms, per rad or per reach, that is rounding."""
_SAME_RANK = 1e-5
"""Smallest singular value of a Jacobian, as a share of its largest one, that counts for its rank."""


class _Identity(NamedTuple):
    """Judgement of a difference that should be zero."""

    verdict: Verdict
    """Whether it is zero for the arm's pose."""
    statement: str
    """Reason of the verdict; empty for a wrong equation."""
    difference: str | None
    """The difference as text; None where it is zero, or where it cannot be written exactly."""


class Equations:
    """Judges the equations of one step.

    Parameters
    ----------
    context
        The arm and poses.
    step
        The step.
    before
        Joints of earlier steps, from 0.
    """

    def __init__(self, context: StepContext, step: GivenStep, before: Sequence[int]) -> None:
        self.context = context
        self.step = step
        self.before = before
        self.differences = [with_term(left, False, right) for left, right in step.equations]
        """Left less right side of each equation."""

    def part(self) -> Part:
        """Return the verdict on the equations together."""
        joints = {f"q{i + 1}" for i in range(self.context.description.n)}
        known = {*POSE_NAMES, *self.context.poses.values, *joints, "pi"}
        for tree in self.differences:
            unknown = sorted(names_of(tree) - known)
            if unknown:
                raise AnswerError(f"equation: unknown name {unknown[0]!r}")
        for tree in self.differences:
            part = self._factor_of_other_roots(tree)
            if part is not None:
                return part

        # Is each equation an identity of the arm?
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
                remarks.append(
                    f"the equation is true of one root alone, at {share:.3g} % of the poses tried"
                )
            elif statement == _WITH_NUMBERS and self._is_in_names(tree):
                remarks.append(
                    "the equation is true of this arm alone: it needs lengths that are equal, or zero, here"
                )
            statements.append(statement)
            verdict = max(verdict, found, key=lambda one: one.severity)

        # Do they determine the joint together?
        own = f"q{self.step.joint + 1}"
        if all(self._holds_always(tree) for tree in self.differences):
            return Part(
                Verdict.INCOMPLETE,
                "the equation holds for every pose and all joint values: it says nothing",
            )
        used = set().union(*map(names_of, self.differences))
        if own not in used:
            return Part(Verdict.INCOMPLETE, f"the equation is right, but does not contain {own}")
        if not self._determines():
            later = sorted(used & joints - {own} - {f"q{j + 1}" for j in self.before})
            verb = "is" if len(later) == 1 else "are"
            reason = f", as {', '.join(later)} {verb} not known yet" if later else ""
            return Part(
                Verdict.INCOMPLETE, f"the equation is right, but does not determine {own}{reason}"
            )
        root = self._other_root(used)
        if root is not None:
            return Part(
                Verdict.INCOMPLETE,
                f"the equation is right, but has roots that are not solutions, such as {own} = {root:.4g} at a pose "
                f"that was tried: it does not determine {own} alone",
            )
        return Part(verdict, f"equation: {statements[0]}", remark="; ".join(dict.fromkeys(remarks)))

    def _other_root(self, used: set[str]) -> float | None:
        """Return a root of the equations that is not a solution; None if there is none.

        None also if the roots are not known: without a closed form, or if the equations contain later joints.
        """
        n = self.context.description.n
        own = self.step.joint
        poses = self.context.solved_poses
        later = {f"q{j + 1}" for j in range(n) if j != own and j not in self.before}
        if not poses.has_closed_form or used & later:
            return None
        equations = _EquationsAtPoses(self.differences, poses, used)
        return other_root(poses, own, self.before, equations.residual_on, self.context.roots)

    def _factor_of_other_roots(self, tree: Tree) -> Part | None:
        """Return the verdict on an equation that is a product with a needless factor; None for other equations.

        The product (c2 - D) (c2 - px) = 0 holds for every solution, because its first factor is zero; the second factor
        adds roots, so that the equation does not determine q2. A factor that does not depend on the joint adds none.
        """
        own = f"q{self.step.joint + 1}"
        factors = _factors_of_zero(tree)
        if len(factors) < 2:
            return None
        has_zero = False
        has_needless = False
        for factor in factors:
            if np.max(np.abs(self.residual(factor))) < _ZERO:
                has_zero = True
            elif own in names_of(factor):
                has_needless = True
        if not has_zero or not has_needless:
            return None
        return Part(
            Verdict.INCOMPLETE,
            f"the equation is a product, and holds since one factor is zero; another factor with {own} is zero for "
            f"other values of {own}, so that the equation does not determine {own}",
        )

    def _identity(self, tree: Tree) -> _Identity:
        """Return the judgement of a difference that should be zero for the arm's pose.

        It is tried as an identity for any lengths first, then as one for the lengths of this arm.
        """
        with_names, with_numbers = self.context.chains
        lengths = dict(table_lengths(self.context.description))
        for name, value in self.context.description.parameters.items():
            if value.rational is not None:
                lengths[name] = value.rational
        difference: str | None = None
        for chain, known, statement in (
            (with_names, {}, "proved: an identity of the arm, whatever its lengths are"),
            (with_numbers, lengths, _WITH_NUMBERS),
        ):
            try:
                element = self._element(tree, chain, known)
            except (OutsideTheRingError, RingError, AnswerError):
                continue
            if element.is_zero:
                return _Identity(Verdict.CORRECT, statement, None)
            difference = difference or _shown(element)
        if np.max(np.abs(self.residual(tree))) > _ZERO:
            return _Identity(Verdict.WRONG, "", difference)
        tried = f"holds at {len(self.context.poses.q)} random poses; tried, not proved"
        return _Identity(Verdict.UNDECIDED, tried, None)

    def _element(self, tree: Tree, chain: ExactChain, known: dict[str, Fraction]) -> Element:
        """Return the numerator of a difference, with the pose of the arm put in for px ... r33.

        Parameters
        ----------
        tree
            The difference.
        chain
            The arm, which gives the pose as a function of the joint values.
        known
            Values of the parameters and lengths that the chain has as numbers, SI units and rad.

        Raises
        ------
        OutsideTheRingError, RingError, AnswerError
            The difference cannot be written in the ring.
        """
        numerator = RingReader(chain.ring, numbers=known).read(tree).numerator

        # Elements that replace the pose's names, by the names' places in the ring.
        T = chain.tool_pose
        entries = zip(POSE, [*T[:3, 3], *T[:3, :3].flat], strict=True)
        pose = {chain.ring.place("constant", chain.names[name]): entry for name, entry in entries}

        used: set[int] = set()
        for monomial in numerator.terms:
            used.update(place for place, exponent in enumerate(monomial) if exponent)
        return translated(
            numerator, chain.ring, {place: pose[place] for place in used & pose.keys()}
        )

    @property
    def _values(self) -> dict[str, Array | float]:
        """Values of all names at the random poses, shape (S,) each or (), SI units and rad."""
        return {**self.context.poses.values, **_joints(self.context.poses.q)}

    def residual(self, tree: Tree, values: dict[str, Array | float] | None = None) -> Array:
        """Return the difference of an equation's sides relative to the size of its terms, shape (S,); inf for no value.

        The values of names are those at the random poses unless given.
        """
        given = self._values if values is None else values
        relative = np.asarray(doubles(tree, given)) / np.maximum(
            _sizes(tree, given), _SMALLEST_SIZE
        )
        residual: Array = np.broadcast_to(
            np.nan_to_num(relative, nan=np.inf), np.shape(given["px"])
        )
        return residual

    def _holds_always(self, tree: Tree) -> bool:
        """Whether an equation holds at one of several random poses that are unrelated to the joint values.

        An equation with roots may hold at a part of them only.
        """
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
        """Return the share of poses, in %, at which an equation holds that is true of some solution of every pose.

        An equation with an explicit root, such as c1 = px/sqrt(px^2 + py^2), holds for some of the solutions of a pose.
        None for an equation that is not of this kind.
        """
        poses = self.context.solved_poses
        truths = poses.truths
        holds = np.zeros(truths.shape[:2], dtype=bool)
        for b in range(truths.shape[1]):
            values = {**poses.values, **_joints(truths[:, b])}
            holds[:, b] = np.abs(self.residual(tree, values)) < _ZERO
        share = 100 * float(np.mean(np.abs(self.residual(tree)) < _ZERO))
        holds_for_a_root = poses.has_closed_form and np.all(holds.any(axis=1))
        return share if share > 0 and holds_for_a_root else None

    def _is_in_names(self, tree: Tree) -> bool:
        """Whether an equation has lengths by name, and no number that may stand for one."""
        lengths = {*table_lengths(self.context.description), *self.context.description.parameters}
        numbers = [
            part
            for part in parts_of(tree)
            if isinstance(part, Number) and part.value.denominator != 1
        ]
        return bool(names_of(tree) & lengths) and not numbers

    def _determines(self) -> bool:
        """Whether the equations determine the joint where those of earlier steps are known.

        They do if its column of their Jacobian, by all joints that are not known, is independent of the other columns:
        rank(J) > rank(J without the column), at most of the poses.
        """
        n = self.context.description.n
        own = self.step.joint
        free = [j for j in range(n) if j not in self.before]
        holds = np.all([np.abs(self.residual(tree)) < _ZERO for tree in self.differences], axis=0)
        poses = self.context.poses.at(np.flatnonzero(holds)[:_RANK_POSES])

        # J_mk = (f_m(q + h e_k) - f_m(q)) / h for each equation f_m = 0, relative to the size of its terms
        J = np.zeros((len(poses.q), len(self.differences), len(free)))
        values = {**poses.values, **_joints(poses.q)}
        for m, tree in enumerate(self.differences):
            size = np.maximum(_sizes(tree, values), _SMALLEST_SIZE)
            here = np.asarray(doubles(tree, values))
            for k, j in enumerate(free):
                unit = poses.scale if poses.description.kinds[j] == "P" else 1.0
                moved = poses.q + _STEP * unit * np.eye(n)[j]
                there = np.asarray(doubles(tree, {**poses.values, **_joints(moved)}))
                J[:, m, k] = (there - here) / _STEP / size
        J[np.abs(J) < _NO_CHANGE] = 0

        without = np.delete(J, free.index(own), axis=2)
        return bool(np.mean(_ranks(J) > _ranks(without)) > 0.5)

    def _wrong(self, k: int, tree: Tree, difference: str | None) -> Part:
        """Return the verdict on a wrong equation k, from 0, with its mistake, and the pose where it is most wrong."""
        residual = np.abs(self.residual(tree))
        s = int(np.argmax(residual))
        values = self._values

        def number_at_s(x: object) -> float:
            return float(np.broadcast_to(np.asarray(x), len(residual))[s])

        def finite_at_s(side: Tree) -> float | None:
            value = number_at_s(doubles(side, values))
            return value if np.isfinite(value) else None

        left, right = self.step.equations[k]
        state = {name: number_at_s(values[name]) for name in POSE_NAMES}
        state |= {f"q{i + 1}": float(x) for i, x in enumerate(self.context.poses.q[s])}
        witness = Witness(state, finite_at_s(left), finite_at_s(right))
        subject = f"equation {k + 1}" if len(self.differences) > 1 else "equation"
        part = Part(
            Verdict.WRONG,
            f"{subject}: no identity of the arm",
            difference=difference,
            witness=witness,
        )
        if self.context.explain:
            part.mistakes = [self._mistake(tree) or ("equation_wrong", "")]
        return part

    # Mistakes

    def _mistake(self, tree: Tree) -> tuple[str, str] | None:
        """Return the mistake whose correction makes a wrong equation an identity, and a detail."""
        changed = self._single_change(tree)
        if changed is not None:
            return changed, ""

        joints = _joints(self.context.poses.q)
        for mistake, values in self.context.misread(self.context.poses):
            if np.max(np.abs(self.residual(tree, {**values, **joints}))) < _ZERO:
                return mistake, ""

        zero = self._with_a_length_of_zero(tree)
        if zero is None:
            return None
        step = self.context.derived(self.step.joint)
        if self.step.joint == 0 and step is not None and zero in names_in(step.elements):
            return "shoulder_offset_forgotten", ""
        return "length_taken_as_zero", zero

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
        poses = self.context.poses.at(range(min(_CHANGE_POSES, len(self.context.poses.q))))
        formula = EditedDoubles(tree, {**poses.values, **_joints(poses.q)})
        lengths = self.context.lengths([tree])
        size = np.max(np.abs(np.asarray(formula.numbers))) + self.context.poses.scale
        own = self.step.joint
        edits = [
            *_with_a_length(tree, lengths, own),
            *_inner_angles(tree, own),
            *edits_of_parts(tree, lengths),
        ]
        for edit in edits:
            if edit.old is tree and edit.mistake in _OF_BOTH_SIDES:
                continue
            try:
                numbers = np.nan_to_num(np.asarray(formula.of(edit.tree)), nan=np.inf)
            except AnswerError:  # it needs a joint that the arm does not have
                continue
            if np.max(np.abs(numbers)) < _ZERO * size and not self._holds_always(edit.tree):
                return edit.mistake
        return None


@dataclass(frozen=True, eq=False)
class _EquationsAtPoses:
    """Equations at poses of which each may be tried with many joint values.

    Attributes
    ----------
    differences
        Left less right side of each equation.
    poses
        The poses.
    used
        Names in the equations.
    """

    differences: Sequence[Tree]
    poses: Poses
    used: set[str]

    def values(self, rows: NDArray[np.intp], q: Array) -> dict[str, Array | float]:
        """Return the values of names at poses of some indices (k,) with joint values (k, n), rad and m."""
        count = len(self.poses.q)
        pose = {
            name: np.broadcast_to(x, count)[rows]
            for name, x in self.poses.values.items()
            if name in self.used
        }
        return {**pose, **_joints(q)}

    def residual_on(self, rows: NDArray[np.intp], q: Array) -> Residual:
        """Return the residual relative to the largest size of the equations' terms at each pose.

        The largest size is that over all joint values q (k, n) of the pose, whose indices are ``rows`` (k,): a factor
        that is common to all terms has roots too, at which all sizes vanish.
        """
        values = self.values(rows, q)
        sizes = []
        for tree in self.differences:
            size = np.nan_to_num(np.broadcast_to(_sizes(tree, values), len(rows)))
            largest = np.zeros(int(rows.max()) + 1)
            np.maximum.at(largest, rows, size)
            sizes.append(np.maximum(largest, _SMALLEST_SIZE))
        return partial(self._residual, sizes)

    def _residual(self, sizes: Sequence[Array], rows: NDArray[np.intp], q: Array) -> Array:
        """Return max |f_m(q)| / size_m over the equations f_m = 0, shape (k,)."""
        values = self.values(rows, q)
        residual: Array = np.zeros(len(rows))
        for tree, size in zip(self.differences, sizes, strict=True):
            residual = np.maximum(residual, np.abs(np.asarray(doubles(tree, values))) / size[rows])
        return residual


def _joints(q: Array) -> dict[str, Array | float]:
    """Return joint values (S, n), rad and m, by name."""
    return {f"q{i + 1}": column for i, column in enumerate(q.T)}


def _sizes(tree: Tree, values: Mapping[str, Array | float]) -> Array:
    """Return the size of a formula before its terms cancel, shape (S,) or ().

    size(a + b) = size(a) + size(b), size(a b) = size(a) size(b), size(a / b) = size(a) / |b|, else size(a) = |a|
    """
    size: Array = np.ones(())
    match tree:
        case Sum(terms):
            size = np.sum(np.broadcast_arrays(*(_sizes(term, values) for _, term in terms)), axis=0)
        case Product(factors):
            for is_factor, factor in factors:
                if is_factor:
                    size = size * _sizes(factor, values)
                else:
                    size = size / np.abs(np.asarray(doubles(factor, values)))
        case _:
            size = np.abs(np.asarray(doubles(tree, values)))
    return size


def _with_a_length(tree: Tree, lengths: Lengths, joint: int) -> Iterator[Edit]:
    """Yield an equation with a constant length, or its square, added to one of its sides."""
    mistake = "shoulder_offset_forgotten" if joint == 0 else "length_forgotten"
    for length in lengths.trees:
        for term, name in ((length, mistake), (square_of(length), "length_forgotten")):
            for added in (True, False):
                new = with_term(tree, added, term)
                yield Edit(name, new, tree, new)


def _inner_angles(tree: Tree, joint: int) -> Iterator[Edit]:
    """Yield a law of cosines with the angle inside the triangle instead of the joint's.

    The inner angle is pi - q, and cos(pi - q) = -cos(q).
    """
    squares = [part for part in parts_of(tree) if isinstance(part, Power)]
    if len(squares) < 2:
        return
    own = f"q{joint + 1}"
    calls = [part for part in parts_of(tree) if isinstance(part, Call) and names_of(part) == {own}]
    if {call.function for call in calls} == {"cos"}:
        new = with_calls_changed(
            tree, ("cos",), lambda call: minus(call) if names_of(call) == {own} else call
        )
        yield Edit("supplement", new, tree, new)


def _ranks(J: Array) -> NDArray[np.int_]:
    """Return the ranks of matrices (S, m, k), shape (S,): the number of singular values that are not small."""
    if not J.shape[2]:
        return np.zeros(len(J), dtype=int)
    singular_values = np.linalg.svd(np.nan_to_num(J), compute_uv=False)
    largest = np.maximum(singular_values[:, :1], 1e-12)
    ranks: NDArray[np.int_] = np.sum(singular_values > _SAME_RANK * largest, axis=1)
    return ranks


def _shown(element: Element) -> str:
    """Return an element as text, cut off if it is long."""
    text = plain_text(element)
    return text if len(text) <= _MAX_SHOWN else f"{text[: _MAX_SHOWN - 3]}..."


def _factors_of_zero(difference: Tree) -> list[Tree]:
    """Return the factors of the one side of an equation whose other side is zero; none for other equations."""
    match difference:
        case Sum(((True, left), (False, right))):
            if _is_zero(right) and not _is_zero(left):
                return _factors(left)
            if _is_zero(left) and not _is_zero(right):
                return _factors(right)
    return []


def _is_zero(tree: Tree) -> bool:
    return isinstance(tree, Number) and tree.value == 0


def _factors(tree: Tree) -> list[Tree]:
    """Return the factors of a numerator, without their powers."""
    match tree:
        case Sum(((_, term),)):
            return _factors(term)
        case Product(factors):
            of_numerator: list[Tree] = []
            for is_factor, factor in factors:
                if is_factor:
                    of_numerator += _factors(factor)
            return of_numerator
        case Power(base, Number(value)) if value > 0:
            return _factors(base)
    return [tree]
