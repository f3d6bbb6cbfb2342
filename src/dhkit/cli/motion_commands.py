"""Commands about motions: plan, simulate, compare, play and picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dhkit.cli.arguments import joint_limits, objective, obstacles, option_values, payload, target, with_long_options
from dhkit.cli.options import Degrees, Json, Robot, Uniform, degrees_option, load_arm
from dhkit.cli.output import MotionFiles
from dhkit.errors import DescriptionError

app = typer.Typer()

PLAN_OPTIONS: dict[str, int | None] = {
    **dict.fromkeys(("--from", "--to", "--via", "--matrix", "--like", "--objective", "--payload", "--box", "--sphere")),
    **dict.fromkeys(("--velocity", "--acceleration", "--jerk", "--torque")),
    "--xyz": 3,
    "--euler": 3,
    "--floor": 1,
}


@app.command(cls=with_long_options(PLAN_OPTIONS))
def plan(
    robot: Robot,
    start: Annotated[
        str, typer.Option("--from", metavar="Q ...", help="Joint values, or the name of a configuration.")
    ] = "ready",
    to: Annotated[str | None, typer.Option(metavar="Q ...", help="The same at the goal.")] = None,
    xyz: Annotated[str | None, typer.Option(metavar="X Y Z", help="Or the tool's position there, m.")] = None,
    euler: Annotated[str, typer.Option(metavar="A B C", help="Its Euler angles, rad.")] = "0 0 0",
    order: Annotated[str, typer.Option(help="Of the Euler angles: XYZ moving axes, xyz fixed ones.")] = "XYZ",
    matrix: Annotated[
        str | None, typer.Option(metavar="M11 ... M44", help="Or the pose by row, 16 or 12 numbers; or a file of them.")
    ] = None,
    like: Annotated[
        str | None, typer.Option(metavar="Q ...", help="Or where these joint values put the tool, by any branch.")
    ] = None,
    via: Annotated[
        list[str] | None, typer.Option(metavar="Q ...", help="Pass here on the way; may be given again.")
    ] = None,
    wanted: Annotated[
        str, typer.Option("--objective", help='time, effort, energy, jerk, or a sum: "time + 1e-4 effort".')
    ] = "time",
    duration: Annotated[float | None, typer.Option(help="s; for objectives without time.")] = None,
    speed: Annotated[float, typer.Option(min=0.001, max=1, help="Share of the joints' speeds that may be used.")] = 1.0,
    velocity: Annotated[
        str | None, typer.Option(metavar="V ...", help="Limit in place of the robot's, for all joints or each; rad/s.")
    ] = None,
    acceleration: Annotated[str | None, typer.Option(metavar="A ...", help="Likewise; rad/s^2.")] = None,
    jerk: Annotated[str | None, typer.Option(metavar="J ...", help="Likewise; rad/s^3.")] = None,
    torque: Annotated[str | None, typer.Option(metavar="T ...", help="Likewise; N m.")] = None,
    load: Annotated[
        str | None,
        typer.Option("--payload", metavar="KG [@ X Y Z]", help="Load, its centre of mass in the tool's frame, m."),
    ] = None,
    tool_speed: Annotated[float | None, typer.Option(help="Limit of the tool's speed, m/s.")] = None,
    box: Annotated[
        list[str] | None, typer.Option(metavar="SX SY SZ @ X Y Z", help="Keep away from it; edges and centre, m.")
    ] = None,
    sphere: Annotated[
        list[str] | None, typer.Option(metavar="R @ X Y Z", help="Keep away from it; radius and centre, m.")
    ] = None,
    floor: Annotated[str | None, typer.Option(metavar="Z", help="Stay above this height, m.")] = None,
    clearance: Annotated[float, typer.Option(min=0, help="How far to keep away, m.")] = 0.01,
    self_collision: Annotated[bool, typer.Option("--self-collision", help="Keep links from each other too.")] = False,
    line: Annotated[bool, typer.Option("--line", help="The tool goes straight.")] = False,
    intervals: Annotated[int | None, typer.Option(min=6, max=2000, help="Of the mesh.")] = None,
    time_limit: Annotated[float, typer.Option(min=0.01, help="To search, s.")] = 30.0,
    degrees: Degrees = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write the motion: .npz, .mat, .csv or .yaml.")
    ] = None,
    html: Annotated[Path | None, typer.Option(help="Write a page that plays it.")] = None,
    figure: Annotated[Path | None, typer.Option(help="Write a figure of it: .png, .svg or .pdf.")] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> int:
    """Plan the best motion to joint values or a pose, certified; exit status 1 where there is none.

    Sliding joints are in m and N. Numbers may be expressions such as 17*inch or pi/2.
    """
    from dhkit.cli import plan as plan_command

    arm = load_arm(robot, uniform)
    pose = {"xyz": xyz, "matrix": matrix, "like": like}
    if sum(given is not None for given in (to, *pose.values())) != 1:
        raise DescriptionError("where to? expected one of --to, --xyz, --matrix and --like")
    settings = plan_command.PlanSettings(
        arm=arm,
        start=option_values(arm, start, "--from", degrees),
        goal=target(arm, **pose, euler=euler, order=order, degrees=degrees)
        if to is None
        else option_values(arm, to, "--to", degrees),
        via=[option_values(arm, place, "--via", degrees) for place in via or ()],
        objective=objective(wanted),
        duration=duration,
        limits=joint_limits(
            arm, {"velocity": velocity, "acceleration": acceleration, "jerk": jerk, "torque": torque}, degrees, speed
        ),
        payload=payload(load),
        tool_speed=tool_speed,
        obstacles=obstacles(box or (), sphere or (), floor),
        clearance=clearance,
        self_collision=self_collision,
        intervals=intervals,
        time_limit=time_limit,
        line=line,
    )
    return plan_command.run(settings, MotionFiles(output, html, figure), degrees=degrees, json=json)


MOTION_OPTIONS: dict[str, int | None] = dict.fromkeys(("--from", "--to", "--payload", "--push", "--columns"))
Motion = Annotated[
    Path | None, typer.Option("--motion", help="Follow it: .npz, .mat, .csv or .yaml of dhkit or from elsewhere.")
]
Columns = Annotated[
    str | None, typer.Option("--columns", metavar="OURS=THEIRS ...", help='Of such a file: "t=tout q=yout".')
]
Start = Annotated[
    str | None, typer.Option("--from", metavar="Q ...", help="Or go from here, joint values or a configuration's name,")
]
Goal = Annotated[str | None, typer.Option("--to", metavar="Q ...", help="to here.")]
Duration = Annotated[float | None, typer.Option(help="s, of a motion between configurations.")]
Bandwidth = Annotated[float, typer.Option(help="Of the controller, rad/s.")]
Damping = Annotated[float, typer.Option(help="Of the controller.")]
Rate = Annotated[float, typer.Option(help="Calls of the controller, Hz.")]
PlantRate = Annotated[float | None, typer.Option(help="Steps of the integration, Hz; those of the controller.")]
Load = Annotated[
    str | None,
    typer.Option(
        "--payload",
        metavar="KG [@ X Y Z]",
        help="What it carries, centre of mass in the tool's frame, m; what the motion was planned with unless given.",
    ),
]
Unmodelled = Annotated[bool, typer.Option("--unmodelled", help="The controller does not know of the payload.")]
FrictionOption = Annotated[
    str,
    typer.Option("--friction", metavar="none|stiction|WIDTH", help="Of the joints; WIDTH of smooth one, rad/s."),
]
Restitution = Annotated[float, typer.Option(help="Of the joint stops, 0 to 1.")]
NoStops = Annotated[bool, typer.Option("--no-stops", help="Joints pass their limits.")]
PushOption = Annotated[
    list[str] | None,
    typer.Option("--push", metavar="FX FY FZ @ BEGIN END", help="A force on the tool, N, world axes, over a time, s."),
]


@app.command(cls=with_long_options(MOTION_OPTIONS))
def simulate(
    robot: Robot,
    controller: Annotated[
        str,
        typer.Option(
            help="pd, pid, pd-gravity, feed-forward, computed-torque, operational-space, adaptive, lqr, none."
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
    continuous: Annotated[bool, typer.Option("--continuous", help="A controller in continuous time.")] = False,
    load: Load = None,
    unmodelled: Unmodelled = False,
    friction: FrictionOption = "none",
    compensate: Annotated[bool, typer.Option("--compensate", help="The controller compensates friction.")] = False,
    restitution: Restitution = 0.0,
    no_stops: NoStops = False,
    push: PushOption = None,
    noise: Annotated[
        float, typer.Option(min=0, help="Standard deviation of measured joint values; rad, with --degrees too, and m.")
    ] = 0.0,
    resolution: Annotated[
        float, typer.Option(min=0, help="Of the encoders, on the joints' side; rad, with --degrees too, and m.")
    ] = 0.0,
    degrees: Degrees = False,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write the run: .npz, .mat or .csv.")] = None,
    html: Annotated[Path | None, typer.Option(help="Write a page that plays it.")] = None,
    figure: Annotated[Path | None, typer.Option(help="Write a figure of it: .png, .svg or .pdf.")] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> int:
    """Simulate an arm under a controller; exit status 1 where the run does not get to its end."""
    from dhkit.cli import simulate as simulate_command, simulation_settings as given
    from dhkit.control import Sensors

    bare = load_arm(robot, uniform)
    sensors = Sensors(noise=noise, resolution=resolution) if noise or resolution else None
    trajectory, text = given.chosen_motion(bare, motion, start, to, duration, degrees, columns)
    arm, plant = given.known_and_moving_arm(bare, payload(load) or trajectory.payload, unmodelled)
    settings = given.SimulationSettings(
        arm=arm,
        plant=plant,
        motion=trajectory,
        motion_text=text,
        controllers=[controller],
        bandwidth=bandwidth,
        damping=damping,
        compensate=compensate,
        options={
            "rate": None if continuous else rate,
            **given.plant_options(plant_rate, friction, restitution, no_stops, push or ()),
            "sensors": sensors,
        },
    )
    return simulate_command.run(settings, MotionFiles(output, html, figure), degrees=degrees, json=json)


@app.command(cls=with_long_options(MOTION_OPTIONS))
def compare(
    robot: Robot,
    controllers: Annotated[str, typer.Option(help="Which, separated by commas; all unless given.")] = "",
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
) -> int:
    """Compare controllers on one motion; exit status 1 where one does not get to its end."""
    from dhkit.cli import simulate as compare_command, simulation_settings as given
    from dhkit.control import CONTROLLERS

    bare = load_arm(robot, uniform)
    trajectory, text = given.chosen_motion(bare, motion, start, to, duration, degrees, columns)
    arm, plant = given.known_and_moving_arm(bare, payload(load) or trajectory.payload, unmodelled)
    settings = given.SimulationSettings(
        arm=arm,
        plant=plant,
        motion=trajectory,
        motion_text=text,
        controllers=[name.strip() for name in controllers.split(",")] if controllers else list(CONTROLLERS),
        bandwidth=bandwidth,
        damping=damping,
        options={
            "rate": rate,
            **given.plant_options(plant_rate, friction, restitution, no_stops, push or ()),
        },
    )
    return compare_command.run_comparison(settings, figure, degrees=degrees, json=json)


@app.command()
def play(
    robot: Robot,
    file: Annotated[Path, typer.Argument(help="A motion or a simulation.")],
    html: Annotated[Path | None, typer.Option(help="Write a page in place of opening the browser.")] = None,
    columns: Columns = None,
    degrees: Annotated[bool, degrees_option("Samples from elsewhere have degrees.")] = False,
    uniform: Uniform = False,
) -> int:
    """Play a motion or a simulation in the browser, or write a page of it."""
    from dhkit.cli import picture as play_command

    return play_command.play(load_arm(robot, uniform), file, html, degrees=degrees, names=columns)


@app.command(cls=with_long_options({"--at": None}))
def picture(
    robot: Robot,
    output: Annotated[Path, typer.Option("--output", "-o", help="The file: .png, or .gif of a motion.")],
    at: Annotated[
        str | None, typer.Option(metavar="Q ...", help="Joint values, or the name of a configuration.")
    ] = None,
    motion: Annotated[Path | None, typer.Option(help="A motion or a simulation: pictures of it.")] = None,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Width and height, px.")] = None,
    count: Annotated[int, typer.Option(min=2, max=900, help="PNG files of a motion.")] = 6,
    rate: Annotated[float, typer.Option(min=1, max=50, help="Pictures a second of a GIF.")] = 15.0,
    frames: Annotated[bool, typer.Option("--frames", help="Draw the DH frames.")] = False,
    degrees: Annotated[bool, degrees_option("Angles are in degrees.")] = False,
    uniform: Uniform = False,
) -> int:
    """Write a picture of an arm, or of a motion: PNG files or a GIF; no browser is needed."""
    from dhkit.cli import picture as picture_command

    words = None if at is None else [at]
    return picture_command.run(
        load_arm(robot, uniform),
        output,
        at=words,
        motion=motion,
        size=size,
        count=count,
        rate=rate,
        frames=frames,
        degrees=degrees,
    )
