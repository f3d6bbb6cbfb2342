"""Values of a robot's parameters: named numbers that may be defined by other parameters."""

from __future__ import annotations

import re
from collections.abc import Mapping

from dhkit.errors import DescriptionError, ExpressionError
from dhkit.expressions import CONSTANTS, FUNCTIONS, Expression, substitute

PARAMETER_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}", re.ASCII)


_JOINT_VARIABLE_NAME = re.compile(r"q[0-9]+", re.ASCII)
"""Name of a joint variable, which rows of a table may contain."""


def check_parameter_name(name: str) -> None:
    """Refuse a parameter's name that an expression could not use, or that means something else there.

    Raises
    ------
    DescriptionError
        No name, or the name of a constant, a function or a joint variable.
    """
    if not PARAMETER_NAME.fullmatch(name):
        raise DescriptionError(
            f"parameters: {name[:80]!r} is not a name; expected letters, digits and _, 64 at most"
        )
    if name in CONSTANTS or name in FUNCTIONS:
        raise DescriptionError(
            f"parameters: {name!r} is taken; expressions know it as a constant or function"
        )
    if _JOINT_VARIABLE_NAME.fullmatch(name):
        raise DescriptionError(f"parameters: {name!r} is taken: joint variables are q1, q2 ...")


def resolved(parameters: Mapping[str, Expression]) -> dict[str, Expression]:
    """Return each parameter's value without names in it.

    Raises
    ------
    DescriptionError
        A parameter is defined in terms of itself, of an unknown name, or has no value.
    """
    values: dict[str, Expression] = {}

    def resolve(name: str, path: tuple[str, ...]) -> None:
        if name in values:
            return
        if name in path:
            cycle = (*path[path.index(name) :], name)
            shortened = cycle if len(cycle) <= 6 else (*cycle[:3], "...", *cycle[-2:])
            raise DescriptionError(f"parameters: {' -> '.join(shortened)} is a cycle")
        for needed in sorted(parameters[name].symbols):
            if needed not in parameters:
                raise DescriptionError(f"parameters.{name}: {needed!r} is not defined")
            resolve(needed, (*path, name))
        try:
            values[name] = substitute(parameters[name], values)
        except ExpressionError as error:
            raise DescriptionError(f"parameters.{name}: {error}") from None

    for name in parameters:
        resolve(name, ())
    return values


def needs(name: str, parameters: Mapping[str, Expression]) -> frozenset[str]:
    """Return the parameters that one depends on, directly or through others; there must be no cycles."""
    direct = parameters[name].symbols
    return direct.union(*(needs(other, parameters) for other in direct))
