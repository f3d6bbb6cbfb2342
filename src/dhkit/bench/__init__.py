"""dhkit timed beside its peers: same robot, same states, one process, interleaved rounds."""

from dhkit.bench.agreement import Verdict
from dhkit.bench.benchmark_report import BenchReport, Ending, Missing, Outcome, Requirement, Row
from dhkit.bench.contenders import QUANTITIES, Contender, Mode, Task, UnavailableError, Workload
from dhkit.bench.derivations import Derivation, Operations
from dhkit.bench.machine import Machine
from dhkit.bench.probes import FirstCall, PeakMemory, ThreadScaling
from dhkit.bench.runner import run

__all__ = [
    "QUANTITIES",
    "BenchReport",
    "Contender",
    "Derivation",
    "Ending",
    "FirstCall",
    "Machine",
    "Missing",
    "Mode",
    "Operations",
    "Outcome",
    "PeakMemory",
    "Requirement",
    "Row",
    "Task",
    "ThreadScaling",
    "UnavailableError",
    "Verdict",
    "Workload",
    "run",
]
