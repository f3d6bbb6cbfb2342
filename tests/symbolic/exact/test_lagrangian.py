"""Exact equations of motion against Pinocchio, the textbook's route, and the textbooks' own formulas."""

from __future__ import annotations

import pickle
from dataclasses import replace
from fractions import Fraction
from time import perf_counter

import numpy as np
import pytest
from hypothesis import given, settings

import dhkit
from acceptance import different_robots_first, sample_size, slow_if
from dhkit import Arm
from dhkit.description import (
    Body,
    Convention,
    Description,
    Placement,
    Tool,
    from_dh,
    library_robot,
    with_uniform_links,
)
from dhkit.errors import DescriptionError
from dhkit.expressions import exact
from dhkit.symbolic.exact.base_parameters import base_parameters
from dhkit.symbolic.exact.exact_arm import exact_arm
from dhkit.symbolic.exact.lagrangian import lagrangian
from dhkit.symbolic.mistakes import MISTAKES, MadeAt
from dhkit.symbolic.ring import RingError
from dhkit.symbolic.textbook import derive
from exact_checks import errors
from random_arms import arms

TOLERANCE = 1e-12
PROVED = [
    "planar2r",
    "planar3r",
    "polar_rp",
    "cart_pendulum",
    "pan_tilt",
    "cobra600",
    "stanford",
    "puma560",
]
"""The robots that both proofs are asked of."""


@pytest.fixture
def sympy_rings(monkeypatch):
    """Rings without python-flint."""
    monkeypatch.setenv("DHKIT_FLINT", "off")
    exact_arm.cache_clear()
    yield
    exact_arm.cache_clear()


# Against Pinocchio


@pytest.mark.parametrize("symbols", [slow_if(x == "none", x) for x in ("none", "file", "inertial")])
@pytest.mark.parametrize("name", different_robots_first(dhkit.robots()))
def test_exact_equations_agree_with_pinocchio(name, symbols, law):
    lag = lagrangian(library_robot(name), symbols)
    quantities = (
        ("M", "g", "V")
        if symbols == "inertial" and lag.n > 5
        else ("M", "C", "h", "g", "tau", "K", "V")
    )
    for quantity, error in errors(lag, law.samples(1000), quantities).items():
        law.holds(f"exact {quantity}", error, TOLERANCE, name)


@settings(max_examples=sample_size(25, quick=8))
@given(arms(least=1, most=3))
def test_random_arms_agree_with_pinocchio(description):
    lag = lagrangian(description, "none")
    for quantity, error in errors(lag, 5).items():
        assert error <= TOLERANCE, quantity
    assert lag.prove_euler_lagrange()
    assert lag.prove_skew_symmetry()


# Proofs


@pytest.mark.parametrize("symbols", ["none", "file", "inertial"])
@pytest.mark.parametrize("name", PROVED)
def test_both_proofs_hold(name, symbols):
    lag = lagrangian(library_robot(name), symbols)
    assert lag.prove_euler_lagrange()
    assert lag.prove_skew_symmetry()


@pytest.mark.parametrize("name", ["planar2r", "stanford", "puma560"])
def test_a_coefficient_off_by_1e_9_is_found(name):
    lag = lagrangian(library_robot(name))
    ring, tiny = lag.arm.ring, Fraction(1, 10**9)
    M = lag.M.copy()
    M[0, 0] = M[0, 0] + tiny * ring.cosine(1)
    wrong = lag.replaced(M=M).prove_euler_lagrange()
    assert not wrong
    acceleration, rates = ring.acceleration(0), (ring.rate(0), ring.rate(1))
    assert wrong.difference[0] == tiny * (
        ring.cosine(1) * acceleration - ring.sine(1) * rates[0] * rates[1]
    )
    assert wrong.difference[1] == tiny * Fraction(1, 2) * ring.sine(1) * rates[0] ** 2
    assert wrong.places == ((0,), (1,))
    assert "entry 1 differs by" in str(wrong)

    C = lag.C.copy()
    C[0, 1] = C[0, 1] + tiny * rates[0]
    skew = lag.replaced(C=C).prove_skew_symmetry()
    assert not skew
    assert skew.difference[0, 1] == skew.difference[1, 0] == -2 * tiny * rates[0]
    assert skew.places == ((0, 1), (1, 0))

    g = lag.g.copy()
    g[-1] = g[-1] + tiny
    assert lag.replaced(g=g).prove_euler_lagrange().places == ((lag.n - 1,),)


def test_another_factorization_gives_the_same_torques_and_is_not_skew():
    lag = lagrangian(library_robot("planar2r"))
    w1, _ = _rates(lag)
    C = lag.C.copy()
    C[0, 0], C[0, 1] = C[0, 0] * 2, C[0, 1] - lag.christoffel[0, 0, 1] * w1
    assert _equal(C @ _rates(lag), lag.h)
    other = lag.replaced(C=C)
    assert other.prove_euler_lagrange()
    assert not other.prove_skew_symmetry()


@pytest.mark.slow
@pytest.mark.parametrize("name", PROVED)
@pytest.mark.parametrize("mistake", MISTAKES)
def test_the_difference_is_what_the_mistake_makes(name, mistake):
    lag = lagrangian(library_robot(name))
    wrong = derive(lag.description, {mistake})
    proof = lag.prove_euler_lagrange(wrong)
    ring, n = lag.arm.ring, lag.n
    expected = {
        "gravity_sign": 2 * lag.g,
        "gravity_forgotten": lag.g,
        "height_forgotten": lag.g,
        "potential_gradient_sign": 2 * lag.g,
        "half_forgotten": -_links_alone(lag),
        "half_squared": Fraction(1, 2) * _links_alone(lag),
        "rotor_forgotten": np.array(
            [a * ring.acceleration(i) for i, a in enumerate(lag.arm.armature)], dtype=object
        ),
        "kinetic_gradient_omitted": -np.array(
            [lag.K.by_position(i) for i in range(n)], dtype=object
        ),
        "kinetic_gradient_sign": -2
        * np.array([lag.K.by_position(i) for i in range(n)], dtype=object),
        "mass_rate_omitted": np.array([[x.by_time() for x in row] for row in lag.M], dtype=object)
        @ _rates(lag),
    }
    if mistake in expected:
        assert all(a == b for a, b in zip(proof.difference, expected[mistake], strict=True))
    else:
        assert bool(proof) == all(a == b for a, b in zip(lag.tau, wrong.tau, strict=True))


def _rates(lag):
    return np.array([lag.arm.ring.rate(i) for i in range(lag.n)], dtype=object)


def _links_alone(lag):
    """M qdd + C qd without rotors."""
    ring = lag.arm.ring
    rotors = np.array(
        [a * ring.acceleration(i) for i, a in enumerate(lag.arm.armature)], dtype=object
    )
    return lag.tau - lag.g - rotors


# The textbooks' own formulas


def test_planar2r_is_spongs():
    """Spong, Hutchinson & Vidyasagar, Robot Modeling and Control, 2006, section 7.4, planar elbow manipulator."""
    lag = lagrangian(library_robot("planar2r"))
    m1, m2, l1, l2, g, c1, c2, c12, s2, w1, w2 = _two_links(lag)
    lc1, lc2, I1, I2 = l1 * HALF, l2 * HALF, m1 * l1**2 * TWELFTH, m2 * l2**2 * TWELFTH
    d11 = m1 * lc1**2 + m2 * (l1**2 + lc2**2 + 2 * l1 * lc2 * c2) + I1 + I2
    d12 = m2 * (lc2**2 + l1 * lc2 * c2) + I2
    d22 = m2 * lc2**2 + I2
    h = -m2 * l1 * lc2 * s2
    assert _equal(lag.M, [[d11, d12], [d12, d22]])
    assert _equal(lag.C, [[h * w2, h * w2 + h * w1], [-h * w1, lag.arm.ring.zero]])
    assert _equal(lag.g, [(m1 * lc1 + m2 * l1) * g * c1 + m2 * lc2 * g * c12, m2 * lc2 * g * c12])


def test_planar2r_is_sicilianos():
    """Siciliano, Sciavicco, Villani & Oriolo, Robotics, 2009, eq. 7.82 and 7.83, motors without mass and inertia."""
    lag = lagrangian(library_robot("planar2r"))
    m1, m2, a1, a2, g, c1, c2, c12, s2, w1, w2 = _two_links(lag)
    l1, l2, I1, I2 = a1 * HALF, a2 * HALF, m1 * a1**2 * TWELFTH, m2 * a2**2 * TWELFTH
    al1, al2 = lag.arm.ring.acceleration(0), lag.arm.ring.acceleration(1)
    tau1 = (
        (I1 + m1 * l1**2 + I2 + m2 * (a1**2 + l2**2 + 2 * a1 * l2 * c2)) * al1
        + (I2 + m2 * (l2**2 + a1 * l2 * c2)) * al2
        - 2 * m2 * a1 * l2 * s2 * w1 * w2
        - m2 * a1 * l2 * s2 * w2**2
        + (m1 * l1 + m2 * a1) * g * c1
        + m2 * l2 * g * c12
    )
    tau2 = (
        (I2 + m2 * (l2**2 + a1 * l2 * c2)) * al1
        + (I2 + m2 * l2**2) * al2
        + m2 * a1 * l2 * s2 * w1**2
        + m2 * l2 * g * c12
    )
    assert _equal(lag.tau, [tau1, tau2])


def test_point_masses_at_the_ends_are_craigs():
    """Craig, Introduction to Robotics, 2005, eq. 6.58 to 6.60: point masses at the distal ends."""
    description = library_robot("planar2r")
    joints = tuple(replace(joint, bodies=(Body(joint.body.mass),)) for joint in description.joints)
    lag = lagrangian(replace(description, joints=joints))
    m1, m2, l1, l2, g, c1, c2, c12, s2, w1, w2 = _two_links(lag)
    al1, al2 = lag.arm.ring.acceleration(0), lag.arm.ring.acceleration(1)
    tau1 = (
        m2 * l2**2 * (al1 + al2)
        + m2 * l1 * l2 * c2 * (2 * al1 + al2)
        + (m1 + m2) * l1**2 * al1
        - m2 * l1 * l2 * s2 * w2**2
        - 2 * m2 * l1 * l2 * s2 * w1 * w2
        + m2 * l2 * g * c12
        + (m1 + m2) * l1 * g * c1
    )
    tau2 = (
        m2 * l1 * l2 * c2 * al1
        + m2 * l1 * l2 * s2 * w1**2
        + m2 * l2 * g * c12
        + m2 * l2**2 * (al1 + al2)
    )
    assert _equal(lag.tau, [tau1, tau2])


def test_the_seeds_second_option_is_the_textbooks_two_link_arm():
    """The seed's option 2: links 2 and 3 of its PUMA as a planar arm of uniform links, l1 = |a2|, l2 = d4.

    With the textbook's angles th1 = q1 and th2 = q2 + 90 degrees, both measured from the horizontal and upwards:
    cos th2 = -s2, sin th2 = c2, cos(th1 + th2) = -sin(q1 + q2).
    """
    puma = Arm.load("puma560_cao")
    at_wrist = np.eye(4)
    at_wrist[2, 3] = -puma.description.numbers.d[5]
    two = puma.with_tool(at_wrist).lock({0: 0, 3: 0, 4: 0, 5: 0}).with_uniform_links().description
    lag = lagrangian(replace(two, joints=tuple(replace(joint, drive=None) for joint in two.joints)))
    ring = lag.arm.ring
    l1 = ring.number((-puma.description.joints[1].a).rational)
    l2 = ring.number(puma.description.joints[3].d.rational)
    g = ring.number(Fraction(981, 100))
    m1, m2 = ring.constant("m1"), ring.constant("m2")
    s1, c1, s2, c2 = ring.sine(0), ring.cosine(0), ring.sine(1), ring.cosine(1)
    w1, w2 = ring.rate(0), ring.rate(1)
    cos1, cos2, sin2, cos12 = c1, -s2, c2, -(s1 * c2 + c1 * s2)
    third = Fraction(1, 3)
    M11 = (third * m1 + m2) * l1**2 + third * m2 * l2**2 + m2 * l1 * l2 * cos2
    M12 = third * m2 * l2**2 + HALF * m2 * l1 * l2 * cos2
    h = HALF * m2 * l1 * l2 * sin2
    assert _equal(lag.M, [[M11, M12], [M12, third * m2 * l2**2]])
    assert _equal(lag.h, [-h * w2 * (2 * w1 + w2), h * w1**2])
    assert _equal(
        lag.g,
        [(HALF * m1 + m2) * l1 * g * cos1 + HALF * m2 * l2 * g * cos12, HALF * m2 * l2 * g * cos12],
    )


HALF, TWELFTH = Fraction(1, 2), Fraction(1, 12)


def _two_links(lag):
    ring = lag.arm.ring
    c1, c2, s1, s2 = ring.cosine(0), ring.cosine(1), ring.sine(0), ring.sine(1)
    constants = [ring.constant(name) for name in ("m1", "m2", "l1", "l2", "g")]
    return (*constants, c1, c2, c1 * c2 - s1 * s2, s2, ring.rate(0), ring.rate(1))


def _equal(elements, expected) -> bool:
    return all(
        a == b for a, b in zip(elements.flat, np.array(expected, dtype=object).flat, strict=True)
    )


# Symbols


def test_parameters_made_of_others_are_written_in_those():
    description = library_robot("planar2r")
    other = description.parameters | {"lc": exact(0)} if False else dict(description.parameters)
    assert set(lagrangian(description).constants) == set(other)


def test_fractions_of_parameters_cancel():
    """The centre of mass of a link with its payload is over m2 + mp; equations have no such fraction left."""
    planar = library_robot("planar2r")
    loaded = replace(
        planar, parameters=type(planar.parameters)(dict(planar.parameters) | {"mp": exact(0.7)})
    )
    first, last = Arm(loaded).with_payload("mp", com=(0.05, 0, 0)).description.joints
    lag = lagrangian(replace(loaded, joints=(first, replace(last, bodies=(last.body,)))))
    assert any("/" in text for text in lag.arm.ring.constants)
    used = {
        g.text
        for element in (*lag.M.flat, *lag.g)
        for monomial in element.terms
        for g, e in zip(lag.arm.ring.generators, monomial, strict=True)
        if e
    }
    assert not any("/" in text for text in used)
    assert lag.prove_euler_lagrange()
    ring = lag.arm.ring
    l2, mp = ring.constant("l2"), ring.constant("mp")
    bare = lagrangian(planar).arm.ring
    assert bare is not ring
    lever = l2 + Fraction(1, 20)
    expected = (
        ring.constant("m2") * l2**2 * Fraction(1, 3)
        + mp * lever**2
        - mp * (lever**2 - lever * lever)
    )
    assert lag.M[1, 1] == expected


def test_inertial_symbols_have_the_field_s_names():
    constants = lagrangian(library_robot("puma560"), "inertial").constants
    assert {"m2", "rx2", "ry2", "rz2", "Ixx2", "Iyz2", "Jm2", "G2", "a2", "d3", "g"} <= set(
        constants
    )
    assert constants["m2"] == 17.4
    assert constants["rx2"] == pytest.approx(17.4 * -0.3638, rel=1e-15)


def test_names_that_the_file_has_are_left_to_it():
    description = from_dh(
        [(0, 0, "a1", 0), (0, 0, "g", 0)],
        parameters={"a1": 0.3, "g": 0.2},
        name="named_like_symbols",
    )
    body = library_robot("planar2r").joints[0].body
    number = Body(
        exact(2), (exact(-0.1), exact(0), exact(0)), body.inertia.__class__(zz=exact(0.1))
    )
    description = replace(
        description, joints=tuple(replace(joint, bodies=(number,)) for joint in description.joints)
    )
    for symbols in ("file", "inertial"):
        for error in errors(lagrangian(description, symbols), 5).values():
            assert error <= TOLERANCE


def test_a_missing_body_is_said():
    with pytest.raises(
        DescriptionError, match=r"joint 2 \(joint2\) has no body.*with_uniform_links"
    ):
        lagrangian(_half_bodied())


def _half_bodied() -> Description:
    bare = from_dh([(0, 0, 0.3, 0), (0, 0, 0.3, 0)])
    return replace(bare, joints=(replace(bare.joints[0], bodies=(Body(exact(1)),)), bare.joints[1]))


def test_unknown_symbols_are_refused():
    with pytest.raises(ValueError, match="symbols is 'all'; expected"):
        lagrangian(library_robot("planar2r"), "all")


def test_mistakes_are_checked():
    description = library_robot("planar2r")
    with pytest.raises(ValueError, match="no mistake 'typo'"):
        derive(description, {"typo"})
    with pytest.raises(ValueError, match="no link 3; expected 1 to 2"):
        derive(description, {MadeAt("mass_forgotten", 3)})
    assert not derive(description, {MadeAt("mass_forgotten", 2)}).g[1]


# Times


@pytest.mark.slow
@pytest.mark.usefixtures("sympy_rings")
def test_exact_puma_without_flint_is_fast(law):
    law.samples(1)
    description = library_robot("puma560")
    start = perf_counter()
    lag = lagrangian(description, "inertial")
    lag.C, lag.g, lag.tau, lag.K  # noqa: B018 - derived when first asked for
    law.takes(
        "exact PUMA, all inertial parameters symbolic, sympy alone, s", perf_counter() - start, 2.0
    )
    start = perf_counter()
    assert lag.prove_euler_lagrange()
    assert lag.prove_skew_symmetry()
    law.takes("both proofs of it, sympy alone, s", perf_counter() - start, 5.0)


@pytest.mark.slow
@pytest.mark.usefixtures("sympy_rings")
def test_exact_panda_without_flint_is_fast(law):
    law.samples(1)
    start = perf_counter()
    lag = lagrangian(library_robot("panda"))
    lag.C, lag.g, lag.tau  # noqa: B018
    law.takes("exact panda, sympy alone, s", perf_counter() - start, 10.0)


def test_exact_puma_with_flint_is_faster(law):
    pytest.importorskip("flint")
    law.samples(1)
    exact_arm.cache_clear()
    start = perf_counter()
    lag = lagrangian(library_robot("puma560"), "inertial")
    lag.C, lag.g, lag.tau  # noqa: B018
    law.takes(
        "exact PUMA, all inertial parameters symbolic, python-flint, s", perf_counter() - start, 0.3
    )


def test_results_are_pickled():
    description = library_robot("cart_pendulum")
    for value in (lagrangian(description), derive(description), base_parameters(description)):
        again = pickle.loads(pickle.dumps(value))
        assert type(again) is type(value)
    again = pickle.loads(pickle.dumps(lagrangian(description)))
    assert again.prove_euler_lagrange()


@pytest.mark.parametrize(
    "mistake", [name for name in MISTAKES if name != "com_rotation_transposed"]
)
def test_mistakes_mean_the_same_in_both_conventions(mistake):
    """The same two rods in both tables: frames lie at the links' far ends, or at their joints.

    A rotation that is transposed is that of the link's own frame, which is another one in the other convention.
    """
    standard = library_robot("planar2r")
    first, second = standard.joints
    l1, l2 = first.a, second.a

    def moved(joint, length):
        return replace(joint.body, com=(length / 2, exact(0), exact(0)))

    joints = (
        replace(first, a=exact(0), bodies=(moved(first, l1),)),
        replace(second, a=l1, bodies=(moved(second, l2),)),
    )
    tool = Tool(Placement((l2, exact(0), exact(0))))
    modified = replace(standard, convention=Convention.MODIFIED, joints=joints, tool=tool)
    q, qd, qdd = (np.random.default_rng(k).normal(size=(4, 2)) for k in range(3))
    torques = []
    for description in (standard, modified):
        wrong = derive(description, {mistake})
        torques.append(wrong.arm.evaluate(wrong.tau, q, qd, qdd))
    assert np.abs(torques[0] - torques[1]).max() < 1e-12


def test_the_heights_that_students_write():
    ring = lagrangian(library_robot("planar2r")).arm.ring
    l1, l2, m2, g = (ring.constant(name) for name in ("l1", "l2", "m2", "g"))
    s1, s2 = ring.sine(0), ring.sine(1)
    s12 = s1 * ring.cosine(1) + ring.cosine(0) * s2

    def height(mistake):
        return derive(library_robot("planar2r"), {mistake}).links[1].V

    assert height("height_relative_angle") == m2 * g * (l1 * s1 + l2 * s2 / 2)
    assert height("height_at_joint") == m2 * g * l1 * s1
    assert height("height_at_end") == height("com_at_end") == m2 * g * (l1 * s1 + l2 * s12)


def test_wrong_arguments_are_said():
    lag = lagrangian(library_robot("planar2r"))
    with pytest.raises(
        TypeError, match="mistakes is 'omega_relative'; expected a set of identities"
    ):
        derive(lag.description, "omega_relative")
    with pytest.raises(TypeError, match="mistake 1: expected MadeAt"):
        derive(lag.description, {1})
    with pytest.raises(RingError, match="is of planar3r with symbols 'file'; expected planar2r"):
        lag.prove_euler_lagrange(derive(library_robot("planar3r")))
    with pytest.raises(ValueError, match=r"M: expected an array of shape \(2, 2\) of elements"):
        lag.replaced(M=np.eye(2))
    with pytest.raises(ValueError, match="no quantity 'N'"):
        lag.replaced(N=lag.M)
    base = base_parameters(lag.description).lagrangian
    with pytest.raises(RingError, match="base parameters: prove the full equations"):
        base.prove_euler_lagrange()
    assert lag.M[0, 0] != base.M[0, 0]
    assert lag.M[1, 1] * 0.5 == lag.M[1, 1] / 2 == lag.M[1, 1] * Fraction(1, 2)


def test_constants_are_those_that_are_printed():
    arm = from_dh([(0, 0, 0.3, "beta"), (0, 0, 0.2, 0)], parameters={"beta": 0.3})
    lag = lagrangian(with_uniform_links(arm))
    assert {str(symbol) for symbol in lag.sympy("g")["g"].free_symbols} <= {
        "q1",
        "q2",
        *lag.constants,
    }
    assert lag.constants["beta"] == 0.3
