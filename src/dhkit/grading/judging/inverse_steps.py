"""Judging of inverse kinematics that is handed in step by step: an equation for each joint, and its solution.

An equation is right if it is an identity of the arm: true whenever the pose is that of the joint values. This is proved
in the exact ring where the ring contains it, else tried. It counts if it is no identity of all poses, and determines
its joint from those of earlier steps. A solution is tried at random poses, with the joints of earlier steps at their
true values: a joint that is right in terms of wrong earlier ones is right.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dhkit.description import Array, Description
from dhkit.errors import AnswerError, DescriptionError
from dhkit.expressions.syntax import Name, Number, Product, Sum, Tree
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.answers.inverse_steps import GivenStep
from dhkit.grading.judging.inverse_branch import Branch
from dhkit.grading.judging.inverse_edits import Edit, Lengths, edits_of_parts
from dhkit.grading.judging.inverse_mistakes import Search, lengths_of
from dhkit.grading.judging.inverse_poses import CLOSES, KNOWN, MATCHES, Mask, Poses
from dhkit.grading.judging.numeric import EditedDoubles, doubles, names_of
from dhkit.grading.judging.quotients import OutsideTheRingError, RingReader
from dhkit.grading.mistakes.library import hint_of, sentence_of
from dhkit.grading.report import Diagnosis, Entry, KinematicJudgement, Note, NoteKind, Verdict, Witness, entry_name
from dhkit.symbolic import InverseDerivation, inverse_derivation, table_lengths
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.inverse.chain import POSE, Chain
from dhkit.symbolic.inverse.forms import Circle
from dhkit.symbolic.inverse.steps import Step as DerivedStep
from dhkit.symbolic.ring import Element, RingError
from dhkit.symbolic.ring.ring import translated

MAX_SHOWN = 200
"""Longest difference of an equation's sides that is printed, in characters."""
FREE_POSES = 8
"""Number of random poses, unrelated to the joints, at which an equation that says nothing of the arm holds."""
ZERO = 1e-9
"""Largest difference of an equation's sides, relative to their size, that is rounding."""
STEP = 1e-6
"""Step of finite differences, rad and m."""
SAME_RANK = 1e-5
"""Singular value, as a share of the largest, below which an equation adds nothing to the others."""


@dataclass
class Part:
    """The verdict on a part of a step: its equations, or its solutions."""

    verdict: Verdict
    statement: str
    mistakes: list[tuple[str, str]] = field(default_factory=list)
    """Mistakes with details."""
    difference: str | None = None
    witness: Witness | None = None


def judge_steps(
    description: Description, steps: Sequence[GivenStep], samples: int = 500, seed: int = 0, *, explain: bool = True
) -> KinematicJudgement:
    """Judge the steps of an arm's inverse kinematics, each with an entry of its own.

    Parameters
    ----------
    description
        The robot.
    steps
        The steps in the order in which joints are found.
    samples, seed
        Number and seed of the random poses at which solutions are tried.
    explain
        Whether to look for mistakes; verdicts do not depend on it.

    Raises
    ------
    AnswerError
        A joint that the arm does not have, or that two steps find.
    """
    n = description.n
    for k, step in enumerate(steps, start=1):
        if not 0 <= step.joint < n:
            raise AnswerError(f"ik, step {k}: joint {step.joint + 1}; expected 1 to {n}")
        if step.joint in [other.joint for other in steps[: k - 1]]:
            raise AnswerError(f"ik, step {k}: joint {step.joint + 1} has a step already")
    with np.errstate(all="ignore"):
        return _Judge(description, Poses.random(description, samples, seed), explain).judgement(steps)


class _Judge:
    def __init__(self, description: Description, poses: Poses, explain: bool) -> None:
        self.description, self.poses, self.explain = description, poses, explain
        try:
            self.derivation: InverseDerivation | None = inverse_derivation(description)
        except DescriptionError:
            self.derivation = None

    def judgement(self, steps: Sequence[GivenStep]) -> KinematicJudgement:
        entries: list[Entry] = []
        diagnosis: list[Diagnosis] = []
        notes: list[Note] = []
        wrong: list[int] = []
        for k, step in enumerate(steps):
            before = [other.joint for other in steps[:k]]
            entry, found, note = self._step(k, step, before, [j for j in before if j in wrong])
            entries.append(entry)
            diagnosis += found
            notes += note
            if entry.verdict.severity >= Verdict.WRONG.severity:
                wrong.append(step.joint)
        missing = sorted({*range(self.description.n)} - {step.joint for step in steps})
        if missing:
            named = ", ".join(f"q{j + 1}" for j in missing)
            entries.append(Entry("ik", (len(steps),), Verdict.INCOMPLETE, statement=f"no step finds {named}"))
        if not self.poses.asks_rotation and self.poses.pose_parts:
            notes.append(Note(NoteKind.ASKED_FOR, "ik", self.poses.pose_parts))
        return KinematicJudgement(tuple(entries), tuple(diagnosis), tuple(notes))

    def _step(
        self, k: int, step: GivenStep, before: Sequence[int], wrong: Sequence[int]
    ) -> tuple[Entry, list[Diagnosis], list[Note]]:
        """Return the entry of step k, from 0, its diagnosis, and notes."""
        if step.error:
            return Entry("ik", (k,), Verdict.UNREADABLE, step.text, statement=step.error), [], []
        parts, notes = [], []
        try:
            if step.equations:
                parts.append(_Equations(self, step, before).part())
            if step.solutions:
                part, roots = _Solutions(self, step, before).part()
                parts.append(part)
                if roots is not None and roots[0] < roots[1]:
                    notes.append(Note(NoteKind.ROOTS_MISSING, entry_name("ik", (k,)), (str(roots[0]), str(roots[1]))))
        except AnswerError as error:
            return Entry("ik", (k,), Verdict.UNREADABLE, step.text, statement=str(error)), [], []
        worst = max(parts, key=lambda part: part.verdict.severity)
        statement = "; ".join(part.statement for part in parts)
        used = {name for tree in step.solutions for name in names_of(tree)}
        follows = [f"q{j + 1}" for j in wrong if f"q{j + 1}" in used]
        if follows and worst.verdict.passes:
            statement += f"; right in terms of {', '.join(follows)}, which {'is' if len(follows) == 1 else 'are'} wrong"
        found = [self._diagnosis(k, step, part) for part in parts if not part.verdict.passes and part.mistakes]
        difference = next((part.difference for part in parts if part.difference), None)
        witness = next((part.witness for part in parts if part.witness), None)
        entry = Entry("ik", (k,), worst.verdict, step.text, statement=statement, difference=difference, witness=witness)
        return entry, found, notes

    def _diagnosis(self, k: int, step: GivenStep, part: Part) -> Diagnosis:
        mistake, detail = part.mistakes[0]
        where = f"ik, step {k + 1}, q{step.joint + 1}"
        worked = self.worked(step.joint)
        hint = f"{hint_of(mistake)} {worked}".strip()
        sentence = sentence_of(mistake, f"q{step.joint + 1}", detail)
        return Diagnosis(mistake, sentence, where, (entry_name("ik", (k,)),), hint)

    def worked(self, joint: int) -> str:
        """Return where the worked solution finds a joint, from 0, as a sentence; empty without one."""
        step = self.derived(joint)
        if self.derivation is None or step is None:
            return ""
        return f"It is step {self.derivation.steps.index(step) + 1} of the worked solution: {step.look}"

    def derived(self, joint: int) -> DerivedStep | None:
        """Return the derivation's step for a joint, from 0; None without a derivation."""
        steps = self.derivation.steps if self.derivation is not None else ()
        return next((step for step in steps if step.unknown is not None and step.unknown.joint == joint), None)

    def lengths(self, trees: Sequence[Tree]) -> Lengths:
        """Return the lengths that formulas may contain: by name where formulas use the names of the table's."""
        names, table = set().union(*map(names_of, trees)), table_lengths(self.description)
        if not names & {*table}:
            return lengths_of(self.description)
        known = (*self.description.parameters, *table)
        return Lengths(known, tuple(Name(name, 0) for name in known))

    @cached_property
    def chains(self) -> tuple[Chain, Chain]:
        """The arm with named lengths, and with numbers."""
        named, numbers = (Chain.of(self.description, named=named, in_joint_values=True) for named in (True, False))
        return named, numbers


class _Equations:
    """Judges the equations of one step."""

    def __init__(self, judge: _Judge, step: GivenStep, before: Sequence[int]) -> None:
        self.judge, self.step, self.before = judge, step, before
        self.differences = [Sum(((True, left), (False, right))) for left, right in step.equations]

    def part(self) -> Part:
        joints = {f"q{i + 1}" for i in range(self.judge.description.n)}
        known = {*POSE_NAMES, *self.judge.poses.values, *joints, "pi"}
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
        named, numbers = self.judge.chains
        table = table_lengths(self.judge.description)
        values = {
            name: value.rational
            for name, value in self.judge.description.parameters.items()
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
        if np.max(np.abs(self._residual(tree))) > ZERO:
            return Verdict.WRONG, "", difference
        return Verdict.UNDECIDED, f"holds at {len(self.judge.poses.q)} random poses; tried, not proved", None

    def _element(self, tree: Tree, chain: Chain, known: dict[str, Fraction]) -> Element:
        """Return a difference with the pose of the arm put in, up to a denominator."""
        quotient = RingReader(chain.ring, numbers=known).read(tree)
        T = chain.tool_pose
        entries = zip(POSE, [*T[:3, 3], *T[:3, :3].flat], strict=True)
        places = {chain.ring.place("constant", chain.names[name]): entry for name, entry in entries}
        used = {k for monomial in quotient.numerator.terms for k, e in enumerate(monomial) if e and k in places}
        return translated(quotient.numerator, chain.ring, {k: places[k] for k in used})

    def _values(self, q: Array) -> dict[str, Array | float]:
        return {**self.judge.poses.values, **{f"q{i + 1}": column for i, column in enumerate(q.T)}}

    def _residual(self, tree: Tree, values: dict[str, Array | float] | None = None) -> Array:
        """Return the difference of an equation's sides relative to the size of its terms, shape (S,)."""
        given = self._values(self.judge.poses.q) if values is None else values
        size = sum(np.abs(np.asarray(doubles(part, given))) for part in _terms(tree))
        relative = np.asarray(doubles(tree, given)) / np.maximum(size, 1e-12)
        residual: Array = np.broadcast_to(np.nan_to_num(relative, nan=np.inf), np.shape(given["px"]))
        return residual

    def _holds_always(self, tree: Tree) -> bool:
        """Whether an equation holds for poses that have nothing to do with the joints."""
        rng = np.random.default_rng(5)
        n, scale = self.judge.description.n, self.judge.poses.scale
        T = np.tile(np.eye(4), (FREE_POSES, 1, 1))
        T[:, :3, :3] = Rotation.random(FREE_POSES, rng=rng).as_matrix()
        T[:, :3, 3] = rng.uniform(-scale, scale, (FREE_POSES, 3))
        free = _Equations(self.judge, self.step, self.before)
        poses = replace(self.judge.poses, q=rng.uniform(-2, 2, (FREE_POSES, n)), T=T, known=None)
        values = {**poses.values, **{f"q{i + 1}": column for i, column in enumerate(poses.q.T)}}
        return bool(np.max(np.abs(free._residual(tree, values))) < ZERO)

    def _determines(self) -> bool:
        """Whether the equations determine the joint where those of earlier steps are known."""
        n, own = self.judge.description.n, self.step.joint
        free = [j for j in range(n) if j not in self.before]
        poses = self.judge.poses.at(range(min(8, len(self.judge.poses.q))))
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
        residual = np.abs(self._residual(tree))
        s = int(np.argmax(residual))
        values = self._values(self.judge.poses.q)
        left, right = (
            float(np.broadcast_to(doubles(side, values), len(residual))[s]) for side in self.step.equations[k]
        )
        state = {name: float(np.broadcast_to(values[name], len(residual))[s]) for name in POSE_NAMES}
        state |= {f"q{i + 1}": float(x) for i, x in enumerate(self.judge.poses.q[s])}
        witness = Witness(state, left if np.isfinite(left) else None, right if np.isfinite(right) else None)
        which = f"equation {k + 1}" if len(self.differences) > 1 else "equation"
        part = Part(Verdict.WRONG, f"{which}: no identity of the arm", difference=difference, witness=witness)
        if self.judge.explain:
            mistake = self._mistake(tree)
            part.mistakes = [(mistake, "")] if mistake else [("equation_wrong", "")]
        return part

    def _mistake(self, tree: Tree) -> str | None:
        """Return the mistake whose correction makes a wrong equation an identity."""
        poses = self.judge.poses.at(range(min(40, len(self.judge.poses.q))))
        values = {**poses.values, **{f"q{i + 1}": column for i, column in enumerate(poses.q.T)}}
        formula, lengths = EditedDoubles(tree, values), self.judge.lengths([tree])
        size = np.max(np.abs(np.asarray(formula.numbers))) + self.judge.poses.scale
        for edit in (*_with_a_length(tree, lengths, self.step.joint), *edits_of_parts(tree, lengths)):
            off = np.max(np.abs(np.nan_to_num(np.asarray(formula.of(edit.tree)), nan=np.inf)))
            if off < ZERO * size and not self._holds_always(edit.tree):
                return edit.mistake
        return None


class _Solutions:
    """Judges the solutions of one step."""

    def __init__(self, judge: _Judge, step: GivenStep, before: Sequence[int]) -> None:
        self.judge, self.step, self.before = judge, step, before

    def part(self) -> tuple[Part, tuple[int, int] | None]:
        """Return the verdict, and the numbers of roots that are given and that there are."""
        own, n = self.step.joint, self.judge.description.n
        values = self.judge.poses.values
        for tree in self.step.solutions:
            names = names_of(tree)
            if f"q{own + 1}" in names:
                raise AnswerError(f"solution: uses q{own + 1}, which it is to give")
            later = [f"q{j + 1}" for j in range(n) if j not in self.before and f"q{j + 1}" in names]
            if later:
                return Part(Verdict.INCOMPLETE, f"solution: uses {later[0]}, which no earlier step finds"), None
            if strange := sorted(names - {*values, "pi"} - {f"q{j + 1}" for j in self.before}):
                raise AnswerError(f"solution: unknown name {strange[0]!r}")
        statements, found = [], np.zeros((0, 0), dtype=bool)
        for k, tree in enumerate(self.step.solutions):
            branch, right = self._best(tree)
            which = f"solution {k + 1}" if len(self.step.solutions) > 1 else "solution"
            if not right:
                return self._wrong(which, branch), None
            hits = self._roots(branch)
            if any(np.array_equal(hits, other) for other in found):
                part = Part(Verdict.WRONG, f"{which}: gives the same as another", [("duplicate_branch", "")])
                return part, None
            found = np.vstack([found, hits[None]]) if found.size else hits[None]
            statements.append(which)
        count = len(self.judge.poses.q)
        statement = f"solution: right at {count} poses given the joints before; tried, not proved"
        return Part(Verdict.CORRECT, statement), (len(self.step.solutions), self._count())

    def _branch(self, tree: Tree, known: Array) -> Branch:
        """Return a branch with a formula for this joint, earlier joints known, and later ones as they follow."""
        rows = np.flatnonzero(np.isfinite(known).all(axis=1))
        poses = replace(self.judge.poses.at(rows), known=known[rows])
        given = {j: Name(f"{KNOWN}{j + 1}", 0) for j in range(self.judge.description.n)}
        nothing = Product(((True, Number(Fraction(0), "0", 0)), (True, Name(f"q{self.step.joint + 1}", 0))))
        trees: list[Tree] = []
        for j, name in given.items():
            if j == self.step.joint:
                trees.append(tree)
            elif j in self.before:
                trees.append(name)
            else:  # behind this joint, in the order of evaluation
                trees.append(Sum(((True, name), (True, nothing))))
        return Branch(poses, tuple(trees))

    def _best(self, tree: Tree) -> tuple[Branch, bool]:
        """Return the branch at whose earlier joints a formula is right most often, and whether it always is."""
        own = self.step.joint
        solutions = self.judge.poses.solutions
        candidates = [self.judge.poses.q, *(solutions[:, b] for b in range(solutions.shape[1]))]
        best: tuple[float, Branch] | None = None
        for known in candidates:
            branch = self._branch(tree, known)
            if not len(branch.poses.q):
                continue
            share = float(np.mean(branch.agrees(own, branch.q[:, own])))
            if best is None or share > best[0]:
                best = share, branch
            if share == 1.0:
                break
        if best is None:
            raise AnswerError("solution: the arm has no poses to try it at")
        return best[1], best[0] == 1.0

    def _roots(self, branch: Branch) -> NDArray[np.bool_]:
        """Return which joint values, rounded, a formula gives at the poses: equal for equal formulas."""
        x = np.remainder(branch.q[:, self.step.joint], 2 * np.pi)
        whole = np.zeros(len(self.judge.poses.q))
        whole[: len(x)] = x
        hits: NDArray[np.bool_] = np.round(whole / (10 * MATCHES)).astype(np.int64)
        return hits

    def _count(self) -> int:
        """Return the number of values that this joint has in general, given the joints of earlier steps."""
        poses, own = self.judge.poses, self.step.joint
        truths = poses.truths
        alive: Mask = np.all(np.isfinite(truths), axis=-1)
        for j in self.before:
            alive &= poses.gaps(truths[..., j], poses.q[:, None, j], j) < MATCHES
        counts = []
        for s in range(min(60, len(truths))):
            values = truths[s, alive[s], own]
            distinct: list[float] = []
            for value in values:
                if all(poses.gaps(np.array(value), np.array(other), own) >= MATCHES for other in distinct):
                    distinct.append(float(value))
            counts.append(len(distinct))
        return int(np.median(counts)) if counts else 0

    def _wrong(self, which: str, branch: Branch) -> Part:
        own = self.step.joint
        agrees = branch.agrees(own, branch.q[:, own])
        s = int(np.argmax(~agrees))
        pose = {name: float(np.asarray(branch.poses.values[name])[s]) for name in POSE_NAMES}
        pose |= {f"q{j + 1}": float(branch.q[s, j]) for j in self.before}
        answer = float(branch.q[s, own])
        truth = float(np.asarray(branch.poses.values[f"{KNOWN}{own + 1}"])[s])
        witness = Witness(pose, answer if np.isfinite(answer) else None, truth)
        share = 100 * float(np.mean(agrees))
        part = Part(Verdict.WRONG, f"{which}: right at {share:.3g} % of {len(agrees)} poses given the joints before")
        part.witness = witness
        if self.judge.explain:
            part.mistakes = [(self._mistake(branch) or "solution_wrong", "")]
        return part

    def _mistake(self, branch: Branch) -> str | None:
        if self._forgets_offset(branch):
            return "shoulder_offset_forgotten"
        search = Search(self.judge.description, self.judge.lengths([branch.trees[self.step.joint]]))
        for explanation in search.explanations(branch):
            if explanation.joint == self.step.joint:
                return explanation.mistake
            return None
        return None

    def _forgets_offset(self, branch: Branch) -> bool:
        """Whether the formula is that of joint 1 without its offset: the direction of the point, or the opposite."""
        step, derivation = self.judge.derived(self.step.joint), self.judge.derivation
        if derivation is None or step is None or self.step.joint != 0 or not isinstance(step.form, Circle):
            return False
        values, _ = next(derivation.candidates(branch.poses.T))
        A, B, C = (np.broadcast_to(values.of(step.form.letters[k]), len(branch.q)) for k in "ABC")
        offset = derivation.chain.number(derivation.chain.offsets[0])
        straight = np.arctan2(B, A) + np.pi / 2 - offset
        x = branch.q[:, 0]
        near = [np.abs((x - straight - turn + np.pi) % (2 * np.pi) - np.pi) < MATCHES for turn in (0.0, np.pi)]
        return bool(np.any(np.abs(C) > CLOSES) and np.mean(near[0] | near[1]) > 0.99)


def _with_a_length(tree: Tree, lengths: Lengths, joint: int) -> Iterator[Edit]:
    """Yield an equation with a constant length added to one of its sides."""
    mistake = "shoulder_offset_forgotten" if joint == 0 else "length_forgotten"
    for length in lengths.trees:
        for added in (True, False):
            new = Sum(((True, tree), (added, length)))
            yield Edit(mistake, new, tree, new)


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
