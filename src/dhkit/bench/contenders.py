"""Contenders: ways to compute a quantity, set up for a robot, that can be timed and asked for their answers."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import cycle, islice
from typing import Any, TypeAlias

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.display import counted, repr_line
from dhkit.errors import from_checkout
from dhkit.verification import random_states

QUANTITIES = (
    "fk",
    "ik",
    "ik_numeric",
    "jacobian",
    "inverse_dynamics",
    "mass_matrix",
    "forward_dynamics",
    "inverse_dynamics_derivatives",
    "regressor",
)
"""Quantities that are timed; each is the name of a method of :class:`dhkit.Arm`."""

INVERSE_KINEMATICS = ("ik", "ik_numeric")
"""Quantities whose answers are joint values for a pose."""

Call: TypeAlias = Callable[[], object]


class UnavailableError(Exception):
    """A contender cannot take part; the message is the reason."""


class Mode(Enum):
    """Way in which a contender is called."""

    SINGLE = "single"
    """One call for each item, from a Python loop."""
    FEW = "few"
    """One call for a few items, from a Python loop."""
    BATCH = "batch"
    """One call for all items."""


@dataclass(frozen=True, eq=False)
class Workload:
    """The states that every contender gets.

    Attributes
    ----------
    arm
        The robot.
    q, qd, qdd
        Random joint values, rates and accelerations, shape (N, n), in rad, m and s.
    threads
        Number of threads that a contender may use, if it has threads.
    """

    arm: Arm
    q: Array
    qd: Array
    qdd: Array
    threads: int = 1

    @classmethod
    def of(cls, arm: Arm, batch: int, threads: int, seed: int) -> Workload:
        """Return ``batch`` random states.

        Revolute joints are over a full turn whatever their limits, prismatic ones within their limits, rates and
        accelerations from -1 to 1 in rad, m and s.
        """
        q = random_states(arm.description, batch, seed)
        rng = np.random.default_rng(seed + 1)
        return cls(arm, q, rng.uniform(-1, 1, q.shape), rng.uniform(-1, 1, q.shape), threads)

    @cached_property
    def T(self) -> Array:
        """The tool's poses, shape (N, 4, 4), m, world."""
        return self.arm.fk(self.q)

    @cached_property
    def q_inside(self) -> Array:
        """Joint values inside the limits, and from -pi to pi or -1 to 1 m without, shape (N, n), rad and m."""
        numbers = self.arm.description.numbers
        room = np.where(numbers.prismatic, 1.0, np.pi)
        lower = np.where(np.isfinite(numbers.lower), numbers.lower, -room)
        upper = np.where(np.isfinite(numbers.upper), numbers.upper, room)
        return np.random.default_rng(2).uniform(lower, upper, self.q.shape)

    @cached_property
    def T_inside(self) -> Array:
        """The tool's poses of ``q_inside``, shape (N, 4, 4), m, world."""
        return self.arm.fk(self.q_inside)

    @cached_property
    def tau(self) -> Array:
        """The motion's torques, shape (N, n), N m and N."""
        return self.arm.inverse_dynamics(self.q, self.qd, self.qdd)

    def inputs(self, quantity: str) -> tuple[Array, ...]:
        """Return the arrays that a quantity is computed from, each with N as its first axis."""
        match quantity:
            case "ik":
                return (self.T,)
            case "ik_numeric":
                return (self.T_inside,)
            case "inverse_dynamics" | "inverse_dynamics_derivatives" | "regressor":
                return self.q, self.qd, self.qdd
            case "forward_dynamics":
                return self.q, self.qd, self.tau
        return (self.q,)

    def __repr__(self) -> str:
        size = f"{counted(len(self.q), 'state')}, {counted(self.threads, 'thread')}"
        return repr_line("Workload", self.arm.name, size)


@dataclass(frozen=True)
class Task:
    """A contender set up for a workload.

    Attributes
    ----------
    prepare
        Returns the call that is timed, for a number of items; work that a user does only once is done here.
    answers
        Returns the results of the first k items in dhkit's conventions: of each item fk (4, 4), jacobian (6, n),
        ik and ik_numeric (solutions, n), torques and accelerations (n,), mass_matrix (n, n), derivatives (3, n, n),
        regressor (n, 10 n).
    """

    prepare: Callable[[int], Call]
    answers: Callable[[int], Sequence[Array]]

    def __repr__(self) -> str:
        return "<Task>"


@dataclass(frozen=True)
class Contender:
    """A way to compute a quantity.

    Attributes
    ----------
    name
        Name of the package and of the function, as in ``EAIK IK_batched``.
    quantity
        One of :data:`QUANTITIES`.
    mode
        How the contender is called.
    setup
        Builds the package's model of the robot; raises :class:`UnavailableError` with the reason if it cannot.
    own
        Whether the contender is dhkit itself.
    """

    name: str
    quantity: str
    mode: Mode
    setup: Callable[[Workload], Task]
    own: bool = False

    def __repr__(self) -> str:
        return repr_line("Contender", summary=f"{self.quantity} by {self.name}, {self.mode.value}")


def import_peer(module: str) -> Any:
    """Import a package that dhkit does not need.

    Raises
    ------
    UnavailableError
        The package is not installed, or cannot be imported.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise UnavailableError(
            f"not installed: no module named {error.name}; {from_checkout('bench')}"
        ) from None
    except ImportError as error:
        raise UnavailableError(f"cannot be imported: {error}") from None


def one_by_one(function: Callable[..., object], inputs: Sequence[Any]) -> Callable[[int], Call]:
    """Return the ``prepare`` of a task that calls a function for one input after the other, again from the first.

    Each input is one argument, or a tuple of arguments.
    """

    def prepare(items: int) -> Call:
        chosen = list(islice(cycle(inputs), items))

        def call_with_one() -> None:
            for value in chosen:
                function(value)

        def call_with_several() -> None:
            for values in chosen:
                function(*values)

        if not isinstance(chosen[0], tuple):
            return call_with_one
        if len(chosen[0]) > 1:
            return call_with_several
        chosen = [value for (value,) in chosen]
        return call_with_one

    return prepare


def single_task(
    function: Callable[..., Any],
    inputs: Iterable[Any],
    answer: Callable[[Any], Array] = lambda result: result,
) -> Task:
    """Return the task of calling a function for one input after the other; ``answer`` converts its results."""
    inputs = list(inputs)

    def answers(count: int) -> list[Array]:
        arguments = (value if isinstance(value, tuple) else (value,) for value in inputs[:count])
        return [answer(function(*values)) for values in arguments]

    return Task(one_by_one(function, inputs), answers)
