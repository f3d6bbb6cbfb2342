"""Points that a late submission loses."""

from __future__ import annotations

import math
from dataclasses import dataclass as plain_dataclass
from datetime import datetime, timedelta
from fractions import Fraction
from typing import Annotated

from pydantic import AwareDatetime, ConfigDict, Field
from pydantic.dataclasses import dataclass

from dhkit.display import counted, value_line

_STRICT = ConfigDict(extra="forbid", use_attribute_docstrings=True)
DURATION = r"^[0-9]{1,6}(\.[0-9]{1,6})? ?(s|min|h|d)$"
"""Duration in a rubric: a number and a unit."""
_UNITS = {"min": timedelta(minutes=1), "s": timedelta(seconds=1), "h": timedelta(hours=1)}
_DAY = timedelta(days=1)
Share = Annotated[float, Field(strict=True, ge=0, le=1, allow_inf_nan=False)]


@plain_dataclass(frozen=True)
class Lateness:
    """Lateness of one submission.

    Attributes
    ----------
    days
        Days begun since the due time; 0 if it is in time.
    share
        Share of its points that it loses.
    """

    days: int
    share: Fraction

    __repr__ = value_line

    def __str__(self) -> str:
        return f"{counted(self.days, 'day')} late: -{100 * float(self.share):g} %"


@dataclass(frozen=True, config=_STRICT)
class LateRule:
    """Points that are lost after a due time.

    Examples
    --------
    >>> from datetime import datetime, UTC
    >>> rule = LateRule(datetime(2026, 11, 20, 23, 0, tzinfo=UTC), grace="10 min", per_day=0.1, at_most=0.5)
    >>> [str(rule.lateness(datetime(2026, 11, *when, tzinfo=UTC))) for when in ((20, 23, 9), (20, 23, 11), (29, 0, 0))]
    ['0 days late: -0 %', '1 day late: -10 %', '9 days late: -50 %']
    """

    due: Annotated[AwareDatetime, Field(strict=True)]
    """Due time, with its zone: 2026-11-20T23:59:00+01:00."""
    per_day: Share
    """Share of its points that a submission loses for each day begun after the due time."""
    grace: Annotated[str, Field(strict=True, pattern=DURATION)] = "0 min"
    """Delay that is no lateness: a number and s, min, h or d. Days count from the due time all the same."""
    at_most: Share = 1.0
    """Largest share of its points that a submission loses."""

    __repr__ = value_line

    def lateness(self, handed_in: datetime) -> Lateness:
        """Return the lateness of a submission.

        Parameters
        ----------
        handed_in
            When it was handed in, with its zone.

        Returns
        -------
        Lateness
            Days begun, and the share of the points that is lost.
        """
        delay = handed_in - self.due
        if delay <= self._grace:
            return Lateness(0, Fraction(0))
        days = math.ceil(delay / _DAY)
        share = min(Fraction(repr(self.per_day)) * days, Fraction(repr(self.at_most)))
        return Lateness(days, share)

    @property
    def _grace(self) -> timedelta:
        unit = self.grace.lstrip("0123456789. ")
        return float(self.grace.removesuffix(unit)) * _UNITS.get(unit, _DAY)
