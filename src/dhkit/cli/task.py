"""`dhkit task`: an instructor's task for a class; `dhkit task variants` gives each student an arm of their own."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from dhkit.cli.options import Json
from dhkit.cli.output import print_json, say
from dhkit.cli.progress import ProgressBar
from dhkit.cli.task_folder import STUDENTS, can_print, check_folder, earlier_key, write_folder
from dhkit.display import counted
from dhkit.errors import AnswerError
from dhkit.grading.variants import Variant, Variants
from dhkit.grading.variants.students import read_students

app = typer.Typer(rich_markup_mode=None)
group = typer.Typer(rich_markup_mode=None, no_args_is_help=True)
app.add_typer(group, name="task")
MOST_LISTED = 5
"""Largest number of students in a message."""


@group.callback()
def task() -> None:
    """Make variants of a task: an arm, a sheet and a statement for each student, and a key for the instructor."""


@group.command()
def variants(
    task: Annotated[
        Path, typer.Argument(help="The instructor's file with a table [variants] (.toml).")
    ],
    students: Annotated[
        Path,
        typer.Option(
            help="Students: an id a line, or a .csv file of Canvas, Moodle, Gradescope or your own."
        ),
    ],
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the numbers; a student's depend on it and the id.")
    ],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="New folder: students/ to hand out, key/ to keep."),
    ],
    shared: Annotated[
        bool, typer.Option("--shared", help="Allow students who have the same variant.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Replace the variants of an earlier run in the folder.")
    ] = False,
    json: Json = False,
) -> None:
    """Write each student's robot, sheet, picture and statement, and a key.

    A student's numbers depend on the task, the seed and the id alone. Grade with
    `dhkit grade SUBMISSIONS --task FOLDER/key`.
    """
    varied = Variants.load(task)
    listed = read_students(students)
    check_folder(output, force=force)
    drawn = [varied.of(student, seed) for student in listed.ids]
    same = _same(drawn)
    if same and not shared:
        raise AnswerError(f"{task}: {_same_text(same, varied, len(drawn))}")
    notes = []
    if listed.column:
        notes.append(f"{students}: ids are those of the column {listed.column!r}")
    if same:
        pairs = ", ".join(" and ".join(names) for names in same[:MOST_LISTED])
        more = f" and {len(same) - MOST_LISTED} more" if len(same) > MOST_LISTED else ""
        notes.append(f"the same variant: {pairs}{more}")
    notes += _size_notes(varied)
    if (earlier := earlier_key(output)) is not None:
        if changed := earlier.changed(drawn):
            notes.append(f"{output}: other variants than before: {_listed(changed)}")
        present = {variant.student for variant in drawn}
        if dropped := [student for student in earlier.variants if student not in present]:
            notes.append(f"{output}: no longer there: {_listed(dropped)}")
    if varied.task.task.in_letters and len(varied.samples) == 1:
        notes.append(
            "answers in numbers do not pass (values = false): all students have one answer"
        )
    if "dh" in varied.task.task.asked:
        notes.append("the table that is asked for stands in the robot file")
    if not can_print():
        notes.append("no statement.pdf: the package typst is not installed")

    begin = time.monotonic()
    with ProgressBar("writing statements") as bar:
        write_folder(varied, task, drawn, seed, output, progress=bar.show)
    per_student = (time.monotonic() - begin) / len(drawn)

    if json:
        print_json(
            {
                "folder": str(output),
                "students": len(drawn),
                "same": [list(names) for names in same],
                "sizes": varied.sizes(),
                "notes": notes,
            }
        )
        return
    for note in notes:
        say(note)
    say(
        f"wrote {output}: {counted(len(drawn), 'student')}, {per_student:.2f} s each; hand out the folders in "
        f"{output / STUDENTS}, keep the key"
    )


def _same(drawn: Iterable[Variant]) -> list[tuple[str, ...]]:
    """Return the students who have the same variant, two or more together."""
    holders: dict[object, list[str]] = {}
    for variant in drawn:
        holders.setdefault(variant.numbers, []).append(variant.student)
    return [tuple(names) for names in holders.values() if len(names) > 1]


def _same_text(same: Sequence[Sequence[str]], varied: Variants, count: int) -> str:
    first, second = same[0][:2]
    if (distinct := varied.distinct(count)) < count:
        return (
            f"{counted(count, 'student')}, and the ranges have {counted(distinct, 'distinct variant')}; expected wider "
            "ranges or more digits, or --shared"
        )
    return (
        f"{counted(len(same), 'variant')} would belong to several students, such as {first} and {second}; expected "
        "another --seed, wider ranges or more digits, or --shared"
    )


def _size_notes(varied: Variants) -> list[str]:
    """Return a line on arms whose answers have different sizes: then students have unequal work."""
    if len(varied.samples) < 2:
        return []
    sizes = varied.sizes()
    if len(set(sizes.values())) < 2:
        return []
    texts = ", ".join(f"{name}: {terms}" for name, terms in sizes.items())
    return [f"answers of different size, in terms: {texts}"]


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    return ", ".join(names[:MOST_LISTED]) + more
