"""A load in the tool, as an argument of a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dhkit import description as describe
from dhkit.description import INERTIA_PLACES, Array, Description
from dhkit.description.frames import number_array

__all__ = ["Payload"]


@dataclass(frozen=True)
class Payload:
    """A rigid load that the tool carries.

    Examples
    --------
    >>> Payload(2.0, com=(0, 0, 0.05))
    Payload(mass=2.0, com=(0, 0, 0.05), inertia=None)
    """

    mass: float
    """kg."""
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Centre of mass in the tool's frame, m."""
    inertia: tuple[tuple[float, ...], ...] | None = None
    """Shape (3, 3), about the centre of mass in the tool's axes, kg m^2; None: a point."""

    def carried(self, description: Description) -> Description:
        """Return an arm with the load joined to its last link.

        Raises
        ------
        DescriptionError
            A load that is none: a negative mass, an impossible inertia.
        """
        return describe.with_payload(description, self.mass, self.com, self.inertia)

    @property
    def numbers(self) -> Array:
        """Mass, centre of mass, and xx, yy, zz, xy, yz, xz, shape (10,)."""
        tensor = number_array(np.zeros((3, 3)) if self.inertia is None else self.inertia, "inertia", "(3, 3)")
        return np.array([self.mass, *self.com, *(tensor[place] for place in INERTIA_PLACES.values())], dtype=float)
