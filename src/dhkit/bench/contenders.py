"""What a contender is: a way to compute a quantity, set up for a robot, that can be timed and asked for its answers."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import cycle, islice
from typing import Any, TypeAlias, TypeVar

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.verification import random_states

__all__ = [
    "QUANTITIES",
    "Call",
    "Contender",
    "Mode",
    "Task",
    "UnavailableError",
    "Workload",
    "import_peer",
    "one_by_one",
]

QUANTITIES = ("fk", "ik", "jacobian")
"""What is timed; each is the name of a method of :class:`dhkit.Arm`."""

Call: TypeAlias = Callable[[], object]
Input = TypeVar("Input")


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
    """The states and poses that every contender gets.

    Attributes
    ----------
    arm
        The robot.
    q
        Random joint values, shape (N, n), rad and m.
    T
        The tool's poses there, world to tool, shape (N, 4, 4).
    threads
        How many threads a contender that offers threads may use.
    """

    arm: Arm
    q: Array
    T: Array
    threads: int = 1

    @classmethod
    def of(cls, arm: Arm, batch: int, threads: int, seed: int) -> Workload:
        """Draw N = ``batch`` states, full turns and strokes within the limits."""
        q = random_states(arm.description, batch, seed)
        return cls(arm, q, arm.fk(q), threads)

    def inputs(self, quantity: str) -> Array:
        """Return what a quantity is computed from: poses for ``ik``, joint values otherwise."""
        return self.T if quantity == "ik" else self.q


@dataclass(frozen=True)
class Task:
    """A contender set up for a workload.

    Attributes
    ----------
    prepare
        Makes, for a number of items, the call that is timed; everything that a user need not pay for is done here.
    answers
        Results of the first k items in dhkit's conventions: fk (4, 4), jacobian (6, n), ik (solutions, n) each.
    """

    prepare: Callable[[int], Call]
    answers: Callable[[int], Sequence[Array]]


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
        raise UnavailableError(f"not installed: no module named {error.name}; pip install 'dhkit[bench]'") from None
    except ImportError as error:
        raise UnavailableError(f"cannot be imported: {error}") from None


def one_by_one(function: Callable[[Input], object], inputs: Sequence[Input]) -> Callable[[int], Call]:
    """Return what prepares a loop of calls over inputs, which are taken round and round."""

    def prepare(items: int) -> Call:
        chosen = list(islice(cycle(inputs), items))

        def loop() -> None:
            for value in chosen:
                function(value)

        return loop

    return prepare
