"""Contacts: the two links of an arm that are nearest to each other or touch, as pages show them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypedDict

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.errors import DhkitError
from dhkit.lab.jobs import Job, Jobs
from dhkit.planning.obstacles import may_touch, nearest_links

PREPARATION_DELAY = 0.5
"""Time without another arm before an arm is prepared, s: an arm that a person edits changes again soon."""


class NearestState(TypedDict):
    """The two links of an arm that are nearest to each other, as pages show them."""

    links: list[int]
    """Their numbers, 0 for the base."""
    distance: float | None
    """Distance of their shapes, m, negative in a penetration; None if only their capsules are known to overlap."""
    points: list[list[float]] | None
    """The nearest points, shape (2, 3), m, world; None without a distance."""


class Contacts:
    """The result of :func:`nearest` for one arm, once it is fast to compute.

    The first computation for an arm takes 0.2 to 1.5 s, since hulls and capsules are fitted and coal is imported.
    Nobody waits for it: until it is done, nothing is known of the links.
    """

    def __init__(self) -> None:
        self._jobs = Jobs()
        self._arm: Arm | None = None

    def prepare(self, arm: Arm, done: Callable[[], None]) -> None:
        """Prepare for an arm in the background, instead of any other arm; then call ``done``."""
        self._arm = None

        def work(job: Job) -> None:
            job.wait(PREPARATION_DELAY)
            nearest(arm, np.zeros(arm.n))

        def take(_: None) -> None:
            self._arm = arm
            done()

        self._jobs.start("contacts", work, take)

    def nearest(self, arm: Arm, q: Array) -> NearestState | None:
        """Return :func:`nearest`; None for an arm that is not prepared."""
        return nearest(arm, q) if self._arm is arm else None

    def close(self) -> None:
        """End the preparation."""
        self._jobs.close()


def nearest(arm: Arm, q: Array) -> NearestState | None:
    """Return the two links of an arm that are nearest to each other at joint values, shape (n,), rad and m.

    Where coal is not installed they are two links whose capsules overlap, and which may touch. None where no two links
    are checked, or nothing is known of them.
    """
    try:
        found = nearest_links(arm.description, q)
    except DhkitError:
        return _by_capsules(arm, q)
    if found is None:
        return None
    links = [found.first.link, found.second.link]
    return NearestState(links=links, distance=found.distance, points=found.points.tolist())


def _by_capsules(arm: Arm, q: Array) -> NearestState | None:
    try:
        bodies = may_touch(arm.description, q)
    except DhkitError:  # a mesh that cannot be read
        return None
    if bodies is None:
        return None
    return NearestState(links=[body.link for body in bodies], distance=None, points=None)


def contacts_along(arm: Arm, q: Array) -> list[NearestState | None]:
    """Return :func:`nearest` where links touch or may touch, None elsewhere, for joint values (N, n), rad and m."""
    found = (nearest(arm, state) for state in q)
    return [one if one is not None and (one["distance"] is None or one["distance"] < 0) else None for one in found]
