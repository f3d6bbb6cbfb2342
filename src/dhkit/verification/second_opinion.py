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
        robot = yourdfpy.URDF.load(io.BytesIO(chain_text(chain).encode()), load_meshes=False, build_scene_graph=True)
        frames = max(_tool_difference(robot, chain, *state) for state in zip(q[:_STATES], tools, strict=False))
    except Exception as error:  # a second reader that fails says nothing about the file
        yield f"yourdfpy does not read it: {' '.join(str(error).split())[:120] or type(error).__name__}"
        return
    links = [link for group in chain.groups for link in group]
    different = [name for name in links if not _same_inertial(robot, chain, name)]
    version = getattr(yourdfpy, "__version__", "")
    if frames <= _TOLERANCE and not different:
        yield f"yourdfpy {version} reads the same frames (within {frames:.1e}) and inertials"
    if frames > _TOLERANCE:
        yield f"yourdfpy {version} puts the tool {frames:.1e} away from where Pinocchio has it"
    if different:
        yield f"yourdfpy {version} reads other inertials of links {', '.join(different)[:200]}"


def _tool_difference(robot: object, chain: Chain, q: Array, tool: Array) -> float:
    robot.update_cfg(dict(zip(chain.names, q.tolist(), strict=True)))  # type: ignore[attr-defined]
    T = robot.get_transform(TIP_FRAME, BASE_FRAME)  # type: ignore[attr-defined]
    return float(np.abs(T - tool).max())


def _same_inertial(robot: object, chain: Chain, name: str) -> bool:
    ours = chain.tree.links[name].inertial
    theirs = robot.link_map[name].inertial  # type: ignore[attr-defined]
    if ours is None or theirs is None:
        return ours is None and theirs is None
    T = np.eye(4) if theirs.origin is None else np.asarray(theirs.origin, dtype=float)
    inertia = T[:3, :3] @ np.asarray(theirs.inertia, dtype=float) @ T[:3, :3].T
    size = max(1.0, float(np.abs(ours.inertia).max()))
    return bool(
        abs(theirs.mass - ours.mass) <= _TOLERANCE * max(1.0, ours.mass)
        and np.abs(T[:3, 3] - ours.com).max() <= _TOLERANCE
        and np.abs(inertia - ours.inertia).max() <= _TOLERANCE * size
    )
