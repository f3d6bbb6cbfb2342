"""`dhkit simulate` and `dhkit compare`: an arm under one controller, or under several on one motion."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from dhkit.arm import Arm
from dhkit.cli.arguments import payload, with_long_options
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.options import Columns, Degrees, Json, Robot, Uniform, load_arm
from dhkit.cli.output import (
    FIGURES,
    MotionFiles,
    check_outputs,
    print_json,
    print_table,
    say,
    say_written,
    write_figure,
)
from dhkit.cli.progress import ProgressBar
from dhkit.cli.simulation_settings import (
    chosen_motion,
    known_and_moving_arm,
    simulation_options,
    tuned_controller,
)
from dhkit.cli.units import joint_entry
from dhkit.control import CONTROLLERS, Sensors, SimulationResult, compare as compare_controllers
from dhkit.errors import SimulationError
from dhkit.trajectories import Trajectory

MAX_ENERGY_ERROR = 1e-6
"""Largest residual of the energy balance, as a share of the energy turned over; above it the steps are too long."""
SUFFIXES = (".npz", ".mat", ".csv")

app = typer.Typer(rich_markup_mode=None)

LONG_OPTIONS: dict[str, int | None] = dict.fromkeys(
    ("--from", "--to", "--payload", "--push", "--columns")
)
Motion = Annotated[
    Path | None,
    typer.Option(
        "--motion",
        help="File of the motion to follow: .npz, .mat, .csv or .yaml, of dhkit or of another program.",
    ),
]
Start = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="Q ...",
        help="Start of a motion instead of a file: joint values or a configuration's name; default: nominal, ready, "
        "home, another one, or zero, whichever there is first.",
    ),
]
Goal = Annotated[
    str | None,
    typer.Option(
        "--to",
        metavar="Q ...",
        help="Goal of a motion instead of a file: joint values or a configuration's name; default: each joint of the "
        "default start moved by 1 rad or less.",
    ),
]
Duration = Annotated[
    float | None,
    typer.Option(
        help="Duration of a motion between configurations, s; default: twice the least, 2 at least."
    ),
]
Bandwidth = Annotated[float, typer.Option(help="Bandwidth that gains are tuned for, rad/s.")]
Damping = Annotated[float, typer.Option(help="Damping ratio that gains are tuned for.")]
Rate = Annotated[float, typer.Option(help="Sampling rate of the controller, Hz.")]
PlantRate = Annotated[
    float | None,
    typer.Option(help="Rate of the integration's steps, Hz; default: that of the controller."),
]
Load = Annotated[
    str | None,
    typer.Option(
        "--payload",
        metavar="KG [@ X Y Z]",
        help="Payload, kg, and its centre of mass in the tool's frame, m; default: that of the planned motion.",
    ),
]
Unmodelled = Annotated[
    bool, typer.Option("--unmodelled", help="The controller's model has no payload.")
]
FrictionOption = Annotated[
    str,
    typer.Option(
        "--friction",
        metavar="none|stiction|WIDTH",
        help="Joint friction; WIDTH, rad/s, is that of smooth friction.",
    ),
]
Restitution = Annotated[
    float, typer.Option(help="Coefficient of restitution of the joint stops, 0 to 1.")
]
NoStops = Annotated[bool, typer.Option("--no-stops", help="Simulate without joint stops.")]
PushOption = Annotated[
    list[str] | None,
    typer.Option(
        "--push",
        metavar="FX FY FZ @ BEGIN END",
        help="Force on the tool, N, world axes, from BEGIN to END, s; may be given again.",
    ),
]


@app.command(cls=with_long_options(LONG_OPTIONS))
def simulate(
    robot: Robot,
    controller: Annotated[
        str,
        typer.Option(
            help="pd, pid, pd-gravity, feed-forward, computed-torque, operational-space, adaptive, lqr or none."
        ),
    ] = "computed-torque",
    motion: Motion = None,
    columns: Columns = None,
    start: Start = None,
    to: Goal = None,
    duration: Duration = None,
    bandwidth: Bandwidth = 20.0,
    damping: Damping = 1.0,
    rate: Rate = 1000.0,
    plant_rate: PlantRate = None,
    continuous: Annotated[
        bool,
        typer.Option(
            "--continuous", help="Run the controller in continuous time, without a sampling rate."
        ),
    ] = False,
    load: Load = None,
    unmodelled: Unmodelled = False,
    friction: FrictionOption = "none",
    compensate: Annotated[
        bool, typer.Option("--compensate", help="Let the controller compensate friction.")
    ] = False,
    restitution: Restitution = 0.0,
    no_stops: NoStops = False,
    push: PushOption = None,
    noise: Annotated[
        float,
        typer.Option(
            min=0,
            help="Standard deviation of measured joint values; rad, with --degrees too, and m.",
        ),
    ] = 0.0,
    resolution: Annotated[
        float,
        typer.Option(
            min=0, help="Resolution of the encoders at the joints; rad, also with --degrees, and m."
        ),
    ] = 0.0,
    degrees: Degrees = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write the run: .npz, .mat or .csv.")
    ] = None,
    html: Annotated[Path | None, typer.Option(help="Write a page that plays the motion.")] = None,
    figure: Annotated[
        Path | None, typer.Option(help="Write a figure of the motion: .png, .svg or .pdf.")
    ] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> ExitStatus:
    """Simulate an arm under a controller; exit status 1 where the run does not get to its end."""
    bare = load_arm(robot, uniform)
    sensors = Sensors(noise=noise, resolution=resolution) if noise or resolution else None
    trajectory, text = chosen_motion(bare, motion, start, to, duration, degrees, columns)
    arm, plant = known_and_moving_arm(bare, payload(load) or trajectory.payload, unmodelled)
    stops = None if no_stops else restitution
    options = simulation_options(
        plant, None if continuous else rate, plant_rate, friction, stops, push or ()
    )
    files = MotionFiles(output, html, figure)
    files.check(SUFFIXES)
    tuned = tuned_controller(controller, arm, trajectory, bandwidth, damping, compensate)
    begin = time.perf_counter()
    failure = ""
    result = None
    try:
        with ProgressBar("simulating") as bar:
            result = arm.simulate(
                tuned, trajectory, options=options, sensors=sensors, progress=bar.show
            )
    except SimulationError as error:
        failure = str(error)
        result = error.result
    seconds = time.perf_counter() - begin
    written: list[str] = []
    if result is not None:
        caption = (
            f"A simulation of {result.t[-1]:.3g} s; the grey arm is what was asked for, and the tool is "
            f"{1000 * result.tool_norms.peak:.3g} mm away from it at most."
        )
        written = files.write(arm, result, "simulation", caption)
    if json:
        facts = {} if result is None else _facts(arm, result, degrees=degrees)
        head = {"robot": arm.name, "controller": controller, "failure": failure or None}
        print_json({**head, **facts, "files": written})
    else:
        if result is not None:
            say(
                f"{arm.name}: {controller}, {'continuous' if continuous else f'{rate:g} Hz'}",
                "bold",
            )
            say(
                f"{_about(text, trajectory, arm, plant)}; {result.t[-1]:g} s simulated in {seconds:.2f} s\n"
            )
            _print(result, degrees=degrees)
        if written:
            say("")
            say_written(written)
    if failure:
        sys.stderr.write(f"dhkit: {' '.join(failure.split())}\n")
    return ExitStatus.NO if failure else ExitStatus.FINE


def _about(text: str, motion: Trajectory, arm: Arm, plant: Arm) -> str:
    """Return the description of a motion with its duration, and of a payload of the plant that the arm lacks."""
    load = "" if plant is arm else ", with a payload that the controller does not know of"
    return f"{text}, {motion.duration:.4g} s{load}"


def _print(result: SimulationResult, *, degrees: bool) -> None:
    description = result.description
    unit = _units(description.numbers.prismatic, degrees)
    torque = np.abs(result.tau).max(axis=0)
    norms = (result.peak_error, result.rms_error, result.final_error)
    rows = []
    for i, joint in enumerate(description.joints):
        limit = description.numbers.effort[i]
        share = f"{100 * torque[i] / limit:.0f}" if np.isfinite(limit) else "no limit"
        errors = [f"{x[i] * unit[i][1]:.3g}" for x in norms]
        rows.append((joint.name, *errors, unit[i][0], share, f"{100 * result.saturated[i]:.0f}"))
    headings = (
        "joint",
        "largest error",
        "RMS",
        "at the end",
        "",
        "largest torque [% of limit]",
        "saturated [% of time]",
    )
    print_table(headings, rows)
    peak, rms, final = (f"{1000 * x:.3g} mm" for x in result.tool_norms)
    say(f"\ntool: largest error {peak}, RMS {rms}, at the end {final}")
    audit = result.audit
    say(
        f"energy: drives {audit.drives:.4g} J, pushes {audit.pushes:.4g} J, friction {audit.friction:.4g} J, impacts "
        f"{audit.impacts:.4g} J; residual of the balance: {audit.error:.1e} of the energy turned over"
    )
    if not audit.error <= MAX_ENERGY_ERROR:
        say("the integration's steps are too long for this motion: give a larger --plant-rate")


def _units(prismatic: NDArray[np.bool_], degrees: bool) -> list[tuple[str, float]]:
    """Return the unit of each joint's errors, and the factor to it from rad or m."""
    angle_unit = ("°", 180 / np.pi) if degrees else ("rad", 1.0)
    return [("m", 1.0) if slides else angle_unit for slides in prismatic.tolist()]


def _facts(arm: Arm, result: SimulationResult, *, degrees: bool) -> dict[str, object]:
    """Return the numbers of a run that `--json` prints."""
    tool = result.tool_norms
    return {
        "duration_s": float(result.t[-1]),
        "steps": len(result.t) - 1,
        **joint_entry(arm, "peak_error", result.peak_error, degrees=degrees),
        **joint_entry(arm, "rms_error", result.rms_error, degrees=degrees),
        **joint_entry(arm, "final_error", result.final_error, degrees=degrees),
        "tool_error_m": {"peak": tool.peak, "rms": tool.rms, "final": tool.final},
        "saturated": result.saturated.tolist(),
        "energy_error": result.audit.error,
    }


@app.command(cls=with_long_options(LONG_OPTIONS))
def compare(
    robot: Robot,
    controllers: Annotated[
        str, typer.Option(help="Names of controllers, separated by commas; default: all.")
    ] = "",
    motion: Motion = None,
    columns: Columns = None,
    start: Start = None,
    to: Goal = None,
    duration: Duration = None,
    bandwidth: Bandwidth = 20.0,
    damping: Damping = 1.0,
    rate: Rate = 1000.0,
    plant_rate: PlantRate = None,
    load: Load = None,
    unmodelled: Unmodelled = False,
    friction: FrictionOption = "none",
    restitution: Restitution = 0.0,
    no_stops: NoStops = False,
    push: PushOption = None,
    degrees: Degrees = False,
    figure: Annotated[Path | None, typer.Option(help="Write a figure: .png, .svg or .pdf.")] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> ExitStatus:
    """Compare controllers on one motion; exit status 1 where one does not get to its end."""
    bare = load_arm(robot, uniform)
    trajectory, text = chosen_motion(bare, motion, start, to, duration, degrees, columns)
    arm, plant = known_and_moving_arm(bare, payload(load) or trajectory.payload, unmodelled)
    options = simulation_options(
        plant, rate, plant_rate, friction, None if no_stops else restitution, push or ()
    )
    about = f"{_about(text, trajectory, arm, plant)}, {rate:g} Hz"
    check_outputs(((figure, FIGURES),))
    names = [name.strip() for name in controllers.split(",")] if controllers else list(CONTROLLERS)
    with ProgressBar(f"simulating {names[0]}") as bar:
        comparison = compare_controllers(
            arm.description,
            trajectory,
            names,
            bandwidth,
            damping,
            lambda name: bar.show(names.index(name) + 1, len(names), f"simulated {name}"),
            options=options,
        )
    if figure is not None and comparison.results:
        from dhkit.viewer import plot_comparison

        write_figure(plot_comparison(comparison.results, f"{arm.name}: {about}"), figure)
    if json:
        facts = {
            name: _facts(arm, result, degrees=degrees)
            for name, result in comparison.results.items()
        }
        print_json({"robot": arm.name, "controllers": facts, "failures": dict(comparison.failures)})
    else:
        say(f"{arm.name}: {about}, {bandwidth:g} rad/s\n", "bold")
        headings, rows = comparison.rows(degrees=degrees)
        print_table(headings, rows)
        for name, reason in comparison.failures.items():
            say(f"\n{name}: {reason}")
        if figure is not None and comparison.results:
            say(f"\nwrote {figure}")
    return ExitStatus.NO if comparison.failures else ExitStatus.FINE
