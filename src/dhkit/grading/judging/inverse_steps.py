"""Judging of inverse kinematics that is handed in step by step: an equation for each joint, and its solution.

An equation is right if it is an identity of the arm: true whenever the pose is that of the joint values. This is proved
in the exact ring where the ring contains it, else tried. It counts if it is not an identity of all poses, and
determines its joint from those of earlier steps. A solution is tried at random poses, with the joints of earlier steps
at their true values: a joint that is right in terms of wrong earlier ones is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dhkit.description import Description
from dhkit.errors import AnswerError
from dhkit.expressions import ZERO, read
from dhkit.expressions.syntax import Name, Tree
from dhkit.expressions.trees import names_of
from dhkit.grading.answers.inverse_steps import GivenStep
from dhkit.grading.catalogue import hint_of, sentence_of
from dhkit.grading.grade_report import (
    NO_STEP,
    Diagnosis,
    Entry,
    KinematicJudgement,
    Verdict,
    entry_name,
)
from dhkit.grading.judging.changed_formulas import renamed, with_term
from dhkit.grading.judging.inverse_poses import Poses
from dhkit.grading.judging.step_context import Part, StepContext
from dhkit.grading.judging.step_equations import Equations
from dhkit.grading.judging.step_solutions import Solutions
from dhkit.grading.remarks import Note, NoteKind


def _steps_in_table_angles(
    description: Description, steps: Sequence[GivenStep]
) -> list[GivenStep] | None:
    """Return steps whose angles are the table's theta, joint value plus offset, in joint values; None if they agree."""
    offsets: dict[int, Tree] = {}
    for j, joint in enumerate(description.joints):
        if description.kinds[j] == "R" and joint.theta != ZERO:
            offsets[j] = read(str(joint.theta))
    if not offsets:
        return None

    # theta = q + offset stands in the formulas, and q = theta - offset is the joint value.
    change: dict[str, Tree] = {}
    for j, offset in offsets.items():
        name = f"q{j + 1}"
        change[name] = with_term(Name(name, 0), True, offset)
    changed = []
    for step in steps:
        solutions = [renamed(tree, change) for tree in step.solutions]
        if step.joint in offsets:
            solutions = [with_term(tree, False, offsets[step.joint]) for tree in solutions]
        equations = tuple(
            (renamed(left, change), renamed(right, change)) for left, right in step.equations
        )
        changed.append(replace(step, equations=equations, solutions=tuple(solutions)))
    return changed


def judge_steps(
    description: Description,
    steps: Sequence[GivenStep],
    samples: int = 500,
    seed: int = 0,
    *,
    explain: bool = True,
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
        if not step.error and step.joint in [other.joint for other in steps[: k - 1]]:
            raise AnswerError(f"ik, step {k}: joint {step.joint + 1} has a step already")
    poses = Poses.random(description, samples, seed)
    with np.errstate(all="ignore"):
        judge = _Judge(description, poses, seed, explain)
        judged = judge.judgement(steps)
        in_table_angles = _steps_in_table_angles(description, steps)
        if in_table_angles is None or all(
            entry.verdict is not Verdict.WRONG for entry in judged.entries
        ):
            return judged
        other = judge.judgement(in_table_angles)

    # One reading for the whole sheet: the joint values, unless more steps pass in the table's angles.
    passing = sum(entry.verdict.passes for entry in judged.entries)
    passing_in_table_angles = sum(entry.verdict.passes for entry in other.entries)
    if passing_in_table_angles <= passing:
        return judged
    return replace(other, notes=(*other.notes, Note(NoteKind.TABLE_ANGLES, "ik")))


class _JudgedStep(NamedTuple):
    """Judgement of one step."""

    entry: Entry
    """Its verdict."""
    diagnosis: list[Diagnosis]
    """Mistakes in its parts."""
    notes: list[Note]
    """Remarks, and roots that it lacks."""


class _Judge(StepContext):
    """Judges the steps of one sheet, in their order."""

    def judgement(self, steps: Sequence[GivenStep]) -> KinematicJudgement:
        """Return the judgement of all steps, with an entry for each joint without a step."""
        entries: list[Entry] = []
        diagnosis: list[Diagnosis] = []
        notes: list[Note] = []
        wrong: list[int] = []
        self.solutions = Solutions(self)
        for k, step in enumerate(steps):
            before = list(dict.fromkeys(other.joint for other in steps[:k]))
            judged = self._step(k, step, before, [j for j in before if j in wrong])
            entries.append(judged.entry)
            diagnosis += judged.diagnosis
            notes += judged.notes
            if judged.entry.verdict is Verdict.WRONG and step.joint not in self.solutions.solved:
                wrong.append(step.joint)

        missing = sorted({*range(self.description.n)} - {step.joint for step in steps})
        entries += [
            Entry("ik", (len(steps) + k,), Verdict.INCOMPLETE, statement=f"{NO_STEP} q{j + 1}")
            for k, j in enumerate(missing)
        ]
        if not self.poses.asks_rotation and self.poses.pose_parts:
            notes.append(Note(NoteKind.ASKED_FOR, "ik", self.poses.pose_parts))
        return KinematicJudgement(tuple(entries), tuple(diagnosis), tuple(notes))

    def _step(
        self, k: int, step: GivenStep, before: Sequence[int], wrong: Sequence[int]
    ) -> _JudgedStep:
        """Return the judgement of step k, from 0.

        Parameters
        ----------
        k
            Number of the step, from 0.
        step
            The step.
        before, wrong
            Joints of earlier steps, from 0, and those of them whose steps are wrong.
        """
        name = entry_name("ik", (k,))
        if step.error:
            if step.joint not in before:
                self.solutions.skip(step.joint)
            return _JudgedStep(
                Entry("ik", (k,), Verdict.UNREADABLE, step.text, statement=step.error), [], []
            )

        parts: list[Part] = []
        notes: list[Note] = []
        try:
            if step.equations:
                parts.append(Equations(self, step, before).part())
            if not step.solutions:
                self.solutions.skip(step.joint)
            else:
                part, roots = self.solutions.part(step, before)
                if part.verdict.passes:
                    # The task asks for the solution: an incomplete equation is then a remark.
                    incomplete = [one for one in parts if one.verdict is Verdict.INCOMPLETE]
                    notes += [
                        Note(NoteKind.STEP_REMARK, name, (one.statement,)) for one in incomplete
                    ]
                    parts = [one for one in parts if one not in incomplete]
                parts.append(part)
                if roots is not None and roots[0] < roots[1]:
                    notes.append(Note(NoteKind.ROOTS_MISSING, name, (str(roots[0]), str(roots[1]))))
        except AnswerError as error:
            self.solutions.skip(step.joint)
            return _JudgedStep(
                Entry("ik", (k,), Verdict.UNREADABLE, step.text, statement=str(error)), [], []
            )
        notes += [Note(NoteKind.STEP_REMARK, name, (one.remark,)) for one in parts if one.remark]

        worst = max(parts, key=lambda part: part.verdict.severity)
        statement = "; ".join(part.statement for part in parts)
        used = set().union(*map(names_of, step.solutions))
        follows = [f"q{j + 1}" for j in wrong if f"q{j + 1}" in used]
        if follows and worst.verdict.passes:
            verb = "is" if len(follows) == 1 else "are"
            statement += f"; right in terms of {', '.join(follows)}, which {verb} wrong"

        found = [
            self._diagnosis(k, step, part)
            for part in parts
            if not part.verdict.passes and part.mistakes
        ]
        difference = next((part.difference for part in parts if part.difference), None)
        witness = next((part.witness for part in parts if part.witness), None)
        read, latex = step.read_as
        entry = Entry(
            "ik",
            (k,),
            worst.verdict,
            step.text,
            latex,
            statement,
            difference=difference,
            witness=witness,
            read=read,
        )
        return _JudgedStep(entry, found, notes)

    def _diagnosis(self, k: int, step: GivenStep, part: Part) -> Diagnosis:
        """Return the diagnosis of the first mistake in a part of step k, from 0."""
        mistake, detail = part.mistakes[0]
        where = f"ik, step {k + 1}, q{step.joint + 1}"
        worked = self.worked(step.joint)
        hint = f"{hint_of(mistake)} {worked}".strip()
        sentence = sentence_of(mistake, f"q{step.joint + 1}", detail)
        return Diagnosis(mistake, sentence, where, (entry_name("ik", (k,)),), hint)

    def worked(self, joint: int) -> str:
        """Return a sentence with the step of the worked solution that finds a joint, from 0; empty without one."""
        step = self.derived(joint)
        if self.derivation is None or step is None:
            return ""
        return f"It is step {self.derivation.steps.index(step) + 1} of the worked solution: {step.look}"
