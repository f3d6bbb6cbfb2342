"""Joints frozen in place: a shorter arm with a table of its own, the same motion and the same masses.

Between two moving joints the frozen row is a fixed transform Y. Written as

    Y = Rz(beta) Tz(epsilon) Tx(a) Rx(alpha) Rz(gamma) Tz(delta)

it is again a row: turns and shifts about a joint's own axis commute with the joint and go into its theta and d. This is
the common normal of the two axes, found from Y's entries (Denavit & Hartenberg 1955).
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

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
from dhkit.description.values import Base, Convention, Joint, Shape, Tool
from dhkit.errors import DescriptionError, ExpressionError
from dhkit.expressions import (
    PI,
    ZERO,
    Budget,
    Expression,
    arc_tangent,
    cos,
    exact_angle,
    parse,
    settled,
    sin,
    sqrt,
    substitute,
)

log = logging.getLogger(__name__)

WORK = 300_000
"""Of exact arithmetic, about a second: beyond it an arm of symbols is locked as numbers."""
READABLE = 80_000
"""Of a robot file's budget: what a locked arm of symbols may take to be read back."""
PARALLEL = 1e-10
"""Sine of the angle between two axes below which they count as parallel: a row of the table cannot say it better."""


class _Chain(NamedTuple):
    """What freezing a joint changes."""

    base: Base
    joints: tuple[Joint, ...]
    """Their bodies are not theirs any more: see ``bodies``."""
    tool: Tool
    bodies: tuple[tuple[Body | None, ...], ...]
    """What each link carries, the base first, in its frame; joined at the end, all at once."""


class _Row(NamedTuple):
    """Y = Rz(beta) Tz(epsilon) Tx(a) Rx(alpha) Rz(gamma) Tz(delta)."""

    beta: Expression
    epsilon: Expression
    a: Expression
    alpha: Expression
    gamma: Expression
    delta: Expression


@takes_robot
def lock(description: Description, joints: Mapping[int | str, Quantity]) -> Description:
    """Return the arm with some joints frozen, their links joined to the link before, or to the base.

    Every remaining joint keeps its zero, limits and drive; configurations lose the frozen entries. The drives of
    frozen joints go: their rotors stand still. A link without a body makes the joined link one without.

    Lengths and masses that are parameters stay parameters. Those that decide angles of the frozen rows become the
    numbers that they are, everywhere in the arm, since the new row's form depends on them; so do all, where the new
    expressions would be longer than a robot file carries.

    Parameters
    ----------
    joints
        Where each is frozen, rad or m; by place from 0, or by name.

    Raises
    ------
    DescriptionError
        No such joint, one named twice, or none left to move.
    """
    held = _places(description, joints)
    if len(held) == description.n:
        raise DescriptionError(f"all {description.n} joints locked; expected one left to move")
    description, held = _decided(description, held)
    try:
        with Budget(WORK):
            locked = _locked(description, held)
        with Budget(READABLE):
            _read_again(locked)
        return locked
    except ExpressionError:
        pass
    except DescriptionError as error:
        # The check of the new description ran out of the same budget; a fault of its own shows again below.
        log.debug("%s: %s", description.name, error)
    names = names_in((description.base, description.joints, description.tool)) | names_in(tuple(held.values()))
    log.info("%s: locked as numbers, since %s would make long expressions", description.name, ", ".join(sorted(names)))
    try:
        return _locked(*_settled(description, held, names))
    except ExpressionError as error:
        raise DescriptionError(f"{description.name} cannot be locked: {error}") from None


def _read_again(locked: Description) -> None:
    """Do what reading the arm's file would, to see whether it fits into a file's budget."""
    for expression in expressions_in(locked):
        if expression.symbols:
            parse(expression.text, locked.parameters)
    replace(locked)


def _decided(description: Description, held: dict[int, Expression]) -> tuple[Description, dict[int, Expression]]:
    """Put numbers for the parameters that the frozen rows' and their neighbours' angles depend on."""
    names = names_in((description.base.placement.rpy, description.tool.placement.rpy))
    for place, q in held.items():
        around = description.joints[max(place - 1, 0) : place + 2]
        names |= names_in(tuple(joint.alpha for joint in around)) | description.joints[place].theta.symbols
        names |= q.symbols if description.joints[place].is_revolute else frozenset()
    return _settled(description, held, names)


def _settled(
    description: Description, held: dict[int, Expression], names: frozenset[str]
) -> tuple[Description, dict[int, Expression]]:
    """Put numbers for some parameters, and for those that depend on each other with them, everywhere."""
    values = resolved(description.parameters)
    # Neither what a settled parameter is made of nor what is made of it may change on its own any more.
    grown, before = names, frozenset[str]()
    while grown != before:
        before = grown
        grown |= {name for name in values if needs(name, description.parameters) & grown}
        grown |= {other for name in grown for other in needs(name, description.parameters)}
    known = {name: values[name] for name in grown}
    rest = Named({name: value for name, value in description.parameters.items() if name not in known})
    fixed = with_values(replace(description, parameters=Named(values)), known)
    return replace(fixed, parameters=rest), {place: substitute(q, known) for place, q in held.items()}


def _locked(description: Description, held: dict[int, Expression]) -> Description:
    """Freeze joints one by one: those at the base from there on, the others from the tip on.

    So no common normal is taken of two axes of which one goes into the base: nearly parallel ones would cost digits.
    """
    bodies = tuple(joint.bodies or (None,) for joint in description.joints)
    base: tuple[Body | None, ...] = (description.base.body,) if description.base.body is not None else ()
    chain = _Chain(description.base, description.joints, description.tool, (base, *bodies))
    values = resolved(description.parameters)
    first = next(place for place in range(description.n + 1) if place not in held)
    for place in range(first):
        chain = _without(chain, description.convention, 0, held[place], values)
    for place in sorted((place for place in held if place > first), reverse=True):
        chain = _without(chain, description.convention, place - first, held[place], values)
    kept = [i for i in range(description.n) if i not in held]
    configurations = Named({name: tuple(q[i] for i in kept) for name, q in description.configurations.items()})
    on_base = [body for body in chain.bodies[0] if body is not None]
    joints = tuple(
        replace(joint, bodies=_link_bodies(joint, parts))
        for joint, parts in zip(chain.joints, chain.bodies[1:], strict=True)
    )
    return replace(
        description,
        base=replace(chain.base, body=joined(on_base) if on_base else None),
        joints=joints,
        tool=chain.tool,
        configurations=configurations,
    )


def _link_bodies(joint: Joint, parts: tuple[Body | None, ...]) -> tuple[Body, ...]:
    """Return the bodies of a link: its own where no other link was joined to it, otherwise all as one."""
    if parts == joint.bodies:
        return joint.bodies
    return () if None in parts else (joined([part for part in parts if part is not None]),)


def _places(description: Description, joints: Mapping[int | str, Quantity]) -> dict[int, Expression]:
    if not isinstance(joints, Mapping):
        raise DescriptionError(f"lock: found {type(joints).__name__}; expected joints with where, such as {{3: 0.0}}")
    names = [joint.name for joint in description.joints]
    places: dict[int, Expression] = {}
    for key, value in joints.items():
        if isinstance(key, str) and key in names:
            place = names.index(key)
        elif isinstance(key, (int, np.integer)) and not isinstance(key, bool) and 0 <= key < description.n:
            place = int(key)
        else:
            raise DescriptionError(
                f"lock: no joint {key!r}; expected 0 to {description.n - 1} or one of {', '.join(names)}"
            )
        if place in places:
            raise DescriptionError(f"lock: joint {place} ({names[place]}) given twice")
        q = quantity(f"lock: joint {place} ({names[place]})", value, description.parameters)
        places[place] = exact_angle(q) if description.joints[place].is_revolute else q
    return places


def _without(
    chain: _Chain, convention: Convention, place: int, q: Expression, values: Mapping[str, Expression]
) -> _Chain:
    """Freeze the joint at one place."""
    row = fixed_row(chain.joints[place], convention, q)
    if place == 0:
        return _onto_base(chain, row)
    if place == len(chain.joints) - 1:
        return _onto_tool(chain, row)
    return _between(chain, convention, place, row, values)


def _onto_base(chain: _Chain, row: ExactPose) -> _Chain:
    """Make frame 1 the new frame 0."""
    base, first = chain.base, chain.joints[0]
    back = inverse(row)
    placement = placement_of(pose_of(base.placement) @ row)
    held = _moved_bodies(chain.bodies[0], back) + chain.bodies[1]
    return _Chain(
        Base(placement, _moved_shapes(base.shapes, back) + first.shapes),
        chain.joints[1:],
        chain.tool,
        (held, *chain.bodies[2:]),
    )


def _onto_tool(chain: _Chain, row: ExactPose) -> _Chain:
    """Make the last link part of the one before, and its row part of the tool's placement."""
    *others, before, last = chain.joints
    placement = placement_of(row @ pose_of(chain.tool.placement))
    carrying = _carrying(before, last, identity(), row)
    *bodies, held, own = chain.bodies
    return _Chain(
        chain.base,
        (*others, carrying),
        Tool(placement, chain.tool.shapes),
        (*bodies, held + _moved_bodies(own, row)),
    )


def _between(
    chain: _Chain, convention: Convention, place: int, row: ExactPose, values: Mapping[str, Expression]
) -> _Chain:
    before, frozen, after = chain.joints[place - 1 : place + 2]
    if convention is Convention.STANDARD:
        own = translation(x=before.a) @ rotation_x(before.alpha)
        new = _common_normal(own @ row, values)
        # What is right of the new row's a and alpha in Y: the shortest way from the frozen frame to the new one.
        to_new = rotation_z(new.gamma) @ translation(z=new.delta) @ inverse(row)
        before = replace(before, a=new.a, alpha=new.alpha)
    else:
        new = _common_normal(row @ translation(x=after.a) @ rotation_x(after.alpha), values)
        to_new = inverse(rotation_z(new.beta) @ translation(z=new.epsilon))
        after = replace(after, a=new.a, alpha=new.alpha)
    before = _turned(_carrying(before, frozen, to_new, to_new @ row), new.beta, new.epsilon)
    after = _turned(after, new.gamma, new.delta)
    held = _moved_bodies(chain.bodies[place], to_new) + _moved_bodies(chain.bodies[place + 1], to_new @ row)
    return _Chain(
        chain.base,
        (*chain.joints[: place - 1], before, after, *chain.joints[place + 2 :]),
        chain.tool,
        (*chain.bodies[:place], held, *chain.bodies[place + 2 :]),
    )


def _carrying(before: Joint, frozen: Joint, T_new_before: ExactPose, T_new_frozen: ExactPose) -> Joint:
    """Give the link before the frozen link's shapes, both put into the new frame."""
    shapes = _moved_shapes(before.shapes, T_new_before) + _moved_shapes(frozen.shapes, T_new_frozen)
    assumed = tuple(dict.fromkeys(before.assumed + ("body",) * ("body" in frozen.assumed)))
    return replace(before, shapes=shapes, assumed=assumed)


def _moved_bodies(bodies: tuple[Body | None, ...], T: ExactPose) -> tuple[Body | None, ...]:
    return tuple(None if body is None else moved_body(body, T) for body in bodies)


def _moved_shapes(shapes: tuple[Shape, ...], T: ExactPose) -> tuple[Shape, ...]:
    return tuple(replace(shape, placement=moved(shape.placement, T)) for shape in shapes)


def _turned(joint: Joint, angle: Expression, shift: Expression) -> Joint:
    """Turn and shift a row about its own joint's axis."""
    return replace(joint, theta=exact_angle(settled(joint.theta + angle, angle=True)), d=settled(joint.d + shift))


def _common_normal(Y: ExactPose, values: Mapping[str, Expression]) -> _Row:
    """Write a fixed transform as a row; see the module's docstring."""

    def size(x: Expression) -> float:
        return float(substitute(x, values))

    if math.hypot(size(Y[0, 2]), size(Y[1, 2])) < PARALLEL:
        row = _parallel(Y, opposite=size(Y[2, 2]) < 0)
    else:
        row = _skew(Y, size)
    beta, epsilon, a, alpha, gamma, delta = row
    return _Row(
        settled(beta, angle=True),
        settled(epsilon),
        settled(a),
        settled(alpha, angle=True),
        settled(gamma, angle=True),
        settled(delta),
    )


def _parallel(Y: ExactPose, opposite: bool) -> _Row:
    """Axes that point along each other: the normal is taken through the first joint's frame."""
    x, y, z = Y[:3, 3]
    turn = arc_tangent(Y[1, 0], Y[0, 0])
    if y.is_zero:
        beta, a = ZERO, x
    elif x.is_zero:
        beta, a = PI / 2, y
    else:
        beta, a = arc_tangent(y, x), sqrt(x * x + y * y)
    return _Row(beta, z, a, PI if opposite else ZERO, beta - turn if opposite else turn - beta, ZERO)


def _skew(Y: ExactPose, size: Callable[[Expression], float]) -> _Row:
    """Axes that do not: beta from the second axis' direction, the rest from where it passes."""
    (x, y, z), (u, v, w) = Y[:3, 3], Y[:3, 2]
    if u.is_zero:
        beta, sine = ZERO, -v
    elif v.is_zero:
        beta, sine = PI / 2, u
    else:
        beta, sine = arc_tangent(u, -v), sqrt(u * u + v * v)
    c, s = (cos(beta), sin(beta)) if u.is_zero or v.is_zero else (-v / sine, u / sine)
    delta = (x * s - y * c) / sine
    sign = -1 if size(sine) < 0 else 1
    gamma = arc_tangent(Y[2, 0] * sign, Y[2, 1] * sign)
    return _Row(beta, z - delta * w, x * c + y * s, arc_tangent(sine, w), gamma, delta)
