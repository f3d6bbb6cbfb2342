"""The panel "Copy as Python": the lines of Python equivalent to a person's work in the lab."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import to_toml
from dhkit.description.library import library_robot, robots
from dhkit.kinematics import classify
from dhkit.lab.control_panel import ControlPanel
from dhkit.lab.desk import Desk
from dhkit.lab.motion_panel import MotionPanel, literal
from dhkit.lab.requests import Fields, JsonObject, Panel, answers
from dhkit.lab.run_settings import OWN, FrictionKind, ReferenceKind
from dhkit.lab.table_panel import TablePanel
from dhkit.lab.tool_panel import ToolPanel

CONSTRUCTORS = {
    "pd": "dhkit.PID.tuned(arm, {w}, {z}, integral=0)",
    "pid": "dhkit.PID.tuned(arm, {w}, {z})",
    "pd-gravity": "dhkit.PDGravity.tuned(arm, {w}, {z})",
    "feed-forward": "dhkit.FeedForward.tuned(arm, {w}, {z})",
    "computed-torque": "dhkit.ComputedTorque.tuned(arm, {w}, {z})",
    "operational-space": "dhkit.OperationalSpace.tuned(arm, {w}, {z})",
    "adaptive": "dhkit.Adaptive.tuned(arm, {w}, {z})",
    "lqr": "dhkit.LQR(arm, q)",
}
"""The call that makes each controller, for a bandwidth w in rad/s and a damping z."""
FRICTION_ARGUMENTS = {
    FrictionKind.NONE: "False",
    FrictionKind.SMOOTH: "dhkit.Friction(0.05)",
    FrictionKind.STICTION: "True",
}


class PythonPanel(Panel):
    """The request for the lines of Python equivalent to the panels; they run as they are."""

    def __init__(
        self,
        desk: Desk,
        table: TablePanel,
        tool: ToolPanel,
        motions: MotionPanel,
        control: ControlPanel,
        source: str | None = None,
    ) -> None:
        super().__init__(desk)
        self.table = table
        self._first = desk.arm
        self._source = source
        """Name or path that the first arm was loaded from."""
        self.tool = tool
        self.motions = motions
        self.control = control

    @answers("python")
    def write(self, _: Fields) -> JsonObject:
        """Return the lines as one text."""
        lines = ["import numpy as np", "import dhkit", "", *self._arm_lines()]
        lines += [f"q = {literal(self.desk.q)}", "print(arm.fk(q))"]
        if self.tool.T is not None:
            lines += self._target_lines(self.tool.T)
        if self.motions.motion is not None:
            lines.append(f"motion = {self.motions.call}")
        if self.desk.running:
            lines += self._run_lines()
        return {"text": "\n".join(lines) + "\n"}

    def _arm_lines(self) -> list[str]:
        """Return the lines that load the arm: by its name or file where nothing but locks or bodies were changed.

        An edited arm is written into a file of its own; its meshes fitted the old lengths alone.
        """
        arm = self._first
        calls = ""
        whole = self.table.whole
        if whole is not None:
            arm = arm.lock(whole.values)
            calls += f".lock({whole.values})"
        if self.desk.assumed_bodies:
            arm = arm.with_uniform_links()
            calls += ".with_uniform_links()"
        loaded = self._load_call()
        if loaded is not None and arm.description == self.desk.arm.description:
            return [f"arm = {loaded}{calls}"]
        arm = self.desk.arm
        text = to_toml(arm.description)
        quoted = f'r"""{text}"""' if '"""' not in text else repr(text)
        file = f"{arm.name}-edited.toml"
        load = f"arm = dhkit.Arm.load({file!r})"
        return ["from pathlib import Path", "", f"Path({file!r}).write_text({quoted})", load]

    def _load_call(self) -> str | None:
        """Return the call that loads the first arm; None if it comes from no file and is not in the library."""
        if self._source is not None:
            return f"dhkit.Arm.load({self._source!r})"
        name = self._first.name
        if name in robots() and library_robot(name) == self._first.description:
            return f"dhkit.Arm.load({name!r})"
        return None

    def _target_lines(self, T: ArrayLike) -> list[str]:
        """Return the lines that solve the inverse kinematics at the target, shape (4, 4), m."""
        lines = [f"T = {literal(T)}"]
        arm = self.desk.arm
        branch = self.tool.chosen
        if classify(arm.description).fit is None:
            return [*lines, f"print(arm.ik_numeric(T, q, position_only={arm.n < 6}).q)"]
        lines += ["solutions = arm.ik(T)", "print(solutions.branches, solutions.q)"]
        return lines if branch is None else [*lines, f"print(solutions.branch({branch!r}))"]

    def _run_lines(self) -> list[str]:
        """Return the lines that simulate the present run from its present setpoint."""
        settings = self.control.settings
        locked = self.control.locked
        sine = self.control.sine
        lines = [f"arm = arm.lock({locked!r})", f"q = q[{self.control.free!r}]"] if locked else []
        if settings.reference is ReferenceKind.MOTION and locked:
            text = "# The run follows the motion's joints that are free: arm.simulate takes a motion of these alone."
            return [*lines, text]
        if settings.controller == OWN:
            return [
                *lines,
                "# The controller is your own program's: give arm.simulate a function in its place.",
            ]
        controller = CONSTRUCTORS[settings.controller].format(
            w=repr(settings.bandwidth), z=repr(settings.damping)
        )
        if settings.gains is not None:
            gains = np.array(settings.gains)[:, self.control.free].tolist()
            listed = ", ".join(str(gain) for gain in gains)
            controller = f"dhkit.PID({listed}, limit=arm.description.numbers.effort)"
        if settings.compensate:
            controller = f"dhkit.FrictionCompensation({controller}, arm)"
        arguments = ["controller", literal(self.control.setpoint), "duration=5.0", "q0=q"]
        if settings.reference is ReferenceKind.MOTION:
            arguments = ["controller", "motion"]
        elif settings.reference is ReferenceKind.SINE and sine is not None:
            frequency, phase = (float(np.asarray(value)) for value in (sine.frequency, sine.phase))
            values = f"{literal(sine.centre)}, {literal(sine.amplitude)}, {frequency!r}, {phase!r}"
            arguments = ["controller", f"dhkit.Sine({values})", "duration=10.0"]
        if settings.payload:
            arguments.append(f"plant=arm.with_payload({settings.payload!r})")
        arguments.append(f"friction={FRICTION_ARGUMENTS[settings.friction]}")
        run = f"run = arm.simulate({', '.join(arguments)})"
        return [*lines, f"controller = {controller}", run, 'dhkit.plot(run).savefig("run.png")']
