"""The parts of a robot: frozen values with exact numbers, in SI units and radians."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import TypeAlias

from dhkit.cached_property import cached_property
from dhkit.description.bodies import ORIGIN, Body, Vector, joined, vector_text
from dhkit.display import counted, repr_line, value_line
from dhkit.expressions import PI, ZERO, Expression, exact

ONE = exact(1)
UNSCALED: Vector = (ONE, ONE, ONE)
STANDARD_GRAVITY: Vector = (ZERO, ZERO, exact(-9.81))


class Convention(Enum):
    """Convention of the Denavit-Hartenberg table."""

    STANDARD = "standard"
    """Distal: A_i = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i); joint i moves about or along z_(i-1)."""
    MODIFIED = "modified"
    """Craig's: A_i = Rx(alpha_(i-1)) Tx(a_(i-1)) Rz(theta_i) Tz(d_i); joint i moves about or along z_i."""


class JointType(Enum):
    """Kind of a joint: the entry of the table's row that the joint variable is added to."""

    REVOLUTE = "revolute"
    """The angle theta, rad."""
    PRISMATIC = "prismatic"
    """The offset d, m."""


@dataclass(frozen=True)
class Units:
    """The units of a robot file's bare numbers."""

    length: str = "m"
    angle: str = "rad"

    LENGTHS = {"m": exact(1), "mm": exact(0.001), "cm": exact(0.01), "in": exact(0.0254)}
    ANGLES = {"rad": exact(1), "deg": PI / 180}

    @property
    def metres(self) -> Expression:
        """One unit of length, in metres."""
        return self.LENGTHS[self.length]

    @property
    def radians(self) -> Expression:
        """One unit of angle, in radians."""
        return self.ANGLES[self.angle]


@dataclass(frozen=True)
class Drive:
    """Motor and gear of a joint, motor side: the joint sees gear^2 J, gear^2 B and abs(gear) Tc."""

    gear: Expression = ONE
    """Motor turns per joint turn (rad/m for a prismatic joint); its sign is the motor's sense."""
    rotor_inertia: Expression = ZERO
    """kg m^2."""
    viscous: Expression = ZERO
    """N m s/rad."""
    coulomb: tuple[Expression, Expression] = (ZERO, ZERO)
    """Torque against positive and against negative motion, N m; the second is not positive."""

    @property
    def armature(self) -> Expression:
        """Rotor inertia as the joint sees it, kg m^2 (kg for a prismatic joint)."""
        return self.gear**2 * self.rotor_inertia

    def __repr__(self) -> str:
        against = " and ".join(map(str, self.coulomb))
        text = f"gear {self.gear}, rotor {self.rotor_inertia} kg m^2, viscous {self.viscous} N m s, dry {against} N m"
        return repr_line("Drive", "", text)


@dataclass(frozen=True)
class Coupling:
    """Inertia of a drive that two joints turn: it adds b qd_i qd_j to the kinetic energy, so M_ij and M_ji get b.

    Where joint i carries the motor of joint j, or moves its gear, the rotor turns with both: by G qd_j + k qd_i, with k
    given by the gear and by the rotor's axis. Its inertia J gives b = J G k; J G^2 is the drive's own and J k^2 belongs
    to joint i (Sciavicco & Siciliano, Modelling and Control of Robot Manipulators, 2000, section 4.1).
    """

    joints: tuple[int, int]
    """Numbers of the two joints, from 1, the lower one first."""
    inertia: Expression
    """b: kg m^2 of two revolute joints, kg m of a revolute and a prismatic one, kg of two prismatic ones; any sign."""

    def __repr__(self) -> str:
        return repr_line(
            "Coupling",
            "",
            f"joints {self.joints[0]} and {self.joints[1]}, {self.inertia} in SI units",
        )


@dataclass(frozen=True)
class Placement:
    """A pose as a robot file gives it: origin, m, and fixed-axis roll, pitch, yaw, rad (R = Rz Ry Rx)."""

    xyz: Vector = ORIGIN
    rpy: Vector = ORIGIN

    def __repr__(self) -> str:
        return repr_line(
            "Placement", "", f"xyz {vector_text(self.xyz)} m, rpy {vector_text(self.rpy)} rad"
        )


@dataclass(frozen=True)
class Mesh:
    """A mesh file, its path relative to the robot file's folder; ``scale`` takes its coordinates to metres."""

    path: str
    scale: Vector = UNSCALED
    """Factors along the file's x, y and z; negative ones mirror."""

    def __repr__(self) -> str:
        return repr_line("Mesh", self.path, f"times {vector_text(self.scale)}")


class _Solid:
    """A geometry that prints in one line, as its constructor is written."""

    __repr__ = value_line


@dataclass(frozen=True, repr=False)
class Box(_Solid):
    """A box centred on the origin, edges in m."""

    size: Vector


@dataclass(frozen=True, repr=False)
class Cylinder(_Solid):
    """A cylinder along z centred on the origin, m."""

    radius: Expression
    length: Expression


@dataclass(frozen=True, repr=False)
class Capsule(_Solid):
    """A cylinder along z with half balls on its ends; ``length`` is the cylinder's, m."""

    radius: Expression
    length: Expression


@dataclass(frozen=True, repr=False)
class Sphere(_Solid):
    """A ball around the origin, m."""

    radius: Expression


Geometry: TypeAlias = Mesh | Box | Cylinder | Capsule | Sphere


@dataclass(frozen=True)
class Shape:
    """Geometry of a link for drawings and collisions."""

    geometry: Geometry
    placement: Placement = Placement()
    """Its pose in ``frame``."""
    color: str | None = None
    """``#rrggbb``."""
    frame: Placement = Placement()
    """Pose of that frame in the link's DH frame. It is the same frame, but for shapes of a link that was locked to this
    one: they keep their own frame, and remain one body."""
    body: int = 0
    """Number of that body in the link, along the chain: 0, unless links were locked together."""

    def __repr__(self) -> str:
        color = "" if self.color is None else f", {self.color}"
        position = f"at {vector_text(self.placement.xyz)} m{color}"
        return repr_line("Shape", type(self.geometry).__name__.lower(), position)


@dataclass(frozen=True)
class Joint:
    """A row of the table with the link that it moves.

    The joint variable is added to ``theta`` of a revolute and to ``d`` of a prismatic joint. In the modified
    convention ``a`` and ``alpha`` are those of the link before (a_(i-1), alpha_(i-1)).
    """

    type: JointType
    a: Expression
    alpha: Expression
    d: Expression
    theta: Expression
    name: str = ""
    """If empty, the description names the joint ``joint1``, ``joint2`` ... by its place."""
    limits: tuple[Expression, Expression] | None = None
    """Lowest and highest value of the joint variable, rad or m; None: unlimited."""
    velocity: Expression | None = None
    """Largest speed, rad/s or m/s."""
    effort: Expression | None = None
    """Largest torque or force, N m or N."""
    bodies: tuple[Body, ...] = ()
    """The link's rigid bodies; the dynamics of a link without a body are unknown."""
    drive: Drive | None = None
    shapes: tuple[Shape, ...] = ()
    """Shapes of the link; a link without shapes is drawn from the table."""
    assumed: tuple[str, ...] = ()
    """Keys of this joint whose numbers are assumptions, not from a publication."""

    def __post_init__(self) -> None:
        if len(self.bodies) > 1:
            named = (
                body if body.name else replace(body, name=f"body {k}")
                for k, body in enumerate(self.bodies, 1)
            )
            object.__setattr__(self, "bodies", tuple(named))

    @cached_property
    def body(self) -> Body | None:
        """The link as one rigid body; several bodies are joined about their common centre of mass."""
        return joined(self.bodies) if self.bodies else None

    @property
    def is_revolute(self) -> bool:
        """Whether the joint variable is an angle."""
        return self.type is JointType.REVOLUTE

    def __repr__(self) -> str:
        row = f"{self.type.value}, theta {self.theta}, d {self.d}, a {self.a}, alpha {self.alpha}"
        return repr_line(f"Joint {self.name}" if self.name else "Joint", "", row)


@dataclass(frozen=True)
class Base:
    """Link 0 and the pose of frame 0 in the world; its shapes and body are in frame 0."""

    placement: Placement = Placement()
    shapes: tuple[Shape, ...] = ()
    body: Body | None = None
    """Body of link 0, which does not move: links that were locked to the base are kept in it."""

    def __repr__(self) -> str:
        return _placed_repr("Base", self.placement, self.shapes)


@dataclass(frozen=True)
class Tool:
    """The pose of the tool's frame in DH frame n; its shapes are in the tool's frame."""

    placement: Placement = Placement()
    shapes: tuple[Shape, ...] = ()

    def __repr__(self) -> str:
        return _placed_repr("Tool", self.placement, self.shapes)


def _placed_repr(kind: str, placement: Placement, shapes: tuple[Shape, ...]) -> str:
    return repr_line(
        kind, "", f"at {vector_text(placement.xyz)} m, {counted(len(shapes), 'shape')}"
    )
