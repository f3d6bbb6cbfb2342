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
    s_alpha4 = chain.alpha[3][1]
    s_alpha5 = chain.alpha[4][1]
    c4, s4 = chain.cosine_and_sine(4)
    _, s5 = chain.cosine_and_sine(5)
    tool = R.T @ bench.T[:3, :3]
    definitions, (ax, ay, az) = bench.define_all(ax=tool[0, 2], ay=tool[1, 2], az=tool[2, 2])
    k = s_alpha5 * s5
    bench.add(
        DerivationStep(
            "theta4",
            "Joints 1 to 3 are known, and with them the axes of link 3. (ax, ay, az) is the direction of axis 6 in "
            "them. Joint 4 turns until axis 6 lies in the plane that joint 5 swings it through; the sine of theta5 is "
            "not known yet, and either sign of it gives a solution.",
            definitions,
            Flip(bench.unknown(4), {"k": k, "X": ax, "Y": ay}),
            "",
            "axes 4 and 6 coincide (ax = ay = 0, theta5 is 0 or pi): only the sum or the difference of theta4 and "
            "theta6 is determined, and theta4 may be chosen, 0 here",
            Choice(FLIPS, (-s_alpha4 * (ax * c4 + ay * s4),)),
        )
    )
    X = -s_alpha4 * s_alpha5 * az
    Y = s_alpha5 * (c4 * ax + s4 * ay)
    bench.add(
        DerivationStep(
            "theta5",
            "In the plane that joint 5 swings axis 6 through, the direction of axis 6 gives cosine and sine.",
            (),
            Direction(bench.unknown(5), {"k": chain.ring.one, "X": X, "Y": Y}),
        )
    )
    more, (nx, ny, ox, oy) = bench.define_all(nx=tool[0, 0], ny=tool[1, 0], ox=tool[0, 1], oy=tool[1, 1])
    sign = s_alpha4 * s_alpha5
    bench.add(
        DerivationStep(
            "theta6",
            "Joint 4 has turned axis 5 into the direction (s4, -c4, 0) in the axes of link 3, up to its sense. "
            "The components of the tool's x and y axes along it are its sine and cosine; nx, ny and ox, oy are the x "
            "and y components of these axes in the axes of link 3.",
            more,
            Direction(
                bench.unknown(6),
                {"k": chain.ring.one, "X": sign * (s4 * ox - c4 * oy), "Y": sign * (s4 * nx - c4 * ny)},
            ),
        )
    )


def turn_parallel_wrist(bench: Workbench, sense: Element) -> tuple[tuple[Definition, ...], Element, Element]:
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
    s_alpha4 = chain.alpha[3][1]
    s_alpha5 = chain.alpha[4][1]
    s5 = chain.cosine_and_sine(5)[1]
    n, o, a = (into_axis_2(bench, bench.T[:3, k]) for k in range(3))
    definitions, (ax, ay, az) = bench.define_all(ax=a[0], ay=a[1], az=a[2])
    bench.add(
        DerivationStep(
            "theta5",
            "Joint 1 is known, and with it the axes of axis 2's frame. (ax, ay, az) is the direction of axis 6 in "
            "them. Joints 2, 3 and 4 turn about its z axis and leave az as it is: it gives the angle between axis 6 "
            "and the parallel axes.",
            definitions,
            CosineAndSquare(bench.unknown(5), {"X": -sense * s_alpha4 * s_alpha5 * az, "S": ax * ax + ay * ay}),
            "",
            "axis 6 is parallel to axes 2, 3 and 4 (theta5 is 0 or pi): only the sum or the difference of theta6 and "
            "phi is determined; theta6 may be chosen, phi follows from it, and joints 2 and 3 have to reach axis 4",
            Choice(FLIPS, (-sense * s_alpha4 * s_alpha5 * s5,)),
        )
    )
    more, (nz, oz) = bench.define_all(nz=n[2], oz=o[2])
    bench.add(
        DerivationStep(
            "theta6",
            "nz and oz are the components of the tool's x and y axes along axis 2: the direction of axis 2, seen from "
            "the tool.",
            more,
            Direction(bench.unknown(6), {"k": s5, "X": sense * s_alpha4 * nz, "Y": -sense * s_alpha4 * oz}),
        )
    )
    c6, s6 = chain.cosine_and_sine(6)
    in_plane, (nx, ny, ox, oy) = bench.define_all(nx=n[0], ny=n[1], ox=o[0], oy=o[1])
    sign = sense * s_alpha4 * s_alpha5
    return in_plane, -sign * (s6 * ny + c6 * oy), sign * (s6 * nx + c6 * ox)
