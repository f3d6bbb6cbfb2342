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
from dhkit.grading.mistakes.variants import Addition, Variant, changed_only, nothing
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
    if truth.friction:
        yield from _friction(truth)


def lagrangian_sum(truth: Truth) -> Variant:
    """Return the mistake L = K + V with the torques from it, which is likelier than a sign of gravity."""
    lag = truth.lagrangian

    def adds(quantity: str) -> Elements:
        # K + V instead of K - V: L gets 2 V, and tau, with g = dV/dq, gets -2 g.
        if quantity == "L":
            return element_array(2 * lag.V)
        if quantity == "tau":
            return -2 * lag.g
        return nothing(lag, quantity)

    return Variant(MadeAt("lagrangian_sum"), adds)


def _signs(truth: Truth) -> Iterator[Variant]:
    """Yield mistakes with whole parts of the equation: a wrong sign, or a missing part."""
    lag = truth.lagrangian
    yield Variant(MadeAt("velocity_torques_sign"), changed_only(lag, "h", lambda: -2 * lag.h))
    yield Variant(MadeAt("velocity_torques_missing"), changed_only(lag, "h", lambda: -lag.h))
    yield Variant(MadeAt("gravity_torques_missing"), changed_only(lag, "tau", lambda: -lag.g))
    yield Variant(MadeAt("gravity_torque_sign"), changed_only(lag, "tau", lambda: -2 * lag.g))
    yield Variant(
        MadeAt("inertial_torques_missing"),
        changed_only(lag, "tau", lambda: lag.h + lag.g - lag.tau),
        rarity=1,
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
    yield Variant(
        MadeAt("rate_of_cosine_sign"), changed_only(lag, "h", lambda: _mass_rate(lag, momenta) * -2)
    )
    yield Variant(
        MadeAt("chain_rule_forgotten"),
        changed_only(lag, "h", lambda: _without_chain_rule(lag, momenta)),
    )


def _mass_rate(lag: Lagrangian, momenta: Elements) -> Elements:
    """Return dM/dt qd, for the momenta p = M qd: sum over k of dp/dq_k qd_k."""
    ring = lag.arm.ring
    rates = []
    for p in momenta:
        rate_of_p = ring.sum(p.by_position(k) * ring.rate(k) for k in range(ring.n))
        rates.append(rate_of_p)
    return element_array(rates)


def _without_chain_rule(lag: Lagrangian, momenta: Elements) -> Elements:
    """Return the change of h if d/dt of cos(q) is taken for -sin(q), without the rate of q."""
    ring = lag.arm.ring
    without_rates = []
    for p in momenta:
        gradient_sum = ring.sum(p.by_position(k) for k in range(ring.n))
        without_rates.append(gradient_sum)
    return element_array(without_rates) - _mass_rate(lag, momenta)


def _velocity_change(truth: Truth, momenta: Elements, name: str) -> Addition:
    """Return the change of h by a mistake in a step of Euler and Lagrange's equation."""
    lag = truth.lagrangian
    wrong = partial(velocity_torques, lag.arm.ring, lag.K, momenta, frozenset({MadeAt(name)}))
    if name not in VELOCITY_FACTORS or truth.coordinates.is_relative:
        return changed_only(lag, "h", lambda: wrong() - lag.h)
    return changed_only(lag, "h", lambda: _scaled_in_y(truth, *VELOCITY_FACTORS[name]))


def _scaled_in_y(truth: Truth, squares: bool, factor: Fraction) -> Elements:
    """Return the change of the robot's h if products of the student's own rates have another factor.

    The torques of y are written in its rates by qd = B yd, get the factor there, and are written in qd by yd = S qd.
    """
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
    """Yield gravity torques that follow from right heights, but with the joints' own angles instead of their sums."""
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
            change = partial(_height_change, lag, _shifted(lag, i, sign))
            yield Variant(MadeAt("height_sin_cos", i + 1), change, f"q{i + 1}")


def _height_change(lag: Lagrangian, shifted: Addition, quantity: str) -> Elements:
    """Return the change of a quantity if an angle is shifted in the potential energy alone."""
    match quantity:
        case "V" | "g":
            return shifted(quantity)
        case "L":
            return shifted("V") * -1
        case "tau":
            return shifted("g")
    return nothing(lag, quantity)


# Mistakes with right matrices


def _matrices(truth: Truth) -> Iterator[Variant]:
    """Yield mistakes in the order of entries: of C transposed, of rates, of equations."""
    lag = truth.lagrangian
    n = truth.description.n
    rates = element_array([lag.arm.ring.rate(i) for i in range(n)])
    if n > 1:
        yield Variant(
            MadeAt("coriolis_transposed"), changed_only(lag, "h", lambda: lag.C.T @ rates - lag.h)
        )
    for i, j in combinations(range(n), 2):
        place = f"joints {i + 1} and {j + 1}"
        yield Variant(MadeAt("centrifugal_index"), _rates_exchanged(lag, i, j), place)
        yield Variant(MadeAt("equations_exchanged"), _equations_exchanged(lag, i, j), place, 2)


def _motor_torques(truth: Truth) -> Addition:
    """Return the change if torques are the motors' although the angles are absolute."""
    lag = truth.lagrangian

    def adds(quantity: str) -> Elements:
        value = right_value(lag, quantity)
        return truth.coordinates.S.T @ value - value if value.ndim == 1 else value * 0

    return adds


def _equations_exchanged(lag: Lagrangian, i: int, j: int) -> Addition:
    """Return the change if the equations of joints i and j, from 0, are exchanged."""

    def adds(quantity: str) -> Elements:
        value = right_value(lag, quantity)
        if not value.ndim:
            return nothing(lag, quantity)
        order = list(range(lag.n))
        order[i] = j
        order[j] = i
        return value[order] - value

    return adds


def _rates_exchanged(lag: Lagrangian, i: int, j: int) -> Addition:
    """Return the change if the squares of two rates are exchanged in h."""
    ring = lag.arm.ring
    rate_i = ring.place("rate", i)
    rate_j = ring.place("rate", j)

    def exchange(torque: Element) -> Element:
        terms: dict[tuple[int, ...], Fraction] = {}
        for monomial, coefficient in torque.terms.items():
            exponents = list(monomial)
            if max(exponents[rate_i], exponents[rate_j]) == 2:
                exponents[rate_i], exponents[rate_j] = exponents[rate_j], exponents[rate_i]
            term = tuple(exponents)
            terms[term] = terms.get(term, Fraction(0)) + coefficient
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
        yield Variant(
            MadeAt("absolute_for_relative"),
            partial(_declared, truth, absolute, absolute.B),
            rarity=1,
        )
    else:
        relative = Coordinates.relative(arm.n)
        yield Variant(
            MadeAt("relative_for_absolute"),
            partial(_declared, truth, relative, absolute.S),
            rarity=1,
        )


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
        # Variable i is read as the sum over j of (matrix_ij times the robot's variable j).
        weights = {j: int(matrix[i, j]) for j in range(n) if matrix[i, j]}
        for kind, generator in (("rate", ring.rate), ("acceleration", ring.acceleration)):
            places[ring.place(kind, i)] = ring.sum(
                generator(j) * weight for j, weight in weights.items()
            )
        if i in ring.angles:
            cosine, sine = sum_of_angles(
                ring, [multiple_angle(ring, j, weight) for j, weight in weights.items()]
            )
            places[ring.place("cosine", i)] = cosine
            places[ring.place("sine", i)] = sine
    wrong = translated_array(answer, places)
    right = element_array(truth.coordinates.in_y(quantity, right_value(lag, quantity)))
    return _in_robot_variables(truth.coordinates, quantity, element_array(wrong - right))


def _in_robot_variables(coordinates: Coordinates, quantity: str, change: Elements) -> Elements:
    """Return a change in the declared coordinates y = S q in the robot's own: S^T M S, S^T tau."""
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


def _shifted(lag: Lagrangian, i: int, sign: int) -> Addition:
    """Return the change if an angle q is shifted by a quarter turn.

    With the sign e: cos(q + e pi/2) = -e sin(q), sin(q + e pi/2) = e cos(q).
    """
    ring = lag.arm.ring
    turned = {
        ring.place("cosine", i): ring.sine(i) * -sign,
        ring.place("sine", i): ring.cosine(i) * sign,
    }
    return lambda quantity: (
        translated_array(right_value(lag, quantity), turned) - right_value(lag, quantity)
    )


# Friction


def _friction(truth: Truth) -> Iterator[Variant]:
    """Yield mistakes with the viscous friction of the drives, r^2 B qd for gear ratios r."""
    lag = truth.lagrangian
    arm = lag.arm
    yield Variant(
        MadeAt("friction_forgotten"), changed_only(lag, "tau", lambda: truth.viscous * -1)
    )
    yield Variant(MadeAt("friction_sign"), changed_only(lag, "tau", lambda: truth.viscous * -2))

    # B qd or r B qd instead.
    for power in (0, 1):
        torques = element_array(
            [arm.gear[i] ** power * arm.viscous[i] * arm.ring.rate(i) for i in range(arm.n)]
        )
        change = partial(np.subtract, torques, truth.viscous)
        yield Variant(MadeAt("friction_gear"), changed_only(lag, "tau", change))
