"""Descriptions as robot files: the same values, in the file's units, expressions as they were written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import tomlkit
from tomlkit.items import Array, Float, InlineTable, Item, Table, Trivia

from dhkit.description.bodies import Body
from dhkit.description.robot_data import RobotData
from dhkit.description.values import (
    STANDARD_GRAVITY,
    UNSCALED,
    Box,
    Drive,
    Joint,
    Mesh,
    Placement,
    Shape,
    Sphere,
    Units,
)
from dhkit.expressions import Expression, exact

ONE = exact(1)
Content: TypeAlias = Mapping[str, Any]


def toml_text(description: RobotData) -> str:
    """Return a description as a robot file's text.

    See :func:`dhkit.description.to_toml`.
    """
    units = description.units
    document = tomlkit.document()
    document["format"] = 1
    document["name"] = description.name
    document["convention"] = description.convention.value
    if units != Units():
        document["units"] = _inline({"length": units.length, "angle": units.angle})
    if description.gravity != STANDARD_GRAVITY:
        document["gravity"] = _entries(description.gravity)
    for key in ("source", "notes"):
        if text := getattr(description, key):
            document[key] = text
    if not description.drawn:
        document["drawn"] = False
    if description.parameters:
        document["parameters"] = _table({name: _entry(value) for name, value in description.parameters.items()})
    joints = tomlkit.aot()
    for joint in description.joints:
        joints.append(_joint(joint, units))
    document["joint"] = joints
    base, tool = description.base, description.tool
    if held := _link(base.placement, base.shapes, units) | ({"body": _body(base.body, units)} if base.body else {}):
        document["base"] = _table(held)
    if held := _link(tool.placement, tool.shapes, units):
        document["tool"] = _table(held)
    if description.configurations:
        document["configurations"] = _table(
            {
                name: _list(_motion(entry, joint, units) for entry, joint in zip(q, description.joints, strict=True))
                for name, q in description.configurations.items()
            }
        )
    return tomlkit.dumps(document)


def _joint(joint: Joint, units: Units) -> Table:
    content: dict[str, Any] = {
        "name": joint.name,
        "type": joint.type.value,
        "a": _entry(joint.a, units.metres),
        "alpha": _entry(joint.alpha, units.radians),
        "d": _entry(joint.d, units.metres),
        "theta": _entry(joint.theta, units.radians),
    }
    if joint.limits is not None:
        content["limits"] = _list(_motion(limit, joint, units) for limit in joint.limits)
    if joint.velocity is not None:
        content["velocity"] = _motion(joint.velocity, joint, units)
    if joint.effort is not None:
        content["effort"] = _entry(joint.effort)
    if len(joint.bodies) == 1:
        content["body"] = _body(joint.bodies[0], units)
    elif joint.bodies:
        content["bodies"] = _list(_body(body, units) for body in joint.bodies).multiline(True)
    if joint.drive is not None:
        content["drive"] = _drive(joint.drive)
    if joint.shapes:
        content["shape"] = _shapes(joint.shapes, units)
    if joint.assumed:
        content["assumed"] = list(joint.assumed)
    return _table(content)


def _body(body: Body, units: Units) -> InlineTable:
    content: dict[str, Any] = {"name": body.name} if body.name else {}
    content["mass"] = _entry(body.mass)
    if not all(x.is_zero for x in body.com):
        content["com"] = _entries(body.com, units.metres)
    moments = {key: _entry(moment) for key, moment in vars(body.inertia).items() if not moment.is_zero}
    if moments:
        content["inertia"] = _inline(moments)
    if body.unphysical:
        content["unphysical"] = True
    return _inline(content)


def _drive(drive: Drive) -> InlineTable:
    numbers = {key: _entry(getattr(drive, key)) for key in ("gear", "rotor_inertia", "viscous")}
    return _inline(numbers | {"coulomb": _entries(drive.coulomb)})


def _link(placement: Placement, shapes: Sequence[Shape], units: Units) -> dict[str, Any]:
    shown = {"shape": _shapes(shapes, units)} if shapes else {}
    return _placement(placement, units) | shown


def _placement(placement: Placement, units: Units) -> dict[str, Any]:
    content = {}
    if not all(x.is_zero for x in placement.xyz):
        content["xyz"] = _entries(placement.xyz, units.metres)
    if not all(x.is_zero for x in placement.rpy):
        content["rpy"] = _entries(placement.rpy, units.radians)
    return content


def _shapes(shapes: Sequence[Shape], units: Units) -> Item:
    return _shape(shapes[0], units) if len(shapes) == 1 else _list(_shape(shape, units) for shape in shapes)


def _shape(shape: Shape, units: Units) -> InlineTable:
    geometry, metres = shape.geometry, units.metres
    content: dict[str, Any]
    match geometry:
        case Mesh(path, scale):
            equal = scale[0] == scale[1] == scale[2]
            content = {"mesh": path}
            if scale != UNSCALED:
                content["scale"] = _entry(scale[0]) if equal else _entries(scale)
        case Box(size):
            content = {"box": _entries(size, metres)}
        case Sphere(radius):
            content = {"sphere": _inline({"radius": _entry(radius, metres)})}
        case _:
            ends = {"radius": _entry(geometry.radius, metres), "length": _entry(geometry.length, metres)}
            content = {type(geometry).__name__.lower(): _inline(ends)}
    color = {"color": shape.color} if shape.color is not None else {}
    return _inline(content | _placement(shape.placement, units) | color)


def _motion(value: Expression, joint: Joint, units: Units) -> Item:
    return _entry(value, units.radians if joint.is_revolute else units.metres)


def _entries(values: Iterable[Expression], unit: Expression = ONE) -> Item:
    return _list(_entry(value, unit) for value in values)


def _entry(value: Expression, unit: Expression = ONE) -> Item:
    """Return text in quotes where the value was written so or has no ending decimal in this unit, else a number."""
    bare = None if value.written is not None else (value / unit).rational
    text = str(value) if bare is None else Expression.number(bare).text
    if bare is None or "/" in text:
        return tomlkit.item(value.text if value.written is None else text)
    if bare.denominator == 1 and "e" not in text:
        return tomlkit.integer(text)
    # tomlkit.float_ would print the nearest double: the digits are handed over as they are.
    return Float(float(bare), Trivia(), text)


def _list(entries: Iterable[Any]) -> Array:
    array = tomlkit.array()
    for entry in entries:
        array.append(entry)
    return array


def _inline(content: Content) -> InlineTable:
    table = tomlkit.inline_table()
    table.update(content)
    return table


def _table(content: Content) -> Table:
    table = tomlkit.table()
    for key, value in content.items():
        table.add(key, value)
    return table
