"""Options of a function as one frozen value: checked once, passed on whole, changed by ``dataclasses.replace``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from difflib import get_close_matches
from typing import Any, Self

from dhkit.display import repr_line


@dataclass(frozen=True, kw_only=True, repr=False)
class Options:
    """Base of option values.

    A function takes such a value as ``options``, or its fields as keyword arguments, or both.
    """

    @classmethod
    def of(cls, options: Self | None, keywords: Mapping[str, Any]) -> Self:
        """Return options, the defaults unless given, with those of the keyword arguments replaced.

        Raises
        ------
        TypeError
            A keyword that is not an option, or options of another function.
        """
        known = [field.name for field in fields(cls)]
        for name in keywords:
            if name not in known:
                close = get_close_matches(name, known, 1)
                hint = f"did you mean {close[0]}?" if close else f"known are {', '.join(known)}"
                raise TypeError(f"unexpected keyword argument {name!r}; {hint}")
        if options is None:
            return cls(**keywords)
        if not isinstance(options, cls):
            raise TypeError(f"options is {type(options).__name__}; expected {cls.__name__}")
        if type(options) is cls and not keywords:
            return options  # it was checked when it was made
        if further := [name for name in options.changed if name not in known]:
            raise TypeError(
                f"options has {', '.join(further)}; expected {cls.__name__}, with {', '.join(known)}"
            )
        return cls(**{**{name: getattr(options, name) for name in known}, **keywords})

    @property
    def changed(self) -> dict[str, Any]:
        """The options that are not the defaults."""
        values = {field.name: (getattr(self, field.name), field.default) for field in fields(self)}
        return {
            name: value for name, (value, default) in values.items() if not _is_same(value, default)
        }

    def __repr__(self) -> str:
        summary = ", ".join(f"{name}={value!r}" for name, value in self.changed.items())
        return repr_line(type(self).__name__, summary=summary)


def _is_same(value: object, default: object) -> bool:
    # Arrays are not defaults.
    return value is default or (type(value) is type(default) and bool(value == default))
