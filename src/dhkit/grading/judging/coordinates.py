"""Joint angles as students count them: each from the link before, or all from one fixed direction."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from dhkit.symbolic import ExactArm
from dhkit.symbolic.exact.compact import parallel_runs
from dhkit.symbolic.ring import Element, Elements, angle_name, translated

ANGLE = re.compile(r"\b([cs])(\d[\d_]*)\b", re.ASCII)
"""A sine or a cosine as formulas are printed: c12."""


@dataclass(frozen=True)
class Coordinates:
    """The student's joint variables y = S q as sums of the robot's.

    Torques belong to coordinates: y's are B^T tau with q = B y, so that power stays the same; mass matrices become
    B^T M B (Siciliano et al., Robotics, 2009, section 7.8, for any linear change of coordinates).

    Attributes
    ----------
    sums
        Of each variable the joints, from 0, that it is the sum of.
    """

    sums: tuple[tuple[int, ...], ...]

    @classmethod
    def relative(cls, n: int) -> Coordinates:
        """Return the robot's own joint variables."""
        return cls(tuple((i,) for i in range(n)))

    @classmethod
    def absolute(cls, arm: ExactArm) -> Coordinates:
        """Return angles from a fixed direction: sums over the turning joints of parallel axes."""
        sums: dict[int, tuple[int, ...]] = {i: (i,) for i in range(arm.n)}
        for run in parallel_runs(arm):
            sums |= {joint: run[: k + 1] for k, joint in enumerate(run)}
        return cls(tuple(sums[i] for i in range(arm.n)))

    @property
    def is_relative(self) -> bool:
        """Whether they are the robot's own."""
        return all(len(joints) == 1 for joints in self.sums)

    @cached_property
    def S(self) -> Elements:
        """Shape (n, n), of whole numbers: y = S q."""
        matrix = np.zeros((len(self.sums), len(self.sums)), dtype=object)
        for i, joints in enumerate(self.sums):
            matrix[i, list(joints)] = 1
        return matrix

    @cached_property
    def B(self) -> Elements:
        """Shape (n, n), of whole numbers: q = B y; S is lower triangular with ones on its diagonal."""
        return np.rint(np.linalg.inv(self.S.astype(float))).astype(int).astype(object)

    def in_y(self, quantity: str, truth: Elements) -> Elements:
        """Return the robot's M, C, h, g, tau or J in these coordinates, still written in q."""
        if self.is_relative:
            return truth
        if quantity in ("M", "C"):
            return self.B.T @ truth @ self.B
        if quantity in ("h", "g", "tau"):
            return self.B.T @ truth
        return truth @ self.B if quantity == "J" else truth

    def rates(self, rates: Elements) -> Elements:
        """Return the variables' rates, or accelerations, from the joints'."""
        return rates if self.is_relative else self.S @ rates

    def in_own_rates(self, element: Element) -> Element:
        """Return what is written in the joints' rates and accelerations in the variables', to be shown."""
        if self.is_relative:
            return element
        ring, places = element.ring, dict[int, Element]()
        for kind, generator in (("rate", ring.rate), ("acceleration", ring.acceleration)):
            own = self.B @ np.array([generator(i) for i in range(ring.n)], dtype=object)
            places |= {ring.place(kind, i): x for i, x in enumerate(own)}
        return translated(element, ring, places)

    def in_own_angles(self, text: str) -> str:
        """Return a formula's text with c12 as the cosine of a variable, or of the difference of two."""
        if self.is_relative:
            return text
        angles = {angle_name(joints): f"q{j + 1}" for j, joints in enumerate(self.sums)}
        for (j, more), (k, less) in product(enumerate(self.sums), repeat=2):
            if len(less) < len(more) and more[: len(less)] == less:
                angles.setdefault(angle_name(more[len(less) :]), f"q{j + 1} - q{k + 1}")

        def own(found: re.Match[str]) -> str:
            angle = angles.get(found[2])
            return f"{'cos' if found[1] == 'c' else 'sin'}({angle})" if angle else found[0]

        return ANGLE.sub(own, text)

    def by_position(self, element: Element, i: int) -> Element:
        """Return the derivative by variable i."""
        return self._by(element, i, "by_position")

    def by_rate(self, element: Element, i: int) -> Element:
        """Return the derivative by variable i's rate."""
        return self._by(element, i, "by_rate")

    def _by(self, element: Element, i: int, what: str) -> Element:
        ring = element.ring
        return ring.sum(getattr(element, what)(j) * int(self.B[j, i]) for j in range(ring.n) if self.B[j, i])
