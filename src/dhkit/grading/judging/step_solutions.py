"""Judging of the solutions of steps of inverse kinematics: a joint's values, given the joints of earlier steps.

The student's roots are followed: each choice among the roots of earlier steps has a set of the arm's solutions that
agree with it, and a formula is right if its value belongs to one of them, at all poses and after every choice. A root
after which later joints have no solution at a pose is right too, if the worked solution has it. An
earlier joint without a right solution has its true values: any of them if one formula is right for all, else those of
one branch, or with one sign of the sine or cosine, the same in all following steps.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain
from typing import TypeAlias

import numpy as np

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Name, Number, Product, Tree
from dhkit.expressions.trees import names_of
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.answers.inverse_steps import GivenStep
from dhkit.grading.grade_report import Verdict, Witness
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.grading.judging.changed_formulas import with_term
from dhkit.grading.judging.inverse_branch import MISSED_SHARE, Branch
from dhkit.grading.judging.inverse_poses import KNOWN, MATCHES, Mask
from dhkit.grading.judging.numeric import doubles
from dhkit.grading.judging.step_context import Part, StepContext
from dhkit.grading.judging.step_mistakes import SolutionMistakes


@dataclass(frozen=True, eq=False)
class Choice:
    """One choice among the roots of the steps so far, at S poses with up to B solutions each.

    Attributes
    ----------
    alive
        Mask (S, B) of the arm's solutions that have the chosen values.
    q
        Values of the joints found so far, shape (S, n), rad and m; NaN for other joints, and at poses without such a
        solution.
    root
        Number of the formula, 0 or 1, that was taken in the last step with two formulas; None before such a step.
    """

    alive: Mask
    q: Array
    root: int | None = None

    @property
    def rows(self) -> Mask:
        """Mask (S,) of the poses at which a solution has the chosen values."""
        rows: Mask = np.asarray(self.alive.any(axis=1))
        return rows


Hypothesis: TypeAlias = tuple[Choice, ...]
"""All choices among the student's roots, given one assumption about the values of earlier joints without a right
solution."""


@dataclass(frozen=True, eq=False)
class _Trial:
    """The formulas of a step, tried after each choice of a hypothesis.

    Attributes
    ----------
    choices
        Choices before the step.
    values
        Values of each formula after each choice, each of shape (S,), rad or m.
    following
        Choices after the step: for each formula, one after each earlier choice.
    right
        Share of the poses at which each formula is right after each choice, shape (formulas, choices); 1 without poses.
    right_within_limits
        Share of those poses that joint values within the limits give, with the same meaning and shape.
    in_pairs
        Whether the first of two formulas was tried only after the first formula of an earlier step, and the second only
        after the second.
    """

    choices: Hypothesis
    values: list[list[Array]]
    following: list[list[Choice]]
    right: Array
    right_within_limits: Array
    in_pairs: bool = False


class Solutions:
    """Judges the solutions of steps, in their order; it keeps the choices among the roots so far.

    Parameters
    ----------
    context
        The arm and poses.
    takes_roots
        Whether roots of the worked solution are right where no solution of the arm follows them.
    """

    def __init__(self, context: StepContext, takes_roots: bool = True) -> None:
        self.context = context
        self._takes_roots = takes_roots
        self.unsolved: list[int] = []
        """Joints of earlier steps, from 0, without a right solution, about which the hypotheses assume nothing yet."""
        self.solved: set[int] = set()
        """Joints, from 0, whose values by the student are right."""
        self._hypotheses: list[Hypothesis] = []

    @property
    def truths(self) -> Array:
        """Solutions at the poses, shape (S, B, n), rad and m."""
        return self.context.solved_poses.truths

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """Assumptions about earlier joints without a right solution that agree with the steps so far.

        At most ``BOUNDS.hypotheses`` are kept.
        """
        if not self._hypotheses:
            alive = np.all(np.isfinite(self.truths), axis=-1)
            nothing_found = np.full((len(alive), self.truths.shape[-1]), np.nan)
            self._hypotheses = [(Choice(alive, nothing_found),)]
        if self.unsolved:
            divided: list[Hypothesis] = []
            for hypothesis in self._hypotheses:
                parts = self._divided(hypothesis, self.unsolved)
                divided += [part for part in parts if _is_alive(part)]
            self._hypotheses = divided[: BOUNDS.hypotheses]
            self.unsolved = []
        return self._hypotheses

    def skip(self, joint: int) -> None:
        """Count a joint, from 0, as unsolved: its step has no solution, or none that is right."""
        self.unsolved.append(joint)

    def part(self, step: GivenStep, before: Sequence[int]) -> tuple[Part, tuple[int, int] | None]:
        """Return the verdict on a step's solutions, and the number of roots that it gives and that the joint has.

        The numbers of roots are None unless the solutions are right.

        Parameters
        ----------
        step
            The step.
        before
            Joints of earlier steps, from 0, in the order of the steps.

        Raises
        ------
        AnswerError
            A name that is unknown there, or an arm whose joints do not follow from the pose.
        """
        unusable = self._unusable(step, before)
        if unusable is not None:
            self.skip(step.joint)
            return unusable, None

        # q1 = phi - gamma follows q2 = +..., and q1 = phi + gamma follows q2 = -...: phi ∓ gamma is right as a pair.
        trials = [self._trial(hypothesis, step) for hypothesis in self.hypotheses]
        pairs = [
            self._trial(each, step, in_pairs=True)
            for each in self.hypotheses
            if _has_pairs(each, step)
        ]

        # Right everywhere or, failing that, within the joint limits.
        least = 1.0 if self.context.poses.has_closed_form else 1.0 - MISSED_SHARE
        tried = [trial for trial in (*trials, *pairs) if self._reaches_poses(trial)]
        right = [trial for trial in tried if np.min(trial.right) >= least]
        is_right_beyond_limits = bool(right)
        if not right:
            right = [trial for trial in tried if np.min(trial.right_within_limits) >= least]
        if not right:
            best = max(trials, key=lambda trial: float(np.min(trial.right_within_limits)))
            self.skip(step.joint)
            return self._wrong(best, step, before), None

        first = right[0]
        right = [trial for trial in right if trial.in_pairs == first.in_pairs]
        count = self._count(first.choices, step.joint)
        same = None if first.in_pairs else self._same(first.values, step.joint)
        if same is not None:
            self.skip(step.joint)
            return Part(
                Verdict.WRONG,
                f"solution {same}: gives the same as another",
                [("duplicate_branch", "")],
            ), None

        self._hypotheses = [tuple(chain(*trial.following)) for trial in right]
        self.solved.add(step.joint)

        remarks = []
        if first.in_pairs:
            remarks.append("its signs are taken with those of the step before, + with +")
        if is_right_beyond_limits:
            where = ""
            poses = len(self.context.within_limits)
        else:
            where = " within the joint limits"
            poses = int(np.sum(self.context.within_limits))
            share = 100 * float(np.min(first.right))
            remarks.append(f"right{where}; beyond them at {share:.3g} % of the poses tried")
        statement = (
            f"solution: right at {poses} poses{where} given the joints before; tried, not proved"
        )
        verdict = Verdict.CORRECT if self.context.poses.has_closed_form else Verdict.UNDECIDED
        return Part(verdict, statement, remark="; ".join(remarks)), (len(step.solutions), count)

    def _unusable(self, step: GivenStep, before: Sequence[int]) -> Part | None:
        """Return the verdict on formulas that cannot be evaluated in this order; None if they can.

        Raises
        ------
        AnswerError
            An unknown name, the joint itself, or an arm whose joints do not follow from the pose.
        """
        own = step.joint
        poses = self.context.poses
        if not poses.isolated:
            raise AnswerError(
                "solution: the joint values of a pose are not isolated; equations alone are judged"
            )
        joints = [f"q{j + 1}" for j in range(self.context.description.n)]
        for tree in step.solutions:
            names = names_of(tree)
            if joints[own] in names:
                raise AnswerError(f"solution: uses q{own + 1}, which it is to give")
            unknown = sorted(names - {*poses.values, "pi", *joints})
            if unknown:
                raise AnswerError(f"solution: unknown name {unknown[0]!r}")
            later = [name for j, name in enumerate(joints) if j not in before and name in names]
            if later:
                return Part(
                    Verdict.INCOMPLETE, f"solution: uses {later[0]}, which no earlier step finds"
                )
        return None

    # Hypotheses

    def _divided(self, hypothesis: Hypothesis, joints: Sequence[int]) -> Iterator[Hypothesis]:
        """Yield assumptions about the values of unsolved joints: any of them, those of one sign, or of one branch."""
        truths = self.truths

        # All values of the solutions.
        divided = [self._by_values(choice, joints) for choice in hypothesis]
        yield _all_choices(divided)

        # Those with one sign of the sine or cosine of an angle, or of the displacement of a prismatic joint.
        for j in joints:
            functions = (np.sin, np.cos) if self.context.description.kinds[j] == "R" else (np.sign,)
            for function in functions:
                for sign in (1.0, -1.0):
                    has_sign = function(truths[..., j]) * sign > 0
                    chosen = [
                        replace(choice, alive=choice.alive & has_sign) for choice in hypothesis
                    ]
                    yield _all_choices([self._by_values(choice, joints) for choice in chosen])

        # Those of one branch of the closed form.
        for b in range(truths.shape[1]):
            yield tuple(parts[b] for parts in divided if b in parts)

    def _by_values(self, choice: Choice, joints: Sequence[int]) -> dict[int, Choice]:
        """Return a choice for each set of values of some joints, by the index of a solution that has them."""
        joints = list(joints)
        parts: dict[int, Choice] = {}
        values = self.truths[..., joints]
        for b in range(values.shape[1]):
            # Solutions with the same values as solution b.
            gaps = self.context.solved_poses.gaps(values, values[:, b : b + 1], joints)
            is_same = np.all(gaps < MATCHES, axis=-1)
            alive = choice.alive & choice.alive[:, b, None] & is_same
            if not alive.any() or any(
                np.array_equal(alive, other.alive) for other in parts.values()
            ):
                continue
            q = choice.q.copy()
            q[:, joints] = np.where(alive.any(axis=1)[:, None], values[:, b], np.nan)
            parts[b] = Choice(alive, q, choice.root)
        return parts

    # Formulas

    def _trial(self, hypothesis: Hypothesis, step: GivenStep, in_pairs: bool = False) -> _Trial:
        """Return the values of a step's formulas after each choice, and the shares of poses at which they are right."""
        values: list[list[Array]] = []
        following: list[list[Choice]] = []
        right = np.ones((len(step.solutions), len(hypothesis)))
        right_within_limits = np.ones_like(right)
        for k, tree in enumerate(step.solutions):
            of_formula: list[Array] = []
            after_formula: list[Choice] = []
            root = k if len(step.solutions) == 2 else None
            for c, choice in enumerate(hypothesis):
                if in_pairs and choice.root != root:
                    continue
                x = self._evaluated(tree, choice)
                after = self._after(choice, step.joint, x, root)
                of_formula.append(x)
                after_formula.append(after)

                rows = choice.rows
                is_right = after.rows
                if self._takes_roots and not np.all(is_right[rows]):
                    is_right = is_right | self._are_roots(choice, step.joint, x)
                if np.any(rows):
                    right[k, c] = np.mean(is_right[rows])
                within_limits = rows & self.context.within_limits
                if np.any(within_limits):
                    right_within_limits[k, c] = np.mean(is_right[within_limits])
            values.append(of_formula)
            following.append(after_formula)
        return _Trial(hypothesis, values, following, right, right_within_limits, in_pairs)

    def _are_roots(self, choice: Choice, joint: int, x: Array) -> Mask:
        """Return whether values x (S,) of a joint, rad or m, are roots of the worked solution after a choice, (S,)."""
        roots = self.context.roots
        gaps_in = self.context.solved_poses.gaps
        is_root = gaps_in(x[:, None], roots[..., joint], joint) < MATCHES
        for j in range(roots.shape[-1]):
            # Joints that the choice has not found yet may have any value.
            gaps = gaps_in(choice.q[:, None, j], roots[..., j], j)
            is_root &= (gaps < MATCHES) | np.isnan(choice.q[:, None, j])
        return np.asarray(is_root.any(axis=1))

    def _evaluated(self, tree: Tree, choice: Choice) -> Array:
        """Return the values of a formula at all poses, shape (S,), rad or m; NaN for no value."""
        given = {f"q{j + 1}": column for j, column in enumerate(choice.q.T)}
        numbers = np.asarray(
            doubles(tree, {**self.context.solved_poses.values, **given}), dtype=float
        )
        x: Array = np.array(np.broadcast_to(numbers, len(choice.q)))
        x[~np.isfinite(x)] = np.nan
        return x

    def _after(self, choice: Choice, joint: int, x: Array, root: int | None) -> Choice:
        """Return a choice with a value of one more joint, x (S,), rad or m."""
        gaps = self.context.solved_poses.gaps(x[:, None], self.truths[..., joint], joint)
        alive = choice.alive & (gaps < MATCHES)
        q = choice.q.copy()
        q[:, joint] = np.where(alive.any(axis=1), x, np.nan)
        return Choice(alive, q, choice.root if root is None else root)

    def _reaches_poses(self, trial: _Trial) -> bool:
        """Whether there are poses within the limits at which the formulas were tried."""
        return any(np.any(choice.rows & self.context.within_limits) for choice in trial.choices)

    def _count(self, hypothesis: Hypothesis, joint: int) -> int:
        """Return the largest number of values that a joint may have after a choice."""
        values = self.truths[..., joint]
        is_same = (
            self.context.solved_poses.gaps(values[:, :, None], values[:, None, :], joint) < MATCHES
        )
        is_earlier = np.tril(np.ones(is_same.shape[1:], dtype=bool), -1)
        most = 0
        for choice in hypothesis:
            # A value counts if no value before it is the same.
            is_repeated = np.any(is_same & is_earlier & choice.alive[:, None, :], axis=2)
            counts = np.sum(choice.alive & ~is_repeated, axis=1)
            most = max(most, int(counts.max(initial=0)))
        return most

    def _same(self, values: Sequence[Sequence[Array]], joint: int) -> int | None:
        """Return the number, from 1, of a formula whose values are those of one before it after every choice."""

        def equal(a: Array, b: Array) -> bool:
            gap = self.context.solved_poses.gaps(a, b, joint)
            return bool(np.all((gap < MATCHES) | np.isnan(gap)))

        for k, own in enumerate(values):
            if any(all(map(equal, own, other)) for other in values[:k]):
                return k + 1
        return None

    # Mistakes

    def _wrong(self, trial: _Trial, step: GivenStep, before: Sequence[int]) -> Part:
        """Return the verdict on a step's solutions of which one is wrong, with a pose that shows it and its mistake."""
        own = step.joint
        inside = self.context.within_limits
        k = int(np.argmin(np.mean(trial.right_within_limits, axis=1)))
        subject = f"solution {k + 1}" if len(step.solutions) > 1 else "solution"

        # Pairs of a choice and a pose at which the formula was tried.
        places: list[tuple[int, int]] = []
        for c, choice in enumerate(trial.choices):
            places += [(c, int(s)) for s in np.flatnonzero(choice.rows & inside)]
        if not places:
            return Part(Verdict.WRONG, f"{subject}: no pose has the values of the joints before")
        right = np.array([trial.following[k][c].rows[s] for c, s in places])
        share = 100 * float(np.mean(right))
        part = Part(
            Verdict.WRONG,
            f"{subject}: right at {share:.3g} % of {len(right)} poses given the joints before",
        )
        branch = self._branch(step.solutions[k], trial.choices, places, own, before)

        # The first of them at which the formula is wrong, with the nearest right value.
        c, s = places[int(np.argmin(right))]
        pose = {
            name: float(np.asarray(self.context.solved_poses.values[name])[s])
            for name in POSE_NAMES
        }
        pose |= {f"q{j + 1}": float(trial.choices[c].q[s, j]) for j in before}
        answer = float(trial.values[k][c][s])
        alive = np.flatnonzero(trial.choices[c].alive[s])
        truths = self.truths[s, alive, own]
        gaps = self.context.solved_poses.gaps(np.full(len(alive), answer), truths, own)
        nearest = int(np.argmin(np.nan_to_num(gaps, nan=np.inf)))
        part.witness = Witness(
            pose, answer if np.isfinite(answer) else None, float(truths[nearest])
        )
        if self.context.explain:
            part.mistakes = [
                self._mistake(branch, step, step.solutions[k], before) or ("solution_wrong", "")
            ]
        return part

    def _branch(
        self,
        tree: Tree,
        choices: Hypothesis,
        places: Sequence[tuple[int, int]],
        own: int,
        before: Sequence[int],
    ) -> Branch:
        """Return a branch with a formula for one joint; earlier joints have their values, and later ones follow.

        Its poses are those of ``places``, each a choice and the index of a pose.
        """
        n = self.context.description.n
        rows = [s for _, s in places]

        # Joint values of a solution that agrees with the choice; earlier joints as they were chosen.
        known = np.array([self.truths[s, np.argmax(choices[c].alive[s])] for c, s in places])
        chosen = np.array([choices[c].q[s] for c, s in places])
        known[:, list(before)] = chosen[:, list(before)]
        poses = replace(self.context.solved_poses.at(rows), known=known)

        # q_j = known_j of earlier joints, and q_j = known_j + 0 q_own of later ones, which makes them follow.
        given = [Name(f"{KNOWN}{j + 1}", 0) for j in range(n)]
        zero = Product(((True, Number(Fraction(0), "0", 0)), (True, Name(f"q{own + 1}", 0))))
        later = [j for j in range(n) if j != own and j not in before]
        trees: list[Tree] = [*given]
        for j in later:
            trees[j] = with_term(given[j], True, zero)
        trees[own] = tree
        return Branch(poses, tuple(trees), given_order=(*before, own, *later), judged_joint=own)

    def _mistake(
        self, branch: Branch, step: GivenStep, tree: Tree, before: Sequence[int]
    ) -> tuple[str, str] | None:
        """Return the mistake in a wrong formula, and a detail; None if none explains it."""

        def is_right_for(other: StepContext) -> bool:
            judge = Solutions(other, takes_roots=False)
            judge.unsolved = list(before)
            part, _ = judge.part(replace(step, solutions=(tree,)), before)
            return part.verdict.passes

        return SolutionMistakes(self.context, branch, step.joint).mistake(is_right_for)


def _all_choices(parts: Sequence[dict[int, Choice]]) -> Hypothesis:
    """Return the hypothesis that all choices of some parts are possible."""
    return tuple(chain.from_iterable(part.values() for part in parts))


def _is_alive(hypothesis: Hypothesis) -> bool:
    """Whether a hypothesis is possible at some pose."""
    return any(np.any(choice.alive) for choice in hypothesis)


def _has_pairs(hypothesis: Hypothesis, step: GivenStep) -> bool:
    """Whether a step has two formulas, and an earlier one has too."""
    return len(step.solutions) == 2 and {choice.root for choice in hypothesis} == {0, 1}
