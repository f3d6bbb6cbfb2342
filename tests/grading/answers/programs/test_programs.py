"""Programs: whatever binds a name, nothing passes that the program does not compute.

Python programs of this file, and only those, are run, to compare what they compute with the verdict on them."""

import contextlib
import io
import itertools
import random
import re
import warnings

import numpy as np
import pytest

from dhkit.description import library_robot
from dhkit.errors import AnswerError
from dhkit.grading import grade
from dhkit.grading.answers.documents.entry_statements import statements_of
from dhkit.grading.answers.sheet_values import Entries, Refusal
from dhkit.grading.answers.sources import read_source
from dhkit.symbolic.equations import (
    equations_matlab,
    equations_python,
    equations_text,
    matlab_files,
    quantities,
)
from dhkit.symbolic.exact.lagrangian import lagrangian

ROBOT = library_robot("planar2r")
PASSES = ("correct", "correct within rounding", "undecided")
V = "m1*g*l1/2*sin(q1) + m2*g*(l1*sin(q1) + l2/2*sin(q1 + q2))"
M = [
    "m1*l1**2/3 + m2*(l1**2 + l2**2/3 + l1*l2*cos(q2))",
    "m2*l2**2/3 + m2*l1*l2*cos(q2)/2",
    "m2*l2**2/3",
]
PYTHON = [
    "import numpy as np",
    "import sympy as sp",
    "from sympy import symbols, sin, cos, Matrix",
    'q1, q2 = symbols("q1 q2")',
    'm1, m2, l1, l2, g = symbols("m1 m2 l1 l2 g")',
    "a = m2*l1*l2*cos(q2)",
    "b = m2*l2**2/3 + a/2",
    "M = Matrix([[m1*l1**2/3 + m2*(l1**2 + l2**2/3) + a, b], [b, m2*l2**2/3]])",
    "V = m1*g*l1/2*sin(q1) + m2*g*(l1*sin(q1) + l2/2*sin(q1 + q2))",
    "print(V)",
]
MATLAB = [
    "clear all; clc; close all",
    "syms q1 q2 m1 m2 l1 l2 g real",
    "a = m2*l1*l2*cos(q2);",
    "b = m2*l2^2/3 + a/2; % coupling",
    "M = [m1*l1^2/3 + m2*(l1^2 + l2^2/3) + a, b",
    "     b, m2*l2^2/3];",
    "V = m1*g*l1/2*sin(q1) + ...",
    "    m2*g*(l1*sin(q1) + l2/2*sin(q1 + q2));",
    "disp(V)",
]
PLACES = {".py": (3, 5, 7, 8, 9, 10), ".m": (2, 3, 4, 6, 8, 9)}
STATE = {"q1": 0.3, "q2": 0.7, "m1": 1.1, "m2": 1.7, "l1": 0.9, "l2": 0.6, "g": 9.1}

ANY_NAME = r"""
@ = 2*m1
@ = @*2
@ += 1
@ -= 1
@ *= 2
@ **= 2
@ = 7
@ = q2
@ = cos
@, zz = q2, 3
zz, @ = 3, q2
[@, zz] = [q2, 3]
(@) = q2
zz = @ = q2
@ = zz = q2
@: object = q2
(zz := 3, @ := q2)
zz = (@ := q2)
print(@ := q2)
zz = [(@ := k) for k in [q2]]
for @ in [q2]: pass
for zz, @ in [(1, q2)]: pass
for zz in [1]: @ = q2
while True:\n    @ = q2\n    break
if True: @ = q2
if False: pass\nelse: @ = q2
import contextlib\nwith contextlib.nullcontext(q2) as @: pass
try: @ = q2\nfinally: pass
try: raise ValueError\nexcept ValueError: @ = q2
try: raise ValueError\nexcept ValueError as @: pass
match q2:\n    case @: pass
match [q2]:\n    case [@]: pass
match [q2]:\n    case [*@]: pass
match {'k': q2}:\n    case {'k': @}: pass
match {'k': q2}:\n    case {**@}: pass
import math as @
from math import pi as @
from math import cos as @
def @(*args): return q2
class @: pass
@ = lambda *args: q2
del @
*@, = [q2]
zz, *@ = [q2, 3]
exec('@ = q2')
eval("globals().update(@=q2)")
globals()['@'] = q2
vars()['@'] = q2
locals()['@'] = q2
globals().update(@=q2)
def zz():\n    global @\n    @ = q2\nzz()
import builtins\nbuiltins.exec('@ = q2')
import sys\nsetattr(sys.modules[__name__], '@', q2)
import inspect\ninspect.currentframe().f_globals['@'] = q2
@ = @.subs(m1, m2)
@ = symbols('m1')
@, zz = symbols('m1 @')
zz, @ = symbols('@ m1')
@ = Matrix([[1, 2], [3, 4]])
@ = np.float64(3)
@ = @ if False else q2
@ = [q2][0]
@ = @ and q2
@ = sp.simplify(2*@)
zz = 3; @ = q2
if (zz := 2) and (@ := q2): pass
assert (@ := q2) is not None
zz = {'k': (@ := q2)}
from sympy.abc import x as @
from numpy import *
from math import *
from sympy import *
if __name__ == '__main__': @ = q2
if __name__ == 'student': @ = q2
@ = sp.sympify('m1')
import operator\noperator.setitem(globals(), '@', q2)
zz = __import__('builtins').exec('@ = q2')
type(zz := 3)\n@ = q2
""".strip().split("\n")
ONE_NAME = r"""
M[0, 0] = 7
M[0, 0] += 7
M[0] = 7
M[:, 0] = Matrix([1, 2])
M.row_swap(0, 1)
M.row_op(0, lambda v, j: 2*v)
M.__setitem__((0, 0), 7)
zz = M\nzz[0, 0] = 7
zz = M\nyy = zz\nyy[0, 0] = 7
zz = [M]\nzz[0][0, 0] = 7
zz = dict(k=M)\nzz['k'][0, 0] = 7
def zz(A):\n    A[0, 0] = 7\nzz(M)
def zz():\n    M[0, 0] = 7\nzz()
def zz():\n    A = M\n    A[0, 0] = 7\nzz()
[A.__setitem__((0, 0), 7) for A in [M]]
for A in [M]: A[0, 0] = 7
M = M.T*2
M = M + M
M = 2*M
M @= M
(lambda A: A.__setitem__((0, 0), 7))(M)
for A in [M]: pass\nA[0, 0] = 7
[A.fill(0) for A in [M]]
sorted([M], key=lambda A: A.fill(0) or 0)
list(map(lambda A: A.fill(0), [M]))
(A := M)\nA[0, 0] = 7
def zz(A=M):\n    A[0, 0] = 7\nzz()
class zz:\n    M[0, 0] = 7
class zz:\n    A = M\n    A[0, 0] = 7
match M:\n    case A: A[0, 0] = 7
with __import__('contextlib').nullcontext(M) as A: A[0, 0] = 7
import contextlib\nwith contextlib.nullcontext(M) as A: A[0, 0] = 7
while M[0, 0] != 7: M[0, 0] = 7
if True: M[0, 0] = 7
A = M if True else 3\nA[0, 0] = 7
A = M or 3\nA[0, 0] = 7
A = {1: M}[1]\nA[0, 0] = 7
A, B = M, 3\nA[0, 0] = 7
A = B = M\nA[0, 0] = 7
A = np.asarray(M)\nA[0, 0] = 7
zz = M.__setitem__\nzz((0, 0), 7)
zz = M.fill\nzz(0)
np.fill_diagonal(M, 0)
M.fill(0)
M[0, 0], M[1, 1] = M[1, 1], M[0, 0]
getattr(M, '__setitem__')((0, 0), 7)
import numpy as sp
sp = np
symbols = 3
def Matrix(x): return 2*sp.Matrix(x)
def symbols(x): return sp.symbols('m1 m2')
Matrix = list
cos = sp.sin
sin, cos = cos, sin
from sympy import sin as cos
from sympy import cos as sin, sin as cos
import math\nsin = math.cos
q1, q2 = q2, q1
m1, m2 = symbols('m2 m1')
m1, m2 = m2, m1
def sin(x): return cos(x)
np.add.at(M, 0, 1)
""".strip().split("\n")
MATLAB_ANY_NAME = r"""
@ = 2*m1;
@ = @*2;
@ += 1;
@ -= 1
@ *= 2;
@ ^= 2;
@++;
++@;
@ = 7;
@ = q2;
[@, zz] = deal(q2, 3);
[zz, @] = deal(3, q2);
[@] = deal(q2);
[~, @] = deal(3, q2);
@ = zz = q2;
zz = @ = q2;
zz = (@ = q2);
if true, @ = q2; end
if true\n@ = q2;\nend
for @ = 1:3, end
for @ = [q2], disp(1), end
for zz = 1:2\n  @ = q2;\nend
while true, @ = q2; break; end
switch 1\ncase 1\n@ = q2;\nend
try, @ = q2; catch, end
try\nerror('a')\ncatch @\nend
if (@ = q2), end
do\n@ = q2;\nuntil true
eval('@ = q2;')
eval(['@' ' = q2;'])
evalin('base', '@ = q2;')
assignin('base', '@', q2)
assignin('caller', '@', q2);
load data.mat
load('data.mat')
run setup.m
setup
run('setup')
source setup.m
@ = @(x) q2;
@ = sym('m1');
@ = sym('m1', 'real');
global @
persistent @
@(1) = 7;
@(1,1) = 7;
@(end) = 7;
@(:) = 7;
@{1} = 7;
@.k = 7;
@(2,:) = [];
@ = subs(@, m1, m2);
@ = [q2];
@ = -@;
@ = [1 2; 3 4];
@ = inv(@);
@ = input('x');
feval('eval', '@ = q2;')
@ = q2, zz = 3;
zz = 3, @ = q2
unwind_protect\n@ = q2;\nunwind_protect_cleanup\nend_unwind_protect
syms @(zz)
syms @ [2 2]
""".strip().split("\n")
MATLAB_ONE_NAME = r"""
M(1,1) = 7;
M(3) = 7;
M(1,:) = [1 2];
M(:,1) = [];
M = M*2;
M = [M; 1 2];
M = M(:, [2 1]);
M([1 2]) = 0;
M(1,1) += 7;
M(1,1) = M(1,1) + 7;
m2 = m1;
cos = @(x) sin(x);
cos = @(x) x;
cos = @sin;
q = [q2; q1]; q2 = q(2);
[q2, q1] = deal(q1, q2);
""".strip().split("\n")
NEEDED = {"M": {"a", "b", "q2", "m2", "cos", "M", "l1"}, "V": {"q1", "m2", "sin", "V", "l1"}}


def report_of(path, text, robot=ROBOT):
    path.write_text(text)
    try:
        return grade(path, robot, explain=False)  # mistakes have no part in verdicts
    except AnswerError:
        return None


def passing(report, name):
    entries = (
        [entry for entry in report.entries if entry.quantity == name] if report is not None else []
    )
    return bool(entries) and all(entry.verdict.value in PASSES for entry in entries)


def computed(text):
    """Run a program of this file; return numbers for M and V, nothing where it does not run."""
    import sympy

    names = {"__name__": "student"}
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            exec(compile(text, "student.py", "exec"), names)
        except Exception:
            return {}
        found = {}
        for name in ("M", "V"):
            with contextlib.suppress(Exception):
                value = sympy.Matrix([names[name]]).subs(
                    {sympy.Symbol(k): x for k, x in STATE.items()}
                )
                found[name] = np.array(value.tolist(), dtype=float)
    return found


RIGHT = computed("\n".join(PYTHON))


def inserted(lines, statement, place):
    return "\n".join([*lines[:place], *statement.replace(r"\n", "\n").split("\n"), *lines[place:]])


def test_the_programs_pass_without_insertions(tmp_path):
    for suffix, lines in ((".py", PYTHON), (".m", MATLAB)):
        report = report_of(tmp_path / f"a{suffix}", "\n".join(lines))
        assert report
        assert set(report.quantities) == {"M", "V"}


@pytest.mark.slow
@pytest.mark.parametrize("statement", ANY_NAME)
def test_no_binding_of_a_name_in_python_passes_for_what_it_is_not(tmp_path, statement):
    rng = random.Random(statement)
    cases = list(itertools.product(("a", "q1", "m2", "sin", "M", "V"), PLACES[".py"]))
    for name, place in rng.sample(cases, 12):
        text = inserted(PYTHON, statement.replace("@", name), place)
        report = report_of(tmp_path / "a.py", text)
        verdicts = [quantity for quantity in ("M", "V") if passing(report, quantity)]
        values = computed(text) if verdicts else {}
        for quantity in verdicts:
            if values:
                assert np.allclose(values[quantity], RIGHT[quantity], rtol=1e-12), text


@pytest.mark.slow
@pytest.mark.parametrize("statement", ONE_NAME)
def test_no_change_of_a_value_in_python_passes_for_what_it_was(tmp_path, statement):
    for place in PLACES[".py"]:
        text = inserted(PYTHON, statement, place)
        report = report_of(tmp_path / "a.py", text)
        verdicts = [quantity for quantity in ("M", "V") if passing(report, quantity)]
        values = computed(text) if verdicts else {}
        for quantity in verdicts:
            if values:
                assert np.allclose(values[quantity], RIGHT[quantity], rtol=1e-12), text


@pytest.mark.slow
@pytest.mark.parametrize("statement", MATLAB_ANY_NAME)
def test_no_binding_of_a_name_in_matlab_passes(tmp_path, statement):
    rng = random.Random(statement)
    cases = list(itertools.product(("a", "q1", "m2", "sin", "M", "V"), PLACES[".m"]))
    for name, place in rng.sample(cases, 12):
        bound = (
            statement.replace("@ =", f"{name} =")
            .replace("@(x)", "\0")
            .replace("@", name)
            .replace("\0", "@(x)")
        )
        report = report_of(tmp_path / "a.m", inserted(MATLAB, bound, place))
        for quantity, needed in NEEDED.items():
            assert not (passing(report, quantity) and name in needed), (bound, place)


@pytest.mark.parametrize("statement", MATLAB_ONE_NAME)
def test_no_change_of_a_value_in_matlab_passes(tmp_path, statement):
    for place in PLACES[".m"]:
        assert not passing(report_of(tmp_path / "a.m", inserted(MATLAB, statement, place)), "M")


HARMLESS = {
    ".py": [
        *(
            "print(M)",
            "sp.pprint(M)",
            "'''V = 3'''",
            "# V = 3",
            "x = 3",
            "M = sp.simplify(M)",
            "V = V",
            "sp.init_printing()",
        ),
        *(
            "x = [q1 for q1 in range(3)]",
            "def f(m1, m2):\n    a = 3\n    return a + m1",
            "x = lambda q1: 2*q1",
            "pass",
        ),
        *(
            "q1 = symbols('q1', real=True)",
            "from math import pi",
            "import matplotlib.pyplot as plt",
            "M.simplify()",
        ),
        *(
            "if __name__ == '__main__':\n    print(M, V)",
            "for k in range(3):\n    print(k)",
            "assert M is not None",
        ),
        *(
            "m1 = 2.0",
            "m1 = 2  # kg",
            "l1 = 1/2",
            "l1 = 0.5; g = 9.81  # m/s^2",
            "tau = M*Matrix([1, 2])",
            "t1 = 3",
        ),
        *(
            "class Arm:\n    def __init__(self):\n        self.m1 = 3\n    def M(self):\n        return 3",
            "x = 'V = 3'",
        ),
        *(
            "def f():\n    M = 3\n    V = 4\n    return 5",
            "theta1 = q1",
            "x = f'{V}'",
            "try:\n    x = 1\nfinally:\n    y = 2",
        ),
        *(
            "x = M.subs(m1, 3)",
            "f = sp.lambdify((q1, q2), M)",
            "n = M.shape[0]",
            "M.det()",
            "x = sp.latex(V)",
            "V;",
        ),
    ],
    ".m": [
        *(
            "disp(M)",
            "M",
            "% V = 3",
            "%{\nV = 3\n%}",
            "x = 3;",
            "M = simplify(M);",
            "V;",
            "fprintf('V = %f', 3);",
        ),
        *(
            "# V = 3",
            "x = 'V = 3';",
            'x = "V = 3";',
            "format long",
            "syms q1 real",
            "q1 = sym('q1', 'real');",
            "tic; toc",
        ),
        *(
            "m1 = 2;",
            "l1 = 0.5; g = 9.81; % m/s^2",
            "pretty(M)",
            "tau = M*[1; 2];",
            "if x > 3, disp(x), end",
            "clc",
        ),
        *(
            "for k = 1:3\n  disp(k)\nend",
            "x = M(1,1);",
            "x = [1 2\n3 4];",
            "assume(q1 > 0)",
            "hold on",
            "warning off",
        ),
        *(
            "function x = f(m1, m2)\na = 3;\nx = a + m1;\nend",
            "x = @(q1) 2*q1;",
            "x = subs(M, m1, 3);",
            "figure; grid on",
        ),
    ],
}


@pytest.mark.parametrize(
    ("suffix", "statement"), [(s, x) for s, listed in HARMLESS.items() for x in listed]
)
def test_what_binds_nothing_that_matters_changes_no_verdict(tmp_path, suffix, statement):
    lines = {".py": PYTHON, ".m": MATLAB}[suffix]
    late = statement.startswith(
        (
            "function",
            "M",
            "V",
            "disp(M",
            "pretty",
            "tau",
            "sp.pprint",
            "print(M",
            "if __",
            "f =",
            "n =",
        )
    )
    late = late or re.search(r"\b[MV]\b(?! = 3)", statement)
    for place in PLACES[suffix][-1:] if late else PLACES[suffix]:
        if "symbols" in statement and place < 5:
            continue
        text = inserted(lines, statement, place)
        report = report_of(tmp_path / f"a{suffix}", text)
        assert passing(report, "M") and passing(report, "V"), (text, report)


# Entries


@pytest.fixture
def read(tmp_path):
    def answers(text, suffix=".py", robot=ROBOT):
        (tmp_path / f"a{suffix}").write_text(text)
        return read_source(tmp_path / f"a{suffix}", robot)

    return answers


SPELLINGS = {
    ".py": ["M{i}{j}", "M_{i}{j}", "M_{i}_{j}", "m{i}{j}", "D{i}{j}", "D_{i}{j}"],
    ".m": [
        "M{i}{j}",
        "M_{i}{j}",
        "M_{i}_{j}",
        "M({i},{j})",
        "M({i}, {j})",
        "D({i},{j})",
        "m{i}{j}",
        "D{i}{j}",
    ],
}


@pytest.mark.parametrize(
    ("suffix", "spelling"), [(s, x) for s, listed in SPELLINGS.items() for x in listed]
)
def test_entries_of_M(read, suffix, spelling):
    power = "**" if suffix == ".py" else "^"
    lines = [
        f"{spelling.format(i=i, j=j)} = {M[k].replace('**', power)}"
        for k, (i, j) in zip((0, 1, 1, 2), itertools.product((1, 2), (1, 2)), strict=True)
    ]
    answer = read("\n".join(lines), suffix).answers["M"]
    assert isinstance(answer, Entries)
    texts = [M[k].replace("**", power) for k in (0, 1, 1, 2)]
    assert dict(answer.texts) == dict(zip([(0, 0), (0, 1), (1, 0), (1, 1)], texts, strict=True))


@pytest.mark.parametrize(
    "spelling", ["M[{i}, {j}]", "M[{i},{j}]", "M[{i}][{j}]", "M[..., {i}, {j}]"]
)
def test_entries_by_python_s_index(read, spelling):
    lines = [
        f"{spelling.format(i=i, j=j)} = m1*{10 * i + j}"
        for i, j in itertools.product((0, 1), (0, 1))
    ]
    for zeros in ("", "M = sp.zeros(2, 2)\n", "M = np.zeros((2, 2))\n", "M = Matrix.zeros(2, 2)\n"):
        if "Matrix." in zeros:
            continue
        start = "import numpy as np\nimport sympy as sp\n" + zeros
        answer = read(start + "\n".join(lines)).answers["M"]
        assert dict(answer.texts) == {
            (i, j): f"m1*{10 * i + j}" for i, j in itertools.product((0, 1), (0, 1))
        }


@pytest.mark.parametrize(
    ("name", "quantity", "index"),
    [
        *(
            ("g1", "g", (0,)),
            ("g_2", "g", (1,)),
            ("G1", "g", (0,)),
            ("tau1", "tau", (0,)),
            ("tau_2", "tau", (1,)),
        ),
        *(
            ("h2", "h", (1,)),
            ("C12", "C", (0, 1)),
            ("C_21", "C", (1, 0)),
            ("J11", "J", (0, 0)),
            ("J_62", "J", (5, 1)),
        ),
        *(
            ("T14", "T", (0, 3)),
            ("A1_14", "A1", (0, 3)),
            ("A2_1_4", "A2", (0, 3)),
            ("A114", "A1", (0, 3)),
        ),
        *(("M_12", "M", (0, 1)), ("N1", "g", (0,)), ("Tau2", "tau", (1,)), ("Jac11", "J", (0, 0))),
    ],
)
def test_names_of_entries(read, name, quantity, index):
    for suffix in (".py", ".m"):
        assert dict(read(f"{name} = m1*l1", suffix).answers[quantity].texts) == {index: "m1*l1"}


@pytest.mark.parametrize(
    ("target", "quantity", "index"),
    [
        ("M(1,2)", "M", (0, 1)),
        ("g(2)", "g", (1,)),
        ("g(2,1)", "g", (1,)),
        ("tau(1)", "tau", (0,)),
        ("G(1)", "g", (0,)),
        ("A1(1,4)", "A1", (0, 3)),
        ("T(3,4)", "T", (2, 3)),
        ("J(6,2)", "J", (5, 1)),
    ],
)
def test_entries_by_matlab_s_index(read, target, quantity, index):
    assert dict(read(f"{target} = m1*l1;", ".m").answers[quantity].texts) == {index: "m1*l1"}


def test_entries_that_are_not_assigned_stay_missing_but_zeros_are_zeros(read):
    assert dict(read("M11 = m1\nV = 0").answers["M"].texts) == {(0, 0): "m1"}
    text = "C = zeros(2,2);\nC(1,1) = m1;"
    assert dict(read(text, ".m").answers["C"].texts) == {
        (0, 0): "m1",
        (0, 1): "0",
        (1, 0): "0",
        (1, 1): "0",
    }


def test_a_wrong_entry_beside_a_right_vector_is_found(tmp_path):
    g = "g = [(m1/2 + m2)*g*l1*cos(q1) + m2*g*l2*cos(q1+q2)/2, m2*g*l2*cos(q1+q2)/2]"
    entries = f"M11 = {M[0]}\nM12 = {M[1]}\nM21 = M12\nM22 = {M[2]}\n"
    assert report_of(tmp_path / "a.py", entries + g)
    assert not report_of(tmp_path / "a.py", entries.replace("/3", "/2", 1) + g)
    assert not report_of(tmp_path / "a.py", f"M11 = {M[0]}\n" + g)


def test_a_parameter_is_no_entry(tmp_path):
    from dhkit.description import with_uniform_links

    del with_uniform_links
    robot = library_robot("planar2r")
    parameters = {"m1", "m2", "l1", "l2", "g"}
    assert parameters == set(robot.parameters)
    (tmp_path / "a.py").write_text("m1 = 2.0\nl1 = 0.5\ng = 9.81\nV = m1*g*l1")
    sheet = read_source(tmp_path / "a.py", robot)
    assert set(sheet.answers) == {"V"}
    assert [note.split(": ")[0] for note in sheet.notes] == ["line 1", "line 3", "line 2"] or len(
        sheet.notes
    ) == 3


def test_an_ambiguous_entry_of_a_long_arm_is_refused_with_both_readings():
    from dhkit.grading.answers.quantity_names import QuantityNames

    class LongArm(QuantityNames):
        def __init__(self, n):
            self.n, self.parameters = n, {}

    long, short = LongArm(12), LongArm(7)
    assert [str(x) for x in long.entries("M112")] == ["M(1,12)", "M(11,2)"]
    assert (
        [str(x) for x in long.entries("M_10_2")]
        == [str(x) for x in long.entries("M10_2")]
        == ["M(10,2)"]
    )
    assert [str(x) for x in long.entries("M110")] == ["M(1,10)"]
    assert [str(x) for x in long.entries("g12")] == ["g(12)"]
    assert (
        short.entries("M112")
        == short.entries("M18")
        == short.entries("M01")
        == short.entries("g8")
        == []
    )


# Scopes, functions, numbers


@pytest.mark.parametrize(
    "text",
    [
        f"def M(q):\n    q1, q2 = q\n    return np.array([[{M[0]}, {M[1]}], [{M[1]}, {M[2]}]])",
        f"def M(q1, q2):\n    b = {M[1]}\n    return [[{M[0]}, b], [b, {M[2]}]]",
        f"def M(q2, q1):\n    b = {M[1]}\n    return [[{M[0]}, b], [b, {M[2]}]]",
        f"M = lambda q1, q2: Matrix([[{M[0]}, {M[1]}], [{M[1]}, {M[2]}]])",
        f"def mass(q):\n    q1 = q[0]; q2 = q[1]\n    M = np.zeros((2, 2))\n    M[0, 0] = {M[0]}\n"
        f"    M[0, 1] = {M[1]}\n"
        f"    M[1, 0] = M[0, 1]\n    M[1, 1] = {M[2]}\n    return M",
        f"def mass(q):\n    b = {M[1]}\n    M = [[{M[0]}, b], [b, {M[2]}]]\n    return M\n"
        "def other(q):\n    b = 7\n    return b",
        f"def M(q1, q2, m1=2.0, l1=1/2):\n    return Matrix(2, 2, [{M[0]}, {M[1]}, {M[1]}, {M[2]}])",
        f"th1, th2 = q1, q2\nM = Matrix([[{M[0]}, {M[1]}], [{M[1]}, {M[2]}]]).applyfunc(simplify)".replace(
            "q1, q2\n", "q1, q2\n"
        ),
        "t = symbols('t')\nq1 = Function('q1')(t)\nq2 = Function('q2')(t)\n"
        f"M = Matrix([[{M[0]}, {M[1]}], [{M[1]}, {M[2]}]])",
        f"q = symbols('q1:3')\nM = Matrix([[{M[0]}, {M[1]}], [{M[1]}, {M[2]}]])".replace(
            "(q2)", "(q[1])"
        ),
        f"q1, q2 = sp.symbols('theta_1 theta_2')\nM = 2*Matrix([[({M[0]})/2, ({M[1]})/2], [({M[1]})/2, ({M[2]})/2]])",
        f"c = cos(q2)\nM = Matrix([[{M[0]}, {M[1]}], [{M[1]}, {M[2]}]])".replace(
            "cos(q2)*", "c*"
        ).replace("l2*cos(q2)", "l2*c"),
    ],
)
def test_functions_and_symbols_of_python(tmp_path, text):
    head = "import numpy as np\nimport sympy as sp\nfrom sympy import *\nfrom numpy import cos\n"
    report = report_of(tmp_path / "a.py", head.replace("from numpy import cos\n", "") + text)
    assert passing(report, "M"), report


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("def V(a, b):\n    return m1*g*a", "unknown name 'a'"),
        ("def V(self, q):\n    return self.m1", "object"),
        ("def V(q):\n    if q: return 3\n    return m1", "several"),
        ("V = m1*g*h9\nh9 = l1", "unknown name"),
        ("V = m1*g*undefined", "unknown name"),
        ("V = m1*foo(l1)", r"foo\(\.\.\.\) is not read"),
        ("V = l1^2", "not read"),
        ("V = l1//2", "not read"),
        ("V = l1 if m1 else l2", "not read"),
        ("V = 0x10*m1", "not read"),
        ("V = 1_000*m1", "not read"),
        ("V = 2j*m1", "not read"),
        ("V = m1(l1)", r"m1\(\.\.\.\) is not read"),
        ("V = q[-1]*m1", "not read"),
        ("V = m1*'2'", "not read"),
        ("V = argmax([m1, m2])", "not read"),
        ("V = x.m1*g", "unknown|not read|no parameter"),
        ("q1, q2 = q[1], q[0]\nV = m1*cos(q1)", "robot's own name"),
        ("q = [q2, q1]\nq1 = q[0]\nV = m1*cos(q1)", "own name|changed"),
        ("q1 = 0.3\nV = m1*cos(q1)", "robot's own name"),
        ("pi = 3\nV = m1*pi", "robot's own name"),
        ("g = -9.81\nV = m1*g", "the robot's file has"),
        ("l1 = 0.7\nV = m1*l1", "the robot's file has"),
        ("c_1 = 3\nm1, M1 = symbols('m1 M1')\nV = m1*M1", "both be read"),
        ("x1 = l1*cos(q1)\nV = m1*diff(x1, t)", "no rate"),
        ("import mymath as math\nV = math.cos(q1)*m1", "module"),
        ("from mymath import cos\nV = cos(q1)*m1", "comes from"),
        ("a = m1\nV = a*g\na = m2\nK = a*qd1**2", "assigned twice"),
        ("a = V2\nV2 = a\nV = a", "unknown name|after it was used"),
        ("V = M[0, 0]*g\nM = [[m1, 0], [0, m2]]", "assigned after it was used"),
    ],
)
def test_refusals_name_their_line_and_reason(read, text, reason):
    answer = read(text).answers["V"]
    assert isinstance(answer, Refusal)
    assert re.search(reason, answer.reason), answer.reason


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("V = m1*(", "line 1: no Python"),
        ("V = 1\nexec('V = 2')", "line 2: found 'exec'"),
        ("V = 1\nfrom mymath import *", "line 2: found 'from mymath import"),
        ("V = m1\0", "Python"),
        ("(" * 10_000, "Python|nested"),
        ("V = " + "-" * 100_000 + "1", "Python|nested"),
        ("# -*- coding: utf-7 -*-\nV = m1", "written in 'utf-7'"),
        ("V = 1\n" * 6_000, "more than 5000 statements"),
        ("x = 3", "assigns no quantity"),
        ("tau = M*ddq + C*dq", "assigns no quantity.*left out: line 1: tau"),
    ],
)
def test_files_that_are_refused(read, text, reason):
    with pytest.raises(AnswerError, match=reason) as error:
        read(text)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 500


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("\ufeffV = m1*g", "m1*g"),
        ("V = m1*g\r\nx = 3\r\n", "m1*g"),
        ("V = (m1  # the first\n     *g)  # V = 3", "m1*g"),
        ("V = m1 \\\n  *g", "m1*g"),
        ("\tx = 1\nV = m1".lstrip("\t"), "m1"),
        ("\x0cV = m1*g", "m1*g"),
        ("V = ｍ1*g", "m1*g"),
        ("x = 'V = 3 # 4'; V = m1*g", "m1*g"),
        ("V = 2.*m1", "2.0*m1"),
        ("V = sp.simplify(m1*g)", "m1*g"),
        ("V = (m1*g).simplify()", "m1*g"),
        ("V = simplify(expand(m1*g))", "m1*g"),
        ("import sympy as s\nV = m1*s.sin(q1)", "m1*sin(q1)"),
        ("V = np.pi*m1", "pi*m1"),
        ("V: float = m1*g", "m1*g"),
    ],
)
def test_text_stays_as_it_was_typed(read, text, expected):
    assert read(text).answers["V"].split() == expected.split()


def test_the_file_s_own_numbers_are_noted(read):
    sheet = read("l1 = 0.5  # m\ng = 9.81  # m/s^2\nV = m1*g*l1")
    assert sorted(sheet.notes) == [
        "line 1: l1 = 0.5 is the file's own number",
        "line 2: g = 9.81 is the file's own number",
    ]
    assert dict(sheet.names.parameters) == {}


@pytest.mark.slow
def test_many_names_are_all_kept(read):
    names = [f"x{k} = x{k - 1} + m1" for k in range(1, 500)]
    sheet = read("\n".join(["x0 = m1", *names, "V = x499"]))
    assert len(sheet.names.parameters) == 499
    with pytest.raises(AnswerError, match="more than 2000 names"):
        read(
            "\n".join(["x0 = m1", *(f"x{k} = x{k - 1} + m1" for k in range(1, 2100)), "V = x2099"])
        )


def test_names_of_functions_do_not_leak(read):
    text = "def V(q):\n    a = m1\n    return a*g\ndef K(q, qd):\n    a = m2\n    return a*qd1**2\n"
    sheet = read(text)
    assert sheet.answers == {"V": "m1*g", "K": "m2*qd1**2"}


# Answers that are bound again, made something else of, or shared

TRUE = "(m1/2+m2)*g*l1*cos(q1)+m2*g*l2*cos(q1+q2)/2, m2*g*l2*cos(q1+q2)/2"
G_DEF = f"def G(q):\n  q1, q2 = q\n  return [{TRUE}]\n"
G_LIST = f"G = [{TRUE}]\n"
G_MATLAB = f"function G=grav(q)\nG=[{TRUE}];\nend\n"
AGAIN = [
    *(
        "G = 0",
        "G = -G(q)",
        "G = neg(G)",
        "G += 1",
        "G, H = 0, 0",
        "(G := 0)",
        "if 1: G=0",
        "for G in [1]: pass",
    ),
    *(
        "del G",
        "class G: pass",
        "from x import G",
        "import G",
        "try: pass\nexcept E as G: pass",
        "[G, H] = f()",
    ),
    *(
        "def foo(): global G; G=0",
        "def G(q): return 0",
        "def G(q): pass",
        "G = lambda q: print(q)",
        "G = H = abs",
    ),
    *(
        "with f() as G: pass",
        "while G := f(): pass",
        "async def G(): pass",
        "G: int = 3",
        "import numpy as G",
    ),
    *(
        "from math import cos as G",
        "match f():\n  case G: pass",
        "G.q = 3",
        "G = symbols('G')",
        "(G, *H) = f()",
    ),
    "if 1:\n  def G(q): return 0",
]


@pytest.mark.parametrize("again", AGAIN)
@pytest.mark.parametrize("start", [G_DEF, f"G = lambda q: [{TRUE}]\n"])
def test_a_function_that_is_bound_again_is_no_answer(tmp_path, start, again):
    assert passing(report_of(tmp_path / "a.py", start), "g")
    for text in (f"{start}{again}\n", f"{again}\n{start}"):
        assert not passing(report_of(tmp_path / "a.py", text), "g"), text


@pytest.mark.parametrize(
    "again",
    [
        "G=0;",
        "G = @(q) 0;",
        "G(1) = 2;",
        "clear x; G = [0 0];",
        "if 1, G=0; end",
        "for G=1:2, end",
        "[G, H] = f(1);",
    ],
)
def test_a_handle_that_is_bound_again_is_no_answer(tmp_path, again):
    start = f"G = @(q1,q2) [{TRUE}];\n"
    assert passing(report_of(tmp_path / "a.m", start), "g")
    assert not passing(report_of(tmp_path / "a.m", f"{start}{again}\n"), "g")


@pytest.mark.parametrize(
    "text",
    [
        *(
            f"def G(q):\n  q1, q2 = q\n  {G_LIST}  return {x}"
            for x in ("-G", "", "neg(G)", "[-G[0], G[1]]", "2*G", "H")
        ),
        *(
            f"def dyn(q):\n  {G_LIST}  return {x}"
            for x in ("-G", "neg(G)", "G*s", "[-x for x in G]", "-np.array(G)")
        ),
        *(
            f"def dyn(q):\n  {G_LIST}  return G\nG = {x}"
            for x in ("-dyn(q)", "0", "neg(dyn(q))", "f()")
        ),
        f"def dyn(q):\n  {G_LIST}  y = -G\n  return y",
        f"def dyn(q1, q2):\n  {G_LIST}  return G\nG = dyn(q2, q1)",
        f"def dyn(q):\n  {G_LIST}  return G\nq = [-q1, q2]\nG = dyn(q)",
        f"def dyn(q):\n  {G_LIST}  return G\ndyn = abs",
        f"def dyn(q):\n  {G_LIST}  return G\ndef G(q):\n  return -dyn(q)",
        f"def G(q):\n  {G_LIST}  print(G)",
        f"G1 = {TRUE.split(', ')[0]}\nG2 = {TRUE.split(', ')[1]}\nG = -Matrix([G1, G2])",
    ],
)
def test_what_is_made_of_an_answer_goes_before_it(tmp_path, text):
    assert not passing(report_of(tmp_path / "a.py", text), "g")


@pytest.mark.parametrize(
    "text",
    [
        f"def dyn(q):\n  {G_LIST}  return G",
        f"import numpy as np\ndef dyn(q):\n  {G_LIST}  return np.array(G)\nG = dyn(q)",
        f"def dyn(q):\n  {G_LIST}  return {{'G': G}}",
        f"import numpy as np\ndef dyn(q):\n  {G_LIST}  return np.array(G)\nq = np.array([0.1, 0.2])\nG = dyn(q)",
        f"def dyn(q, ddq):\n  {G_LIST}  return M*ddq + G",
        f"def G(q, g=9.81, m1=2.0, dt=0.1, p=None):\n  return [{TRUE}]",
        f"m1 = 2.0\ndef G(q, m1=m1):\n  return [{TRUE}]",
        f"P = {{'m1': 2.0}}\ndef G(q, p=P):\n  m1 = p['m1']\n  return [{TRUE}]",
        f"def G(q, p):\n  m1 = p.m1\n  return [{TRUE}]",
        f"{G_LIST}y = len(G)",
        f"{G_LIST}H = np.array(G)\nH[0] = 3".replace("H =", "import numpy as np\nH ="),
    ],
)
def test_what_leaves_an_answer_as_it_is(tmp_path, text):
    assert passing(report_of(tmp_path / "a.py", text), "g")


@pytest.mark.parametrize(
    "text",
    [
        f"G=-grav(q1,q2);\nfunction G=grav(q1,q2)\nG = [{TRUE}];\nend",
        f"G=grav(q2,q1);\nfunction G=grav(q1,q2)\nG = [{TRUE}];\nend",
        f"G=grav(q1,q2)*2;\nfunction G=grav(q1,q2)\nG = [{TRUE}];\nend",
        f"function y=grav(q1,q2)\nG = [{TRUE}];\ny = -G;\nend",
        f"function G=grav(q1,q2)\nG = [{TRUE}];\nG = -G;\nend",
        *(
            f"{before}{G_MATLAB}{after}"
            for own in (
                *("function y=cos(x)\ny=sin(x);\nend\n", "function m1=m1()\nm1=3;\nend\n"),
                *("function y=g()\ny=-9.81;\nend\n", "function m1\ndisp(1)\nend\n"),
                *("function y=l2(varargin)\ny=3;\nend\n", "function y=q1\ny=3;\nend\n"),
                *("function y=plus(a,b)\ny=a;\nend\n", "function [y,z]=q2(a)\ny=a;z=a;\nend\n"),
            )
            for before, after in ((own, ""), ("", own))
        ),
        f"function p=m2(x)\np=x;\nend\nfunction G=grav(q)\nG=simplify([{TRUE}]);\nend",
        f"function y=simplify(x)\ny=-x;\nend\nfunction G=grav(q)\nG=simplify([{TRUE}]);\nend",
        f"function g=g(q)\ng=[{TRUE}];\nend",
        f"function G=grav(q, p)\nm1 = p.m2;\nG=[{TRUE}];\nend",
        f"p.m1 = 5; m1 = p.m1;\nG=[{TRUE}];",
    ],
)
def test_functions_of_matlab_go_before_what_has_their_names(tmp_path, text):
    assert not passing(report_of(tmp_path / "a.m", text), "g")


@pytest.mark.parametrize(
    "text",
    [
        f"G=grav(q1,q2);\nfunction G=grav(q1,q2)\nG = [{TRUE}];\nend",
        f"{G_MATLAB}function y=other(x)\ny=x;\nend",
        f"function G=grav(q, p)\nm1 = p.m1; g = p.g;\nG=[{TRUE}];\nend",
        f"function G=grav(q, params)\nl1 = params.l1;\nG=[{TRUE}];\nend",
        f"p.m1 = 2; m1 = p.m1;\nG=[{TRUE}];",
    ],
)
def test_functions_of_matlab_that_change_no_name(tmp_path, text):
    assert passing(report_of(tmp_path / "a.m", text), "g")


@pytest.mark.parametrize(
    "text",
    [
        *(
            f"def G(q, {x}):\n  return [{TRUE}]"
            for x in ("g=-9.81", "m1=5", "*, l1=3", "q1=0", "m1=None", "g=9.8")
        ),
        *(f"G = lambda q, {x}: [{TRUE}]" for x in ("m1=3", "g=-9.81", "*, l2=1", "q2=q1", "m2=m1")),
        *(
            f"def G(q, p={x}):\n  m1 = p.m1\n  return [{TRUE}]"
            for x in ("dict(m1=5)", "{'m1': 5}", "f()", "None", "P")
        ),
        f"class P:\n  m1 = 5\nX = P()\ndef G(q, p=X):\n  m1 = p.m1\n  return [{TRUE}]",
        f"def G(q, c1=1):\n  return [{TRUE}]".replace("cos(q1)+", "c1+"),
    ],
)
def test_defaults_other_than_the_file_s_numbers_are_refused(tmp_path, text):
    assert not passing(report_of(tmp_path / "a.py", text), "g")


@pytest.mark.parametrize(
    "half",
    [
        *(
            "Integer(1/2)",
            "sp.Integer(0.5)",
            "int(0.5)",
            "Rational(1/2)",
            "Rational(1.0/2)",
            "Integer(1)//2",
            "1 % 2",
        ),
        *(
            "I2(1/2)",
            "R(1/2)",
            "Integer(m1)/m1/2",
            "Rational(m1, m1)/2",
            "round(0.5)",
            "Rational(0.5, 1)",
            "floor(0.5)",
        ),
    ],
)
def test_numbers_that_sympy_makes_others_of_are_refused(read, half):
    head = "import sympy as sp\nfrom sympy import *\nfrom sympy import Integer as I2\nR = sp.Rational\n"
    assert isinstance(read(f"{head}V = m1*g*l1*({half})").answers["V"], Refusal)


@pytest.mark.parametrize(
    "half", ["Integer(1)/2", "Rational(1, 2)", "sp.Rational(1, 2)", "Rational(0.5)", "S(1)/2"]
)
def test_numbers_that_sympy_leaves_as_they_are(read, half):
    assert not isinstance(read(f"import sympy as sp\nV = m1*g*l1*({half})").answers["V"], Refusal)


@pytest.mark.parametrize(
    "change",
    [
        *(
            "a.b=G\na.b[0]=1",
            "def w(): return G\nw()[0]=1",
            "y=max(G,[0]); y[0]=1",
            "def w(): return G\ny=w(); y[0]=1",
        ),
        *("a['k']=G\na['k'][0]=1", "y=min(G, G); y[0]=1", "a.b.c=G\nf(a)"),
        *(
            "def u(): w()[0]=1\ndef w(): return G\nu()",
            "def w(x): return x\ny=w(G); y[0]=1",
            "y=f(G)\ny[0]+=1",
        ),
        *(
            "a = G\na[0], y = 1, 2",
            "a, b = f(G)\na[0]=1",
            "y=next(iter([G])); y[0]=1",
            "def w(): yield G\nfor y in w(): y[0]=1",
        ),
        *(
            "def w():\n  A = G\n  return A\nw()[0]=1",
            "def w(): return G\nw().append(1)",
            "w = lambda: G\nw()[0] = 1",
        ),
        *(
            "def cos(x): return x\ny = cos(G); y[0]=1",
            "y=sum([], start=G); y[0]=1",
            "def w(): return G\ndel w()[0]",
        ),
    ],
)
def test_a_list_that_is_changed_by_another_way_is_no_answer(tmp_path, change):
    assert not passing(report_of(tmp_path / "a.py", G_LIST + change), "g")


def test_a_function_of_a_parameter_s_name_says_how_to_name_it(read):
    reason = read(f"def g(q):\n  return [{TRUE}]").answers["g"].reason
    assert reason == "g is the robot's parameter; name the function G"


# MATLAB


@pytest.mark.parametrize(
    "text",
    [
        "M = [A B; B D];",
        "M = [A, B\n B, D];",
        "M = [A, B; ...\n B, D];",
        "M = [[A, B]; [B, D]];",
        "M = [A B; B D]';",
        "M = simplify([A, B; B, D]);",
        "M = 2*[A/2, B/2; B/2, D/2];",
        "M = [2*A, 2*B; 2*B, 2*D]/2;",
        "M = sym(zeros(2)); M(1,1) = A; M(1,2) = B; M(2,1) = M(1,2); M(2,2) = D;",
        "M = zeros(2,2);\nM(1,1) = A;\nM(1,2) = B;\nM(2,1) = B;\nM(2,2) = D;",
        "function M = mass(q)\nM = [A, B; B, D];\nend",
        "function M = mass(q1, q2)\nb = B;\nM = [A, b; b, D];",
        "function [M, x] = mass(in)\nM = [A, B; B, D];\nx = 3;\nendfunction",
        "M = @(q1, q2) [A, B; B, D];",
        "syms q1(t) q2(t)\nM = [A, B; B, D];",
        "q = sym('q', [2 1]);\nM = [A, B; B, D];",
        "syms q [2 1]\nM = [A, B; B, D];",
        "x = 3; % comment\nM = [A, B; % first\n     B, D]; # second",
        "c2 = cos(q2)';\nM = [A, B; B, D];",
        "c2 = cos(q(2)); M = [A, B; B, D];",
    ],
)
def test_matrices_of_matlab(tmp_path, text):
    entries = dict(zip("ABD", (x.replace("**", "^") for x in M), strict=True))
    short = "c2" if "c2" in text else "cos(q2)"
    text = re.sub(
        r"\b[ABD]\b", lambda found: f"({entries[found[0]]})".replace("cos(q2)", short), text
    )
    report = report_of(tmp_path / "a.m", text)
    assert passing(report, "M"), report


@pytest.mark.parametrize(
    "value",
    [
        *(
            "m1^l1^2",
            "2^3^2*m1",
            "m1*1:2",
            "m1(end)",
            "q(end)*m1",
            "m1\\l1",
            "m1 == 2",
            "~m1",
            "m1'*[1;2]",
            "x{1}*m1",
        ),
        *(
            "2m1",
            "1d3*m1",
            "0x10*m1",
            "2i*m1",
            "m1*'a'",
            "m1 & l1",
            "[m1 l1]*[1; 2; 3]",
            "m1*@sin",
            "subs(m1, l1)",
            "sin",
        ),
        *("int(m1, q1)", "m1*g(1,2,3,4)", "foo(m1)", "square(m1)", "m1*", "*m1", "()", "m1 l1"),
    ],
)
def test_what_matlab_formulas_are_not_read(read, value):
    try:
        sheet = read(f"K = {value};\nV = m1*g;", ".m")
    except AnswerError:
        return
    assert isinstance(sheet.answers.get("K", Refusal("")), Refusal)


def test_transposes_are_taken(read):
    answer = read("C = [1 2; 3 4]';", ".m").answers["C"]
    assert answer.replace(" ", "") == "[[1,3],[2,4]]"


# Notebooks


def notebook(*cells, **metadata):
    import json

    listed = [
        {"cell_type": "code", "source": cell, "execution_count": k}
        for k, cell in enumerate(cells, start=1)
    ]
    return json.dumps(
        {"cells": [{"cell_type": "markdown", "source": "V = 3"}, *listed], "metadata": metadata}
    )


@pytest.mark.parametrize(
    "line",
    [
        *(
            "%matplotlib inline",
            "!pip install sympy",
            "%pip install sympy",
            "?print",
            "print?",
            "%load_ext autoreload",
        ),
        *("%%time", "%timeit 3", "%%capture", "%config x = 3", "%precision 4"),
    ],
)
def test_magics_that_assign_nothing_are_dropped(read, line):
    sheet = read(notebook(f"{line}\nx = m1", "V = x*g"), ".ipynb")
    assert sheet.answers == {"V": "m1*g"}


@pytest.mark.parametrize(
    "line",
    [
        "%run a.py",
        "%load a.py",
        "%store -r V",
        "%%python2",
        "%pylab",
        "%reset",
        "%%bash2",
        "%macro x",
    ],
)
def test_magics_that_may_assign_refuse_the_notebook(read, line):
    with pytest.raises(AnswerError, match="cell 1"):
        read(notebook(f"{line}\nV = m1"), ".ipynb")


@pytest.mark.parametrize(
    "cell",
    [
        *(
            "%time V = 3",
            "%time V.fill(0)",
            "%timeit V.row_swap(0, 1)",
            "%%timeit\nV = 3",
            "%%capture V\nprint(1)",
        ),
        "    V = 2*V",
    ],
)
def test_what_magics_and_cells_execute_counts(read, cell):
    """IPython executes a timed statement, binds what is captured, and takes a cell's indentation away."""
    answer = read(notebook("V = Matrix([m1*g])", cell), ".ipynb").answers["V"]
    assert isinstance(answer, Refusal)


def test_each_cell_is_python_by_itself(read):
    with pytest.raises(AnswerError, match="cell 2, line 1: no Python"):
        read(notebook("V = m1*g", 's = """', "V = 2*V", '"""'), ".ipynb")


@pytest.mark.parametrize(
    "cell", ["%%bash\nV=3", "%%latex\n$V = 3$", "%%html\n<b>V = 3</b>", "%%writefile a.py\nV = 3"]
)
def test_cells_of_other_languages_are_left_out(read, cell):
    assert read(notebook(cell, "V = m1*g"), ".ipynb").answers == {"V": "m1*g"}


def test_lines_of_notebooks_are_those_of_their_cells(read):
    answer = read(notebook("x = 1\ny = 2", "\nV = m1", "V = m2"), ".ipynb").answers["V"]
    assert "cell 3, line 1" in answer.reason
    with pytest.raises(AnswerError, match="cell 2, line 2: no Python"):
        read(notebook("V = 1", "x = 3\ny = ("), ".ipynb")


def test_cells_that_were_run_in_another_order_are_noted(read):
    import json

    cells = [
        {"cell_type": "code", "source": f"x{k} = {k}\nV = m1", "execution_count": 9 - k}
        for k in range(3)
    ]
    assert "another order" in read(json.dumps({"cells": cells}), ".ipynb").notes[0]


def test_a_notebook_of_octave(read):
    text = notebook("x = m1;\nV = x*g;", kernelspec={"language": "octave"})
    assert read(text, ".ipynb").answers == {"V": "m1*g"}


# What dhkit itself writes


@pytest.mark.slow
@pytest.mark.parametrize(
    "robot", ["planar2r", "polar_rp", "cart_pendulum", "cobra600", "planar3r", "puma560"]
)
def test_equations_are_read_back(tmp_path, robot):
    description = library_robot(robot)
    names = ("M", "C", "g") if description.n > 3 else ("M", "C", "h", "g", "tau", "K", "V")
    lag = lagrangian(description)
    listed = quantities(lag, names)
    from dhkit.symbolic.equations import equations_latex, latex_document

    texts = {".py": equations_python(lag, listed), ".m": equations_matlab(lag, listed)}
    texts[".tex"] = latex_document(equations_latex(listed), robot)
    for suffix, text in texts.items():
        report = report_of(tmp_path / f"a{suffix}", text, description)
        assert report, (suffix, str(report))
        assert set(report.quantities) == set(names)
    for name, text in matlab_files(lag, listed).items():
        if not name.endswith("_parameters.m"):
            assert report_of(tmp_path / name, text, description), name
    found = statements_of(equations_text(listed), ".txt")
    assert not any(statement.problem for statement in found)
    lines = [f"{name} = {s.formulas[-1]};" for s in reversed(found) for name in s.targets]
    report = report_of(tmp_path / "b.m", "\n".join(lines), description)
    assert report, str(report)


def test_a_name_of_a_command_of_matlab_may_be_assigned(tmp_path):
    path = tmp_path / "answer.m"
    formula = "m1*g*l1*sin(q1)/2 + m2*g*(l1*sin(q1) + l2*sin(q1 + q2)/2)"
    assert passing(report_of(path, f"load = 3;\nV = {formula} + load - 3\n"), "V")
    path.write_text(f"load data\nV = {formula}\n")
    with pytest.raises(AnswerError, match="may change any name"):
        grade(path, ROBOT)


def test_a_third_derivative_is_not_an_acceleration(tmp_path):
    report = report_of(tmp_path / "answer.m", "h1 = diff(qdot1, t, 2)\n")
    assert "unreadable: h1" in str(report)


def test_a_part_of_a_row_is_a_row(tmp_path):
    formula = "m1*g*l1*sin(q1)/2 + m2*g*(l1*sin(q1) + l2*sin(q1 + q2)/2)"
    text = f"v = [{formula}, 1, 2];\nw = v(1:2)*[1; 0];\nV = w(1) + 0*w(1);\n"
    assert passing(report_of(tmp_path / "answer.m", text), "V")


def test_a_field_in_a_handle_is_not_a_name(tmp_path):
    """m1 of p.m1 is a field, whatever m1 is assigned afterwards."""
    text = "p.m2 = m2;\nf = @(x) p.m2*x;\nM22 = f(l2^2/3);\nm2 = 3;\n"
    assert "assigned after the handle" not in str(report_of(tmp_path / "answer.m", text))
