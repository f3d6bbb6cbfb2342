"""A task's names of the joint variables hold for programs and papers."""

import pytest

import dhkit
from dhkit.errors import AnswerError
from dhkit.grading import Verdict, grade
from dhkit.grading.answers.sheet import read_task

TASK = 'robot = "planar2r"\n[names]\nq = ["alpha", "beta"]\n'
TEXTS = {
    ".m": "G = [m1*g*l1*cos(alpha)/2 + m2*g*(l1*cos(alpha) + l2*cos(alpha + beta)/2); m2*g*l2*cos(alpha + beta)/2];\n",
    ".py": (
        "from sympy import *\nalpha, beta, g, l1, l2, m1, m2 = symbols('alpha beta g l1 l2 m1 m2')\n"
        "c = cos(alpha + beta)\nG = Matrix([m1*g*l1*cos(alpha)/2 + m2*g*(l1*cos(alpha) + l2*c/2), m2*g*l2*c/2])\n"
    ),
    ".tex": (
        r"\begin{document} \[ G = \begin{bmatrix} \frac{m_1 g l_1}{2} \cos\alpha + m_2 g (l_1 \cos\alpha + "
        r"\frac{l_2}{2} \cos(\alpha + \beta)) \\ \frac{m_2 g l_2}{2} \cos(\alpha + \beta) \end{bmatrix} \] "
        r"\end{document}"
    ),
}


@pytest.mark.parametrize("suffix", TEXTS)
def test_names_of_a_task_are_those_of_a_file(tmp_path, suffix):
    sheet, task = tmp_path / f"answer{suffix}", tmp_path / "task.toml"
    sheet.write_text(TEXTS[suffix])
    task.write_text(TASK)
    arm = dhkit.Arm.load("planar2r")
    assert grade(sheet, arm, task=read_task(task)).verdict is Verdict.CORRECT
    with pytest.raises(AnswerError, match="alpha"):
        grade(sheet, arm)
