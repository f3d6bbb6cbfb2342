"""Judging of the solutions of steps of inverse kinematics: a joint's values, given the joints of earlier steps.

The student's roots are followed: each choice among the roots of earlier steps has a set of the arm's solutions that
agree with it, and a formula is right if its value belongs to one of them, at all poses and after every choice. An
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
from dhkit.expressions.syntax import Name, Number, Product, Sum, Tree
from dhkit.expressions.trees import names_of
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.answers.inverse_steps import GivenStep
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.grading.judging.inverse_branch import MISSED_SHARE, Branch
from dhkit.grading.judging.inverse_poses import KNOWN, MATCHES, Mask
from dhkit.grading.judging.numeric import doubles
from dhkit.grading.judging.step_context import Part, StepContext
from dhkit.grading.judging.step_mistakes import SolutionMistakes
from dhkit.grading.report import Verdict, Witness


@dataclass(frozen=True, eq=False)
class Choice:
    """One choice among the roots of the steps so far.

    Attributes
    ----------
    alive
        Which solutions of the arm have the values chosen, shape (S, B).
    q
        Values of the joints found, shape (S, n), rad and m; NaN of others, and where no solution has the values.
    root
        Which of two formulas was taken in the last step that has two, 0 or 1; None before such a step.
    """

    alive: Mask
    q: Array
    root: int | None = None

    @property
    def rows(self) -> Mask:
        """The poses at which a solution has the values, shape (S,)."""
        rows: Mask = np.asarray(self.alive.any(axis=1))
        return rows


Hypothesis: TypeAlias = tuple[Choice, ...]
"""All choices among the student's roots, for one way to take the earlier joints without a right solution."""


@dataclass(frozen=True, eq=False)
class _Trial:
    """The formulas of a step, tried after each choice of a hypothesis.

    Attributes
    ----------
    choices
        The choices before the step.
    values
        Values of each formula after each choice, each of shape (S,), rad or m.
    following
        Choices after the step: one for each formula and earlier choice.
    right
        Share of the poses at which each formula is right after each choice, shape (formulas, choices); 1 without poses.
    right_within_limits
        The same at poses that joint values within the limits give.
    in_pairs
        Whether each of two formulas was tried only after the same of the two formulas of an earlier step.
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
    """

    def __init__(self, context: StepContext) -> None:
        self.context = context
        self.unsolved: list[int] = []
        """Joints of earlier steps whose values are none of the student's and not yet part of the hypotheses."""
        self.solved: set[int] = set()
        """Joints of which the student's values are right."""
        self._hypotheses: list[Hypothesis] = []

    @property
    def truths(self) -> Array:
        """Solutions at the poses, shape (S, B, n), rad and m."""
        return self.context.solved_poses.truths

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """The ways to take earlier joints without a right solution that explain the steps so far."""
        if not self._hypotheses:
            alive = np.all(np.isfinite(self.truths), axis=-1)
            self._hypotheses = [(Choice(alive, np.full((len(alive), self.truths.shape[-1]), np.nan)),)]
        if self.unsolved:
            following = [
                found
                for hypothesis in self._hypotheses
                for found in self._divided(hypothesis, self.unsolved)
                if any(np.any(choice.alive) for choice in found)
            ]
            self._hypotheses = following[: BOUNDS.hypotheses]
            self.unsolved = []
        return self._hypotheses

    def skip(self, joint: int) -> None:
        """Take a joint whose step has no solution that could be judged as unsolved."""
        self.unsolved.append(joint)

    def part(self, step: GivenStep, before: Sequence[int]) -> tuple[Part, tuple[int, int] | None]:
        """Return the verdict on a step's solutions, and the numbers of roots that are given and that there are.

        Parameters
        ----------
        step
            The step.
        before
            Joints of earlier steps, from 0, in the order of these.

        Raises
        ------
        AnswerError
            A name that is unknown there, or an arm whose joints do not follow from the pose.
        """
        if (part := self._unusable(step, before)) is not None:
            self.skip(step.joint)
            return part, None
        trials = [self._trial(hypothesis, step) for hypothesis in self.hypotheses]
        # q1 = phi - gamma follows q2 = +..., and q1 = phi + gamma follows q2 = -...: phi ∓ gamma is right as a pair.
        trials += [self._trial(each, step, in_pairs=True) for each in self.hypotheses if _has_pairs(each, step)]
        least = 1.0 if self.context.poses.has_closed_form else 1.0 - MISSED_SHARE
        for beyond in (True, False):
            right = [
                trial
                for trial in trials
                if self._reached(trial) and np.min(trial.right if beyond else trial.right_within_limits) >= least
            ]
            if right:
                break
        else:
            alone = [trial for trial in trials if not trial.in_pairs]
            trial = max(alone, key=lambda one: float(np.min(one.right_within_limits)))
            self.skip(step.joint)
            return self._wrong(trial, step, before), None
        right = [trial for trial in right if trial.in_pairs == right[0].in_pairs]
        first = right[0]
        count = self._count(first.choices, step.joint)
        same = None if first.in_pairs else self._same(first.values, step.joint)
        if same is not None:
            self.skip(step.joint)
            return Part(Verdict.WRONG, f"solution {same}: gives the same as another", [("duplicate_branch", "")]), None
        self._hypotheses = [tuple(chain(*trial.following)) for trial in right]
        self.solved.add(step.joint)
        tried = self.context.within_limits
        where = ""
        remark = ""
        if beyond:
            tried = np.ones_like(tried)
        else:
            where = " within the joint limits"
            remark = f"right{where}; beyond them at {100 * float(np.min(first.right)):.3g} % of the poses tried"
        if first.in_pairs:
            remark = "; ".join(filter(None, ["its signs are taken with those of the step before, + with +", remark]))
        statement = f"solution: right at {np.sum(tried)} poses{where} given the joints before; tried, not proved"
        verdict = Verdict.CORRECT if self.context.poses.has_closed_form else Verdict.UNDECIDED
        return Part(verdict, statement, remark=remark), (len(step.solutions), count)

    def _unusable(self, step: GivenStep, before: Sequence[int]) -> Part | None:
        """Return why formulas cannot be evaluated in this order; None if they can."""
        own = step.joint
        poses = self.context.poses
        if not poses.isolated:
            raise AnswerError("solution: the joint values of a pose are not isolated; equations alone are judged")
        joints = [f"q{j + 1}" for j in range(self.context.description.n)]
        for tree in step.solutions:
            names = names_of(tree)
            if joints[own] in names:
                raise AnswerError(f"solution: uses q{own + 1}, which it is to give")
            if strange := sorted(names - {*poses.values, "pi", *joints}):
                raise AnswerError(f"solution: unknown name {strange[0]!r}")
            if later := [joints[j] for j in range(len(joints)) if j not in before and joints[j] in names]:
                return Part(Verdict.INCOMPLETE, f"solution: uses {later[0]}, which no earlier step finds")
        return None

    # Hypotheses

    def _divided(self, hypothesis: Hypothesis, joints: Sequence[int]) -> Iterator[Hypothesis]:
        """Yield ways to take unsolved joints: all of their values, those of one branch, or of one sign."""
        truths = self.truths
        divided = [self._by_values(choice, joints) for choice in hypothesis]
        yield tuple(choice for parts in divided for choice in parts.values())
        for j in joints:
            for function in (np.sin, np.cos) if self.context.description.kinds[j] == "R" else (np.sign,):
                for sign in (1.0, -1.0):
                    chosen = function(truths[..., j]) * sign > 0
                    parts = [self._by_values(replace(one, alive=one.alive & chosen), joints) for one in hypothesis]
                    yield tuple(choice for part in parts for choice in part.values())
        for b in range(truths.shape[1]):
            yield tuple(parts[b] for parts in divided if b in parts)

    def _by_values(self, choice: Choice, joints: Sequence[int]) -> dict[int, Choice]:
        """Return a choice for each set of values of some joints, by the index of a solution that has them."""
        joints = list(joints)
        parts = dict[int, Choice]()
        values = self.truths[..., joints]
        for b in range(values.shape[1]):
            gaps = self.context.solved_poses.gaps(values, values[:, b : b + 1], joints)
            alive = choice.alive & choice.alive[:, b, None] & np.all(gaps < MATCHES, axis=-1)
            if not alive.any() or any(np.array_equal(alive, other.alive) for other in parts.values()):
                continue
            q = choice.q.copy()
            q[:, joints] = np.where(alive.any(axis=1)[:, None], values[:, b], np.nan)
            parts[b] = Choice(alive, q, choice.root)
        return parts

    # Formulas

    def _trial(self, hypothesis: Hypothesis, step: GivenStep, in_pairs: bool = False) -> _Trial:
        values: list[list[Array]] = []
        following: list[list[Choice]] = []
        shares = np.ones((2, len(step.solutions), len(hypothesis)))
        for k, tree in enumerate(step.solutions):
            values.append([])
            following.append([])
            root = k if len(step.solutions) == 2 else None
            for c, choice in enumerate(hypothesis):
                if in_pairs and choice.root != root:
                    continue
                x = self._evaluated(tree, choice)
                after = self._after(choice, step.joint, x, root)
                for share, rows in zip(shares, (choice.rows, choice.rows & self.context.within_limits), strict=True):
                    if np.any(rows):
                        share[k, c] = np.mean(after.rows[rows])
                values[-1].append(x)
                following[-1].append(after)
        return _Trial(hypothesis, values, following, shares[0], shares[1], in_pairs)

    def _evaluated(self, tree: Tree, choice: Choice) -> Array:
        given = {f"q{j + 1}": column for j, column in enumerate(choice.q.T)}
        numbers = np.asarray(doubles(tree, {**self.context.solved_poses.values, **given}), dtype=float)
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

    def _reached(self, trial: _Trial) -> bool:
        """Whether there are poses at which the formulas were tried."""
        return any(np.any(choice.rows & self.context.within_limits) for choice in trial.choices)

    def _count(self, hypothesis: Hypothesis, joint: int) -> int:
        """Return the largest number of values that a joint may have after a choice."""
        most = 0
        for choice in hypothesis:
            values = self.truths[..., joint]
            # A value counts if none before it is the same.
            same = self.context.solved_poses.gaps(values[:, :, None], values[:, None, :], joint) < MATCHES
            earlier = np.tril(np.ones(same.shape[1:], dtype=bool), -1)
            repeated = np.any(same & earlier & choice.alive[:, None, :], axis=2)
            most = max(most, int(np.sum(choice.alive & ~repeated, axis=1).max(initial=0)))
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
        own = step.joint
        inside = self.context.within_limits
        k = int(np.argmin(np.mean(trial.right_within_limits, axis=1)))
        which = f"solution {k + 1}" if len(step.solutions) > 1 else "solution"
        places = [(c, int(s)) for c, one in enumerate(trial.choices) for s in np.flatnonzero(one.rows & inside)]
        if not places:
            return Part(Verdict.WRONG, f"{which}: no pose has the values of the joints before")
        right = np.array([trial.following[k][c].rows[s] for c, s in places])
        share = 100 * float(np.mean(right))
        part = Part(Verdict.WRONG, f"{which}: right at {share:.3g} % of {len(right)} poses given the joints before")
        branch = self._branch(step.solutions[k], trial.choices, places, own, before)
        c, s = places[int(np.argmin(right))]
        pose = {name: float(np.asarray(self.context.solved_poses.values[name])[s]) for name in POSE_NAMES}
        pose |= {f"q{j + 1}": float(trial.choices[c].q[s, j]) for j in before}
        answer = float(trial.values[k][c][s])
        alive = np.flatnonzero(trial.choices[c].alive[s])
        truths = self.truths[s, alive, own]
        gaps = self.context.solved_poses.gaps(np.full(len(alive), answer), truths, own)
        truth = float(truths[int(np.argmin(np.nan_to_num(gaps, nan=np.inf)))])
        part.witness = Witness(pose, answer if np.isfinite(answer) else None, truth)
        if self.context.explain:
            part.mistakes = [self._mistake(branch, step, step.solutions[k], before) or ("solution_wrong", "")]
        return part

    def _branch(
        self, tree: Tree, choices: Hypothesis, places: Sequence[tuple[int, int]], own: int, before: Sequence[int]
    ) -> Branch:
        """Return a branch with a formula for one joint; earlier joints have their values, and later ones follow.

        Its poses are those of ``places``, each a choice and the index of a pose.
        """
        n = self.context.description.n
        rows = [s for _, s in places]
        known = np.array([self.truths[s, np.argmax(choices[c].alive[s])] for c, s in places])
        known[:, list(before)] = np.array([choices[c].q[s] for c, s in places])[:, list(before)]
        given = [Name(f"{KNOWN}{j + 1}", 0) for j in range(n)]
        nothing = Product(((True, Number(Fraction(0), "0", 0)), (True, Name(f"q{own + 1}", 0))))
        later = [j for j in range(n) if j != own and j not in before]
        trees: list[Tree] = [*given]
        for j in later:
            trees[j] = Sum(((True, given[j]), (True, nothing)))
        trees[own] = tree
        poses = replace(self.context.solved_poses.at(rows), known=known)
        return Branch(poses, tuple(trees), given_order=(*before, own, *later), judged_joint=own)

    def _mistake(self, branch: Branch, step: GivenStep, tree: Tree, before: Sequence[int]) -> tuple[str, str] | None:
        def is_right_for(other: StepContext) -> bool:
            judge = Solutions(other)
            judge.unsolved = list(before)
            part, _ = judge.part(replace(step, solutions=(tree,)), before)
            return part.verdict.passes

        return SolutionMistakes(self.context, branch, step.joint).mistake(is_right_for)


def _has_pairs(hypothesis: Hypothesis, step: GivenStep) -> bool:
    """Whether a step has two formulas, and an earlier one has too."""
    return len(step.solutions) == 2 and {choice.root for choice in hypothesis} == {0, 1}
