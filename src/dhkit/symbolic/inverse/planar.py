"""Steps of arms that move in parallel planes: planar arms, SCARAs, and a slide and an axis across each other."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from dhkit.symbolic.exact.transforms import rotation
from dhkit.symbolic.inverse.chain import ExactChain
from dhkit.symbolic.inverse.forms import Circle, Turned
from dhkit.symbolic.inverse.regions import (
    UPRIGHT,
    height_of_slide,
    linear_parts,
    number,
    reach_with_slide,
    reach_with_two_links,
    remaining_angle,
)
from dhkit.symbolic.inverse.relations import (
    IN_THE_PLANE,
    TOOL,
    is_long,
    origin,
    parallel,
    perpendicular,
    relative_sense,
    sum_text,
)
from dhkit.symbolic.inverse.steps import Choice, Condition, DerivationStep, Workbench
from dhkit.symbolic.ring import Elements
from dhkit.symbolic.ring.elements import element_array


def chain_fits(chain: ExactChain) -> bool:
    """Whether all axes are parallel, and two links have a length."""
    if not all(parallel(chain, i) for i in range(1, chain.n)):
        return False
    return all(is_long(vector[:2]) for vector in _chain_vectors(chain))


def _revolute(chain: ExactChain) -> list[int]:
    return [i for i, kind in enumerate(chain.description.kinds, start=1) if kind == "R"]


def _between(chain: ExactChain, i: int, j: int) -> Elements:
    """Return what is constant between joints i and j > i, both revolute: C_i, and a slide with its link."""
    return chain.link(i) @ chain.part(i + 1, j - 1)


def _end(chain: ExactChain, i: int) -> Elements:
    """Return what is constant behind joint i, the last revolute one: its link, a slide, and the tool."""
    if i == chain.n:
        return chain.last
    return chain.link(i) @ chain.part(i + 1, chain.n) @ chain.last


def _chain_vectors(chain: ExactChain) -> list[Elements]:
    """Return the constant vectors of the two links behind the first two revolute joints, shape (3,) each, m."""
    turning = _revolute(chain)
    parts = [_between(chain, i, j) for i, j in pairwise(turning)] + [_end(chain, turning[-1])]
    return [origin(part) for part in parts[:2]]


def parallel_chain(bench: Workbench) -> None:
    """Write the steps of two or three parallel joints with at most one slide along them."""
    chain = bench.chain
    turning = _revolute(chain)
    a, b = turning[:2]
    before = chain.part(1, a - 1)
    # In the frame of the first revolute joint, whose height a slide before it changes alone.
    R = before[:2, :2]
    point = R.T @ (origin(bench.T)[:2] - origin(before)[:2])
    first = _between(chain, a, b)
    end = _end(chain, turning[-1])
    up: Any = chain.first[2, :3] @ before[:3, 2]
    side = chain.ring.number(1 if number(chain, up) >= -UPRIGHT else -1)
    x, y = point
    last = end
    if len(turning) == 3:
        c = turning[2]
        middle = _between(chain, b, c)
        _chain_rotation(bench, turning, before, first, middle, end)
        cosine, sine = chain.named(("cphi", "sphi"))
        still = first @ middle
        behind = rotation(chain.ring, 0, 1, (cosine, sine))[:2, :2] @ still[:2, :2] @ origin(end)[:2]
        x = x - behind[0]
        y = y - behind[1]
        last = middle
    definitions, (x, y) = bench.define_all(x=x, y=y)
    who = TOOL if len(turning) == 2 else f"axis {turning[2]}"
    bench.add(
        DerivationStep(
            "The point in the plane",
            f"{who.capitalize()} is at (x, y) from axis {a}, in the axes of its frame at theta{a} = 0"
            + (": what lies behind it is turned by phi, and taken off." if len(turning) == 3 else "."),
            definitions,
        )
    )
    both = origin(first @ chain.joint(b) @ last)
    reach_with_two_links(bench, (a, b), origin(first)[:2], both[:2], (x, y), who, ("left", "right"), side)
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


def _chain_senses(chain: ExactChain, turning: list[int]) -> list[tuple[int, int]]:
    sense = 1
    senses = []
    for i in range(turning[0], turning[-1] + 1):
        if i in turning:
            senses.append((i, sense))
        if i < chain.n:
            sense *= int(number(chain, relative_sense(chain, i)))
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

    # The tool's axis that has the longest projection onto the plane, at q = 0 and at every q.
    numbers = np.array([[number(chain, entry) for entry in row] for row in at_zero[:2]])
    sizes = (numbers**2).sum(axis=0)
    column = int(np.argmax(np.round(sizes, 12)))
    own = still[:2, :2] @ end[:2, column]
    seen = before[:2, :2].T @ bench.T[:2, column]
    definitions, (ax, ay) = bench.define_all(ax=seen[0], ay=seen[1])
    bench.add(
        DerivationStep(
            "phi",
            f"{sum_text(_chain_senses(chain, turning))} The joints turn the tool's {'xyz'[column]} axis by phi: "
            "it is seen at (ax, ay) in the plane.",
            definitions,
            Turned(phi, {"U": own[0], "V": own[1], "X": ax, "Y": ay}),
        )
    )


def _chain_height(bench: Workbench) -> None:
    """Add the slide along the axes, or the condition that the pose lies in the arm's plane."""
    chain = bench.chain
    arm = (chain.whole @ chain.last)[2, 3]
    given = origin(bench.T)[2]
    slides = [i for i, kind in enumerate(chain.description.kinds, start=1) if kind == "P"]
    if slides:
        look = f"Joint {slides[0]} alone moves the tool along the axes."
        height_of_slide(bench, slides[0], given, arm, look)
    else:
        bench.conditions.append(Condition(IN_THE_PLANE, given, arm))


def polar(bench: Workbench) -> None:
    """Write the steps of a slide across a turning axis."""
    chain = bench.chain
    definitions, (x, y) = bench.define_all(x=origin(bench.T)[0], y=origin(bench.T)[1])
    bench.add(DerivationStep("The point in the plane", "The tool is at (x, y) from axis 1.", definitions))
    vector = origin(chain.link(1) @ chain.joint(2) @ chain.last)
    reach_with_slide(bench, 1, vector[:2], (x, y), TOOL)
    arm = (chain.whole @ chain.last)[2, 3]
    bench.conditions.append(Condition(IN_THE_PLANE, origin(bench.T)[2], arm))


def slider_fits(chain: ExactChain) -> bool:
    """Whether the tool is off an axis that a slide carries."""
    return perpendicular(chain, 1) and is_long(origin(chain.last)[:2])


def slider(bench: Workbench) -> None:
    """Write the steps of a turning axis across a slide."""
    chain = bench.chain
    place = origin(chain.whole @ chain.last)
    carried = chain.joint(1) @ chain.link(1)
    # In the axes of axis 2's frame: the slide is along y, and x and z do not depend on it.
    R = carried[:3, :3]
    own = R.T @ (place - origin(carried))
    start = R.T @ origin(carried)
    seen = R.T @ origin(bench.T)
    A, B, rest = linear_parts(own[0], 1)
    bench.add(
        DerivationStep(
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
    look = "With theta2 known, the slide has to bring the tool to its place along its direction."
    height_of_slide(bench, 1, origin(bench.T)[2], place[2], look)
    bench.conditions.append(Condition(IN_THE_PLANE, seen[2] - start[2], own[2]))
