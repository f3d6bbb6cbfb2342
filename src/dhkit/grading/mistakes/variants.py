"""Mistakes on one robot: what each adds to M, h, g, tau, K, V and L, computed on request.

h = C qd are the velocity torques, h_i = sum_k (dp_i/dq_k) qd_k - dK/dq_i with the momenta p_i = dK/dqd_i.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from dhkit.cached_property import cached_property
from dhkit.grading.judging.coordinates import Coordinates
from dhkit.grading.judging.truth import right_value
from dhkit.symbolic import Lagrangian
from dhkit.symbolic.mistakes import MadeAt
from dhkit.symbolic.ring import Element, Elements, element_array
from dhkit.symbolic.textbook import velocity_torques

Addition = Callable[[str], Elements]
"""Function that returns a mistake's change of a quantity, in the robot's joint variables and the quantity's shape."""


@dataclass(frozen=True, eq=False)
class Change:
    """Change of the energies by a mistake.

    Every quantity is linear in K and V, so that its change is the quantity computed from the changes of K and V.
    """

    K: Element
    """Change of the kinetic energy."""
    V: Element
    """Change of the potential energy."""

    @cached_property
    def momenta(self) -> Elements:
        """The changes of p_i = dK/dqd_i."""
        return element_array([self.K.by_rate(i) for i in range(self.K.ring.n)])

    def of(self, quantity: str) -> Elements:
        """Return the change of M, h, g, tau, K, V or L."""
        ring = self.K.ring
        n = ring.n
        match quantity:
            case "M":
                # M_ij = dp_i/dqd_j
                M = np.empty((n, n), dtype=object)
                for i, momentum in enumerate(self.momenta):
                    for j in range(n):
                        M[i, j] = momentum.by_rate(j)
                return M
            case "h":
                return velocity_torques(ring, self.K, self.momenta)
            case "g":
                # g_i = dV/dq_i
                return element_array([self.V.by_position(i) for i in range(n)])
            case "tau":
                # tau = M qdd + h + g
                accelerations = element_array([ring.acceleration(i) for i in range(n)])
                return self.of("M") @ accelerations + self.of("h") + self.of("g")
            case "K":
                return element_array(self.K)
            case "V":
                return element_array(self.V)
            case "L":
                return element_array(self.K - self.V)
        raise ValueError(f"no quantity {quantity!r}; expected M, h, g, tau, K, V or L")


def added_lazily(derive_change: Callable[..., Change], *arguments: object) -> Addition:
    """Return the additions of a change of the energies, which is derived when the first of them is asked for."""
    change = cache(lambda: derive_change(*arguments))
    return lambda quantity: change().of(quantity)


@dataclass(frozen=True, eq=False)
class Variant:
    """Mistake on a robot.

    Attributes
    ----------
    made
        Identifier of the mistake, and the link where it is made.
    adds
        Function that returns what the mistake adds to a quantity, in the robot's own joint variables.
    place
        Link, joint or parameters in words; empty if the mistake is made throughout.
    rarity
        Rank among mistakes that explain equally many quantities, of which the one with the lowest is named: 0 for
        mistakes in a textbook's derivation, 1 for mistakes in formulas, 2 for those that are merely possible.
    is_kinematic
        Whether the mistake is made in transforms and the Jacobian, not in the dynamics.
    """

    made: MadeAt
    adds: Addition
    place: str = ""
    rarity: int = 0
    is_kinematic: bool = False
    # A cache.
    _changes: dict[tuple[str, Coordinates], Elements] = field(default_factory=dict, repr=False)

    @property
    def identity(self) -> str:
        """Identifier of the mistake."""
        return self.made.identity

    @property
    def name(self) -> str:
        """Identifier of the mistake, with the place."""
        return f"{self.identity} ({self.place})" if self.place else self.identity

    def adds_to(self, quantity: str, coordinates: Coordinates) -> Elements:
        """Return the mistake's change of a quantity in the student's coordinates y, q = B y.

        h, g and tau become B^T (.), and M becomes B^T M B. C is not unique; its mistakes are compared in h = C qd.
        """
        key = (quantity, coordinates)
        if key not in self._changes:
            self._changes[key] = element_array(coordinates.in_y(quantity, self.adds(quantity)))
        return self._changes[key]


# Building blocks of variants


def nothing(lag: Lagrangian, quantity: str) -> Elements:
    """Return zeros in the shape of a quantity."""
    return right_value(lag, quantity) * 0


def changed_only(lag: Lagrangian, changed: str, change: Callable[[], Elements]) -> Addition:
    """Return a mistake's addition to ``changed`` (h, g or tau), and to tau, which contains it; zeros for the others."""
    cached_change = cache(change)

    def adds(quantity: str) -> Elements:
        return cached_change() if quantity in (changed, "tau") else nothing(lag, quantity)

    return adds
