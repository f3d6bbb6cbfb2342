"""`dhkit demo`: from a table to a verified model and an animated page, stage by stage, with times."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from dhkit.arm import Arm
from dhkit.cli.demo_motions import race, there_and_back, tour
from dhkit.cli.equations_page import equations_page
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.options import Json, load_arm
from dhkit.cli.output import output_folder, print_json, say, write_figure
from dhkit.cli.simulation_settings import chosen_motion
from dhkit.cli.straight import Branches, Line, branches, straight_line
from dhkit.control import compare
from dhkit.description import Array, write_atomically
from dhkit.dynamics import dynamics_graph
from dhkit.errors import DhkitError, MissingPackageError
from dhkit.symbolic import operation_count
from dhkit.symbolic.equations import equations_latex, latex_document, readable
from dhkit.trajectories import Trajectory
from dhkit.verification import VerificationReport
from dhkit.viewer.motion import Motion

MAX_TERMS = 5_000
"""Most terms of M, C and g that are printed together; of longer equations M and g are printed."""
TORQUE_SAMPLES = 801
"""Samples of a motion of which the largest torque is printed."""
LEAST_TIME = "least time"
PAGES = {
    "equations.html": "the equations of motion",
    "ik.html": "inverse kinematics worked out",
    "plan.html": "motions in least time",
    "control.html": "simulated controllers",
}
"""Pages that the arm's page leads to."""
SAME_LOOK = 1e-6
"""Largest distance of frames, as a share of the arm's reach, of two states that look the same."""

app = typer.Typer(rich_markup_mode=None)


@dataclass(frozen=True, eq=False)
class InverseKinematics:
    """Results of inverse kinematics that the page shows."""

    branches: Branches
    line: Line | None


@app.command()
def demo(
    robot: Annotated[str, typer.Option(help="A library name or a robot file.")] = "puma560",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder to write; default: out/NAME.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Use fewer samples.")] = False,
    json: Json = False,
) -> ExitStatus:
    """Build a robot from its table, verify it, and write its URDF, a figure and an animated page."""
    arm = load_arm(robot)
    folder = output_folder(output, arm.name)
    folder.mkdir(parents=True, exist_ok=True)
    stages: list[dict[str, Any]] = []

    def stage(title: str, work: Callable[[], str]) -> None:
        start = time.perf_counter()
        try:
            result = work()
        except MissingPackageError as error:
            result = f"skipped: {error}"
        seconds = time.perf_counter() - start
        stages.append({"stage": title, "result": result, "seconds": seconds})
        if not json:
            say(f"  {title:<9} {seconds:6.2f} s   {result}")

    if not json:
        say(f"{arm.name}: {arm.description.source}", "bold")
        say(f"\n{arm.dh}\n")
    urdf = folder / f"{arm.name}.urdf"
    stage("build", lambda: _build(arm, urdf))
    reports: list[VerificationReport] = []
    stage("verify", lambda: _verify(arm, 100 if quick else 1000, reports))
    if reports:
        write_atomically(folder / "verification.md", reports[0].markdown())
    stage("equations", lambda: _equations(arm, folder))
    stage("figure", lambda: _figure(arm, folder / f"{arm.name}.png"))
    shown: list[InverseKinematics] = []
    motions: dict[str, Motion] = {}
    stage("ik", lambda: _inverse(arm, folder, shown))
    stage("plan", lambda: _plan(arm, folder, 16 if quick else None, motions))
    stage("control", lambda: _control(arm, folder, motions))
    page = folder / "index.html"
    if shown:
        stage("page", lambda: _page(arm, shown[0], page, motions))
    ok = all(report.ok for report in reports)
    if json:
        print_json({"robot": arm.name, "folder": str(folder), "ok": ok, "stages": stages})
    else:
        for report in reports:
            say(f"\n{report}")
        if page.exists():
            say(f"\nOpen {page} in a browser; it needs no network.")
    return ExitStatus.FINE if ok else ExitStatus.NO


def _build(arm: Arm, path: Path) -> str:
    files = arm.write_urdf(path)
    meshes = f" and {len(files) - 1} meshes" if len(files) > 1 else ""
    return f"URDF from {arm.n} rows: {path}{meshes}"


def _verify(arm: Arm, samples: int, reports: list[VerificationReport]) -> str:
    if find_spec("pinocchio") is None:
        return "skipped: Pinocchio is not installed (pip install pin)"
    report = arm.verify(samples)
    reports.append(report)
    worst = max(report.agreements, key=lambda agreement: agreement.error / agreement.tolerance)
    verdict = "agrees with" if report.ok else "DISAGREES with"
    return (
        f"{verdict} {report.reference} in {samples} states: {worst.quantity} to {worst.error:.1e}"
    )


def _equations(arm: Arm, folder: Path) -> str:
    """Derive by two routes, prove that they agree, and write the equations as LaTeX and as a page."""
    try:
        start = time.perf_counter()
        lag = arm.lagrangian
        if not (lag.prove_euler_lagrange() and lag.prove_skew_symmetry()):
            return "the two derivations DISAGREE"
        seconds = time.perf_counter() - start
        entries = [*lag.M.flat, *lag.C.flat, *lag.g]
        what = ("M", "C", "g") if sum(map(len, entries)) <= MAX_TERMS else ("M", "g")
        shown = readable(lag, what)
        write_atomically(folder / "equations.tex", latex_document(equations_latex(shown), arm.name))
        write_atomically(folder / "equations.html", equations_page(lag, shown))
    except DhkitError as error:
        return f"skipped: {error}"
    operations = operation_count(dynamics_graph("inverse_dynamics", arm.description))
    sums = operations.get("additions", 0)
    products = operations.get("multiplications", 0)
    return (
        f"M qdd + C qd + g proved equal to Euler and Lagrange's equation in {seconds:.2f} s: "
        f"{folder / 'equations.html'} and .tex; inverse dynamics in {products} multiplications and {sums} additions"
    )


def _figure(arm: Arm, path: Path) -> str:
    from dhkit.viewer import plot_arm

    configurations = arm.configurations
    shown = next((name for name in ("nominal", "ready", "zero") if name in configurations), None)
    return str(
        write_figure(
            plot_arm(arm.description, configurations[shown] if shown else np.zeros(arm.n)), path
        )
    )


def _inverse(arm: Arm, folder: Path, shown: list[InverseKinematics]) -> str:
    """Solve a pose, follow a line, and write the derivation of closed forms as a page."""
    from dhkit.viewer.scene import first_configuration

    line = straight_line(arm)
    solutions = branches(arm, first_configuration(arm.description) if line is None else line.q[0])
    shown.append(InverseKinematics(solutions, line))
    worked_out = ""
    if solutions.closed_form:
        derivation = arm.symbolic.ik
        write_atomically(folder / "ik.html", derivation.html())
        verdict = "proved" if derivation.prove() else "NOT PROVED"
        worked_out = f"; worked out and {verdict}: {folder / 'ik.html'}"
    return f"{_branches_text(solutions)}; {_line_text(line)}{worked_out}"


def _branches_text(branches: Branches) -> str:
    count = len(branches.q)
    one = count == 1
    if branches.closed_form:
        what = f"{count} branch{'' if one else 'es'} of one pose"
    else:
        what = f"no closed form: {count} solution{'' if one else 's'} of one pose, by iteration,"
    if branches.error is None:
        return f"{what} aim{'s' * one} at one point"
    to = f"to {branches.error:.0e}" if branches.error else "exactly"
    return f"{what} close{'s' * one} FK {to}"


def _line_text(line: Line | None) -> str:
    if line is None:
        return "no straight line found that it follows without a jump"
    return f"a line of {line.length:.2g} m in {len(line.q)} poses: {line.switches} switches"


def _plan(arm: Arm, folder: Path, intervals: int | None, motions: dict[str, Motion]) -> str:
    """Plan a motion in least time; write it, a figure of it beside the quintic, and a page of both."""
    from dhkit.viewer import plot_uses

    try:
        best, quintic = race(arm, intervals)
    except (DhkitError, ValueError) as error:
        return f"skipped: {error}"
    best.save(folder / "plan.npz")
    write_figure(plot_uses({"least time": best, "quintic": quintic}), folder / "plan.png")
    motions |= {LEAST_TIME: best, "the quintic between the same states": quintic}
    both = {"there in least time, back by the quintic": there_and_back(best, quintic)}
    _save(
        arm,
        folder / "plan.html",
        "motions in least time",
        both | motions,
        f"A motion in {best.duration:.3f} s, the least that the limits of speed and torque allow, beside the quintic "
        f"between the same states, {quintic.duration:.3f} s. The first motion goes there in least time and back by "
        "the quintic, with a rest at both ends; the curves, with the limits, are under Motions.",
    )
    certificate = best.report.certificate
    kept = "all limits kept" if certificate.ok else "limits NOT kept"
    return (
        f"{_duration_text(best)}, the quintic {_duration_text(quintic)}: {kept} in {certificate.states} states, by "
        f"{certificate.reference}; {folder / 'plan.html'}: there in least time, back by the quintic"
    )


def _control(arm: Arm, folder: Path, motions: dict[str, Motion]) -> str:
    """Simulate independent joints and computed torque on one motion; write a figure, and a page of the first."""
    from dhkit.viewer import plot_comparison

    try:
        motion, _ = chosen_motion(arm, None, None, None, None, False)
        compared = compare(arm.description, motion, ("pid", "computed-torque"))
    except (DhkitError, ValueError) as error:
        return f"skipped: {error}"
    if compared.failures:
        return "; ".join(f"{name}: {reason}" for name, reason in compared.failures.items())
    write_figure(plot_comparison(compared.results), folder / "control.png")
    simulated = {f"simulated: {name}": result for name, result in compared.results.items()}
    motions |= simulated
    _save(
        arm,
        folder / "control.html",
        "simulated controllers",
        simulated,
        "The simulated arm under two controllers; the grey arm beside it is the motion that was asked for. A PID of "
        "each joint does not know the arm's dynamics, computed torque does.\n"
        + "; ".join(
            f"{name}: the tool errs by {1000 * r.tool_norms.peak:.2g} mm"
            for name, r in compared.results.items()
        )
        + f'. "{next(iter(simulated))}" plays first.',
    )
    errors = [
        f"{name} errs by {1000 * run.tool_norms.peak:.2g} mm"
        for name, run in compared.results.items()
    ]
    seconds = f"{motion.duration:.3g} s at 1 kHz"
    return f"{seconds}: {', '.join(errors)}; {folder / 'control.html'}: pid, with the motion asked for as a ghost"


def _duration_text(motion: Trajectory) -> str:
    tau = motion.sample(n=TORQUE_SAMPLES).tau
    largest = 100 * float(np.max(np.abs(tau) / motion.description.numbers.effort))
    return f"{motion.duration:.3f} s with torques up to {largest:.0f} %"


def _page(arm: Arm, inverse: InverseKinematics, path: Path, motions: dict[str, Motion]) -> str:
    """Write a page with the arm's motions and, at the pose where the first begins, its other branches as ghosts."""
    line = inverse.line
    times, q = tour(arm, None if line is None else line.q)
    first = (
        "tour of the configurations" if line is None else "tour, with a straight line of the tool"
    )
    is_ghost = _looks_different(arm, inverse.branches.q, q[0])
    lines = [arm.description.source, f'The motion "{first}" plays first; more are under Motions.']
    if is_ghost.any():
        lines.append("Translucent arms are the other ways to reach the pose with which it begins.")
    with arm.view() as view:
        view.show(q[0])
        names = [
            name for name, ghost in zip(inverse.branches.names, is_ghost, strict=True) if ghost
        ]
        view.ghosts(inverse.branches.q[is_ghost], names=names)
        view.trace(None if line is None else line.T[:, :3, 3])
        links = {text: name for name, text in PAGES.items() if (path.parent / name).exists()}
        played = {first: (times, q)} | motions
        view.save_html(
            path, interactive=True, motions=played, caption="\n".join(lines), links=links
        )
    return f"{path}, with sliders, the table and {1 + len(motions)} motions"


def _save(arm: Arm, path: Path, title: str, motions: Mapping[str, Motion], caption: str) -> None:
    links = {"the arm, its branches and all motions": "index.html"}
    with arm.view() as view:
        view.save_html(
            path,
            interactive=True,
            motions=motions,
            title=f"{arm.name}: {title} · dhkit",
            caption=caption,
            links=links,
        )


def _looks_different(arm: Arm, q: Array, shown: Array) -> NDArray[np.bool_]:
    """Return which states, shape (k, n), look different from the one shown, shape (n,): others would only tint it."""
    distances = np.abs(arm.frames(q) - arm.frames(shown))[..., :3, 3].max(axis=(1, 2))
    return np.asarray(distances > SAME_LOOK * arm.description.reach)
