"""Steps of arms that move in parallel planes: planar arms, SCARAs, and a prismatic with a revolute joint across it."""

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
    """Return whether all axes are parallel, and two links have a length."""
    if not all(parallel(chain, i) for i in range(1, chain.n)):
        return False
    return all(is_long(vector[:2]) for vector in _chain_vectors(chain))


def _revolute(chain: ExactChain) -> list[int]:
    """Return the revolute joints, from 1."""
    return [i for i, kind in enumerate(chain.description.kinds, start=1) if kind == "R"]


def _between(chain: ExactChain, i: int, j: int) -> Elements:
    """Return the transform from revolute joint i to the next one, j: C_i, and a prismatic joint with its link.

    Its part in the plane is constant.
    """
    return chain.link(i) @ chain.part(i + 1, j - 1)


def _end(chain: ExactChain, i: int) -> Elements:
    """Return the transform after joint i, the last revolute one: its link, a prismatic joint, and the tool."""
    if i == chain.n:
        return chain.last
    return chain.link(i) @ chain.part(i + 1, chain.n) @ chain.last


def _chain_vectors(chain: ExactChain) -> list[Elements]:
    """Return the vectors of the two links after the first two revolute joints, shape (3,) each, m."""
    revolute = _revolute(chain)
    parts = [_between(chain, i, j) for i, j in pairwise(revolute)]
    parts.append(_end(chain, revolute[-1]))
    return [origin(part) for part in parts[:2]]


def parallel_chain(bench: Workbench) -> None:
    """Write the steps of two or three parallel revolute joints with at most one prismatic joint along them."""
    chain = bench.chain
    revolute = _revolute(chain)
    has_three = len(revolute) == 3
    a, b = revolute[:2]

    # The tool in the frame of the first revolute joint; a prismatic joint before it only changes the frame's height.
    before = chain.part(1, a - 1)
    R = before[:2, :2]
    x, y = R.T @ (origin(bench.T)[:2] - origin(before)[:2])

    # Left and right are named as seen from above; in a vertical plane, as seen against the first axis.
    up: Any = chain.first[2, :3] @ before[:3, 2]
    side = chain.ring.number(1 if number(chain, up) >= -UPRIGHT else -1)

    first = _between(chain, a, b)
    end = _end(chain, revolute[-1])
    second = end
    who = TOOL
    taken_off = "."
    if has_three:
        # Axis c instead of the tool: (x, y) <- (x, y) - Rz(phi) R p, with p the vector from axis c to the tool
        c = revolute[2]
        who = f"axis {c}"
        taken_off = ": the part after it is turned by phi, and taken off."
        second = _between(chain, b, c)
        _chain_rotation(bench, revolute, before, first @ second, end)
        cosine, sine = chain.named(("cphi", "sphi"))
        at_zero = first @ second
        from_axis_c = (
            rotation(chain.ring, 0, 1, (cosine, sine))[:2, :2] @ at_zero[:2, :2] @ origin(end)[:2]
        )
        x = x - from_axis_c[0]
        y = y - from_axis_c[1]

    definitions, (x, y) = bench.define_all(x=x, y=y)
    bench.add(
        DerivationStep(
            "The point in the plane",
            f"{who.capitalize()} is at (x, y) from axis {a}, in the axes of its frame at theta{a} = 0{taken_off}",
            definitions,
        )
    )
    both = origin(first @ chain.joint(b) @ second)
    reach_with_two_links(
        bench, (a, b), origin(first)[:2], both[:2], (x, y), who, ("left", "right"), side
    )

    if has_three:
        # The part of phi that joints a and b make: the rotation of link b by them, less its rotation at zero angles.
        turned = chain.joint(a) @ first @ chain.joint(b) @ second
        known = turned[:2, :2] @ (first @ second)[:2, :2].T
        remaining_angle(
            bench,
            revolute[2],
            element_array([known[0, 0], known[1, 0]]),
            _chain_senses(chain, revolute),
            f"Joint {revolute[2]} turns what remains of phi.",
        )
    _chain_height(bench)


def _chain_senses(chain: ExactChain, revolute: list[int]) -> list[tuple[int, int]]:
    """Return the revolute joints, each with 1 if its axis has the direction of the first one's, else -1."""
    sense = 1
    senses = []
    for i in range(revolute[0], revolute[-1] + 1):
        if i in revolute:
            senses.append((i, sense))
        if i < chain.n:
            sense *= int(number(chain, relative_sense(chain, i)))
    return senses


def _chain_rotation(
    bench: Workbench, revolute: list[int], before: Elements, at_zero: Elements, end: Elements
) -> None:
    """Add the step for phi, the sum of three parallel joints' angles, from the tool's axis that is seen best.

    Parameters
    ----------
    revolute
        The three joints, from 1.
    before
        The transform before the first of them, shape (4, 4).
    at_zero
        The transform from the first joint to the third where their angles are 0, shape (4, 4).
    end
        The transform after the third joint, shape (4, 4).
    """
    chain = bench.chain
    a, b, c = revolute
    senses = _chain_senses(chain, revolute)

    # Rz(phi) is the rotation of the links by the joints, less their rotation at zero angles.
    whole = (
        chain.joint(a)
        @ _between(chain, a, b)
        @ chain.joint(b)
        @ _between(chain, b, c)
        @ chain.joint(c)
    )
    by_phi = whole[:2, :2] @ at_zero[:2, :2].T
    phi = bench.phi(by_phi[0, 0], by_phi[1, 0], senses)

    # The tool's axis with the largest component in the plane, the first one of equals.
    tool_axes = (before @ at_zero @ end)[:3, :3]
    sizes = []
    for k in range(3):
        size = sum(number(chain, tool_axes[i, k]) ** 2 for i in range(2))
        sizes.append(size)
    column = int(np.argmax(np.round(sizes, 12)))

    # Rz(phi) own = seen
    own = at_zero[:2, :2] @ end[:2, column]
    seen = before[:2, :2].T @ bench.T[:2, column]
    definitions, (ax, ay) = bench.define_all(ax=seen[0], ay=seen[1])
    bench.add(
        DerivationStep(
            "phi",
            f"{sum_text(senses)} The joints turn the tool's {'xyz'[column]} axis by phi: "
            "it is seen at (ax, ay) in the plane.",
            definitions,
            Turned(phi, {"U": own[0], "V": own[1], "X": ax, "Y": ay}),
        )
    )


def _chain_height(bench: Workbench) -> None:
    """Add the step of a prismatic joint along the axes, or the condition that the pose lies in the arm's plane."""
    chain = bench.chain
    arm = (chain.whole @ chain.last)[2, 3]
    given = origin(bench.T)[2]
    prismatic = [i for i, kind in enumerate(chain.description.kinds, start=1) if kind == "P"]
    if prismatic:
        look = f"Joint {prismatic[0]} alone moves the tool along the axes."
        height_of_slide(bench, prismatic[0], given, arm, look)
    else:
        bench.conditions.append(Condition(IN_THE_PLANE, given, arm))


def polar(bench: Workbench) -> None:
    """Write the steps of a prismatic joint after a revolute one, at right angles to its axis."""
    chain = bench.chain
    definitions, (x, y) = bench.define_all(x=origin(bench.T)[0], y=origin(bench.T)[1])
    bench.add(
        DerivationStep("The point in the plane", "The tool is at (x, y) from axis 1.", definitions)
    )
    vector = origin(chain.link(1) @ chain.joint(2) @ chain.last)
    reach_with_slide(bench, 1, vector[:2], (x, y), TOOL)
    arm = (chain.whole @ chain.last)[2, 3]
    bench.conditions.append(Condition(IN_THE_PLANE, origin(bench.T)[2], arm))


def slider_fits(chain: ExactChain) -> bool:
    """Return whether the tool is off a revolute axis at right angles to the prismatic joint before it."""
    return perpendicular(chain, 1) and is_long(origin(chain.last)[:2])


def slider(bench: Workbench) -> None:
    """Write the steps of a revolute joint after a prismatic one, at right angles to it."""
    chain = bench.chain
    tool = origin(chain.whole @ chain.last)

    # In the axes of axis 2's frame, the prismatic joint moves along y: x and z do not depend on it.
    axis_2 = chain.joint(1) @ chain.link(1)
    R = axis_2[:3, :3]
    own = R.T @ (tool - origin(axis_2))
    start = R.T @ origin(axis_2)
    seen = R.T @ origin(bench.T)

    # x of the tool from axis 2: A cos(theta2) + B sin(theta2) + rest = seen_x - start_x
    A, B, rest = linear_parts(own[0], 1)
    bench.add(
        DerivationStep(
            "theta2",
            "Joint 1 slides at right angles to axis 2: what it does not change is how far the tool lies beside the "
            "line in which it slides, which depends on theta2 alone.",
            form=Circle(bench.unknown(2), {"A": A, "B": B, "C": seen[0] - start[0] - rest}),
            nothing="the pose is farther beside the slide than the tool is from axis 2",
            singular="the tool is straight beside axis 2, at right angles to the slide: both solutions coincide",
            choice=Choice(("ahead", "behind"), (chain.alpha[0][1] * own[1],)),
        )
    )
    look = "With theta2 known, the slide has to bring the tool to its place along its direction."
    height_of_slide(bench, 1, origin(bench.T)[2], tool[2], look)
    bench.conditions.append(Condition(IN_THE_PLANE, seen[2] - start[2], own[2]))
