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
from dhkit.grading.judging.inverse_mistakes import MistakeSearch
from dhkit.grading.judging.inverse_poses import CLOSES, MATCHES, Mask, Poses
from dhkit.grading.judging.numeric import doubles
from dhkit.grading.judging.step_context import StepContext
from dhkit.symbolic.inverse.forms import Circle

_FEW_POSES = 60
"""Number of random poses at which a formula is tried for an arm with a length of zero."""
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
        Branch of the formula and of known values of the other joints.
    joint
        The formula's joint, from 0.
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
            Function that says whether the formula is right for another arm.
        """
        if self._forgets_offset():
            return "shoulder_offset_forgotten", ""
        mistake = self._single_mistake(self.branch)
        if mistake:
            return mistake, ""
        mistake = self._mistake_besides_quadrants()
        if mistake:
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

    def _single_mistake(self, branch: Branch) -> str:
        """Return the mistake whose correction makes the formula right; empty if there is none."""
        lengths = self.context.lengths([branch.trees[self.joint]])
        search = MistakeSearch(self.context.description, lengths)
        explanation = next(search.explanations(branch), None)
        if explanation is None or explanation.joint != self.joint:
            return ""
        return explanation.mistake or ""

    def _mistake_besides_quadrants(self) -> str:
        """Return the mistake that is left where atan(y/x) is read as atan2(y, x); empty if none explains the rest."""
        tree = with_calls_changed(self.tree, ("atan",), with_quadrant)
        if tree is self.tree:
            return ""
        return self._single_mistake(self.branch.with_tree(self.joint, tree))

    @property
    def _joints(self) -> dict[str, Array]:
        """Values of the other joints by name, shape (S,) each."""
        return {f"q{k + 1}": self.branch.q[:, k] for k in self.branch.independent(self.joint)}

    def _right(self, x: object) -> Mask:
        """Return a mask (S,) of the poses at which values x of the joint, rad or m, are right."""
        values = self.branch.repaired(self.joint, np.asarray(x, dtype=float))
        return self.branch.agrees(self.joint, values)

    def _forgets_offset(self) -> bool:
        """Whether the formula is that of joint 1 without its offset: the direction of the point, or the opposite.

        Joint 1 follows from A cos(theta) + B sin(theta) = C, where C is the shoulder's offset. Without it,
        theta = atan2(B, A) + pi/2 or half a turn from there.
        """
        step = self.context.derived(self.joint)
        derivation = self.context.derivation
        if (
            derivation is None
            or step is None
            or self.joint != 0
            or not isinstance(step.form, Circle)
        ):
            return False
        values, _ = next(derivation.candidates(self.branch.poses.T))
        count = len(self.branch.q)
        A, B, C = (np.broadcast_to(values.of(step.form.letters[letter]), count) for letter in "ABC")
        if not np.any(np.abs(C) > CLOSES):
            return False

        theta_offset = derivation.chain.number(derivation.chain.offsets[0])
        straight = np.arctan2(B, A) + np.pi / 2 - theta_offset
        x = self.branch.q[:, 0]
        is_straight = np.abs(_wrapped(x - straight)) < MATCHES
        is_opposite = np.abs(_wrapped(x - straight - np.pi)) < MATCHES
        return bool(np.mean(is_straight | is_opposite) > _ALMOST_ALL)

    def _needs_another_sign(self) -> bool:
        """Whether the formula is right at a part of the poses, and at the others with another sign of a root in it."""
        right = self._right(self.branch.q[:, self.joint])
        if not np.any(right):
            return False
        formula = self.branch.editable(self.joint)
        for tree in with_signs_changed(self.tree):
            right_with_sign = self._right(formula.of(tree))
            if np.all(right | right_with_sign):
                return True
        return False

    def _is_in_base(self) -> bool:
        """Whether the formula is right if r11 ... r33 are the tool's rotation in an earlier frame k, such as R_36."""
        poses = self.branch.poses
        if poses.known is None or not names_of(self.tree) & {*_ROTATIONS}:
            return False
        R_tool = poses.T[:, :3, :3]
        frames = world_to_frames(self.context.description, poses.known)
        for k in range(1, self.joint + 1):
            # R_k,tool = R_k^T R_tool, both in the world
            R_k = frames[:, k, :3, :3]
            R = np.swapaxes(R_k, 1, 2) @ R_tool
            entries = dict(zip(_ROTATIONS, R.reshape(-1, 9).T, strict=True))
            if np.all(self._right(doubles(self.tree, {**poses.values, **self._joints, **entries}))):
                return True
        return False


def _wrapped(angle: Array) -> Array:
    """Return angles in [-pi, pi), rad."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def _arms_without_a_length(description: Description) -> Iterator[tuple[str, Description]]:
    """Yield the name of each length of the table that is not zero, with the arm in which that length is zero."""
    for i, joint in enumerate(description.joints):
        for name, entry, other in (
            (f"d{i + 1}", joint.d, replace(joint, d=ZERO)),
            (f"a{i + 1}", joint.a, replace(joint, a=ZERO)),
        ):
            if entry == ZERO:
                continue
            symbols = sorted(entry.symbols)
            joints = (*description.joints[:i], other, *description.joints[i + 1 :])
            try:
                arm = replace(description, joints=joints)
            except DescriptionError:
                continue
            yield symbols[0] if len(symbols) == 1 else name, arm
