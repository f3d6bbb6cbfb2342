"""`dhkit demo`: from a table to a verified model and an animated page, stage by stage, with times."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.cli.output import print_json, say
from dhkit.description import Array, write_atomically
from dhkit.errors import DescriptionError
from dhkit.verification import VerificationReport

__all__ = ["run", "tour"]

RATE = 50.0
"""Hz: how densely the animated motion is sampled."""
PAUSE = 0.4
"""s: rest at each configuration of the tour."""
GENTLE = 0.6
"""Share of the joints' speeds that the tour uses."""
DEFAULT_SPEED = 1.5
"""rad/s or m/s, of joints without a speed limit."""


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
            say(f"  {title:<8} {seconds:6.2f} s   {result}")

    if not json:
        say(f"{arm.name}: {arm.description.source}", "bold")
        say(f"\n{arm.dh}\n")
    urdf = folder / f"{arm.name}.urdf"
    stage("build", lambda: _build(arm, urdf))
    reports: list[VerificationReport] = []
    stage("verify", lambda: _verify(arm, 100 if quick else 1000, reports))
    stage("figure", lambda: _figure(arm, folder / f"{arm.name}.png"))
    stage("page", lambda: _page(arm, folder / "index.html"))
    ok = all(report.ok for report in reports)
    if json:
        print_json({"robot": arm.name, "folder": str(folder), "ok": ok, "stages": stages})
    else:
        for report in reports:
            say(f"\n{report}")
        say(f"\nOpen {folder / 'index.html'} in a browser; it needs no network.")
    return 0 if ok else 1


def tour(arm: Arm) -> tuple[Array, Array]:
    """Return times (N,), s, and joint values (N, n) of a smooth motion through the arm's configurations and back."""
    stops = _stops(arm)
    numbers = arm.description.numbers
    speed = GENTLE * np.where(np.isfinite(numbers.velocity), numbers.velocity, DEFAULT_SPEED)
    pieces, at = [stops[0][None]], stops[0]
    for stop in [*stops[1:], stops[0]]:
        # A quintic blend is fastest in its middle, at 15/8 of its mean speed.
        duration = max(0.8, float(np.max(15 / 8 * np.abs(stop - at) / speed)))
        s = np.linspace(0.0, 1.0, max(2, round(duration * RATE)))[1:, None]
        blend = s**3 * (10 - 15 * s + 6 * s**2)
        pieces += [at + (stop - at) * blend, np.repeat(stop[None], round(PAUSE * RATE), axis=0)]
        at = stop
    q = np.concatenate(pieces)
    return np.arange(len(q)) / RATE, q


def _stops(arm: Arm) -> list[Array]:
    """Return the named configurations in the limits, each once; single joints moved where there is only one."""
    numbers = arm.description.numbers
    inside = [q for q in arm.configurations.values() if np.all((q >= numbers.lower) & (q <= numbers.upper))]
    stops: list[Array] = []
    for q in inside or [np.clip(np.zeros(arm.n), numbers.lower, numbers.upper)]:
        if not any(np.array_equal(q, stop) for stop in stops):
            stops.append(q)
    first = stops[0]
    for i in range(arm.n):
        moved = first.copy()
        room = 0.7 if not numbers.prismatic[i] else 0.3 * max(arm.description.reach, 0.1)
        moved[i] = moved[i] + room if moved[i] + room <= numbers.upper[i] else max(moved[i] - room, numbers.lower[i])
        stops += [moved] if len(stops) < 4 else []
    return stops


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


def _figure(arm: Arm, path: Path) -> str:
    from dhkit.viewer import plot_arm

    configurations = arm.configurations
    shown = next((name for name in ("nominal", "ready", "zero") if name in configurations), None)
    buffer = io.BytesIO()
    plot_arm(arm.description, configurations[shown] if shown else np.zeros(arm.n)).savefig(
        buffer, format="png", dpi=120
    )
    write_atomically(path, buffer.getvalue())
    return str(path)


def _page(arm: Arm, path: Path) -> str:
    times, q = tour(arm)
    with arm.view() as view:
        view.play((times, q))
        view.save_html(path)
    return f"{path}, {times[-1]:.1f} s of motion"
