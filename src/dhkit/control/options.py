"""Options of simulations: of one arm, and of a batch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict

import numpy as np

from dhkit.control.plant import Plant
from dhkit.control.pushes import Push
from dhkit.control.runs import Progress
from dhkit.control.sensors import Sensors
from dhkit.control.timing import require_positive
from dhkit.description import Description, Robot, description_of
from dhkit.dynamics import Friction
from dhkit.kernels import check_whole
from dhkit.options import Options

TOLERANCES = (3e-14, 1e-3)
"""Range of tolerances: below, DOP853 cannot meet it in doubles; above, the result is not accurate."""
KEEP = ("final", "errors", "all")


@dataclass(frozen=True, kw_only=True, repr=False)
class SimulationOptions(Options):
    """Options of :func:`simulate` and :func:`compare`: the arm that moves, how it is sampled and how it is integrated.

    Raises
    ------
    ValueError, TypeError
        A value that does not fit: says which, and what is expected.

    Examples
    --------
    >>> rough = SimulationOptions(friction=True, rate=500.0)
    >>> rough.rate, rough.saturation
    (500.0, True)
    """

    plant: Robot | Plant | None = None
    """The arm that moves, if it differs from the robot: another payload, other parameters, the same joints. A
    :class:`Plant` has its own friction, restitution and pushes."""
    friction: bool | Friction | None = False
    """Friction of the joints: True for a step with stiction, or a smooth :class:`Friction`."""
    restitution: float | None = 0.0
    """Coefficient of restitution of the joint stops, 0 to 1; None for no stops."""
    pushes: Push | Sequence[Push] = ()
    """Wrenches on the tool or on links."""
    rate: float | None = 1000.0
    """Calls of the controller, Hz; None for a continuous controller."""
    plant_rate: float | None = None
    """Steps of the integration, Hz, a multiple of ``rate``; ``rate`` unless given. Of a continuous run, rows of its
    result a second; 1000 unless given."""
    sensors: Sensors | None = None
    """The sensors whose values the controller gets; the true state unless given. Sampled runs only."""
    saturation: bool = True
    """Whether torques are cut off at the drives' limits."""
    tolerance: float = 1e-13
    """Tolerance of a step of DOP853, relative and absolute. Continuous runs only."""
    progress: Progress | None = None
    """Called after every thousand rows; an exception in it ends the run."""

    def __post_init__(self) -> None:
        _require_sampling(self.rate, self.plant_rate, self.sensors, self.saturation)
        if not isinstance(self.plant, Plant | None):
            _require_arm(self.plant)
        has_own = (
            self.friction
            or self.restitution != 0.0
            or not isinstance(self.pushes, tuple)
            or self.pushes
        )
        if isinstance(self.plant, Plant) and has_own:
            raise ValueError(
                "plant is a Plant, which has its own friction, restitution and pushes; expected it alone"
            )
        if self.rate is None and self.sensors is not None:
            raise ValueError("sensors measure samples; expected a rate in Hz, or no sensors")
        if self.rate is None and not TOLERANCES[0] <= self.tolerance <= TOLERANCES[1]:
            raise ValueError(
                f"tolerance is {self.tolerance!r}; expected {TOLERANCES[0]:g} to {TOLERANCES[1]:g}"
            )

    def moving(self, description: Description) -> Plant:
        """Return the plant that moves instead of a robot.

        Raises
        ------
        ValueError
            It has other joints.
        """
        if isinstance(self.plant, Plant):
            moved = self.plant
        else:
            pushes = (self.pushes,) if isinstance(self.pushes, Push) else tuple(self.pushes)
            arm = description if self.plant is None else description_of(self.plant)
            moved = Plant(arm, Friction.chosen(self.friction), self.restitution, pushes)
        if moved.description.kinds != description.kinds:
            raise ValueError(
                f"the plant has joints {moved.description.kinds}; expected {description.kinds}"
            )
        return moved


class SimulationKeywords(TypedDict, total=False):
    """The fields of :class:`SimulationOptions`, as keyword arguments."""

    plant: Robot | Plant | None
    friction: bool | Friction | None
    restitution: float | None
    pushes: Push | Sequence[Push]
    rate: float | None
    plant_rate: float | None
    sensors: Sensors | None
    saturation: bool
    tolerance: float
    progress: Progress | None


@dataclass(frozen=True, kw_only=True, repr=False)
class BatchOptions(Options):
    """Options of :func:`simulate_batch`.

    Raises
    ------
    ValueError, TypeError
        A value that does not fit: says which, and what is expected.
    """

    plant: Robot | Sequence[Robot] | None = None
    """The arms that move: one for all runs, or one for each run (payloads, parameters); the robot unless given."""
    friction: bool | Friction | None = None
    """Friction model of all arms, of a width above 0 (smooth); None or False for none."""
    rate: float = 1000.0
    """Calls of the controller, Hz."""
    plant_rate: float | None = None
    """Steps of the integration, Hz, a multiple of ``rate``; ``rate`` unless given."""
    keep: str = "errors"
    """Stored results. ``"final"``: the last states; ``"errors"``: norms of the errors as well; ``"all"``: all states
    as well, at most 4 GB."""
    sensors: Sensors | None = None
    """The sensors whose values the controller gets; the true state unless given."""
    saturation: bool = True
    """Whether torques are cut off at the drives' limits."""
    threads: int = 1
    """Number of threads that share a large batch."""
    progress: Progress | None = None
    """Called after every thousand steps; an exception in it ends the run."""

    def __post_init__(self) -> None:
        for arm in self._arms:
            _require_arm(arm)
        if self.rate is None:
            raise ValueError("rate is None; expected Hz: a batch is sampled")
        _require_sampling(self.rate, self.plant_rate, self.sensors, self.saturation)
        if self.keep not in KEEP:
            raise ValueError(f"keep is {self.keep!r}; expected one of {', '.join(KEEP)}")
        chosen = Friction.chosen(self.friction)
        if chosen is not None and chosen.width == 0:
            raise ValueError(
                "a batch has no stiction; expected friction that is smooth, such as Friction(0.01)"
            )
        check_whole("threads", self.threads, 1)

    def moving(self, description: Description) -> tuple[Description, ...]:
        """Return the arms that move instead of a robot.

        Raises
        ------
        ValueError
            One has other joints.
        """
        arms = tuple(map(description_of, self._arms)) or (description,)
        for arm in arms:
            if arm.kinds != description.kinds:
                raise ValueError(f"a plant has joints {arm.kinds}; expected {description.kinds}")
        return arms

    @property
    def _arms(self) -> Sequence[Robot]:
        if self.plant is None:
            return ()
        return (
            (self.plant,)
            if isinstance(self.plant, str) or not isinstance(self.plant, Sequence)
            else self.plant
        )


class BatchKeywords(TypedDict, total=False):
    """The fields of :class:`BatchOptions`, as keyword arguments."""

    plant: Robot | Sequence[Robot] | None
    friction: bool | Friction | None
    rate: float
    plant_rate: float | None
    keep: str
    sensors: Sensors | None
    saturation: bool
    threads: int
    progress: Progress | None


def _require_arm(value: object) -> None:
    try:
        description_of(value)  # type: ignore[arg-type]  # which is what is asked
    except TypeError:
        raise TypeError(
            f"plant is {type(value).__name__}; expected an arm or its description"
        ) from None


def _require_sampling(
    rate: float | None, plant_rate: float | None, sensors: Sensors | None, saturation: bool
) -> None:
    require_positive(rate=rate, plant_rate=plant_rate)
    if sensors is not None and not isinstance(sensors, Sensors):
        raise TypeError(f"sensors is {type(sensors).__name__}; expected a Sensors, or None")
    if not isinstance(saturation, bool | np.bool_):
        raise TypeError(f"saturation is {saturation!r}; expected True or False")
