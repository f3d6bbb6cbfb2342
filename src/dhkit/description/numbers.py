"""The float view of a description: read-only arrays of its exact numbers, for array code."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dhkit.cached_property import cached_property
from dhkit.description.arrays import Array
from dhkit.description.bodies import INERTIA_PLACES, Body, joined
from dhkit.description.exact_poses import pose_of
from dhkit.description.joint_centres import FAR, LinkEnds, link_ends
from dhkit.description.parameters import resolved
from dhkit.description.robot_data import RobotData
from dhkit.description.traversal import with_values
from dhkit.description.values import Convention, Placement
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
    """Shape (n,); so are the next three."""
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
    coupling: Array
    """Shape (n, n), symmetric: inertias of drives that two joints turn, kg m^2, kg m and kg; 0 on the diagonal."""
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
    """The sum of abs(a) + abs(d) and of the finite strokes, m; with ``link_ends``, of their lengths and the strokes."""
    link_ends: LinkEnds | None
    """Ends of the links where a and d are not sizes of the arm, since axes are nearly parallel; see
    :mod:`dhkit.description.joint_centres`."""

    @property
    def table_length(self) -> float:
        """The sum of abs(a) + abs(d), m: rounding errors of positions are shares of it."""
        return float(np.sum(np.abs(self.a) + np.abs(self.d)))

    @cached_property
    def drive_inertia(self) -> Array:
        """The drives' part of the mass matrix, shape (n, n), kg m^2, kg m and kg: armature and coupling."""
        matrix = np.diag(self.armature) + self.coupling
        matrix.flags.writeable = False
        return matrix

    @property
    def inertial_parameters(self) -> Array:
        """The inertial parameters that torques are linear in, shape (n, 10), in DH frame i, about its origin.

        Mass, kg, first moments m c, kg m, and second moments xx, yy, zz, xy, yz, xz, kg m^2; NaN where a link has no
        body.
        """
        # J = I + m (c^2 1 - c c^T): from the centre of mass to the frame's origin (Steiner).
        m = self.mass[:, None]
        c = self.com
        square = np.sum(c * c, axis=-1)[:, None, None] * np.eye(3)
        second = self.inertia + m[..., None] * (square - c[:, :, None] * c[:, None, :])
        listed = np.stack([second[:, i, j] for i, j in INERTIA_PLACES.values()], axis=-1)
        return np.concatenate([m, m * c, listed], axis=-1)

    @classmethod
    def of(cls, description: RobotData) -> Numbers:
        """Round a description's exact numbers to doubles."""
        values = resolved(description.parameters)
        joints = description.joints
        drives = [joint.drive for joint in joints]

        def array(column: Iterable[Expression | float]) -> Array:
            exact = (substitute(x, values) if isinstance(x, Expression) else x for x in column)
            return np.array([float(x) for x in exact], dtype=float)

        def angles(column: Iterable[Expression]) -> list[Expression]:
            return [exact_angle(substitute(x, values)) for x in column]

        alpha = angles(j.alpha for j in joints)
        theta = angles(j.theta for j in joints)
        lower = array(j.limits[0] if j.limits else -np.inf for j in joints)
        upper = array(j.limits[1] if j.limits else np.inf for j in joints)
        a = array(j.a for j in joints)
        d = array(j.d for j in joints)
        gear = array(drive.gear if drive else 1.0 for drive in drives)
        prismatic = np.array([not j.is_revolute for j in joints])
        # How far each prismatic joint can move away from zero, m; one without limits adds nothing to the reach.
        strokes = [
            float(stroke)
            for stroke in np.maximum(abs(lower), abs(upper))[prismatic]
            if np.isfinite(stroke)
        ]
        T_last_tool = matrix(description.tool.placement, values)
        cos_alpha = array(cos(x) for x in alpha)
        sin_alpha = array(sin(x) for x in alpha)
        is_standard = description.convention is Convention.STANDARD
        ends = link_ends(
            a, d, cos_alpha, sin_alpha, is_standard=is_standard, tool=T_last_tool[:3, 3]
        )
        along_table = float(np.sum(np.abs(a) + np.abs(d)))
        along_centres = float(ends.lengths.sum())
        is_far = along_table > FAR * along_centres
        mass, com, inertia = zip(
            *(_body_arrays(_as_one(j.bodies, values), array, np.nan) for j in joints), strict=True
        )
        configurations = {"zero": np.zeros(len(joints))}
        configurations |= {name: array(q) for name, q in description.configurations.items()}
        numbers = cls(
            values={name: float(value) for name, value in values.items()},
            a=a,
            d=d,
            alpha=array(alpha),
            theta=array(theta),
            cos_alpha=cos_alpha,
            sin_alpha=sin_alpha,
            cos_theta=array(cos(x) for x in theta),
            sin_theta=array(sin(x) for x in theta),
            prismatic=prismatic,
            lower=lower,
            upper=upper,
            velocity=array(np.inf if j.velocity is None else j.velocity for j in joints),
            effort=array(np.inf if j.effort is None else j.effort for j in joints),
            mass=np.array(mass),
            com=np.array(com),
            inertia=np.array(inertia),
            armature=array(drive.armature if drive else 0.0 for drive in drives),
            coupling=_coupling_matrix(description, array),
            # qd_motor = gear qd and tau = gear tau_motor: gear^2 B; |gear| Tc in the joint's directions.
            viscous=gear**2 * array(drive.viscous if drive else 0.0 for drive in drives),
            coulomb=np.abs(gear)[:, None]
            * np.array([array(x.coulomb) if x else np.zeros(2) for x in drives]),
            base_body=_body_arrays(description.base.body, array, 0.0),
            gravity=array(description.gravity),
            T_world_base=matrix(description.base.placement, values),
            T_last_tool=T_last_tool,
            configurations=configurations,
            reach=(along_centres if is_far else along_table) + float(sum(strokes)),
            link_ends=ends if is_far else None,
        )
        for value in [*vars(numbers).values(), *numbers.configurations.values()]:
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        return numbers

    def __repr__(self) -> str:
        return repr_line("Numbers", counted(len(self.a), "joint"), f"reach {self.reach:.4g} m")


def matrix(placement: Placement, values: dict[str, Expression]) -> Array:
    """Return a placement's transform, shape (4, 4), m; cosines of right angles are exactly 0."""
    names = set[str]()
    for entry in (*placement.xyz, *placement.rpy):
        names |= entry.symbols
    return _cached_matrix(
        placement, tuple((name, value) for name, value in values.items() if name in names)
    ).copy()


@lru_cache(maxsize=1024)
def _cached_matrix(placement: Placement, values: tuple[tuple[str, Expression], ...]) -> Array:
    """Return :func:`matrix`; an exact pose costs 1 ms, and most placements stay while a user edits the table."""
    numbers = dict(values)
    exact_pose = pose_of(placement, numbers)
    pose = np.empty(exact_pose.shape)
    for index, entry in np.ndenumerate(exact_pose):
        pose[index] = float(substitute(entry, numbers))
    return pose


def _coupling_matrix(
    description: RobotData, array: Callable[[Iterable[Expression]], Array]
) -> Array:
    matrix = np.zeros((description.n, description.n))
    inertias = array(coupling.inertia for coupling in description.couplings)
    for coupling, inertia in zip(description.couplings, inertias, strict=True):
        i, j = (number - 1 for number in coupling.joints)
        matrix[i, j] = matrix[j, i] = inertia
    return matrix


def _as_one(bodies: tuple[Body, ...], values: dict[str, Expression]) -> Body | None:
    """Return a link's bodies as one body; several are joined with numbers for parameters: a divisor may be zero."""
    if len(bodies) < 2:
        return bodies[0] if bodies else None
    return joined(with_values(bodies, values))


def _body_arrays(
    body: Body | None, array: Callable[[Iterable[Expression]], Array], missing: float
) -> tuple[float, Array, Array]:
    """Return mass, centre of mass and inertia of a body, all ``missing`` where there is none."""
    if body is None:
        return missing, np.full(3, missing), np.full((3, 3), missing)
    return (
        float(array([body.mass])[0]),
        array(body.com),
        np.array([array(row) for row in body.inertia.rows]),
    )
