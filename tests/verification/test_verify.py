"""Verification finds nothing where nothing is wrong, and what is wrong where something is."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import dhkit
from dhkit import Arm
from dhkit.description import from_dh, library_robot
from dhkit.model import pinocchio_model
from dhkit.verification import Agreement, VerificationReport, random_motions, verify

DYNAMICS = {
    "mass matrix M",
    "Coriolis matrix C",
    "C qd",
    "gravity torque g",
    "bias C qd + g",
    "inverse dynamics tau",
    "forward dynamics qdd",
    "kinetic energy K",
    "potential energy V",
    "regressor Y",
}


@pytest.mark.parametrize("name", dhkit.robots())
def test_every_robot_agrees(name, law):
    report = verify(library_robot(name), law.samples(1000))
    for agreement in report.agreements:
        law.holds(agreement.quantity, agreement.error, agreement.tolerance, name)
    assert report.ok
    compared = {agreement.quantity for agreement in report.agreements}
    assert compared >= DYNAMICS or any(
        "forward dynamics not compared" in note for note in report.notes
    )


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (lambda model: model.armature.__iadd__(1e-9), {"mass matrix M", "inverse dynamics tau"}),
        (
            lambda model: setattr(model.gravity, "linear", np.array([0, 0, -9.81 - 1e-9])),
            {"gravity torque g"},
        ),
        (
            lambda model: setattr(model.inertias[2], "mass", 17.4 + 1e-9),
            {"mass matrix M", "potential energy V"},
        ),
        (
            lambda model: setattr(model.inertias[2], "lever", model.inertias[2].lever + 1e-10),
            {"gravity torque g"},
        ),
        (
            lambda model: setattr(model.jointPlacements[3], "translation", np.full(3, 0.1)),
            {"frame positions"},
        ),
    ],
)
def test_what_is_wrong_is_found(monkeypatch, change, found):
    model = pinocchio_model(library_robot("puma560"))
    change(model)
    monkeypatch.setattr("dhkit.verification.comparison.pinocchio_model", lambda description: model)
    report = verify(library_robot("puma560"), 50)
    assert not report
    assert found <= {agreement.quantity for agreement in report.agreements if not agreement.ok}
    assert "DISAGREES at q = [" in str(report)


def test_the_worst_state_is_where_it_happens(monkeypatch):
    import dhkit.dynamics as dynamics

    description = library_robot("planar2r")
    true = dynamics.gravity_torque

    def wrong(description, q):
        g = true(description, q)
        g[7, 1] += 1e-3
        return g

    monkeypatch.setattr(dynamics, "gravity_torque", wrong)
    report = verify(description, 20)
    (agreement,) = (
        agreement for agreement in report.agreements if agreement.quantity == "gravity torque g"
    )
    assert agreement.q == tuple(random_motions(description, 20).q[7])
    assert agreement.qd == ()


def test_nan_is_no_agreement(monkeypatch):
    import dhkit.dynamics as dynamics

    monkeypatch.setattr(
        dynamics, "kinetic_energy", lambda description, q, qd: np.full(len(q), np.nan)
    )
    report = verify(library_robot("planar2r"), 5)
    assert not report.ok
    assert [agreement.quantity for agreement in report.agreements if not agreement.ok] == [
        "kinetic energy K"
    ]


def test_an_arm_without_bodies_is_compared_as_far_as_it_goes():
    report = verify(from_dh([(0, 0, 0.3, 0), (0, 0, 0.3, 0)]), 5)
    assert report.ok
    assert len(report.agreements) == 4
    assert "no body on joint1, joint2" in str(report)


def test_a_singular_mass_matrix_is_said():
    planar = library_robot("planar2r")
    body = replace(planar.joints[1].body, mass=planar.joints[1].body.mass * 0)
    light = replace(body, inertia=type(body.inertia)())
    report = verify(
        replace(planar, joints=(planar.joints[0], replace(planar.joints[1], bodies=(light,)))), 5
    )
    assert report.ok
    assert any("forward dynamics not compared" in note and "elbow" in note for note in report.notes)


def test_states_are_inside_the_limits():
    description = library_robot("stanford")
    motion = random_motions(description, 500, seed=3)
    numbers = description.numbers
    assert np.all((motion.q >= numbers.lower) & (motion.q <= numbers.upper))
    assert np.all(np.abs(motion.qd) <= numbers.velocity)
    with pytest.raises(ValueError, match="samples is 0"):
        random_motions(description, 0)


def report(robot="puma560 & 100%", error=3e-16) -> VerificationReport:
    agreement = Agreement("C qd", error, 1e-12, (0.1, 0.2), (1.0, 2.0))
    return VerificationReport(robot, "Pinocchio 4.1.0", 10, 0, (agreement,), ("a_note",))


def test_reports_for_people_and_papers():
    markdown, latex = report().markdown(), report(error=float("nan")).latex()
    assert "| C qd | 3.0e-16 | 1e-12 | agrees | q = [0.1, 0.2], qd = [1.0, 2.0] |" in markdown
    assert "puma560 \\& 100\\%" in latex
    assert "a\\_note" in latex
    assert "\\mathrm{NaN}" in latex
    assert latex.count("{") == latex.count("}")
    assert "\\scriptsize q = [0.1, 0.2]" in latex
    assert json.loads(json.dumps(report().json()))["agreements"][0]["ok"] is True


def test_arm_verify():
    assert Arm.load("cart_pendulum").verify(samples=5, seed=4).ok


def test_the_inertia_of_coupled_drives_is_said_to_be_added():
    assert (
        "the inertia of coupled drives was added to Pinocchio's M"
        in verify(library_robot("manutec_r3"), 5).notes
    )
    assert not verify(library_robot("puma560"), 5).notes
