"""Intervals of the arm angle inside the limits of one arm, by the program of the parts of a turn."""

from __future__ import annotations

import struct
from functools import lru_cache

import numpy as np

from dhkit.description import Array, Description, world_to_tool
from dhkit.kernels import FastCall, SingleCall, kernel
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.chain import Chain
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.closed_form.family import ARM_ANGLE, Fit
from dhkit.kinematics.turn_parts import PARTS, interval_parameters, joined
from dhkit.symbolic import Pipeline

_STATE = struct.Struct("d")


@lru_cache(maxsize=64)
def arm_angle_intervals(description: Description) -> ArmAngleIntervals | None:
    """Return the intervals of an arm whose redundancy is an arm angle, else None.

    Parameters
    ----------
    description
        The robot.
    """
    found = classify(description).redundant
    if found is None or found[0].redundancy != ARM_ANGLE:
        return None
    return ArmAngleIntervals(description, found[1])


class ArmAngleIntervals:
    """The intervals of an arm at poses.

    Its answers are None where it cannot tell: of other types than arrays, while it is not compiled, of matrices that
    are no poses, and where the outer joints of the shoulder or of the wrist turn about one line.
    """

    def __init__(self, description: Description, fit: Fit) -> None:
        numbers = description.numbers
        offset = Chain.of(Axes.of(description)).offset
        self._parameters = interval_parameters(fit, offset, numbers.lower, numbers.upper)

        def derived() -> Pipeline:
            from dhkit.kinematics.interval_program import interval_program  # with CasADi

            return interval_program(fit)

        self._kernel = kernel("arm_angle_parts", "", derived, ("float64",) * 2)
        middle = np.arange(1.0, description.n + 1.0) / description.n
        self._call: FastCall = SingleCall(
            self._kernel,
            self._parameters,
            (PARTS, 2),
            install=self._install,
            example=[world_to_tool(description, middle)],
        )

    def _install(self, call: FastCall) -> None:
        self._call = call

    def compile(self) -> None:
        """Compile the program for single calls now."""
        if isinstance(self._call, SingleCall):
            self._call.compile()

    def __call__(self, T: object) -> list[tuple[float, float]] | None:
        """Return the intervals at a pose of the tool in the world, an array (4, 4), m, by compiled code."""
        found = self._call(T, None)
        if found is None:
            return None
        parts, packed = found
        (state,) = _STATE.unpack(packed)
        return joined(parts, state)

    def interpreted(self, T: Array) -> list[tuple[float, float]] | None:
        """Return the intervals at a pose, shape (4, 4), m."""
        parts = np.empty((1, 2 * PARTS))
        state = np.empty((1, 1))
        self._kernel(self._parameters, [T.reshape(1, 16)], [parts, state])
        return joined(parts.reshape(PARTS, 2), state.item())
