"""Memory of large results is used again once they are dropped, and only then."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import threading

import numpy as np
import pytest

from dhkit import Arm
from dhkit.kernels import large_arrays
from dhkit.kernels.large_arrays import large_array

SHAPE = (100_000, 4, 4)
"""12.8 MB."""

pytestmark = pytest.mark.skipif(not large_arrays._CAN_KEEP, reason="needs MADV_FREE")


@pytest.fixture(autouse=True)
def no_blocks_wait():
    gc.collect()
    large_arrays._kept.clear()
    yield
    large_arrays._kept.clear()


def place(array):
    return array.__array_interface__["data"][0]


def test_memory_of_a_dropped_array_is_used_again():
    first = large_array(SHAPE)
    assert first.flags.writeable and first.flags.c_contiguous and first.dtype == np.float64
    there = place(first)
    del first
    assert place(large_array(SHAPE)) == there


def test_memory_in_use_is_left_alone():
    first = large_array(SHAPE)
    first[:] = 1.0
    view = first[1::2, 0]
    del first
    second = large_array(SHAPE)
    second[:] = 2.0
    assert not np.shares_memory(view, second)
    assert (view == 1.0).all()


def test_buffers_and_pickles_hold_their_memory():
    first = large_array(SHAPE)
    first[:] = 3.0
    buffer = memoryview(first)
    del first
    large_array(SHAPE)[:] = 4.0
    assert (np.asarray(buffer) == 3.0).all()


def test_small_arrays_and_other_sizes_get_memory_of_their_own():
    large = large_array(SHAPE)
    there = place(large)
    del large
    assert place(large_array((10, 4, 4))) != there
    assert len(large_arrays._kept) == 1
    # A block of 12.8 MB is not held by a result of 5 MB.
    assert place(large_array((40_000, 4, 4))) != there


def test_kept_memory_is_bounded(monkeypatch):
    monkeypatch.setattr(large_arrays, "_MOST_KEPT", 30_000_000)
    arrays = [large_array(SHAPE) for _ in range(5)]
    arrays.clear()
    assert [len(block) for block in large_arrays._kept] == [12_800_000] * 2


def test_threads_never_share_memory():
    wrong = []

    def work(number):
        for _ in range(50):
            array = large_array((600_000,))
            array[:] = number
            if not (array == number).all():
                wrong.append(number)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def test_a_forked_child_has_memory_of_its_own():
    array = large_array(SHAPE)
    array[:] = 1.0
    child = os.fork()
    if child == 0:
        array[:] = 2.0
        os._exit(0)
    os.waitpid(child, 0)
    assert (array == 1.0).all()


def test_without_memory_maps_numpy_is_asked(monkeypatch):
    def refused(*_, **__):
        raise OSError(12, "Cannot allocate memory")

    monkeypatch.setattr(large_arrays.mmap, "mmap", refused)
    assert large_array(SHAPE).shape == SHAPE


def test_results_of_an_arm_are_new_arrays():
    arm = Arm.load("puma560")
    q = np.random.default_rng(0).uniform(-2, 2, (100_000, 6))
    first = arm.fk(q)
    second = arm.fk(q + 0.1)
    assert not np.shares_memory(first, second)
    assert np.array_equal(first[:100], arm.fk(q[:100]))
    there = place(first)
    del first
    assert place(arm.fk(q)) == there


def test_whoever_holds_the_base_alone_holds_the_memory():
    first = large_array(SHAPE)
    first[:] = 5.0
    base = first.base
    del first
    large_array(SHAPE)[:] = 6.0
    assert (np.asarray(base) == 5.0).all()
    assert not hasattr(base, "close")


def test_nothing_is_kept_where_addresses_are_bounded():
    code = (
        "import resource, numpy as np; from dhkit.kernels import large_arrays;"
        "resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30));"
        "x = large_arrays.large_array((4_000_000,)); del x; assert not large_arrays._kept"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
