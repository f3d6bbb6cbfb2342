"""The choice of numbers of a description that become symbols, and the symbols' names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from dhkit.description import INERTIA_PLACES, Body, Coupling, Description, Drive
from dhkit.description.parameters import resolved
from dhkit.expressions import Expression, exact, exact_angle, substitute

Symbols: TypeAlias = Literal["none", "file", "inertial"]
"""The numbers that are symbols: none, the file's parameters, or every inertial parameter with lengths and gravity."""

_ONE = exact(1)


@dataclass(frozen=True)
class BodyNumbers:
    """The numbers of a body as expressions."""

    name: str
    mass: Expression
    """kg."""
    com: tuple[Expression, ...]
    """Centre of mass in the link's DH frame, m."""
    inertia: tuple[Expression, ...] | None
    """Inertia about the centre of mass, kg m^2, in the order of ``INERTIA_PLACES``; None where ``second`` is given."""
    second: tuple[Expression, ...] | None
    """Inertia about the DH frame's origin, kg m^2, in the same order; None where ``inertia`` is given."""


@dataclass(frozen=True)
class LinkNumbers:
    """The numbers of a link as expressions."""

    row: tuple[Expression, Expression, Expression, Expression]
    """a, d, alpha, theta."""
    bodies: tuple[BodyNumbers, ...]
    """With ``symbols="inertial"`` a single body that stands for all of them."""
    gear: Expression
    """Gear ratio; 1 without a drive."""
    rotor: Expression
    """Rotor inertia at the motor side, kg m^2; 0 without a drive."""


class Naming:
    """Decides which numbers become symbols, and keeps the symbols' values.

    Attributes
    ----------
    description, symbols
        The robot, and the choice of symbols.
    values
        Value of every symbol, by name.
    inertial
        Names of the symbols that torques are linear in, link by link.
    """

    def __init__(self, description: Description, symbols: Symbols) -> None:
        self.description = description
        self.symbols = symbols
        self.inertial: list[str] = []
        self.values = resolved(description.parameters)

        # Replacements: parameters that are made of others are written in those; without symbols, all are numbers.
        self._fixed: Mapping[str, Expression]
        if symbols == "none":
            self._fixed = self.values
        else:
            dependent = [name for name, value in description.parameters.items() if value.symbols]
            self._fixed = {
                name: _in_independent_parameters(description.parameters, name) for name in dependent
            }

    def known(self, expression: Expression) -> Expression:
        """Return an expression in the symbols that are kept."""
        return substitute(expression, self._fixed)

    def symbol(self, name: str, value: Expression) -> Expression:
        """Return a new symbol of this value; underscores are appended to a name that has another value."""
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
        """Return a length of the table, m; with ``symbols="inertial"`` a symbol of this name, unless it is zero."""
        known = self.known(expression)
        if self.symbols != "inertial" or known.symbols or known.is_zero:
            return known
        return self.symbol(name, known)

    def gravity(self) -> list[Expression]:
        """Return the free-fall acceleration in the world, m/s^2: a multiple of g if it is along an axis."""
        vector = [self.known(x) for x in self.description.gravity]
        if self.symbols != "inertial" or any(x.symbols for x in vector):
            return vector

        nonzero = [x for x in vector if not x.is_zero]
        if len(nonzero) != 1:
            return [
                x if x.is_zero else self.symbol(f"g{axis}", x)
                for axis, x in zip("xyz", vector, strict=True)
            ]

        # One component: +g or -g, with g > 0.
        (component,) = nonzero
        is_positive = float(component) > 0
        g = self.symbol("g", component if is_positive else -component)
        signed_g = g if is_positive else -g
        return [x if x.is_zero else signed_g for x in vector]

    def link(self, i: int, bodies: Sequence[Body]) -> LinkNumbers:
        """Return the numbers of link i, counted from 0."""
        joint = self.description.joints[i]
        number = i + 1
        row = (
            self.length(f"a{number}", joint.a),
            self.length(f"d{number}", joint.d),
            exact_angle(self.known(joint.alpha)),
            exact_angle(self.known(joint.theta)),
        )
        drive = joint.drive or Drive()
        gear = self.known(drive.gear)
        rotor = self.known(drive.rotor_inertia)
        if self.symbols != "inertial":
            return LinkNumbers(row, tuple(self._body(body) for body in bodies), gear, rotor)

        # All bodies of the link as one: mass m, first moments r = m c, inertia I about the origin of the DH frame.
        m, x, y, z, *second = map(exact, self.description.numbers.inertial_parameters[i].tolist())
        mass = self.inertial_symbol(f"m{number}", m)
        moments = [
            self.inertial_symbol(f"r{axis}{number}", r)
            for axis, r in zip("xyz", (x, y, z), strict=True)
        ]
        tensor = [
            self.inertial_symbol(f"I{key}{number}", x)
            for key, x in zip(INERTIA_PLACES, second, strict=True)
        ]
        com = [r / mass for r in moments]
        whole = BodyNumbers("", mass, tuple(com), None, tuple(tensor))

        if not rotor.is_zero:
            if gear != _ONE:
                gear = self.symbol(f"G{number}", substitute(drive.gear, self.values))
            rotor = self.inertial_symbol(
                f"Jm{number}", substitute(drive.rotor_inertia, self.values)
            )
        return LinkNumbers(row, (whole,), gear, rotor)

    def coupling(self, coupling: Coupling) -> Expression:
        """Return the inertia of a drive that two joints move together, kg m^2, kg m or kg."""
        known = self.known(coupling.inertia)
        if self.symbols != "inertial" or known.is_zero:
            return known
        first, second = coupling.joints
        return self.inertial_symbol(f"Jc{first}{second}", substitute(coupling.inertia, self.values))

    def _body(self, body: Body) -> BodyNumbers:
        mass = self.known(body.mass)
        com = tuple(self.known(x) for x in body.com)
        inertia = tuple(self.known(getattr(body.inertia, key)) for key in INERTIA_PLACES)
        return BodyNumbers(body.name, mass, com, inertia, None)


def _in_independent_parameters(parameters: Mapping[str, Expression], name: str) -> Expression:
    """Return a parameter in terms of the parameters that do not depend on others."""
    expression = parameters[name]
    dependent = {x for x in expression.symbols if parameters[x].symbols}
    while dependent:
        expression = substitute(expression, {x: parameters[x] for x in dependent})
        dependent = {x for x in expression.symbols if parameters[x].symbols}
    return expression
