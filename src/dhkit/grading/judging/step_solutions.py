"""Judging of the solutions of a step of inverse kinematics: a joint's value, given the joints of earlier steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Name, Number, Product, Sum, Tree
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.answers.inverse_steps import GivenStep
from dhkit.grading.judging.inverse_branch import Branch
from dhkit.grading.judging.inverse_mistakes import Search
from dhkit.grading.judging.inverse_poses import CLOSES, KNOWN, MATCHES, Mask
from dhkit.grading.judging.numeric import names_of
from dhkit.grading.judging.step_context import Part, StepContext
from dhkit.grading.report import Verdict, Witness
from dhkit.symbolic.inverse.forms import Circle


class Solutions:
    """Judges the solutions of one step."""

    def __init__(self, context: StepContext, step: GivenStep, before: Sequence[int], several: bool) -> None:
        self.context, self.step, self.before, self.several = context, step, before, several

    def part(self) -> tuple[Part, tuple[int, int] | None]:
        """Return the verdict, and the numbers of roots that are given and that there are."""
        own, n = self.step.joint, self.context.description.n
        values = self.context.poses.values
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
        count = len(self.context.poses.q)
        statement = f"solution: right at {count} poses given the joints before; tried, not proved"
        return Part(Verdict.CORRECT, statement), (len(self.step.solutions), int(self.counts.max(initial=0)))

    def _branch(self, tree: Tree, known: Array) -> Branch:
        """Return a branch with a formula for this joint, earlier joints known, and later ones as they follow.

        At poses where each value of this joint leads to a solution: a root may be right and later joints out of reach.
        """
        rows = np.flatnonzero(np.isfinite(known).all(axis=1) & (self.counts == self.counts.max(initial=0)))
        poses = replace(self.context.poses.at(rows), known=known[rows])
        given = {j: Name(f"{KNOWN}{j + 1}", 0) for j in range(self.context.description.n)}
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
        """Return the branch at whose earlier joints a formula is right most often, and whether it always is.

        A formula may be that of one branch, unless earlier steps give several roots.
        """
        own = self.step.joint
        solutions = self.context.poses.solutions
        of_branches = () if self.several else (solutions[:, b] for b in range(solutions.shape[1]))
        candidates = [self.context.poses.q, *of_branches]
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
        whole = np.zeros(len(self.context.poses.q))
        whole[: len(x)] = x
        hits: NDArray[np.bool_] = np.round(whole / (10 * MATCHES)).astype(np.int64)
        return hits

    @cached_property
    def counts(self) -> NDArray[np.int_]:
        """The number of values that this joint may have at each pose, given the joints of earlier steps, shape (S,)."""
        poses, own = self.context.poses, self.step.joint
        truths = poses.truths
        alive: Mask = np.all(np.isfinite(truths), axis=-1)
        for j in self.before:
            alive &= poses.gaps(truths[..., j], poses.q[:, None, j], j) < MATCHES
        values = truths[..., own]
        # A value counts if none before it is the same.
        same = poses.gaps(values[:, :, None], values[:, None, :], own) < MATCHES
        earlier = np.tril(np.ones(same.shape[1:], dtype=bool), -1)
        counts: NDArray[np.int_] = np.sum(alive & ~np.any(same & earlier & alive[:, None, :], axis=2), axis=1)
        return counts

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
        if self.context.explain:
            part.mistakes = [(self._mistake(branch) or "solution_wrong", "")]
        return part

    def _mistake(self, branch: Branch) -> str | None:
        if self._forgets_offset(branch):
            return "shoulder_offset_forgotten"
        search = Search(self.context.description, self.context.lengths([branch.trees[self.step.joint]]))
        for explanation in search.explanations(branch):
            if explanation.joint == self.step.joint:
                return explanation.mistake
            return None
        return None

    def _forgets_offset(self, branch: Branch) -> bool:
        """Whether the formula is that of joint 1 without its offset: the direction of the point, or the opposite."""
        step, derivation = self.context.derived(self.step.joint), self.context.derivation
        if derivation is None or step is None or self.step.joint != 0 or not isinstance(step.form, Circle):
            return False
        values, _ = next(derivation.candidates(branch.poses.T))
        A, B, C = (np.broadcast_to(values.of(step.form.letters[k]), len(branch.q)) for k in "ABC")
        offset = derivation.chain.number(derivation.chain.offsets[0])
        straight = np.arctan2(B, A) + np.pi / 2 - offset
        x = branch.q[:, 0]
        near = [np.abs((x - straight - turn + np.pi) % (2 * np.pi) - np.pi) < MATCHES for turn in (0.0, np.pi)]
        return bool(np.any(np.abs(C) > CLOSES) and np.mean(near[0] | near[1]) > 0.99)
