"""Straight-line programs as batch functions: SIMD blocks compiled by Numba and cached on disk, or NumPy."""

from dhkit.kernels.batches import check_whole, fill, pose_rows, result_array
from dhkit.kernels.kernel import Kernel, compiling, kernel

__all__ = ["Kernel", "check_whole", "compiling", "fill", "kernel", "pose_rows", "result_array"]
