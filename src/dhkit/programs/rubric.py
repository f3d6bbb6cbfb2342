"""What a program's functions are worth, read strictly from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from dhkit.description.files import read_bounded
from dhkit.description.toml_text import plain_numbers, toml_document
from dhkit.display import repr_line, value_line
from dhkit.errors import AnswerError, DescriptionError

MAX_BYTES = 100_000
STRICT = ConfigDict(extra="forbid")
Points = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]


@dataclass(frozen=True, config=STRICT)
class ForwardPoints:
    """Of ``fk``: poses that agree."""

    agrees: Points = 100.0

    def __repr__(self) -> str:
        return value_line(self)


@dataclass(frozen=True, config=STRICT)
class InversePoints:
    """Of ``ik``.

    Attributes
    ----------
    closes
        Poses that every solution returned leads to, and poses out of reach for which none is.
    branches
        All solutions.
    singular
        Singular poses.
    time
        Of a call.
    seconds
        Time of a call that is worth all its points; ten times as long is worth none.
    """

    closes: Points = 60.0
    branches: Points = 20.0
    singular: Points = 10.0
    time: Points = 10.0
    seconds: Positive = 0.01

    def __repr__(self) -> str:
        return value_line(self)


@dataclass(frozen=True, config=STRICT)
class ControllerTask:
    """Of ``controller``: a quintic motion between two configurations of the arm.

    Attributes
    ----------
    follows
        Points where the peak error of every joint is within the bound; none at ten times the bound.
    start, goal
        Configurations by name; ``zero`` is known to every arm.
    duration
        s.
    rate
        Hz of the controller.
    payload
        kg at the tool, which the controller is not told of.
    bound
        rad and m.
    """

    follows: Points = 100.0
    start: str = "ready"
    goal: str = "zero"
    duration: Positive = 2.0
    rate: Positive = 500.0
    payload: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    bound: Positive = 0.01

    def __repr__(self) -> str:
        return value_line(self)


@dataclass(frozen=True, config=STRICT)
class CheckRubric:
    """What a program is worth: the functions that a file names, or those that the program has."""

    fk: ForwardPoints = Field(default_factory=ForwardPoints)
    ik: InversePoints = Field(default_factory=InversePoints)
    controller: ControllerTask = Field(default_factory=ControllerTask)
    named: tuple[str, ...] = ()
    """Functions that are asked for; empty for those that a program has."""

    @classmethod
    def read(cls, path: str | Path) -> CheckRubric:
        """Read a rubric: a TOML file with tables ``[fk]``, ``[ik]`` and ``[controller]``.

        Raises
        ------
        AnswerError
            It cannot be read, or says what no rubric says.
        """
        try:
            data = plain_numbers(toml_document(read_bounded(path, MAX_BYTES, "a rubric").decode()))
        except (DescriptionError, UnicodeDecodeError) as error:
            raise AnswerError(f"{path}: {error}" if isinstance(error, UnicodeDecodeError) else str(error)) from None
        return cls.from_dict(data, f"{path}: ")

    @classmethod
    def from_dict(cls, data: dict[str, Any], where: str = "") -> CheckRubric:
        """Build a rubric from a file's tables.

        Raises
        ------
        AnswerError
            An unknown name, or a value that does not fit.
        """
        try:
            return TypeAdapter(cls).validate_python({**data, "named": tuple(data)})
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(str(part)[:80] for part in first["loc"])
            raise AnswerError(f"{where}{place}: {first['msg'][:200]}") from None

    def wanted(self, defined: tuple[str, ...]) -> tuple[str, ...]:
        """Return the functions that count, of those that a program defines."""
        return self.named or defined

    def points(self, function: str) -> dict[str, float]:
        """Return the parts of a function's score and their points."""
        parts: dict[str, float] = {
            "fk": {"agrees": self.fk.agrees},
            "ik": {name: getattr(self.ik, name) for name in ("closes", "branches", "singular", "time")},
            "controller": {"follows": self.controller.follows},
        }[function]
        return parts

    def __repr__(self) -> str:
        functions = self.wanted(("fk", "ik", "controller"))
        points = ", ".join(f"{function} {sum(self.points(function).values()):g}" for function in functions)
        return repr_line("CheckRubric", said=f"points of {points}")
