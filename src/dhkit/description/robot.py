"""A robot as plain data: everything in its robot file, checked when it is made."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar, cast

from dhkit.description.named import Named
from dhkit.description.values import STANDARD_GRAVITY, Base, Convention, Joint, Tool, Units, Vector
from dhkit.display import html_block, html_lines, repr_line
from dhkit.expressions import Expression, substitute

if TYPE_CHECKING:
    from dhkit.description.numbers import Numbers

P = ParamSpec("P")
R = TypeVar("R")

Robot = Any
"""An arm, or its description."""


@dataclass(frozen=True)
class Description:
    """A serial robot as data: everything in its robot file, with exact numbers.

    Two descriptions are equal when they mean the same robot, whatever units their files were written in.

    Raises
    ------
    DescriptionError
        The values describe no robot; the message names joint and key, what was found and what was expected.
    """

    name: str
    convention: Convention
    joints: tuple[Joint, ...]
    parameters: Named[Expression] = field(default_factory=Named)
    gravity: Vector = STANDARD_GRAVITY
    """Free-fall acceleration in the world frame, m/s^2."""
    base: Base = field(default=Base())
    tool: Tool = field(default=Tool())
    configurations: Named[tuple[Expression, ...]] = field(default_factory=Named)
    """Joint vectors by name, rad and m."""
    source: str = ""
    notes: str = ""
    drawn: bool = True
    """Whether links and tools without shapes are drawn from the table, where other links have shapes."""
    units: Units = field(default=Units(), compare=False)
    """What :func:`dhkit.description.to_toml` writes numbers in."""
    mesh_folder: Path | None = field(default=None, compare=False)
    """The folder that mesh paths are relative to."""
    warnings: tuple[str, ...] = field(default=(), init=False, compare=False)
    """What is odd about the values, but carried on with."""

    def __post_init__(self) -> None:
        from dhkit.description.validation import check

        joints = tuple(
            joint if joint.name else replace(joint, name=f"joint{i}") for i, joint in enumerate(self.joints, start=1)
        )
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "warnings", check(self))

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.joints)

    @property
    def kinds(self) -> str:
        """One letter a joint, R or P."""
        return "".join("R" if joint.is_revolute else "P" for joint in self.joints)

    @cached_property
    def numbers(self) -> Numbers:
        """The float view: read-only arrays of the table, the limits, bodies and drives."""
        from dhkit.description.numbers import Numbers

        return Numbers.of(self)

    @property
    def reach(self) -> float:
        """An upper bound of the distance from frame 0 to frame n: the sum of abs(a) + abs(d) + stroke, m."""
        return self.numbers.reach

    @cached_property
    def digest(self) -> str:
        """What two descriptions of one robot have in common, in twelve characters: of its file's text.

        Examples
        --------
        >>> from dhkit.description.library import library_robot
        >>> len(library_robot("puma560").digest)
        12
        """
        from dhkit.description.toml_writer import to_toml

        return hashlib.sha256(to_toml(self).encode()).hexdigest()[:12]

    # Whatever is made once for a robot is found by its hash, on every call: it is worked out once.
    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash(tuple(getattr(self, item.name) for item in fields(self) if item.compare))

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields alone: what is worked out from them is worked out anew, and hashes of text differ by process."""
        return {item.name: getattr(self, item.name) for item in fields(self)}

    def __repr__(self) -> str:
        bodies = sum(bool(joint.bodies) for joint in self.joints)
        return repr_line(
            f"Description {self.name}",
            said=f"{self.kinds}, {self.convention.value} DH, bodies on {bodies} of {self.n} links",
        )

    def _repr_html_(self) -> str:
        from dhkit.description.table import DHTable

        values = [f"{name} = {value:.6g}" for name, value in self.numbers.values.items()]
        lines = [*self.carried_words, *([f"parameters (SI): {', '.join(values)}"] if values else [])]
        lines += [f"warning: {warning}" for warning in self.warnings]
        return html_block(self.name, DHTable.of(self)._repr_html_(), html_lines(lines))

    @property
    def carried_words(self) -> list[str]:
        """Where the tool is in the last frame, unless there, and the mass of payloads, in words."""
        from dhkit.description.parameters import resolved

        found = []
        x, y, z = (float(entry) + 0.0 for entry in self.numbers.T_last_tool[:3, 3])
        if (x, y, z) != (0.0, 0.0, 0.0):
            found.append(f"tool at ({x:.4g}, {y:.4g}, {z:.4g}) m")
        values = resolved(self.parameters)
        masses = [body.mass for body in self.joints[-1].bodies if body.name.startswith("payload")]
        if masses:
            found.append(f"carrying {sum(float(substitute(mass, values)) for mass in masses):.4g} kg")
        return found


def takes_robot(function: Callable[Concatenate[Description, P], R]) -> Callable[Concatenate[Robot, P], R]:
    """Let a function that takes a description take an arm as well: its first argument, or ``description=``."""

    @wraps(function)
    def taking(*arguments: Any, **options: Any) -> R:
        if arguments:
            if not isinstance(arguments[0], Description):
                arguments = (description_of(arguments[0]), *arguments[1:])
        elif "description" in options:
            options["description"] = description_of(options["description"])
        return function(*arguments, **options)

    taking.takes_robot = True  # type: ignore[attr-defined]  # for the test that finds functions without
    return cast("Callable[Concatenate[Robot, P], R]", taking)


def description_of(robot: Robot) -> Description:
    """Return the description of an arm, or itself.

    Raises
    ------
    TypeError
        Neither.
    """
    found = getattr(robot, "description", robot)
    if not isinstance(found, Description):
        raise TypeError(f"found {type(robot).__name__}; expected an arm or its description")
    return found
