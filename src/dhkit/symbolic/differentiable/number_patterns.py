"""The split of an arm's numbers into constants of an expression (0, 1, -1) and symbols that arms give values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array

if TYPE_CHECKING:
    import casadi

CONSTANTS = (0.0, 1.0, -1.0)
"""Numbers that shorten an expression: cosines of right angles, lengths that are zero."""


@dataclass(frozen=True, eq=False)
class NumberPattern:
    """The numbers of one or several arms, some of them symbols in expressions that all these arms share.

    A number is a constant where it is the same 0, 1 or -1 in all arms. Arms of equal :attr:`code` have equal
    expressions, and share their compiled kernels.

    Attributes
    ----------
    numbers
        Shape (arms, N), one row an arm, without negative zeros.
    is_symbol
        Mask of the numbers that are symbols, shape (N,).
    """

    numbers: Array
    is_symbol: NDArray[np.bool_]

    @classmethod
    def of(cls, numbers: Array) -> NumberPattern:
        """Return the pattern of numbers, shape (arms, N)."""
        numbers = numbers + 0.0  # -0.0 + 0.0 is 0.0
        is_shared = (numbers == numbers[0]).all(axis=0)
        is_constant = np.isin(numbers[0], CONSTANTS) & is_shared
        return cls(numbers, ~is_constant)

    @property
    def code(self) -> str:
        """One letter a number: 0, + and - for 0, 1 and -1, p for a symbol."""
        letters = np.select(
            [self.numbers[0] == constant for constant in CONSTANTS], list("0+-"), "p"
        )
        return "".join(np.where(self.is_symbol, "p", letters))

    @property
    def parameters(self) -> Array:
        """Values of the symbols, shape (arms, symbols), in SI units."""
        return self.numbers[:, self.is_symbol]

    def entries(self) -> tuple[list[Any], casadi.SX]:
        """Return the N entries of an expression (constants and symbols), and the symbols (symbols x 1, SI units)."""
        import casadi

        symbols = casadi.SX.sym("parameter", int(self.is_symbol.sum()))
        entries: list[Any] = self.numbers[0].tolist()
        if symbols.numel():
            places = np.flatnonzero(self.is_symbol).tolist()
            for place, symbol in zip(places, casadi.vertsplit(symbols), strict=True):
                entries[place] = symbol
        return entries, symbols
