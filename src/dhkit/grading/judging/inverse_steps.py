"""Judging of inverse kinematics that is handed in step by step: an equation for each joint, and its solution.

An equation is right if it is an identity of the arm: true whenever the pose is that of the joint values. This is proved
in the exact ring where the ring contains it, else tried. It counts if it is no identity of all poses, and determines
its joint from those of earlier steps. A solution is tried at random poses, with the joints of earlier steps at their
true values: a joint that is right in terms of wrong earlier ones is right.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dhkit.description import Description
from dhkit.errors import AnswerError
from dhkit.grading.answers.inverse_steps import GivenStep
from dhkit.grading.judging.inverse_poses import Poses
from dhkit.grading.judging.numeric import names_of
from dhkit.grading.judging.step_context import Part, StepContext
from dhkit.grading.judging.step_equations import Equations
from dhkit.grading.judging.step_solutions import Solutions
from dhkit.grading.mistakes.library import hint_of, sentence_of
from dhkit.grading.report import Diagnosis, Entry, KinematicJudgement, Note, NoteKind, Verdict, entry_name


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


class _Judge(StepContext):
    def judgement(self, steps: Sequence[GivenStep]) -> KinematicJudgement:
        entries: list[Entry] = []
        diagnosis: list[Diagnosis] = []
        notes: list[Note] = []
        wrong: list[int] = []
        for k, step in enumerate(steps):
            before = [other.joint for other in steps[:k]]
            several = any(len(other.solutions) > 1 for other in steps[:k])
            entry, found, note = self._step(k, step, before, [j for j in before if j in wrong], several)
            entries.append(entry)
            diagnosis += found
            notes += note
            if entry.verdict.severity >= Verdict.WRONG.severity:
                wrong.append(step.joint)
        missing = sorted({*range(self.description.n)} - {step.joint for step in steps})
        entries += [
            Entry("ik", (len(steps) + k,), Verdict.INCOMPLETE, statement=f"no step finds q{j + 1}")
            for k, j in enumerate(missing)
        ]
        if not self.poses.asks_rotation and self.poses.pose_parts:
            notes.append(Note(NoteKind.ASKED_FOR, "ik", self.poses.pose_parts))
        return KinematicJudgement(tuple(entries), tuple(diagnosis), tuple(notes))

    def _step(
        self, k: int, step: GivenStep, before: Sequence[int], wrong: Sequence[int], several: bool
    ) -> tuple[Entry, list[Diagnosis], list[Note]]:
        """Return the entry of step k, from 0, its diagnosis, and notes.

        ``several`` says whether an earlier step gives several roots, for all of which this one has to be right.
        """
        if step.error:
            return Entry("ik", (k,), Verdict.UNREADABLE, step.text, statement=step.error), [], []
        parts, notes = [], []
        try:
            if step.equations:
                parts.append(Equations(self, step, before).part())
            if step.solutions:
                part, roots = Solutions(self, step, before, several).part()
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
