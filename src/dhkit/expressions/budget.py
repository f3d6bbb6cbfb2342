"""How much work exact arithmetic may take: what bounds the time that hostile text costs."""

from __future__ import annotations

from contextvars import ContextVar, Token
from types import TracebackType

from dhkit.display import repr_line
from dhkit.errors import ExpressionError

DEFAULT_WORK = 100_000
"""Term products and sums: about half a second. A file of the library takes 1,000 at most, an arm of symbols with a
joint locked at 60 degrees 20,000."""


class Budget:
    """Work that is left to the exact arithmetic inside a ``with`` block, in this thread.

    Examples
    --------
    >>> from dhkit.expressions import parse
    >>> with Budget(100):
    ...     parse("(x + y)^40", ["x", "y"])
    Traceback (most recent call last):
    dhkit.errors.ExpressionError: multiplies out to too many terms
    """

    def __init__(self, work: int = DEFAULT_WORK) -> None:
        self.left = work
        self._tokens: list[Token[Budget | None]] = []

    def __enter__(self) -> Budget:
        self._tokens.append(_ACTIVE.set(self))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        _ACTIVE.reset(self._tokens.pop())

    def __repr__(self) -> str:
        return repr_line("Budget", said=f"{self.left} term products and sums left")


_ACTIVE: ContextVar[Budget | None] = ContextVar("budget", default=None)


def spend(work: int) -> None:
    """Take from the budget that is in force, if any.

    Raises
    ------
    ExpressionError
        Nothing is left of it.
    """
    budget = _ACTIVE.get()
    if budget is not None:
        budget.left -= work
        if budget.left < 0:
            raise ExpressionError("multiplies out to too many terms")


def budgeted() -> Budget:
    """Return the budget in force, or a fresh one."""
    return _ACTIVE.get() or Budget()
