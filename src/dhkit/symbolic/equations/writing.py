"""The traversal of collected equations and of constants' expressions that all output formats share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import Generic, Protocol, TypeVar

from dhkit.expressions import Atom, Expression
from dhkit.expressions.exact import MAX_FRACTION_PART
from dhkit.expressions.syntax import decimal_text
from dhkit.symbolic.equations.collected import Powers, Product, is_reciprocal
from dhkit.symbolic.ring import Generator

T = TypeVar("T")


class Writer(Protocol[T]):
    """Writes the parts of an equation in one output format."""

    def symbol(self, name: str) -> T:
        """Return a constant by its name."""

    def variable(self, generator: Generator) -> T:
        """Return a joint's value, rate or acceleration, or a sine or cosine."""

    def pi(self) -> T:
        """Return the number pi."""

    def call(self, function: str, arguments: Sequence[T]) -> T:
        """Return a function of :data:`dhkit.expressions.FUNCTIONS`."""

    def power(self, base: T, exponent: int) -> T:
        """Return a power of a symbol, a variable, a call or brackets; the exponent is 2 or more."""

    def brackets(self, inner: T) -> T:
        """Return a sum as a factor."""

    def product(self, coefficient: Fraction, numerator: Sequence[T], denominator: Sequence[T]) -> T:
        """Return a positive number times the numerator's factors, divided by the denominator's."""

    def total(self, terms: Sequence[tuple[bool, T]]) -> T:
        """Return the sum of terms, each with whether it is subtracted."""


class Printer(Generic[T]):
    """Writes collected sums of one ring in an output format.

    Parameters
    ----------
    generators
        The ring's generators.
    writer
        The output format.
    constant
        Writes a constant that is neither a name nor a reciprocal; its whole expression if not given.
    """

    def __init__(
        self,
        generators: Sequence[Generator],
        writer: Writer[T],
        constant: Callable[[Generator], T] | None = None,
    ) -> None:
        self.writer = writer
        self._constant = constant or (lambda generator: self._atom_like(generator))
        self._is_reciprocal = [is_reciprocal(generator) for generator in generators]
        self._generators = generators
        self._written: dict[int, T] = {}

    def sum(self, products: Iterable[Product]) -> T:
        """Return a sum."""
        terms = [(product.coefficient < 0, self.product(product)) for product in products]
        return self._total(terms)

    def product(self, product: Product) -> T:
        """Return a product without its sign."""
        writer = self.writer
        numerator = self._powers(product.powers, reciprocals=False)
        if product.factor:
            numerator.append(writer.brackets(self.sum(product.factor)))
        if len(product.motion) > 1:
            numerator.append(writer.brackets(self.sum(product.motion)))
        elif product.motion:
            numerator += self._powers(product.motion[0].powers, reciprocals=False)
        return writer.product(
            abs(product.coefficient), numerator, self._powers(product.powers, reciprocals=True)
        )

    def expression(self, expression: Expression) -> T:
        """Return an expression of constants."""
        writer = self.writer
        terms = []
        for monomial, coefficient in expression.terms:
            numerator = [self._power(self.atom(atom), e) for atom, e in monomial if e > 0]
            denominator = [self._power(self.atom(atom), -e) for atom, e in monomial if e < 0]
            terms.append(
                (coefficient < 0, writer.product(abs(coefficient), numerator, denominator))
            )
        return self._total(terms)

    def _total(self, terms: Sequence[tuple[bool, T]]) -> T:
        """Return a sum of terms, each with whether it is subtracted; 0 without terms."""
        if not terms:
            zero = self.writer.product(Fraction(0), [], [])
            terms = [(False, zero)]
        return self.writer.total(terms)

    def atom(self, atom: Atom) -> T:
        """Return a name, pi or a function."""
        if atom.name == "group":
            return self.writer.brackets(self.expression(atom.arguments[0]))
        if atom.arguments:
            return self.writer.call(
                atom.name, [self.expression(argument) for argument in atom.arguments]
            )
        return self.writer.pi() if atom.name == "pi" else self.writer.symbol(atom.name)

    def _powers(self, powers: Powers, *, reciprocals: bool) -> list[T]:
        """Return the factors that are reciprocals, as their denominators, or those that are not."""
        return [
            self._power(self._generator(k), e)
            for k, e in powers
            if self._is_reciprocal[k] == reciprocals
        ]

    def _power(self, base: T, exponent: int) -> T:
        return base if exponent == 1 else self.writer.power(base, exponent)

    def _generator(self, place: int) -> T:
        """Return a generator; a reciprocal's denominator instead of the reciprocal."""
        if place not in self._written:
            generator = self._generators[place]
            if generator.kind != "constant":
                self._written[place] = self.writer.variable(generator)
            elif self._is_reciprocal[place] or is_name(generator):
                self._written[place] = self._atom_like(generator)
            else:
                self._written[place] = self._constant(generator)
        return self._written[place]

    def _atom_like(self, generator: Generator) -> T:
        """Return a constant as a factor: a name, a single function or name without its power, or a sum in brackets."""
        meaning = generator.meaning
        if meaning is None or is_name(generator):
            return self.writer.symbol(generator.text)
        if len(meaning.terms) == 1:
            ((monomial, coefficient),) = meaning.terms
            if len(monomial) == 1 and coefficient == 1:
                ((atom, _),) = monomial
                return self.atom(atom)
        return self.writer.brackets(self.expression(meaning))


def readable_decimal(value: Fraction) -> str | None:
    """Return a rational as an exact decimal; None for a short fraction, or if the decimal does not end."""
    is_short_fraction = max(value.numerator, value.denominator) <= MAX_FRACTION_PART
    return None if is_short_fraction else decimal_text(value)


def is_name(generator: Generator) -> bool:
    """Return whether a constant is written as its name."""
    return generator.meaning is None or generator.meaning.text in generator.meaning.symbols
