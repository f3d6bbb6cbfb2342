"""Elementary functions of exact values: resolved at multiples of 15 degrees and perfect squares, atoms otherwise."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import cache

from dhkit.errors import ExpressionError
from dhkit.expressions.exact import PI, STEPS_IN_PI, ZERO, Atom, Expression
from dhkit.expressions.numbers import exact, exact_angle

_NEGLIGIBLE = 1e-40
"""Values of functions below this are replaced by 0: no length makes them count, and their decimals would be long."""
_SETTLED_DIGITS = 30
"""Digits kept of a coefficient that products of decimals have made longer; a double has 17."""
_LARGEST_FACTORED = 10**6
"""Square roots of numbers up to this are split into those of primes: sqrt(6) is sqrt(2)*sqrt(3)."""


def sqrt(x: Expression) -> Expression:
    """Return the square root; that of a perfect square is rational.

    Parameters
    ----------
    x
        Exact value.

    Returns
    -------
    Expression
        The root, not negative; exact.

    Raises
    ------
    ExpressionError
        A negative number.

    Examples
    --------
    >>> from dhkit.expressions import exact
    >>> print(sqrt(exact(4)).text, sqrt(exact(2)).text)
    2 sqrt(2)
    """
    number = x.rational
    if number is None:
        return Expression.of_atom(Atom("sqrt", (x,)))
    if number < 0:
        raise ExpressionError(f"sqrt({x.text}) is not real")
    inside = number.numerator * number.denominator
    root = math.isqrt(inside)
    if root * root == inside:
        return Expression.number(Fraction(root, number.denominator))
    if inside > _LARGEST_FACTORED:
        return Expression.of_atom(Atom("sqrt", (x,)))
    result = Expression.number(Fraction(1, number.denominator))
    for prime, power in _prime_factors(inside):
        atom = Expression.of_atom(Atom("sqrt", (Expression.number(prime),)))
        result = result * prime ** (power // 2) * (atom if power % 2 else 1)
    return result


def sin(x: Expression) -> Expression:
    """Return the sine of an angle in radians.

    Parameters
    ----------
    x
        Exact value.

    Returns
    -------
    Expression
        Exact for multiples of 15 degrees, else an atom of exact arithmetic.

    Examples
    --------
    >>> from dhkit.expressions import parse
    >>> print(sin(parse("pi/4", {})).text)
    sqrt(2)/2
    """
    steps = _steps(x)
    if steps is not None:
        return _sine_of_steps(steps)
    if (direction := _direction(x)) is not None:
        return direction[1]
    return -sin(-x) if _leads_negative(x) else Expression.of_atom(Atom("sin", (x,)))


def cos(x: Expression) -> Expression:
    """Return the cosine of an angle in radians.

    Parameters
    ----------
    x
        Exact value.

    Returns
    -------
    Expression
        Exact for multiples of 15 degrees, else an atom of exact arithmetic.

    Examples
    --------
    >>> from dhkit.expressions import parse
    >>> print(cos(parse("pi/3", {})).text)
    0.5
    """
    steps = _steps(x)
    if steps is not None:
        return _sine_of_steps(steps + STEPS_IN_PI // 2)
    if (direction := _direction(x)) is not None:
        return direction[0]
    return cos(-x) if _leads_negative(x) else Expression.of_atom(Atom("cos", (x,)))


def tan(x: Expression) -> Expression:
    """Return the tangent of an angle in radians."""
    steps = _steps(x)
    if steps is None:
        return Expression.of_atom(Atom("tan", (x,)))
    if steps % STEPS_IN_PI == 0:
        return ZERO
    # By the half angle the denominator is one term, so that tan(15 deg) becomes 2 - sqrt(3).
    if steps % (STEPS_IN_PI // 2) == 0:
        raise ExpressionError(f"tan({x.text}) is not finite")
    return (1 - cos(x * 2)) / sin(x * 2)


def arc_tangent(y: Expression, x: Expression) -> Expression:
    """Return atan2(y, x); exact if it is a multiple of 15 degrees of two numbers.

    Parameters
    ----------
    y, x
        Exact values, in proportion to sine and cosine.

    Returns
    -------
    Expression
        rad, in (-pi, pi].

    Examples
    --------
    >>> from dhkit.expressions import exact
    >>> print(arc_tangent(exact(1), exact(-1)).text)
    3*pi/4
    """
    if y.symbols or x.symbols:
        return Expression.of_atom(Atom("atan2", (y, x)))
    angle = math.atan2(float(y), float(x))
    steps = round(angle * STEPS_IN_PI / math.pi)
    # At that angle y cos = x sin holds exactly, and the point lies on its side of the origin.
    if (y * _sine_of_steps(steps + STEPS_IN_PI // 2) - x * _sine_of_steps(steps)).is_zero:
        return PI * Fraction(steps, STEPS_IN_PI)
    return Expression.of_atom(Atom("atan2", (y, x)))


def absolute(x: Expression) -> Expression:
    """Return the absolute value, resolved where x is a number."""
    if x.symbols:
        return Expression.of_atom(Atom("abs", (x,)))
    return -x if float(x) < 0 else x


def _arc_sine(x: Expression) -> Expression:
    return _inverse("asin", x, math.asin, _sine_of_steps)


def _arc_cosine(x: Expression) -> Expression:
    return _inverse("acos", x, math.acos, lambda steps: _sine_of_steps(steps + STEPS_IN_PI // 2))


def _arc_tangent_of_one(x: Expression) -> Expression:
    angle = arc_tangent(x, Expression.number(1))
    return angle if angle.half_turns is not None else Expression.of_atom(Atom("atan", (x,)))


FUNCTIONS: Mapping[str, tuple[int, Callable[..., Expression]]] = {
    "sin": (1, sin),
    "cos": (1, cos),
    "tan": (1, tan),
    "asin": (1, _arc_sine),
    "acos": (1, _arc_cosine),
    "atan": (1, _arc_tangent_of_one),
    "atan2": (2, arc_tangent),
    "sqrt": (1, sqrt),
    "abs": (1, absolute),
}
"""The functions that text may use, by name: number of arguments, and function. No others are ever called."""


def call(function: str, *arguments: Expression) -> Expression:
    """Apply a function of :data:`FUNCTIONS`.

    Parameters
    ----------
    function
        Name, one of :data:`FUNCTIONS`.
    *arguments
        Exact values, as many as the function takes.

    Returns
    -------
    Expression
        The function's value, exact where it is rational or a root.

    Raises
    ------
    ExpressionError
        No such function, another number of arguments, or a value outside its domain.

    Examples
    --------
    >>> from dhkit.expressions import exact
    >>> print(call("sqrt", exact(4)).text)
    2
    """
    if function not in FUNCTIONS:
        raise ExpressionError(
            f"unknown function {function!r}; expected one of {', '.join(FUNCTIONS)}"
        )
    count, meaning = FUNCTIONS[function]
    if len(arguments) != count:
        raise ExpressionError(
            f"{function} takes {count} argument{'s' * (count > 1)}, found {len(arguments)}"
        )
    return meaning(*arguments)


def substitute(expression: Expression, values: Mapping[str, Expression]) -> Expression:
    """Return the expression with parameters replaced by their values; parameters without value stay.

    Parameters
    ----------
    expression
        Expression.
    values
        Values by name.

    Returns
    -------
    Expression
        The value.

    Examples
    --------
    >>> from dhkit.expressions import exact, parse
    >>> print(substitute(parse("l1 + l2", {"l1", "l2"}), {"l1": exact(0.5)}).text)
    l2 + 0.5
    """
    if values.keys().isdisjoint(expression.symbols):
        return expression
    total = ZERO
    for monomial, coefficient in expression.terms:
        product = Expression.number(coefficient)
        for atom, exponent in monomial:
            product = product * _replaced(atom, values) ** exponent
        total = total + product
    return total


def _replaced(atom: Atom, values: Mapping[str, Expression]) -> Expression:
    if atom.is_symbol:
        return values.get(atom.name, Expression.of_atom(atom))
    arguments = [substitute(argument, values) for argument in atom.arguments]
    if atom.name == "group":
        return arguments[0]
    return call(atom.name, *arguments) if arguments else Expression.of_atom(atom)


def _decimal(atom: Atom) -> Expression:
    value = float(atom.value())
    return exact(value) if abs(value) > _NEGLIGIBLE else ZERO


def decimals(expression: Expression) -> Expression:
    """Return an expression with functions of numbers as decimals: 0.7648421872844885 for cos(0.7); roots stay.

    Parameters
    ----------
    expression
        Exact value.

    Returns
    -------
    Expression
        The expression in which ``cos(0.7)`` and the like are decimals.

    Examples
    --------
    >>> from dhkit.expressions import parse
    >>> print(decimals(parse("l1*cos(0.7)", {"l1"})).text)
    0.7648421872844885*l1
    """
    total = []
    for monomial, coefficient in expression.terms:
        product = Expression.number(coefficient)
        for atom, exponent in monomial:
            is_number = (
                atom.arguments
                and atom.name != "sqrt"
                and not any(x.symbols for x in atom.arguments)
            )
            base = _decimal(atom) if is_number else Expression.of_atom(atom)
            product = product * base**exponent
        total.append(product)
    return Expression.sum(total)


def _steps(angle: Expression) -> int | None:
    """Return an angle in steps of 15 degrees; None if it is not a multiple."""
    half_turns = angle.half_turns
    if half_turns is None or (half_turns * STEPS_IN_PI).denominator != 1:
        return None
    return int(half_turns * STEPS_IN_PI) % (2 * STEPS_IN_PI)


@cache
def _sine_of_steps(steps: int) -> Expression:
    """Return sin(steps 15 degrees), in Q(sqrt 2, sqrt 3)."""
    half_circle, step = divmod(steps, STEPS_IN_PI)
    two, three, six = (sqrt(Expression.number(n)) for n in (2, 3, 6))
    first_quadrant = (
        ZERO,
        (six - two) / 4,
        Expression.number(Fraction(1, 2)),
        two / 2,
        three / 2,
        (six + two) / 4,
        Expression.number(1),
    )
    return first_quadrant[min(step, STEPS_IN_PI - step)] * (-1 if half_circle % 2 else 1)


def _inverse(
    name: str,
    x: Expression,
    approximate: Callable[[float], float],
    exactly: Callable[[int], Expression],
) -> Expression:
    """Return an inverse function: resolved at multiples of 15 degrees, an atom elsewhere."""
    if not x.symbols:
        try:
            angle = approximate(float(x))
        except ValueError:
            raise ExpressionError(f"{name}({x.text}) is not real") from None
        steps = round(angle * STEPS_IN_PI / math.pi)
        if exactly(steps) == x:
            return PI * Fraction(steps, STEPS_IN_PI)
    return Expression.of_atom(Atom(name, (x,)))


def _direction(angle: Expression) -> tuple[Expression, Expression] | None:
    """Return cosine and sine of an angle that is +-atan2(y, x), or that plus a number; None for other angles.

    The point (x, y) at the distance r has the direction (x/r, y/r); the number is added by the addition theorem.
    """
    arcs = [term for term in angle.terms if len(term[0]) == 1 and term[0][0][0].name == "atan2"]
    if len(arcs) != 1 or arcs[0][0][0][1] != 1 or abs(arcs[0][1]) != 1:
        return None
    rest = Expression(tuple(term for term in angle.terms if term != arcs[0]))
    if rest.symbols:
        return None
    y, x = arcs[0][0][0][0].arguments
    r = sqrt(x * x + y * y)
    c = x / r
    s = y * arcs[0][1] / r
    return (
        (c, s) if rest.is_zero else (c * cos(rest) - s * sin(rest), s * cos(rest) + c * sin(rest))
    )


def _leads_negative(x: Expression) -> bool:
    return bool(x.terms) and x.terms[0][1] < 0


def _prime_factors(number: int) -> list[tuple[int, int]]:
    """Factor by trial division; numbers are small here."""
    factors = []
    prime = 2
    while prime * prime <= number:
        power = 0
        while number % prime == 0:
            number = number // prime
            power = power + 1
        if power:
            factors.append((prime, power))
        prime += 1
    return [*factors, (number, 1)] if number > 1 else factors


def settled(value: Expression, *, angle: bool = False) -> Expression:
    """Return a value without parameters as a rational number or a multiple of pi; other values as they are.

    ``sin(0.5)`` is an atom of exact arithmetic; in a table it is written as 0.479425538604203.

    Parameters
    ----------
    value
        Exact value.
    angle
        Whether the value is an angle, which may be a multiple of pi.

    Returns
    -------
    Expression
        The value as it is written in a table.

    Examples
    --------
    >>> from dhkit.expressions import parse
    >>> print(settled(parse("sin(0.5)", {}), angle=False).text)
    0.479425538604203
    """
    if value.symbols or value.rational is not None or value.half_turns is not None:
        return value.with_digits(_SETTLED_DIGITS)
    number = exact(float(value))
    return exact_angle(number) if angle else number
