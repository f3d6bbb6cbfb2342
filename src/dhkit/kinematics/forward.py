"""Forward kinematics: where the tool and the frames are."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array, world_to_frames, world_to_tool
from dhkit.kinematics.batches import in_blocks

__all__ = ["forward_kinematics", "frames"]


def forward_kinematics(description: Description, q: ArrayLike, out: Array | None = None, threads: int = 1) -> Array:
    """Return the tool's pose in the world, T_world_tool = base A_1 ... A_n tool.

    Parameters
    ----------
    description
        The robot.
    q
        Joint values, shape (..., n), rad and m.
    out
        Where to write, shape (..., 4, 4), float64, contiguous.
    threads
        How many threads share a large batch.

    Returns
    -------
    Array
        Shape (..., 4, 4); a row of NaN where q has one.

    Raises
    ------
    ValueError, TypeError
        q has not shape (..., n) or is not numeric; ``out`` does not fit.
    """
    states = (joint_array(description, q),)
    return in_blocks(lambda block: world_to_tool(description, block), states, (4, 4), out, threads)


def frames(description: Description, q: ArrayLike, out: Array | None = None, threads: int = 1) -> Array:
    """Return DH frames 0 ... n in the world, shape (..., n+1, 4, 4); arguments as for :func:`forward_kinematics`."""
    states = (joint_array(description, q),)
    tail = (description.n + 1, 4, 4)
    return in_blocks(lambda block: world_to_frames(description, block), states, tail, out, threads)
