"""The report of a program that was compared with an arm."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import chain

import numpy as np

from dhkit.display import html_block, html_lines, html_table, repr_line, value_line


@dataclass(frozen=True)
class Part:
    """One part of a function's score.

    Attributes
    ----------
    name
        Name of the part, such as ``closes``.
    points, most
        Points that it got, and points that it is worth.
    text
        The result in a sentence.
    details
        Descriptions of failures.
    """

    name: str
    points: float
    most: float
    text: str
    details: tuple[str, ...] = ()

    __repr__ = value_line


@dataclass(frozen=True)
class CheckReport:
    """The score of a program that was compared with an arm.

    Attributes
    ----------
    robot, program
        Names of the arm and of the program.
    functions
        The parts of each function's score.
    notes
        Further remarks.
    seed
        Seed of the random states: the same seed gives the same states.
    """

    robot: str
    program: str
    functions: dict[str, tuple[Part, ...]]
    notes: tuple[str, ...]
    seed: int

    @property
    def points(self) -> float:
        """Points of all functions."""
        parts = chain.from_iterable(self.functions.values())
        return round(float(sum(part.points for part in parts)), 6)

    @property
    def most(self) -> float:
        """Points that all functions are worth."""
        parts = chain.from_iterable(self.functions.values())
        return round(float(sum(part.most for part in parts)), 6)

    @property
    def full(self) -> bool:
        """Whether the program has all points."""
        return self.points >= self.most

    def to_dict(self) -> dict[str, object]:
        """Return the report as plain data for JSON."""
        return {"points": self.points, "most": self.most, **asdict(self)}

    def __str__(self) -> str:
        lines = [f"{self.program} against {self.robot}: {self.points:g} of {self.most:g} points"]
        for function, parts in self.functions.items():
            lines += ["", function]
            for part in parts:
                lines.append(
                    f"  {part.name:<10} {f'{part.points:.3g} of {part.most:g}':>12}   {part.text}"
                )
                lines += [f"  {'':<10} {'':>12}     {detail}" for detail in part.details]
        lines += [""] * bool(self.notes) + [f"note: {note}" for note in self.notes]
        return "\n".join([*lines, f"random states: seed {self.seed}"])

    def __repr__(self) -> str:
        score = f"{self.points:g} of {self.most:g} points, {', '.join(self.functions)}"
        return repr_line("CheckReport", f"{self.program} against {self.robot}", score)

    def _repr_html_(self) -> str:
        rows = []
        for function, parts in self.functions.items():
            for part in parts:
                points = f"{part.points:.3g} of {part.most:g}"
                rows.append((function, part.name, points, part.text))
        title = f"{self.program} against {self.robot}: {self.points:g} of {self.most:g} points"
        return html_block(
            title, html_table(("function", "part", "points", ""), rows), html_lines(self.notes)
        )


def share_within(value: float, bound: float) -> float:
    """Return the share of points, 0 to 1, of a value: 1 up to the bound, falling with log10 to 0 at ten times it."""
    return float(np.clip(1 - np.log10(max(value, 1e-12) / bound), 0.0, 1.0))
