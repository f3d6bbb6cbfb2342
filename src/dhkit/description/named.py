"""An immutable, ordered mapping from names to values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TypeVar

from dhkit.display import LONGEST_LINE, counted, repr_line

V = TypeVar("V")


class Named(Mapping[str, V]):
    """Values by name, in the order given; hashable and picklable, so that frozen values can hold it.

    Examples
    --------
    >>> lengths = Named({"l1": 0.5, "l2": 0.3})
    >>> lengths["l2"], list(lengths)
    (0.3, ['l1', 'l2'])
    """

    __slots__ = ("_items",)

    def __init__(self, items: Mapping[str, V] | Iterable[tuple[str, V]] = ()) -> None:
        self._items: dict[str, V] = dict(items)

    def __getitem__(self, name: str) -> V:
        return self._items[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __hash__(self) -> int:
        return hash(frozenset(self._items.items()))

    def __reduce__(self) -> tuple[type[Named[V]], tuple[dict[str, V]]]:
        return Named, (self._items,)

    def __repr__(self) -> str:
        text = f"Named({self._items!r})"
        # Mappings of arrays print many long lines, so they are summarized.
        if len(text) <= LONGEST_LINE and text.isprintable() and "array(" not in text:
            return text
        return repr_line("Named", counted(len(self), "value"), ", ".join(self._items))
