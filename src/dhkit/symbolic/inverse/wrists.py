"""Steps for the last three joints of six: a spherical wrist, and the wrist after three parallel axes."""

from __future__ import annotations

from dhkit.symbolic.inverse.forms import CosineAndSquare, Direction, Flip
from dhkit.symbolic.inverse.regions import into_axis_2
from dhkit.symbolic.inverse.steps import Choice, Definition, DerivationStep, Workbench
from dhkit.symbolic.ring import Element, Elements

FLIPS = ("no-flip", "flip")
"""Joint 5 turned to its positive side, from axis 4 (or the parallel axes) to axis 6, and to the other one."""


def turn_spherical_wrist(bench: Workbench, R: Elements) -> None:
    """Add the steps for joints 4, 5 and 6, whose axes meet.

    Parameters
    ----------
    R
        The axes of axis 4's frame before joint 4 turns, in those before joint 1, shape (3, 3), in known joints.
    """
    chain = bench.chain
    s_alpha4 = chain.alpha[3][1]  # alpha_4 and alpha_5 are right angles: their sines are 1 or -1
    s_alpha5 = chain.alpha[4][1]
    c4, s4 = chain.cosine_and_sine(4)
    _, s5 = chain.cosine_and_sine(5)

    # The tool's axes in those of link 3, R_36 = Rz(theta4) Rx(alpha4) Rz(theta5) Rx(alpha5) Rz(theta6). Its last
    # column is axis 6:  ax = k c4,  ay = k s4,  az = -s_alpha4 s_alpha5 c5,  with k = s_alpha5 s5
    tool = R.T @ bench.T[:3, :3]
    definitions, (ax, ay, az) = bench.define_all(ax=tool[0, 2], ay=tool[1, 2], az=tool[2, 2])
    k = s_alpha5 * s5
    bench.add(
        DerivationStep(
            "theta4",
            "Joints 1 to 3 are known, and with them the axes of link 3. (ax, ay, az) is the direction of axis 6 in "
            "them. Joint 4 turns until axis 6 lies in the plane that joint 5 swings it through; the sine of theta5 is "
            "not known yet, and either sign of it gives a solution.",
            definitions=definitions,
            form=Flip(bench.unknown(4), {"k": k, "X": ax, "Y": ay}),
            singular="axes 4 and 6 coincide (ax = ay = 0, theta5 is 0 or pi): only the sum or the difference of theta4 "
            "and theta6 is determined, and theta4 may be chosen, 0 here",
            choice=Choice(FLIPS, (-s_alpha4 * (ax * c4 + ay * s4),)),
        )
    )

    # c5 = -s_alpha4 s_alpha5 az,  s5 = s_alpha5 (c4 ax + s4 ay)
    c5_known = -s_alpha4 * s_alpha5 * az
    s5_known = s_alpha5 * (c4 * ax + s4 * ay)
    bench.add(
        DerivationStep(
            "theta5",
            "In the plane that joint 5 swings axis 6 through, the direction of axis 6 gives cosine and sine.",
            form=Direction(bench.unknown(5), {"k": chain.ring.one, "X": c5_known, "Y": s5_known}),
        )
    )

    # Axis 5 is (s4, -c4, 0), up to its sense, in link 3: components of n and o along it.
    more, (nx, ny, ox, oy) = bench.define_all(
        nx=tool[0, 0], ny=tool[1, 0], ox=tool[0, 1], oy=tool[1, 1]
    )
    sign = s_alpha4 * s_alpha5
    c6_known = sign * (s4 * ox - c4 * oy)
    s6_known = sign * (s4 * nx - c4 * ny)
    bench.add(
        DerivationStep(
            "theta6",
            "Joint 4 has turned axis 5 into the direction (s4, -c4, 0) in the axes of link 3, up to its sense. "
            "The components of the tool's x and y axes along it are its sine and cosine; nx, ny and ox, oy are the x "
            "and y components of these axes in the axes of link 3.",
            definitions=more,
            form=Direction(bench.unknown(6), {"k": chain.ring.one, "X": c6_known, "Y": s6_known}),
        )
    )


def turn_parallel_wrist(
    bench: Workbench, sense: Element
) -> tuple[tuple[Definition, ...], Element, Element]:
    """Add the steps for joints 5 and 6 after the parallel axes 2, 3 and 4.

    Parameters
    ----------
    sense
        1 if axis 4 has the direction of axis 2, else -1.

    Returns
    -------
    tuple
        Definitions for the step that finds phi, the sum of the angles of joints 2, 3 and 4, and its cosine and sine.
    """
    chain = bench.chain
    s_alpha4 = chain.alpha[3][1]  # alpha_4 and alpha_5 are right angles: their sines are 1 or -1
    s_alpha5 = chain.alpha[4][1]
    _, s5 = chain.cosine_and_sine(5)

    # The tool's axes n, o, a in the frame of axis 2; c5 = -sense s_alpha4 s_alpha5 az and s5^2 = ax^2 + ay^2
    n, o, a = (into_axis_2(bench, bench.T[:3, k]) for k in range(3))
    definitions, (ax, ay, az) = bench.define_all(ax=a[0], ay=a[1], az=a[2])
    c5_known = -sense * s_alpha4 * s_alpha5 * az
    s5_squared = ax * ax + ay * ay
    bench.add(
        DerivationStep(
            "theta5",
            "Joint 1 is known, and with it the axes of axis 2's frame. (ax, ay, az) is the direction of axis 6 in "
            "them. Joints 2, 3 and 4 turn about its z axis and leave az as it is: it gives the angle between axis 6 "
            "and the parallel axes.",
            definitions=definitions,
            form=CosineAndSquare(bench.unknown(5), {"X": c5_known, "S": s5_squared}),
            singular="axis 6 is parallel to axes 2, 3 and 4 (theta5 is 0 or pi): only the sum or the difference of "
            "theta6 and phi is determined; theta6 may be chosen, phi follows from it, and joints 2 and 3 have to reach "
            "axis 4",
            choice=Choice(FLIPS, (-sense * s_alpha4 * s_alpha5 * s5,)),
        )
    )

    # s5 c6 = sense s_alpha4 nz,  s5 s6 = -sense s_alpha4 oz
    more, (nz, oz) = bench.define_all(nz=n[2], oz=o[2])
    bench.add(
        DerivationStep(
            "theta6",
            "nz and oz are the components of the tool's x and y axes along axis 2: the direction of axis 2, seen from "
            "the tool.",
            definitions=more,
            form=Direction(
                bench.unknown(6), {"k": s5, "X": sense * s_alpha4 * nz, "Y": -sense * s_alpha4 * oz}
            ),
        )
    )

    # Joints 2, 3 and 4 turn axis 5, which is s6 n + c6 o up to its sense, by phi.
    c6, s6 = chain.cosine_and_sine(6)
    in_plane, (nx, ny, ox, oy) = bench.define_all(nx=n[0], ny=n[1], ox=o[0], oy=o[1])
    sign = sense * s_alpha4 * s_alpha5
    cos_phi = -sign * (s6 * ny + c6 * oy)
    sin_phi = sign * (s6 * nx + c6 * ox)
    return in_plane, cos_phi, sin_phi
