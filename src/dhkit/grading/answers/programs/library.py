"""Functions of numpy, sympy, casadi and MATLAB that are read: their results for given arguments."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import chain

from dhkit.grading.answers.programs.scope import Scope
from dhkit.grading.answers.programs.values import (
    ZERO,
    Given,
    Matrix,
    Scalar,
    Several,
    Text,
    UnreadError,
    Value,
    applied,
    calculated,
    identity,
    matrix_of,
    number,
    transposed,
    vector_of,
    zeros,
)
from dhkit.grading.answers.tokens import word_set
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES

UNCHANGED = word_set(
    """
    simplify expand trigsimp factor cancel together powsimp expand_trig radsimp collect combine simplifyFraction vpa
    nsimplify doit copy as_immutable as_mutable applyfunc asarray asanyarray sympify
    """
)
"""Functions and methods that write an expression in another way, or copy it."""

_FLAT = word_set("flatten ravel squeeze")
"""Functions and methods that make a vector with one index."""

_EXACT = frozenset(("Integer", "int", "round", "floor", "ceil", "trunc"))
"""Functions that make another number of a quotient: Integer(1/3) is 0."""

SCALAR = frozenset(FUNCTION_NAMES) - {"Rational", "Integer", "Float", "S", "number", "sympify"}
"""Functions of numbers that answers may contain."""


def called(scope: Scope, function: str, arguments: Sequence[Value], of_numpy: bool) -> Value:
    """Return the value of a library's function.

    Parameters
    ----------
    scope
        Where the call stands.
    function
        Name in the library.
    arguments
        Values of the arguments.
    of_numpy
        Whether matrices that it makes multiply entry by entry.

    Raises
    ------
    UnreadError
        A function, or arguments, that are not read.
    """
    match function, arguments:
        case ("zeros", [Several(())]):  # zeros((*q.shape[:-1],)): one number a state
            return Matrix({}, is_zeros=True)
        case ("zeros", [Scalar() as n]) if not of_numpy and n.text.isdecimal():
            # sympy's and MATLAB's are square.
            return zeros(int(n.text[:6]), int(n.text[:6]))
        case ("zeros", _) if arguments:
            return zeros(*_shape_of(arguments), multiplies_entries=of_numpy)
        case ("zeros_like", [Matrix() as matrix]):
            return matrix.mapped(lambda x: zeros(1).entries[(0,)])
        case ("eye" | "identity", [Scalar() as n]):
            return identity(int(n.number or 0), of_numpy)
        case ("transpose", [Matrix() as matrix]):
            return transposed(matrix)
        case ("dot" | "matmul", [Matrix() as left, Matrix() as right]):
            return calculated(left, "@", right, scope.record.power)
        case ("sum", [Matrix() as terms]) if terms.is_flat:
            total: Value = ZERO
            for term in terms.entries.values():
                total = term if total is ZERO else calculated(total, "+", term, scope.record.power)
            return total
        case ("Rational" | "S" | "sympify" | "nsimplify", [Text(text)]) if match := re.fullmatch(
            r"(-?\d{1,15})/(\d{1,15})", text, re.ASCII
        ):
            return calculated(number(match[1]), "/", number(match[2]))
        case ("float" | "float64", [Scalar() as x]):
            return x
        case ("Integer" | "int", [Scalar() as x]) if x.text.isdecimal():
            return x
        case ("Rational", [_, *_]):
            return _rational(arguments)
        case ("Float" | "S" | "float" | "float64", [Scalar() as x]) if x.number is not None:
            return x
        case ("S" | "sympify", [Scalar() as x]):
            return x
    if function in _EXACT:
        raise UnreadError(f"{function}(...) of anything but whole numbers is not read")
    if function in UNCHANGED and arguments:
        return unchanged(arguments[0])
    if function in _FLAT and len(arguments) == 1:
        return flat(arguments[0])
    if function in SCALAR and arguments:
        return applied(function, [scope.scalar(argument) for argument in arguments])
    raise UnreadError(f"{function}(...) is not read")


def unchanged(value: Value) -> Value:
    """Return a value that a function leaves as it is; a list is a matrix then."""
    if isinstance(value, Scalar | Matrix | Given):
        return value
    raise UnreadError("a function of what is not a number or a matrix is not read")


def flat(value: Value) -> Value:
    """Return a matrix as a vector with one index."""
    if isinstance(value, Matrix) and not value.is_flat:
        if 1 not in value.shape:
            raise UnreadError("a matrix made flat is not read")
        return vector_of(
            list(chain.from_iterable(value.rows)), multiplies_entries=value.multiplies_entries
        )
    return unchanged(value)


def as_matrix(value: Value, of_numpy: bool) -> Matrix:
    """Return a list of numbers or of rows as a matrix; sympy's of a flat list is a column."""
    if isinstance(value, Matrix):
        if value.is_flat and not of_numpy and value.is_list:
            return matrix_of([[x] for x in value.entries.values()])
        return Matrix(value.entries, multiplies_entries=of_numpy)
    raise UnreadError("a matrix of something else than rows of numbers is not read")


def _shape_of(arguments: Sequence[Value]) -> tuple[int, ...]:
    """Return the numbers of rows and columns in zeros(2, 2), zeros(2) and zeros((2, 2))."""
    numbers: list[int] = []
    for argument in arguments:
        entries = argument.entries.values() if isinstance(argument, Matrix) else [argument]
        for entry in entries:
            if not isinstance(entry, Scalar) or not entry.text.isdecimal():
                raise UnreadError("zeros of this shape are not read")
            numbers.append(int(entry.text[:6]))
    return tuple(numbers)


def _rational(arguments: Sequence[Value]) -> Scalar:
    """Return Rational(1, 2), whose arguments have to be numbers as they stand."""
    numbers = [
        x
        for x in arguments
        if isinstance(x, Scalar) and x.text.lstrip("-").replace(".", "", 1).isdecimal()
    ]
    if len(numbers) != len(arguments) or not 1 <= len(numbers) <= 2:
        raise UnreadError("Rational(...) of anything but whole numbers is not read")
    if len(numbers) == 1:
        return numbers[0]
    if any("." in x.text for x in numbers):
        raise UnreadError("Rational(...) of anything but whole numbers is not read")
    result = calculated(numbers[0], "/", numbers[1])
    assert isinstance(result, Scalar)  # noqa: S101
    return result
