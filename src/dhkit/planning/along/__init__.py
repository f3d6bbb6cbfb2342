"""Motions along a given path: how fast, by a program in the squares of its speed."""

from dhkit.planning.along.path_motion import along_path

__all__ = ["along_path"]
