"""What one page has been sent and has drawn: a state machine without input or output."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum

from dhkit.viewer.protocol import stamped
from dhkit.viewer.streams import Samples

__all__ = ["Session", "Slot"]


LAST_SLOT = 1_000
"""Slots are below."""


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
    PANELS = 100
    """The first of the states and samples of panels, each with a slot of its own."""


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

    def __init__(self, state: Mapping[int, tuple[int, bytes | Samples]]) -> None:
        # A new page needs the slots in their order; later whatever has waited longest is next, or poses that come as
        # fast as they are drawn would leave nothing else a turn.
        self._waiting = {slot: (slot, sequence, message) for slot, (sequence, message) in state.items()}
        self._unshown: int | None = None

    @property
    def settled(self) -> bool:
        """Whether the page has drawn everything."""
        return not self._waiting and self._unshown is None

    def offer(self, slot: int, sequence: int, message: bytes | Samples) -> None:
        """Take a message in place of the one that waits in its slot; samples join those that wait."""
        turn, _, waiting = self._waiting.get(slot, (_turn(slot, sequence), 0, None))
        if isinstance(message, Samples) and isinstance(waiting, Samples):
            message = waiting.followed_by(message)
        self._waiting[slot] = (turn, sequence, message)

    def next(self) -> bytes | None:
        """Return the message to send now; None while one is not drawn yet, or nothing waits."""
        if self._unshown is not None or not self._waiting:
            return None
        slot = min(self._waiting, key=lambda slot: self._waiting[slot][0])
        _, self._unshown, message = self._waiting.pop(slot)
        return stamped(message.encoded(), self._unshown) if isinstance(message, Samples) else message

    def shown(self, sequence: int) -> None:
        """Take note that the page has drawn a message; of another than the one under way, nothing."""
        if sequence == self._unshown:
            self._unshown = None


def _turn(slot: int, sequence: int) -> int:
    """Return when a message of a slot is next: the scene first, others by their age."""
    return Slot.SCENE if slot == Slot.SCENE else LAST_SLOT + sequence
