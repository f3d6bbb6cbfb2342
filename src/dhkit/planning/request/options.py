"""Options of the search for a motion: between configurations, and along a path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict

from numpy.typing import ArrayLike

from dhkit.description import Payload
from dhkit.options import Options
from dhkit.planning.certificate import CollisionAvoidance
from dhkit.planning.obstacles import Scene
from dhkit.planning.program import MAX_ITERATIONS, ProgressCall, Work
from dhkit.planning.request.request import require_limits
from dhkit.trajectories import Limits, Trajectory
from dhkit.trajectories.timing import check_duration


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class PathOptions(Options):
    """Options of :func:`along_path`, and of every other search: limits of the motion, and limits of the search.

    Raises
    ------
    ValueError, TypeError
        A value that does not fit: says which, and the expected one.
    """

    duration: float | None = None
    """Duration, s. For objectives without time :meth:`Planner.solve` takes twice that of cubics along the straight
    path unless it is given, and :func:`along_path` needs it."""
    limits: Limits | None = None
    """Limits of the joints; the robot's, or the planner's, unless given. Along a path with limits of jerk, the path
    must not have jumps of curvature."""
    payload: Payload | None = None
    """Payload of the tool."""
    obstacles: Scene = ()
    """Obstacles to avoid: ``Obstacle.box(...)`` and the like, ``Floor()``."""
    clearance: float = 0.01
    """Smallest distance from obstacles, m."""
    self_collision: bool = False
    """Whether links keep the clearance from each other too."""
    max_iterations: int = MAX_ITERATIONS
    """Limit of the search, iterations of the optimizer in all solutions for all branches. When it is reached, the
    search raises, or returns the best motion found so far. 250 states that are tested for collisions while paths are
    sampled count as one iteration."""
    time_limit: float | None = None
    """A limit of time, s, besides. With it the result depends on the speed and the load of the machine."""
    progress: ProgressCall | None = None
    """Called once in each iteration; an exception in it ends the search."""

    def __post_init__(self) -> None:
        if self.payload is not None and not isinstance(self.payload, Payload):
            raise TypeError(f"payload is {self.payload!r}; expected Payload(mass, com, inertia)")
        if self.progress is not None and not callable(self.progress):
            raise TypeError(f"progress is {self.progress!r}; expected a function")
        require_limits(self.limits)
        check_duration(self.duration)
        self.avoidance()
        self.work()

    def avoidance(self) -> CollisionAvoidance:
        """Return the obstacles of the motion and the clearance from them, checked."""
        return CollisionAvoidance.of(self.obstacles, self.clearance, self.self_collision)

    def work(self) -> Work:
        """Return the work of a search that begins now, with its limits."""
        return Work.limited(self.max_iterations, self.time_limit)


class PathKeywords(TypedDict, total=False):
    """The fields of :class:`PathOptions`, as keyword arguments."""

    duration: float | None
    limits: Limits | None
    payload: Payload | None
    obstacles: Scene
    clearance: float
    self_collision: bool
    max_iterations: int
    time_limit: float | None
    progress: ProgressCall | None


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class PlanOptions(PathOptions):
    """Options of :meth:`Planner.solve` and :meth:`dhkit.Arm.plan`: motions between configurations.

    Raises
    ------
    ValueError, TypeError
        A value that does not fit: says which, and the expected one.

    Examples
    --------
    >>> PlanOptions(self_collision=True, clearance=0.02)
    <PlanOptions: clearance=0.02, self_collision=True>
    """

    via: Sequence[ArrayLike | str] = ()
    """Places to pass in order, as start and goal, at times that are optimized."""
    coordinates: Sequence[str] | None = None
    """Names of the coordinates of poses that count, ``arm.ik(T).met``, for arms that meet no more of them; all six
    unless given."""
    start_velocity: ArrayLike | None = None
    """Joint rates at the start, shape (n,), rad/s and m/s; at rest unless given."""
    goal_velocity: ArrayLike | None = None
    """Joint rates at the goal, likewise."""
    warm: Trajectory | None = None
    """A similar motion, as the initial guess."""
    compare: bool = False
    """Whether the report includes classical motions and the cost on a coarser mesh; ``Arm.plan`` does unless told."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.warm is not None and not isinstance(self.warm, Trajectory):
            raise TypeError(f"warm is {type(self.warm).__name__}; expected a Trajectory")


class PlanKeywords(PathKeywords, total=False):
    """The fields of :class:`PlanOptions`, as keyword arguments."""

    via: Sequence[ArrayLike | str]
    coordinates: Sequence[str] | None
    start_velocity: ArrayLike | None
    goal_velocity: ArrayLike | None
    warm: Trajectory | None
    compare: bool
