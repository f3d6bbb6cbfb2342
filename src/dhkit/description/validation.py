"""Whether the values of a description make a robot: errors that stop, warnings that are kept."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from dhkit.description.assets import MESH_FORMATS, inside
from dhkit.description.bodies import Body
from dhkit.description.joint_words import outside_words
from dhkit.description.mesh_files import check_mesh_file
from dhkit.description.parameters import check_parameter_name, resolved
from dhkit.description.robot_data import RobotData
from dhkit.description.values import Box, Drive, Geometry, Joint, Mesh, Placement, Shape
from dhkit.errors import DescriptionError, ExpressionError
from dhkit.expressions import Expression, substitute

MAX_JOINTS = 32
LARGEST = 1e12
"""Size of a number, SI units: products of several of them are finite doubles, and no robot comes near."""
MESSAGE = 300
"""Characters of an expression's own message, which may quote the whole of it."""
MAX_PARAMETERS = 200
MAX_CONFIGURATIONS = 100
MAX_SHAPES = 200
"""A humanoid's trunk with both arms frozen has 110."""
MAX_BODIES = 16
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.\-]{0,63}", re.ASCII)
BODY_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.\- ]{0,63}", re.ASCII)
RESERVED = re.compile(r"(world|base|tool|dh\d+|link\d+)(_fixed)?")
"""Names of the URDF's links and fixed joints: a joint of the same name would confuse Pinocchio."""
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")
"""What no XML may hold, and what a terminal would act on."""
COLOR = re.compile(r"#[0-9a-fA-F]{6}")
ABSOLUTE_SLACK = 1e-12
"""kg m^2: the smallest eigenvalue of a published inertia may be this far below zero."""
RELATIVE_SLACK = 1e-9
"""Share of the largest eigenvalue, for tensors given to ten digits."""

WHOLE_TURN, SEVERAL_TURNS, LARGEST_DEGREES = math.tau + 1e-9, 2 * math.tau + 1e-9, 1080.0
"""rad: an angle of the table, or a joint limit, between these and the last is likely one in degrees."""

Value = Callable[[str, Expression], float]


def check(description: RobotData) -> tuple[str, ...]:
    """Check a description; return its warnings.

    Raises
    ------
    DescriptionError
        The first thing found that makes it no robot: joint, key, found, expected.
    """
    _check_counts(description)
    for name in description.parameters:
        check_parameter_name(name)
    values = resolved(description.parameters)
    for name, parameter in values.items():
        _finite(f"parameters.{name}", parameter, {})

    def value(where: str, expression: Expression) -> float:
        return _finite(where, expression, values)

    for i, component in enumerate(description.gravity):
        value(f"gravity[{i}]", component)
    warnings: list[str] = []
    for number, joint in enumerate(description.joints, start=1):
        warnings += _check_joint(joint, f"joint {number} ({joint.name})", value)
    _check_names(description)
    for key in ("source", "notes"):
        if found := CONTROL.search(getattr(description, key)):
            raise DescriptionError(f"{key}: holds the control character {found.group()!r}; expected plain text")
    for part, placement, shapes in (
        ("base", description.base.placement, description.base.shapes),
        ("tool", description.tool.placement, description.tool.shapes),
    ):
        _check_placement(placement, f"{part}: ", value)
        warnings += _check_shapes(shapes, part, value, description)
    for joint in description.joints:
        warnings += _check_shapes(joint.shapes, f"link of {joint.name}", value, description)
    if description.base.body is not None:
        warnings += _check_lone_body(description.base.body, "base", value)
    warnings += _check_configurations(description, value)
    return tuple(warnings)


def _finite(where: str, expression: Expression, values: Mapping[str, Expression]) -> float:
    try:
        value = float(substitute(expression, values))
    except ExpressionError as error:
        raise DescriptionError(f"{where}: {str(error)[:MESSAGE]}") from None
    if abs(value) > LARGEST:
        raise DescriptionError(f"{where}: {value:.3g} in SI units; expected at most {LARGEST:g}")
    return value


def _check_counts(description: RobotData) -> None:
    for what, count, least, most in (
        ("joints", description.n, 1, MAX_JOINTS),
        ("parameters", len(description.parameters), 0, MAX_PARAMETERS),
        ("configurations", len(description.configurations), 0, MAX_CONFIGURATIONS),
    ):
        if not least <= count <= most:
            raise DescriptionError(f"{count} {what}; expected {least} to {most}")


def _check_names(description: RobotData) -> None:
    if not NAME.fullmatch(description.name):
        raise DescriptionError(
            f"name: found {description.name[:80]!r}; expected letters, digits, '_', '.', '-', beginning with a letter"
        )
    seen: set[str] = set()
    for i, joint in enumerate(description.joints, start=1):
        if not NAME.fullmatch(joint.name):
            raise DescriptionError(
                f"joint {i}: name {joint.name[:80]!r}; expected letters, digits, '_', '.', '-', beginning with a letter"
            )
        if RESERVED.fullmatch(joint.name):
            raise DescriptionError(f"joint {i}: name {joint.name!r} is taken by a frame of the URDF; choose another")
        if joint.name in seen:
            raise DescriptionError(f"joint {i}: name {joint.name!r} is another joint's already")
        seen.add(joint.name)


def _check_joint(joint: Joint, where: str, value: Value) -> Iterator[str]:
    angles = list[tuple[str, float, float]]()
    for key in ("a", "alpha", "d", "theta"):
        size = value(f"{where}: {key}", getattr(joint, key))
        if key in ("alpha", "theta"):
            angles.append((key, size, WHOLE_TURN))
    if joint.limits is not None:
        lower, upper = (value(f"{where}: limits[{i}]", limit) for i, limit in enumerate(joint.limits))
        if lower > upper:
            raise DescriptionError(f"{where}: limits [{lower:g}, {upper:g}] are the wrong way round")
        if joint.is_revolute:
            angles += [("lower limit", lower, SEVERAL_TURNS), ("upper limit", upper, SEVERAL_TURNS)]
    for key, angle, most in angles:
        if most < abs(angle) <= LARGEST_DEGREES:
            yield f"{where}: {key} is {angle:.6g} rad, {abs(angle) / math.tau:.3g} turns; are angles in degrees?"
    for key, unit in (("velocity", "rad/s or m/s"), ("effort", "N m or N")):
        limit = getattr(joint, key)
        if limit is not None and not value(f"{where}: {key}", limit) > 0:
            raise DescriptionError(f"{where}: {key} is {limit}; expected a positive number of {unit}")
    if joint.drive is not None:
        _check_drive(joint.drive, where, value)
    if len(joint.bodies) == 1:
        _check_body_names(joint.bodies, where)
        yield from _check_lone_body(joint.bodies[0], where, value)
    elif joint.bodies:
        _check_body_names(joint.bodies, where)
        for body in joint.bodies:
            yield from _check_body(body, f"{where}, {body.name}", value)


def _check_body_names(bodies: Sequence[Body], where: str) -> None:
    if len(bodies) > MAX_BODIES:
        raise DescriptionError(f"{where}: {len(bodies)} bodies; expected at most {MAX_BODIES}")
    seen: set[str] = set()
    for k, body in enumerate(bodies, start=1):
        if body.name and not BODY_NAME.fullmatch(body.name):
            raise DescriptionError(
                f"{where}: body {k} has the name {body.name[:80]!r}; expected letters, digits, '_', '.', '-' and "
                "spaces, beginning with a letter"
            )
        if body.name in seen:
            raise DescriptionError(f"{where}: name {body.name!r} is another body's already")
        seen.add(body.name)


def _check_drive(drive: Drive, where: str, value: Value) -> None:
    if value(f"{where}: drive.gear", drive.gear) == 0:
        raise DescriptionError(f"{where}: drive.gear is 0; expected the ratio of motor to joint speed")
    for key, unit in (("rotor_inertia", "kg m^2"), ("viscous", "N m s/rad")):
        found = value(f"{where}: drive.{key}", getattr(drive, key))
        if found < 0:
            raise DescriptionError(f"{where}: drive.{key} is {found:g} {unit}; expected none below 0")
    positive, negative = (value(f"{where}: drive.coulomb[{i}]", entry) for i, entry in enumerate(drive.coulomb))
    if positive < 0 or negative > 0:
        raise DescriptionError(
            f"{where}: drive.coulomb is [{positive:g}, {negative:g}] N m; expected [not negative, not positive]"
        )


def _check_body(body: Body, where: str, value: Value) -> Iterator[str]:
    mass = value(f"{where}: body.mass", body.mass)
    if mass < 0:
        raise DescriptionError(f"{where}: body.mass is {mass:g} kg; expected none below 0")
    for i, entry in enumerate(body.com):
        value(f"{where}: body.com[{i}]", entry)
    lowest, middle, largest = _principal_moments(body, where, value)
    slack = ABSOLUTE_SLACK + RELATIVE_SLACK * abs(largest)
    if lowest < -slack:
        message = f"{where}: body.inertia has the eigenvalue {lowest:.6g} kg m^2; expected none below 0"
        if not body.unphysical:
            raise DescriptionError(message)
        yield message
    elif largest > lowest + middle + slack:
        yield (
            f"{where}: no body has principal moments {lowest:.4g}, {middle:.4g}, {largest:.4g} kg m^2 "
            "(triangle inequality)"
        )
    if mass == 0 and largest > slack:
        yield f"{where}: a body without mass has inertia"


def _check_lone_body(body: Body, where: str, value: Value) -> Iterator[str]:
    """Check the only body of a link: one of several may well be a point mass."""
    yield from _check_body(body, where, value)
    mass = value(f"{where}: body.mass", body.mass)
    lowest, _, largest = _principal_moments(body, where, value)
    if mass > 0 and math.isclose(max(abs(lowest), abs(largest)), 0.0, abs_tol=ABSOLUTE_SLACK):
        yield f"{where}: a body of {mass:g} kg has no inertia"


def _principal_moments(body: Body, where: str, value: Value) -> tuple[float, float, float]:
    """Return the eigenvalues of the inertia, kg m^2, the lowest first."""
    rows = [[value(f"{where}: body.inertia", entry) for entry in row] for row in body.inertia.rows]
    lowest, middle, largest = (float(x) for x in np.linalg.eigvalsh(np.array(rows)))
    return lowest, middle, largest


def _check_placement(placement: Placement, prefix: str, value: Value) -> None:
    for key, entries in (("xyz", placement.xyz), ("rpy", placement.rpy)):
        for i, entry in enumerate(entries):
            value(f"{prefix}{key}[{i}]", entry)


def check_body(body: Body, where: str, values: Mapping[str, Expression]) -> None:
    """Refuse a body that is none, by itself.

    Raises
    ------
    DescriptionError
        A negative mass, an impossible inertia, or a value that is not finite.
    """
    for _ in _check_body(body, where, lambda place, expression: _finite(place, expression, values)):
        pass


def _check_shapes(shapes: tuple[Shape, ...], where: str, value: Value, description: RobotData) -> Iterator[str]:
    if len(shapes) > MAX_SHAPES:
        raise DescriptionError(f"{where}: {len(shapes)} shapes; expected at most {MAX_SHAPES}")
    for shape in shapes:
        _check_placement(shape.placement, f"{where}: shape.", value)
        if shape.color is not None and not COLOR.fullmatch(shape.color):
            raise DescriptionError(f"{where}: shape.color is {shape.color[:80]!r}; expected '#rrggbb'")
        yield from _check_geometry(shape.geometry, f"{where}: shape", value, description)


def _check_geometry(geometry: Geometry, where: str, value: Value, description: RobotData) -> Iterator[str]:
    if isinstance(geometry, Mesh):
        yield from _check_mesh(geometry, where, value, description)
        return
    if isinstance(geometry, Box):
        sizes = {f"box[{i}]": edge for i, edge in enumerate(geometry.size)}
    else:
        sizes = dict(vars(geometry))
    for key, size in sizes.items():
        found = value(f"{where}.{key}", size)
        if not found > 0:
            raise DescriptionError(f"{where}.{key} is {found:g}; expected a positive number")


def _check_mesh(mesh: Mesh, where: str, value: Value, description: RobotData) -> Iterator[str]:
    """Refuse a path or a scale that is none; a file that is none is a warning, for the arm works without it."""
    file = inside(description.mesh_folder, mesh.path, where)
    if not mesh.path.lower().endswith(MESH_FORMATS):
        raise DescriptionError(f"{where}.mesh is {mesh.path[:80]!r}; expected one of {', '.join(MESH_FORMATS)}")
    for i, entry in enumerate(mesh.scale):
        if value(f"{where}.scale[{i}]", entry) == 0:
            raise DescriptionError(f"{where}.scale[{i}] is 0; expected a factor to metres, negative to mirror")
    if file is None:
        return
    try:
        check_mesh_file(file)
    except DescriptionError as error:
        cause = str(error).removeprefix(f"{file}: ")
        what = "is not there" if not file.exists() else f"is no mesh that can be read ({cause})"
        yield f"{where}.mesh: {mesh.path!r} {what}; the link is drawn from the table"


def _check_configurations(description: RobotData, value: Value) -> Iterator[str]:
    for name, q in description.configurations.items():
        if not NAME.fullmatch(name):
            raise DescriptionError(f"configurations: {name[:80]!r} is no name")
        if len(q) != description.n:
            raise DescriptionError(f"configurations.{name}: {len(q)} numbers; expected {description.n}, one a joint")
        for i, entry in enumerate(q):
            found, joint = value(f"configurations.{name}[{i}]", entry), description.joints[i]
            if joint.limits is None:
                continue
            lower, upper = (value("", limit) for limit in joint.limits)
            if words := outside_words(found, lower, upper, slides=not joint.is_revolute):
                yield f"configurations.{name}: {joint.name} is {words}"
