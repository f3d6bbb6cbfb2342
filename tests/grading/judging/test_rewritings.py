"""An answer may be written in any way: what sympy makes of the truth, and what students do, stays correct."""

import pytest
import sympy
from hypothesis import HealthCheck, given, settings, strategies as st
from sympy.simplify.fu import TR8, TR10

from dhkit.grading import Verdict, grade_answers
from dhkit.symbolic import lagrangian
from grading_answers import corpus_robot

ROBOTS = ("planar2r", "polar_rp", "cart_pendulum", "pan_tilt", "planar3r")
TURNING = {
    "planar2r": "q2",
    "polar_rp": "q1",
    "cart_pendulum": "q2",
    "pan_tilt": "q2",
    "planar3r": "q3",
}
FACTORS = ("l1 + l2", "m1 + g*l1", "2 + cos(Q)", "l1*sin(Q)**2 + l1")


def shifted(expression, sign):
    """Write cosines as shifted sines."""
    return expression.replace(
        sympy.cos, lambda x: sympy.sin(x + sign * sympy.pi / 2, evaluate=False) * sign
    )


STEPS = {
    "expand": sympy.expand,
    "factor": sympy.factor,
    "expand_trig": sympy.expand_trig,
    "product to sum": TR8,
    "sum to product": TR10,
    "together": sympy.together,
    "shift": lambda x: shifted(x, 1),
    "shift back": lambda x: shifted(x, -1),
    "times one": lambda x: sympy.Mul(
        x, sympy.sin(sympy.Symbol("Q")) ** 2 + sympy.cos(sympy.Symbol("Q")) ** 2
    ),
    "tangents": lambda x: x.replace(sympy.sin, lambda a: sympy.tan(a) * sympy.cos(a)),
    "double angles": lambda x: x.replace(
        lambda e: e.is_Pow and e.exp == 2 and e.base.func is sympy.cos,
        lambda e: (1 + sympy.cos(2 * e.base.args[0])) / 2,
    ),
    "decimals": lambda x: x.replace(
        lambda e: e.is_Rational and not e.is_Integer and e.q in (2, 4, 5, 8),
        lambda e: sympy.Float(e, 15),
    ),
}


def entries_of(robot):
    lag = lagrangian(corpus_robot(robot))
    found = []
    for name, value in lag.sympy(("M", "h", "g", "tau")).items():
        found.append((name, [sympy.Matrix(value).row(i).tolist()[0] for i in range(lag.n)]))
    return found


TRUTH = {robot: entries_of(robot) for robot in ROBOTS}


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    robot=st.sampled_from(ROBOTS),
    which=st.integers(0, 3),
    steps=st.lists(st.sampled_from(sorted(STEPS)), min_size=1, max_size=3),
    factor=st.sampled_from(["", *FACTORS]),
)
def test_every_rewriting_is_accepted(robot, which, steps, factor):
    check(robot, which, steps, factor)


def check(robot, which, steps, factor):
    name, rows = TRUTH[robot][which]
    factor = factor.replace("Q", TURNING[robot])
    answer = []
    for row in rows:
        changed = []
        for entry in row:
            for step in steps:
                entry = STEPS[step](entry)
            text = str(entry.subs(sympy.Symbol("Q"), sympy.Symbol(TURNING[robot])))
            symbols = {str(symbol) for symbol in sympy.sympify(factor or "1").free_symbols}
            known = {str(s) for r in rows for e in r for s in e.free_symbols} | {TURNING[robot]}
            if factor and symbols <= known:
                text = f"({text})*({factor})/({factor})"
            changed.append(text)
        answer.append(changed if name == "M" else changed[0])
    report = grade_answers(corpus_robot(robot), {name: answer})
    assert report.verdict in (Verdict.CORRECT, Verdict.ROUNDED), (
        steps,
        factor,
        str(report),
        answer,
    )
    # 15 digits of a decimal that ends are the decimal itself.
    assert report.verdict is Verdict.CORRECT or "decimals" in steps


def test_rewritings_at_full_size(law):
    """Accept every rewriting, drawn at random."""
    import numpy as np

    rng = np.random.default_rng(4)
    for _ in range(law.samples(400)):
        steps = [sorted(STEPS)[k] for k in rng.integers(len(STEPS), size=rng.integers(1, 4))]
        check(
            ROBOTS[rng.integers(len(ROBOTS))],
            rng.integers(4),
            steps,
            ["", *FACTORS][rng.integers(5)],
        )
    law.holds("rewritings that are not accepted", 0, 0)


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_truth_itself_is_accepted(robot):
    for name, rows in TRUTH[robot]:
        answer = (
            [[str(e) for e in row] for row in rows]
            if name == "M"
            else [str(row[0]) for row in rows]
        )
        assert grade_answers(corpus_robot(robot), {name: answer}).verdict is Verdict.CORRECT
