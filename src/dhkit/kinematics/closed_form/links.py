"""Joints 2 and 3 with parallel axes: two links in the arm's plane that reach a point with the elbow up or down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dhkit.description import Array
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.closed_form.arm_plane import ArmPlane, as_pair, to_arm_frame
from dhkit.kinematics.closed_form.family import Parameter
from dhkit.kinematics.closed_form.formulas import (
    SX,
    Pair,
    add_angles,
    angle,
    clamp,
    fabs,
    hypot,
    if_else,
    select_pair,
    sign,
    two_link,
)

ELBOWS = ("up", "down")


def link_parameters(axes: Axes, plane: ArmPlane, end: Array) -> dict[str, Parameter] | None:
    """Return the parameters of the links from axis 2 to 3 to ``end`` (3,), world, m; None if one has no length."""
    second = plane.coordinates(axes.point(2))
    third = plane.coordinates(axes.point(3))
    last = plane.coordinates(end)
    upper = third[:2] - second[:2]
    fore = last[:2] - third[:2]
    if min(np.linalg.norm(upper), np.linalg.norm(fore)) <= axes.tolerance * axes.scale:
        return None
    upper_pair = as_pair(*upper)
    return {
        "a1": second[0],
        "offset": axes.snapped(last[2]),
        "L2": np.linalg.norm(upper),
        "L3": np.linalg.norm(fore),
        "upper": upper_pair,
        "bend": add_angles(as_pair(*fore), upper_pair, -1.0),
        "sense3": axes.sense(2, 3),
    }


def link_range(parameters: Mapping[str, Parameter]) -> tuple[float, float]:
    """Return the least and the largest distance that the two links reach, m."""
    L2 = float(np.asarray(parameters["L2"]))
    L3 = float(np.asarray(parameters["L3"]))
    return abs(L2 - L3), L2 + L3


@dataclass(frozen=True)
class Elbow:
    """One of the two solutions of joints 2 and 3."""

    q2: Pair
    bent: Pair
    """Rotation of link 3 against link 2 about v since zero joint positions, as a pair."""
    q3: SX
    """Joint value 3, rad."""
    miss: SX
    """Distance of the point from the ring that the two links reach, m."""
    nearest: tuple[SX, SX]
    """Point nearest to the required one that the two links reach, from axis 2, m."""
    singular: SX
    """Whether the two links are stretched or folded."""
    clamped: SX
    """Whether the point lies beyond the ring by rounding only."""

    @property
    def joints(self) -> tuple[SX, SX]:
        """Joint values 2 and 3, rad."""
        return angle(self.q2), self.q3

    @property
    def rotation(self) -> Pair:
        """Rotation of link 3 about v since zero joint positions, as a pair."""
        return add_angles(self.q2, self.bent)


def elbows(p: Mapping[str, SX], x: SX, u: SX, q1: Pair, scale: SX) -> tuple[Elbow, Elbow]:
    """Return the upper and the lower elbow for a point at (x, u) from axis 2, m, with joint 1 at q1.

    The upper one is higher in the world; if both are level, it is the one left of the line to the point. The links are
    those of :func:`two_link`, from which their directions at zero joint positions are taken off:

        L2 e^(i (q2 + upper)) + L3 e^(i (q2 + upper + bent + bend)) = x + i u.
    """
    arm = two_link(x, u, p["L2"], p["L3"], scale)

    # From the line to the point, the elbow on its left lies in the direction (-u, x).
    vertical = to_arm_frame(p["up"], q1)
    left_is_up = sign(vertical[1] * x - vertical[0] * u)

    # The nearest point of the ring |L2 - L3| <= R <= L2 + L3 lies on the line to the point.
    R = hypot(x, u)
    share = clamp(R, fabs(p["L2"] - p["L3"]), p["L2"] + p["L3"]) / if_else(R > 0, R, 1.0)

    def elbow(on_left: SX) -> Elbow:
        q2 = add_angles(select_pair(on_left > 0, *arm.first), p["upper"], -1.0)
        bent = add_angles(select_pair(on_left > 0, *arm.between), p["bend"], -1.0)
        return Elbow(
            q2=q2,
            bent=bent,
            q3=angle((bent[0], p["sense3"] * bent[1])),
            miss=arm.miss,
            nearest=(share * x, share * u),
            singular=arm.straight,
            clamped=arm.clamped,
        )

    return elbow(left_is_up), elbow(-left_is_up)
