"""Equations as functions of a programming language, apart from its syntax: locals, then entry by entry.

Parameters are members of one record, ``p.m2``, which no name of the language or of its library can clash with.
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
from dhkit.symbolic.equations.quantities import Quantity
from dhkit.symbolic.equations.writing import Printer, is_name
from dhkit.symbolic.exact.lagrangian import Lagrangian
from dhkit.symbolic.kinematics import SymbolicKinematics
from dhkit.symbolic.ring import Element, Generator
from dhkit.symbolic.ring.notation import angles_of, constants_of, generators_of, symbols_of

INPUTS = {"M": "q", "C": "q qd", "h": "q qd", "g": "q", "tau": "q qd qdd", "K": "q qd", "V": "q"}
"""What each quantity is a function of; those of kinematics of q alone."""
STATES = {"position": "q", "rate": "qd", "acceleration": "qdd"}
WORDS = """
    auto break case char const continue default do double else enum extern float for goto if inline int long
    register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    bool true false nullptr constexpr typeof alignas alignof thread_local static_assert asm linux unix i386
    NAN INFINITY HUGE_VAL HUGE_VALF HUGE_VALL MATH_ERRNO MATH_ERREXCEPT math_errhandling
    end function elseif otherwise catch global parfor persistent spmd try classdef endfunction endif endfor
    endwhile end_try_catch unwind_protect until
"""
RESERVED = frozenset(WORDS.split()) | frozenset(keyword.kwlist)
"""Words that C, Python, MATLAB or Octave keep for themselves, even as a member's name."""
LONGEST = 48
"""Letters of an identifier: MATLAB reads 63, of which the quantity's name takes some."""
CHUNK = 40
"""Terms of one statement: compilers nest long sums as deep as they are long."""
WIDTH = 112


@dataclass(frozen=True)
class Language:
    """How a programming language writes what its expressions are made of.

    Attributes
    ----------
    item
        An array's entry, from its name and a number from 0: ``{array}[{k}]``.
    offset
        The number of the first entry.
    pi
        The number pi.
    functions
        Names of functions that it calls otherwise.
    """

    item: str
    offset: int
    pi: str
    functions: Mapping[str, str]


@dataclass(frozen=True)
class Parameter:
    """A number that may be changed: its name in code, its own name and its value, SI."""

    identifier: str
    name: str
    value: float


@dataclass(frozen=True)
class Entry:
    """Parts whose sum is an entry, and where it goes: places from 0, two for mirrored entries of the mass matrix."""

    places: tuple[tuple[int, ...], ...]
    parts: tuple[str, ...]


@dataclass(frozen=True)
class Function:
    """A quantity as a function.

    Attributes
    ----------
    quantity
        What it computes.
    inputs
        Its arguments.
    used
        Those that it reads.
    locals
        Names with the expressions that they stand for, and perhaps a remark.
    entries
        Those that are not zero.
    """

    quantity: Quantity
    inputs: tuple[str, ...]
    used: frozenset[str]
    locals: tuple[tuple[str, str, str], ...]
    entries: tuple[Entry, ...]

    @property
    def title(self) -> str:
        """What it computes, in words."""
        return self.quantity.title


@dataclass(frozen=True)
class Program:
    """Functions, and the parameters that they share.

    Attributes
    ----------
    robot
        The robot's name, harmless in any comment.
    identifier
        The robot's name as an identifier.
    n
        The number of joints.
    parameters, functions
        See their classes.
    notes
        What is written otherwise than in the robot's file.
    """

    robot: str
    identifier: str
    n: int
    parameters: tuple[Parameter, ...]
    functions: tuple[Function, ...]
    notes: tuple[str, ...]

    @property
    def subject(self) -> str:
        """What the functions are, in words."""
        moving = any(function.quantity.name in INPUTS for function in self.functions)
        return "Equations of motion" if moving else "Kinematics"


def program(lag: Lagrangian | SymbolicKinematics, quantities: Sequence[Quantity], language: Language) -> Program:
    """Return quantities as functions in a language."""
    elements = [element for quantity in quantities for element in quantity.elements.flat]
    values = dict(lag.description.numbers.values) | lag.arm.parameters
    constants = constants_of(generators_of(elements))
    order = {name: k for k, name in enumerate([*lag.description.parameters, *lag.arm.parameters])}
    names = sorted(symbols_of(constants), key=lambda name: (order.get(name, len(order)), name))
    identifiers = _identifiers(names)
    code = _Code(language, identifiers)
    return Program(
        harmless(lag.description.name),
        identifier(lag.description.name),
        lag.n,
        tuple(Parameter(identifiers[name], harmless(name), float(values.get(name, math.nan))) for name in names),
        tuple(code.function(quantity) for quantity in quantities),
        tuple(f"{harmless(name)} is {own}" for name, own in identifiers.items() if name != own),
    )


def harmless(text: str) -> str:
    """Return text that ends no comment and no string: ASCII letters, digits and a few signs."""
    return re.sub(r"[^A-Za-z0-9 _.,:=()+^-]", "?", text)


def identifier(name: str) -> str:
    """Return a name as an identifier of ASCII letters, digits and underscores that begins with a letter."""
    cleaned = re.sub(r"\W", "_", name, flags=re.ASCII)[:LONGEST]
    return cleaned if re.match(r"[A-Za-z]", cleaned) else f"x{cleaned}"


def wrapped(text: str, first: str, following: str, ending: str = "") -> str:
    """Break a long expression in front of plus and minus signs.

    Parameters
    ----------
    text
        The expression.
    first
        What stands before it.
    following
        What later lines begin with.
    ending
        What all lines but the last end with.
    """
    lines, line = [], first
    for piece in re.split(r"(?= [+-] )", text):
        if len(line) + len(piece) > WIDTH and line != first:
            lines.append(line + ending)
            line = following + piece.lstrip()
        else:
            line += piece
    return "\n".join([*lines, line])


class _Code:
    """Writes expressions, and remembers nothing between functions."""

    def __init__(self, language: Language, identifiers: Mapping[str, str]) -> None:
        self.language = language
        self.identifiers = identifiers

    # A writer, see Writer

    def symbol(self, name: str) -> str:
        return f"p.{self.identifiers[name]}"

    def variable(self, generator: Generator) -> str:
        return generator.text

    def pi(self) -> str:
        return self.language.pi

    def call(self, function: str, arguments: Sequence[str]) -> str:
        return f"{self.language.functions.get(function, function)}({', '.join(arguments)})"

    def power(self, base: str, exponent: int) -> str:
        return "*".join([base] * exponent)

    def brackets(self, inner: str) -> str:
        return f"({inner})"

    def product(self, coefficient: Fraction, above: Sequence[str], below: Sequence[str]) -> str:
        number = repr(float(coefficient))
        factors = [number, *above] if coefficient != 1 or not above else above
        return "*".join(factors) + "".join(f"/({x})" if "*" in x else f"/{x}" for x in below)

    def total(self, terms: Sequence[tuple[bool, str]]) -> str:
        signed = "".join(f" {'-' if negative else '+'} {term}" for negative, term in terms)
        return f"-{signed[3:]}" if signed.startswith(" - ") else signed[3:]

    # Functions

    def function(self, quantity: Quantity) -> Function:
        """Return a quantity as a function."""
        generators = generators_of(quantity.elements.flat)
        derived = [g for g in constants_of(generators) if not is_name(g) and not is_reciprocal(g)]
        short = {g.text: f"k{k}" for k, g in enumerate(derived, start=1)}
        listed = [(short[g.text], self._meaning(g), harmless(g.text)) for g in derived]
        states = sorted(
            (g for g in generators if g.kind in STATES), key=lambda g: (list(STATES).index(g.kind), g.joint)
        )
        listed += [(g.text, self._item(STATES[g.kind], g.joint), "") for g in states]
        for angle in angles_of(generators):
            total = " + ".join(self._item("q", joint) for joint in angle.joints)
            listed.append((angle.name, f"{angle.function}({total})", ""))
        entries = tuple(
            Entry(places, tuple(self._parts(element, short))) for places, element in _upper(quantity) if element
        )
        used = {STATES[g.kind] for g in states} | ({"q"} if angles_of(generators) else set())
        return Function(
            quantity,
            tuple(INPUTS.get(quantity.name, "q").split()),
            frozenset(used),
            tuple(listed),
            entries,
        )

    def _parts(self, element: Element, short: Mapping[str, str]) -> Iterator[str]:
        printer = Printer(element.ring.generators, self, lambda generator: short[generator.text])
        products = [piece for product in collected(element) for piece in _split(product)]
        for k in range(0, len(products), CHUNK):
            yield printer.sum(products[k : k + CHUNK])

    def _meaning(self, generator: Generator) -> str:
        assert generator.meaning is not None  # noqa: S101 - derived constants have one
        return Printer((), self).expression(generator.meaning)

    def _item(self, array: str, k: int) -> str:
        return self.language.item.format(array=array, k=k + self.language.offset)


def _split(product: Product) -> Iterator[Product]:
    """Split a product whose brackets hold a very long sum."""
    if len(product.factor) <= CHUNK * 4:
        yield product
        return
    for k in range(0, len(product.factor), CHUNK):
        yield replace(product, factor=product.factor[k : k + CHUNK])


def _upper(quantity: Quantity) -> Iterator[tuple[tuple[tuple[int, ...], ...], Element]]:
    for place, element in np.ndenumerate(quantity.elements):
        if not quantity.is_symmetric or place[0] == place[1]:
            yield (place,), element
        elif place[0] < place[1]:
            yield (place, place[::-1]), element


def _identifiers(names: Iterable[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for name in names:
        own = identifier(name)
        while own in RESERVED or own in found.values():
            own += "_"
        found[name] = own
    return found
