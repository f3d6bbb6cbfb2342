"""`dhkit compare`: controllers on one motion, as a table and a figure."""

from __future__ import annotations

from pathlib import Path

from dhkit.cli.output import print_json, print_table, say
from dhkit.cli.outputs import FIGURES, check_outputs, write_figure
from dhkit.cli.progress import ProgressBar
from dhkit.cli.simulate import facts_of
from dhkit.cli.simulation_task import Task
from dhkit.control import Comparison, Plant, compare
from dhkit.dynamics import Friction


def run(task: Task, figure: Path | None, *, degrees: bool, json: bool) -> int:
    """Compare controllers on one motion, print a table and write a figure; return 0, or 1 where one failed."""
    check_outputs(((figure, FIGURES),))
    options = dict(task.options)
    plant = Plant(
        task.plant.description,
        Friction.chosen(options.pop("friction")),
        options.pop("restitution"),
        tuple(options.pop("pushes")),
    )
    names = list(task.controllers)
    with ProgressBar(f"simulating {names[0]}") as bar:
        compared = compare(
            task.arm.description,
            task.motion,
            names,
            task.bandwidth,
            task.damping,
            lambda name: bar.show(names.index(name) + 1, len(names), f"simulated {name}"),
            plant=plant,
            **options,
        )
    if figure is not None and compared.results:
        from dhkit.viewer import plot_comparison

        write_figure(plot_comparison(compared.results, f"{task.arm.name}: {task.about}, {task.rate}"), figure)
    if json:
        facts = {name: facts_of(task.arm, result, degrees=degrees) for name, result in compared.results.items()}
        print_json({"robot": task.arm.name, "controllers": facts, "failures": dict(compared.failures)})
    else:
        _print(task, compared, degrees=degrees)
        if figure is not None and compared.results:
            say(f"\nwrote {figure}")
    return 1 if compared.failures else 0


def _print(task: Task, compared: Comparison, *, degrees: bool) -> None:
    say(f"{task.arm.name}: {task.about}, {task.rate}, {task.bandwidth:g} rad/s", "bold")
    say("")
    headings, rows = compared.rows(degrees=degrees)
    print_table(headings, rows)
    for name, reason in compared.failures.items():
        say(f"\n{name}: {reason}")
