"""Mistakes in the solution of a step of inverse kinematics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from dhkit.description import Array, Description, world_to_frames
from dhkit.errors import AnswerError, DescriptionError
from dhkit.expressions import ZERO
from dhkit.expressions.trees import names_of
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.judging.changed_formulas import with_calls_changed, with_quadrant
from dhkit.grading.judging.inverse_branch import Branch
from dhkit.grading.judging.inverse_edits import with_signs_changed
from dhkit.grading.judging.inverse_mistakes import Search
from dhkit.grading.judging.inverse_poses import CLOSES, MATCHES, Mask, Poses
from dhkit.grading.judging.numeric import doubles
from dhkit.grading.judging.step_context import StepContext
from dhkit.symbolic.inverse.forms import Circle

_FEW_POSES = 60
"""Number of random poses at which an arm with a length of zero is tried."""
_ALMOST_ALL = 0.99
"""Share of poses at which a formula's value is that of joint 1 without its offset."""
_ROTATIONS = POSE_NAMES[3:]


class SolutionMistakes:
    """Search for the mistake in a step's formula.

    Parameters
    ----------
    context
        The arm and poses.
    branch
        The formula among known values of the other joints.
    joint
        Its joint, from 0.
    """

    def __init__(self, context: StepContext, branch: Branch, joint: int) -> None:
        self.context = context
        self.branch = branch
        self.joint = joint
        self.tree = branch.trees[joint]

    def mistake(self, is_right_for: Callable[[StepContext], bool]) -> tuple[str, str] | None:
        """Return the mistake that explains a wrong formula, and a detail; None if none is found.

        Parameters
        ----------
        is_right_for
            Whether the formula is right for another arm.
        """
        if self._forgets_offset():
            return "shoulder_offset_forgotten", ""
        search = Search(self.context.description, self.context.lengths([self.tree]))
        explanation = next(search.explanations(self.branch), None)
        if explanation is not None and explanation.joint == self.joint and explanation.mistake:
            return explanation.mistake, ""
        if mistake := self._besides_quadrants():
            return mistake, ""
        if self._needs_another_sign():
            return "sign_lost", ""
        for mistake, values in self.context.misread(self.branch.poses):
            if np.all(self._right(doubles(self.tree, {**values, **self._joints}))):
                return mistake, ""
        if self._is_in_base():
            return "rotation_not_reduced", ""
        for name, other in _arms_without_a_length(self.context.description):
            try:
                poses = Poses.random(other, _FEW_POSES, self.context.seed)
                if is_right_for(StepContext(other, poses, self.context.seed, explain=False)):
                    return "length_taken_as_zero", name
            except (AnswerError, DescriptionError):
                continue  # it uses the length, or the arm has no closed form without it
        return None

    def _besides_quadrants(self) -> str:
        """Return the mistake that is left where atan(y/x) is read as atan2(y, x); empty if none explains the rest."""
        tree = with_calls_changed(self.tree, ("atan",), with_quadrant)
        if tree is self.tree:
            return ""
        branch = self.branch.with_tree(self.joint, tree)
        search = Search(self.context.description, self.context.lengths([tree]))
        explanation = next(search.explanations(branch), None)
        return (explanation.mistake or "") if explanation is not None and explanation.joint == self.joint else ""

    @property
    def _joints(self) -> dict[str, Array]:
        """Values of the other joints by name, shape (S,) each."""
        return {f"q{k + 1}": self.branch.q[:, k] for k in self.branch.independent(self.joint)}

    def _right(self, x: object) -> Mask:
        """Return whether values of the joint are right, shape (S,)."""
        return self.branch.agrees(self.joint, self.branch.repaired(self.joint, np.asarray(x, dtype=float)))

    def _forgets_offset(self) -> bool:
        """Whether the formula is that of joint 1 without its offset: the direction of the point, or the opposite."""
        step = self.context.derived(self.joint)
        derivation = self.context.derivation
        if derivation is None or step is None or self.joint != 0 or not isinstance(step.form, Circle):
            return False
        values, _ = next(derivation.candidates(self.branch.poses.T))
        A, B, C = (np.broadcast_to(values.of(step.form.letters[k]), len(self.branch.q)) for k in "ABC")
        offset = derivation.chain.number(derivation.chain.offsets[0])
        straight = np.arctan2(B, A) + np.pi / 2 - offset
        x = self.branch.q[:, 0]
        near = [np.abs((x - straight - turn + np.pi) % (2 * np.pi) - np.pi) < MATCHES for turn in (0.0, np.pi)]
        return bool(np.any(np.abs(C) > CLOSES) and np.mean(near[0] | near[1]) > _ALMOST_ALL)

    def _needs_another_sign(self) -> bool:
        """Whether the formula is right at a part of the poses, and at the others with another sign of a root in it."""
        right = self._right(self.branch.q[:, self.joint])
        formula = self.branch.editable(self.joint)
        return bool(np.any(right)) and any(
            bool(np.all(right | self._right(formula.of(tree)))) for tree in with_signs_changed(self.tree)
        )

    def _is_in_base(self) -> bool:
        """Whether the formula is right with the tool's rotation in the frame behind joints before, as R_36."""
        poses = self.branch.poses
        if poses.known is None or not names_of(self.tree) & {*_ROTATIONS}:
            return False
        frames = world_to_frames(self.context.description, poses.known)
        for k in range(1, self.joint + 1):
            R = np.swapaxes(frames[:, k, :3, :3], 1, 2) @ poses.T[:, :3, :3]
            turned = dict(zip(_ROTATIONS, R.reshape(-1, 9).T, strict=True))
            if np.all(self._right(doubles(self.tree, {**poses.values, **self._joints, **turned}))):
                return True
        return False


def _arms_without_a_length(description: Description) -> Iterator[tuple[str, Description]]:
    """Yield for each length of the table its name, and the arm with zero in its place."""
    for i, joint in enumerate(description.joints):
        for name, entry, other in (
            (f"d{i + 1}", joint.d, replace(joint, d=ZERO)),
            (f"a{i + 1}", joint.a, replace(joint, a=ZERO)),
        ):
            symbols = sorted(entry.symbols)
            joints = (*description.joints[:i], other, *description.joints[i + 1 :])
            try:
                if entry != ZERO:
                    yield symbols[0] if len(symbols) == 1 else name, replace(description, joints=joints)
            except DescriptionError:
                continue
