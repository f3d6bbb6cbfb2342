"""Frames, tool pose and Jacobian of an arm as CasADi SX expressions of its joint positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from dhkit.description import Array, Convention, Description, Robot, description_of, takes_robot
from dhkit.description.frames import carrying
from dhkit.display import counted, repr_line
from dhkit.symbolic.differentiable.number_patterns import NumberPattern

if TYPE_CHECKING:
    import casadi

Entry: TypeAlias = "float | casadi.SX"
"""A number, or an expression that stands for one."""
ReferenceAxes: TypeAlias = Literal["world", "tool"]
"""The axes in which the tool's velocity is given."""


@dataclass(frozen=True)
class SymbolicTable:
    """The numbers that an arm's frames depend on, each a float or a symbol.

    ``SymbolicTable.of`` holds the arm's own numbers. ``SymbolicTable.parametric`` keeps numbers that are 0, 1 or -1 and
    has symbols for the others, so that one derivation and one compiled kernel serve every arm of the same pattern.
    """

    convention: Convention
    prismatic: tuple[bool, ...]
    rows: tuple[tuple[Entry, ...], ...]
    """a, d, cos alpha, sin alpha, cos theta, sin theta of each row, m and without unit."""
    base: tuple[Entry, ...]
    """T_world_base without its last row: 12 entries, row by row."""
    tool: tuple[Entry, ...]
    """T_last_tool, the tool in frame n, likewise."""

    @classmethod
    def of(cls, description: Robot) -> SymbolicTable:
        """Return the table of an arm, rounded once from its exact numbers."""
        description = description_of(description)
        numbers = _table_numbers(description) + 0.0  # -0.0 + 0.0 is 0.0
        return cls._filled(description, numbers.tolist())

    @classmethod
    def parametric(cls, description: Robot) -> tuple[SymbolicTable, casadi.SX]:
        """Return a table of symbols, and the symbols (m x 1); see :func:`table_pattern` for their values."""
        description = description_of(description)
        entries, symbols = _pattern(description).entries()
        return cls._filled(description, entries), symbols

    def __repr__(self) -> str:
        return repr_line("SymbolicTable", counted(self.n, "joint"), f"{self.convention.value} DH")

    @classmethod
    def _filled(cls, description: Description, entries: Sequence[Entry]) -> SymbolicTable:
        """Return the table of entries in the order of :func:`_table_numbers`."""
        n = description.n
        return cls(
            convention=description.convention,
            prismatic=tuple(bool(x) for x in description.numbers.prismatic),
            rows=tuple(tuple(entries[6 * i : 6 * i + 6]) for i in range(n)),
            base=tuple(entries[6 * n : 6 * n + 12]),
            tool=tuple(entries[6 * n + 12 :]),
        )

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.rows)

    def link_transform(self, i: int, q: casadi.SX) -> casadi.SX:
        """Return A_(i+1), 4 x 4: frame i+1 in frame i, for row i, counted from 0, at joint position q, rad or m."""
        import casadi

        a, d, cos_alpha, sin_alpha, cos_theta, sin_theta = self.rows[i]
        cos_q, sin_q = (1.0, 0.0) if self.prismatic[i] else (casadi.cos(q), casadi.sin(q))

        # The table's own angle enters by the addition theorem: an offset of 90 degrees is exact and costs nothing.
        c = cos_q * cos_theta - sin_q * sin_theta
        s = sin_q * cos_theta + cos_q * sin_theta
        if self.prismatic[i]:
            d = d + q

        # Standard: Rz(theta) Tz(d) Tx(a) Rx(alpha). Modified: Rx(alpha) Tx(a) Rz(theta) Tz(d).
        if self.convention is Convention.STANDARD:
            return _matrix(
                [c, -s * cos_alpha, s * sin_alpha, a * c],
                [s, c * cos_alpha, -c * sin_alpha, a * s],
                [0, sin_alpha, cos_alpha, d],
            )
        return _matrix(
            [c, -s, 0, a],
            [s * cos_alpha, c * cos_alpha, -sin_alpha, -sin_alpha * d],
            [s * sin_alpha, c * sin_alpha, cos_alpha, cos_alpha * d],
        )

    def world_to_frames(self, q: casadi.SX) -> list[casadi.SX]:
        """Return DH frames 0 ... n in the world, each 4 x 4, for q (n x 1), rad and m."""
        frames = [_matrix(self.base[0:4], self.base[4:8], self.base[8:12])]
        for i in range(self.n):
            frames.append(frames[-1] @ self.link_transform(i, q[i]))
        return frames

    def world_to_tool(self, q: casadi.SX) -> casadi.SX:
        """Return the tool in the world, 4 x 4, for q (n x 1), rad and m."""
        return self.world_to_frames(q)[-1] @ self.last_to_tool

    @property
    def last_to_tool(self) -> casadi.SX:
        """Pose of the tool in frame n, 4 x 4, m."""
        return _matrix(self.tool[0:4], self.tool[4:8], self.tool[8:12])


def joint_symbols(name: str, n: int) -> casadi.SX:
    """Return n symbols, n x 1.

    Parameters
    ----------
    name
        Name of the vector.
    n
        Number of joints.

    Returns
    -------
    casadi.SX
        n x 1.

    Examples
    --------
    >>> joint_symbols("q", 2)
    SX([q_0, q_1])
    """
    import casadi

    return casadi.SX.sym(name, n)


def _table_numbers(description: Description) -> Array:
    """Return the numbers of an arm's frames, shape (6 n + 24,): six a joint, twelve each of base and tool."""
    numbers = description.numbers
    columns = (
        numbers.a,
        numbers.d,
        numbers.cos_alpha,
        numbers.sin_alpha,
        numbers.cos_theta,
        numbers.sin_theta,
    )
    joints = np.stack(columns, axis=1).ravel()
    return np.concatenate(
        [joints, numbers.T_world_base[:3].ravel(), numbers.T_last_tool[:3].ravel()]
    )


@takes_robot
def table_pattern(description: Description) -> tuple[str, Array]:
    """Return the pattern of an arm's frames as text, and the values of its table's symbols, shape (symbols,), m and 1.

    Arms of equal pattern (convention, kinds of joints, places of the numbers 0, 1 and -1) have equal expressions.

    Parameters
    ----------
    description
        The robot.

    Returns
    -------
    tuple[str, Array]
        The pattern, and the values in the order of ``SymbolicTable.parametric``'s symbols.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> pattern, values = table_pattern(library_robot("planar2r"))
    >>> values.shape
    (2,)
    >>> table_pattern(library_robot("planar3r"))[0] == pattern
    False
    """
    pattern = _pattern(description)
    return f"{description.convention.value} {description.kinds} {pattern.code}", pattern.parameters[
        0
    ]


def _pattern(description: Description) -> NumberPattern:
    return NumberPattern.of(_table_numbers(description)[None])


def jacobian(table: SymbolicTable, q: casadi.SX, frame: ReferenceAxes = "world") -> casadi.SX:
    """Return the tool's geometric Jacobian, 6 x n: linear velocity in m/s, then angular velocity in rad/s, by qd.

    Column i is (z x (p_tool - p); z) for a revolute joint about the axis z through p, and (z; 0) for a prismatic one
    (Siciliano et al., Robotics, 2009, eq. 3.30).

    Parameters
    ----------
    table
        The arm's table in CasADi expressions.
    q
        Joint values, n x 1.
    frame
        ``"world"`` or ``"tool"``.

    Returns
    -------
    casadi.SX
        6 x n, m/rad, m/m and rad/rad, 0 for the angular rows of a prismatic joint.

    Examples
    --------
    >>> import casadi
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import SymbolicTable, joint_symbols
    >>> q = joint_symbols("q", 2)
    >>> J = jacobian(SymbolicTable.of(Arm.load("planar2r")), q)
    >>> casadi.Function("J", [q], [J])([0, 0])[1, :]
    DM([[0.9, 0.4]])
    """
    import casadi

    frames = table.world_to_frames(q)
    tool = frames[-1] @ table.last_to_tool
    columns = []
    for T, is_prismatic in zip(carrying(table.convention, frames), table.prismatic, strict=True):
        z = T[:3, 2]
        p = T[:3, 3]
        if is_prismatic:
            columns.append(casadi.vertcat(z, casadi.SX(3, 1)))
        else:
            columns.append(casadi.vertcat(casadi.cross(z, tool[:3, 3] - p), z))
    J = casadi.horzcat(*columns)
    if frame == "world":
        return J

    R_tool_world = tool[:3, :3].T
    return casadi.vertcat(R_tool_world @ J[:3, :], R_tool_world @ J[3:, :])


def jacobian_dot(
    table: SymbolicTable, q: casadi.SX, qd: casadi.SX, frame: ReferenceAxes = "world"
) -> casadi.SX:
    """Return the time derivative of the Jacobian along qd, 6 x n, m and rad per s and unit of q.

    For ``"tool"``, the derivative of its components in the axes of the tool.

    Parameters
    ----------
    table
        The arm's table in CasADi expressions.
    q
        Joint values, n x 1.
    qd
        Joint rates, n x 1.
    frame
        ``"world"`` or ``"tool"``.

    Returns
    -------
    casadi.SX
        6 x n.

    Examples
    --------
    >>> import casadi
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import SymbolicTable, joint_symbols
    >>> q, qd = joint_symbols("q", 2), joint_symbols("qd", 2)
    >>> Jd = jacobian_dot(SymbolicTable.of(Arm.load("planar2r")), q, qd)
    >>> casadi.Function("Jd", [q, qd], [Jd])([0, 0], [1, 0])[0, :]
    DM([[-0.9, -0.4]])
    """
    import casadi

    J = jacobian(table, q, frame)
    return casadi.reshape(casadi.jtimes(casadi.vec(J), q, qd), 6, table.n)


def _matrix(*rows: Sequence[Any]) -> casadi.SX:
    """Return a rigid transform, 4 x 4, from its first three rows."""
    import casadi

    all_rows = [*rows, (0, 0, 0, 1)]
    matrix: casadi.SX = casadi.vertcat(*(casadi.horzcat(*row) for row in all_rows))
    return matrix
