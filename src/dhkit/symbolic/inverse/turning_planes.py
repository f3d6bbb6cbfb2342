"""Steps of arms whose first joint turns a plane: PUMA, Stanford, Universal Robots, five joints, turntables."""

from __future__ import annotations

import math

from dhkit.symbolic.exact.transforms import rotation, translation
from dhkit.symbolic.inverse.chain import ExactChain
from dhkit.symbolic.inverse.forms import Direction as Directed, Turned
from dhkit.symbolic.inverse.regions import (
    Plane,
    into_axis_2,
    number,
    reach_with_slide,
    reach_with_two_links,
    remaining_angle,
    turn_into_place,
    turn_the_plane,
)
from dhkit.symbolic.inverse.relations import (
    CENTRE,
    TOOL,
    flipped,
    is_long,
    origin,
    parallel,
    perpendicular,
    relative_sense,
    sum_text,
)
from dhkit.symbolic.inverse.steps import Condition, DerivationStep, Workbench
from dhkit.symbolic.inverse.wrists import turn_parallel_wrist, turn_spherical_wrist
from dhkit.symbolic.ring import Element, Elements
from dhkit.symbolic.ring.elements import element_array


def _spherical(chain: ExactChain) -> bool:
    """Return whether axes 4, 5 and 6 meet in one point, each at right angles to the next."""
    meet = chain.a[3].is_zero and chain.a[4].is_zero and chain.d[4].is_zero
    return meet and perpendicular(chain, 4) and perpendicular(chain, 5)


# The PUMA's and the Stanford's families


def _wrist_centre(bench: Workbench) -> Elements:
    """Return the wrist centre before joint 1, shape (3,), m: the origin after joint 5, which joint 6 does not move."""
    T = bench.T
    d6 = bench.chain.d[5]
    # w = p - d6 a, with a the axis of joint 6
    place: Elements = T[:3, 3] - T[:3, 2] * d6
    if d6.is_zero:
        return place
    definitions, symbols = bench.define_all(wx=place[0], wy=place[1], wz=place[2])
    bench.add(
        DerivationStep(
            "The wrist centre",
            f"Axes 4, 5 and 6 meet in one point, the wrist centre. It is {d6} along axis 6 behind frame 6: joints 4, 5 "
            "and 6 turn the tool about it and leave it in place.",
            definitions,
        )
    )
    return symbols


def _fore_arm(chain: ExactChain) -> Elements:
    """Return the wrist centre in the frame of axis 3 that joint 3 moves, shape (3,), m."""
    return origin(chain.link(3) @ chain.joint(4))


def elbow_fits(chain: ExactChain) -> bool:
    """Return whether axes 2 and 3 are parallel before a spherical wrist."""
    if not (perpendicular(chain, 1) and parallel(chain, 2) and _spherical(chain)):
        return False
    return not chain.a[1].is_zero and is_long(_fore_arm(chain)[:2])


def elbow(bench: Workbench) -> None:
    """Write the steps of the PUMA's family."""
    chain = bench.chain

    # Joints 1, 2 and 3 put the wrist centre in place.
    centre = _wrist_centre(bench)
    inside = origin(chain.part(2, 3) @ chain.joint(4))
    plane = turn_the_plane(bench, centre, inside, CENTRE)
    both_links = origin(chain.link(2) @ chain.joint(3) @ chain.link(3) @ chain.joint(4))
    _two_links_in_plane(bench, plane, CENTRE, both_links)

    # Joints 4, 5 and 6 turn the tool. Joints 2 and 3 together turn link 3 by phi.
    links_2_and_3 = chain.part(2, 3)
    sense = relative_sense(chain, 2)
    definitions, (c, s) = bench.define_all(cphi=links_2_and_3[0, 0], sphi=links_2_and_3[1, 0])
    bench.sum = ((2, 1), (3, int(number(chain, sense))))
    bench.add(DerivationStep("The rotation of link 3", sum_text(bench.sum), definitions))
    R = rotation(chain.ring, 0, 1, (c, s))[:3, :3] @ flipped(chain, sense) @ chain.link(3)[:3, :3]
    turn_spherical_wrist(bench, _turn_1(bench) @ R)


def _two_links_in_plane(bench: Workbench, plane: Plane, who: str, both: Elements) -> None:
    """Add the steps for joints 2 and 3 with the elbow up or down.

    Parameters
    ----------
    plane
        The point in the plane that joint 1 turns.
    who
        The point's name in sentences.
    both
        The vector from axis 2 to the point where theta2 is 0, shape (3,), m, in theta3.
    """
    chain = bench.chain
    definitions, (x, y) = bench.define_all(x=plane.x, y=plane.y)
    bench.add(
        DerivationStep(
            "The point in the arm's plane",
            f"In the plane that joint 1 has turned, {who} is at (x, y) from axis 2, in the axes of its frame.",
            definitions,
        )
    )
    # (-y, x), the left of the line to (x, y), is above the line where its component along the vertical is positive.
    above = plane.up[1] * x - plane.up[0] * y
    first = element_array([chain.a[1], chain.ring.zero])
    reach_with_two_links(bench, (2, 3), first, both[:2], (x, y), who, ("up", "down"), above)


def _turn_1(bench: Workbench) -> Elements:
    """Return the axes of axis 2's frame in those before joint 1, shape (3, 3)."""
    chain = bench.chain
    R: Elements = (chain.joint(1) @ chain.link(1))[:3, :3]
    return R


def slide_fits(chain: ExactChain) -> bool:
    """Return whether joint 3 slides at right angles to axis 2 before a spherical wrist."""
    return perpendicular(chain, 1) and perpendicular(chain, 2) and _spherical(chain)


def slide(bench: Workbench) -> None:
    """Write the steps of the Stanford's family."""
    chain = bench.chain
    centre = _wrist_centre(bench)
    plane = turn_the_plane(bench, centre, origin(chain.part(2, 3) @ chain.joint(4)), CENTRE)
    definitions, (x, y) = bench.define_all(x=plane.x, y=plane.y)
    bench.add(
        DerivationStep(
            "The point in the arm's plane",
            f"In the plane that joint 1 has turned, {CENTRE} is at (x, y) from axis 2, in the axes of its frame.",
            definitions,
        )
    )
    vector = origin(chain.link(2) @ chain.part(3, 3) @ chain.joint(4))
    reach_with_slide(bench, 2, vector[:2], (x, y), CENTRE)
    R: Elements = chain.part(2, 3)[:3, :3]
    turn_spherical_wrist(bench, _turn_1(bench) @ R)


# The Universal Robots' family, and turntables with parallel joints


def parallel_fits(chain: ExactChain) -> bool:
    """Return whether axes 2, 3 and 4 are parallel, and 5 and 6 meet."""
    return five_joints_fit(chain) and perpendicular(chain, 5) and chain.a[4].is_zero


def _parallel_senses(chain: ExactChain) -> list[tuple[int, int]]:
    """Return joints 2, 3 and 4, each with 1 if its axis has the direction of axis 2, else -1."""
    third_to_second = int(number(chain, relative_sense(chain, 2)))
    fourth_to_third = int(number(chain, relative_sense(chain, 3)))
    return [(2, 1), (3, third_to_second), (4, third_to_second * fourth_to_third)]


def three_parallel(bench: Workbench) -> None:
    """Write the steps of the Universal Robots' family."""
    chain = bench.chain

    # w = p - d6 a, with a the axis of joint 6
    T = bench.T
    d6 = chain.d[5]
    place = T[:3, 3] - T[:3, 2] * d6
    point = place
    who = "the point where axes 5 and 6 meet"
    if not d6.is_zero:
        definitions, point = bench.define_all(wx=place[0], wy=place[1], wz=place[2])
        bench.add(
            DerivationStep(
                "The point where axes 5 and 6 meet",
                f"Axes 5 and 6 meet in a point {d6} along axis 6 behind frame 6: joints 5 and 6 leave it in place.",
                definitions,
            )
        )

    # Joint 1 puts the point into the plane; joints 5 and 6 turn the tool; the rest of its rotation is phi.
    links_2_to_4 = chain.part(2, 4)
    plane = turn_the_plane(bench, point, origin(links_2_to_4 @ chain.joint(5)), who)
    sense = relative_sense(chain, 2) * relative_sense(chain, 3)
    senses = _parallel_senses(chain)
    definitions, cosine, sine = turn_parallel_wrist(bench, sense)
    phi = bench.phi(links_2_to_4[0, 0], links_2_to_4[1, 0], senses)
    bench.add(
        DerivationStep(
            "phi",
            f"{sum_text(senses)} Joint 6 is known, and with it the direction of axis 5 in the tool's x and y axes. "
            "Axis 5 is at right angles to axes 2, 3 and 4, which turn it by phi.",
            definitions,
            Directed(phi, {"k": chain.ring.one, "X": cosine, "Y": sine}),
        )
    )

    # Joints 2, 3 and 4 put the point in place, with phi known.
    lever = origin(chain.link(4) @ chain.joint(5))
    _reach_axis_4(bench, plane, lever, sense, senses)


def _reach_axis_4(
    bench: Workbench, plane: Plane, lever: Elements, sense: Element, senses: list[tuple[int, int]]
) -> None:
    """Add the steps for joints 2, 3 and 4, where phi is known.

    Parameters
    ----------
    plane
        A point after joint 4 in the plane that joint 1 turns.
    lever
        The vector from axis 4 to the point in the frame that joint 4 moves, shape (3,), m.
    sense
        1 if axis 4 has the direction of axis 2, else -1.
    senses
        Joints 2, 3 and 4, whose angles add up to phi, each with 1 or -1.
    """
    chain = bench.chain
    c, s = bench.chain.named(("cphi", "sphi"))

    # Axis 4 is at (x, y) = point - Rz(phi) lever from axis 2.
    from_axis_4 = rotation(chain.ring, 0, 1, (c, s))[:3, :3] @ flipped(chain, sense) @ lever
    definitions, (x, y) = bench.define_all(x=plane.x - from_axis_4[0], y=plane.y - from_axis_4[1])
    bench.add(
        DerivationStep(
            "Axis 4 in the arm's plane",
            "The links after axis 4 are turned by phi: without them, axis 4 is at (x, y) from axis 2.",
            definitions,
        )
    )
    above = plane.up[1] * x - plane.up[0] * y
    first = element_array([chain.a[1], chain.ring.zero])
    both = origin(chain.link(2) @ chain.part(3, 3))
    reach_with_two_links(bench, (2, 3), first, both[:2], (x, y), "axis 4", ("up", "down"), above)

    links_2_and_3 = chain.part(2, 3)
    known_angle = element_array([links_2_and_3[0, 0], links_2_and_3[1, 0]])
    remaining_angle(bench, 4, known_angle, senses, "Joint 4 turns what remains of phi.")


def five_joints_fit(chain: ExactChain) -> bool:
    """Return whether axes 2, 3 and 4 are parallel on a turntable, and axis 5 is at right angles to them."""
    if not (perpendicular(chain, 1) and parallel(chain, 2) and parallel(chain, 3)):
        return False
    return perpendicular(chain, 4) and not chain.a[1].is_zero and not chain.a[2].is_zero


def five_joints(bench: Workbench) -> None:
    """Write the steps of a turntable with three parallel joints and a last one that rolls the tool."""
    chain = bench.chain
    T = bench.T
    along = chain.last[2, 3]
    who = "the point of axis 5 next to the tool"
    foot = T[:3, 3]
    if not along.is_zero:
        # f = p + F_z a, with a the direction of axis 5
        place = T[:3, 3] + T[:3, 2] * along
        definitions, foot = bench.define_all(wx=place[0], wy=place[1], wz=place[2])
        bench.add(
            DerivationStep(
                "The point of axis 5 next to the tool",
                f"It is {along} along axis 5 from frame 5, and joint 5 leaves it in place.",
                definitions,
            )
        )
    beyond = translation(chain.ring, 2, along)
    plane = turn_the_plane(bench, foot, origin(chain.part(2, 4) @ chain.joint(5) @ beyond), who)

    # Axis 5 is at right angles to axes 2, 3 and 4, which turn it by phi.
    axis = into_axis_2(bench, T[:3, 2])
    bench.conditions.append(
        Condition(
            "Axis 5 stays in the plane that joint 1 turns: axis 5 of the pose has to lie in it.",
            axis[2],
            chain.ring.zero,
        )
    )
    sense = relative_sense(chain, 2) * relative_sense(chain, 3)
    senses = _parallel_senses(chain)
    links_2_to_4 = chain.part(2, 4)
    phi = bench.phi(links_2_to_4[0, 0], links_2_to_4[1, 0], senses)
    definitions, (ax, ay) = bench.define_all(ax=axis[0], ay=axis[1])
    # Without phi, axis 5 is at (0, V) in the frame of axis 2: (ax, ay) = V (-sin(phi), cos(phi)).
    V = -sense * chain.alpha[3][1]
    bench.add(
        DerivationStep(
            "phi",
            f"{sum_text(senses)} Axis 5 is at right angles to axes 2, 3 and 4, which turn it by phi: it is seen at "
            "(ax, ay) in the plane.",
            definitions,
            Directed(phi, {"k": chain.ring.one, "X": V * ay, "Y": -V * ax}),
        )
    )
    lever = origin(chain.link(4) @ chain.joint(5) @ beyond)
    _reach_axis_4(bench, plane, lever, sense, senses)

    # The y axis before joint 5 turns is that of the parallel axes: n and o have s5 and c5 along it.
    n_and_o = [into_axis_2(bench, T[:3, k])[2] for k in range(2)]
    definitions, (nz, oz) = bench.define_all(nz=n_and_o[0], oz=n_and_o[1])
    along_y = sense * chain.alpha[3][1]
    bench.add(
        DerivationStep(
            "theta5",
            "nz and oz are the components of the tool's x and y axes along axis 2. Axis 5 is at right angles to it, so "
            "that they are sine and cosine of theta5, up to their sign.",
            definitions,
            Directed(bench.unknown(5), {"k": chain.ring.one, "X": along_y * oz, "Y": along_y * nz}),
        )
    )


def turntable_fits(chain: ExactChain) -> bool:
    """Return whether parallel axes stand on a turntable, and both links that reach have a length."""
    if not (perpendicular(chain, 1) and all(parallel(chain, i) for i in range(2, chain.n))):
        return False
    second_link = origin(chain.last)[:2] if chain.n == 3 else element_array([chain.a[2]])
    return not chain.a[1].is_zero and is_long(second_link)


def yaw_two(bench: Workbench) -> None:
    """Write the steps of a turntable with two parallel joints."""
    chain = bench.chain
    plane = turn_the_plane(bench, origin(bench.T), origin(chain.part(2, 3) @ chain.last), TOOL)
    _two_links_in_plane(bench, plane, TOOL, origin(chain.link(2) @ chain.joint(3) @ chain.last))


def yaw_three(bench: Workbench) -> None:
    """Write the steps of a turntable with three parallel joints."""
    chain = bench.chain
    plane = turn_the_plane(bench, origin(bench.T), origin(chain.part(2, 4) @ chain.last), TOOL)
    sense = relative_sense(chain, 2) * relative_sense(chain, 3)
    senses = _parallel_senses(chain)

    # The tool's axis that is seen in the plane: z, or x if z is along the parallel axes.
    z_in_plane = math.hypot(number(chain, chain.last[0, 2]), number(chain, chain.last[1, 2]))
    column = 2 if z_in_plane > 0.5 else 0
    seen = into_axis_2(bench, bench.T[:3, column])
    own = chain.last[:3, column]
    _known_rotation(bench, seen, own, sense, senses, column)
    _reach_axis_4(bench, plane, origin(chain.last), sense, senses)


def _known_rotation(
    bench: Workbench,
    seen: Elements,
    own: Elements,
    sense: Element,
    senses: list[tuple[int, int]],
    column: int,
) -> None:
    """Add the step for phi from the direction of an axis of the tool.

    Parameters
    ----------
    seen
        The axis in the frame of axis 2, shape (3,), from the given pose.
    own
        The axis in the frame that the last joint moves, shape (3,), constant.
    sense
        1 if the last axis has the direction of axis 2, else -1.
    senses
        The joints whose angles add up to phi, each with 1 or -1.
    column
        The axis: 0 for x, 2 for z.
    """
    chain = bench.chain
    joints = [i for i, _ in senses]
    parallel_links = chain.part(joints[0], joints[-1])
    phi = bench.phi(parallel_links[0, 0], parallel_links[1, 0], senses)
    definitions, (ax, ay) = bench.define_all(ax=seen[0], ay=seen[1])
    U = own[0]
    V = sense * own[1]
    bench.add(
        DerivationStep(
            "phi",
            f"{sum_text(senses)} The parallel joints turn the tool's {'xyz'[column]} axis by phi: it is seen at "
            "(ax, ay) in the plane.",
            definitions=definitions,
            form=Turned(phi, {"U": U, "V": V, "X": ax, "Y": ay}),
            singular="the tool's axis is along the parallel axes",
        )
    )


def pan_tilt_fits(chain: ExactChain) -> bool:
    """Return whether two axes are at right angles, and the tool is off the second."""
    return perpendicular(chain, 1) and is_long(origin(chain.last)[:2])


def pan_tilt(bench: Workbench) -> None:
    """Write the steps of pan and tilt."""
    chain = bench.chain
    plane = turn_the_plane(bench, origin(bench.T), origin(chain.part(2, 2) @ chain.last), TOOL)
    definitions, (x, y) = bench.define_all(x=plane.x, y=plane.y)
    more, (u, v) = bench.define_all(u=origin(chain.last)[0], v=origin(chain.last)[1])
    turn_into_place(bench, 2, (*definitions, *more), (u, v), (x, y), TOOL)
