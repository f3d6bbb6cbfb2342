"""A robot's fields as its file holds them, not checked; checks, float view and printers take this class."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, TypeAlias

from dhkit.description.bodies import Vector
from dhkit.description.named import Named
from dhkit.description.values import (
    STANDARD_GRAVITY,
    Base,
    Convention,
    Coupling,
    Joint,
    Tool,
    Units,
)
from dhkit.expressions import Expression


@dataclass(frozen=True)
class RobotData:
    """The fields of a :class:`dhkit.description.Description`, which is the one class that derives from this."""

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
    couplings: tuple[Coupling, ...] = ()
    """Inertias of drives that turn with two joints; at most one of each two joints."""
    source: str = ""
    notes: str = ""
    drawn: bool = True
    """Whether links and tool without shapes are drawn from the table although other links have shapes."""
    units: Units = field(default=Units(), compare=False)
    """Units in which :func:`dhkit.description.to_toml` writes numbers."""
    mesh_folder: Path | None = field(default=None, compare=False)
    """The folder that mesh paths are relative to."""
    warnings: tuple[str, ...] = field(default=(), init=False, compare=False)
    """Unusual values that make no error, one line each."""

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.joints)

    @property
    def kinds(self) -> str:
        """One letter a joint, R or P."""
        return "".join("R" if joint.is_revolute else "P" for joint in self.joints)


class HasDescription(Protocol):
    """An arm, or another object that carries a description."""

    @property
    def description(self) -> RobotData:
        """The robot as data."""


Robot: TypeAlias = RobotData | HasDescription
"""An arm, or its description."""


def data_of(robot: Robot) -> RobotData:
    """Return the description of an arm, or itself.

    Raises
    ------
    TypeError
        Neither.
    """
    data = getattr(robot, "description", robot)
    if not isinstance(data, RobotData):
        raise TypeError(f"found {type(robot).__name__}; expected an arm or its description")
    return data
