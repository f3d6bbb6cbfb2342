"""Doubles as values of LLVM's intermediate representation: operators write lines of a straight-line body.

A body's values are vectors of several doubles, one for each item of a batch, or single doubles.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self, TypeAlias, TypeVar

WIDTH = 8
"""Number of doubles of a vector: one register of AVX-512, two of AVX, four of SSE and NEON."""

FUSING = "contract nsz"
"""Liberties for LLVM: fuse products into sums, and drop the sign of zero. No others, so that NaN survives."""
EXACT = "nsz"
"""Liberty for LLVM: drop the sign of zero. Every operation is rounded as in IEEE 754."""


@dataclass
class Body:
    """The lines written so far; each defines one value, of ``width`` doubles or truth values."""

    liberties: str = FUSING
    width: int = WIDTH
    lines: list[str] = field(default_factory=list)

    @property
    def number_type(self) -> str:
        """LLVM's type of numbers."""
        return "double" if self.width == 1 else f"<{self.width} x double>"

    @property
    def truth_type(self) -> str:
        """LLVM's type of truth values."""
        return "i1" if self.width == 1 else f"<{self.width} x i1>"

    def declarations(self) -> list[str]:
        """Return the declarations of LLVM's functions that a body may call."""
        kind = self.number_type
        return [
            f"declare {kind} {self.intrinsic(name)}({kind})" for name in ("fabs", "sqrt", "floor")
        ]

    def intrinsic(self, name: str) -> str:
        """Return LLVM's name of a function of one number."""
        return f"@llvm.{name}.f64" if self.width == 1 else f"@llvm.{name}.v{self.width}f64"

    def constant(self, value: float) -> str:
        """Return a double as LLVM's text, by its bits, for all lanes."""
        (bits,) = struct.unpack("<Q", struct.pack("<d", value))
        return f"0x{bits:016X}" if self.width == 1 else f"splat (double 0x{bits:016X})"

    def constants(self, values: Sequence[float]) -> str:
        """Return doubles as LLVM's text of a vector, one for each lane."""
        bits = (struct.unpack("<Q", struct.pack("<d", value))[0] for value in values)
        return f"<{', '.join(f'double 0x{pattern:016X}' for pattern in bits)}>"

    def define(self, instruction: str) -> str:
        """Append an instruction and return the name of its value."""
        name = f"%v{len(self.lines)}"
        self.lines.append(f"  {name} = {instruction}")
        return name


_Kind = TypeVar("_Kind", bound="Lanes")


@dataclass(frozen=True, eq=False)
class Lanes:
    """As many doubles, or truth values, as the body's width."""

    body: Body
    name: str
    """Name of the value, or text of a constant."""

    @property
    def type(self) -> str:
        """LLVM's type of the value."""
        raise NotImplementedError

    def lane(self, body: Body, k: int) -> Self:
        """Return what is in a lane, as a value of a body of width 1."""
        return replace(
            self,
            body=body,
            name=body.define(f"extractelement {self.type} {self.name}, i64 {k}"),
        )


@dataclass(frozen=True, eq=False)
class Vector(Lanes):
    """As many doubles as the body's width.

    Comparisons with ``<``, ``<=``, :meth:`equals` and :meth:`differs` return a :class:`Mask`.
    """

    @property
    def type(self) -> str:
        """LLVM's type of the value."""
        return self.body.number_type

    def _with(self, instruction: str, other: Number, *, swapped: bool = False) -> str:
        operands = [self.name, _text(self.body, other)]
        if swapped:
            operands.reverse()
        return self.body.define(f"{instruction} {self.body.number_type} {', '.join(operands)}")

    def __add__(self, other: Number) -> Vector:
        return Vector(self.body, self._with(f"fadd {self.body.liberties}", other))

    def __sub__(self, other: Number) -> Vector:
        return Vector(self.body, self._with(f"fsub {self.body.liberties}", other))

    def __mul__(self, other: Number) -> Vector:
        return Vector(self.body, self._with(f"fmul {self.body.liberties}", other))

    def __truediv__(self, other: Number) -> Vector:
        return Vector(self.body, self._with(f"fdiv {self.body.liberties}", other))

    __radd__ = __add__
    __rmul__ = __mul__

    def __rsub__(self, other: Number) -> Vector:
        return Vector(self.body, self._with(f"fsub {self.body.liberties}", other, swapped=True))

    def __neg__(self) -> Vector:
        return Vector(
            self.body,
            self.body.define(f"fneg {self.body.liberties} {self.body.number_type} {self.name}"),
        )

    # Ordered comparisons with NaN are false; ``differs`` is true.

    def __lt__(self, other: Number) -> Mask:
        return Mask(self.body, self._with("fcmp olt", other))

    def __le__(self, other: Number) -> Mask:
        return Mask(self.body, self._with("fcmp ole", other))

    def __gt__(self, other: Number) -> Mask:
        return Mask(self.body, self._with("fcmp ogt", other))

    def equals(self, other: Number) -> Mask:
        """Return whether two vectors are equal, lane by lane."""
        return Mask(self.body, self._with("fcmp oeq", other))

    def differs(self, other: Number) -> Mask:
        """Return whether two vectors differ, lane by lane."""
        return Mask(self.body, self._with("fcmp une", other))

    def call(self, intrinsic: str) -> Vector:
        """Return one of LLVM's functions of one number: fabs, sqrt or floor."""
        kind = self.body.number_type
        call = f"call {self.body.liberties} {kind} {self.body.intrinsic(intrinsic)}({kind} {self.name})"
        return Vector(self.body, self.body.define(call))


Number: TypeAlias = Vector | float


@dataclass(frozen=True, eq=False)
class Mask(Lanes):
    """As many truth values as the body's width."""

    @property
    def type(self) -> str:
        """LLVM's type of the value."""
        return self.body.truth_type

    def __and__(self, other: Mask) -> Mask:
        return Mask(
            self.body, self.body.define(f"and {self.body.truth_type} {self.name}, {other.name}")
        )

    def __or__(self, other: Mask) -> Mask:
        return Mask(
            self.body, self.body.define(f"or {self.body.truth_type} {self.name}, {other.name}")
        )

    def __invert__(self) -> Mask:
        true = "true" if self.body.width == 1 else "splat (i1 true)"
        return Mask(self.body, self.body.define(f"xor {self.body.truth_type} {self.name}, {true}"))


def spread(lanes: Body, value: _Kind) -> _Kind:
    """Return a single value in all lanes."""
    kind = replace(value, body=lanes).type
    first = lanes.define(f"insertelement {kind} poison, {value.type} {value.name}, i64 0")
    copied = f"shufflevector {kind} {first}, {kind} poison, <{lanes.width} x i32> zeroinitializer"
    return replace(value, body=lanes, name=lanes.define(copied))


def gathered(lanes: Body, values: Sequence[_Kind]) -> _Kind:
    """Return single values, all numbers or all truth values, one in each lane."""
    result = replace(values[0], body=lanes, name="poison")
    for lane, value in enumerate(values):
        filled = f"insertelement {result.type} {result.name}, {value.type} {value.name}, i64 {lane}"
        result = replace(result, name=lanes.define(filled))
    return result


def chosen_lanes(condition: Sequence[bool], true: _Kind, false: _Kind) -> _Kind:
    """Return one value's lanes where a condition holds, and another's elsewhere; both are of one kind."""
    body = true.body
    lanes = ", ".join(f"i1 {str(holds).lower()}" for holds in condition)
    values = f"{true.type} {true.name}, {false.type} {false.name}"
    return replace(true, name=body.define(f"select {body.truth_type} <{lanes}>, {values}"))


def _text(body: Body, number: Number) -> str:
    return number.name if isinstance(number, Vector) else body.constant(number)


def select(condition: Mask, true: Number, false: Number) -> Vector:
    """Return one of two values in each lane, without a branch."""
    body = condition.body
    values = ", ".join(f"{body.number_type} {_text(body, value)}" for value in (true, false))
    choice = f"select {body.liberties} {body.truth_type} {condition.name}, {values}"
    return Vector(body, body.define(choice))


def absolute(x: Vector) -> Vector:
    """Return the absolute value."""
    return x.call("fabs")


def floor(x: Vector) -> Vector:
    """Return the greatest integer that is not above x."""
    return x.call("floor")


def sqrt(x: Vector) -> Vector:
    """Return the square root, NaN below 0."""
    return x.call("sqrt")
