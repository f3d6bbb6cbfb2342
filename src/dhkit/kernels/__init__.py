"""Straight-line programs as batch functions: SIMD blocks compiled by Numba and cached on disk, or NumPy."""

from dhkit.kernels.kernel import Kernel, compiling, kernel

__all__ = ["Kernel", "compiling", "kernel"]
