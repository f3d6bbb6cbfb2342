"""Properties that are computed once, and a fork while another thread computes one. Module: cached_property."""

import os
import threading

import pytest

from dhkit.cached_property import cached_property


class Square:
    """A value whose property may wait for an event."""

    def __init__(self, side, event=None):
        self.side, self.event, self.computed = side, event, 0

    @cached_property
    def area(self):
        """The area."""
        self.computed += 1
        if self.event is not None:
            self.event.wait()
        return self.side**2


def test_a_value_is_computed_once_and_belongs_to_its_object():
    three, four = Square(3), Square(4)
    assert (three.area, three.area, four.area) == (9, 9, 16)
    assert three.computed == 1
    del three.area
    assert three.area == 9 and three.computed == 2
    assert Square.area.__doc__ == "The area."


@pytest.mark.skipif(not hasattr(os, "fork"), reason="fork of POSIX")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_a_fork_while_another_thread_computes_does_not_hang():
    """With Python 3.11's own, the child would wait for the lock of the other thread."""
    event = threading.Event()
    slow = Square(2, event)
    thread = threading.Thread(target=lambda: slow.area)
    thread.start()
    while not slow.computed:
        pass
    child = os.fork()
    if child == 0:
        os._exit(Square(3).area)
    _, status = os.waitpid(child, 0)
    event.set()
    thread.join()
    assert os.waitstatus_to_exitcode(status) == 9
