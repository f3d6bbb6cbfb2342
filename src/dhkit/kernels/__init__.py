"""Programs as batch functions: interpreted by CasADi's virtual machine, or compiled to SIMD blocks by LLVM."""

from dhkit.kernels.batches import check_whole, fill, pose_rows, result_array
from dhkit.kernels.kernel import Kernel, kernel, kernel_mode
from dhkit.kernels.threads import in_threads

__all__ = ["Kernel", "check_whole", "fill", "in_threads", "kernel", "kernel_mode", "pose_rows", "result_array"]
