"""A URDF read by yourdfpy, compared with the frames and inertials that Pinocchio and dhkit read."""

from __future__ import annotations

import io
import logging
from collections.abc import Iterator

import numpy as np

from dhkit.description import Array
from dhkit.model.urdf_chain import BASE_FRAME, TIP_FRAME, Chain, chain_text

_TOLERANCE = 1e-9
"""Largest difference of a frame's entries, and of masses, centres and moments of inertia, that counts as agreement."""
_STATES = 10
"""Number of states at which the tool's pose is compared."""


def second_opinion(chain: Chain, q: Array, tools: Array) -> Iterator[str]:
    """Yield a sentence on whether yourdfpy reads the same frames and inertials; it reads incomplete files otherwise.

    Parameters
    ----------
    chain
        A chain of a URDF that passed the gate.
    q
        Joint values, shape (N, n), rad and m; the first ten are compared.
    tools
        The tip in the base at those values by Pinocchio, shape (N, 4, 4).
    """
    try:
        import yourdfpy
    except ImportError:
        return
    # yourdfpy logs its own warnings; our sentences report what differs.
    logging.getLogger("yourdfpy").setLevel(logging.CRITICAL)
    try:
        text = io.BytesIO(chain_text(chain).encode())
        robot = yourdfpy.URDF.load(text, load_meshes=False, build_scene_graph=True)
        states = zip(q[:_STATES], tools[:_STATES], strict=True)
        difference = max(_tool_difference(robot, chain, state, tool) for state, tool in states)
    except Exception as error:  # a second reader that fails says nothing about the file
        message = " ".join(str(error).split())[:120]
        yield f"yourdfpy does not read it: {message or type(error).__name__}"
        return

    links: list[str] = []
    for group in chain.groups:
        links += group
    different = [name for name in links if not _same_inertial(robot, chain, name)]
    version = getattr(yourdfpy, "__version__", "")
    if difference <= _TOLERANCE and not different:
        yield f"yourdfpy {version} reads the same frames (within {difference:.1e}) and inertials"
    if difference > _TOLERANCE:
        yield f"yourdfpy {version} puts the tool {difference:.1e} away from where Pinocchio has it"
    if different:
        yield f"yourdfpy {version} reads other inertials of links {', '.join(different)[:200]}"


def _tool_difference(robot: object, chain: Chain, q: Array, tool: Array) -> float:
    """Return the largest difference of the tip's pose in the base, m and rotation entries, at joint values q (n,)."""
    robot.update_cfg(dict(zip(chain.names, q.tolist(), strict=True)))  # type: ignore[attr-defined]
    T = robot.get_transform(TIP_FRAME, BASE_FRAME)  # type: ignore[attr-defined]
    return float(np.abs(T - tool).max())


def _same_inertial(robot: object, chain: Chain, name: str) -> bool:
    """Return whether a link has the same mass, centre of mass and inertia in both readings, or none in either."""
    ours = chain.tree.links[name].inertial
    theirs = robot.link_map[name].inertial  # type: ignore[attr-defined]
    if ours is None or theirs is None:
        return ours is None and theirs is None

    # In the link's axes: I = R I_own R^T
    T = np.eye(4) if theirs.origin is None else np.asarray(theirs.origin, dtype=float)
    R = T[:3, :3]
    com = T[:3, 3]
    inertia = R @ np.asarray(theirs.inertia, dtype=float) @ R.T

    largest_inertia = max(1.0, float(np.abs(ours.inertia).max()))
    same_mass = abs(theirs.mass - ours.mass) <= _TOLERANCE * max(1.0, ours.mass)
    same_com = np.abs(com - ours.com).max() <= _TOLERANCE
    same_inertia = np.abs(inertia - ours.inertia).max() <= _TOLERANCE * largest_inertia
    return bool(same_mass and same_com and same_inertia)
