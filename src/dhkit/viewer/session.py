"""A session: the messages that one page has been sent and has drawn; a state machine without input or output."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum

from dhkit.viewer.bounds import BOUNDS
from dhkit.viewer.protocol import Samples, stamped

_MAX_SLOT = 1_000
"""A bound above all slots, so that messages are sent by their age after the scene."""


class Slot(IntEnum):
    """Slots of messages, in the order a new page needs them: a message replaces the one before it in its slot.

    A page's state is the latest message of every slot: replaying them synchronises a page fully.
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


OF_ONE_ARM = (Slot.TRACE, Slot.POINTS, Slot.ELLIPSOIDS, Slot.GHOSTS, Slot.MOTION)
"""Slots that a new scene clears: their messages were about the arm before."""


class Session:
    """Messages on their way to one page, in two lanes: pictures, and the states and samples of panels.

    At most one picture is under way, since drawing takes time, and at most ``BOUNDS.panel_messages`` messages of
    panels, which a page takes at once; neither lane waits for the other. In each slot only the latest message waits.

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
    >>> session.offer(Slot.PANELS, 4, b"a panel's state")
    >>> session.next()
    b"a panel's state"
    >>> session.acknowledge(1)
    >>> session.next()
    b'third'
    """

    def __init__(self, state: Mapping[int, tuple[int, bytes | Samples]]) -> None:
        # A new page needs the slots in their order. Later the message that has waited longest is next: poses that come
        # as fast as they are drawn would otherwise leave no turn to anything else.
        self._waiting = {
            slot: (slot, sequence, message) for slot, (sequence, message) in state.items()
        }
        self._unshown: dict[bool, set[int]] = {False: set(), True: set()}
        """Sequence numbers under way, by whether their slot is a panel's."""

    @property
    def settled(self) -> bool:
        """Whether the page has drawn everything."""
        return not self._waiting and not any(self._unshown.values())

    def offer(self, slot: int, sequence: int, message: bytes | Samples) -> None:
        """Queue a message instead of the one that waits in its slot; samples are added to those that wait."""
        if slot == Slot.SCENE:
            for other in OF_ONE_ARM:
                self._waiting.pop(other, None)
        new_turn = slot if slot == Slot.SCENE else _MAX_SLOT + sequence
        turn, _, waiting = self._waiting.get(slot, (new_turn, 0, None))
        if isinstance(message, Samples) and isinstance(waiting, Samples):
            message = waiting.followed_by(message)
        self._waiting[slot] = (turn, sequence, message)

    def next(self) -> bytes | None:
        """Return a message to send now; None if enough are under way, or nothing waits."""
        capacity = {False: 1, True: BOUNDS.panel_messages}
        free_lanes = {
            lane for lane, unshown in self._unshown.items() if len(unshown) < capacity[lane]
        }
        sendable = [slot for slot in self._waiting if (slot >= Slot.PANELS) in free_lanes]
        if not sendable:
            return None
        slot = min(sendable, key=lambda slot: self._waiting[slot][0])
        _, sequence, message = self._waiting.pop(slot)
        self._unshown[slot >= Slot.PANELS].add(sequence)
        return stamped(message.encoded(), sequence) if isinstance(message, Samples) else message

    def acknowledge(self, sequence: int) -> None:
        """Note that the page has drawn a message; the number of a message that is not under way is ignored."""
        for lane in self._unshown.values():
            lane.discard(sequence)
