"""Verification, motions with their torques, and controllers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dhkit.control import SimulationResult, compare
from dhkit.description import Description
from dhkit.description.joint_text import joint_unit
from dhkit.display import counted, plain
from dhkit.errors import DhkitError
from dhkit.report.document import Block, Heading, Items, Paragraph, Prompt, Table
from dhkit.report.pictures import figure_block
from dhkit.report.sections.dynamics import dynamics_section
from dhkit.report.sections.kinematics import table_block
from dhkit.report.sections.robot import moved, ready
from dhkit.report.words import Attachments, joint_values, name_of, number, with_minus_signs
from dhkit.trajectories import Trajectory, quintic

CONTROLLERS = ("pd-gravity", "pid", "computed-torque")
"""Controllers that are compared."""
_WORDS = {
    "pd-gravity": "PD control of each joint with gravity compensation",
    "pid": "independent PID control of each joint",
    "computed-torque": "computed torque: the model's M, C and g cancel the arm's own dynamics",
}
_SHORTEST = 2.0
"""Shortest duration of the motion that is made here, s; longer ones take twice their least time."""
_LONGEST_LIST = 200
"""Longest list of names that is shown, characters."""
_STATES = 300
"""Number of random states of the verification."""
_FIGURE_WIDTH = 8.6
"""Width that figures over time are drawn with, inches; they are made for screens and are 11.5 wide there."""
_SAMPLES = 401
"""Number of samples of a motion in which its largest torques are looked for."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of a report, and where it comes from in words."""

    trajectory: Trajectory | None
    words: str


def default_motion(description: Description) -> Motion:
    """Return a quintic between the first configuration and one with every joint moved; none where limits forbid it."""
    name, first = ready(description)
    numbers = description.numbers
    start = np.clip(first, numbers.lower, numbers.upper)
    goal = moved(description, start)
    try:
        shortest = 0.0
        if np.isfinite(numbers.velocity).any() or np.isfinite(numbers.effort).any():
            shortest = quintic(description, start, goal).duration
        motion = quintic(description, start, goal, max(_SHORTEST, 2 * shortest))
    except (DhkitError, ValueError) as error:
        return Motion(None, str(error))
    return Motion(motion, f"a quintic polynomial from {name} to {joint_values(description, goal)}")


def verification_section(description: Description) -> Iterator[Block]:
    """Yield the table of dhkit's numbers beside Pinocchio's."""
    yield Heading("Verification")
    from dhkit.verification import verify

    try:
        report = verify(description, _STATES)
    except DhkitError as error:
        yield Paragraph(f"Not done: {error}.")
        return
    yield Paragraph(
        f"dhkit's kinematics and dynamics were compared with those of {report.reference}, which computes them from the "
        f"robot's URDF by other algorithms, in {report.samples} random states. All quantities "
        f"{'agree' if report.ok else 'do NOT agree'}. Errors are the largest difference of an entry, relative to the "
        "size of the quantity."
    )
    rows = []
    for agreement in report.agreements:
        verdict = "agrees" if agreement.ok else "DISAGREES"
        rows.append(
            (agreement.quantity, f"{agreement.error:.1e}", f"{agreement.tolerance:.0e}", verdict)
        )
    yield Table(
        ("quantity", "worst error", "at most", "verdict"),
        tuple(rows),
        f"{name_of(description)} against {report.reference}, {report.samples} states, seed {report.seed}",
        "lrrl",
    )
    for note in report.notes:
        yield Paragraph(f"Note: {note}.")


def motion_section(description: Description, motion: Motion) -> Iterator[Block]:
    """Yield the section on a motion and its torques."""
    from dhkit.viewer import plot

    yield Heading("Motion")
    if motion.trajectory is None:
        yield Paragraph(f"No motion: {motion.words}.")
        return
    trajectory = motion.trajectory
    yield Paragraph(f"The motion is {motion.words}; it takes {number(trajectory.duration)} s.")
    has_bodies = bool(np.isfinite(description.numbers.mass).all())
    if not has_bodies:
        yield Paragraph("The robot has a link without body, so that there are no torques.")
    size = trajectory.sample(n=_SAMPLES)
    numbers = description.numbers
    rows = []
    tau = size.tau if has_bodies else np.full(size.q.shape, np.nan)
    for i, joint in enumerate(description.joints):
        factor = 1.0 if numbers.prismatic[i] else 180 / np.pi
        unit = "m" if numbers.prismatic[i] else "°"
        torque = float(np.abs(tau[:, i]).max()) if has_bodies else np.nan
        share = (
            f"{100 * torque / numbers.effort[i]:.0f} %"
            if has_bodies and np.isfinite(numbers.effort[i])
            else ""
        )
        rows.append(
            (
                f"{i + 1} {joint.name}",
                f"{number(factor * float(size.q[0, i]))} {unit}".replace(" °", "°"),
                f"{number(factor * float(size.q[-1, i]))} {unit}".replace(" °", "°"),
                f"{number(factor * float(np.abs(size.qd[:, i]).max()))} {unit}/s".replace(
                    " °", "°"
                ),
                f"{number(torque)} {'N' if numbers.prismatic[i] else 'N m'}" if has_bodies else "",
                share,
            )
        )
    yield Table(
        ("joint", "begin", "end", "largest speed", "largest torque", "of its limit"),
        tuple(rows),
        "The motion by joints",
        "lrrrrr",
    )
    yield figure_block(
        plot(trajectory),
        "Joint values, rates and torques over time, and the path of the tool; limits near the curves are dashed",
        width=_FIGURE_WIDTH,
    )
    yield Prompt("Say why this motion was chosen, and what limits it.")


def control_section(
    description: Description, motion: Motion, run: SimulationResult | None, files: Attachments
) -> Iterator[Block]:
    """Yield the section on control: controllers compared, and a simulation if there is one.

    A simulation of another arm, such as one with locked joints, is the simplified model of the seed paper's option 2:
    its equations come first.
    """
    subject = description
    if run is not None and run.description != description:
        subject = run.description
        yield from _model(subject, files)
    yield Heading("Control")
    if not np.isfinite(subject.numbers.mass).all():
        yield Paragraph("The robot has a link without body, so that nothing can be simulated.")
        yield Prompt(
            "State which controller you would choose, and on which simplified model you would try it."
        )
        return
    if subject is not description:
        motion = default_motion(subject)
    yield from _comparison(subject, motion)
    if run is not None:
        yield from _run(run)
    yield Prompt(
        "State the gains and how they were chosen, discuss the errors of the controllers, and what a real arm would "
        "add (friction, payload, sampling)."
    )


def _model(subject: Description, files: Attachments) -> Iterator[Block]:
    """Yield the equations of the simplified model."""
    joints = plain(", ".join(joint.name for joint in subject.joints), _LONGEST_LIST)
    blocks = list(dynamics_section(subject, files, "Simplified model for control"))
    yield blocks[0]
    yield Paragraph(
        f"Control is tried on a simplified model with {counted(subject.n, 'moving joint')} ({joints}): the other "
        "joints of the robot are locked, and their links belong to those that move."
    )
    yield table_block(subject, "the simplified model")
    yield from blocks[1:]


def _comparison(description: Description, motion: Motion) -> Iterator[Block]:
    """Yield the errors of controllers on a motion."""
    from dhkit.viewer import plot_comparison

    if motion.trajectory is None:
        yield Paragraph(f"No comparison of controllers: {motion.words}.")
        return
    compared = compare(description, motion.trajectory, CONTROLLERS)
    yield Paragraph(
        f"Controllers are compared on {motion.words}, in {number(motion.trajectory.duration)} s, each with a sampling "
        "rate of 1 kHz, a bandwidth of 20 rad/s and a damping ratio of 1:"
    )
    yield Items(tuple((f"{name}: {text}",) for name, text in _WORDS.items()))
    headings, rows = compared.rows()
    yield Table(
        tuple(headings),
        tuple((row[0], *with_minus_signs(row[1:])) for row in rows),
        "Errors of the joint that errs most, the tool's largest error, and the largest torque as a share of the limits",
        "lrrrrr",
    )
    for name, reason in compared.failures.items():
        yield Paragraph(f"{name}: {reason}.")
    if compared.results:
        yield figure_block(
            plot_comparison(compared.results),
            "Errors of the controllers over time",
            width=_FIGURE_WIDTH,
        )


def _run(run: SimulationResult) -> Iterator[Block]:
    """Yield a simulation of its own: errors and figure."""
    from dhkit.viewer import plot

    controller = f" with {run.controller}" if run.controller else ""
    yield Heading("Simulation", 2)
    unit = joint_unit(run.description.numbers.prismatic)
    yield Paragraph(
        f"The simulation{controller} takes {number(float(run.t[-1]))} s. The joint that errs most is off by "
        f"{number(float(run.peak_error.max()))} {unit} (RMS {number(float(run.rms_error.max()))}, at the end "
        f"{number(float(run.final_error.max()))}); the tool by {number(1000 * run.tool_norms.peak)} mm. Energy: "
        f"{run.audit}."
    )
    yield figure_block(
        plot(run),
        "Joint values with the reference (dashed), errors and torques of the simulation",
        width=_FIGURE_WIDTH,
    )
