"""The application: all commands together; unusable input ends in one line on stderr and status 2."""

from __future__ import annotations

import ast
import logging
import re
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, cast

import typer
from typer.core import TyperCommand, TyperGroup

from dhkit import __version__
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.options import AS_DESIGNED, as_designed_option
from dhkit.cli.output import ReaderGone, say
from dhkit.cli.quantities import with_plain_numbers
from dhkit.cli.streams import clean_streams
from dhkit.description.joint_text import DEGREES
from dhkit.errors import DhkitError

MAX_WORD_LENGTH = 120
"""Longest word on stderr, characters: messages echo typed words."""
MAX_MESSAGE_LENGTH = 600
"""Longest message on stderr, characters."""
LONG_WORD = re.compile(rf"\S{{{2 * MAX_WORD_LENGTH},}}")
"""A word that is cut to MAX_WORD_LENGTH, since it is twice as long or more."""

UsageError = cast(type[Exception], typer.BadParameter.__mro__[2])
"""``click.ClickException``, the base class of usage errors: BadParameter is a UsageError, and that a ClickException.
Newer versions of typer contain their own click, so that ``import click`` has another one."""


COMMANDS = {
    "robots": "info",
    "info": "info",
    "build": "files",
    "import-cad": "files",
    "fk": "info",
    "ik": "inverse",
    "plan": "plan",
    "simulate": "simulate",
    "compare": "simulate",
    "play": "picture",
    "picture": "picture",
    "lab": "browser",
    "view": "browser",
    "verify": "verify",
    "extract": "extract",
    "report": "report",
    "workspace": "workspace",
    "equations": "equations",
    "task": "task",
    "grade": "grade",
    "check": "verify",
    "pack": "pack",
    "bench": "bench",
    "schema": "files",
    "docs": "docs",
    "demo": "demo",
    "doctor": "doctor",
    "cache": "doctor",
}
"""Modules of the commands, in the order of the help; they are imported when a command runs, since that takes long."""


class LazyCommand(TyperCommand):
    """A command whose module is imported when its arguments are parsed."""

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """Parse arguments by the command itself; its numbers may be expressions."""
        name = str(self.name)
        command = load_command(name)
        info_name, words, *others = arguments
        function = getattr(import_module(command.callback.__module__), name.replace("-", "_"))
        plain = with_plain_numbers(command, function, words)
        return command.make_context(info_name, plain, *others, **options)

    def get_short_help_str(self, limit: int = 0) -> str:
        """Return the first paragraph of the command's docstring, of whatever length, without importing its module."""
        tree = ast.parse(
            (Path(__file__).parent / f"{COMMANDS[str(self.name)]}.py").read_text("utf-8")
        )
        name = str(self.name).replace("-", "_")
        function = next(
            node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == name
        )
        return " ".join((ast.get_docstring(function) or "").split("\n\n")[0].split())


def load_command(name: str) -> TyperCommand:
    """Import the module of a command, and return the command."""
    module = import_module(f"dhkit.cli.{COMMANDS[name]}")
    command = cast(TyperCommand, typer.main.get_group(module.app).commands[name])
    if any(parameter.name == "robot" for parameter in command.params):
        command.params.append(as_designed_option())
    return command


class Commands(TyperGroup):
    """Lists the commands with their whole first sentence, over several lines where it is long."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        for name in COMMANDS:
            self.add_command(LazyCommand(name))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the list into the help."""
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, command.get_short_help_str()) for name, command in self.commands.items()]
            )


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
    clean_streams()
    logging.basicConfig(format="dhkit: %(message)s", level=logging.WARNING)
    # Messages about work that takes seconds, such as compiling.
    logging.getLogger("dhkit").setLevel(logging.INFO)
    degrees = DEGREES.set(False)
    as_designed = AS_DESIGNED.set(False)
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
        AS_DESIGNED.reset(as_designed)
    if status == ExitStatus.INTERRUPTED:  # some versions of typer return it for Ctrl-C
        raise KeyboardInterrupt
    return status if isinstance(status, int) else ExitStatus.FINE


def _refuse(message: str) -> ExitStatus:
    """Print one line on stderr, shortened, and return the status of unusable input."""
    line = LONG_WORD.sub(lambda match: f"{match[0][:MAX_WORD_LENGTH]}…", " ".join(message.split()))
    sys.stderr.write(
        f"dhkit: {line if len(line) <= MAX_MESSAGE_LENGTH else f'{line[:MAX_MESSAGE_LENGTH]}…'}\n"
    )
    return ExitStatus.UNUSABLE


def _print_version(requested: bool) -> None:
    if requested:
        say(f"dhkit {__version__}")
        raise typer.Exit


Version = Annotated[
    bool,
    typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version."),
]


@app.callback()
def common(version: Version = False) -> None:
    """Robot arms from their Denavit-Hartenberg table."""
