"""Mistakes with parameters: forgotten, doubled, halved, taken for another, exchanged, or in other units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from itertools import combinations, permutations

from dhkit.description import INERTIA_PLACES, Description
from dhkit.expressions import Expression
from dhkit.grading.catalogue import PARAMETER_FACTORS, UNITS
from dhkit.grading.judging.truth import Truth, right_value, translated_array
from dhkit.grading.mistakes.bounds import BOUNDS
from dhkit.grading.mistakes.variants import Addition, Variant
from dhkit.symbolic.mistakes import MadeAt
from dhkit.symbolic.ring import Element, Elements


def parameter_variants(truth: Truth) -> Iterator[Variant]:
    """Yield mistakes with the file's parameters."""
    lag = truth.lagrangian
    ring = lag.arm.ring
    symbols = [name for name in lag.arm.parameters if name in ring.constants]
    kinds = _kinds(truth.description)
    yield from _factors(truth, symbols, kinds)
    yield from _tilts(truth)
    yield from _units(truth, [name for name in symbols if kinds.get(name) == "length"])

    alike = [pair for pair in combinations(symbols, 2) if _are_alike(*pair, kinds)]
    for first, second in alike:
        swapped = {first: ring.constant(second), second: ring.constant(first)}
        place = f"{first} and {second}"
        yield Variant(MadeAt("parameters_exchanged"), _replaced(truth, swapped), place, 1)
    for first, second in permutations(symbols, 2):
        if (first, second) not in alike and (second, first) not in alike:
            continue
        made = MadeAt("parameter_for_another")
        other = ring.constant(second)
        yield Variant(made, _replaced(truth, {first: other}), f"{second} for {first}", 1)
        if kinds.get(first) == "length" and lag.n <= BOUNDS.half_length_joints:
            half = other * Fraction(1, 2)
            yield Variant(made, _replaced(truth, {first: half}), f"{second}/2 for {first}", 1)
            yield Variant(made, _replaced(truth, {first: other * 2}), f"2*{second} for {first}", 2)
    for i, j in combinations(range(1, truth.description.n + 1), 2):
        # l1 and l2, m1 and m2 ... of links 1 and 2.
        pairs = [(x, y) for x, y in permutations(symbols, 2) if _are_of_links(x, y, i, j)]
        if len(pairs) > 1:
            swapped = {}
            for x, y in pairs:
                swapped[x] = ring.constant(y)
                swapped[y] = ring.constant(x)
            yield Variant(
                MadeAt("links_exchanged"), _replaced(truth, swapped), f"links {i} and {j}", 1
            )


def _factors(truth: Truth, symbols: list[str], kinds: Mapping[str, str]) -> Iterator[Variant]:
    """Yield mistakes by which a parameter has another factor: it is forgotten, doubled, halved, has another sign."""
    ring = truth.lagrangian.arm.ring
    for identity, factor in PARAMETER_FACTORS.items():
        for name in symbols:
            # A length has the wrong sign where an offset is on the other side; a mass or an inertia has none.
            rarity = 1 if factor > 0 or kinds.get(name) == "length" else 2
            yield Variant(
                MadeAt(identity),
                _replaced(truth, {name: ring.constant(name) * factor}),
                name,
                rarity,
            )


def _units(truth: Truth, lengths: list[str]) -> Iterator[Variant]:
    """Yield mistakes by which all lengths, or one of them, are in another unit."""
    ring = truth.lagrangian.arm.ring
    groups = [lengths] if len(lengths) > 1 else []
    groups += [[name] for name in lengths]
    for identity, factor in UNITS.items():
        for names in groups:
            values = {name: ring.constant(name) * factor for name in names}
            place = names[0] if len(names) == 1 else ""
            yield Variant(MadeAt(identity), _replaced(truth, values), place, 2)


def _tilts(truth: Truth) -> Iterator[Variant]:
    """Yield mistakes with constant angles: forgotten, wrong sign, sine and cosine exchanged."""
    ring = truth.lagrangian.arm.ring
    for cosine in ring.constants:
        sine = f"sin{cosine[3:]}"
        if not cosine.startswith("cos(") or sine not in ring.constants:
            continue
        c = ring.constant(cosine)
        s = ring.constant(sine)
        place = cosine[4:-1]
        for identity, values in (
            ("parameter_forgotten", {cosine: ring.one, sine: ring.zero}),
            ("parameter_sign", {sine: -s}),
            ("parameter_sin_cos", {cosine: s, sine: c}),
        ):
            yield Variant(MadeAt(identity), _replaced(truth, values), place, 1)


def lengths_of(description: Description) -> list[str]:
    """Return the parameters that are lengths."""
    return [name for name, kind in _kinds(description).items() if kind == "length"]


def _kinds(description: Description) -> dict[str, str]:
    """Return the kind of each parameter (length, mass, inertia, gear ...), by its first use in the file."""
    kinds: dict[str, str] = {}

    def note(kind: str, *expressions: Expression) -> None:
        for expression in expressions:
            for name in expression.symbols:
                kinds.setdefault(name, kind)

    for joint in description.joints:
        note("mass", *(body.mass for body in joint.bodies))
        if joint.drive is not None:
            note("gear", joint.drive.gear)
            note("rotor", joint.drive.rotor_inertia)
            note("friction", joint.drive.viscous)
        note("length", joint.a, joint.d)
    note("rotor", *(coupling.inertia for coupling in description.couplings))
    note("length", *description.tool.placement.xyz)
    for joint in description.joints:
        for body in joint.bodies:
            note("length", *body.com)
    for joint in description.joints:
        for body in joint.bodies:
            note("inertia", *(getattr(body.inertia, key) for key in INERTIA_PLACES))
    return kinds


def _are_alike(first: str, second: str, kinds: Mapping[str, str]) -> bool:
    """Whether two parameters may be confused: they are of the same kind, or have the same letters."""
    return kinds.get(first, first) == kinds.get(second, second) or _letters(first) == _letters(
        second
    )


def _are_of_links(first: str, second: str, i: int, j: int) -> bool:
    """Whether two parameters are the same one of links i and j, from 1: l1 and l2."""
    letters = _letters(first)
    return bool(letters) and first == f"{letters}{i}" and second == f"{letters}{j}"


def _letters(name: str) -> str:
    """Return a name without the number at its end."""
    return name.rstrip("0123456789")


def _replaced(truth: Truth, values: Mapping[str, Element]) -> Addition:
    """Return the change if parameters are replaced; zero for quantities with constants that are made of them."""
    ring = truth.lagrangian.arm.ring
    places = {ring.place("constant", name): value for name, value in values.items()}

    # Constants such as sin(alpha) that contain a replaced parameter.
    dependent = [
        ring.place("constant", constant.text)
        for constant in ring.given
        if constant.text not in values and not constant.symbols.isdisjoint(values)
    ]

    def adds(quantity: str) -> Elements:
        whole = right_value(truth.lagrangian, quantity)
        if quantity == "tau" and truth.friction:
            whole = whole + truth.viscous
        if dependent and any(element.contains_any(dependent) for element in whole.flat):
            return whole * 0
        return translated_array(whole, places) - whole

    return adds
