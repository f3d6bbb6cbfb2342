"""Doubles as values of LLVM's intermediate representation: operators write lines of a straight-line body.

A body's values are vectors of several doubles, one for each item of a batch, or single doubles.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TypeAlias

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

    def define(self, instruction: str) -> str:
        """Append an instruction and return the name of its value."""
        name = f"%v{len(self.lines)}"
        self.lines.append(f"  {name} = {instruction}")
        return name


@dataclass(frozen=True, eq=False)
class Vector:
    """As many doubles as the body's width.

    Comparisons with ``<``, ``<=``, :meth:`equals` and :meth:`differs` return a :class:`Mask`.
    """

    body: Body
    name: str
    """Name of the value, or text of a constant."""

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
class Mask:
    """As many truth values as the body's width."""

    body: Body
    name: str

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
