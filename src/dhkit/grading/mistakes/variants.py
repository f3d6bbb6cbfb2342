"""Mistakes on one robot, each with its change of every quantity, which is computed when asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from dhkit.grading.judging.coordinates import Coordinates
from dhkit.grading.judging.truth import right_value
from dhkit.symbolic import Lagrangian
from dhkit.symbolic.mistakes import MadeAt
from dhkit.symbolic.ring import Element, Elements, element_array
from dhkit.symbolic.textbook import velocity_torques

Make = Callable[[str], Elements]
"""Function that returns what a mistake adds to a quantity, in the robot's joint variables and the quantity's shape."""


@dataclass(frozen=True, eq=False)
class Change:
    """Change of the energies by a mistake; the changes of all equations follow, which are linear in the energies."""

    K: Element
    V: Element

    def of(self, quantity: str) -> Elements:
        """Return the change of M, h, g, tau, K, V or L."""
        ring = self.K.ring
        n = ring.n

        # p_i = dK/dqd_i
        momenta = element_array([self.K.by_rate(i) for i in range(n)])
        match quantity:
            case "M":
                # M_ij = dp_i/dqd_j
                M = np.empty((n, n), dtype=object)
                for i, momentum in enumerate(momenta):
                    for j in range(n):
                        M[i, j] = momentum.by_rate(j)
                return M
            case "h":
                return velocity_torques(ring, self.K, momenta)
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
        return element_array(self.K - self.V)


def make_lazily(change: Callable[..., Change], *arguments: object) -> Make:
    """Return what a change of the energies adds to a quantity; the change is computed once, when first asked for."""
    cached = cache(lambda: change(*arguments))
    return lambda quantity: cached().of(quantity)


@dataclass(frozen=True, eq=False)
class Variant:
    """Mistake on a robot.

    Attributes
    ----------
    made
        Identifier of the mistake, and the link where it is made.
    make
        Function that returns what the mistake adds to a quantity, in the robot's own joint variables.
    place
        Link, joint or parameters in words; empty if the mistake is made throughout.
    rarity
        Rank of the mistake among those that explain an answer, of which the one with the lowest rank is named: 0 for
        mistakes in a textbook's derivation, 1 for mistakes in formulas, 2 for those that are merely possible.
    is_kinematic
        Whether the mistake is made in transforms and the Jacobian, not in the dynamics.
    """

    made: MadeAt
    make: Make
    place: str = ""
    rarity: int = 0
    is_kinematic: bool = False
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
        """Return what the mistake adds to a quantity in the student's coordinates; C is represented by C qd."""
        key = (quantity, coordinates)
        if key not in self._changes:
            self._changes[key] = element_array(coordinates.in_y(quantity, self.make(quantity)))
        return self._changes[key]


# Arrays of elements


def nothing(lag: Lagrangian, quantity: str) -> Elements:
    """Return zeros in the shape of a quantity."""
    return right_value(lag, quantity) * 0


def changed_only(lag: Lagrangian, changed: str, change: Callable[[], Elements]) -> Make:
    """Return the function of a mistake that changes one vector of torques, and tau, which contains it."""

    def make(quantity: str) -> Elements:
        return change() if quantity in (changed, "tau") else nothing(lag, quantity)

    return make
