"""What one page has been sent and has drawn: a state machine without input or output."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum

__all__ = ["Session", "Slot"]


class Slot(IntEnum):
    """What the messages of a scene replace each other by, in the order a new page needs them.

    A page's state is the latest message of every slot: replaying them is a full resynchronisation.
    """

    SCENE = 0
    FRAMES = 1
    TRACE = 2
    POINTS = 3
    ELLIPSOIDS = 4
    GHOSTS = 5
    OBSTACLES = 6
    MOTION = 7
    """A pose or an animation."""


class Session:
    """Messages on their way to one page: at most one that it has not drawn yet, and per slot only the latest waits.

    Examples
    --------
    >>> session = Session({})
    >>> session.offer(Slot.MOTION, 1, b"first")
    >>> session.next()
    b'first'
    >>> session.offer(Slot.MOTION, 2, b"second")
    >>> session.offer(Slot.MOTION, 3, b"third")
    >>> session.next() is None
    True
    >>> session.shown(1)
    >>> session.next()
    b'third'
    """

    def __init__(self, state: Mapping[Slot, tuple[int, bytes]]) -> None:
        self._waiting = dict(state)
        self._unshown: int | None = None

    @property
    def settled(self) -> bool:
        """Whether the page has drawn everything."""
        return not self._waiting and self._unshown is None

    def offer(self, slot: Slot, sequence: int, message: bytes) -> None:
        """Take a message in place of the one that waits in its slot."""
        self._waiting[slot] = (sequence, message)

    def next(self) -> bytes | None:
        """Return the message to send now; None while one is not drawn yet, or nothing waits."""
        if self._unshown is not None or not self._waiting:
            return None
        self._unshown, message = self._waiting.pop(min(self._waiting))
        return message

    def shown(self, sequence: int) -> None:
        """Take note that the page has drawn a message; of another than the one under way, nothing."""
        if sequence == self._unshown:
            self._unshown = None
