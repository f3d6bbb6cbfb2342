"""Matrices in one text, and names that mean two things: read as a person would, or asked about."""

import unicodedata

import casadi
import pytest

from dhkit import Arm
from dhkit.description import from_dh
from dhkit.errors import AnswerError
from dhkit.grading import Verdict
from dhkit.grading.answers.reading import read_answer
from dhkit.grading.answers.typeset import typeset
from dhkit.grading.answers.vocabulary import Vocabulary

ARM = Arm.load("planar2r")


def verdict(**answers):
    return ARM.grade(explain=False, **answers).verdict


C_ROWS = (("-m2*l1*l2*s2*qd2/2", "-m2*l1*l2*s2*(qd1 + qd2)/2"), ("m2*l1*l2*s2*qd1/2", "0"))
G_PAIR = ("(m1/2 + m2)*g*l1*c1 + m2*g*l2*c12/2", "m2*g*l2*c12/2")
TRANSPOSED = [
    "{}'",
    "{}.'",
    "Matrix({}).T",
    "np.array({}).T",
    "transpose({})",
    "({})'",
    "transpose(Matrix({}))",
    "{}^T",
]
TWICE = [
    "transpose({})'",
    "sp.Matrix({}).T.T",
    "({}')'",
    "transpose(transpose({}))",
    "Matrix(np.array({}))",
]


def in_one_text(rows, notation):
    if notation == "lists":
        return "[" + ", ".join(f"[{', '.join(row)}]" for row in rows) + "]"
    return "[" + "; ".join(", ".join(row) for row in rows) + "]"


@pytest.mark.parametrize("notation", ["lists", "MATLAB"])
@pytest.mark.parametrize("written", TRANSPOSED + TWICE)
def test_transposes_are_read(written, notation):
    right, turned = (
        in_one_text(C_ROWS, notation),
        in_one_text(list(zip(*C_ROWS, strict=True)), notation),
    )
    expected = (
        (Verdict.WRONG, Verdict.CORRECT)
        if written in TRANSPOSED
        else (Verdict.CORRECT, Verdict.WRONG)
    )
    assert (verdict(C=written.format(right)), verdict(C=written.format(turned))) == expected


@pytest.mark.parametrize("sign", ["^T", "^{T}", r"^\top", r"^{\top}"])
def test_transposes_of_latex_are_read(sign):
    matrix = r"\begin{{bmatrix}} {} & {} \\ {} & {} \end{{bmatrix}}".format(*C_ROWS[0], *C_ROWS[1])
    assert verdict(C=matrix.replace("*", " ")) is Verdict.CORRECT
    assert verdict(C=matrix.replace("*", " ") + sign) is Verdict.WRONG


@pytest.mark.parametrize(
    "written",
    [
        "([{0}; {1}])*(1)",
        "(1)*[{0}; {1}]*(1)",
        "np.array([{0}, {1}])*1",
        "1/2*Matrix([2*({0}), 2*({1})])",
        "Matrix(2, 1, [{0}, {1}])",
        "-1*<-({0}), -({1})>",
        "[{0}\n {1}] % [N m]",
        "[{0}; % first (of [two])\n {1}]",
        "2*[{0}; {1}]/2",
        "[[{0}], [{1}]]'",
        "transpose([{0}, {1}])",
        "-[-({0}); -({1})]",
    ],
)
def test_factors_and_comments_of_a_matrix_are_read(written):
    assert verdict(g=written.format(*G_PAIR)) is Verdict.CORRECT
    assert verdict(g=written.format(G_PAIR[0], f"3*({G_PAIR[1]})")) is Verdict.WRONG


@pytest.mark.parametrize(
    "written",
    [
        "[[{0}], 7 ({1}) l1]",
        "[{0}; {1}]^2",
        "([{0}; {1}])^2",
        "[{0}; {1}].^2",
        "Matrix([{0}, {1}])**2",
        "1/[{0}; {1}]",
        "[{0}; {1}]^-1",
        "Matrix(2, 2, [{0}, {1}])",
        "[{0}; {1}]*[1; 1]",
    ],
)
def test_what_is_done_with_a_matrix_is_refused(written):
    with pytest.raises(AnswerError):
        ARM.grade(g=written.format(*G_PAIR), explain=False)


# Names that mean two things


def arm_with(*names):
    parameters = dict.fromkeys(("l1", "l2", "m1", "m2", *names), 0.5)
    return Vocabulary(from_dh([(0, 0, "l1", 0), (0, 0, "l2", 0)], parameters=parameters))


@pytest.mark.parametrize(
    ("text", "names", "read"),
    [
        (r"l1c\,l_2", ("l1c",), "l1c*l2"),
        (r"l1c^2 l_1^2", ("l1c",), "l1c^2*l1^2"),
        (r"I1z\,\theta_1", ("I1z",), "I1z*q1"),
        ("sin(q2(t))*diff(q1(t),t)", ("T",), "sin(q2)*qd1"),
        ("q(1)*l1", ("Q",), "q1*l1"),
        ("d2q1/dt2 + ddq2/dt2", (), "qdd1 + qdd2"),
        ("c_12", (), "cos(q1 + q2)"),
        ("√2*m1", (), "sqrt(2)*m1"),
        ("√m1", (), "sqrt(m1)"),
        ("c*(l1 + l2)", ("c",), "c*(l1 + l2)"),
        ("c q1 + s q2", (), "cos(q1) + sin(q2)"),
    ],
)
def test_names_that_are_read(text, names, read):
    assert typeset(read_answer(text, arm_with(*names)))[0] == read


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("l1 c (l1 + l2)", ("c",)),
        (r"l_1 c \left(l_1 + l_2\right)", ("c",)),
        ("S (l1 + l2)", ("S",)),
        ("sin(q2(t))", ("t",)),
        ("q(1)*l1", ("q",)),
        (r"\frac{1}{2} m_2 l_2 c_12", ()),
        (r"\cos\theta_12", ()),
        (r"\sin\frac{1}{2}\theta_1", ()),
        ("sin 1/2 q1", ()),
        ("c(1)", ()),
        ("q1(0)", ()),
        ("c l1", ()),
        ("m1 s l2", ()),
    ],
)
def test_names_that_are_asked_about(text, names):
    with pytest.raises(AnswerError):
        read_answer(text, arm_with(*names))


def test_letters_with_their_dots_in_one_character():
    names = {"q": ["x", "y"]}
    text = "[-m2*l1*l2*sin(y)*ẋ*ẏ - m2*l1*l2*sin(y)*ẏ^2/2 m2*l1*l2*sin(y)*ẋ^2/2]"
    for form in ("NFC", "NFD"):
        answers = {"h": unicodedata.normalize(form, text)}
        assert ARM.grade(answers, names=names, explain=False).verdict is Verdict.CORRECT


def test_a_right_entry_of_C_beside_one_outside_the_ring():
    arm = Arm.load("cart_pendulum")
    report = arm.grade(C=[["q2*qd2", "-l*mp*qd2*sin(q2)/2"], ["0", "0"]], explain=False)
    assert {entry.name for entry in report.entries if not entry.verdict.passes} == {"C11"}


# CasADi


def mass_matrix(q2, m1, m2, l1, l2):
    """Return the mass matrix of two uniform rods, which does not depend on q1."""
    coupled = m2 * (l2**2 / 3 + l1 * l2 * casadi.cos(q2) / 2)
    first = m1 * l1**2 / 3 + m2 * (l1**2 + l2**2 / 3 + l1 * l2 * casadi.cos(q2))
    return casadi.vertcat(casadi.horzcat(first, coupled), casadi.horzcat(coupled, m2 * l2**2 / 3))


LENGTHS = [casadi.SX.sym(name) for name in ("m1", "m2", "l1", "l2")]


@pytest.mark.parametrize("name", ["q2", "q_2"])
def test_symbols_of_casadi_count_from_one(name):
    assert (
        ARM.grade(M=mass_matrix(casadi.SX.sym(name), *LENGTHS), explain=False).verdict
        is Verdict.CORRECT
    )


def test_entries_of_a_vector_of_casadi_count_from_zero_if_the_answer_shows_it():
    """SX.sym("q", 2) has q_0 and q_1; q_1 alone may be a symbol of the first joint too."""
    q = casadi.SX.sym("q", 2)
    alone = ARM.grade(M=mass_matrix(q[1], *LENGTHS), explain=False)
    assert alone.verdict is Verdict.UNREADABLE
    assert "q_1 may be joint 1 or" in alone.entries[0].statement
    m1, m2, l1, l2 = LENGTHS
    g = casadi.SX.sym("g")
    second = m2 * g * l2 / 2 * casadi.cos(q[0] + q[1])
    first = (m1 / 2 + m2) * g * l1 * casadi.cos(q[0]) + second
    assert ARM.grade(g=casadi.vertcat(first, second), explain=False).verdict is Verdict.CORRECT


def test_a_list_of_scalars_of_casadi_is_one_answer():
    """An entry with q_1 alone counts as the others show: here from 1, by q_2 in another entry."""
    q1 = casadi.SX.sym("q_1")
    q2 = casadi.SX.sym("q_2")
    first, second = casadi.vertsplit(casadi.vertcat(q1, q2 + casadi.sin(q1)))
    assert ARM.grade(g=[first, second], explain=False).verdict is Verdict.WRONG
    m1, m2, l1, l2 = LENGTHS
    V = casadi.SX.sym("g") * (
        m1 * l1 / 2 * casadi.sin(q1) + m2 * (l1 * casadi.sin(q1) + l2 / 2 * casadi.sin(q1 + q2))
    )
    gradient = casadi.vertsplit(casadi.gradient(V, casadi.vertcat(q1, q2)))
    assert ARM.grade(g=gradient, explain=False).verdict is Verdict.CORRECT


def test_a_function_of_casadi_has_the_arms_own_joint_variables():
    values = ARM.description.numbers.values
    q = casadi.SX.sym("q", 2)
    M = mass_matrix(q[1], *(values[name] for name in ("m1", "m2", "l1", "l2")))
    function = casadi.Function("M", [q], [M])
    assert ARM.grade(M=function, explain=False).verdict in (Verdict.CORRECT, Verdict.ROUNDED)
    wrong = casadi.Function("M", [q], [casadi.substitute(M, q[1], q[0])])
    assert ARM.grade(M=wrong, explain=False).verdict is Verdict.WRONG
    with pytest.raises(AnswerError, match="expected a function of"):
        ARM.grade(M=casadi.Function("M", [], [casadi.SX.eye(2)]))


@pytest.mark.parametrize(
    ("text", "plain", "latex"),
    [
        ("(2^3)^q1", "(2^3)^q1", r"(2^{3})^{q_{1}}"),
        ("2^(3^q1)", "2^(3^q1)", r"2^{3^{q_{1}}}"),
        ("2*3*q1", "2*3*q1", r"2 \cdot 3 q_{1}"),
        ("2*1/2", "2*1/2", r"\frac{2 \cdot 1}{2}"),
        ("cos(q1)^2*l1/2", "cos(q1)^2*l1/2", r"\frac{\cos(q_{1})^{2} l_{1}}{2}"),
    ],
)
def test_formulas_are_typeset_without_double_meaning(text, plain, latex):
    assert typeset(read_answer(text, Vocabulary(ARM.description))) == (plain, latex)
