"""The float view of a description: what array code reads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dhkit.description.arrays import Array
from dhkit.description.bodies import INERTIA_PLACES, Body, Vector, joined
from dhkit.description.exact_poses import pose_of
from dhkit.description.parameters import resolved
from dhkit.description.robot_data import RobotData
from dhkit.description.traversal import with_values
from dhkit.description.values import Joint, Placement
from dhkit.display import counted, repr_line
from dhkit.expressions import Expression, cos, exact_angle, sin, substitute


@dataclass(frozen=True, eq=False)
class Numbers:
    """Arrays of a robot's numbers, SI and radians, read-only; n joints.

    Cosines and sines are rounded from the exact angles: those of 90 degrees are 0 and 1.
    """

    values: dict[str, float]
    """The parameters' values."""
    a: Array
    """Shape (n,), m."""
    d: Array
    """Shape (n,), m."""
    alpha: Array
    """Shape (n,), rad."""
    theta: Array
    """Shape (n,), rad."""
    cos_alpha: Array
    sin_alpha: Array
    cos_theta: Array
    sin_theta: Array
    prismatic: NDArray[np.bool_]
    """Shape (n,)."""
    lower: Array
    """Shape (n,), rad or m; -inf where unlimited."""
    upper: Array
    velocity: Array
    """Shape (n,), rad/s or m/s; inf where unlimited."""
    effort: Array
    """Shape (n,), N m or N; inf where unlimited."""
    mass: Array
    """Shape (n,), kg; NaN where a link has no body."""
    com: Array
    """Shape (n, 3), m, in DH frame i."""
    inertia: Array
    """Shape (n, 3, 3), kg m^2, about the centre of mass in the axes of DH frame i."""
    armature: Array
    """Shape (n,), gear^2 rotor inertia, kg m^2 or kg; 0 without a drive."""
    viscous: Array
    """Shape (n,), joint side, N m s/rad or N s/m."""
    coulomb: Array
    """Shape (n, 2), joint side, against positive and against negative motion, N m or N; the second is <= 0."""
    base_body: tuple[float, Array, Array]
    """Mass, kg (0 without a body), centre of mass (3,), m, and inertia (3, 3), kg m^2, of link 0, in frame 0."""
    gravity: Array
    """Shape (3,), m/s^2, world."""
    T_world_base: Array
    """Shape (4, 4): frame 0 in the world."""
    T_last_tool: Array
    """Shape (4, 4): the tool in DH frame n."""
    configurations: dict[str, Array]
    """Joint vectors by name, shape (n,), rad and m."""
    reach: float
    """The sum of abs(a) + abs(d) + stroke, m."""

    @property
    def inertial_parameters(self) -> Array:
        """What torques are linear in, shape (n, 10), in the axes of DH frame i and about its origin.

        Mass, kg, first moments m c, kg m, and second moments xx, yy, zz, xy, yz, xz, kg m^2; NaN where a link has no
        body.
        """
        m, c = self.mass[:, None], self.com
        square = np.sum(c * c, axis=-1)[:, None, None] * np.eye(3)
        second = self.inertia + m[..., None] * (square - c[:, :, None] * c[:, None, :])
        listed = np.stack([second[:, i, j] for i, j in INERTIA_PLACES.values()], axis=-1)
        return np.concatenate([m, m * c, listed], axis=-1)

    @classmethod
    def of(cls, description: RobotData) -> Numbers:
        """Round a description's exact numbers."""
        values = resolved(description.parameters)
        joints = description.joints
        bodies = [_as_one(joint.bodies, values) for joint in joints]
        drives = [joint.drive for joint in joints]

        def known(expression: Expression) -> Expression:
            return substitute(expression, values)

        def array(column: Iterable[Expression | float]) -> Array:
            return np.array([float(known(x)) if isinstance(x, Expression) else x for x in column], dtype=float)

        def angles(column: Iterable[Expression]) -> list[Expression]:
            return [exact_angle(known(x)) for x in column]

        alpha, theta = angles(j.alpha for j in joints), angles(j.theta for j in joints)
        lower = array(j.limits[0] if j.limits else -np.inf for j in joints)
        upper = array(j.limits[1] if j.limits else np.inf for j in joints)
        a, d = array(j.a for j in joints), array(j.d for j in joints)
        gear = array(drive.gear if drive else 1.0 for drive in drives)
        prismatic = np.array([not j.is_revolute for j in joints])
        numbers = cls(
            values={name: float(value) for name, value in values.items()},
            a=a,
            d=d,
            alpha=array(alpha),
            theta=array(theta),
            cos_alpha=array(cos(x) for x in alpha),
            sin_alpha=array(sin(x) for x in alpha),
            cos_theta=array(cos(x) for x in theta),
            sin_theta=array(sin(x) for x in theta),
            prismatic=prismatic,
            lower=lower,
            upper=upper,
            velocity=array(np.inf if j.velocity is None else j.velocity for j in joints),
            effort=array(np.inf if j.effort is None else j.effort for j in joints),
            mass=array(body.mass if body else np.nan for body in bodies),
            com=np.array([array(body.com) if body else np.full(3, np.nan) for body in bodies]),
            inertia=np.array([_tensor(body, array) for body in bodies]),
            armature=array(drive.armature if drive else 0.0 for drive in drives),
            viscous=gear**2 * array(drive.viscous if drive else 0.0 for drive in drives),
            coulomb=np.abs(gear)[:, None] * np.array([array(x.coulomb) if x else np.zeros(2) for x in drives]),
            base_body=_base_body(description.base.body, array),
            gravity=array(description.gravity),
            T_world_base=matrix(description.base.placement, values),
            T_last_tool=matrix(description.tool.placement, values),
            configurations={name: array(q) for name, q in description.configurations.items()},
            reach=float(np.sum(np.abs(a) + np.abs(d)) + _stroke(joints, lower, upper)),
        )
        own = [getattr(numbers, item.name) for item in fields(numbers)]
        for value in [*own, *numbers.configurations.values()]:
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        return numbers

    def __repr__(self) -> str:
        return repr_line("Numbers", counted(len(self.a), "joint"), f"reach {self.reach:.4g} m")


def matrix(placement: Placement, values: dict[str, Expression]) -> Array:
    """Return a placement's (4, 4) matrix; right angles have exact cosines."""
    needed = {name for entry in (*placement.xyz, *placement.rpy) for name in entry.symbols}
    return _matrix(placement, tuple((name, value) for name, value in values.items() if name in needed)).copy()


@lru_cache(maxsize=1024)
def _matrix(placement: Placement, values: tuple[tuple[str, Expression], ...]) -> Array:
    """Remember matrices: an exact pose costs 1 ms, and base, tool and shapes stay while a person edits the table."""
    pose = pose_of(placement, dict(values))
    return np.array([[float(substitute(entry, dict(values))) for entry in row] for row in pose], dtype=float)


def _as_one(bodies: tuple[Body, ...], values: dict[str, Expression]) -> Body | None:
    """Return a link's bodies as one, several joined as numbers: a parameter that is zero divides nothing then."""
    if len(bodies) < 2:
        return bodies[0] if bodies else None
    return joined(with_values(bodies, values))


def _tensor(body: Body | None, array: Callable[[Vector], Array]) -> Array:
    return np.full((3, 3), np.nan) if body is None else np.array([array(row) for row in body.inertia.rows])


def _base_body(body: Body | None, array: Callable[[Iterable[Expression]], Array]) -> tuple[float, Array, Array]:
    if body is None:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    return float(array([body.mass])[0]), array(body.com), np.array([array(row) for row in body.inertia.rows])


def _stroke(joints: Sequence[Joint], lower: Array, upper: Array) -> float:
    """Return how far the prismatic joints with limits can move away from zero, m."""
    strokes = [max(abs(lo), abs(up)) for j, lo, up in zip(joints, lower, upper, strict=True) if not j.is_revolute]
    return float(sum(stroke for stroke in strokes if np.isfinite(stroke)))
