"""Symbols of an arm and its limits in programs of intervals of the redundancy, and the roots of waves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.closed_form.family import Fit, PoseSymbols
from dhkit.kinematics.closed_form.formulas import Pair, hypot
from dhkit.kinematics.redundant import JOINTS
from dhkit.kinematics.turn_parts import RESULTS, TOUCHING
from dhkit.symbolic import Pipeline, PipelineStep
from dhkit.symbolic.programs.graph import Variable

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
_LIMIT_NUMBERS = 7 * JOINTS


@dataclass(frozen=True)
class Limits:
    """Symbols of the limits of joints with angles theta = q + offset."""

    begin: Sequence[_SX]
    width: Sequence[_SX]
    offset: Sequence[_SX]
    """Lower limits and ranges of q, and offsets, turns."""
    ends: tuple[Sequence[Pair], Sequence[Pair]]
    """Lower and upper limits of theta, as pairs."""

    @classmethod
    def read(cls, numbers: _SX) -> Limits:
        """Return the limits from parameters."""
        parts = [ca.vertsplit(part) for part in ca.vertsplit(numbers, JOINTS)]
        begin, width, offset, cos_lower, cos_upper, sin_lower, sin_upper = parts
        lower = list(zip(cos_lower, sin_lower, strict=True))
        upper = list(zip(cos_upper, sin_upper, strict=True))
        return cls(begin, width, offset, (lower, upper))

    def inside(self, joint: int, theta: _SX) -> _SX:
        """Return whether an angle theta, rad, is inside the limits of a joint for some whole turns."""
        beyond = theta * (1.0 / math.tau) - (self.begin[joint] + self.offset[joint])
        return beyond - ca.floor(beyond) <= self.width[joint]


class ArmSymbols:
    """Symbols of an arm's parameters, as :func:`dhkit.kinematics.turn_parts.interval_parameters` orders them.

    Attributes
    ----------
    parameters
        All of them, a column.
    p, limits
        Those of the fit, by name, and the limits.
    """

    def __init__(self, fit: Fit) -> None:
        count = len(fit.vector())
        self.parameters = ca.SX.sym("parameters", count + _LIMIT_NUMBERS)
        self.p = fit.named(self.parameters[:count])
        self.limits = Limits.read(self.parameters[count:])

    def pose(self, T: _SX, free: Pair = (1.0, 0.0)) -> PoseSymbols:
        """Return a pose T, 4 x 4, at a redundancy, as a pair."""
        scale = self.p["reach"] + ca.norm_1(T[:3, 3])
        return PoseSymbols(T=T[:3, :], scale=scale, free=free)

    def pipeline(self, name: str, steps: Sequence[PipelineStep]) -> Pipeline:
        """Return the program of steps from the tool's pose T to ``RESULTS``."""
        inputs = (Variable("parameters", (self.parameters.numel(),)), Variable("T", (4, 4)))
        return Pipeline(name, inputs, tuple(steps), RESULTS)


def wave_root(wave: tuple[_SX, _SX, _SX], sign: _SX) -> _SX:
    """Return the root of a + b cos(x) + c sin(x) to one side of its extreme, rad; pi where it has none.

    With the length r of (b, c) and its direction phi, cos(x - phi) = -a / r.

    Parameters
    ----------
    wave
        a, b and c.
    sign
        The side: 1 or -1.
    """
    a, b, c = wave
    r = hypot(b, c)
    cosine = -a / ca.if_else(r > 0, r, 1.0)
    square = 1.0 - cosine * cosine
    is_touching = ca.fabs(square) < 2 * TOUCHING
    is_root = ca.logic_and(r > 0, ca.logic_or(is_touching, square > 0))
    sine = sign * ca.sqrt(ca.if_else(is_touching, 0.0, ca.fmax(square, 0.0)))
    root = ca.atan2(c * cosine + b * sine, b * cosine - c * sine)
    return ca.if_else(is_root, root, math.pi)
