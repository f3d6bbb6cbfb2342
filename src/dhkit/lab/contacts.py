"""Contacts: two links of an arm, or a link and an obstacle, that are nearest to each other or touch."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypedDict

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.errors import DhkitError
from dhkit.lab.jobs import Job, Jobs
from dhkit.planning.obstacles import Scene, may_touch, nearest_links, nearest_obstacle

PREPARATION_DELAY = 0.5
"""Time without another arm before an arm is prepared, s: an arm that a person edits changes again soon."""


class NearestState(TypedDict):
    """Two links of an arm that are nearest to each other, or a link and an obstacle, as pages show them."""

    links: list[int]
    """Numbers of the two links, or of the one, 0 for the base."""
    obstacle: str | None
    """Name of the obstacle; None for two links."""
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

    def nearest(self, arm: Arm, q: Array, scene: Scene = ()) -> NearestState | None:
        """Return :func:`nearest`; None for an arm that is not prepared."""
        return nearest(arm, q, scene) if self._arm is arm else None

    def close(self) -> None:
        """End the preparation."""
        self._jobs.close()


def nearest(arm: Arm, q: Array, scene: Scene = ()) -> NearestState | None:
    """Return two links, or a link and an obstacle, that are nearest at joint values, shape (n,), rad and m.

    Where coal is not installed they are two links whose capsules overlap, and which may touch. None where no distance
    is checked, or nothing is known of the links.
    """
    try:
        links = nearest_links(arm.description, q)
        beside = nearest_obstacle(arm.description, q, scene)
    except DhkitError:
        return _by_capsules(arm, q)
    if beside is not None and (links is None or beside.distance < links.distance):
        points = beside.points.tolist()
        return NearestState(
            links=[beside.link.link],
            obstacle=beside.obstacle.name,
            distance=beside.distance,
            points=points,
        )
    if links is None:
        return None
    numbers = [links.first.link, links.second.link]
    return NearestState(
        links=numbers, obstacle=None, distance=links.distance, points=links.points.tolist()
    )


def _by_capsules(arm: Arm, q: Array) -> NearestState | None:
    try:
        bodies = may_touch(arm.description, q)
    except DhkitError:  # a mesh that cannot be read
        return None
    if bodies is None:
        return None
    return NearestState(
        links=[body.link for body in bodies], obstacle=None, distance=None, points=None
    )


def contacts_along(arm: Arm, q: Array, scene: Scene = ()) -> list[NearestState | None]:
    """Return :func:`nearest` where something touches or may touch, else None, at joint values (N, n), rad and m."""
    found = (nearest(arm, state, scene) for state in q)
    return [
        one if one is not None and (one["distance"] is None or one["distance"] < 0) else None
        for one in found
    ]
