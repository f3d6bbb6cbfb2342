"""Programs and papers are read, not run: what they assign, in order, and nothing that was changed afterwards."""

import json
import re

import pytest

from dhkit.description import library_robot
from dhkit.errors import AnswerError
from dhkit.grading import Verdict, grade

ROBOT = library_robot("planar2r")
V = "m1*g*l1/2*sin(q1) + m2*g*(l1*sin(q1) + l2/2*sin(q1 + q2))"
M = "[[m1*l1**2/3 + m2*(l1**2 + l2**2/3) + a, b], [b, m2*l2**2/3]]"
PYTHON = f"""
import sympy as sp
\'\'\'
V = 3
\'\'\'
q1, q2 = sp.symbols("q1 q2")
l1 = 0.5   # metres
g = 9.81
a = m2*l1*l2*sp.cos(q2)
b = (m2*l2**2/3
     + a/2)
M = sp.Matrix({M})
M = sp.simplify(M)
tau = M*ddq + C*dq
V = sp.simplify({V})
print(V)
"""
MATLAB = """
function M = mass(q)
%{
V = 3
%}
c2 = cos(q2); % elbow
a = m2*l1*l2*c2;
M = zeros(2,2);
M(1,1) = m1*l1^2/3 + m2*(l1^2 + l2^2/3) + a;
M(1,2) = m2*l2^2/3 + a/2;
M(2,1) = M(1,2);
M(2,2) = m2*l2^2/3;
g = 9.81;
G = [m1*g*l1*cos(q1)/2 + m2*g*(l1*cos(q1) + l2*cos(q1+q2)/2)
     m2*g*l2*cos(q1+q2)/2];
"""
LATEX = r"""
\\documentclass{article}
\\newcommand{\\ct}{\\cos\\theta}
The mass matrix is
\\[ M(q) = \\begin{bmatrix} \\frac13 m_1 l_1^2 + m_2 (l_1^2 + \\frac{l_2^2}{3} + l_1 l_2 c_2) & m_2(\\frac{l_2^2}{3}
+ \\frac12 l_1l_2 c_2) \\\\ m_2(\\frac{l_2^2}{3}+\\frac12 l_1l_2 c_2) & \\frac{1}{3}m_2l_2^2 \\end{bmatrix}. \\]
\\begin{align*}
g_1 &= \\frac{1}{2} m_1 g l_1 c_1 + m_2 g (l_1 c_1 + \\tfrac12 l_2 c_{12}) \\\\
g_2 &= \\tfrac12 m_2 g l_2 \\cos(\\theta_1+\\theta_2)
\\end{align*}
""".replace("\\\\", "\\")


def graded(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    return grade(tmp_path / name, ROBOT)


@pytest.mark.parametrize(
    ("name", "text", "quantities"),
    [
        ("a.py", PYTHON, ("M", "V")),
        ("a.m", MATLAB, ("g", "M")),
        ("a.tex", LATEX, ("M", "g")),
        (
            "a.ipynb",
            json.dumps({"cells": [{"cell_type": "code", "source": PYTHON.splitlines(True)}]}),
            ("M", "V"),
        ),
    ],
)
def test_homework_as_it_is_handed_in(tmp_path, name, text, quantities):
    report = graded(tmp_path, name, text)
    assert report.verdict is Verdict.CORRECT, str(report)
    assert set(report.quantities) == set(quantities)


@pytest.mark.parametrize(
    "lines",
    [
        f"V = {V}\nV += m1*g*l1*sin(q1)",
        f"V = {V}\nV = 3",
        f"V = {V}\nV = V*2",
        "c1 = sin(q1)\ng = [(m1/2 + m2)*g*l1*c1 + m2*g*l2*cos(q1+q2)/2, m2*g*l2*cos(q1+q2)/2]",
        f"m2 = 2*m1\nV = {V}",
        f"a = m1\nV = {V.replace('m1', 'a')}\na = m2",
        "M = [[1, 0], [0, 1]]\nM[0,0] = 7",
    ],
)
def test_what_is_changed_afterwards_is_never_taken_for_what_it_was(tmp_path, lines):
    try:
        report = graded(tmp_path, "a.py", lines)
    except AnswerError as error:
        report, refusal = None, str(error)
    assert (
        not report
        if report is not None
        else re.search(
            "line 1, and is the robot's own name|(assigned twice|changed after).* line [23]",
            refusal,
        )
    )


def test_a_name_of_the_students_goes_before_the_shorthand(tmp_path):
    lines = (
        "c1 = cos(q1)/2\ng = [(m1/2 + m2)*g*l1*2*c1 + m2*g*l2*cos(q1+q2)/2, m2*g*l2*cos(q1+q2)/2]"
    )
    assert graded(tmp_path, "a.py", lines).verdict is Verdict.CORRECT


def test_a_program_without_an_answer(tmp_path):
    with pytest.raises(AnswerError, match="assigns no quantity"):
        graded(tmp_path, "a.py", "x = 3")
    with pytest.raises(AnswerError, match="which robot"):
        grade(tmp_path / "a.py")
