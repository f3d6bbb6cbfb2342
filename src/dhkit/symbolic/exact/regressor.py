"""The regressor: torques are linear in the inertial parameters, tau = Y(q, qd, qdd) theta."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dhkit.display import repr_line
from dhkit.symbolic.exact.lagrangian import Lagrangian, Proof
from dhkit.symbolic.ring import Elements, RingError


@dataclass(frozen=True, eq=False, repr=False)
class Regressor:
    """Torques as a matrix times inertial parameters (Khosla & Kanade, 1985; Atkeson, An & Hollerbach, 1986).

    Attributes
    ----------
    lagrangian
        The equations.
    names
        The parameters theta. For each link: mass ``m2``, first moments ``rx2`` ..., second moments about its DH
        frame's origin ``Ixx2`` ..., and its drive's rotor inertia ``Jm2``; then inertias of drives that move two joints
        together, ``Jc23``. Or base parameters.
    Y
        Matrix, shape (n, parameters), of elements that do not contain the parameters.
    """

    lagrangian: Lagrangian
    names: tuple[str, ...]
    Y: Elements

    def __repr__(self) -> str:
        return repr_line(
            "Regressor", self.lagrangian.description.name, " x ".join(map(str, self.Y.shape))
        )

    @property
    def theta(self) -> Elements:
        """The parameters as elements, shape (parameters,)."""
        ring = self.lagrangian.arm.ring
        return np.array([ring.constant(name) for name in self.names], dtype=object)

    def prove(self) -> Proof:
        """Decide whether Y theta is M qdd + C qd + g: whether torques are linear in the parameters."""
        return Proof("tau = Y theta", self.Y @ self.theta - self.lagrangian.tau)


def regressor(equations: Lagrangian) -> Regressor:
    """Return the regressor of equations in inertial parameters (``symbols="inertial"``), or in base parameters.

    Raises
    ------
    RingError
        The equations have no inertial parameters: masses and moments are numbers or depend on other parameters.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.symbolic.exact.lagrangian import lagrangian
    >>> found = regressor(lagrangian(library_robot("cart_pendulum"), "inertial"))
    >>> found.Y.shape, bool(found.prove())
    ((2, 20), True)
    """
    names = equations.arm.inertial
    if not names:
        raise RingError(
            f"the equations of {equations.description.name} have no inertial parameters; derive them with"
            " symbols='inertial'"
        )

    # tau is linear in theta, so Y_ik = dtau_i/dtheta_k.
    Y = np.empty((equations.n, len(names)), dtype=object)
    for i, torque in enumerate(equations.tau):
        for k, name in enumerate(names):
            Y[i, k] = torque.by_constant(name)
    return Regressor(equations, names, Y)
