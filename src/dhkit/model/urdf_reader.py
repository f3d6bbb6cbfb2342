"""Reading a URDF into links and joints, checked on the way.

Pinocchio and yourdfpy accept links with two parents, circles beside the tree, axes of zero length and NaN masses, and
read missing limits as [0, 0]. Here they are refused, or read by a stated rule with a warning.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import ROUND_DOWN, ROUND_HALF_EVEN, Decimal
from functools import lru_cache
from pathlib import Path

import numpy as np

from dhkit.description import Array, pose
from dhkit.errors import ModelError
from dhkit.model.urdf_tree import MOVING, Inertial, UrdfJoint, UrdfLink, UrdfShape, UrdfTree
from dhkit.model.urdf_xml import Element, child_name, numbers, parsed

MAX_LINKS = 500
"""Thousands of fixed joints in a row crash Pinocchio."""
MAX_SHAPES = 2_000
JOINT_TYPES = (*MOVING, "fixed", "floating", "planar")
SAME_LENGTH = 1e-6
"""Relative: an axis whose length differs more from 1 was hardly meant as a unit vector, and is said."""
SAME_TURN = 1e-4
"""How far a quaternion's length may be from 1: it is normalised."""
FAR = 1e6
"""m: nothing that is to be seen is larger or farther away."""
OWN = "dhkit:"
"""Beginning of the names that dhkit adds for other readers."""
LEAST_DIGITS = 3
"""Significant digits of a decimal that is taken for a rounded multiple of 15 degrees."""
DECIMALS = range(3, 10)
"""Decimals of the rounded right angles whose misses are read as 0."""


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
    return _Reader(path, as_designed).tree(parsed(path))


class _Reader:
    """Reads one file; collects what is odd."""

    def __init__(self, path: Path, as_designed: bool) -> None:
        self.path = path
        self.as_designed = as_designed
        self.warnings: list[str] = []
        self.changes: list[str] = []

    def tree(self, robot: Element) -> UrdfTree:
        """Return the checked tree."""
        link_elements = self._named(robot, "link")
        joint_elements = self._named(robot, "joint")
        parents = self._parents(link_elements, joint_elements)
        root = self._root(link_elements, joint_elements, parents)
        colors = {
            name: color
            for material in robot.findall("material")
            if (name := material.get("name")) and (color := self._color(material))
        }
        joints = {name: self._joint(name, element) for name, element in joint_elements.items()}
        for joint in joints.values():
            if joint.mimics is not None and joint.mimics not in joints:
                self.warnings.append(f"joint {joint.name!r} follows {joint.mimics[:60]!r}, which is no joint")
        links = {name: self._link(name, element, colors) for name, element in link_elements.items()}
        return UrdfTree(
            path=self.path,
            name=robot.get("name", ""),
            element=robot,
            links=links,
            joints=joints,
            parent_joint={link: joints[name] for link, name in parents.items()},
            root=root,
            warnings=tuple(dict.fromkeys(self.warnings)),
            changes=tuple(self.changes),
        )

    def _named(self, robot: Element, tag: str) -> dict[str, Element]:
        elements = robot.findall(tag)
        if len(elements) > MAX_LINKS:
            raise ModelError(f"{self.path}: {len(elements)} {tag}s; expected {MAX_LINKS} at most")
        named: dict[str, Element] = {}
        for element in elements:
            name = element.get("name", "")
            if not name or not name.isprintable() or name.startswith(OWN):
                raise ModelError(f"{self.path}: a {tag} has the name {name[:60]!r}; expected text")
            if name in named:
                raise ModelError(f"{self.path}: two {tag}s have the name {name[:60]!r}")
            named[name] = element
        return named

    def _parents(self, links: Mapping[str, Element], joints: Mapping[str, Element]) -> dict[str, str]:
        """Return each link's joint to its parent."""
        if not links:
            raise ModelError(f"{self.path}: no links; expected a robot (of a xacro file: what xacro makes of it)")
        parents: dict[str, str] = {}
        for name, joint in joints.items():
            child, parent = child_name(joint, "child"), child_name(joint, "parent")
            for tag, link in (("parent", parent), ("child", child)):
                if link not in links:
                    raise ModelError(f"{self.path}: joint {name!r}: <{tag}> is {link[:60]!r}, which is no link")
            if child in parents:
                raise ModelError(
                    f"{self.path}: link {child!r} has two parents, by joints {parents[child]!r} and {name!r}"
                )
            parents[child] = name
        return parents

    def _root(self, links: Mapping[str, Element], joints: Mapping[str, Element], parents: Mapping[str, str]) -> str:
        """Return the link without a parent; refuse none, several, and links that go round in a circle."""
        roots = [link for link in links if link not in parents]
        if len(roots) > 1:
            raise ModelError(f"{self.path}: not connected: {_listed(roots)} have no parent; expected one root")
        children: dict[str, list[str]] = {}
        for child, name in parents.items():
            children.setdefault(child_name(joints[name], "parent"), []).append(child)
        reached, waiting = set(roots), list(roots)
        while waiting:
            for child in children.get(waiting.pop(), ()):
                reached.add(child)
                waiting.append(child)
        if beyond := [link for link in links if link not in reached]:
            raise ModelError(f"{self.path}: links {_listed(beyond)} go round in a circle; expected a tree")
        return roots[0]

    def _joint(self, name: str, joint: Element) -> UrdfJoint:
        where = f"{self.path}: joint {name!r}"
        kind = joint.get("type", "")
        if kind not in JOINT_TYPES:
            raise ModelError(f"{where} is {kind[:40]!r}; expected one of {', '.join(JOINT_TYPES)}")
        mimic, dynamics = joint.find("mimic"), joint.find("dynamics")
        moving = kind in MOVING
        damping, friction = (
            (numbers(where, dynamics, key, 1) or [0.0])[0] if moving else 0.0 for key in ("damping", "friction")
        )
        if damping < 0 or friction < 0:
            raise ModelError(f"{where}: damping {damping:g}, friction {friction:g}; expected none below 0")
        velocity, effort = (self._largest(name, joint, key) if moving else None for key in ("velocity", "effort"))
        return UrdfJoint(
            name=name,
            kind=kind,
            parent=child_name(joint, "parent"),
            child=child_name(joint, "child"),
            T_parent_joint=self._origin(f"joint {name!r}", joint.find("origin")),
            axis=self._axis(name, joint) if moving else np.array([1.0, 0.0, 0.0]),
            limits=self._limits(name, joint) if moving else None,
            velocity=velocity,
            effort=effort,
            damping=damping,
            friction=friction,
            mimics=None if mimic is None else mimic.get("joint", ""),
        )

    def _origin(self, what: str, origin: Element | None) -> Array:
        """Return a pose from xyz and rpy; what is missing is 0."""
        where = f"{self.path}: {what}"
        xyz = numbers(where, origin, "xyz", 3) or [0.0] * 3
        if quaternion := numbers(where, origin, "quat_xyzw", 4):  # of URDF 1.2
            if origin is not None and origin.get("rpy") is not None:
                raise ModelError(f"{where}: <origin> has both rpy and quat_xyzw; expected one of them")
            if abs(math.hypot(*quaternion) - 1) > SAME_TURN:
                raise ModelError(f"{where}: <origin quat_xyzw>: found length {math.hypot(*quaternion):.4g}; expected 1")
            return pose(xyz, quat=quaternion)
        rpy = numbers(where, origin, "rpy", 3) or [0.0] * 3
        if self.as_designed and origin is not None and any(rpy):
            rpy = [
                self._designed_angle(what, word, value)
                for word, value in zip(origin.get("rpy", "").split(), rpy, strict=True)
            ]
        return pose(xyz, euler=rpy, order="xyz")

    def _designed_angle(self, what: str, word: str, value: float) -> float:
        designed = _rounded_from(word, value)
        if designed != value:
            self.changes.append(f"{what}: rpy {word} read as {math.degrees(designed):.6g} degrees")
        return designed

    def _axis(self, name: str, joint: Element) -> Array:
        given = numbers(f"{self.path}: joint {name!r}", joint.find("axis"), "xyz", 3) or [1.0, 0.0, 0.0]
        largest = max(map(abs, given))
        if not largest > 0:
            raise ModelError(f"{self.path}: joint {name!r}: <axis xyz>: found 0 0 0; expected a direction")
        axis = np.array(given) / largest  # first, since squares of 1e200 overflow
        length = float(np.linalg.norm(axis))
        if not 1 - SAME_LENGTH < length * largest < 1 + SAME_LENGTH:
            self.warnings.append(f"joint {name!r}: axis has length {length * largest:.6g}; read as a direction")
        axis = axis / length
        nearest = np.round(axis)
        small = axis[nearest == 0]
        if self.as_designed and small.any() and all(_is_rounding_of_zero(float(x)) for x in small):
            self.changes.append(f"joint {name!r}: axis read as {' '.join(f'{x:g}' for x in nearest)}")
            return np.asarray(nearest)
        return axis

    def _limits(self, name: str, joint: Element) -> tuple[float, float] | None:
        limit, where = joint.find("limit"), f"{self.path}: joint {name!r}"
        lower, upper = (numbers(where, limit, key, 1) for key in ("lower", "upper"))
        if joint.get("type") == "continuous":
            return None
        if limit is None or (not lower and not upper):
            self.warnings.append(f"joint {name!r}: no limits; read as unlimited")
            return None
        low, high = (lower or [0.0])[0], (upper or [0.0])[0]
        if low == high == 0:
            self.warnings.append(f"joint {name!r}: limits [0, 0]; read as unlimited")
            return None
        if low > high:
            raise ModelError(f"{where}: limits [{low:g}, {high:g}] are the wrong way round")
        return low, high

    def _largest(self, name: str, joint: Element, key: str) -> float | None:
        limit = joint.find("limit")
        if limit is not None and limit.get(key, "").strip().lower() in ("inf", "+inf", "infinity"):
            self.warnings.append(f"joint {name!r}: {key} {limit.get(key)}; read as unlimited")
            return None
        found = numbers(f"{self.path}: joint {name!r}", limit, key, 1)
        if found and found[0] < 0:
            raise ModelError(f"{self.path}: joint {name!r}: {key} is {found[0]:g}; expected none below 0")
        if found and found[0] == 0:
            self.warnings.append(f"joint {name!r}: {key} 0; read as unlimited")
        return found[0] if found and found[0] > 0 else None

    def _link(self, name: str, link: Element, colors: Mapping[str, str]) -> UrdfLink:
        visuals, collisions = (tuple(self._shapes(name, link.findall(tag), colors)) for tag in ("visual", "collision"))
        return UrdfLink(name, self._inertial(name, link.find("inertial")), visuals, collisions)

    def _inertial(self, name: str, inertial: Element | None) -> Inertial | None:
        if inertial is None:
            return None
        where = f"{self.path}: link {name!r}"
        mass = numbers(where, inertial.find("mass"), "value", 1)
        listed = [
            numbers(where, inertial.find("inertia"), f"i{key}", 1) for key in ("xx", "yy", "zz", "xy", "yz", "xz")
        ]
        if not mass or not all(listed):
            raise ModelError(f"{where}: <inertial> lacks mass or inertia; expected value, ixx, iyy, izz, ixy, iyz, ixz")
        if mass[0] < 0:
            raise ModelError(f"{where}: mass is {mass[0]:g}; expected none below 0")
        (xx,), (yy,), (zz,), (xy,), (yz,), (xz,) = listed
        lowest, *_, highest = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if lowest < -(1e-12 + 1e-9 * abs(highest)):
            self.warnings.append(f"link {name!r}: no body has this inertia: a principal moment is {lowest:.3g} kg m^2")
        T = self._origin(f"link {name!r}: inertial", inertial.find("origin"))
        own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return Inertial(mass[0], T[:3, 3], T[:3, :3] @ own @ T[:3, :3].T)

    def _shapes(self, link: str, elements: Sequence[Element], colors: Mapping[str, str]) -> Iterator[UrdfShape]:
        if len(elements) > MAX_SHAPES:
            raise ModelError(f"{self.path}: link {link!r} has {len(elements)} shapes; expected {MAX_SHAPES} at most")
        for element in elements:
            what = f"link {link!r}: {element.tag}"
            T, color, geometry = self._origin(what, element.find("origin")), None, element.find("geometry")
            material = element.find("material")
            if material is not None:
                color = self._color(material) or colors.get(material.get("name", ""))
            shape = None if geometry is None else self._geometry(what, geometry, T, color)
            if shape is None:
                self.warnings.append(f"{what} has no geometry that dhkit knows; left out")
            elif max(*map(abs, shape.sizes), np.abs(T[:3, 3]).max()) > FAR:
                self.warnings.append(f"{what} is larger than {FAR:g} m or farther away; left out")
            else:
                yield shape

    def _geometry(self, what: str, geometry: Element, T: Array, color: str | None) -> UrdfShape | None:
        where = f"{self.path}: {what}"
        sizes: list[float] | None = None
        for element in geometry:
            match element.tag:
                case "mesh":
                    scale = numbers(where, element, "scale", 3) or [1.0, 1.0, 1.0]
                    if not all(scale) or not element.get("filename"):
                        self.warnings.append(f"{what}: a mesh without a file name or with scale 0; left out")
                        return None
                    return UrdfShape("mesh", tuple(scale), T, element.get("filename", ""), color)
                case "box":
                    sizes = numbers(where, element, "size", 3)
                case "cylinder" | "capsule":
                    sizes = [*numbers(where, element, "radius", 1), *numbers(where, element, "length", 1)]
                    sizes = sizes if len(sizes) == 2 else None
                case "sphere":
                    sizes = numbers(where, element, "radius", 1)
            if sizes and min(sizes) > 0:
                return UrdfShape(element.tag, tuple(sizes), T, color=color)
        return None

    def _color(self, material: Element) -> str | None:
        element = material.find("color")
        rgba = [] if element is None else element.get("rgba", "").split()
        try:
            levels = [round(255 * min(max(float(word), 0.0), 1.0)) for word in rgba[:3]]
        except ValueError:
            return None  # a colour is not worth a robot
        return "#{:02x}{:02x}{:02x}".format(*levels) if len(levels) == 3 else None


def _rounded_from(word: str, value: float) -> float:
    """Return the multiple of 15 degrees that a decimal of at least three digits rounds or cuts, or the value itself.

    A miss of a rounded right angle, such as 3.6732e-06, is read as 0.
    """
    if _is_rounding_of_zero(value):
        return 0.0
    step = round(value * 12 / math.pi) * math.pi / 12
    number = Decimal(word)
    digits, exponent = number.as_tuple().digits, number.as_tuple().exponent
    if len(digits) < LEAST_DIGITS or not isinstance(exponent, int) or abs(step) > 2 * math.pi + 1e-9 or exponent > 0:
        return value
    unit = Decimal(1).scaleb(exponent)
    exact = Decimal(step)
    nearest = (exact.quantize(unit, rounding) for rounding in (ROUND_HALF_EVEN, ROUND_DOWN))
    return step if number in nearest and step else value


def _is_rounding_of_zero(value: float) -> bool:
    """Return whether a small number is what is left of a right angle that was rounded: 1.5708 - pi/2 = 3.67e-6."""
    return abs(value) < 1e-12 or any(math.isclose(abs(value), miss, rel_tol=1e-3) for miss in _misses())


@lru_cache(maxsize=1)
def _misses() -> tuple[float, ...]:
    """Return how far right angles are from their decimals, rounded and cut, rad."""
    rights = [k * math.pi / 2 for k in range(1, 5)]
    misses = {abs(round(right, k) - right) for right in rights for k in DECIMALS}
    cut = {abs(math.floor(right * 10**k) / 10**k - right) for right in rights for k in DECIMALS}
    return tuple(miss for miss in misses | cut if miss < 2e-4)


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names)[:200]
