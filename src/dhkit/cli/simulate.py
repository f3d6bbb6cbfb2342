"""`dhkit simulate` and `dhkit compare`: an arm under one controller, or under several on one motion."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dhkit.arm import Arm
from dhkit.cli.output import FIGURES, PAGES, check_outputs, print_json, print_table, say, write_figure
from dhkit.cli.progress import ProgressBar
from dhkit.cli.simulation_task import Task
from dhkit.cli.units import joint_entry
from dhkit.control import Comparison, Plant, SimulationResult, compare
from dhkit.dynamics import Friction
from dhkit.errors import SimulationError

ACCOUNTED = 1e-6
"""Share of the energy without account above which the steps are too long."""
RESULTS = (".npz", ".mat", ".csv")


@dataclass(frozen=True)
class Files:
    """What is to be written."""

    result: Path | None = None
    page: Path | None = None
    figure: Path | None = None

    def check(self) -> None:
        """Refuse what could not be written, before anybody waits for it."""
        check_outputs(((self.result, RESULTS), (self.page, PAGES), (self.figure, FIGURES)))

    def write(self, arm: Arm, result: SimulationResult) -> Iterator[Path]:
        """Write them, and yield each path."""
        if self.result is not None:
            yield result.save(self.result)
        if self.page is not None:
            with arm.view() as view:
                view.play(result)
                peak = 1000 * result.tool_norms.peak
                caption = (
                    f"A simulation of {result.t[-1]:.3g} s; the grey arm is what was asked for, and the tool is "
                    f"{peak:.3g} mm away from it at most."
                )
                yield view.save_html(self.page, interactive=True, motions={"simulation": result}, caption=caption)
        if self.figure is not None:
            from dhkit.viewer import plot

            yield write_figure(plot(result), self.figure)


def run(task: Task, files: Files, *, degrees: bool, json: bool) -> int:
    """Simulate, print the errors and write files; return 0, or 1 where the run did not get to its end."""
    files.check()
    name = task.controllers[0]
    controller = task.controller(name)
    begin = time.perf_counter()
    failure, result = "", None
    try:
        with ProgressBar("simulating") as bar:
            result = task.arm.simulate(
                controller,
                task.motion,
                plant=task.plant,
                progress=bar.show,
                **task.options,
            )
    except SimulationError as error:
        failure, result = str(error), error.result
    seconds = time.perf_counter() - begin
    written = [] if result is None else [str(path) for path in files.write(task.arm, result)]
    if json:
        facts = {} if result is None else facts_of(task.arm, result, degrees=degrees)
        print_json({"robot": task.arm.name, "controller": name, "failure": failure or None, **facts, "files": written})
    else:
        if result is not None:
            _print(task, name, result, seconds, degrees=degrees)
        if written:
            say("\n" + "\n".join(f"wrote {path}" for path in written))
    if failure:
        sys.stderr.write(f"dhkit: {' '.join(failure.split())}\n")
    return 1 if failure else 0


def _print(task: Task, name: str, result: SimulationResult, seconds: float, *, degrees: bool) -> None:
    description = result.description
    say(f"{task.arm.name}: {name}, {task.rate}", "bold")
    say(f"{task.about}; {result.t[-1]:g} s simulated in {seconds:.2f} s\n")
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
        f"{audit.impacts:.4g} J; {audit.error:.1e} of what was turned over is without account"
    )
    if not audit.error <= ACCOUNTED:
        say("the integration's steps are too long for this motion: give a larger --plant-rate")


def _units(prismatic: NDArray[np.bool_], degrees: bool) -> list[tuple[str, float]]:
    """Return each joint's unit of errors, and what a radian or metre is in it."""
    turn = ("°", 180 / np.pi) if degrees else ("rad", 1.0)
    return [("m", 1.0) if slides else turn for slides in prismatic.tolist()]


def facts_of(arm: Arm, result: SimulationResult, *, degrees: bool) -> dict[str, Any]:
    """Return what `--json` says of a run."""
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


def run_comparison(task: Task, figure: Path | None, *, degrees: bool, json: bool) -> int:
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
        _print_comparison(task, compared, degrees=degrees)
        if figure is not None and compared.results:
            say(f"\nwrote {figure}")
    return 1 if compared.failures else 0


def _print_comparison(task: Task, compared: Comparison, *, degrees: bool) -> None:
    say(f"{task.arm.name}: {task.about}, {task.rate}, {task.bandwidth:g} rad/s", "bold")
    say("")
    headings, rows = compared.rows(degrees=degrees)
    print_table(headings, rows)
    for name, reason in compared.failures.items():
        say(f"\n{name}: {reason}")
