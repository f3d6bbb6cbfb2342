"""A URDF that somebody else wrote against a table."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dhkit import dynamics, kinematics
from dhkit.description import Array, Description, pose_parts, takes_robot
from dhkit.errors import ModelError
from dhkit.model.urdf_chain import BASE_FRAME, TIP_FRAME, Chain, chain_model, read_chain
from dhkit.verification.comparison import Comparison, largest, worst
from dhkit.verification.differences import differences
from dhkit.verification.measure import Floors, relative_error
from dhkit.verification.reference import Reference
from dhkit.verification.report import VerificationReport, printable
from dhkit.verification.second_opinion import second_opinion
from dhkit.verification.states import random_motions

BASE_MOVED = "the arms differ by a constant base"
ROUNDING = 1e-12
"""m and rotation entries: what is below is no difference of two arms."""
CLOSE = 1e-6
"""m and rotation entries: poses that differ by less from state to state differ by a constant transform."""


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
    """Hold somebody's URDF against a table: the same tool, the same mass matrix and torques at the same joint values.

    The URDF is computed by Pinocchio, the table by dhkit. Joints are taken in their order along the chain, whatever
    they are called. Gravity and rotor inertias, which a URDF has not, are the table's.

    Parameters
    ----------
    description
        The table.
    path
        The URDF.
    tip
        The link whose frame is the tool; the end of the only chain if not given.
    samples, seed
        How many random states inside the table's limits, from which seed.
    tolerance
        The largest error that still counts as agreement; files often carry few digits.
    base
        The link that is the world; the root if not given.

    Raises
    ------
    ModelError
        The URDF cannot be read, has another number or other kinds of joints, or Pinocchio is not installed.
    ValueError
        ``samples`` is below 1, or a tolerance that is not positive.
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
    reference = Reference(model, motion)
    notes = [f"joints in order: {', '.join(chain.names)}; tool: {chain.tip}", *chain.notes]
    notes += _limits(description, chain)
    comparisons = list(_tool(description, reference, tolerance, notes))
    notes += second_opinion(chain, motion.q, _tools(reference))
    if not any(note.startswith(BASE_MOVED) for note in notes):
        notes += differences(description, model, tolerance)
    if all(joint.bodies for joint in description.joints):
        comparisons += _dynamics(description, reference, tolerance)
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


def _tool(description: Description, reference: Reference, tolerance: float, notes: list[str]) -> Iterator[Comparison]:
    ours = kinematics.forward_kinematics(description, reference.motion.q)
    theirs = _tools(reference)
    reach = max(1.0, description.reach)
    position = largest(ours[:, :3, 3] - theirs[:, :3, 3]) / reach
    rotation = largest(ours[:, :3, :3] - theirs[:, :3, :3])
    if max(position.max(), rotation.max()) > max(tolerance, ROUNDING):
        notes += _constant_offset(ours, theirs)
    yield Comparison("tool position", position, tolerance)
    yield Comparison("tool rotation", rotation, tolerance)


def _tools(reference: Reference) -> Array:
    """Return the URDF's tip in its base, shape (N, 4, 4)."""
    frames = reference.frames([BASE_FRAME, TIP_FRAME])
    return np.asarray(np.linalg.inv(frames[:, 0]) @ frames[:, 1])


def _constant_offset(ours: Array, theirs: Array) -> Iterator[str]:
    """Say where two tools differ only by where the base or the tool's frame was put."""
    inverse = np.linalg.inv(ours)
    for what, offsets in (
        ("tool: the URDF's stands in the table's", inverse @ theirs),
        ("base: the URDF's arm stands, in the table's world,", theirs @ inverse),
    ):
        if np.abs(offsets - offsets[0]).max() < CLOSE:
            xyz, rpy = pose_parts(offsets[0], order="xyz", degrees=True)
            place = ", ".join(f"{x + 0.0:.6g}" for x in np.round(xyz, 9))
            angles = ", ".join(f"{x + 0.0:.6g}" for x in np.round(rpy, 7))
            yield f"the arms differ by a constant {what} at xyz ({place}) m, rpy ({angles}) degrees"


def _dynamics(description: Description, reference: Reference, tolerance: float) -> Iterator[Comparison]:
    q, qd, qdd = reference.motion
    M = dynamics.mass_matrix(description, q)
    g, tau = dynamics.gravity_torque(description, q), dynamics.inverse_dynamics(description, q, qd, qdd)
    floors = Floors.of(description, M, qd, qdd, tau)
    yield Comparison("mass matrix M", relative_error(reference.mass_matrix(), M), tolerance)
    yield Comparison("gravity torque g", relative_error(reference.gravity_torque(), g, floors.g), tolerance)
    error = relative_error(reference.inverse_dynamics(), tau, floors.tau)
    yield Comparison("inverse dynamics tau", error, tolerance, 3)


def _limits(description: Description, chain: Chain) -> Iterator[str]:
    """Say which limits are others."""
    numbers = description.numbers
    for i, (joint, name) in enumerate(zip(description.joints, chain.names, strict=True)):
        own = (numbers.lower[i], numbers.upper[i])
        theirs = chain.limits.get(name)
        if joint.limits is not None and theirs is not None and not np.allclose(own, theirs, atol=1e-3):
            yield (
                f"joint {i + 1}: limits {theirs[0]:.4g} to {theirs[1]:.4g} in the URDF,"
                f" {own[0]:.4g} to {own[1]:.4g} in the table"
            )
