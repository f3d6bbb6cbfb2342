"""How a comparison ended, by hand and by the command: its exit status and what it says on stderr."""

from __future__ import annotations

import json

import pytest

from dhkit import Arm
from dhkit.bench import (
    Contender,
    Ending,
    Missing,
    Mode,
    Row,
    Task,
    UnavailableError,
    Verdict,
    run,
    runner,
)
from dhkit.bench.contenders import one_by_one
from dhkit.bench.peers import dhkit_arm, pinocchio
from dhkit.bench.runner import outcome_of
from dhkit.cli import main

OWN = Missing("fk", "dhkit", "failed: RuntimeError: x", failed=True, own=True)
OWN_UNAVAILABLE = Missing("fk", "dhkit", "no closed form", own=True)
PEER = Missing("fk", "peer", "failed: RuntimeError: x", failed=True)
PEER_UNAVAILABLE = Missing("fk", "peer", "not installed")


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch):
    """Small batches need no compiled kernels."""
    monkeypatch.setattr(Arm, "compile", lambda self: None)


def figures(contender, error, own=False, quantity="fk"):
    return Row(
        quantity, contender, Mode.SINGLE, own, 1, 1, 1.0, 1.0, 1.0, Verdict(error), None, None
    )


OURS, THEIRS, LIES = figures("dhkit", 0.0, own=True), figures("peer", 1e-12), figures("liar", 1e-3)


@pytest.mark.parametrize(
    ("rows", "missing", "ending"),
    [
        ([OURS, THEIRS], [PEER_UNAVAILABLE], Ending.COMPLETE),
        ([OURS], [PEER], Ending.PEERS_FAILED),
        ([OURS, LIES], [], Ending.PEERS_FAILED),
        ([OURS], [OWN_UNAVAILABLE], Ending.COMPLETE),  # one of several ways to call dhkit
        ([OURS, THEIRS], [OWN], Ending.OWN_FAILED),
        ([figures("dhkit", 1e-3, own=True), THEIRS], [], Ending.OWN_FAILED),
        ([figures("dhkit", None, own=True), THEIRS], [], Ending.OWN_FAILED),
        ([THEIRS], [OWN_UNAVAILABLE], Ending.OWN_MISSING),
        ([], [OWN, PEER], Ending.ALL_FAILED),
        ([LIES], [], Ending.ALL_FAILED),
        ([LIES], [OWN, PEER_UNAVAILABLE], Ending.ALL_FAILED),
        ([], [OWN_UNAVAILABLE, PEER_UNAVAILABLE], Ending.NOTHING_TIMED),
        ([], [], Ending.NOTHING_TIMED),
    ],
)
def test_a_comparison_ends_in_one_of_six_ways(rows, missing, ending):
    other = [figures("dhkit", None, own=True, quantity="ik")]
    outcome = outcome_of(
        "fk", [*rows, *other], [*missing, Missing("ik", "peer", "failed: x", failed=True)]
    )
    assert outcome.ending is ending
    assert outcome.ok == (ending in (Ending.COMPLETE, Ending.PEERS_FAILED))
    assert bool(outcome.causes) == (ending is not Ending.COMPLETE and bool(rows or missing))
    assert str(outcome).startswith(f"fk: {ending.value}")


def test_the_first_cause_is_named_and_the_others_are_counted():
    outcome = outcome_of("fk", [OURS, LIES], [PEER, PEER_UNAVAILABLE])
    assert str(outcome) == "fk: peers failed; peer: failed: RuntimeError: x (and 1 more)"
    assert outcome.causes[1] == "liar: DISAGREES: 1e-03"


def agreeing(workload):
    fk = workload.arm.fk
    return Task(one_by_one(fk, list(workload.q)), lambda k: list(fk(workload.q[:k])))


def lying(workload):
    fk = workload.arm.fk
    return Task(one_by_one(fk, list(workload.q)), lambda k: list(fk(workload.q[:k]) + 1e-3))


def failing(workload):
    raise RuntimeError("out of\ncheese")


def unavailable(workload):
    raise UnavailableError("takes six joints")


def contender(setup, name="peer", own=False):
    return Contender(name, "fk", Mode.SINGLE, setup, own)


OWN_CONTENDERS = tuple(entry for entry in dhkit_arm.contenders() if entry.quantity == "fk")


def bench(monkeypatch, capsys, contenders, *options):
    """Return the exit status of `dhkit bench fk`, its report as data, and what it says beside its progress."""
    monkeypatch.setattr(runner, "all_contenders", lambda: contenders)
    with pytest.raises(SystemExit) as ended:
        main(
            [
                "bench",
                "fk",
                "--robot",
                "planar2r",
                "--batch=4",
                "--repeats=1",
                "--no-probes",
                "--json",
                *options,
            ]
        )
    out, err = capsys.readouterr()
    return (
        ended.value.code,
        json.loads(out),
        [line for line in err.splitlines() if line.startswith("dhkit: ")],
    )


@pytest.mark.parametrize(
    ("contenders", "said"),
    [
        (
            [contender(failing, "ours", own=True), contender(failing), contender(unavailable)],
            "dhkit: fk: every contender failed; ours: failed: RuntimeError: out of cheese (and 1 more)",
        ),
        (
            [contender(lying, "ours", own=True), contender(lying)],
            "dhkit: fk: every contender failed; ours: DISAGREES: 1e-03 (and 1 more)",
        ),
        (
            [
                *OWN_CONTENDERS,
                contender(failing, "ours", own=True),
                contender(failing),
                contender(agreeing),
            ],
            "dhkit: fk: dhkit itself failed; ours: failed: RuntimeError: out of cheese",
        ),
        (
            [contender(unavailable, "ours", own=True), contender(agreeing)],
            "dhkit: fk: dhkit itself could not be timed; ours: takes six joints",
        ),
        ([contender(unavailable)], "dhkit: fk: nothing could be timed; peer: takes six joints"),
        ([], "dhkit: fk: nothing could be timed"),
    ],
)
def test_the_command_fails_in_one_line_where_there_is_nothing_to_compare(
    monkeypatch, capsys, contenders, said
):
    status, report, lines = bench(monkeypatch, capsys, contenders)
    assert status == 1
    assert lines == [said]
    assert [outcome["ok"] for outcome in report["outcomes"]] == [False]


def test_peers_that_fail_beside_dhkit_are_noted(monkeypatch, capsys):
    peers = contender(failing, "broken"), contender(lying, "liar"), contender(agreeing, "honest")
    status, report, lines = bench(monkeypatch, capsys, (*OWN_CONTENDERS, *peers))
    assert status == 0
    assert lines == [
        "dhkit: note: fk: peers failed; broken: failed: RuntimeError: out of cheese (and 1 more)"
    ]
    assert report["outcomes"] == [
        {
            "quantity": "fk",
            "ending": "peers_failed",
            "ok": True,
            "causes": ["broken: failed: RuntimeError: out of cheese", "liar: DISAGREES: 1e-03"],
        }
    ]
    assert report["missing"] == [
        {
            "quantity": "fk",
            "name": "broken",
            "reason": "failed: RuntimeError: out of cheese",
            "failed": True,
            "own": False,
        }
    ]


def test_the_command_says_nothing_where_peers_are_not_installed(monkeypatch, capsys):
    status, report, lines = bench(monkeypatch, capsys, (*OWN_CONTENDERS, contender(unavailable)))
    assert (status, lines) == (0, [])
    assert [outcome["ending"] for outcome in report["outcomes"]] == ["complete"]


def test_each_quantity_that_fails_has_a_line(monkeypatch, capsys):
    also = [Contender("ours", "jacobian", Mode.SINGLE, failing, own=True)]
    status, _, lines = bench(
        monkeypatch, capsys, [contender(failing, "ours", own=True), *also], "jacobian"
    )
    assert status == 1
    assert [line.split("; ")[0] for line in lines] == [
        f"dhkit: {quantity}: every contender failed" for quantity in ("fk", "jacobian")
    ]


def test_both_files_are_written_where_every_contender_fails(monkeypatch, capsys, tmp_path):
    status, report, _ = bench(
        monkeypatch, capsys, [contender(failing)], "--output", str(tmp_path / "result")
    )
    assert status == 1
    assert json.loads((tmp_path / "result.json").read_text(encoding="utf-8")) == report
    assert "out of cheese" in (tmp_path / "result.md").read_text(encoding="utf-8")


def test_an_interrupted_run_has_no_outcome_of_what_it_did_not_finish():
    def stop(line):
        if line == "jacobian: dhkit":
            raise KeyboardInterrupt

    own = dhkit_arm.contenders()
    report = run(
        Arm.load("planar2r"), ("fk", "jacobian"), batch=4, repeats=1, progress=stop, contenders=own
    )
    assert report.interrupted
    assert [(outcome.quantity, outcome.ending) for outcome in report.outcomes] == [
        ("fk", Ending.COMPLETE)
    ]


@pytest.mark.parametrize("name", ["planar2r", "al5d", "pan_tilt", "cobra600", "puma560"])
def test_our_own_inverse_kinematics_agree_where_they_meet_positions_alone(name):
    arm, own = Arm.load(name), dhkit_arm.contenders()
    report = run(arm, ("ik",), batch=8, repeats=1, probes=False, contenders=own)
    assert [outcome.ending for outcome in report.outcomes] == [Ending.COMPLETE]
    assert {row.verdict.solutions for row in report.rows} == {len(arm.family.fit.branches)}


@pytest.mark.slow
def test_out_is_for_closed_forms():
    """An arm that ssik solves takes no out=: dhkit is timed without, and has not failed."""
    pytest.importorskip("ssik")
    into_out = next(
        entry
        for entry in dhkit_arm.contenders()
        if (entry.quantity, entry.name) == ("ik", dhkit_arm.BATCH)
    )
    report = run(
        Arm.load("panda"), ("ik",), batch=1, repeats=1, probes=False, contenders=[into_out]
    )
    reason = "arm.ik takes out= only where a closed form decides how many branches there are"
    assert report.missing == (Missing("ik", dhkit_arm.BATCH, reason, own=True),)


def test_what_dhkit_lacks_is_named_before_what_its_peers_lack():
    """Peers are judged by dhkit's dynamics, and fail for the same reason."""
    own = [entry for entry in dhkit_arm.contenders() if entry.quantity == "mass_matrix"]
    arm = Arm.from_dh([[0, 0, 0.4, 0]], kinds="R")
    contenders = [*pinocchio.contenders(), *own]
    report = run(arm, ("mass_matrix",), batch=4, repeats=1, probes=False, contenders=contenders)
    (outcome,) = report.outcomes
    assert outcome.ending is Ending.ALL_FAILED
    assert outcome.causes[0].startswith("dhkit, out=: arm.mass_matrix: arm: ")
    assert "no body" in outcome.causes[0]
