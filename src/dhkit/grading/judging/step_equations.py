"""Judging of the equations of a step of inverse kinematics: identities of the arm that determine a joint."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Sum, Tree
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.answers.inverse_steps import GivenStep
from dhkit.grading.judging.changed_formulas import square_of
from dhkit.grading.judging.inverse_edits import Edit, Lengths, edits_of_parts
from dhkit.grading.judging.numeric import EditedDoubles, doubles, names_of
from dhkit.grading.judging.quotients import OutsideTheRingError, RingReader
from dhkit.grading.judging.step_context import Part, StepContext
from dhkit.grading.report import Verdict, Witness
from dhkit.symbolic import table_lengths
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.inverse.chain import POSE, Chain
from dhkit.symbolic.ring import Element, RingError
from dhkit.symbolic.ring.ring import translated

MAX_SHOWN = 200
"""Longest difference of an equation's sides that is printed, in characters."""
FREE_POSES = 8
"""Number of random poses, unrelated to the joints, at which an equation that says nothing of the arm holds."""
ZERO = 1e-9
"""Largest difference of an equation's sides, relative to their size, that is rounding."""
OF_BOTH_SIDES = ("square_forgotten", "square_too_much", "root_forgotten")
"""Changes of both sides of an equation at once, which are no correction."""
STEP = 1e-6
"""Step of finite differences, rad and m."""
SAME_RANK = 1e-5
"""Singular value, as a share of the largest, below which an equation adds nothing to the others."""


class Equations:
    """Judges the equations of one step."""

    def __init__(self, context: StepContext, step: GivenStep, before: Sequence[int]) -> None:
        self.context, self.step, self.before = context, step, before
        self.differences = [Sum(((True, left), (False, right))) for left, right in step.equations]

    def part(self) -> Part:
        """Return the verdict on the equations together."""
        joints = {f"q{i + 1}" for i in range(self.context.description.n)}
        known = {*POSE_NAMES, *self.context.poses.values, *joints, "pi"}
        for tree in self.differences:
            if strange := sorted(names_of(tree) - known):
                raise AnswerError(f"equation: unknown name {strange[0]!r}")
        statements = []
        verdict = Verdict.CORRECT
        for k, tree in enumerate(self.differences):
            found, statement, difference = self._identity(tree)
            if found is Verdict.WRONG:
                return self._wrong(k, tree, difference)
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
        return Part(verdict, f"equation: {statements[0]}")

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
            (numbers, {**table, **values}, "proved: an identity of the arm with its own lengths"),
        ):
            try:
                element = self._element(tree, chain, known)
            except (OutsideTheRingError, RingError, AnswerError):
                continue
            if element.is_zero:
                return Verdict.CORRECT, statement, None
            difference = difference or _shown(element)
        if np.max(np.abs(self.residual(tree))) > ZERO:
            return Verdict.WRONG, "", difference
        return Verdict.UNDECIDED, f"holds at {len(self.context.poses.q)} random poses; tried, not proved", None

    def _element(self, tree: Tree, chain: Chain, known: dict[str, Fraction]) -> Element:
        """Return a difference with the pose of the arm put in, up to a denominator."""
        quotient = RingReader(chain.ring, numbers=known).read(tree)
        T = chain.tool_pose
        entries = zip(POSE, [*T[:3, 3], *T[:3, :3].flat], strict=True)
        places = {chain.ring.place("constant", chain.names[name]): entry for name, entry in entries}
        used = {k for monomial in quotient.numerator.terms for k, e in enumerate(monomial) if e and k in places}
        return translated(quotient.numerator, chain.ring, {k: places[k] for k in used})

    def _values(self, q: Array) -> dict[str, Array | float]:
        return {**self.context.poses.values, **{f"q{i + 1}": column for i, column in enumerate(q.T)}}

    def residual(self, tree: Tree, values: dict[str, Array | float] | None = None) -> Array:
        """Return the difference of an equation's sides relative to the size of its terms, shape (S,)."""
        given = self._values(self.context.poses.q) if values is None else values
        size = sum(np.abs(np.asarray(doubles(part, given))) for part in _terms(tree))
        relative = np.asarray(doubles(tree, given)) / np.maximum(size, 1e-12)
        residual: Array = np.broadcast_to(np.nan_to_num(relative, nan=np.inf), np.shape(given["px"]))
        return residual

    def _holds_always(self, tree: Tree) -> bool:
        """Whether an equation holds for poses that have nothing to do with the joints."""
        rng = np.random.default_rng(5)
        n, scale = self.context.description.n, self.context.poses.scale
        T = np.tile(np.eye(4), (FREE_POSES, 1, 1))
        T[:, :3, :3] = Rotation.random(FREE_POSES, rng=rng).as_matrix()
        T[:, :3, 3] = rng.uniform(-scale, scale, (FREE_POSES, 3))
        free = Equations(self.context, self.step, self.before)
        poses = replace(self.context.poses, q=rng.uniform(-2, 2, (FREE_POSES, n)), T=T, known=None)
        values = {**poses.values, **{f"q{i + 1}": column for i, column in enumerate(poses.q.T)}}
        return bool(np.max(np.abs(free.residual(tree, values))) < ZERO)

    def _determines(self) -> bool:
        """Whether the equations determine the joint where those of earlier steps are known."""
        n, own = self.context.description.n, self.step.joint
        free = [j for j in range(n) if j not in self.before]
        poses = self.context.poses.at(range(min(8, len(self.context.poses.q))))
        columns = []
        for j in free:
            pushed = poses.q + STEP * np.eye(n)[j]
            sides = []
            for tree in self.differences:
                at, after = (
                    np.asarray(doubles(tree, {**poses.values, **{f"q{i + 1}": c for i, c in enumerate(q.T)}}))
                    for q in (poses.q, pushed)
                )
                sides.append(np.broadcast_to((after - at) / STEP, len(poses.q)))
            columns.append(sides)
        J = np.array(columns).transpose(2, 1, 0)  # (S, equations, free joints)
        own_column = free.index(own)
        without = np.delete(J, own_column, axis=2)
        return bool(np.mean(_ranks(J) > _ranks(without)) > 0.5)

    def _wrong(self, k: int, tree: Tree, difference: str | None) -> Part:
        """Return the part of a wrong equation k, with its mistake."""
        residual = np.abs(self.residual(tree))
        s = int(np.argmax(residual))
        values = self._values(self.context.poses.q)
        left, right = (
            float(np.broadcast_to(doubles(side, values), len(residual))[s]) for side in self.step.equations[k]
        )
        state = {name: float(np.broadcast_to(values[name], len(residual))[s]) for name in POSE_NAMES}
        state |= {f"q{i + 1}": float(x) for i, x in enumerate(self.context.poses.q[s])}
        witness = Witness(state, left if np.isfinite(left) else None, right if np.isfinite(right) else None)
        which = f"equation {k + 1}" if len(self.differences) > 1 else "equation"
        part = Part(Verdict.WRONG, f"{which}: no identity of the arm", difference=difference, witness=witness)
        if self.context.explain:
            mistake = self._mistake(tree)
            part.mistakes = [(mistake, "")] if mistake else [("equation_wrong", "")]
        return part

    def _mistake(self, tree: Tree) -> str | None:
        """Return the mistake whose correction makes a wrong equation an identity."""
        poses = self.context.poses.at(range(min(40, len(self.context.poses.q))))
        values = {**poses.values, **{f"q{i + 1}": column for i, column in enumerate(poses.q.T)}}
        formula, lengths = EditedDoubles(tree, values), self.context.lengths([tree])
        size = np.max(np.abs(np.asarray(formula.numbers))) + self.context.poses.scale
        for edit in (*_with_a_length(tree, lengths, self.step.joint), *edits_of_parts(tree, lengths)):
            if edit.old is tree and edit.mistake in OF_BOTH_SIDES:
                continue
            off = np.max(np.abs(np.nan_to_num(np.asarray(formula.of(edit.tree)), nan=np.inf)))
            if off < ZERO * size and not self._holds_always(edit.tree):
                return edit.mistake
        return None


def _with_a_length(tree: Tree, lengths: Lengths, joint: int) -> Iterator[Edit]:
    """Yield an equation with a constant length, or its square, added to one of its sides."""
    mistake = "shoulder_offset_forgotten" if joint == 0 else "length_forgotten"
    for length in lengths.trees:
        for term, name in ((length, mistake), (square_of(length), "length_forgotten")):
            for added in (True, False):
                new = Sum(((True, tree), (added, term)))
                yield Edit(name, new, tree, new)


def _terms(tree: Tree) -> list[Tree]:
    """Return the terms of a sum, with those of sums in it."""
    if isinstance(tree, Sum):
        return [part for _, term in tree.terms for part in _terms(term)]
    return [tree]


def _ranks(J: Array) -> NDArray[np.int_]:
    """Return the ranks of matrices (S, m, k), shape (S,)."""
    if not J.shape[2]:
        return np.zeros(len(J), dtype=int)
    sizes = np.linalg.svd(np.nan_to_num(J), compute_uv=False)
    ranks: NDArray[np.int_] = np.sum(sizes > SAME_RANK * np.maximum(sizes[:, :1], 1e-12), axis=1)
    return ranks


def _shown(element: Element) -> str:
    text = plain_text(element)
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}..."
