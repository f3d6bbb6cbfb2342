"""`dhkit doctor` and `dhkit cache`: what is installed, whether it works, and the kernels that are kept on disk."""

from __future__ import annotations

import platform
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from enum import StrEnum
from importlib.metadata import PackageNotFoundError, requires, version
from typing import Annotated, Any

import numpy as np
import typer

from dhkit import __version__
from dhkit.arm import Arm
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.options import Json
from dhkit.cli.output import print_json, say
from dhkit.display import counted
from dhkit.errors import DhkitError, MissingPackageError
from dhkit.kernels import store

DISTRIBUTION = "dhkit-robotics"
HIDDEN_EXTRAS = ("test", "check")
"""Extras for work on dhkit itself."""
SAMPLES = 50
"""Random states of the self-check."""
TOLERANCE = 1e-12
"""Largest error of a pose that inverse kinematics leads to: m, and entries of the rotation matrix."""
_REQUIREMENT = re.compile(r"([\w.-]+)([^;]*)(?:;(.*))?")
_EXTRA = re.compile(r"""extra == ['"]([\w-]+)['"]""")

app = typer.Typer(rich_markup_mode=None)


class CacheAction(StrEnum):
    """What `dhkit cache` does."""

    SHOW = "show"
    CLEAR = "clear"


@dataclass(frozen=True)
class Package:
    """A package that dhkit uses."""

    name: str
    wanted: str
    """Bounds of its version, such as ``>=2.0``."""
    extra: str
    """Extra that brings it; empty for the default installation."""
    version: str | None
    """None if it is not installed."""


@dataclass(frozen=True)
class Check:
    """A self-check: what was checked, and the outcome."""

    name: str
    outcome: str
    ok: bool
    seconds: float


@app.command()
def doctor(json: Json = False) -> ExitStatus:
    """Show versions, packages, extras and the cache, and check in seconds that the installation works."""
    packages = list(_packages())
    checks = [
        _check("kinematics and dynamics against Pinocchio", _verify),
        _check("inverse kinematics closes forward kinematics", _close),
        _check("Lagrange's equations proved", _prove),
    ]
    system = {
        "dhkit": __version__,
        "python": platform.python_version(),
        "system": platform.platform(),
    }
    ok = all(check.ok for check in checks)
    if json:
        cache = _cache()
        print_json(
            system
            | {"packages": [asdict(package) for package in packages]}
            | {"cache": cache, "checks": [asdict(check) for check in checks], "ok": ok}
        )
        return ExitStatus.FINE if ok else ExitStatus.NO
    say(f"dhkit {__version__}, Python {system['python']}, {system['system']}\n")
    for package in packages:
        state = package.version or "not installed"
        extra = f"extra {package.extra}" if package.extra else ""
        say(f"  {package.name:<24} {state:<16} {package.wanted:<14} {extra}".rstrip())
    say(f"\n{_cache_line()}\n")
    for check in checks:
        say(f"  {check.name:<46} {check.seconds:5.2f} s   {check.outcome}")
    return ExitStatus.FINE if ok else ExitStatus.NO


@app.command()
def cache(
    action: Annotated[CacheAction, typer.Argument(help="show or clear.")] = CacheAction.SHOW,
    json: Json = False,
) -> ExitStatus:
    """Show the folder of compiled kernels and its size, or clear it; kernels are compiled again when needed."""
    deleted = store.clear() if action is CacheAction.CLEAR else 0
    if json:
        print_json(_cache() | {"deleted": deleted})
    elif action is CacheAction.CLEAR:
        say(f"deleted {counted(deleted, 'kernel')}")
    else:
        say(_cache_line())
    return ExitStatus.FINE


def _packages() -> Iterator[Package]:
    """Yield the packages of the default installation and of the extras, as the installed metadata lists them."""
    try:
        requirements = requires(DISTRIBUTION) or []
    except PackageNotFoundError:  # run from a folder of sources
        return
    for requirement in requirements:
        parts = _REQUIREMENT.match(requirement)
        if parts is None:
            continue
        name, wanted, marker = parts.groups()
        extra = _EXTRA.search(marker or "")
        if extra is not None and extra[1] in HIDDEN_EXTRAS:
            continue
        try:
            installed: str | None = version(name)
        except PackageNotFoundError:
            installed = None
        yield Package(name, wanted.strip(), extra[1] if extra is not None else "", installed)


def _cache() -> dict[str, Any]:
    files = store.stored_kernels()
    size = sum(path.stat().st_size for path in files if path.exists())
    folder = store.cache_folder()
    return {"folder": None if folder is None else str(folder), "kernels": len(files), "bytes": size}


def _cache_line() -> str:
    cached = _cache()
    if cached["folder"] is None:
        return "compiled kernels are not kept: there is no folder that this user alone can write"
    megabytes = cached["bytes"] / 1e6
    return f"{counted(cached['kernels'], 'compiled kernel')}, {megabytes:.1f} MB, in {cached['folder']}"


def _check(name: str, work: Callable[[], str]) -> Check:
    """Run a self-check, which returns its outcome or raises an error."""
    start = time.perf_counter()
    try:
        outcome, ok = work(), True
    except MissingPackageError as error:
        outcome, ok = f"skipped: {error}", True
    except DhkitError as error:
        outcome, ok = f"FAILED: {error}", False
    return Check(name, outcome, ok, time.perf_counter() - start)


def _verify() -> str:
    report = Arm.load("puma560").verify(SAMPLES)
    if not report.ok:
        raise DhkitError("they disagree; `dhkit verify puma560` says where")
    return f"{len(report.agreements)} quantities agree in {SAMPLES} states"


def _close() -> str:
    arm = Arm.load("puma560")
    numbers = arm.description.numbers
    q = np.random.default_rng(0).uniform(numbers.lower, numbers.upper, (SAMPLES, arm.n))
    T = arm.fk(q)
    error = float(np.abs(arm.fk(arm.ik(T).q) - T[:, None]).max())
    if not error < TOLERANCE:
        raise DhkitError(f"a solution leads to another pose, by {error:.1e}")
    return f"all branches of {SAMPLES} poses, to {error:.0e}"


def _prove() -> str:
    return str(Arm.load("planar2r").lagrangian.prove_euler_lagrange())
