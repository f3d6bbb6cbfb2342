"""Consistency of a sheet's own quantities: new errors, and errors that follow from earlier ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from dhkit.grading.answers.sheet import quantity_names
from dhkit.grading.judging.quantities import Index, JudgedQuantity, place_of
from dhkit.grading.judging.truth import Truth
from dhkit.grading.remarks import Note, NoteKind
from dhkit.symbolic.ring import Element, Elements, Ring, element_array


@dataclass(frozen=True, eq=False)
class Consistency:
    """Comparison of a sheet's quantities with each other, in the order of the derivation.

    Attributes
    ----------
    truth
        Right answers, for quantities that are not on the sheet.
    judged
        The sheet's quantities by name.
    """

    truth: Truth
    judged: Mapping[str, JudgedQuantity]

    def follows(self, quantity: str) -> dict[Index, str]:
        """Return the wrong entries that are derived correctly from wrong answers, with the names of these answers."""
        judged = self.judged[quantity]
        if quantity not in _ROUTES:
            return {}
        sources = _ROUTES[quantity][0]
        wrong = [name for name in sources if name in self.judged and self.judged[name].wrong]
        expected = self.derived(quantity) if wrong else None
        if expected is None:
            return {}
        answers = {index: judged.findings[index].answer for index in judged.wrong_indices}
        return {
            index: ", ".join(wrong)
            for index, answer in answers.items()
            if answer is not None and answer.numerator_of_difference(expected[place_of(quantity, index)]).is_zero
        }

    def notes(self) -> list[Note]:
        """Return notes on which quantities agree with each other, right or wrong, if one of them is wrong."""
        notes = []
        for quantity, (sources, _) in _ROUTES.items():
            given = tuple(name for name in sources if name in self.judged)
            if quantity not in self.judged or not given:
                continue
            if not any(self.judged[name].wrong for name in (quantity, *given)):
                continue
            own = self.own(quantity)
            expected = self.derived(quantity)
            if own is None or expected is None:
                continue
            agrees = all((a - b).is_zero for a, b in zip(own.flat, expected.flat, strict=True))
            notes.append(Note(NoteKind.AGREES if agrees else NoteKind.DISAGREES, quantity, given))
        return notes

    def own(self, quantity: str) -> Elements | None:
        """Return a quantity of the sheet, or the truth if it is not on the sheet; None if it is outside the ring.

        C and h stand for C qd.
        """
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
            array[place_of(name, index)] = element
        return array

    def derived(self, quantity: str) -> Elements | None:
        """Return a quantity as it follows from those that the sheet has; None if one of them is outside the ring."""
        sources, derive = _ROUTES[quantity]
        values = []
        for name in sources:
            if name == "C" or name not in quantity_names(self.n):  # own("h") is C qd where C alone is given
                continue
            value = self.own(name)
            if value is None:
                return None
            values.append(value)
        return derive(self, *values)

    @property
    def n(self) -> int:
        """The number of joints."""
        return self.truth.description.n

    def rates(self, generator: Callable[[Ring, int], Element]) -> Elements:
        """Return the rates (``Ring.rate``) or accelerations of the student's variables, shape (n,)."""
        ring = self.truth.lagrangian.arm.ring
        return self.truth.coordinates.rates(element_array([generator(ring, i) for i in range(self.n)]))


_Route = Callable[..., Elements]
"""Derives a quantity from the sheet's others, which follow its first argument, a :class:`Consistency`."""


def _gradient(parts: Consistency, V: Elements) -> Elements:
    """Return dV/dq."""
    by = parts.truth.coordinates.by_position
    energy: Element = V.item()
    return np.array([by(energy, i) for i in range(parts.n)], dtype=object)


def _hessian(parts: Consistency, K: Elements) -> Elements:
    """Return the second derivatives of K by the rates."""
    by = parts.truth.coordinates.by_rate
    n = parts.n
    energy: Element = K.item()
    momenta = [by(energy, i) for i in range(n)]
    return np.array([[by(p, j) for j in range(n)] for p in momenta], dtype=object).reshape(n, n)


def _velocity_torques(parts: Consistency, M: Elements) -> Elements:
    """Return dM/dt qd - d(qd^T M qd / 2)/dq."""
    rates = parts.rates(Ring.rate)
    by = parts.truth.coordinates.by_position
    momenta = M @ rates
    K = rates @ momenta / 2
    ring = parts.truth.lagrangian.arm.ring
    torques = [
        ring.sum(momentum.by_position(k) * ring.rate(k) for k in range(parts.n)) - by(K, i)
        for i, momentum in enumerate(momenta)
    ]
    return np.array(torques, dtype=object)


def _torques(parts: Consistency, M: Elements, h: Elements, g: Elements) -> Elements:
    """Return M qdd + h + g."""
    torques = M @ parts.rates(Ring.acceleration) + h + g
    friction = parts.truth.coordinates.in_y("tau", parts.truth.viscous) if parts.truth.friction else 0
    return torques + friction


def _product(parts: Consistency, *links: Elements) -> Elements:
    """Return base A1 ... An tool."""
    T = parts.truth.kinematics.base
    for A in links:
        T = T @ A
    return T @ parts.truth.kinematics.tool


def _jacobian(parts: Consistency, T: Elements) -> Elements:
    """Return the derivatives of T's origin by the variables, and the axes of dR/dq R^T, shape (6, n)."""
    by = parts.truth.coordinates.by_position
    columns = []
    for i in range(parts.n):
        rate = np.array([[by(entry, i) for entry in row] for row in T[:3]], dtype=object)
        turn = rate[:, :3] @ T[:3, :3].T
        columns.append([*rate[:, 3], turn[2, 1], turn[0, 2], turn[1, 0]])
    return np.array(columns, dtype=object).T


_ROUTES: Mapping[str, tuple[tuple[str, ...], _Route]] = {
    "M": (("K",), _hessian),
    "C": (("M",), _velocity_torques),
    "h": (("M",), _velocity_torques),
    "g": (("V",), _gradient),
    "tau": (("M", "C", "h", "g"), _torques),
    "L": (("K", "V"), lambda _, K, V: element_array(K[()] - V[()])),
    "T": (tuple(f"A{i}" for i in range(1, 33)), _product),
    "J": (("T",), _jacobian),
}
"""By quantity: the quantities that it is derived from, and the derivation."""
