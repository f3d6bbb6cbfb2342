"""A rigid load that the tool carries: mass, centre of mass and inertia, for planned motions and joint torques."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description.arrays import Array, number_array
from dhkit.description.bodies import INERTIA_PLACES, eigenvalue_tolerance
from dhkit.description.changes import is_asymmetric, with_payload
from dhkit.description.robot import Description
from dhkit.display import value_line
from dhkit.errors import DescriptionError


@dataclass(frozen=True)
class Payload:
    """A rigid load that the tool carries.

    Raises
    ------
    DescriptionError
        Other shapes, numbers that are not finite, a negative mass, or an inertia that is not symmetric or has a
        negative eigenvalue. The triangle inequality of the moments is checked where it is joined to an arm.
    TypeError
        Not numbers.

    Examples
    --------
    >>> Payload(2, com=(0, 0, 0.05))
    Payload(mass=2.0, com=(0.0, 0.0, 0.05), inertia=None)
    """

    mass: float
    """kg."""
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Centre of mass in the tool's frame, m."""
    inertia: tuple[tuple[float, ...], ...] | None = None
    """Shape (3, 3), about the centre of mass in the tool's axes, kg m^2; None, as zeros become: a point mass."""

    def __post_init__(self) -> None:
        given_inertia = np.zeros((3, 3)) if self.inertia is None else self.inertia
        mass = _checked("mass", self.mass, ())
        com = _checked("com", self.com, (3,))
        tensor = _checked("inertia", given_inertia, (3, 3))
        if is_asymmetric(tensor):
            raise DescriptionError("payload: inertia is not symmetric")
        object.__setattr__(self, "mass", mass.item())
        object.__setattr__(self, "com", tuple(com.tolist()))
        object.__setattr__(
            self, "inertia", tuple(map(tuple, tensor.tolist())) if tensor.any() else None
        )

        if self.mass < 0:
            raise DescriptionError(f"payload: mass is {self.mass:g} kg; expected none below 0")
        moments = np.linalg.eigvalsh(tensor)  # ascending
        if moments[0] < -eigenvalue_tolerance(float(moments[-1])):
            raise DescriptionError(
                f"payload: inertia has the eigenvalue {moments[0]:.6g} kg m^2; expected none below 0"
            )

    def carried(self, description: Description) -> Description:
        """Return an arm with the load joined to its last link.

        Raises
        ------
        DescriptionError
            The last link has no body.
        """
        return with_payload(description, self.mass, self.com, self.inertia)

    @property
    def numbers(self) -> Array:
        """Mass, kg, centre of mass, m, and entries xx, yy, zz, xy, yz, xz of the inertia, kg m^2, shape (10,).

        The inertia is about the centre of mass; off-diagonal entries have the tensor's sign, xy = -integral of x y dm.
        """
        tensor = np.zeros((3, 3)) if self.inertia is None else np.array(self.inertia)
        return np.array(
            [self.mass, *self.com, *(tensor[place] for place in INERTIA_PLACES.values())],
            dtype=float,
        )

    @classmethod
    def of_numbers(cls, numbers: Array) -> Payload:
        """Return the payload of ten :attr:`numbers`.

        Parameters
        ----------
        numbers
            The ten numbers, shape (10,).
        """
        if numbers.shape != (10,):
            raise DescriptionError(f"payload: numbers has shape {numbers.shape}; expected (10,)")
        tensor = np.zeros((3, 3))
        for value, (i, j) in zip(numbers[4:], INERTIA_PLACES.values(), strict=True):
            tensor[i, j] = tensor[j, i] = value
        x, y, z = numbers[1:4].tolist()
        return cls(float(numbers[0]), (x, y, z), tuple(map(tuple, tensor.tolist())))

    __repr__ = value_line


def _checked(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return a value as finite numbers of a shape, or refuse it in one line."""
    array = number_array(value, f"payload: {name}", str(shape))
    if array.shape != shape:
        raise DescriptionError(f"payload: {name} has shape {array.shape}; expected {shape}")
    if not np.isfinite(array).all():
        raise DescriptionError(f"payload: {name} is {value!r}; expected finite numbers")
    return array
