"""Answers that can only be calculated with numbers, at states that the judge chooses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from dhkit.description import Array


class SampledAnswer(ABC):
    """A quantity as a function of numbers."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Name in reports."""

    @property
    @abstractmethod
    def parameters(self) -> frozenset[str]:
        """The robot's parameters that it takes; the others have the file's values in it."""

    @abstractmethod
    def at(self, states: Sequence[Mapping[str, float]], shape: tuple[int, ...]) -> Array:
        """Return its values at states, shape (states, *shape), SI units and rad; NaN where it has none.

        Parameters
        ----------
        states
            Values of the joint variables, their rates and the parameters, by the robot's own names.
        shape
            The quantity's shape.

        Raises
        ------
        AnswerError
            It fails, or returns another shape.
        """
