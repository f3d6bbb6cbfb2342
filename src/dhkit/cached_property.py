"""``cached_property`` without a lock, as Python has it from version 3.12 on.

That of Python 3.11 holds a lock of the whole class while a value is computed. A process that is forked meanwhile by
another thread finds the lock taken for ever, and hangs at its first look at any object of the class.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar, overload

Value = TypeVar("Value")


class cached_property(Generic[Value]):  # noqa: N801 - as functools names it
    """A property that is computed once for each object; two threads that ask first may both compute it."""

    def __init__(self, function: Callable[[Any], Value]) -> None:
        self.function = function
        self.__doc__ = function.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, instance: None, owner: type | None = None) -> cached_property[Value]: ...

    @overload
    def __get__(self, instance: object, owner: type | None = None) -> Value: ...

    def __get__(
        self, instance: object | None, owner: type | None = None
    ) -> cached_property[Value] | Value:
        if instance is None:
            return self
        # Found by the object itself from now on, since this class has no __set__.
        value = instance.__dict__[self.name] = self.function(instance)
        return value
