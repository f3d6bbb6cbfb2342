"""The robots of the package example-robot-data, found through its own list of files and loaded by name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from dhkit.errors import ModelError
from dhkit.model.urdf_chain import chain_tips, only_tip, tool_frame
from dhkit.model.urdf_tree import read_urdf

__all__ = ["ExampleChain", "example_chains", "example_robots", "example_urdf", "urdf_source"]

PACKAGE = "example-robot-data"
PREFIX = "example:"
ENDINGS = ("_robot", "_description", "_data")
"""What names of files and folders have that names of robots do not."""


@dataclass(frozen=True)
class ExampleChain:
    """A chain that loads by name.

    Attributes
    ----------
    name
        What ``Arm.load`` takes: ``example:ur5``, or ``example:allegro_left_hand#link_3_tip`` where there are several.
    path, tip
        The URDF and the chain's last link.
    joints
        Names of the moving joints.
    """

    name: str
    path: Path
    tip: str
    joints: tuple[str, ...]


@lru_cache(maxsize=1)
def example_robots() -> dict[str, Path]:
    """Return the package's URDFs by name: the file's name, after its folder's where two files have the same.

    Raises
    ------
    ModelError
        The package is not installed.
    """
    try:
        files = distribution(PACKAGE).files or []
    except PackageNotFoundError:
        raise ModelError(f"the package {PACKAGE} is not installed; pip install {PACKAGE} (414 MB)") from None
    paths = sorted(Path(str(file.locate())).resolve() for file in files if file.name.endswith(".urdf"))
    paths = [path for path in paths if b"<link" in path.read_bytes()]  # ur3.urdf is a robot without links
    stems = [_without_ending(path.stem) for path in paths]
    # anymal.urdf lies in the folders of two robots
    named = {
        stem if stems.count(stem) == 1 else _without_ending(_robot_folder(path)): path
        for stem, path in zip(stems, paths, strict=True)
    }
    return dict(sorted(named.items()))


def example_urdf(name: str) -> Path:
    """Return the URDF of an example robot.

    Raises
    ------
    ModelError
        No such robot, or the package is not installed.
    """
    robots = example_robots()
    if name not in robots:
        raise ModelError(f"no example robot {name[:60]!r}; there are {', '.join(robots)}")
    return robots[name]


def urdf_source(name: str) -> tuple[Path, str | None, str | None]:
    """Return the file, base and tip that a name stands for.

    A name is a path, or ``example:`` and the name of an example robot; after it ``#TIP`` or ``#BASE..TIP`` may name
    the links between which the chain lies.

    Raises
    ------
    ModelError
        No such example robot.
    """
    source, _, links = name.partition("#")
    base, between, tip = links.partition("..")
    path = example_urdf(source.removeprefix(PREFIX)) if source.startswith(PREFIX) else Path(source)
    return (path, base or None, tip or None) if between else (path, None, links or None)


def example_chains() -> Iterator[ExampleChain]:
    """Return the chains from root to leaf of every example robot: arms, legs, fingers.

    Chains with joints that follow others are left out. Of frames behind the same joint the tool's
    is taken, else the first.
    """
    for name, path in example_robots().items():
        tree = read_urdf(path)
        tips = chain_tips(tree)
        for joints, leaves in tips.items():
            tip = tool_frame(leaves) or leaves[0]
            ending = "" if tip == only_tip(tree, tree.root) else f"#{tip}"
            yield ExampleChain(f"{PREFIX}{name}{ending}", path, tip, joints)


def _without_ending(name: str) -> str:
    for ending in ENDINGS:
        name = name.removesuffix(ending)
    return name


def _robot_folder(path: Path) -> str:
    """Return the name of a robot's folder in the package: the one that holds urdf/ or robots/."""
    return next((parent.name for parent in path.parents if parent.name.endswith(ENDINGS)), path.parent.name)
