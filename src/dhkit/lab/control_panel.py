"""The panel of control: a controller on the simulated arm in real time, with a reference as ghost, pushes and loads."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from dhkit.arm import Arm
from dhkit.control import CONTROLLERS, PID, Controller, FrictionCompensation, Sine, make_controller
from dhkit.control.gains import effective_inertia
from dhkit.description import Array, Description
from dhkit.errors import DhkitError
from dhkit.lab.desk import Desk, file_content, has_bodies
from dhkit.lab.live import Live
from dhkit.lab.motion_panel import MotionPanel
from dhkit.lab.own_panel import OwnPanel
from dhkit.lab.requests import Fields, JsonObject, Panel, answers
from dhkit.lab.run_settings import (
    CONTROLLER_TITLES,
    JOINT_CONTROLLERS,
    OWN,
    SETTING_NAMES,
    Gains,
    ReferenceKind,
    Setpoints,
    Settings,
    back_and_forth,
    gentle_sine,
)
from dhkit.viewer.protocol import Samples

log = logging.getLogger(__name__)

CONTROL_RATE = 1000.0
"""Calls of the controller per second, Hz."""
FRAME_RATE = 60.0
"""Pictures per second, Hz."""
MAX_FRAMES_BEHIND = 5
"""Frames that the simulation may be behind on a slow machine; with more, it runs slower than real time."""
PUBLISH_PERIOD = 0.25
"""Time between two states of the panel while a simulation runs, s."""
CONTROLLER_SETTINGS = ("controller", "bandwidth", "damping", "compensate")
"""Settings of which the controller is made."""
STILL_POLE = 1e-9
"""Size of a pole, 1/s, below which it is that of an integral that is switched off."""
MAX_PUSH_FORCE = 1e4
"""Largest component of a push, N."""
MAX_PUSH_DURATION = 10.0
"""Longest duration of a push, s."""
GHOST_COLOR = (0.55, 0.6, 0.68)
"""Red, green and blue of the reference's ghost, from 0 to 1."""


class ControlPanel(Panel):
    """Requests ``control.…``, ``bodies.assume`` and ``arm.planar``; a run has a thread of its own."""

    def __init__(self, desk: Desk, motions: MotionPanel, own: OwnPanel) -> None:
        super().__init__(desk)
        self.motions = motions
        self.own = own
        self.settings = Settings()
        self.planar = False
        """Whether only joints 2 and 3 are free."""
        self.free: list[int] = []
        """The joints that a run moves, from 0."""
        self.sine: Sine | None = None
        """The sine that the last run with one follows."""
        self._lock = threading.RLock()
        self._live: Live | None = None
        self._start_q: Array = np.zeros(0)
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._paused = False
        self._speed = 1.0
        self._error: str | None = None
        desk.before_replace.append(self._forget_run)
        desk.on_replace.append(self.publish)
        desk.steer = self._steer
        motions.on_change.append(self._follow_changed_motion)
        self.on_frame: list[Callable[[float, Array, Array], None]] = []
        """Called at each frame with the time of a run, s, and the desired values and the errors of its joints, shape
        (k,), rad and m."""
        own.on_change.append(self.publish)

    @answers("control.start", *SETTING_NAMES)
    def start(self, fields: Fields) -> None:
        """Simulate from the state on show."""
        settings = self.settings.changed(fields)
        arm = self.desk.arm
        if not has_bodies(arm):
            raise ValueError(
                "control.start: the arm has no bodies; expected uniform links to be assumed first"
            )
        self._require_reference(settings.reference)
        self._end_run()
        with self._lock:
            previous = self.settings
            self.settings = settings
            self.free = [1, 2] if self.planar else list(range(arm.n))
            self._start_q = self.desk.q.copy()
            try:
                friction = settings.friction_model
                live = Live(
                    self._free_arm(arm),
                    self._plant(arm),
                    friction,
                    self._start_q[self.free],
                    CONTROL_RATE,
                )
                live.take(self._controller(live))
                live.setpoints = self._setpoints(live, arm)
            except (DhkitError, ValueError):
                self.settings = previous
                self.publish()
                raise
            self._live = live
            self._error = None
            self._paused = False
            self._speed = 1.0
        self._stop = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(live, self._stop), name="dhkit-control", daemon=True
        )
        self.desk.running = True
        self._thread.start()
        self.publish()

    @answers("control.change", *SETTING_NAMES)
    def change(self, fields: Fields) -> None:
        """Change settings, also while a simulation runs: whatever they do not concern goes on as it is."""
        with self._lock:
            previous = self.settings
            settings = self.settings.changed(fields)
            live = self._live if self.desk.running else None
            if live is not None:
                try:
                    if "reference" in fields.data:
                        self._require_reference(settings.reference)
                    self.settings = settings
                    controller = None
                    if any(
                        getattr(settings, name) != getattr(previous, name)
                        for name in CONTROLLER_SETTINGS
                    ):
                        controller = self._controller(live)
                    if (settings.payload, settings.friction) != (
                        previous.payload,
                        previous.friction,
                    ):
                        live.change(self._plant(self.desk.arm), settings.friction_model)
                except (DhkitError, ValueError):
                    self.settings = previous
                    raise
                if controller is not None:
                    live.take(controller)
                if "reference" in fields.data:
                    live.setpoints = self._setpoints(live, self.desk.arm)
            self.settings = settings
        self.publish()

    @answers("control.gains", "kp", "ki", "kd")
    def set_gains(self, fields: Fields) -> None:
        """Use other gains of the joints' controllers, (n,) each, also while a simulation runs."""
        n = self.desk.arm.n
        gains = Gains(*(tuple(fields.vector(name, n).tolist()) for name in Gains._fields))
        if min(map(min, gains)) < 0:
            raise ValueError("control.gains: a gain is negative; expected numbers from 0 on")
        if self.settings.controller not in JOINT_CONTROLLERS:
            raise ValueError(
                f"control.gains: the controller is {self.settings.controller}; expected PID or PD"
            )
        with self._lock:
            self.settings = replace(self.settings, gains=gains)
            if self._live is not None and self.desk.running:
                self._live.take(self._controller(self._live))
        self.publish()

    @answers("control.pause")
    def pause(self, _: Fields) -> None:
        """Stop the simulated time, or let it go on."""
        if not self.desk.running:
            raise ValueError("control.pause: nothing runs")
        self._paused = not self._paused
        self.publish()

    @answers("control.stop")
    def stop(self, _: Fields) -> None:
        """End the run; its samples stay."""
        self._end_run()
        self.publish()

    @answers("control.push", "link", "force", "duration")
    def push(self, fields: Fields) -> None:
        """Push a link or the tool from now on."""
        link = fields.integer("link", 1, self.desk.arm.n) if "link" in fields else None
        force = fields.vector("force", 3)
        duration = fields.number("duration", 0.0, MAX_PUSH_DURATION, 0.2)
        if np.abs(force).max() > MAX_PUSH_FORCE:
            raise ValueError(f"control.push: force is beyond {MAX_PUSH_FORCE:g} N")
        with self._lock:
            if self._live is None or not self.desk.running:
                raise ValueError("control.push: nothing runs")
            if self.planar and link is not None:
                raise ValueError(
                    "control.push: only the tool can be pushed while joints are locked"
                )
            self._live.push(link, force, duration)

    @answers("control.download", "format")
    def download(self, fields: Fields) -> JsonObject:
        """Return the run so far as a file."""
        kind = fields.choice("format", ("csv", "npz"))
        with self._lock:
            if self._live is None:
                raise ValueError("control.download: nothing has been simulated yet")
            result = self._live.result()
        return {"name": f"{self.desk.arm.name}-run.{kind}", "content": file_content(result, kind)}

    @answers("bodies.assume")
    def assume_bodies(self, _: Fields) -> None:
        """Replace all bodies of an arm with a link without body by thin uniform rods."""
        if has_bodies(self.desk.arm):
            raise ValueError("bodies.assume: every link has a mass; expected one without")
        self._end_run()
        self.desk.assumed_bodies = True
        self.desk.replace(self.desk.arm.with_uniform_links())

    @answers("arm.planar", "on")
    def lock_to_planar(self, fields: Fields) -> None:
        """Leave only joints 2 and 3 free, or all joints again."""
        on = fields.flag("on")
        kinds = self.desk.arm.description.kinds
        if on and (self.desk.arm.n < 4 or kinds[1:3] != "RR"):
            raise ValueError(
                f"arm.planar: joints are {kinds}; expected at least 4, the second and third revolute"
            )
        self._end_run()
        self.planar = on
        self.publish()

    def publish(self) -> None:
        """Send the settings and the state of the run to the pages."""
        live = self._live
        names = [*CONTROLLERS, *([OWN] if self.own.has_controller else [])]
        self.desk.view.panel(
            "control",
            {
                "running": self._thread is not None,
                "paused": self._paused,
                "controllers": [
                    {"name": name, "title": CONTROLLER_TITLES.get(name, name)} for name in names
                ],
                **vars(self.settings),
                "planar": self.planar,
                "rate": CONTROL_RATE,
                "speed": round(self._speed, 2),
                "time": round(live.t, 3) if live is not None else 0.0,
                "error": self._error,
                "note": "the links' masses are assumed: uniform rods"
                if self.desk.assumed_bodies
                else None,
                "gains": self._gains_state(),
            },
        )

    def _gains_state(self) -> JsonObject | None:
        """Return the gains of the joints' controllers, and the poles that follow, where one is chosen."""
        arm = self.desk.arm
        if self.settings.controller not in JOINT_CONTROLLERS or not has_bodies(arm):
            return None
        settings = self.settings
        m, tuned = _tuned(
            arm.description, settings.controller, settings.bandwidth, settings.damping
        )
        gains = tuned if settings.gains is None else settings.gains
        # m s^3 + kd s^2 + kp s + ki = 0 of each joint alone, with its effective inertia m
        slowest = []
        for polynomial in np.stack([m, gains.kd, gains.kp, gains.ki], axis=1):
            poles = np.roots(polynomial)
            moving = poles[np.abs(poles) > STILL_POLE]
            slowest.append(float(moving.real.max()))
        return {
            **gains._asdict(),
            "slowest": slowest,
            "tuned": settings.gains is None,
        }

    @property
    def locked(self) -> dict[int, float]:
        """The values of the joints that a run does not move, by joint from 0."""
        return (
            {i: float(x) for i, x in enumerate(self._start_q) if i not in self.free}
            if self.planar
            else {}
        )

    @property
    def setpoint(self) -> Array:
        """The values of the free joints that a run follows now, shape (k,), rad and m."""
        return np.zeros(len(self.free)) if self._live is None else self._live.setpoint_q

    def close(self) -> None:
        """End the run."""
        self._end_run()

    # The run

    def _run(self, live: Live, stop: threading.Event) -> None:
        """Simulate and show frames at FRAME_RATE; if more than MAX_FRAMES_BEHIND late, drop the delay."""
        begin = time.monotonic()
        frame = 0
        published = 0.0
        shown = 0
        ratio = CONTROL_RATE / FRAME_RATE
        columns = self._columns()
        self.desk.view.append(
            Samples("control", columns, np.zeros((0, len(columns)), np.float32), restart=True)
        )
        try:
            while not stop.is_set():
                if self._paused:
                    time.sleep(1 / FRAME_RATE)
                    begin = time.monotonic()
                    frame = 0
                    continue
                delay = time.monotonic() - (begin + frame / FRAME_RATE)
                if delay < 0:
                    time.sleep(-delay)
                elif delay > MAX_FRAMES_BEHIND / FRAME_RATE:
                    speed = frame / FRAME_RATE / max(time.monotonic() - begin, 1e-9)
                    self._speed = 0.8 * self._speed + 0.2 * speed
                    begin = time.monotonic()
                    frame = 0
                # A frame lasts no whole number of steps: rounding alike each time would change the speed.
                self._simulate_frame(live, round((shown + 1) * ratio) - round(shown * ratio))
                frame += 1
                shown += 1
                if frame / FRAME_RATE >= 1.0 and delay <= MAX_FRAMES_BEHIND / FRAME_RATE:
                    self._speed = min(1.0, 0.8 * self._speed + 0.2)
                if time.monotonic() - published > PUBLISH_PERIOD:
                    published = time.monotonic()
                    self.publish()
        except (DhkitError, ValueError) as error:
            self._report_failure(live, stop, " ".join(str(error).split()))
        except Exception as error:
            log.exception("the simulation failed")
            self._report_failure(live, stop, f"{type(error).__name__}: Python's log says more")

    def _simulate_frame(self, live: Live, steps: int) -> None:
        with self._lock:
            tau = np.zeros(len(self.free))
            for _ in range(steps):
                _, tau = live.advance()
            moved, desired, t = live.q, live.setpoint_q, live.t
        q = self._whole_arm(moved)
        reference = self._whole_arm(desired)
        self.desk.show(q)
        self.desk.view.ghosts(reference[None], GHOST_COLOR)
        tool_error = np.linalg.norm(self.desk.arm.fk(q)[:3, 3] - self.desk.arm.fk(reference)[:3, 3])
        for call in self.on_frame:
            call(t, desired, desired - moved)
        row = np.array([[t, *moved, *(desired - moved), *tau, tool_error]], dtype=np.float32)
        self.desk.view.append(Samples("control", self._columns(), row))

    def _columns(self) -> tuple[str, ...]:
        """Return the names of the numbers of a sample: time, then values, errors and torques of the free joints."""
        names = ["t"]
        for quantity in ("q", "e", "tau"):
            names += [f"{quantity}{i + 1}" for i in self.free]
        return (*names, "tool")

    def _report_failure(self, live: Live, stop: threading.Event, error: str) -> None:
        """Publish why a run failed, unless the run was stopped or replaced in the meantime."""
        if not stop.is_set() and live is self._live and not self._stop.is_set():
            self._error = error
            self._thread = None
            self.desk.running = False
            self.desk.view.ghosts(None)
            self.publish()

    def _end_run(self) -> None:
        self._stop.set()
        self.desk.running = False
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(5.0)
            self._thread = None
            self.desk.view.ghosts(None)

    def _forget_run(self) -> None:
        """End the run of an arm that another has replaced."""
        was_running = self.desk.running
        self._end_run()
        with self._lock:
            self._live = None
            self.settings = replace(self.settings, gains=None)
            self.planar = False
            self._error = "ended: the arm was edited" if was_running else None
        self.publish()

    def _follow_changed_motion(self) -> None:
        """Follow the new motion from now on; hold the setpoint where the motion was taken away."""
        with self._lock:
            live = self._live
            if (
                live is None
                or not self.desk.running
                or self.settings.reference is not ReferenceKind.MOTION
            ):
                return
            if self.motions.motion is None:
                self.settings = replace(self.settings, reference=ReferenceKind.HOLD)
            live.setpoints = self._setpoints(live, self.desk.arm)
        self.publish()

    def _whole_arm(self, q: Array) -> Array:
        """Return the joint values of the whole arm, shape (n,), for those of the free joints, shape (k,)."""
        whole = self._start_q.copy()
        whole[self.free] = q
        return whole

    def _free_arm(self, arm: Arm) -> Arm:
        """Return the arm that has the free joints alone."""
        return arm.lock({i: self.locked[i] for i in self.locked}) if self.planar else arm

    def _plant(self, arm: Arm) -> Arm:
        free_arm = self._free_arm(arm)
        return free_arm.with_payload(self.settings.payload) if self.settings.payload else free_arm

    def _controller(self, live: Live) -> Controller:
        settings = self.settings
        description = live.arm.description
        controller: Controller
        if settings.controller == OWN:
            controller = self.own.controller()
        elif settings.controller in JOINT_CONTROLLERS and settings.gains is not None:
            kp, ki, kd = (np.array(gain)[self.free] for gain in settings.gains)
            controller = PID(kp, ki, kd, limit=description.numbers.effort)
        else:
            controller = make_controller(
                settings.controller, description, settings.bandwidth, settings.damping, live.q
            )
        return FrictionCompensation(controller, live.arm) if settings.compensate else controller

    def _require_reference(self, reference: ReferenceKind) -> None:
        """Refuse a reference that does not exist.

        Raises
        ------
        ValueError
            Names the missing part.
        """
        if reference is ReferenceKind.MOTION and self.motions.motion is None:
            raise ValueError(
                "control: there is no motion to follow; expected one planned first (Motion)"
            )
        if reference is ReferenceKind.TARGET and self.desk.target_q is None:
            raise ValueError(
                "control: there is no target to follow; expected one that is in reach (Tool)"
            )

    def _setpoints(self, live: Live, arm: Arm) -> Setpoints:
        """Return the setpoints of the free joints that the run follows from now on."""
        begin = live.t
        free = self.free
        held = live.setpoint_q if live.t else live.q.copy()
        at_rest = np.zeros(len(free))
        match self.settings.reference:
            case ReferenceKind.TARGET:
                return lambda t: (self._target_setpoint(held), at_rest, at_rest)
            case ReferenceKind.MOTION:
                motion = self.motions.motion
                assert motion is not None  # noqa: S101 - for mypy: _require_reference was called before
                return lambda t: back_and_forth(motion, t - begin, free)
            case ReferenceKind.SINE:
                self.sine = sine = gentle_sine(arm, held, free)

                def sample(t: float) -> tuple[Array, Array, Array]:
                    q, qd, qdd = sine.sampled(np.array([t - begin]))
                    return q[0], qd[0], qdd[0]

                return sample
        return lambda t: (held, at_rest, at_rest)

    def _target_setpoint(self, held: Array) -> Array:
        target_q = self.desk.target_q
        return held if target_q is None else target_q[self.free]

    def _steer(self, q: Array, joint: int | None) -> None:
        """Show the joint values that a person asks for, shape (n,); a run holds those of one joint, or of all."""
        with self._lock:
            live = self._live
            if live is None or not self.desk.running:
                self.desk.show(q)
                return
            held = live.setpoint_q.copy()
            at_rest = np.zeros(len(self.free))
            steered = [k for k, i in enumerate(self.free) if joint in (None, i)]
            if not steered:
                raise ValueError(f"joint {1 + (joint or 0)} is locked: only joints 2 and 3 move")
            held[steered] = q[self.free][steered]
            self.settings = replace(self.settings, reference=ReferenceKind.SLIDERS)
            live.setpoints = lambda t: (held, at_rest, at_rest)
        self.publish()


@lru_cache(maxsize=4)
def _tuned(
    description: Description, name: str, bandwidth: float, damping: float
) -> tuple[Array, Gains]:
    """Return the effective inertias of the joints, shape (n,), and the gains that a joint controller is tuned to."""
    controller = make_controller(name, description, bandwidth, damping)
    assert isinstance(controller, PID)  # noqa: S101 - for mypy: JOINT_CONTROLLERS are PIDs
    gains = (
        np.broadcast_to(gain, description.n)
        for gain in (controller.kp, controller.ki, controller.kd)
    )
    return effective_inertia(description), Gains(*(tuple(gain.tolist()) for gain in gains))
