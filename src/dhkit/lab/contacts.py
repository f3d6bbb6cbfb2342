"""Contacts: links of an arm that touch each other, as capsules."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.errors import DhkitError
from dhkit.lab.jobs import Job, Jobs

PREPARATION_DELAY = 0.5
"""Time without another arm before an arm is prepared, s: an arm that a person edits changes again soon."""


class Contacts:
    """The result of :func:`touching_links` for one arm, once it is fast to compute.

    The first computation for an arm takes 0.2 to 1.5 s, since capsules are fitted and coal is imported. Nobody waits
    for it: until it is done, no links are reported to touch.
    """

    def __init__(self) -> None:
        self._jobs = Jobs()
        self._arm: Arm | None = None

    def prepare(self, arm: Arm, done: Callable[[], None]) -> None:
        """Prepare for an arm in the background, instead of any other arm; then call ``done``."""
        self._arm = None

        def work(job: Job) -> None:
            job.wait(PREPARATION_DELAY)
            touching_links(arm, np.zeros((1, arm.n)))

        def take(_: None) -> None:
            self._arm = arm
            done()

        self._jobs.start("contacts", work, take)

    def links(self, arm: Arm, q: Array) -> list[int]:
        """Return the two links that penetrate each other most at joint values, shape (n,), rad and m; 0 is the base.

        The list is empty where no links touch, and for an arm that is not prepared.
        """
        return touching_links(arm, q[None])[0] if self._arm is arm else []

    def close(self) -> None:
        """End the preparation."""
        self._jobs.close()


def touching_links(arm: Arm, q: Array) -> list[list[int]]:
    """Return the two links that penetrate each other most, for each of the joint values, shape (N, n), rad and m.

    Links are numbered from 1, the base is 0. The list of a state is empty where no links touch, and where the arm has
    no shapes that could.
    """
    try:
        free = arm.distance(q, self_collision=True).itself >= 0
        pairs = [None if f else arm.distance(x, self_collision=True).pair for f, x in zip(free, q, strict=True)]
    except DhkitError:
        return [[] for _ in q]
    return [[] if pair is None else [_link_number(name) for name in pair] for pair in pairs]


def _link_number(name: str) -> int:
    """Return the number of a link that distances name "the base" or "link 3"."""
    return 0 if name == "the base" else int(name.removeprefix("link "))
