"""The lab: an arm in the browser with panels to move, drive, edit, plan and control it."""

from dhkit.lab.assignment import Assignment
from dhkit.lab.lab import Lab
from dhkit.lab.serving import serve

__all__ = ["Assignment", "Lab", "serve"]
