"""Steps of inverse kinematics on a sheet: what cannot be read is refused, or says why."""

import re

import pytest

import dhkit
from dhkit.description import library_robot
from dhkit.errors import AnswerError
from dhkit.grading import Verdict
from dhkit.grading.answers.sheet import sheet_of
from dhkit.grading.sheet_judge import judge_sheet


def judged(steps):
    data = {"robot": "puma560", "answer": {"ik": {"steps": steps}}}
    return judge_sheet(library_robot("puma560"), sheet_of(data), seed=1)


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ("x", r"answer.ik.steps: found 'x'; expected 1 to 64 steps such as"),
        ([], "answer.ik.steps: found"),
        ([3], r"answer.ik.steps\[0\]: found 3; expected"),
        (
            [{"joint": "1", "equation": "a = b"}],
            r"answer.ik.steps\[0\].joint: found '1'; expected the joint's number",
        ),
        (
            [{"joint": 1}],
            r"answer.ik.steps\[0\]: found a table; expected an equation, a solution, or both",
        ),
        (
            [{"joint": 1, "equations": "a = b"}],
            r"unknown key answer.ik.steps\[0\].'equations'; did you mean 'equation'",
        ),
        ([{"joint": 1, "equation": [1, {}]}], r"answer.ik.steps\[0\].equation: found"),
    ],
)
def test_sheets_that_cannot_be_read(steps, message):
    with pytest.raises(AnswerError, match=message):
        judged(steps)
    with pytest.raises(AnswerError, match="both branches and steps"):
        sheet_of(
            {"answer": {"ik": {"branches": [["0"]], "steps": [{"joint": 1, "solution": "0"}]}}}
        )


@pytest.mark.parametrize(
    ("formulas", "message"),
    [
        ({"equation": "px*s1"}, "no equals sign between two sides; expected an equation"),
        ({"equation": "px = "}, "no equals sign between two sides; expected an equation"),
        (
            {"equation": "banana = s1"},
            "'banana = s1': defines quantities, and has no equation or solution of q1",
        ),
        (
            {"equation": "D = ±px"},
            "'D = ±px': defines quantities, and has no equation or solution of q1",
        ),
        (
            {"equation": "2*D = px"},
            "unknown name 'D' .* a quantity of your own is defined by an equation, D = ",
        ),
        ({"solution": "q2 = px"}, "'q2' stands in front of a solution of q1"),
        ({"solution": "phi = px"}, "'phi' stands in front of a solution of q1"),
        ({"solution": "py +-sqrt(px)"}, r"'\+-' may be ± or a minus; write ±"),
        ({"solution": "q1 + 1"}, "uses q1, which it is to give"),
        ({"solution": "__import__('os')"}, "position"),
        ({"solution": "("}, "position|bracket|end"),
    ],
)
def test_formulas_that_cannot_be_read_say_why(formulas, message):
    entry = judged([{"joint": 1, **formulas}]).entries[0]
    assert entry.verdict is Verdict.UNREADABLE and re.search(message, entry.statement), (
        entry.statement
    )


# Notations of textbooks

PLANAR = dhkit.Arm.load("planar2r")
COSINE = "(px^2 + py^2 - l1^2 - l2^2)/(2*l1*l2)"
Q1 = "atan2(py, px) - atan2(l2*sin(q2), l1 + l2*cos(q2))"
Q2 = f"±acos({COSINE})"


def planar(second, first=None):
    """Return the report on a planar arm's steps: joint 2, then joint 1."""
    steps = [{"joint": 2, **second}, {"joint": 1, **(first or {"solution": Q1})}]
    return PLANAR.grade(ik={"steps": steps})


@pytest.mark.parametrize(
    ("equation", "solution"),
    [
        ([f"c2 = {COSINE}", "s2 = ±sqrt(1 - c2^2)"], "atan2(s2, c2)"),
        ([f"cos(theta2) = {COSINE}"], "±acos(cos(theta2))"),
        ([f"cos(theta2) = {COSINE} = D"], "atan2(±sqrt(1 - D^2), D)"),
        ([f"D = {COSINE}", "S = ±sqrt(1 - D^2)"], "atan2(S, D)"),
        ([f"c = {COSINE}", "s = ±sqrt(1 - c^2)"], "atan2(s, c)"),
        (["r^2 = px^2 + py^2", "D = (r^2 - l1^2 - l2^2)/(2*l1*l2)"], "±acos(D)"),
        (["r = sqrt(px^2 + py^2)", "alpha = acos((l1^2 + l2^2 - r^2)/(2*l1*l2))"], "pi - alpha"),
        (["phi1 = px^2 + py^2", "phi2 = (phi1 - l1^2 - l2^2)/(2*l1*l2)"], "±acos(phi2)"),
        ([f"cos(phi) = {COSINE}"], "±phi"),
        (
            [r"D = \frac{p_x^2 + p_y^2 - l_1^2 - l_2^2}{2 l_1 l_2}"],
            r"\theta_2 = \mathrm{atan2}(\pm\sqrt{1-D^2}, D)",
        ),
    ],
)
def test_cosines_and_own_letters_are_those_of_the_equations(equation, solution):
    report = planar({"equation": equation, "solution": solution})
    assert report.verdict is Verdict.CORRECT, str(report)


@pytest.mark.parametrize(
    ("equation", "solution"),
    [
        ([f"c2 = 2*{COSINE}", "s2 = ±sqrt(1 - c2^2)"], "atan2(s2, c2)"),
        ([f"c2 = {COSINE}", "s2 = ±sqrt(1 + c2^2)"], "atan2(s2, c2)"),
        ([f"c2 = {COSINE}", "s2 = ±sqrt(1 - c2^2)"], "atan2(c2, s2)"),
        ([f"D = {COSINE}", "S = ±sqrt(1 + D^2)"], "atan2(S, D)"),
        (["r^2 = px^2 - py^2", "D = (r^2 - l1^2 - l2^2)/(2*l1*l2)"], "±acos(D)"),
        ([f"cos(phi) = {COSINE}"], "phi + pi"),
    ],
)
def test_and_wrong_ones_are_wrong(equation, solution):
    assert planar({"equation": equation, "solution": solution}).verdict is Verdict.WRONG


@pytest.mark.parametrize(
    ("equation", "solution", "verdict"),
    [
        (["k1 = l1 + l2*c2", "k2 = l2*s2"], "atan2(py, px) - atan2(k2, k1)", Verdict.CORRECT),
        (
            ["beta = atan2(py, px)", "gamma = atan2(l2*s2, l1 + l2*c2)"],
            "beta - gamma",
            Verdict.CORRECT,
        ),
        (
            ["tan(beta) = py/px", "gamma = atan2(l2*s2, l1 + l2*c2)"],
            "beta - gamma",
            Verdict.CORRECT,
        ),
        # The signs belong to those of joint 2.
        (
            ["r^2 = px^2 + py^2", "cos(psi) = (r^2 + l1^2 - l2^2)/(2*l1*r)"],
            "atan2(py, px) ∓ psi",
            Verdict.CORRECT,
        ),
        (
            ["r^2 = px^2 + py^2", "cos(psi) = (r^2 + l1^2 - l2^2)/(2*l1*r)"],
            "atan2(py, px) ± psi",
            Verdict.WRONG,
        ),
    ],
)
def test_angles_of_triangles(equation, solution, verdict):
    report = planar({"solution": Q2}, {"equation": equation, "solution": solution})
    assert report.verdict is verdict, str(report)


def test_a_name_with_two_signs_holds_for_its_step():
    report = planar(
        {"equation": [f"D = {COSINE}", "S = ±sqrt(1 - D^2)"], "solution": "atan2(S, D)"},
        {"solution": "atan2(py, px) - atan2(l2*S, l1 + l2*D)"},
    )
    assert (
        "it has two signs; write the sine or cosine of q2 in its place"
        in report.entries[1].statement
    )


@pytest.mark.slow
def test_a_product_with_another_factor_does_not_determine_the_joint():
    for equation, verdict in (
        (f"(c2 - {COSINE})*(c2 - px) = 0", Verdict.INCOMPLETE),
        (f"0 = (c2 - {COSINE})*s2", Verdict.INCOMPLETE),
        (f"l1*px*(c2 - {COSINE}) = 0", Verdict.CORRECT),
        (f"(c2 - {COSINE})^2 = 0", Verdict.CORRECT),
        (f"s2^2 = 1 - ({COSINE})^2", Verdict.INCOMPLETE),
        (f"c2^2 = ({COSINE})^2", Verdict.INCOMPLETE),
        (f"sin(2*q2) = 2*s2*({COSINE})", Verdict.INCOMPLETE),
        (f"c2^3 - c2 = ({COSINE})^3 - ({COSINE})", Verdict.INCOMPLETE),
        (f"c2^2 - c2*(px + {COSINE}) + px*({COSINE}) = 0", Verdict.INCOMPLETE),
        ("2*l1*l2*c2 = px^2 + py^2 - l1^2 - l2^2", Verdict.CORRECT),
    ):
        assert planar({"equation": equation}).entries[0].verdict is verdict, equation


def test_how_steps_were_read_is_shown():
    report = planar({"equation": f"c2 = {COSINE}", "solution": "±acos(c2)"})
    root = "acos((px^2 + py^2 - l1^2 - l2^2)/(2*l1*l2))"
    assert report.entries[0].read == f"cos(q2) = {root[5:-1]}; q2 = {root}; q2 = -{root}"
    assert report.entries[0].latex.startswith(r"\cos(q_{2}) = \frac")


def test_how_branches_were_read_is_shown():
    report = PLANAR.grade(ik={"branches": [[Q1, f"acos({COSINE})"]]})
    assert report.entries[0].read.endswith("; q2 = acos((px^2 + py^2 - l1^2 - l2^2)/(2*l1*l2))")


def test_a_step_may_define_the_letters_of_an_earlier_one_anew():
    report = planar(
        {"equation": [f"D = {COSINE}", "S = ±sqrt(1 - D^2)"], "solution": "atan2(S, D)"},
        {
            "equation": ["S = l2*sin(q2)", "D = l1 + l2*cos(q2)"],
            "solution": "atan2(py, px) - atan2(S, D)",
        },
    )
    assert report.verdict is Verdict.CORRECT, str(report)
