"""A URDF of another source compared with a table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from dhkit import dynamics, kinematics
from dhkit.description import Array, Description, pose_parts, takes_robot
from dhkit.errors import ModelError
from dhkit.model.urdf_chain import (
    BASE_FRAME,
    TIP_FRAME,
    Chain,
    chain_model,
    read_chain,
    tip_in_base,
)
from dhkit.verification.comparison import Comparison, largest, worst
from dhkit.verification.differences import differences
from dhkit.verification.measure import Floors, relative_error
from dhkit.verification.reference import PinocchioResults
from dhkit.verification.second_opinion import second_opinion
from dhkit.verification.states import random_motions
from dhkit.verification.verification_report import VerificationReport, printable

_SAME_POSE = 1e-12
"""Largest difference of positions, m, and of rotation entries that is rounding."""
_ROUNDING_STATES = 100
"""Number of states at which a URDF is compared with itself, read as designed."""
_TOOL_SHARE = 2.0
"""Allowed difference of tools, in differences between the URDF's tool as written and as designed: a table whose axes
were made parallel is nearer to either reading than they are to each other."""
_DYNAMICS_SHARE = 10.0
"""Allowed relative difference of M, g and tau, in the same differences of the tool."""
_CONSTANT = 1e-6
"""Largest variation between states, m and rotation entries, of a transform between tools that counts as constant."""


class _OffsetFrame(Enum):
    """The frame by which two arms differ, with the beginning of the sentence that says so."""

    TOOL = "tool: the URDF's stands in the table's"
    BASE = "base: the URDF's arm stands, in the table's world,"


@dataclass(frozen=True, eq=False)
class _ConstantOffset:
    """A transform by which the tools of two arms differ at all states."""

    frame: _OffsetFrame
    T: Array
    """Shape (4, 4): the URDF's frame in the table's."""

    def __str__(self) -> str:
        xyz, rpy = pose_parts(self.T, order="xyz", degrees=True)
        place = ", ".join(f"{x + 0.0:.6g}" for x in np.round(xyz, 9))
        angles = ", ".join(f"{x + 0.0:.6g}" for x in np.round(rpy, 7))
        return f"the arms differ by a constant {self.frame.value} at xyz ({place}) m, rpy ({angles}) degrees"


@takes_robot
def verify_urdf(
    description: Description,
    path: str | Path,
    tip: str | None = None,
    samples: int = 1000,
    seed: int = 0,
    tolerance: float = 1e-9,
    *,
    base: str | None = None,
) -> VerificationReport:
    """Compare a URDF with a table: tool poses, mass matrices and torques at the same joint values.

    Pinocchio computes the URDF, dhkit the table. Joints are matched by their order along the chain, not by name.
    Gravity and rotor inertias, which a URDF does not contain, are the table's.

    Parameters
    ----------
    description
        The table.
    path
        The URDF.
    tip
        The link whose frame is the tool; the end of the only chain if not given.
    samples, seed
        Number and seed of random states inside the table's limits.
    tolerance
        The largest error that still counts as agreement; files often carry few digits.
    base
        The link that is the world; the root if not given.

    Returns
    -------
    VerificationReport
        The worst error of each quantity, with its state, and the differences found, in words; ``.ok``.

    Raises
    ------
    ModelError
        The URDF cannot be read, has another number or other kinds of joints, or Pinocchio is not installed.
    ValueError
        ``samples`` is below 1, or a tolerance that is not positive.

    Examples
    --------
    >>> from dhkit.description import asset, library_robot
    >>> verify_urdf(library_robot("planar2r"), asset("urdf/planar2r.urdf"), samples=20).ok
    True
    """
    if not 0 < tolerance < np.inf:
        raise ValueError(f"tolerance is {tolerance}; expected a positive, finite number")
    chain = read_chain(path, base, tip)
    if chain.kinds != description.kinds:
        raise ModelError(
            f"{path}: joints {', '.join(chain.names)} are {chain.kinds}; expected {description.kinds} as in"
            f" {description.name}'s table; another tip may end another chain"
        )
    model = chain_model(chain)
    model.gravity.linear = np.array(description.numbers.gravity)
    model.armature = np.array(description.numbers.armature)
    motion = random_motions(description, samples, seed)
    reference = PinocchioResults(model, motion, description.numbers.coupling)
    notes = [f"joints in order: {', '.join(chain.names)}; tool: {chain.tip}", *chain.notes]
    notes += _limits(description, chain)
    rounding = _rounding_of_angles(chain, motion.q, max(1.0, description.reach))
    if rounding > tolerance:
        notes.append(
            f"the file's angles are rounded: as designed the tool differs by up to {rounding:.1e}, as a share of the"
            " reach and in rad; differences of that size count as agreement"
        )
    comparisons, offsets = _tool(description, reference, tolerance + _TOOL_SHARE * rounding)
    notes += [*map(str, offsets), *second_opinion(chain, motion.q, _tools(reference))]
    if not any(offset.frame is _OffsetFrame.BASE for offset in offsets):
        notes += differences(description, model, tolerance + _TOOL_SHARE * rounding)
    if all(joint.bodies for joint in description.joints):
        notes += reference.notes
        comparisons += _dynamics(description, reference, tolerance + _DYNAMICS_SHARE * rounding)
    else:
        notes.append("dynamics not compared: the table has links without a body")
    import pinocchio as pin

    return VerificationReport(
        robot=description.name,
        reference=f"{printable(Path(path).name)} in Pinocchio {pin.__version__}",
        samples=samples,
        seed=seed,
        agreements=tuple(worst(comparison, motion) for comparison in comparisons),
        notes=tuple(map(printable, notes)),
    )


def _rounding_of_angles(chain: Chain, q: Array, reach: float) -> float:
    """Return the largest difference of a URDF's tool between its angles as written and as designed, unrounded.

    The difference is that of positions as shares of the reach, and of entries of the rotation, at joint values q
    (N, n); 0 if no angle is rounded.
    """
    designed = read_chain(chain.path, chain.base, chain.tip, as_designed=True)
    if not designed.tree.changes:
        return 0.0
    states = q[:_ROUNDING_STATES]
    difference = np.array(
        [tip_in_base(designed, state) - tip_in_base(chain, state) for state in states]
    )
    difference[:, :3, 3] /= reach
    return float(np.abs(difference).max())


def _tool(
    description: Description, reference: PinocchioResults, tolerance: float
) -> tuple[list[Comparison], list[_ConstantOffset]]:
    """Return the comparisons of the tool's pose, and the constant transforms that explain a difference."""
    ours = kinematics.forward_kinematics(description, reference.motion.q)
    theirs = _tools(reference)
    reach = max(1.0, description.reach)
    position = largest(ours[:, :3, 3] - theirs[:, :3, 3]) / reach
    rotation = largest(ours[:, :3, :3] - theirs[:, :3, :3])
    comparisons = [
        Comparison("tool position", position, tolerance),
        Comparison("tool rotation", rotation, tolerance),
    ]
    differs = max(position.max(), rotation.max()) > max(tolerance, _SAME_POSE)
    offsets = list(_constant_offsets(ours, theirs)) if differs else []
    return comparisons, offsets


def _tools(reference: PinocchioResults) -> Array:
    """Return the URDF's tip in its base, shape (N, 4, 4)."""
    frames = reference.frames([BASE_FRAME, TIP_FRAME])
    return np.asarray(np.linalg.inv(frames[:, 0]) @ frames[:, 1])


def _constant_offsets(ours: Array, theirs: Array) -> Iterator[_ConstantOffset]:
    """Yield the constant transforms at the tool and at the base between two tools, shape (N, 4, 4) each."""
    # theirs = ours X at the tool, or theirs = X ours at the base, with a constant X
    inverse = np.linalg.inv(ours)
    for frame, offsets in (
        (_OffsetFrame.TOOL, inverse @ theirs),
        (_OffsetFrame.BASE, theirs @ inverse),
    ):
        variation = np.abs(offsets - offsets[0]).max()
        if variation < _CONSTANT:
            yield _ConstantOffset(frame, offsets[0])


def _dynamics(
    description: Description, reference: PinocchioResults, tolerance: float
) -> Iterator[Comparison]:
    """Yield the comparisons of M, g and tau; errors are relative to the table's."""
    q, qd, qdd = reference.motion
    M = dynamics.mass_matrix(description, q)
    g = dynamics.gravity_torque(description, q)
    tau = dynamics.inverse_dynamics(description, q, qd, qdd)
    floors = Floors.of(description, M, qd, qdd, tau)
    yield Comparison("mass matrix M", relative_error(reference.mass_matrix(), M), tolerance)
    yield Comparison(
        "gravity torque g", relative_error(reference.gravity_torque(), g, floors.g), tolerance
    )
    error = relative_error(reference.inverse_dynamics(), tau, floors.tau)
    yield Comparison("inverse dynamics tau", error, tolerance, 3)


def _limits(description: Description, chain: Chain) -> Iterator[str]:
    """Yield a sentence for each joint whose limits differ."""
    numbers = description.numbers
    for i, (joint, name) in enumerate(zip(description.joints, chain.names, strict=True)):
        own = (numbers.lower[i], numbers.upper[i])
        theirs = chain.limits.get(name)
        if (
            joint.limits is not None
            and theirs is not None
            and not np.allclose(own, theirs, atol=1e-3)
        ):
            yield (
                f"joint {i + 1}: limits {theirs[0]:.4g} to {theirs[1]:.4g} in the URDF,"
                f" {own[0]:.4g} to {own[1]:.4g} in the table"
            )
