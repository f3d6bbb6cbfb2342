"""Robot files: TOML text to a description and back, without loss."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dhkit.description.bodies import INERTIA_PLACES, Body, Inertia, Vector
from dhkit.description.bounds import BOUNDS
from dhkit.description.files import read_bounded, write_atomically
from dhkit.description.named import Named
from dhkit.description.quantities import parse_quantity, without_variable
from dhkit.description.robot import Description, takes_robot
from dhkit.description.toml_text import toml_document
from dhkit.description.toml_writer import toml_text
from dhkit.description.values import (
    ONE,
    Base,
    Box,
    Capsule,
    Convention,
    Coupling,
    Cylinder,
    Drive,
    Geometry,
    Joint,
    JointType,
    Mesh,
    Placement,
    Shape,
    Sphere,
    Tool,
    Units,
)
from dhkit.errors import DescriptionError, ExpressionError
from dhkit.expressions import Budget, Expression, exact, exact_angle

if TYPE_CHECKING:
    from dhkit.description.schema import (
        BodyForm,
        CouplingForm,
        DriveForm,
        Entry,
        FrameForm,
        JointForm,
        RobotForm,
        ShapeForm,
        ToolForm,
    )


def read_robot(path: str | Path) -> Description:
    """Read a robot file.

    Parameters
    ----------
    path
        Robot file, which ends in ``.toml``.

    Returns
    -------
    Description
        The robot.

    Raises
    ------
    DescriptionError
        It cannot be read, or describes no robot: file, joint, key, the value found and the value expected.

    Examples
    --------
    >>> from dhkit.description import library_robot, write_robot
    >>> write_robot(library_robot("planar2r"), "arm.toml")
    >>> read_robot("arm.toml") == library_robot("planar2r")
    True
    """
    path = Path(path)
    content = read_bounded(path, BOUNDS.file_bytes)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DescriptionError(f"{path}: not UTF-8 text (byte {error.start + 1})") from None
    return from_toml(text, file=str(path), mesh_folder=path.parent.resolve())


def from_toml(
    text: str, *, file: str = "robot file", mesh_folder: Path | None = None
) -> Description:
    """Read a robot file's text; ``file`` names it in messages, mesh paths are relative to ``mesh_folder``.

    Parameters
    ----------
    text
        Text of a robot file.
    file
        Name of the file in messages.
    mesh_folder
        Folder that mesh paths are relative to.

    Returns
    -------
    Description
        The robot.

    Raises
    ------
    DescriptionError
        See :func:`read_robot`.

    Examples
    --------
    >>> from dhkit.description.library import library_robot
    >>> arm = from_toml(to_toml(library_robot("planar2r")))
    >>> arm.n
    2
    """
    from dhkit.description.schema import validated

    try:
        if len(text) > BOUNDS.file_bytes:
            raise DescriptionError(
                f"more than {BOUNDS.file_bytes / 1e6:g} MB; expected a robot file"
            )
        with Budget():
            return _FormReader(validated(toml_document(text)), mesh_folder).description()
    except DescriptionError as error:
        raise DescriptionError(f"{file}: {error}") from None


@takes_robot
def to_toml(description: Description) -> str:
    """Return a description as a robot file's text.

    Reading it gives an equal description in the same units. Comments of a file that was read are not kept.

    Parameters
    ----------
    description
        The arm.

    Returns
    -------
    str
        TOML text that :func:`from_toml` reads.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> print(to_toml(library_robot("planar2r"))[:30])
    format = 1
    name = "planar2r"
    c
    """
    return toml_text(description)


@takes_robot
def write_robot(description: Description, path: str | Path) -> None:
    """Write a robot file, whole or not at all.

    Parameters
    ----------
    description
        The arm.
    path
        File to write.

    Raises
    ------
    OSError
        It cannot be written; names the file or its folder.

    Examples
    --------
    >>> from dhkit.description import library_robot, read_robot
    >>> write_robot(library_robot("planar2r"), "mine.toml")
    >>> read_robot("mine.toml").name
    'planar2r'
    """
    write_atomically(Path(path), toml_text(description))


class _FormReader:
    """Converts a validated form to a description, with exact values in SI units."""

    def __init__(self, form: RobotForm, mesh_folder: Path | None) -> None:
        self.form = form
        self.mesh_folder = mesh_folder
        self.units = Units(form.units.length, form.units.angle)
        self.names = frozenset(form.parameters)

    def description(self) -> Description:
        form = self.form
        return Description(
            name=form.name,
            convention=Convention(form.convention),
            parameters=Named(
                {name: self.number(f"parameters.{name}", x) for name, x in form.parameters.items()}
            ),
            joints=tuple(self.joint(i, joint) for i, joint in enumerate(form.joint, start=1)),
            gravity=self.vector("gravity", form.gravity),
            base=Base(
                self.placement("base", form.base),
                self.shapes("base", form.base.shape),
                None if form.base.body is None else self.body("base", form.base.body),
            ),
            tool=Tool(self.placement("tool", form.tool), self.shapes("tool", form.tool.shape)),
            configurations=Named(
                {name: self.configuration(name, q) for name, q in form.configurations.items()}
            ),
            couplings=tuple(
                self.coupling(f"coupling[{k}]", entry) for k, entry in enumerate(form.coupling)
            ),
            source=form.source,
            notes=form.notes,
            drawn=form.drawn,
            units=self.units,
            mesh_folder=self.mesh_folder,
        )

    def number(self, where: str, entry: Entry, unit: Expression = ONE) -> Expression:
        """Return the value of an entry: a bare number in this unit, or text in SI."""
        try:
            return (
                parse_quantity(entry, self.names, unit)
                if isinstance(entry, str)
                else exact(entry) * unit
            )
        except ExpressionError as error:
            raise DescriptionError(f"{where}: {error}") from None

    def length(self, where: str, entry: Entry) -> Expression:
        return self.number(where, entry, self.units.metres)

    def angle(self, where: str, entry: Entry) -> Expression:
        return exact_angle(self.number(where, entry, self.units.radians))

    def vector(self, where: str, entries: Sequence[Entry], unit: Expression = ONE) -> Vector:
        x, y, z = (self.number(f"{where}[{i}]", entry, unit) for i, entry in enumerate(entries))
        return x, y, z

    def placement(self, where: str, form: ToolForm | ShapeForm | FrameForm) -> Placement:
        roll, pitch, yaw = (
            self.angle(f"{where}: rpy[{i}]", entry) for i, entry in enumerate(form.rpy)
        )
        return Placement(
            self.vector(f"{where}: xyz", form.xyz, self.units.metres), (roll, pitch, yaw)
        )

    def motion(self, where: str, type: JointType, entry: Entry) -> Expression:
        """Return a value of the joint variable, or of its rate."""
        return self.angle(where, entry) if type is JointType.REVOLUTE else self.length(where, entry)

    def joint(self, number: int, form: JointForm) -> Joint:
        where = f"joint {number}" + (f" ({form.name[:40]})" if form.name else "")
        kind = JointType(form.type)
        theta = form.theta
        d = form.d
        if kind is JointType.REVOLUTE:
            theta = without_variable(theta, number)
        else:
            d = without_variable(d, number)
        limits = None
        if form.limits is not None:
            lower, upper = (
                self.motion(f"{where}: limits[{i}]", kind, x) for i, x in enumerate(form.limits)
            )
            limits = (lower, upper)
        return Joint(
            type=kind,
            a=self.length(f"{where}: a", form.a),
            alpha=self.angle(f"{where}: alpha", form.alpha),
            d=self.length(f"{where}: d", d),
            theta=self.angle(f"{where}: theta", theta),
            name=form.name,
            limits=limits,
            velocity=None
            if form.velocity is None
            else self.motion(f"{where}: velocity", kind, form.velocity),
            effort=None if form.effort is None else self.number(f"{where}: effort", form.effort),
            bodies=self.bodies(where, form),
            drive=None if form.drive is None else self.drive(f"{where}: drive", form.drive),
            shapes=self.shapes(where, form.shape),
            assumed=tuple(form.assumed),
        )

    def bodies(self, where: str, form: JointForm) -> tuple[Body, ...]:
        if form.bodies is None:
            return () if form.body is None else (self.body(where, form.body),)
        return tuple(
            self.body(f"{where}, {body.name[:40] or f'body {k}'}", body)
            for k, body in enumerate(form.bodies, start=1)
        )

    def body(self, where: str, form: BodyForm) -> Body:
        moments = {
            key: self.number(f"{where}: body.inertia.{key}", getattr(form.inertia, key))
            for key in INERTIA_PLACES
        }
        mass = self.number(f"{where}: body.mass", form.mass)
        com = self.vector(f"{where}: body.com", form.com, self.units.metres)
        return Body(mass, com, Inertia(**moments), form.unphysical, form.name)

    def drive(self, where: str, form: DriveForm) -> Drive:
        coulomb = [
            self.number(f"{where}.coulomb[{i}]", entry) for i, entry in enumerate(form.coulomb)
        ]
        positive, negative = coulomb if len(coulomb) == 2 else (coulomb[0], -coulomb[0])
        gear, rotor_inertia, viscous = (
            self.number(f"{where}.{key}", getattr(form, key))
            for key in ("gear", "rotor_inertia", "viscous")
        )
        return Drive(gear, rotor_inertia, viscous, (positive, negative))

    def coupling(self, where: str, form: CouplingForm) -> Coupling:
        first, second = sorted(form.joints)
        return Coupling((first, second), self.number(f"{where}.inertia", form.inertia))

    def shapes(self, where: str, forms: Iterable[ShapeForm]) -> tuple[Shape, ...]:
        return tuple(self.shape(f"{where}: shape", form) for form in forms)

    def shape(self, where: str, form: ShapeForm) -> Shape:
        placement = self.placement(where, form)
        frame = self.placement(f"{where}.frame", form.frame)
        return Shape(self.geometry(where, form), placement, form.color, frame, form.frame.body)

    def geometry(self, where: str, form: ShapeForm) -> Geometry:
        if form.mesh is not None:
            return Mesh(form.mesh, self.vector(f"{where}.scale", form.scale))
        if form.box is not None:
            return Box(self.vector(f"{where}.box", form.box, self.units.metres))
        if form.sphere is not None:
            return Sphere(self.length(f"{where}.sphere.radius", form.sphere.radius))
        for kind, ends in ((Cylinder, form.cylinder), (Capsule, form.capsule)):
            if ends is not None:
                return kind(
                    self.length(f"{where}.radius", ends.radius),
                    self.length(f"{where}.length", ends.length),
                )
        raise DescriptionError(f"{where}: no geometry")

    def configuration(self, name: str, q: Sequence[Entry]) -> tuple[Expression, ...]:
        where = f"configurations.{name[:80]}"
        if len(q) != len(self.form.joint):
            raise DescriptionError(
                f"{where}: {len(q)} numbers; expected {len(self.form.joint)}, one a joint"
            )
        return tuple(
            self.motion(f"{where}[{i}]", JointType(joint.type), entry)
            for i, (joint, entry) in enumerate(zip(self.form.joint, q, strict=True))
        )
