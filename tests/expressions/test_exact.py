"""Laws of exact numbers."""

import math
import pickle
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, strategies as st

from dhkit.errors import ExpressionError
from dhkit.expressions import (
    PI,
    Expression,
    arc_tangent,
    cos,
    exact,
    exact_angle,
    parse,
    sin,
    sqrt,
    substitute,
)

NAMES = ("l1", "m1", "q")
ROUNDED_ANGLE = 2e-15  # what rounding an angle of up to 8 rad moves its sine in the reference

rationals = st.fractions(min_value=-100, max_value=100, max_denominator=1000)


@st.composite
def expressions(draw):
    leaf = st.one_of(
        rationals.map(Expression.number), st.sampled_from(NAMES).map(Expression.symbol), st.just(PI)
    )
    combine = st.recursive(
        leaf,
        lambda inner: st.one_of(
            st.tuples(inner, inner).map(lambda pair: pair[0] + pair[1]),
            st.tuples(inner, inner).map(lambda pair: pair[0] - pair[1]),
            st.tuples(inner, inner).map(lambda pair: pair[0] * pair[1]),
            inner.map(lambda x: x if x.is_zero else 1 / x),
            inner.map(sin),
            inner.map(cos),
        ),
        max_leaves=6,
    )
    return draw(combine)


@given(expressions())
def test_text_reads_back_to_an_equal_value(expression):
    assert parse(expression.text, NAMES) == expression


@given(expressions(), expressions(), expressions())
def test_sums_and_products_commute_and_distribute(a, b, c):
    assert a + b == b + a
    assert a * b == b * a
    assert (a + b) * c == a * c + b * c


@given(expressions(), st.floats(0.5, 2.0), st.floats(0.5, 2.0), st.floats(-3, 3))
def test_the_value_is_that_of_the_same_arithmetic_in_floats(expression, l1, m1, q):
    values = {"l1": exact(l1), "m1": exact(m1), "q": exact(q)}
    try:
        seen = float(substitute(expression, values))
    except ExpressionError:
        return  # a division by zero that only these values have
    namespace = {"l1": l1, "m1": m1, "q": q, "pi": math.pi, "sin": math.sin, "cos": math.cos}
    # The text is our own printer's, of a tree that Hypothesis built: evaluating it is the independent path.
    try:
        expected = eval(expression.text.replace("^", "**"), {"__builtins__": {}}, namespace)
    except (ZeroDivisionError, OverflowError):
        return
    terms = sum(abs(float(substitute(Expression((term,)), values))) for term in expression.terms)
    # Sines of large arguments amplify what rounding their argument moved.
    assert seen == pytest.approx(expected, rel=1e-9, abs=1e-9 * (1 + terms))


@pytest.mark.parametrize("step", range(-30, 31))
def test_multiples_of_15_degrees_have_exact_sines(step):
    angle = PI * Fraction(step, 12)
    s, c = sin(angle), cos(angle)
    assert s * s + c * c == exact(1)
    assert float(s) == pytest.approx(math.sin(step * math.pi / 12), abs=ROUNDED_ANGLE)
    assert float(c) == pytest.approx(math.cos(step * math.pi / 12), abs=ROUNDED_ANGLE)
    assert arc_tangent(s, c) == PI * Fraction((step + 11) % 24 - 11, 12)


def test_a_right_angle_has_the_cosine_zero():
    assert cos(parse("90*deg")).is_zero
    assert cos(exact_angle(exact(1.5707963267948966))).is_zero
    assert float(cos(PI / 2)) == 0.0


@pytest.mark.parametrize("step", range(-48, 49))
def test_only_the_nearest_double_is_taken_for_a_part_of_a_turn(step):
    nearest = float(PI * Fraction(step, 12))
    assert exact_angle(exact(nearest)) == PI * Fraction(step, 12)
    if step:
        for neighbour in (np.nextafter(nearest, 9), np.nextafter(nearest, -9)):
            assert exact_angle(exact(neighbour)).rational == Fraction(repr(float(neighbour)))


@pytest.mark.parametrize(
    ("number", "value"),
    [
        (0.1, Fraction(1, 10)),
        (Decimal("0.67183"), Fraction(67183, 100_000)),
        (np.float32(0.5), Fraction(1, 2)),
        (Fraction(1, 3), Fraction(1, 3)),
        (np.int64(-7), Fraction(-7)),
        (2e-4, Fraction(1, 5000)),
        (-1e-30, -Fraction(1, 10**30)),
    ],
)
def test_numbers_are_what_was_written(number, value):
    assert exact(number).rational == value


@pytest.mark.parametrize(
    "number", [math.nan, math.inf, -math.inf, Decimal("NaN"), Decimal("1e400"), "1", True, None, 1j]
)
def test_what_is_no_finite_number_is_refused(number):
    with pytest.raises(ExpressionError):
        exact(number)


def test_square_roots_of_squares_are_rational_and_others_multiply_out():
    assert sqrt(exact(Fraction(9, 4))) == exact(1.5)
    assert sqrt(exact(2)) * sqrt(exact(3)) == sqrt(exact(6))
    assert sqrt(exact(6)) ** 2 == exact(6)
    assert parse("1/sqrt(2)") == parse("sqrt(2)/2")


def test_fractions_of_parameters_cancel_where_they_are_proportional():
    names = ("m2", "mp")
    assert parse("(2*m2 + 2*mp)/(m2 + mp)", names) == exact(2)
    assert parse("1/(2*m2 + 2*mp)", names) * 2 == parse("1/(m2 + mp)", names)


def test_expressions_are_values():
    expression = parse("m1*l1^2/12 + sin(q)/sqrt(3)", NAMES)
    assert pickle.loads(pickle.dumps(expression)) == expression
    assert {expression: 1}[parse("sin(q)*sqrt(3)/3 + l1^2*m1/12", NAMES)] == 1
    assert expression.symbols == {"m1", "l1", "q"}
