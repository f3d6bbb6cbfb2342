"""The panel of a person's own program: its kinematics beside the arm's, its score, and its controller."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.errors import DhkitError
from dhkit.lab.desk import Desk
from dhkit.lab.fields import Fields
from dhkit.lab.jobs import Job, Jobs
from dhkit.programs import Limits, Program, ProgramError, check

log = logging.getLogger(__name__)

PERIOD = 0.1
"""s between two looks at the state on show, and at the file."""
SAMPLES = 100
"""Random poses of a score."""
CLOSE = 1e-6
"""m and entries of a rotation matrix."""
PRINTED = 2_000
"""Characters of what the program prints that are shown: the last."""
LIVE = Limits(seconds=1.0)
"""Of a call while a person moves the arm."""


class OwnPanel:
    """Requests ``own.…``; a thread of its own compares the program with the arm, and loads it anew when it is saved."""

    def __init__(
        self,
        desk: Desk,
        source: Path | Sequence[str] | None,
        sandbox: str | None = None,
        lock: AbstractContextManager[Any] | None = None,
    ) -> None:
        self.desk, self.source, self._sandbox = desk, source, sandbox
        self.changed: list[Callable[[], None]] = []
        """Called when there are other functions."""
        self.scored: list[Callable[[Arm, dict[str, Any]], None]] = []
        """Called with a score, as :meth:`dhkit.programs.CheckReport.to_dict` has it, and the arm that it is about."""
        self._state: dict[str, Any] = {}
        self._seen: Any = None
        self._lock = threading.Lock()
        self._ghosts = False
        self._program: Program | None = None
        self._driver: Program | None = None
        self._judge: Program | None = None
        self._scores = Jobs(lambda state: None, lock)
        desk.changed.append(self._replaced)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        if source is not None:
            self._thread = threading.Thread(target=self._work, name="dhkit-own", daemon=True)

    def begin(self) -> None:
        """Load the program, in the background."""
        self.publish()
        if self._thread is not None:
            self._thread.start()

    @property
    def controls(self) -> bool:
        """Whether there is a controller."""
        return "controller" in self._state.get("functions", ())

    def ghosts(self, data: dict[str, Any]) -> dict[str, Any]:
        """Show the program's solutions as ghosts, or no longer."""
        self._ghosts = Fields("own.ghosts", data, ["on"]).flag("on")
        if not self._ghosts:
            self.desk.view.ghosts(None)
        self._seen = None
        return {}

    def score(self, data: dict[str, Any]) -> dict[str, Any]:
        """Score the program once more."""
        Fields("own.score", data, [])
        if self.source is None:
            raise ValueError("own.score: there is no program; expected --mine FILE")
        self._score()
        return {}

    def controller(self) -> Callable[..., Array]:
        """Return the program's controller, in a process of its own that ends when another is asked for.

        Raises
        ------
        ValueError
            There is none.
        """
        if self.source is None or not self.controls:
            raise ValueError("control: there is no controller of your own; expected --mine FILE with one")
        if self._driver is not None:
            self._driver.close()
        driver = self._driver = Program(self.source, LIVE, self._sandbox)
        driver.start()

        return driver.controller

    def publish(self) -> None:
        """Tell the pages what is known."""
        self.desk.view.panel("own", {"ghosts": self._ghosts, **self._state} if self.source is not None else None)

    def close(self) -> None:
        """End the program's processes."""
        self._stop.set()
        for program in (self._judge, self._driver, self._program):
            if program is not None:
                program.close()
        if self._thread is not None and self._thread.is_alive():
            self._thread.join(5.0)
        self._scores.close()

    # The thread

    def _work(self) -> None:
        saved: object = None
        while not self._stop.is_set():
            try:
                now = self._saved()
                if now != saved:
                    saved = now
                    self._load()
                self._compare()
            except Exception:
                log.exception("comparing the program failed")
            self._stop.wait(PERIOD)

    def _saved(self) -> object:
        """Return what changes when the file is saved."""
        if not isinstance(self.source, Path):
            return self.source
        try:
            about = self.source.stat()
        except OSError:
            return "missing"
        return about.st_mtime_ns, about.st_size

    def _load(self) -> None:
        assert self.source is not None  # noqa: S101 - for mypy: the thread runs with a program alone
        if self._program is not None:
            self._program.close()
        self._program = Program(self.source, LIVE, self._sandbox)
        self._seen = None
        self._state = {"file": self._program.name, "functions": [], "loading": True, "report": None}
        self.publish()
        try:
            self._program.start()
        except ProgramError as error:
            self._tell(loading=False, error=str(error), output=self._program.output[-PRINTED:])
            return
        self._tell(loading=False, error=None, functions=list(self._program.functions))
        for call in self.changed:
            call()
        self._score()

    def _tell(self, **state: Any) -> None:
        with self._lock:
            self._state = {**self._state, **state}
            if not self._stop.is_set():
                self.publish()

    def _compare(self) -> None:
        """Compare the program's answers with the arm's, at the state on show."""
        program, desk = self._program, self.desk
        if program is None or not program.functions or self._state.get("loading", True):
            return
        printed = program.output[-PRINTED:]  # which may come after the answer
        if printed != self._state.get("output", ""):
            self._tell(output=printed)
        arm, q = desk.arm, desk.q
        seen = (arm, q.tobytes(), self._ghosts)
        if seen == self._seen:
            return
        self._seen = seen
        found: dict[str, Any] = {}
        if "fk" in program.functions:
            found["fk"] = self._answered(lambda: _forward(arm, q, program))
        if "ik" in program.functions:
            found["ik"] = self._answered(lambda: self._inverse(arm, q, program))
        self._tell(**found, imported=list(program.imported))

    def _answered(self, ask: Any) -> dict[str, Any]:
        try:
            result: dict[str, Any] = ask()
        except (ProgramError, ValueError, TypeError) as error:
            return {"error": " ".join(str(error).split())[:300]}
        return result

    def _inverse(self, arm: Arm, q: Array, program: Program) -> dict[str, Any]:
        T = arm.fk(q)
        rows = program.ik(T, arm.n)
        finite = rows[np.isfinite(rows).all(axis=1)]
        right = [bool(np.abs(arm.fk(row) - T).max() < CLOSE) for row in finite]
        if self._ghosts and not self.desk.running:
            self.desk.view.ghosts(finite[:16] if len(finite) else None)
        return {"count": len(finite), "right": sum(right), "q": finite[:16].tolist()}

    def _replaced(self) -> None:
        """Leave what was found about another arm."""
        if self.source is None:
            return
        self._scores.cancel()
        self._seen = None
        self._tell(scoring=False, report=None, fk=None, ik=None, edited=True)

    def _score(self) -> None:
        source, arm = self.source, self.desk.arm
        assert source is not None  # noqa: S101 - for mypy
        if self._judge is not None:
            self._judge.close()
        judge = self._judge = Program(source, Limits(), self._sandbox)

        def work(job: Job) -> dict[str, Any]:
            try:
                with judge:
                    return check(arm, judge, samples=SAMPLES, progress=job.progress).to_dict()
            except DhkitError as error:
                return {"error": str(error)}

        def take(report: dict[str, Any]) -> None:
            if arm is not self.desk.arm:  # edited meanwhile
                self._tell(scoring=False, report=None)
                return
            self._tell(scoring=False, report=report)
            for call in self.scored:
                call(arm, report)

        self._tell(scoring=True, edited=False)
        self._scores.start("score", work, take)


def _forward(arm: Arm, q: Array, program: Program) -> dict[str, Any]:
    T = program.fk(q)
    ours = arm.fk(q)
    cosine = np.clip((np.trace(ours[:3, :3].T @ T[:3, :3]) - 1) / 2, -1.0, 1.0)
    return {
        "distance": float(np.linalg.norm(T[:3, 3] - ours[:3, 3])),
        "angle": float(np.arccos(cosine)),
        "T": T.ravel().tolist(),
    }
