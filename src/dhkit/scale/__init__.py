"""Work on many processes or machines by dask: workspaces, batches, simulations, plans and grades (extra ``scale``).

The result of a task depends on its arguments alone. A worker that is lost costs the tasks that it was working on, and
those whose results it still held: dask computes them again elsewhere, with the same digits.
"""

from dhkit.scale.arrays import fk, forward_dynamics, ik, inverse_dynamics, jacobian, map_states
from dhkit.scale.clusters import connected, prepare
from dhkit.scale.grades import grade_many
from dhkit.scale.runs import plan_many, simulate_many
from dhkit.scale.workspaces import save_workspace, workspace

__all__ = [
    "connected",
    "fk",
    "forward_dynamics",
    "grade_many",
    "ik",
    "inverse_dynamics",
    "jacobian",
    "map_states",
    "plan_many",
    "prepare",
    "save_workspace",
    "simulate_many",
    "workspace",
]
