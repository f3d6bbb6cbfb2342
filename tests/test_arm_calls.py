"""Single calls of an arm's methods: compiled functions that give the ordinary way's values and exceptions."""

import copy
import dataclasses
import gc
import os
import pickle
import resource
import signal
import subprocess
import sys
import threading
import types
import warnings
from functools import cache, partial

import numpy as np
import pytest
from hypothesis import given, settings

import acceptance
from acceptance import DIFFERENT_ROBOTS, only_accepting, slow_if
from dhkit import Arm, dynamics, kinematics
from dhkit.kernels import single_calls
from dhkit.kernels.call_source import MAX_IN_LANES, MAX_ITEMS
from dhkit.kinematics.programs import kinematic_kernels
from random_arms import arms, tables

STATES = {
    "fk": 1,
    "frames": 1,
    "jacobian": 1,
    "jacobian_dot": 2,
    "mass_matrix": 1,
    "coriolis_matrix": 2,
    "gravity_torque": 1,
    "bias": 2,
    "inverse_dynamics": 3,
    "forward_dynamics": 3,
    "regressor": 3,
    "inverse_dynamics_derivatives": 3,
    "forward_dynamics_derivatives": 3,
}
"""Methods by name, and how many joint vectors they take."""


def ordinary(method):
    """Return the function behind a method of Arm, with derivatives as one array."""
    if method == "fk":
        return kinematics.forward_kinematics
    function = getattr(kinematics, method, None) or getattr(dynamics, method)
    return partial(in_one_array, function) if method.endswith("derivatives") else function


def in_one_array(function, *arguments, **options):
    return np.stack(function(*arguments, **options), axis=-3)


def stacked(function, *arguments):
    """Return a fast function's result, with derivatives as one array."""
    found = function(*arguments)
    return np.stack(found, axis=-3) if isinstance(found, tuple) else found


def called(arm, method):
    """Return a method of an arm, with derivatives as one array."""
    function = getattr(arm, method)
    return partial(in_one_array, function) if method.endswith("derivatives") else function


def compiled(arm):
    for _ in arm._calls.compile():
        pass
    return arm


@cache
def compiled_robot(name):
    return compiled(Arm.load(name))


@pytest.fixture(scope="module")
def puma():
    return compiled_robot("puma560")


def is_builtin(function):
    return isinstance(function, types.BuiltinFunctionType)


@pytest.mark.parametrize(
    "name", [slow_if(name in ("panda", "stanford"), name) for name in DIFFERENT_ROBOTS]
)
def test_values_are_those_of_the_ordinary_way(name, law):
    arm = compiled_robot(name)
    rng = np.random.default_rng(0)
    for method, count in STATES.items():
        fast = getattr(arm._calls, method)
        if fast is single_calls.never:
            assert not all(joint.bodies for joint in arm.description.joints)
            continue
        fast = partial(stacked, fast)
        for items in (None, 1, 2, 7, MAX_ITEMS, MAX_IN_LANES):
            shape = (arm.n,) if items is None else (items, arm.n)
            for _ in range(law.samples(200, quick=3)):
                states = rng.normal(scale=rng.choice([1e-3, 1.0, 100.0]), size=(count, *shape))
                expected = ordinary(method)(arm, *states)
                found = fast(*states, None)
                if found is None:
                    assert items == MAX_IN_LANES and expected.nbytes > 4 << 20
                    continue
                assert found is not None and found.shape == expected.shape
                assert found.flags.c_contiguous
                scale = np.abs(expected).max(initial=1.0)
                law.holds(method, np.abs(found - expected).max() / scale, 1e-11)
                out = np.empty_like(expected)
                filled = fast(*states, out)
                assert method.endswith("derivatives") or filled is out
                assert np.array_equal(out, found)


@settings(max_examples=acceptance.sample_size(100, quick=3))
@given(arms())
def test_random_arms(description):
    arm = compiled(Arm(description))
    q, qd, qdd = np.random.default_rng(1).normal(size=(3, arm.n))
    for method, count in STATES.items():
        states = (q, qd, qdd)[:count]
        expected = ordinary(method)(arm, *states)
        found = stacked(getattr(arm._calls, method), *states, None)
        if found is None:
            assert method == "forward_dynamics" and not np.isfinite(expected).all()
        else:
            scale = np.abs(expected).max(initial=1.0)
            assert np.allclose(found, expected, rtol=0, atol=1e-8 * scale), method


@settings(max_examples=3)
@given(tables())
def test_arms_without_bodies_say_so_as_before(description):
    arm = compiled(Arm(description))
    q = np.zeros(arm.n)
    assert is_builtin(arm._calls.fk)
    assert_same(outcome(arm.mass_matrix, q), outcome(dynamics.mass_matrix, arm, q))


class Subclass(np.ndarray):
    pass


def unusual(rng, n, tmp_path):
    """Yield joint vectors as callers may have them: types, layouts, classes, sizes and values."""
    q = rng.normal(size=n)
    yield q.tolist()
    yield tuple(q)
    yield q.astype(np.float32)
    yield q.astype(np.longdouble)
    yield np.ones(n, dtype=int)
    yield np.ones(n, dtype=bool)
    yield q.astype(complex)
    yield q.astype(object)
    yield q.astype(">f8")
    yield q.astype(str)
    yield np.array([None] * n)
    yield np.repeat(q, 2)[::2]
    yield q[::-1]
    yield np.broadcast_to(q[:1], (n,))
    yield np.broadcast_to(q, (3, n))
    yield np.asfortranarray(rng.normal(size=(3, n)))
    yield rng.normal(size=(3, 2 * n))[:, ::2]
    yield q.view(Subclass)
    yield np.matrix(q)
    yield np.ma.masked_array(q, mask=[True] + [False] * (n - 1))
    kept = np.memmap(tmp_path / "states", dtype=float, mode="w+", shape=(n,))
    kept[:] = q
    yield kept
    still = q.copy()
    still.flags.writeable = False
    yield still
    unaligned = np.zeros(8 * n + 1, dtype=np.uint8)[1:].view(float)
    yield unaligned
    for shape in (
        (),
        (0,),
        (n - 1,),
        (n + 1,),
        (0, n),
        (1, n),
        (MAX_ITEMS + 1, n),
        (MAX_IN_LANES + 1, n),
        (2, 3, n),
    ):
        yield rng.normal(size=shape)
    for value in (np.nan, np.inf, -np.inf, 1e6, np.nextafter(1e6, 2e6), 1e300, 5e-324, -0.0):
        with_value = q.copy()
        with_value[-1] = value
        yield with_value
    yield "ready"
    yield "nonsense"
    yield ["ready", "zero"]
    yield None
    yield {}
    yield 3.0
    yield np.datetime64("2020-01-01")


def outcome(function, *arguments, **options):
    """Return a call's value, or its exception's type and text."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return function(*arguments, **options)
    except Exception as error:
        return type(error), str(error)


def assert_same(found, expected):
    if isinstance(expected, tuple):
        assert found == expected
    else:
        assert type(found) is type(expected) and found.shape == expected.shape
        scale = np.nan_to_num(np.abs(expected), posinf=1.0).max(initial=1.0)
        assert np.allclose(found, expected, rtol=1e-9, atol=1e-9 * scale, equal_nan=True)


@pytest.mark.filterwarnings("ignore:the matrix subclass")
def test_unusual_arguments_give_the_same_values_and_exceptions(puma, tmp_path, law):
    for seed in range(law.samples(1000, quick=1)):
        rng = np.random.default_rng(seed)
        plain = rng.normal(size=puma.n)
        for method, count in STATES.items():
            for place in range(count):
                for value in unusual(rng, puma.n, tmp_path):
                    states = [plain] * count
                    states[place] = value
                    found = outcome(called(puma, method), *states)
                    assert_same(found, outcome(ordinary(method), puma, *states))


def test_unusual_results_give_the_same_values_and_exceptions(puma, law):
    rng = np.random.default_rng(2)
    for method, count in STATES.items():
        for items in (None, 5):
            shape = (puma.n,) if items is None else (items, puma.n)
            states = rng.normal(size=(count, *shape))
            result = ordinary(method)(puma, *states)
            still = np.empty_like(result)
            still.flags.writeable = False
            for out in (
                still,
                np.empty((*result.shape, 2))[..., 0],
                np.empty(result.shape, dtype=np.float32),
                np.empty(result.shape, dtype=">f8"),
                np.empty(result.shape).view(Subclass),
                np.empty((1, *result.shape)),
                np.empty(result.shape[1:]),
                np.empty(result.size + 1),
                np.broadcast_to(np.empty(1), result.shape),
                np.asfortranarray(np.empty((*result.shape, 2)))[..., 0],
                [],
                "out",
            ):
                found = outcome(called(puma, method), *states, out=out)
                assert_same(found, outcome(ordinary(method), puma, *states, out=out))
            assert_same(
                outcome(called(puma, method), *states, threads=0),
                outcome(ordinary(method), puma, *states, threads=0),
            )


def test_a_result_may_lie_where_an_input_lies(puma):
    rng = np.random.default_rng(3)
    for items in (None, 9):
        size = 1 if items is None else items
        for method, count in STATES.items():
            shape = (puma.n,) if items is None else (items, puma.n)
            states = rng.normal(size=(count, *shape))
            expected = ordinary(method)(puma, *states)
            for place in range(count):
                for shift in (0, 1, puma.n):
                    # One block of memory holds the input at ``shift`` and the result at its start.
                    memory = np.zeros(shift + expected.size + size * puma.n)
                    own = list(states)
                    own[place] = memory[shift : shift + states[place].size].reshape(shape)
                    own[place][...] = states[place]
                    out = memory[: expected.size].reshape(expected.shape)
                    getattr(puma, method)(*own, out=out)
                    assert np.allclose(out, expected, rtol=1e-9, atol=1e-9), (method, shift)


def test_states_that_are_missing_in_a_batch_are_missing_in_the_result_alone(puma):
    rng = np.random.default_rng(4)
    for items in (5, 9, 100):
        for method, count in STATES.items():
            states = rng.normal(size=(count, items, puma.n))
            states[-1, items // 2, 2] = np.nan
            assert_same(
                called(puma, method)(*states),
                ordinary(method)(puma, *states),
            )
            rest = np.delete(states, items // 2, axis=1)
            found = np.delete(called(puma, method)(*states), items // 2, axis=0)
            assert np.array_equal(found, called(puma, method)(*rest)), method


@pytest.mark.parametrize(
    "name",
    [slow_if(name != "planar2r", name) for name in ("planar2r", "puma560", "stanford", "panda")],
)
def test_a_state_gets_the_same_bits_alone_and_in_a_compiled_batch(name):
    arm = compiled_robot(name)
    for kernel in [*kinematic_kernels(arm.description), *dynamics.dynamic_kernels(arm)]:
        kernel.compile()
    states = np.random.default_rng(8).uniform(-3, 3, (3, 70, arm.n))
    for method, count in STATES.items():
        batch = ordinary(method)(arm, *states[:count])
        for k in range(0, 70, 7):
            assert np.array_equal(called(arm, method)(*states[:count, k]), batch[k]), method


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers of POSIX")
def test_a_signal_handler_that_calls_the_same_function_changes_nothing(puma):
    q = np.linspace(0.1, 0.6, 6)
    T = puma.fk(q)
    seen = []

    def handler(*_):
        seen.append((puma.fk(-2 * q), puma.ik(T).q))

    before = signal.signal(signal.SIGALRM, handler)
    try:
        while len(seen) < 300:
            if signal.getitimer(signal.ITIMER_REAL)[0] == 0:
                signal.setitimer(signal.ITIMER_REAL, 2e-4)
            assert np.array_equal(puma.fk(q), T)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert all(np.array_equal(a, seen[0][0]) and np.array_equal(b, seen[0][1]) for a, b in seen)


def test_a_missing_acceleration_is_explained_by_the_ordinary_way(caplog):
    arm = compiled_robot("puma560")
    q = np.full(6, np.nan)
    assert arm._calls.forward_dynamics(q, q, q, None) is None
    out = np.ones(6)
    assert arm._calls.forward_dynamics(q, q, q, out) is None and (out == 1.0).all()
    assert np.isnan(arm.forward_dynamics(q, q, q)).all()


def test_a_quantity_is_compiled_after_some_calls_and_never_in_the_callers_way():
    arm = Arm.load("planar2r")
    q = np.zeros(2)
    before = arm.fk(q)
    if not is_builtin(arm._calls.fk):
        for _ in range(single_calls.CALLS_BEFORE_COMPILING):
            arm.fk(q)
        for thread in threading.enumerate():
            if thread.name == "compile forward_kinematics":
                thread.join()
    assert is_builtin(arm._calls.fk)
    assert np.allclose(arm.fk(q), before, rtol=0, atol=1e-15)


def test_copies_and_pickles_of_an_arm_have_functions_of_their_own(puma):
    q = np.linspace(-1, 1, 6)
    for twin in (copy.copy(puma), copy.deepcopy(puma), pickle.loads(pickle.dumps(puma))):
        assert twin == puma and np.allclose(twin.fk(q), puma.fk(q), rtol=0, atol=1e-15)


def test_a_function_outlives_its_arm():
    arm = compiled(Arm.load("planar2r"))
    q = np.array([0.1, 0.2])
    expected = arm.fk(q)
    function = arm._calls.fk
    del arm
    gc.collect()
    filler = [np.zeros(64) for _ in range(1000)]
    assert np.array_equal(function(q, None), expected) and filler


def test_threads_share_a_function(puma):
    q = np.random.default_rng(5).normal(size=(8, 500, 6))
    expected = [[puma.fk(state) for state in states] for states in q]
    found = [None] * 8

    batches = [None] * 8

    def work(k):
        found[k] = [puma.fk(state) for state in q[k]]
        batches[k] = puma.fk(q[k])

    threads = [threading.Thread(target=work, args=(k,)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert np.array_equal(found, expected)
    assert np.allclose(batches, expected, rtol=0, atol=1e-14)


def test_calls_leave_no_memory_behind(puma, law):
    q, qd, qdd = np.random.default_rng(6).normal(size=(3, 6))
    out = np.empty((4, 4))
    missing = np.full(6, np.nan)
    references = [sys.getrefcount(x) for x in (None, q, out, missing, np.ndarray)]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(law.samples(25_000_000, quick=50_000)):
        puma.fk(q)
        puma.fk(q, out)
        puma.inverse_dynamics(q, qd, qdd)
        puma._calls.forward_dynamics(missing, qd, qdd, None)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown < 4_000, f"{grown} KB"
    after = [sys.getrefcount(x) for x in (None, q, out, missing, np.ndarray)]
    assert np.abs(np.subtract(after, references)).max() < 100


NEW_PROCESS = """
import os, sys, threading
import numpy as np
from dhkit import Arm
arm = Arm.load("planar2r")
q = np.array([0.1, 0.2])
for _ in range(300):
    arm.fk(q)
{then}
"""


def in_new_process(then, **environment):
    return subprocess.run(
        [sys.executable, "-c", NEW_PROCESS.format(then=then)],
        capture_output=True,
        text=True,
        env={**os.environ, **environment},
        check=False,
        timeout=120,
    )


def test_a_process_that_ends_while_it_compiles_ends_well(tmp_path):
    done = in_new_process("", DHKIT_CACHE_DIR=str(tmp_path))
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("mode", "kind"), [("on", "builtin_function_or_method"), ("off", "function")]
)
def test_kernels_on_compiles_at_once_and_off_never(mode, kind):
    done = in_new_process("print(type(arm._calls.fk).__name__)", DHKIT_KERNELS=mode)
    assert (done.returncode, done.stdout.strip()) == (0, kind), done.stderr


def test_a_forked_process_compiles_for_itself(tmp_path):
    done = in_new_process(
        "pid = os.fork()\n"
        "for _ in range(300): arm.fk(q); arm.mass_matrix(q)\n"
        "for t in threading.enumerate():\n"
        "    if t is not threading.current_thread(): t.join()\n"
        "if pid: assert os.waitpid(pid, 0)[1] == 0\n"  # the child prints first: two prints at once mix their lines
        "print(type(arm._calls.mass_matrix).__name__, flush=True)\n",
        DHKIT_CACHE_DIR=str(tmp_path),
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == ["builtin_function_or_method"] * 2


def test_calls_of_several_states_need_little_stack(tmp_path):
    done = in_new_process(
        "arm = Arm.load('panda')\n"
        "arm.regressor(*np.zeros((3, 4, 7)))\n"
        "threading.stack_size(48 * 1024)\n"
        "thread = threading.Thread(target=arm.regressor, args=np.zeros((3, 4, 7)))\n"
        "thread.start()\n"
        "thread.join()\n",
        DHKIT_KERNELS="on",
        DHKIT_CACHE_DIR=str(tmp_path),
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_objects_that_lie_elsewhere_in_memory_are_not_read(monkeypatch):
    monkeypatch.setattr(single_calls, "FLAGS_OFFSET", single_calls.FLAGS_OFFSET + 8)
    assert not single_calls._has_known_layout()


@only_accepting
def test_the_debug_allocator_finds_no_bad_access(tmp_path):
    """Run with Python's debug allocator, which fills freed memory and checks the borders of blocks."""
    done = in_new_process(
        "for _ in range(100_000): arm.fk(q); arm.fk(q, np.empty((4, 4)))",
        PYTHONMALLOC="debug",
        DHKIT_KERNELS="on",
        DHKIT_CACHE_DIR=str(tmp_path),
    )
    assert (done.returncode, done.stderr) == (0, "")


# Inverse kinematics

FIELDS = ("q", "distance", "valid", "flags", "status_code")
CLOSED_FORMS = ("puma560", "ur5", "stanford", "irb140", "cobra600", "planar2r")


def poses(arm, rng, count):
    """Yield poses inside and beyond the workspace, singular ones, and matrices that are not poses."""
    for q in rng.uniform(-3, 3, (count, arm.n)):
        T = arm.fk(q)
        yield T
        yield arm.fk(np.where(rng.random(arm.n) < 0.5, 0.0, q))
        far = T.copy()
        far[:3, 3] *= rng.choice([1.5, 10.0, 1e200])
        yield far
        for change in (np.nan, np.inf, 1e-9, 1e-5, 1.0):
            wrong = T.copy()
            wrong[rng.integers(4), rng.integers(4)] += change
            yield wrong


@pytest.mark.parametrize(
    "name", [slow_if(name in ("ur5", "irb140"), name) for name in CLOSED_FORMS]
)
def test_the_solutions_of_one_pose_are_those_of_the_ordinary_way(name, law):
    arm = compiled_robot(name)
    rng = np.random.default_rng(7)
    taken = 0
    for T in poses(arm, rng, law.samples(2000, quick=20)):
        expected = kinematics.inverse_kinematics(arm, T)
        found = arm.ik(T)
        taken += "_packed" in vars(found)
        if np.array_equal(found.flags, expected.flags):
            for field in FIELDS:
                one = getattr(found, field)
                other = getattr(expected, field)
                assert (one.shape, one.dtype) == (other.shape, other.dtype)
                assert not one.ndim or one.flags.writeable
                largest = np.nan_to_num(np.abs(other.astype(float)), posinf=1.0).max(initial=1.0)
                assert np.allclose(one, other, rtol=0, atol=1e-7 * largest, equal_nan=True), field
            assert repr(found) == repr(expected)
        else:
            # At a boundary of singularity or limits, sines that differ in the last bit decide otherwise.
            law.holds("decided otherwise", np.abs(found.flags - 1.0 * expected.flags).max(), 31)
        assert found.branches == expected.branches and found.complete
    assert taken > 20


@pytest.mark.parametrize(
    "name", [slow_if(name in ("ur5", "irb140"), name) for name in CLOSED_FORMS]
)
def test_the_solutions_of_few_poses_are_those_of_each(name):
    arm = compiled_robot(name)
    T = arm.fk(np.random.default_rng(9).uniform(-1, 1, (7, arm.n)))
    few = arm.ik(T)
    assert "_packed" in vars(few)
    out = np.empty_like(few.q)
    assert arm.ik(T, out=out).q is out and np.array_equal(out, few.q, equal_nan=True)
    for k, pose in enumerate(T):
        one = arm.ik(pose)
        for field in FIELDS:
            assert np.array_equal(getattr(few, field)[k], getattr(one, field), equal_nan=True)


def test_the_solutions_at_a_redundancy_are_those_of_the_ordinary_way(law):
    arm = compiled_robot("panda")
    rng = np.random.default_rng(7)
    taken = 0
    for T in poses(arm, rng, law.samples(2000, quick=40)):
        redundancy = float(rng.uniform(-3.0, 3.0))
        expected = kinematics.inverse_kinematics(arm, T, redundancy=redundancy)
        found = arm.ik(T, redundancy=redundancy)
        taken += "_packed" in vars(found)
        assert not found.complete and found.branches == expected.branches
        assert np.array_equal(found.redundancy, expected.redundancy)
        for field in ("q", "distance"):
            one = getattr(found, field)
            other = getattr(expected, field)
            assert np.allclose(one, other, rtol=0, atol=1e-7, equal_nan=True), field
        assert np.array_equal(found.status, expected.status)
    assert taken > 20
    with pytest.raises(ValueError, match="redundancy is not finite"):
        arm.ik(arm.fk("ready"), redundancy=float("nan"))
    with pytest.raises(TypeError, match="redundancy: found 'much'"):
        arm.ik(arm.fk("ready"), redundancy="much")


def test_solutions_of_one_pose_are_copied_pickled_and_replaced(puma):
    T = puma.fk(np.linspace(-1, 1, 6))
    expected = puma.ik(T).valid
    assert np.array_equal(pickle.loads(pickle.dumps(puma.ik(T))).valid, expected)
    assert np.array_equal(copy.deepcopy(puma.ik(T)).valid, expected)
    replaced = dataclasses.replace(puma.ik(T), q=np.zeros((8, 6)))
    assert np.array_equal(replaced.valid, expected) and not replaced.q.any()
    with pytest.raises(AttributeError, match="'IKSolutions' object has no attribute 'validity'"):
        _ = puma.ik(T).validity


def test_unusual_poses_give_the_same_values_and_exceptions(puma, tmp_path):
    T = puma.fk(np.linspace(-1, 1, 6))
    flat = np.zeros(33)[1:]
    flat[::2] = T.ravel()
    for value in (
        T.tolist(),
        T.astype(np.float32),
        T.astype(">f8"),
        np.asfortranarray(T),
        flat[::2].reshape(4, 4),
        T.view(Subclass),
        T[None],
        np.array([T, T]),
        np.array([T] * (MAX_ITEMS + 1)),
        np.zeros((0, 4, 4)),
        np.array([[T, T]]),
        T[:3],
        T.ravel(),
        np.eye(3),
        None,
        "ready",
        np.ma.masked_array(T),
    ):
        found = outcome(puma.ik, value)
        expected = outcome(kinematics.inverse_kinematics, puma, value)
        if isinstance(expected, tuple):
            assert found == expected
        else:
            assert np.allclose(found.q, expected.q, rtol=0, atol=1e-9, equal_nan=True)
            assert np.array_equal(found.valid, expected.valid)
    for out in (np.empty((8, 6)), np.empty((6, 8)), np.empty((8, 6), order="F"), [], T):
        found = outcome(puma.ik, T.copy(), out=out)
        expected = outcome(kinematics.inverse_kinematics, puma, T.copy(), out=out)
        if isinstance(expected, tuple):
            assert found == expected
        else:
            assert found.q is out


# Numeric inverse kinematics


@pytest.mark.parametrize("name", ["panda", "puma560", "cobra600", "stanford", "planar3r"])
def test_one_pose_is_solved_as_the_ordinary_way_solves_it(name, law):
    arm = compiled_robot(name)
    numbers = arm.description.numbers
    rng = np.random.default_rng(10)
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -np.pi)
    upper = np.where(np.isfinite(numbers.upper), numbers.upper, np.pi)
    taken = 0
    different = 0
    count = law.samples(500, quick=20)
    for q in rng.uniform(lower, upper, (count, arm.n)):
        T = arm.fk(q)
        for q0 in (None, q + 0.05, q + 7.0):
            found = arm.ik_numeric(T, q0)
            expected = kinematics.solve_numerically(arm, T, q0)
            assert (found.status, found.branches) == (expected.status, expected.branches)
            taken += "_packed" in vars(found)
            for field in FIELDS:
                one, other = getattr(found, field), getattr(expected, field)
                assert (one.shape, one.dtype) == (other.shape, other.dtype)
            if found.valid.all():
                assert np.abs(arm.fk(found.q[0]) - T).max() < 1e-11
                assert ((found.q >= numbers.lower) & (found.q <= numbers.upper)).all()
                different += not np.allclose(found.q, expected.q, rtol=0, atol=1e-6)
    assert taken > count
    # A search that the last bits decide may end at another solution.
    law.holds("share of other solutions", different / (3 * count), 0.05)


def test_poses_that_are_not_found_are_told_by_the_ordinary_way(puma):
    T = puma.fk(np.linspace(-1, 1, 6))
    far = T.copy()
    far[0, 3] = 50.0
    wrong = T.copy()
    wrong[:3, :3] *= 1.001
    for pose in (far, wrong, np.full((4, 4), np.nan), T.tolist(), T[None], T.astype(np.float32)):
        found = outcome(puma.ik_numeric, pose)
        expected = outcome(kinematics.solve_numerically, puma, pose)
        assert np.array_equal(found.status, expected.status)
        assert np.allclose(found.q, expected.q, rtol=0, atol=1e-6, equal_nan=True)
    for q0 in ([0.0] * 6, np.full(6, np.nan), np.zeros(5), "ready", np.zeros((2, 6))):
        found = outcome(puma.ik_numeric, T, q0)
        expected = outcome(kinematics.solve_numerically, puma, T, q0)
        if isinstance(expected, tuple):
            assert found == expected
        else:
            assert np.allclose(found.q, expected.q, rtol=0, atol=1e-6)
    for options in ({"tolerance": -1.0}, {"tolerance": np.nan}, {"seed": -1}, {"restarts": -1}):
        found = outcome(puma.ik_numeric, T, **options)
        assert found == outcome(kinematics.solve_numerically, puma, T, **options)


def test_few_poses_are_solved_as_the_ordinary_way_solves_them(puma):
    numbers = puma.description.numbers
    q = np.random.default_rng(11).uniform(numbers.lower, numbers.upper, (20, 6))
    T = puma.fk(q)
    for q0 in (None, np.zeros(6), q + 0.05):
        found = puma.ik_numeric(T, q0)
        expected = kinematics.solve_numerically(puma, T, q0)
        assert "_packed" in vars(found)
        for field in FIELDS:
            one, other = getattr(found, field), getattr(expected, field)
            assert (one.shape, one.dtype) == (other.shape, other.dtype)
        assert np.allclose(found.q, expected.q, rtol=0, atol=1e-6)
        assert np.array_equal(found.status, expected.status)
    some = T.copy()
    some[3, 0, 3] = 50.0
    assert puma.ik_numeric(some).status[3] == "out_of_reach"


# Found by an adversary

FREED = """
import ctypes, gc
class Filler:
    def __del__(self):
        global held
        held = [ctypes.create_string_buffer(b"\\xff" * 32, 32) for _ in range(20000)]
class Ring: pass
own = type("Own", (Arm,), {{}}).load("planar2r")
own.__dict__["own"] = own
own._calls._single_call("fk").compile()
ring = Ring(); ring.ring = ring; ring.filler = np.array([Filler(), None], object)
gc.freeze(); gc.unfreeze(); del own, ring; gc.collect()
"""


def test_the_cycle_collector_leaves_a_function_what_it_needs():
    done = in_new_process(FREED.format(), PYTHONMALLOC="malloc")
    assert (done.returncode, done.stderr) == (0, "")


FORBIDDEN = """
import ctypes
if ctypes.CDLL(None).prctl(65, 1, 0, 0, 0) == 0:  # PR_SET_MDWE of Linux
    for _ in range(300): arm.mass_matrix(q)
    for t in threading.enumerate():
        if t is not threading.current_thread(): t.join()
    assert type(arm._calls.mass_matrix).__name__ == "function"
    assert np.isfinite(arm.mass_matrix(np.zeros((70000, 2)))).all()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="a rule of Linux")
def test_where_memory_may_not_become_executable_nothing_is_compiled(tmp_path):
    done = in_new_process(FORBIDDEN, DHKIT_CACHE_DIR=str(tmp_path))
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("start", [np.full(6, 0.3 + 2j), np.array(["0.3"] * 6), np.ones(6, bool)])
def test_a_start_of_another_type_is_refused_for_few_poses_too(puma, start):
    T = np.stack([puma.fk(np.linspace(-1, 1, 6))] * 2)
    found = outcome(puma.ik_numeric, T, start)
    expected = outcome(kinematics.solve_numerically, puma, T, start)
    if isinstance(expected, tuple):
        assert found == expected
    else:
        assert np.allclose(found.q, expected.q, rtol=0, atol=1e-6)


def test_fields_are_those_of_the_call_whatever_becomes_of_out():
    arm = compiled_robot("irb140")
    T = arm.fk(np.linspace(-1, 1, 6))
    out = np.empty((8, 6))
    found = arm.ik(T, out=out)
    out.shape = (48,)
    assert "_packed" in vars(found) and found.valid.shape == (8,)


@pytest.mark.parametrize("threads", [1.0, True, np.array([1]), np.array([1, 1]), 0, "1"])
def test_threads_that_are_not_one_are_refused_as_before(puma, threads):
    q = np.linspace(-1, 1, 6)
    T = puma.fk(q)
    for method, function, argument in (
        (puma.fk, kinematics.forward_kinematics, q),
        (puma.ik, kinematics.inverse_kinematics, T),
        (puma.ik_numeric, kinematics.solve_numerically, T),
    ):
        found = outcome(method, argument, threads=threads)
        expected = outcome(function, puma, argument, threads=threads)
        if isinstance(expected, tuple):
            assert found == expected
        else:
            assert type(found) is type(expected)


def test_far_poses_and_huge_shapes_are_told_as_before(puma):
    T = puma.fk(np.linspace(-1, 1, 6))
    T[0, 3] = 1e200
    with np.errstate(all="raise"):
        for poses in (T, np.stack([T, T])):
            assert np.all(puma.ik_numeric(poses).status == "out_of_reach")
    for shape in ((10**15, 4, 0), (10**15, 0, 4)):
        for method, function in (
            (puma.ik, kinematics.inverse_kinematics),
            (puma.ik_numeric, kinematics.solve_numerically),
        ):
            assert outcome(method, np.empty(shape)) == outcome(function, puma, np.empty(shape))
    assert outcome(puma.ik_numeric, T, tolerance=1e200) == outcome(
        kinematics.solve_numerically, puma, T, tolerance=1e200
    )


@pytest.mark.slow
@settings(max_examples=acceptance.sample_size(100, quick=4))
@given(arms(least=6))
def test_searches_of_random_arms_are_compiled(description):
    arm = Arm(description)
    arm._calls.ik_numeric.compile()
    assert is_builtin(arm._calls.ik_numeric._call)


def test_code_of_another_kernel_is_not_run(tmp_path):
    code = (
        "from dhkit import Arm\n"
        "arm = Arm.load('planar2r')\n"
        "for _ in arm._calls.compile(): pass\n"
        "print(type(arm._calls.fk).__name__)"
    )
    environment = {"DHKIT_CACHE_DIR": str(tmp_path)}
    assert in_new_process(code, **environment).returncode == 0
    folder = tmp_path / "kernels"
    (fk,) = folder.glob("forward_kinematics_call_*.kernel")
    (gravity,) = folder.glob("gravity_torque_call_*.kernel")
    fk.write_bytes(gravity.read_bytes())
    done = in_new_process(code, **environment)
    assert done.stdout.strip() == "builtin_function_or_method"
    assert "damaged; the kernel is compiled anew" in done.stderr
