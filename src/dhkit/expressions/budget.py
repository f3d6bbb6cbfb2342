"""Bounded work of exact arithmetic, so that hostile text cannot take long."""

from __future__ import annotations

from contextvars import ContextVar, Token

from dhkit.display import repr_line
from dhkit.errors import ExpressionError

_DEFAULT_WORK = 100_000
"""Number of products and sums of terms, about half a second. A file of the library needs at most 1,000, an arm of
symbols with a joint locked at 60 degrees 20,000."""


class Budget:
    """The work that exact arithmetic may do inside a ``with`` block, in this thread.

    Examples
    --------
    >>> from dhkit.expressions import parse
    >>> with Budget(100):
    ...     parse("(x + y)^40", ["x", "y"])
    Traceback (most recent call last):
    dhkit.errors.ExpressionError: multiplies out to too many terms
    """

    def __init__(self, work: int = _DEFAULT_WORK) -> None:
        self.left = work
        self._tokens: list[Token[Budget | None]] = []

    def __enter__(self) -> Budget:
        self._tokens.append(_ACTIVE.set(self))
        return self

    def __exit__(self, *_: object) -> None:
        _ACTIVE.reset(self._tokens.pop())

    def __repr__(self) -> str:
        return repr_line("Budget", summary=f"{self.left} term products and sums left")


_ACTIVE: ContextVar[Budget | None] = ContextVar("budget", default=None)


def spend(work: int) -> None:
    """Take work from the current budget, if there is one.

    Raises
    ------
    ExpressionError
        The budget is used up.
    """
    budget = _ACTIVE.get()
    if budget is not None:
        budget.left -= work
        if budget.left < 0:
            raise ExpressionError("multiplies out to too many terms")


def budgeted() -> Budget:
    """Return the current budget, or a new one."""
    return _ACTIVE.get() or Budget()
