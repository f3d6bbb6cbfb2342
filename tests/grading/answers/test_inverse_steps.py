"""Steps of inverse kinematics on a sheet: what cannot be read is refused, or says why.

Modules: inverse_steps, pose_entries, sheet_values.
"""

import re

import pytest

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
        ([{"joint": "1", "equation": "a = b"}], r"answer.ik.steps\[0\].joint: found '1'; expected the joint's number"),
        ([{"joint": 1}], r"answer.ik.steps\[0\]: found a table; expected an equation, a solution, or both"),
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
        sheet_of({"answer": {"ik": {"branches": [["0"]], "steps": [{"joint": 1, "solution": "0"}]}}})


@pytest.mark.parametrize(
    ("formulas", "message"),
    [
        ({"equation": "px*s1"}, "no equals sign between two sides; expected an equation"),
        ({"equation": "px = "}, "no equals sign between two sides; expected an equation"),
        ({"equation": "banana = s1"}, "'banana = s1': defines quantities, and has no equation or solution of q1"),
        ({"equation": "D = ±px"}, "'D = ±px': defines 'D' with two signs; write ± where it is used"),
        ({"equation": "2*D = px"}, "unknown name 'D' .* a quantity of your own is defined by an equation, D = "),
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
    assert entry.verdict is Verdict.UNREADABLE and re.search(message, entry.statement), entry.statement
