"""Reader of URDFs: links and joints, checked while they are read.

Pinocchio and yourdfpy accept links with two parents, circles beside the tree, axes of zero length and NaN masses, and
read missing limits as [0, 0]. Here they are refused, or read by a stated rule with a warning.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import ROUND_DOWN, ROUND_HALF_EVEN, Decimal
from functools import lru_cache
from itertools import chain
from pathlib import Path

import numpy as np

from dhkit.description import Array, Box, Capsule, Cylinder, Geometry, Mesh, Sphere, pose
from dhkit.description.bodies import eigenvalue_tolerance
from dhkit.description.bounds import BOUNDS as ROBOT_BOUNDS
from dhkit.errors import ModelError
from dhkit.expressions import exact
from dhkit.model.bounds import BOUNDS
from dhkit.model.urdf_tree import (
    AXIS_KINDS,
    ElementName,
    Inertial,
    JointKind,
    UrdfJoint,
    UrdfLink,
    UrdfShape,
    UrdfTree,
    UrdfWarning,
)
from dhkit.model.urdf_xml import Element, child_name, number, numbers, parse_urdf

_UNIT_LENGTH_TOLERANCE = 1e-6
"""Largest difference of an axis' length from 1 without a warning: other axes were hardly meant as unit vectors."""
_QUATERNION_TOLERANCE = 1e-4
"""Largest difference of a quaternion's length from 1; it is normalized."""
_NO_LIMIT = -1
"""Speed or effort that stands for "no limit" in files of some exporters, as 0 does."""
_OWN_PREFIX = "dhkit:"
"""Beginning of the names that dhkit adds for other readers."""
_MIN_DIGITS = 3
"""Smallest number of significant digits of a decimal that is taken for a rounded multiple of 15 degrees."""
_ROUND_SIZES = (("radius", 1), ("length", 1))
_GEOMETRY_SIZES = {
    "box": (("size", 3),),
    "cylinder": _ROUND_SIZES,
    "capsule": _ROUND_SIZES,
    "sphere": (("radius", 1),),
}
"""Attributes with the sizes of a geometry, and how many numbers each has."""
_ROUNDED_DECIMALS = range(3, 10)
"""Numbers of decimals of rounded right angles whose differences from the right angle are read as 0."""


def read_urdf(path: str | Path, *, as_designed: bool = False) -> UrdfTree:
    """Read a URDF; meshes are not opened.

    Parameters
    ----------
    path
        The file. Its text is never trusted: no document types or entities, bounded size and depth, one tree of at
        most 500 links, names once each, finite numbers, axes of some length, complete inertials.
    as_designed
        Read angles such as 1.5708 as the multiples of 15 degrees that they round, and axes such as 0 1 2e-6 as a
        coordinate axis; ``changes`` lists them.

    Raises
    ------
    ModelError
        The file cannot be read or breaks a rule; names file, element and value in one line.
    """
    path = Path(path)
    try:
        return _UrdfReader(path, as_designed).tree(parse_urdf(path))
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None


class _UrdfReader:
    """Reads one file and collects its warnings; messages do not name the file."""

    def __init__(self, path: Path, as_designed: bool) -> None:
        self.path = path
        self.as_designed = as_designed
        self.warnings: list[UrdfWarning] = []
        self.changes: list[str] = []

    def tree(self, robot: Element) -> UrdfTree:
        """Return the checked tree."""
        link_elements = _by_name(robot, "link")
        joint_elements = _by_name(robot, "joint")
        parents = _parent_joints(link_elements, joint_elements)
        root, members = _largest_tree(link_elements, joint_elements, parents)
        left_out = tuple(name for name in link_elements if name not in members)
        link_elements = {
            name: element for name, element in link_elements.items() if name in members
        }
        joint_elements = {
            name: element
            for name, element in joint_elements.items()
            if child_name(element, "child") in members
        }
        colors = {}
        for material in robot.findall("material"):
            name = material.get("name")
            color = _color(material)
            if name and color:
                colors[name] = color
        joints = {
            name: self._joint(ElementName("joint", name), element)
            for name, element in joint_elements.items()
        }
        for joint in joints.values():
            if joint.mimics is not None and joint.mimics not in joints:
                self._warn(
                    ElementName("joint", joint.name),
                    f" follows {joint.mimics[:60]!r}, which is not a joint",
                )
        links = {
            name: self._link(ElementName("link", name), element, colors)
            for name, element in link_elements.items()
        }
        return UrdfTree(
            path=self.path,
            name=robot.get("name", ""),
            element=robot,
            links=links,
            joints=joints,
            parent_joint={link: joints[name] for link, name in parents.items() if link in members},
            unconnected=left_out,
            root=root,
            warnings=tuple(dict.fromkeys(self.warnings)),
            changes=tuple(self.changes),
        )

    def _warn(self, element: ElementName, text: str) -> None:
        self.warnings.append(UrdfWarning(element, text))

    def _joint(self, name: ElementName, joint: Element) -> UrdfJoint:
        if joint.get("type", "") not in list(JointKind):
            raise ModelError(
                f"{name} is {joint.get('type', '')[:40]!r}; expected one of {', '.join(JointKind)}"
            )
        kind = JointKind(joint.get("type", ""))
        mimic = joint.find("mimic")
        has_axis = kind in AXIS_KINDS
        limits: tuple[float, float] | None = None
        velocity = effort = fault = None
        damping = friction = 0.0
        try:
            if has_axis:
                damping, friction = _dynamics(name, joint)
                velocity, effort = (
                    self._largest(name, joint, key) for key in ("velocity", "effort")
                )
                limits = self._limits(name, joint)
        except ModelError as error:
            fault = str(error)
        return UrdfJoint(
            name=name.name,
            kind=kind,
            parent=child_name(joint, "parent"),
            child=child_name(joint, "child"),
            T_parent_joint=self._joint_origin(str(name), joint.find("origin")),
            rounding=self._rounding(joint.find("origin"), "rpy"),
            axis=self._axis(name, joint) if has_axis else np.array([1.0, 0.0, 0.0]),
            axis_rounding=self._rounding(joint.find("axis"), "xyz"),
            limits=limits,
            velocity=velocity,
            effort=effort,
            damping=damping,
            friction=friction,
            mimics=None if mimic is None else mimic.get("joint", ""),
            fault=fault,
        )

    def _joint_origin(self, where: str, origin: Element | None) -> Array:
        T = self._origin(where, origin)
        largest = float(np.abs(T[:3, 3]).max())
        if largest > ROBOT_BOUNDS.number:
            raise ModelError(
                f"{where}: <origin xyz>: found {largest:.3g} m; expected at most {ROBOT_BOUNDS.number:g}"
            )
        return T

    def _origin(self, where: str, origin: Element | None) -> Array:
        """Return the pose of xyz and rpy, or of a quaternion; missing ones are 0."""
        xyz = numbers(where, origin, "xyz", 3) or [0.0] * 3
        if quaternion := numbers(where, origin, "quat_xyzw", 4):  # of URDF 1.2
            if origin is not None and origin.get("rpy") is not None:
                raise ModelError(
                    f"{where}: <origin> has both rpy and quat_xyzw; expected one of them"
                )
            if abs(math.hypot(*quaternion) - 1) > _QUATERNION_TOLERANCE:
                raise ModelError(
                    f"{where}: <origin quat_xyzw>: found length {math.hypot(*quaternion):.4g}; expected 1"
                )
            return pose(xyz, quat=quaternion)
        rpy = numbers(where, origin, "rpy", 3) or [0.0] * 3
        if self.as_designed and origin is not None and any(rpy):
            for i, (word, value) in enumerate(zip(origin.get("rpy", "").split(), rpy, strict=True)):
                rpy[i] = _designed_angle(word, value)
                if rpy[i] != value:
                    self.changes.append(
                        f"{where}: rpy {word} read as {math.degrees(rpy[i]):.6g} degrees"
                    )
        return pose(xyz, euler=rpy, order="xyz")

    def _rounding(self, element: Element | None, key: str) -> float:
        """Return the sum of the roundings of an attribute's numbers; 0 where they are read as designed."""
        if element is None or self.as_designed:
            return 0.0
        return sum(_decimal_rounding(word) for word in element.get(key, "").split())

    def _axis(self, name: ElementName, joint: Element) -> Array:
        entries = numbers(str(name), joint.find("axis"), "xyz", 3) or [1.0, 0.0, 0.0]
        largest = max(map(abs, entries))
        if not largest > 0:
            raise ModelError(f"{name}: <axis xyz>: found 0 0 0; expected a direction")
        axis = np.array(entries) / largest  # first, since squares of 1e200 overflow
        length = float(np.linalg.norm(axis))
        if not 1 - _UNIT_LENGTH_TOLERANCE < length * largest < 1 + _UNIT_LENGTH_TOLERANCE:
            self._warn(name, f": axis has length {length * largest:.6g}; read as a direction")
        axis = axis / length
        nearest = np.round(axis)
        small = axis[nearest == 0]
        if self.as_designed and small.any() and all(_is_rounding_of_zero(float(x)) for x in small):
            self.changes.append(f"{name}: axis read as {' '.join(f'{x:g}' for x in nearest)}")
            return np.asarray(nearest)
        return axis

    def _limits(self, name: ElementName, joint: Element) -> tuple[float, float] | None:
        limit = joint.find("limit")
        lower, upper = (number(str(name), limit, key) for key in ("lower", "upper"))
        if joint.get("type") == JointKind.CONTINUOUS:
            return None
        if lower is None and upper is None:
            self._warn(name, ": no limits; read as unlimited")
            return None
        low = lower or 0.0
        high = upper or 0.0
        if low == high == 0:
            self._warn(name, ": limits [0, 0]; read as unlimited")
            return None
        if low > high:
            raise ModelError(f"{name}: limits [{low:g}, {high:g}] are the wrong way round")
        return low, high

    def _largest(self, name: ElementName, joint: Element, key: str) -> float | None:
        """Return the largest speed or torque, None for unlimited."""
        limit = joint.find("limit")
        if limit is not None and limit.get(key, "").strip().lower() in ("inf", "+inf", "infinity"):
            self._warn(name, f": {key} {limit.get(key)}; read as unlimited")
            return None
        value = number(str(name), limit, key)
        if value in (0, _NO_LIMIT):
            self._warn(name, f": {key} {value:g}; read as unlimited")
            return None
        if value is not None and value < 0:
            raise ModelError(f"{name}: {key} is {value:g}; expected none below 0")
        return value

    def _link(self, name: ElementName, link: Element, colors: Mapping[str, str]) -> UrdfLink:
        try:
            visuals, collisions = (
                tuple(self._shapes(name, link.findall(tag), colors))
                for tag in ("visual", "collision")
            )
            return UrdfLink(
                name.name, self._inertial(name, link.find("inertial")), visuals, collisions
            )
        except ModelError as error:
            return UrdfLink(name.name, None, (), (), fault=str(error))

    def _inertial(self, name: ElementName, inertial: Element | None) -> Inertial | None:
        if inertial is None:
            return None
        mass = number(str(name), inertial.find("mass"), "value")
        keys = ("ixx", "iyy", "izz", "ixy", "iyz", "ixz")
        moments: list[float] = []
        for key in keys:
            moments += numbers(str(name), inertial.find("inertia"), key, 1)
        if mass is None or len(moments) != len(keys):
            raise ModelError(
                f"{name}: <inertial> lacks mass or inertia; expected value, {', '.join(keys)}"
            )
        if mass < 0:
            raise ModelError(f"{name}: mass is {mass:g}; expected none below 0")
        xx, yy, zz, xy, yz, xz = moments
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        lowest, *_, highest = np.linalg.eigvalsh(tensor)
        if lowest < -eigenvalue_tolerance(highest):
            self._warn(
                name, f": no body has this inertia: a principal moment is {lowest:.3g} kg m^2"
            )
        T = self._origin(f"{name}: inertial", inertial.find("origin"))
        return Inertial(mass, T[:3, 3], T[:3, :3] @ tensor @ T[:3, :3].T)

    def _shapes(
        self, name: ElementName, elements: Sequence[Element], colors: Mapping[str, str]
    ) -> Iterator[UrdfShape]:
        if len(elements) > BOUNDS.shape_elements:
            raise ModelError(
                f"{name} has {len(elements)} shapes; expected {BOUNDS.shape_elements} at most"
            )
        for element in elements:
            T = self._origin(f"{name}: {element.tag}", element.find("origin"))
            color = None
            material = element.find("material")
            if material is not None:
                color = _color(material) or colors.get(material.get("name", ""))
            geometry, size = self._geometry(name, element)
            if geometry is None:
                self._warn(name, f": {element.tag} has no geometry that dhkit knows; left out")
            elif max(size, np.abs(T[:3, 3]).max()) > BOUNDS.shape_distance:
                text = f": {element.tag} is larger than {BOUNDS.shape_distance:g} m or farther away; left out"
                self._warn(name, text)
            else:
                yield UrdfShape(geometry, T, color)

    def _geometry(self, name: ElementName, shape: Element) -> tuple[Geometry | None, float]:
        """Return the first known geometry of a visual or collision element, and its largest size or scale."""
        where = f"{name}: {shape.tag}"
        parent = shape.find("geometry")
        for element in [] if parent is None else parent:
            sizes: list[float] = []
            for key, count in _GEOMETRY_SIZES.get(element.tag, ()):
                sizes += numbers(where, element, key, count)
            entries = [exact(size) for size in sizes] if sizes and min(sizes) > 0 else []
            match element.tag, entries:
                case "mesh", _:
                    sizes = numbers(where, element, "scale", 3) or [1.0, 1.0, 1.0]
                    if not all(sizes) or not element.get("filename"):
                        self._warn(
                            name,
                            f": {shape.tag}: a mesh without a file name or with scale 0; left out",
                        )
                        return None, 0.0
                    x, y, z = map(exact, sizes)
                    return Mesh(element.get("filename", ""), (x, y, z)), max(map(abs, sizes))
                case "box", [x, y, z]:
                    return Box((x, y, z)), max(sizes)
                case "cylinder", [radius, length]:
                    return Cylinder(radius, length), max(sizes)
                case "capsule", [radius, length]:
                    return Capsule(radius, length), max(sizes)
                case "sphere", [radius]:
                    return Sphere(radius), max(sizes)
        return None, 0.0


def _by_name(robot: Element, tag: str) -> dict[str, Element]:
    """Return a robot's links or joints by name; refuse too many, invalid names and repeated ones."""
    elements = robot.findall(tag)
    if len(elements) > BOUNDS.links:
        raise ModelError(f"{len(elements)} {tag}s; expected {BOUNDS.links} at most")
    named: dict[str, Element] = {}
    for element in elements:
        name = element.get("name", "")
        if not name or not name.isprintable() or name.startswith(_OWN_PREFIX):
            raise ModelError(f"a {tag} has the name {name[:60]!r}; expected text")
        if name in named:
            raise ModelError(f"two {tag}s have the name {name[:60]!r}")
        named[name] = element
    return named


def _parent_joints(links: Mapping[str, Element], joints: Mapping[str, Element]) -> dict[str, str]:
    """Return the name of the joint between each link and its parent."""
    if not links:
        raise ModelError("no links; expected a robot (of a xacro file: its expansion by xacro)")
    parents: dict[str, str] = {}
    for name, joint in joints.items():
        for tag in ("parent", "child"):
            if (link := child_name(joint, tag)) not in links:
                raise ModelError(f"joint {name!r}: <{tag}> is {link[:60]!r}, which is not a link")
        child = child_name(joint, "child")
        if child in parents:
            raise ModelError(
                f"link {child!r} has two parents, by joints {parents[child]!r} and {name!r}"
            )
        parents[child] = name
    return parents


def _largest_tree(
    links: Mapping[str, Element], joints: Mapping[str, Element], parents: Mapping[str, str]
) -> tuple[str, set[str]]:
    """Return the root of the largest tree, the first of equal ones, and its links; refuse links in a circle."""
    children: dict[str, list[str]] = {}
    for child, name in parents.items():
        children.setdefault(child_name(joints[name], "parent"), []).append(child)
    trees: dict[str, set[str]] = {}
    for root in (link for link in links if link not in parents):
        reached = [root]
        for link in reached:  # grows while it is traversed
            reached += children.get(link, ())
        trees[root] = set(reached)
    in_a_tree = set(chain.from_iterable(trees.values()))
    if in_a_circle := [link for link in links if link not in in_a_tree]:
        raise ModelError(
            f"links {', '.join(in_a_circle)[:200]} go round in a circle; expected a tree"
        )
    root = max(trees, key=lambda link: len(trees[link]))
    return root, trees[root]


def _dynamics(name: ElementName, joint: Element) -> tuple[float, float]:
    """Return damping, N m s/rad or N s/m, and friction, N m or N; 0 where they are missing."""
    dynamics = joint.find("dynamics")
    damping, friction = (number(str(name), dynamics, key) or 0.0 for key in ("damping", "friction"))
    if damping < 0 or friction < 0:
        raise ModelError(
            f"{name}: damping {damping:g}, friction {friction:g}; expected none below 0"
        )
    return damping, friction


def _color(material: Element) -> str | None:
    element = material.find("color")
    rgba = [] if element is None else element.get("rgba", "").split()
    try:
        levels = [round(255 * min(max(float(word), 0.0), 1.0)) for word in rgba[:3]]
    except ValueError:
        return None  # an invalid colour is not a reason to refuse a robot
    return "#{:02x}{:02x}{:02x}".format(*levels) if len(levels) == 3 else None


def _designed_angle(word: str, value: float) -> float:
    """Return the multiple of 15 degrees that a decimal of at least three digits rounds or cuts, or the value itself.

    The difference of a right angle and its decimal, such as 3.6732e-06, is read as 0, and that of half a turn and a
    rounded right angle, such as 1.570796326589793 = pi - 1.570796327, as the right angle.
    """
    if _is_rounding_of_zero(value):
        return 0.0
    multiple = round(value * 12 / math.pi) * math.pi / 12
    if multiple and _is_rounding_of_zero(value - multiple, rel_tol=1e-5):
        return multiple
    decimal = Decimal(word)
    _, digits, exponent = decimal.as_tuple()
    if (
        len(digits) < _MIN_DIGITS
        or not isinstance(exponent, int)
        or abs(multiple) > math.tau + 1e-9
        or exponent > 0
    ):
        return value
    unit = Decimal(1).scaleb(exponent)
    roundings = (
        Decimal(multiple).quantize(unit, rounding) for rounding in (ROUND_HALF_EVEN, ROUND_DOWN)
    )
    return multiple if decimal in roundings and multiple else value


def _decimal_rounding(word: str) -> float:
    """Return by how much a decimal may be off: a unit of its last place, if it has three digits at least.

    A rounded multiple of 15 degrees is off by what it differs from that, 1.571 by 2.04e-4; a hundredth more covers what
    the product of several rotations adds. The difference of a right angle and its decimal, such as 3.6732e-06, is off
    by itself.
    """
    value = abs(float(word))
    if value < 1e-12:
        return 0.0
    if _is_rounding_of_zero(value):
        return value
    decimal = Decimal(word).as_tuple()
    if (
        len(decimal.digits) < _MIN_DIGITS
        or not isinstance(decimal.exponent, int)
        or decimal.exponent >= 0
    ):
        return 0.0
    unit = float(10.0**decimal.exponent)
    multiple = round(value * 12 / math.pi) * math.pi / 12
    return 1.01 * abs(value - multiple) if multiple and abs(value - multiple) <= unit else unit


def _is_rounding_of_zero(value: float, rel_tol: float = 1e-3) -> bool:
    """Return whether a number is the difference of a right angle and its decimal: 1.5708 - pi/2 = 3.67e-6."""
    return abs(value) < 1e-12 or any(
        math.isclose(abs(value), error, rel_tol=rel_tol) for error in _rounding_errors()
    )


@lru_cache(maxsize=1)
def _rounding_errors() -> tuple[float, ...]:
    """Return the differences of right angles and their decimals, rounded and cut, rad."""
    errors = set()
    for quarter_turns in range(1, 5):
        right = quarter_turns * math.pi / 2
        for decimals in _ROUNDED_DECIMALS:
            rounded = round(right, decimals)
            cut = math.floor(right * 10**decimals) / 10**decimals
            errors |= {abs(rounded - right), abs(cut - right)}
    return tuple(error for error in errors if error < 2e-4)
