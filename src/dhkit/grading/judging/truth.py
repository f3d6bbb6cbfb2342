"""Right answers: an arm's equations and transforms in the exact ring, in the student's coordinates."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, lru_cache

import numpy as np

from dhkit.description import Description
from dhkit.description.parameters import resolved
from dhkit.grading.judging.coordinates import Coordinates
from dhkit.grading.judging.quotients import RingReader
from dhkit.symbolic import ExactArm, Lagrangian, lagrangian
from dhkit.symbolic.ring import Element, Elements, Ring, element_array, translated
from dhkit.symbolic.textbook_kinematics import TextbookKinematics, derive_kinematics

DYNAMICS = ("M", "C", "h", "g", "tau", "K", "V", "L")
"""Quantities of the equations of motion, each derived from those before it."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Right answers for a robot.

    Attributes
    ----------
    description
        The robot.
    coordinates
        Joint variables in which the task asks for torques and mass matrices.
    friction
        Whether tau includes viscous friction.
    """

    description: Description
    coordinates: Coordinates
    friction: bool = False
    _values: dict[str, Elements] = field(default_factory=dict, repr=False)

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

    @cached_property
    def numbers(self) -> Mapping[str, Fraction]:
        """The file's numbers of the parameters, in SI units or rad."""
        return {name: exact_number(self.description, name) for name in self.description.parameters}

    def arm(self, quantity: str) -> ExactArm:
        """Return the arm to whose ring a quantity belongs."""
        return self.lagrangian.arm if quantity in DYNAMICS else self.kinematics.arm

    def reader(self, quantity: str) -> RingReader:
        """Return a reader into a quantity's ring, with numbers for the parameters that the ring does not have."""
        ring = self.arm(quantity).ring
        names = self.description.parameters.keys() - set(ring.constants)
        return RingReader(ring, numbers={name: self.numbers[name] for name in names})

    def of(self, quantity: str) -> Elements:
        """Return the right value of a quantity, an array of elements in the quantity's shape.

        Raises
        ------
        DescriptionError
            A link has no body, and the quantity needs it.
        """
        if quantity not in self._values:
            self._values[quantity] = self.coordinates.in_y(
                quantity, self._in_robot_variables(quantity)
            )
        return self._values[quantity]

    def with_numbers(self, quantity: str, array: Elements, numbers: Collection[str]) -> Elements:
        """Return elements of a quantity's ring with the file's numbers instead of some parameters."""
        ring = self.arm(quantity).ring
        return substituted(array, {p: ring.number(self.numbers[p]) for p in numbers}, ring)

    def _in_robot_variables(self, quantity: str) -> Elements:
        """Return the right value of a quantity in the robot's own joint variables."""
        if quantity not in DYNAMICS:
            return kinematic_quantity(self.kinematics, quantity)
        array = right_value(self.lagrangian, quantity)
        return array + self.viscous if quantity == "tau" and self.friction else array

    @cached_property
    def viscous(self) -> Elements:
        """Viscous friction torques r^2 B qd on the joints' side, shape (n,), N m or N, for gear ratios r."""
        arm = self.lagrangian.arm
        torques = []
        for i, (r, B) in enumerate(zip(arm.gear, arm.viscous, strict=True)):
            torques.append(r * r * B * arm.ring.rate(i))
        return element_array(torques)


@lru_cache(maxsize=32)
def truth_of(description: Description, absolute: bool = False, friction: bool = False) -> Truth:
    """Return the right answers for a robot; the same object each time, so that nothing is derived twice."""
    arm = derive_kinematics(description).arm
    coordinates = Coordinates.absolute(arm) if absolute else Coordinates.relative(description.n)
    return Truth(description, coordinates, friction)


def right_value(lag: Lagrangian, quantity: str) -> Elements:
    """Return M, C, h, g, tau, K, V or L in the robot's own joint variables, without friction."""
    if quantity == "L":
        return element_array(lag.K - lag.V)
    return element_array(getattr(lag, quantity))


def kinematic_quantity(kinematics: TextbookKinematics, quantity: str) -> Elements:
    """Return A1 ... An (4, 4), T (4, 4) or J (6, n) of a derivation."""
    if quantity == "T":
        return kinematics.T
    if quantity == "J":
        return kinematics.J
    link = int(quantity[1:])
    return kinematics.A[link - 1]


def substituted(array: Elements, values: Mapping[str, Element], ring: Ring) -> Elements:
    """Return elements with constants, given by their texts, replaced by elements of a ring."""
    return translated_array(
        array, {ring.place("constant", text): value for text, value in values.items()}, ring
    )


def translated_array(
    array: Elements, places: Mapping[int, Element], ring: Ring | None = None
) -> Elements:
    """Return elements with generators, given by their places, replaced; in their own ring unless another is given."""
    result = np.empty(array.shape, dtype=object)
    for index, element in np.ndenumerate(array):
        result[index] = translated(element, element.ring if ring is None else ring, places)
    return result


def exact_number(description: Description, name: str) -> Fraction:
    """Return the number of a parameter in the file, in SI units or rad."""
    value = resolved(description.parameters)[name]
    return value.value() if value.rational is None else value.rational
