"""Programs as batch functions: interpreted by CasADi's virtual machine, or compiled to SIMD blocks by LLVM."""

from dhkit.kernels.batches import check_whole, fill, pose_rows, result_array
from dhkit.kernels.elementary import EXACT_RANGE
from dhkit.kernels.kernel import SMALL_BATCH, Kernel, kernel, kernel_mode, uncounted
from dhkit.kernels.single_calls import FastCall, SingleCall, never, unpacked
from dhkit.kernels.threads import all_in_threads, in_threads

__all__ = [
    "EXACT_RANGE",
    "SMALL_BATCH",
    "FastCall",
    "Kernel",
    "SingleCall",
    "all_in_threads",
    "check_whole",
    "fill",
    "in_threads",
    "kernel",
    "kernel_mode",
    "never",
    "pose_rows",
    "result_array",
    "uncounted",
    "unpacked",
]
