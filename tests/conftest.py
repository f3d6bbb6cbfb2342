"""Sample sizes, Hypothesis profiles and what a machine must have."""

from __future__ import annotations

import gc
import os
import shutil
from importlib import import_module
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

import acceptance
from acceptance import pytest_collection_modifyitems  # noqa: F401 - a pytest hook
from viewer.chromium import Chromium, require_chromium

# Kernels compiled by tests stay with the checkout, for the next run.
os.environ.setdefault("DHKIT_CACHE_DIR", str(Path(__file__).resolve().parents[1] / ".cache"))

settings.register_profile(
    "dhkit",
    deadline=None,
    max_examples=acceptance.sample_size(1000),
    derandomize=not acceptance.ACCEPTING,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
    print_blob=True,
    # Without "explain": its tracing makes deriving programs ten times slower.
    phases=(Phase.explicit, Phase.reuse, Phase.generate, Phase.target, Phase.shrink),
)
settings.load_profile("dhkit")


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(acceptance.Recorder(), "dhkit-laws")


def pytest_collection_finish() -> None:
    # Modules and tests stay until the end: a collector that visits them again and again takes 5 % of the time.
    gc.freeze()
    gc.set_threshold(10_000, 10, 10)


@pytest.fixture(scope="session")
def check_urdf() -> str:
    """Path of urdfdom's check_urdf; skips where it is missing and not required."""
    return require("check_urdf", "Debian's liburdfdom-tools has it")


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every batch, single states too, is computed by compiled kernels."""
    monkeypatch.setattr(import_module("dhkit.kernels.kernel"), "kernel_mode", lambda: "on")


@pytest.fixture
def interpreted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every batch is computed by CasADi's virtual machine."""
    monkeypatch.setattr(import_module("dhkit.kernels.kernel"), "kernel_mode", lambda: "off")


def require(program: str, hint: str) -> str:
    path = shutil.which(program)
    if path is None and program in os.environ.get("DHKIT_REQUIRE", "").split(","):
        pytest.fail(f"{program} is required (DHKIT_REQUIRE) and missing: {hint}")
    if path is None:
        pytest.skip(f"no {program}: {hint}")
    return path


@pytest.fixture(scope="session")
def chromium():
    """A headless Chromium, or a skip."""
    require_chromium()
    browser = Chromium()
    yield browser
    browser.close()
