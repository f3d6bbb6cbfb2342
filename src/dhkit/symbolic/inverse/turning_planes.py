"""Steps of arms whose first joint turns a plane: PUMA, Stanford and Universal Robots, turntables, pan and tilt."""

from __future__ import annotations

import math

from dhkit.symbolic.exact.transforms import rotation
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
from dhkit.symbolic.inverse.steps import DerivationStep, Workbench
from dhkit.symbolic.inverse.wrists import turn_parallel_wrist, turn_spherical_wrist
from dhkit.symbolic.ring import Element, Elements
from dhkit.symbolic.ring.elements import element_array


def _spherical(chain: ExactChain) -> bool:
    meet = chain.a[3].is_zero and chain.a[4].is_zero and chain.d[4].is_zero
    return meet and perpendicular(chain, 4) and perpendicular(chain, 5)


# The PUMA's and the Stanford's families


def _wrist_centre(bench: Workbench) -> Elements:
    """Return the wrist centre before joint 1, shape (3,), m: the origin behind joint 5, which joint 6 leaves alone."""
    T = bench.T
    d6 = bench.chain.d[5]
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
    """Return the wrist centre in the frame of axis 3 behind joint 3, shape (3,), m."""
    return origin(chain.link(3) @ chain.joint(4))


def elbow_fits(chain: ExactChain) -> bool:
    """Whether axes 2 and 3 are parallel before a spherical wrist."""
    if not (perpendicular(chain, 1) and parallel(chain, 2) and _spherical(chain)):
        return False
    return not chain.a[1].is_zero and is_long(_fore_arm(chain)[:2])


def elbow(bench: Workbench) -> None:
    """Write the steps of the PUMA's family."""
    chain = bench.chain
    centre = _wrist_centre(bench)
    inside = origin(chain.part(2, 3) @ chain.joint(4))
    plane = turn_the_plane(bench, centre, inside, CENTRE)
    _two_links_in_plane(bench, plane, CENTRE, origin(chain.link(2) @ chain.joint(3) @ chain.link(3) @ chain.joint(4)))
    turned = chain.part(2, 3)
    sense = relative_sense(chain, 2)
    definitions, (c, s) = bench.define_all(cphi=turned[0, 0], sphi=turned[1, 0])
    bench.sum = (2, 1), (3, int(number(chain, sense)))
    bench.add(DerivationStep("The rotation of link 3", sum_text(bench.sum), definitions))
    R = rotation(chain.ring, 0, 1, (c, s))[:3, :3] @ flipped(chain, sense) @ chain.link(3)[:3, :3]
    turn_spherical_wrist(bench, _turn_1(bench) @ R)


def _two_links_in_plane(bench: Workbench, plane: Plane, who: str, both: Elements) -> None:
    """Add the steps for joints 2 and 3 with the elbow up or down."""
    chain = bench.chain
    definitions, (x, y) = bench.define_all(x=plane.x, y=plane.y)
    bench.add(
        DerivationStep(
            "The point in the arm's plane",
            f"In the plane that joint 1 has turned, {who} is at (x, y) from axis 2, in the axes of its frame.",
            definitions,
        )
    )
    above = plane.up[1] * x - plane.up[0] * y
    first = element_array([chain.a[1], chain.ring.zero])
    reach_with_two_links(bench, (2, 3), first, both[:2], (x, y), who, ("up", "down"), above)


def _turn_1(bench: Workbench) -> Elements:
    """Return the axes of axis 2's frame in those before joint 1, shape (3, 3)."""
    chain = bench.chain
    R: Elements = (chain.joint(1) @ chain.link(1))[:3, :3]
    return R


def slide_fits(chain: ExactChain) -> bool:
    """Whether joint 3 slides at right angles to axis 2 before a spherical wrist."""
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
    """Whether axes 2, 3 and 4 are parallel, and 5 and 6 meet."""
    if not (perpendicular(chain, 1) and parallel(chain, 2) and parallel(chain, 3)):
        return False
    if not (perpendicular(chain, 4) and perpendicular(chain, 5) and chain.a[4].is_zero):
        return False
    return not chain.a[1].is_zero and not chain.a[2].is_zero


def _parallel_senses(chain: ExactChain) -> list[tuple[int, int]]:
    second, third = (int(number(chain, relative_sense(chain, i))) for i in (2, 3))
    return [(2, 1), (3, second), (4, second * third)]


def three_parallel(bench: Workbench) -> None:
    """Write the steps of the Universal Robots' family."""
    chain = bench.chain
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
    arm = chain.part(2, 4)
    lever = (chain.link(4) @ chain.joint(5))[:3, 3]
    plane = turn_the_plane(bench, point, origin(arm @ chain.joint(5)), who)
    sense = relative_sense(chain, 2) * relative_sense(chain, 3)
    senses = _parallel_senses(chain)
    definitions, cosine, sine = turn_parallel_wrist(bench, sense)
    phi = bench.phi(arm[0, 0], arm[1, 0], senses)
    bench.add(
        DerivationStep(
            "phi",
            f"{sum_text(senses)} Joint 6 is known, and with it the direction of axis 5 in the tool's x and y axes. "
            "Axis 5 is at right angles to axes 2, 3 and 4, which turn it by phi.",
            definitions,
            Directed(phi, {"k": chain.ring.one, "X": cosine, "Y": sine}),
        )
    )
    _reach_axis_4(bench, plane, lever, sense, senses)


def _reach_axis_4(
    bench: Workbench, plane: Plane, lever: Elements, sense: Element, senses: list[tuple[int, int]]
) -> None:
    """Add the steps for joints 2, 3 and 4, where phi is known: ``lever`` leads from axis 4 to the point."""
    chain = bench.chain
    c, s = bench.chain.named(("cphi", "sphi"))
    behind = rotation(chain.ring, 0, 1, (c, s))[:3, :3] @ flipped(chain, sense) @ lever
    definitions, (x, y) = bench.define_all(x=plane.x - behind[0], y=plane.y - behind[1])
    bench.add(
        DerivationStep(
            "Axis 4 in the arm's plane",
            "What lies behind axis 4 is turned by phi: without it, axis 4 is at (x, y) from axis 2.",
            definitions,
        )
    )
    above = plane.up[1] * x - plane.up[0] * y
    first = element_array([chain.a[1], chain.ring.zero])
    both = origin(chain.link(2) @ chain.part(3, 3))
    reach_with_two_links(bench, (2, 3), first, both[:2], (x, y), "axis 4", ("up", "down"), above)
    before = chain.part(2, 3)
    remaining_angle(bench, 4, element_array([before[0, 0], before[1, 0]]), senses, "Joint 4 turns what remains of phi.")


def turntable_fits(chain: ExactChain) -> bool:
    """Whether parallel axes stand on a turntable."""
    if not (perpendicular(chain, 1) and all(parallel(chain, i) for i in range(2, chain.n))):
        return False
    last = origin(chain.last) if chain.n == 3 else element_array([chain.a[2]])
    return not chain.a[1].is_zero and is_long(last[:2])


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
    # The tool's axis that is seen in the plane: z, or x if z is along the axes.
    column = 2 if math.hypot(*(number(chain, x) for x in chain.last[:2, 2])) > 0.5 else 0
    _known_rotation(bench, into_axis_2(bench, bench.T[:3, column]), chain.last[:3, column], sense, senses, column)
    _reach_axis_4(bench, plane, origin(chain.last), sense, senses)


def _known_rotation(
    bench: Workbench, seen: Elements, own: Elements, sense: Element, senses: list[tuple[int, int]], column: int
) -> None:
    """Add the step for phi from the direction of an axis of the tool, ``own`` behind the last joint."""
    chain = bench.chain
    joints = [i for i, _ in senses]
    turned = chain.part(joints[0], joints[-1])
    phi = bench.phi(turned[0, 0], turned[1, 0], senses)
    definitions, (ax, ay) = bench.define_all(ax=seen[0], ay=seen[1])
    U = own[0]
    V = sense * own[1]
    bench.add(
        DerivationStep(
            "phi",
            f"{sum_text(senses)} The parallel joints turn the tool's {'xyz'[column]} axis by phi: it is seen at "
            "(ax, ay) in the plane.",
            definitions,
            Turned(phi, {"U": U, "V": V, "X": ax, "Y": ay}),
            "",
            "the tool's axis is along the parallel axes",
        )
    )


def pan_tilt_fits(chain: ExactChain) -> bool:
    """Whether two axes are at right angles, and the tool is off the second."""
    return perpendicular(chain, 1) and is_long(origin(chain.last)[:2])


def pan_tilt(bench: Workbench) -> None:
    """Write the steps of pan and tilt."""
    chain = bench.chain
    plane = turn_the_plane(bench, origin(bench.T), origin(chain.part(2, 2) @ chain.last), TOOL)
    definitions, (x, y) = bench.define_all(x=plane.x, y=plane.y)
    more, (u, v) = bench.define_all(u=origin(chain.last)[0], v=origin(chain.last)[1])
    turn_into_place(bench, 2, (*definitions, *more), (u, v), (x, y), TOOL)
