"""Answers that the exact ring does not have, held against the truth at many random states in many digits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dhkit.expressions import Expression
from dhkit.expressions.exact import Atom
from dhkit.symbolic import ExactArm
from dhkit.symbolic.ring import Element

if TYPE_CHECKING:
    from mpmath import mpf

SAMPLES = 1_000
DIGITS = 50
TOLERANCE, LEAST = 1e-25, 1e-3
"""By what share two numbers may differ that are taken for one, and the least that it is a share of."""
NEAR_SIZES = {"q": 3.0, "qd": 2.0, "qdd": 2.0}
"""Sizes of the states that are tried within one turn; rad or m, and seconds."""


@dataclass(frozen=True)
class Sample:
    """A random state and random parameters.

    Attributes
    ----------
    names
        Values by name: q1, qd1, qdd1, parameters.
    generators
        Values of the ring's generators, in their order.
    """

    names: Mapping[str, Any]
    generators: Sequence[Any]


def samples(arm: ExactArm, numbers: frozenset[str], seed: int, every: int = 1, count: int = SAMPLES) -> list[Sample]:
    """Return random states: a third within one turn, the others at scales from 1e-3 to 1e3 rad, m and their rates.

    Parameters
    ----------
    arm
        The robot.
    numbers
        Parameters that keep the file's values; others come within a factor of four of them, spread evenly over its
        logarithm: of S sets of parameters, each S-th of the range has one.
    seed
        Of the random numbers. It must not be known to who writes answers: one that is wrong only far from the states
        that are tried would pass.
    every
        After how many states parameters change.
    count
        How many.
    """
    import mpmath

    rng = np.random.default_rng(seed)
    found = []
    sets = -(-count // every)
    factors = dict[str, Any]()
    for name in arm.parameters:
        shares = (rng.permutation(sets) + rng.uniform(size=sets)) / sets
        factors[name] = 4.0 ** (2 * shares - 1)
    parameters: dict[str, Any] = {name: mpmath.mpf(value) for name, value in arm.description.numbers.values.items()}
    for k in range(count):
        if k % every == 0:
            for name, value in arm.parameters.items():
                parameters[name] = mpmath.mpf(value if name in numbers else value * factors[name][k // every])
        names = dict(parameters)
        common = 10.0 ** rng.uniform(-3.0, 3.0)
        for i in range(arm.n):
            for kind, near in NEAR_SIZES.items():
                size = (near, common, 10.0 ** rng.uniform(-3.0, 3.0))[k % 3]
                names[f"{kind}{i + 1}"] = mpmath.mpf(rng.uniform(-size, size))
        found.append(Sample(names, _generators(arm, names)))
    return found


def element_value(element: Element, sample: Sample) -> mpf:
    """Return the number that an element is, in the digits that are set."""
    import mpmath

    total = mpmath.mpf(0)
    for monomial, coefficient in element.terms.items():
        product = mpmath.mpf(coefficient.numerator) / coefficient.denominator
        for k, exponent in enumerate(monomial):
            if exponent:
                product *= sample.generators[k] ** exponent
        total += product
    return total


def _generators(arm: ExactArm, names: Mapping[str, Any]) -> list[Any]:
    import mpmath

    values: list[Any] = []
    for generator in arm.ring.generators:
        if generator.kind in ("sine", "cosine"):
            angle = sum(names[f"q{joint + 1}"] for joint in generator.joints)
            values.append(mpmath.sin(angle) if generator.kind == "sine" else mpmath.cos(angle))
        elif generator.kind == "constant":
            values.append(names[generator.text] if generator.meaning is None else _value(generator.meaning, names))
        else:
            values.append(names[generator.text])
    return values


def _value(expression: Expression, names: Mapping[str, Any]) -> Any:
    import mpmath

    total = mpmath.mpf(0)
    for monomial, coefficient in expression.terms:
        product = mpmath.mpf(coefficient.numerator) / coefficient.denominator
        for atom, exponent in monomial:
            product *= _atom(atom, names) ** exponent
        total += product
    return total


def _atom(atom: Atom, names: Mapping[str, Any]) -> Any:
    import mpmath

    if atom.name == "pi":
        return +mpmath.pi
    if atom.is_symbol:
        return names[atom.name]
    arguments = [_value(argument, names) for argument in atom.arguments]
    if atom.name == "group":
        return arguments[0]
    function: Callable[..., Any] = abs if atom.name == "abs" else getattr(mpmath, atom.name)
    return function(*arguments)


def differ(answer: Any, truth: Any) -> bool:
    """Whether two numbers in many digits are not the same."""
    size = max(abs(answer), abs(truth), LEAST)
    return bool(abs(answer - truth) > TOLERANCE * size)


def show_state(sample: Sample, names: set[str]) -> dict[str, float]:
    """Return those of a sample's values that are named, as doubles."""
    return {name: float(value) for name, value in sample.names.items() if name in names}
