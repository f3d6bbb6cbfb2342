"""Pattern of an arm's numbers: constants of an expression (0, 1, -1), and symbols that arms give values."""

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
    """The numbers of one or several arms, and which of them are symbols in expressions that all these arms share.

    A number is a constant where it is the same 0, 1 or -1 in all arms. Arms of equal :attr:`code` have equal
    expressions, and share their compiled kernels.

    Attributes
    ----------
    numbers
        Shape (arms, N), one row an arm, without negative zeros.
    is_symbol
        Shape (N,).
    """

    numbers: Array
    is_symbol: NDArray[np.bool_]

    @classmethod
    def of(cls, numbers: Array) -> NumberPattern:
        """Return the pattern of numbers, shape (arms, N)."""
        numbers = numbers + 0.0
        return cls(numbers, ~(np.isin(numbers[0], CONSTANTS) & (numbers == numbers[0]).all(axis=0)))

    @property
    def code(self) -> str:
        """One letter a number: 0, + and - for 0, 1 and -1, p for a symbol."""
        letters = np.select([self.numbers[0] == constant for constant in CONSTANTS], list("0+-"), "p")
        return "".join(np.where(self.is_symbol, "p", letters))

    @property
    def parameters(self) -> Array:
        """Values of the symbols, shape (arms, symbols), in SI units."""
        return self.numbers[:, self.is_symbol]

    def entries(self) -> tuple[list[Any], casadi.SX]:
        """Return the N entries of an expression (constants and symbols), and the symbols (symbols x 1, SI units)."""
        import casadi

        symbols = casadi.SX.sym("parameter", int(self.is_symbol.sum()))
        remaining = iter(casadi.vertsplit(symbols) if symbols.numel() else ())
        pairs = zip(self.numbers[0].tolist(), self.is_symbol, strict=True)
        return [next(remaining) if is_symbol else number for number, is_symbol in pairs], symbols
