"""Judging formulas of inverse kinematics: whether their joint values bring the tool to the poses asked for.

All of it is numerical: the formulas are worked out in doubles for random poses, and forward kinematics say how far the
tool then is from them. Which solutions there are is known where the arm has a closed form of ours.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from dhkit.description import Description
from dhkit.errors import AnswerError
from dhkit.expressions import CONSTANTS
from dhkit.expressions.syntax import Tree
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.judging.changed_calls import changed_calls, negated
from dhkit.grading.judging.inverse_branch import (
    Branch,
    BranchJudgement,
    InverseExplanation,
    InverseWitness,
    joint_order,
)
from dhkit.grading.judging.inverse_poses import CLOSES, Poses
from dhkit.grading.judging.numeric import names_of, parts_of
from dhkit.grading.mistakes.library import LIBRARY
from dhkit.grading.report import Note, NoteKind, Verdict

__all__ = [
    "CLOSES",
    "POSE_NAMES",
    "BranchJudgement",
    "InverseExplanation",
    "InverseJudgement",
    "InverseWitness",
    "judge_inverse",
]

MAX_NODES = 5_000
"""Of a formula: a PUMA's longest has 200."""


@dataclass(frozen=True)
class InverseJudgement:
    """What is decided of a set of branches.

    Attributes
    ----------
    branches
        One judgement a branch.
    duplicates
        Pairs of branches, from 0, that give the same joint values wherever both have values.
    solutions, covered
        How many solutions the arm has in general, limits aside, and how many of them the branches give; None without
        a closed form.
    notes
        What a reader should know: solutions that no branch gives.
    """

    branches: tuple[BranchJudgement, ...]
    duplicates: tuple[tuple[int, int], ...] = ()
    solutions: int | None = None
    covered: int | None = None
    notes: tuple[Note, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """The worst of the branches."""
        return max((branch.verdict for branch in self.branches), key=lambda verdict: verdict.severity)


def judge_inverse(
    description: Description, branches: Sequence[Sequence[Tree]], samples: int = 1000, seed: int = 0
) -> InverseJudgement:
    """Judge formulas of an arm's inverse kinematics.

    An arm of few joints is asked for what it can meet: a planar arm of two joints for positions alone.

    Parameters
    ----------
    description
        The robot.
    branches
        Of each branch one formula a joint, rad or m, in the tool's pose in the world (px py pz, r11 ... r33), the
        robot's parameters, pi, and the other joints; no two may need each other.
    samples
        How many random poses: forward kinematics of joint values inside the limits; a turn or a metre without.
    seed
        Of the random poses.

    Raises
    ------
    AnswerError
        No branch, another number of formulas, an unknown name or function, joints that need each other.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.expressions import read
    >>> branch = [read(formula) for formula in ("atan(py/px)", "sqrt(px^2 + py^2)")]
    >>> judged = judge_inverse(library_robot("polar_rp"), [branch]).branches[0]
    >>> judged.verdict.value, judged.joint, judged.explanations[0].mistake
    ('wrong', 0, 'quadrant')
    """
    _check(description, branches)
    poses = Poses.random(description, samples, seed)
    answers = [Branch(poses, tuple(branch)) for branch in branches]
    duplicates = tuple((i, j) for j in range(len(answers)) for i in range(j) if poses.same(answers[i].q, answers[j].q))
    judged = [answer.judgement() for answer in answers]
    for i, j in duplicates:
        if not any(found.joint is None for found in judged[j].explanations):
            said = _duplicate(answers, i, j)
            judged[j] = replace(
                judged[j], verdict=Verdict.WRONG, explanations=(*judged[j].explanations, said), repeats=i
            )
    solutions, covered = _coverage(poses, answers)
    return InverseJudgement(tuple(judged), duplicates, solutions, covered, _notes(poses, solutions, covered))


def _check(description: Description, branches: Sequence[Sequence[Tree]]) -> None:
    """Refuse formulas that cannot be worked out."""
    if not branches:
        raise AnswerError("ik: no branch")
    n = description.n
    pose = {*POSE_NAMES, *description.parameters, *CONSTANTS}
    for b, branch in enumerate(branches, start=1):
        if len(branch) != n:
            raise AnswerError(f"ik, branch {b}: {len(branch)} formula{'s' * (len(branch) != 1)}; expected {n}")
        for k, tree in enumerate(branch):
            if sum(1 for _ in islice(parts_of(tree), MAX_NODES + 1)) > MAX_NODES:
                raise AnswerError(f"ik, branch {b}, q{k + 1}: a formula of more than {MAX_NODES} terms and factors")
            others = {f"q{i + 1}" for i in range(n) if i != k}
            for name in sorted(names_of(tree) - pose - others):
                where = f"ik, branch {b}, q{k + 1}"
                if name == f"q{k + 1}":
                    raise AnswerError(f"{where}: uses {name}, which it is to give")
                known = ", ".join([*POSE_NAMES[:3], "r11 ... r33", *description.parameters, "pi", "other joints"])
                raise AnswerError(f"{where}: unknown name {name!r}; expected {known}")
        joint_order(branch, f"ik, branch {b}")


def _notes(poses: Poses, solutions: int | None, covered: int | None) -> tuple[Note, ...]:
    notes = []
    if not poses.full:
        notes.append(Note(NoteKind.ASKED_FOR, "ik", tuple(poses.met)))
    if solutions is None or covered is None:
        notes.append(Note(NoteKind.NO_CLOSED_FORM, "ik"))
    elif covered < solutions:
        notes.append(Note(NoteKind.SOLUTIONS_MISSING, "ik", (str(covered), str(solutions))))
    return tuple(notes)


def _coverage(poses: Poses, answers: Sequence[Branch]) -> tuple[int | None, int | None]:
    """Return how many solutions there are in general, and how many of these branches give."""
    if not poses.solutions.shape[1]:
        return None, None
    valid = np.all(np.isfinite(poses.solutions), axis=-1)
    most = int(np.max(np.sum(valid, axis=1)))
    given = np.zeros_like(valid)
    for answer in answers:
        given |= poses.matches(answer.q, poses.solutions) & answer.closed[:, None]
    general = np.sum(valid, axis=1) == most
    return most, int(np.median(np.sum(given, axis=1)[general]))


def _duplicate(answers: Sequence[Branch], i: int, j: int) -> InverseExplanation:
    """Say of a branch that gives the same as an earlier one whether another sign would make it another."""
    for branch in _other_signs(answers[j]):
        if not np.any(branch.failing) and not any(branch.poses.same(branch.q, answer.q) for answer in answers):
            sentence = f"gives the same as branch {i + 1}: {LIBRARY['elbow_sign'].sentence}"
            return InverseExplanation("elbow_sign", sentence)
    return InverseExplanation("duplicate_branch", f"gives the same as branch {i + 1}")


def _other_signs(branch: Branch) -> Iterator[Branch]:
    """Yield a branch with other signs of roots and arc cosines: in one formula, and in all."""
    changed = [list(changed_calls(tree, ("sqrt", "acos"), negated)) for tree in branch.trees]
    for joint, trees in enumerate(changed):
        for tree in trees:
            yield branch.with_tree(joint, tree)
    # The last change of a formula is that of all its roots.
    yield replace(branch, trees=tuple(new[-1] if new else old for old, new in zip(branch.trees, changed, strict=True)))
