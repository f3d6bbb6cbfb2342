"""Programs of other people, run in processes of their own and compared with an arm."""

from dhkit.execution.isolation import Isolation, IsolationError, find_isolation
from dhkit.execution.process import Limits, ProgramError
from dhkit.programs.check_report import CheckReport, Part
from dhkit.programs.checks import check
from dhkit.programs.program import FUNCTIONS, Program, protect_from_children
from dhkit.programs.random_poses import random_states
from dhkit.programs.rubric import CheckRubric

__all__ = [
    "FUNCTIONS",
    "CheckReport",
    "CheckRubric",
    "Isolation",
    "IsolationError",
    "Limits",
    "Part",
    "Program",
    "ProgramError",
    "check",
    "find_isolation",
    "protect_from_children",
    "random_states",
]
