"""A robot as plain data: everything in its robot file, checked by the constructor."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

from dhkit.cached_property import cached_property
from dhkit.description.bodies import Body
from dhkit.description.numbers import Numbers
from dhkit.description.parameters import resolved
from dhkit.description.robot_data import Robot, RobotData, data_of
from dhkit.description.table import DHTable
from dhkit.description.toml_writer import toml_text
from dhkit.description.validation import check
from dhkit.display import html_block, html_lines, repr_line
from dhkit.errors import DescriptionError
from dhkit.expressions import substitute

P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Description(RobotData):
    """A serial robot as data: everything in its robot file, with exact numbers.

    Two descriptions are equal when they mean the same robot, whatever units their files were written in.

    Raises
    ------
    DescriptionError
        The values describe no robot; the message names joint and key, the value found and the value expected.
    """

    def __post_init__(self) -> None:
        joints = tuple(
            joint if joint.name else replace(joint, name=f"joint{i}")
            for i, joint in enumerate(self.joints, start=1)
        )
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "warnings", check(self))

    @cached_property
    def numbers(self) -> Numbers:
        """The float view: read-only arrays of the table, the limits, bodies and drives."""
        return Numbers.of(self)

    @property
    def reach(self) -> float:
        """Length of the arm, m: the sum of abs(a) + abs(d) and of the prismatic joints' finite strokes.

        Where nearly parallel axes make a and d far longer than the arm, the lengths between joint centres, the tool
        included, are summed instead (:mod:`dhkit.description.joint_centres`). With limits on all prismatic joints it
        bounds the distance from frame 0 to frame n or, in the second case, to the tool.
        """
        return self.numbers.reach

    @cached_property
    def digest(self) -> str:
        """First twelve hexadecimal digits of the SHA-256 of its robot file's text.

        Equal robots written in the same units have equal digests; the units are part of the text.

        Examples
        --------
        >>> from dhkit.description.library import library_robot
        >>> len(library_robot("puma560").digest)
        12
        """
        return hashlib.sha256(toml_text(self).encode()).hexdigest()[:12]

    # Caches are looked up by a description's hash on every call, so it is computed once.
    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash(tuple(getattr(self, item.name) for item in fields(self) if item.compare))

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields alone, without cached values: hashes of texts differ from process to process."""
        return {item.name: getattr(self, item.name) for item in fields(self)}

    def __repr__(self) -> str:
        bodies = sum(bool(joint.bodies) for joint in self.joints)
        text = f"{self.kinds}, {self.convention.value} DH, bodies on {bodies} of {self.n} links"
        return repr_line(f"Description {self.name}", "", text)

    def _repr_html_(self) -> str:
        values = [f"{name} = {value:.6g}" for name, value in self.numbers.values.items()]
        lines = [*self.tool_texts, *([f"parameters (SI): {', '.join(values)}"] if values else [])]
        lines += [f"warning: {warning}" for warning in self.warnings]
        return html_block(self.name, DHTable.of(self)._repr_html_(), html_lines(lines))

    @property
    def tool_texts(self) -> list[str]:
        """Texts about the tool: its position in frame n, unless at the origin, and the payloads' mass, if any."""
        texts = []
        x, y, z = (float(entry) + 0.0 for entry in self.numbers.T_last_tool[:3, 3])
        if (x, y, z) != (0.0, 0.0, 0.0):
            texts.append(f"tool at ({x:.4g}, {y:.4g}, {z:.4g}) m")
        values = resolved(self.parameters)
        masses = [body.mass for body in self.joints[-1].bodies if body.is_payload]
        if masses:
            texts.append(
                f"carrying {sum(float(substitute(mass, values)) for mass in masses):.4g} kg"
            )
        return texts


def takes_robot(
    function: Callable[Concatenate[Description, P], R],
) -> Callable[Concatenate[Robot, P], R]:
    """Return a function of a description that takes an arm as well, as first argument or as ``description=``.

    Parameters
    ----------
    function
        Function whose first parameter is ``description``.

    Returns
    -------
    Callable
        The same function for a description or an arm.

    Examples
    --------
    >>> from dhkit import Arm
    >>> @takes_robot
    ... def joint_count(description):
    ...     return description.n
    >>> joint_count(Arm.load("planar2r"))
    2
    """

    @wraps(function)
    def wrapper(*arguments: Any, **options: Any) -> R:
        if arguments:
            if not isinstance(arguments[0], Description):
                arguments = (description_of(arguments[0]), *arguments[1:])
        elif "description" in options:
            options["description"] = description_of(options["description"])
        return function(*arguments, **options)

    wrapper.takes_robot = True  # type: ignore[attr-defined]  # for the test that finds functions without
    return cast("Callable[Concatenate[Robot, P], R]", wrapper)


def description_of(robot: Robot) -> Description:
    """Return the description of an arm, or itself.

    Parameters
    ----------
    robot
        Description, or an arm.

    Returns
    -------
    Description
        The robot as data; the argument itself if it is a description.

    Raises
    ------
    TypeError
        Neither.

    Examples
    --------
    >>> from dhkit import Arm
    >>> description_of(Arm.load("planar2r")).name
    'planar2r'
    """
    return cast("Description", data_of(robot))


@takes_robot
def require_bodies(description: Description) -> tuple[tuple[Body, ...], ...]:
    """Return the bodies of each link, and refuse an arm whose dynamics are unknown.

    Parameters
    ----------
    description
        The robot.

    Returns
    -------
    tuple[tuple[Body, ...], ...]
        For each link its bodies, at least one.

    Raises
    ------
    DescriptionError
        Names the joints whose links have no body.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> [len(bodies) for bodies in require_bodies(library_robot("planar2r"))]
    [1, 1]
    """
    bare = [
        f"{i} ({joint.name})"
        for i, joint in enumerate(description.joints, start=1)
        if not joint.bodies
    ]
    if bare:
        plural, verb = ("s", "have") if len(bare) > 1 else ("", "has")
        raise DescriptionError(
            f"{description.name}: the link{plural} of joint{plural} {', '.join(bare)} {verb} no body, so the dynamics "
            "are unknown; add [joint.body], or use with_uniform_links (--uniform-links in commands that have it)"
        )
    return tuple(joint.bodies for joint in description.joints)
