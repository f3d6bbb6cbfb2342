"""Description made from a table of doubles: bodies, limits, shapes and tool, with numbers rounded to some decimals."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from dhkit.description import (
    INERTIA_PLACES,
    Array,
    Base,
    Body,
    Convention,
    Description,
    Drive,
    Inertia,
    Joint,
    JointType,
    Named,
    Placement,
    Shape,
    Tool,
    pose_parts,
    world_to_frames,
)
from dhkit.description.bodies import Vector, eigenvalue_tolerance
from dhkit.description.bounds import BOUNDS
from dhkit.description.validation import RESERVED_NAME
from dhkit.expressions import PI, ZERO, Expression, exact, exact_angle
from dhkit.model.extraction.table import Table
from dhkit.model.urdf_chain import Chain
from dhkit.model.urdf_tree import UrdfJoint

_SIGNIFICANT_DIGITS = 12
"""Significant digits of masses and inertias that are rounded; centres of mass are rounded to a tenth of a picometre."""
_ANGLE_STEP = math.pi / 12
"""15 degrees, rad: rounded angles near a multiple of it become that multiple."""
_MAX_LOCKED_COSINE = 1e-12
"""Cosine of a pitch that counts as 90 degrees."""
_GRAVITY = np.array([0.0, 0.0, -9.81])
_GRAVITY_DECIMALS = 14
"""Decimals of gravity: torques about nearly vertical axes are small, and must be right as well."""
_SHAPE_DECIMALS = 12
"""Decimals of the poses of shapes, m and rad."""


@dataclass(frozen=True)
class Rounding:
    """Converts doubles to exact numbers, rounded to some decimals; None: not rounded."""

    decimals: int | None

    def length(self, value: float) -> Expression:
        """Return a length, m."""
        return exact(
            float(value) + 0.0
            if self.decimals is None
            else round(float(value), self.decimals) + 0.0
        )

    def angle(self, value: float) -> Expression:
        """Return an angle, rad; one within the last decimal of a multiple of 15 degrees is that multiple."""
        if self.decimals is None:
            return exact_angle(exact(float(value) + 0.0))
        steps = round(value / _ANGLE_STEP)
        if abs(value - steps * _ANGLE_STEP) <= 10.0**-self.decimals:
            return PI * Fraction(steps, 12)
        return exact(round(float(value), self.decimals) + 0.0)

    def vector(self, values: Array) -> Vector:
        """Return three lengths, shape (3,), m."""
        x, y, z = map(self.length, values)
        return x, y, z

    def placement(self, T: Array) -> Placement:
        """Return a pose, shape (4, 4), m, as origin and fixed-axis roll, pitch, yaw."""
        xyz, (yaw, pitch, roll) = pose_parts(T, order="ZYX")
        last_decimal = 0.0 if self.decimals is None else 10.0**-self.decimals
        if np.hypot(T[0, 0], T[1, 0]) < max(_MAX_LOCKED_COSINE, last_decimal):
            # At gimbal lock, rounding errors alone would decide how roll and yaw share the angle. With yaw 0 the second
            # row of R = Ry(pitch) Rx(roll) is (0, cos(roll), -sin(roll)).
            roll = np.arctan2(-T[1, 2], T[1, 1])
            yaw = 0.0
        r, p, y = (self.angle(float(value)) for value in (roll, pitch, yaw))
        return Placement(self.vector(xyz), (r, p, y))

    def body(self, mass: float, com: Array, inertia: Array) -> Body:
        """Return a body: mass, kg, centre of mass, shape (3,), m, and inertia about it, shape (3, 3), kg m^2.

        A body with an impossible inertia is marked ``unphysical``.
        """
        largest = float(np.abs(inertia).max())
        moments = Inertia.of_tensor(inertia)
        if self.decimals is not None and largest:
            places = _SIGNIFICANT_DIGITS - 1 - math.floor(math.log10(largest))
            rounded = {
                key: round(float(inertia[place]), places) + 0.0
                for key, place in INERTIA_PLACES.items()
            }
            moments = Inertia(**{key: exact(moment) for key, moment in rounded.items()})
        weight = mass if self.decimals is None else float(f"{mass:.{_SIGNIFICANT_DIGITS}g}")
        lowest, _, highest = np.linalg.eigvalsh(inertia)
        # Half of the tolerance of a description: rounding changes the eigenvalue once more.
        is_impossible = lowest < -eigenvalue_tolerance(highest) / 2
        center = Rounding(None if self.decimals is None else _SIGNIFICANT_DIGITS + 1).vector(com)
        return Body(exact(weight), center, moments, unphysical=bool(is_impossible))


UNROUNDED = Rounding(None)


@dataclass(frozen=True, eq=False)
class Draft:
    """All of a description but the numbers of its table."""

    chain: Chain
    convention: Convention
    shapes: tuple[tuple[tuple[Shape, Array], ...], ...]
    """The shapes of each group of links, with their poses in the base at zero, shape (4, 4), m."""
    mesh_folder: Path
    name: str

    def description(self, table: Table, rounding: Rounding) -> Description:
        """Return the description of a table, its numbers rounded."""
        chain = self.chain
        bare = self._without_bodies(table, rounding)
        # Bodies and shapes are placed in the frames of the rounded table.
        frames = world_to_frames(bare, np.zeros(bare.n))
        tool_pose = np.linalg.inv(frames[-1]) @ chain.zero_poses[chain.tip]
        moving_links = itertools.chain.from_iterable(chain.groups[1:])
        has_bodies = any(chain.tree.links[link].inertial is not None for link in moving_links)
        joints = tuple(
            replace(
                joint,
                bodies=(self._body(i, frames[i], rounding),) if has_bodies else (),
                shapes=self._placed_shapes(i, frames[i]),
            )
            for i, joint in enumerate(bare.joints, start=1)
        )
        base_body = self._body(0, frames[0], rounding)
        base_shapes = self._placed_shapes(0, frames[0])
        base = replace(
            bare.base, shapes=base_shapes, body=base_body if base_body.mass != ZERO else None
        )
        return replace(bare, joints=joints, base=base, tool=Tool(rounding.placement(tool_pose)))

    def _without_bodies(self, table: Table, rounding: Rounding) -> Description:
        """Return the description without bodies, shapes and tool."""
        chain = self.chain
        gravity_rounding = UNROUNDED if rounding.decimals is None else Rounding(_GRAVITY_DECIMALS)
        joints = zip(_joint_names(chain.names), chain.joints, table.rows, strict=True)
        return Description(
            name=self.name,
            convention=self.convention,
            joints=tuple(_joint(name, joint, row, rounding) for name, joint, row in joints),
            gravity=gravity_rounding.vector(chain.T_base_root[:3, :3] @ _GRAVITY),
            base=Base(rounding.placement(table.T_base_first)),
            configurations=_configurations(chain),
            drawn=not any(self.shapes),
            source=f"{chain.path.name}, link {chain.base} to link {chain.tip}",
            mesh_folder=self.mesh_folder,
        )

    def _body(self, i: int, T_base_frame: Array, rounding: Rounding) -> Body:
        """Return the links that move with joint i (0: the base) as one body in a frame.

        With masses m, centres c and inertias I_c of the links (R, p their poses in the frame), the body has

            m = sum m_k,    c = sum m_k c_k / m,    I = sum (R I_c R^T + m (r.r 1 - r r^T))_k,    r_k = c_k - c,

        by the parallel-axis theorem.
        """
        chain = self.chain
        to_frame = np.linalg.inv(T_base_frame)
        mass = 0.0
        moment = np.zeros(3)
        second = np.zeros((3, 3))
        parts = []
        for link in chain.groups[i]:
            inertial = chain.tree.links[link].inertial
            if inertial is None:
                continue
            # c_k = R c + p,  I_k = R I R^T
            T = to_frame @ chain.zero_poses[link]
            com = T[:3, :3] @ inertial.com + T[:3, 3]
            parts.append((inertial.mass, com, T[:3, :3] @ inertial.inertia @ T[:3, :3].T))
            mass = mass + inertial.mass
            moment = moment + inertial.mass * com

        center = moment / mass if mass else np.zeros(3)
        for m, com, inertia in parts:
            r = com - center
            second += inertia + m * (r @ r * np.eye(3) - np.outer(r, r))
        return rounding.body(mass, center, second)

    def _placed_shapes(self, i: int, T_base_frame: Array) -> tuple[Shape, ...]:
        to_frame = np.linalg.inv(T_base_frame)
        rounding = Rounding(_SHAPE_DECIMALS)
        return tuple(
            replace(shape, placement=rounding.placement(to_frame @ T))
            for shape, T in self.shapes[i]
        )


def _joint(name: str, joint: UrdfJoint, row: Array, rounding: Rounding) -> Joint:
    theta, d, a, alpha = row.tolist()
    has_friction = joint.damping or joint.friction
    dry = exact(joint.friction)
    return Joint(
        type=JointType.PRISMATIC if joint.is_prismatic else JointType.REVOLUTE,
        a=rounding.length(a),
        alpha=rounding.angle(alpha),
        d=rounding.length(d),
        theta=rounding.angle(theta),
        name=name,
        limits=None if joint.limits is None else (exact(joint.limits[0]), exact(joint.limits[1])),
        velocity=None if joint.velocity is None else exact(joint.velocity),
        effort=None if joint.effort is None else exact(joint.effort),
        drive=Drive(viscous=exact(joint.damping), coulomb=(dry, -dry)) if has_friction else None,
    )


def _configurations(chain: Chain) -> Named[tuple[Expression, ...]]:
    """Return the configuration ``zero``; ``middle``, of the limits, if zero is outside of some."""
    limits = [joint.limits for joint in chain.joints]
    outside = [limit for limit in limits if limit is not None and not limit[0] <= 0 <= limit[1]]
    if not outside:
        return Named({"zero": (ZERO,) * len(limits)})
    middle = (
        (exact(limit[0]) + exact(limit[1])) / 2 if limit in outside and limit else ZERO
        for limit in limits
    )
    return Named({"middle": tuple(middle)})


def _joint_names(names: Sequence[str]) -> list[str]:
    """Return names that a robot file allows, each once."""
    allowed: list[str] = []
    for number, original in enumerate(names, start=1):
        name = allowed_name(original, f"joint{number}")
        if RESERVED_NAME.fullmatch(name):
            name = f"{name}_joint"
        stem = name
        count = 1
        while name in allowed:
            count += 1
            name = f"{stem[: BOUNDS.name_characters - 4]}_{count}"
        allowed.append(name)
    return allowed


def allowed_name(name: str, prefix: str) -> str:
    """Return a name with underscores for characters that a robot file does not allow.

    A name without a letter at its beginning gets the prefix.
    """
    plain = re.sub(r"[^A-Za-z0-9_.\-]", "_", name)[: BOUNDS.name_characters]
    if re.match(r"[A-Za-z_]", plain):
        return plain
    return f"{prefix}_{plain}"[: BOUNDS.name_characters].rstrip("_")
