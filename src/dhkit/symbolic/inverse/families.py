"""Families of arms whose inverse kinematics is derived: how each is recognized in the exact table, and its steps.

The families are those of ``dhkit.kinematics.closed_form``, read anew from the table: axes i and i + 1 are parallel
where sin(alpha_i) is 0, at right angles where cos(alpha_i) is 0, and meet where a_i is 0.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from dhkit.symbolic.exact.transforms import rotation
from dhkit.symbolic.inverse.chain import Chain
from dhkit.symbolic.inverse.forms import Circle, Direction as Directed, Turned
from dhkit.symbolic.inverse.regions import (
    Plane,
    height_of_slide,
    into_axis_2,
    linear_parts,
    number,
    reach_with_slide,
    reach_with_two_links,
    remaining_angle,
    turn_into_place,
    turn_the_plane,
)
from dhkit.symbolic.inverse.steps import Choice, Condition, Step, Workbench
from dhkit.symbolic.inverse.wrists import turn_parallel_wrist, turn_spherical_wrist
from dhkit.symbolic.ring import Element, Elements
from dhkit.symbolic.ring.elements import element_array

CHAINS = ("RR", "RRR", "RRPR", "RRRP", "PRRR", "RPRR", "RRP", "RPR", "PRR")
"""Kinds of joints of arms in parallel planes: two or three revolute joints and at most one slide."""
CENTRE, TOOL = "the wrist centre", "the tool"
IN_THE_PLANE = "The arm moves in a plane: the pose has to lie in it."


@dataclass(frozen=True)
class Derivable:
    """A family.

    Attributes
    ----------
    name
        Its identifier, as ``arm.family.name``.
    kinds
        Kinds of joints.
    geometry
        How its axes lie, in words.
    fits
        Whether an arm of these kinds belongs to it.
    derive
        Writes its steps on a workbench.
    undoes_tool
        Whether it reaches every pose.
    aims
        Whether it only points at the pose's origin.
    """

    name: str
    kinds: tuple[str, ...]
    geometry: str
    fits: Callable[[Chain], bool]
    derive: Callable[[Workbench], None]
    undoes_tool: bool = False
    aims: bool = False


def family_of(chain: Chain) -> Derivable | None:
    """Return the family of an arm; None if it has none."""
    for family in FAMILIES:
        if chain.description.kinds in family.kinds and family.fits(chain):
            return family
    return None


# Relations of axes, joints from 1


def _parallel(chain: Chain, i: int) -> bool:
    return chain.alpha[i - 1][1].is_zero


def _perpendicular(chain: Chain, i: int) -> bool:
    return chain.alpha[i - 1][0].is_zero


def _sense(chain: Chain, i: int) -> Element:
    """Return 1 or -1: whether parallel axes i and i + 1 have the same direction."""
    return chain.alpha[i - 1][0]


def _origin(T: Elements) -> Elements:
    point: Elements = T[:3, 3]
    return point


def _is_long(vector: Elements) -> bool:
    return any(not entry.is_zero for entry in vector)


def _spherical(chain: Chain) -> bool:
    meet = chain.a[3].is_zero and chain.a[4].is_zero and chain.d[4].is_zero
    return meet and _perpendicular(chain, 4) and _perpendicular(chain, 5)


# The PUMA's and the Stanford's families


def _wrist_centre(bench: Workbench) -> Elements:
    """Return the wrist centre before joint 1, shape (3,), m: the origin behind joint 5, which joint 6 leaves alone."""
    T, d6 = bench.T, bench.chain.d[5]
    place: Elements = T[:3, 3] - T[:3, 2] * d6
    if d6.is_zero:
        return place
    definitions, symbols = bench.define_all(wx=place[0], wy=place[1], wz=place[2])
    bench.add(
        Step(
            "The wrist centre",
            f"Axes 4, 5 and 6 meet in one point, the wrist centre. It is {d6} along axis 6 behind frame 6: joints 4, 5 "
            "and 6 turn the tool about it and leave it in place.",
            definitions,
        )
    )
    return symbols


def _fore_arm(chain: Chain) -> Elements:
    """Return the wrist centre in the frame of axis 3 behind joint 3, shape (3,), m."""
    return _origin(chain.link(3) @ chain.joint(4))


def _elbow_fits(chain: Chain) -> bool:
    if not (_perpendicular(chain, 1) and _parallel(chain, 2) and _spherical(chain)):
        return False
    return not chain.a[1].is_zero and _is_long(_fore_arm(chain)[:2])


def _elbow(bench: Workbench) -> None:
    chain = bench.chain
    centre = _wrist_centre(bench)
    inside = _origin(chain.part(2, 3) @ chain.joint(4))
    plane = turn_the_plane(bench, centre, inside, CENTRE)
    _two_links_in_plane(bench, plane, CENTRE, _origin(chain.link(2) @ chain.joint(3) @ chain.link(3) @ chain.joint(4)))
    turned = chain.part(2, 3)
    sense = _sense(chain, 2)
    definitions, (c, s) = bench.define_all(cphi=turned[0, 0], sphi=turned[1, 0])
    bench.sum = (2, 1), (3, int(number(chain, sense)))
    bench.add(Step("The rotation of link 3", _sum_text(bench.sum), definitions))
    R = rotation(chain.ring, 0, 1, (c, s))[:3, :3] @ _flipped(chain, sense) @ chain.link(3)[:3, :3]
    turn_spherical_wrist(bench, _turn_1(bench) @ R)


def _two_links_in_plane(bench: Workbench, plane: Plane, who: str, both: Elements) -> None:
    """Add the steps for joints 2 and 3 with the elbow up or down."""
    chain = bench.chain
    definitions, (x, y) = bench.define_all(x=plane.x, y=plane.y)
    bench.add(
        Step(
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


def _flipped(chain: Chain, sense: Element) -> Elements:
    """Return the rotation by 0 or pi about x, shape (3, 3): diag(1, sense, sense)."""
    R = chain.part(1, 0)[:3, :3].copy()
    R[1, 1] = R[2, 2] = sense
    return R


def _sum_text(senses: Sequence[tuple[int, int]]) -> str:
    terms = "".join(f" {'+' if sense > 0 else '-'} theta{i}" for i, sense in senses)
    return f"Angles about parallel axes add up: phi = {terms[3:]}."


def _slide_fits(chain: Chain) -> bool:
    return _perpendicular(chain, 1) and _perpendicular(chain, 2) and _spherical(chain)


def _slide(bench: Workbench) -> None:
    chain = bench.chain
    centre = _wrist_centre(bench)
    plane = turn_the_plane(bench, centre, _origin(chain.part(2, 3) @ chain.joint(4)), CENTRE)
    definitions, (x, y) = bench.define_all(x=plane.x, y=plane.y)
    bench.add(
        Step(
            "The point in the arm's plane",
            f"In the plane that joint 1 has turned, {CENTRE} is at (x, y) from axis 2, in the axes of its frame.",
            definitions,
        )
    )
    vector = _origin(chain.link(2) @ chain.part(3, 3) @ chain.joint(4))
    reach_with_slide(bench, 2, vector[:2], (x, y), CENTRE)
    R: Elements = chain.part(2, 3)[:3, :3]
    turn_spherical_wrist(bench, _turn_1(bench) @ R)


# The Universal Robots' family, and turntables with parallel joints


def _parallel_fits(chain: Chain) -> bool:
    if not (_perpendicular(chain, 1) and _parallel(chain, 2) and _parallel(chain, 3)):
        return False
    if not (_perpendicular(chain, 4) and _perpendicular(chain, 5) and chain.a[4].is_zero):
        return False
    return not chain.a[1].is_zero and not chain.a[2].is_zero


def _parallel_senses(chain: Chain) -> list[tuple[int, int]]:
    second, third = (int(number(chain, _sense(chain, i))) for i in (2, 3))
    return [(2, 1), (3, second), (4, second * third)]


def _three_parallel(bench: Workbench) -> None:
    chain = bench.chain
    T, d6 = bench.T, chain.d[5]
    place = T[:3, 3] - T[:3, 2] * d6
    point = place
    who = "the point where axes 5 and 6 meet"
    if not d6.is_zero:
        definitions, point = bench.define_all(wx=place[0], wy=place[1], wz=place[2])
        bench.add(
            Step(
                "The point where axes 5 and 6 meet",
                f"Axes 5 and 6 meet in a point {d6} along axis 6 behind frame 6: joints 5 and 6 leave it in place.",
                definitions,
            )
        )
    arm = chain.part(2, 4)
    lever = (chain.link(4) @ chain.joint(5))[:3, 3]
    plane = turn_the_plane(bench, point, _origin(arm @ chain.joint(5)), who)
    sense = _sense(chain, 2) * _sense(chain, 3)
    senses = _parallel_senses(chain)
    ax, ay, k = turn_parallel_wrist(bench, sense)
    phi = bench.phi(arm[0, 0], arm[1, 0], senses)
    bench.add(
        Step(
            "phi",
            f"{_sum_text(senses)} Joints 2, 3 and 4 turn axis 6 about their axes by phi.",
            (),
            Directed(phi, {"k": k, "X": ax, "Y": ay}),
        )
    )
    _reach_axis_4(bench, plane, lever, sense, senses)


def _reach_axis_4(
    bench: Workbench, plane: Plane, lever: Elements, sense: Element, senses: list[tuple[int, int]]
) -> None:
    """Add the steps for joints 2, 3 and 4, where phi is known: ``lever`` leads from axis 4 to the point."""
    chain = bench.chain
    c, s = bench.chain.named(("cphi", "sphi"))
    behind = rotation(chain.ring, 0, 1, (c, s))[:3, :3] @ _flipped(chain, sense) @ lever
    definitions, (x, y) = bench.define_all(x=plane.x - behind[0], y=plane.y - behind[1])
    bench.add(
        Step(
            "Axis 4 in the arm's plane",
            "What lies behind axis 4 is turned by phi: without it, axis 4 is at (x, y) from axis 2.",
            definitions,
        )
    )
    above = plane.up[1] * x - plane.up[0] * y
    first, both = element_array([chain.a[1], chain.ring.zero]), _origin(chain.link(2) @ chain.part(3, 3))
    reach_with_two_links(bench, (2, 3), first, both[:2], (x, y), "axis 4", ("up", "down"), above)
    before = chain.part(2, 3)
    remaining_angle(bench, 4, element_array([before[0, 0], before[1, 0]]), senses, "Joint 4 turns what remains of phi.")


def _turntable_fits(chain: Chain) -> bool:
    if not (_perpendicular(chain, 1) and all(_parallel(chain, i) for i in range(2, chain.n))):
        return False
    last = _origin(chain.last) if chain.n == 3 else element_array([chain.a[2]])
    return not chain.a[1].is_zero and _is_long(last[:2])


def _yaw_two(bench: Workbench) -> None:
    chain = bench.chain
    plane = turn_the_plane(bench, _origin(bench.T), _origin(chain.part(2, 3) @ chain.last), TOOL)
    _two_links_in_plane(bench, plane, TOOL, _origin(chain.link(2) @ chain.joint(3) @ chain.last))


def _yaw_three(bench: Workbench) -> None:
    chain = bench.chain
    plane = turn_the_plane(bench, _origin(bench.T), _origin(chain.part(2, 4) @ chain.last), TOOL)
    sense, senses = _sense(chain, 2) * _sense(chain, 3), _parallel_senses(chain)
    # The tool's axis that is seen in the plane: z, or x if z is along the axes.
    column = 2 if any(abs(number(chain, x)) > 0.5 for x in chain.last[:2, 2]) else 0
    _known_rotation(bench, into_axis_2(bench, bench.T[:3, column]), chain.last[:3, column], sense, senses, column)
    _reach_axis_4(bench, plane, _origin(chain.last), sense, senses)


def _known_rotation(
    bench: Workbench, seen: Elements, own: Elements, sense: Element, senses: list[tuple[int, int]], column: int
) -> None:
    """Add the step for phi from the direction of an axis of the tool, ``own`` behind the last joint."""
    chain = bench.chain
    joints = [i for i, _ in senses]
    turned = chain.part(joints[0], joints[-1])
    phi = bench.phi(turned[0, 0], turned[1, 0], senses)
    definitions, (ax, ay) = bench.define_all(ax=seen[0], ay=seen[1])
    U, V = own[0], sense * own[1]
    bench.add(
        Step(
            "phi",
            f"{_sum_text(senses)} The parallel joints turn the tool's {'xyz'[column]} axis by phi: it is seen at "
            "(ax, ay) in the plane.",
            definitions,
            Turned(phi, {"U": U, "V": V, "X": ax, "Y": ay}),
            "",
            "the tool's axis is along the parallel axes",
        )
    )


def _pan_tilt_fits(chain: Chain) -> bool:
    return _perpendicular(chain, 1) and _is_long(_origin(chain.last)[:2])


def _pan_tilt(bench: Workbench) -> None:
    chain = bench.chain
    plane = turn_the_plane(bench, _origin(bench.T), _origin(chain.part(2, 2) @ chain.last), TOOL)
    definitions, (x, y) = bench.define_all(x=plane.x, y=plane.y)
    more, (u, v) = bench.define_all(u=_origin(chain.last)[0], v=_origin(chain.last)[1])
    turn_into_place(bench, 2, (*definitions, *more), (u, v), (x, y), TOOL)


# Arms in parallel planes


def _chain_fits(chain: Chain) -> bool:
    if not all(_parallel(chain, i) for i in range(1, chain.n)):
        return False
    return all(_is_long(vector[:2]) for vector in _chain_vectors(chain))


def _revolute(chain: Chain) -> list[int]:
    return [i for i, kind in enumerate(chain.description.kinds, start=1) if kind == "R"]


def _between(chain: Chain, i: int, j: int) -> Elements:
    """Return what is constant between joints i and j > i, both revolute: C_i, and a slide with its link."""
    return chain.link(i) @ chain.part(i + 1, j - 1)


def _end(chain: Chain, i: int) -> Elements:
    """Return what is constant behind joint i, the last revolute one: its link, a slide, and the tool."""
    if i == chain.n:
        return chain.last
    return chain.link(i) @ chain.part(i + 1, chain.n) @ chain.last


def _chain_vectors(chain: Chain) -> list[Elements]:
    """Return the constant vectors of the two links behind the first two revolute joints, shape (3,) each, m."""
    turning = _revolute(chain)
    parts = [_between(chain, i, j) for i, j in pairwise(turning)] + [_end(chain, turning[-1])]
    return [_origin(part) for part in parts[:2]]


def _parallel_chain(bench: Workbench) -> None:
    chain = bench.chain
    turning = _revolute(chain)
    a, b = turning[:2]
    before = chain.part(1, a - 1)
    # In the frame of the first turning joint, whose height a slide before it changes alone.
    R = before[:2, :2]
    point = R.T @ (_origin(bench.T)[:2] - _origin(before)[:2])
    first = _between(chain, a, b)
    end = _end(chain, turning[-1])
    up: Any = chain.first[2, :3] @ before[:3, 2]
    side = chain.ring.number(1 if number(chain, up) >= 0 else -1)
    x, y = point
    last = end
    if len(turning) == 3:
        c = turning[2]
        middle = _between(chain, b, c)
        _chain_rotation(bench, turning, before, first, middle, end)
        cosine, sine = chain.named(("cphi", "sphi"))
        still = first @ middle
        behind = rotation(chain.ring, 0, 1, (cosine, sine))[:2, :2] @ still[:2, :2] @ _origin(end)[:2]
        x, y = x - behind[0], y - behind[1]
        last = middle
    definitions, (x, y) = bench.define_all(x=x, y=y)
    who = TOOL if len(turning) == 2 else f"axis {turning[2]}"
    bench.add(
        Step(
            "The point in the plane",
            f"{who.capitalize()} is at (x, y) from axis {a}, in the axes of its frame at theta{a} = 0"
            + (": what lies behind it is turned by phi, and taken off." if len(turning) == 3 else "."),
            definitions,
        )
    )
    both = _origin(first @ chain.joint(b) @ last)
    reach_with_two_links(bench, (a, b), _origin(first)[:2], both[:2], (x, y), who, ("left", "right"), side)
    if len(turning) == 3:
        known = chain.joint(a) @ first @ chain.joint(b) @ last
        # Cosine and sine of the part of phi that joints a and b make.
        part = known[:2, :2] @ (first @ last)[:2, :2].T
        remaining_angle(
            bench,
            turning[2],
            element_array([part[0, 0], part[1, 0]]),
            _chain_senses(chain, turning),
            f"Joint {turning[2]} turns what remains of phi.",
        )
    _chain_height(bench)


def _chain_senses(chain: Chain, turning: list[int]) -> list[tuple[int, int]]:
    sense, senses = 1, []
    for i in range(turning[0], turning[-1] + 1):
        if i in turning:
            senses.append((i, sense))
        if i < chain.n:
            sense *= int(number(chain, _sense(chain, i)))
    return senses


def _chain_rotation(
    bench: Workbench, turning: list[int], before: Elements, first: Elements, middle: Elements, end: Elements
) -> None:
    """Add the step for phi, the sum of three parallel joints' angles, from the tool's axis that is seen best."""
    chain = bench.chain
    a, b, c = turning
    still = first @ middle
    whole = chain.joint(a) @ first @ chain.joint(b) @ middle @ chain.joint(c)
    turned = whole[:2, :2] @ still[:2, :2].T
    phi = bench.phi(turned[0, 0], turned[1, 0], _chain_senses(chain, turning))
    at_zero = (before @ still @ end)[:3, :3]
    sizes = [sum(number(chain, at_zero[i, k]) ** 2 for i in range(2)) for k in range(3)]
    column = int(np.argmax(np.round(sizes, 12)))
    own = still[:2, :2] @ end[:2, column]
    seen = before[:2, :2].T @ bench.T[:2, column]
    definitions, (ax, ay) = bench.define_all(ax=seen[0], ay=seen[1])
    bench.add(
        Step(
            "phi",
            f"{_sum_text(_chain_senses(chain, turning))} The joints turn the tool's {'xyz'[column]} axis by phi: "
            "it is seen at (ax, ay) in the plane.",
            definitions,
            Turned(phi, {"U": own[0], "V": own[1], "X": ax, "Y": ay}),
        )
    )


def _chain_height(bench: Workbench) -> None:
    """Add the slide along the axes, or the condition that the pose lies in the arm's plane."""
    chain = bench.chain
    arm, given = (chain.whole @ chain.last)[2, 3], _origin(bench.T)[2]
    slides = [i for i, kind in enumerate(chain.description.kinds, start=1) if kind == "P"]
    if slides:
        look = f"Joint {slides[0]} alone moves the tool along the axes."
        height_of_slide(bench, slides[0], given, arm, look)
    else:
        bench.conditions.append(Condition(IN_THE_PLANE, given, arm))


def _polar(bench: Workbench) -> None:
    chain = bench.chain
    definitions, (x, y) = bench.define_all(x=_origin(bench.T)[0], y=_origin(bench.T)[1])
    bench.add(Step("The point in the plane", "The tool is at (x, y) from axis 1.", definitions))
    vector = _origin(chain.link(1) @ chain.joint(2) @ chain.last)
    reach_with_slide(bench, 1, vector[:2], (x, y), TOOL)
    arm = (chain.whole @ chain.last)[2, 3]
    bench.conditions.append(Condition(IN_THE_PLANE, _origin(bench.T)[2], arm))


def _slider_fits(chain: Chain) -> bool:
    return _perpendicular(chain, 1) and _is_long(_origin(chain.last)[:2])


def _slider(bench: Workbench) -> None:
    chain = bench.chain
    place, carried = _origin(chain.whole @ chain.last), chain.joint(1) @ chain.link(1)
    # In the axes of axis 2's frame: the slide is along y, and x and z do not depend on it.
    R = carried[:3, :3]
    own, start, seen = R.T @ (place - _origin(carried)), R.T @ _origin(carried), R.T @ _origin(bench.T)
    A, B, rest = linear_parts(own[0], 1)
    bench.add(
        Step(
            "theta2",
            "Joint 1 slides at right angles to axis 2: what it does not change is how far the tool lies beside the "
            "line in which it slides, which depends on theta2 alone.",
            (),
            Circle(bench.unknown(2), {"A": A, "B": B, "C": seen[0] - start[0] - rest}),
            "the pose is farther beside the slide than the tool is from axis 2",
            "the tool is straight beside axis 2, at right angles to the slide: both solutions coincide",
            Choice(("ahead", "behind"), (chain.alpha[0][1] * own[1],)),
        )
    )
    look = "With theta2 known, the slide has to bring the tool to its height."
    height_of_slide(bench, 1, _origin(bench.T)[2], place[2], look)
    bench.conditions.append(Condition(IN_THE_PLANE, seen[2] - start[2], own[2]))


FAMILIES = (
    Derivable("elbow_wrist", ("RRRRRR",), "spherical wrist, axes 2 and 3 parallel", _elbow_fits, _elbow, True),
    Derivable(
        "slide_wrist",
        ("RRPRRR",),
        "spherical wrist, joint 3 slides at right angles to axis 2",
        _slide_fits,
        _slide,
        True,
    ),
    Derivable(
        "three_parallel",
        ("RRRRRR",),
        "axes 2, 3 and 4 parallel, 5 and 6 meet",
        _parallel_fits,
        _three_parallel,
        True,
    ),
    Derivable("yaw_three", ("RRRR",), "a turntable, axes 2, 3 and 4 parallel", _turntable_fits, _yaw_three),
    Derivable("yaw_two", ("RRR",), "a turntable, axes 2 and 3 parallel", _turntable_fits, _yaw_two),
    Derivable("pan_tilt", ("RR",), "pan and tilt: axes 1 and 2 at right angles", _pan_tilt_fits, _pan_tilt, aims=True),
    Derivable("parallel_chain", CHAINS, "parallel axes", _chain_fits, _parallel_chain),
    Derivable(
        "polar",
        ("RP",),
        "a slide at right angles to a revolute axis",
        lambda chain: _perpendicular(chain, 1),
        _polar,
    ),
    Derivable("slider", ("PR",), "a revolute axis at right angles to a slide", _slider_fits, _slider),
)
"""In the order in which they are tried."""
