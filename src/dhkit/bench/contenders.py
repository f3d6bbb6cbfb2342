"""What a contender is: a way to compute a quantity, set up for a robot, that can be timed and asked for its answers."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
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

QUANTITIES = ("fk", "ik", "jacobian", "inverse_dynamics", "mass_matrix", "forward_dynamics")
"""What is timed; each is the name of a method of :class:`dhkit.Arm`."""

Call: TypeAlias = Callable[[], object]


class UnavailableError(Exception):
    """A contender that cannot take part, with the reason."""


class Mode(Enum):
    """How a contender is called."""

    SINGLE = "single"
    """One call an item, from a Python loop."""
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
        Random joint values, rates and accelerations, shape (N, n), rad, m and seconds.
    threads
        How many threads a contender that offers threads may use.
    """

    arm: Arm
    q: Array
    qd: Array
    qdd: Array
    threads: int = 1

    @classmethod
    def of(cls, arm: Arm, batch: int, threads: int, seed: int) -> Workload:
        """Draw N = ``batch`` states, full turns and strokes within the limits."""
        q = random_states(arm.description, batch, seed)
        rng = np.random.default_rng(seed + 1)
        return cls(arm, q, rng.uniform(-1, 1, q.shape), rng.uniform(-1, 1, q.shape), threads)

    @cached_property
    def T(self) -> Array:
        """The tool's poses, world to tool, shape (N, 4, 4)."""
        return self.arm.fk(self.q)

    @cached_property
    def tau(self) -> Array:
        """The motion's torques, shape (N, n), N m and N."""
        return self.arm.inverse_dynamics(self.q, self.qd, self.qdd)

    def inputs(self, quantity: str) -> tuple[Array, ...]:
        """Return what a quantity is computed from, each with N as its first axis."""
        match quantity:
            case "ik":
                return (self.T,)
            case "inverse_dynamics":
                return self.q, self.qd, self.qdd
            case "forward_dynamics":
                return self.q, self.qd, self.tau
        return (self.q,)

    def __repr__(self) -> str:
        said = f"{counted(len(self.q), 'state')}, {counted(self.threads, 'thread')}"
        return repr_line("Workload", self.arm.name, said)


@dataclass(frozen=True)
class Task:
    """A contender set up for a workload.

    Attributes
    ----------
    prepare
        Makes, for a number of items, the call that is timed; everything that a user need not pay for is done here.
    answers
        Results of the first k items in dhkit's conventions: fk (4, 4), jacobian (6, n), ik (solutions, n) each,
        torques and accelerations (n,), mass_matrix (n, n).
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
        Whose it is and what is called, as in ``EAIK IK_batched``.
    quantity
        One of :data:`QUANTITIES`.
    mode
        How it is called.
    setup
        Builds its model of the robot; raises :class:`UnavailableError` with the reason where it cannot.
    own
        Whether it is dhkit itself.
    """

    name: str
    quantity: str
    mode: Mode
    setup: Callable[[Workload], Task]
    own: bool = False

    def __repr__(self) -> str:
        return repr_line("Contender", said=f"{self.quantity} by {self.name}, {self.mode.value}")


def import_peer(module: str) -> Any:
    """Import a package that dhkit does without.

    Raises
    ------
    UnavailableError
        It is not installed, or cannot be imported.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise UnavailableError(f"not installed: no module named {error.name}; {from_checkout('bench')}") from None
    except ImportError as error:
        raise UnavailableError(f"cannot be imported: {error}") from None


def one_by_one(function: Callable[..., object], inputs: Sequence[Any]) -> Callable[[int], Call]:
    """Return what prepares a loop of calls over inputs, each one argument or a tuple of them, taken round and round."""

    def prepare(items: int) -> Call:
        chosen = list(islice(cycle(inputs), items))

        def of_one() -> None:
            for value in chosen:
                function(value)

        def of_two_or_three() -> None:
            for values in chosen:
                function(*values)

        if not isinstance(chosen[0], tuple):
            return of_one
        if len(chosen[0]) > 1:
            return of_two_or_three
        chosen = [value for (value,) in chosen]
        return of_one

    return prepare
