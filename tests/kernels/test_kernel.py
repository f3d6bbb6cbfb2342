"""Kernels: the same results compiled and in NumPy, on one thread and several, from the disk and without one."""

import json
import logging
import os
import platform
import subprocess
import sys
from pathlib import Path

import casadi
import numpy as np
import pytest

from dhkit import Arm
from dhkit.description import library_robot, world_to_tool
from dhkit.kernels import kernel, store
from dhkit.kernels.kernel import SHARE
from dhkit.kinematics import forward_kinematics, inverse_kinematics, jacobian
from dhkit.symbolic import Graph
from random_arms import states

TWINS = 1e-14
"""What compiled code may differ by from NumPy: products fused into sums."""


def product_graph():
    a, x = casadi.SX.sym("a"), casadi.SX.sym("x", 3)
    y = casadi.if_else(x[0] > 0, a * x[1], casadi.sqrt(-x[0]))
    return Graph.of("product", {"a": a, "x": x}, {"y": y, "bits": casadi.if_else(x[2] > 1, 5.0, 2.0)})


def run_product(x, threads=1):
    y, bits = np.empty((len(x), 1)), np.empty((len(x), 1), dtype=np.uint8)
    kernel("test_product", "", product_graph, ("float64", "uint8"))(np.array([2.0]), [x], [y, bits], threads)
    return y[:, 0], bits[:, 0]


@pytest.mark.parametrize("off", [False, True])
@pytest.mark.parametrize("count", [0, 1, 7, 63, 64, 65, 200, 2 * SHARE + 5])
def test_a_kernel_computes_its_graph_for_any_number_of_items(count, off, monkeypatch):
    monkeypatch.setenv("DHKIT_KERNELS", "off" if off else "on")
    x = np.random.default_rng(count).normal(size=(count, 3))
    for threads in (1, 2, 5):
        y, bits = run_product(x, threads)
        with np.errstate(invalid="ignore"):
            assert np.array_equal(y, np.where(x[:, 0] > 0, 2.0 * x[:, 1], np.sqrt(-x[:, 0])))
        assert np.array_equal(bits, np.where(x[:, 2] > 1, 5, 2))


@pytest.mark.parametrize("name", ["puma560", "panda", "stanford", "al5d"])
def test_numpy_and_compiled_kernels_give_the_same(name, monkeypatch):
    arm = library_robot(name)
    q = states(arm, 300)
    q[17, 1] = np.nan
    compiled = [forward_kinematics(arm, q), jacobian(arm, q)]
    monkeypatch.setenv("DHKIT_KERNELS", "off")
    for ours, twin in zip(compiled, [forward_kinematics(arm, q), jacobian(arm, q)], strict=True):
        assert np.array_equal(np.isnan(ours), np.isnan(twin))
        assert np.nanmax(np.abs(ours - twin)) < TWINS


@pytest.mark.parametrize("name", ["puma560", "ur5", "stanford", "cobra600", "al5d", "ax12_arm"])
def test_numpy_and_compiled_inverse_kinematics_give_the_same(name, monkeypatch):
    arm = library_robot(name)
    T = world_to_tool(arm, states(arm, 300))
    T[3, 0, 0], T[4, :3, 3] = np.nan, 1e3
    ours = inverse_kinematics(arm, T)
    monkeypatch.setenv("DHKIT_KERNELS", "off")
    twin = inverse_kinematics(arm, T)
    for key in ("valid", "flags", "status_code"):
        assert np.array_equal(getattr(ours, key), getattr(twin, key)), key
    assert np.nanmax(np.abs(np.angle(np.exp(1j * (ours.q - twin.q))))) < 1e-9  # near singularities roundings grow


def test_memory_beyond_results_is_one_block():
    """Scratch space does not grow with the batch: that of inverse kinematics fits the first cache."""
    from dhkit.kernels.source import BLOCK

    assert BLOCK * 8 * (17 + 48 + 18) < 48 * 1024


def in_new_process(code, folder, **environment):
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env={**os.environ, "DHKIT_CACHE_DIR": str(folder), **environment},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done


CALL = """
import logging, sys
logging.basicConfig(level=logging.INFO, format="%(name)s %(message)s", stream=sys.stderr)
import dhkit, numpy as np
T = dhkit.Arm.load("planar2r").fk(np.zeros((10, 2)))
assert abs(T[0, 0, 3] - 1.0) < 1, T
print("casadi" in sys.modules)
"""


def test_the_second_process_neither_derives_nor_compiles(tmp_path):
    first = in_new_process(CALL, tmp_path)
    assert first.stderr.count("compiling forward_kinematics for the first time") == 1
    assert first.stdout.strip() == "True"
    second = in_new_process(CALL, tmp_path)
    assert "compiling" not in second.stderr
    assert second.stdout.strip() == "False"
    assert (tmp_path / "kernels").stat().st_mode & 0o777 == 0o700


def test_a_damaged_cache_is_compiled_around(tmp_path):
    in_new_process(CALL, tmp_path)
    for path in (tmp_path / "kernels").rglob("*.nb?"):
        path.write_bytes(b"damaged")
    damaged = in_new_process(CALL, tmp_path)
    assert "unusable" in damaged.stderr or "compiling" in damaged.stderr
    for path in (tmp_path / "kernels").glob("*.py"):
        path.write_text("this is not Python")
    in_new_process(CALL, tmp_path)
    in_new_process(CALL, tmp_path)


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_a_folder_that_others_can_write_is_not_used(tmp_path, monkeypatch, caplog):
    (tmp_path / "kernels").mkdir(mode=0o700)
    (tmp_path / "kernels").chmod(0o777)
    monkeypatch.setenv("DHKIT_CACHE_DIR", str(tmp_path))
    assert store.cache_folder() is None
    assert "can be written by other users" in caplog.text


def test_an_unwritable_home_means_memory_only(tmp_path):
    (tmp_path / "file").write_text("")
    done = in_new_process(CALL, tmp_path / "file")
    assert "compiling forward_kinematics" in done.stderr


def test_switched_off_nothing_is_compiled(tmp_path):
    done = in_new_process(CALL + "print('numba' in sys.modules)", tmp_path, DHKIT_KERNELS="off")
    assert done.stdout.split() == ["True", "False"]
    assert not list(Path(tmp_path).rglob("*"))


def test_arms_of_one_pattern_share_a_kernel(caplog):
    caplog.set_level(logging.INFO)
    arm = Arm.from_dh([(0, 0.3, 0.2, "pi/2"), (0, 0, 0.4, 0)])
    arm.fk([0.1, 0.2])
    caplog.clear()
    longer = Arm.from_dh([(0, 0.5, 0.1, "pi/2"), (0, 0, 0.7, 0)])
    assert np.abs(longer.fk([0.1, 0.2]) - world_to_tool(longer.description, [0.1, 0.2])).max() < 1e-15
    assert "compiling" not in caplog.text


@pytest.mark.parametrize("left", ["", "half"])
def test_a_kernel_that_was_not_written_to_its_end_is_written_again(tmp_path, left):
    in_new_process(CALL, tmp_path)
    (path,) = (tmp_path / "kernels").glob("forward_kinematics_*.py")
    whole = path.read_text()
    path.write_text(whole[: len(whole) // 2] if left else "")
    in_new_process(CALL, tmp_path)
    assert path.read_text() == whole


FORK = """
import multiprocessing, threading, time
import numpy as np
from dhkit import Arm
from dhkit.kernels import kernel as kernels
def child():
    T = Arm.load("planar2r").fk([0.1, 0.2])
    raise SystemExit(0 if np.isfinite(T).all() else 3)
module = __import__("sys").modules["dhkit.kernels.kernel"]
held = threading.Event()
def hold():
    with module._lock:
        held.set()
        time.sleep(30)
threading.Thread(target=hold, daemon=True).start()
held.wait()
process = multiprocessing.get_context("fork").Process(target=child)
process.start()
process.join(60)
print(process.exitcode)
__import__("os")._exit(0)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="fork of POSIX")
def test_a_fork_while_another_thread_compiles_does_not_hang(tmp_path):
    assert in_new_process(FORK, tmp_path).stdout.strip() == "0"


@pytest.mark.skipif(platform.machine() != "x86_64", reason="names a processor of that kind")
def test_a_processor_without_wide_registers_computes_the_same(tmp_path):
    code = "import dhkit; print(dhkit.Arm.load('puma560').fk([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])[:3].tolist())"
    plain = in_new_process(code, tmp_path, NUMBA_CPU_NAME="x86-64", NUMBA_CPU_FEATURES="")
    T = Arm.load("puma560").fk([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])[:3]
    assert np.abs(np.array(json.loads(plain.stdout)) - T).max() < TWINS
