"""The robots of the package example-robot-data, found through its own list of files and loaded by name."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from dhkit.display import counted, repr_line
from dhkit.errors import ModelError
from dhkit.model.urdf_chain import chain_tips, only_tip, tool_frame
from dhkit.model.urdf_reader import read_urdf
from dhkit.model.urdf_tree import UrdfJoint, UrdfTree

_PACKAGE = "example-robot-data"
_PREFIX = "example:"
_MAX_ARM_JOINTS = 7
"""Largest number of joints of an arm; longer chains go through a trunk."""
_NAME_ENDINGS = ("_robot", "_description", "_data")
"""Endings of names of files and folders that are left out of names of robots."""


@dataclass(frozen=True)
class ExampleChain:
    """A chain that loads by name.

    Attributes
    ----------
    name
        The name for ``Arm.load``: ``example:ur5``, or ``example:allegro_left_hand#link_3_tip`` where there are several.
    path, base, tip
        The URDF, and the chain's first and last link; the root if ``base`` is None.
    joints
        Names of the moving joints.
    """

    name: str
    path: Path
    base: str | None
    tip: str
    joints: tuple[str, ...]

    def __repr__(self) -> str:
        return repr_line(
            f"ExampleChain {self.name}", "", f"{counted(len(self.joints), 'joint')} to {self.tip}"
        )


@lru_cache(maxsize=1)
def example_robots() -> dict[str, Path]:
    """Return the package's URDFs by name: the file's name, after its folder's where two files have the same.

    Returns
    -------
    dict[str, Path]
        URDF files by name.

    Raises
    ------
    ModelError
        The package is not installed.

    Examples
    --------
    >>> example_robots()["panda"]  # doctest: +SKIP
    """
    try:
        files = distribution(_PACKAGE).files or []
    except PackageNotFoundError:
        raise ModelError(
            f"the package {_PACKAGE} is not installed; pip install {_PACKAGE} (414 MB)"
        ) from None
    paths = sorted(
        Path(str(file.locate())).resolve() for file in files if file.name.endswith(".urdf")
    )
    # ur3.urdf is a robot without links.
    paths = [path for path in paths if b"<link" in path.read_bytes()]
    stems = [_without_ending(path.stem) for path in paths]
    # anymal.urdf lies in the folders of two robots
    named = {
        stem if stems.count(stem) == 1 else _without_ending(_robot_folder(path)): path
        for stem, path in zip(stems, paths, strict=True)
    }
    return dict(sorted(named.items()))


def example_urdf(name: str) -> Path:
    """Return the URDF of an example robot.

    Parameters
    ----------
    name
        Name of a robot of example-robot-data.

    Returns
    -------
    Path
        The URDF.

    Raises
    ------
    ModelError
        No such robot, or the package is not installed.

    Examples
    --------
    >>> example_urdf("panda")  # doctest: +SKIP
    """
    robots = example_robots()
    if name not in robots:
        raise ModelError(f"no example robot {name[:60]!r}; there are {', '.join(robots)}")
    return robots[name]


def urdf_source(name: str) -> tuple[Path, str | None, str | None]:
    """Return the file, base and tip of a name.

    A name is a path, or ``example:`` and the name of an example robot; after it ``#TIP`` or ``#BASE..TIP`` may name
    the links between which the chain lies. A file that exists under the whole name is that file.

    Parameters
    ----------
    name
        Path, or ``example:NAME``, with or without ``#TIP`` or ``#BASE..TIP``.

    Returns
    -------
    tuple[Path, str | None, str | None]
        File, first and last link of the chain; None where the name does not give them.

    Raises
    ------
    ModelError
        No such example robot.

    Examples
    --------
    >>> urdf_source("robots/two_arms.urdf#left_base..left_hand")[1:]
    ('left_base', 'left_hand')
    """
    if not name.startswith(_PREFIX) and Path(name).is_file():
        return Path(name), None, None
    source, _, links = name.rpartition("#") if "#" in name else (name, "", "")
    base, between, tip = links.partition("..")
    path = (
        example_urdf(source.removeprefix(_PREFIX)) if source.startswith(_PREFIX) else Path(source)
    )
    return (path, base or None, tip or None) if between else (path, None, links or None)


def example_chains() -> Iterator[ExampleChain]:
    """Return the chains from root to leaf of every example robot: arms, legs, fingers.

    For a chain with more than seven joints, the limb after the last branching is listed too. Chains with joints that
    follow others are left out. Of several frames after one joint the tool's is taken, or the first.

    Yields
    ------
    ExampleChain
        A chain, named as ``Arm.load`` accepts it.

    Raises
    ------
    ModelError
        The package example-robot-data is not installed.

    Examples
    --------
    >>> names = [chain.name for chain in example_chains()]  # doctest: +SKIP
    """
    for name, path in example_robots().items():
        tree = read_urdf(path)
        tips = chain_tips(tree)
        for joints, leaves in tips.items():
            tip = tool_frame(leaves) or leaves[0]
            ending = "" if tip == only_tip(tree, tree.root) else f"#{tip}"
            yield ExampleChain(f"{_PREFIX}{name}{ending}", path, None, tip, joints)
            limb = _limb(tree, tip) if len(joints) > _MAX_ARM_JOINTS else ()
            if 0 < len(limb) < len(joints):
                base = limb[0].parent
                limb_joints = tuple(joint.name for joint in limb)
                yield ExampleChain(f"{_PREFIX}{name}#{base}..{tip}", path, base, tip, limb_joints)


def _limb(tree: UrdfTree, tip: str) -> tuple[UrdfJoint, ...]:
    """Return the moving joints to a tip after the last link on which several moving joints hang."""

    def carrier(link: str) -> str:
        """Return the first of the links that a link is fixed to."""
        while (joint := tree.parent_joint.get(link)) is not None and joint.is_fixed:
            link = joint.parent
        return link

    carriers = Counter(
        carrier(joint.parent) for joint in tree.joints.values() if not joint.is_fixed
    )
    chain = [joint for joint in tree.joints_to(tip) or () if not joint.is_fixed]
    branchings = [k for k, joint in enumerate(chain) if carriers[carrier(joint.parent)] > 1]
    return tuple(chain[max(branchings, default=0) :])


def _without_ending(name: str) -> str:
    for ending in _NAME_ENDINGS:
        name = name.removesuffix(ending)
    return name


def _robot_folder(path: Path) -> str:
    """Return the name of a robot's folder in the package: the one that holds urdf/ or robots/."""
    return next(
        (parent.name for parent in path.parents if parent.name.endswith(_NAME_ENDINGS)),
        path.parent.name,
    )
