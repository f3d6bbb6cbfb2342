"""The application: all commands together; unusable input ends in one line on stderr and status 2."""

from __future__ import annotations

import logging
import re
import sys
from collections.abc import Sequence
from typing import Annotated, Any, cast

import typer
from typer.core import TyperGroup

from dhkit import __version__
from dhkit.cli import analysis_commands, motion_commands, robot_commands
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

for group in (robot_commands.app, motion_commands.app, analysis_commands.app):
    app.add_typer(group)


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
