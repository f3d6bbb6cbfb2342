"""The machine of a benchmark: processor, Python and packages; nothing that names a host or a person."""

from __future__ import annotations

import os
import platform
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from dhkit.display import repr_line
from dhkit.kernels import kernel_mode

_FLAGS = ("sse4_2", "avx", "avx2", "fma", "avx512f", "avx512dq", "avx512vl", "asimd", "sve")
PACKAGES = (
    "dhkit-robotics",
    "numpy",
    "scipy",
    "llvmlite",
    "pin",
    "EAIK",
    "py-opw-kinematics",
    "ssik",
    "roboticstoolbox-python",
    "ikpy",
    "casadi",
    "toppra",
)


@dataclass(frozen=True)
class Machine:
    """The machine that a benchmark ran on.

    Attributes
    ----------
    processor
        Model of the processor.
    cores
        Number of cores that this process may use.
    flags
        Vector instruction sets that kernels use.
    system
        Operating system and architecture.
    python
        Implementation and version.
    packages
        Versions of the packages, by name; those that are not installed are left out.
    kernels
        The setting ``DHKIT_KERNELS``: auto, on or off.
    """

    processor: str
    cores: int
    flags: tuple[str, ...]
    system: str
    python: str
    packages: dict[str, str]
    kernels: str

    @property
    def facts(self) -> tuple[str, str, str]:
        """Lines of a report: processor, system, packages."""
        return (
            f"{self.processor}, {self.cores} cores, {' '.join(self.flags)}",
            f"{self.system}, {self.python}, kernels {self.kernels}",
            ", ".join(f"{name} {version}" for name, version in self.packages.items()),
        )

    @classmethod
    def here(cls) -> Machine:
        """Return the facts of this machine."""
        facts = _cpuinfo()
        versions = {name: _version(name) for name in PACKAGES}
        present = facts.get("flags", facts.get("Features", "")).split()
        return cls(
            processor=facts.get("model name") or platform.processor() or platform.machine(),
            cores=cores(),
            flags=tuple(flag for flag in _FLAGS if flag in present),
            system=f"{platform.system()} {platform.machine()}",
            python=f"{platform.python_implementation()} {platform.python_version()}",
            packages={name: version for name, version in versions.items() if version},
            kernels=kernel_mode(),
        )

    def __repr__(self) -> str:
        return repr_line("Machine", summary=f"{self.processor}, {self.cores} cores, {self.python}")


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _cpuinfo() -> dict[str, str]:
    """Return the first processor's entries of /proc/cpuinfo; none on systems without it."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return {}
    lines = (line.partition(":") for line in text.split("\n\n")[0].splitlines())
    return {key.strip(): value.strip() for key, _, value in lines}


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
