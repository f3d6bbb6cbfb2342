"""The application: all commands together; unusable input ends in one line on stderr and status 2."""

from __future__ import annotations

import logging
import re
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated, Any, NamedTuple, cast

import typer
from typer.core import TyperCommand, TyperGroup

from dhkit import __version__
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.output import ReaderGone, say
from dhkit.cli.streams import replace_unknown_letters
from dhkit.description.joint_text import DEGREES
from dhkit.errors import DhkitError

MAX_WORD_LENGTH, MAX_MESSAGE_LENGTH = 120, 600
"""Longest word and longest message on stderr, characters; messages echo what was typed."""
LONG_WORD = re.compile(rf"\S{{{2 * MAX_WORD_LENGTH},}}")

UsageError = cast(type[Exception], typer.BadParameter.__mro__[2])
"""Click's base class of usage errors. Newer versions of typer contain their own click, so that ``import click`` has
another one."""


class Entry(NamedTuple):
    """A command: the module in ``dhkit.cli`` whose ``app`` has it, and its help text."""

    module: str
    help: str


COMMANDS = {
    "robots": Entry("info", "List the robots of the library."),
    "info": Entry("info", "Show a robot: its DH table, limits, masses, configurations and what is odd about it."),
    "build": Entry("files", "Write a robot's URDF, with its meshes beside it."),
    "import-cad": Entry(
        "files",
        "Make a robot of a CAD assembly's parts and a DH table: meshes in their links' frames, masses, TOML and URDF.",
    ),
    "fk": Entry("info", "Print where the tool is for given joint values (rad and m)."),
    "ik": Entry(
        "inverse",
        "Print every way to put the tool at a pose, given by --xyz, --matrix or --like; exit status 1 where there is "
        "none.\n\n"
        "Numbers may be expressions such as 17*inch or pi/2; joint values may be the name of a configuration.",
    ),
    "plan": Entry(
        "plan",
        "Plan the best motion to joint values or a pose, certified; exit status 1 where there is none.\n\n"
        "Sliding joints are in m and N. Numbers may be expressions such as 17*inch or pi/2.",
    ),
    "simulate": Entry(
        "simulate", "Simulate an arm under a controller; exit status 1 where the run does not get to its end."
    ),
    "compare": Entry("simulate", "Compare controllers on one motion; exit status 1 where one does not get to its end."),
    "play": Entry("picture", "Play a motion or a simulation in the browser, or write a page of it."),
    "picture": Entry("picture", "Write a picture of an arm, or of a motion: PNG files or a GIF; no browser is needed."),
    "lab": Entry("browser", "Open an arm in the browser: move, drive, edit, plan and control it; Ctrl-C ends it."),
    "view": Entry("browser", "Show an arm in the browser, to look at; Ctrl-C ends it."),
    "verify": Entry(
        "verify",
        "Hold our kinematics and dynamics against Pinocchio's; exit status 1 where they disagree.\n\n"
        "With --urdf hold somebody's URDF against the table: tool, mass matrix and torques at equal joint values.",
    ),
    "extract": Entry(
        "extract",
        "Find the Denavit-Hartenberg table of a URDF's chain, with its bodies, limits and meshes.\n\n"
        "Prints how far the table is from the file; exit status 1 where that is more than 1e-9.",
    ),
    "workspace": Entry(
        "workspace",
        "Show where a robot's tool can be and how well it moves there, in numbers, a figure and a page.",
    ),
    "equations": Entry(
        "equations", "Print a robot's equations of motion, exactly: M(q) qdd + C(q, qd) qd + g(q) = tau."
    ),
    "grade": Entry(
        "grade",
        "Judge students' answers exactly, entry by entry.\n\n"
        "Exit status 0: all pass; 1: one is wrong or incomplete, or lacks the proof that is asked for; 2: one is "
        "unreadable.",
    ),
    "check": Entry(
        "verify",
        "Score a program's forward and inverse kinematics and its controller, and say where it fails first.\n\n"
        "Exit status 0: full marks; 1: fewer; 2: it cannot be loaded.",
    ),
    "bench": Entry(
        "bench",
        "Time our kinematics and dynamics beside every installed peer: median, spread and ratios.\n\n"
        "Exit status 1: dhkit itself, or every contender of a quantity, failed or could not be timed.\n\n"
        "Quantities: fk, ik, jacobian, inverse_dynamics, mass_matrix, forward_dynamics.",
    ),
    "schema": Entry("files", "Print the JSON Schema of a file format."),
    "demo": Entry(
        "demo", "Build a robot from its table, verify it, and write its URDF, a figure and an animated page."
    ),
}
"""The commands by name, in the order of the help. Their modules are imported when they run, since that takes long."""


class LazyCommand(TyperCommand):
    """A command whose module is imported when its arguments are parsed."""

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """Parse arguments by the command itself."""
        return load_command(cast(str, self.name)).make_context(*arguments, **options)


def load_command(name: str) -> TyperCommand:
    """Import the module of a command, and return the command."""
    module = import_module(f"dhkit.cli.{COMMANDS[name].module}")
    command = cast(TyperCommand, typer.main.get_group(module.app).commands[name])
    command.help = COMMANDS[name].help
    return command


class Commands(TyperGroup):
    """Lists the commands with their whole first sentence, over several lines where it is long."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        for name, entry in COMMANDS.items():
            self.add_command(LazyCommand(name, help=entry.help))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the list into the help."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, entry.help.split("\n\n")[0]) for name, entry in COMMANDS.items()])


app = typer.Typer(
    name="dhkit",
    cls=Commands,
    help="Robot arms from their Denavit-Hartenberg table.",
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status.

    Raises
    ------
    KeyboardInterrupt
        Somebody pressed Ctrl-C.
    """
    replace_unknown_letters()
    logging.basicConfig(format="dhkit: %(message)s", level=logging.WARNING)
    logging.getLogger("dhkit").setLevel(logging.INFO)  # messages about work that takes seconds, such as compiling
    degrees = DEGREES.set(False)
    try:
        status = app(args=None if arguments is None else list(arguments), standalone_mode=False)
    except (DhkitError, ValueError) as error:
        return _refuse(str(error))
    except UsageError as error:
        message: str = error.format_message()  # type: ignore[attr-defined]
        if type(error).__name__ == "NoArgsIsHelpError":
            sys.stderr.write(f"{message}\n")
            return ExitStatus.UNUSABLE
        return _refuse(message)
    except ReaderGone:
        return ExitStatus.READER_GONE
    except OSError as error:
        return _refuse(f"{error.filename or 'output'}: {error.strerror or error}")
    except typer.Abort:
        raise KeyboardInterrupt from None
    finally:
        DEGREES.reset(degrees)
    if status == ExitStatus.INTERRUPTED:  # some versions of typer return it for Ctrl-C
        raise KeyboardInterrupt
    return status if isinstance(status, int) else ExitStatus.FINE


def _refuse(message: str) -> ExitStatus:
    """Print one line on stderr, shortened, and return the status of unusable input."""
    line = LONG_WORD.sub(lambda match: f"{match[0][:MAX_WORD_LENGTH]}…", " ".join(message.split()))
    sys.stderr.write(f"dhkit: {line if len(line) <= MAX_MESSAGE_LENGTH else f'{line[:MAX_MESSAGE_LENGTH]}…'}\n")
    return ExitStatus.UNUSABLE


def _print_version(requested: bool) -> None:
    if requested:
        say(f"dhkit {__version__}")
        raise typer.Exit


Version = Annotated[bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version.")]


@app.callback()
def common(version: Version = False) -> None:
    """Robot arms from their Denavit-Hartenberg table."""
