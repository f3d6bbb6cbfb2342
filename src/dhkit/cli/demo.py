"""`dhkit demo`: from a table to a verified model and an animated page, stage by stage, with times."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dhkit.arm import Arm
from dhkit.cli.equations_page import equations_page
from dhkit.cli.output import print_json, say, write_figure
from dhkit.cli.quickest import race, there_and_back
from dhkit.cli.simulation_task import chosen_motion
from dhkit.cli.straight import Branches, Line, branches, straight_line
from dhkit.cli.tour import tour
from dhkit.control import compare
from dhkit.description import Array, write_atomically
from dhkit.dynamics import dynamics_graph
from dhkit.errors import DescriptionError, DhkitError
from dhkit.symbolic import operation_count
from dhkit.symbolic.equations import equations_latex, latex_document, readable
from dhkit.trajectories import Trajectory
from dhkit.verification import VerificationReport
from dhkit.viewer.motion import Motion

PRINTED = 5_000
"""Terms of M, C and g that are printed; of longer ones M and g."""
SAMPLES = 801
"""By which a motion's largest torque is told."""
QUICKEST = "least time"
PAGES = {
    "equations.html": "the equations of motion",
    "plan.html": "motions in least time",
    "control.html": "simulated controllers",
}
"""What the arm's page leads to."""
OWN = 1e-6
"""Share of the reach: an arm whose frames are all nearer to another's than this looks the same."""


@dataclass(frozen=True, eq=False)
class Shown:
    """What the page shows of inverse kinematics."""

    ways: Branches
    line: Line | None


def run(arm: Arm, output: Path | None, *, quick: bool, json: bool) -> int:
    """Run the demo into a folder; return 0, or 1 where our numbers and Pinocchio's disagree."""
    folder = output or Path("out") / arm.name
    if folder.exists() and not folder.is_dir():
        raise DescriptionError(f"{folder}: not a folder")
    folder.mkdir(parents=True, exist_ok=True)
    stages: list[dict[str, Any]] = []

    def stage(title: str, work: Callable[[], str]) -> None:
        start = time.perf_counter()
        result = work()
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
    shown: list[Shown] = []
    motions: dict[str, Motion] = {}
    stage("ik", lambda: _inverse(arm, shown))
    stage("plan", lambda: _plan(arm, folder, 16 if quick else None, motions))
    stage("control", lambda: _control(arm, folder, motions))
    stage("page", lambda: _page(arm, shown[0], folder / "index.html", motions))
    ok = all(report.ok for report in reports)
    if json:
        print_json({"robot": arm.name, "folder": str(folder), "ok": ok, "stages": stages})
    else:
        for report in reports:
            say(f"\n{report}")
        say(f"\nOpen {folder / 'index.html'} in a browser; it needs no network.")
    return 0 if ok else 1


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
    return f"{verdict} {report.reference} in {samples} states: {worst.quantity} to {worst.error:.1e}"


def _equations(arm: Arm, folder: Path) -> str:
    """Derive by two routes, prove that they agree, and write the equations as LaTeX and as a page."""
    try:
        start = time.perf_counter()
        lag = arm.lagrangian
        if not (lag.prove_euler_lagrange() and lag.prove_skew_symmetry()):
            return "the two derivations DISAGREE"
        seconds = time.perf_counter() - start
        entries = [*lag.M.flat, *lag.C.flat, *lag.g]
        what = ("M", "C", "g") if sum(map(len, entries)) <= PRINTED else ("M", "g")
        listed = readable(lag, what)
        write_atomically(folder / "equations.tex", latex_document(equations_latex(listed), arm.name))
        write_atomically(folder / "equations.html", equations_page(lag, listed))
    except DhkitError as error:
        return f"skipped: {error}"
    operations = operation_count(dynamics_graph("inverse_dynamics", arm.description))
    sums, products = operations.get("additions", 0), operations.get("multiplications", 0)
    return (
        f"M qdd + C qd + g proved equal to Euler and Lagrange's equation in {seconds:.2f} s: "
        f"{folder / 'equations.html'} and .tex; inverse dynamics in {products} multiplications and {sums} additions"
    )


def _figure(arm: Arm, path: Path) -> str:
    from dhkit.viewer import plot_arm

    configurations = arm.configurations
    shown = next((name for name in ("nominal", "ready", "zero") if name in configurations), None)
    return str(write_figure(plot_arm(arm.description, configurations[shown] if shown else np.zeros(arm.n)), path))


def _inverse(arm: Arm, shown: list[Shown]) -> str:
    from dhkit.viewer.scene import first_configuration

    line = straight_line(arm)
    ways = branches(arm, first_configuration(arm.description) if line is None else line.q[0])
    shown.append(Shown(ways, line))
    return f"{_ways(ways)}; {_followed(line)}"


def _ways(ways: Branches) -> str:
    count = len(ways.q)
    one = count == 1
    if ways.closed_form:
        what = f"{count} branch{'' if one else 'es'} of one pose"
    else:
        what = f"no closed form: {count} solution{'' if one else 's'} of one pose, by iteration,"
    if ways.error is None:
        return f"{what} aim{'s' * one} at one point"
    to = f"to {ways.error:.0e}" if ways.error else "exactly"
    return f"{what} close{'s' * one} FK {to}"


def _followed(line: Line | None) -> str:
    if line is None:
        return "no straight line found that it follows without a jump"
    return f"a line of {line.length:.2g} m in {len(line.q)} poses: {line.switches} switches"


def _plan(arm: Arm, folder: Path, intervals: int | None, motions: dict[str, Motion]) -> str:
    """Plan a motion in least time, and write it with what it and the quintic use of the limits, and a page of both."""
    from dhkit.viewer import plot_uses

    try:
        best, quintic = race(arm, intervals)
    except (DhkitError, ValueError) as error:
        return f"skipped: {error}"
    best.save(folder / "plan.npz")
    write_figure(plot_uses({"least time": best, "quintic": quintic}), folder / "plan.png")
    motions |= {QUICKEST: best, "the quintic between the same states": quintic}
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
        f"{_worth(best)}, the quintic {_worth(quintic)}: {kept} in {certificate.states} states, by "
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
            f"{name}: the tool errs by {1000 * r.tool_norms.peak:.2g} mm" for name, r in compared.results.items()
        )
        + f'. "{next(iter(simulated))}" plays first.',
    )
    errors = [f"{name} errs by {1000 * run.tool_norms.peak:.2g} mm" for name, run in compared.results.items()]
    seconds = f"{motion.duration:.3g} s at 1 kHz"
    return f"{seconds}: {', '.join(errors)}; {folder / 'control.html'}: pid, with the motion asked for as a ghost"


def _worth(motion: Trajectory) -> str:
    tau = motion.sample(n=SAMPLES).tau
    largest = 100 * float(np.max(np.abs(tau) / motion.description.numbers.effort))
    return f"{motion.duration:.3f} s with torques up to {largest:.0f} %"


def _page(arm: Arm, shown: Shown, path: Path, motions: dict[str, Motion]) -> str:
    """Write a page with the arm's motions and, at the pose where the first begins, its other branches as ghosts."""
    line = shown.line
    times, q = tour(arm, None if line is None else line.q)
    first = "tour of the configurations" if line is None else "tour, with a straight line of the tool"
    beside = _apart(arm, shown.ways.q, q[0])
    lines = [arm.description.source, f'The motion "{first}" plays first; more are under Motions.']
    if beside.any():
        lines.append("Translucent arms are the other ways to reach the pose with which it begins.")
    with arm.view() as view:
        view.show(q[0])
        view.ghosts(shown.ways.q[beside], names=[x for x, drawn in zip(shown.ways.names, beside, strict=True) if drawn])
        view.trace(None if line is None else line.T[:, :3, 3])
        links = {text: name for name, text in PAGES.items() if (path.parent / name).exists()}
        played = {first: (times, q)} | motions
        view.save_html(path, interactive=True, motions=played, caption="\n".join(lines), links=links)
    return f"{path}, with sliders, the table and {1 + len(motions)} motions"


def _save(arm: Arm, path: Path, title: str, motions: Mapping[str, Motion], caption: str) -> None:
    links = {"the arm, its branches and all motions": "index.html"}
    with arm.view() as view:
        view.save_html(
            path, interactive=True, motions=motions, title=f"{arm.name}: {title} · dhkit", caption=caption, links=links
        )


def _apart(arm: Arm, q: Array, own: Array) -> NDArray[np.bool_]:
    """Return of which states (k, n) something is seen beside the arm in its own, (k,): others would only tint it."""
    gaps = np.abs(arm.frames(q) - arm.frames(own))[..., :3, 3].max(axis=(1, 2))
    return np.asarray(gaps > OWN * arm.description.reach)
