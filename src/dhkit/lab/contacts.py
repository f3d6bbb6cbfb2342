"""Links of an arm that touch each other, as capsules."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.errors import DhkitError
from dhkit.lab.jobs import Job, Jobs

SETTLE = 0.5
"""s without another arm before one is prepared: an arm that a person edits changes again soon."""


class Contacts:
    """What :func:`touching` says of one arm, once that is fast.

    The first answer for an arm takes 0.2 to 1.5 s (capsules are fitted, and coal is imported), which nobody waits for:
    until it is there, nothing is said to touch.
    """

    def __init__(self) -> None:
        self._jobs = Jobs(lambda state: None)
        self._arm: Arm | None = None

    def prepare(self, arm: Arm, done: Callable[[], None]) -> None:
        """Prepare in the background for an arm, which takes the place of any other; then call ``done``."""
        self._arm = None

        def work(job: Job) -> None:
            job.wait(SETTLE)
            touching(arm, np.zeros((1, arm.n)))

        def ready(_: None) -> None:
            self._arm = arm
            done()

        self._jobs.start("contacts", work, ready)

    def links(self, arm: Arm, q: Array) -> list[int]:
        """Return the two links that penetrate each other most at joint values, shape (n,); 0 is the base."""
        return touching(arm, q[None])[0] if self._arm is arm else []

    def close(self) -> None:
        """End what runs."""
        self._jobs.close()


def touching(arm: Arm, q: Array) -> list[list[int]]:
    """Return for each of the joint values, shape (N, n), the two links that penetrate each other most.

    Links are numbered from 1, the base is 0. The list of a state is empty where no links touch, or where it cannot be
    told: the arm has no shapes.
    """
    try:
        apart = arm.distance(q, self_collision=True).itself >= 0
        pairs = [None if free else arm.distance(x, self_collision=True).pair for free, x in zip(apart, q, strict=True)]
    except DhkitError:
        return [[] for _ in q]
    return [[] if pair is None else [_number(name) for name in pair] for pair in pairs]


def _number(name: str) -> int:
    """Return the number of a link that :class:`dhkit.Distances` names ``the base`` or ``link 3``."""
    return 0 if name == "the base" else int(name.removeprefix("link "))
