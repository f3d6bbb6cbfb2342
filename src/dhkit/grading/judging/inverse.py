"""Judging of formulas of inverse kinematics: whether their joint values bring the tool to the requested poses.

Verdicts are numerical: the formulas are evaluated in doubles at random poses, and forward kinematics gives the tool's
distance from them. All solutions are known for arms with a closed form in dhkit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from dhkit.description import Description
from dhkit.errors import AnswerError
from dhkit.expressions import CONSTANTS
from dhkit.expressions.syntax import Tree
from dhkit.expressions.trees import names_of, parts_of
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.catalogue import hint_of, sentence_of
from dhkit.grading.grade_report import (
    Diagnosis,
    Entry,
    KinematicJudgement,
    Verdict,
    Witness,
    entry_name,
)
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.grading.judging.inverse_branch import Branch, joint_order
from dhkit.grading.judging.inverse_edits import with_signs_changed
from dhkit.grading.judging.inverse_mistakes import Explanation, MistakeSearch
from dhkit.grading.judging.inverse_poses import CLOSES, Poses
from dhkit.grading.remarks import Note, NoteKind
from dhkit.symbolic import table_lengths


@dataclass(frozen=True)
class Closure:
    """Number of poses that a branch reaches.

    Attributes
    ----------
    closed, poses
        Number of poses that the branch reaches, among those that it must reach, and number of the latter.
    without_value
        Number of poses that it must reach and at which it has no value: the root of a negative number, an arc cosine
        beyond 1.
    """

    closed: int
    poses: int
    without_value: int = 0

    @classmethod
    def of(cls, branch: Branch) -> Closure:
        """Return the counts of a branch."""
        required = branch.reachable
        without_value = required & np.any(np.isnan(branch.q), axis=1)
        return cls(
            closed=int(np.sum(branch.closed & required)),
            poses=int(np.sum(required)),
            without_value=int(np.sum(without_value)),
        )

    def __str__(self) -> str:
        """Return the count in one line."""
        count = f"closes {self.closed} of {self.poses} poses"
        if self.closed == self.poses:
            return f"{count} to {CLOSES:g}; tried, not proved"
        if not self.without_value:
            return count
        share = 100 * self.without_value / max(self.poses, 1)
        return f"{count}, has no value on {share:.3g} %"


@dataclass(frozen=True)
class InverseJudgement(KinematicJudgement):
    """Judgement of formulas of inverse kinematics, with one entry for each branch.

    A branch is CORRECT if it reaches every tried pose that the exact branch reaches which it follows, else WRONG. A
    branch that repeats another is WRONG.

    Attributes
    ----------
    closures
        Number of poses that each branch reaches.
    duplicates
        Pairs of branches, from 0, that give the same joint values wherever both have values.
    solutions, covered
        Number of solutions that the arm has in general, limits aside, and number of those that the branches give; None
        without a closed form.
    """

    closures: tuple[Closure, ...] = ()
    duplicates: tuple[tuple[int, int], ...] = ()
    solutions: int | None = None
    covered: int | None = None


def judge_inverse(
    description: Description,
    branches: Sequence[Sequence[Tree]],
    samples: int = 1000,
    seed: int = 0,
    *,
    explain: bool = True,
) -> InverseJudgement:
    """Judge formulas of an arm's inverse kinematics.

    Only those parts of a pose are required that the arm can reach: of a planar arm with two joints the position. The
    position alone is also required of an arm with at most three joints that has no closed form in dhkit, if the
    position determines its joints.

    Parameters
    ----------
    description
        The robot.
    branches
        For each branch one formula for each joint, rad or m, in the tool's pose in the world (px py pz, r11 ... r33),
        the robot's parameters, pi, and other joints; no two formulas may need each other.
    samples
        Number of random poses, the forward kinematics of joint values inside the limits. The range of a joint without
        limits is a whole turn, or a metre outwards.
    seed
        Seed of the random poses.
    explain
        Whether to look for mistakes; verdicts do not depend on it.

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
        return _judge(description, branches, Poses.random(description, samples, seed), explain)


def _judge(
    description: Description, branches: Sequence[Sequence[Tree]], poses: Poses, explain: bool
) -> InverseJudgement:
    search = MistakeSearch(description)
    answers = [Branch(poses, tuple(branch)) for branch in branches]

    duplicates: list[tuple[int, int]] = []
    for j, answer in enumerate(answers):
        duplicates += [(i, j) for i in range(j) if poses.same(answers[i].q, answer.q)]
    # The first branch that each repeats.
    repeats = {j: i for i, j in reversed(duplicates)}

    entries: list[Entry] = []
    diagnosis: list[Diagnosis] = []
    for k, answer in enumerate(answers):
        explanations = [] if answer.is_right or not explain else list(search.explanations(answer))
        diagnosis += [_diagnosis(k, explanation) for explanation in _in_order(answer, explanations)]
        if k in repeats and explain and all(one.joint is not None for one in explanations):
            diagnosis.append(_diagnose_duplicate(answers, repeats[k], k))
        entries.append(_entry(k, answer, explanations, repeats.get(k)))
    solutions, covered = _coverage(poses, answers)
    return InverseJudgement(
        tuple(entries),
        tuple(diagnosis),
        _notes(poses, solutions, covered),
        closures=tuple(map(Closure.of, answers)),
        duplicates=tuple(duplicates),
        solutions=solutions,
        covered=covered,
    )


def _check(description: Description, branches: Sequence[Sequence[Tree]]) -> None:
    """Refuse formulas that cannot be evaluated.

    Raises
    ------
    AnswerError
        No branch, another number of formulas, a formula that is too long, an unknown name, or joints that need each
        other.
    """
    if not branches:
        raise AnswerError("ik: no branch")
    n = description.n
    lengths = [*description.parameters, *table_lengths(description)]
    known = {*POSE_NAMES, *lengths, *CONSTANTS}
    for b, branch in enumerate(branches, start=1):
        if len(branch) != n:
            raise AnswerError(
                f"ik, branch {b}: {len(branch)} formula{'s' * (len(branch) != 1)}; expected {n}"
            )
        for k, tree in enumerate(branch):
            where = f"ik, branch {b}, q{k + 1}"
            nodes = sum(1 for _ in islice(parts_of(tree), BOUNDS.formula_nodes + 1))
            if nodes > BOUNDS.formula_nodes:
                raise AnswerError(
                    f"{where}: a formula of more than {BOUNDS.formula_nodes} terms and factors"
                )

            others = {f"q{i + 1}" for i in range(n) if i != k}
            unknown = sorted(names_of(tree) - known - others)
            if not unknown:
                continue
            name = unknown[0]
            if name == f"q{k + 1}":
                raise AnswerError(f"{where}: uses {name}, which it is to give")
            expected = [*POSE_NAMES[:3], "r11 ... r33", *lengths, "pi", "other joints"]
            raise AnswerError(f"{where}: unknown name {name!r}; expected {', '.join(expected)}")
        joint_order(branch, f"ik, branch {b}")


def _in_order(branch: Branch, explanations: Sequence[Explanation]) -> list[Explanation]:
    """Return explanations in the order in which the branch evaluates their joints."""
    return sorted(explanations, key=lambda explanation: branch.rank(explanation.joint or 0))


def _entry(
    k: int, branch: Branch, explanations: Sequence[Explanation], repeats: int | None
) -> Entry:
    """Return the entry of branch k, from 0; ``repeats`` is the number of an earlier branch that is the same, from 0."""
    if branch.is_right and repeats is None:
        return Entry("ik", (k,), Verdict.CORRECT, statement=str(Closure.of(branch)))
    repetition = "" if repeats is None else f"gives the same solutions as branch {repeats + 1}"
    statement = repetition or str(Closure.of(branch))
    blamed = next((one.joint for one in explanations if one.joint is not None), None)
    witness = None if branch.is_right else _witness(branch, blamed)
    return Entry("ik", (k,), Verdict.WRONG, statement=statement, witness=witness)


def _witness(branch: Branch, joint: int | None) -> Witness:
    """Return a pose that a branch does not reach, and a joint's values there.

    The branch has values at the pose if it has at any such pose. The truth is the solution that is nearest joint by
    joint; the joint, from 0, is the first wrong one unless given.
    """
    has_values = branch.failing & np.all(np.isfinite(branch.q), axis=1)
    s = int(np.argmax(has_values if np.any(has_values) else branch.failing))
    one = Branch(branch.poses.at([s]), branch.trees)
    if joint is None:
        rank = min(int(one.agreement.first_wrong[0]), branch.n - 1)
        joint = branch.order[rank]
    pose = {name: float(np.asarray(one.poses.values[name])[0]) for name in POSE_NAMES}
    answer = float(one.q[0, joint])
    truth = float(one.poses.truths[0, one.agreement.nearest[0], joint])
    return Witness(pose, answer if np.isfinite(answer) else None, truth)


def _diagnosis(k: int, explanation: Explanation) -> Diagnosis:
    """Return the diagnosis of a mistake in branch k, from 0."""
    joint = "" if explanation.joint is None else f"q{explanation.joint + 1}"
    where = f"ik, branch {k + 1}, {joint}" if joint else f"ik, branch {k + 1}"
    if explanation.mistake is not None:
        sentence = sentence_of(explanation.mistake, joint)
    elif joint:
        sentence = f"{joint} is the first that is wrong."
    elif explanation.is_near:
        sentence = f"The joint values are near to a solution, but do not bring the tool to the pose to {CLOSES:g}."
    else:
        sentence = (
            "The joint values do not bring the tool to the pose; no single mistake explains it."
        )
    return Diagnosis(
        explanation.mistake,
        sentence,
        where,
        (entry_name("ik", (k,)),),
        hint_of(explanation.mistake),
    )


def _diagnose_duplicate(answers: Sequence[Branch], i: int, j: int) -> Diagnosis:
    """Return the diagnosis of branch j, which repeats branch i: a wrong sign if another sign gives a new solution."""
    mistake = "duplicate_branch"
    for trees in _other_signs(answers[j]):
        branch = answers[j].with_trees(trees)
        if branch.is_right and not any(branch.poses.same(branch.q, answer.q) for answer in answers):
            mistake = "elbow_sign"
            break
    sentence = sentence_of(mistake, detail=f"it gives the same as branch {i + 1}")
    return Diagnosis(
        mistake, sentence, f"ik, branch {j + 1}", (entry_name("ik", (j,)),), hint_of(mistake)
    )


def _other_signs(branch: Branch) -> Iterator[tuple[Tree, ...]]:
    """Yield a branch's formulas with other signs of roots and arc cosines, in one formula and in all."""
    changes = [list(with_signs_changed(tree)) for tree in branch.trees]
    for joint, changed_trees in enumerate(changes):
        for tree in changed_trees:
            yield branch.with_tree(joint, tree).trees

    # The last change of a formula is that of all its roots.
    yield tuple(
        changed[-1] if changed else tree
        for tree, changed in zip(branch.trees, changes, strict=True)
    )


def _notes(poses: Poses, solutions: int | None, covered: int | None) -> tuple[Note, ...]:
    """Return notes on the parts of poses that were required, and on solutions that no branch gives."""
    notes = []
    if not poses.asks_rotation:
        kind = NoteKind.ASKED_FOR if poses.pose_parts else NoteKind.POSITIONS_ONLY
        notes.append(Note(kind, "ik", poses.pose_parts))
    if solutions is None or covered is None:
        notes.append(Note(NoteKind.NO_CLOSED_FORM, "ik"))
    elif covered < solutions:
        notes.append(Note(NoteKind.SOLUTIONS_MISSING, "ik", (str(covered), str(solutions))))
    return tuple(notes)


def _coverage(poses: Poses, answers: Sequence[Branch]) -> tuple[int | None, int | None]:
    """Return the number of solutions in general, and of those that the branches give; None without a closed form."""
    if not poses.has_closed_form:
        return None, None
    exists = np.all(np.isfinite(poses.solutions), axis=-1)
    counts = np.sum(exists, axis=1)
    most = int(np.max(counts))

    is_given = np.zeros_like(exists)
    for answer in answers:
        is_given |= poses.matches(answer.q, poses.solutions) & answer.closed[:, None]

    # Poses with fewer solutions, such as those near the limit of the workspace, are not general.
    is_general = counts == most
    return most, int(np.median(np.sum(is_given, axis=1)[is_general]))
