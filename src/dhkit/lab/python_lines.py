"""The lines of Python that do what a person has done in the lab."""

from __future__ import annotations

import numpy as np

from dhkit.description import Array, Description, to_toml
from dhkit.description.library import library_robot, robots
from dhkit.lab.control_panel import ControlPanel
from dhkit.lab.desk import Desk
from dhkit.lab.motion_panel import MotionPanel
from dhkit.lab.tool_panel import ToolPanel

__all__ = ["python_lines"]

CLASSES = {
    "pd": "dhkit.PID.tuned(arm, {w:g}, {z:g}, integral=0)",
    "pid": "dhkit.PID.tuned(arm, {w:g}, {z:g})",
    "pd-gravity": "dhkit.PDGravity.tuned(arm, {w:g}, {z:g})",
    "feed-forward": "dhkit.FeedForward.tuned(arm, {w:g}, {z:g})",
    "computed-torque": "dhkit.ComputedTorque.tuned(arm, {w:g}, {z:g})",
    "operational-space": "dhkit.OperationalSpace.tuned(arm, {w:g}, {z:g})",
    "adaptive": "dhkit.Adaptive.tuned(arm, {w:g}, {z:g})",
    "lqr": "dhkit.LQR(arm, q)",
}
FRICTION = {"none": "False", "smooth": "dhkit.Friction(0.05)", "stiction": "True"}


def python_lines(desk: Desk, tool: ToolPanel, motions: MotionPanel, control: ControlPanel) -> str:
    """Return the lines as text; they run as they are where the arm is the library's."""
    arm = desk.arm
    lines = ["import numpy as np", "import dhkit", ""]
    if arm.name in robots() and library_robot(arm.name) == arm.description:
        lines.append(f"arm = dhkit.Arm.load({arm.name!r})")
    else:
        lines += [
            f"# The arm's file, as `download` gives it: save it as {arm.name}.toml.",
            *_commented(arm.description),
        ]
        lines.append(f"arm = dhkit.Arm.load({f'{arm.name}.toml'!r})")
    lines.append(f"q = {_array(desk.q)}")
    lines.append("print(arm.fk(q))")
    if tool.T is not None:
        lines += [f"T = {_array(tool.T)}", "solutions = arm.ik(T)", "print(solutions.branches, solutions.q)"]
    if motions.motion is not None:
        lines.append(_motion(motions, arm.n))
    if desk.running:
        settings = control.settings
        made = CLASSES[settings.controller].format(w=settings.bandwidth, z=settings.damping)
        plant = f"plant=arm.with_payload({settings.payload:g}), " if settings.payload else ""
        lines.append(f"controller = {f'dhkit.FrictionCompensation({made}, arm)' if settings.compensate else made}")
        follows = "motion" if settings.reference == "motion" else "q"
        duration = "" if follows == "motion" else "duration=5.0, "
        lines.append(
            f"run = arm.simulate(controller, {follows}, {duration}{plant}friction={FRICTION[settings.friction]})"
        )
        lines.append('dhkit.plot(run).savefig("run.png")')
    return "\n".join(lines) + "\n"


def _motion(motions: MotionPanel, n: int) -> str:
    motion = motions.motion
    if motion is None:
        return ""
    start, goal = _array(motion.q(0.0)), _array(motion.q(motion.duration))
    if motions.kind in ("quintic", "trapezoidal"):
        return f"motion = arm.{motions.kind}({start}, {goal}, {motion.duration!r})"
    if motions.kind == "least time":
        return f"motion = arm.plan({start}, {goal})"
    if motions.kind == "line":
        return f"motion = arm.straight_line(arm.fk({start}), arm.fk({goal}), {start}, {motion.duration!r})"
    return f"motion = dhkit.Trajectory.load({'motion.npz'!r})  # as `download` gives it"


def _array(array: Array) -> str:
    return f"np.array({np.asarray(array).tolist()!r})"


def _commented(description: Description) -> list[str]:
    return [f"# {line}".rstrip() for line in to_toml(description).splitlines()]
