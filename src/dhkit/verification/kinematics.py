"""Frames and Jacobians by our own kinematics against Pinocchio's, over random states."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dhkit.description import Array, Description
from dhkit.kinematics import forward_kinematics, frames, jacobian
from dhkit.model import PinocchioModel, pinocchio_model
from dhkit.verification.report import Agreement, VerificationReport

__all__ = ["random_states", "verify"]

FRAME_TOLERANCE = 1e-13
"""Of positions over the reach (at least 1 m) and of rotation entries: some hundred roundings."""
JACOBIAN_TOLERANCE = 1e-12
"""Of Jacobian entries, the linear ones over the reach (at least 1 m)."""


def random_states(description: Description, samples: int, seed: int = 0) -> Array:
    """Return random joint values, shape (samples, n): full turns, and strokes within the limits (1 m where none).

    Raises
    ------
    ValueError
        ``samples`` is below 1.
    """
    if samples < 1:
        raise ValueError(f"samples is {samples}; expected 1 or more")
    numbers = description.numbers
    bounded = np.isfinite(numbers.lower) & np.isfinite(numbers.upper) & numbers.prismatic
    lower = np.where(bounded, numbers.lower, np.where(numbers.prismatic, -1.0, -np.pi))
    upper = np.where(bounded, numbers.upper, np.where(numbers.prismatic, 1.0, np.pi))
    return np.random.default_rng(seed).uniform(lower, upper, (samples, description.n))


def verify(description: Description, samples: int = 1000, seed: int = 0) -> VerificationReport:
    """Hold frames, tool and Jacobians against Pinocchio's, computed from the URDF that dhkit writes.

    Parameters
    ----------
    description
        The robot.
    samples, seed
        How many random states, from which seed.

    Returns
    -------
    VerificationReport
        The worst error of each quantity, and where; ``.ok``.

    Raises
    ------
    ModelError
        Pinocchio is not installed, or refuses the model.
    """
    model = pinocchio_model(description)
    import pinocchio as pin

    q = random_states(description, samples, seed)
    T_world_frames, T_world_tool = frames(description, q), forward_kinematics(description, q)
    J_world, J_tool = jacobian(description, q), jacobian(description, q, frame="tool")
    names = [*(f"dh{i}" for i in range(description.n + 1)), "tool"]
    scale = max(1.0, description.reach)

    quantities = ("frame positions", "frame rotations", "Jacobian (world)", "Jacobian (tool)")
    worst = dict.fromkeys(quantities, (0.0, 0))
    for k, (reference, references_J) in enumerate(_references(model, q, names)):
        ours = np.concatenate([T_world_frames[k], T_world_tool[k : k + 1]])
        errors = {
            "frame positions": np.abs(ours - reference)[:, :3, 3].max() / scale,
            "frame rotations": np.abs(ours - reference)[:, :3, :3].max(),
        }
        for key, J, reference_J in zip(quantities[2:], (J_world[k], J_tool[k]), references_J, strict=True):
            difference = np.abs(J - reference_J)
            errors[key] = max(difference[:3].max() / scale, difference[3:].max())
        for key, error in errors.items():
            if error > worst[key][0] or np.isnan(error):  # a NaN stays: nothing is greater than it
                worst[key] = (float(error), k)
    return VerificationReport(
        robot=description.name,
        reference=f"Pinocchio {pin.__version__}",
        samples=samples,
        seed=seed,
        agreements=tuple(
            Agreement(
                key, error, FRAME_TOLERANCE if key.startswith("frame") else JACOBIAN_TOLERANCE, tuple(map(float, q[k]))
            )
            for key, (error, k) in worst.items()
        ),
    )


def _references(model: PinocchioModel, q: Array, names: list[str]) -> Iterator[tuple[Array, tuple[Array, Array]]]:
    """Yield, a state, Pinocchio's frames and its tool Jacobians in world and tool axes."""
    import pinocchio as pin

    data = model.createData()
    ids = [model.getFrameId(name) for name in names]
    for state in q:
        pin.computeJointJacobians(model, data, state)
        pin.updateFramePlacements(model, data)
        frames = np.array([data.oMf[i].homogeneous for i in ids])
        world, tool = (
            # eigenpy hands a matrix of one column over as a vector.
            np.reshape(pin.getFrameJacobian(model, data, ids[-1], axes), (6, model.nv))
            for axes in (pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, pin.ReferenceFrame.LOCAL)
        )
        yield frames, (world, tool)
