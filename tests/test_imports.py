"""`import dhkit` is light, and everything but the reference path works without Pinocchio."""

import subprocess
import sys
import time

import pytest

HEAVY = (
    "numpy",
    "scipy",
    "pinocchio",
    "pydantic",
    "meshcat",
    "matplotlib",
    "trimesh",
    "tornado",
    "typer",
    "rich",
    "tomlkit",
)

WITHOUT_PINOCCHIO = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("pinocchio", "coal", "hppfcl"):
            raise ImportError(f"{name} is blocked")

sys.meta_path.insert(0, Blocked())
import importlib, pkgutil
import numpy as np
import pytest
import dhkit

for module in pkgutil.walk_packages(dhkit.__path__, "dhkit."):
    importlib.import_module(module.name)
for name in dhkit.robots():
    arm = dhkit.Arm.load(name)
    arm.fk(np.zeros(arm.n)), arm.jacobian(np.zeros(arm.n)), arm.urdf()
dhkit.plot(arm.description)
for call in (lambda: arm.model, lambda: arm.verify(1)):
    try:
        call()
    except dhkit.ModelError as error:
        assert "pip install pin" in str(error)
    else:
        raise AssertionError("worked without Pinocchio")
"""


def run(code):
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=False
    )


def test_importing_dhkit_imports_nothing_heavy():
    done = run(f"import sys, dhkit; print([m for m in {HEAVY!r} if m in sys.modules])")
    assert done.stdout.strip() == "[]", done


def test_kinematics_import_no_scipy():
    done = run(
        "import sys, dhkit, numpy; arm = dhkit.Arm.load('jaco'); arm.ik(arm.fk(numpy.ones(6)));"
        "print([name for name in sys.modules if name.startswith('scipy')])"
    )
    assert done.stdout.strip() == "[]", done


def test_the_lab_is_imported_when_it_is_first_used():
    done = run(
        "import sys, dhkit; before = 'dhkit.lab' in sys.modules;"
        "print(before, dhkit.lab.serve.__name__, 'tornado' in sys.modules)"
    )
    assert done.stdout.split() == ["False", "serve", "False"], done


@pytest.mark.parametrize(
    ("package", "function", "module"),
    [
        ("dhkit.symbolic", "equations_latex", "dhkit.symbolic.equations.latex"),
        ("dhkit.symbolic", "readable", "dhkit.symbolic.equations.quantities"),
        ("dhkit.control", "load_result", "dhkit.control.result_files"),
    ],
)
def test_values_are_printed_and_saved_by_modules_imported_on_first_use(package, function, module):
    done = run(
        f"import sys, {package}; from dhkit.formats import format_function;"
        f"print({module!r} in sys.modules, format_function({function!r}).__module__)"
    )
    assert done.stdout.split() == ["False", module], done


def test_importing_dhkit_takes_no_time(law):
    seconds = []
    for _ in range(max(3, law.samples(20))):
        start = time.perf_counter()
        run("pass")
        bare = time.perf_counter()
        run("import dhkit")
        seconds.append((time.perf_counter() - bare) - (bare - start))
    law.takes("seconds that import dhkit takes", sorted(seconds)[len(seconds) // 2], 0.3)


@pytest.mark.slow
def test_everything_but_the_reference_works_without_pinocchio():
    done = run(WITHOUT_PINOCCHIO)
    assert done.returncode == 0, done.stderr
