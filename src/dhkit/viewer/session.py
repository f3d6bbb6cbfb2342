"""What one page has been sent and has drawn: a state machine without input or output."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum

from dhkit.viewer.protocol import stamped
from dhkit.viewer.streams import Samples

STATES = 16
"""Messages of panels under way: an edit of the table changes the state of most panels."""
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


OF_ONE_ARM = (Slot.TRACE, Slot.POINTS, Slot.ELLIPSOIDS, Slot.GHOSTS, Slot.MOTION)
"""What a new scene takes away: it was drawn for the arm before."""


class Session:
    """Messages on their way to one page, in two lanes: pictures, and the states and samples of panels.

    One picture at most is under way, which the display takes its time for, and :data:`STATES` messages of panels, which
    the page takes at once; neither lane waits for the other. Per slot only the latest waits.

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
    >>> session.shown(1)
    >>> session.next()
    b'third'
    """

    def __init__(self, state: Mapping[int, tuple[int, bytes | Samples]]) -> None:
        # A new page needs the slots in their order; later whatever has waited longest is next, or poses that come as
        # fast as they are drawn would leave nothing else a turn.
        self._waiting = {slot: (slot, sequence, message) for slot, (sequence, message) in state.items()}
        self._unshown: dict[bool, set[int]] = {False: set(), True: set()}
        """Sequence numbers under way, by whether they are of a panel."""

    @property
    def settled(self) -> bool:
        """Whether the page has drawn everything."""
        return not self._waiting and not any(self._unshown.values())

    def offer(self, slot: int, sequence: int, message: bytes | Samples) -> None:
        """Take a message in place of the one that waits in its slot; samples join those that wait."""
        if slot == Slot.SCENE:
            for other in OF_ONE_ARM:
                self._waiting.pop(other, None)
        turn, _, waiting = self._waiting.get(slot, (_turn(slot, sequence), 0, None))
        if isinstance(message, Samples) and isinstance(waiting, Samples):
            message = waiting.followed_by(message)
        self._waiting[slot] = (turn, sequence, message)

    def next(self) -> bytes | None:
        """Return a message to send now; None where enough are under way, or nothing waits."""
        full = {lane: len(self._unshown[lane]) >= most for lane, most in ((False, 1), (True, STATES))}
        free = [slot for slot in self._waiting if not full[_of_panel(slot)]]
        if not free:
            return None
        slot = min(free, key=lambda slot: self._waiting[slot][0])
        _, sequence, message = self._waiting.pop(slot)
        self._unshown[_of_panel(slot)].add(sequence)
        return stamped(message.encoded(), sequence) if isinstance(message, Samples) else message

    def shown(self, sequence: int) -> None:
        """Take note that the page has drawn a message; of one that is not under way, nothing."""
        for lane in self._unshown.values():
            lane.discard(sequence)


def _of_panel(slot: int) -> bool:
    """Return whether a slot is a panel's."""
    return slot >= Slot.PANELS


def _turn(slot: int, sequence: int) -> int:
    """Return when a message of a slot is next: the scene first, others by their age."""
    return Slot.SCENE if slot == Slot.SCENE else LAST_SLOT + sequence
