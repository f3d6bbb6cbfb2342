"""Consistency of a sheet's own quantities: new errors, and errors that follow from earlier ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

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
        sources = _ROUTES[quantity].sources
        wrong = [name for name in sources if name in self.judged and self.judged[name].wrong]
        expected = self.derived(quantity) if wrong else None
        if expected is None:
            return {}

        follows: dict[Index, str] = {}
        for index in judged.wrong_indices:
            answer = judged.findings[index].answer
            derived = expected[place_of(quantity, index)]
            if answer is not None and answer.numerator_of_difference(derived).is_zero:
                follows[index] = ", ".join(wrong)
        return follows

    def notes(self) -> list[Note]:
        """Return notes on the quantities that agree with each other, or do not, if one of them is wrong."""
        notes = []
        for quantity, route in _ROUTES.items():
            given = tuple(name for name in route.sources if name in self.judged)
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

        The value of C, as of h, is C qd.
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
        route = _ROUTES[quantity]
        values = []
        for name in route.sources:
            # A source C is left out: own("h") is C qd where C alone is given.
            if name == "C" or name not in quantity_names(self.n):
                continue
            value = self.own(name)
            if value is None:
                return None
            values.append(value)
        return route.derive(self, *values)

    @property
    def n(self) -> int:
        """The number of joints."""
        return self.truth.description.n

    def rates(self, generator: Callable[[Ring, int], Element]) -> Elements:
        """Return the rates (``Ring.rate``) or accelerations of the student's variables, shape (n,)."""
        ring = self.truth.lagrangian.arm.ring
        return self.truth.coordinates.rates(
            element_array([generator(ring, i) for i in range(self.n)])
        )


class _Route(NamedTuple):
    """Derivation of a quantity from others."""

    sources: tuple[str, ...]
    """Names of the quantities from which it is derived."""
    derive: Callable[..., Elements]
    """Function of a :class:`Consistency` and the values of these quantities."""


def _gradient(parts: Consistency, V: Elements) -> Elements:
    """Return g = dV/dq, shape (n,)."""
    by = parts.truth.coordinates.by_position
    energy: Element = V.item()
    return np.array([by(energy, i) for i in range(parts.n)], dtype=object)


def _hessian(parts: Consistency, K: Elements) -> Elements:
    """Return M_ij = d2K / dyd_i dyd_j, shape (n, n), where yd are the rates of the student's variables."""
    by = parts.truth.coordinates.by_rate
    n = parts.n
    energy: Element = K.item()
    M = np.empty((n, n), dtype=object)
    for i in range(n):
        momentum = by(energy, i)
        for j in range(n):
            M[i, j] = by(momentum, j)
    return M


def _velocity_torques(parts: Consistency, M: Elements) -> Elements:
    """Return h = dM/dt yd - d(yd^T M yd / 2)/dy, shape (n,), for the student's variables y."""
    yd = parts.rates(Ring.rate)
    by = parts.truth.coordinates.by_position
    momenta = M @ yd
    K = yd @ momenta / 2

    # With the momenta p = M yd:  dM/dt yd = sum over k of dp/dq_k qd_k
    ring = parts.truth.lagrangian.arm.ring
    torques = []
    for i, momentum in enumerate(momenta):
        rate_of_momentum = ring.sum(momentum.by_position(k) * ring.rate(k) for k in range(parts.n))
        torques.append(rate_of_momentum - by(K, i))
    return np.array(torques, dtype=object)


def _torques(parts: Consistency, M: Elements, h: Elements, g: Elements) -> Elements:
    """Return tau = M ydd + h + g, with viscous friction if tau includes it, shape (n,)."""
    torques = M @ parts.rates(Ring.acceleration) + h + g
    friction = (
        parts.truth.coordinates.in_y("tau", parts.truth.viscous) if parts.truth.friction else 0
    )
    return torques + friction


def _product(parts: Consistency, *links: Elements) -> Elements:
    """Return T = T_base A_1 ... A_n T_tool, shape (4, 4)."""
    T = parts.truth.kinematics.base
    for A in links:
        T = T @ A
    return T @ parts.truth.kinematics.tool


def _jacobian(parts: Consistency, T: Elements) -> Elements:
    """Return J, shape (6, n): dp/dy_i of the origin p of T, then w_i of dR/dy_i R^T = (the matrix of w_i x)."""
    by = parts.truth.coordinates.by_position
    R = T[:3, :3]
    columns = []
    for i in range(parts.n):
        derivative = np.empty((3, 4), dtype=object)
        for place, entry in np.ndenumerate(T[:3]):
            derivative[place] = by(entry, i)
        w_matrix = derivative[:, :3] @ R.T
        columns.append([*derivative[:, 3], w_matrix[2, 1], w_matrix[0, 2], w_matrix[1, 0]])
    return np.array(columns, dtype=object).T


_ROUTES: Mapping[str, _Route] = {
    "M": _Route(("K",), _hessian),
    "C": _Route(("M",), _velocity_torques),
    "h": _Route(("M",), _velocity_torques),
    "g": _Route(("V",), _gradient),
    "tau": _Route(("M", "C", "h", "g"), _torques),
    "L": _Route(("K", "V"), lambda _, K, V: element_array(K[()] - V[()])),
    "T": _Route(tuple(f"A{i}" for i in range(1, 33)), _product),
    "J": _Route(("T",), _jacobian),
}
"""Derivations of quantities from others on the sheet, by the quantities."""
