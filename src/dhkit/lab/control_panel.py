"""The panel of control: a controller on the simulated arm in real time, with a reference as ghost, pushes and loads."""

from __future__ import annotations

import logging
import threading
import time
from dataclasses import replace
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.control import CONTROLLERS, Controller, FrictionCompensation, Sine, make_controller
from dhkit.description import Array
from dhkit.errors import DhkitError
from dhkit.lab.desk import Desk, file_content
from dhkit.lab.fields import Fields
from dhkit.lab.live import Live, Wanted
from dhkit.lab.motion_panel import MotionPanel
from dhkit.lab.own_panel import OwnPanel
from dhkit.lab.references import back_and_forth, gentle_sine
from dhkit.lab.run_settings import OWN, PARTS, TITLES, Settings
from dhkit.viewer.streams import Samples

log = logging.getLogger(__name__)

RATE = 1000.0
"""Hz of the controller."""
FRAMES = 60.0
"""Pictures a second."""
BEHIND = 5
"""Frames that a slow machine is behind before time is let go."""
REBUILT = ("controller", "bandwidth", "damping", "compensate")
"""Settings of which the controller is made."""
MOST_FORCE, LONGEST_PUSH = 1e4, 10.0
GHOST = (0.55, 0.6, 0.68)
"""Red, green and blue of the reference."""


class ControlPanel:
    """Requests ``control.…``, ``bodies.assume`` and ``arm.planar``; the run has a thread of its own."""

    def __init__(self, desk: Desk, motions: MotionPanel, own: OwnPanel) -> None:
        self.desk, self.motions, self.own = desk, motions, own
        self.settings = Settings()
        self.planar = False
        self._lock = threading.RLock()
        self._live: Live | None = None
        self._free: list[int] = []
        self._base: Array = np.zeros(0)
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._paused = False
        self._speed = 1.0
        self._error: str | None = None
        desk.changed.append(self._forget)
        desk.steer = self._steer
        motions.changed.append(self._motion_changed)
        own.changed.append(self.publish)
        self.sine: Sine | None = None
        """What a run that follows a sine follows."""

    def start(self, data: dict[str, Any]) -> dict[str, Any]:
        """Simulate from the state on show."""
        settings = self.settings.changed("control.start", data)
        arm = self.desk.arm
        if not all(joint.bodies for joint in arm.description.joints):
            raise ValueError("control.start: the arm has no bodies; expected uniform links to be assumed first")
        self._require_reference(settings.reference)
        self._end()
        with self._lock:
            before, self.settings = self.settings, settings
            self._free = [1, 2] if self.planar else list(range(arm.n))
            self._base = self.desk.q.copy()
            try:
                live = Live(self._simulated(arm), self._plant(arm), settings.model, self._base[self._free], RATE)
                live.take(self._controller(live))
                live.wanted = self._wanted(live, arm)
            except (DhkitError, ValueError):
                self.settings = before
                self.publish()
                raise
            self._live = live
            self._error, self._paused, self._speed = None, False, 1.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(live, self._stop), name="dhkit-control", daemon=True)
        self.desk.running = True
        self._thread.start()
        self.publish()
        return {}

    def change(self, data: dict[str, Any]) -> dict[str, Any]:
        """Change the settings, while it runs too: what they do not concern goes on as it is."""
        with self._lock:
            before, now = self.settings, self.settings.changed("control.change", data)
            live = self._live if self.desk.running else None
            if live is not None:
                try:
                    if "reference" in data:
                        self._require_reference(now.reference)
                    self.settings = now
                    controller = None
                    if any(getattr(now, name) != getattr(before, name) for name in REBUILT):
                        controller = self._controller(live)
                    if (now.payload, now.friction) != (before.payload, before.friction):
                        live.change(self._plant(self.desk.arm), now.model)
                except (DhkitError, ValueError):
                    self.settings = before
                    raise
                if controller is not None:
                    live.take(controller)
                if "reference" in data:
                    live.wanted = self._wanted(live, self.desk.arm)
            self.settings = now
        self.publish()
        return {}

    def pause(self, data: dict[str, Any]) -> dict[str, Any]:
        """Hold the time, or let it go on."""
        Fields("control.pause", data, [])
        if not self.desk.running:
            raise ValueError("control.pause: nothing runs")
        self._paused = not self._paused
        self.publish()
        return {}

    def stop(self, data: dict[str, Any]) -> dict[str, Any]:
        """End the run; its samples stay."""
        Fields("control.stop", data, [])
        self._end()
        self.publish()
        return {}

    def push(self, data: dict[str, Any]) -> dict[str, Any]:
        """Push a link or the tool from now on."""
        fields = Fields("control.push", data, ["link", "force", "duration"])
        link = fields.whole("link", 1, self.desk.arm.n) if "link" in fields else None
        force = fields.vector("force", 3)
        duration = fields.number("duration", 0.0, LONGEST_PUSH, 0.2)
        if np.abs(force).max() > MOST_FORCE:
            raise ValueError(f"control.push: force is beyond {MOST_FORCE:g} N")
        with self._lock:
            if self._live is None or not self.desk.running:
                raise ValueError("control.push: nothing runs")
            if self.planar and link is not None:
                raise ValueError("control.push: only the tool can be pushed while joints are locked")
            self._live.push(link, force, duration)
        return {}

    def download(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return the run so far as a file."""
        kind = Fields("control.download", data, ["format"]).choice("format", ("csv", "npz"))
        with self._lock:
            if self._live is None:
                raise ValueError("control.download: nothing has been simulated yet")
            result = self._live.result()
        return {"name": f"{self.desk.arm.name}-run.{kind}", "content": file_content(result, kind)}

    def assume(self, data: dict[str, Any]) -> dict[str, Any]:
        """Give an arm without bodies uniform links."""
        Fields("bodies.assume", data, [])
        if all(joint.bodies for joint in self.desk.arm.description.joints):
            raise ValueError("bodies.assume: every link has a mass; expected one without")
        self._end()
        self.desk.assumed_bodies = True
        self.desk.replace(self.desk.arm.with_uniform_links())
        return {}

    def lock_to_planar(self, data: dict[str, Any]) -> dict[str, Any]:
        """Leave only joints 2 and 3 free, or all again."""
        on = Fields("arm.planar", data, ["on"]).flag("on")
        kinds = self.desk.arm.description.kinds
        if on and (self.desk.arm.n < 4 or kinds[1:3] != "RR"):
            raise ValueError(f"arm.planar: joints are {kinds}; expected at least 4, the second and third revolute")
        self._end()
        self.planar = on
        self.publish()
        return {}

    def publish(self) -> None:
        """Tell the pages what runs."""
        live, settings = self._live, self.settings
        running = self._thread is not None
        self.desk.view.panel(
            "control",
            {
                "running": running,
                "paused": self._paused,
                "controllers": [
                    {"name": name, "title": TITLES.get(name, name)}
                    for name in [*CONTROLLERS, *([OWN] if self.own.controls else [])]
                ],
                **{name: getattr(settings, name) for name in PARTS},
                "planar": self.planar,
                "rate": RATE,
                "speed": round(self._speed, 2),
                "time": round(live.t, 3) if live is not None else 0.0,
                "error": self._error,
                "note": "the links' masses are assumed: uniform rods" if self.desk.assumed_bodies else None,
            },
        )

    @property
    def free(self) -> list[int]:
        """The joints that a run moves, from 0."""
        return self._free

    @property
    def locked(self) -> dict[int, float]:
        """The values of the joints that a run does not move, by joint from 0."""
        return {i: float(x) for i, x in enumerate(self._base) if i not in self._free} if self.planar else {}

    @property
    def wanted(self) -> Array:
        """The joint values that a run follows now, of the free joints."""
        live = self._live
        return np.zeros(len(self._free)) if live is None else live.wanted(live.t)[0]

    def close(self) -> None:
        """End the run."""
        self._end()

    # The run

    def _run(self, live: Live, stop: threading.Event) -> None:
        begin, frame, told = time.monotonic(), 0, 0.0
        columns = self._columns()
        self.desk.view.append(Samples("control", columns, np.zeros((0, len(columns)), np.float32), restart=True))
        try:
            while not stop.is_set():
                if self._paused:
                    time.sleep(1 / FRAMES)
                    begin, frame = time.monotonic(), 0
                    continue
                late = time.monotonic() - (begin + frame / FRAMES)
                if late < 0:
                    time.sleep(-late)
                elif late > BEHIND / FRAMES:
                    self._speed = 0.8 * self._speed + 0.2 * (frame / FRAMES) / max(time.monotonic() - begin, 1e-9)
                    begin, frame = time.monotonic(), 0
                self._frame(live)
                frame += 1
                if frame / FRAMES >= 1.0 and late <= BEHIND / FRAMES:
                    self._speed = min(1.0, 0.8 * self._speed + 0.2)
                if time.monotonic() - told > 0.25:
                    told = time.monotonic()
                    self.publish()
        except (DhkitError, ValueError) as error:
            self._failed(live, stop, " ".join(str(error).split()))
        except Exception as error:
            log.exception("the simulation failed")
            self._failed(live, stop, f"{type(error).__name__}: Python's log says more")

    def _frame(self, live: Live) -> None:
        with self._lock:
            error = tau = np.zeros(len(self._free))
            for _ in range(round(RATE / FRAMES)):
                error, tau = live.advance()
            q, wanted = self._full(live.q), self._full(live.wanted(live.t)[0])
            t = live.t
        self.desk.show(q)
        self.desk.view.ghosts(wanted[None], GHOST)
        tool = np.linalg.norm(self.desk.arm.fk(q)[:3, 3] - self.desk.arm.fk(wanted)[:3, 3])
        row = np.array([[t, *error, *tau, tool]], dtype=np.float32)
        self.desk.view.append(Samples("control", self._columns(), row))

    def _columns(self) -> tuple[str, ...]:
        """Return the names of the samples' numbers: time, errors and torques of the free joints, the tool's error."""
        return ("t", *(f"{name}{i + 1}" for name in ("e", "tau") for i in self._free), "tool")

    def _failed(self, live: Live, stop: threading.Event, error: str) -> None:
        if stop.is_set():
            return  # the lab ends, and its pages with it
        if live is self._live and not self._stop.is_set():
            self._error, self._thread, self.desk.running = error, None, False
            self.publish()

    def _end(self) -> None:
        self._stop.set()
        self.desk.running = False
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(5.0)
            self._thread = None
            self.desk.view.ghosts(None)

    def _forget(self) -> None:
        """End a run of another arm."""
        ran = self.desk.running
        self._end()
        with self._lock:
            self._live, self.planar = None, False
            self._error = "ended: the arm was edited" if ran else None
        self.publish()

    def _motion_changed(self) -> None:
        """Follow another motion from now on; hold where there is none any more."""
        with self._lock:
            live = self._live
            if live is None or not self.desk.running or self.settings.reference != "motion":
                return
            if self.motions.motion is None:
                self.settings = replace(self.settings, reference="hold")
            live.wanted = self._wanted(live, self.desk.arm)
        self.publish()

    def _full(self, q: Array) -> Array:
        """Return the joint values of the whole arm."""
        full = self._base.copy()
        full[self._free] = q
        return full

    def _simulated(self, arm: Arm) -> Arm:
        """Return the arm whose joints are free."""
        if not self.planar:
            return arm
        return arm.lock({i: self.locked[i] for i in self.locked})

    def _plant(self, arm: Arm) -> Arm:
        simulated = self._simulated(arm)
        return simulated.with_payload(self.settings.payload) if self.settings.payload else simulated

    def _controller(self, live: Live) -> Any:
        settings = self.settings
        description = live.arm.description
        controller: Controller = (
            self.own.controller()
            if settings.controller == OWN
            else make_controller(settings.controller, description, settings.bandwidth, settings.damping, live.q)
        )
        return FrictionCompensation(controller, live.arm) if settings.compensate else controller

    def _require_reference(self, name: str) -> None:
        """Refuse to follow what is not there.

        Raises
        ------
        ValueError
            Says what is missing.
        """
        if name == "motion" and self.motions.motion is None:
            raise ValueError("control: there is no motion to follow; expected one planned first (Motion)")
        if name == "target" and self.desk.aimed is None:
            raise ValueError("control: there is no target to follow; expected one that is in reach (Tool)")

    def _wanted(self, live: Live, arm: Arm) -> Wanted:
        """Return what the run follows from now on."""
        begin, free = live.t, self._free
        held = live.wanted(begin)[0] if live.t else live.q.copy()
        still = np.zeros(len(free))
        if self.settings.reference == "target":
            return lambda t: (self._aimed(held), still, still)
        if self.settings.reference == "motion":
            motion = self.motions.motion
            assert motion is not None  # noqa: S101 - for mypy: it was asked for before
            return lambda t: back_and_forth(motion, t - begin, free)
        if self.settings.reference == "sine":
            self.sine = sine = gentle_sine(arm, held, free)

            def sampled(t: float) -> tuple[Array, Array, Array]:
                q, qd, qdd = sine.sampled(np.array([t - begin]))
                return q[0], qd[0], qdd[0]

            return sampled
        return lambda t: (held, still, still)

    def _steer(self, q: Array, joint: int | None) -> None:
        """Show joint values that a person asks for, or have the run hold them: of one joint, or of all."""
        with self._lock:
            live = self._live
            if live is None or not self.desk.running:
                self.desk.show(q)
                return
            held, still = live.wanted(live.t)[0].copy(), np.zeros(len(self._free))
            asked = [k for k, i in enumerate(self._free) if joint in (None, i)]
            if not asked:
                raise ValueError(f"joint {1 + (joint or 0)} is locked: only joints 2 and 3 move")
            held[asked] = q[self._free][asked]
            self.settings = replace(self.settings, reference="sliders")
            live.wanted = lambda t: (held, still, still)
        self.publish()

    def _aimed(self, held: Array) -> Array:
        aimed = self.desk.aimed
        return held if aimed is None else aimed[self._free]
