"""The commands and their arguments; every bad input ends in one line on stderr and status 2."""

from __future__ import annotations

import logging
import re
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, cast

import typer
from typer.core import TyperGroup

from dhkit import __version__
from dhkit.arm import Arm
from dhkit.cli.arguments import gathering, joint_limits, joint_values, objective, obstacles, payload, target
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.output import ReaderGone, print_json, say
from dhkit.cli.streams import accept_every_letter
from dhkit.description.files import check_place
from dhkit.description.joint_words import DEGREES
from dhkit.errors import DescriptionError, DhkitError

SHOWN, LONGEST = 120, 600
"""Characters of a word, and of a message: what was typed is echoed in it."""
LONG_WORD = re.compile(rf"\S{{{2 * SHOWN},}}")
GONE = 141
"""Exit status where whoever read the output went away, as shells have it."""

UsageError = cast(type[Exception], typer.BadParameter.__mro__[2])
"""Click's base of usage errors: newer typers carry a click of their own, which ``import click`` is not."""


class Commands(TyperGroup):
    """Lists the commands with their whole first sentence, over several lines where it is long."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the list into the help."""
        texts = ((name, self.commands[name].help or "") for name in self.list_commands(ctx))
        with formatter.section("Commands"):
            formatter.write_dl([(name, " ".join(text.split("\n\n")[0].split())) for name, text in texts])


app = typer.Typer(
    name="dhkit",
    cls=Commands,
    help="Robot arms from their Denavit-Hartenberg table.",
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

Robot = Annotated[
    str, typer.Argument(help="A library name (see `dhkit robots`), a robot file (.toml) or a URDF; FILE.urdf#TIP.")
]


def _told_in_degrees(wanted: bool) -> bool:
    """Have messages tell angles in the unit that the command's arguments are in."""
    DEGREES.set(wanted)
    return wanted


def _degrees(text: str) -> Any:
    return typer.Option("--degrees", callback=_told_in_degrees, help=text)


Degrees = Annotated[bool, _degrees("Angles in and out are in degrees.")]
Uniform = Annotated[
    bool, typer.Option("--uniform-links", help="Thin uniform rods of 1 kg each for links, in place of their bodies.")
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]


def _arm(robot: str, uniform: bool) -> Arm:
    """Return a robot by name or file, perhaps with rods for links."""
    arm = Arm.load(robot)
    return arm.with_uniform_links() if uniform else arm


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status.

    Raises
    ------
    KeyboardInterrupt
        Somebody pressed Ctrl-C.
    """
    accept_every_letter()
    logging.basicConfig(format="dhkit: %(message)s", level=logging.WARNING)
    logging.getLogger("dhkit").setLevel(logging.INFO)  # says what takes seconds, such as compiling
    degrees = DEGREES.set(False)
    try:
        status = app(args=None if arguments is None else list(arguments), standalone_mode=False)
    except (DhkitError, ValueError) as error:
        return _refused(str(error))
    except UsageError as error:
        message: str = error.format_message()  # type: ignore[attr-defined]
        if type(error).__name__ == "NoArgsIsHelpError":
            sys.stderr.write(f"{message}\n")
            return 2
        return _refused(message)
    except ReaderGone:
        return GONE
    except OSError as error:
        return _refused(f"{error.filename or 'output'}: {error.strerror or error}")
    except typer.Abort:
        raise KeyboardInterrupt from None
    finally:
        DEGREES.reset(degrees)
    if status == ExitStatus.INTERRUPTED:  # which some versions of typer make of Ctrl-C
        raise KeyboardInterrupt
    return status if isinstance(status, int) else 0


def _refused(message: str) -> int:
    line = LONG_WORD.sub(lambda found: f"{found[0][:SHOWN]}…", " ".join(message.split()))
    sys.stderr.write(f"dhkit: {line if len(line) <= LONGEST else f'{line[:LONGEST]}…'}\n")
    return 2


def _version(wanted: bool) -> None:
    if wanted:
        say(f"dhkit {__version__}")
        raise typer.Exit


Version = Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")]


@app.callback()
def common(version: Version = False) -> None:
    """Robot arms from their Denavit-Hartenberg table."""


@app.command()
def robots(
    examples: Annotated[
        bool, typer.Option("--examples", help="Those of the package example-robot-data instead.")
    ] = False,
    json: Json = False,
) -> None:
    """List the robots of the library."""
    if examples:
        from dhkit.cli import extract as extract_command

        extract_command.list_examples(json)
        return
    from dhkit.cli import info as info_command

    info_command.list_robots(json)


@app.command()
def info(robot: Robot, json: Json = False) -> None:
    """Show a robot: its DH table, limits, masses, configurations and what is odd about it."""
    from dhkit.cli import info as info_command

    info_command.show(Arm.load(robot), json)


@app.command()
def build(
    robot: Robot,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="The URDF to write; ./NAME.urdf.")] = None,
    mesh_prefix: Annotated[
        str | None, typer.Option(help="What it names its meshes by, as package://my_robot/meshes/; meshes/.")
    ] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> None:
    """Write a robot's URDF, with its meshes beside it."""
    arm = _arm(robot, uniform)
    path = output or Path(f"{arm.name}.urdf")
    if path.suffix == ".toml":
        raise DescriptionError(f"{path}: a URDF would overwrite a robot file; expected another name")
    check_place(path)
    files = arm.write_urdf(path, mesh_prefix)
    if json:
        print_json({"files": [str(file) for file in files]})
    else:
        say("\n".join(f"wrote {file}" for file in files))


@app.command(name="import-cad", cls=gathering({"--at": None}))
def import_cad(
    folder: Annotated[
        Path,
        typer.Argument(help="Mesh files, one a link, exported in one pose in assembly coordinates; or a .mat file."),
    ],
    table: Annotated[str, typer.Option("--table", help="The DH table: a robot file (.toml) or a library name.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The new folder: robot.toml, robot.urdf, meshes.")],
    density: Annotated[float | None, typer.Option(help="Of all links, kg/m^3; nothing is assumed.")] = None,
    mass: Annotated[list[str] | None, typer.Option(metavar="LINK=KG", help="Of one link; may be given again.")] = None,
    report: Annotated[
        list[Path] | None, typer.Option(help="Mass properties from the CAD program: SolidWorks' text or a .csv.")
    ] = None,
    unit: Annotated[str | None, typer.Option(help="Of the files: m, cm, mm or in; by size unless given.")] = None,
    simplify: Annotated[int | None, typer.Option(metavar="N", help="Reduce parts to N triangles.")] = None,
    mapping: Annotated[
        list[str] | None,
        typer.Option("--map", metavar="LINK=FILE", help="Where names do not say it; may be given again."),
    ] = None,
    at: Annotated[
        str | None, typer.Option(metavar="Q ...", help="Joint values of the export; ready, else zero, unless given.")
    ] = None,
    degrees: Annotated[bool, _degrees("Angles of --at are in degrees.")] = False,
    json: Json = False,
) -> int:
    """Make a robot of a CAD assembly's parts and a DH table: meshes in their links' frames, masses, TOML and URDF."""
    from dhkit.cli import import_cad as import_cad_command

    return import_cad_command.run(
        folder,
        Arm.load(table),
        output,
        density=density,
        masses=mass or (),
        reports=report or (),
        unit=unit,
        simplify=simplify,
        mapping=mapping or (),
        at=at,
        degrees=degrees,
        json=json,
    )


@app.command(context_settings={"ignore_unknown_options": True})
def fk(
    robot: Robot,
    q: Annotated[list[str], typer.Argument(help="Joint values, or the name of a configuration such as ready.")],
    degrees: Degrees = False,
    frames: Annotated[bool, typer.Option("--frames", help="All DH frames too.")] = False,
    json: Json = False,
) -> None:
    """Print where the tool is for given joint values (rad and m)."""
    from dhkit.cli import info as info_command

    info_command.forward(Arm.load(robot), q, degrees=degrees, with_frames=frames, json=json)


@app.command(cls=gathering({"--xyz": 3, "--euler": 3, "--matrix": None, "--like": None, "--near": None}))
def ik(
    robot: Robot,
    xyz: Annotated[str | None, typer.Option(metavar="X Y Z", help="The tool's position, m.")] = None,
    euler: Annotated[str, typer.Option(metavar="A B C", help="Its Euler angles, rad.")] = "0 0 0",
    order: Annotated[str, typer.Option(help="Of the Euler angles: XYZ moving axes, xyz fixed ones.")] = "XYZ",
    matrix: Annotated[
        str | None, typer.Option(metavar="M11 ... M44", help="The pose by row, 16 or 12 numbers; or a file of them.")
    ] = None,
    like: Annotated[str | None, typer.Option(metavar="Q ...", help="Where these joint values put the tool.")] = None,
    near: Annotated[str | None, typer.Option(metavar="Q ...", help="Mark the branch nearest to these values.")] = None,
    degrees: Degrees = False,
    limits: Annotated[bool, typer.Option("--limits", help="Only branches inside the joint limits.")] = False,
    numeric: Annotated[bool, typer.Option("--numeric", help="One solution, by iteration, for any arm.")] = False,
    json: Json = False,
) -> int:
    """Print every way to put the tool at a pose, given by --xyz, --matrix or --like; exit status 1 where there is none.

    Numbers may be expressions such as 17*inch or pi/2; joint values may be the name of a configuration.
    """
    from dhkit.cli import inverse as inverse_command

    arm = Arm.load(robot)
    return inverse_command.run(
        arm,
        target(arm, xyz=xyz, euler=euler, order=order, matrix=matrix, like=like, degrees=degrees),
        near=None if near is None else joint_values(arm, [near], degrees, "values of --near", outside="fine"),
        order=order,
        degrees=degrees,
        limits=limits,
        numeric=numeric,
        json=json,
    )


PLAN_WORDS: dict[str, int | None] = {
    **dict.fromkeys(("--from", "--to", "--via", "--matrix", "--like", "--objective", "--payload", "--box", "--sphere")),
    **dict.fromkeys(("--velocity", "--acceleration", "--jerk", "--torque")),
    "--xyz": 3,
    "--euler": 3,
    "--floor": 1,
}


@app.command(cls=gathering(PLAN_WORDS))
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

    arm = _arm(robot, uniform)
    pose = {"xyz": xyz, "matrix": matrix, "like": like}
    if sum(given is not None for given in (to, *pose.values())) != 1:
        raise DescriptionError("where to? expected one of --to, --xyz, --matrix and --like")
    task = plan_command.Task(
        arm=arm,
        start=joint_values(arm, [start], degrees, "values of --from", outside="refused"),
        goal=target(arm, **pose, euler=euler, order=order, degrees=degrees)
        if to is None
        else joint_values(arm, [to], degrees, "values of --to", outside="refused"),
        via=[joint_values(arm, [place], degrees, "values of --via", outside="refused") for place in via or ()],
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
    )
    files = plan_command.Files(output, html, figure)
    return plan_command.run(task, files, line=line, degrees=degrees, json=json)


MOTION_WORDS: dict[str, int | None] = dict.fromkeys(("--from", "--to", "--payload", "--push", "--columns"))
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


@app.command(cls=gathering(MOTION_WORDS))
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
    from dhkit.cli import simulate as simulate_command
    from dhkit.cli import simulation_task as asked
    from dhkit.control import Sensors

    bare = _arm(robot, uniform)
    sensors = Sensors(noise=noise, resolution=resolution) if noise or resolution else None
    followed, named = asked.chosen_motion(bare, motion, start, to, duration, degrees, columns)
    arm, plant = asked.moving_arm(bare, payload(load) or followed.payload, unmodelled)
    task = asked.Task(
        arm=arm,
        plant=plant,
        motion=followed,
        named=named,
        controllers=[controller],
        bandwidth=bandwidth,
        damping=damping,
        compensate=compensate,
        options={
            "rate": None if continuous else rate,
            "plant_rate": plant_rate,
            "friction": asked.friction_of(friction),
            "restitution": None if no_stops else restitution,
            "pushes": asked.pushes(push or ()),
            "sensors": sensors,
        },
    )
    return simulate_command.run(task, simulate_command.Files(output, html, figure), degrees=degrees, json=json)


@app.command(cls=gathering(MOTION_WORDS))
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
    from dhkit.cli import compare as compare_command
    from dhkit.cli import simulation_task as asked
    from dhkit.control import CONTROLLERS

    bare = _arm(robot, uniform)
    followed, named = asked.chosen_motion(bare, motion, start, to, duration, degrees, columns)
    arm, plant = asked.moving_arm(bare, payload(load) or followed.payload, unmodelled)
    task = asked.Task(
        arm=arm,
        plant=plant,
        motion=followed,
        named=named,
        controllers=[name.strip() for name in controllers.split(",")] if controllers else list(CONTROLLERS),
        bandwidth=bandwidth,
        damping=damping,
        options={
            "rate": rate,
            "plant_rate": plant_rate,
            "friction": asked.friction_of(friction),
            "restitution": None if no_stops else restitution,
            "pushes": asked.pushes(push or ()),
        },
    )
    return compare_command.run(task, figure, degrees=degrees, json=json)


@app.command()
def play(
    robot: Robot,
    file: Annotated[Path, typer.Argument(help="A motion or a simulation.")],
    html: Annotated[Path | None, typer.Option(help="Write a page in place of opening the browser.")] = None,
    columns: Columns = None,
    degrees: Annotated[bool, _degrees("Samples from elsewhere have degrees.")] = False,
    uniform: Uniform = False,
) -> int:
    """Play a motion or a simulation in the browser, or write a page of it."""
    from dhkit.cli import play as play_command

    return play_command.run(_arm(robot, uniform), file, html, degrees=degrees, names=columns)


@app.command(cls=gathering({"--at": None}))
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
    degrees: Annotated[bool, _degrees("Angles are in degrees.")] = False,
    uniform: Uniform = False,
) -> int:
    """Write a picture of an arm, or of a motion: PNG files or a GIF; no browser is needed."""
    from dhkit.cli import picture as picture_command

    words = None if at is None else [at]
    return picture_command.run(
        _arm(robot, uniform),
        output,
        at=words,
        motion=motion,
        size=size,
        count=count,
        rate=rate,
        frames=frames,
        degrees=degrees,
    )


@app.command()
def lab(
    robot: Annotated[str, typer.Argument(help="A library name, a robot file or an assignment (.toml).")],
    port: Annotated[int | None, typer.Option(min=1024, max=65535, help="Keep this address, token included.")] = None,
    mine: Annotated[Path | None, typer.Option(help="Your file (.py, .m) with fk, ik or controller.")] = None,
    run: Annotated[
        str | None, typer.Option(help="Your program in place of a file; ARGUMENTS follow the robot.")
    ] = None,
    arguments: Annotated[list[str] | None, typer.Argument(help="Of the program of --run.")] = None,
    sandbox: Annotated[str | None, typer.Option(help="bwrap: your program in bubblewrap.")] = None,
    solid: Annotated[Path | None, typer.Option(help="An STL file for the panel of transforms.")] = None,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only print the address.")] = False,
) -> int:
    """Open an arm in the browser: move, drive, edit, plan and control it; Ctrl-C ends it."""
    from dhkit.cli import browser

    if mine is not None and run is not None:
        raise DescriptionError("--mine and --run; expected one of them")
    if arguments and run is None:
        raise DescriptionError(f"{arguments[0]!r} behind the robot; expected --run PROGRAM for arguments")
    own = mine if run is None else [run, *(arguments or [])]
    return browser.run_lab(robot, port, open_browser=not no_browser, own=own, sandbox=sandbox, solid=solid)


@app.command()
def view(
    robot: Robot,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only print the address.")] = False,
    html: Annotated[Path | None, typer.Option(help="Write a page in place of it.")] = None,
) -> int:
    """Show an arm in the browser, to look at; Ctrl-C ends it."""
    from dhkit.cli import browser

    return browser.run_view(Arm.load(robot), html, open_browser=not no_browser)


@app.command()
def verify(
    robot: Robot,
    samples: Annotated[int, typer.Option(min=1, max=1_000_000, help="How many random states.")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="Of the random states.")] = 0,
    urdf: Annotated[str | None, typer.Option(help="Somebody's URDF to hold against the robot's table.")] = None,
    base: Annotated[str | None, typer.Option(help="Its link that is the world; the root.")] = None,
    tip: Annotated[str | None, typer.Option(help="Its link that is the tool; the end of the only chain.")] = None,
    tolerance: Annotated[float, typer.Option(help="The largest error that agrees, with --urdf.")] = 1e-9,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write a report: .md, .tex or .json.")] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> int:
    """Hold our kinematics and dynamics against Pinocchio's; exit status 1 where they disagree.

    With --urdf hold somebody's URDF against the table: tool, mass matrix and torques at equal joint values.
    """
    from dhkit.cli import verify as verify_command

    return verify_command.run(
        _arm(robot, uniform),
        samples,
        seed,
        urdf=urdf,
        base=base,
        tip=tip,
        tolerance=tolerance,
        output=output,
        json=json,
    )


@app.command()
def extract(
    urdf: Annotated[str, typer.Argument(metavar="FILE", help="A URDF, or example:NAME of example-robot-data.")],
    base: Annotated[str | None, typer.Option(help="The chain's first link, which becomes the world; the root.")] = None,
    tip: Annotated[str | None, typer.Option(help="Its last link; may be left out where there is one chain.")] = None,
    modified: Annotated[bool, typer.Option("--modified", help="Craig's table instead of the standard one.")] = False,
    as_designed: Annotated[
        bool, typer.Option("--as-designed", help="Read 1.5708 as a right angle, and say what that changes.")
    ] = False,
    drop: Annotated[
        bool, typer.Option("--drop-side", help="Leave out links behind joints beside the chain; else they are frozen.")
    ] = False,
    package_dir: Annotated[
        list[Path] | None, typer.Option(help="Folder with packages that package:// names; may be given again.")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="The robot file to write (.toml).")] = None,
    json: Json = False,
) -> int:
    """Find the Denavit-Hartenberg table of a URDF's chain, with its bodies, limits and meshes.

    Prints how far the table is from the file; exit status 1 where that is more than 1e-9.
    """
    from dhkit.cli import extract as extract_command

    return extract_command.run(
        urdf,
        base=base,
        tip=tip,
        modified=modified,
        as_designed=as_designed,
        drop=drop,
        package_dirs=package_dir or (),
        output=output,
        json=json,
    )


@app.command()
def workspace(
    robot: Robot,
    samples: Annotated[int, typer.Option(min=1, max=10_000_000, help="How many random states.")] = 100_000,
    seed: Annotated[int, typer.Option(min=0, help="Of the random states.")] = 0,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Folder to write; out/NAME.")] = None,
    json: Json = False,
) -> None:
    """Show where a robot's tool can be and how well it moves there, in numbers, a figure and a page."""
    from dhkit.cli import workspace as workspace_command

    workspace_command.run(Arm.load(robot), samples, seed, output, json=json)


@app.command()
def equations(
    robot: Robot,
    what: Annotated[str, typer.Option(help="Any of M, C, h, g, tau, K, V; or of A (A1 ... An), T, J.")] = "M,C,g",
    form: Annotated[str, typer.Option("--format", help="text, latex, python, c, matlab or html.")] = "text",
    symbols: Annotated[
        str, typer.Option(help="none: numbers; file: the file's parameters; inertial: every inertial parameter.")
    ] = "file",
    base: Annotated[
        bool, typer.Option("--base-parameters", help="The fewest inertial parameters, and what they stand for.")
    ] = False,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="File to write; a folder for matlab.")] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> None:
    """Print a robot's equations of motion, exactly: M(q) qdd + C(q, qd) qd + g(q) = tau."""
    from dhkit.cli import equations as equations_command

    equations_command.run(
        _arm(robot, uniform), what=what, form=form, symbols=symbols, base=base, output=output, json=json
    )


@app.command()
def grade(
    sheets: Annotated[
        list[Path] | None, typer.Argument(help="Answer sheets (.toml, .py, .m, .tex, .ipynb), or folders of them.")
    ] = None,
    robot: Annotated[
        str | None, typer.Option(help="A library name or a robot file, in place of the sheets' own.")
    ] = None,
    task: Annotated[
        Path | None, typer.Option(help="The instructor's file: robot, [task], [names], [rubric] (.toml).")
    ] = None,
    rubric: Annotated[Path | None, typer.Option(help="What answers are worth (.toml).")] = None,
    read: Annotated[bool, typer.Option("--read", help="Show how each entry was read.")] = False,
    seed: Annotated[int | None, typer.Option(min=0, help="Of the random states, to replay a report.")] = None,
    form: Annotated[str, typer.Option("--format", help="text, json, gradescope, junit or html.")] = "text",
    feedback: Annotated[
        str | None, typer.Option(help="full, hint or verdict: how much is told; the rubric's unless given.")
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, max=1024, help="Sheets at once; one for each core.")] = None,
    seconds: Annotated[float, typer.Option(min=0.1, help="The longest that a sheet may take.")] = 60.0,
    remark: Annotated[
        bool, typer.Option("--remark", help="The files are reports written before (JSON): mark them again.")
    ] = False,
    template: Annotated[str | None, typer.Option(help="Print an empty sheet for this robot.")] = None,
    explain: Annotated[str | None, typer.Option(help="Print this robot's worked solution, step by step.")] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File to write; a folder for several sheets.")
    ] = None,
    json: Json = False,
) -> int:
    """Judge students' answers exactly, entry by entry.

    Exit status 0: all pass; 1: one is wrong or incomplete, or lacks the proof that is asked for; 2: one is unreadable.
    """
    from dhkit.cli import grade as grade_command
    from dhkit.cli import grade_texts

    if template is not None:
        return grade_texts.write_template(template, output)
    if explain is not None:
        return grade_texts.write_explanation(Arm.load(explain), form, output)
    if not sheets:
        raise DescriptionError("no answer sheet; expected files or folders, --template NAME or --explain NAME")
    wanted: dict[str, Any] = {"form": form, "feedback": feedback, "output": output, "json": json}
    if remark:
        return grade_command.remark(sheets, grade_command.rubric_of(rubric), **wanted)
    return grade_command.grade_files(sheets, robot, rubric, task, seed, jobs=jobs, seconds=seconds, read=read, **wanted)


@app.command()
def check(
    robot: Robot,
    program: Annotated[
        list[str],
        typer.Argument(help="A file (.py, .m) that defines fk, ik or controller; with --run a program, its arguments."),
    ],
    run: Annotated[
        bool, typer.Option("--run", help="Execute PROGRAM, which speaks the protocol of docs/own-code.md.")
    ] = False,
    rubric: Annotated[Path | None, typer.Option(help="What each part is worth (.toml).")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Of the random states, to replay a report.")] = None,
    samples: Annotated[int, typer.Option(min=1, max=100_000, help="Random states.")] = 200,
    seconds: Annotated[float, typer.Option(min=0.01, max=3600, help="The longest that a call may take.")] = 5.0,
    sandbox: Annotated[str | None, typer.Option(help="bwrap: in bubblewrap, for strangers' files.")] = None,
    json: Json = False,
) -> int:
    """Score a program's forward and inverse kinematics and its controller, and say where it fails first.

    Exit status 0: full marks; 1: fewer; 2: it cannot be loaded.
    """
    from dhkit.cli import check as check_command

    if not run and len(program) != 1:
        raise DescriptionError(f"{len(program)} files; expected one, or --run with a program and its arguments")
    source = program if run else Path(program[0])
    return check_command.run(Arm.load(robot), source, rubric, seed, samples, sandbox, seconds, json)


@app.command()
def bench(
    quantities: Annotated[list[str] | None, typer.Argument(help="What to time; all unless given.")] = None,
    robot: Annotated[str, typer.Option(help="A library name or a robot file.")] = "puma560",
    batch: Annotated[int, typer.Option(min=1, max=10_000_000, help="Items of a batch.")] = 100_000,
    threads: Annotated[int, typer.Option(min=1, max=1024, help="Threads that batch calls may use.")] = 1,
    repeats: Annotated[int, typer.Option(min=1, max=1000, help="Interleaved rounds.")] = 9,
    seed: Annotated[int, typer.Option(min=0, help="Of the random states.")] = 0,
    probes: Annotated[bool, typer.Option(help="Measure threads, memory and new processes too.")] = True,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write NAME.md and NAME.json as well.")] = None,
    json: Json = False,
) -> int:
    """Time our kinematics and dynamics beside every installed peer: median, spread and ratios.

    Exit status 1: dhkit itself, or every contender of a quantity, failed or could not be timed.

    Quantities: fk, ik, jacobian, inverse_dynamics, mass_matrix, forward_dynamics.
    """
    from dhkit.bench import QUANTITIES
    from dhkit.cli import bench as bench_command

    return bench_command.run(
        Arm.load(robot),
        quantities or QUANTITIES,
        batch=batch,
        threads=threads,
        repeats=repeats,
        seed=seed,
        probes=probes,
        output=output,
        json=json,
    )


SCHEMAS = {
    "robot": "dhkit.description.schema",
    "assignment": "dhkit.lab.assignment_form",
    "sheet": "dhkit.grading.schema",
    "rubric": "dhkit.grading.schema",
    "task": "dhkit.grading.schema",
    "motion": "dhkit.trajectories.schema",
}
"""Modules that have a function ``NAME_schema``, by NAME."""


@app.command()
def schema(what: Annotated[str, typer.Argument(help=f"Which file: {', '.join(SCHEMAS)}.")]) -> None:
    """Print the JSON Schema of a file format."""
    if what not in SCHEMAS:
        raise DescriptionError(f"no schema {what!r}; expected {', '.join(SCHEMAS)}")
    print_json(getattr(import_module(SCHEMAS[what]), f"{what}_schema")(), indent=2)


@app.command()
def demo(
    robot: Annotated[str, typer.Option(help="A library name or a robot file.")] = "puma560",
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Folder to write; out/NAME.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer samples.")] = False,
    json: Json = False,
) -> int:
    """Build a robot from its table, verify it, and write its URDF, a figure and an animated page."""
    from dhkit.cli import demo as demo_command

    return demo_command.run(Arm.load(robot), output, quick=quick, json=json)
