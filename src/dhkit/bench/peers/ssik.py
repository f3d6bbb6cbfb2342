"""ssik (analytic inverse kinematics of 6R and 7R arms), by the module that `ssik build` writes for an arm."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.bench.contenders import Contender, Mode, Task, UnavailableError, Workload, import_peer, one_by_one
from dhkit.bench.geometry import JointAxes, bare, joint_axes

BUILD_TIME = 120.0
"""s: an arm without a closed form is derived for up to a minute."""


def contenders() -> tuple[Contender, ...]:
    """Return ssik's contenders; it takes one pose a call."""
    return (
        Contender("ssik fk", "fk", Mode.SINGLE, _forward),
        Contender("ssik solve", "ik", Mode.SINGLE, _solve),
    )


def _forward(workload: Workload) -> Task:
    package, axes = _package_and_axes(workload)
    arm = package.Manipulator.from_axes(axes.directions, axes.offsets)
    return Task(
        one_by_one(arm.fk, list(workload.q)),
        lambda k: [axes.with_tool_rotation(arm.fk(q)) for q in workload.q[:k]],
    )


def _solve(workload: Workload) -> Task:
    _package_and_axes(workload)
    # Limits off, one representative a branch: what the others return.
    solve = partial(_built(workload).solve, respect_limits=False)
    return Task(
        one_by_one(solve, list(workload.T)),
        lambda k: [np.reshape([found.q for found in solve(T)], (-1, workload.arm.n)) for T in workload.T[:k]],
    )


def _package_and_axes(workload: Workload) -> tuple[Any, JointAxes]:
    package, axes = import_peer("ssik"), joint_axes(workload.arm.description)
    if workload.arm.n not in (6, 7):
        raise UnavailableError(f"takes 6 or 7 joints; this arm has {workload.arm.n}")
    return package, axes


def _built(workload: Workload) -> Any:
    """Return the module that ssik writes for the arm: its documented way to speed."""
    with tempfile.TemporaryDirectory() as folder:
        urdf, module = Path(folder) / "arm.urdf", Path(folder) / "arm_ik.py"
        urdf.write_text(Arm(bare(workload.arm.description)).urdf(), encoding="utf-8")
        ends = ("--base", "world", "--ee", "tool")
        command = [sys.executable, "-m", "ssik.cli", "build", str(urdf), *ends, "--out", str(module), "--no-validate"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=BUILD_TIME, check=False)  # noqa: S603
        except subprocess.TimeoutExpired:
            raise UnavailableError(f"`ssik build` took more than {BUILD_TIME:.0f} s") from None
        if done.returncode or not module.exists():
            lines = (done.stderr or done.stdout).strip().splitlines()
            raise UnavailableError(f"`ssik build` failed: {lines[-1] if lines else 'no output'}")
        spec = importlib.util.spec_from_file_location("dhkit_bench_arm_ik", module)
        if spec is None or spec.loader is None:
            raise UnavailableError("`ssik build` wrote no Python module")
        built = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(built)
        return built
