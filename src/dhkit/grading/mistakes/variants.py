"""What each mistake changes on one robot: differences from the truth, made when asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from dhkit.grading.judging.coordinates import Coordinates
from dhkit.symbolic import Lagrangian
from dhkit.symbolic.mistakes import MadeAt
from dhkit.symbolic.ring import Element, Elements, Ring, element_array, translated
from dhkit.symbolic.textbook import velocity_torques

Make = Callable[[str], Elements]
"""Returns what a mistake adds to a quantity in the robot's own joint variables."""


@dataclass(frozen=True, eq=False)
class Change:
    """What a mistake adds to energies, from which what it adds to all else follows: equations are linear in them."""

    K: Element
    V: Element

    def of(self, quantity: str) -> Elements:
        """Return what it adds to M, h, g, tau, K, V or L."""
        ring = self.K.ring
        n = ring.n
        momenta = element_array([self.K.by_rate(i) for i in range(n)])
        match quantity:
            case "M":
                return np.array([[p.by_rate(j) for j in range(n)] for p in momenta], dtype=object).reshape(n, n)
            case "h":
                return velocity_torques(ring, self.K, momenta)
            case "g":
                return element_array([self.V.by_position(i) for i in range(n)])
            case "tau":
                return _torques(ring, self.of("M"), self.of("h"), self.of("g"))
        return element_array({"K": self.K, "V": self.V}.get(quantity, self.K - self.V))


@dataclass(frozen=True, eq=False)
class Variant:
    """A mistake on a robot.

    Attributes
    ----------
    made
        Which mistake, and at which link.
    make
        Returns what it adds to a quantity in the robot's own joint variables.
    place
        Which link, joint or parameters, in words; empty where it is made throughout.
    rarity
        How seldom such mistakes are made: 0 where a textbook's derivation goes wrong, 1 for what goes wrong in
        formulas, 2 for what is possible. Of several that explain an answer the least rare is named.
    is_kinematic
        Whether it is made in transforms and the Jacobian, not in the dynamics.
    """

    made: MadeAt
    make: Make
    place: str = ""
    rarity: int = 0
    is_kinematic: bool = False
    _made: dict[tuple[str, Coordinates], Elements] = field(default_factory=dict, repr=False)

    @property
    def identity(self) -> str:
        """The mistake's identity."""
        return self.made.identity

    @property
    def called(self) -> str:
        """The identity, with the place."""
        return f"{self.identity} ({self.place})" if self.place else self.identity

    def adds_to(self, quantity: str, coordinates: Coordinates) -> Elements:
        """Return what the mistake adds to a quantity in the student's coordinates; C counts by C qd."""
        key = (quantity, coordinates)
        if key not in self._made:
            self._made[key] = element_array(coordinates.in_y(quantity, self.make(quantity)))
        return self._made[key]


# Arrays of elements


def right(lag: Lagrangian, quantity: str) -> Elements:
    """Return a quantity's right value in the robot's own joint variables."""
    return element_array(lag.K - lag.V) if quantity == "L" else element_array(getattr(lag, quantity))


def nothing(lag: Lagrangian, quantity: str) -> Elements:
    """Return zeros of a quantity's shape."""
    return right(lag, quantity) * 0


def changed_only(lag: Lagrangian, changed: str, change: Callable[[], Elements]) -> Make:
    """Return what adds to one vector of torques, and to their sum."""

    def make(quantity: str) -> Elements:
        return change() if quantity in (changed, "tau") else nothing(lag, quantity)

    return make


def translated_array(array: Elements, places: Mapping[int, Element]) -> Elements:
    """Return elements with generators replaced, by their places."""
    result = np.empty(array.shape, dtype=object)
    for place, element in np.ndenumerate(array):
        result[place] = translated(element, element.ring, places)
    return result


def _torques(ring: Ring, M: Elements, h: Elements, g: Elements) -> Elements:
    return M @ element_array([ring.acceleration(i) for i in range(ring.n)]) + h + g
