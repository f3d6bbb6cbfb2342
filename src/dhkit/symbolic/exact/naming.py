"""Which of a description's numbers become symbols, and what these are called."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from dhkit.description import Body, Description, Drive, Joint
from dhkit.description.parameters import resolved
from dhkit.expressions import Expression, exact, exact_angle, substitute

__all__ = ["INERTIA_KEYS", "INERTIA_PLACES", "LinkNumbers", "Naming", "Symbols"]

Symbols: TypeAlias = Literal["none", "file", "inertial"]
"""Which numbers are symbols: none, the file's parameters, or every inertial parameter with lengths and gravity."""

ONE = exact(1)
INERTIA_KEYS = ("xx", "yy", "zz", "xy", "yz", "xz")
INERTIA_PLACES = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}


@dataclass(frozen=True)
class LinkNumbers:
    """What is read of a link, as expressions."""

    row: tuple[Expression, Expression, Expression, Expression]
    """a, d, alpha, theta."""
    mass: Expression
    com: tuple[Expression, ...]
    inertia: tuple[Expression, ...] | None
    """In the order of ``INERTIA_KEYS``, about the centre of mass; None where ``second`` is given."""
    second: tuple[Expression, ...] | None
    gear: Expression
    rotor: Expression


class Naming:
    """Decides which numbers become symbols, and remembers the symbols' values."""

    def __init__(self, description: Description, symbols: Symbols) -> None:
        self.description = description
        self.symbols = symbols
        self.inertial: list[str] = []
        self.values = resolved(description.parameters)
        own = {name for name, value in description.parameters.items() if not value.symbols}
        self._fixed = {
            name: _through(description.parameters, name) for name in description.parameters if name not in own
        }
        if symbols == "none":
            self._fixed = self.values

    def known(self, expression: Expression) -> Expression:
        """Return an expression in the symbols that are kept."""
        return substitute(expression, self._fixed)

    def symbol(self, name: str, value: Expression) -> Expression:
        """Return a new symbol of that value; zero needs none."""
        while name in self.values and self.values[name] != value:
            name += "_"
        self.values[name] = value
        return Expression.symbol(name)

    def inertial_symbol(self, name: str, value: Expression) -> Expression:
        """Return a new symbol that torques are linear in."""
        symbol = self.symbol(name, value)
        self.inertial.append(symbol.text)
        return symbol

    def length(self, name: str, expression: Expression) -> Expression:
        """Return a length of the table, by a name of its own where all numbers are symbols."""
        known = self.known(expression)
        if self.symbols != "inertial" or known.symbols or known.is_zero:
            return known
        return self.symbol(name, known)

    def gravity(self) -> list[Expression]:
        """Return the free-fall acceleration in the world."""
        vector = [self.known(x) for x in self.description.gravity]
        if self.symbols != "inertial" or any(x.symbols for x in vector):
            return vector
        along = [x for x in vector if not x.is_zero]
        if len(along) == 1:
            size = along[0] if float(along[0]) > 0 else -along[0]
            g = self.symbol("g", size)
            return [x if x.is_zero else g if float(x) > 0 else -g for x in vector]
        return [x if x.is_zero else self.symbol(f"g{axis}", x) for axis, x in zip("xyz", vector, strict=True)]

    def link(self, i: int, joint: Joint, body: Body) -> LinkNumbers:
        """Return what link i, from 1, is read from."""
        row = (
            self.length(f"a{i}", joint.a),
            self.length(f"d{i}", joint.d),
            exact_angle(self.known(joint.alpha)),
            exact_angle(self.known(joint.theta)),
        )
        drive = joint.drive or Drive()
        gear, rotor = self.known(drive.gear), self.known(drive.rotor_inertia)
        if self.symbols != "inertial":
            inertia = tuple(self.known(getattr(body.inertia, key)) for key in INERTIA_KEYS)
            com = tuple(self.known(x) for x in body.com)
            return LinkNumbers(row, self.known(body.mass), com, inertia, None, gear, rotor)
        numbers = self.description.numbers
        m, c, I_com = numbers.mass[i - 1], numbers.com[i - 1], numbers.inertia[i - 1]
        about_origin = I_com + m * (c @ c * np.eye(3) - np.outer(c, c))
        mass = self.inertial_symbol(f"m{i}", exact(float(m)))
        moments = [self.inertial_symbol(f"r{axis}{i}", exact(float(m * x))) for axis, x in zip("xyz", c, strict=True)]
        second = tuple(
            self.inertial_symbol(f"I{key}{i}", exact(float(about_origin[place])))
            for key, place in INERTIA_PLACES.items()
        )
        if not rotor.is_zero:
            gear = gear if gear == ONE else self.symbol(f"G{i}", substitute(drive.gear, self.values))
            rotor = self.inertial_symbol(f"Jm{i}", substitute(drive.rotor_inertia, self.values))
        return LinkNumbers(row, mass, tuple(x / mass for x in moments), None, second, gear, rotor)


def _through(parameters: object, name: str) -> Expression:
    """Return a parameter in those that are not made of others."""
    table: dict[str, Expression] = dict(parameters)  # type: ignore[call-overload]
    expression = table[name]
    while made := {x for x in expression.symbols if table[x].symbols}:
        expression = substitute(expression, {x: table[x] for x in made})
    return expression
