"""Intervals of the redundancy whose ends are roots of equations, of one arm."""

from __future__ import annotations

import math
import struct
import sys
from collections.abc import Sequence
from functools import lru_cache
from typing import TypeAlias

import numpy as np

from dhkit.description import Array, Description, world_to_tool
from dhkit.kernels import FastCall, SingleCall, kernel
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.chain import Chain
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.closed_form.family import ARM_ANGLE, Fit
from dhkit.kinematics.redundant import JOINTS
from dhkit.kinematics.turn_parts import (
    ARM_ANGLE_PARTS,
    JOINT_7_PARTS,
    KNOWN,
    RESULTS,
    UNKNOWN,
    interval_parameters,
    joined,
    unrolled,
)
from dhkit.symbolic import Pipeline

Intervals: TypeAlias = list[tuple[float, float]]
"""Beginning and end of each interval, rad."""
_COUNTS_AS = 20
"""Calls that an interpreted one counts as: it takes up to 20 ms, compiled 50 us."""
_HIGHEST_BYTES = slice(7 if sys.byteorder == "little" else 0, None, 8)
_AGREEMENT = 1e-3
"""Largest difference of compiled from interpreted ends, rad: roots amplify rounding where two nearly coincide."""


@lru_cache(maxsize=64)
def intervals_by_roots(description: Description) -> IntervalsByRoots | None:
    """Return the intervals of an arm of seven joints with a closed form at a redundancy; None of other arms.

    Parameters
    ----------
    description
        The robot.
    """
    found = classify(description).redundant
    if found is None:
        return None
    family, fit = found
    return IntervalsByRoots(description, fit, is_arm_angle=family.redundancy == ARM_ANGLE)


class IntervalsByRoots:
    """The intervals of an arm at poses, inside its limits, and the state that tells whether their ends are known.

    See :mod:`dhkit.kinematics.turn_parts` for the states.
    """

    def __init__(self, description: Description, fit: Fit, *, is_arm_angle: bool) -> None:
        numbers = description.numbers
        offset = Chain.of(Axes.of(description)).offset
        self._parameters = interval_parameters(fit, offset, numbers.lower, numbers.upper)
        self._parts = ARM_ANGLE_PARTS if is_arm_angle else JOINT_7_PARTS
        last = JOINTS - 1
        # The programs tell of one turn, without regard to the limits of joint 7 where it is the redundancy.
        self._limits: tuple[float, float] | None = None
        if not is_arm_angle and np.isfinite([numbers.lower[last], numbers.upper[last]]).all():
            self._limits = (float(numbers.lower[last]), float(numbers.upper[last]))
        self._state = struct.Struct(f"{8 * self._parts}xd")

        def derived() -> Pipeline:
            # With CasADi, which takes time to import.
            if is_arm_angle:
                from dhkit.kinematics.arm_angle_program import arm_angle_program

                return arm_angle_program(fit)
            from dhkit.kinematics.joint_7_program import joint_7_program

            return joint_7_program(fit)

        name = "arm_angle_parts" if is_arm_angle else "joint_7_parts"
        self._kernel = kernel(name, "", derived, ("float64",) * len(RESULTS))
        # A posture without symmetry inside the limits, at which no roots coincide.
        lower = np.maximum(numbers.lower, -2.0)
        upper = np.minimum(numbers.upper, 2.0)
        posture = (lower + upper) / 2 + 0.3 * (upper - lower) * np.sin(np.arange(1.0, JOINTS + 1.0))
        self._call: FastCall = SingleCall(
            self._kernel,
            self._parameters,
            (self._parts,),
            install=self._install,
            example=[world_to_tool(description, posture)],
            are_alike=self._are_alike,
            counts_as=_COUNTS_AS,
        )

    def _install(self, call: FastCall) -> None:
        self._call = call

    def _are_alike(self, found: Sequence[Array], expected: Sequence[Array]) -> bool:
        """Return whether two results lead to the same intervals; roots that bound nothing may differ."""
        one, other = (
            self._intervals(begins.ravel(), are_inside.tobytes(), state.item())
            for begins, are_inside, state in (found, expected)
        )
        return np.shape(one) == np.shape(other) and np.allclose(one, other, rtol=0, atol=_AGREEMENT)

    def compile(self) -> None:
        """Compile the program for single calls now."""
        if isinstance(self._call, SingleCall):
            self._call.compile()

    def __call__(self, T: object) -> tuple[float, Intervals] | None:
        """Return state and intervals at a pose of the tool in the world, m, by compiled code.

        None while it is not compiled, and of what is no array (4, 4) of finite numbers.
        """
        found = self._call(T, None)
        if found is None:
            return None
        begins, packed = found
        if begins.ndim != 1:
            # The function takes several poses as well.
            return None
        (state,) = self._state.unpack(packed)
        if math.isnan(state):
            # An entry of T is not finite.
            return None
        return state, self._intervals(begins, packed, state)

    def interpreted(self, T: Array) -> tuple[float, Intervals]:
        """Return state and intervals at a pose, shape (4, 4), m."""
        begins, are_inside, state = (np.empty((1, size)) for size in (self._parts, self._parts, 1))
        self._kernel(self._parameters, [T.reshape(1, 16)], [begins, are_inside, state])
        known = state.item()
        return known, self._intervals(begins[0], are_inside.tobytes(), known)

    def _intervals(self, begins: Array, packed: bytes, state: float) -> Intervals:
        """Return the intervals, from the numbers 1 and 0 of the parts that ``packed`` begins with.

        Where the equations are not known well, the arm is inside its limits in the middle of these parts, whose ends
        are anywhere near.
        """
        if state not in (KNOWN, UNKNOWN):
            return []
        intervals = joined(begins, packed[_HIGHEST_BYTES][: self._parts])
        return intervals if self._limits is None else unrolled(intervals, *self._limits)
