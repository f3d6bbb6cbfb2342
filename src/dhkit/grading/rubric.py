"""Rubric: the worth of answers, read strictly from a file or a sheet's table."""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Mapping
from dataclasses import fields, replace
from datetime import date
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass
from pydantic_core import ErrorDetails

from dhkit.description.files import read_bounded
from dhkit.description.toml_text import plain_numbers, toml_document
from dhkit.display import repr_line, value_line
from dhkit.errors import AnswerError, DescriptionError
from dhkit.grading.answers.sheet import QUANTITY
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.lateness import LateRule, Share

_STRICT = ConfigDict(extra="forbid", use_attribute_docstrings=True)
WEIGHED = re.compile(
    rf"(?:{QUANTITY.pattern})|(M|C|T|J|A[1-9][0-9]??)_?([1-9])([1-9])|(M|C|J)_?([1-9][0-9]?)_([1-9][0-9]?)"
    r"|(h|g|tau|dh|ik)_?([1-9][0-9]?)"
)
"""Names of quantities and of entries: M12, M_12, M1_10 with indices of two digits, A1_14, g2, tau_2."""
QUANTITIES = ("M", "C", "h", "g", "tau", "K", "V", "L", "T", "J", "dh", "ik", "A1")

Feedback: TypeAlias = Literal["full", "hint", "verdict"]
"""Level of detail of a report: everything; verdicts and where to look; verdicts alone."""

Weight = Annotated[float, Field(strict=True, ge=0, le=1e6, allow_inf_nan=False)]


@dataclass(frozen=True, config=_STRICT)
class Credit:
    """Share of its points, from 0 to 1, that an entry gets which is not simply right."""

    rounding: Share = 1.0
    """Correct within rounding."""
    sampled: Share = 1.0
    """A function of numbers that agrees at the states where it was called."""
    undecided: Share = 1.0
    """Neither proved nor refuted."""
    follow_on: Share = 0.5
    """Wrong only because earlier answers of the sheet are."""
    other_frames: Share = 0.5
    """Right in frames other than the table's."""
    diagnosed: Share = 0.0
    """Wrong by a single mistake that is named."""
    mistakes: dict[str, Share] = Field(default_factory=dict, max_length=200)
    """Wrong by these mistakes, by name; goes before diagnosed."""

    __repr__ = value_line


@dataclass(frozen=True, config=_STRICT)
class Rubric:
    """Weights of the answers.

    Examples
    --------
    >>> Rubric.from_data({"points": 10, "weights": {"M": 4, "g": 2}}).weights["g"]
    2.0
    """

    points: Annotated[float, Field(strict=True, gt=0, le=1e6, allow_inf_nan=False)] = 100.0
    """Points of a sheet that is right throughout."""
    weights: dict[str, Weight] = Field(default_factory=dict, max_length=1000)
    """Weights of quantities (M = 4) and of entries within their quantity (M12 = 0; 1 unless given).

    Where a quantity has a weight above 0, those are asked for: one that is missing from a sheet gets none of
    its points, and one that is not named counts nothing. Otherwise the quantities of the sheet weigh the same.
    """
    credit: Credit = Field(default_factory=Credit)
    """Shares for answers that are not simply right."""
    digits: Annotated[int, Field(strict=True, ge=3, le=15)] = 4
    """Significant digits from which a decimal may be rounded."""
    feedback: Feedback = "full"
    """Level of detail of a report: everything (full), where to look (hint), or verdicts alone (verdict)."""
    late: LateRule | None = None
    """Points that a late submission loses, where the export says when it was handed in."""

    @classmethod
    def read(cls, path: str | Path) -> Rubric:
        """Return the rubric of a TOML file.

        Parameters
        ----------
        path
            Rubric file, which ends in ``.toml``.

        Raises
        ------
        AnswerError
            No such file, one over 100 kB, no TOML, or anything that :meth:`from_data` refuses; names the file.
        """
        try:
            content = read_bounded(path, BOUNDS.rubric_bytes, "a rubric")
        except DescriptionError as error:
            raise AnswerError(str(error)) from None
        try:
            document = plain_numbers(toml_document(content.decode()))
        except (DescriptionError, UnicodeDecodeError) as error:
            raise AnswerError(f"{path}: no TOML: {error}") from None
        return cls.from_data(document, f"{path}: ")

    @classmethod
    def from_data(cls, data: Mapping[str, object], place: str = "rubric: ") -> Rubric:
        """Return the rubric of a parsed table, such as a sheet's ``[rubric]``.

        Raises
        ------
        AnswerError
            The first thing wrong, after ``place``: key, the value found, the value expected.
        """
        if not isinstance(data, Mapping):
            raise AnswerError(f"{place}found {_short_repr(data)}; expected a table")
        try:
            rubric = TypeAdapter(cls).validate_python(dict(data))
        except ValidationError as error:
            # A mistyped key is the most useful message.
            errors = sorted(
                error.errors(), key=lambda one: one["type"] != "unexpected_keyword_argument"
            )
            raise AnswerError(place + _one_line(errors[0])) from None
        weights: dict[str, float] = {}
        for name, weight in rubric.weights.items():
            entry = _entry_name(name)
            if entry is None:
                unknown = f"weights: no quantity {name[:80]!r}"
                raise AnswerError(f"{place}{unknown}{_hint(name, QUANTITIES)}")
            if entry in weights:
                raise AnswerError(f"{place}weights: {name} is there twice, as {entry}")
            weights[entry] = weight
        return replace(rubric, weights=weights)

    def require_mistakes(self, known: Collection[str], place: str = "rubric: ") -> None:
        """Refuse a share for an unknown mistake, which no sheet would ever get.

        Raises
        ------
        AnswerError
            The message names the mistake, and the known one with the most similar name.
        """
        for name in self.credit.mistakes:
            if name not in known:
                raise AnswerError(
                    f"{place}credit.mistakes: no mistake {name[:80]!r}{_hint(name, sorted(known))}"
                )

    def __repr__(self) -> str:
        weights = (
            ", ".join(f"{name} {weight:g}" for name, weight in self.weights.items()) or "all alike"
        )
        return repr_line(
            "Rubric", summary=f"{self.points:g} points, feedback {self.feedback}, weights {weights}"
        )


def _entry_name(name: str) -> str | None:
    """Return the name of a quantity or entry as in reports, M12 for M_12; None if there is no such entry."""
    match = WEIGHED.fullmatch(name)
    if match is None:
        return None
    quantity, *indices = [part for part in match.groups() if part] or [name]
    separator = "_" if any(len(index) > 1 for index in indices) else ""
    return quantity + separator.join(indices)


_TIME = "a time with its zone, such as 2026-11-20T23:59:00+01:00"
_EXPECTED = {
    "dataclass_type": "a table",
    "dict_type": "a table",
    "float_type": "a number",
    "datetime_type": _TIME,
    "timezone_aware": _TIME,
    "string_pattern_mismatch": "a duration, such as '10 min' (s, min, h or d)",
}
"""Expected value by the type of an error."""


def _one_line(error: ErrorDetails) -> str:
    path = [str(part)[:80] for part in error["loc"] if part != "[key]"]
    if error["type"] == "unexpected_keyword_argument":
        tables = {"credit": Credit, "late": LateRule}
        known = [field.name for field in fields(tables.get("".join(path[:-1]), Rubric))]
        place = "".join(f"{part}: " for part in path[:-1])
        if path == ["rubric"]:
            return "unknown key 'rubric'; expected its keys at the top: [late] for [rubric.late]"
        return f"{place}unknown key {path[-1]!r}{_hint(path[-1], known)}"
    if error["type"] == "missing":
        return f"{'.'.join(path)}: missing"
    expected = _EXPECTED.get(
        error["type"], error["msg"].removeprefix("Input should be ").removeprefix("a valid ")
    )
    return f"{'.'.join(path)}: found {_short_repr(error['input'])}; expected {expected}"


def _hint(name: str, known: Collection[str]) -> str:
    close = difflib.get_close_matches(name[:80], known, n=1) or [
        one for one in known if one.lower() == name.lower()
    ]
    return f"; did you mean {close[0]!r}?" if close else f"; expected one of {', '.join(known)}"


def _short_repr(found: object) -> str:
    text = found.isoformat() if isinstance(found, date) else repr(found)
    return text if len(text) <= 60 else f"{text[:57]}..."
