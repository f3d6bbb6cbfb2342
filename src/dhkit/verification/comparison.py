"""Our kinematics and dynamics compared with Pinocchio's at random states."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dhkit import dynamics, kinematics
from dhkit.description import Array, Description, takes_robot
from dhkit.errors import DescriptionError
from dhkit.model import pinocchio_model
from dhkit.verification.measure import TOLERANCE, Floors, forward_tolerance, relative_error
from dhkit.verification.reference import PinocchioResults
from dhkit.verification.states import JointStates, random_motions
from dhkit.verification.verification_report import Agreement, VerificationReport

_FRAME_TOLERANCE = 1e-13
"""Tolerance for positions over the lengths of the table (at least 1 m) and rotation entries: some hundred roundings."""
_LOST_POWER = 1.5
"""Exponent of (lengths of the table / lengths of the arm) in the growth of rounding errors of dynamics: it is between 1
and 2."""
_JACOBIAN_TOLERANCE = 1e-12
"""Tolerance for Jacobian entries, linear ones over the lengths of the table (at least 1 m)."""


class Comparison(NamedTuple):
    """Errors of a quantity at N states."""

    quantity: str
    """Name of the quantity."""
    errors: Array
    """Shape (N,)."""
    tolerance: Array | float
    """Largest error that counts as agreement, shape (N,) or one for all states."""
    vectors: int = 1
    """Number of vectors of the state that the quantity depends on: 1 for q, 2 for q and qd, 3 for q, qd and qdd."""


@takes_robot
def verify(description: Description, samples: int = 1000, seed: int = 0) -> VerificationReport:
    """Compare our kinematics and dynamics with Pinocchio's, computed from the URDF that dhkit writes.

    Compared are frames, Jacobians, M, C, C qd, g, inverse and forward dynamics, energies and the regressor at random
    states inside the limits. Dynamics need a body on every link, forward dynamics a regular M. Both sides start from
    ``description.numbers``: an error in the rounding of the table, in a link's body or in the drives' inertia is the
    same on both sides and is not found here; the tests compare those with the robot files.

    Parameters
    ----------
    description
        The robot.
    samples, seed
        Number and seed of random states.

    Returns
    -------
    VerificationReport
        The worst error of each quantity, with its state; ``.ok``.

    Raises
    ------
    ModelError
        Pinocchio is not installed, or refuses the model.
    ValueError
        ``samples`` is below 1.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> report = verify(library_robot("planar2r"), samples=20)
    >>> report.ok
    True
    """
    motion = random_motions(description, samples, seed)
    reference = PinocchioResults(pinocchio_model(description), motion, description.numbers.coupling)
    comparisons = list(_kinematics(description, reference))
    notes: list[str] = []
    missing = [joint.name for joint in description.joints if not joint.bodies]
    if missing:
        notes.append(f"dynamics not compared: no body on {', '.join(missing)}")
    else:
        notes += reference.notes
        scale = _rounding_scale(description)
        if scale > 1:
            notes.append(
                f"lengths of the table add up to {description.numbers.table_length:.3g} m, those of the arm to"
                f" {description.reach:.3g} m: errors of dynamics may be {scale:.1e} times as large as otherwise"
            )
        of_dynamics = _dynamics(description, reference, notes)
        comparisons += [
            comparison._replace(tolerance=scale * comparison.tolerance)
            for comparison in of_dynamics
        ]
    import pinocchio as pin

    return VerificationReport(
        robot=description.name,
        reference=f"Pinocchio {pin.__version__}",
        samples=samples,
        seed=seed,
        agreements=tuple(worst(comparison, motion) for comparison in comparisons),
        notes=tuple(notes),
    )


def worst(comparison: Comparison, motion: JointStates) -> Agreement:
    """Return the state with the largest error relative to its tolerance; NaN counts as largest."""
    errors = comparison.errors
    tolerances = np.broadcast_to(comparison.tolerance, errors.shape)
    relative = np.where(np.isnan(errors), np.inf, errors / tolerances)
    k = int(np.argmax(relative))
    state = [tuple(map(float, vector[k])) for vector in motion[: comparison.vectors]]
    return Agreement(comparison.quantity, float(errors[k]), float(tolerances[k]), *state)


def _rounding_scale(description: Description) -> float:
    """Return how many times as large rounding errors of dynamics may be; 1 if the table has the arm's lengths.

    Differences of points that are far away lose digits: with lengths of 1e5 arms, M has lost 5 digits and the kinetic
    energy, a sum of squares of velocities, 7.
    """
    numbers = description.numbers
    if numbers.link_ends is None:
        return 1.0
    return float((numbers.table_length / numbers.reach) ** _LOST_POWER)


def _kinematics(description: Description, reference: PinocchioResults) -> Iterator[Comparison]:
    """Yield the comparisons of frames and Jacobians; positions are divided by the lengths of the table."""
    q = reference.motion.q
    size = max(1.0, description.numbers.table_length)
    frames = kinematics.frames(description, q)
    tool = kinematics.forward_kinematics(description, q)
    ours = np.concatenate([frames, tool[:, None]], axis=1)
    theirs = reference.frames([*(f"dh{i}" for i in range(description.n + 1)), "tool"])
    yield Comparison(
        "frame positions", largest(ours[..., :3, 3] - theirs[..., :3, 3]) / size, _FRAME_TOLERANCE
    )
    yield Comparison(
        "frame rotations", largest(ours[..., :3, :3] - theirs[..., :3, :3]), _FRAME_TOLERANCE
    )
    for frame in ("world", "tool"):
        J = kinematics.jacobian(description, q, frame)
        difference = J - reference.jacobian("tool", in_world=frame == "world")
        error = np.maximum(largest(difference[:, :3]) / size, largest(difference[:, 3:]))
        yield Comparison(f"Jacobian ({frame})", error, _JACOBIAN_TOLERANCE)


def _dynamics(
    description: Description, reference: PinocchioResults, notes: list[str]
) -> Iterator[Comparison]:
    """Yield the comparisons of dynamics; a note is appended if forward dynamics cannot be compared."""
    q, qd, qdd = reference.motion

    # Pinocchio's.
    M = reference.mass_matrix()
    C = reference.coriolis_matrix()
    C_qd = np.einsum("nij,nj->ni", C, qd)
    g = reference.gravity_torque()
    tau = reference.inverse_dynamics()
    floors = Floors.of(description, M, qd, qdd, tau)

    our_C = dynamics.coriolis_matrix(description, q, qd)
    our_C_qd = np.einsum("nij,nj->ni", our_C, qd)
    yield _relative("mass matrix M", dynamics.mass_matrix(description, q), M)
    yield _relative("Coriolis matrix C", our_C, C, floors.C, vectors=2)
    yield _relative("C qd", our_C_qd, C_qd, floors.h, vectors=2)
    yield _relative("gravity torque g", dynamics.gravity_torque(description, q), g, floors.g)
    yield _relative(
        "bias C qd + g", dynamics.bias(description, q, qd), C_qd + g, floors.bias, vectors=2
    )

    our_tau = dynamics.inverse_dynamics(description, q, qd, qdd)
    yield _relative("inverse dynamics tau", our_tau, tau, floors.tau, vectors=3)

    try:
        our_qdd = dynamics.forward_dynamics(description, q, qd, tau)
    except DescriptionError as error:
        notes.append(f"forward dynamics not compared: {error}")
    else:
        error_of_qdd = relative_error(our_qdd, reference.forward_dynamics(tau), floors.qdd)
        yield Comparison("forward dynamics qdd", error_of_qdd, forward_tolerance(M), 3)

    K = dynamics.kinetic_energy(description, q, qd)
    V = dynamics.potential_energy(description, q)
    yield _relative("kinetic energy K", K, reference.kinetic_energy(), floors.h, vectors=2)
    yield _relative("potential energy V", V, reference.potential_energy(), floors.g)
    Y = dynamics.regressor(description, q, qd, qdd)
    yield _relative("regressor Y", Y, reference.regressor(), floors.Y, vectors=3)


def _relative(
    quantity: str, ours: Array, theirs: Array, floor: Array | float = 0.0, vectors: int = 1
) -> Comparison:
    """Return the comparison of a quantity of dynamics by its relative error."""
    return Comparison(quantity, relative_error(ours, theirs, floor), TOLERANCE, vectors)


def largest(difference: Array) -> Array:
    """Return the largest magnitude of an entry at each state, shape (N,)."""
    return np.asarray(np.abs(difference).reshape(len(difference), -1).max(axis=1))
