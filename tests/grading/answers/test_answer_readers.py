"""Laws of the readers of answers, one piece at a time; whole files and sheets are in the other tests."""

import ast

import pytest
import sympy

from dhkit import Arm
from dhkit.errors import AnswerError
from dhkit.expressions import read
from dhkit.expressions.syntax import Token
from dhkit.expressions.trees import node_count
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.computer_algebra import from_mathematica, is_mathematica
from dhkit.grading.answers.derivatives import time_derivative
from dhkit.grading.answers.documents.latex_rows import matrix_rows, rows_of
from dhkit.grading.answers.documents.latex_source import document_statements
from dhkit.grading.answers.given import given_quantity, vocabulary_of, with_entries_gathered
from dhkit.grading.answers.pretty import in_one_line, is_pretty
from dhkit.grading.answers.programs.matlab_tokens import matlab_statements
from dhkit.grading.answers.programs.notebook import Notebook
from dhkit.grading.answers.programs.python_changes import assigned_names, bound_names
from dhkit.grading.answers.programs.python_program import constant_index
from dhkit.grading.answers.quantity_names import QuantityNames
from dhkit.grading.answers.sheet_values import AnswerSheet
from dhkit.grading.answers.tokens import replace_runs, split_tokens


def line_name(line):
    return f"line {line}"


def test_runs_of_tokens_are_replaced_once():
    tokens = split_tokens("a b a b a", list(range(9)), "a b a b a")

    def read_run(k):
        return (
            ([Token("name", "c", tokens[k].at)], k + 2)
            if [t.text for t in tokens[k : k + 2]] == ["a", "b"]
            else None
        )

    assert [t.text for t in replace_runs(tokens, read_run)] == ["c", "c", "a"]


@pytest.mark.parametrize(
    ("text", "index"),
    [
        ("q[0]", (0,)),
        ("M[0, 1]", (0, 1)),
        ("M[..., 2, 3]", (2, 3)),
        ("q[k]", None),
        ("q[-1]", None),
    ],
)
def test_python_indices_count_from_zero(text, index):
    assert constant_index(ast.parse(text, mode="eval").body.slice) == index


def test_names_bound_and_parts_assigned_however_deep():
    tree = ast.parse("for i in x:\n    with a as b:\n        M[i].y = 1\n        del K[0]\n")
    assert set(assigned_names(tree)) == {"i", "b", "M", "K"}
    assert set(bound_names(tree)) == {"i", "b"}


def test_a_string_that_does_not_end_in_matlab():
    with pytest.raises(AnswerError, match="line 2: a string that does not end"):
        list(matlab_statements("a = 1;\nb = 'x", "file", line_name))


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("[a, b(2)] = f(c)", {"a", "b"}),
        ("s.x(3) = 1", {"s"}),
        ("k++", {"k"}),
        ("syms q1 q2 real", {"q1", "q2", "real"}),
        ("for k = 1:3", {"k"}),
        ("disp(x)", set()),
    ],
)
def test_names_that_a_matlab_statement_may_assign(text, names):
    (statement,) = matlab_statements(text, "file", line_name)
    assert statement.assigned_names() == names


def test_lines_of_a_notebook_belong_to_cells():
    notebook = Notebook("a\nb\nc", ".py", (1, 3), ())
    assert [notebook.line_name(line) for line in (1, 2, 3)] == [
        "cell 1, line 1",
        "cell 1, line 2",
        "cell 2, line 1",
    ]


def test_entries_with_digits_in_two_readings():
    names = QuantityNames(Arm.load("puma560").description)
    assert [str(t) for t in names.entries("M12")] == ["M(1,2)"]
    assert [str(t) for t in names.entries("A1_14")] == ["A1(1,4)"]
    assert names.entries("M_7_1") == [] and names.quantity("U") == "V"


def test_rows_of_displays_and_of_matrices():
    rows = list(rows_of(r"\begin{align} a &= b \\ &+ c \end{align}", 5))
    assert [" ".join(row.text.split()) for row in rows if row.text.strip()] == ["a = b", "+ c"]
    assert matrix_rows(r"\begin{bmatrix} a & {b & c} \\ d & e \end{bmatrix}") == [
        ["a", "{b & c}"],
        ["d", "e"],
    ]
    assert matrix_rows("a + b") is None


def test_macros_for_one_symbol_are_put_in_and_others_refused():
    text = "\\newcommand{\\w}{\\omega}\n\\newcommand{\\f}[1]{#1^2}\n$a = \\w$\n$b = \\f{c}$\n"
    first, second = document_statements(text)
    assert (first.line, first.problem) == (3, "") and "omega" in first.formulas[-1]
    assert "the macro \\f, which line 2 defines" in second.problem


def test_mathematica_becomes_plain_text():
    text = "Derivative[1][q1][t] + ArcTan[x, y]"
    assert is_mathematica(text)
    plain = from_mathematica(split_tokens(text, list(range(len(text))), text), text)
    assert "".join(t.text for t in plain) == "ddt(q1)+atan2(y,x)"


M1, L1, Q1 = sympy.symbols("m1 l1 q1")
PRINTED = [
    M1 * L1**2 / 3 + Q1,
    (M1 + L1) ** 3 / (1 + Q1**2),
    sympy.sin(Q1 + 1 / L1) * M1 / (L1 + 1 / Q1),
    ((M1 + 1 / L1) ** 2 + Q1) / M1**10,
]


@pytest.mark.parametrize("formula", PRINTED, ids=str)
def test_several_lines_that_sympy_prints_say_in_one_what_was_printed(formula):
    printed = sympy.pretty(formula, use_unicode=True, wrap_line=False)
    assert is_pretty(printed)
    line = in_one_line(printed).translate({ord("₁"): "1", ord("⋅"): "*", ord("^"): "**"})
    assert sympy.simplify(sympy.sympify(line) - formula) == 0


def test_a_fraction_that_slipped_from_its_bar_is_refused():
    with pytest.raises(AnswerError, match="a bar without a numerator or a denominator"):
        in_one_line("m₁    \n   ───\n    2 ")


PLANAR = Arm.load("planar2r").description


def given_texts(name, shape, answers):
    """Return the texts of a quantity's entries by their indices; None where one was not handed in."""
    names = QuantityNames(PLANAR)
    gathered = with_entries_gathered(answers, names)
    given = given_quantity(
        name, gathered[name], shape, vocabulary_of(PLANAR, AnswerSheet(answers=answers)), names
    )
    return {entry.index: None if entry.is_missing else entry.text for entry in given}


def test_half_of_a_symmetric_matrix_is_enough_and_half_of_another_is_not():
    texts = {"11": "m1*l1^2", "12": "m2*l1*l2", "22": "m2*l2^2"}
    M = given_texts("M", (2, 2), {f"M{place}": text for place, text in texts.items()})
    C = given_texts("C", (2, 2), {f"C{place}": text for place, text in texts.items()})
    assert M == {(0, 0): "m1*l1^2", (0, 1): "m2*l1*l2", (1, 0): "m2*l1*l2", (1, 1): "m2*l2^2"}
    assert C == M | {(1, 0): None}


@pytest.mark.parametrize(
    ("answers", "complaint"),
    [
        ({"g": ["0", "0"], "g1": "0"}, "g: given whole and entry by entry; expected one of them"),
        ({"g1": "0", "g_1": "0"}, r"g_1: g\(1\) is given twice; expected each entry once"),
    ],
)
def test_an_entry_that_is_given_twice_is_refused(answers, complaint):
    with pytest.raises(AnswerError, match=complaint):
        with_entries_gathered(answers, QuantityNames(PLANAR))


def test_time_derivatives_count_their_nodes():
    tree = time_derivative(read("sin(q1)*q2"))
    assert node_count(tree, 100) == node_count(tree, node_count(tree, 100))
    with pytest.raises(AnswerError, match="an acceleration, qdd1"):
        time_derivative(read("qdd1"))


def test_as_many_macros_as_the_bound_are_read():
    names = [f"x{chr(97 + i // 26)}{chr(97 + i % 26)}" for i in range(BOUNDS.macros + 1)]
    definitions = [rf"\newcommand{{\{name}}}{{y}}" for name in names]
    accepted = "\n".join([*definitions[:-1], *definitions[:3], "$g_1 = m_1$"])
    assert len(list(document_statements(accepted))) == 1
    with pytest.raises(AnswerError, match=f"more than {BOUNDS.macros} macros"):
        list(document_statements("\n".join([*definitions, "$g_1 = m_1$"])))
