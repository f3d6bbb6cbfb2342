"""States of motions, twice: as CasADi symbols for the optimizer, and as numbers by Pinocchio for certificates.

The optimizer's torques and poses are CasADi expressions of dhkit; those of a certificate are Pinocchio's. Both read the
same description of the arm, and where Pinocchio is not installed, dhkit's own numeric mechanics takes its place.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NewType

import numpy as np

from dhkit import dynamics, kinematics
from dhkit.description import Array, Description, Payload
from dhkit.description.parameters import resolved
from dhkit.errors import ModelError
from dhkit.expressions import substitute
from dhkit.model import PinocchioModel, pinocchio_model
from dhkit.symbolic import CasadiFunctions, Friction, SymbolicTable, jacobian, joint_symbols
from dhkit.trajectories import Limits, Trajectory
from dhkit.trajectories.pieces import Pieces, Side

if TYPE_CHECKING:
    import casadi

LoadedArm = NewType("LoadedArm", Description)
"""An arm whose last link includes the payload, if there is one."""
LOAD = 10
"""Number of parameters of a payload: mass, centre of mass (3), inertia (6)."""


def loaded(description: Description, payload: Payload | None = None) -> LoadedArm:
    """Return an arm with its payload."""
    return LoadedArm(description if payload is None else payload.carried(description))


class Point:
    """q, qd and qdd of an arm as SX symbols, and quantities derived from them on first use."""

    def __init__(
        self, description: Description, limits: Limits, friction: Friction | None, payload: bool
    ) -> None:
        self.description = description
        self.limits = limits
        self.n = description.n
        self.q = joint_symbols("q", self.n)
        self.qd = joint_symbols("qd", self.n)
        self.qdd = joint_symbols("qdd", self.n)
        self.load = joint_symbols("load", LOAD if payload else 0)
        self.friction = friction
        self._functions = CasadiFunctions(description, friction=friction, payload=payload)

    @cached_property
    def tau(self) -> casadi.SX:
        """Joint torques, n x 1, N m and N."""
        return self._torque(self._functions)

    @cached_property
    def dissipation(self) -> casadi.SX:
        """The power lost to friction, 1 x 1, W."""
        import casadi

        if self.friction is None:
            return casadi.SX(0)
        without_friction = self._torque(self._functions.layered(payload=bool(self.load.numel())))
        return casadi.dot(self.tau - without_friction, self.qd)

    def _torque(self, functions: CasadiFunctions) -> casadi.SX:
        load = self.load
        loads = (load[0], load[1:4], load[4:10]) if load.numel() else ()
        return functions.inverse_dynamics(self.q, self.qd, self.qdd, *loads)

    @cached_property
    def T_world_tool(self) -> casadi.SX:
        """The pose of the tool in the world, 4 x 4, m."""
        return SymbolicTable.of(self.description).world_to_tool(self.q)

    @cached_property
    def tool_velocity(self) -> casadi.SX:
        """The velocity of the tool's origin, 3 x 1, m/s, world axes."""
        return jacobian(SymbolicTable.of(self.description), self.q)[:3, :] @ self.qd

    @cached_property
    def tool_acceleration(self) -> casadi.SX:
        """The acceleration of the tool's origin, 3 x 1, m/s^2, world axes: of v(q, qd), dv/dq qd + dv/dqd qdd."""
        import casadi

        v = self.tool_velocity
        return casadi.jtimes(v, self.q, self.qd) + casadi.jtimes(v, self.qd, self.qdd)

    @property
    def gear(self) -> Array:
        """Gear ratios, shape (n,), without unit; 1 without a drive."""
        return gear_ratios(self.description)


def gear_ratios(description: Description) -> Array:
    """Return the drives' gear ratios, shape (n,), without unit; 1 without a drive."""
    values = resolved(description.parameters)
    drives = [joint.drive for joint in description.joints]
    return np.array([float(substitute(drive.gear, values)) if drive else 1.0 for drive in drives])


@dataclass(frozen=True, eq=False)
class States:
    """q, qd and qdd of N states, shape (N, n) each, and quantities derived from them on first use."""

    description: LoadedArm
    times: Array
    """Times, shape (N,), s."""
    q: Array
    qd: Array
    qdd: Array
    friction: Friction | None = None
    jerk: Array = field(default_factory=lambda: np.zeros((0, 0)))
    """Jerks, shape (N, n), rad/s^3 and m/s^3; empty unless requested."""
    motion: Pieces | None = None
    """The joint values of which they are states, ``points`` evenly spread ones in each piece, both ends included."""
    points: int = 0

    @classmethod
    def of(
        cls,
        arm: LoadedArm,
        trajectory: Trajectory,
        times: Array,
        friction: Friction | None = None,
        side: Side = "right",
    ) -> States:
        """Return a motion's states at times of any shape, s."""
        values = (trajectory.q, trajectory.qd, trajectory.qdd, trajectory.jerk)
        q, qd, qdd, jerk = (value(times, side).reshape(-1, trajectory.n) for value in values)
        return cls(arm, times.ravel(), q, qd, qdd, friction, jerk)

    def beside(self, last: States, count: int) -> States:
        """Return K rows of ``count`` states each: count - 1 of these and a last one of ``last``."""

        def joined(a: Array, b: Array) -> Array:
            width = a.shape[1:]
            rows = [a.reshape(-1, count - 1, *width), b.reshape(-1, 1, *width)]
            return np.concatenate(rows, axis=1).reshape(-1, *width)

        return replace(
            self,
            times=joined(self.times, last.times),
            q=joined(self.q, last.q),
            qd=joined(self.qd, last.qd),
            qdd=joined(self.qdd, last.qdd),
            jerk=joined(self.jerk, last.jerk),
        )

    @property
    def n(self) -> int:
        """The number of joints."""
        return self.description.n

    @cached_property
    def reference(self) -> str:
        """Name of the library that computes torques and poses: Pinocchio, or dhkit if it is not installed."""
        return "dhkit" if _model(self.description) is None else "Pinocchio"

    @cached_property
    def tau(self) -> Array:
        """Joint torques including friction, shape (N, n), N m and N."""
        return self._rigid + self._friction_torque(self.qd)

    @cached_property
    def gravity_torque(self) -> Array:
        """Gravity torques, shape (N, n), N m and N."""
        model = _model(self.description)
        if model is None:
            return dynamics.gravity_torque(self.description, self.q)
        import pinocchio as pin

        data = model.createData()
        return self._gathered(
            [pin.computeGeneralizedGravity(model, data, q).copy() for q in self.q]
        )

    @cached_property
    def T_world_tool(self) -> Array:
        """Poses of the tool in the world, shape (N, 4, 4)."""
        return self._tool[0]

    @cached_property
    def tool_velocity(self) -> Array:
        """Velocities of the tool's origin, world axes, shape (N, 3), m/s."""
        return self._tool[1]

    @cached_property
    def tool_acceleration(self) -> Array:
        """Accelerations of the tool's origin, world axes, shape (N, 3), m/s^2."""
        return self._tool[2]

    def with_tool(self, T_world_tool: Array) -> States:
        """Return these states with the tool at rest in poses (N, 4, 4) whose joint values are not known."""
        other = replace(self)
        other.__dict__["_tool"] = (T_world_tool, *np.zeros((2, len(T_world_tool), 3)))
        return other

    def slowed(self, c: float) -> States:
        """Return the states of the motion slowed down c times.

        Of q(t / c) a derivative of order k is divided by c^k. Torques of inertia are linear in qdd and quadratic in qd,
        so that without friction tau = g + (tau(c = 1) - g) / c^2 (Hollerbach 1984, Dynamic scaling of manipulator
        trajectories).
        """
        slower = replace(
            self, times=self.times * c, qd=self.qd / c, qdd=self.qdd / c**2, jerk=self.jerk / c**3
        )
        # Their joint values are the same, and so is the clearance.
        slower = replace(slower, motion=None)
        known: dict[str, Any] = slower.__dict__
        if "_rigid" in self.__dict__:
            known["_rigid"] = self.gravity_torque + (self._rigid - self.gravity_torque) / c**2
            known["gravity_torque"] = self.gravity_torque
        if "_tool" in self.__dict__:
            T, v, a = self._tool
            known["_tool"] = (T, v / c, a / c**2)
        return slower

    @cached_property
    def _rigid(self) -> Array:
        """Joint torques without friction, shape (N, n), N m and N, with those of the drives' coupled inertias."""
        model = _model(self.description)
        if model is None:
            return dynamics.inverse_dynamics(self.description, self.q, self.qd, self.qdd)
        import pinocchio as pin

        data = model.createData()
        states = zip(self.q, self.qd, self.qdd, strict=True)
        tau = self._gathered([pin.rnea(model, data, *state).copy() for state in states])

        # M of the model has the drives' own inertias on its diagonal; those that couple two joints are added.
        return tau + self.qdd @ self.description.numbers.coupling

    def _friction_torque(self, qd: Array) -> Array | float:
        return (
            0.0
            if self.friction is None
            else dynamics.friction_torque(self.description, qd, self.friction)
        )

    @cached_property
    def _tool(self) -> tuple[Array, Array, Array]:
        """Poses, velocities v = J qd and accelerations a = J qdd + Jd qd of the tool."""
        model = _model(self.description)
        if model is None:
            J = kinematics.jacobian(self.description, self.q)[:, :3]
            Jd = kinematics.jacobian_dot(self.description, self.q, self.qd)[:, :3]
            velocity = np.einsum("kij,kj->ki", J, self.qd)
            acceleration = np.einsum("kij,kj->ki", J, self.qdd)
            T = kinematics.forward_kinematics(self.description, self.q)
            return T, velocity, acceleration + np.einsum("kij,kj->ki", Jd, self.qd)
        import pinocchio as pin

        data = model.createData()
        frame = model.getFrameId("tool")
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        T = np.empty((len(self.q), 4, 4))
        velocity = np.empty((len(self.q), 3))
        acceleration = np.empty((len(self.q), 3))
        for k, state in enumerate(zip(self.q, self.qd, self.qdd, strict=True)):
            pin.forwardKinematics(model, data, *state)
            T[k] = pin.updateFramePlacement(model, data, frame).homogeneous
            velocity[k] = pin.getFrameVelocity(model, data, frame, axes).linear
            # The classical acceleration is dv/dt of the tool's origin; the spatial one is dv/dt - w x v.
            acceleration[k] = pin.getFrameClassicalAcceleration(model, data, frame, axes).linear
        return T, velocity, acceleration

    def _gathered(self, rows: list[Array]) -> Array:
        # eigenpy returns a matrix of one column as a vector.
        return np.reshape(np.array(rows), self.q.shape)


@lru_cache(maxsize=16)
def _model(description: Description) -> PinocchioModel | None:
    """Return the Pinocchio model of an arm, or None if Pinocchio is not installed."""
    try:
        return pinocchio_model(description)
    except ModelError as error:
        if isinstance(error.__context__, ImportError):
            return None
        raise


def prepare(description: Description) -> None:
    """Build the Pinocchio model of an arm in advance, so that the first certificate is fast."""
    _model(description)
