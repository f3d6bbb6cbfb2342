"""Files of other people, executed in processes of their own, isolated where the system can, within limits."""

from dhkit.execution.isolation import Isolation, IsolationError, Kind, find_isolation
from dhkit.execution.process import Limits, ProgramError

__all__ = ["Isolation", "IsolationError", "Kind", "Limits", "ProgramError", "find_isolation"]
