"""Integration of a motion in one interval, whose acceleration is at most quadratic.

The formulas hold for arrays and for CasADi's symbols. An acceleration is given by its values a, b and c at the
beginning, the middle and the end of an interval; a linear one has b = (a + c) / 2, a constant one a = b = c.
"""

from __future__ import annotations

from typing import Any, NamedTuple


class Interval(NamedTuple):
    """One interval of a motion: its duration h (s), the state at its beginning, and the acceleration in it."""

    h: Any
    q: Any
    qd: Any
    a: Any
    b: Any
    c: Any

    @property
    def q_end(self) -> Any:
        """Joint values at the end, rad and m."""
        return self.q + self.h * self.qd + self.h**2 * (self.a / 6 + self.b / 3)

    @property
    def qd_end(self) -> Any:
        """Joint rates at the end, rad/s and m/s."""
        return self.qd + self.h * (self.a + 4 * self.b + self.c) / 6

    @property
    def q_middle(self) -> Any:
        """Joint values halfway in time."""
        return self.q + self.h / 2 * self.qd + self.h**2 * (7 * self.a + 6 * self.b - self.c) / 96

    @property
    def qd_middle(self) -> Any:
        """Joint rates halfway in time."""
        return self.qd + self.h * (5 * self.a + 8 * self.b - self.c) / 24

    @property
    def jerks(self) -> tuple[Any, Any]:
        """Jerks at both ends, rad/s^3 and m/s^3; the jerk is linear between them."""
        return (-3 * self.a + 4 * self.b - self.c) / self.h, (self.a - 4 * self.b + 3 * self.c) / self.h
