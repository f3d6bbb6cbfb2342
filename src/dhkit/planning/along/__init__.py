"""Time-optimal and other motions along a given path, by a program in the squared path speed."""

from dhkit.planning.along.path_motion import along_path

__all__ = ["along_path"]
