"""Forward kinematics and the Jacobian as a textbook derives them, exactly, with the places where students go wrong.

Link transforms from the table's four elementary motions, their product from base to tool, and the Jacobian column by
column from the joints' axes and the levers to the tool (Spong, Hutchinson & Vidyasagar, Robot Modeling and Control,
2006, sections 3.2 and 4.6; Craig, Introduction to Robotics, 2005, section 3.4, for modified tables).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from dhkit.description import Body, Description, Placement
from dhkit.display import repr_line
from dhkit.expressions import ZERO, Expression, cos, exact_angle, sin
from dhkit.symbolic.exact.exact_arm import ExactArm, ExactRow, exact_arm
from dhkit.symbolic.exact.naming import Naming, Symbols
from dhkit.symbolic.exact.transforms import identity, inverse, rotation, translation
from dhkit.symbolic.mistakes import MadeAt, Mistake, Subject, catalogue, check_mistake, has, made_at
from dhkit.symbolic.ring import Direction, Elements, RingError
from dhkit.symbolic.ring.reading import difference_of_angles

ROW = (
    "Look again at this row: which axis does it turn about, and which lengths lie along which axis?"
)
_ZERO_POSE = (
    "Look again at where each joint's angle is zero: draw the arm with all joint values zero."
)
ORDER = "Look again at the order of rotations and translations inside A_i."
_ENDS = (
    "Look again at the product of the transforms: "
    "where does it begin, where does it end, and which way does it run?"
)
COLUMNS = "Look again at the Jacobian's columns: the joint's axis, and the lever from the joint to the tool."
_AXES = "Look again at which axes and which point the Jacobian is for."


def _mistakes(subject: Subject, hint: str, **sentences: str) -> list[Mistake]:
    """Return mistakes of one subject and hint, each an identity with its sentence."""
    return [Mistake(identity, subject, sentence, hint) for identity, sentence in sentences.items()]


LINK_MISTAKES: Mapping[str, Mistake] = catalogue(
    _mistakes(
        Subject.TABLE,
        ROW,
        a_d_exchanged="a and d are exchanged: a is measured along the x axis, d along the z axis",
        a_forgotten="the length a along the x axis is missing",
        d_forgotten="the offset d along the z axis is missing",
        alpha_sign="the twist alpha has the wrong sign: it turns from one z axis to the next about x, by the right "
        "hand",
        alpha_forgotten="the twist alpha is missing: the next z axis is taken parallel to this one",
        alpha_sin_cos="sine and cosine of alpha are exchanged",
    ),
    _mistakes(
        Subject.TABLE,
        _ZERO_POSE,
        theta_offset_forgotten="theta lacks its constant offset: at joint value 0 the x axes are not aligned",
        theta_offset_sign="theta's constant offset has the wrong sign",
        theta_sign="theta has the wrong sign: the joint turns the wrong way round",
        theta_sin_cos="sine and cosine of theta are exchanged: the angle is measured from the y axis, 90 deg - theta",
        theta_quarter_more="the zero pose is shifted: theta is 90 degrees too large",
        theta_quarter_less="the zero pose is shifted: theta is 90 degrees too small",
        variable_forgotten="the joint's variable is missing: the joint is taken for fixed",
    ),
    _mistakes(
        Subject.TRANSFORM,
        ORDER,
        rotations_first="both rotations come before both translations: a and d are measured along turned axes",
        translations_first="both translations come before both rotations: a and d are measured along unturned axes",
        rotation_transposed="the rotation inside A_i is transposed: it maps frame i - 1 to frame i",
        translations_unrotated="translations are added up without turning them into the axes of the frames before",
    ),
)
"""Mistakes inside one A_i, or in multiplying by it: made at every link or at one."""

POSE_MISTAKES: Mapping[str, Mistake] = catalogue(
    _mistakes(
        Subject.TRANSFORM,
        _ENDS,
        convention_exchanged="the table's numbers are put into the A_i of the other convention (standard, modified)",
        product_reversed="the product runs the wrong way: A_n ... A_1 instead of A_1 ... A_n",
        tool_forgotten="the tool's transform is missing: the product ends at frame n",
        tool_inverted="the tool's transform is inverted",
        base_forgotten="the base's transform is missing: the product begins at frame 0",
        base_inverted="the base's transform is inverted",
        pose_inverted="the pose is inverted: it maps the world to the tool instead of the tool to the world",
    )
)
"""Mistakes in the pose of the tool, and in what follows from it."""

JACOBIAN_MISTAKES: Mapping[str, Mistake] = catalogue(
    _mistakes(
        Subject.JACOBIAN,
        _AXES,
        jacobian_x_y_exchanged="the rows of the velocities along x and y are exchanged",
        jacobian_halves_exchanged="angular rows stand above linear ones: here the linear velocity comes first",
        point_frame_n="the linear velocity is that of frame n's origin instead of the tool's",
        point_frame_0="the linear velocity is that of the point at frame 0's origin instead of the tool's",
        point_world="the linear velocity is that of the point at the world's origin (the spatial Jacobian), "
        "instead of the tool's",
        axes_of_tool="the Jacobian is in the tool's axes instead of the world's",
        axes_of_frame_0="the Jacobian is in frame 0's axes instead of the world's",
    ),
    _mistakes(
        Subject.JACOBIAN,
        COLUMNS,
        lever_not_subtracted="the lever is the tool's position from frame 0: the joint's position is not subtracted",
        lever_own="the lever is frame i's position from frame 0, instead of that from the joint to the tool",
        lever_neighbour="the lever begins at the neighbouring frame: at p_i instead of p_(i-1) (modified: the reverse)",
        axis_neighbour="the axis is that of the neighbouring frame: z_i instead of z_(i-1) (modified: the reverse)",
        axis_unturned="every axis is taken as (0, 0, 1): the joints before do not turn it",
        angular_axes_unturned="every axis in the angular half is taken as (0, 0, 1): the joints before do not turn it",
        cross_product_order="the cross product is lever x axis instead of axis x lever: the linear rows change sign",
        prismatic_as_revolute="a prismatic joint's column is that of a revolute one: it should be (axis; 0)",
        prismatic_angular="a prismatic joint turns the tool: the lower half of its column should be 0",
        revolute_as_prismatic="a revolute joint's column is that of a prismatic one: it should be (axis x lever; axis)",
    ),
)
"""Mistakes in the Jacobian alone."""

KINEMATIC_MISTAKES: Mapping[str, Mistake] = catalogue(
    LINK_MISTAKES.values(), POSE_MISTAKES.values(), JACOBIAN_MISTAKES.values()
)
"""Places where a derivation of transforms and Jacobians goes wrong, by identity."""


@dataclass(frozen=True, eq=False, repr=False)
class TextbookKinematics:
    """A derivation of an arm's forward kinematics and Jacobian, step by step.

    Attributes
    ----------
    arm
        The description in the ring.
    mistakes
        The mistakes that were made.
    """

    arm: ExactArm
    mistakes: frozenset[MadeAt] = field(default=frozenset())

    def __repr__(self) -> str:
        made = ", ".join(sorted(map(str, self.mistakes))) or "no mistakes"
        return repr_line("TextbookKinematics", self.arm.description.name, made)

    @cached_property
    def A(self) -> tuple[Elements, ...]:
        """The link transforms A_1 ... A_n, each of shape (4, 4): frame i in frame i - 1, m."""
        return tuple(self._link(i) for i in range(self.arm.n))

    @cached_property
    def frames(self) -> tuple[Elements, ...]:
        """Frames 0 ... n in the world, each of shape (4, 4), m."""
        order = (
            range(self.arm.n - 1, -1, -1) if self._has("product_reversed") else range(self.arm.n)
        )
        frames = [self.base]
        for i in order:
            frames.append(_product(frames[-1], self.A[i], self._has("translations_unrotated", i)))
        return tuple(frames)

    @cached_property
    def T(self) -> Elements:
        """The tool in the world, shape (4, 4): base A_1 ... A_n tool, m."""
        return inverse(self._pose) if self._has("pose_inverted") else self._pose

    @cached_property
    def J(self) -> Elements:
        """The Jacobian, shape (6, n): linear velocity of the tool's origin, then angular velocity, in world axes."""
        n = self.arm.n
        linear = np.empty((3, n), dtype=object)
        angular = np.empty((3, n), dtype=object)
        for i in range(n):
            linear[:, i], angular[:, i] = self._column(i)

        if self._has("axes_of_tool"):
            R = self._pose[:3, :3]
            linear = R.T @ linear
            angular = R.T @ angular
        if self._has("axes_of_frame_0"):
            R = self.base[:3, :3]
            linear = R.T @ linear
            angular = R.T @ angular
        if self._has("angular_axes_unturned"):
            z = identity(self.arm.ring)[:3, 2:3]
            is_revolute = np.array([kind == "R" for kind in self.arm.ring.kinds], dtype=int)
            angular = z * is_revolute
        if self._has("jacobian_x_y_exchanged"):
            linear = linear[[1, 0, 2]]
        halves = (angular, linear) if self._has("jacobian_halves_exchanged") else (linear, angular)
        return np.concatenate(halves)

    @cached_property
    def base(self) -> Elements:
        """Frame 0 in the world, shape (4, 4), m."""
        if self._has("base_forgotten"):
            return identity(self.arm.ring)
        base = _placement(self.arm, self.arm.description.base.placement)
        return inverse(base) if self._has("base_inverted") else base

    @cached_property
    def tool(self) -> Elements:
        """The tool in frame n, shape (4, 4), m."""
        if self._has("tool_forgotten"):
            return identity(self.arm.ring)
        tool = _placement(self.arm, self.arm.description.tool.placement)
        return inverse(tool) if self._has("tool_inverted") else tool

    @cached_property
    def _pose(self) -> Elements:
        """The tool in the world before it may be inverted by mistake, shape (4, 4), m."""
        return _product(self.frames[-1], self.tool, self._has("translations_unrotated", self.arm.n))

    @property
    def _standard(self) -> bool:
        """Whether the table is read as one of the standard convention."""
        return self.arm.is_standard != self._has("convention_exchanged")

    def _has(self, mistake: str, i: int | None = None) -> bool:
        return has(self.mistakes, mistake, i)

    def _link(self, i: int) -> Elements:
        """Return A_i, i counted from 0, as the product of its four elementary motions."""
        ring = self.arm.ring
        row = self._lengths(i, self._angles(i, self.arm.rows[i]))
        Rz = rotation(ring, 0, 1, row.theta)
        Rx = rotation(ring, 1, 2, row.alpha)
        Tz = translation(ring, 2, row.d)
        Tx = translation(ring, 0, row.a)
        first, last = (Rz, Rx) if self._standard else (Rx, Rz)
        if self._has("rotations_first", i):
            A = first @ last @ Tx @ Tz
        elif self._has("translations_first", i):
            A = Tx @ Tz @ first @ last
        elif self._standard:
            A = Rz @ Tz @ Tx @ Rx
        else:
            A = Rx @ Tx @ Rz @ Tz
        if self._has("rotation_transposed", i):
            A[:3, :3] = A[:3, :3].T.copy()
        return A

    def _lengths(self, i: int, row: ExactRow) -> ExactRow:
        """Return the row with the mistakes in a and d."""
        ring = self.arm.ring
        a = row.a
        d = row.d
        if ring.kinds[i] != "R" and self._has("variable_forgotten", i):
            d = d - ring.position(i)
        if self._has("a_forgotten", i):
            a = ring.zero
        if self._has("d_forgotten", i):
            d = ring.zero if ring.kinds[i] == "R" else ring.position(i)
        if self._has("a_d_exchanged", i):
            return replace(row, a=d, d=a)
        return replace(row, a=a, d=d)

    def _angles(self, i: int, row: ExactRow) -> ExactRow:
        """Return the row with the mistakes in theta and alpha."""
        # Angles are (cosine, sine).
        ring = self.arm.ring
        alpha = row.alpha
        if self._has("alpha_forgotten", i):
            alpha = (ring.one, ring.zero)
        if self._has("alpha_sign", i):
            alpha = _negative(alpha)
        if self._has("alpha_sin_cos", i):
            c, s = alpha
            alpha = (s, c)

        # theta = joint variable + constant offset; the variable of a prismatic joint is not an angle.
        theta = row.theta
        variable = (ring.cosine(i), ring.sine(i)) if ring.kinds[i] == "R" else (ring.one, ring.zero)
        offset = difference_of_angles(theta, variable)
        if self._has("theta_offset_forgotten", i):
            theta = variable
        if self._has("theta_offset_sign", i):
            theta = difference_of_angles(variable, offset)
        if self._has("variable_forgotten", i):
            theta = offset
        if self._has("theta_sign", i):
            theta = _negative(theta)

        # cos(x +- 90 deg) = -+sin x, sin(x +- 90 deg) = +-cos x
        c, s = theta
        if self._has("theta_quarter_more", i):
            c, s = (-s, c)
        if self._has("theta_quarter_less", i):
            c, s = (s, -c)
        if self._has("theta_sin_cos", i):
            c, s = (s, c)
        return replace(row, alpha=alpha, theta=(c, s))

    def _column(self, i: int) -> tuple[Elements, Elements]:
        """Return the linear and the angular half of column i, counted from 0, shape (3,) each."""
        # Revolute: (z x lever; z). Prismatic: (z; 0).
        z = self._axis(i)
        zero = np.array([self.arm.ring.zero] * 3, dtype=object)
        is_prismatic = self.arm.ring.kinds[i] != "R"
        if is_prismatic and not self._has("prismatic_as_revolute"):
            return z, z if self._has("prismatic_angular") else zero
        if not is_prismatic and self._has("revolute_as_prismatic"):
            return z, zero
        linear = np.cross(z, self._lever(i))
        if self._has("cross_product_order"):
            linear = -linear
        return linear, z

    def _axis(self, i: int) -> Elements:
        """Return the direction of joint i's axis in the world, shape (3,)."""
        if self._has("axis_unturned"):
            return identity(self.arm.ring)[:3, 2]
        own, neighbour = (i, i + 1) if self._standard else (i + 1, i)
        return self.frames[neighbour if self._has("axis_neighbour") else own][:3, 2]

    def _lever(self, i: int) -> Elements:
        """Return the vector from joint i to the tool's origin, in world axes, shape (3,), m."""
        places = [frame[:3, 3] for frame in self.frames]
        own, neighbour = (i, i + 1) if self._standard else (i + 1, i)
        if self._has("lever_own"):
            return places[i + 1] - places[0]
        point = self._pose[:3, 3]
        if self._has("point_frame_n"):
            point = places[-1]
        if self._has("point_frame_0"):
            point = places[0]
        if self._has("point_world"):
            point = point - point
        if self._has("lever_not_subtracted"):
            return point - places[0]
        return point - places[neighbour if self._has("lever_neighbour") else own]


def derive_kinematics(
    description: Description,
    mistakes: Iterable[MadeAt | str] = frozenset(),
    symbols: Symbols = "file",
) -> TextbookKinematics:
    """Derive an arm's link transforms, the pose of its tool and its Jacobian as a textbook does.

    The ring is that of the dynamics, :func:`dhkit.symbolic.exact_arm` of ``description`` and ``symbols``, unless the
    tool's angles need constants that it has not.

    Parameters
    ----------
    description
        The robot; links may lack bodies.
    mistakes
        Mistakes of :data:`KINEMATIC_MISTAKES`, by identity where they are made throughout; those of
        :data:`LINK_MISTAKES` at one link as ``MadeAt(identity, link)``; ``translations_unrotated`` at link n + 1 is
        that of the tool.
    symbols
        See :func:`dhkit.symbolic.exact_arm`.

    Raises
    ------
    ValueError
        No such mistake, no such link, or a link given for a mistake that concerns the whole arm.
    TypeError
        A mistake is neither a name nor a :class:`~dhkit.symbolic.mistakes.MadeAt`.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> print(derive_kinematics(arm).T[0, 3])
    l1*c1 + l2*(c1*c2 - s1*s2)
    >>> print(derive_kinematics(arm, {"translations_unrotated"}).T[0, 3])
    l1*c1 + l2*c2
    """
    made = made_at(mistakes)
    for mistake in made:
        _check_kinematic_mistake(mistake, description.n)
    return TextbookKinematics(_arm_with_tool(with_massless_links(description), symbols), made)


def with_massless_links(description: Description) -> Description:
    """Return a description with massless bodies on links that have none; the same one if no link needs one.

    The exact arm, which dynamics use too, needs a body on every link; kinematics do not.
    """
    if all(joint.bodies for joint in description.joints):
        return description
    massless = Body(ZERO)
    joints = tuple(
        joint if joint.bodies else replace(joint, bodies=(massless,))
        for joint in description.joints
    )
    return replace(description, joints=joints)


def _check_kinematic_mistake(made: object, n: int) -> None:
    """Check that a mistake is in :data:`KINEMATIC_MISTAKES` and is made at a link of an arm of n joints.

    Raises
    ------
    TypeError
        Not a :class:`~dhkit.symbolic.mistakes.MadeAt`.
    ValueError
        No such mistake, no such link, or a link given for a mistake that concerns the whole arm.
    """
    of_tool = isinstance(made, MadeAt) and made.identity == "translations_unrotated"
    check_mistake(made, n + of_tool, KINEMATIC_MISTAKES)
    if isinstance(made, MadeAt) and made.link is not None and made.identity not in LINK_MISTAKES:
        raise ValueError(f"mistake {made.identity!r} concerns the whole arm, no single link")


def _arm_with_tool(description: Description, symbols: Symbols) -> ExactArm:
    """Return the exact arm; its ring contains the constants of the tool's angles too."""
    arm = exact_arm(description, symbols)
    try:
        _placement(arm, description.tool.placement)
    except RingError:
        needed: list[Expression] = []
        for angle in _known_angles(arm, description.tool.placement):
            needed += [cos(angle), sin(angle)]
        return exact_arm(description, symbols, tuple(needed))
    return arm


def _known_angles(arm: ExactArm, placement: Placement) -> list[Expression]:
    """Return roll, pitch and yaw in the symbols that the arm keeps."""
    naming = Naming(arm.description, arm.symbols)
    return [exact_angle(naming.known(x)) for x in placement.rpy]


def _placement(arm: ExactArm, placement: Placement) -> Elements:
    """Return a placement's matrix, shape (4, 4): Rz(yaw) Ry(pitch) Rx(roll), then the origin."""
    ring = arm.ring
    naming = Naming(arm.description, arm.symbols)
    roll, pitch, yaw = (ring.direction(angle) for angle in _known_angles(arm, placement))
    T: Elements = (
        rotation(ring, 0, 1, yaw) @ rotation(ring, 2, 0, pitch) @ rotation(ring, 1, 2, roll)
    )
    T[:3, 3] = [ring.read(naming.known(x)) for x in placement.xyz]
    return T


def _product(first: Elements, second: Elements, unrotated: bool) -> Elements:
    """Return the product of two transforms; ``unrotated`` is the mistake of not rotating the second's origin."""
    product: Elements = first @ second
    if unrotated:
        product[:3, 3] = first[:3, 3] + second[:3, 3]
    return product


def _negative(direction: Direction) -> Direction:
    """Return cosine and sine of the negative of an angle."""
    c, s = direction
    return c, -s
