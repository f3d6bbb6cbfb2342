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
from dhkit.bench.contenders import (
    Contender,
    Mode,
    Task,
    UnavailableError,
    Workload,
    import_peer,
    single_task,
)
from dhkit.bench.geometry import JointAxes, bare, joint_axes

_MAX_BUILD_TIME = 120.0
"""Longest time of `ssik build`, s: for an arm without a closed form it takes up to a minute."""


def contenders() -> tuple[Contender, ...]:
    """Return ssik's contenders; each call takes one pose."""
    return (
        Contender("ssik fk", "fk", Mode.SINGLE, _forward),
        Contender("ssik solve", "ik", Mode.SINGLE, _solve),
    )


def _forward(workload: Workload) -> Task:
    package, axes = _package_and_axes(workload)
    arm = package.Manipulator.from_axes(axes.directions, axes.offsets)
    return single_task(arm.fk, workload.q, axes.with_tool_rotation)


def _solve(workload: Workload) -> Task:
    _package_and_axes(workload)
    # Without limits, one solution for each branch, as the other packages return.
    solve = partial(_build_module(workload).solve, respect_limits=False)
    return single_task(
        solve, workload.T, lambda found: np.reshape([x.q for x in found], (-1, workload.arm.n))
    )


def _package_and_axes(workload: Workload) -> tuple[Any, JointAxes]:
    package = import_peer("ssik")
    axes = joint_axes(workload.arm.description)
    if workload.arm.n not in (6, 7):
        raise UnavailableError(f"takes 6 or 7 joints; this arm has {workload.arm.n}")
    return package, axes


def _build_module(workload: Workload) -> Any:
    """Return the module that ssik writes for the arm, which its documentation recommends for speed."""
    with tempfile.TemporaryDirectory() as folder:
        urdf = Path(folder) / "arm.urdf"
        module = Path(folder) / "arm_ik.py"
        urdf.write_text(Arm(bare(workload.arm.description)).urdf(), encoding="utf-8")
        ends = ("--base", "world", "--ee", "tool")
        command = [
            sys.executable,
            "-m",
            "ssik.cli",
            "build",
            str(urdf),
            *ends,
            "--out",
            str(module),
            "--no-validate",
        ]
        try:
            process = subprocess.run(  # noqa: S603
                command, capture_output=True, text=True, timeout=_MAX_BUILD_TIME, check=False
            )
        except subprocess.TimeoutExpired:
            raise UnavailableError(f"`ssik build` took more than {_MAX_BUILD_TIME:.0f} s") from None
        if process.returncode or not module.exists():
            lines = (process.stderr or process.stdout).strip().splitlines()
            raise UnavailableError(f"`ssik build` failed: {lines[-1] if lines else 'no output'}")
        spec = importlib.util.spec_from_file_location("dhkit_bench_arm_ik", module)
        if spec is None or spec.loader is None:
            raise UnavailableError("`ssik build` wrote no Python module")
        built = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(built)
        return built
