"""Random states at which answers outside the exact ring are compared with the truth, in many digits."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from dhkit.expressions import Expression
from dhkit.expressions.exact import Atom
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.symbolic import ExactArm
from dhkit.symbolic.ring import Element

if TYPE_CHECKING:
    from mpmath import mpf

_Key = TypeVar("_Key")
DIGITS = 50
"""Number of decimal digits of the arithmetic."""
TOLERANCE = 1e-25
"""Largest relative difference of two numbers that count as equal: half of the digits may be lost."""
MIN_SIZE = 1e-3
"""Smallest size to which differences are relative, in the quantity's SI unit."""
_NEAR_SIZES = {"q": 3.0, "qd": 2.0, "qdd": 2.0}
"""Largest joint values, rates and accelerations of states within one turn, in rad or m and their derivatives by s."""


@dataclass(frozen=True)
class Sample:
    """A random state and random parameters.

    Attributes
    ----------
    names
        Values by name: q1, qd1, qdd1, parameters; SI units and rad.
    generators
        Values of the ring's generators, in their order.
    """

    names: Mapping[str, Any]
    generators: Sequence[Any]


def samples(
    arm: ExactArm, numbers: frozenset[str], seed: int, every: int = 1, count: int = BOUNDS.states
) -> Iterator[Sample]:
    """Yield random states: a third within one turn, the others at scales from 1e-3 to 1e3 rad, m and their rates.

    Parameters
    ----------
    arm
        The robot.
    numbers
        Parameters that keep the file's values. The others are the file's times factors between 1/4 and 4, whose
        logarithms are spread evenly: of S sets of parameters, each S-th of the range contains one.
    seed
        Seed of the random numbers. It must not be known to the writer of an answer: an answer that is wrong only far
        from the tried states would pass.
    every
        Number of consecutive states that share parameters.
    count
        Number of states.
    """
    import mpmath

    rng = np.random.default_rng(seed)
    sets = math.ceil(count / every)
    factors: dict[str, Any] = {}
    for name in arm.parameters:
        # Stratified samples of [0, 1): one in each interval of length 1 / sets, in random order.
        shares = (rng.permutation(sets) + rng.uniform(size=sets)) / sets
        factors[name] = 4.0 ** (2 * shares - 1)

    parameters: dict[str, Any] = {
        name: mpmath.mpf(value) for name, value in arm.description.numbers.values.items()
    }
    for k in range(count):
        if k % every == 0:
            for name, value in arm.parameters.items():
                parameters[name] = mpmath.mpf(
                    value if name in numbers else value * factors[name][k // every]
                )
        names = dict(parameters)
        # In turn: within one turn, at one scale that all joints share, at scales of their own.
        common = 10.0 ** rng.uniform(-3.0, 3.0)
        for i in range(arm.n):
            for kind, near in _NEAR_SIZES.items():
                own = 10.0 ** rng.uniform(-3.0, 3.0)
                size = (near, common, own)[k % 3]
                names[f"{kind}{i + 1}"] = mpmath.mpf(rng.uniform(-size, size))
        yield Sample(names, _generators(arm, names))


def element_value(element: Element, sample: Sample) -> mpf:
    """Return the value of an element at a sample, in mpmath's working precision."""
    terms = ((enumerate(monomial), coefficient) for monomial, coefficient in element.terms.items())
    return _sum_of_products(terms, sample.generators.__getitem__)


def _sum_of_products(
    terms: Iterable[tuple[Iterable[tuple[_Key, int]], Fraction]], value: Callable[[_Key], Any]
) -> mpf:
    """Return the sum over terms of coefficient c times powers: sum of c x_1^e_1 x_2^e_2 ..."""
    import mpmath

    total = mpmath.mpf(0)
    for powers, coefficient in terms:
        product = mpmath.mpf(coefficient.numerator) / coefficient.denominator
        for key, exponent in powers:
            if exponent:
                product *= value(key) ** exponent
        total += product
    return total


def _generators(arm: ExactArm, names: Mapping[str, Any]) -> list[Any]:
    """Return the values of the ring's generators, given those of names."""
    import mpmath

    def atom_value(atom: Atom) -> Any:
        if atom.name == "pi":
            return +mpmath.pi
        if atom.is_symbol:
            return names[atom.name]
        arguments = [expression_value(argument) for argument in atom.arguments]
        if atom.name == "group":
            return arguments[0]
        function: Callable[..., Any] = abs if atom.name == "abs" else getattr(mpmath, atom.name)
        return function(*arguments)

    def expression_value(expression: Expression) -> Any:
        return _sum_of_products(expression.terms, atom_value)

    values: list[Any] = []
    for generator in arm.ring.generators:
        if generator.kind in ("sine", "cosine"):
            angle = sum(names[f"q{joint + 1}"] for joint in generator.joints)
            values.append(mpmath.sin(angle) if generator.kind == "sine" else mpmath.cos(angle))
        elif generator.kind == "constant" and generator.meaning is not None:
            values.append(expression_value(generator.meaning))
        else:
            values.append(names[generator.text])
    return values


def differ(answer: mpf, truth: mpf) -> bool:
    """Whether two numbers of mpmath differ by more than the tolerance."""
    size = max(abs(answer), abs(truth), MIN_SIZE)
    return bool(abs(answer - truth) > TOLERANCE * size)
