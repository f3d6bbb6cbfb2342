"""dhkit on dask: the same digits as one process, whoever computes them, and whoever is lost on the way."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest

import dhkit
from acceptance import in_time, only_accepting
from dhkit import Arm, scale
from dhkit.cli import main
from dhkit.errors import (
    AnswerError,
    DescriptionError,
    DhkitError,
    MissingPackageError,
    PlanningError,
)
from dhkit.grading import judge_process
from dhkit.grading.batch import grade_all
from dhkit.grading.class_judge import ClassJudge
from dhkit.grading.judge_process import JudgeTask, judged_elsewhere
from dhkit.grading.options import GradeOptions
from dhkit.grading.reports.json import report_of
from dhkit.grading.sheets import Sheet, find_sheets
from dhkit.grading.variants import VariantKey
from dhkit.kernels import kernel_mode
from dhkit.scale.clusters import TASKS_AHEAD, completed

da = pytest.importorskip("dask.array")
pytest.importorskip("distributed")
zarr = pytest.importorskip("zarr")

GIGABYTE = 1e9
GIGABYTES = 2 << 30
SAMPLES = 1_000_000
ROWS = 3_000
PLANAR = Arm.load("planar2r")


@pytest.fixture(scope="module")
def client():
    with scale.connected("local:2") as client:
        yield client


@pytest.fixture
def compiling(monkeypatch):
    """Compile kernels of this process at their first use, as workers do: interpreted ones round otherwise."""
    monkeypatch.setenv("DHKIT_KERNELS", "on")
    kernel_mode.cache_clear()
    yield
    monkeypatch.undo()
    kernel_mode.cache_clear()


def assert_same(one, other):
    """Hold all arrays of two workspaces to the same digits."""
    for name in ("positions", "manipulability", "bounds", "best", "histogram"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    assert (one.distances, one.radii) == (other.distances, other.radii)
    assert one.largest_manipulability == other.largest_manipulability
    assert np.array_equal(one.grid.counts, other.grid.counts)
    for mine, theirs in [(one.grid, other.grid), *zip(one.maps, other.maps, strict=True)]:
        assert np.array_equal(mine.manipulability, theirs.manipulability, equal_nan=True)


def kill_a_worker(client):
    pid = next(iter(client.run(os.getpid).values()))
    os.kill(pid, signal.SIGKILL)


# Workspaces


@pytest.mark.slow
def test_a_workspace_has_the_digits_of_one_process_though_a_worker_is_killed(client):
    alone = PLANAR.workspace(SAMPLES, 3)
    assert_same(scale.workspace(client, PLANAR, SAMPLES, 3), alone)

    killed = []

    def kill_once(done, total):
        if total / 2 < done < total and not killed:
            killed.append(done)
            kill_a_worker(client)

    assert_same(scale.workspace(client, PLANAR, SAMPLES, 3, progress=kill_once), alone)
    assert killed


class Written:
    """A function that takes a while, and leaves a file for each call."""

    def __init__(self, folder):
        self.folder = folder

    def __call__(self, item):
        Path(self.folder, f"{item}-{time.time_ns()}").touch()
        time.sleep(0.05)
        return item**2


@pytest.mark.slow
def test_a_lost_worker_costs_its_own_tasks_alone(client, tmp_path):
    items = list(range(40))
    found = {}
    for number, result in completed(client, Written(tmp_path), items):
        found[number] = result
        if len(found) == 10:
            kill_a_worker(client)
    assert found == {item: item**2 for item in items}
    # It worked on one task, one waited, and results of others may not have been fetched.
    calls = len(list(tmp_path.iterdir()))
    assert len(items) <= calls <= len(items) + TASKS_AHEAD + 1


@pytest.mark.slow
def test_an_exception_in_progress_ends_the_work(client):
    def stop(done, total):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        scale.workspace(client, PLANAR, SAMPLES, progress=stop)
    with pytest.raises(ValueError, match="samples is 0"):
        scale.workspace(client, PLANAR, 0)


@only_accepting
def test_memory_does_not_grow_with_the_number_of_samples():
    arm = Arm.load("puma560")
    most = {}

    def watch(done, total):
        for process in psutil.Process().children(recursive=True):
            size = process.memory_info().rss
            most[process.pid] = max(size, most.get(process.pid, 0))

    start = time.perf_counter()
    with scale.connected("local:2") as client:
        space = scale.workspace(client, arm, 100_000_000, progress=watch)
    assert space.samples == space.grid.counts.sum() == 100_000_000
    assert max(most.values()) < 2 * GIGABYTE
    in_time(time.perf_counter() - start, 300)


# Arrays


def states(rows=ROWS, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (rows, 6))


@pytest.mark.parametrize("chunks", [ROWS, 1_000, (700, 4)])
def test_arrays_are_those_of_the_arm(chunks):
    arm = Arm.load("puma560")
    arm.compile()  # compiled and interpreted kernels round otherwise
    q, qd, qdd = (states(seed=seed) for seed in range(3))
    rows = chunks if isinstance(chunks, tuple) else (chunks, 6)
    lazy = [da.from_array(array, chunks=rows) for array in (q, qd, qdd)]
    pairs = [
        (scale.fk(arm, lazy[0]), arm.fk(q)),
        (scale.jacobian(arm, lazy[0]), arm.jacobian(q)),
        (scale.ik(arm, scale.fk(arm, lazy[0])), arm.ik(arm.fk(q)).q),
        (scale.inverse_dynamics(arm, *lazy), arm.inverse_dynamics(q, qd, qdd)),
        (scale.forward_dynamics(arm, lazy[0], qd, lazy[2]), arm.forward_dynamics(q, qd, qdd)),
    ]
    for dask_array, expected in pairs:
        assert dask_array.shape == expected.shape
        assert dask_array.dtype == expected.dtype
        found = dask_array.compute(scheduler="synchronous")
        assert np.array_equal(found, expected, equal_nan=True)


@pytest.mark.slow
@pytest.mark.usefixtures("compiling")
def test_workers_compute_arrays_with_the_same_digits(client):
    arm = Arm.load("puma560")
    q = states()
    lazy = da.from_array(q, chunks=(100, 6))  # batches that would be interpreted
    assert np.array_equal(scale.fk(arm, lazy).compute(), arm.fk(q))
    assert float(scale.fk(arm, lazy)[:, 2, 3].max().compute()) == arm.fk(q)[:, 2, 3].max()


def test_rows_may_be_of_any_shape_and_type():
    T = np.broadcast_to(np.eye(4), (10, 4, 4))
    is_high = scale.map_states(
        lambda T, z: T[:, 2, 3] > z, T, np.arange(10) - 5.5, tail=(), dtype=bool, chunk=4
    )
    assert is_high.chunks == ((4, 4, 2),)
    assert is_high.compute(scheduler="synchronous").tolist() == [True] * 6 + [False] * 4


@pytest.mark.parametrize(
    ("arrays", "complaint"),
    [
        ((), "no arrays; expected one or more"),
        ((3.0,), "found a number; expected an array with a row for each state"),
        ((np.zeros((3, 2)), np.zeros((4, 2))), r"arrays have \[3, 4\] rows"),
    ],
)
def test_arrays_that_do_not_fit_are_named(arrays, complaint):
    with pytest.raises(ValueError, match=complaint):
        scale.map_states(np.add, *arrays, tail=())


# Simulations and plans


@pytest.mark.slow
@pytest.mark.usefixtures("compiling")
def test_simulations_are_those_of_one_batch(client):
    controller = dhkit.PDGravity.tuned(PLANAR)
    starts = np.random.default_rng(0).uniform(-0.1, 0.1, (2_100, 2))
    calls = []
    found = scale.simulate_many(
        client,
        PLANAR,
        controller,
        [0.1, 0.2],
        0.2,
        q0=starts,
        size=600,
        options=dhkit.BatchOptions(keep="all"),
        progress=lambda done, total: calls.append((done, total)),
    )
    alone = PLANAR.simulate_batch(controller, [0.1, 0.2], 0.2, q0=starts, keep="all")
    for name in ("t", "q0", "q", "qd", "peak_error", "rms_error", "works", "outside"):
        assert np.array_equal(getattr(found, name), getattr(alone, name)), name
    assert np.array_equal(found.history.tau, alone.history.tau)
    assert calls[-1] == (2_100, 2_100)
    assert len(calls) == 3


@pytest.mark.slow
@pytest.mark.usefixtures("compiling")
def test_each_simulation_may_have_an_arm_of_its_own(client):
    controller = dhkit.PDGravity.tuned(PLANAR)
    plants = [PLANAR.with_payload(mass) for mass in np.linspace(0.1, 1, 100)]
    options = dhkit.BatchOptions(plant=plants)
    found = scale.simulate_many(
        client, PLANAR, controller, [0.1, 0.2], 0.2, options=options, size=40
    )
    alone = PLANAR.simulate_batch(controller, [0.1, 0.2], 0.2, options=options)
    assert found.arms == alone.arms
    assert np.array_equal(found.q, alone.q)


@pytest.mark.slow
@pytest.mark.usefixtures("compiling")
def test_plans_are_those_of_one_process_and_errors_keep_their_place(client):
    planner = PLANAR.planner(intervals=12)
    goals = np.array([[0.5, 0.2], [99.0, 0.0], [0.2, 0.4]])
    found = scale.plan_many(client, planner, np.zeros(2), goals)
    alone = planner.solve_many(np.zeros(2), goals, workers=1)
    assert isinstance(found[1], PlanningError)
    assert str(found[1]) == str(alone[1])
    for k in (0, 2):
        assert found[k].duration == alone[k].duration
        assert np.array_equal(found[k].sample(n=20).q, alone[k].sample(n=20).q)
    with pytest.raises(ValueError, match="starts has 2 places; expected 1 or 3"):
        scale.plan_many(client, planner, np.zeros((2, 2)), goals)


# Clusters


def test_dask_is_imported_when_it_is_first_used():
    code = "import sys, dhkit.scale; print([m for m in ('dask', 'distributed', 'zarr') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_missing_extra_is_named_with_its_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "dask.array", None)
    with pytest.raises(MissingPackageError, match=r"scaling needs dask, .*\.\[scale\]"):
        scale.fk(PLANAR, np.zeros((3, 2)))


@pytest.mark.parametrize(
    ("scheduler", "complaint"),
    [
        ("tcp://127.0.0.1:9", "no scheduler of dask answers at tcp://127.0.0.1:9 within 0.2 s"),
        ("cake", "scheduler 'cake': expected an address such as tcp://10.0.0.1:8786, local or"),
        ("local:many", "scheduler 'local:many': expected an address"),
        ("cake://1", "scheduler 'cake://1': unknown address scheme"),
    ],
)
def test_a_scheduler_that_does_not_answer_is_one_line(scheduler, complaint):
    with (
        pytest.raises(DhkitError, match=complaint) as error,
        scale.connected(scheduler, timeout=0.2),
    ):
        pass
    assert "\n" not in str(error.value)


@pytest.mark.slow
def test_workers_of_another_version_are_refused(client, monkeypatch):
    monkeypatch.setattr(dhkit, "__version__", "9.9")
    with pytest.raises(DhkitError, match=r"worker tcp://.* has dhkit .*; expected 9\.9, as here"):
        scale.prepare(client)


@pytest.mark.slow
def test_a_scheduler_without_workers_is_named():
    from distributed import LocalCluster

    with LocalCluster(n_workers=0, dashboard_address=":0") as cluster:
        address = cluster.scheduler_address
        complaint = f"the scheduler at {address} has no worker after 0.2 s: start one with"
        with pytest.raises(DhkitError, match=complaint), scale.connected(address, timeout=0.2):
            pass


def small_cluster():
    from distributed import LocalCluster

    return LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=":0", silence_logs="CRITICAL"
    )


@pytest.mark.slow
def test_a_task_that_kills_its_workers_is_named():
    import dask

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        small_cluster() as cluster,
        scale.connected(cluster.scheduler_address) as client,
        pytest.raises(DhkitError, match="a task ended its worker again and again"),
    ):
        list(completed(client, os._exit, [1]))


@only_accepting  # closing a cluster without a scheduler takes half a minute
def test_a_scheduler_that_is_lost_is_named():
    with small_cluster() as cluster, scale.connected(cluster.scheduler_address) as client:
        results = completed(client, abs, range(10))
        next(results)
        cluster.sync(cluster.scheduler.close)
        with pytest.raises(DhkitError, match="the connection to the scheduler is lost"):
            list(results)


# Grades

G1 = "g1 = 9.81*((m1/2 + m2)*l1*cos(q1) + m2*l2*cos(q1 + q2)/2)\n"
RIGHT = G1 + "g2 = 9.81*m2*l2*cos(q1 + q2)/2\n"
WRONG = G1 + "g2 = 9.81*m2*l2*cos(q2)/2\n"


@pytest.fixture
def sheets(tmp_path):
    """Return sheets of six students, every second one right, and what is wrong with two more."""
    for number in range(6):
        (tmp_path / f"s{number}.py").write_text(WRONG if number % 2 else RIGHT)
    (tmp_path / "strange.py").write_bytes(b"\xff\xfe g2")
    (tmp_path / "word.docx").write_text("g2")
    return find_sheets([tmp_path])


JUDGE = ClassJudge(options=GradeOptions(seed=7), robot=PLANAR.description, has_own_seeds=True)


def untimed(report):
    return replace(report, seconds=0.0)


def in_processes(sheets, judge=JUDGE):
    return [untimed(report) for report in grade_all(sheets, judge)]


def on_cluster(client, sheets, judge=JUDGE):
    found = dict(scale.grade_many(client, sheets, judge))
    return [untimed(found[number]) for number in range(len(sheets))]


@pytest.mark.slow
def test_sheets_are_judged_as_on_one_machine(client, sheets):
    reports = on_cluster(client, sheets)
    assert reports == in_processes(sheets)
    assert [report.verdict.value for report in reports] == [
        *["correct", "wrong"] * 3,
        *["unreadable"] * 2,
    ]


@pytest.mark.slow
def test_a_lost_worker_costs_no_report(client, sheets):
    many = [replace(sheet, student=str(k)) for k, sheet in enumerate(sheets * 5)]
    found = {}
    for number, report in scale.grade_many(client, many, JUDGE):
        found[number] = untimed(report)
        if len(found) == 10:
            kill_a_worker(client)
    assert [found[number] for number in range(len(many))] == in_processes(many)


def task_of(path, judge=JUDGE, seconds=60.0):
    return JudgeTask.of(Sheet(path), judge, seconds, GIGABYTES)


@pytest.mark.slow
def test_a_process_judges_sheets_of_another_machine(tmp_path):
    """It needs neither the file nor the key; messages name the file as here; a process that ended is replaced."""
    path = tmp_path / "ada.py"
    path.write_text(RIGHT)
    task = task_of(path)
    path.unlink()
    for _ in range(2):
        report = report_of(judged_elsewhere(task))
        assert (report.verdict.value, report.sheet) == ("correct", str(path))
        judge_process._OWN.process().end()
    path.write_text("g2 = [")
    report = report_of(judged_elsewhere(task_of(path)))
    assert report.error.startswith(f"{path}: ")


def test_a_robot_file_is_not_sent_along(tmp_path):
    path = tmp_path / "answer.toml"
    path.write_text('format = 1\nrobot = "arm.toml"\n[answer]\nV = "0"\n')
    report = report_of(judged_elsewhere(task_of(path, replace(JUDGE, robot=None))))
    assert report.error == (
        f"{path}: arm.toml: no such file; no other files are sent to a cluster: give --robot, or a task with a robot"
    )


def test_a_process_for_sheets_ends_with_its_program_or_when_it_is_idle():
    program = "from dhkit.grading import judge_process as p; p.IDLE_SECONDS = 0.1; p.serve()"
    for stdin in (subprocess.DEVNULL, subprocess.PIPE):
        with subprocess.Popen([sys.executable, "-c", program], stdin=stdin) as process:
            assert process.wait(60) == 0


def test_a_sheet_on_another_machine_has_limits(tmp_path):
    path = tmp_path / "ada.py"
    path.write_text(RIGHT)
    report = report_of(judged_elsewhere(task_of(path, seconds=0.001)))
    assert report.error == "took longer than 0.001 s"
    with path.open("wb") as file:
        file.truncate(50_000_000)
    report = report_of(judged_elsewhere(task_of(path)))
    here = next(grade_all([Sheet(path)], JUDGE))
    assert report.error == here.error


def test_a_student_without_a_variant_is_told_before_anything_is_sent(tmp_path, sheets):
    key = VariantKey(tmp_path, 1, "", {})
    judge = replace(JUDGE, key=key, students={sheet.path: "eve" for sheet in sheets})
    with pytest.raises(AnswerError, match="student 'eve' has no variant"):
        JudgeTask.of(sheets[0], judge, 60.0, GIGABYTES)


# Files and the command


def test_a_workspace_is_written_whole_with_its_origin(tmp_path):
    space = PLANAR.workspace(5_000, 2)
    path = scale.save_workspace(space, tmp_path / "deep" / "map.zarr")
    group = zarr.open_group(path, mode="r")
    assert np.array_equal(group["counts"][:], space.grid.counts)
    assert np.array_equal(group["manipulability"][:], space.grid.manipulability, equal_nan=True)
    assert np.array_equal(group["map_0"][:], space.maps[0].manipulability, equal_nan=True)
    for axis, cells in enumerate(space.grid.counts.shape):
        assert np.allclose(np.diff(group[f"edges_{axis}"][:]), space.grid.edge)
        assert group[f"edges_{axis}"].shape == (cells + 1,)
    assert group.attrs["robot"] == "planar2r"
    assert group.attrs["robot_digest"] == PLANAR.description.digest
    assert (group.attrs["seed"], group.attrs["samples"]) == (2, 5_000)
    assert group.attrs["dhkit_version"] == dhkit.__version__
    assert [each.name for each in path.parent.iterdir()] == ["map.zarr"]


def test_a_map_that_cannot_be_written_leaves_the_last_one(tmp_path, monkeypatch):
    path = scale.save_workspace(PLANAR.workspace(5_000, 2), tmp_path / "map.zarr")
    monkeypatch.setattr(zarr.Group, "create_array", lambda *_, **__: press_ctrl_c())
    with pytest.raises(KeyboardInterrupt):
        scale.save_workspace(PLANAR.workspace(5_000, 3), path)
    assert zarr.open_group(path, mode="r").attrs["seed"] == 2
    assert [each.name for each in tmp_path.iterdir()] == ["map.zarr"]


def press_ctrl_c():
    raise KeyboardInterrupt


def test_other_folders_are_left_alone(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "note").write_text("keep me")
    with pytest.raises(DescriptionError, match="mine: not a workspace of dhkit"):
        scale.save_workspace(PLANAR.workspace(100), tmp_path / "mine")
    with pytest.raises(ValueError, match="keeps to one point"):
        scale.save_workspace(Arm.from_dh([(0, 0.5, 0, 0)]).workspace(10), tmp_path / "point")
    assert [each.name for each in tmp_path.iterdir()] == ["mine"]


def run(*arguments):
    with pytest.raises(SystemExit) as exit:
        main(("workspace", *arguments))
    return exit.value.code


@pytest.mark.slow
def test_the_command_says_the_same_with_a_scheduler(client, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    said = []
    for options in ([], ["--scheduler", client.scheduler.address, "--zarr", "map.zarr"]):
        assert run("planar2r", "--samples", "2e5", "--seed", "3", "--json", *options) == 0
        said.append(json.loads(capsys.readouterr().out))
    assert said[1].pop("files") == [*said[0].pop("files"), "map.zarr"]
    assert said[0] == said[1]
    assert zarr.open_group("map.zarr", mode="r")["counts"][:].sum() == 200_000


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--samples", "1e-3"], "not a whole number from 1 to 1e+12, such as 100000 or 1e9"),
        (["--samples", "1e13"], "not a whole number"),
        (["--scheduler", "cake"], "scheduler 'cake': expected an address"),
        (["--zarr", "taken"], "taken: not a workspace of dhkit"),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments, complaint, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("keep me")
    assert run("planar2r", *arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert complaint in err
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]
