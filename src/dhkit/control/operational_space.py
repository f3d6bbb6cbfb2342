"""Operational space control: of the tool's pose, by the Jacobian and the operational space inertia."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.control.gains import gain, gains_text, pd_gains, positive
from dhkit.control.references import Setpoint
from dhkit.description import Array, Robot, description_of
from dhkit.description.arrays import number_array
from dhkit.display import repr_line
from dhkit.dynamics import bias, mass_matrix, require_inertia
from dhkit.kinematics import forward_kinematics, jacobian, jacobian_dot
from dhkit.verification import random_motions

PROBES = 16
"""Number of random configurations at which the rank of the Jacobian is determined."""
ZERO = 1e-9
"""Singular value, relative to the largest, below which the tool cannot move in a direction."""


class OperationalSpace:
    """tau = J^T Lambda (a_d + kd de/dt + kp e - dJ/dt qd) + C qd + g + N^T tau_0.

    Khatib, A unified approach for motion and force control of robot manipulators: the operational space formulation,
    1987. e is the tool's error: position, then the rotation vector of R_d R^T, in world axes; Lambda = (J M^-1 J^T)^-1
    is the operational space inertia. Each coordinate's error decays as s^2 + kd s + kp says.

    Near a singularity, Lambda is damped. J, lengths over the arm's reach, has the singular values sigma_i with left and
    right vectors u_i and v_i; where sigma_i is below the threshold sigma_0, (sigma_0^2 - sigma_i^2) v_i^T M^-1 v_i is
    added to J M^-1 J^T along u_i. That is the damping factor (1 - (sigma / sigma_0)^2) lambda^2 of Nakamura & Hanafusa,
    Inverse kinematic solutions with singularity robustness, 1986, but for each singular value by itself, as in the
    numerical filtering of Chiaverini, Siciliano & Egeland, Review of the damped least-squares inverse kinematics, 1994.
    So torques stay bounded, and a direction is given up where its sigma_i = 0. Directions in which the arm can never
    move its tool, such as those out of the plane of planar2r, are left out: the part of the error that the columns of J
    span counts.

    What the tool leaves to the joints follows the setpoint's joint values: tau_0 = M (qdd_d + posture_kd (qd_d - qd) +
    posture_kp (q_d - q)), and N^T = 1 - J^T Lambda J M^-1, which does not accelerate the tool. That is the null space
    of a redundant arm or of left-out ``directions``, and in part a direction that is lost near a singularity.

    Parameters
    ----------
    robot
        The arm, or its description.
    kp, kd
        Gains of the tool's error, 1/s^2 and 1/s: a number, or shape (6,), position then rotation, world axes.
    posture_kp, posture_kd
        Gains of the joints' errors, 1/s^2 and 1/s: a number, or shape (n,); the means of ``kp`` and ``kd`` unless
        given.
    directions
        Which of the tool's velocities are controlled, shape (6,), linear then angular, world axes: all unless given.
    threshold
        sigma_0: a number without unit, for lengths are taken over the arm's reach.

    Raises
    ------
    ValueError
        A gain that is negative or not finite, no direction, a threshold that is not positive.
    TypeError
        Not an arm, or gains that are not numbers.
    DescriptionError
        A link without a body.
    """

    batches = False
    """False: the controller takes the state of one arm, not states of a batch."""

    def __init__(
        self,
        robot: Robot,
        kp: ArrayLike,
        kd: ArrayLike,
        *,
        posture_kp: ArrayLike | None = None,
        posture_kd: ArrayLike | None = None,
        directions: ArrayLike | None = None,
        threshold: float = 0.05,
    ) -> None:
        self.description = description_of(robot)
        require_inertia(self.description)
        n = self.description.n
        self.kp = _tool_gain(kp, "kp")
        self.kd = _tool_gain(kd, "kd")
        self.posture_kp = gain(
            self.kp.mean() if posture_kp is None else posture_kp, "posture_kp", n
        )
        self.posture_kd = gain(
            self.kd.mean() if posture_kd is None else posture_kd, "posture_kd", n
        )
        self.threshold = positive(threshold, "threshold")
        self._rows = _rows(directions)
        length = self.description.reach or 1.0
        self._row_scale: Array = np.repeat([1 / length, 1.0], 3)[self._rows]
        self._joint_scale: Array = np.where(self.description.numbers.prismatic, length, 1.0)
        self._rank = self._freedoms()

    @classmethod
    def tuned(
        cls,
        robot: Robot,
        bandwidth: float = 20.0,
        damping: float = 1.0,
        directions: ArrayLike | None = None,
        threshold: float = 0.05,
    ) -> Self:
        """Return the controller with kp = w^2 and kd = 2 z w, for the tool's error and the joints'.

        Parameters
        ----------
        robot
            The arm, or its description.
        bandwidth, damping
            w, rad/s, and z.
        directions, threshold
            As for the class.
        """
        return cls(robot, *pd_gains(bandwidth, damping), directions=directions, threshold=threshold)

    def __call__(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the torques, shape (n,), N m and N."""
        description = self.description
        scale = self._joint_scale

        # In joint coordinates x, q = D x with D = diag(reach if prismatic, else 1), singular values have no unit. The
        # Jacobian becomes J D, the mass matrix D M D, accelerations D^-1 a_0 and torques D tau.
        J_full = jacobian(description, q)
        J = self._scaled(J_full)
        M = mass_matrix(description, q) * np.outer(scale, scale)

        # Acceleration of the tool: J qdd = a = x_d'' + kd (x_d' - x') + kp (x_d - x) - J' qd.
        error = pose_error(forward_kinematics(description, q), setpoint.T)
        error_rate = setpoint.twist - J_full @ qd
        wanted = setpoint.acceleration + self.kd * error_rate + self.kp * error
        a = self._row_scale * (wanted - jacobian_dot(description, q, qd) @ qd)[self._rows]

        # Acceleration of the joints where the tool leaves them free.
        a_0 = (
            setpoint.qdd + self.posture_kd * (setpoint.qd - qd) + self.posture_kp * (setpoint.q - q)
        )
        a_0 = a_0 / scale

        # With J = U S V^T the inverse of Lambda = (J M^-1 J^T)^-1 is U (S V^T M^-1 V S) U^T. Near a singular direction,
        # where sigma < threshold, its diagonal has the value at the threshold, so that forces stay finite.
        rank = self._rank
        U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
        U = U[:, :rank]
        sigma = sigma[:rank]
        Vt = Vt[:rank]
        mobility = Vt @ np.linalg.solve(M, Vt.T)
        Lambda_inverse = sigma[:, None] * mobility * sigma
        lacking = np.maximum(self.threshold**2 - sigma**2, 0.0)
        Lambda_inverse[np.diag_indices(rank)] += lacking * np.diagonal(mobility)

        # tau = J^T Lambda (a - J a_0) + M a_0 + C qd + g, which equals J^T Lambda a + N^T M a_0 + C qd + g. The force
        # Lambda (a - J a_0) is taken in the coordinates of U, where J is S V^T.
        force = np.linalg.solve(Lambda_inverse, U.T @ a - sigma * (Vt @ a_0))
        tau: Array = (Vt.T @ (sigma * force) + M @ a_0) / scale + bias(description, q, qd)
        return tau

    def __repr__(self) -> str:
        return repr_line(
            type(self).__name__, self.description.name, gains_text(kp=self.kp, kd=self.kd)
        )

    def _scaled(self, J: Array) -> Array:
        """Return the controlled rows of Jacobians, shape (..., k, n), with lengths divided by the reach."""
        return self._row_scale[:, None] * J[..., self._rows, :] * self._joint_scale

    def _freedoms(self) -> int:
        """Return the number of controlled directions in which the tool can be moved.

        Raises
        ------
        ValueError
            The tool cannot be moved in any of them.
        """
        # The rank is the same at almost all configurations, and smaller at singular ones: the largest one counts.
        q = random_motions(self.description, PROBES).q
        sigma = np.linalg.svd(self._scaled(jacobian(self.description, q)), compute_uv=False)
        largest = float(sigma.max())
        rank = int(np.sum(sigma > ZERO * largest, axis=-1).max()) if largest > ZERO else 0
        if not rank:
            raise ValueError(f"{self.description.name} moves its tool in none of the directions")
        return rank


def pose_error(T: Array, goal: Array) -> Array:
    """Return the error of a pose (4, 4), shape (6,): position, m, and rotation vector, rad, in world axes.

    The rotation vector is that of R_goal R^T, of length pi at most; at length pi its sign is not determined.
    """
    from scipy.spatial.transform import Rotation

    # exp([turn]x) R = R_goal: the rotation from R to R_goal in world axes.
    turn = Rotation.from_matrix(goal[:3, :3] @ T[:3, :3].T).as_rotvec()
    return np.concatenate([goal[:3, 3] - T[:3, 3], turn])


def _tool_gain(value: ArrayLike, name: str) -> Array:
    array = number_array(value, name, "a number, or (6,)")
    if array.shape not in ((), (6,)):
        raise ValueError(
            f"{name} has shape {array.shape}; expected a number, or (6,): position, then rotation"
        )
    return gain(array, name)


def _rows(directions: ArrayLike | None) -> NDArray[np.intp]:
    chosen = np.ones(6, dtype=bool) if directions is None else np.asarray(directions)
    if chosen.shape != (6,) or not np.isin(chosen, (0, 1)).all() or not chosen.any():
        raise ValueError(
            f"directions is {directions!r}; expected six of True and False, one of them True"
        )
    return np.flatnonzero(chosen)
