"""Numbers that people type on the command line: expressions with units, read by the parser of robot files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import get_type_hints

from typer.core import TyperCommand

from dhkit.errors import DescriptionError, ExpressionError
from dhkit.expressions import Expression, parse, substitute

UNITS = {
    "m": Expression.number(1),
    "rad": Expression.number(1),
    "s": Expression.number(1),
    "ms": Expression.number(Fraction(1, 1000)),
}
"""Units of the command line beside the constants of robot files (mm, cm, inch, deg), in m, rad and s."""


def quantity(text: str) -> float:
    """Return the value of a number or an expression in SI units and radians; nothing is evaluated as code.

    Raises
    ------
    ExpressionError
        Not an expression, or an unknown name.

    Examples
    --------
    >>> quantity("20*mm"), quantity("1/4"), quantity("500*ms")
    (0.02, 0.25, 0.5)
    """
    return float(substitute(parse(text, UNITS.keys()), UNITS))


def with_plain_numbers(
    command: TyperCommand, function: Callable[..., object], words: Sequence[str]
) -> list[str]:
    """Return the words of a command line with expressions of its numbers replaced by their values.

    Parameters
    ----------
    command
        The command.
    function
        Its function: a parameter that is a float, or a float and None, takes a number.
    words
        The words after the command.

    Raises
    ------
    DescriptionError
        A number is not an expression; the message names the option.
    """
    options = _options_of_numbers(command, get_type_hints(function))
    plain: list[str] = []
    rest = list(words)
    while rest:
        word = rest.pop(0)
        if word == "--":
            return [*plain, word, *rest]
        option, sign, value = word.partition("=")
        if option not in options:
            plain.append(word)
        elif sign:
            plain.append(f"{option}={_plain(value, option)}")
        else:
            plain.append(word)
            if rest:
                plain.append(_plain(rest.pop(0), option))
    return plain


def _options_of_numbers(command: TyperCommand, types: Mapping[str, object]) -> set[str]:
    """Return the options that take a number."""
    options: set[str] = set()
    for parameter in command.params:
        if types.get(parameter.name or "") in (float, float | None):
            options.update(parameter.opts)
    return options


def _plain(text: str, option: str) -> str:
    """Return a number as it is, and an expression as its value."""
    try:
        float(text)
    except ValueError:
        pass
    else:
        return text
    try:
        return repr(quantity(text))
    except ExpressionError as error:
        raise DescriptionError(f"{option}: {error}") from None
