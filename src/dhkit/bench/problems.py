"""Problems with known answers: which solutions of inverse kinematics each solver finds, misses and invents.

A file has an arm's table as plain numbers, and poses with all joint values that reach them, or none; and perhaps
motions among obstacles. The files in ``benchmarks/problems`` are described there; any tool can be scored by them.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.bench.benchmark_report import Report, Table, duration
from dhkit.bench.contenders import Contender, UnavailableError, Workload
from dhkit.bench.machine import Machine
from dhkit.bench.motion_problems import (
    MOTION_COLUMNS,
    MotionProblems,
    MotionRow,
    plan_problems,
)
from dhkit.bench.peers import all_contenders
from dhkit.description import Array
from dhkit.description.files import read_bounded
from dhkit.display import html_table, plain, repr_line
from dhkit.errors import DescriptionError

FORMAT = 1
_FILE_BYTES = 50_000_000
SAME = 1e-6
"""Difference, rad or m, up to which a solver's solution is a known one."""
CLOSES = 1e-6
"""Largest difference of the pose, m and rad, of joint values that count as a solution."""
_OWN = ("dhkit", "dhkit, one call")
"""dhkit's ways of calling that are scored."""
_REASON = 200
"""Longest reason why a solver took no part, characters."""
_TIMINGS = 3
"""Runs of which the fastest counts."""
REACHABLE = ("regular", "near singular", "near limit")
KINDS = (*REACHABLE, "just unreachable", "far unreachable")

_MEANING = (
    "Found: solutions of the file that the solver gave, up to 1e-6 rad or m. Invented: joint values that miss the pose "
    "by more than 1e-6 m or rad. Error: largest difference of the pose of a found solution, m or rad. Time: of a "
    "pose, of all poses in one run, the fastest of three; dhkit's kernels are compiled before. Motions are dhkit's: "
    "found are those that keep the clearance and all limits, by formulas of the benchmark's own, at 1 kHz; durations "
    "are compared with the shortest known ones."
)


@dataclass(frozen=True, eq=False)
class Problems:
    """An arm, and poses with all their solutions.

    Attributes
    ----------
    arm
        The arm.
    kinds
        Kind of each pose, one of :data:`KINDS`.
    T
        Poses of the tool in the world, shape (N, 4, 4), m.
    solutions
        Joint values that reach each pose, shape (k, n) each, rad and m; k is 0 for poses out of reach.
    motions
        Motions among obstacles; None without any.
    """

    arm: Arm
    kinds: tuple[str, ...]
    T: Array
    solutions: tuple[Array, ...]
    motions: MotionProblems | None = None

    @classmethod
    def read(cls, path: Path) -> Problems:
        """Return the problems of a file.

        Raises
        ------
        DescriptionError
            The file is missing, or has not the format; names the key.
        """
        content = read_bounded(path, _FILE_BYTES, "problems")
        try:
            data = json.loads(content)
            if data["format"] != FORMAT:
                raise DescriptionError(f"{path}: format {data['format']}; expected {FORMAT}")
            arm = _arm(data["arm"])
            poses = data["inverse_kinematics"]
            T = np.array([pose["T"] for pose in poses], dtype=float).reshape(-1, 4, 4)
            solutions = tuple(
                np.array(pose["solutions"], dtype=float).reshape(-1, arm.n) for pose in poses
            )
            motions = MotionProblems.read(data) if "motions" in data else None
            return cls(arm, tuple(str(pose["kind"]) for pose in poses), T, solutions, motions)
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            raise DescriptionError(
                f"{path}: no problems: {type(error).__name__}: {error}"
            ) from None

    def __repr__(self) -> str:
        return repr_line("Problems", self.arm.name, f"{len(self.T)} poses")


def _arm(table: Mapping[str, Any]) -> Arm:
    """Return the arm of a file's table."""
    rows = list(zip(table["theta_deg"], table["d"], table["a"], table["alpha_deg"], strict=True))
    arm = Arm.from_dh(
        rows,
        kinds=table["kinds"],
        convention=table["convention"],
        angle="deg",
        name=table["name"],
    )
    return arm.with_base(np.array(table["base"])).with_tool(np.array(table["tool"]))


@dataclass(frozen=True)
class ProblemRow:
    """What a solver did with an arm's poses.

    Attributes
    ----------
    robot, contender, own
        Names of the arm and the solver, and whether it is dhkit.
    poses, known
        Number of poses, and of their solutions.
    found
        Solutions that were given, by kind of pose.
    missed
        Solutions that were not given, by kind of pose.
    invented
        Number of joint values that were given and do not reach the pose.
    error
        Largest difference of the pose of a found solution, m or rad.
    seconds
        Time for a pose, s.
    reason
        Why the solver took no part; empty if it did.
    """

    robot: str
    contender: str
    own: bool
    poses: int
    known: int
    found: dict[str, int] = field(default_factory=dict)
    missed: dict[str, int] = field(default_factory=dict)
    invented: int = 0
    error: float = 0.0
    seconds: float = 0.0
    reason: str = ""

    @property
    def is_right(self) -> bool:
        """Whether nothing was missed and nothing invented."""
        return not self.reason and not self.invented and not any(self.missed.values())

    @property
    def cells(self) -> list[str]:
        """The row of the table."""
        shares = [
            f"{self.found.get(kind, 0)} of {self.found.get(kind, 0) + self.missed.get(kind, 0)}"
            for kind in REACHABLE
        ]
        timing = duration(self.seconds)
        return [
            self.robot,
            self.contender,
            *shares,
            str(self.invented),
            f"{self.error:.1e}",
            timing,
        ]

    def __repr__(self) -> str:
        found = f"{sum(self.found.values())} of {self.known} solutions found"
        return repr_line("ProblemRow", f"{self.robot} by {self.contender}", self.reason or found)


@dataclass(frozen=True)
class ProblemReport(Report):
    """Scores of all solvers; prints as tables.

    Attributes
    ----------
    machine
        The machine and the versions.
    rows
        A row for each arm and solver.
    motions
        A row for each arm with motions.
    """

    machine: Machine
    rows: tuple[ProblemRow, ...] = ()
    motions: tuple[MotionRow, ...] = ()

    @property
    def title(self) -> str:
        """The measured subject, in a line."""
        return "Inverse kinematics and motions whose answers are known"

    @property
    def meaning(self) -> str:
        """Meaning of the columns."""
        return _MEANING

    @property
    def tables(self) -> list[Table]:
        """A row for each arm and solver, and why solvers took no part."""
        columns = (
            "arm",
            "solver",
            *(f"found, {kind}" for kind in REACHABLE),
            "invented",
            "error",
            "time",
        )
        scored = [row.cells for row in self.rows if not row.reason]
        others = [[row.robot, row.contender, row.reason] for row in self.rows if row.reason]
        return [
            ("Solutions", columns, scored),
            ("Took no part", ("arm", "solver", "reason"), others),
            ("Motions", MOTION_COLUMNS, [row.cells for row in self.motions]),
        ]

    @property
    def main_table(self) -> str:
        """The table that a notebook shows, as HTML."""
        _, columns, cells = self.tables[0]
        return html_table(columns, cells)

    def __repr__(self) -> str:
        return repr_line("ProblemReport", summary=f"{len(self.rows)} rows")


def files_in(path: Path) -> list[Path]:
    """Return the files of problems in a folder, or the file itself.

    Raises
    ------
    DescriptionError
        There is none.
    """
    files = [path] if path.is_file() else sorted(path.glob("*.json"))
    found = [file for file in files if file.name != "schema.json"]
    if not found:
        raise DescriptionError(f"{path}: no files of problems (.json)")
    return found


def run_problems(
    files: Iterable[Path], progress: Callable[[str], object] | None = None
) -> ProblemReport:
    """Return the scores of dhkit and every installed peer.

    Parameters
    ----------
    files
        Files of problems.
    progress
        Called with a line for each arm and solver.

    Raises
    ------
    DescriptionError
        A file has not the format.
    """
    contenders = [
        one
        for one in all_contenders()
        if one.quantity == "ik" and (not one.own or one.name in _OWN)
    ]
    rows = []
    motions = []
    for file in files:
        problems = Problems.read(file)
        problems.arm.compile()
        for contender in contenders:
            if progress is not None:
                progress(f"{problems.arm.name}: {contender.name}")
            rows.append(_score(problems, contender))
        if problems.motions is not None:
            if progress is not None:
                progress(f"{problems.arm.name}: motions")
            motions.append(plan_problems(problems.motions))
    return ProblemReport(Machine.here(), tuple(rows), tuple(motions))


@dataclass(frozen=True, eq=False)
class _Poses(Workload):
    """A workload whose poses are given."""

    given: Array = field(default_factory=lambda: np.zeros((0, 4, 4)))

    @property
    def T(self) -> Array:
        return self.given


def _score(problems: Problems, contender: Contender) -> ProblemRow:
    arm = problems.arm
    count = len(problems.T)
    known = sum(map(len, problems.solutions))
    states = np.zeros((count, arm.n))
    workload = _Poses(arm, states, states, states, given=problems.T)
    row = ProblemRow(arm.name, contender.name, contender.own, count, known)
    try:
        task = contender.setup(workload)
        answers = task.answers(count)
        call = task.prepare(count)
        seconds = min(_seconds(call) for _ in range(_TIMINGS))
    except UnavailableError as error:
        return replace(row, reason=plain(str(error), _REASON))
    except Exception as error:  # a peer may raise anything
        return replace(row, reason=plain(f"{type(error).__name__}: {error}", _REASON))
    return _compared(row, problems, answers, seconds / count)


def _seconds(call: Callable[[], object]) -> float:
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def _compared(
    row: ProblemRow, problems: Problems, answers: Sequence[Array], seconds: float
) -> ProblemRow:
    found = dict.fromkeys(KINDS, 0)
    missed = dict.fromkeys(KINDS, 0)
    invented = 0
    largest = 0.0
    for kind, T, known, given in zip(
        problems.kinds, problems.T, problems.solutions, answers, strict=True
    ):
        q = np.asarray(given, dtype=float).reshape(-1, problems.arm.n)
        q = q[np.isfinite(q).all(axis=1)]
        error = np.abs(problems.arm.fk(q) - T).max(axis=(1, 2)) if len(q) else np.zeros(0)
        invented += int(np.sum(error > CLOSES))
        # |2 sin((p - q) / 2)| is about |p - q|, whole turns apart or not; slides differ by less than a turn.
        apart = 2 * np.abs(np.sin((known[:, None] - q[None]) / 2)).max(axis=-1)
        is_same = (apart < SAME).any(axis=1) if len(q) else np.zeros(len(known), dtype=bool)
        found[kind] += int(is_same.sum())
        missed[kind] += int((~is_same).sum())
        right = error[error <= CLOSES]
        largest = max(largest, float(right.max(initial=0.0)))
    return replace(
        row, found=found, missed=missed, invented=invented, error=largest, seconds=seconds
    )
