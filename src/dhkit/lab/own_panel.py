"""The panel of a person's own program: its kinematics beside the arm's, its score, and its controller."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np

from dhkit.arm import Arm
from dhkit.control import Controller
from dhkit.description import Array
from dhkit.errors import DhkitError
from dhkit.lab.desk import Desk
from dhkit.lab.jobs import Job, Jobs
from dhkit.lab.requests import Fields, JsonObject, Panel, answers
from dhkit.programs import Isolation, Limits, Program, ProgramError, check

log = logging.getLogger(__name__)

PERIOD = 0.1
"""Time between two comparisons with the state on show, and between two looks at the program's file, s."""
SCORE_SAMPLES = 100
"""Random poses of a score."""
POSE_TOLERANCE = 1e-6
"""Largest error of a pose that a solution leads to: m, and entries of the rotation matrix."""
MAX_OUTPUT_LENGTH = 2_000
"""Number of characters of the program's output that are shown: the last ones."""
MAX_SOLUTIONS = 16
"""Solutions that are shown of a pose."""
CALL_LIMITS = Limits(seconds=1.0)
"""Limits of a call while a person moves the arm."""


class OwnPanel(Panel):
    """Requests ``own.…``; a thread of its own compares the program with the arm, and loads it again when it is saved.

    Parameters
    ----------
    desk
        The arm and its state.
    source
        The program, as :class:`dhkit.programs.Program` takes it; None if there is none.
    isolation
        Isolation of the program: files and resources that it can use; None for the best that works here.
    lock
        Held while a score is taken.
    """

    def __init__(
        self,
        desk: Desk,
        source: str | Path | Sequence[str] | None,
        isolation: Isolation | None = None,
        lock: AbstractContextManager[object] | None = None,
    ) -> None:
        super().__init__(desk)
        self.source = source
        self._isolation = isolation
        self.on_change: list[Callable[[], None]] = []
        """Called when the program has been loaded, with the functions that it defines now."""
        self.on_score: list[Callable[[Arm, Mapping[str, object]], None]] = []
        """Called with a score, as :meth:`dhkit.programs.CheckReport.to_dict` has it, and the arm that it is about."""
        self._state: dict[str, object] = {}
        self._functions: tuple[str, ...] = ()
        self._compared: tuple[Arm, bytes, bool] | None = None
        """The arm, its state and whether ghosts are shown, at the last comparison."""
        self._lock = threading.Lock()
        self._shows_ghosts = False
        self._program: Program | None = None
        """The process that is compared; the controller and the score have processes of their own."""
        self._controller_program: Program | None = None
        self._scored_program: Program | None = None
        self._scores = Jobs(lock=lock)
        desk.on_replace.append(self._forget_results)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="dhkit-own", daemon=True)

    def begin(self) -> None:
        """Load the program in the background, if there is one."""
        if self.source is not None:
            self._thread.start()

    @property
    def has_controller(self) -> bool:
        """Whether the program defines a controller."""
        return "controller" in self._functions

    @answers("own.ghosts", "on")
    def show_ghosts(self, fields: Fields) -> None:
        """Show or hide the program's solutions as ghosts."""
        self._shows_ghosts = fields.flag("on")
        if not self._shows_ghosts:
            self.desk.view.ghosts(None)
        self._compared = None

    @answers("own.score")
    def score(self, _: Fields) -> None:
        """Score the program once more."""
        if self.source is None:
            raise ValueError("own.score: there is no program; expected --mine FILE")
        self._start_score(self.source)

    def controller(self) -> Controller:
        """Return the program's controller, in a process of its own that ends when another is asked for.

        Raises
        ------
        ValueError
            The program defines none.
        """
        if self.source is None or not self.has_controller:
            raise ValueError(
                "control: there is no controller of your own; expected --mine FILE with one"
            )
        if self._controller_program is not None:
            self._controller_program.close()
        program = self._controller_program = Program(self.source, CALL_LIMITS, self._isolation)
        program.start()
        return program.controller

    def publish(self) -> None:
        """Send the state of the program to the pages."""
        state = {"ghosts": self._shows_ghosts, **self._state} if self.source is not None else None
        self.desk.view.panel("own", state)

    def close(self) -> None:
        """End the program's processes."""
        self._stop.set()
        for program in (self._scored_program, self._controller_program, self._program):
            if program is not None:
                program.close()
        if self._thread.is_alive():
            self._thread.join(5.0)
        self._scores.close()

    # The thread

    def _run(self) -> None:
        loaded_version: object = None
        while not self._stop.is_set():
            try:
                version = self._file_version()
                if version != loaded_version:
                    loaded_version = version
                    self._load()
                self._compare()
            except Exception:
                log.exception("comparing the program failed")
            self._stop.wait(PERIOD)

    def _file_version(self) -> object:
        """Return a value that changes when the program's file is saved."""
        if not isinstance(self.source, Path):
            return self.source
        try:
            status = self.source.stat()
        except OSError:
            return "missing"
        return status.st_mtime_ns, status.st_size

    def _load(self) -> None:
        assert self.source is not None  # noqa: S101 - for mypy: the thread runs only with a program
        if self._program is not None:
            self._program.close()
        program = self._program = Program(self.source, CALL_LIMITS, self._isolation)
        self._compared = None
        self._functions = ()
        self._state = {"file": program.name, "functions": [], "loading": True, "report": None}
        self.publish()
        try:
            program.start()
        except ProgramError as error:
            self._publish(
                loading=False, error=str(error), output=program.output[-MAX_OUTPUT_LENGTH:]
            )
            return
        self._functions = program.functions
        self._publish(loading=False, error=None, functions=list(program.functions))
        for call in self.on_change:
            call()
        self._start_score(self.source)

    def _publish(self, **state: object) -> None:
        """Send the state to the pages with some of its parts replaced."""
        with self._lock:
            self._state = {**self._state, **state}
            if not self._stop.is_set():
                self.publish()

    def _compare(self) -> None:
        """Compare the program's answers with the arm's, at the state on show."""
        program = self._program
        arm = self.desk.arm
        q = self.desk.q
        if program is None or not program.functions or self._state.get("loading", True):
            return
        output = program.output[-MAX_OUTPUT_LENGTH:]  # it may come after the answer
        if output != self._state.get("output", ""):
            self._publish(output=output)
        state = (arm, q.tobytes(), self._shows_ghosts)
        if state == self._compared:
            return
        self._compared = state
        results: dict[str, object] = {}
        for name, compare in (("fk", self._compare_forward), ("ik", self._compare_inverse)):
            if name in program.functions:
                try:
                    results[name] = compare(arm, q, program)
                except (ProgramError, ValueError, TypeError) as error:
                    results[name] = {"error": " ".join(str(error).split())[:300]}
        self._publish(**results, imported=list(program.imported))

    def _compare_forward(self, arm: Arm, q: Array, program: Program) -> JsonObject:
        T = program.fk(q)
        T_arm = arm.fk(q)
        cosine = np.clip((np.trace(T_arm[:3, :3].T @ T[:3, :3]) - 1) / 2, -1.0, 1.0)
        distance = float(np.linalg.norm(T[:3, 3] - T_arm[:3, 3]))
        return {"distance": distance, "angle": float(np.arccos(cosine)), "T": T.ravel().tolist()}

    def _compare_inverse(self, arm: Arm, q: Array, program: Program) -> JsonObject:
        T = arm.fk(q)
        solutions = program.ik(T, arm.n)
        finite = solutions[np.isfinite(solutions).all(axis=1)]
        right = sum(
            bool(np.abs(arm.fk(solution) - T).max() < POSE_TOLERANCE) for solution in finite
        )
        shown = finite[:MAX_SOLUTIONS]
        if self._shows_ghosts and not self.desk.running:
            self.desk.view.ghosts(shown if len(shown) else None)
        return {"count": len(finite), "right": right, "q": shown.tolist()}

    def _forget_results(self) -> None:
        """Forget the results about an arm that another has replaced."""
        if self.source is not None:
            self._scores.cancel()
            self._compared = None
            self._publish(scoring=False, report=None, fk=None, ik=None, edited=True)

    def _start_score(self, source: str | Path | Sequence[str]) -> None:
        arm = self.desk.arm
        if self._scored_program is not None:
            self._scored_program.close()
        program = self._scored_program = Program(source, Limits(), self._isolation)

        def work(job: Job) -> Mapping[str, object]:
            try:
                with program:
                    return check(
                        arm, program, samples=SCORE_SAMPLES, progress=job.progress
                    ).to_dict()
            except DhkitError as error:
                return {"error": str(error)}

        def take(report: Mapping[str, object]) -> None:
            if arm is not self.desk.arm:  # the arm was edited meanwhile
                self._publish(scoring=False, report=None)
                return
            self._publish(scoring=False, report=report)
            for call in self.on_score:
                call(arm, report)

        self._publish(scoring=True, edited=False)
        self._scores.start("score", work, take)
