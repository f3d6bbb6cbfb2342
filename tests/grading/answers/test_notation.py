"""Every notation means what a person means by it; what is not mathematics is refused with its place."""

import contextlib
import math
from types import SimpleNamespace

import pytest
from hypothesis import given, settings, strategies as st

from acceptance import ACCEPTING
from dhkit.description import from_dh, library_robot
from dhkit.errors import AnswerError
from dhkit.grading.answers import Vocabulary, read_answer, read_matrix
from dhkit.grading.judging.numeric import doubles
from grading_states import STATE

V = SimpleNamespace(**STATE)
sin, cos, tan, pi = math.sin, math.cos, math.tan, math.pi

NOTATIONS = {
    # Python and sympy
    "m2*l1*cos(q2)**2": V.m2 * V.l1 * cos(V.q2) ** 2,
    "-m1**-1": -1 / V.m1,
    "np.sin(q[0])*math.cos(q[1])": sin(V.q1) * cos(V.q2),
    "sp.Rational(1, 3)*m1*l1**2": V.m1 * V.l1**2 / 3,
    "Rational(1,12)*m1": V.m1 / 12,
    "sympy.sqrt(3)/2*m1": math.sqrt(3) / 2 * V.m1,
    "m1*Derivative(q1(t), (t, 2)) + Derivative(q2(t), t)": V.m1 * V.qdd1 + V.qd2,
    "diff(theta1(t), t)**2 + diff(q2(t), t, t)": V.qd1**2 + V.qdd2,
    "S(1)/2*m1": V.m1 / 2,
    "sin(q1)**2 + cos(q1)**2": 1,
    "l[0] + m[1]": V.l1 + V.m2,
    "qd[0]*qd[1]": V.qd1 * V.qd2,
    "1e-3*m1 + .5*l1 + 2.": 1e-3 * V.m1 + V.l1 / 2 + 2,
    # MATLAB
    "m2.*l1.^2.*cos(q(2))'": V.m2 * V.l1**2 * cos(V.q2),
    "2.*m1./l1": 2 * V.m1 / V.l1,
    "m1*l1^2/12": V.m1 * V.l1**2 / 12,
    "dq(1)*dq(2)": V.qd1 * V.qd2,
    "sind(90)*m1": V.m1,
    # shorthand
    "c1*s12 - s1*c12": sin(V.q2),
    "C1 S12": cos(V.q1) * sin(V.q1 + V.q2),
    "s_1 c_12": sin(V.q1) * cos(V.q1 + V.q2),
    "m2 l1 c2^2": V.m2 * V.l1 * cos(V.q2) ** 2,
    "m2l1l2s2": V.m2 * V.l1 * V.l2 * sin(V.q2),
    "1/2 m1 l1^2": V.m1 * V.l1**2 / 2,
    "2(m1 + m2)(l1)": 2 * (V.m1 + V.m2) * V.l1,
    "sin q1 cos 2 q2": sin(V.q1) * cos(2 * V.q2),
    "sin^2 q1": sin(V.q1) ** 2,
    "sin^2(q1 + q2) l1": sin(V.q1 + V.q2) ** 2 * V.l1,
    "cos(th1)*sin(theta2)*thd1*theta_2_dot": cos(V.q1) * sin(V.q2) * V.qd1 * V.qd2,
    "q1dot*dq2*qd_1*dtheta2*th1d": V.qd1**3 * V.qd2**2,
    "ddq1 + qddot2 + theta1ddot + thdd2 + d2q1": 3 * V.qdd1 + 2 * V.qdd2,
    "L1*M_2": V.l1 * V.m2,
    "sec(q1)*cos(q1) + cot(q2)*tan(q2)": 2,
    "cos(th12) + sin(q12)": cos(V.q1 + V.q2) + sin(V.q1 + V.q2),
    "m2gl2cos(q1)": V.m2 * V.g * V.l2 * cos(V.q1),
    "l1*[m1 + m2]/2": V.l1 * (V.m1 + V.m2) / 2,
    "theta1'*theta2'^2 + q1''": V.qd1 * V.qd2**2 + V.qdd1,
    "Cos(q1)*SIN(Theta2)": cos(V.q1) * sin(V.q2),
    # LaTeX
    r"\frac{1}{2} m_1 \dot\theta_1^2": V.m1 * V.qd1**2 / 2,
    r"\tfrac12 m_1 l_1^2 + \frac{m_2}{3}l_2^{2}": V.m1 * V.l1**2 / 2 + V.m2 / 3 * V.l2**2,
    r"\cos(q_1+q_2) + c_{12}": 2 * cos(V.q1 + V.q2),
    r"c_{1-2}": cos(V.q1 - V.q2),
    r"\cos\theta_1\,\sin^2\theta_2": cos(V.q1) * sin(V.q2) ** 2,
    r"m_2\left(l_1^2 + l_1 l_2\cos\theta_2\right)": V.m2 * (V.l1**2 + V.l1 * V.l2 * cos(V.q2)),
    r"\ddot{q}_1 + \ddot{\theta}_{2} + \ddot{\theta_1} + {\dot\theta}_1": 2 * V.qdd1
    + V.qdd2
    + V.qd1,
    r"\dot{\theta}_1\cdot\dot q_2 \times \ell_1": V.qd1 * V.qd2 * V.l1,
    r"$\mathrm{sin}(\theta_1) \, \operatorname{cos}\left(\theta_2\right)$": sin(V.q1) * cos(V.q2),
    r"\sqrt{l_1^2}": V.l1,
    r"\frac{d}{d t} \theta_{1}{\left(t \right)} + \frac{d^{2}}{d t^{2}} q_{2}{\left(t \right)}": V.qd1
    + V.qdd2,
    r"\frac{d\theta_1}{dt}\frac{\partial}{\partial t} q_2(t)": V.qd1 * V.qd2,
    r"\sin{\left(\theta_{1}{\left(t \right)} \right)}": sin(V.q1),
    r"m_{2}gl_{1}": V.m2 * V.g * V.l1,
    r"\bigl[ m_1 + m_2 \bigr] g": (V.m1 + V.m2) * V.g,
    # what keyboards and editors insert
    "θ̇₁² m₂": V.qd1**2 * V.m2,
    "½·m₁·l₁²": V.m1 * V.l1**2 / 2,
    "−m1×g×cos θ₁": -V.m1 * V.g * cos(V.q1),
    "q̈₁ + q̇2": V.qdd1 + V.qd2,
    "m₂gl₂cos(θ₁+θ₂) sinθ2": V.m2 * V.g * V.l2 * cos(V.q1 + V.q2) * sin(V.q2),
    "m₂ l₁⁻¹² ": V.m2 * V.l1**-12,
    # angles
    "sin(q1 + pi/2)": cos(V.q1),
    "cos(2*q1 - 3*q2 + pi)": cos(2 * V.q1 - 3 * V.q2 + pi),
    "cos(30*deg)": math.sqrt(3) / 2,
}


@pytest.fixture(scope="module")
def vocabulary():
    return Vocabulary(library_robot("planar2r"))


@pytest.mark.parametrize("text", NOTATIONS)
def test_a_notation_means_what_is_meant(text, vocabulary):
    assert doubles(read_answer(text, vocabulary), STATE) == pytest.approx(
        NOTATIONS[text], rel=1e-14, abs=1e-14
    )


MATRICES = {
    "[[m1, m2],[l1, 0]]": [["m1", "m2"], ["l1", "0"]],
    "[m1 -m2; l1, 0]": [["m1", "-m2"], ["l1", "0"]],
    "[m1 - m2 l1; l1 2]": [["m1 - m2", "l1"], ["l1", "2"]],
    "Matrix([[m1],[l1]])": [["m1"], ["l1"]],
    "sp.Matrix([[m1, l1]]).T": [["m1", "l1"]],
    "np.array([[q1,1],[2,3]])": [["q1", "1"], ["2", "3"]],
    "[m1; m2]'": [["m1"], ["m2"]],
    r"\begin{bmatrix} m_1 & 0\\ l_1 & c_{12}\end{bmatrix}": [["m_1", "0"], ["l_1", "c_{12}"]],
    r"\left[\begin{array}{cc} 1 & 2 \\ 3 & 4 \end{array}\right]": [["1", "2"], ["3", "4"]],
    "[m1, m2\n l1, 0]": [["m1", "m2"], ["l1", "0"]],
    "[m1 ...\n ; l1]": [["m1"], ["l1"]],
    "1/6*[[m1, m2], [l1, 0]]": [["m1", "m2"], ["l1", "0"]],
    r"\frac{1}{6}\begin{bmatrix} m_1 \\[4pt] m_2 \end{bmatrix}^\top": [["m_1"], ["m_2"]],
    "[m1 cos(q1); l1 2]": [["m1", "cos(q1)"], ["l1", "2"]],
    "[cos q1 m2; l1 sin q2]": [["cos q1", "m2"], ["l1", "sin q2"]],
    "[m1*cos q1 + m2; l1]": [["m1*cos q1 + m2"], ["l1"]],
    "<m1, l1*cos(theta[2](t))>": [["m1"], ["l1*cos(theta[2](t))"]],
    "np.diag([m1 + l1, m2])": [["m1 + l1", "0"], ["0", "m2"]],
    "diag(m1 + l1, m2)": [["m1 + l1", "0"], ["0", "m2"]],
    "diag([m1 + l1; m2])": [["m1 + l1", "0"], ["0", "m2"]],
    r"\operatorname{diag}(m_1, l_1)": [["m_1", "0"], ["0", "l_1"]],
    r"\begin{pmatrix} \frac{1}{2} m_1 \\ 0 \end{pmatrix}": [[r"\frac{1}{2} m_1"], ["0"]],
}


@pytest.mark.parametrize("text", MATRICES)
def test_a_matrix_in_one_text(text, vocabulary):
    assert [[entry for entry, _ in row] for row in read_matrix(text, vocabulary)] == MATRICES[text]


REFUSED = {
    "__import__('os').system('x')": "unknown name '__import__'|attribute",
    "m1.__class__": "attribute",
    "lambda x: x": "unknown name 'lambda'",
    "f'{m1}'": "a prime",
    "m1 if q1 > 0 else m2": "unexpected '>'|unknown name 'if'",
    "ql": "did you mean 'q",
    "l3": "unknown name 'l3'",
    "q3": "unknown name 'q3'",
    "сos(q1)": "CYRILLIC SMALL LETTER ES",
    "m1 + ": "ends where",
    "(m1": "ends where",
    "m1)": "found '\\)'|expected",
    "2 3": "found '3' at position 3",
    "": "ends where",
    r"\input{/etc/passwd}": r"macro \\input",
    r"\write18{rm}": r"macro \\write",
    r"\def\a{\a\a}\a": r"macro \\def",
    "m1\x00": "unexpected character",
    "(" * 60 + "m1" + ")" * 60: "nested more than 50",
    r"\sqrt" * 200 + "{m_1}": "nested more than 50",
    "m1" * 200_000: "characters",
    "sin": "without an argument",
    "atan2(q1)": "of 1 arguments",
    "diff(m1, q1)": "derivative other than",
    "m1 = 3": "unexpected '='",
    r"\sqrt[3]{m_1}": "other than the square root",
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_no_expression_is_refused(text, vocabulary):
    with pytest.raises(AnswerError, match=REFUSED[text]) as refusal:
        read_answer(text, vocabulary)
    assert len(str(refusal.value)) < 300
    assert "\x00" not in str(refusal.value)


def test_own_names_go_before_the_usual_ones():
    names = Vocabulary(library_robot("planar2r"), q=("a", "b"), qd=("u", "v"))
    value = doubles(read_answer("a + b*bdot + u*v + addot", names), STATE)
    assert value == pytest.approx(V.q1 + V.q2 * V.qd2 + V.qd1 * V.qd2 + V.qdd1)


@pytest.mark.parametrize("name", ["c", "s", "t", "e", "I2x"])
@pytest.mark.parametrize(
    "written", ["m1*{}**2/3", "m1*{0}*{0}/3", r"\frac{{1}}{{3}} m_1 {}^2", "{}^2*m1/3"]
)
def test_a_parameter_may_be_called_like_a_shorthand(name, written):
    robot = from_dh([(0, 0, name, 0)], parameters={"m1": 2.0, name: 0.5})
    vocabulary = Vocabulary(robot)
    value = doubles(read_answer(written.format(name), vocabulary), {"m1": 2.0, name: 0.5})
    assert value == pytest.approx(2.0 * 0.25 / 3)


def test_a_files_parameter_goes_before_shorthand():
    arm = from_dh([(0, 0, "c1", 0), (0, 0, 0.2, 0)], parameters={"c1": 0.3})
    names = Vocabulary(arm)
    assert doubles(read_answer("c1", names), {"c1": 0.3, "q1": 1.0}) == 0.3
    assert doubles(read_answer("s1", names), {"q1": 1.0}) == sin(1.0)


def test_sliding_joints_have_no_sine_and_may_be_called_d():
    names = Vocabulary(library_robot("polar_rp"))
    assert (
        doubles(read_answer("d2 + d2dot + rdd2", names), {"q2": 0.5, "qd2": 0.25, "qdd2": 2.0})
        == 2.75
    )
    with pytest.raises(AnswerError, match="unknown name"):
        read_answer("c2", names)


def test_gravity_is_known_where_it_is_a_number():
    names = Vocabulary(library_robot("puma560"))
    assert doubles(read_answer("2*g", names), {}) == pytest.approx(2 * 9.81)


def test_absolute_angles_are_sums():
    names = Vocabulary(library_robot("planar2r"), sums=((0,), (0, 1)))
    assert doubles(read_answer("th2 + th2dot + c2 + qdd2", names), STATE) == pytest.approx(
        V.q1 + V.q2 + V.qd1 + V.qd2 + cos(V.q1 + V.q2) + V.qdd1 + V.qdd2
    )


WORDS = ("sin", "cos", "q1", "theta", "\\frac", "\\dot", "m1", "l2", "²", "θ", "t", "diff")
PIECES = st.lists(
    st.sampled_from([*"()[]{}+-*/^_.,;'&$\\ 0123456789", *WORDS]) | st.text(max_size=4), max_size=24
).map("".join)


def fuzz(vocabulary, text):
    """Whatever is typed, the reader answers or refuses; nothing else happens."""
    for read in (read_answer, read_matrix):
        with contextlib.suppress(AnswerError):
            read(text, vocabulary)


@settings(max_examples=400 if ACCEPTING else 150)
@given(PIECES)
def test_nothing_but_refusals_comes_of_any_text(text):
    fuzz(Vocabulary(library_robot("planar2r")), text)
