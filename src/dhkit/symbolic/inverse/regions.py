"""Steps that put a point in place: joint 1 turns a plane, two links reach in it, a prismatic joint reaches in it."""

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
from dhkit.symbolic.ring.polynomials import Monomial

UPRIGHT = 1e-9
"""Largest entry of a unit vector along the vertical that counts as zero, as in ``dhkit.kinematics.closed_form``."""


@dataclass(frozen=True, eq=False)
class Plane:
    """A point in the plane that joint 1 turns: coordinates in the frame of axis 2, whose z axis is axis 2.

    Attributes
    ----------
    tilt
        Sine of alpha_1: 1 or -1.
    x, y
        The point, m.
    up
        Components x and y of the world's vertical.
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
    """Return the world's vertical in the frame before joint 1, shape (3,), unit length.

    It only gives branches their names; entries of at most UPRIGHT are 0.
    """
    zero = chain.ring.zero
    row = chain.first[2, :3]  # z of the world in the axes of the frame
    return element_array([zero if abs(number(chain, x)) <= UPRIGHT else x for x in row])


def into_axis_2(bench: Workbench, vector: Elements) -> Elements:
    """Return a vector, shape (3,), of the frame before joint 1 in the axes of the frame of axis 2."""
    c, s = bench.chain.cosine_and_sine(1)
    tilt = bench.chain.alpha[0][1]
    x, y, z = vector
    # (Rz(theta1) Rx(alpha1))^T v with cos(alpha1) = 0
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
    offset = inside[2]

    # The point's z in the frame of axis 2 is the offset: tilt (s px - c py) = offset.
    form: Form
    if offset.is_zero:
        missing = ""
        form = Line(unknown, {"X": px, "Y": py})
        look = (
            f"Axes 1 and 2 are at right angles. The plane through axis 1 and at right angles to axis 2 holds {who}, "
            "whatever the later joints are: seen along axis 1, the arm points at it, or away from it."
        )
        nothing = ""
    else:
        missing = f"abs({offset})"
        form = Circle(unknown, {"A": -py, "B": px, "C": tilt * offset})
        look = (
            f"Axes 1 and 2 are at right angles. {who.capitalize()} lies {offset} along axis 2 beside axis 1, "
            "whatever the later joints are: seen along axis 1, this is its distance from the line in which the arm "
            "points."
        )
        nothing = (
            f"{who} is nearer to axis 1 than {missing}: "
            f"the missing distance is {missing} - sqrt({px * px + py * py})"
        )

    # A branch has its name from the sense in which the arm points at the point. For the name, an offset that is only
    # rounding counts as none; the equation keeps it.
    distance = number(chain, offset)
    if abs(distance) <= ZERO_LENGTH * (chain.description.reach or 1.0):
        distance = 0.0
    if distance:
        # Seen from above: left and right are exchanged for an arm that hangs.
        hangs = number(chain, _vertical(chain)[2]) < 0
        right_comes_first = distance < 0 if hangs else distance > 0
        names = ("right", "left") if right_comes_first else ("left", "right")
        singular = f"{who} is {missing} from axis 1: both solutions coincide"
    else:
        names = ("front", "back")
        singular = f"{who} is on axis 1"
    forward = tilt * (c * px + s * py)
    bench.add(
        DerivationStep(
            "theta1",
            look,
            form=form,
            nothing=nothing,
            singular=singular,
            choice=Choice(names, (forward,)),
            figure=Figure(View.TOP, ("axis 1", who)),
        )
    )

    # The point in the frame of axis 2: less the offset d1 along axis 1 and the length a1.
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
        The vector from the first joint's axis to the second's, where the first joint's angle is 0, x and y, m.
    both
        The vector from the first joint's axis to the point, where that angle is 0, in the second joint's angle, m.
    place
        The required position of the point from the first joint's axis: quantities x and y, m.
    who
        The point's name in sentences.
    names
        The name of the elbow on the left of the line to the point where ``above`` is positive (seen against the axes),
        and that of the other one.
    above
        A quantity whose sign exchanges the two names.
    """
    a, b = joints
    x, y = place
    unknown = bench.unknown(b)

    # Law of cosines: |both|^2 = A cos(theta_b) + B sin(theta_b) + rest = x^2 + y^2
    square = both[0] * both[0] + both[1] * both[1]
    A, B, rest = linear_parts(square, unknown.joint or 0)
    form = Circle(unknown, {"A": A, "B": B, "C": x * x + y * y - rest})

    # The elbow is on the left of the line to the point where the z component of first x both is negative.
    left = first[1] * both[0] - first[0] * both[1]
    bench.add(
        DerivationStep(
            f"theta{b}",
            f"Axes {a} and {b} are parallel. The distance of {who} from axis {a} depends on theta{b} alone: "
            f"the law of cosines in the triangle of axis {a}, axis {b} and {who}.",
            form=form,
            nothing=f"{who} is farther from axis {a} than both links together reach, or nearer than their difference",
            singular="the two links are stretched out or folded: both solutions coincide",
            choice=Choice(names, (left, above)),
            figure=Figure(View.TRIANGLE, (f"axis {a}", f"axis {b}", who), tuple(first[:2])),
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
            definitions=definitions,
            form=Turned(bench.unknown(i), {"U": u, "V": v, "X": x, "Y": y}),
            singular=f"{who} is on axis {i}",
        )
    )


def reach_with_slide(
    bench: Workbench, i: int, vector: Elements, place: tuple[Element, Element], who: str
) -> None:
    """Add the steps for a prismatic joint after a revolute joint i, from 1, that put a point in place.

    Parameters
    ----------
    vector
        The vector from axis i to the point, where joint i's angle is 0, in the prismatic joint's value, x and y, m.
    place
        The required position of the point from axis i: quantities x and y, m.
    who
        The point's name in sentences.
    """
    x, y = place
    unknown = bench.unknown(i + 1)
    q = unknown.symbols[0]

    # |vector|^2 = q^2 + 2 M q + rest = x^2 + y^2, so (q + M)^2 = x^2 + y^2 - rest + M^2 = S
    square = vector[0] * vector[0] + vector[1] * vector[1]
    M, rest = _quadratic_parts(square, unknown.joint or 0)
    distance_squared = x * x + y * y
    S = distance_squared - rest + M * M

    # rest - M^2 is the squared distance of axis i from the line on which the point slides.
    passes_axis = (rest - M * M).is_zero
    nothing = (
        "" if passes_axis else f"{who} is nearer to axis {i} than the line along which it slides"
    )
    bench.add(
        DerivationStep(
            f"q{i + 1}",
            f"Joint {i + 1} slides at right angles to axis {i}: the distance of {who} from axis {i} depends on "
            f"q{i + 1} alone (Pythagoras).",
            form=Square(unknown, {"M": M, "S": S, "Q": distance_squared}),
            nothing=nothing,
            singular=f"{who} is as near to axis {i} as the slide allows: both solutions coincide",
            choice=Choice(("out", "in"), (q + M,)),
            figure=Figure(View.SLIDE, (f"axis {i}", who)),
        )
    )
    definitions, (u, v) = bench.define_all(u=vector[0], v=vector[1])
    turn_into_place(bench, i, definitions, (u, v), place, who)


def remaining_angle(
    bench: Workbench, i: int, before: Elements, senses: Sequence[tuple[int, int]], look: str
) -> None:
    """Add the step for joint i, from 1, whose angle is the rest of the sum phi.

    Parameters
    ----------
    before
        Cosine and sine of the part of phi that is known.
    senses
        Joints that phi adds up, from 1, each with 1 or -1; joint i is the last.
    """
    cosine, sine = bench.chain.named(("cphi", "sphi"))
    c, s = before

    # phi = known + own theta_i, so theta_i = own (phi - known)
    own = senses[-1][1]
    X = cosine * c + sine * s
    Y = own * (sine * c - cosine * s)
    known_joints = [(f"theta{j}", -own * sense) for j, sense in senses[:-1]]
    terms = (("phi", own), *known_joints)
    bench.add(
        DerivationStep(f"theta{i}", look, form=Remainder(bench.unknown(i), {"X": X, "Y": Y}, terms))
    )


def linear_parts(element: Element, i: int) -> tuple[Element, Element, Element]:
    """Return A, B and C of A cos(theta_i) + B sin(theta_i) + C; joint i counts from 0."""
    ring = element.ring
    cosine = ring.place("cosine", i)
    sine = ring.place("sine", i)
    A: dict[Monomial, Fraction] = {}
    B: dict[Monomial, Fraction] = {}
    C: dict[Monomial, Fraction] = {}
    for monomial, coefficient in element.terms.items():
        if monomial[cosine] + monomial[sine] > 1:
            raise ValueError(f"not linear in cosine and sine of joint {i + 1}: {element}")
        without = tuple(
            0 if k in (cosine, sine) else exponent for k, exponent in enumerate(monomial)
        )
        if monomial[cosine]:
            A[without] = coefficient
        elif monomial[sine]:
            B[without] = coefficient
        else:
            C[without] = coefficient
    return ring.from_terms(A), ring.from_terms(B), ring.from_terms(C)


def _quadratic_parts(element: Element, i: int) -> tuple[Element, Element]:
    """Return m and c of q_i^2 + 2 m q_i + c; joint i counts from 0."""
    ring = element.ring
    place = ring.place("position", i)
    m: dict[Monomial, Fraction] = {}
    c: dict[Monomial, Fraction] = {}
    for monomial, coefficient in element.terms.items():
        exponent = monomial[place]
        without = tuple(0 if k == place else e for k, e in enumerate(monomial))
        if exponent == 1:
            m[without] = coefficient / 2
        elif exponent == 0:
            c[without] = coefficient
        else:
            is_square = exponent == 2 and coefficient == 1 and not any(without)
            if not is_square:
                raise ValueError(f"not q^2 + 2 m q + c: {element}")
    return ring.from_terms(m), ring.from_terms(c)


def height_of_slide(bench: Workbench, i: int, given: Element, arm: Element, look: str) -> None:
    """Add the step for prismatic joint i, from 1, which alone changes a coordinate.

    Parameters
    ----------
    given
        The coordinate in the given pose, m.
    arm
        The same in the joints: q_i or -q_i, plus a rest without it.
    look
        The step's explanation.
    """
    ring = bench.chain.ring
    place = ring.place("position", i - 1)
    q_alone = tuple(int(k == place) for k in range(len(ring.generators)))

    # given = sense q_i + rest, with sense 1 or -1
    sense = arm.terms[q_alone]
    rest = arm - sense * ring.position(i - 1)
    bench.add(
        DerivationStep(f"q{i}", look, form=Sliding(bench.unknown(i), {"Z": sense * (given - rest)}))
    )
