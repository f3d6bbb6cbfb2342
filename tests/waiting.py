"""Waiting for events. Limits end only tests that hang: none is near what a busy machine needs."""

import time

HANGS = 120.0
"""Seconds after which an event is not awaited any more."""
PERIOD = 0.01
"""Seconds between two looks."""


def wait_for(event, what="the event"):
    """Return what ``event()`` returns once that is true."""
    deadline = time.monotonic() + HANGS
    while not (found := event()):
        assert time.monotonic() < deadline, f"{what} did not come within {HANGS:g} s"
        time.sleep(PERIOD)
    return found
