"""Options of judging a file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

from dhkit.execution import Isolation
from dhkit.grading.answers.sheet_values import AnswerSheet
from dhkit.options import Options


@dataclass(frozen=True, kw_only=True, repr=False)
class GradeOptions(Options):
    """Options of :func:`grade`.

    Raises
    ------
    TypeError
        A task that is not an answer sheet, or an isolation that is none.
    """

    task: AnswerSheet | None = None
    """Task from :func:`dhkit.grading.answers.sheet.read_task`. It takes precedence over the sheet's own [task]; its
    [names] count if the sheet has none."""
    seed: int | None = None
    """Seed of the random states at which answers outside the exact ring are tried; by default from the system's
    entropy."""
    explain: bool = True
    """Whether to look for mistakes; verdicts do not depend on it."""
    execute: bool = False
    """Whether a program (.py, .m, .ipynb) is executed in a process of its own instead of being read. Its answers are
    then the formulas that its names stand for. Functions that cannot be called with symbols are called with numbers,
    and agree at sampled states at best."""
    isolation: Isolation | None = None
    """Isolation of an executed program; by default the best that works on this system, or none."""

    def __post_init__(self) -> None:
        if not isinstance(self.task, AnswerSheet | None):
            raise TypeError(f"task is {type(self.task).__name__}; expected what read_task returns")
        if not isinstance(self.isolation, Isolation | None):
            raise TypeError(f"isolation is {type(self.isolation).__name__}; expected an Isolation")


class GradeKeywords(TypedDict, total=False):
    """The fields of :class:`GradeOptions`, as keyword arguments."""

    task: AnswerSheet | None
    seed: int | None
    explain: bool
    execute: bool
    isolation: Isolation | None
