"""Formulas with several matrices: sums, products, transposes, powers, and names of other answers of a sheet."""

import numpy as np
import pytest

import dhkit
from dhkit.description import library_robot
from dhkit.errors import AnswerError
from dhkit.grading import Verdict
from dhkit.grading.answers.matrix_algebra import is_algebra, read_algebra
from dhkit.grading.answers.vocabulary import Vocabulary
from dhkit.grading.judging.numeric import doubles

PLANAR = dhkit.Arm.load("planar2r")
VALUES = {"q1": 0.7, "q2": -1.3, "l1": 0.6, "l2": 0.35, "m1": 2.5, "m2": 1.5}
SCALARS = ("q1", "l1", "2", "0.5", "m2", "(l1 + l2)", "cos(q2)", "sin(q1 + q2)")


def value_of(text):
    """Return the number that a formula of plain Python is."""
    return eval(text, {"cos": np.cos, "sin": np.sin}, VALUES)


# A law: random formulas in five notations, against numpy


def random_formula(rng, shape, depth):
    """Return a random formula of a shape as nested tuples, and its value."""
    m, n = shape
    kinds = (
        ["literal"]
        if depth == 0
        else ["literal", "sum", "product", "scaled", "transpose", "quotient"]
    )
    match str(rng.choice(kinds)):
        case "sum":
            left, x = random_formula(rng, shape, depth - 1)
            right, y = random_formula(rng, shape, depth - 1)
            added = bool(rng.random() < 0.5)
            return ("sum", left, right, added), x + y if added else x - y
        case "product":
            inner = int(rng.integers(2, 4))
            left, x = random_formula(rng, (m, inner), depth - 1)
            right, y = random_formula(rng, (inner, n), depth - 1)
            return ("product", left, right), x @ y
        case "scaled":
            number = str(rng.choice(SCALARS))
            part, x = random_formula(rng, shape, depth - 1)
            return ("scaled", number, part), value_of(number) * x
        case "quotient":
            number = str(rng.choice(["2", "l1", "(l1 + l2)"]))
            part, x = random_formula(rng, shape, depth - 1)
            return ("quotient", part, number), x / value_of(number)
        case "transpose":
            part, x = random_formula(rng, (n, m), depth - 1)
            return ("transpose", part), x.T
    entries = [[str(rng.choice(SCALARS)) for _ in range(n)] for _ in range(m)]
    return ("literal", entries), np.array([[value_of(entry) for entry in row] for row in entries])


def written(formula, notation):
    """Return a formula as text: matlab, spaces (MATLAB without commas), numpy, sympy or latex."""
    match formula:
        case ("sum", left, right, added):
            return f"({written(left, notation)} {'+' if added else '-'} {written(right, notation)})"
        case ("product", left, right):
            if notation == "numpy":
                return f"({written(left, notation)}) @ ({written(right, notation)})"
            return f"{written(left, notation)}{' ' if notation == 'latex' else '*'}{written(right, notation)}"
        case ("scaled", number, part):
            if notation == "latex":
                return rf"{latex(number)} \cdot {written(part, notation)}"
            return f"{number}*{written(part, notation)}"
        case ("quotient", part, number):
            if notation == "latex":
                return rf"\frac{{1}}{{{latex(number)}}} {written(part, notation)}"
            return f"{written(part, notation)}/{number}"
        case ("transpose", part):
            sign = {"numpy": ".T", "sympy": ".T", "latex": "^T"}.get(notation, "'")
            return f"({written(part, notation)}){sign}"
        case ("literal", entries):
            if notation == "latex":
                rows = r" \\ ".join(" & ".join(map(latex, row)) for row in entries)
                return rf"\begin{{bmatrix}} {rows} \end{{bmatrix}}"
            if notation in ("matlab", "spaces"):
                between = ", " if notation == "matlab" else " "
                compact = [[entry.replace(" ", "") for entry in row] for row in entries]
                return f"[{'; '.join(between.join(row) for row in compact)}]"
            name = "np.array" if notation == "numpy" else "Matrix"
            return f"{name}([{', '.join('[' + ', '.join(row) + ']' for row in entries)}])"
    raise ValueError(formula)


def latex(entry):
    return {
        "cos(q2)": r"\cos(q_2)",
        "sin(q1 + q2)": r"\sin(q_1 + q_2)",
        "(l1 + l2)": "(l_1 + l_2)",
        "q1": "q_1",
        "l1": "l_1",
        "m2": "m_2",
    }.get(entry, entry)


def test_random_formulas_are_read_as_numpy_computes_them(law):
    vocabulary = Vocabulary(library_robot("planar2r"))
    rng = np.random.default_rng(0)
    notations = ("matlab", "spaces", "numpy", "sympy", "latex")
    for k in range(law.samples(5000, quick=300)):
        formula, expected = random_formula(
            rng, tuple(int(x) for x in rng.integers(1, 4, 2)), int(rng.integers(1, 4))
        )
        text = written(formula, notations[k % len(notations)])
        if not is_algebra(text, vocabulary):
            continue
        rows = read_algebra(text, vocabulary)
        found = np.array([[float(doubles(entry, VALUES)) for entry in row] for row in rows])
        assert found.shape == expected.shape, text
        error = np.max(np.abs(found - expected)) / max(1.0, np.abs(expected).max())
        law.holds("error of an entry", error, 1e-12, text)


# Answers


def given(name):
    """Return the true answer to a quantity as text."""
    value = getattr(PLANAR.lagrangian, name)
    if isinstance(value, list | tuple) or hasattr(value, "tolist"):
        return [
            [str(entry) for entry in row] if hasattr(row, "__len__") and name in "MC" else str(row)
            for row in value
        ]
    return str(value)


A1 = "[c1 -s1 0 l1*c1; s1 c1 0 l1*s1; 0 0 1 0; 0 0 0 1]"
A2 = "[c2 -s2 0 l2*c2; s2 c2 0 l2*s2; 0 0 1 0; 0 0 0 1]"
RIGHT = {
    "quadratic form": {"M": given("M"), "K": "1/2*qd'*M*qd"},
    "its transpose": {"M": given("M"), "K": "transpose(qd)*M*qd/2"},
    "in LaTeX": {"M": given("M"), "K": r"\frac{1}{2}\dot{q}^T M \dot{q}"},
    "equation of motion": {
        "M": given("M"),
        "h": given("h"),
        "g": given("g"),
        "tau": "M*qdd + h + G",
    },
    "of arguments": {
        "M": given("M"),
        "h": given("h"),
        "g": given("g"),
        "tau": "M(q)*qdd + h(q, qd) + G(q)",
    },
    "entries of vectors": {
        "h": ["-m2*l1*l2*sin(q(2))*(qd(1)*qd(2) + qd(2)^2/2)", "m2*l1*l2*sin(q(2))*qd(1)^2/2"]
    },
    "numpy's entries": {
        "h": [
            "-m2*l1*l2*np.sin(q[1])*(qd[0]*qd[1] + qd[1]**2/2)",
            "m2*l1*l2*np.sin(q[1])*qd[0]**2/2",
        ]
    },
    "with C": {"M": given("M"), "C": given("C"), "g": given("g"), "tau": "M*qdd + C*qd + G"},
    "h of C": {"C": given("C"), "h": "C*qd"},
    "L of energies": {"K": given("K"), "V": given("V"), "L": "K - V"},
    "product of transforms": {"A1": A1, "A2": A2, "T": "A1*A2"},
    "one of them written out": {"A1": A1, "T": f"A1*{A2}"},
    "both written out": {"T": f"{A1}*{A2}"},
    "sum of links": {
        "M": "[m1*l1^2/3, 0; 0, 0] + m2*[l1^2 + l2^2/3 + l1*l2*c2, l2^2/3 + l1*l2*c2/2; l2^2/3 + l1*l2*c2/2, l2^2/3]"
    },
}


@pytest.mark.parametrize("name", RIGHT)
def test_answers_in_terms_of_matrices_are_right(name):
    report = PLANAR.grade(RIGHT[name])
    assert report.verdict is Verdict.CORRECT, str(report)


def test_wrong_ones_are_wrong_and_named():
    report = PLANAR.grade({"A1": A1, "A2": A2, "T": "A2*A1"})
    assert report.verdict is Verdict.WRONG and "wrong way" in report.diagnosis[0].sentence
    assert PLANAR.grade({"M": given("M"), "K": "qd'*M*qd"}).entries[-1].verdict is Verdict.WRONG
    assert PLANAR.grade(
        {"M": given("M"), "C": given("C"), "g": given("g"), "tau": "M*qdd + C*qd - G"}
    ).verdict is (Verdict.WRONG)


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        ({"M": "[1 0;0 1]*[1 2 3]"}, "a product of matrices of 2 x 2 and 1 x 3"),
        ({"M": "[1 0;0 1] + [1 2 3]"}, "a sum of matrices of 1 x 3 and 2 x 2"),
        ({"M": "[1 0;0 1]*[1;2]"}, "M: found 2 rows of 1; expected 2 of 2"),
        ({"K": "[1 0;0 1]*[qd1;qd2]"}, "K: found 2 rows of 1; expected a number"),
        ({"g": "[1 2;3 4]*[1;2;]/[1 2]"}, "a division by a matrix"),
        ({"g": "[1 2;3 4]^-1*[1;2]"}, "a power of a matrix that is not a small whole number"),
        ({"g": "np.array([[1,0],[0,1]])*np.array([1,2])"}, "multiplies entry by entry; write @"),
        ({"g": "[1 0;0 1].*[1 2;3 4]"}, "multiplies entry by entry"),
        ({"M": "[1 0;0 1].^2 + [1 2;3 4]"}, "raises entry by entry"),
        ({"M": given("M"), "K": "q'*M*q/2"}, "q' may be the transpose of q or its rate"),
        ({"M": "M*[1 0;0 1]"}, "unknown name 'M'"),
        ({"T": "A1*A2"}, "expected a matrix in brackets, found 'A1"),
        (
            {"M": given("M"), "h": given("h"), "g": given("g"), "tau": "M*qdd + h + g"},
            "write G for the answer to g",
        ),
        ({"g": "sin([1;2])*[1 2]"}, "sin without an argument"),
        ({"g": "[1 2;3]*[1;2]"}, "rows have different lengths"),
        ({"g": f"{'[1 0;0 1]^8*' * 800}[1;2]"}, "more than 64 products"),
        ({"M": f"{'(' * 10}[m1 l1;l2 m2]{'^8)' * 10}"}, "more than 64 products"),
    ],
)
def test_what_cannot_be_read_says_why(answers, message):
    report = PLANAR.grade({"V": given("V"), **answers})
    unread = [entry.statement for entry in report.entries if entry.verdict is Verdict.UNREADABLE]
    assert unread and message in unread[0], unread


@pytest.mark.parametrize(
    "text",
    [
        r"\begin{bmatrix} m_1 & m_2 \\ m_2 & l_1 \end{bmatrix} + m_2",
        "[m1, m2; m2, l1] + m2",
        "m2 - [m1, m2; m2, l1]",
        "[[m1, m2], [m2, l1]] - m2*l2^2/3",
    ],
)
def test_a_matrix_and_a_number_have_no_sum(text):
    with pytest.raises(AnswerError, match="a matrix in a sum with a number"):
        dhkit.Arm.load("planar2r").grade({"M": text})


@pytest.mark.parametrize(
    ("g2", "verdict"),
    [
        (r"m_2 g {\frac{1}{2} l_2 \cos(q_1+q_2)}", Verdict.CORRECT),
        (r"m_2 g {+ \frac{1}{2} l_2 \cos(q_1+q_2)}", Verdict.WRONG),
        (r"0 {+ m_2 g \frac{1}{2} l_2 \cos(q_1+q_2)}", Verdict.CORRECT),
        (r"-m_2 g \frac{1}{2} l_2 \cos{-(q_1+q_2-\pi)}", Verdict.CORRECT),
    ],
)
def test_braces_that_begin_with_a_sign_are_no_factor(g2, verdict):
    report = dhkit.Arm.load("planar2r").grade(
        {"g": ["(m1/2+m2)*g*l1*c1+m2*g*l2*c12/2", g2]}, explain=False
    )
    assert report.entries[1].verdict is verdict
