"""Whether a student's own parts agree: an error that follows from an earlier one is told from a new one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from dhkit.grading.judging.quantities import JudgedQuantity
from dhkit.grading.judging.truth import Truth
from dhkit.grading.report import Note, NoteKind, Verdict
from dhkit.symbolic.ring import Element, Elements, element_array

Index = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Consistency:
    """A sheet's quantities, held against one another in the order of the derivation.

    Attributes
    ----------
    truth
        For what is not on the sheet.
    judged
        By name.
    """

    truth: Truth
    judged: Mapping[str, JudgedQuantity]

    def follows(self, quantity: str) -> dict[Index, str]:
        """Return which wrong entries are right in themselves, each with the wrong answers that they follow from."""
        judged = self.judged[quantity]
        routes = _ROUTES.get(quantity, ())
        found: dict[Index, str] = {}
        for sources, route in routes:
            wrong = [name for name in sources if name in self.judged and self.judged[name].wrong]
            if not wrong:
                continue
            expected = route(self)
            if expected is None:
                continue
            for index, finding in judged.findings.items():
                if finding.verdict is not Verdict.WRONG or index in found or finding.answer is None:
                    continue
                place = index[:1] if quantity == "C" else index
                if finding.answer.numerator_of_difference(expected[place]).is_zero:
                    found[index] = ", ".join(wrong)
        return found

    def notes(self) -> list[Note]:
        """Say of a sheet with mistakes which of its parts agree with each other, right or wrong."""
        found = []
        for quantity, ((sources, route), *_) in _ROUTES.items():
            given = tuple(name for name in sources if name in self.judged)
            if quantity not in self.judged or not given:
                continue
            if not any(self.judged[name].wrong for name in (quantity, *given)):
                continue
            own, expected = self.own(quantity), route(self)
            if own is None or expected is None:
                continue
            agrees = all((a - b).is_zero for a, b in zip(own.flat, expected.flat, strict=True))
            found.append(Note(NoteKind.AGREES if agrees else NoteKind.DISAGREES, quantity, given))
        return found

    def own(self, quantity: str) -> Elements | None:
        """Return the student's elements of a quantity, or the truth where it is not on the sheet; of C its h."""
        name = quantity
        if quantity == "h" and "h" not in self.judged and "C" in self.judged:
            name = "C"
        if name not in self.judged:
            return self.truth.of("h" if quantity == "C" else quantity)
        judged = self.judged[name]
        right = judged.truth
        array = np.empty(right.shape, dtype=object)
        for index, finding in judged.findings.items():
            element = finding.answer.element() if finding.answer is not None else None
            if element is None:
                return None
            array[index[:1] if name == "C" else index] = element
        return array

    @property
    def n(self) -> int:
        """The number of joints."""
        return self.truth.description.n

    def rates(self, kind: str) -> Elements:
        """Return the student's variables' rates or accelerations."""
        ring = self.truth.lagrangian.arm.ring
        own = np.array([getattr(ring, kind)(i) for i in range(self.n)], dtype=object)
        return self.truth.coordinates.rates(own)


Route = Callable[[Consistency], Elements | None]


def _gradient(parts: Consistency) -> Elements | None:
    """Return dV/dq."""
    V = parts.own("V")
    if V is None:
        return None
    by = parts.truth.coordinates.by_position
    energy: Element = V.item()
    return np.array([by(energy, i) for i in range(parts.n)], dtype=object)


def _hessian(parts: Consistency) -> Elements | None:
    """Return the second derivatives of K by the rates."""
    K = parts.own("K")
    if K is None:
        return None
    by, n = parts.truth.coordinates.by_rate, parts.n
    energy: Element = K.item()
    momenta = [by(energy, i) for i in range(n)]
    return np.array([[by(p, j) for j in range(n)] for p in momenta], dtype=object).reshape(n, n)


def _velocity_torques(parts: Consistency) -> Elements | None:
    """Return dM/dt qd - d(qd^T M qd / 2)/dq."""
    M = parts.own("M")
    if M is None:
        return None
    rates, by = parts.rates("rate"), parts.truth.coordinates.by_position
    momenta = M @ rates
    K = rates @ momenta / 2
    ring = parts.truth.lagrangian.arm.ring
    torques = [
        ring.sum(momentum.by_position(k) * ring.rate(k) for k in range(parts.n)) - by(K, i)
        for i, momentum in enumerate(momenta)
    ]
    return np.array(torques, dtype=object)


def _torques(parts: Consistency) -> Elements | None:
    """Return M qdd + h + g."""
    M, h, g = parts.own("M"), parts.own("h"), parts.own("g")
    if M is None or h is None or g is None:
        return None
    torques = M @ parts.rates("acceleration") + h + g
    friction = parts.truth.coordinates.in_y("tau", parts.truth.viscous) if parts.truth.friction else 0
    return torques + friction


def _lagrangian(parts: Consistency) -> Elements | None:
    """Return K - V."""
    K, V = parts.own("K"), parts.own("V")
    return None if K is None or V is None else element_array(K[()] - V[()])


def _product(parts: Consistency) -> Elements | None:
    """Return base A1 ... An tool."""
    T = parts.truth.kinematics.base
    for i in range(1, parts.n + 1):
        A = parts.own(f"A{i}")
        if A is None:
            return None
        T = T @ A
    pose: Elements = T @ parts.truth.kinematics.tool
    return pose


def _jacobian(parts: Consistency) -> Elements | None:
    """Return what moves with each variable: the velocity of T's origin, and that of its axes, dR/dq R^T."""
    T = parts.own("T")
    if T is None:
        return None
    by, columns = parts.truth.coordinates.by_position, []
    for i in range(parts.n):
        rate = np.array([[by(entry, i) for entry in row] for row in T[:3]], dtype=object)
        turn = rate[:, :3] @ T[:3, :3].T
        columns.append([*rate[:, 3], turn[2, 1], turn[0, 2], turn[1, 0]])
    return np.array(columns, dtype=object).T


_ROUTES: Mapping[str, tuple[tuple[tuple[str, ...], Route], ...]] = {
    "M": ((("K",), _hessian),),
    "C": ((("M",), _velocity_torques),),
    "h": ((("M",), _velocity_torques),),
    "g": ((("V",), _gradient),),
    "tau": ((("M", "C", "h", "g"), _torques),),
    "L": ((("K", "V"), _lagrangian),),
    "T": ((tuple(f"A{i}" for i in range(1, 33)), _product),),
    "J": ((("T",), _jacobian),),
}
"""By quantity the quantities that it is made of, and how."""
