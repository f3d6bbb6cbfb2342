"""The error measure: what is relative to what, and what counts as no error."""

import numpy as np
import pytest

from dhkit.description import library_robot
from dhkit.verification import VerificationReport
from dhkit.verification.measure import Floors, forward_tolerance, relative_error
from dhkit.verification.verification_report import Agreement


def test_differences_are_relative_to_the_largest_entry_or_the_floor():
    reference = np.array([[2.0, -4.0], [0.0, 1e-9], [0.0, 0.0], [1.0, 1.0]])
    ours = reference + np.array([[0.4, 0.0], [1e-9, 0.0], [0.0, 0.0], [np.nan, 0.0]])
    assert relative_error(ours, reference)[:3] == pytest.approx([0.1, 1.0, 0.0])
    assert relative_error(ours, reference, np.array([1.0, 10.0, 0.0, 0.0]))[:3] == pytest.approx(
        [0.1, 1e-10, 0.0]
    )
    assert np.isnan(relative_error(ours, reference)[3])
    assert relative_error(np.ones((1, 2)), np.zeros((1, 2)))[0] == np.inf
    with pytest.raises(ValueError, match="shapes"):
        relative_error(ours, reference[0])


def test_floors_and_tolerance():
    arm = library_robot("planar2r")
    M = np.array([np.diag([2.0, 1.0]), np.diag([1.0, 1e-8])])
    qd, qdd, tau = (
        np.array([[1.0, -3.0]] * 2),
        np.array([[5.0, 0.0]] * 2),
        np.array([[8.0, 0.0]] * 2),
    )
    floors = Floors.of(arm, M, qd, qdd, tau)
    numbers = arm.numbers
    weight = numbers.mass.sum() * np.linalg.norm(numbers.gravity) * max(1.0, arm.reach)
    assert floors.g == pytest.approx([weight] * 2)
    assert list(floors.C) == pytest.approx([6.0, 3.0])
    assert floors.h == pytest.approx([18.0, 9.0])
    assert floors.bias == pytest.approx(floors.g + floors.h)
    assert floors.tau == pytest.approx(floors.g + floors.h + [10.0, 5.0])
    assert floors.qdd == pytest.approx([8.0, 8e8])
    assert forward_tolerance(M) == pytest.approx([1e-12, 4 * np.finfo(float).eps * 1e8])


def test_a_report_prints_errors_that_are_not_finite():
    agreements = tuple(
        Agreement(name, error, 1e-12, (0.0,)) for name, error in (("M", np.inf), ("g", np.nan))
    )
    report = VerificationReport("planar2r", "Pinocchio", 1, 0, agreements)
    assert not report.ok
    assert r"\infty" in report.latex() and r"\mathrm{NaN}" in report.latex()
    assert "inf" in report.markdown() and "DISAGREES" in repr(report)
