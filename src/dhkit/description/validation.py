"""Checks whether the values of a description make a robot: errors are raised, warnings are returned."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from dhkit.description.assets import MESH_FORMATS, inside
from dhkit.description.bodies import MIN_EIGENVALUE_TOLERANCE, Body, eigenvalue_tolerance
from dhkit.description.bounds import BOUNDS
from dhkit.description.joint_text import violated_limit_text
from dhkit.description.mesh_files import MeshFileError, check_mesh_file
from dhkit.description.parameters import check_parameter_name, resolved
from dhkit.description.robot_data import RobotData
from dhkit.description.values import Box, Drive, Geometry, Joint, Mesh, Placement, Shape
from dhkit.errors import DescriptionError, ExpressionError
from dhkit.expressions import Expression, substitute

NAME = re.compile(rf"[A-Za-z_][A-Za-z0-9_.\-]{{0,{BOUNDS.name_characters - 1}}}", re.ASCII)
BODY_NAME = re.compile(rf"[A-Za-z_][A-Za-z0-9_.\- ]{{0,{BOUNDS.name_characters - 1}}}", re.ASCII)
RESERVED_NAME = re.compile(r"(world|base|tool|dh\d+|link\d+)(_fixed)?")
"""Names of links and fixed joints of our URDFs: a joint of the same name would confuse Pinocchio."""
_CONTROL_CHARACTER = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)
"""Characters that XML may not hold or that a terminal would act on."""
SHAPE_LEFT_OUT = "; this shape is left out"
"""End of a line of notes on a shape of the file that a description comes from, which the description does not have."""
_COLOR = re.compile(r"#[0-9a-fA-F]{6}")

_MAX_TABLE_ANGLE = math.tau + 1e-9
"""Largest angle of a table, rad; a larger one is probably in degrees, see _MAX_DEGREES."""
_MAX_LIMIT_ANGLE = 2 * math.tau + 1e-9
"""Largest joint limit, rad; a larger one is probably in degrees, see _MAX_DEGREES."""
_MAX_DEGREES = 1080.0
"""Largest number that is probably an angle in degrees: three turns; larger ones give no warning."""

_Value = Callable[[str, Expression], float]
"""Returns the number of an expression, SI and radians; the text names the expression in messages."""


def check(description: RobotData) -> tuple[str, ...]:
    """Check a description; return its warnings.

    Raises
    ------
    DescriptionError
        The first fault: joint, key, the value found and the value expected.
    """
    for what, count, least, most in (
        ("joints", description.n, 1, BOUNDS.joints),
        ("parameters", len(description.parameters), 0, BOUNDS.parameters),
        ("configurations", len(description.configurations), 0, BOUNDS.configurations),
    ):
        if not least <= count <= most:
            raise DescriptionError(f"{count} {what}; expected {least} to {most}")
    for name in description.parameters:
        check_parameter_name(name)
    values = resolved(description.parameters)
    for name, parameter in values.items():
        _number(f"parameters.{name}", parameter, {})

    def value(where: str, expression: Expression) -> float:
        return _number(where, expression, values)

    for i, component in enumerate(description.gravity):
        value(f"gravity[{i}]", component)
    warnings: list[str] = []
    for number, joint in enumerate(description.joints, start=1):
        warnings += _check_joint(joint, f"joint {number} ({joint.name})", value)
    warnings += _check_couplings(description, value)
    _check_names(description)
    for key in ("source", "notes"):
        if control := _CONTROL_CHARACTER.search(getattr(description, key)):
            raise DescriptionError(
                f"{key}: holds the control character {control.group()!r}; expected plain text"
            )
    base = description.base
    tool = description.tool
    for part, placed in (("base", base), ("tool", tool)):
        _check_placement(placed.placement, f"{part}: ", value)
        warnings += _check_shapes(placed.shapes, part, value, description)
    for joint in description.joints:
        warnings += _check_shapes(joint.shapes, f"link of {joint.name}", value, description)
    if base.body is not None:
        warnings += _check_only_body(base.body, "base", value)
    warnings += _check_configurations(description, value)
    warnings += shapes_left_out(description.notes)
    return tuple(warnings)


def shapes_left_out(notes: str) -> tuple[str, ...]:
    """Return the lines of notes on shapes that a description lacks: its links reach farther than its shapes say."""
    return tuple(line for line in notes.splitlines() if line.endswith(SHAPE_LEFT_OUT))


def _number(where: str, expression: Expression, values: Mapping[str, Expression]) -> float:
    try:
        number = float(substitute(expression, values))
    except ExpressionError as error:
        raise DescriptionError(f"{where}: {str(error)[: BOUNDS.message_characters]}") from None
    if abs(number) > BOUNDS.number:
        raise DescriptionError(
            f"{where}: {number:.3g} in SI units; expected at most {BOUNDS.number:g}"
        )
    return number


def _check_names(description: RobotData) -> None:
    expected = "expected letters, digits, '_', '.', '-', beginning with a letter"
    if not NAME.fullmatch(description.name):
        raise DescriptionError(f"name: found {description.name[:80]!r}; {expected}")
    names = [joint.name for joint in description.joints]
    for i, name in enumerate(names, start=1):
        if not NAME.fullmatch(name):
            raise DescriptionError(f"joint {i}: name {name[:80]!r}; {expected}")
        if RESERVED_NAME.fullmatch(name):
            raise DescriptionError(
                f"joint {i}: name {name!r} is taken by a frame of the URDF; choose another"
            )
        if name in names[: i - 1]:
            raise DescriptionError(f"joint {i}: name {name!r} is another joint's already")


def _check_joint(joint: Joint, where: str, value: _Value) -> Iterator[str]:
    row = {
        key: value(f"{where}: {key}", getattr(joint, key)) for key in ("a", "alpha", "d", "theta")
    }
    angles = [(key, row[key], _MAX_TABLE_ANGLE) for key in ("alpha", "theta")]
    if joint.limits is not None:
        lower, upper = (
            value(f"{where}: limits[{i}]", limit) for i, limit in enumerate(joint.limits)
        )
        if lower > upper:
            raise DescriptionError(
                f"{where}: limits [{lower:g}, {upper:g}] are the wrong way round"
            )
        if joint.is_revolute:
            angles += [
                ("lower limit", lower, _MAX_LIMIT_ANGLE),
                ("upper limit", upper, _MAX_LIMIT_ANGLE),
            ]
    for key, angle, most in angles:
        if most < abs(angle) <= _MAX_DEGREES:
            yield f"{where}: {key} is {angle:.6g} rad, {abs(angle) / math.tau:.3g} turns; are angles in degrees?"
    for key, unit in (("velocity", "rad/s or m/s"), ("effort", "N m or N")):
        limit = getattr(joint, key)
        if limit is not None and not value(f"{where}: {key}", limit) > 0:
            raise DescriptionError(
                f"{where}: {key} is {limit}; expected a positive number of {unit}"
            )
    if joint.drive is not None:
        _check_drive(joint.drive, where, value)
    _check_body_names(joint.bodies, where)
    if len(joint.bodies) == 1:
        yield from _check_only_body(joint.bodies[0], where, value)
    else:
        for body in joint.bodies:
            yield from _check_body(body, f"{where}, {body.name}", value)


def _check_body_names(bodies: Sequence[Body], where: str) -> None:
    if len(bodies) > BOUNDS.bodies:
        raise DescriptionError(f"{where}: {len(bodies)} bodies; expected at most {BOUNDS.bodies}")
    names = [body.name for body in bodies]
    for k, name in enumerate(names, start=1):
        if name and not BODY_NAME.fullmatch(name):
            raise DescriptionError(
                f"{where}: body {k} has the name {name[:80]!r}; expected letters, digits, '_', '.', '-' and "
                "spaces, beginning with a letter"
            )
        if name in names[: k - 1]:
            raise DescriptionError(f"{where}: name {name!r} is another body's already")


def _check_drive(drive: Drive, where: str, value: _Value) -> None:
    if value(f"{where}: drive.gear", drive.gear) == 0:
        raise DescriptionError(
            f"{where}: drive.gear is 0; expected the ratio of motor to joint speed"
        )
    for key, unit in (("rotor_inertia", "kg m^2"), ("viscous", "N m s/rad")):
        number = value(f"{where}: drive.{key}", getattr(drive, key))
        if number < 0:
            raise DescriptionError(
                f"{where}: drive.{key} is {number:g} {unit}; expected none below 0"
            )
    positive, negative = (
        value(f"{where}: drive.coulomb[{i}]", entry) for i, entry in enumerate(drive.coulomb)
    )
    if positive < 0 or negative > 0:
        raise DescriptionError(
            f"{where}: drive.coulomb is [{positive:g}, {negative:g}] N m; expected [not negative, not positive]"
        )


def _check_couplings(description: RobotData, value: _Value) -> Iterator[str]:
    pairs: set[tuple[int, int]] = set()
    armature = [
        value("drive", joint.drive.armature) if joint.drive else 0.0 for joint in description.joints
    ]
    for k, coupling in enumerate(description.couplings):
        where = f"coupling[{k}]"
        i, j = coupling.joints
        if not 1 <= i < j <= description.n:
            raise DescriptionError(
                f"{where}: joints [{i}, {j}]; expected two joints of 1 to {description.n}"
            )
        if (i, j) in pairs:
            raise DescriptionError(f"{where}: joints {i} and {j} have a coupling already")
        pairs.add((i, j))
        inertia = value(f"{where}: inertia", coupling.inertia)
        # A rotor of inertia J that turns by G qd_j + k qd_i has b = J G k, and adds J k^2 and J G^2 to the diagonal:
        # b^2 = (J k^2) (J G^2), each at most the armature of its joint.
        if inertia**2 > armature[i - 1] * armature[j - 1]:
            yield (
                f"{where}: {inertia:g} is more than the root of the two joints' gear^2 rotor_inertia, "
                f"{armature[i - 1]:g} and {armature[j - 1]:g}: rotors alone cannot have such a coupling"
            )


def _check_body(body: Body, where: str, value: _Value) -> Iterator[str]:
    mass = value(f"{where}: body.mass", body.mass)
    if mass < 0:
        raise DescriptionError(f"{where}: body.mass is {mass:g} kg; expected none below 0")
    for i, entry in enumerate(body.com):
        value(f"{where}: body.com[{i}]", entry)
    lowest, middle, largest = _principal_moments(body, where, value)
    tolerance = eigenvalue_tolerance(largest)
    if lowest < -tolerance:
        message = (
            f"{where}: body.inertia has the eigenvalue {lowest:.6g} kg m^2; expected none below 0"
        )
        if not body.unphysical:
            raise DescriptionError(message)
        yield message
    # I_1 + I_2 - I_3 = 2 integral of x_3^2 dm >= 0 in principal axes.
    elif largest > lowest + middle + tolerance:
        yield (
            f"{where}: no body has principal moments {lowest:.4g}, {middle:.4g}, {largest:.4g} kg m^2 "
            "(triangle inequality)"
        )
    if mass == 0 and largest > tolerance:
        yield f"{where}: a body without mass has inertia"


def _check_only_body(body: Body, where: str, value: _Value) -> Iterator[str]:
    """Check the only body of a link, which is unlikely to be a point mass; one of several bodies may be one."""
    yield from _check_body(body, where, value)
    mass = value(f"{where}: body.mass", body.mass)
    lowest, _, largest = _principal_moments(body, where, value)
    if mass > 0 and max(abs(lowest), abs(largest)) <= MIN_EIGENVALUE_TOLERANCE:
        yield f"{where}: a body of {mass:g} kg has no inertia"


def _principal_moments(body: Body, where: str, value: _Value) -> tuple[float, float, float]:
    """Return the eigenvalues of the inertia, kg m^2, the lowest first."""
    inertia = np.empty((3, 3))
    for i, row in enumerate(body.inertia.rows):
        inertia[i] = [value(f"{where}: body.inertia", entry) for entry in row]
    lowest, middle, largest = (float(x) for x in np.linalg.eigvalsh(inertia))
    return lowest, middle, largest


def _check_placement(placement: Placement, prefix: str, value: _Value) -> None:
    for key, entries in (("xyz", placement.xyz), ("rpy", placement.rpy)):
        for i, entry in enumerate(entries):
            value(f"{prefix}{key}[{i}]", entry)


def check_body(body: Body, where: str, values: Mapping[str, Expression]) -> None:
    """Refuse an impossible body.

    Raises
    ------
    DescriptionError
        A negative mass, an impossible inertia, or a value that is not finite.
    """
    list(_check_body(body, where, lambda place, expression: _number(place, expression, values)))


def _check_shapes(
    shapes: tuple[Shape, ...], where: str, value: _Value, description: RobotData
) -> Iterator[str]:
    if len(shapes) > BOUNDS.shapes:
        raise DescriptionError(f"{where}: {len(shapes)} shapes; expected at most {BOUNDS.shapes}")
    for shape in shapes:
        _check_placement(shape.placement, f"{where}: shape.", value)
        _check_placement(shape.frame, f"{where}: shape.frame.", value)
        if shape.color is not None and not _COLOR.fullmatch(shape.color):
            raise DescriptionError(
                f"{where}: shape.color is {shape.color[:80]!r}; expected '#rrggbb'"
            )
        if isinstance(shape.geometry, Mesh):
            yield from _check_mesh(shape.geometry, f"{where}: shape", value, description)
        else:
            _check_sizes(shape.geometry, f"{where}: shape", value)


def _check_sizes(geometry: Geometry, where: str, value: _Value) -> None:
    if isinstance(geometry, Box):
        sizes = {f"box[{i}]": edge for i, edge in enumerate(geometry.size)}
    else:
        sizes = dict(vars(geometry))
    for key, size in sizes.items():
        number = value(f"{where}.{key}", size)
        if not number > 0:
            raise DescriptionError(f"{where}.{key} is {number:g}; expected a positive number")


def _check_mesh(mesh: Mesh, where: str, value: _Value, description: RobotData) -> Iterator[str]:
    """Refuse an invalid path or scale; a file that is not a mesh is a warning, for the arm works without it."""
    file = inside(description.mesh_folder, mesh.path, f"{where}.mesh")
    if not mesh.path.lower().endswith(MESH_FORMATS):
        raise DescriptionError(
            f"{where}.mesh is {mesh.path[:80]!r}; expected one of {', '.join(MESH_FORMATS)}"
        )
    for i, entry in enumerate(mesh.scale):
        if value(f"{where}.scale[{i}]", entry) == 0:
            raise DescriptionError(
                f"{where}.scale[{i}] is 0; expected a factor to metres, negative to mirror"
            )
    if file is None:
        return
    try:
        check_mesh_file(file)
    except MeshFileError as error:
        fault = (
            "is not there"
            if not file.exists()
            else f"is not a mesh that can be read ({error.reason})"
        )
        yield f"{where}.mesh: {mesh.path!r} {fault}; the link is drawn without it"


def _check_configurations(description: RobotData, value: _Value) -> Iterator[str]:
    for name, q in description.configurations.items():
        if not NAME.fullmatch(name):
            raise DescriptionError(f"configurations: {name[:80]!r} is not a name")
        if len(q) != description.n:
            raise DescriptionError(
                f"configurations.{name}: {len(q)} numbers; expected {description.n}, one a joint"
            )
        for i, (entry, joint) in enumerate(zip(q, description.joints, strict=True)):
            number = value(f"configurations.{name}[{i}]", entry)
            if joint.limits is None:
                continue
            lower, upper = (value("", limit) for limit in joint.limits)
            if violation := violated_limit_text(number, lower, upper, slides=not joint.is_revolute):
                yield f"configurations.{name}: {joint.name} is {violation}"
