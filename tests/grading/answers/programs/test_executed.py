"""Programs that are executed: what their names and functions are, as formulas where they can be, else at states."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

import dhkit
from acceptance import slow_if
from conftest import require
from dhkit.cli import main
from dhkit.description import library_robot
from dhkit.errors import AnswerError
from dhkit.execution import Isolation, Kind, find_isolation
from dhkit.execution.bounds import BOUNDS
from dhkit.grading import grade
from dhkit.grading.answers.sheet import read_task
from dhkit.grading.grade_report import Verdict

ROBOT = "planar2r"
M = (
    "[[m1*l1**2/3 + m2*(l1**2 + l2**2/3 + l1*l2*cos(q2)), m2*l2**2/3 + m2*l1*l2*cos(q2)/2],"
    " [m2*l2**2/3 + m2*l1*l2*cos(q2)/2, m2*l2**2/3]]"
)
LAGRANGE = """
from sympy import *
t = symbols("t")
m = symbols("m1:3")
l = symbols("l1:3")
g = symbols("g")
q = [Function(f"q{i + 1}")(t) for i in range(2)]
K = V = 0
x = y = angle = 0
for i in range(2):
    angle += q[i]
    xc, yc = x + l[i]*cos(angle)/2, y + l[i]*sin(angle)/2
    x, y = x + l[i]*cos(angle), y + l[i]*sin(angle)
    K += m[i]*(diff(xc, t)**2 + diff(yc, t)**2)/2 + m[i]*l[i]**2/12*diff(angle, t)**2/2
    V += m[i]*g*yc
L = K - V
tau = Matrix([diff(diff(L, qi.diff(t)), t) - diff(L, qi) for qi in q])
"""
"""Newton's way through a loop, which the reader of programs refuses."""


@pytest.fixture
def judged(tmp_path):
    """Write a program, execute it without isolation, and return its report."""

    def run(text, name="answer.py", robot=ROBOT, **options):
        path = tmp_path / name
        path.write_text(text)
        options.setdefault("isolation", Isolation(Kind.NONE, "a test"))
        return grade(path, library_robot(robot), execute=True, **options)

    return run


def verdicts(report):
    return {
        quantity: max(
            (entry.verdict for entry in report.of(quantity)), key=lambda one: one.severity
        )
        for quantity in report.quantities
    }


@pytest.mark.slow
def test_a_derivation_with_loops_is_proved(judged):
    report = judged(LAGRANGE)
    assert verdicts(report) == dict.fromkeys(("K", "V", "L", "tau"), Verdict.CORRECT)
    assert any("executed, not isolated" in str(note) for note in report.notes)


@pytest.mark.slow
def test_a_mistake_is_found_and_named(judged):
    report = judged(LAGRANGE.replace("/12*diff", "/3*diff"))
    assert verdicts(report)["K"] is Verdict.WRONG and verdicts(report)["V"] is Verdict.CORRECT
    assert report.diagnosis


def test_names_without_a_value_are_symbols(judged):
    assert verdicts(judged(f"from numpy import cos, array\nM = array({M})")) == {
        "M": Verdict.CORRECT
    }


RIGHT_PROGRAMS = [
    f"import numpy as np\nfrom numpy import cos\ndef M(q):\n    q1, q2 = q\n    return np.array({M})",
    f"from math import cos\ndef mass_matrix(q, p):\n    m1, m2, l1, l2 = p.m1, p.m2, p.l1, p['l2']\n    q2 = q[1]\n"
    f"    return {M}",
    "import numpy as np\ndef M(q1, q2, m1, m2, l1, l2):\n    M = np.zeros((2, 2))\n    c = np.cos(q2)\n"
    "    M[0, 0] = m1*l1**2/3 + m2*(l1**2 + l2**2/3 + l1*l2*c)\n    M[0, 1] = M[1, 0] = m2*l2**2/3 + m2*l1*l2*c/2\n"
    "    M[1, 1] = m2*l2**2/3\n    return M",
    f"import casadi as ca\nfrom casadi import cos\nm1, m2, l1, l2 = map(ca.SX.sym, ('m1', 'm2', 'l1', 'l2'))\n"
    f"q = ca.SX.sym('q', 2)\nq2 = q[1]\nrows = {M}\nM = ca.vertcat(*[ca.horzcat(*row) for row in rows])",
    f"import casadi as ca\nfrom casadi import cos\nnames = 'q1 q2 m1 m2 l1 l2'.split()\n"
    f"q1, q2, m1, m2, l1, l2 = map(ca.MX.sym, names)\nM = ca.vertcat(*[ca.horzcat(*row) for row in {M}])",
    f"import casadi as ca\nfrom casadi import cos\ndef M(q, m1, m2, l1, l2):\n    q1, q2 = q[0], q[1]\n"
    f"    return ca.vertcat(*[ca.horzcat(*row) for row in {M}])",
]


@pytest.mark.parametrize(
    "text", [slow_if(k % 4 > 0, text) for k, text in enumerate(RIGHT_PROGRAMS)]
)
def test_programs_that_are_right_are_proved(judged, text):
    report = judged(text)
    assert verdicts(report) == {"M": Verdict.CORRECT}, report


@pytest.mark.slow
def test_doubles_are_rounded(judged):
    """lambdify writes 1/3 as a quotient of whole numbers, which is a double before a symbol is there."""
    symbols = "from sympy import *\nq2, m1, m2, l1, l2 = symbols('q2 m1 m2 l1 l2')\n"
    report = judged(f"{symbols}M = lambdify((q2, m1, m2, l1, l2), Matrix({M}))")
    assert verdicts(report) == {"M": Verdict.ROUNDED}


STATE = """
import numpy as np
m1, m2, l1, l2, g = 2.0, 1.5, 0.5, 0.4, 9.81
def rhs(t, x, u):
    q1, q2, w1, w2 = x
    c2 = np.cos(q2)
    M = np.array([[m1*l1**2/3 + m2*(l1**2 + l2**2/3 + l1*l2*c2), m2*l2**2/3 + m2*l1*l2*c2/2],
                  [m2*l2**2/3 + m2*l1*l2*c2/2, m2*l2**2/3]])
    s = -m2*l1*l2*np.sin(q2)/2
    C = np.array([[s*w2, s*(w1 + w2)], [-s*w1, 0]])
    return np.r_[w1, w2, np.linalg.solve(M, u - C @ [w1, w2])]
"""


@pytest.mark.slow
def test_local_names_of_a_right_hand_side_are_sampled(judged, tmp_path):
    """np.linalg.solve takes no symbols: the function is called with numbers."""
    (tmp_path / "task.toml").write_text('[names]\nstate = "q, qd"\n[task]\nexecute = true\n')
    task = read_task(tmp_path / "task.toml")
    report = judged(STATE, task=task)
    assert verdicts(report) == {"M": Verdict.SAMPLED, "C": Verdict.SAMPLED}, report
    assert report and "1000 random states" in report.of("M")[0].statement
    report = judged(STATE.replace("-m2*l1*l2*np.sin", "m2*l1*l2*np.sin"), task=task)
    assert verdicts(report) == {"M": Verdict.SAMPLED, "C": Verdict.WRONG}
    with pytest.raises(AnswerError, match=r'\[names\] state = "q, qd"'):
        judged(STATE)


@pytest.mark.slow
def test_sampled_parameters_vary(judged):
    """A function that has a parameter's value instead of its letter is right at the file's values alone."""
    text = (
        "def V(q1, q2, m1, m2, l1, l2, g):\n    from math import sin\n    float(q1)\n    return {}"
    )
    right = "m1*g*l1/2*sin(q1) + m2*g*(l1*sin(q1) + l2/2*sin(q1 + q2))"
    assert verdicts(judged(text.format(right))) == {"V": Verdict.SAMPLED}
    value = library_robot(ROBOT).numbers.values["l1"]
    assert verdicts(judged(text.format(right.replace("l1/2", f"{value}/2")))) == {
        "V": Verdict.WRONG
    }


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (f"q2 = 0.3\nm1 = m2 = l1 = l2 = 1\nfrom math import cos\nM = {M}", "one state alone"),
        (f"m1 = 77\nfrom sympy import cos\nM = {M}", "the robot's file has"),
        slow_if(True, "M = 'text'", "assigns no quantity|found str"),
        slow_if(True, "import sys\nsys.exit(3)", "SystemExit"),
        ("raise ValueError('no')", "ValueError: no"),
        slow_if(True, "def V(a, b):\n    return a", "argument a of V is not known"),
        slow_if(True, "x = (", "SyntaxError"),
        slow_if(True, "V = float('nan')", "nan is not a number|assigns no quantity"),
        slow_if(True, "while True:\n    pass", "no answer within"),
    ],
)
def test_what_is_no_answer_is_refused(judged, text, reason, monkeypatch):
    monkeypatch.setattr("dhkit.execution.child.BOUNDS", replace(BOUNDS, start_time=1.5))
    try:
        report = judged(text)
    except AnswerError as error:
        found = str(error)
    else:
        assert report.verdict is Verdict.UNREADABLE
        found = report.fault
    assert re.search(reason, found), found


ATTACKS = [
    'import os\nos.write(4, b\'{"functions": [], "names": {}, "verdict": "correct"}\\n\')\n',
    "import sympy\nsympy.Basic.__eq__ = lambda a, b: True\nsympy.Basic.__hash__ = lambda a: 1\n",
    "import sympy\nsympy.sstr = sympy.sstrrepr = lambda x: '__import__(\"os\")'\n",
    "import json\njson.dumps = lambda x: '{}'\n",
    "import builtins, sys\nsys.setprofile = lambda f: None\n",
]


@pytest.mark.parametrize("attack", [slow_if(k > 0, attack) for k, attack in enumerate(ATTACKS)])
def test_what_a_program_patches_is_only_its_answer(judged, attack):
    """None of these makes a wrong answer right."""
    try:
        report = judged(attack + "from sympy import *\nV = 2*m1*g*l1")
    except AnswerError:
        return
    assert report.verdict in (Verdict.WRONG, Verdict.UNREADABLE)


@pytest.fixture
def isolated():
    """A system that isolates programs, or a skip; a container may have bubblewrap and no namespaces."""
    require("bwrap", "Debian's bubblewrap isolates programs")
    if not find_isolation():
        pytest.skip(f"programs are {find_isolation()}")


LOOKING = """
import os, socket, subprocess, sys
seen = [path for path in {paths} if os.path.exists(path)]
try:
    import dhkit
    seen.append("dhkit")
except ImportError:
    pass
code = "import dhkit, pinocchio"
if subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0:
    seen.append("dhkit in a subprocess")
raise RuntimeError(f"seen: {{seen}}")
"""


@pytest.mark.usefixtures("isolated")
def test_isolated_programs_derive_and_see_nothing_of_ours(judged, tmp_path):
    secret = tmp_path / "rubric.toml"
    secret.write_text("points = 10\n")
    isolation = find_isolation([secret], required=True)
    assert judged(LAGRANGE, isolation=isolation).verdict is Verdict.CORRECT
    paths = [str(secret), str(Path(dhkit.__file__))]
    if isolation.kind is Kind.BUBBLEWRAP:
        with pytest.raises(AnswerError, match=r"seen: \[\]"):
            judged(LOOKING.format(paths=paths), isolation=isolation)


@pytest.mark.slow
@pytest.mark.usefixtures("isolated")
def test_a_class_is_executed_isolated_alone(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "class").mkdir()
    for name in ("ada", "bob"):
        (tmp_path / "class" / f"{name}.py").write_text(LAGRANGE)
    with pytest.raises(SystemExit) as done:
        main(("grade", "class", "--robot", ROBOT, "--json", "--execute"))
    reports = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert (done.value.code, [one["verdict"] for one in reports]) == (0, ["correct", "correct"])
    monkeypatch.setattr(
        "dhkit.execution.isolation._probed", lambda *_: Isolation(Kind.NONE, "a test")
    )
    with pytest.raises(SystemExit) as refused:
        main(("grade", "class", "--robot", ROBOT, "--json", "--execute"))
    assert refused.value.code == 2
    assert "only where they can be isolated: a test" in capsys.readouterr().err


RIGHT = "m1*g*l1/2*sin(q1) + m2*g*(l1*sin(q1) + l2/2*sin(q1 + q2))"
OF_NUMBERS = f"(q1, q2, m1, m2, l1, l2, g):\n    float(q1)\n    return {{}}*({RIGHT})\n"


WRONG = [
    f"from math import sin\nV = 2*({RIGHT})\ndef U{OF_NUMBERS.format(1)}",
    f"from math import sin\ndef V{OF_NUMBERS.format(1)}def U{OF_NUMBERS.format(2)}",
    f"from math import sin\ndef V{OF_NUMBERS.format('(1 + 7j)')}",
    f"from math import sin\ndef V{OF_NUMBERS.format('(1 + t)').replace('(q1', '(t, q1')}",
    f"from math import sin\ndef energy(q1, q2, m1, m2, l1, l2, g):\n    V = {RIGHT}\n    return 2*V",
    f"from math import sin\ndef energy(q1, q2, m1, m2, l1, l2, g):\n    float(q1)\n    V = {RIGHT}\n    return 2*V",
    f"from sympy import *\nx = Symbol('0*g + {RIGHT}')\nV = 5*x",
    "from sympy import *\nx = Function('m1')(g*l1*sin(q1)/2)\nV = x + m2*g*(l1*sin(q1) + l2/2*sin(q1 + q2))",
    "import casadi as ca\nq = ca.SX.sym('q', 1, 2)\nc, s = ca.cos(q[1]), ca.sin(q[1])\n"
    "l1 = ca.SX.sym('l1')\nA1 = ca.vertcat(ca.horzcat(c, -s, 0, l1*c), ca.horzcat(s, c, 0, l1*s),"
    " ca.horzcat(0, 0, 1, 0), ca.horzcat(0, 0, 0, 1))",
    f"from sympy import *\nq1 = pi/2\nV = {RIGHT}",
    "import sys\nsys.setrecursionlimit(20000)\nV = m1\nfor _ in range(960):\n    V = [V]",
]


@pytest.mark.parametrize("text", [slow_if(k % 6 > 0, text) for k, text in enumerate(WRONG)])
def test_no_wrong_program_is_right(judged, text):
    """Conflicts, complex numbers, times, changed results, symbols that read as formulas, one state: none passes."""
    try:
        report = judged(text)
    except AnswerError:
        return
    assert not report, report


def test_functions_that_agree_are_sampled(judged):
    text = f"from math import sin\ndef V{OF_NUMBERS.format(1)}def potential_energy{OF_NUMBERS.format(1)}"
    assert verdicts(judged(text)) == {"V": Verdict.SAMPLED}


def test_functions_without_a_quantity_are_not_called(judged):
    text = f"from sympy import *\ndef helper():\n    while True: pass\nV = {RIGHT}"
    assert verdicts(judged(text)) == {"V": Verdict.CORRECT}


@pytest.mark.slow
@pytest.mark.usefixtures("octave")
def test_a_script_of_octave_may_clear(judged):
    text = f"clear all; clc\nclose all\nfunction V = V(q1, q2, m1, m2, l1, l2, g)\n  V = {RIGHT};\nend\n"
    assert verdicts(judged(text, "answer.m")) == {"V": Verdict.SAMPLED}


@pytest.mark.slow
def test_names_of_libraries_are_no_answers(judged):
    """math has a number tau, and numpy a number pi."""
    text = "from math import *\ndef V(q1, q2, m1, m2, l1, l2, g):\n    float(q1)\n    return {} if abs(q1) < 50 else 0"
    report = judged(text.format("m1*g*l1/2*sin(q1) + m2*g*(l1*sin(q1) + l2/2*sin(q1 + q2))"))
    assert verdicts(report) == {"V": Verdict.WRONG}
    assert verdicts(judged(f"from numpy import *\nM = array({M})")) == {"M": Verdict.CORRECT}


def test_a_task_must_permit_it(judged, tmp_path):
    (tmp_path / "task.toml").write_text("[task]\nasked = ['M']\n")
    with pytest.raises(AnswerError, match="does not permit executing"):
        judged("M = 1", task=read_task(tmp_path / "task.toml"))


def test_the_command_executes_where_it_is_asked(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "answer.py").write_text(LAGRANGE)
    with pytest.raises(SystemExit) as refused:
        main(("grade", "answer.py", "--robot", ROBOT, "--json"))
    assert refused.value.code == 2
    assert "--execute" in capsys.readouterr().out
    with pytest.raises(SystemExit) as done:
        main(("grade", "answer.py", "--robot", ROBOT, "--json", "--execute"))
    report = json.loads(capsys.readouterr().out)
    assert (done.value.code, report["verdict"]) == (0, "correct")


def test_a_notebook_is_executed(judged):
    cells = [
        {"cell_type": "code", "source": text, "execution_count": 1}
        for text in ("%matplotlib inline", LAGRANGE)
    ]
    report = judged(json.dumps({"cells": cells}), "answer.ipynb")
    assert report.verdict is Verdict.CORRECT


@pytest.fixture
def octave():
    """GNU Octave, or a skip."""
    require("octave-cli", "Debian's octave runs MATLAB's language")


V_OF_OCTAVE = "m1*g*l1/2*sin(q1) + m2*g*(l1*sin(q1) + l2/2*sin(q1 + q2))"


@pytest.mark.usefixtures("octave")
@pytest.mark.parametrize(
    "text",
    [
        slow_if(True, f"function V = V(q1, q2, m1, m2, l1, l2, g)\n  V = {V_OF_OCTAVE};\nend\n"),
        slow_if(
            True,
            f"function r = V(q, p)\n  q1 = q(1); q2 = q(2); m1 = p.m1; m2 = p.m2; l1 = p.l1; l2 = p.l2; g = p.g;\n"
            f"  r = {V_OF_OCTAVE};\nend\n",
        ),
        f"x = 3;\ndisp(twice(x))\nfunction y = twice(x)\n  y = 2*x;\nend\nfunction [a, V] = energies(q1, q2)\n"
        f"  m1 = 2; m2 = 1.5; l1 = 0.5; l2 = 0.4; g = 9.81;\n  a = 1;\n  V = {V_OF_OCTAVE};\nend\n",
    ],
)
def test_functions_of_octave_are_sampled(judged, text):
    assert verdicts(judged(text, "answer.m")) == {"V": Verdict.SAMPLED}
    wrong = text.replace("l2/2*sin", "l2/3*sin")
    assert verdicts(judged(wrong, "answer.m")) == {"V": Verdict.WRONG}


@pytest.mark.usefixtures("octave")
def test_octave_without_symbols_says_so(judged):
    with pytest.raises(AnswerError, match="symbolic"):
        judged("syms q1 m1\nV = m1*undefined_function(q1);\n", "answer.m")
