"""The lines of Python that do what a person has done in the lab."""

from __future__ import annotations

import numpy as np

from dhkit.arm import Arm
from dhkit.description import to_toml
from dhkit.description.library import library_robot, robots
from dhkit.kinematics import classify
from dhkit.lab.control_panel import ControlPanel
from dhkit.lab.desk import Desk
from dhkit.lab.motion_panel import MotionPanel, literal
from dhkit.lab.run_settings import OWN
from dhkit.lab.tool_panel import ToolPanel

CLASSES = {
    "pd": "dhkit.PID.tuned(arm, {w}, {z}, integral=0)",
    "pid": "dhkit.PID.tuned(arm, {w}, {z})",
    "pd-gravity": "dhkit.PDGravity.tuned(arm, {w}, {z})",
    "feed-forward": "dhkit.FeedForward.tuned(arm, {w}, {z})",
    "computed-torque": "dhkit.ComputedTorque.tuned(arm, {w}, {z})",
    "operational-space": "dhkit.OperationalSpace.tuned(arm, {w}, {z})",
    "adaptive": "dhkit.Adaptive.tuned(arm, {w}, {z})",
    "lqr": "dhkit.LQR(arm, q)",
}
FRICTION = {"none": "False", "smooth": "dhkit.Friction(0.05)", "stiction": "True"}


def python_lines(desk: Desk, tool: ToolPanel, motions: MotionPanel, control: ControlPanel) -> str:
    """Return the lines as text; they run as they are."""
    arm = desk.arm
    lines = ["import numpy as np", "import dhkit", "", *_arm(arm), f"q = {literal(desk.q)}", "print(arm.fk(q))"]
    if tool.T is not None:
        lines += _target(arm, tool)
    if motions.motion is not None:
        lines.append(f"motion = {motions.made}")
    if desk.running:
        lines += _run(control)
    return "\n".join(lines) + "\n"


def _arm(arm: Arm) -> list[str]:
    """Return the lines that make the arm: by its name, or from its file, which they write."""
    if arm.name in robots() and library_robot(arm.name) == arm.description:
        return [f"arm = dhkit.Arm.load({arm.name!r})"]
    text = to_toml(arm.description)
    quoted = f'r"""{text}"""' if '"""' not in text else repr(text)
    file = f"{arm.name}-edited.toml"
    return ["from pathlib import Path", "", f"Path({file!r}).write_text({quoted})", f"arm = dhkit.Arm.load({file!r})"]


def _target(arm: Arm, tool: ToolPanel) -> list[str]:
    assert tool.T is not None  # noqa: S101 - for mypy
    lines = [f"T = {literal(tool.T)}"]
    if classify(arm.description).fit is None:
        return [*lines, f"print(arm.ik_numeric(T, q, position_only={arm.n < 6}).q)"]
    lines += ["solutions = arm.ik(T)", "print(solutions.branches, solutions.q)"]
    return lines if tool.chosen is None else [*lines, f"print(solutions.branch({tool.chosen!r}))"]


def _run(control: ControlPanel) -> list[str]:
    """Return the lines that simulate what runs, from its present setpoint."""
    settings, wanted = control.settings, control.wanted
    lines = []
    locked = control.locked
    if locked:
        lines += [f"arm = arm.lock({locked!r})", f"q = q[{control.free!r}]"]
    if settings.reference == "motion" and locked:
        return [
            *lines,
            "# The run follows the motion's joints that are free: arm.simulate takes a motion of these alone.",
        ]
    if settings.controller == OWN:
        return [*lines, "# The controller is your own program's: give arm.simulate a function in its place."]
    w, z = repr(settings.bandwidth), repr(settings.damping)
    made = CLASSES[settings.controller].format(w=w, z=z)
    lines.append(f"controller = {f'dhkit.FrictionCompensation({made}, arm)' if settings.compensate else made}")
    sine = control.sine
    if settings.reference == "motion":
        reference, duration = "motion", ""
    elif settings.reference == "sine" and sine is not None:
        frequency, phase = (float(np.asarray(value)) for value in (sine.frequency, sine.phase))
        values = f"{literal(sine.centre)}, {literal(sine.amplitude)}, {frequency!r}, {phase!r}"
        reference, duration = f"dhkit.Sine({values})", "duration=10.0, "
    else:
        reference, duration = literal(wanted), "duration=5.0, "
    plant = f"plant=arm.with_payload({settings.payload!r}), " if settings.payload else ""
    start = "" if settings.reference in ("motion", "sine") else "q0=q, "
    lines.append(
        f"run = arm.simulate(controller, {reference}, {duration}{start}{plant}friction={FRICTION[settings.friction]})"
    )
    return [*lines, 'dhkit.plot(run).savefig("run.png")']
