"""An arm in the form from which inverse kinematics is derived, for both conventions of tables.

T = E J_1 C_1 J_2 C_2 ... C_(n-1) J_n F with the joints J_i = Rz(theta_i) Tz(d_i), the links C_i = Tx(a_i) Rx(alpha_i)
between them, and constant ends E and F. Standard tables have E = base, F = C_n tool; modified ones E = base C_0,
F = tool. Angles of joints are the table's theta_i: joint value plus offset.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from dhkit.description import Convention, Description, Placement, takes_robot
from dhkit.description.parameters import resolved
from dhkit.expressions import PI, PI_DIGITS, ZERO, Expression, exact, exact_angle, substitute
from dhkit.symbolic.exact.naming import Naming
from dhkit.symbolic.exact.transforms import identity, inverse, rotation, translation
from dhkit.symbolic.ring import Direction, Element, Elements, Ring
from dhkit.symbolic.ring.constants import Constants, value_of
from dhkit.symbolic.ring.notation import distinct
from dhkit.symbolic.ring.reading import sum_of_angles
from dhkit.symbolic.ring.ring import Constant

_POSITION = ("px", "py", "pz")
_ROTATION = ("r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33")
POSE = (*_POSITION, *_ROTATION)
"""Names of the entries of the tool's pose in the world."""
INNER = tuple(name.replace("p", "h").replace("r", "h") for name in POSE)
"""Names of the entries of the pose without base and tool."""
_DEFINED = (
    *INNER,
    *("wx", "wy", "wz"),
    *("ax", "ay", "az"),
    *("nx", "ny", "nz"),
    *("ox", "oy", "oz"),
    *("x", "y", "u", "v", "cphi", "sphi"),
)
"""Names that steps may define."""
ZERO_LENGTH = Fraction(1, 10**12)
"""Tolerance within which a length, as a share of the reach, or an angle, rad, is rounding of 0 or of k pi/2."""


@dataclass(frozen=True, eq=False)
class ExactChain:
    """The exact chain of an arm.

    Attributes
    ----------
    description
        The robot.
    ring
        The ring of all elements: sines and cosines of theta_i, values of prismatic joints, lengths, the pose's entries,
        and the quantities that steps define.
    names
        The names of the pose's entries and of defined quantities in the ring: their own, unless the robot file has
        parameters of those names.
    first, last
        The constant ends E and F, shape (4, 4), m.
    a, alpha
        Lengths, m, and cosines and sines of the twists, of the links C_1 ... C_(n-1).
    d
        Lengths of the joints, m; of a prismatic joint, with its value added.
    offsets
        Offset of each joint: theta_i minus the joint value; of a prismatic joint, its constant angle.
    values
        Values of the ring's constants that are not entries of poses and not defined by steps.
    lengths
        Values of the symbols, SI, by name.
    notes
        One sentence for each number that is a symbol because it has no exact form.
    in_joint_values
        Whether sines and cosines are those of the joint values; else of the table's angles theta_i.
    """

    description: Description
    ring: Ring
    names: Mapping[str, str]
    first: Elements
    last: Elements
    a: tuple[Element, ...]
    alpha: tuple[Direction, ...]
    d: tuple[Element, ...]
    offsets: tuple[Expression, ...]
    values: dict[str, float]
    lengths: dict[str, float]
    notes: tuple[str, ...]
    in_joint_values: bool = False

    @classmethod
    def of(
        cls, description: Description, *, named: bool, in_joint_values: bool = False
    ) -> ExactChain:
        """Return an arm's chain; lengths that are numbers get names (a2, d3) if ``named``, else all are numbers."""
        naming = Naming(description, "inertial" if named else "none")

        # The numbers of table, base and tool as expressions. Symbols get their names in this order.
        a_lengths: list[Expression] = []
        d_lengths: list[Expression] = []
        alphas: list[Expression] = []
        thetas: list[Expression] = []
        for i, joint in enumerate(description.joints, start=1):
            a_lengths.append(naming.length(f"a{i}", joint.a))
            d_lengths.append(naming.length(f"d{i}", joint.d))
            alphas.append(exact_angle(naming.known(joint.alpha)))
            thetas.append(exact_angle(naming.known(joint.theta)))
        base = _known_placement(naming, description.base.placement)
        tool = _known_placement(naming, description.tool.placement)

        # Constants are found, and printed, row by row.
        lengths: list[Expression] = []
        angles: list[Expression] = []
        for a_i, d_i, alpha_i, theta_i in zip(a_lengths, d_lengths, alphas, thetas, strict=True):
            lengths += [a_i, d_i]
            angles += [alpha_i, theta_i]
        constants = Constants.of([*lengths, *base.xyz, *tool.xyz], [*angles, *base.rpy, *tool.rpy])
        taken = frozenset[str]().union(*(constant.symbols for constant in constants.found.values()))
        names = distinct([*POSE, *_DEFINED], taken)

        # The pose and defined quantities come first, so that they are written first.
        ring = Ring(description.kinds, [*map(Constant, names.values()), *constants.found.values()])
        T_base = _transform(ring, base)
        T_tool = _transform(ring, tool)
        a = [ring.read(x) for x in a_lengths]
        alpha = [ring.direction(x) for x in alphas]
        d = [ring.read(x) for x in d_lengths]
        for i, kind in enumerate(description.kinds):
            if kind == "P":
                d[i] = d[i] + ring.position(i)

        # The link of the last row (standard) or of the first one (modified) is not between joints.
        is_standard = description.convention is Convention.STANDARD
        outer = description.n - 1 if is_standard else 0
        outer_link = translation(ring, 0, a.pop(outer)) @ rotation(ring, 1, 2, alpha.pop(outer))
        return cls(
            description=description,
            ring=ring,
            names=names,
            first=T_base if is_standard else T_base @ outer_link,
            last=outer_link @ T_tool if is_standard else T_tool,
            a=tuple(a),
            alpha=tuple(alpha),
            d=tuple(d),
            offsets=tuple(thetas),
            values={
                text: value_of(constant, naming.values)
                for text, constant in constants.found.items()
            },
            lengths={name: float(naming.values[name]) for name in sorted(taken)},
            notes=tuple(constants.notes),
            in_joint_values=in_joint_values,
        )

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.d)

    def number(self, expression: Expression) -> float:
        """Return the value of an expression in the file's parameters, SI and rad."""
        return float(substitute(expression, resolved(self.description.parameters)))

    def symbol(self, name: str) -> Element:
        """Return an entry of the pose or a defined quantity by its usual name."""
        return self.ring.constant(self.names[name])

    def cosine_and_sine(self, i: int) -> Direction:
        """Return cosine and sine of theta_i, i from 1; of a prismatic joint those of its constant angle."""
        offset = self.ring.direction(self.offsets[i - 1])
        if self.description.kinds[i - 1] != "R":
            return offset
        own = (self.ring.cosine(i - 1), self.ring.sine(i - 1))
        return sum_of_angles(own, offset) if self.in_joint_values else own

    def joint(self, i: int) -> Elements:
        """Return J_i, i from 1, shape (4, 4)."""
        return rotation(self.ring, 0, 1, self.cosine_and_sine(i)) @ translation(
            self.ring, 2, self.d[i - 1]
        )

    def link(self, i: int) -> Elements:
        """Return C_i, i from 1 to n - 1, shape (4, 4)."""
        return translation(self.ring, 0, self.a[i - 1]) @ rotation(
            self.ring, 1, 2, self.alpha[i - 1]
        )

    def part(self, first: int, last: int) -> Elements:
        """Return J_first C_first ... J_last C_last, shape (4, 4); without C_n, the identity if ``last`` is smaller."""
        T = identity(self.ring)
        for i in range(first, last + 1):
            T = T @ self.joint(i)
            if i < self.n:
                T = T @ self.link(i)
        return T

    @cached_property
    def whole(self) -> Elements:
        """J_1 C_1 ... J_n, shape (4, 4)."""
        return self.part(1, self.n)

    @cached_property
    def tool_pose(self) -> Elements:
        """The tool in the world in the joints, base A_1 ... A_n tool = E J_1 C_1 ... J_n F, shape (4, 4), m."""
        T = self.first
        for i in range(1, self.n + 1):
            T = T @ self.joint(i) @ (self.link(i) if i < self.n else self.last)
        return T

    @cached_property
    def given_pose(self) -> Elements:
        """The given pose, shape (4, 4), of symbols."""
        T = identity(self.ring)
        T[:3, 3] = [self.symbol(name) for name in _POSITION]
        T[:3, :3] = np.array([self.symbol(name) for name in _ROTATION], dtype=object).reshape(3, 3)
        return T

    def named(self, names: Iterable[str]) -> Elements:
        """Return defined quantities by their usual names, shape (k,)."""
        return np.array([self.symbol(name) for name in names], dtype=object)


def without_rounding(description: Description) -> tuple[Description, list[str]]:
    """Return an arm with lengths within ZERO_LENGTH of 0 as 0, angles so near k pi/2 as k pi/2, and notes on these.

    ``arm.family`` reads tables with the same tolerance; only numbers change, not parameters.
    """
    notes: list[str] = []

    def rounded(
        name: str,
        value: Expression,
        number: Fraction | None,
        near: Expression,
        tolerance: float | Fraction,
    ) -> Expression:
        """Return ``near`` with a note if the number is not 0 and within the tolerance of it, else the value."""
        if not number or abs(near.value() - number) > tolerance:
            return value
        notes.append(f"{name}, {float(number)!r}, is read as {near}")
        return near

    def length(name: str, value: Expression) -> Expression:
        tolerance = (description.reach or 1.0) * ZERO_LENGTH
        return rounded(name, value, value.rational, ZERO, tolerance)

    def angle(name: str, value: Expression) -> Expression:
        number = exact_angle(value).rational
        quarter_turns = round(2 * (number or 0) / PI_DIGITS)
        return rounded(name, value, number, PI * Fraction(quarter_turns, 2), ZERO_LENGTH)

    def end(name: str, placement: Placement) -> Placement:
        x, y, z = placement.xyz
        roll, pitch, yaw = placement.rpy
        xyz = (
            length(f"x of the {name}", x),
            length(f"y of the {name}", y),
            length(f"z of the {name}", z),
        )
        rpy = (
            angle(f"roll of the {name}", roll),
            angle(f"pitch of the {name}", pitch),
            angle(f"yaw of the {name}", yaw),
        )
        return Placement(xyz, rpy)

    joints = []
    for i, joint in enumerate(description.joints, start=1):
        without = replace(
            joint,
            a=length(f"a{i}", joint.a),
            alpha=angle(f"alpha{i}", joint.alpha),
            d=length(f"d{i}", joint.d),
            theta=angle(f"theta{i}", joint.theta),
        )
        joints.append(without)
    base = replace(description.base, placement=end("base", description.base.placement))
    tool = replace(description.tool, placement=end("tool", description.tool.placement))
    if not notes:
        return description, notes
    return replace(description, joints=tuple(joints), base=base, tool=tool), notes


@takes_robot
def table_lengths(description: Description) -> dict[str, Fraction]:
    """Return the lengths of a table that are numbers, by the names that derivations give them: a2, d3, m.

    Parameters
    ----------
    description
        The robot.

    Returns
    -------
    dict[str, Fraction]
        Lengths, m, exact; those that the file names as parameters are left out.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> {name: float(length) for name, length in table_lengths(library_robot("puma560")).items()}
    {'d1': 0.67183, 'a2': 0.4318, 'a3': 0.0203, 'd3': 0.15005, 'd4': 0.4318}
    """
    naming = Naming(description, "inertial")
    found = {}
    for i, joint in enumerate(description.joints, start=1):
        for name, length in ((f"a{i}", joint.a), (f"d{i}", joint.d)):
            symbol = naming.length(name, length)
            value = naming.values.get(symbol.text)
            if (
                symbol.text not in description.parameters
                and value is not None
                and value.rational is not None
            ):
                found[symbol.text] = value.rational
    return found


def with_table_lengths(description: Description, lengths: Mapping[str, Fraction]) -> Description:
    """Return the arm with other lengths in its table; ``lengths`` by the names of :func:`table_lengths`, m."""
    naming = Naming(description, "inertial")

    def replaced(name: str, length: Expression) -> Expression:
        new = lengths.get(naming.length(name, length).text)
        return length if new is None else exact(new)

    joints = tuple(
        replace(joint, a=replaced(f"a{i}", joint.a), d=replaced(f"d{i}", joint.d))
        for i, joint in enumerate(description.joints, start=1)
    )
    return replace(description, joints=joints)


def is_identity(T: Elements) -> bool:
    """Return whether a transform moves nothing."""
    return all(entry == (1 if i == j else 0) for (i, j), entry in np.ndenumerate(T))


def undone(first: Elements, T: Elements, last: Elements) -> Elements:
    """Return first^-1 T last^-1, shape (4, 4)."""
    result: Elements = inverse(first) @ T @ inverse(last)
    return result


def _known_placement(naming: Naming, placement: Placement) -> Placement:
    """Return a placement in the symbols that are kept."""
    x, y, z = (naming.known(length) for length in placement.xyz)
    roll, pitch, yaw = (exact_angle(naming.known(angle)) for angle in placement.rpy)
    return Placement((x, y, z), (roll, pitch, yaw))


def _transform(ring: Ring, placement: Placement) -> Elements:
    """Return Rz(yaw) Ry(pitch) Rx(roll) with an origin, shape (4, 4), m."""
    roll, pitch, yaw = (ring.direction(angle) for angle in placement.rpy)
    T: Elements = (
        rotation(ring, 0, 1, yaw) @ rotation(ring, 2, 0, pitch) @ rotation(ring, 1, 2, roll)
    )
    T[:3, 3] = [ring.read(length) for length in placement.xyz]
    return T
