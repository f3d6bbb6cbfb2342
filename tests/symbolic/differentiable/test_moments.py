"""Moments of bodies, and regrouping that changes no equation; how many operations that saves."""

from dataclasses import replace
from fractions import Fraction

import casadi
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from acceptance import sample_size
from dhkit.description import library_robot
from dhkit.symbolic import (
    Graph,
    InertialTable,
    composite_coriolis_matrix,
    composite_mass_matrix,
    inertial_pattern,
    joint_symbols,
    kinetic_energy,
    operation_count,
    potential_energy,
    recursive_gravity,
    recursive_inverse_dynamics,
)
from dhkit.symbolic.differentiable.inertial_table import exact_moments
from dhkit.symbolic.differentiable.moments import Moments
from dynamics_reference import motions, tilted_arms
from random_arms import random_body

REGROUPED = 1e-14
PUMA_OPERATIONS = 305
"""Additions and multiplications: required are 400; Armstrong, Khatib & Burdick 1986 need 305 for what is cut off."""


def moments(seed):
    """Moments of a random body and what they should be: mass, first moments and S as arrays."""
    body = random_body(np.random.default_rng(seed))
    mass, com = float(body.mass), np.array([float(x) for x in body.com])
    J = np.array([[float(x) for x in row] for row in body.inertia.rows])
    return Moments.of_body(mass, tuple(com), J.tolist()), mass, com, J


@given(st.integers(0, 10**6), st.floats(-4, 4), st.lists(st.floats(-2, 2), min_size=3, max_size=3))
def test_moments_turn_and_move_like_bodies(seed, angle, p):
    link, mass, com, J = moments(seed)
    c, s, p = np.cos(angle), np.sin(angle), np.array(p)
    Rx, Rz = (
        np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    )
    for found, R, shift in (
        (link, np.eye(3), np.zeros(3)),
        (link.about_x(c, s), Rx, np.zeros(3)),
        (link.about_z(c, s), Rz, np.zeros(3)),
        (link.moved(tuple(p)), np.eye(3), p),
    ):
        r = R @ com + shift
        S = R @ (np.trace(J) / 2 * np.eye(3) - J) @ R.T + mass * np.outer(r, r)
        assert np.allclose(found.tensor, S, rtol=1e-12, atol=1e-12)
        assert np.allclose(found.first, mass * r, rtol=1e-12, atol=1e-13)
    assert Moments.of_entries(link.entries) == link


@settings(max_examples=max(5, sample_size(400)))
@given(tilted_arms(least=1))
@pytest.mark.slow
def test_regrouping_changes_no_equation(law, arm):
    law.samples(400)
    grouped = InertialTable.of(arm)
    links = tuple(
        Moments.of_entries([float(x) for x in link.entries]) for link in exact_moments(arm)
    )
    numbers = arm.numbers
    lift = -float(numbers.mass.sum() * (numbers.gravity @ numbers.T_world_base[:3, 3]))
    plain = replace(grouped, links=links, potential=lift)
    q, qd, qdd = symbols = [joint_symbols(name, arm.n) for name in ("q", "qd", "qdd")]
    values = [
        casadi.Function(
            "f",
            symbols,
            [
                recursive_inverse_dynamics(table, q, qd, qdd),
                casadi.densify(composite_mass_matrix(table, q)),
                casadi.densify(composite_coriolis_matrix(table, q, qd)),
                recursive_gravity(table, q),
                kinetic_energy(table, q, qd),
                potential_energy(table, q),
            ],
        )
        for table in (grouped, plain)
    ]
    for state in zip(*motions(arm, 3), strict=True):
        for name, ours, theirs in zip(
            ["tau", "M", "C", "g", "K", "V"], *(f(*state) for f in values), strict=True
        ):
            ours, theirs = np.array(ours), np.array(theirs)
            weight = float(numbers.mass.sum()) * 10 * max(1.0, arm.reach)
            size = max(np.abs(theirs).max(), weight)
            law.holds(f"{name} regrouped", np.abs(ours - theirs).max() / size, REGROUPED, arm)


def test_what_lies_on_the_axis_is_gone():
    table = InertialTable.of(library_robot("puma560"))
    assert all(link.mass == 0 and link.first[2] == 0 and link.zz == 0 for link in table.links)
    last = table.links[-1]
    assert last.difference == 0 and last.first == (0, 0, 0)  # symmetric: exactly, not by a rounding


def test_arms_of_a_pattern_share_an_expression():
    arm = library_robot("puma560")
    pattern, values = inertial_pattern(arm)
    table, symbols = InertialTable.parametric(arm)
    assert symbols.numel() == len(values)
    heavier = replace(
        arm,
        joints=tuple(
            replace(j, bodies=(replace(j.body, mass=j.body.mass * Fraction(11, 10)),))
            if i == 2
            else j
            for i, j in enumerate(arm.joints)
        ),
    )
    other, changed = inertial_pattern(heavier)
    assert other == pattern
    assert not np.array_equal(changed, values)
    q = joint_symbols("q", 6)
    M = casadi.Function("M", [symbols, q], [casadi.densify(composite_mass_matrix(table, q))])
    own = InertialTable.of(heavier)
    expected = casadi.Function("M", [q], [casadi.densify(composite_mass_matrix(own, q))])
    assert np.abs(np.array(M(changed, np.ones(6))) - np.array(expected(np.ones(6)))).max() < 1e-14


def test_the_inverse_dynamics_of_the_puma_are_short(law):
    arm = library_robot("puma560")
    symbols = {name: joint_symbols(name, 6) for name in ("q", "qd", "qdd")}
    tau = recursive_inverse_dynamics(InertialTable.of(arm), *symbols.values())
    counts = operation_count(Graph.of("inverse_dynamics", symbols, {"tau": tau}))
    assert set(counts) == {"additions", "multiplications", "sines and cosines"}
    total = counts["additions"] + counts["multiplications"]
    law.holds("operations of the PUMA's inverse dynamics", total, PUMA_OPERATIONS)
