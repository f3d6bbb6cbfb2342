"""Closed-form inverse kinematics of one pose by a compiled function; see :mod:`dhkit.kernels.single_calls`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dhkit.description import Array, Description, world_to_tool
from dhkit.kernels import FastCall, SingleCall
from dhkit.kernels.call_source import MAX_ITEMS
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.solutions import IKSolutions, IKStatus
from dhkit.kinematics.solver import Solver, has_offset_wrist, solver_for, solver_of

_NO_SEED = 0.0
"""Angle of a free joint without a seed, rad."""
_ZERO = bytes(8)
"""The distance 0.0 m, with which the packed outputs of a pose that is reached begin."""


_REACHED = (int(IKStatus.ok), int(IKStatus.singular))
"""Status codes of poses with solutions: numbers, for a comparison with members of an enumeration takes longer."""


class PoseCall:
    """All solutions of one pose or a few of an arm with a closed form, or None of what it does not take."""

    def __init__(self, description: Description, solver: Solver, free: int = 2) -> None:
        self.shared: Mapping[str, object] = {
            "branches": solver.fit.branches,
            "met": solver.fit.coordinates,
            "description": description,
            "batch": (),
        }
        B = len(solver.fit.branches)
        # Distance, valid, flags and status.
        self._pose_bytes = 8 + 2 * B + 1
        # The ordinary way corrects the kernel's distance of poses beyond reach.
        self._needs_reach = has_offset_wrist(solver.fit)
        middle = np.arange(1.0, description.n + 1.0) / description.n
        self.call: FastCall = SingleCall(
            solver.kernel,
            solver.parameters,
            (B, description.n),
            install=self._install,
            example=[world_to_tool(description, middle), *[_NO_SEED] * free],
        )

    def _install(self, call: FastCall) -> None:
        self.call = call

    def compile(self) -> None:
        """Compile the function now."""
        if isinstance(self.call, SingleCall):
            self.call.compile()

    def __call__(self, T: Any, out: Array | None) -> IKSolutions | None:
        """Return the solutions, written into ``out`` unless it is None.

        Parameters
        ----------
        T
            Poses of the tool in the world, shape (4, 4), or (N, 4, 4) with few of them, m.
        out
            Array for the joint values, shape (..., B, n), rad and m.
        """
        no_seed: float | Array = _NO_SEED
        shared = self.shared
        if type(T) is np.ndarray and T.ndim == 3:
            if len(T) > MAX_ITEMS or T.shape[1:] != (4, 4):
                return None
            no_seed = np.zeros(len(T))
            shared = {**shared, "batch": (len(T),)}
        if self._needs_reach and out is not None and _may_share_memory(T, out):
            # The ordinary way may still need T.
            return None
        found = self.call(T, no_seed, no_seed, out)
        if found is None:
            return None
        q, packed = found
        if self._needs_reach and not self._is_reached(packed):
            return None
        return IKSolutions.of_packed(q, packed, shared)

    def _is_reached(self, packed: bytes) -> bool:
        """Return whether all poses are reached."""
        if len(packed) == self._pose_bytes:
            return packed.startswith(_ZERO)
        return all(
            packed.startswith(_ZERO, place) for place in range(0, len(packed), self._pose_bytes)
        )


class RedundantCall:
    """The solutions of one pose of an arm of seven joints at a redundancy, or None of what it does not take."""

    def __init__(self, description: Description, solver: Solver) -> None:
        self._poses = PoseCall(description, solver, free=3)

    def compile(self) -> None:
        """Compile the function now."""
        self._poses.compile()

    def __call__(self, T: Any, redundancy: object) -> IKSolutions | None:
        """Return the solutions.

        Parameters
        ----------
        T
            Pose of the tool in the world, shape (4, 4), m.
        redundancy
            The redundancy, rad; a float is taken.
        """
        poses = self._poses
        found = poses.call(T, _NO_SEED, redundancy, _NO_SEED, None)
        if found is None:
            return None
        q, packed = found
        # The ordinary way tells a pose that another redundancy may reach from others.
        if packed[-1] not in _REACHED:
            return None
        return IKSolutions.of_packed(q, packed, poses.shared, False, np.array(redundancy))


def _may_share_memory(T: Any, out: Any) -> bool:
    are_arrays = isinstance(T, np.ndarray) and isinstance(out, np.ndarray)
    return not are_arrays or np.may_share_memory(T, out)


def pose_call(description: Description) -> PoseCall | None:
    """Return the function of an arm; None without a closed form that is its own.

    Parameters
    ----------
    description
        The robot.
    """
    solver = solver_of(description)
    if solver is None or classify(description).neighbour is not None:
        return None
    return PoseCall(description, solver)


def redundant_call(description: Description) -> RedundantCall | None:
    """Return the function of an arm of seven joints; None without a closed form at a redundancy.

    Parameters
    ----------
    description
        The robot.
    """
    redundant = classify(description).redundant
    return (
        None
        if redundant is None
        else RedundantCall(description, solver_for(description, *redundant))
    )
