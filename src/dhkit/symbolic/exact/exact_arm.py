"""A description in the exact ring: its table, bodies, drives and gravity as elements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import (
    INERTIA_PLACES,
    Array,
    Convention,
    Description,
    description_of,
    joint_array,
    require_bodies,
)
from dhkit.display import counted, repr_line
from dhkit.expressions import ZERO, Expression, exact_angle
from dhkit.symbolic.exact.naming import BodyNumbers, LinkNumbers, Naming, Symbols
from dhkit.symbolic.ring import Element, Elements, Ring
from dhkit.symbolic.ring.constants import Constants, value_of
from dhkit.symbolic.ring.reading import Direction, sum_of_angles


@dataclass(frozen=True, eq=False)
class ExactRow:
    """A row of the table with the joint variable: lengths, m, and cosine and sine of the angles."""

    a: Element
    d: Element
    alpha: Direction
    theta: Direction


@dataclass(frozen=True, eq=False)
class ExactBody:
    """A body of a link in the axes of the link's DH frame."""

    name: str
    """Name as in the description; may be empty for a link's only body."""
    mass: Element
    com: Elements
    """Centre of mass, shape (3,), m."""
    inertia: Elements
    """Inertia about the centre of mass, shape (3, 3), kg m^2."""
    moment: Elements
    """Mass times centre of mass, shape (3,), kg m."""
    second: Elements
    """Inertia about the frame's origin, shape (3, 3), kg m^2."""


@dataclass(frozen=True, eq=False)
class ExactArm:
    """A description whose numbers are elements of a ring.

    Attributes
    ----------
    description, symbols
        The robot, and the choice of its numbers that are symbols.
    ring
        The ring of all elements.
    rows
        Rows of the table, one a joint.
    bodies
        Bodies of each link; with ``symbols="inertial"`` a single one that stands for all of them.
    gear, rotor, viscous
        Gear ratio, rotor inertia, kg m^2, and motor-side viscous friction, N m s, of each drive; 1, 0, 0 without one.
    couplings
        Joints i < j, from 0, and the drives' inertia that both turn, kg m^2, kg m or kg.
    base
        Rotation of frame 0 in the world, shape (3, 3).
    gravity
        Free-fall acceleration in the axes of frame 0, shape (3,), m/s^2.
    origin
        Position of frame 0's origin from the world's, in the axes of frame 0, shape (3,), m.
    tool
        The tool's origin in frame n, shape (3,), m.
    values
        Value of every constant of the ring.
    parameters
        Value of every symbol that the constants depend on, SI.
    notes
        One sentence for each number that is a symbol because it has no exact form.
    inertial
        With ``symbols="inertial"`` the symbols that torques are linear in, link by link; empty otherwise.
    """

    description: Description
    symbols: Symbols
    ring: Ring
    rows: tuple[ExactRow, ...]
    bodies: tuple[tuple[ExactBody, ...], ...]
    gear: tuple[Element, ...]
    rotor: tuple[Element, ...]
    viscous: tuple[Element, ...]
    couplings: tuple[tuple[int, int, Element], ...]
    base: Elements
    gravity: Elements
    origin: Elements
    tool: Elements
    values: dict[str, float]
    parameters: dict[str, float]
    notes: tuple[str, ...]
    inertial: tuple[str, ...] = ()

    @property
    def n(self) -> int:
        """The number of joints."""
        return self.ring.n

    @property
    def armature(self) -> tuple[Element, ...]:
        """Rotor inertias at the joint side, gear^2 times rotor inertia, shape (n,), kg m^2 or kg."""
        return tuple(gear * gear * rotor for gear, rotor in zip(self.gear, self.rotor, strict=True))

    @property
    def is_standard(self) -> bool:
        """Whether the table is of the standard (distal) convention."""
        return self.description.convention is Convention.STANDARD

    def evaluate(
        self,
        elements: Element | Elements,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
    ) -> Array:
        """Return the values of elements at states; elements may be written in sums of angles.

        Parameters
        ----------
        elements
            One element, or an array of them.
        q, qd, qdd
            Joint values, rates and accelerations, shapes (..., n), rad, m and seconds; batch axes broadcast. Rates and
            accelerations are 0 unless given.

        Returns
        -------
        Array
            Shape ``(..., *elements.shape)``, SI.

        Raises
        ------
        ValueError, TypeError
            A joint vector has another shape, or is not numeric.
        """
        zero = np.zeros(self.n)
        states = np.broadcast_arrays(
            joint_array(self.description, q, "q"),
            joint_array(self.description, zero if qd is None else qd, "qd"),
            joint_array(self.description, zero if qdd is None else qdd, "qdd"),
        )
        batch = states[0].shape[:-1]

        if isinstance(elements, Element):
            shape: tuple[int, ...] = ()
            listed = [elements]
        else:
            shape = np.shape(elements)
            listed = np.asarray(elements, dtype=object).ravel().tolist()

        # Elements in other angles are of other rings; the generators' values are computed once a ring.
        rings = {element.ring for element in listed}
        values = {ring: ring.values(self.values, *states) for ring in rings}
        numbers = np.empty((*batch, len(listed)))
        for k, element in enumerate(listed):
            numbers[..., k] = element.value(values[element.ring])
        return numbers.reshape((*batch, *shape))

    def __repr__(self) -> str:
        summary = f"{counted(self.n, 'joint')}, {', '.join(self.ring.constants) or 'in numbers'}"
        return repr_line("ExactArm", self.description.name, summary)


@lru_cache(maxsize=32)
def exact_arm(
    description: Description, symbols: Symbols = "file", needed: tuple[Expression, ...] = ()
) -> ExactArm:
    """Return a description in a ring; equal arguments give equal rings, so that results can be compared.

    Parameters
    ----------
    description
        The robot.
    symbols
        ``"none"``: numbers only. ``"file"``: the file's parameters that do not depend on others. ``"inertial"``:
        each link's mass ``m2``, first moments ``rx2 ry2 rz2`` and second moments about its frame's origin ``Ixx2`` ...
        ``Ixz2``, its drive's ``Jm2`` and ``G2``, lengths ``a2 d2`` where they are not zero, and gravity ``g``.
    needed
        Further expressions whose constants the ring contains.

    Returns
    -------
    ExactArm
        The arm's rows, bodies, gravity and drives as elements of one ring.

    Raises
    ------
    DescriptionError
        A link has no body.
    ValueError
        Another choice of symbols.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> exact_arm(library_robot("planar2r")).ring.constants
    ('g', 'l1', 'm1', 'l2', 'm2')
    >>> exact_arm(library_robot("planar2r"), "none").ring.constants
    ()
    """
    if not isinstance(description, Description):
        return exact_arm(description_of(description), symbols, needed)
    if symbols not in ("none", "file", "inertial"):
        raise ValueError(f"symbols is {symbols!r}; expected 'none', 'file' or 'inertial'")

    # All numbers of the description as expressions in the symbols.
    bodies = require_bodies(description)
    naming = Naming(description, symbols)
    links = [naming.link(i, own) for i, own in enumerate(bodies)]
    gravity = naming.gravity()
    base = description.base.placement
    base_xyz = [naming.known(x) for x in base.xyz]
    base_rpy = [exact_angle(naming.known(x)) for x in base.rpy]
    tool = [naming.known(x) for x in description.tool.placement.xyz]
    viscous = [
        naming.known(joint.drive.viscous) if joint.drive else ZERO for joint in description.joints
    ]
    couplings = [
        (*coupling.joints, naming.coupling(coupling)) for coupling in description.couplings
    ]

    # The ring that contains them.
    shared_inertias = [inertia for *_, inertia in couplings]
    expressions = [*gravity, *base_xyz, *tool, *viscous, *shared_inertias, *needed]
    angles = [*base_rpy]
    for link in links:
        a, d, alpha, theta = link.row
        expressions += [a, d]
        for body in link.bodies:
            expressions += [body.mass, *body.com, *_tensor(body)]
        expressions += [link.gear, link.rotor]
        angles += [alpha, theta]
    constants = Constants.of(expressions, angles)
    ring = Ring(description.kinds, list(constants.found.values()))

    # The same numbers as elements of the ring. A vector v of the world is R^T v in the axes of frame 0.
    R = _rotation(ring, base_rpy)
    return ExactArm(
        description=description,
        symbols=symbols,
        ring=ring,
        rows=tuple(_row(ring, i, link) for i, link in enumerate(links)),
        bodies=tuple(_bodies(ring, link) for link in links),
        gear=tuple(ring.read(link.gear) for link in links),
        rotor=tuple(ring.read(link.rotor) for link in links),
        viscous=tuple(ring.read(x) for x in viscous),
        couplings=tuple((i - 1, j - 1, ring.read(inertia)) for i, j, inertia in couplings),
        base=R,
        gravity=R.T @ np.array([ring.read(x) for x in gravity], dtype=object),
        origin=R.T @ np.array([ring.read(x) for x in base_xyz], dtype=object),
        tool=np.array([ring.read(x) for x in tool], dtype=object),
        values={
            text: value_of(constant, naming.values) for text, constant in constants.found.items()
        },
        parameters={name: float(naming.values[name]) for name in _symbols(constants)},
        notes=tuple(constants.notes),
        inertial=tuple(naming.inertial),
    )


def _symbols(constants: Constants) -> list[str]:
    """Return the names of the parameters that constants depend on, in their order."""
    names: dict[str, None] = {}
    for constant in constants.found.values():
        names |= dict.fromkeys(sorted(constant.symbols))
    return list(names)


def _row(ring: Ring, i: int, link: LinkNumbers) -> ExactRow:
    """Return row i, counted from 0, with the joint variable added to theta or d."""
    a = ring.read(link.row[0])
    d = ring.read(link.row[1])
    alpha = ring.direction(link.row[2])
    theta = ring.direction(link.row[3])
    if ring.kinds[i] != "R":
        return ExactRow(a, d + ring.position(i), alpha, theta)
    return ExactRow(a, d, alpha, sum_of_angles((ring.cosine(i), ring.sine(i)), theta))


def _bodies(ring: Ring, link: LinkNumbers) -> tuple[ExactBody, ...]:
    """Return a link's bodies in the ring, with inertias about the centre of mass and about the frame's origin."""
    bodies = []
    for body in link.bodies:
        mass = ring.read(body.mass)
        com = np.array([ring.read(x) for x in body.com], dtype=object)
        moment = np.array([mass * x for x in com], dtype=object)
        tensor = _symmetric_matrix([ring.read(x) for x in _tensor(body)])

        # Steiner: I_origin = I_com + m (c^2 1 - c c^T); the numbers have one of the two.
        steiner = point_inertia(com, moment)
        if body.second is None:
            bodies.append(ExactBody(body.name, mass, com, tensor, moment, tensor + steiner))
        else:
            bodies.append(ExactBody(body.name, mass, com, tensor - steiner, moment, tensor))
    return tuple(bodies)


def _tensor(body: BodyNumbers) -> tuple[Expression, ...]:
    """Return the inertia that is given of a body, about the centre of mass or the frame's origin."""
    return body.inertia or body.second or ()


def point_inertia(c: Elements, h: Elements) -> Elements:
    """Return m (c^2 1 - c c^T), shape (3, 3), from a position c and the first moment h = m c, both shape (3,)."""
    square = c @ h
    zero = 0 * square
    inertia = np.empty((3, 3), dtype=object)
    for i in range(3):
        for j in range(3):
            inertia[i, j] = (square if i == j else zero) - c[i] * h[j]
    return inertia


def _symmetric_matrix(entries: Sequence[Element]) -> Elements:
    """Return a symmetric matrix, shape (3, 3), from its entries in the order of ``INERTIA_PLACES``."""
    tensor = np.empty((3, 3), dtype=object)
    for (i, j), entry in zip(INERTIA_PLACES.values(), entries, strict=True):
        tensor[i, j] = tensor[j, i] = entry
    return tensor


def _rotation(ring: Ring, rpy: Sequence[Expression]) -> Elements:
    """Return Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3)."""
    one = ring.one
    zero = ring.zero
    (cr, sr), (cp, sp), (cy, sy) = (ring.direction(angle) for angle in rpy)
    z = np.array([[cy, -sy, zero], [sy, cy, zero], [zero, zero, one]], dtype=object)
    y = np.array([[cp, zero, sp], [zero, one, zero], [-sp, zero, cp]], dtype=object)
    x = np.array([[one, zero, zero], [zero, cr, -sr], [zero, sr, cr]], dtype=object)
    rotation: Elements = z @ y @ x
    return rotation
