"""Numbers x + y r with r^2 known but its sign left open, so that square roots need not be taken.

A solution of a quadratic equation in a joint's cosine and sine is of this kind. The product of a function's values for
both signs of r, (x + y r) (x - y r) = x^2 - y^2 r^2, has no root left: it is a polynomial where x, y and r^2 are. With
r^2 = -1 these are the complex numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

Element: TypeAlias = Any
"""A CasADi SX scalar, a number, or an :class:`Extension`."""
SIGNS = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
"""Signs that two roots may have."""


@dataclass(frozen=True, eq=False)
class Root:
    """A square root r that stays symbolic."""

    square: Element
    """r^2."""
    level: int = 1
    """1 where r^2 is without other roots; larger than the levels of the roots in r^2."""

    @property
    def element(self) -> Extension:
        """The number r itself."""
        return Extension(0.0, 1.0, self)


@dataclass(frozen=True, eq=False)
class Extension:
    """The number x + y r."""

    x: Element
    y: Element
    root: Root

    __array_priority__: ClassVar[float] = 1e6
    """Larger than CasADi's, so that SX leaves sums and products with these numbers to them."""

    def __add__(self, other: Element) -> Extension:
        if not isinstance(other, Extension) or other.root.level < self.root.level:
            return Extension(self.x + other, self.y, self.root)
        if other.root.level > self.root.level:
            return Extension(other.x + self, other.y, other.root)
        return Extension(self.x + other.x, self.y + other.y, self.root)

    __radd__ = __add__

    def __mul__(self, other: Element) -> Extension:
        if not isinstance(other, Extension) or other.root.level < self.root.level:
            return Extension(self.x * other, self.y * other, self.root)
        if other.root.level > self.root.level:
            return Extension(other.x * self, other.y * self, other.root)
        # (x + y r) (u + v r) = x u + y v r^2 + (x v + y u) r.
        x = self.x * other.x + (self.y * other.y) * self.root.square
        y = self.x * other.y + self.y * other.x
        return Extension(x, y, self.root)

    __rmul__ = __mul__

    def __neg__(self) -> Extension:
        return self.__mul__(-1.0)

    def __sub__(self, other: Element) -> Extension:
        return self.__add__(other * -1.0)

    def __rsub__(self, other: Element) -> Extension:
        return self.__neg__().__add__(other)

    @property
    def norm(self) -> Element:
        """The product (x + y r) (x - y r) = x^2 - y^2 r^2."""
        return self.x * self.x - (self.y * self.y) * self.root.square

    @property
    def inverse(self) -> Extension:
        """1 / (x + y r) = (x - y r) / (x^2 - y^2 r^2), for a root of level 1."""
        factor = 1.0 / self.norm
        return Extension(self.x * factor, self.y * factor * -1.0, self.root)
