"""Claims of a certificate about distances, and the findings of a second check."""

from __future__ import annotations

from dataclasses import dataclass

from dhkit.display import repr_line, value_line
from dhkit.planning.obstacles import Floor, Obstacle, link_name

ACCEPTED_SHARE = 0.1
"""Share of a clearance by which it may be missed between the states of a certificate."""
ACCEPTED_GAP = 1e-3
"""Least gap, m, by which a clearance may be missed between the states of a certificate, whatever its share."""
TOUCH = 1e-6
"""Depth, m, up to which two solids only touch."""


def distance_text(distance: float) -> str:
    """Return a distance of two bodies, m, in words; a negative one is the depth by which they overlap.

    Examples
    --------
    >>> distance_text(0.0032), distance_text(-0.1)
    ('a distance of 3.2 mm', 'an overlap of 100 mm')
    """
    kind = "an overlap" if distance < 0 else "a distance"
    return f"{kind} of {1000 * abs(distance):.3g} mm"


@dataclass(frozen=True)
class Claim:
    """Two things whose distance a certificate claims."""

    link: int
    other: int | Obstacle | Floor
    """Another link, or an obstacle around the arm."""
    kept: float
    """Distance that is kept, m."""

    @property
    def refuting(self) -> float:
        """Distance, m, below which the claim is refuted."""
        return max(self.kept - max(ACCEPTED_SHARE * self.kept, ACCEPTED_GAP), -TOUCH)

    def __str__(self) -> str:
        other = link_name(self.other) if isinstance(self.other, int) else self.other.name
        return f"distance of {link_name(self.link)} and {other}"


@dataclass(frozen=True)
class Refutation:
    """A limit or a distance that a motion does not keep."""

    what: str
    """Such as ``torque of elbow``, or ``distance of link 3 and box``."""
    found: float
    """Share of the limit, which is 1 at the limit; of distances, m."""
    required: float
    time: float
    """s."""
    unit: str = ""
    """Unit of what was found and required: m of distances, empty of shares and of jumps."""

    @property
    def statement(self) -> str:
        """What was found and what was required, in words."""
        at = f"at {self.time:.4g} s"
        if self.unit == "m":
            return f"{self.what} {at}: {distance_text(self.found)} found, {1000 * self.required:.3g} mm asked for"
        if self.required == 0:
            return f"{self.what} {at}: by {self.found:.3g}"
        return f"{self.what} {at}: {100 * self.found:.5g} % of its limit"

    __repr__ = value_line


@dataclass(frozen=True)
class Recheck:
    """Result of a second check."""

    states: int
    """Number of states in which the joints were looked at first."""
    smallest_distance: float
    """Smallest distance that was measured, m; a lower bound from 20 mm above the required one; inf without any."""
    refutations: tuple[Refutation, ...]

    @property
    def ok(self) -> bool:
        """Whether nothing was found that the motion does not keep."""
        return not self.refutations

    def __repr__(self) -> str:
        found = (
            "nothing refuted"
            if self.ok
            else f"{len(self.refutations)} refuted, first {self.refutations[0].what}"
        )
        return repr_line("Recheck", f"{self.states} states", found)

    def __str__(self) -> str:
        found = "; ".join(one.statement for one in self.refutations) or "nothing refuted"
        return f"{found}, in {self.states} states and around them"
