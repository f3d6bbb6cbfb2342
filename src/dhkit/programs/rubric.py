"""The rubric of a program: the points of its functions, read from a file whose keys and values are all checked."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from dhkit.description.files import read_bounded
from dhkit.description.toml_text import plain_numbers, toml_document
from dhkit.display import repr_line, value_line
from dhkit.errors import AnswerError, DescriptionError
from dhkit.programs.bounds import BOUNDS

_STRICT = ConfigDict(extra="forbid")
Points = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]


@dataclass(frozen=True, config=_STRICT)
class ForwardPoints:
    """Points of ``fk``: those of poses that agree."""

    agrees: Points = 100.0

    __repr__ = value_line


@dataclass(frozen=True, config=_STRICT)
class InversePoints:
    """Points of ``ik``.

    Attributes
    ----------
    closes
        Points of poses that every solution returned leads to, and of poses out of reach without solutions.
    branches
        Points of returning all solutions.
    singular
        Points of singular poses.
    time
        Points of the time of a call.
    seconds
        Longest time of a call with all points of ``time``, s; a call that takes ten times as long has none.
    """

    closes: Points = 60.0
    branches: Points = 20.0
    singular: Points = 10.0
    time: Points = 10.0
    seconds: Positive = 0.01

    __repr__ = value_line


@dataclass(frozen=True, config=_STRICT)
class ControllerTask:
    """The task of ``controller``: a quintic motion between two configurations of the arm.

    Attributes
    ----------
    follows
        Points if the peak error of every joint is within the bound; none at ten times the bound.
    start, goal
        Names of the configurations; every arm has ``zero``.
    duration
        Duration of the motion, s.
    rate
        Calls of the controller per second, Hz.
    payload
        Mass at the tool, kg, that the controller does not know of.
    bound
        Largest peak error with all points, rad and m.
    """

    follows: Points = 100.0
    start: str = "ready"
    goal: str = "zero"
    duration: Positive = 2.0
    rate: Positive = 500.0
    payload: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    bound: Positive = 0.01

    __repr__ = value_line


@dataclass(frozen=True, config=_STRICT)
class CheckRubric:
    """The points of a program: those of the functions that a file names, or of those that the program has."""

    fk: ForwardPoints = Field(default_factory=ForwardPoints)
    ik: InversePoints = Field(default_factory=InversePoints)
    controller: ControllerTask = Field(default_factory=ControllerTask)
    named: tuple[str, ...] = ()
    """Functions that must be defined; empty for those that the program has."""

    @classmethod
    def read(cls, path: str | Path) -> CheckRubric:
        """Read a rubric: a TOML file with tables ``[fk]``, ``[ik]`` and ``[controller]``.

        Parameters
        ----------
        path
            Rubric file, which ends in ``.toml``.

        Raises
        ------
        AnswerError
            The file cannot be read, or is not a rubric.
        """
        try:
            data = plain_numbers(
                toml_document(read_bounded(path, BOUNDS.rubric_bytes, "a rubric").decode())
            )
        except (DescriptionError, UnicodeDecodeError) as error:
            raise AnswerError(
                f"{path}: {error}" if isinstance(error, UnicodeDecodeError) else str(error)
            ) from None
        return cls.from_dict(data, f"{path}: ")

    @classmethod
    def from_dict(cls, data: dict[str, object], where: str = "") -> CheckRubric:
        """Return a rubric of a file's tables; ``where`` begins the message of an error.

        Raises
        ------
        AnswerError
            A name is unknown, or a value does not fit.
        """
        try:
            return TypeAdapter(cls).validate_python({**data, "named": tuple(data)})
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(str(part)[:80] for part in first["loc"])
            raise AnswerError(f"{where}{place}: {first['msg'][:200]}") from None

    def scored_functions(self, defined: tuple[str, ...]) -> tuple[str, ...]:
        """Return the functions that are scored, for a program that defines these."""
        return self.named or defined

    def points(self, function: str) -> dict[str, float]:
        """Return the points of each part of a function's score."""
        return {
            "fk": {"agrees": self.fk.agrees},
            "ik": {
                name: getattr(self.ik, name) for name in ("closes", "branches", "singular", "time")
            },
            "controller": {"follows": self.controller.follows},
        }[function]

    def __repr__(self) -> str:
        functions = self.scored_functions(("fk", "ik", "controller"))
        points = ", ".join(
            f"{function} {sum(self.points(function).values()):g}" for function in functions
        )
        return repr_line("CheckRubric", summary=f"points of {points}")
