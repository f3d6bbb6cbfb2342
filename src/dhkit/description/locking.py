"""Joints locked in place: a shorter arm with a table of its own, the same motion and the same masses.

Between the axes of the joints before and after it, the locked row A_i(q_i) is part of a fixed transform,

    standard:  Y = Tx(a) Rx(alpha) of the row before, times A_i;    modified:  Y = A_i times Tx(a) Rx(alpha) of the row
    after.

Written as Y = Rz(beta) Tz(epsilon) Tx(a) Rx(alpha) Rz(gamma) Tz(delta), it is again a part of a row: rotations about
and shifts along a joint's own axis commute with the joint, so that beta and epsilon are added to theta and d of the row
before, gamma and delta to those of the row after. This is the common normal of the two axes, computed from Y's entries
(Denavit & Hartenberg 1955).
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np

from dhkit.description.bodies import Body, ExactPose, joined, moved_body
from dhkit.description.exact_poses import (
    fixed_row,
    identity,
    inverse,
    moved,
    placement_of,
    pose_of,
    rotation_x,
    rotation_z,
    translation,
)
from dhkit.description.named import Named
from dhkit.description.parameters import needs, resolved
from dhkit.description.robot import Description, takes_robot
from dhkit.description.table_rows import Quantity, quantity
from dhkit.description.traversal import expressions_in, names_in, with_values
from dhkit.description.values import ONE, Base, Convention, Joint, Shape, Tool
from dhkit.errors import DescriptionError, ExpressionError
from dhkit.expressions import (
    PI,
    ZERO,
    Budget,
    Expression,
    arc_tangent,
    exact_angle,
    parse,
    settled,
    sqrt,
    substitute,
)

log = logging.getLogger(__name__)

_LOCKING_BUDGET = 300_000
"""Steps of exact arithmetic, about a second, after which an arm with symbols is locked with numbers instead."""
_READING_BUDGET = 80_000
"""Steps that reading a locked arm's symbols back may take: a share of a robot file's budget."""
_PARALLEL_SINE = 1e-10
"""Two axes count as parallel if the sine of the angle between them is below this number."""

_LinkBodies: TypeAlias = tuple[Body | None, ...]
"""Bodies of one link, in its frame; None stands for a joined link without a body."""


class _ArmParts(NamedTuple):
    """The parts of an arm that locking a joint changes."""

    base: Base
    joints: tuple[Joint, ...]
    """The joints; their own bodies are out of date, ``bodies`` counts."""
    tool: Tool
    bodies: tuple[_LinkBodies, ...]
    """The bodies of each link, the base first; they are joined in one step at the end."""


class _Row(NamedTuple):
    """Y = Rz(beta) Tz(epsilon) Tx(a) Rx(alpha) Rz(gamma) Tz(delta); rad and m."""

    beta: Expression
    epsilon: Expression
    a: Expression
    alpha: Expression
    gamma: Expression
    delta: Expression


@takes_robot
def lock(description: Description, joints: Mapping[int | str, Quantity]) -> Description:
    """Return the arm with some joints locked, their links joined to the link before, or to the base.

    Every remaining joint keeps its zero, limits and drive; configurations lose the locked entries. The drives of
    locked joints are removed, and their couplings: a rotor that also turns with another joint is part of that joint's
    link (:class:`dhkit.description.values.Coupling`). If a link has no body, the joined link has none either; but the
    base, which does not move, has those bodies of the links joined to it that there are.

    Lengths and masses that are parameters stay parameters. Parameters that determine angles of the locked rows are
    replaced by their numbers, everywhere in the arm, since the new row's form depends on them; all parameters are,
    if the new expressions would be longer than a robot file may hold.

    Parameters
    ----------
    description
        The arm.
    joints
        The value at which each joint is locked, rad or m, by the joint's place from 0 or by its name.

    Returns
    -------
    Description
        An arm of fewer joints, whose poses and torques are those of the arm with these joints held.

    Raises
    ------
    DescriptionError
        No such joint, one named twice, or none left to move.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("puma560")
    >>> wrist = lock(arm, {0: 0.0, 1: 0.0, "elbow": 0.0})
    >>> wrist.n, [joint.name for joint in wrist.joints]
    (3, ['wrist_roll', 'wrist_pitch', 'flange_roll'])
    """
    locked = _locked_places(description, joints)
    if len(locked) == description.n:
        raise DescriptionError(f"all {description.n} joints locked; expected one left to move")
    description, locked = _with_numbers(description, locked, _angle_names(description, locked))
    try:
        with Budget(_LOCKING_BUDGET):
            shorter = _lock_all(description, locked)
        with Budget(_READING_BUDGET):
            # What reading the arm's file would do, to see whether the arm fits into a file's budget.
            for expression in expressions_in(shorter):
                if expression.symbols:
                    parse(expression.text, shorter.parameters)
            replace(shorter)  # runs the checks of a description
        return shorter
    except ExpressionError:
        log.debug("%s: the budget of exact arithmetic is spent", description.name)
    except DescriptionError as error:
        # The check of the new description may have spent the reading budget, which it reports so; a real fault is
        # raised again below.
        log.debug("%s: %s", description.name, error)
    names = names_in((description.base, description.joints, description.tool)) | names_in(
        tuple(locked.values())
    )
    log.info(
        "%s: locked as numbers, since %s would make long expressions",
        description.name,
        ", ".join(sorted(names)),
    )
    try:
        return _lock_all(*_with_numbers(description, locked, names))
    except ExpressionError as error:
        raise DescriptionError(f"{description.name} cannot be locked: {error}") from None


def _locked_places(
    description: Description, joints: Mapping[int | str, Quantity]
) -> dict[int, Expression]:
    """Return the value of each locked joint, rad or m, by its place from 0."""
    if not isinstance(joints, Mapping):
        raise DescriptionError(
            f"lock: found {type(joints).__name__}; expected joints with where, such as {{3: 0.0}}"
        )
    names = [joint.name for joint in description.joints]
    locked: dict[int, Expression] = {}
    for key, value in joints.items():
        if isinstance(key, str) and key in names:
            place = names.index(key)
        elif (
            isinstance(key, (int, np.integer))
            and not isinstance(key, bool)
            and 0 <= key < description.n
        ):
            place = int(key)
        else:
            raise DescriptionError(
                f"lock: no joint {key!r}; expected 0 to {description.n - 1} or one of {', '.join(names)}"
            )
        if place in locked:
            raise DescriptionError(f"lock: joint {place} ({names[place]}) given twice")
        q = quantity(f"lock: joint {place} ({names[place]})", value, description.parameters)
        locked[place] = exact_angle(q) if description.joints[place].is_revolute else q
    return locked


def _angle_names(description: Description, locked: Mapping[int, Expression]) -> frozenset[str]:
    """Return the parameters that determine angles of base, tool, locked rows and their neighbours."""
    names = names_in((description.base.placement.rpy, description.tool.placement.rpy))
    for place, q in locked.items():
        joint = description.joints[place]
        rows = description.joints[max(place - 1, 0) : place + 2]  # with one on either side
        names |= names_in(tuple(row.alpha for row in rows)) | joint.theta.symbols
        names |= q.symbols if joint.is_revolute else frozenset()
    return names


def _with_numbers(
    description: Description, locked: Mapping[int, Expression], names: frozenset[str]
) -> tuple[Description, dict[int, Expression]]:
    """Replace parameters by their numbers everywhere, with all that their values contain and all that contain them."""
    parameters = description.parameters
    values = resolved(description.parameters)
    # Parameters in the value of a replaced one, and those computed from it, may not change on their own any more.
    previous = frozenset[str]()
    while names != previous:
        previous = names
        names |= {name for name in values if needs(name, parameters) & names}
        names = names.union(*(needs(name, parameters) for name in names))
    # All parameters as numbers first, so that no value of one that remains contains one that goes.
    known = {name: values[name] for name in names}
    remaining = Named({name: value for name, value in parameters.items() if name not in known})
    fixed = with_values(replace(description, parameters=Named(values)), known)
    return replace(fixed, parameters=remaining), {
        place: substitute(q, known) for place, q in locked.items()
    }


def _lock_all(description: Description, locked: Mapping[int, Expression]) -> Description:
    """Lock joints one by one: those next to the base outwards, the others from the tip inwards.

    A joint next to the base becomes part of the base's placement, without a common normal. From the tip inwards it
    would first join the link before, by the common normal of two axes, which costs digits where these are parallel
    to a few digits.
    """
    bodies = tuple(joint.bodies or (None,) for joint in description.joints)
    base: _LinkBodies = (description.base.body,) if description.base.body is not None else ()
    chain = _ArmParts(description.base, description.joints, description.tool, (base, *bodies))
    values = resolved(description.parameters)
    first = next(place for place in range(description.n + 1) if place not in locked)
    inwards = sorted((place for place in locked if place > first), reverse=True)
    for place in range(first):
        # Those before it are gone.
        chain = _lock_one(chain, description.convention, 0, locked[place], values)
    for place in inwards:
        chain = _lock_one(chain, description.convention, place - first, locked[place], values)
    moving = [i for i in range(description.n) if i not in locked]
    new_numbers = {i + 1: k for k, i in enumerate(moving, start=1)}  # couplings count joints from 1
    on_base = [body for body in chain.bodies[0] if body is not None]
    configurations = {}
    for name, q in description.configurations.items():
        configurations[name] = tuple(q[i] for i in moving)
    return replace(
        description,
        base=replace(chain.base, body=joined(on_base) if on_base else None),
        joints=tuple(
            replace(joint, bodies=_link_bodies(joint, parts))
            for joint, parts in zip(chain.joints, chain.bodies[1:], strict=True)
        ),
        tool=chain.tool,
        couplings=tuple(
            replace(
                coupling, joints=(new_numbers[coupling.joints[0]], new_numbers[coupling.joints[1]])
            )
            for coupling in description.couplings
            if new_numbers.keys() >= set(coupling.joints)
        ),
        configurations=Named(configurations),
    )


def _link_bodies(joint: Joint, parts: _LinkBodies) -> tuple[Body, ...]:
    """Return the bodies of a link: its own if no other link was joined to it, otherwise all joined to one."""
    if parts == joint.bodies:
        return joint.bodies
    return () if None in parts else (joined([part for part in parts if part is not None]),)


def _lock_one(
    chain: _ArmParts,
    convention: Convention,
    place: int,
    q: Expression,
    values: Mapping[str, Expression],
) -> _ArmParts:
    """Lock the joint at a place: the first joins the base, the last the tool, others the link before."""
    row = fixed_row(chain.joints[place], convention, q)
    if place == 0:
        return _join_base(chain, row)
    if place == len(chain.joints) - 1:
        return _join_tool(chain, row)
    return _join_link_before(chain, convention, place, row, values)


def _join_base(chain: _ArmParts, row: ExactPose) -> _ArmParts:
    """Make frame 1 the new frame 0."""
    # T_world_1 = T_world_0 A_1; what is fixed to frame 0 moves into frame 1 by A_1^-1.
    T_new_old = inverse(row)
    placement = placement_of(pose_of(chain.base.placement) @ row)
    shapes = _joined_shapes(_moved_shapes(chain.base.shapes, T_new_old), chain.joints[0].shapes)
    on_base = _moved_bodies(chain.bodies[0], T_new_old) + chain.bodies[1]
    return _ArmParts(
        Base(placement, shapes), chain.joints[1:], chain.tool, (on_base, *chain.bodies[2:])
    )


def _join_tool(chain: _ArmParts, row: ExactPose) -> _ArmParts:
    """Make the last link part of the one before, and its row part of the tool's placement."""
    # T_(n-1)_tool = A_n T_n_tool; what is fixed to frame n moves into frame n - 1 by A_n.
    *others, before, last = chain.joints
    *other_bodies, own_bodies, last_bodies = chain.bodies
    tool = Tool(placement_of(row @ pose_of(chain.tool.placement)), chain.tool.shapes)
    joints = (*others, _with_shapes_of(before, last, identity(), row))
    return _ArmParts(
        chain.base, joints, tool, (*other_bodies, own_bodies + _moved_bodies(last_bodies, row))
    )


def _join_link_before(
    chain: _ArmParts,
    convention: Convention,
    place: int,
    row: ExactPose,
    values: Mapping[str, Expression],
) -> _ArmParts:
    """Make the locked link part of the one before, and the locked row part of the two neighbouring rows."""
    before, locked, after = chain.joints[place - 1 : place + 2]
    if convention is Convention.STANDARD:
        normal = _common_normal(translation(x=before.a) @ rotation_x(before.alpha) @ row, values)
        # The new frame stands after a and alpha in Y, and the locked one at its end, so that
        # T_new_locked = Rz(gamma) Tz(delta) and T_new_before = T_new_locked A_i^-1.
        T_new_before = rotation_z(normal.gamma) @ translation(z=normal.delta) @ inverse(row)
        before = replace(before, a=normal.a, alpha=normal.alpha)
    else:
        normal = _common_normal(row @ translation(x=after.a) @ rotation_x(after.alpha), values)
        # The frame before stands at the beginning of Y, the new one after beta and epsilon.
        T_new_before = inverse(rotation_z(normal.beta) @ translation(z=normal.epsilon))
        after = replace(after, a=normal.a, alpha=normal.alpha)
    T_new_locked = T_new_before @ row
    joined_link = _with_shapes_of(before, locked, T_new_before, T_new_locked)
    before = _screw_about_axis(joined_link, normal.beta, normal.epsilon)
    after = _screw_about_axis(after, normal.gamma, normal.delta)
    own_bodies = _moved_bodies(chain.bodies[place], T_new_before)
    bodies = own_bodies + _moved_bodies(chain.bodies[place + 1], T_new_locked)
    return _ArmParts(
        chain.base,
        (*chain.joints[: place - 1], before, after, *chain.joints[place + 2 :]),
        chain.tool,
        (*chain.bodies[:place], bodies, *chain.bodies[place + 2 :]),
    )


def _with_shapes_of(
    before: Joint, locked: Joint, T_new_before: ExactPose, T_new_locked: ExactPose
) -> Joint:
    """Return the link before with the locked link's shapes, both moved into the new frame."""
    shapes = _joined_shapes(
        _moved_shapes(before.shapes, T_new_before), _moved_shapes(locked.shapes, T_new_locked)
    )
    assumed = before.assumed
    if "body" in locked.assumed and "body" not in assumed:
        assumed = (*assumed, "body")
    return replace(before, shapes=shapes, assumed=assumed)


def _joined_shapes(before: tuple[Shape, ...], locked: tuple[Shape, ...]) -> tuple[Shape, ...]:
    """Return the shapes of a link and of one that is locked to it, whose ``body`` numbers continue those before."""
    count = 1 + max((shape.body for shape in before), default=0)
    return before + tuple(replace(shape, body=count + shape.body) for shape in locked)


def _moved_bodies(bodies: _LinkBodies, T: ExactPose) -> _LinkBodies:
    return tuple(None if body is None else moved_body(body, T) for body in bodies)


def _moved_shapes(shapes: tuple[Shape, ...], T: ExactPose) -> tuple[Shape, ...]:
    return tuple(replace(shape, frame=moved(shape.frame, T)) for shape in shapes)


def _screw_about_axis(joint: Joint, angle: Expression, shift: Expression) -> Joint:
    """Return a row rotated about its own joint's axis by an angle, rad, and shifted along it, m."""
    return replace(
        joint,
        theta=exact_angle(settled(joint.theta + angle, angle=True)),
        d=settled(joint.d + shift),
    )


def _common_normal(Y: ExactPose, values: Mapping[str, Expression]) -> _Row:
    """Write a fixed transform as a row; see the module's docstring."""

    def number(x: Expression) -> float:
        return float(substitute(x, values))

    if math.hypot(number(Y[0, 2]), number(Y[1, 2])) < _PARALLEL_SINE:
        row = _parallel_axes_row(Y, is_opposite=number(Y[2, 2]) < 0)
    else:
        row = _nonparallel_axes_row(Y, number)
    angles = ("beta", "alpha", "gamma")
    return _Row(*(settled(value, angle=name in angles) for name, value in row._asdict().items()))


def _parallel_axes_row(Y: ExactPose, is_opposite: bool) -> _Row:
    """Return the row of axes in equal or opposite directions, by the normal through the origin of the second frame.

    The angle between them is taken to be exactly 0 or pi, which moves a point 1 m away by up to 1e-10 m.
    """
    # delta = 0 and epsilon = z. The normal points to (x, y): a (cos(beta), sin(beta)) = (x, y). If x or y is 0, beta is
    # pi/2 or 0, and a, of either sign, is the other one. Y rotates x by beta + gamma if the axes point alike, by
    # beta - gamma if they are opposite.
    x, y, z = Y[:3, 3]
    turn = arc_tangent(Y[1, 0], Y[0, 0])
    if y.is_zero:
        beta = ZERO
        a = x
    elif x.is_zero:
        beta = PI / 2
        a = y
    else:
        beta = arc_tangent(y, x)
        a = sqrt(x * x + y * y)
    alpha = PI if is_opposite else ZERO
    gamma = beta - turn if is_opposite else turn - beta
    return _Row(beta, z, a, alpha, gamma, ZERO)


def _nonparallel_axes_row(Y: ExactPose, number: Callable[[Expression], float]) -> _Row:
    """Return the row of skew or intersecting axes: angles from Y's rotation; a, delta and epsilon from its position."""
    # The second axis (u, v, w) is perpendicular to the normal (cos beta, sin beta, 0), so
    #     (u, v) = sin(alpha) (sin beta, -cos beta),    w = cos(alpha).
    x, y, z = Y[:3, 3]
    u, v, w = Y[:3, 2]
    if u.is_zero:
        beta = ZERO
        cos_beta = ONE
        sin_beta = ZERO
        sin_alpha = -v
    elif v.is_zero:
        beta = PI / 2
        cos_beta = ZERO
        sin_beta = ONE
        sin_alpha = u
    else:
        beta = arc_tangent(u, -v)
        sin_alpha = sqrt(u * u + v * v)
        cos_beta = -v / sin_alpha
        sin_beta = u / sin_alpha

    # Y's position is a (cos(beta), sin(beta), 0) + epsilon (0, 0, 1) + delta (u, v, w), so
    #     x sin(beta) - y cos(beta) = delta sin(alpha),    x cos(beta) + y sin(beta) = a,    z = epsilon + delta w.
    delta = (x * sin_beta - y * cos_beta) / sin_alpha
    a = x * cos_beta + y * sin_beta

    # Row z of Y is (sin(alpha) sin(gamma), sin(alpha) cos(gamma), cos(alpha)); times the sign of
    # sin(alpha), the first two have the arc tangent gamma.
    sign = -1 if number(sin_alpha) < 0 else 1
    gamma = arc_tangent(Y[2, 0] * sign, Y[2, 1] * sign)
    return _Row(beta, z - delta * w, a, arc_tangent(sin_alpha, w), gamma, delta)
