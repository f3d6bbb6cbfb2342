"""Mistakes in Euler and Lagrange's equation with right energies, and in the choice of coordinates."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from functools import partial
from itertools import combinations

import numpy as np

from dhkit.grading.judging.coordinates import Coordinates
from dhkit.grading.judging.quotients import multiple_angle, sum_of_angles
from dhkit.grading.judging.truth import DYNAMICS, Truth, right_value, translated_array
from dhkit.grading.mistakes.sums_of_angles import sums_of_angles
from dhkit.grading.mistakes.variants import Make, Variant, changed_only, nothing
from dhkit.symbolic import Lagrangian
from dhkit.symbolic.mistakes import MISTAKES, STEP_FACTORS, VELOCITY_FACTORS, MadeAt
from dhkit.symbolic.ring import Element, Elements, element_array
from dhkit.symbolic.textbook import TextbookDerivation, derive, scaled, velocity_torques


def equation_variants(truth: Truth) -> Iterator[Variant]:
    """Yield the mistakes that leave the energies right."""
    yield from _signs(truth)
    yield from _steps(truth)
    yield from _gravity_torques(truth)
    yield from _heights(truth)
    yield from _matrices(truth)
    yield from sums_of_angles(truth.lagrangian.arm, partial(right_value, truth.lagrangian))
    yield from _other_coordinates(truth)
    yield from _zero_poses(truth)
    yield from _friction(truth) if truth.friction else ()


def lagrangian_sum(truth: Truth) -> Variant:
    """Return the mistake L = K + V with the torques from it, which is likelier than a sign of gravity."""
    lag = truth.lagrangian

    def make(quantity: str) -> Elements:
        if quantity == "L":
            return element_array(2 * lag.V)
        return -2 * lag.g if quantity == "tau" else nothing(lag, quantity)

    return Variant(MadeAt("lagrangian_sum"), make)


def _signs(truth: Truth) -> Iterator[Variant]:
    """Yield mistakes with whole parts of the equation: a wrong sign, or a missing part."""
    lag = truth.lagrangian
    yield Variant(MadeAt("velocity_torques_sign"), changed_only(lag, "h", lambda: -2 * lag.h))
    yield Variant(MadeAt("velocity_torques_missing"), changed_only(lag, "h", lambda: -lag.h))
    yield Variant(MadeAt("gravity_torques_missing"), changed_only(lag, "tau", lambda: -lag.g))
    yield Variant(MadeAt("gravity_torque_sign"), changed_only(lag, "tau", lambda: -2 * lag.g))
    yield Variant(
        MadeAt("inertial_torques_missing"), changed_only(lag, "tau", lambda: lag.h + lag.g - lag.tau), rarity=1
    )
    if not truth.coordinates.is_relative:
        yield Variant(MadeAt("motor_torques"), _motor_torques(truth))


# Steps of Euler and Lagrange's equation


def _steps(truth: Truth) -> Iterator[Variant]:
    """Yield the mistakes that change h or g alone."""
    lag = truth.lagrangian
    n = truth.description.n
    momenta = element_array([lag.K.by_rate(i) for i in range(n)])
    yield Variant(MadeAt("potential_gradient_sign"), changed_only(lag, "g", lambda: -2 * lag.g))
    for name in MISTAKES:
        if name in STEP_FACTORS or name in VELOCITY_FACTORS:
            yield Variant(MadeAt(name), _velocity_change(truth, momenta, name))
    yield Variant(MadeAt("rate_of_cosine_sign"), changed_only(lag, "h", lambda: _mass_rate(lag, momenta) * -2))
    yield Variant(MadeAt("chain_rule_forgotten"), changed_only(lag, "h", lambda: _without_chain_rule(lag, momenta)))


def _mass_rate(lag: Lagrangian, momenta: Elements) -> Elements:
    """Return dM/dt qd."""
    ring = lag.arm.ring
    return element_array([ring.sum(p.by_position(k) * ring.rate(k) for k in range(ring.n)) for p in momenta])


def _without_chain_rule(lag: Lagrangian, momenta: Elements) -> Elements:
    """Return the change of h if d/dt of cos(q) is taken for -sin(q), without the rate of q."""
    ring = lag.arm.ring
    bare = element_array([ring.sum(p.by_position(k) for k in range(ring.n)) for p in momenta])
    return bare - _mass_rate(lag, momenta)


def _velocity_change(truth: Truth, momenta: Elements, name: str) -> Make:
    lag = truth.lagrangian
    wrong = partial(velocity_torques, lag.arm.ring, lag.K, momenta, frozenset({MadeAt(name)}))
    if name not in VELOCITY_FACTORS or truth.coordinates.is_relative:
        return changed_only(lag, "h", lambda: wrong() - lag.h)
    return changed_only(lag, "h", lambda: _scaled_in_y(truth, *VELOCITY_FACTORS[name]))


def _scaled_in_y(truth: Truth, squares: bool, factor: Fraction) -> Elements:
    """Return the change of the robot's h if products of the student's own rates have another factor."""
    ring = truth.lagrangian.arm.ring
    coordinates = truth.coordinates
    n = truth.description.n
    rates = element_array([ring.rate(i) for i in range(n)])
    in_y = {ring.place("rate", i): rate for i, rate in enumerate(coordinates.B @ rates)}
    back = {ring.place("rate", i): rate for i, rate in enumerate(coordinates.S @ rates)}
    torques = translated_array(truth.of("h"), in_y)
    changed = element_array([scaled(torque, squares, factor) for torque in torques])
    return coordinates.S.T @ (translated_array(changed, back) - truth.of("h"))  # type: ignore[no-any-return]


def _gravity_torques(truth: Truth) -> Iterator[Variant]:
    """Yield gravity torques from right heights, but with the joints' own angles."""
    textbook = derive(truth.description)
    for i in range(1, truth.description.n):
        if truth.description.kinds[i] == "R":
            made = MadeAt("gravity_torque_relative_angle", i + 1)
            change = partial(_own_angle_change, textbook, i)
            yield Variant(made, changed_only(truth.lagrangian, "g", change), f"link {i + 1}")


def _own_angle_change(textbook: TextbookDerivation, i: int) -> Elements:
    """Return the change of g if the weight of link i, from 0, is computed without the angles of preceding joints."""
    arm = textbook.arm
    link = textbook.links[i]
    ring = arm.ring
    joint = textbook.links[i - 1].origin if arm.is_standard else link.origin
    height = -ring.sum(body.body.mass * (arm.gravity @ (body.com - joint)) for body in link.bodies)
    torques = element_array([height.by_position(j) for j in range(ring.n)])
    still: dict[int, Element] = {}
    for j in range(i):
        if j in ring.angles:
            still |= {ring.place("cosine", j): ring.one, ring.place("sine", j): ring.zero}
    return translated_array(torques, still) - torques


def _heights(truth: Truth) -> Iterator[Variant]:
    """Yield heights with sine and cosine exchanged, of a joint's angle and of the sums that contain it."""
    lag = truth.lagrangian
    for i in lag.arm.ring.angles:
        for sign in (-1, 1):
            shifted = _shifted(lag, i, sign)

            def make(quantity: str, shifted: Make = shifted) -> Elements:
                if quantity in ("V", "g"):
                    return shifted(quantity)
                if quantity in ("L", "tau"):
                    return shifted("V") * -1 if quantity == "L" else shifted("g")
                return nothing(lag, quantity)

            yield Variant(MadeAt("height_sin_cos", i + 1), make, f"q{i + 1}")


# Mistakes with right matrices


def _matrices(truth: Truth) -> Iterator[Variant]:
    lag = truth.lagrangian
    n = truth.description.n
    rates = element_array([lag.arm.ring.rate(i) for i in range(n)])
    if n > 1:
        yield Variant(MadeAt("coriolis_transposed"), changed_only(lag, "h", lambda: lag.C.T @ rates - lag.h))
    for i, j in combinations(range(n), 2):
        place = f"joints {i + 1} and {j + 1}"
        yield Variant(MadeAt("centrifugal_index"), _rates_exchanged(lag, i, j), place)
        yield Variant(MadeAt("equations_exchanged"), _equations_exchanged(lag, i, j), place, 2)


def _motor_torques(truth: Truth) -> Make:
    """Return the change if torques are the motors' although the angles are absolute."""
    lag = truth.lagrangian

    def make(quantity: str) -> Elements:
        value = right_value(lag, quantity)
        return truth.coordinates.S.T @ value - value if value.ndim == 1 else value * 0

    return make


def _equations_exchanged(lag: Lagrangian, i: int, j: int) -> Make:
    def make(quantity: str) -> Elements:
        value = right_value(lag, quantity)
        if not value.ndim:
            return nothing(lag, quantity)
        order = list(range(lag.n))
        order[i], order[j] = j, i
        return value[order] - value

    return make


def _rates_exchanged(lag: Lagrangian, i: int, j: int) -> Make:
    """Return the change if the squares of two rates are exchanged in h."""
    ring = lag.arm.ring
    a, b = ring.place("rate", i), ring.place("rate", j)

    def exchange(torque: Element) -> Element:
        terms: dict[tuple[int, ...], Fraction] = {}
        for monomial, coefficient in torque.terms.items():
            powers = list(monomial)
            if max(powers[a], powers[b]) == 2:
                powers[a], powers[b] = powers[b], powers[a]
            terms[tuple(powers)] = terms.get(tuple(powers), Fraction(0)) + coefficient
        return ring.from_terms(terms)

    return changed_only(lag, "h", lambda: element_array([exchange(x) for x in lag.h]) - lag.h)


# Coordinates


def _other_coordinates(truth: Truth) -> Iterator[Variant]:
    """Yield answers in relative angles that were declared absolute, and the other way round."""
    arm = truth.lagrangian.arm
    absolute = Coordinates.absolute(arm)
    if absolute.is_relative:
        return
    if truth.coordinates.is_relative:
        yield Variant(MadeAt("absolute_for_relative"), partial(_declared, truth, absolute, absolute.B), rarity=1)
    else:
        relative = Coordinates.relative(arm.n)
        yield Variant(MadeAt("relative_for_absolute"), partial(_declared, truth, relative, absolute.S), rarity=1)


def _declared(truth: Truth, meant: Coordinates, matrix: Elements, quantity: str) -> Elements:
    """Return the change if an answer in other coordinates is read in the declared ones.

    The answer is right in the coordinates ``meant``; its variables are read as ``matrix`` times the robot's.
    """
    lag = truth.lagrangian
    ring = lag.arm.ring
    n = lag.n
    answer = element_array(meant.in_y(quantity, right_value(lag, quantity)))
    places: dict[int, Element] = {}
    for i in range(n):
        for kind, generator in (("rate", ring.rate), ("acceleration", ring.acceleration)):
            places[ring.place(kind, i)] = ring.sum(generator(j) * int(matrix[i, j]) for j in range(n) if matrix[i, j])
        if i in ring.angles:
            multiples = [multiple_angle(ring, j, int(matrix[i, j])) for j in range(n) if matrix[i, j]]
            c, s = sum_of_angles(ring, multiples)
            places |= {ring.place("cosine", i): c, ring.place("sine", i): s}
    wrong = translated_array(answer, places)
    change = element_array(wrong - element_array(truth.coordinates.in_y(quantity, right_value(lag, quantity))))
    return _in_robot_variables(truth.coordinates, quantity, change)


def _in_robot_variables(coordinates: Coordinates, quantity: str, change: Elements) -> Elements:
    """Return a change in the declared coordinates in the robot's own."""
    if coordinates.is_relative or quantity not in DYNAMICS:
        return change
    if quantity in ("M", "C"):
        return coordinates.S.T @ change @ coordinates.S
    return coordinates.S.T @ change if change.ndim == 1 else change


def _zero_poses(truth: Truth) -> Iterator[Variant]:
    """Yield zero poses that are a quarter turn off."""
    lag = truth.lagrangian
    for i in lag.arm.ring.angles:
        for identity, sign in (("zero_shifted", 1), ("zero_shifted_back", -1)):
            yield Variant(MadeAt(identity, i + 1), _shifted(lag, i, sign), f"joint {i + 1}", 1)


def _shifted(lag: Lagrangian, i: int, sign: int) -> Make:
    ring = lag.arm.ring
    turned = {ring.place("cosine", i): ring.sine(i) * -sign, ring.place("sine", i): ring.cosine(i) * sign}
    return lambda quantity: translated_array(right_value(lag, quantity), turned) - right_value(lag, quantity)


# Friction


def _friction(truth: Truth) -> Iterator[Variant]:
    lag = truth.lagrangian
    arm = lag.arm
    yield Variant(MadeAt("friction_forgotten"), changed_only(lag, "tau", lambda: truth.viscous * -1))
    yield Variant(MadeAt("friction_sign"), changed_only(lag, "tau", lambda: truth.viscous * -2))
    for power in (0, 1):
        torques = element_array([arm.gear[i] ** power * arm.viscous[i] * arm.ring.rate(i) for i in range(arm.n)])
        change = partial(np.subtract, torques, truth.viscous)
        yield Variant(MadeAt("friction_gear"), changed_only(lag, "tau", change))
