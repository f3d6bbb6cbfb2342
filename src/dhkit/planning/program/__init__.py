"""Nonlinear programs of tasks, in blocks of variables and rows, and the optimizer that solves them."""

from dhkit.planning.program.blocks import (
    Block,
    BlockProgram,
    Indices,
    LocalFunction,
    RowKind,
    Rows,
    Scaling,
)
from dhkit.planning.program.mesh import (
    MIN_LEG_INTERVALS,
    Curve,
    Knots,
    Mesh,
    corrected,
    knots_along,
)
from dhkit.planning.program.motion_program import (
    SMALL_ARM_JOINTS,
    MotionProgram,
    curves_for,
    leg_durations,
    straight_motion,
)
from dhkit.planning.program.optimization_program import (
    Arguments,
    Iterate,
    Margins,
    OptimizationProgram,
    Starts,
    Task,
    limit_rows,
    row_bounds,
    worst_row,
)
from dhkit.planning.program.problem import Problem
from dhkit.planning.program.solver import (
    Progress,
    ProgressCall,
    Solution,
    Solver,
    delayed_interrupts,
)
from dhkit.planning.program.work import MAX_ITERATIONS, SearchLimitError, Work

__all__ = [
    "MAX_ITERATIONS",
    "MIN_LEG_INTERVALS",
    "SMALL_ARM_JOINTS",
    "Arguments",
    "Block",
    "BlockProgram",
    "Curve",
    "Indices",
    "Iterate",
    "Knots",
    "LocalFunction",
    "Margins",
    "Mesh",
    "MotionProgram",
    "OptimizationProgram",
    "Problem",
    "Progress",
    "ProgressCall",
    "RowKind",
    "Rows",
    "Scaling",
    "SearchLimitError",
    "Solution",
    "Solver",
    "Starts",
    "Task",
    "Work",
    "corrected",
    "curves_for",
    "delayed_interrupts",
    "knots_along",
    "leg_durations",
    "limit_rows",
    "row_bounds",
    "straight_motion",
    "worst_row",
]
