"""What the parser reads, and what it refuses, fast."""

import contextlib
import time

import pytest
from hypothesis import given, strategies as st

from dhkit.errors import ExpressionError
from dhkit.expressions import Budget, exact, parse

NAMES = ("l1", "m1", "x", "y", "z")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("17*inch", 0.4318),
        ("2*mm + 3*cm", 0.032),
        ("90*deg/pi", 0.5),
        ("0.1 + 0.2", 0.3),
        ("-2^2", -4),
        ("2^-1", 0.5),
        ("2**3**2", 512),
        ("2^(1/2)*2^0.5", 2),
        ("--3", 3),
        ("1e3", 1000),
        (".5", 0.5),
        ("5.", 5),
        ("4^0.5", 2),
        ("atan2(1, 1)/pi", 0.25),
        ("abs(-3)", 3),
        ("tan(45*deg)", 1),
        ("acos(0)/deg", 90),
        ("asin(1/2)/deg", 30),
        ("atan(1)/deg", 45),
        ("sin(30*deg)", 0.5),
        (" 1 / 4 ", 0.25),
        ("6/2/3", 1),
        ("2-3-4", -5),
    ],
)
def test_text_has_the_value_that_school_gives_it(text, value):
    assert parse(text) == exact(value)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "ends where"),
        ("1 2", "found '2' at position 3"),
        ("2m1", "found 'm1'"),
        ("(1", r"ends where '\)'"),
        ("1)", "expected an operator"),
        ("l2", "unknown name 'l2'; known are l1"),
        ("incj", "did you mean 'inch'"),
        ("foo(1)", "unknown function 'foo'"),
        ("__import__('os')", "unexpected character"),
        ("__import__(os)", "unknown name 'os'|unknown function"),
        ("().__class__", "unexpected character"),
        ("l1.real", "unexpected character"),
        ("lambda: 1", "unexpected character"),
        ("l1 if l1 else m1", "found 'if'"),
        ("[1]", "unexpected character"),
        ("sin()", "found"),
        ("sin(1, 2)", "sin takes 1 argument, found 2"),
        ("atan2(1)", "takes 2 arguments"),
        ("1/0", "division by zero"),
        ("1/(l1-l1)", "division by zero"),
        ("sqrt(-1)", "not real"),
        ("asin(2)", "not real"),
        ("tan(90*deg)", "not finite"),
        ("1e400", "beyond the range"),
        ("1e99999999", "beyond the range"),
        ("9" * 500, "beyond the range"),
        ("10**10**10", "exponent|too many"),
        ("((9^64)^64)^64", "too long"),
        ("l1^m1", "exponent of m1"),
        ("l1^(1/3)", "whole number or half"),
        ("(" * 10_000 + "1" + ")" * 10_000, "characters"),
        ("(" * 4000 + "1" + ")" * 4000, "nested more"),
        ("-" * 9999, "ends where"),
        ("sin(" * 60 + "1" + ")" * 60, "nested more"),
        ("2^" * 60 + "1", "nested more"),
        ("(x+y+z+1)^60", "too many terms"),
        ("*".join(["(x+y+z+l1+1)"] * 700), "too many terms|more than 2000 terms"),
        ("π", "unexpected character"),
        ("1,2", "expected an operator"),
        ("l1;m1", "unexpected character"),
        ("nan", "unknown name"),
        ("inf", "unknown name"),
        ("0x10", "found 'x10'"),
    ],
)
def test_what_is_no_expression_is_refused_in_one_short_line(text, complaint):
    with pytest.raises(ExpressionError, match=complaint) as error:
        parse(text, NAMES)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 300


@given(st.text(alphabet="0123456789.eE+-*/^() ,lm1sinqrtpg_", max_size=60))
def test_any_text_is_read_or_refused(text):
    try:
        expression = parse(text, NAMES)
    except ExpressionError:
        return
    assert parse(expression.text, NAMES) == expression


def test_a_long_sum_is_no_deep_one():
    assert parse("+".join(["1"] * 4000)) == exact(4000)


def test_a_budget_is_shared():
    budget = Budget(5000)
    with budget, pytest.raises(ExpressionError, match="too many terms"):
        for _ in range(1000):
            parse("(x + y)^8 + (y + z)^8", NAMES)
    assert parse("(x + y)^8", NAMES).symbols == {"x", "y"}
    assert budget.left < 0


@pytest.mark.slow
def test_hostile_text_takes_no_time(law):
    """Each of these would run for minutes, or fill the memory, if it were worked out."""
    for text in (
        "10**10**10",
        "(x+y+z+l1+m1)^64",
        "*".join(["(x+y+z+1)"] * 900),
        "((((x+1)^64+1)^64+1)^64+1)^64",
        "sin(" * 49 + "(x+y+1)^30" + ")" * 49,
        "1/(x+" * 49 + "1" + ")" * 49,
        "*".join(["sqrt(x+y+z)^63"] * 100),
        "*".join(["sqrt(x+y)"] * 900),
        "*".join(["(x+1)/(x+2)"] * 400),
        "(" + "+".join(f"sin({i}*x)" for i in range(200)) + ")^2",
        "+".join(f"sin(x+{i})" for i in range(900)),
        "+".join(f"sin((x+y)^{i % 20})" for i in range(400)),
    ):
        start = time.process_time()
        with contextlib.suppress(ExpressionError):
            parse(text, NAMES)
        law.takes("seconds to refuse an expression", time.process_time() - start, 1.0, text[:40])
