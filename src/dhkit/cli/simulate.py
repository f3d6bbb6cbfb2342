"""`dhkit simulate` and `dhkit compare`: an arm under one controller, or under several on one motion."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dhkit.arm import Arm
from dhkit.cli.exit_status import ExitStatus
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
from dhkit.cli.simulation_settings import SimulationSettings
from dhkit.cli.units import joint_entry
from dhkit.control import Comparison, Plant, SimulationResult, compare
from dhkit.dynamics import Friction
from dhkit.errors import SimulationError

MAX_ENERGY_ERROR = 1e-6
"""Largest share of the energy that is turned over which may be without account; above it the steps are too long."""
SUFFIXES = (".npz", ".mat", ".csv")


def run(settings: SimulationSettings, files: MotionFiles, *, degrees: bool, json: bool) -> ExitStatus:
    """Simulate, print the errors and write files; the status is NO if the run did not get to its end."""
    files.check(SUFFIXES)
    name = settings.controllers[0]
    controller = settings.controller(name)
    begin = time.perf_counter()
    failure, result = "", None
    try:
        with ProgressBar("simulating") as bar:
            result = settings.arm.simulate(
                controller, settings.motion, plant=settings.plant, progress=bar.show, **settings.options
            )
    except SimulationError as error:
        failure, result = str(error), error.result
    seconds = time.perf_counter() - begin
    written: list[str] = []
    if result is not None:
        caption = (
            f"A simulation of {result.t[-1]:.3g} s; the grey arm is what was asked for, and the tool is "
            f"{1000 * result.tool_norms.peak:.3g} mm away from it at most."
        )
        written = files.write(settings.arm, result, "simulation", caption)
    if json:
        facts = {} if result is None else facts_of(settings.arm, result, degrees=degrees)
        print_json(
            {"robot": settings.arm.name, "controller": name, "failure": failure or None, **facts, "files": written}
        )
    else:
        if result is not None:
            _print(settings, name, result, seconds, degrees=degrees)
        if written:
            say("")
            say_written(written)
    if failure:
        sys.stderr.write(f"dhkit: {' '.join(failure.split())}\n")
    return ExitStatus.NO if failure else ExitStatus.FINE


def _print(settings: SimulationSettings, name: str, result: SimulationResult, seconds: float, *, degrees: bool) -> None:
    description = result.description
    say(f"{settings.arm.name}: {name}, {settings.rate}", "bold")
    say(f"{settings.about}; {result.t[-1]:g} s simulated in {seconds:.2f} s\n")
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
    if not audit.error <= MAX_ENERGY_ERROR:
        say("the integration's steps are too long for this motion: give a larger --plant-rate")


def _units(prismatic: NDArray[np.bool_], degrees: bool) -> list[tuple[str, float]]:
    """Return the unit of each joint's errors, and the factor to it from rad or m."""
    angle_unit = ("°", 180 / np.pi) if degrees else ("rad", 1.0)
    return [("m", 1.0) if slides else angle_unit for slides in prismatic.tolist()]


def facts_of(arm: Arm, result: SimulationResult, *, degrees: bool) -> dict[str, object]:
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


def run_comparison(settings: SimulationSettings, figure: Path | None, *, degrees: bool, json: bool) -> ExitStatus:
    """Compare controllers on one motion, print a table and write a figure; the status is NO if one failed."""
    check_outputs(((figure, FIGURES),))
    options = dict(settings.options)
    plant = Plant(
        settings.plant.description,
        Friction.chosen(options.pop("friction")),
        options.pop("restitution"),
        tuple(options.pop("pushes")),
    )
    names = list(settings.controllers)
    with ProgressBar(f"simulating {names[0]}") as bar:
        comparison = compare(
            settings.arm.description,
            settings.motion,
            names,
            settings.bandwidth,
            settings.damping,
            lambda name: bar.show(names.index(name) + 1, len(names), f"simulated {name}"),
            plant=plant,
            **options,
        )
    if figure is not None and comparison.results:
        from dhkit.viewer import plot_comparison

        write_figure(
            plot_comparison(comparison.results, f"{settings.arm.name}: {settings.about}, {settings.rate}"), figure
        )
    if json:
        facts = {name: facts_of(settings.arm, result, degrees=degrees) for name, result in comparison.results.items()}
        print_json({"robot": settings.arm.name, "controllers": facts, "failures": dict(comparison.failures)})
    else:
        _print_comparison(settings, comparison, degrees=degrees)
        if figure is not None and comparison.results:
            say(f"\nwrote {figure}")
    return ExitStatus.NO if comparison.failures else ExitStatus.FINE


def _print_comparison(settings: SimulationSettings, comparison: Comparison, *, degrees: bool) -> None:
    say(f"{settings.arm.name}: {settings.about}, {settings.rate}, {settings.bandwidth:g} rad/s", "bold")
    say("")
    headings, rows = comparison.rows(degrees=degrees)
    print_table(headings, rows)
    for name, reason in comparison.failures.items():
        say(f"\n{name}: {reason}")
