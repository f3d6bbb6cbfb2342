"""Two links in the arm's plane: axes 2 and 3, parallel, bring a point in place with the elbow up or down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dhkit.description import Array
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.closed_form.arm_plane import ArmPlane, as_pair, turned_back
from dhkit.kinematics.closed_form.family import Parameter
from dhkit.kinematics.closed_form.formulas import (
    SX,
    Pair,
    fabs,
    angle,
    select_pair,
    clamp,
    hypot,
    sign,
    add_angles,
    two_link,
    if_else,
)

ELBOWS = ("up", "down")


def link_parameters(axes: Axes, plane: ArmPlane, end: Array) -> dict[str, Parameter] | None:
    """Return the links from axis 2 to axis 3 to a point (in the world); None where one has no length."""
    second, third, last = (plane.coordinates(point) for point in (axes.point(2), axes.point(3), end))
    upper, fore = third[:2] - second[:2], last[:2] - third[:2]
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


@dataclass(frozen=True)
class Elbow:
    """One of the two ways of joints 2 and 3 to bring the point in place."""

    q2: Pair
    bent: Pair
    """How far link 3 has turned against link 2 about v since zero joint values."""
    q3: SX
    miss: SX
    nearest: tuple[SX, SX]
    """The point nearest to the one asked for that the two links reach, from axis 2, m."""
    singular: SX
    clamped: SX

    @property
    def joints(self) -> tuple[SX, SX]:
        """Joint values 2 and 3, rad."""
        return angle(self.q2), self.q3

    @property
    def turned(self) -> Pair:
        """How far link 3 has turned about v since zero joint values."""
        return add_angles(self.q2, self.bent)


def elbows(p: Mapping[str, SX], x: SX, u: SX, q1: Pair, scale: SX) -> tuple[Elbow, Elbow]:
    """Return the upper elbow, then the lower one, for a point at (x, u) from axis 2, as joint 1 holds the plane.

    The upper one is higher in the world; where they are level, the one on the left of the line to the point is.
    """
    arm = two_link(x, u, p["L2"], p["L3"], scale)
    # The elbow on the left of the line to the point is off it in the direction (-u, x).
    vertical = turned_back(p["up"], q1)
    left_is_up = sign(vertical[1] * x - vertical[0] * u)
    R = hypot(x, u)
    share = clamp(R, fabs(p["L2"] - p["L3"]), p["L2"] + p["L3"]) / if_else(R > 0, R, 1.0)

    def elbow(raised: SX) -> Elbow:
        q2 = add_angles(select_pair(raised > 0, *arm.first), p["upper"], -1.0)
        bent = add_angles(select_pair(raised > 0, *arm.between), p["bend"], -1.0)
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
