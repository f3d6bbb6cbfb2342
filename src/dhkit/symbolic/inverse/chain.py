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
from itertools import chain

import numpy as np

from dhkit.description import Convention, Description, Placement, takes_robot
from dhkit.description.parameters import resolved
from dhkit.expressions import PI, PI_DIGITS, ZERO, Expression, exact, exact_angle, substitute
from dhkit.symbolic.exact.naming import Naming
from dhkit.symbolic.exact.transforms import identity, inverse, rotation, translation
from dhkit.symbolic.ring import Direction, Element, Elements, Ring
from dhkit.symbolic.ring.constants import Constants, value_of
from dhkit.symbolic.ring.notation import distinct
from dhkit.symbolic.ring.ring import Constant

_POSITION = ("px", "py", "pz")
_ROTATION = tuple(f"r{i}{j}" for i in "123" for j in "123")
POSE = (*_POSITION, *_ROTATION)
"""Names of the entries of the tool's pose in the world."""
INNER = tuple(name.replace("p", "h").replace("r", "h") for name in POSE)
"""Names of the entries of the pose without base and tool."""
_DEFINED = (
    *INNER,
    *(f"{letter}{axis}" for letter in "wano" for axis in "xyz"),
    *("x", "y", "u", "v", "cphi", "sphi"),
)
"""Names that steps may define."""
ZERO_LENGTH = Fraction(1, 10**12)
"""rad, and lengths over the reach."""


@dataclass(frozen=True, eq=False)
class ExactChain:
    """The exact chain of an arm.

    Attributes
    ----------
    description
        The robot.
    ring
        Of all elements: sines and cosines of theta_i, values of prismatic joints, lengths, the pose's entries, and the
        quantities that steps define.
    names
        The names of the pose's entries and of defined quantities in the ring: their own, unless the robot file has
        parameters of those names.
    first, last
        The constant ends E and F, shape (4, 4), m.
    a, alpha
        Of the links C_1 ... C_(n-1): lengths, m, and cosine and sine of the twists.
    d
        Lengths of the joints, m; with the joint's value where it slides.
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
    def of(cls, description: Description, *, named: bool, in_joint_values: bool = False) -> ExactChain:
        """Return an arm's chain; lengths that are numbers get names (a2, d3) if ``named``, else all are numbers."""
        naming = Naming(description, "inertial" if named else "none")
        joints = description.joints
        is_standard = description.convention is Convention.STANDARD
        lengths = [(naming.length(f"a{i}", j.a), naming.length(f"d{i}", j.d)) for i, j in enumerate(joints, start=1)]
        angles = [tuple(exact_angle(naming.known(x)) for x in (j.alpha, j.theta)) for j in joints]
        ends = [description.base.placement, description.tool.placement]
        fixed = [[naming.known(x) for x in end.xyz] for end in ends]
        turned = [[exact_angle(naming.known(x)) for x in end.rpy] for end in ends]
        constants = Constants.of(
            [*chain.from_iterable(lengths), *chain.from_iterable(fixed)],
            [*chain.from_iterable(angles), *chain.from_iterable(turned)],
        )
        taken = set(chain.from_iterable(constant.symbols for constant in constants.found.values()))
        names = distinct([*POSE, *_DEFINED], taken)
        # The pose and defined quantities come first, so that they are written first.
        ring = Ring(description.kinds, [*map(Constant, names.values()), *constants.found.values()])
        placed = []
        for xyz, rpy in zip(fixed, turned, strict=True):
            placed.append(_placed(ring, [ring.read(x) for x in xyz], [ring.direction(x) for x in rpy]))
        base, tool = placed
        a = [ring.read(row[0]) for row in lengths]
        alpha = [ring.direction(row[0]) for row in angles]
        outer = 0 if not is_standard else len(joints) - 1
        link = translation(ring, 0, a[outer]) @ rotation(ring, 1, 2, alpha[outer])
        del a[outer], alpha[outer]
        d = [ring.read(row[1]) for row in lengths]
        slides = [kind == "P" for kind in description.kinds]
        return cls(
            description,
            ring,
            names,
            base if is_standard else base @ link,
            link @ tool if is_standard else tool,
            tuple(a),
            tuple(alpha),
            tuple(d_i + ring.position(i) if slides[i] else d_i for i, d_i in enumerate(d)),
            tuple(row[1] for row in angles),
            {text: value_of(constant, naming.values) for text, constant in constants.found.items()},
            {name: float(naming.values[name]) for name in sorted(taken)},
            tuple(constants.notes),
            in_joint_values,
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
        c = self.ring.cosine(i - 1)
        s = self.ring.sine(i - 1)
        if not self.in_joint_values:
            return c, s
        return c * offset[0] - s * offset[1], s * offset[0] + c * offset[1]

    def joint(self, i: int) -> Elements:
        """Return J_i, i from 1, shape (4, 4)."""
        return rotation(self.ring, 0, 1, self.cosine_and_sine(i)) @ translation(self.ring, 2, self.d[i - 1])

    def link(self, i: int) -> Elements:
        """Return C_i, i from 1 to n - 1, shape (4, 4)."""
        return translation(self.ring, 0, self.a[i - 1]) @ rotation(self.ring, 1, 2, self.alpha[i - 1])

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
        """The tool in the world by the table's own transforms, base A_1 ... A_n tool, shape (4, 4), m."""
        T = self.first
        for i in range(1, self.n + 1):
            T = T @ self.joint(i) @ (self.link(i) if i < self.n else self.last)
        return T

    @cached_property
    def given_pose(self) -> Elements:
        """The pose that is given, shape (4, 4), of symbols."""
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

    def length(name: str, value: Expression) -> Expression:
        return nearest(name, value, value.rational, ZERO, (description.reach or 1.0) * ZERO_LENGTH)

    def angle(name: str, value: Expression) -> Expression:
        number = exact_angle(value).rational
        return nearest(name, value, number, PI * Fraction(round(2 * (number or 0) / PI_DIGITS), 2), ZERO_LENGTH)

    def nearest(
        name: str, value: Expression, number: Fraction | None, known: Expression, tolerance: float | Fraction
    ) -> Expression:
        if not number or abs(known.value() - number) > tolerance:
            return value
        notes.append(f"{name}, {float(number)!r}, is read as {known}")
        return known

    def end(name: str, placement: Placement) -> Placement:
        x, y, z = (length(f"{axis} of the {name}", v) for axis, v in zip("xyz", placement.xyz, strict=True))
        angles = zip(("roll", "pitch", "yaw"), placement.rpy, strict=True)
        roll, pitch, yaw = (angle(f"{turn} of the {name}", v) for turn, v in angles)
        return Placement((x, y, z), (roll, pitch, yaw))

    joints = tuple(
        replace(
            joint,
            a=length(f"a{i}", joint.a),
            alpha=angle(f"alpha{i}", joint.alpha),
            d=length(f"d{i}", joint.d),
            theta=angle(f"theta{i}", joint.theta),
        )
        for i, joint in enumerate(description.joints, start=1)
    )
    base = replace(description.base, placement=end("base", description.base.placement))
    tool = replace(description.tool, placement=end("tool", description.tool.placement))
    return (replace(description, joints=joints, base=base, tool=tool) if notes else description), notes


@takes_robot
def table_lengths(description: Description) -> dict[str, Fraction]:
    """Return the lengths of a table that are numbers, by the names that derivations give them: a2, d3, m."""
    naming = Naming(description, "inertial")
    found = {}
    for i, joint in enumerate(description.joints, start=1):
        for name, length in ((f"a{i}", joint.a), (f"d{i}", joint.d)):
            symbol = naming.length(name, length)
            value = naming.values.get(symbol.text)
            if symbol.text not in description.parameters and value is not None and value.rational is not None:
                found[symbol.text] = value.rational
    return found


def with_table_lengths(description: Description, lengths: Mapping[str, Fraction]) -> Description:
    """Return the arm with other lengths in its table; ``lengths`` by the names of :func:`table_lengths`, m."""
    naming = Naming(description, "inertial")

    def other(name: str, length: Expression) -> Expression:
        new = lengths.get(naming.length(name, length).text)
        return length if new is None else exact(new)

    joints = tuple(
        replace(joint, a=other(f"a{i}", joint.a), d=other(f"d{i}", joint.d))
        for i, joint in enumerate(description.joints, start=1)
    )
    return replace(description, joints=joints)


def is_identity(T: Elements) -> bool:
    """Whether a transform moves nothing."""
    return all(entry == (1 if i == j else 0) for (i, j), entry in np.ndenumerate(T))


def undone(first: Elements, T: Elements, last: Elements) -> Elements:
    """Return first^-1 T last^-1, shape (4, 4)."""
    result: Elements = inverse(first) @ T @ inverse(last)
    return result


def _placed(ring: Ring, xyz: list[Element], rpy: list[Direction]) -> Elements:
    """Return Rz(yaw) Ry(pitch) Rx(roll) with an origin, shape (4, 4)."""
    roll, pitch, yaw = rpy
    T: Elements = rotation(ring, 0, 1, yaw) @ rotation(ring, 2, 0, pitch) @ rotation(ring, 1, 2, roll)
    T[:3, 3] = xyz
    return T
