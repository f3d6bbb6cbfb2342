"""What the named numbers of a robot come to."""

from __future__ import annotations

import re
from collections.abc import Mapping

from dhkit.errors import DescriptionError, ExpressionError
from dhkit.expressions import CONSTANTS, FUNCTIONS, Expression, substitute

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}", re.ASCII)


def check_parameter_name(name: str) -> None:
    """Refuse a name that an expression could not use, or that means something else there."""
    if not NAME.fullmatch(name):
        raise DescriptionError(f"parameters: {name[:80]!r} is no name; expected letters, digits and _, 64 at most")
    if name in CONSTANTS or name in FUNCTIONS:
        raise DescriptionError(f"parameters: {name!r} is taken; expressions know it as a constant or function")


def resolved(parameters: Mapping[str, Expression]) -> dict[str, Expression]:
    """Return each parameter's value without names in it.

    Raises
    ------
    DescriptionError
        A parameter is defined in terms of itself, of an unknown name, or has no value.
    """
    values: dict[str, Expression] = {}
    for name in parameters:
        _resolve(name, parameters, values, ())
    return values


def needs(name: str, parameters: Mapping[str, Expression]) -> frozenset[str]:
    """Return the parameters that one is made of, directly or through others; parameters have no cycles."""
    direct = parameters[name].symbols
    return direct.union(*(needs(other, parameters) for other in direct))


def _resolve(
    name: str, parameters: Mapping[str, Expression], values: dict[str, Expression], path: tuple[str, ...]
) -> None:
    if name in values:
        return
    if name in path:
        cycle = (*path[path.index(name) :], name)
        shown = cycle if len(cycle) <= 6 else (*cycle[:3], "...", *cycle[-2:])
        raise DescriptionError(f"parameters: {' -> '.join(shown)} is a cycle")
    for needed in sorted(parameters[name].symbols):
        if needed not in parameters:
            raise DescriptionError(f"parameters.{name}: {needed!r} is not defined")
        _resolve(needed, parameters, values, (*path, name))
    try:
        values[name] = substitute(parameters[name], values)
    except ExpressionError as error:
        raise DescriptionError(f"parameters.{name}: {error}") from None
