"""Distances of the solids that an arm is drawn with, along a motion, by coal at poses of Pinocchio's frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from dhkit.description import Array, Box, Capsule, Cylinder, Description, Sphere
from dhkit.model import pinocchio_model
from dhkit.model.mesh_reader import read_part
from dhkit.model.reference import import_pinocchio
from dhkit.model.shapes import link_parts
from dhkit.planning.obstacles import Floor
from dhkit.planning.second_check.instants import dense, derivative
from dhkit.planning.second_check.result import Claim
from dhkit.trajectories import Trajectory

FIRST_TURN = 0.06
"""Largest turn of a joint, rad (m if prismatic), between the states in which distances are measured first."""
HALVINGS = 12
"""Number of times that the time between two states is halved."""
MEASURED = 0.02
"""Distance, m, above the required one from which a lower bound of the distance is used instead."""
RANDOM_STATES = 100
"""Number of random configurations in which two solids that no motion can move apart are recognised."""
SAME_SHARE = 1e-3
"""Difference of two distances, as a share of the spread of all, below which they are the same."""
FIXED_SHARE = 0.1
"""Smallest share of random configurations with the same distance of two solids that no motion can move apart."""
CURVED = 1.1
"""Largest ratio of lengths, of a point's path between two states over the straight line."""
FLAT = 1e-6
"""Thickness of a mesh, as a share of its size and at least in m, below which it is made so thick."""
FAILED = -1e300
"""Largest number that coal returns where it finds a penetration and not its depth: in some symmetric places."""
SHIFT = np.array([3e-8, 1e-8, 2e-8])
"""Translation of one solid, m, with which coal is asked again then."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A solid on a link, or at rest in the world."""

    shape: Any
    """The solid as coal's shape."""
    link: int | None
    """Its link; None if it is at rest."""
    T: Array
    """Pose in the DH frame of the link, or in the world, shape (4, 4), m."""

    height: float | None = None
    """Height of a floor, m, world z; None for other solids."""

    @cached_property
    def radius(self) -> float:
        """Radius of a ball around the origin of T that contains the solid, m; infinite for a floor."""
        if self.height is not None:
            return np.inf
        self.shape.computeLocalAABB()
        return float(np.linalg.norm(self.shape.aabb_center) + self.shape.aabb_radius)

    def placed(self, frames: Array) -> Array:
        """Return the poses of the solid in the world, shape (N, 4, 4), from the frames of links (N, n + 1, 4, 4)."""
        if self.link is None:
            return np.broadcast_to(self.T, (len(frames), 4, 4))
        return np.asarray(frames[:, self.link] @ self.T)


class DrawnArm:
    """The solids of an arm along a motion.

    Raises
    ------
    ModelError
        Pinocchio is not installed, or a mesh cannot be read.
    """

    def __init__(self, description: Description, motion: Trajectory) -> None:
        import coal

        self._coal: Any = coal
        self._request = coal.DistanceRequest()
        self._request.enable_signed_distance = True
        self._request.gjk_tolerance = 1e-9
        self._request.epa_tolerance = 1e-9
        self._pin = import_pinocchio()
        self._model: Any = pinocchio_model(description)
        self._data = self._model.createData()
        self._frame_ids = [self._model.getFrameId(f"dh{i}") for i in range(description.n + 1)]
        self._solids = [
            Solid(self._shape(part.geometry, part), part.link, part.T_link_part)
            for part in link_parts(description)
        ]
        self.motion = motion
        self.instants = dense(motion, FIRST_TURN)
        self._along = self.frames(derivative(motion, self.instants, 0))
        self._anywhere = self.frames(_random_configurations(description))

    def frames(self, q: Array) -> Array:
        """Return the DH frames of the base and all links in the world, shape (N, n + 1, 4, 4), m, at q (N, n)."""
        found = np.empty((len(q), len(self._frame_ids), 4, 4))
        for k, state in enumerate(q):
            self._pin.framesForwardKinematics(self._model, self._data, state)
            for i, frame in enumerate(self._frame_ids):
                found[k, i] = self._data.oMf[frame].homogeneous
        return found

    def smallest(self, claim: Claim) -> tuple[float, Array]:
        """Return the smallest distance of the solids of a claim, m, and its instant, shape (2,)."""
        found = [
            self._smallest_of(pair, claim)
            for pair in self._pairs(claim)
            if not self._is_fixed(pair, claim)
        ]
        return min(found, key=lambda one: one[0], default=(np.inf, self.instants[0]))

    def _is_fixed(self, pair: tuple[Solid, Solid], claim: Claim) -> bool:
        """Return whether two solids stand in each other, and no motion moves them apart: an arm's foot and the floor.

        They are then too near in all random configurations, and in many of these by the same depth, that of the parts
        that do not move.
        """
        gaps = self._gaps(pair, self._anywhere, claim.refuting)
        if np.any(gaps >= claim.refuting):
            return False
        spread = float(np.ptp(gaps))
        return bool(np.mean(gaps >= gaps.max() - SAME_SHARE * spread) >= FIXED_SHARE)

    def _pairs(self, claim: Claim) -> Iterator[tuple[Solid, Solid]]:
        own = [solid for solid in self._solids if solid.link == claim.link]
        if isinstance(claim.other, int):
            others = [solid for solid in self._solids if solid.link == claim.other]
        elif isinstance(claim.other, Floor):
            below = self._coal.Halfspace(np.array([0.0, 0.0, 1.0]), claim.other.height)
            others = [Solid(below, None, np.eye(4), claim.other.height)]
        else:
            others = [
                Solid(self._shape(claim.other.geometry), None, np.array(claim.other.placement))
            ]
        return product(own, others)

    def _smallest_of(self, pair: tuple[Solid, Solid], claim: Claim) -> tuple[float, Array]:
        """Return the smallest distance of two solids along the motion, m, and its instant, shape (2,).

        Between two states of distances d1 and d2, between which the solids travel w, the distance is at least
        (d1 + d2 - w) / 2: where that is too little, the time between them is halved.
        """
        instants = self.instants
        frames = self._along
        enough = claim.kept + MEASURED
        gaps = self._gaps(pair, frames, enough)
        for _ in range(HALVINGS):
            least_between = (gaps[:-1] + gaps[1:] - _travels(pair, frames)) / 2
            is_inside_piece = instants[:-1, 0] == instants[1:, 0]
            places = np.flatnonzero((least_between < claim.refuting) & is_inside_piece)
            if not len(places) or gaps.min() < claim.refuting:
                break
            middle = (instants[places] + instants[places + 1]) / 2
            new = self.frames(derivative(self.motion, middle, 0))
            gaps = np.insert(gaps, places + 1, self._gaps(pair, new, enough))
            instants = np.insert(instants, places + 1, middle, axis=0)
            frames = np.insert(frames, places + 1, new, axis=0)
        k = int(np.argmin(gaps))
        return float(gaps[k]), instants[k]

    def _gaps(self, pair: tuple[Solid, Solid], frames: Array, enough: float) -> Array:
        """Return the distances of two solids, shape (N,), m; lower bounds where these are more than ``enough``."""
        first, second = pair
        T_first = first.placed(frames)
        T_second = second.placed(frames)

        # Lower bounds from the balls around the solids: |t_1 - t_2| - r_1 - r_2, and above a floor z_1 - height - r_1.
        if second.height is None:
            apart = np.linalg.norm(T_first[:, :3, 3] - T_second[:, :3, 3], axis=1)
            gaps: Array = apart - first.radius - second.radius
        else:
            gaps = T_first[:, 2, 3] - second.height - first.radius
        for k in np.flatnonzero(gaps < enough):
            gaps[k] = self._distance(first.shape, T_first[k], second.shape, T_second[k])
        return gaps

    def _distance(self, first: Any, T_first: Array, second: Any, T_second: Array) -> float:
        """Return the signed distance of two of coal's shapes, m."""
        coal = self._coal
        one = coal.Transform3s(np.array(T_first[:3, :3]), np.array(T_first[:3, 3]))
        for shift in (np.zeros(3), SHIFT, -SHIFT):
            other = coal.Transform3s(np.array(T_second[:3, :3]), T_second[:3, 3] + shift)
            found = float(
                coal.distance(first, one, second, other, self._request, coal.DistanceResult())
            )
            if found > FAILED:
                return found
        return -MEASURED  # inside each other, to a depth that is not known

    def _shape(self, geometry: object, part: Any = None) -> Any:
        """Return coal's shape of a solid; of a part that is a mesh, its convex hull."""
        coal = self._coal
        match geometry:
            case Box(size):
                return coal.Box(*(float(edge) for edge in size))
            case Sphere(radius):
                return coal.Sphere(float(radius))
            case Cylinder(radius, length):
                return coal.Cylinder(float(radius), float(length))
            case Capsule(radius, length):
                return coal.Capsule(float(radius), float(length))
        vertices = np.unique(read_part(part).vertices.astype(float), axis=0)
        spread = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
        if len(vertices) < 4 or spread[2] <= FLAT * spread[0]:
            # qhull needs a volume, and crashes without: copies of the corners around each give one.
            shift = max(FLAT * spread[0], FLAT)
            moves = shift * np.stack([-np.eye(3), np.eye(3)], axis=1).reshape(-1, 3)
            vertices = np.concatenate([vertices + move for move in moves])
        surface = coal.BVHModelOBBRSS()
        surface.beginModel(0, len(vertices))
        surface.addVertices(vertices)
        surface.endModel()
        surface.buildConvexHull(True, "Qt")  # with triangles, by qhull
        return surface.convex


def _travels(pair: tuple[Solid, Solid], frames: Array) -> Array:
    """Return bounds of the travel of the first solid's points, as seen from the second, shape (N - 1,), m.

    A point of the ball of radius r about the origin moves by at most |t1 - t0| + angle r.
    """
    first, second = pair
    T_second_first = np.linalg.inv(second.placed(frames)) @ first.placed(frames)
    of_origin = np.linalg.norm(np.diff(T_second_first[:, :3, 3], axis=0), axis=1)
    # The Frobenius norm of R1 - R0 is 2 sqrt(2) sin(angle / 2): the angle, or more, up to 2 rad.
    angle = np.linalg.norm(np.diff(T_second_first[:, :3, :3], axis=0), axis=(1, 2))
    travels: Array = CURVED * (of_origin + angle * first.radius)
    return travels


def _random_configurations(description: Description) -> Array:
    """Return random joint values, shape (RANDOM_STATES, n), rad and m: all turns, and strokes inside their limits."""
    numbers = description.numbers
    prismatic = numbers.prismatic
    bound = np.where(prismatic, description.reach or 1.0, np.pi)
    lower = np.where(prismatic & np.isfinite(numbers.lower), numbers.lower, -bound)
    upper = np.where(prismatic & np.isfinite(numbers.upper), numbers.upper, bound)
    random: Array = np.random.default_rng(1).uniform(
        lower, np.maximum(lower, upper), (RANDOM_STATES, description.n)
    )
    return random
