"""Laws with a sample size: small in `make test`, full in `make accept`, which writes down what was seen.

A test takes the fixture ``law``; ``law.samples(1000)`` is 1,000 under DHKIT_ACCEPT=1 and a fiftieth of it otherwise;
``law.holds("frames", seen, required)`` keeps the worst of each quantity and fails where it is too large.
"""

from __future__ import annotations

import json
import math
import os
import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import pytest

ACCEPTING = os.environ.get("DHKIT_ACCEPT") == "1"
RESULTS = Path(__file__).resolve().parents[1] / "benchmarks" / "results" / "acceptance.json"
SHARE = 50
FEWEST = 5

only_accepting = pytest.mark.skipif(not ACCEPTING, reason="in make accept")
"""For tests that take too long for every change."""


def sample_size(full: int, quick: int | None = None) -> int:
    """Return how many samples this run takes of a law stated with ``full``.

    Outside of ``make accept`` they are ``quick``, and unless it is given a fiftieth, and at least ``FEWEST``.
    """
    if ACCEPTING:
        return full
    if quick is not None:
        return min(quick, full)
    return max(min(full, FEWEST), full // SHARE)


DIFFERENT_ROBOTS = (
    "planar2r",
    "puma560",
    "stanford",
    "cobra600",
    "panda",
    "manutec_r3",
    "ax12_arm",
)
"""Robots that differ in kind: few joints, a PUMA, prismatic joints, seven joints, a coupling, tiny links."""


def different_robots_first(names: Sequence[str]) -> list[object]:
    """Return the cases of a law of every robot: robots of different kinds, and all the others in `make accept`."""
    return [
        name if name in DIFFERENT_ROBOTS else pytest.param(name, marks=only_accepting)
        for name in names
    ]


def slow_if(slow: bool, *values: object) -> object:
    """Return a case of a parametrized test, marked as slow where it takes more than about a second."""
    return pytest.param(*values, marks=[pytest.mark.slow] if slow else [])


def in_time(seconds: float, required: float) -> None:
    """Hold a time to what is required in `make accept` alone: elsewhere a tracer or a busy machine decides."""
    assert not ACCEPTING or seconds <= required, (
        f"{seconds:.3g} s, required at most {required:.3g} s"
    )


class Law:
    """What one test has seen, quantity by quantity."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.size = 0
        self.worst: dict[str, tuple[float, float]] = {}

    def samples(self, full: int, quick: int | None = None) -> int:
        """Return the number of samples of this run, see :func:`sample_size`."""
        self.size = sample_size(full, quick)
        return self.size

    def holds(self, quantity: str, seen: float, required: float, where: object = None) -> None:
        """Record a figure and fail if it exceeds what is required; NaN fails."""
        seen = float(seen)
        before, _ = self.worst.get(quantity, (-math.inf, required))
        if math.isnan(seen) or seen > before:
            self.worst[quantity] = (seen, required)
        assert seen <= required, f"{quantity}: {seen:.3g}, required at most {required:.3g}" + (
            f" at {where}" if where is not None else ""
        )

    def takes(self, quantity: str, seconds: float, required: float, where: object = None) -> None:
        """Hold a time to what is required in `make accept` alone: elsewhere a tracer or a busy machine decides."""
        if ACCEPTING:
            self.holds(quantity, seconds, required, where)

    def rows(self) -> list[dict[str, object]]:
        return [
            {
                "law": self.name,
                "quantity": q,
                "samples": self.size,
                "seen": seen,
                "required": required,
                "holds": seen <= required,
            }
            for q, (seen, required) in self.worst.items()
        ]


class Recorder:
    """Pytest plugin: collects the laws of a session."""

    def __init__(self) -> None:
        self.rows: list[dict[str, object]] = []

    @pytest.fixture
    def law(self, request: pytest.FixtureRequest):
        request.applymarker(pytest.mark.law)
        law = Law(request.node.nodeid.split("tests/", 1)[-1])
        yield law
        self.rows += law.rows()
        if ACCEPTING:
            for row in law.rows():
                print(
                    f"\n  {row['quantity']}: {row['seen']:.3g} of at most {row['required']:.3g}",
                    end="",
                )

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if (
            not ACCEPTING
            or hasattr(session.config, "workerinput")
            or not self.rows
            or not _is_whole(session.config)
        ):
            return
        packages = ("numpy", "llvmlite", "casadi", "pin", "yourdfpy", "eaik", "ssik", "hypothesis")
        RESULTS.parent.mkdir(parents=True, exist_ok=True)
        RESULTS.write_text(
            json.dumps(
                {
                    "python": platform.python_version(),
                    "machine": platform.machine(),
                    "packages": {package: version(package) for package in packages},
                    "laws": sorted(
                        self.rows, key=lambda row: (str(row["law"]), str(row["quantity"]))
                    ),
                },
                indent=1,
            )
            + "\n"
        )

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if not ACCEPTING:
            terminalreporter.write_line(_left_out(terminalreporter.config))
            return
        if not self.rows:
            return
        worst: dict[str, tuple[float, float, int]] = {}
        for row in self.rows:
            name = f"{str(row['law']).split('[')[0]}: {row['quantity']}"
            seen, count = (
                max(worst.get(name, (-math.inf, 0.0, 0))[0], row["seen"]),
                worst.get(name, (0, 0, 0))[2] + 1,
            )
            worst[name] = (seen, row["required"], count)
        terminalreporter.section("laws: worst seen, required")
        for name, (seen, required, count) in worst.items():
            terminalreporter.write_line(f"{seen:10.2e} {required:10.1e}  {name} ({count})")


def _left_out(config: pytest.Config) -> str:
    """Return a line on what this run leaves out, and the command that runs it."""
    laws = "laws at their full size and on every robot: make accept"
    if config.option.markexpr == "not slow and not browser":
        return f"Left out: tests that take seconds, and all with a browser: make test-all; {laws}"
    if config.option.markexpr == "not slow":
        return f"Left out: tests that take seconds: make test-all; {laws}"
    return f"Left out: {laws}"


def _is_whole(config: pytest.Config) -> bool:
    """Whether all tests were asked for: what a part of them saw must not replace what all of them saw."""
    asked = [(config.invocation_params.dir / argument).resolve() for argument in config.args]
    return asked == [Path(__file__).resolve().parent] and not config.option.keyword


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark laws, and what runs only in `make accept`, for -m law; and tests with a browser."""
    for item in items:
        if "chromium" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.browser)
        left = any(mark == only_accepting.mark for mark in item.iter_markers("skipif"))
        if left or "law" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.law)
