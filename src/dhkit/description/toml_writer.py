"""Descriptions as robot files: the same values in the file's units, expressions as they were written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import tomlkit
from tomlkit.items import Array, Float, InlineTable, Item, Table, Trivia

from dhkit.description.bodies import Body
from dhkit.description.quantities import has_numbers_alone
from dhkit.description.robot_data import RobotData
from dhkit.description.values import (
    ONE,
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
from dhkit.expressions import Expression

_Content: TypeAlias = dict[str, Any]
"""Keys of a table, with values that tomlkit takes."""


def toml_text(description: RobotData) -> str:
    """Return a description as a robot file's text; see :func:`dhkit.description.to_toml`."""
    units = description.units
    document = tomlkit.document()
    document["format"] = 1
    document["name"] = description.name
    document["convention"] = description.convention.value
    if units != Units():
        document["units"] = _inline_table({"length": units.length, "angle": units.angle})
    if description.gravity != STANDARD_GRAVITY:
        document["gravity"] = _entries(description.gravity)
    for key in ("source", "notes"):
        if text := getattr(description, key):
            document[key] = text
    if not description.drawn:
        document["drawn"] = False
    if description.parameters:
        document["parameters"] = _table(
            {name: _entry(value) for name, value in description.parameters.items()}
        )
    joints = tomlkit.aot()
    for joint in description.joints:
        joints.append(_table(_joint(joint, units)))
    document["joint"] = joints
    if description.couplings:
        couplings = tomlkit.aot()
        for coupling in description.couplings:
            content = {"joints": _array(coupling.joints), "inertia": _entry(coupling.inertia)}
            couplings.append(_table(content))
        document["coupling"] = couplings
    base = description.base
    tool = description.tool
    body = {"body": _body(base.body, units)} if base.body else {}
    if base_content := _placement(base.placement, units) | _shapes(base.shapes, units) | body:
        document["base"] = _table(base_content)
    if tool_content := _placement(tool.placement, units) | _shapes(tool.shapes, units):
        document["tool"] = _table(tool_content)
    if description.configurations:
        configurations = {}
        for name, q in description.configurations.items():
            entries = [
                _motion(entry, joint, units)
                for entry, joint in zip(q, description.joints, strict=True)
            ]
            configurations[name] = _array(entries)
        document["configurations"] = _table(configurations)
    return tomlkit.dumps(document)


def _joint(joint: Joint, units: Units) -> _Content:
    content: _Content = {
        "name": joint.name,
        "type": joint.type.value,
        "a": _entry(joint.a, units.metres),
        "alpha": _entry(joint.alpha, units.radians),
        "d": _entry(joint.d, units.metres),
        "theta": _entry(joint.theta, units.radians),
    }
    if joint.limits is not None:
        content["limits"] = _array(_motion(limit, joint, units) for limit in joint.limits)
    if joint.velocity is not None:
        content["velocity"] = _motion(joint.velocity, joint, units)
    if joint.effort is not None:
        content["effort"] = _entry(joint.effort)
    if len(joint.bodies) == 1:
        content["body"] = _body(joint.bodies[0], units)
    elif joint.bodies:
        content["bodies"] = _array(_body(body, units) for body in joint.bodies).multiline(True)
    if joint.drive is not None:
        content["drive"] = _drive(joint.drive)
    content |= _shapes(joint.shapes, units)
    if joint.assumed:
        content["assumed"] = list(joint.assumed)
    return content


def _body(body: Body, units: Units) -> InlineTable:
    content: _Content = {"name": body.name} if body.name else {}
    content["mass"] = _entry(body.mass)
    content |= _nonzero_entries("com", body.com, units.metres)
    if moments := {
        key: _entry(moment) for key, moment in vars(body.inertia).items() if not moment.is_zero
    }:
        content["inertia"] = _inline_table(moments)
    if body.unphysical:
        content["unphysical"] = True
    return _inline_table(content)


def _drive(drive: Drive) -> InlineTable:
    numbers = {key: _entry(getattr(drive, key)) for key in ("gear", "rotor_inertia", "viscous")}
    return _inline_table(numbers | {"coulomb": _entries(drive.coulomb)})


def _placement(placement: Placement, units: Units) -> _Content:
    return _nonzero_entries("xyz", placement.xyz, units.metres) | _nonzero_entries(
        "rpy", placement.rpy, units.radians
    )


def _shapes(shapes: Sequence[Shape], units: Units) -> _Content:
    """Return the key ``shape`` with one shape or a list of several; nothing without shapes."""
    if len(shapes) == 1:
        return {"shape": _shape(shapes[0], units)}
    return {"shape": _array(_shape(shape, units) for shape in shapes)} if shapes else {}


def _shape(shape: Shape, units: Units) -> InlineTable:
    content: _Content
    match shape.geometry:
        case Mesh(path, scale):
            content = {"mesh": path}
            if scale != UNSCALED:
                content["scale"] = (
                    _entry(scale[0]) if scale[0] == scale[1] == scale[2] else _entries(scale)
                )
        case Box(size):
            content = {"box": _entries(size, units.metres)}
        case Sphere(radius):
            content = {"sphere": _inline_table({"radius": _entry(radius, units.metres)})}
        case geometry:
            ends = {key: _entry(size, units.metres) for key, size in vars(geometry).items()}
            content = {type(geometry).__name__.lower(): _inline_table(ends)}
    color = {"color": shape.color} if shape.color is not None else {}
    frame = _placement(shape.frame, units) | ({"body": shape.body} if shape.body else {})
    of_locked_link = {"frame": _inline_table(frame)} if frame else {}
    return _inline_table(content | _placement(shape.placement, units) | of_locked_link | color)


def _motion(value: Expression, joint: Joint, units: Units) -> Item:
    return _entry(value, units.radians if joint.is_revolute else units.metres)


def _entries(values: Iterable[Expression], unit: Expression = ONE) -> Array:
    return _array(_entry(value, unit) for value in values)


def _nonzero_entries(key: str, values: Sequence[Expression], unit: Expression) -> _Content:
    """Return a key with a list of values; nothing where all of them are zero, the default."""
    return {} if all(value.is_zero for value in values) else {key: _entries(values, unit)}


def _entry(value: Expression, unit: Expression = ONE) -> Item:
    """Return a number in this unit, or text in quotes for an expression and for a number without a finite decimal."""
    bare = None if value.written is not None else (value / unit).rational
    text = str(value) if bare is None else Expression.number(bare).text
    if bare is None or "/" in text:
        written = value.text if value.written is None else text
        # In a table of mm a number in quotes could be taken for mm: in parentheses it is an expression, in metres.
        return tomlkit.item(
            f"({written})" if unit != ONE and has_numbers_alone(written) else written
        )
    if bare.denominator == 1 and "e" not in text:
        return tomlkit.integer(text)
    # tomlkit.float_ would print the nearest double; this keeps all digits.
    return Float(float(bare), Trivia(), text)


def _array(entries: Iterable[object]) -> Array:
    array = tomlkit.array()
    array.extend(entries)
    return array


def _inline_table(content: Mapping[str, object]) -> InlineTable:
    table = tomlkit.inline_table()
    table.update(content)
    return table


def _table(content: Mapping[str, object]) -> Table:
    table = tomlkit.table()
    for key, value in content.items():
        table.add(key, value)
    return table
