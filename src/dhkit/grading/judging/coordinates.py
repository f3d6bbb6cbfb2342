"""Joint variables of students: angles from the previous link, or from a fixed direction."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from dhkit.symbolic import ExactArm
from dhkit.symbolic.exact.compact import parallel_runs
from dhkit.symbolic.ring import Element, Elements, angle_name, translated

ANGLE = re.compile(r"\b([cs])(\d[\d_]*)\b", re.ASCII)
"""A sine or cosine in a printed formula: c12."""


_VARIABLE = re.compile(r"(?:q|qd|qdd)\d+", re.ASCII)
"""A joint variable, rate or acceleration by name: qd1."""


@dataclass(frozen=True)
class Coordinates:
    """The student's joint variables y = S q, sums of the robot's joint variables q.

    In what the student reads, y is printed under the names of q: q2 is the student's second variable, whatever it is
    the sum of.

    With q = B y, the torques of y are B^T tau, so that power stays the same, and the mass matrix is B^T M B (Siciliano
    et al., Robotics, 2009, section 7.8, for any linear change of coordinates).

    Attributes
    ----------
    sums
        Joints, from 0, whose variables each of the student's variables is the sum of.
    """

    sums: tuple[tuple[int, ...], ...]

    @classmethod
    def relative(cls, n: int) -> Coordinates:
        """Return the robot's joint variables, y = q."""
        return cls(tuple((i,) for i in range(n)))

    @classmethod
    def absolute(cls, arm: ExactArm) -> Coordinates:
        """Return angles from a fixed direction: sums over consecutive revolute joints with parallel axes."""
        sums: dict[int, tuple[int, ...]] = {i: (i,) for i in range(arm.n)}
        for run in parallel_runs(arm):
            for k, joint in enumerate(run):
                sums[joint] = run[: k + 1]
        return cls(tuple(sums[i] for i in range(arm.n)))

    @property
    def is_relative(self) -> bool:
        """Whether the student's variables are the robot's, y = q."""
        return all(len(joints) == 1 for joints in self.sums)

    @cached_property
    def S(self) -> Elements:
        """Matrix of y = S q, shape (n, n), of integers."""
        matrix = np.zeros((len(self.sums), len(self.sums)), dtype=object)
        for i, joints in enumerate(self.sums):
            matrix[i, list(joints)] = 1
        return matrix

    @cached_property
    def B(self) -> Elements:
        """Matrix of q = B y, shape (n, n), of integers, since S is lower triangular with ones on its diagonal."""
        return np.rint(np.linalg.inv(self.S.astype(float))).astype(int).astype(object)

    def in_y(self, quantity: str, truth: Elements) -> Elements:
        """Return the robot's M, C, h, g, tau or J in these coordinates, written in q; other quantities stay."""
        if self.is_relative:
            return truth
        match quantity:
            case "M" | "C":
                return self.B.T @ truth @ self.B
            case "h" | "g" | "tau":
                return self.B.T @ truth
            case "J":
                return truth @ self.B
        return truth

    def rates(self, rates: Elements) -> Elements:
        """Return the rates or accelerations of the variables from those of the joints, shape (n,)."""
        return rates if self.is_relative else self.S @ rates

    def in_student_rates(self, element: Element) -> Element:
        """Return an element written in the student's rates and accelerations, for printing: qd1 is then y1's rate."""
        if self.is_relative:
            return element
        ring = element.ring
        places: dict[int, Element] = {}
        for kind, generator in (("rate", ring.rate), ("acceleration", ring.acceleration)):
            # qd = B yd; the names of qd now stand for yd.
            student_rates = np.array([generator(i) for i in range(ring.n)], dtype=object)
            robot_rates = self.B @ student_rates
            places |= {ring.place(kind, i): x for i, x in enumerate(robot_rates)}
        return translated(element, ring, places)

    def in_student_angles(self, text: str) -> str:
        """Return a printed formula with c12 as the cosine of a student's variable, or of a difference of two."""
        if self.is_relative:
            return text
        angles = {angle_name(joints): f"q{j + 1}" for j, joints in enumerate(self.sums)}
        for (j, long), (k, short) in product(enumerate(self.sums), repeat=2):
            # q23 = (q1 + q2 + q3) - q1
            if len(short) < len(long) and long[: len(short)] == short:
                angles.setdefault(angle_name(long[len(short) :]), f"q{j + 1} - q{k + 1}")

        def written(match: re.Match[str]) -> str:
            angle = angles.get(match[2])
            if not angle:
                return match[0]
            function = "cos" if match[1] == "c" else "sin"
            return f"{function}({angle})"

        return ANGLE.sub(written, text)

    def student_state(self, state: Mapping[str, float]) -> dict[str, float]:
        """Return a state, given by the robot's q1, qd1 ..., in the student's variables; missing values are zero."""
        if self.is_relative:
            return dict(state)
        student: dict[str, float] = {}
        for kind in ("q", "qd", "qdd"):
            names = [f"{kind}{i + 1}" for i in range(len(self.sums))]
            if any(name in state for name in names):
                for name, joints in zip(names, self.sums, strict=True):
                    student[name] = sum(state.get(names[i], 0.0) for i in joints)
        others = {name: value for name, value in state.items() if not _VARIABLE.fullmatch(name)}
        return student | others

    def by_position(self, element: Element, i: int) -> Element:
        """Return the derivative by variable i."""
        return self._differentiate(Element.by_position, element, i)

    def by_rate(self, element: Element, i: int) -> Element:
        """Return the derivative by variable i's rate."""
        return self._differentiate(Element.by_rate, element, i)

    def _differentiate(
        self, derivative: Callable[[Element, int], Element], element: Element, i: int
    ) -> Element:
        """Return the derivative by variable i, or its rate: df/dy_i = sum over j of df/dq_j B_ji, since q = B y."""
        ring = element.ring
        return ring.sum(
            derivative(element, j) * int(self.B[j, i]) for j in range(ring.n) if self.B[j, i]
        )
