"""The package ssik as a peer: its solutions of an arm's poses, from the arm's axes."""

import numpy as np

from dhkit.kinematics.axes import Axes


def solutions_of(description, poses):
    """Return the solutions of each pose (N, 4, 4), a list of arrays (K, n), inside limits or not."""
    import ssik

    axes = Axes.of(description)
    # ssik's P: from the world to the first axis, from axis to axis, and to the tool; its H: the axes' directions.
    offsets = np.diff(axes.points, axis=0, prepend=0.0, append=axes.T_world_tool[None, :3, 3])
    solver = ssik.Manipulator.from_axes(axes.directions, offsets)
    solver.prepare()
    # ssik's tool has the world's axes at q = 0.
    turn = np.eye(4)
    turn[:3, :3] = axes.T_world_tool[:3, :3].T
    found = [solver.solve(goal, respect_limits=False) for goal in poses @ turn]
    return [np.array([s.q for s in some], dtype=float).reshape(-1, description.n) for some in found]
