"""The benchmark's laws: who agrees is said to, who lies is found out, who is missing is listed; no figure is judged."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks.targets import targets

from dhkit import Arm, pose, robots
from dhkit.bench import (
    BenchReport,
    Contender,
    Machine,
    Missing,
    Mode,
    PeakMemory,
    Task,
    ThreadScaling,
    UnavailableError,
    Verdict,
    Workload,
    probes,
    run,
)
from dhkit.bench.agreement import judge
from dhkit.bench.benchmark_report import BATCH, duration
from dhkit.bench.contenders import import_peer, one_by_one
from dhkit.bench.geometry import OrthoParallel, bare, joint_axes
from dhkit.bench.machine import cores
from dhkit.bench.peers import (
    all_contenders,
    dhkit_arm,
    eaik,
    ikpy,
    pinocchio,
    roboticstoolbox,
    ssik,
)
from dhkit.bench.rounds import items_within
from dhkit.cli import main

pytestmark = pytest.mark.slow

CLOSE = 1e-13
"""m and rotation entries: a chain of ten products of matrices whose entries are below 3."""
PEERS = ("eaik", "py_opw_kinematics", "ssik", "roboticstoolbox", "frankik", "ikpy")
QUICK = (*dhkit_arm.contenders(), *pinocchio.contenders())
"""Contenders that need nothing but dhkit's own dependencies."""


@pytest.fixture
def uncompiled(monkeypatch):
    """Small batches need no compiled kernels."""
    monkeypatch.setattr(Arm, "compile", lambda self: None)


@pytest.fixture
def no_peers(monkeypatch):
    for name in PEERS:
        for loaded in [module for module in sys.modules if module.split(".")[0] == name]:
            monkeypatch.delitem(sys.modules, loaded)
        monkeypatch.setitem(sys.modules, name, None)


def agreeing(workload):
    fk = workload.arm.fk
    return Task(one_by_one(fk, list(workload.q)), lambda k: list(fk(workload.q[:k])))


def lying(workload):
    fk = workload.arm.fk
    return Task(one_by_one(fk, list(workload.q)), lambda k: list(fk(workload.q[:k]) + 1e-3))


def failing(workload):
    raise RuntimeError("out of\ncheese")


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("name", ["planar2r", "puma560"])
def test_a_report_is_complete(name):
    report = run(
        Arm.load(name), ("fk", "jacobian"), batch=50, repeats=3, probes=False, contenders=QUICK
    )
    assert not report.missing
    assert [(row.quantity, row.contender) for row in report.rows] == [
        (contender.quantity, contender.name)
        for quantity in ("fk", "jacobian")
        for contender in QUICK
        if contender.quantity == quantity
    ]
    for row in report.rows:
        assert row.verdict.ok
        assert 0 < row.lower <= row.seconds <= row.upper
        assert row.rounds == 3
        assert 1 <= row.items <= 50
        assert row.times_batch is not None
        assert row.times_batch > 0
    reference = next(row for row in report.rows if row.contender == dhkit_arm.BATCH)
    assert reference.times_batch == 1
    assert report.machine.python.endswith(sys.version.split()[0])
    asked = targets(report)
    assert {line.quantity for line in asked} == {"fk", "jacobian"}
    assert all(line.met is None for line in asked)  # asked at a larger batch


@pytest.mark.usefixtures("uncompiled")
def test_a_report_is_json_and_markdown():
    report = run(
        Arm.load("planar2r"),
        ("fk",),
        batch=20,
        repeats=1,
        probes=False,
        contenders=[*QUICK, liar("peer")],
    )
    plain = report.json()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert plain["rows"][0]["agrees"] is True
    assert plain["rows"][-1]["agrees"] is False
    assert {"processor", "cores", "packages", "kernels"} <= set(plain["machine"])
    for text in (report.markdown(), str(report)):
        assert all(row.contender in text for row in report.rows)
        assert "DISAGREES: 1e-03" in text
        assert report.machine.processor in text


def liar(name):
    return Contender(name, "fk", Mode.SINGLE, lying)


@pytest.mark.usefixtures("uncompiled")
def test_a_contender_that_disagrees_is_reported_with_its_error_and_timed():
    honest = Contender("honest", "fk", Mode.SINGLE, agreeing)
    report = run(
        Arm.load("planar2r"),
        ["fk"],
        batch=20,
        repeats=1,
        probes=False,
        contenders=[honest, liar("liar")],
    )
    told = {row.contender: row for row in report.rows}
    assert told["honest"].verdict == Verdict(0.0)
    assert told["liar"].verdict.error == pytest.approx(1e-3)
    assert not told["liar"].verdict.ok
    assert told["liar"].seconds > 0
    assert told["liar"].times_batch is None  # dhkit took no part


@pytest.mark.usefixtures("uncompiled")
def test_a_contender_that_fails_is_missing_with_the_reason():
    broken = Contender("broken", "fk", Mode.BATCH, failing)
    report = run(
        Arm.load("planar2r"), ["fk"], batch=20, repeats=1, probes=False, contenders=[broken]
    )
    assert report.missing == (
        Missing("fk", "broken", "failed: RuntimeError: out of cheese", failed=True),
    )
    assert not report.rows


@pytest.mark.usefixtures("no_peers", "uncompiled")
def test_peers_that_are_not_installed_are_listed():
    report = run(Arm.load("puma560"), ("fk",), batch=20, repeats=1, probes=False)
    assert {row.contender for row in report.rows} == {c.name for c in QUICK if c.quantity == "fk"}
    missing = {gap.name for gap in report.missing}
    assert missing == {c.name for c in all_contenders() if c.quantity == "fk"} - {
        row.contender for row in report.rows
    }
    assert all("not installed" in gap.reason for gap in report.missing)
    assert "pip install -e '.[bench]'" in str(report)


def moved_puma():
    base, tool = pose((0.1, 0.2, 0.3), euler=(0.4, 0.5, 0.6)), pose((0, 0, 0.1), euler=(1, 2, 3))
    return Arm.load("puma560").with_base(base).with_tool(tool)


@pytest.mark.parametrize(
    "arm", [moved_puma(), Arm.load("puma560_akb"), Arm.load("stanford")], ids=lambda arm: repr(arm)
)
def test_installed_peers_agree(arm):
    """Whichever peers are there: with a base and a tool, for a modified table, for a prismatic joint."""
    workload = Workload.of(arm, 8, 1, 0)
    for contender in all_contenders():
        if contender.quantity == "ik" or contender.name.startswith(("roboticstoolbox", "ikpy")):
            continue  # slow to import
        try:
            task = contender.setup(workload)
        except UnavailableError:
            continue
        assert judge(workload, contender.quantity, task).ok, contender.name


def test_solutions_of_ik_are_judged_by_where_they_lead():
    workload = Workload.of(Arm.load("planar2r"), 4, 1, 0)

    def verdict(*answers):
        return judge(workload, "ik", Task(lambda items: lambda: None, lambda k: answers))

    right = [q[None] for q in workload.q]
    assert verdict(*right).ok
    assert verdict(*right).solutions == 1.0
    nothing = np.empty((0, 0))
    half = verdict(right[0], nothing, right[2], nothing)
    assert half.ok
    assert half.solutions == 0.5
    assert verdict(nothing, nothing) == Verdict(None, 0.0)
    assert not verdict(nothing, nothing).ok
    off = verdict(right[0], right[1] + 0.1, right[2], right[3])
    assert not off.ok
    assert off.solutions == 0.75


def test_dhkits_inverse_kinematics_is_asked_the_same_way(monkeypatch):
    """A stand-in for arm.ik that returns two branches, one of them invalid."""
    arm = Arm.load("planar2r")
    workload = Workload.of(arm, 6, 1, 0)

    def ik(self, T, seed=None, out=None, threads=1):
        index = [
            int(np.argmin(np.abs(workload.T - pose).sum(axis=(1, 2))))
            for pose in np.reshape(T, (-1, 4, 4))
        ]
        q = np.full((*T.shape[:-2], 2, arm.n), np.nan) if out is None else out
        q[..., 0, :] = workload.q[index].reshape(*T.shape[:-2], arm.n)
        return SimpleNamespace(q=q, valid=~np.isnan(q).any(axis=-1))

    monkeypatch.setattr(Arm, "ik", ik, raising=False)
    own = [contender for contender in dhkit_arm.contenders() if contender.quantity == "ik"]
    own = [contender for contender in own if "redundancy given" not in contender.name]
    for contender in own:
        task = contender.setup(workload)
        assert judge(workload, "ik", task) == Verdict(0.0, 1.0)
        task.prepare(3)()
    assert dhkit_arm.new_output(arm.ik, [workload.T]).shape == (6, 2, arm.n)


@pytest.mark.usefixtures("uncompiled")
def test_an_interrupted_run_reports_what_it_measured():
    def stop(line):
        if line == "fk: round 2 of 9":
            raise KeyboardInterrupt

    report = run(
        Arm.load("planar2r"), ("fk", "jacobian"), batch=10, progress=stop, contenders=QUICK
    )
    assert report.interrupted
    assert {row.quantity for row in report.rows} == {"fk"}
    assert {row.rounds for row in report.rows} == {2}
    assert "interrupted" in str(report)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"quantities": ["fkk"]}, "no quantity 'fkk'; expected fk, ik, ik_numeric"),
        ({"batch": 0}, "batch is 0"),
        ({"threads": 0}, "threads is 0"),
        ({"repeats": 0}, "repeats is 0"),
    ],
)
def test_unusable_arguments_are_named(arguments, complaint):
    with pytest.raises(ValueError, match=complaint):
        run(Arm.load("planar2r"), **arguments)


def test_a_missing_package_says_how_to_get_it():
    with pytest.raises(
        UnavailableError, match=r"no module named no_such_peer; `.venv/bin/pip install"
    ):
        import_peer("no_such_peer")


@pytest.mark.parametrize("name", [name for name in robots() if Arm.load(name).n == 6])
def test_an_ortho_parallel_arm_stands_upright_at_its_zero(name):
    """The family's forward kinematics, by its own chain of translations and rotations, is the arm's."""
    arm = Arm.load(name)
    try:
        family = OrthoParallel.of(arm.description)
    except UnavailableError as error:
        assert name in {"jaco", "stanford", "ur3", "ur5", "ur10"}, error  # noqa: PT017
        return
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (20, 6))
    assert np.allclose(family.ours(family.angles(q)), q, atol=CLOSE)
    T = arm.fk(q)
    assert np.allclose(family.tool_poses(family.poses(T)), T, atol=CLOSE)
    upright = [chain(family, angles) for angles in family.angles(q)]
    assert np.allclose(family.tool_poses(np.array(upright)), T, atol=CLOSE)


def chain(family, angles):
    steps = [
        (0, 0, 0),
        (family.a1, 0, 0),
        (0, 0, family.c2),
        (family.a2, family.b, family.c3),
        (0, 0, 0),
        (0, 0, 0),
    ]
    T = np.eye(4)
    for step, axis, angle in zip(steps, "zyyzyz", angles, strict=True):
        T[:3, 3] += T[:3, :3] @ step
        T[:3, :3] @= rotation(axis, angle)
    return T


def rotation(axis, angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array(
        [[c, -s, 0], [s, c, 0], [0, 0, 1]] if axis == "z" else [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    )


@pytest.mark.parametrize("name", ["puma560", "kr5", "panda"])
def test_axes_and_offsets_are_the_arm(name):
    """The product of rotations about the axes, with the offsets between, is forward kinematics."""
    arm = Arm.load(name)
    axes = joint_axes(arm.description)
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, arm.n)
    T = np.eye(4)
    for axis, offset, angle in zip(axes.directions, axes.offsets[:-1], q, strict=True):
        T[:3, 3] += T[:3, :3] @ offset
        T[:3, :3] @= turn_about(axis, angle)
    T[:3, 3] += T[:3, :3] @ axes.offsets[-1]
    assert np.allclose(axes.with_tool_rotation(T), arm.fk(q), atol=CLOSE)
    assert np.allclose(axes.without_tool_rotation(arm.fk(q)), T, atol=CLOSE)


def turn_about(axis, angle):
    """Rodrigues' formula."""
    K = np.cross(np.eye(3), axis)
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


def test_a_bare_description_is_the_same_mechanism():
    arm = Arm.load("puma560")
    q = np.linspace(-1, 1, 6)
    alone = Arm(bare(arm.description))
    assert np.array_equal(alone.fk(q), arm.fk(q))
    assert "mesh" not in alone.urdf()


def test_slow_contenders_get_fewer_items():
    def prepare(items):
        return lambda: sum(range(2_000_000)) if items > 1 else None

    assert items_within(Task(prepare, lambda k: []), Mode.SINGLE, 1000) < 1000
    assert items_within(Task(lambda items: lambda: None, lambda k: []), Mode.BATCH, 1000) == 1000


def test_peaks_of_memory_are_seen_after_they_are_gone():
    def peak():
        return float(np.ones(80_000_000).sum())  # 640 MB, given back before the call returns

    try:
        total, extra = probes._with_memory(peak)
    except OSError as error:
        pytest.skip(f"the peak cannot be reset: {error}")
    assert total == 80_000_000
    assert 600e6 < extra < 670e6  # some MB were free already


def test_two_threads_are_held_against_a_control_loop(monkeypatch):
    monkeypatch.setattr(probes, "cores", lambda: 2)
    scaling = probes.thread_scaling(Workload.of(Arm.load("planar2r"), 100, 1, 0), "fk", repeats=1)
    assert scaling.share == pytest.approx(scaling.dhkit / scaling.control)
    monkeypatch.setattr(probes, "cores", lambda: 1)
    with pytest.raises(UnavailableError, match="two cores"):
        probes.thread_scaling(Workload.of(Arm.load("planar2r"), 100, 1, 0), "fk", repeats=1)


def test_memory_is_measured_in_a_process_of_its_own():
    try:
        memory = probes.peak_memory(
            Workload.of(Arm.load("planar2r"), 1000, 1, 0), "fk", "new arrays"
        )
    except UnavailableError as error:
        pytest.skip(str(error))
    assert (memory.inputs, memory.outputs) == (1000 * 2 * 8, 1000 * 16 * 8)
    assert memory.extra >= 0


def test_a_process_that_fails_says_why():
    with pytest.raises(UnavailableError, match=r"a new process failed: .*no such luck"):
        probes._python("raise RuntimeError('no such luck')", environment={})


def test_requirements_are_judged_where_they_are_asked():
    scaling, memory = ThreadScaling("fk", 1.7, 1.9), PeakMemory("fk", "out=", 48, 128, 16)
    assert memory.share == pytest.approx((48 + 128 + 16) / (48 + 128))
    report = BenchReport(
        "puma560", BATCH, 1, 0, (), (), (), (scaling,), (memory,), (), Machine.here()
    )
    asked = targets(report)
    met = {line.what: line.met for line in asked}
    assert met["scaling to two threads over a control loop's"] is True
    assert met["peak memory over inputs and outputs (out=)"] is True
    unasked = targets(replace(report, batch=1000))
    assert {line.met for line in unasked} == {None}


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (1.5, "1.5 s"),
        (0.0123, "12.3 ms"),
        (4.5e-6, "4.5 µs"),
        (2.5e-7, "250 ns"),
        (3.21e-9, "3.21 ns"),
    ],
)
def test_times_are_in_the_unit_that_suits_them(seconds, text):
    assert duration(seconds) == text


@pytest.mark.usefixtures("no_peers", "uncompiled")
def test_the_command_prints_json_and_writes_both_files(capsys, tmp_path):
    arguments = [
        "bench",
        "fk",
        "--robot",
        "planar2r",
        "--batch",
        "20",
        "--repeats",
        "1",
        "--no-probes",
        "--json",
    ]
    with pytest.raises(SystemExit) as ended:
        main([*arguments, "-o", str(tmp_path / "result")])
    out, err = capsys.readouterr()
    assert ended.value.code == 0
    assert json.loads(out)["robot"] == "planar2r"
    assert json.loads((tmp_path / "result.json").read_text(encoding="utf-8")) == json.loads(out)
    assert (tmp_path / "result.md").read_text(encoding="utf-8").startswith("# planar2r")
    assert "fk: round 1 of 1" in err


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["bench", "torque"], "no quantity 'torque'"),
        (["bench", "--robot", "no_such_robot"], "no_such_robot"),
        (["bench", "fk", "-o", "/dev/null/result"], "/dev/null: a file; expected a folder"),
    ],
)
def test_the_command_refuses_in_one_line(capsys, arguments, complaint):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    err = capsys.readouterr().err
    assert ended.value.code == 2
    assert err.count("\n") == 1
    assert complaint in err


def test_contenders_have_names_of_their_own_and_known_quantities():
    listed = all_contenders()
    assert len({(contender.name, contender.quantity) for contender in listed}) == len(listed)
    peers = [c for peer in (eaik, ikpy, roboticstoolbox, ssik) for c in peer.contenders()]
    assert {contender.name for contender in peers} <= {contender.name for contender in listed}
    assert not any(contender.own for contender in peers)
    assert Machine.here().cores == cores()


def test_an_arm_of_seven_joints_is_solved_at_the_redundancy_of_the_states():
    arm = Arm.load("panda")
    workload = Workload.of(arm, 6, 1, 0)
    own = [x for x in dhkit_arm.contenders() if x.quantity == "ik" and "redundancy given" in x.name]
    assert len(own) == 2
    for contender in own:
        answers = contender.setup(workload).answers(6)
        for q, found in zip(workload.q, answers, strict=True):
            assert np.abs(np.angle(np.exp(1j * (found - q)))).max(axis=1).min() < 1e-6
    with pytest.raises(UnavailableError, match="arms of seven joints"):
        own[0].setup(Workload.of(Arm.load("planar2r"), 6, 1, 0))
