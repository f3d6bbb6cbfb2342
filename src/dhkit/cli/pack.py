"""`dhkit pack`: a task as what Gradescope, PrairieLearn, Otter, nbgrader, Moodle and Canvas take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dhkit.cli.options import Json
from dhkit.cli.output import print_json, say, say_written
from dhkit.platforms.packing import IMAGE, PLATFORMS, pack as packed
from dhkit.platforms.quizzes import MAX_COUNT

app = typer.Typer(rich_markup_mode=None)
_SUFFIX = {"gradescope": ".zip", "canvas": ".zip"}
"""Ending of the output's name; the other platforms take folders."""


@app.command()
def pack(
    platform: Annotated[str, typer.Argument(help=f"Platform: {', '.join(PLATFORMS)}.")],
    task: Annotated[
        Path, typer.Argument(help="The instructor's file: robot, [task], [names], [rubric].")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Zip file or new folder to write; default: TASK-PLATFORM."
        ),
    ] = None,
    wheel: Annotated[
        Path | None,
        typer.Option(help="Wheel of dhkit to install there; default: this version from PyPI."),
    ] = None,
    image: Annotated[str, typer.Option(help="Name of PrairieLearn's image.")] = IMAGE,
    count: Annotated[
        int, typer.Option(min=1, max=MAX_COUNT, help="Variants of each question of a quiz.")
    ] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the states of a quiz.")] = 0,
    json: Json = False,
) -> None:
    """Pack a task for a teaching platform: an autograder, a question, a notebook with its tests, or a quiz.

    What is judged there is the task's robot; the students' files never choose another one.
    """
    package = packed(platform, task, wheel=wheel, image=image, count=count, seed=seed)
    place = output or Path(f"{task.stem}-{platform}{_SUFFIX.get(platform, '')}")
    package.write(place)
    if json:
        print_json({"platform": platform, "output": str(place), "files": sorted(package.files)})
        return
    say_written([place])
    if wheel is None and platform not in ("moodle", "canvas"):
        say("dhkit is installed there from the package index; --wheel FILE packs a wheel instead")
