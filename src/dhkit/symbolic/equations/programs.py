"""Equations as functions with local variables and one sum for each entry, before a language's printer writes them.

Parameters are members of one record, ``p.m2``: no name of a language or its library can clash with them.
"""

from __future__ import annotations

import keyword
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from dhkit.symbolic.equations.collected import Product, collected, is_reciprocal
from dhkit.symbolic.equations.quantities import Quantity, elements_of
from dhkit.symbolic.equations.writing import Printer, is_name
from dhkit.symbolic.exact.lagrangian import Lagrangian
from dhkit.symbolic.kinematics import SymbolicKinematics
from dhkit.symbolic.languages.statements import Let, Store
from dhkit.symbolic.languages.syntax import Syntax
from dhkit.symbolic.ring import Element, Generator
from dhkit.symbolic.ring.notation import angles_of, constants_of, generators_of, symbols_of

INPUTS = {"M": "q", "C": "q qd", "h": "q qd", "g": "q", "tau": "q qd qdd", "K": "q qd", "V": "q"}
"""Arguments of each quantity; quantities of kinematics depend on q alone."""
_STATES = {"position": "q", "rate": "qd", "acceleration": "qdd"}
"""Argument that holds each kind of generator, in the order in which they are read."""
_RESERVED_WORDS = """
    auto break case char const continue default do double else enum extern float for goto if inline int long
    register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    bool true false nullptr constexpr typeof alignas alignof thread_local static_assert asm linux unix i386
    NAN INFINITY HUGE_VAL HUGE_VALF HUGE_VALL MATH_ERRNO MATH_ERREXCEPT math_errhandling
    end function elseif otherwise catch global parfor persistent spmd try classdef endfunction endif endfor
    endwhile end_try_catch unwind_protect until
"""
RESERVED = frozenset(_RESERVED_WORDS.split()) | frozenset(keyword.kwlist)
"""Words that C, Python, MATLAB or Octave reserve, as names of members too."""
_MAX_IDENTIFIER_LENGTH = 48
"""Longest identifier: MATLAB reads 63 letters, of which the quantity's name takes some."""
_MAX_TERMS = 40
"""Largest number of terms of one statement: compilers recurse once for each term of a sum."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of the generated code: identifier, name in the robot file, and value, SI."""

    identifier: str
    name: str
    value: float


@dataclass(frozen=True)
class Function:
    """A quantity as a function.

    Attributes
    ----------
    quantity
        The quantity that it computes.
    inputs
        Its arguments.
    used
        The arguments that its expressions contain.
    locals
        Local variables.
    entries
        The entries that are not zero; mirrored entries of the mass matrix are stored together.
    """

    quantity: Quantity
    inputs: tuple[str, ...]
    used: frozenset[str]
    locals: tuple[Let, ...]
    entries: tuple[Store, ...]

    @property
    def title(self) -> str:
        """The quantity in words."""
        return self.quantity.title


@dataclass(frozen=True)
class FunctionSet:
    """Functions, and the parameters that they share.

    Attributes
    ----------
    robot
        The robot's name, safe in comments of any language.
    identifier
        The robot's name as an identifier.
    n
        The number of joints.
    parameters
        The parameters, in the order of the robot file.
    functions
        The functions.
    notes
        One sentence for each name that differs from the robot file's.
    """

    robot: str
    identifier: str
    n: int
    parameters: tuple[Parameter, ...]
    functions: tuple[Function, ...]
    notes: tuple[str, ...]

    @property
    def subject(self) -> str:
        """The functions together, in words."""
        moving = any(function.quantity.name in INPUTS for function in self.functions)
        return "Equations of motion" if moving else "Kinematics"


def function_set(
    source: Lagrangian | SymbolicKinematics, quantities: Sequence[Quantity], language: Syntax
) -> FunctionSet:
    """Return quantities as functions in a language."""
    # The parameters that occur, in the order of the robot file.
    constants = constants_of(generators_of(elements_of(quantities)))
    order = {
        name: k for k, name in enumerate([*source.description.parameters, *source.arm.parameters])
    }
    names = sorted(symbols_of(constants), key=lambda name: (order.get(name, len(order)), name))
    identifiers = _identifiers(names)
    values = dict(source.description.numbers.values) | source.arm.parameters
    parameters = [
        Parameter(identifiers[x], harmless(x), float(values.get(x, math.nan))) for x in names
    ]

    code = _Code(language, identifiers)
    return FunctionSet(
        robot=harmless(source.description.name),
        identifier=identifier(source.description.name),
        n=source.n,
        parameters=tuple(parameters),
        functions=tuple(code.function(quantity) for quantity in quantities),
        notes=tuple(
            f"{harmless(name)} is {own}" for name, own in identifiers.items() if name != own
        ),
    )


def harmless(text: str) -> str:
    """Return text with ASCII letters, digits and a few signs only, which cannot end a comment or a string."""
    return re.sub(r"[^A-Za-z0-9 _.,:=()+^-]", "?", text)


def identifier(name: str) -> str:
    """Return a name as an identifier of ASCII letters, digits and underscores that begins with a letter."""
    cleaned = re.sub(r"\W", "_", name, flags=re.ASCII)[:_MAX_IDENTIFIER_LENGTH]
    return cleaned if re.match(r"[A-Za-z]", cleaned) else f"x{cleaned}"


class _Code:
    """Writes expressions in a language's syntax; see :class:`dhkit.symbolic.equations.writing.Writer`."""

    def __init__(self, language: Syntax, identifiers: Mapping[str, str]) -> None:
        self.language = language
        self.identifiers = identifiers

    def symbol(self, name: str) -> str:
        return f"p.{self.identifiers[name]}"

    def variable(self, generator: Generator) -> str:
        return generator.text

    def pi(self) -> str:
        return self.language.pi

    def call(self, function: str, arguments: Sequence[str]) -> str:
        return self.language.call(function, arguments)

    def power(self, base: str, exponent: int) -> str:
        return "*".join([base] * exponent)

    def brackets(self, inner: str) -> str:
        return f"({inner})"

    def product(
        self, coefficient: Fraction, numerator: Sequence[str], denominator: Sequence[str]
    ) -> str:
        factors = list(numerator)
        if coefficient != 1 or not numerator:
            factors.insert(0, repr(float(coefficient)))
        divisors = [f"/({x})" if "*" in x else f"/{x}" for x in denominator]
        return "*".join(factors) + "".join(divisors)

    def total(self, terms: Sequence[tuple[bool, str]]) -> str:
        signed = "".join(f" {'-' if negative else '+'} {term}" for negative, term in terms)
        return f"-{signed[3:]}" if signed.startswith(" - ") else signed[3:]

    # Functions

    def function(self, quantity: Quantity) -> Function:
        """Return a quantity as a function."""
        generators = generators_of(quantity.elements.flat)
        used: set[str] = set()

        # Local variables: functions of parameters (k1, k2 ...), then the state, then sines and cosines.
        derived = [g for g in constants_of(generators) if not is_name(g) and not is_reciprocal(g)]
        short = {g.text: f"k{k}" for k, g in enumerate(derived, start=1)}
        variables = [Let(short[g.text], self._meaning(g), harmless(g.text)) for g in derived]

        kinds = list(_STATES)
        states = [g for g in generators if g.kind in _STATES]
        for g in sorted(states, key=lambda g: (kinds.index(g.kind), g.joint)):
            argument = _STATES[g.kind]
            variables.append(Let(g.text, self.language.entry(argument, g.joint)))
            used.add(argument)

        for angle in angles_of(generators):
            total = " + ".join(self.language.entry("q", joint) for joint in angle.joints)
            variables.append(Let(angle.name, f"{angle.function}({total})"))
            used.add("q")

        entries = []
        for places, element in _upper(quantity):
            if element:
                entries.append(Store(quantity.name, places, tuple(self._parts(element, short))))
        return Function(
            quantity=quantity,
            inputs=tuple(INPUTS.get(quantity.name, "q").split()),
            used=frozenset(used),
            locals=tuple(variables),
            entries=tuple(entries),
        )

    def _parts(self, element: Element, short: Mapping[str, str]) -> Iterator[str]:
        """Yield expressions whose sum is an element; ``short`` names the functions of parameters."""
        printer = Printer(element.ring.generators, self, lambda generator: short[generator.text])
        products: list[Product] = []
        for product in collected(element):
            products += _split(product)
        for k in range(0, len(products), _MAX_TERMS):
            yield printer.sum(products[k : k + _MAX_TERMS])

    def _meaning(self, generator: Generator) -> str:
        """Return the expression of a function of parameters."""
        assert generator.meaning is not None  # noqa: S101 - derived constants have one
        return Printer((), self).expression(generator.meaning)


def _split(product: Product) -> Iterator[Product]:
    """Split a product with a very long sum in brackets into several products."""
    if len(product.factor) <= _MAX_TERMS * 4:
        yield product
        return
    for k in range(0, len(product.factor), _MAX_TERMS):
        yield replace(product, factor=product.factor[k : k + _MAX_TERMS])


def _upper(quantity: Quantity) -> Iterator[tuple[tuple[tuple[int, ...], ...], Element]]:
    """Yield the entries, each with its places: two for those of a symmetric matrix off the diagonal."""
    for place, element in np.ndenumerate(quantity.elements):
        if not quantity.is_symmetric or place[0] == place[1]:
            yield (place,), element
        elif place[0] < place[1]:
            yield (place, place[::-1]), element


def _identifiers(names: Iterable[str]) -> dict[str, str]:
    """Return distinct identifiers for names."""
    found: dict[str, str] = {}
    for name in names:
        own = identifier(name)
        while own in RESERVED or own in found.values():
            own += "_"
        found[name] = own
    return found
