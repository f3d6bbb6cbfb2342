"""The ring's laws: relations, normal forms, derivatives, and reading of exact expressions."""

from __future__ import annotations

import pickle
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, strategies as st

from dhkit.expressions import exact, parse
from dhkit.symbolic.ring import Constant, Ring, RingError
from dhkit.symbolic.ring.constants import Constants, value_of


@pytest.fixture(params=["flint", "sympy"])
def ring(request, monkeypatch):
    if request.param == "flint":
        pytest.importorskip("flint")
    else:
        monkeypatch.setenv("DHKIT_FLINT", "off")
    return Ring(
        "RP",
        [
            Constant("m1"),
            Constant("m2"),
            Constant("sqrt(2)", square=exact(2)),
            Constant("1/(m1 + m2)", reciprocal_of=parse("m1 + m2", names=["m1", "m2"])),
            Constant("1/m2", reciprocal_of=parse("m2", names=["m2"])),
        ],
    )


def test_relations(ring):
    c, s, r = ring.cosine(0), ring.sine(0), ring.constant("sqrt(2)")
    assert c * c + s * s == 1
    assert r * r == 2
    assert (c + s) ** 4 == 1 + 4 * c * s + 4 * c**2 * s**2
    assert ring.sine(0) != ring.cosine(0)


def test_reciprocals_cancel_and_partial_fractions_are_equal(ring):
    m1, m2, u, w = (ring.constant(text) for text in ("m1", "m2", "1/(m1 + m2)", "1/m2"))
    assert (m1 + m2) * u == 1
    assert m1 * u + m2 * u == 1
    assert u * w * m1 == w - u
    assert u * w * m1 != w + u
    assert (m1 + m2) ** 3 * u**2 == m1 + m2


def test_derivatives_are_those_of_finite_differences(ring):
    c, s, d = ring.cosine(0), ring.sine(0), ring.position(1)
    element = 3 * c**3 * s * d**2 - c * d + ring.constant("m1") * s
    constants = dict.fromkeys(ring.constants, 1.5)
    q, h = np.array([0.7, -0.4]), 1e-6

    def at(e, q):
        return e.value(ring.values(constants, q))

    for i in range(2):
        step = h * np.eye(2)[i]
        numeric = (at(element, q + step) - at(element, q - step)) / (2 * h)
        assert at(element.by_position(i), q) == pytest.approx(numeric, abs=1e-8)


def test_by_time_is_the_chain_rule(ring):
    element = ring.cosine(0) * ring.rate(1) * ring.position(1)
    expected = (
        -ring.sine(0) * ring.rate(0) * ring.rate(1) * ring.position(1)
        + ring.cosine(0) * ring.acceleration(1) * ring.position(1)
        + ring.cosine(0) * ring.rate(1) ** 2
    )
    assert element.by_time() == expected


def test_elements_of_two_rings_do_not_mix(ring):
    with pytest.raises(RingError, match="two rings"):
        ring.one + Ring("RP").one


def test_unknown_constant_names_those_there_are(ring):
    with pytest.raises(RingError, match=r"no 'm3' in the ring; it has .*m1"):
        ring.constant("m3")


def test_a_product_too_long_is_refused():
    ring = Ring("", [Constant(f"x{k}") for k in range(40)])
    total = ring.sum(ring.constant(f"x{k}") for k in range(40))
    with pytest.raises(RingError, match="terms"):
        total**8


def test_sums_of_angles_are_equal_to_what_they_stand_for():
    ring = Ring("RRR", sums=[(1, 2), (0, 1, 2)])
    place = ring.place("cosine", "c23")
    monomial = [0] * len(ring.generators)
    monomial[place] = 1
    c23 = ring.from_terms({tuple(monomial): Fraction(1)})
    assert c23 == ring.cosine(1) * ring.cosine(2) - ring.sine(1) * ring.sine(2)
    assert c23.by_position(2) == -ring.sine(1) * ring.cosine(2) - ring.cosine(1) * ring.sine(2)


@given(st.integers(-23, 23), st.integers(-23, 23))
def test_multiples_of_15_degrees_are_exact(first, second):
    angles = [parse(f"pi*{k}/12") for k in (first, second, first + second)]
    constants = Constants.of([], angles)
    ring = Ring("R", list(constants.found.values()))
    (c1, s1), (c2, s2), (c3, s3) = (ring.direction(angle) for angle in angles)
    assert c1 * c2 - s1 * s2 == c3
    assert s1 * c2 + c1 * s2 == s3
    assert not constants.notes


@pytest.mark.parametrize(
    "texts",
    [("0.3", "0.6", "0.9"), ("pi/7", "2*pi/7", "3*pi/7"), ("beta/2", "beta", "3*beta/2"), ("beta", "pi/6 - 0.2",
      "beta + pi/6 - 0.2")],
)  # fmt: skip
def test_other_angles_are_symbols_that_add_up(texts):
    angles = [parse(text, names=["beta"]) for text in texts]
    constants = Constants.of([], angles)
    ring = Ring("R", list(constants.found.values()))
    (c1, s1), (c2, s2), (c3, s3) = (ring.direction(angle) for angle in angles)
    assert c1 * c2 - s1 * s2 == c3
    assert s1 * c2 + c1 * s2 == s3
    values = {
        text: value_of(constant, {"beta": exact(0.7)}) for text, constant in constants.found.items()
    }
    numbers = ring.values(values, np.zeros(1))
    assert s3.value(numbers) == pytest.approx(np.sin(float(substituted(angles[2]))), abs=1e-15)


def substituted(angle):
    from dhkit.expressions import substitute

    return substitute(angle, {"beta": exact(0.7)})


def test_what_is_a_symbol_though_a_number_is_said():
    constants = Constants.of([parse("atan2(l1, 2)", names=["l1"])], [parse("0.3")])
    assert any("cos(0.3)" in note for note in constants.notes)
    assert any("atan2" in note for note in constants.notes)


def test_expressions_are_read_exactly():
    names = ["l1", "l2", "m1", "m2"]
    texts = [
        "m1*l1^2/12",
        "(m1*l1 + m2*l2)/(m1 + m2)",
        "sqrt(l1^2 + l2^2)",
        "1/m1",
        "sqrt(2)*sqrt(3)",
        "pi*l1^2",
    ]
    expressions = [parse(text, names=names) for text in texts]
    ring = Ring("R", list(Constants.of(expressions, []).found.values()))
    steiner, com, diagonal, inverse, six, area = map(ring.read, expressions)
    m1, m2, l1, l2 = (ring.constant(name) for name in ("m1", "m2", "l1", "l2"))
    assert 12 * steiner == m1 * l1**2
    assert com * (m1 + m2) == m1 * l1 + m2 * l2
    assert diagonal**2 == l1**2 + l2**2
    assert inverse * m1 == 1
    assert six**2 == 6
    assert area == ring.constant("pi") * l1**2


def test_rings_and_elements_are_pickled(ring):
    element = ring.cosine(0) * ring.constant("m1") + ring.constant("1/(m1 + m2)")
    other = pickle.loads(pickle.dumps(element))
    assert other == element
    assert other.ring == ring
    assert hash(other.ring) == hash(ring)
    assert str(other) == str(element)


@pytest.mark.parametrize("flint", ["on", "off"])
def test_a_root_inside_a_root_is_reduced_too(flint, monkeypatch):
    """x^2 = 2 + y, y^2 = 3: both ways of multiplying x x y are 3 + 2 y."""
    monkeypatch.setenv("DHKIT_FLINT", flint)
    ring = Ring("R", list(Constants.of([parse("sqrt(2 + sqrt(3))")], []).found.values()))
    x = ring.read(parse("sqrt(2 + sqrt(3))"))
    y = ring.read(parse("sqrt(3)"))
    assert ((x * y) * x - (x * x) * y).is_zero
    assert ((x * y) * x - 3 - 2 * y).is_zero
    assert (x**4 - 4 * x**2 + 1).is_zero
