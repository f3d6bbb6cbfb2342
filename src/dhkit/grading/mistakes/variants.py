"""What each mistake of the library changes in a robot's equations: differences from the truth, made when asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from itertools import combinations, permutations

import numpy as np

from dhkit.grading.judging.coordinates import Coordinates
from dhkit.grading.judging.truth import Truth, kinematic_quantity
from dhkit.grading.mistakes.library import PARAMETER_MISTAKES, of_links
from dhkit.symbolic import Lagrangian
from dhkit.symbolic.mistakes import LINK_MISTAKES, ROTOR_MISTAKES, STEP_FACTORS, VELOCITY_FACTORS
from dhkit.symbolic.ring import Element, Elements, Ring, element_array, translated
from dhkit.symbolic.textbook import TextbookDerivation, derive, scaled, velocity_torques
from dhkit.symbolic.textbook_kinematics import KINEMATIC_MISTAKES, TextbookKinematics, derive_kinematics
from dhkit.symbolic.textbook_kinematics import LINK_MISTAKES as LINK_KINEMATICS

__all__ = ["Change", "Variant", "kinematic_variants", "variants"]


@dataclass(frozen=True, eq=False)
class Change:
    """What a mistake adds to energies, from which what it adds to all else follows: equations are linear in them."""

    K: Element
    V: Element

    def of(self, quantity: str, n: int) -> Elements:
        """Return what it adds to M, h, g, tau, K, V or L."""
        ring = self.K.ring
        momenta = element_array([self.K.by_rate(i) for i in range(n)])
        match quantity:
            case "M":
                return np.array([[p.by_rate(j) for j in range(n)] for p in momenta], dtype=object).reshape(n, n)
            case "h":
                return velocity_torques(ring, self.K, momenta)
            case "g":
                return element_array([self.V.by_position(i) for i in range(n)])
            case "tau":
                return _torques(ring, self.of("M", n), self.of("h", n), self.of("g", n))
        return element_array({"K": self.K, "V": self.V}.get(quantity, self.K - self.V))


@dataclass(frozen=True, eq=False)
class Variant:
    """A mistake on a robot.

    Attributes
    ----------
    name
        Of :data:`dhkit.grading.mistakes.library.LIBRARY`; a link follows behind ``@``.
    where
        Which link or which parameters, in words; empty where it is made throughout.
    make
        Returns what the mistake adds to a quantity in the robot's own joint variables.
    """

    name: str
    where: str
    make: Callable[[str], Elements]
    _made: dict[tuple[str, Coordinates], Elements] = field(default_factory=dict, repr=False)

    def adds_to(self, quantity: str, coordinates: Coordinates) -> Elements:
        """Return what the mistake adds to a quantity; C counts by C qd."""
        key = (quantity, coordinates)
        if key not in self._made:
            self._made[key] = element_array(coordinates.in_y(quantity, self.make(quantity)))
        return self._made[key]


def variants(truth: Truth) -> list[Variant]:
    """Return the mistakes that there are on a robot, those of the whole derivation before those of one link."""
    return [
        *_whole_variants(truth),
        *_zero_variants(truth),
        *_energy_variants(truth),
        *_step_variants(truth),
        *_torque_variants(truth),
        *_matrix_variants(truth),
        *_parameter_variants(truth),
        *(_friction_variants(truth) if truth.friction else ()),
    ]


def kinematic_variants(truth: Truth) -> list[Variant]:
    """Return the mistakes that there are in a robot's transforms and Jacobian."""
    n = truth.description.n
    named = [(name, "") for name in KINEMATIC_MISTAKES]
    if n > 1:
        named += [(f"{name}@{i}", f"link {i}") for name in LINK_KINEMATICS for i in range(1, n + 1)]
    return [Variant(name, where, _kinematic_change(truth, name)) for name, where in named]


def _kinematic_change(truth: Truth, name: str) -> Callable[[str], Elements]:
    made: list[TextbookKinematics] = []

    def make(quantity: str) -> Elements:
        if not made:
            made.append(derive_kinematics(truth.description, {name}))
        return kinematic_quantity(made[0], quantity) - kinematic_quantity(truth.kinematics, quantity)

    return make


def _whole_variants(truth: Truth) -> Iterator[Variant]:
    """Yield what is wrong with whole quantities: their sign, or whose torques they are."""
    lag = truth.lagrangian
    yield Variant("lagrangian_sum", "", _lagrangian_sum(lag))
    yield Variant("velocity_torques_sign", "", _only(lag, "h", lambda: -2 * lag.h))
    if not truth.coordinates.is_relative:
        yield Variant("motor_torques", "", _motor_torques(truth))


def _lagrangian_sum(lag: Lagrangian) -> Callable[[str], Elements]:
    return lambda quantity: element_array(2 * lag.V) if quantity == "L" else _nothing(lag, quantity)


# Energies


def _energy_variants(truth: Truth) -> Iterator[Variant]:
    """Yield the mistakes that change links' energies, and the rotors'."""
    description, n = truth.description, truth.description.n
    right = derive(description)
    names = [name for name in of_links() if name in LINK_MISTAKES | ROTOR_MISTAKES]
    for name in names:
        yield Variant(name, "", _change_of(right, name, n))
    for name in names:
        if n > 1:
            for i in range(1, n + 1):
                yield Variant(f"{name}@{i}", f"link {i}", _change_of(right, f"{name}@{i}", n))


def _change_of(right: TextbookDerivation, name: str, n: int) -> Callable[[str], Elements]:
    made: list[Change] = []

    def make(quantity: str) -> Elements:
        if not made:
            wrong = derive(right.arm.description, {name}, right.arm.symbols)
            made.append(Change(wrong.K - right.K, wrong.V - right.V))
        return made[0].of(quantity, n)

    return make


# Steps of Euler and Lagrange's equation


def _step_variants(truth: Truth) -> Iterator[Variant]:
    """Yield the mistakes that change h or g alone."""
    lag, n = truth.lagrangian, truth.description.n
    momenta = element_array([lag.K.by_rate(i) for i in range(n)])
    for name in of_links():
        if name in STEP_FACTORS or name in VELOCITY_FACTORS:
            yield Variant(name, "", _velocity_change(truth, momenta, name))
    yield Variant("potential_gradient_sign", "", _only(lag, "g", lambda: -2 * lag.g))


def _velocity_change(truth: Truth, momenta: Elements, name: str) -> Callable[[str], Elements]:
    lag = truth.lagrangian
    wrong = partial(velocity_torques, lag.arm.ring, lag.K, momenta, frozenset({name}))
    if name not in VELOCITY_FACTORS or truth.coordinates.is_relative:
        return _only(lag, "h", lambda: wrong() - lag.h)
    return _only(lag, "h", lambda: _scaled_in_y(truth, *VELOCITY_FACTORS[name]))


def _scaled_in_y(truth: Truth, squares: bool, factor: Fraction) -> Elements:
    """Return what changes, in the robot's torques, where products of the student's own rates have another factor."""
    ring, coordinates, n = truth.lagrangian.arm.ring, truth.coordinates, truth.description.n
    rates = element_array([ring.rate(i) for i in range(n)])
    in_y = {ring.place("rate", i): rate for i, rate in enumerate(coordinates.B @ rates)}
    back = {ring.place("rate", i): rate for i, rate in enumerate(coordinates.S @ rates)}
    torques = _translated(truth.of("h"), in_y)
    changed = element_array([scaled(torque, squares, factor) for torque in torques])
    return coordinates.S.T @ (_translated(changed, back) - truth.of("h"))  # type: ignore[no-any-return]


def _only(lag: Lagrangian, changed: str, change: Callable[[], Elements]) -> Callable[[str], Elements]:
    """Return what adds to one vector of torques, and to their sum."""

    def make(quantity: str) -> Elements:
        return change() if quantity in (changed, "tau") else _nothing(lag, quantity)

    return make


def _torque_variants(truth: Truth) -> Iterator[Variant]:
    """Yield gravity torques whose heights are right, and whose angles are then the joints' own."""
    right = derive(truth.description)
    for i in range(1, truth.description.n):
        if truth.description.kinds[i] == "R":
            name = f"gravity_torque_relative_angle@{i + 1}"
            yield Variant(name, f"link {i + 1}", _only(truth.lagrangian, "g", partial(_own_angle_change, right, i)))


def _own_angle_change(right: TextbookDerivation, i: int) -> Elements:
    """Return what changes where the torques of link i, from its joint on, do not see the joints before it turn."""
    arm, link = right.arm, right.links[i]
    ring = arm.ring
    joint = right.links[i - 1].origin if arm.is_standard else link.origin
    height = -arm.bodies[i].mass * (arm.gravity @ (link.com - joint))
    torques = element_array([height.by_position(j) for j in range(ring.n)])
    still: dict[int, Element] = {}
    for j in range(i):
        if j in ring.angles:
            still |= {ring.place("cosine", j): ring.one, ring.place("sine", j): ring.zero}
    return _translated(torques, still) - torques


# Zero positions


def _zero_variants(truth: Truth) -> Iterator[Variant]:
    """Yield zero poses that are a quarter turn off, and sines and cosines exchanged."""
    lag = truth.lagrangian
    for i in lag.arm.ring.angles:
        for name, sign in (("zero_shifted", 1), ("zero_shifted_back", -1)):
            yield Variant(f"{name}@{i + 1}", f"joint {i + 1}", _shifted(lag, i, sign))


def _shifted(lag: Lagrangian, i: int, sign: int) -> Callable[[str], Elements]:
    ring = lag.arm.ring
    turned = {ring.place("cosine", i): ring.sine(i) * -sign, ring.place("sine", i): ring.cosine(i) * sign}
    return lambda quantity: _translated(_right(lag, quantity), turned) - _right(lag, quantity)


# What is done with matrices that are right


def _matrix_variants(truth: Truth) -> Iterator[Variant]:
    lag, n = truth.lagrangian, truth.description.n
    rates = element_array([lag.arm.ring.rate(i) for i in range(n)])
    if n > 1:
        yield Variant("coriolis_transposed", "", _only(lag, "h", lambda: lag.C.T @ rates - lag.h))
    for i, j in combinations(range(n), 2):
        where = f"joints {i + 1} and {j + 1}"
        yield Variant("equations_exchanged", where, _equations_exchanged(lag, i, j))
        yield Variant("centrifugal_index", where, _rates_exchanged(lag, i, j))


def _motor_torques(truth: Truth) -> Callable[[str], Elements]:
    """Return what changes where torques stay the motors' though the angles are absolute."""
    lag = truth.lagrangian

    def make(quantity: str) -> Elements:
        right = _right(lag, quantity)
        return truth.coordinates.S.T @ right - right if right.ndim == 1 else right * 0

    return make


def _equations_exchanged(lag: Lagrangian, i: int, j: int) -> Callable[[str], Elements]:
    def make(quantity: str) -> Elements:
        right = _right(lag, quantity)
        if not right.ndim:
            return _nothing(lag, quantity)
        order = list(range(lag.n))
        order[i], order[j] = j, i
        return right[order] - right

    return make


def _rates_exchanged(lag: Lagrangian, i: int, j: int) -> Callable[[str], Elements]:
    """Exchange the squares of two rates in h."""
    ring = lag.arm.ring
    a, b = ring.place("rate", i), ring.place("rate", j)

    def exchanged(torque: Element) -> Element:
        terms: dict[tuple[int, ...], Fraction] = {}
        for monomial, coefficient in torque.terms.items():
            powers = list(monomial)
            if max(powers[a], powers[b]) == 2:
                powers[a], powers[b] = powers[b], powers[a]
            terms[tuple(powers)] = terms.get(tuple(powers), Fraction(0)) + coefficient
        return ring.from_terms(terms)

    return _only(lag, "h", lambda: element_array([exchanged(x) for x in lag.h]) - lag.h)


# Parameters


def _parameter_variants(truth: Truth) -> Iterator[Variant]:
    """Yield parameters forgotten, doubled, halved, taken for another, and those of two links exchanged."""
    lag = truth.lagrangian
    ring = lag.arm.ring
    symbols = [name for name in lag.arm.parameters if ring.constants.count(name) and _is_free(ring, name)]
    for name in symbols:
        x = ring.constant(name)
        for mistake, factor in PARAMETER_MISTAKES.items():
            yield Variant(mistake, name, _replaced(lag, {name: x * factor}))
    for first, second in permutations(symbols, 2):
        if _letters(first) == _letters(second):
            yield Variant(
                "parameter_for_another", f"{second} for {first}", _replaced(lag, {first: ring.constant(second)})
            )
    for first, second in combinations(symbols, 2):
        if _letters(first) == _letters(second):
            swapped = {first: ring.constant(second), second: ring.constant(first)}
            yield Variant("parameters_exchanged", f"{first} and {second}", _replaced(lag, swapped))
    for i, j in combinations(range(1, truth.description.n + 1), 2):
        pairs = [(x, y) for x in symbols for y in symbols if _swaps(x, y, i, j)]
        if len(pairs) > 1:
            swapped = {a: ring.constant(b) for x, y in pairs for a, b in ((x, y), (y, x))}
            yield Variant("links_exchanged", f"links {i} and {j}", _replaced(lag, swapped))


def _swaps(first: str, second: str, i: int, j: int) -> bool:
    letters = _letters(first)
    return bool(letters) and first == f"{letters}{i}" and second == f"{letters}{j}"


def _letters(name: str) -> str:
    return name.rstrip("0123456789")


def _is_free(ring: Ring, name: str) -> bool:
    """Whether no other constant is written in a parameter, so that another may stand in its place."""
    return not any(name in constant.symbols and constant.text != name for constant in ring.given)


def _replaced(lag: Lagrangian, values: Mapping[str, Element]) -> Callable[[str], Elements]:
    ring = lag.arm.ring
    places = {ring.place("constant", name): value for name, value in values.items()}
    return lambda quantity: _translated(_right(lag, quantity), places) - _right(lag, quantity)


# Friction


def _friction_variants(truth: Truth) -> Iterator[Variant]:
    lag = truth.lagrangian
    yield Variant("friction_forgotten", "", _only(lag, "tau", lambda: truth.viscous * -1))
    yield Variant("friction_sign", "", _only(lag, "tau", lambda: truth.viscous * -2))


# Arrays of elements


def _right(lag: Lagrangian, quantity: str) -> Elements:
    return element_array(lag.K - lag.V) if quantity == "L" else element_array(getattr(lag, quantity))


def _nothing(lag: Lagrangian, quantity: str) -> Elements:
    return _right(lag, quantity) * 0


def _translated(array: Elements, places: Mapping[int, Element]) -> Elements:
    result = np.empty(array.shape, dtype=object)
    for place, element in np.ndenumerate(array):
        result[place] = translated(element, element.ring, places)
    return result


def _torques(ring: Ring, M: Elements, h: Elements, g: Elements) -> Elements:
    return M @ element_array([ring.acceleration(i) for i in range(ring.n)]) + h + g
