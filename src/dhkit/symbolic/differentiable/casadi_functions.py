"""An arm's mechanics as CasADi functions for optimizers, each derived when it is first used."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING

from dhkit.description import Convention, Description, Robot, description_of
from dhkit.display import repr_line
from dhkit.symbolic.differentiable.composite_bodies import (
    composite_coriolis_matrix,
    composite_mass_matrix,
)
from dhkit.symbolic.differentiable.energies import kinetic_energy, lagrange_torque, potential_energy
from dhkit.symbolic.differentiable.forward_dynamics import solve_for_acceleration
from dhkit.symbolic.differentiable.frames import SymbolicTable, jacobian, joint_symbols
from dhkit.symbolic.differentiable.friction import Friction, friction_parameters, friction_torque
from dhkit.symbolic.differentiable.inertial_table import InertialTable
from dhkit.symbolic.differentiable.moments import Moments
from dhkit.symbolic.differentiable.recursive import (
    recursive_bias,
    recursive_gravity,
    recursive_inverse_dynamics,
)
from dhkit.symbolic.differentiable.vectors import Vector3, dot, plus

if TYPE_CHECKING:
    import casadi

_PAYLOAD = {"payload_mass": 1, "payload_com": 3, "payload_inertia": 6}
"""Inputs of the payload layer, with their lengths."""


class CasadiFunctions:
    """An arm's mechanics as ``casadi.Function`` objects with named inputs and outputs; differentiable, immutable.

    q, qd, qdd and tau are n x 1, rad, m, seconds, N m and N. Functions can be called with symbols, in ``Opti`` and
    ``nlpsol``, mapped, serialized, and turned into C by CasADi.

    Parameters
    ----------
    description
        The robot; dynamics need a body on every link.
    friction
        Friction of the joints in inverse and forward dynamics: True for a step, or a :class:`Friction`.
    payload
        Whether dynamics and energies take a load: ``payload_mass`` (kg), ``payload_com`` (3, m, in the tool's frame)
        and ``payload_inertia`` (6: xx, yy, zz, xy, yz, xz about its centre of mass in the tool's axes, kg m^2).
    wrench
        Whether inverse and forward dynamics take a ``wrench`` (6): force (N) then moment (N m) that the environment
        applies at the tool's origin, world axes.

    Raises
    ------
    DescriptionError
        A link has no body; raised when a function of dynamics is first used.
    TypeError
        ``friction`` is neither a bool nor a :class:`Friction`, or another layer is not a bool.

    Examples
    --------
    >>> from dhkit import Arm
    >>> tau = Arm.load("puma560").casadi.inverse_dynamics
    >>> tau
    Function(inverse_dynamics:(q[6],qd[6],qdd[6])->(tau[6]) SXFunction)
    """

    def __init__(
        self,
        description: Robot,
        friction: bool | Friction | None = None,
        payload: bool = False,
        wrench: bool = False,
    ) -> None:
        for name, layer in (("payload", payload), ("wrench", wrench)):
            if not isinstance(layer, bool):
                raise TypeError(f"{name} is {layer!r}; expected True or False")
        description = description_of(description)
        self._description = description
        self._friction = Friction.chosen(friction)
        self._payload = payload
        self._wrench = wrench

    def layered(
        self, friction: bool | Friction | None = None, payload: bool = False, wrench: bool = False
    ) -> CasadiFunctions:
        """Return the same arm's functions with these layers, and no others; see the class.

        Parameters
        ----------
        friction
            Model of friction to include.
        payload
            Whether mass, centre of mass and inertia of a payload are inputs.
        wrench
            Whether a wrench on the tool is an input.

        Examples
        --------
        >>> from dhkit import Arm
        >>> arm = Arm.load("planar2r")
        >>> arm.casadi.layered(payload=True).inverse_dynamics.name_in()[3:]
        ['payload_mass', 'payload_com', 'payload_inertia']
        """
        return CasadiFunctions(self._description, friction, payload, wrench)

    # Kinematics

    @cached_property
    def fk(self) -> casadi.Function:
        """The tool in the world, q -> T, 4 x 4."""
        table = SymbolicTable.of(self._description)
        q = self._q
        return _function("fk", {"q": q}, {"T": table.world_to_tool(q)})

    @cached_property
    def jacobian(self) -> casadi.Function:
        """The tool's Jacobian, q -> J, 6 x n: linear, then angular velocity, world axes."""
        table = SymbolicTable.of(self._description)
        q = self._q
        return _function("jacobian", {"q": q}, {"J": jacobian(table, q)})

    # Dynamics

    @cached_property
    def mass_matrix(self) -> casadi.Function:
        """The mass matrix, q -> M, n x n, drives included."""
        return self._dynamics(
            "mass_matrix", {"q": self._q}, {"M": composite_mass_matrix(self._table, self._q)}
        )

    @cached_property
    def coriolis_matrix(self) -> casadi.Function:
        """The Coriolis matrix, q, qd -> C, n x n, by Christoffel symbols."""
        C = composite_coriolis_matrix(self._table, self._q, self._qd)
        return self._dynamics("coriolis_matrix", {"q": self._q, "qd": self._qd}, {"C": C})

    @cached_property
    def gravity_torque(self) -> casadi.Function:
        """The torques that hold the arm at rest, q -> g, n x 1, N m and N."""
        return self._dynamics(
            "gravity_torque", {"q": self._q}, {"g": recursive_gravity(self._table, self._q)}
        )

    @cached_property
    def bias(self) -> casadi.Function:
        """The torques of a motion without acceleration, q, qd -> h = C qd + g, n x 1, N m and N."""
        h = recursive_bias(self._table, self._q, self._qd)
        return self._dynamics("bias", {"q": self._q, "qd": self._qd}, {"h": h})

    @cached_property
    def inverse_dynamics(self) -> casadi.Function:
        """Joint torques, q, qd, qdd -> tau, n x 1, with the layers' loads."""
        tau = recursive_inverse_dynamics(self._table, self._q, self._qd, self._qdd) - self._load
        inputs = {"q": self._q, "qd": self._qd, "qdd": self._qdd}
        return self._dynamics("inverse_dynamics", inputs, {"tau": tau}, self._wrench_input)

    @cached_property
    def forward_dynamics(self) -> casadi.Function:
        """Accelerations, q, qd, tau -> qdd, n x 1, with the layers' loads; NaN where M is singular."""
        tau = joint_symbols("tau", self._description.n)
        net = tau + self._load - recursive_bias(self._table, self._q, self._qd)
        qdd = solve_for_acceleration(composite_mass_matrix(self._table, self._q), net)
        inputs = {"q": self._q, "qd": self._qd, "tau": tau}
        return self._dynamics("forward_dynamics", inputs, {"qdd": qdd}, self._wrench_input)

    @cached_property
    def kinetic_energy(self) -> casadi.Function:
        """Kinetic energy, q, qd -> K, J."""
        K = kinetic_energy(self._table, self._q, self._qd)
        return self._dynamics("kinetic_energy", {"q": self._q, "qd": self._qd}, {"K": K})

    @cached_property
    def potential_energy(self) -> casadi.Function:
        """Potential energy, q -> V, J, 0 for a mass at the world's origin."""
        return self._dynamics(
            "potential_energy", {"q": self._q}, {"V": potential_energy(self._table, self._q)}
        )

    @cached_property
    def lagrange(self) -> casadi.Function:
        """Lagrange's equations, q, qd, qdd -> tau = d/dt dL/dqd - dL/dq, n x 1, by differentiating L = K - V."""
        tau = lagrange_torque(self._table, self._q, self._qd, self._qdd)
        return self._dynamics(
            "lagrange", {"q": self._q, "qd": self._qd, "qdd": self._qdd}, {"tau": tau}
        )

    # Symbols and tables

    @cached_property
    def _q(self) -> casadi.SX:
        return joint_symbols("q", self._description.n)

    @cached_property
    def _qd(self) -> casadi.SX:
        return joint_symbols("qd", self._description.n)

    @cached_property
    def _qdd(self) -> casadi.SX:
        return joint_symbols("qdd", self._description.n)

    @cached_property
    def _load_symbols(self) -> dict[str, casadi.SX]:
        return (
            {name: joint_symbols(name, size) for name, size in _PAYLOAD.items()}
            if self._payload
            else {}
        )

    @cached_property
    def _wrench_input(self) -> dict[str, casadi.SX]:
        return {"wrench": joint_symbols("wrench", 6)} if self._wrench else {}

    @cached_property
    def _table(self) -> InertialTable:
        table = InertialTable.of(self._description)
        if not self._payload:
            return table
        mass, com, inertia = self._load_symbols.values()
        load = _payload_moments(self._description, mass, com, inertia)

        # V = -m g . p, with p the origin of frame 0 in the world
        numbers = self._description.numbers
        g_p = float(numbers.gravity @ numbers.T_world_base[:3, 3])
        return table.with_load(load, -(mass * g_p))

    @cached_property
    def _load(self) -> casadi.SX:
        """Torques of the layers, J^T wrench - friction, n x 1, N m and N."""
        import casadi

        description = self._description
        load = casadi.SX(description.n, 1)
        if self._wrench:
            J = jacobian(SymbolicTable.of(description), self._q)
            load += J.T @ self._wrench_input["wrench"]
        if self._friction is not None:
            width = self._friction.width
            parameters = casadi.SX(casadi.DM(friction_parameters(description.numbers, width)))
            load -= friction_torque(self._qd, parameters, smooth=width > 0)
        return load

    def _dynamics(
        self,
        name: str,
        states: Mapping[str, casadi.SX],
        outputs: Mapping[str, casadi.SX],
        more: Mapping[str, casadi.SX] | None = None,
    ) -> casadi.Function:
        """Return a function of states, the payload if there is one, and further inputs."""
        inputs = {**states, **self._load_symbols, **(more or {})}
        return _function(name, inputs, outputs)

    # Value semantics

    def __reduce__(
        self,
    ) -> tuple[type[CasadiFunctions], tuple[Description, Friction | None, bool, bool]]:
        return CasadiFunctions, (self._description, self._friction, self._payload, self._wrench)

    def __repr__(self) -> str:
        layers = [str(self._friction)] if self._friction is not None else []
        if self._payload:
            layers.append("payload")
        if self._wrench:
            layers.append("wrench")
        return repr_line("CasADi functions", self._description.name, ", ".join(layers))


def _function(
    name: str, inputs: Mapping[str, casadi.SX], outputs: Mapping[str, casadi.SX]
) -> casadi.Function:
    """Return a function with named inputs and outputs."""
    import casadi

    # With "cse" CasADi computes equal products once.
    expressions = [casadi.densify(casadi.SX(x)) for x in outputs.values()]
    return casadi.Function(
        name, list(inputs.values()), expressions, list(inputs), list(outputs), {"cse": True}
    )


def _payload_moments(
    description: Description, mass: casadi.SX, com: casadi.SX, inertia: casadi.SX
) -> Moments:
    """Return the moments of a load in the joint frame of an arm's last link.

    Parameters
    ----------
    description
        The arm that carries it.
    mass
        kg.
    com
        3 x 1, centre of mass in the tool's frame, m.
    inertia
        6 x 1: xx, yy, zz, xy, yz, xz of the tensor about the centre of mass in the tool's axes, kg m^2.
    """
    R, p = _tool_in_joint_frame(description)
    xx, yy, zz, xy, yz, xz = (inertia[i] for i in range(6))
    tensor: list[Vector3] = [(xx, xy, xz), (xy, yy, yz), (xz, yz, zz)]

    # c' = p + R c, I' = R I R^T: I is symmetric, so that the rows R I_i are the columns of R I.
    com_in_joint_frame = plus(p, _rotate(R, (com[0], com[1], com[2])))
    columns = [_rotate(R, row) for row in tensor]
    inertia_in_joint_frame = [_rotate(R, row) for row in _transposed(columns)]
    return Moments.of_body(mass, com_in_joint_frame, inertia_in_joint_frame)


def _rotate(R: list[Vector3], a: Vector3) -> Vector3:
    """Return R a."""
    return dot(R[0], a), dot(R[1], a), dot(R[2], a)


def _transposed(rows: list[Vector3]) -> list[Vector3]:
    """Return the columns of a 3 x 3 matrix."""
    return [(column[0], column[1], column[2]) for column in zip(*rows, strict=True)]


def _tool_in_joint_frame(description: Description) -> tuple[list[Vector3], Vector3]:
    """Return rotation, row by row, and position, m, of the tool in the joint frame of the last link."""
    numbers = description.numbers
    T = numbers.T_last_tool.tolist()
    R: list[Vector3] = [(row[0], row[1], row[2]) for row in T[:3]]
    x, y, z = (row[3] for row in T[:3])
    p: Vector3 = (x, y, z)
    if description.convention is Convention.MODIFIED:
        return R, p

    # DH frame n in the joint frame is Tx(a) Rx(alpha): R' = Rx R, p' = a x + Rx p.
    a = float(numbers.a[-1])
    c = float(numbers.cos_alpha[-1])
    s = float(numbers.sin_alpha[-1])
    Rx: list[Vector3] = [(1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c)]
    columns = [_rotate(Rx, column) for column in _transposed(R)]
    return _transposed(columns), plus((a, 0.0, 0.0), _rotate(Rx, p))
