"""Kernels: equal results interpreted and compiled, when they are compiled, on one thread and several."""

import signal
import subprocess
import sys
import threading
from functools import partial
from importlib import import_module

import casadi
import numpy as np
import pytest

import dhkit
from acceptance import different_robots_first, slow_if
from dhkit.description import library_robot, robots, world_to_tool
from dhkit.errors import DhkitError
from dhkit.kernels import Kernel, kernel, machine_code
from dhkit.kernels.kernel import COMPILE_AFTER, MIN_ITEMS_PER_THREAD, SMALL_BATCH, kernel_mode
from dhkit.kernels.llvm_source import llvm_source, work_size
from dhkit.kernels.threads import all_in_threads, in_threads
from dhkit.kinematics import forward_kinematics, inverse_kinematics, jacobian
from dhkit.symbolic import Graph, Loop
from random_arms import states

TIERS = 1e-14
"""What a compiled result may differ by from an interpreted one: products fused into sums, another sine."""

fresh = iter(range(10**9))


def product_graph():
    a, x = casadi.SX.sym("a"), casadi.SX.sym("x", 3)
    y = casadi.if_else(x[0] > 0, a * x[1], casadi.sqrt(-x[0]))
    return Graph.of(
        "product", {"a": a, "x": x}, {"y": y, "bits": casadi.if_else(x[2] > 1, 5.0, 2.0)}
    )


def product_kernel():
    """Return a kernel that nothing is known of."""
    return kernel("test_product", str(next(fresh)), product_graph, ("float64", "uint8"))


def run_product(run, x, threads=1):
    y, bits = np.empty((len(x), 1)), np.empty((len(x), 1), dtype=np.uint8)
    run(np.array([2.0]), [x], [y, bits], threads)
    return y[:, 0], bits[:, 0]


def set_mode(monkeypatch, mode):
    """Set the mode, which a process reads from the environment once."""
    # dhkit.kernels.kernel is the function of this name, not its module.
    monkeypatch.setattr(import_module("dhkit.kernels.kernel"), "kernel_mode", lambda: mode)


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """An empty cache, in each mode that a test does not choose itself."""
    monkeypatch.setenv("DHKIT_CACHE_DIR", str(tmp_path))


@pytest.mark.parametrize("mode", ["auto", "on", "off"])
@pytest.mark.parametrize(
    "count", [0, 1, 7, 16, 17, 63, 64, 65, 100, 200, 2 * MIN_ITEMS_PER_THREAD + 5]
)
def test_a_kernel_computes_its_graph_for_any_number_of_items(count, mode, monkeypatch):
    set_mode(monkeypatch, mode)
    x = np.random.default_rng(count).normal(size=(count, 3))
    run = product_kernel()
    for threads in (1, 2, 5):
        y, bits = run_product(run, x, threads)
        with np.errstate(invalid="ignore"):
            assert np.array_equal(y, np.where(x[:, 0] > 0, 2.0 * x[:, 1], np.sqrt(-x[:, 0])))
        assert np.array_equal(bits, np.where(x[:, 2] > 1, 5, 2))


@pytest.mark.parametrize("mode", ["on", "off"])
def test_nothing_is_written_beside_the_results(mode, monkeypatch):
    """Machine code trusts its pointers: what lies before and after a result keeps its value, of no items too."""
    set_mode(monkeypatch, mode)
    run = product_kernel()
    for count in (*range(140), 1000):
        x = np.random.default_rng(count).normal(size=(count, 3))
        y, bits = np.full((count + 200, 1), 7.0), np.full((count + 200, 1), 7, dtype=np.uint8)
        run(np.array([2.0]), [x], [y[100 : 100 + count], bits[100 : 100 + count]])
        for whole in (y, bits):
            assert np.all(whole[:100] == 7), count
            assert np.all(whole[100 + count :] == 7), count
        assert not np.any(bits[100 : 100 + count] == 7)


def test_arrays_that_a_kernel_cannot_take_are_refused(compiled):
    run, x = product_kernel(), np.ones((100, 3))
    outputs = [np.empty((100, 1)), np.empty((100, 1), dtype=np.uint8)]
    for bad in (np.ones((100, 6))[:, ::2], np.ones((100, 3), order="F")):
        with pytest.raises(ValueError, match="strides"):
            run(np.ones(1), [bad], outputs)
    with pytest.raises(ValueError, match=r"shape \(99, 1\)"):
        run(np.ones(1), [x], [np.empty((99, 1)), outputs[1]])


# When a kernel is compiled


def is_compiled(run):
    return run._function is not None


def test_small_batches_never_start_a_compilation():
    run = product_kernel()
    for _ in range(COMPILE_AFTER // 16):
        run_product(run, np.ones((SMALL_BATCH - 1, 3)))
    assert not is_compiled(run)


def test_items_of_larger_batches_do_by_their_number():
    run = product_kernel()
    run_product(run, np.ones((COMPILE_AFTER - SMALL_BATCH - 1, 3)))
    assert not is_compiled(run)
    run_product(run, np.ones((SMALL_BATCH, 3)))
    assert not is_compiled(run)
    run_product(run, np.ones((SMALL_BATCH, 3)))
    assert is_compiled(run)


def test_a_large_batch_is_compiled_for_at_once():
    run = product_kernel()
    run_product(run, np.ones((COMPILE_AFTER, 3)))
    assert is_compiled(run)


def test_on_and_off(monkeypatch):
    run = product_kernel()
    set_mode(monkeypatch, "off")
    run_product(run, np.ones((COMPILE_AFTER, 3)))
    assert not is_compiled(run)
    set_mode(monkeypatch, "on")
    run_product(run, np.ones((1, 3)))
    assert is_compiled(run)


def test_another_mode_is_refused(monkeypatch):
    monkeypatch.setenv("DHKIT_KERNELS", "fast")
    kernel_mode.cache_clear()
    with pytest.raises(DhkitError, match="DHKIT_KERNELS is 'fast'; expected auto, on or off"):
        dhkit.Arm.load("planar2r").fk([0, 0])


@pytest.mark.parametrize("name", ["puma560", "panda", "cart_pendulum"])
@pytest.mark.slow
def test_an_arm_compiles_all_it_has(name, monkeypatch):
    """Afterwards nothing is left to derive, whatever is asked for."""
    seen = []
    arm = dhkit.Arm.load(name).with_base(np.diag([1.0, 1.0, 1.0, 1.0]))
    arm.compile(lambda done, total: seen.append((done, total)))
    assert seen == [(k + 1, len(seen)) for k in range(len(seen))]
    set_mode(monkeypatch, "on")
    monkeypatch.setattr(Kernel, "program", lambda self: pytest.fail(f"{self.name} is derived"))
    q = np.zeros((2, arm.n))
    T = arm.fk(q)
    for frame in ("world", "tool"):
        arm.jacobian(q, frame)
        arm.jacobian_dot(q, q, frame)
    arm.frames(q), arm.ik_numeric(T), arm.ik_numeric(T, position_only=True)
    if arm.family.closed_form and name != "panda":
        arm.ik(T)
    arm.mass_matrix(q), arm.coriolis_matrix(q, q), arm.gravity_torque(q), arm.bias(q, q)
    arm.inverse_dynamics(q, q, q, wrench=np.zeros(6), friction=True)
    arm.forward_dynamics(q, q, q, friction=dhkit.Friction(0.1))
    arm.kinetic_energy(q, q), arm.potential_energy(q)


def test_a_machine_that_cannot_compile_interprets(monkeypatch, caplog):
    def refuse(source):
        raise RuntimeError("no such processor")

    monkeypatch.setattr(machine_code, "compile_module", refuse)
    run = product_kernel()
    for _ in range(2):
        y, _ = run_product(run, np.ones((COMPILE_AFTER, 3)))
        assert np.all(y == 2)
    assert (
        caplog.text.count(
            "test_product is interpreted: it cannot be compiled here (no such processor)"
        )
        == 1
    )


# Tiers agree


def both(monkeypatch, call):
    results = []
    for mode in ("on", "off"):
        set_mode(monkeypatch, mode)
        results.append(call())
    return results


UNUSUAL = (np.nan, np.inf, -np.inf, 1e6, np.nextafter(1e6, np.inf), -2e6, 1e300, 5e-324, -0.0)
"""Values of a joint, some beyond the range of sine and cosine."""


@pytest.mark.parametrize(
    "name", [slow_if(True, "puma560"), slow_if(True, "panda"), "stanford", "al5d", "cart_pendulum"]
)
def test_tiers_agree_and_give_nan_for_the_same_states(name, monkeypatch):
    arm = dhkit.Arm.load(name)
    q = states(arm.description, 300)
    for k, value in enumerate(UNUSUAL):
        q[k, k % arm.n] = value
    with np.errstate(invalid="ignore"):
        qd = np.where(np.isfinite(q), np.sin(q), q)
    quantities = {
        "fk": (q,),
        "frames": (q,),
        "jacobian": (q,),
        "jacobian_dot": (q, qd),
    }
    if name != "al5d":
        quantities |= {
            "mass_matrix": (q,),
            "coriolis_matrix": (q, qd),
            "inverse_dynamics": (q, qd, qd),
        }
        quantities |= {"gravity_torque": (q,), "kinetic_energy": (q, qd), "potential_energy": (q,)}
    for quantity, arguments in quantities.items():
        one, other = both(monkeypatch, partial(getattr(arm, quantity), *arguments))
        assert np.array_equal(np.isnan(one), np.isnan(other)), quantity
        scale = np.abs(np.delete(one, 6, axis=0)[9:]).max()
        rows = ~np.isin(np.arange(300), 6)  # 1e300 of a prismatic joint overflows in one of them
        assert np.nanmax(np.abs(one[rows] - other[rows])[9:]) <= 10 * TIERS * max(1.0, scale), (
            quantity
        )


@pytest.mark.parametrize(
    "name", ["puma560", "puma560_cao", "ur3", "ur5", "irb140", "stanford", "cobra600", "al5d"]
)
def test_tiers_give_the_same_inverse_kinematics_bit_for_bit(name, monkeypatch):
    """At singular poses and limits too, where a rounding decides what is valid, clamped and inside."""
    arm = library_robot(name)
    rng = np.random.default_rng(2)
    q = np.concatenate([rng.integers(-4, 5, (1000, arm.n)) * np.pi / 4, states(arm, 300)])
    T = world_to_tool(arm, q)
    T[3, 0, 0], T[4, :3, 3], T[5, 0, 3] = np.nan, 1e3, np.inf
    one, other = both(monkeypatch, lambda: inverse_kinematics(arm, T))
    for key in ("q", "valid", "flags", "status_code", "distance", "allowed"):
        ours, theirs = getattr(one, key), getattr(other, key)
        assert np.array_equal(ours, theirs, equal_nan=ours.dtype == float), key


@pytest.mark.parametrize("mode", ["on", "off"])
@pytest.mark.parametrize("name", ["puma560", "panda"])
def test_with_one_tier_a_batch_is_its_items_bit_for_bit(name, mode, monkeypatch):
    set_mode(monkeypatch, mode)
    arm = dhkit.Arm.load(name)
    q = states(arm.description, 200)
    for f, x in ((arm.fk, (q,)), (arm.jacobian, (q,)), (arm.inverse_dynamics, (q, q, q))):
        batch = f(*x)
        assert all(np.array_equal(batch[k], f(*(y[k] for y in x))) for k in range(0, 200, 7))


# Machine code


def test_memory_beyond_results_is_one_block():
    """Scratch space does not grow with the batch: that of inverse kinematics fits the first cache."""
    assert 8 * work_size(17 + 48 + 18) < 32 * 1024


@pytest.mark.parametrize("processor", ["x86-64", "haswell", "skylake-avx512"])
def test_a_kernel_can_be_compiled_for_other_processors(processor):
    """Wide vectors are split where registers are short."""
    triple, _, features = machine_code.processor()
    if not triple.startswith("x86_64"):
        pytest.skip("names processors of that kind")
    code = machine_code.compile_module(
        llvm_source(product_graph(), ("float64", "uint8")), (triple, processor, "")
    )
    if processor == "skylake-avx512" and "+avx512f" not in features:
        return
    if processor == "haswell" and "+avx2" not in features:
        return
    x = np.random.default_rng(1).normal(size=(100, 3))
    y, bits = np.empty((100, 1)), np.empty((100, 1), dtype=np.uint8)
    machine_code.CompiledFunction(code)(np.array([2.0]), [x], [y, bits])
    with np.errstate(invalid="ignore"):
        assert np.array_equal(y[:, 0], np.where(x[:, 0] > 0, 2.0 * x[:, 1], np.sqrt(-x[:, 0])))
    assert np.array_equal(bits[:, 0], np.where(x[:, 2] > 1, 5, 2))


def test_text_that_is_no_kernel_is_refused():
    with pytest.raises(RuntimeError):
        machine_code.compile_module("define void @kernel(")
    with pytest.raises(RuntimeError, match="without a function"):
        machine_code.CompiledFunction(
            machine_code.compile_module("define void @other() {\n  ret void\n}")
        )


@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_no_kernel_calls_anything(name):
    """Machine code from the cache is linked with nothing: processors have an instruction for each operation."""
    from dhkit.dynamics import dynamic_kernels
    from dhkit.kinematics import kinematic_kernels

    arm = library_robot(name)
    for run in kinematic_kernels(arm) + dynamic_kernels(arm):
        lines = run._source(run.program()).splitlines()
        called = {function_in(line) for line in lines if "call " in line}
        own = {function_in(line) for line in lines if line.startswith("define internal")}
        widths = ("v8f64", "f64")
        operations = {
            f"llvm.{name}.{kind}" for name in ("fabs", "sqrt", "floor") for kind in widths
        }
        assert called <= operations | own


def function_in(line):
    return line.split("@")[1].split("(")[0]


def test_arms_of_one_pattern_share_a_kernel():
    from dhkit.kinematics.forward import tool_kernel

    arm = dhkit.Arm.from_dh([(0, 0.3, 0.2, "pi/2"), (0, 0, 0.4, 0)])
    longer = dhkit.Arm.from_dh([(0, 0.5, 0.1, "pi/2"), (0, 0, 0.7, 0)])
    assert tool_kernel(arm.description)[0] is tool_kernel(longer.description)[0]
    assert (
        np.abs(longer.fk([0.1, 0.2]) - world_to_tool(longer.description, [0.1, 0.2])).max() < 1e-15
    )


def test_kinematics_agree_with_matrices_multiplied_in_numpy(compiled):
    arm = library_robot("puma560")
    q = states(arm, 200)
    assert np.abs(forward_kinematics(arm, q) - world_to_tool(arm, q)).max() < TIERS
    assert jacobian(arm, q).shape == (200, 6, 6)


# Interrupted calls


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers of POSIX")
@pytest.mark.parametrize("mode", ["auto", "on", "off"])
@pytest.mark.parametrize("count", [1, 63])
def test_a_signal_handler_that_calls_the_same_kernel_changes_nothing(count, mode, monkeypatch):
    set_mode(monkeypatch, mode)
    arm = dhkit.Arm.load("puma560")
    q = np.linspace(0.1, 0.6, 6) + np.zeros((count, 6))
    fk = partial(forward_kinematics, arm)
    expected, calls = fk(q), []

    def handler(*_):
        calls.append(fk(-2 * q))

    before = signal.signal(signal.SIGALRM, handler)
    try:
        while len(calls) < 300:
            # No period: a handler may last longer, and then nests.
            if signal.getitimer(signal.ITIMER_REAL)[0] == 0:
                signal.setitimer(signal.ITIMER_REAL, 2e-4)
            assert np.array_equal(fk(q), expected)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert all(np.array_equal(other, calls[0]) for other in calls)


def test_when_a_share_fails_no_thread_goes_on():
    """The caller may use its arrays again: what has begun is waited for, also when the caller's own share raises."""
    begun, ended = threading.Event(), []

    def work(item):
        if item == 0:
            assert begun.wait(10)
            raise KeyboardInterrupt
        begun.set()
        threading.Event().wait(0.2)
        ended.append(item)

    with pytest.raises(KeyboardInterrupt):
        all_in_threads(work, [0, 1])
    assert ended == [1]


def test_results_come_in_order_from_as_many_threads_as_asked_for():
    working, most, lock = [], [0], threading.Lock()

    def work(item):
        with lock:
            working.append(item)
            most[0] = max(most[0], len(working))
        threading.Event().wait(0.01)
        with lock:
            working.remove(item)
        return item

    assert list(in_threads(work, range(20), 3)) == list(range(20))
    assert most[0] <= 3
    before = threading.active_count()
    for threads in range(2, 20):
        list(in_threads(work, range(threads), threads))
    assert threading.active_count() - before <= 2 + 4 + 8 + 16 + 32


AFTER_THE_END = """
import atexit, numpy as np, dhkit
arm = dhkit.Arm.load("planar2r")
q = np.zeros((70_000, 2))
T = arm.fk(q)
atexit.register(lambda: print(bool((arm.fk(q, threads=2) == T).all())))
"""


def test_threads_are_not_needed_when_the_interpreter_ends():
    done = subprocess.run(
        [sys.executable, "-c", AFTER_THE_END],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    assert done.stdout == "True\n"


def test_a_search_for_one_pose_starts_no_compilation(monkeypatch):
    arm = dhkit.Arm.load("panda").with_tool(np.eye(4) + 0.01 * np.eye(4, k=3))
    monkeypatch.setattr(Kernel, "compile", lambda self: pytest.fail("compiled"))
    monkeypatch.setattr(Kernel, "_look_up", lambda self: pytest.fail("looked up"))
    for _ in range(3):
        arm.ik_numeric(dhkit.pose((5.0, 0.2, 1.6)))


# Loops


def newton_root():
    """Square roots by Heron's steps x <- (x + a / x) / 2 from x = a, until x^2 is near a."""
    import casadi

    p, a, x, one = (casadi.SX.sym(name) for name in ("p", "a", "x", "one"))
    inputs = {"parameters": p, "a": a}
    within = {**inputs, "fixed": one, "state": x}
    start = Graph.of("heron_start", inputs, {"state": a, "fixed": 0 * a + 1})
    after = (x + a / x) / 2
    goes_on = casadi.fabs(after * after - a) > p * a
    step = Graph.of("heron_step", within, {"state": after, "goes_on": goes_on})
    finish = Graph.of("heron", within, {"root": x * one, "twice": 2 * x})
    return Loop(start, step, finish, most=60)


@pytest.mark.parametrize("mode", ["on", "off"])
@pytest.mark.parametrize("count", [1, 2, 1000])
def test_a_loop_ends_for_each_item_when_it_is_done(mode, count, monkeypatch):
    set_mode(monkeypatch, mode)
    run = Kernel("heron", "", newton_root, ("float64", "float64"), is_loop=True)
    a = np.geomspace(1e-6, 1e6, count)[:, None]
    root, twice = np.empty((2, count, 1))
    run(np.array([1e-14]), [a], [root, twice])
    assert np.abs(root / np.sqrt(a) - 1).max() < 1e-13
    assert np.array_equal(twice, 2 * root)


@pytest.mark.parametrize("mode", ["on", "off"])
def test_a_loop_is_bounded_and_keeps_what_is_not_finite(mode, monkeypatch):
    set_mode(monkeypatch, mode)
    run = Kernel("heron", "", newton_root, ("float64", "float64"), is_loop=True)
    a = np.array([[2.0], [np.nan], [np.inf], [3.0]])
    root, twice = np.empty((2, 4, 1))
    # Never near enough: all steps are taken.
    run(np.array([-1.0]), [a], [root, twice])
    assert np.allclose(root[[0, 3], 0], np.sqrt([2.0, 3.0]), rtol=1e-15)
    assert np.isnan(root[[1, 2], 0]).all()


def test_threads_share_a_loop(monkeypatch):
    set_mode(monkeypatch, "on")
    run = Kernel("heron", "", newton_root, ("float64", "float64"), is_loop=True)
    a = np.linspace(1, 9, 20_000)[:, None]
    once, shared = np.empty((2, 2, 20_000, 1))
    run(np.array([1e-14]), [a], list(once))
    run(np.array([1e-14]), [a], list(shared), threads=4)
    assert np.array_equal(once, shared)
