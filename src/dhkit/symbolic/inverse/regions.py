"""Steps that put a point in place: joint 1 turns a plane, two links reach in it, a slide reaches in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from dhkit.symbolic.inverse.chain import ZERO_LENGTH, ExactChain
from dhkit.symbolic.inverse.forms import Circle, Form, Line, Remainder, Sliding, Square, Turned
from dhkit.symbolic.inverse.steps import Choice, Definition, DerivationStep, Figure, View, Workbench
from dhkit.symbolic.ring import Element, Elements
from dhkit.symbolic.ring.elements import element_array

UPRIGHT = 1e-9
"""Tolerance of entries of the vertical's direction, as in ``dhkit.kinematics.closed_form``."""


@dataclass(frozen=True, eq=False)
class Plane:
    """Known quantities once joint 1 is known: coordinates in the frame of axis 2, whose z axis is axis 2.

    Attributes
    ----------
    tilt
        Sine of alpha_1: 1 or -1.
    x, y
        The point, m.
    up
        Coordinates x and y of the world's vertical.
    """

    tilt: Element
    x: Element
    y: Element
    up: tuple[Element, Element]


def number(chain: ExactChain, element: Element) -> float:
    """Return the value of an element of constants, with the file's values."""
    ring = chain.ring
    return float(element.value([chain.values.get(g.text, np.nan) for g in ring.generators]))


def _vertical(chain: ExactChain) -> Elements:
    """Return the direction that is up in the frame before joint 1, shape (3,).

    It only gives branches their names; a base that is upright or level but for UPRIGHT counts as upright or level.
    """
    zero = chain.ring.zero
    return element_array([zero if abs(number(chain, x)) <= UPRIGHT else x for x in chain.first[2, :3]])


def into_axis_2(bench: Workbench, vector: Elements) -> Elements:
    """Return a vector, shape (3,), of the frame before joint 1 in the axes of the frame of axis 2."""
    c, s = bench.chain.cosine_and_sine(1)
    tilt = bench.chain.alpha[0][1]
    x, y, z = vector
    return element_array([c * x + s * y, tilt * z, tilt * (s * x - c * y)])


def turn_the_plane(bench: Workbench, point: Elements, inside: Elements, who: str) -> Plane:
    """Add the step that finds joint 1, and return coordinates in the plane.

    Parameters
    ----------
    point
        A point of the arm before joint 1, shape (3,), m, in known quantities.
    inside
        The same in the frame of axis 2, in joints 2, 3 ...: its z is constant.
    who
        The point's name in sentences.
    """
    chain = bench.chain
    unknown = bench.unknown(1)
    c, s = chain.cosine_and_sine(1)
    tilt = chain.alpha[0][1]
    px, py, pz = point
    beside = inside[2]
    offset = number(chain, inside[2])
    if abs(offset) <= ZERO_LENGTH * (chain.description.reach or 1.0):
        offset = 0.0  # as far as names go; the equation keeps it
    forward = tilt * (c * px + s * py)
    missing = "" if inside[2].is_zero else f"abs({inside[2]})"
    if inside[2].is_zero:
        form: Form = Line(unknown, {"X": px, "Y": py})
        look = (
            f"Axes 1 and 2 are at right angles. The plane through axis 1 and at right angles to axis 2 holds {who}, "
            "whatever the later joints are: seen along axis 1, the arm points at it, or away from it."
        )
        nothing = ""
    else:
        form = Circle(unknown, {"A": -py, "B": px, "C": tilt * beside})
        look = (
            f"Axes 1 and 2 are at right angles. {who.capitalize()} lies {inside[2]} along axis 2 beside axis 1, "
            "whatever the later joints are: seen along axis 1, this is its distance from the line in which the arm "
            "points."
        )
        nothing = (
            f"{who} is nearer to axis 1 than {missing}: the missing distance is {missing} - sqrt({px * px + py * py})"
        )
    names = ("front", "back")
    if offset:
        swapped = (-1.0 if number(chain, _vertical(chain)[2]) < 0 else 1.0) * offset > 0
        names = ("right", "left") if swapped else ("left", "right")
    bench.add(
        DerivationStep(
            "theta1",
            look,
            (),
            form,
            nothing,
            f"{who} is on axis 1" if not offset else f"{who} is {missing} from axis 1: both solutions coincide",
            Choice(names, (forward,)),
            Figure(View.TOP, ("axis 1", who)),
        )
    )
    x = c * px + s * py - chain.a[0]
    y = tilt * (pz - chain.d[0])
    up = into_axis_2(bench, _vertical(chain))
    return Plane(tilt, x, y, (up[0], up[1]))


def reach_with_two_links(
    bench: Workbench,
    joints: tuple[int, int],
    first: Elements,
    both: Elements,
    place: tuple[Element, Element],
    who: str,
    names: tuple[str, str],
    above: Element,
) -> None:
    """Add the steps for two parallel joints that put a point in place.

    Parameters
    ----------
    joints
        The two joints, from 1.
    first
        The vector from the first joint's axis to the second's before the first turns, x and y, m.
    both
        The vector to the point, in the second joint's angle.
    place
        Where the point has to be, from the first joint's axis: quantities x and y.
    who
        The point's name in sentences.
    names
        The name of the elbow on the left of the line to the point where ``above`` is positive (seen against the axes),
        and that of the other one.
    """
    a, b = joints
    x, y = place
    unknown = bench.unknown(b)
    square = both[0] * both[0] + both[1] * both[1]
    A, B, rest = linear_parts(square, unknown.joint or 0)
    form = Circle(unknown, {"A": A, "B": B, "C": x * x + y * y - rest})
    bench.add(
        DerivationStep(
            f"theta{b}",
            f"Axes {a} and {b} are parallel. The distance of {who} from axis {a} depends on theta{b} alone: "
            f"the law of cosines in the triangle of axis {a}, axis {b} and {who}.",
            (),
            form,
            f"{who} is farther from axis {a} than both links together reach, or nearer than their difference",
            "the two links are stretched out or folded: both solutions coincide",
            # The elbow is on the left of the line to the point where first x both is negative.
            Choice(names, (first[1] * both[0] - first[0] * both[1], above)),
            Figure(View.TRIANGLE, (f"axis {a}", f"axis {b}", who), tuple(first[:2])),
        )
    )
    definitions, (u, v) = bench.define_all(u=both[0], v=both[1])
    turn_into_place(bench, a, definitions, (u, v), place, who)


def turn_into_place(
    bench: Workbench,
    i: int,
    definitions: tuple[Definition, ...],
    vector: tuple[Element, Element],
    place: tuple[Element, Element],
    who: str,
) -> None:
    """Add the step that turns a known vector (u, v) into a known place (x, y)."""
    u, v = vector
    x, y = place
    bench.add(
        DerivationStep(
            f"theta{i}",
            f"Before joint {i} turns, {who} is at (u, v) from axis {i}; afterwards it is at (x, y).",
            definitions,
            Turned(bench.unknown(i), {"U": u, "V": v, "X": x, "Y": y}),
            "",
            f"{who} is on axis {i}",
        )
    )


def reach_with_slide(bench: Workbench, i: int, vector: Elements, place: tuple[Element, Element], who: str) -> None:
    """Add the steps for a prismatic joint after a revolute joint i, from 1, that put a point in place."""
    x, y = place
    unknown = bench.unknown(i + 1)
    square = vector[0] * vector[0] + vector[1] * vector[1]
    middle, rest = _quadratic_parts(square, unknown.joint or 0)
    S = x * x + y * y - rest + middle * middle
    bench.add(
        DerivationStep(
            f"q{i + 1}",
            f"Joint {i + 1} slides at right angles to axis {i}: the distance of {who} from axis {i} depends on "
            f"q{i + 1} alone (Pythagoras).",
            (),
            Square(unknown, {"M": middle, "S": S, "Q": x * x + y * y}),
            ""
            if (rest - middle * middle).is_zero
            else f"{who} is nearer to axis {i} than the line along which it slides",
            f"{who} is as near to axis {i} as the slide allows: both solutions coincide",
            Choice(("out", "in"), (unknown.symbols[0] + middle,)),
            Figure(View.SLIDE, (f"axis {i}", who)),
        )
    )
    definitions, (u, v) = bench.define_all(u=vector[0], v=vector[1])
    turn_into_place(bench, i, definitions, (u, v), place, who)


def remaining_angle(bench: Workbench, i: int, before: Elements, senses: Sequence[tuple[int, int]], look: str) -> None:
    """Add the step for a joint i, from 1, that is what remains of phi.

    Parameters
    ----------
    before
        Cosine and sine of the part of phi that is known.
    senses
        Joints that phi adds up, from 1, each with 1 or -1; joint i is the last.
    """
    cosine, sine = bench.chain.named(("cphi", "sphi"))
    c, s = before
    own = senses[-1][1]
    X = cosine * c + sine * s
    Y = own * (sine * c - cosine * s)
    terms = (("phi", own), *((f"theta{j}", -own * sense) for j, sense in senses[:-1]))
    bench.add(DerivationStep(f"theta{i}", look, (), Remainder(bench.unknown(i), {"X": X, "Y": Y}, terms)))


def linear_parts(element: Element, i: int) -> tuple[Element, Element, Element]:
    """Return A, B and C of A cos(theta_i) + B sin(theta_i) + C; joint i counts from 0."""
    ring = element.ring
    places = ring.place("cosine", i), ring.place("sine", i)
    parts: list[dict[tuple[int, ...], Fraction]] = [{}, {}, {}]
    for monomial, coefficient in element.terms.items():
        exponents = [monomial[k] for k in places]
        if sum(exponents) > 1:
            raise ValueError(f"not linear in cosine and sine of joint {i + 1}: {element}")
        lowered = tuple(0 if k in places else e for k, e in enumerate(monomial))
        parts[2 if not sum(exponents) else exponents.index(1)][lowered] = coefficient
    A, B, C = (ring.from_terms(part) for part in parts)
    return A, B, C


def _quadratic_parts(element: Element, i: int) -> tuple[Element, Element]:
    """Return m and c of q_i^2 + 2 m q_i + c; joint i counts from 0."""
    ring = element.ring
    place = ring.place("position", i)
    middle: dict[tuple[int, ...], Fraction] = {}
    rest: dict[tuple[int, ...], Fraction] = {}
    for monomial, coefficient in element.terms.items():
        lowered = tuple(0 if k == place else e for k, e in enumerate(monomial))
        if monomial[place] == 1:
            middle[lowered] = coefficient / 2
        elif monomial[place] == 0:
            rest[lowered] = coefficient
        elif lowered != (0,) * len(monomial) or coefficient != 1 or monomial[place] != 2:
            raise ValueError(f"not q^2 + 2 m q + c: {element}")
    return ring.from_terms(middle), ring.from_terms(rest)


def height_of_slide(bench: Workbench, i: int, given: Element, arm: Element, look: str) -> None:
    """Add the step for a slide i, from 1, that alone changes a coordinate: ``given``, and ``arm`` in the joints."""
    place = bench.chain.ring.place("position", i - 1)
    unit = tuple(int(k == place) for k in range(len(bench.chain.ring.generators)))
    sense = arm.terms[unit]
    rest = arm - sense * bench.chain.ring.position(i - 1)
    bench.add(DerivationStep(f"q{i}", look, (), Sliding(bench.unknown(i), {"Z": sense * (given - rest)})))
