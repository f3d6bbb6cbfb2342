"""Pinocchio's kinematics and dynamics at many states, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dhkit.description import INERTIA_PLACES, Array
from dhkit.model import PinocchioModel
from dhkit.verification.states import JointStates


class PinocchioResults:
    """Pinocchio's results for a model at N joint states; N is the first axis of every array.

    ``coupling``, shape (n, n), is the inertia of drives that move two joints together, which Pinocchio does not know:
    it is added to M, and to the quantities that depend on M.
    """

    def __init__(
        self, model: PinocchioModel, motion: JointStates, coupling: Array | None = None
    ) -> None:
        self.model = model
        self.motion = motion
        self.coupling = np.zeros((model.nv, model.nv)) if coupling is None else coupling
        self._data = model.createData()

    @property
    def notes(self) -> list[str]:
        """One sentence for each addition to Pinocchio's results."""
        return (
            ["the inertia of coupled drives was added to Pinocchio's M"]
            if self.coupling.any()
            else []
        )

    def frames(self, names: Sequence[str]) -> Array:
        """Return frames in the world, shape (N, names, 4, 4)."""
        import pinocchio as pin

        ids = [self.model.getFrameId(name) for name in names]

        def placements(q: Array, qd: Array, qdd: Array) -> Array:
            pin.framesForwardKinematics(self.model, self._data, q)
            return np.array([self._data.oMf[i].homogeneous for i in ids])

        return self._each(placements, (len(ids), 4, 4))

    def jacobian(self, name: str, *, in_world: bool) -> Array:
        """Return a frame's Jacobian at its origin, linear rows (m) first, in world or own axes, shape (N, 6, n)."""
        import pinocchio as pin

        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED if in_world else pin.ReferenceFrame.LOCAL
        frame = self.model.getFrameId(name)

        def jacobian(q: Array, qd: Array, qdd: Array) -> Array:
            return np.asarray(pin.computeFrameJacobian(self.model, self._data, q, frame, axes))

        return self._each(jacobian, (6, self.n))

    def mass_matrix(self) -> Array:
        """Return joint-space mass matrices M(q), shape (N, n, n), kg m^2, kg m and kg."""
        import pinocchio as pin

        # Old versions fill only the upper triangle.
        M = self._each(lambda q, qd, qdd: pin.crba(self.model, self._data, q), (self.n, self.n))
        symmetric = np.triu(M) + np.swapaxes(np.triu(M, 1), 1, 2)
        return symmetric + self.coupling

    def coriolis_matrix(self) -> Array:
        """Return Coriolis matrices C(q, qd) of Christoffel symbols, shape (N, n, n); C qd is in N m and N."""
        import pinocchio as pin

        return self._each(
            lambda q, qd, qdd: pin.computeCoriolisMatrix(self.model, self._data, q, qd),
            (self.n, self.n),
        )

    def gravity_torque(self) -> Array:
        """Return gravity torques g(q), shape (N, n), N m and N."""
        import pinocchio as pin

        return self._each(
            lambda q, qd, qdd: pin.computeGeneralizedGravity(self.model, self._data, q), (self.n,)
        )

    def inverse_dynamics(self) -> Array:
        """Return joint torques of the states' accelerations, without friction, shape (N, n), N m and N."""
        import pinocchio as pin

        tau = self._each(lambda q, qd, qdd: pin.rnea(self.model, self._data, q, qd, qdd), (self.n,))
        return np.asarray(tau + self.motion.qdd @ self.coupling)

    def forward_dynamics(self, tau: Array) -> Array:
        """Return accelerations under joint torques, shape (N, n), N m and N; rad/s^2 and m/s^2, shape (N, n)."""
        import pinocchio as pin

        if self.coupling.any():
            # M qdd = tau - (C qd + g)
            bias = self._each(
                lambda q, qd, qdd: pin.nonLinearEffects(self.model, self._data, q, qd), (self.n,)
            )
            qdd = np.linalg.solve(self.mass_matrix(), (tau - bias)[..., None])
            return np.asarray(qdd[..., 0])
        torques = iter(tau)
        return self._each(
            lambda q, qd, qdd: pin.aba(self.model, self._data, q, qd, next(torques)), (self.n,)
        )

    def kinetic_energy(self) -> Array:
        """Return kinetic energies, shape (N,), J."""
        import pinocchio as pin

        K = self._each(
            lambda q, qd, qdd: pin.computeKineticEnergy(self.model, self._data, q, qd), ()
        )
        of_couplings = np.einsum("ni,ij,nj->n", self.motion.qd, self.coupling, self.motion.qd) / 2
        return np.asarray(K + of_couplings)

    def potential_energy(self) -> Array:
        """Return potential energies, shape (N,), J."""
        import pinocchio as pin

        return self._each(
            lambda q, qd, qdd: pin.computePotentialEnergy(self.model, self._data, q), ()
        )

    def regressor(self) -> Array:
        """Return Y with tau = Y p, p the 10 inertial parameters of each link in its DH frame, shape (N, n, 10 n).

        Pinocchio's parameters are those of its own joint frames, in its own order.
        """
        import pinocchio as pin

        Y = self._each(
            lambda q, qd, qdd: pin.computeJointTorqueRegressor(self.model, self._data, q, qd, qdd),
            (self.n, 10 * self.n),
        )
        for i in range(self.n):
            columns = slice(10 * i, 10 * i + 10)
            Y[:, :, columns] = Y[:, :, columns] @ self._parameters(i)
        return Y

    def _parameters(self, i: int) -> Array:
        """Return the matrix (10, 10) from the parameters of DH frame i + 1 to Pinocchio's of its link."""
        import pinocchio as pin

        pin.framesForwardKinematics(self.model, self._data, pin.neutral(self.model))
        T = self._data.oMi[i + 1].inverse() * self._data.oMf[self.model.getFrameId(f"dh{i + 1}")]
        R = T.rotation
        p = T.translation
        identity = np.eye(3)

        # Column k: the parameters of a body whose parameter k is 1. With m, h and I in the DH frame,
        #   h' = R h + m p
        #   I' = R I R^T + 2 (p . R h) 1 - p (R h)^T - (R h) p^T + m (p^2 1 - p p^T)
        matrix = np.zeros((10, 10))
        for k, unit in enumerate(np.eye(10)):
            m = unit[0]
            R_h = R @ unit[1:4]
            inertia = np.zeros((3, 3))
            for value, (a, b) in zip(unit[4:], INERTIA_PLACES.values(), strict=True):
                inertia[a, b] = inertia[b, a] = value
            mixed = 2 * (p @ R_h) * identity - np.outer(p, R_h) - np.outer(R_h, p)
            inertia = R @ inertia @ R.T + mixed + m * (p @ p * identity - np.outer(p, p))
            matrix[:, k] = [m, *(R_h + m * p), *(inertia[place] for place in _PINOCCHIO_ORDER)]
        return matrix

    @property
    def n(self) -> int:
        """The number of joints."""
        return int(self.model.nv)

    def _each(
        self, answer: Callable[[Array, Array, Array], object], shape: tuple[int, ...]
    ) -> Array:
        """Return the answers of this shape for the states (q, qd, qdd), shape (N, *shape)."""
        results = []
        for state in zip(*self.motion, strict=True):
            # Pinocchio overwrites its arrays: copy. eigenpy returns a matrix of one column as a vector.
            result = np.array(answer(*state))
            results.append(np.reshape(result, shape))
        return np.array(results)


_PINOCCHIO_ORDER = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
"""Row and column of Pinocchio's inertia parameters, in its order: Ixx, Ixy, Iyy, Ixz, Iyz, Izz."""
