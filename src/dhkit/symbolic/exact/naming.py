"""Choice of a description's numbers that become symbols, and the symbols' names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from dhkit.description import INERTIA_PLACES, Body, Coupling, Description, Drive
from dhkit.description.parameters import resolved
from dhkit.expressions import Expression, exact, exact_angle, substitute

Symbols: TypeAlias = Literal["none", "file", "inertial"]
"""Numbers that are symbols: none, the file's parameters, or every inertial parameter with lengths and gravity."""

_ONE = exact(1)


@dataclass(frozen=True)
class BodyNumbers:
    """The numbers of a body as expressions."""

    name: str
    mass: Expression
    com: tuple[Expression, ...]
    inertia: tuple[Expression, ...] | None
    """Inertia about the centre of mass, in the order of ``INERTIA_PLACES``; None if ``second`` is given."""
    second: tuple[Expression, ...] | None


@dataclass(frozen=True)
class LinkNumbers:
    """The numbers of a link as expressions."""

    row: tuple[Expression, Expression, Expression, Expression]
    """a, d, alpha, theta."""
    bodies: tuple[BodyNumbers, ...]
    """With ``symbols="inertial"`` a single body that stands for all of them."""
    gear: Expression
    rotor: Expression


class Naming:
    """Decides which numbers become symbols, and keeps the symbols' values."""

    def __init__(self, description: Description, symbols: Symbols) -> None:
        self.description = description
        self.symbols = symbols
        self.inertial: list[str] = []
        self.values = resolved(description.parameters)
        own = {name for name, value in description.parameters.items() if not value.symbols}
        self._fixed = {
            name: _in_independent_parameters(description.parameters, name)
            for name in description.parameters
            if name not in own
        }
        if symbols == "none":
            self._fixed = self.values

    def known(self, expression: Expression) -> Expression:
        """Return an expression in the symbols that are kept."""
        return substitute(expression, self._fixed)

    def symbol(self, name: str, value: Expression) -> Expression:
        """Return a new symbol of this value; zero stays a number."""
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
        """Return a length of the table, as a symbol of this name where all numbers are symbols."""
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
        m, x, y, z, *second = map(exact, self.description.numbers.inertial_parameters[i].tolist())
        mass = self.inertial_symbol(f"m{number}", m)
        moments = [self.inertial_symbol(f"r{axis}{number}", r) for axis, r in zip("xyz", (x, y, z), strict=True)]
        tensor = tuple(
            self.inertial_symbol(f"I{key}{number}", entry) for key, entry in zip(INERTIA_PLACES, second, strict=True)
        )
        if not rotor.is_zero:
            gear = gear if gear == _ONE else self.symbol(f"G{number}", substitute(drive.gear, self.values))
            rotor = self.inertial_symbol(f"Jm{number}", substitute(drive.rotor_inertia, self.values))
        whole = BodyNumbers("", mass, tuple(r / mass for r in moments), None, tensor)
        return LinkNumbers(row, (whole,), gear, rotor)

    def coupling(self, coupling: Coupling) -> Expression:
        """Return the inertia of a drive that two joints turn."""
        known = self.known(coupling.inertia)
        if self.symbols != "inertial" or known.is_zero:
            return known
        first, second = coupling.joints
        return self.inertial_symbol(f"Jc{first}{second}", substitute(coupling.inertia, self.values))

    def _body(self, body: Body) -> BodyNumbers:
        inertia = tuple(self.known(getattr(body.inertia, key)) for key in INERTIA_PLACES)
        return BodyNumbers(body.name, self.known(body.mass), tuple(self.known(x) for x in body.com), inertia, None)


def _in_independent_parameters(parameters: Mapping[str, Expression], name: str) -> Expression:
    """Return a parameter in terms of the parameters that do not depend on others."""
    expression = parameters[name]
    while made := {x for x in expression.symbols if parameters[x].symbols}:
        expression = substitute(expression, {x: parameters[x] for x in made})
    return expression
