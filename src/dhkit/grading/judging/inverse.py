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
from dhkit.grading.answers.given import POSE_NAMES, Given
from dhkit.grading.judging.inverse_branch import Branch, joint_order
from dhkit.grading.judging.inverse_edits import with_signs_changed
from dhkit.grading.judging.inverse_mistakes import Explanation, Search
from dhkit.grading.judging.inverse_poses import CLOSES, Poses
from dhkit.grading.judging.kinematic_judgement import KinematicJudgement, unreadable_entries, with_texts
from dhkit.grading.judging.numeric import names_of, parts_of
from dhkit.grading.mistakes.library import hint_of, sentence_of
from dhkit.grading.report import Diagnosis, Entry, Note, NoteKind, Verdict, Witness

MAX_NODES = 5_000
"""Of a formula: a PUMA's longest has 200."""


@dataclass(frozen=True)
class Closure:
    """How many poses a branch closes.

    Attributes
    ----------
    closed, poses
        How many poses it closes, of how many that a solution of this branch reaches.
    without_value
        On how many of these it has no value: a root of a negative number, an arc cosine beyond 1.
    """

    closed: int
    poses: int
    without_value: int = 0

    @classmethod
    def of(cls, branch: Branch) -> Closure:
        """Count."""
        asked = branch.reachable
        without = asked & np.any(np.isnan(branch.q), axis=1)
        return cls(int(np.sum(branch.closed & asked)), int(np.sum(asked)), int(np.sum(without)))

    def __str__(self) -> str:
        """Return the count in a line."""
        said = f"closes {self.closed} of {self.poses} poses"
        if self.closed == self.poses:
            return f"{said} to {CLOSES:g}; tried, not proved"
        share = 100 * self.without_value / max(self.poses, 1)
        return said + (f", has no value on {share:.3g} %" if self.without_value else "")


@dataclass(frozen=True)
class InverseJudgement(KinematicJudgement):
    """What is decided of formulas of inverse kinematics, an entry a branch.

    A branch is CORRECT where it closes every pose tried that a solution of this branch reaches, else WRONG; so is one
    that repeats another.

    Attributes
    ----------
    closures
        How many poses each branch closes.
    duplicates
        Pairs of branches, from 0, that give the same joint values wherever both have values.
    solutions, covered
        How many solutions the arm has in general, limits aside, and how many of them the branches give; None without
        a closed form.
    """

    closures: tuple[Closure, ...] = ()
    duplicates: tuple[tuple[int, int], ...] = ()
    solutions: int | None = None
    covered: int | None = None


def inverse_entries(
    description: Description, branches: Sequence[Sequence[Given]], seed: int = 0, *, explained: bool = True
) -> KinematicJudgement:
    """Judge the formulas of a sheet; see :func:`judge_inverse`.

    Raises
    ------
    AnswerError
        A formula with a name that is not known yet.
    """
    if unreadable := unreadable_entries("ik", branches):
        return KinematicJudgement(unreadable)
    trees = [[entry.tree for entry in branch if entry.tree is not None] for branch in branches]
    judgement = judge_inverse(description, trees, seed=seed, explained=explained)
    return replace(judgement, entries=with_texts(judgement.entries, branches))


def judge_inverse(
    description: Description,
    branches: Sequence[Sequence[Tree]],
    samples: int = 1000,
    seed: int = 0,
    *,
    explained: bool = True,
) -> InverseJudgement:
    """Judge formulas of an arm's inverse kinematics.

    An arm of few joints is asked for what it can meet: a planar arm of two joints for positions alone, and so is any
    arm of three joints or fewer without a closed form of ours whose joints the position determines.

    Parameters
    ----------
    description
        The robot.
    branches
        Of each branch one formula a joint, rad or m, in the tool's pose in the world (px py pz, r11 ... r33), the
        robot's parameters, pi, and the other joints; no two may need each other.
    samples
        How many random poses: forward kinematics of joint values inside the limits. Without limits, joints turn by a
        whole turn, and slide by a metre outwards.
    seed
        Of the random poses.
    explained
        Whether mistakes are looked for; verdicts do not depend on it.

    Raises
    ------
    AnswerError
        No branch, another number of formulas, an unknown name or function, joints that need each other.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.expressions import read
    >>> branch = [read(formula) for formula in ("atan(py/px)", "sqrt(px^2 + py^2)")]
    >>> judged = judge_inverse(library_robot("polar_rp"), [branch])
    >>> judged.verdict.value, judged.diagnosis[0].where, judged.diagnosis[0].mistake
    ('wrong', 'ik, branch 1, q1', 'quadrant')
    """
    _check(description, branches)
    with np.errstate(all="ignore"):
        return _judged(description, branches, Poses.random(description, samples, seed), explained)


def _judged(
    description: Description, branches: Sequence[Sequence[Tree]], poses: Poses, explained: bool
) -> InverseJudgement:
    search = Search(description)
    answers = [Branch(poses, tuple(branch)) for branch in branches]
    duplicates = tuple((i, j) for j in range(len(answers)) for i in range(j) if poses.same(answers[i].q, answers[j].q))
    repeats = {j: i for i, j in reversed(duplicates)}
    entries, diagnosis = [], []
    for k, answer in enumerate(answers):
        found = [] if answer.is_right or not explained else list(search.explanations(answer))
        diagnosis += [_diagnosis(k, one) for one in sorted(found, key=lambda one: answer.rank(one.joint or 0))]
        if k in repeats and explained and all(one.joint is not None for one in found):
            diagnosis.append(_of_duplicate(answers, repeats[k], k))
        entries.append(_entry(k, answer, found, repeats.get(k)))
    solutions, covered = _coverage(poses, answers)
    return InverseJudgement(
        tuple(entries),
        tuple(diagnosis),
        _notes(poses, solutions, covered),
        closures=tuple(map(Closure.of, answers)),
        duplicates=duplicates,
        solutions=solutions,
        covered=covered,
    )


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


def _entry(k: int, branch: Branch, found: Sequence[Explanation], repeats: int | None) -> Entry:
    """Return the judgement of branch k, from 0."""
    if branch.is_right and repeats is None:
        return Entry("ik", (k,), Verdict.CORRECT, statement=str(Closure.of(branch)))
    repetition = "" if repeats is None else f"gives the same solutions as branch {repeats + 1}"
    blamed = next((one.joint for one in found if one.joint is not None), None)
    witness = None if branch.is_right else _witness(branch, blamed)
    return Entry("ik", (k,), Verdict.WRONG, statement=repetition or str(Closure.of(branch)), witness=witness)


def _witness(branch: Branch, joint: int | None) -> Witness:
    """Return a pose that a branch does not close, one where it has values if there is one, and a joint's values there.

    The truth is the solution that is nearest, joint after joint; the joint is the first that is wrong unless given.
    """
    valued = branch.failing & np.all(np.isfinite(branch.q), axis=1)
    s = int(np.argmax(valued if np.any(valued) else branch.failing))
    one = Branch(branch.poses.at([s]), branch.trees)
    joint = joint if joint is not None else branch.order[min(int(one.agreement[0][0]), branch.n - 1)]
    pose = {name: float(np.asarray(one.poses.values[name])[0]) for name in POSE_NAMES}
    answer = float(one.q[0, joint])
    truth = float(one.poses.truths[0, one.agreement[1][0], joint])
    return Witness(pose, answer if np.isfinite(answer) else None, truth)


def _diagnosis(k: int, found: Explanation) -> Diagnosis:
    """Return what a report says of a mistake in branch k, from 0."""
    where = f"ik, branch {k + 1}" + ("" if found.joint is None else f", q{found.joint + 1}")
    joint = "" if found.joint is None else f"q{found.joint + 1}"
    if found.mistake is not None:
        sentence = sentence_of(found.mistake, joint)
    elif joint:
        sentence = f"{joint} is the first that is wrong."
    elif found.is_near:
        sentence = f"The joint values are near to a solution, but do not bring the tool to the pose to {CLOSES:g}."
    else:
        sentence = "The joint values do not bring the tool to the pose; no single mistake explains it."
    return Diagnosis(found.mistake, sentence, where, (_name(k),), hint_of(found.mistake))


def _of_duplicate(answers: Sequence[Branch], i: int, j: int) -> Diagnosis:
    """Say of a branch that gives the same as an earlier one whether another sign would make it another."""
    mistake = "duplicate_branch"
    for trees in _other_signs(answers[j]):
        branch = answers[j].with_trees(trees)
        if branch.is_right and not any(branch.poses.same(branch.q, answer.q) for answer in answers):
            mistake = "elbow_sign"
            break
    sentence = sentence_of(mistake, detail=f"it gives the same as branch {i + 1}")
    return Diagnosis(mistake, sentence, f"ik, branch {j + 1}", (_name(j),), hint_of(mistake))


def _other_signs(branch: Branch) -> Iterator[tuple[Tree, ...]]:
    """Yield a branch's formulas with other signs of roots and arc cosines: in one formula, and in all."""
    changed = [list(with_signs_changed(tree)) for tree in branch.trees]
    for joint, trees in enumerate(changed):
        for tree in trees:
            yield (*branch.trees[:joint], tree, *branch.trees[joint + 1 :])
    # The last change of a formula is that of all its roots.
    yield tuple(new[-1] if new else old for old, new in zip(branch.trees, changed, strict=True))


def _name(k: int) -> str:
    return Entry("ik", (k,), Verdict.WRONG).name


def _notes(poses: Poses, solutions: int | None, covered: int | None) -> tuple[Note, ...]:
    notes = []
    if not poses.asks_rotation:
        kind = NoteKind.ASKED_FOR if poses.met else NoteKind.POSITIONS_ONLY
        notes.append(Note(kind, "ik", poses.met))
    if solutions is None or covered is None:
        notes.append(Note(NoteKind.NO_CLOSED_FORM, "ik"))
    elif covered < solutions:
        notes.append(Note(NoteKind.SOLUTIONS_MISSING, "ik", (str(covered), str(solutions))))
    return tuple(notes)


def _coverage(poses: Poses, answers: Sequence[Branch]) -> tuple[int | None, int | None]:
    """Return how many solutions there are in general, and how many of these branches give."""
    if not poses.has_closed_form:
        return None, None
    valid = np.all(np.isfinite(poses.solutions), axis=-1)
    most = int(np.max(np.sum(valid, axis=1)))
    given = np.zeros_like(valid)
    for answer in answers:
        given |= poses.matches(answer.q, poses.solutions) & answer.closed[:, None]
    general = np.sum(valid, axis=1) == most
    return most, int(np.median(np.sum(given, axis=1)[general]))
