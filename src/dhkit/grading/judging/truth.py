"""What is right: an arm's equations and transforms in the exact ring, in the student's coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, lru_cache

import numpy as np

from dhkit.description import Description
from dhkit.description.parameters import resolved
from dhkit.grading.judging.coordinates import Coordinates
from dhkit.symbolic import ExactArm, Lagrangian, lagrangian
from dhkit.symbolic.ring import Element, Elements, Ring, element_array, translated
from dhkit.symbolic.textbook_kinematics import TextbookKinematics, derive_kinematics

DYNAMICS = ("M", "C", "h", "g", "tau", "K", "V", "L")
"""Quantities of the equations of motion, in the order in which they are derived from one another."""


@dataclass(frozen=True, eq=False)
class Truth:
    """The right answers for a robot.

    Attributes
    ----------
    description
        The robot.
    coordinates
        In which joint variables torques and mass matrices are asked for.
    friction
        Whether tau includes viscous friction.
    """

    description: Description
    coordinates: Coordinates
    friction: bool = False
    _made: dict[str, Elements] = field(default_factory=dict, repr=False)

    @cached_property
    def kinematics(self) -> TextbookKinematics:
        """The table's transforms, which need no bodies."""
        return derive_kinematics(self.description)

    @cached_property
    def lagrangian(self) -> Lagrangian:
        """The equations of motion.

        Raises
        ------
        DescriptionError
            A link has no body.
        """
        return lagrangian(self.description)

    def arm(self, quantity: str) -> ExactArm:
        """Return the arm in whose ring a quantity is."""
        return self.lagrangian.arm if quantity in DYNAMICS else self.kinematics.arm

    def others(self, quantity: str) -> dict[str, Fraction]:
        """Return the numbers of the parameters that a quantity's ring does not have."""
        known = set(self.arm(quantity).ring.constants)
        names = (name for name in self.description.parameters if name not in known)
        return {name: exact_number(self.description, name) for name in names}

    def of(self, quantity: str) -> Elements:
        """Return a quantity's right value, an array of elements.

        Raises
        ------
        DescriptionError
            A link has no body, and the quantity needs it.
        """
        if quantity not in self._made:
            self._made[quantity] = self.coordinates.in_y(quantity, self._robots(quantity))
        return self._made[quantity]

    def _robots(self, quantity: str) -> Elements:
        if quantity not in DYNAMICS:
            return kinematic_quantity(self.kinematics, quantity)
        lag = self.lagrangian
        value = lag.K - lag.V if quantity == "L" else getattr(lag, quantity)
        array = element_array(value)
        return array + self.viscous if quantity == "tau" and self.friction else array

    @cached_property
    def viscous(self) -> Elements:
        """Friction torques gear^2 B qd on the joints' side, shape (n,)."""
        arm = self.lagrangian.arm
        pairs = zip(arm.gear, arm.viscous, strict=True)
        return element_array([gear * gear * B * arm.ring.rate(i) for i, (gear, B) in enumerate(pairs)])


@lru_cache(maxsize=32)
def truth_of(description: Description, absolute: bool = False, friction: bool = False) -> Truth:
    """Return the right answers; the same object each time, so that nothing is derived twice."""
    arm = derive_kinematics(description).arm
    coordinates = Coordinates.absolute(arm) if absolute else Coordinates.relative(description.n)
    return Truth(description, coordinates, friction)


def kinematic_quantity(kinematics: TextbookKinematics, quantity: str) -> Elements:
    """Return A1 ... An, T or J of a derivation."""
    if quantity in ("T", "J"):
        return kinematics.T if quantity == "T" else kinematics.J
    return kinematics.A[int(quantity[1:]) - 1]


def substituted(array: Elements, values: Mapping[str, Element], ring: Ring) -> Elements:
    """Return elements with constants replaced, by their texts."""
    places = {ring.place("constant", text): value for text, value in values.items()}
    result = np.empty(array.shape, dtype=object)
    for place, element in np.ndenumerate(array):
        result[place] = translated(element, ring, places)
    return result


def exact_number(description: Description, name: str) -> Fraction:
    """Return a parameter's number in the file."""
    value = resolved(description.parameters)[name]
    return value.value() if value.rational is None else value.rational
