"""Vectors of doubles as values of LLVM's intermediate representation: operators write lines of a straight-line body."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TypeAlias

WIDTH = 8
"""Number of doubles of a vector: one register of AVX-512, two of AVX, four of SSE and NEON."""
VECTOR = f"<{WIDTH} x double>"
_MASK = f"<{WIDTH} x i1>"

FUSING = "contract nsz"
"""Liberties for LLVM: fuse products into sums, and drop the sign of zero. No others, so that NaN survives."""
EXACT = "nsz"
"""Liberty for LLVM: drop the sign of zero. Every operation is rounded as in IEEE 754."""


@dataclass
class Body:
    """The lines written so far; each defines one value."""

    liberties: str = FUSING
    lines: list[str] = field(default_factory=list)

    def define(self, instruction: str) -> str:
        """Append an instruction and return the name of its value."""
        name = f"%v{len(self.lines)}"
        self.lines.append(f"  {name} = {instruction}")
        return name


@dataclass(frozen=True, eq=False)
class Vector:
    """``WIDTH`` doubles. Comparisons with ``<``, ``<=``, :meth:`equals` and :meth:`differs` return a :class:`Mask`."""

    body: Body
    name: str
    """Name of the value, or text of a constant."""

    def _with(self, instruction: str, other: Number, *, swapped: bool = False) -> str:
        first = self.name
        second = _text(other)
        return self.body.define(
            f"{instruction} {VECTOR} {f'{second}, {first}' if swapped else f'{first}, {second}'}"
        )

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
            self.body, self.body.define(f"fneg {self.body.liberties} {VECTOR} {self.name}")
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
        function = f"@llvm.{intrinsic}.v{WIDTH}f64({VECTOR} {self.name})"
        return Vector(
            self.body, self.body.define(f"call {self.body.liberties} {VECTOR} {function}")
        )


Number: TypeAlias = Vector | float


@dataclass(frozen=True, eq=False)
class Mask:
    """``WIDTH`` truth values."""

    body: Body
    name: str

    def __and__(self, other: Mask) -> Mask:
        return Mask(self.body, self.body.define(f"and {_MASK} {self.name}, {other.name}"))

    def __or__(self, other: Mask) -> Mask:
        return Mask(self.body, self.body.define(f"or {_MASK} {self.name}, {other.name}"))

    def __invert__(self) -> Mask:
        return Mask(self.body, self.body.define(f"xor {_MASK} {self.name}, splat (i1 true)"))


def constant(value: float) -> str:
    """Return a double as LLVM's text, by its bits, for all lanes."""
    (bits,) = struct.unpack("<Q", struct.pack("<d", value))
    return f"splat (double 0x{bits:016X})"


def _text(number: Number) -> str:
    return number.name if isinstance(number, Vector) else constant(number)


def select(condition: Mask, true: Number, false: Number) -> Vector:
    """Return one of two values in each lane, without a branch."""
    body = condition.body
    choice = f"select {body.liberties} {_MASK} {condition.name}, {VECTOR} {_text(true)}, {VECTOR} {_text(false)}"
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
