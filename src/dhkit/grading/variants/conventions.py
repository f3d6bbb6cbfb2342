"""The same arm with its table in the other Denavit-Hartenberg convention."""

from __future__ import annotations

from dataclasses import replace

from dhkit.description import Base, Convention, Description, Joint, Tool
from dhkit.description.bodies import ExactPose, moved_body
from dhkit.description.exact_poses import (
    inverse,
    moved,
    placement_of,
    pose_of,
    rotation_x,
    translation,
)
from dhkit.expressions import ZERO, Expression


def in_convention(description: Description, convention: Convention) -> Description:
    """Return an arm with its table in a convention: the same motion, frames of the other convention, no shapes.

    Between the rotations about z of joints i and i + 1 stands X_i = Tx(a) Rx(alpha), which belongs to row i in the
    standard convention and to row i + 1 in the modified one (Craig, Introduction to Robotics, ch. 3). So a and alpha
    move by a row, and the frame of link i by X_i. At the ends, X becomes part of the tool's or the base's placement.

    Parameters
    ----------
    description
        The arm.
    convention
        The convention of the new table.
    """
    bare = _without_shapes(description)
    if description.convention is convention:
        return bare
    if convention is Convention.MODIFIED:
        return _modified(bare)
    return _standard(bare)


def _without_shapes(description: Description) -> Description:
    """Return an arm that is drawn from its table.

    Shapes have the lengths of the robot file instead of the drawn ones, and meshes lie beside that file.
    """
    return replace(
        description,
        joints=tuple(replace(joint, shapes=()) for joint in description.joints),
        base=replace(description.base, shapes=()),
        tool=replace(description.tool, shapes=()),
        drawn=True,
    )


def _modified(description: Description) -> Description:
    """Return a standard arm in the modified convention: frame i moves back by X_i."""
    a = ZERO
    alpha = ZERO
    joints = []
    for joint in description.joints:
        joints.append(_with_row(joint, a, alpha, _along_x(joint)))
        a = joint.a
        alpha = joint.alpha
    tool = Tool(moved(description.tool.placement, _along_x(description.joints[-1])))
    return replace(description, joints=tuple(joints), tool=tool, convention=Convention.MODIFIED)


def _standard(description: Description) -> Description:
    """Return a modified arm in the standard convention: frame i moves on by X_i, frame 0 by the first row's."""
    joints = []
    for i, joint in enumerate(description.joints):
        if i + 1 < description.n:
            following = description.joints[i + 1]
            joints.append(
                _with_row(joint, following.a, following.alpha, inverse(_along_x(following)))
            )
        else:
            joints.append(replace(joint, a=ZERO, alpha=ZERO))
    base = description.base
    first = _along_x(description.joints[0])
    if not (description.joints[0].a.is_zero and description.joints[0].alpha.is_zero):
        body = None if base.body is None else moved_body(base.body, inverse(first))
        base = Base(placement_of(pose_of(base.placement) @ first), (), body)
    return replace(description, joints=tuple(joints), base=base, convention=Convention.STANDARD)


def _along_x(joint: Joint) -> ExactPose:
    """Return Tx(a) Rx(alpha) of a row."""
    T: ExactPose = translation(x=joint.a) @ rotation_x(joint.alpha)
    return T


def _with_row(joint: Joint, a: Expression, alpha: Expression, T: ExactPose) -> Joint:
    """Return a joint with another a and alpha, and its bodies in the frame that T maps the earlier one to."""
    bodies = tuple(moved_body(body, T) for body in joint.bodies)
    return replace(joint, a=a, alpha=alpha, bodies=bodies)
