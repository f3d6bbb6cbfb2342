r"""Documents: rows that go on, chains, entries and systems are read as what they mean and as nothing else."""

import re
import time

import pytest

from dhkit.description import library_robot
from dhkit.errors import AnswerError
from dhkit.grading import grade
from dhkit.grading.answers.documents.entry_statements import statements_of
from dhkit.grading.answers.documents.statements import left_hand_name
from dhkit.grading.answers.sheet_values import Entries, EqualFormulas, Refusal
from dhkit.grading.answers.sources import read_source
from dhkit.grading.remarks import NoteKind

ROBOT = library_robot("planar2r")
V = r"\tfrac12 m_1 g l_1 s_1 + m_2 g (l_1 s_1 + \tfrac12 l_2 s_{12})"
GRAVITY = [r"\tfrac12 m_1 g l_1 c_1", r"m_2 g l_1 c_1 + \tfrac12 m_2 g l_2 c_{12}"]


@pytest.fixture
def read(tmp_path):
    def answers(text, robot=ROBOT):
        (tmp_path / "a.tex").write_text(text)
        return read_source(tmp_path / "a.tex", robot)

    return answers


@pytest.fixture
def graded(tmp_path):
    def verdicts(text, robot=ROBOT):
        (tmp_path / "a.tex").write_text(text)
        return grade(tmp_path / "a.tex", robot)

    return verdicts


def squeezed(text):
    return "".join(text.replace(r"\qquad", "").replace(r"\quad", "").replace("{}", "").split())


GOING_ON = [
    r"\begin{align} V &= A \\ &\quad + B \end{align}",
    r"\begin{align*} V &= A \\ &+ B \end{align*}",
    r"\begin{align} V = {} & A \\ & {} + B \end{align}",
    r"\begin{align} V &= A \nonumber \\ &\qquad + B \label{eq:v} \end{align}",
    r"\begin{align} V &= A \tag{3} \\[2pt] &\phantom{=} + B. \end{align}",
    r"\begin{align} V &= A + \\ &\quad B, \end{align}",
    r"\begin{equation} \begin{split} V &= A \\ &+ B \end{split} \end{equation}",
    r"\begin{equation} \begin{aligned} V &= A \\ &+ B \end{aligned} \end{equation}",
    r"\[ \begin{aligned}[t] V &= A \\ &+ B \end{aligned} \]",
    r"\[ V = \begin{aligned}[t] & A \\ & + B \end{aligned} \]",
    r"\begin{multline} V = A \\ + B \end{multline}",
    r"\begin{gather} V = A \\ + B \end{gather}",
    r"\begin{equation} \begin{gathered} V = A \\ + B \end{gathered} \end{equation}",
    r"\begin{eqnarray} V & = & A \nonumber \\ & & + B \end{eqnarray}",
    r"\begin{eqnarray*} V & = & A \\ & + & B \end{eqnarray*}",
    r"\begin{IEEEeqnarray}{rCl} V & = & A \IEEEnonumber \\ && + B \end{IEEEeqnarray}",
    r"\begin{flalign} V &= A & \\ &+ B & \end{flalign}",
    r"\begin{alignat}{2} V &= A \\ &+ B \end{alignat}",
    r"\begin{dmath} V = A + B \end{dmath}",
    "\\begin{align} V &= A % the first link\n \\\\ % the second\n &+ B \\end{align}",
    "$$ V = A \n + B $$",
    r"\( V = A + B \)",
    r"$V = A + B$",
    "V = A + B",
    r"\begin{align} \intertext{The potential energy is} V &= A \\ &+ B \end{align}",
    r"\begin{align} V &= A + B && \text{(potential energy)} \end{align}",
    r"\begin{align} V &\equiv A + B \end{align}",
    r"\begin{align} V &:= A + B \end{align}",
    r"\begin{align} V(q) &= A + B, \quad \text{where } q = (q_1, q_2)^T \end{align}",
]


@pytest.mark.parametrize("text", GOING_ON)
def test_rows_that_go_on_are_one_formula(read, text):
    sheet = read(text.replace("A", "m_1 g").replace("B", "m_2 g"))
    assert squeezed(sheet.answers["V"]) in (
        "m_1g+m_2g",
        r"\begin{aligned}[t]&m_1g\\&+m_2g\end{aligned}",
    )


@pytest.mark.parametrize(
    "text",
    [
        r"\begin{align} V &= \left( A \right. \\ &\quad \left. + B \right) \end{align}",
        r"\begin{align} V &= \Bigl( A \\ &\quad + B \Bigr) \end{align}",
        r"\begin{align} V &= \bigl[ A \\ & B \bigr] \end{align}",
        r"\begin{align} V &= A \cdot \\ & B \end{align}",
        r"\begin{align} V &= A \\ &\quad \times B \end{align}",
        r"\begin{align} V &= A \\ &- B \end{align}",
    ],
)
def test_no_row_is_lost(read, text):
    answer = squeezed(read(text.replace("A", "m_1 g").replace("B", "m_2 g")).answers["V"])
    assert "m_1g" in answer and "m_2g" in answer and "\\\\" not in answer


def test_a_second_row_counts(graded):
    first, second = r"\tfrac12 m_1 g l_1 s_1", r"m_2 g (l_1 s_1 + \tfrac12 l_2 s_{12})"
    assert graded(rf"\begin{{align}} V &= {first} \\ &\quad + {second} \end{{align}}")
    assert not graded(rf"\begin{{align}} V &= {first} \\ &\quad + 2 {second} \end{{align}}")
    assert not graded(rf"\begin{{align}} V &= {V} \\ &\quad + {second} \end{{align}}")


@pytest.mark.parametrize("sign", ["=", r"\equiv", r"\approx"])
def test_a_chain_states_each_of_its_formulas(read, graded, sign):
    assert read(rf"\begin{{align}} V &= A \\ &{sign} B \end{{align}}").answers[
        "V"
    ] == EqualFormulas(("A", "B"))
    wrong = V.replace("s_1", "c_1")
    assert graded(rf"\begin{{align}} V &= {V} \\ &{sign} {V} + 0 \end{{align}}")
    for first, second in ((V, wrong), (wrong, V), (wrong, wrong)):
        for text in (
            rf"\begin{{align}} V &= {first} \\ &{sign} {second} \end{{align}}",
            rf"\[ V = {first} {sign} {second} \]",
        ):
            report = graded(text)
            assert bool(report) is (second == V)
            assert first == second or any(
                note.kind is NoteKind.SIDES_DIFFER for note in report.notes
            )


@pytest.mark.parametrize(
    "text",
    [
        r"\begin{align} M_{12} &= M_{21} = F \\ M_{11} &= 1 \\ M_{22} &= 2 \end{align}",
        r"\[ M_{12} = M_{21} = F, \quad M_{11} = 1, \quad M_{22} = 2 \]",
        r"$M_{11} = 1$, $M_{1,2} = F$, $M_{2,1} = M_{12}$ and $M_{22} = 2$",
        r"\[ \begin{cases} M_{11} = 1 \\ M_{12} = M_{21} = F \\ M_{22} = 2 \end{cases} \]",
        r"\[ \left\{ \begin{array}{l} M_{11} = 1 \\ M_{12} = M_{21} = F \\ M_{22} = 2 \end{array} \right. \]",
        r"\begin{align} \mathbf{M}_{11}(q) &= 1 & M_{12}(q) &= M_{21}(q) = F & M_{22} &= 2 \end{align}",
        r"\[ M(q) = \begin{bmatrix} M_{11} & M_{12} \\ M_{21} & M_{22} \end{bmatrix} \] \begin{align} M_{11} &= 1 \\"
        r" M_{12} &= M_{21} = F \\ M_{22} &= 2 \end{align}",
        r"\[ D_{11} = 1 \] \[ D_{12} = D_{21} = F \] \[ D_{22} = 2 \]",
    ],
)
def test_names_on_several_sides_name_entries(read, text):
    answer = read(text.replace("F", "m_1 g")).answers["M"]
    assert isinstance(answer, Entries)
    found = dict(answer.texts)
    assert (found[0, 0], found[1, 1]) == ("1", "2")
    assert squeezed(found[0, 1]) == "m_1g"
    assert squeezed(found[1, 0]) in ("m_1g", "M_{12}")


@pytest.mark.parametrize(
    "left",
    [
        *(
            r"\dot V",
            r"\dot{V}",
            r"\ddot V",
            r"\delta V",
            r"\Delta V",
            "V'",
            r"V^{-1}",
            r"\partial V/\partial q",
            "V_1",
        ),
        *(
            r"\frac{\partial V}{\partial q_1}",
            r"\hat V",
            r"\bar{V}",
            r"\tilde V",
            "V_{tot}",
            r"V_{\text{link 1}}",
            "2V",
        ),
        *(
            "-V",
            "V + K",
            r"\nabla V",
            "V(0)",
            "V(q_1 = 0)",
            r"\max V",
            "V^2",
            r"\int V",
            r"\langle V \rangle",
            "V dt",
        ),
        *(
            r"\mathrm{d}V",
            "dV",
            r"V^\star",
            r"V_{,1}",
            r"\lvert V \rvert",
            "V T",
            r"\sum V",
            r"\frac{dV}{dt}",
        ),
    ],
)
def test_what_is_not_V_is_not_read_as_V(read, left):
    wrong, right = rf"\[ {left} = 3 \]", rf"\[ V = {V} \]"
    assert read(f"{wrong} {right}").answers == read(f"{right} {wrong}").answers == {"V": V}
    with pytest.raises(AnswerError, match="assigns no quantity"):
        read(wrong)


@pytest.mark.parametrize(
    "left",
    [
        r"\dot M",
        r"\hat{M}",
        "M^{-1}",
        "M_{link1}",
        r"\det M",
        r"M\ddot q",
        "M^T",
        r"M\dot q + C",
        "2M",
        r"\bar M",
        "M_c",
    ],
)
def test_what_is_not_M_is_not_read_as_M(read, left):
    matrix = r"\begin{bmatrix} 1 & 2 \\ 3 & 4 \end{bmatrix}"
    assert set(read(rf"\[ {left} = {matrix} \] \[ V = {V} \]").answers) == {"V"}


def test_products_of_matrices_are_left_out_and_told(read):
    tau = r"\begin{bmatrix} \tau_1 \\ \tau_2 \end{bmatrix} = M \begin{bmatrix} \ddot q_1 \\ \ddot q_2 \end{bmatrix}"
    sheet = read(rf"\[ {tau} \] \[ \tau = M \ddot q + g \] \[ V = {V} \]")
    assert set(sheet.answers) == {"V"}
    assert [told[:7] for told in sheet.left_out] == ["line 1:", "line 1:"]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (r"\begin{gather} V = A \\ (B + C) \end{gather}", "neither begins with an operator"),
        (r"\begin{gather} V = A \\ - B = C \end{gather}", "an = of its own"),
        (r"\[ V = A \] \[ + B \]", "another display"),
        (r"\[ V = A \] \[ = B \]", "another display"),
        (r"\[ V = A > 0 \]", "another relation"),
        (r"\[ V = A \neq 0 \]", "another relation"),
        (r"\[ V = (A \]", "do not close"),
        (r"\[ V = \pm A \]", r"a sign \\pm, which stands for two values"),
        (r"\[ V = A \] \[ V = B \]", "assigned twice"),
        (r"$V = A$ and $V = 2 A$", "assigned twice"),
        (r"\[ V = \begin{cases} A & q_1 > 0 \\ B & q_1 < 0 \end{cases} \]", "row|relation"),
        (r"\newcommand{\x}{A + B} \[ V = 2\x \]", "macro"),
        (r"\def\x{m_1 g} \[ V = \x \]", "macro"),
        (r"\newcommand{\x}[1]{#1^2} \[ V = \x{A} \]", "macro"),
        (r"\renewcommand{\sin}{\cos} \renewcommand{\sin}{\tan} \[ V = \sin q_1 \]", "macro"),
        (r"\let\sin\cos \[ V = \sin q_1 \]", "macro"),
        (r"\DeclareMathOperator{\sin}{cos} \[ V = \sin q_1 \]", "macro"),
        (r"\[ m_1 = 3 \] \[ V = m_1 g \]", "robot's own name"),
        (r"\[ q_1 = \theta_2 \] \[ V = \sin q_1 \]", "robot's own name"),
        (r"\[ q_1 = \theta_1 - \theta_2 \] \[ V = m_1 c_1 \]", "robot's own name"),
        (r"\[ g = -9.81 \] \[ V = m_1 g \]", "robot's own name"),
        (r"\[ a = m_1 \] \[ V = a g \] \[ a = m_2 \]", "assigned twice"),
        (r"\[ a = b \] \[ b = a \] \[ V = a g \]", "defined by itself"),
        (r"\[ a = m_1 = m_2 \] \[ V = a g \]", "several formulas"),
    ],
)
def test_what_is_not_understood_refuses_the_answer_with_its_line(read, text, reason):
    answer = read(f"\n{text}").answers["V"]
    assert isinstance(answer, Refusal)
    assert re.search(reason, answer.reason)
    assert "line 2" in answer.reason


@pytest.mark.parametrize(
    "text",
    [
        rf"\newcommand{{\qa}}{{q_1}} \[ V = {V} \]",
        rf"\[ g = 9.81 \] \[ V = {V} \]",
        rf"\[ g = 9.81\,\mathrm{{m/s^2}} \] $l_1 = 0.5~\text{{m}}$ \[ V = {V} \]",
        rf"\[ V = {V} \] At $q_1 = 0$ and $q_2 = \pi$ the arm is folded, so $\dot V = 0$, $V(0) = 0$.",
        rf"\[ q_1 = \theta_1 \] \[ V = {V} \]",
        rf"\[ m_1 > 0 \] \[ q_1 \in [0, 2\pi) \] \[ V = {V} \]",
        "\\begin{verbatim}\n$V = 3$\n\\end{verbatim}" + rf"\[ V = {V} \]",
        "% $V = 3$\n" + rf"\[ V = {V} \]",
        r"\iffalse $V = 3$ \fi" + rf"\[ V = {V} \]",
        r"\documentclass{article} \newcommand{\x}{$V = 3$} "
        rf"\begin{{document}} \[ V = {V} \] \end{{document}} $V = 3$",
        rf"\[ c_{{12}} = \cos(q_1 + q_2), \quad s_1 = \sin q_1 \] \[ V = {V} \]",
        rf"\[ V = {V.replace('l_1 s_1', 'y_1')} \] where $y_1 = l_1 \sin q_1$.",
        r"\newcommand{\la}{l_1} \[ V = " + V.replace("l_1", r"\la") + r" \]",
        rf"\[ K = T \] \[ T = \tfrac12 m_1 \dot q_1^2 \] \[ V = {V} \]",
    ],
)
def test_what_changes_nothing_changes_no_verdict(graded, text):
    entries = [entry for entry in graded(text).entries if entry.quantity == "V"]
    assert entries and all(entry.verdict.value == "correct" for entry in entries)


@pytest.mark.parametrize(
    ("side", "name"),
    [
        (r"M_{12}", "M12"),
        (r"M_{1,2}", "M12"),
        (r"M_{10,2}", "M10_2"),
        (r"\mathbf{M}(q)", "M"),
        (r"\mathbf g(\theta)", "g"),
        (r"h(q, \dot q)", "h"),
        (r"C\left(q, \dot{q}\right)", "C"),
        (r"\tau_1", "tau1"),
        (r"\boldsymbol{\tau}", "tau"),
        (r"\mathcal{L}", "L"),
        (r"g_2(q_1, q_2)", "g2"),
        (r"M(1,2)", "M12"),
        (r"{\bf M}", "M"),
        *(
            (side, "")
            for side in (
                r"\dot V",
                "V'",
                "M^{-1}",
                "2M",
                "V + K",
                r"\frac{V}{2}",
                "",
                "V(q_1 + q_2)",
                "1",
            )
        ),
    ],
)
def test_left_hand_sides(side, name):
    assert left_hand_name(side) == name


@pytest.mark.parametrize(
    ("text", "targets", "formulas"),
    [
        (r"\tau_1 = m_1 g", ("tau1",), ("m_1 g",)),
        ("tau1 = m1*g;", ("tau1",), ("m1*g",)),
        ("G(q) = m1*g", ("G",), ("m1*g",)),
        ("M12 = M21 = m1", ("M12", "M21"), ("m1",)),
        ("m1*g*cos(q1)", (), ("m1*g*cos(q1)",)),
        (r"\begin{aligned} V &= a \\ &+ b \end{aligned}", ("V",), (r"a + b",)),
        (r"\begin{aligned} V &= a \\ &= b \end{aligned}", ("V",), ("a", "b")),
        (r"\frac12 m_1", (), (r"\frac12 m_1",)),
        ("V = a = b", ("V",), ("a", "b")),
        ("V = U = b", ("V", "U"), ("b",)),
        ("M[0][1] = a", ("M1_2",), ("a",)),
        ("M(1,2) = a", ("M1_2",), ("a",)),
    ],
)
def test_statements_of_one_entry(text, targets, formulas):
    (statement,) = statements_of(text)
    assert (statement.targets, statement.formulas, statement.problem) == (targets, formulas, "")


@pytest.mark.parametrize(
    "text", ["V = a\n  + b", "V = a +\n b", "V = (a\n + b)", "V = a ...\n + b;", "V\n= a + b"]
)
def test_lines_of_plain_text_that_go_on(text):
    (statement,) = statements_of(text, ".txt")
    assert [squeezed(formula).strip("()") for formula in statement.formulas] == ["a+b"]
    assert statement.targets == ("V",)


def test_a_system_gives_several_statements():
    found = statements_of(r"\begin{cases} \tau_1 = a \\ \tau_2 = b \end{cases}")
    assert [(s.targets, s.formulas) for s in found] == [(("tau1",), ("a",)), (("tau2",), ("b",))]
    found = statements_of("g1 = a\ng2 = b;\n")
    assert [(s.line, s.targets, s.formulas) for s in found] == [
        (1, ("g1",), ("a",)),
        (2, ("g2",), ("b",)),
    ]


# Found by adversaries: what stands after comments, words, macros and & counts, or refuses

M22 = r"\tfrac13 m_2 l_2^2"
LESS = r"\tfrac14 m_2 l_2^2"
M11 = r"\tfrac13 m_1 l_1^2 + m_2 (l_1^2 + \tfrac13 l_2^2 + l_1 l_2 c_2)"
M12 = r"m_2 (\tfrac13 l_2^2 + \tfrac12 l_1 l_2 c_2)"


@pytest.mark.parametrize(
    "text",
    [
        "V = a   # potential energy\n  + b",
        "V = a % x\n + b",
        "V = a   # = c; d\n  + b",
        "V = a\n# the second link (of two\n + b",
        "V = a + % first\n b",
        "V = a % energy [J]\n + b;",
        "V = a # it = 3\n\t+ b # end",
    ],
)
def test_a_comment_hides_nothing_behind_its_line(text):
    (statement,) = statements_of(text, ".txt")
    assert [squeezed(formula) for formula in statement.formulas] == ["a+b"]


def test_numbers_of_maxima_are_no_comments():
    (statement,) = statements_of("V = %pi*a + %e\n + %i", ".txt")
    assert squeezed(statement.formulas[0]) == "%pi*a+%e+%i"


@pytest.mark.parametrize(
    "rows",
    [
        r"\begin{align} M_{22} = &A \\ = &B \end{align}",
        r"\begin{align} M_{22} =& A \\ =& B \end{align}",
        r"\begin{align*} M_{22} &= A \\ = &B \end{align*}",
        r"\begin{eqnarray} M_{22} & = & A \\ & = & B \end{eqnarray}",
        r"\begin{align} M_{22} & = & A \\ & = & B \end{align}",
        r"\begin{gather} M_{22} \\ = A \\ = B \end{gather}",
        r"\begin{align} M_{22} \equiv &A \\ \triangleq &B \end{align}",
        r"\begin{align} M_{22} = {} &A \\ {} = {} &B \end{align}",
        r"\begin{multline} M_{22} = A \\ = B \end{multline}",
    ],
)
def test_a_row_that_begins_with_a_relation_goes_on(read, graded, rows):
    (answer,) = read(rows.replace("A", "m_1 g").replace("B", "m_2 g")).answers["M"].texts.values()
    assert [squeezed(formula) for formula in answer.formulas] == ["m_1g", "m_2g"]


@pytest.mark.parametrize(
    ("first", "second", "verdict"), [(M22, LESS, "wrong"), (LESS, M22, "correct")]
)
def test_the_last_side_is_judged(graded, first, second, verdict):
    text = rf"\begin{{align}} M_{{22}} = &{first} \\ = &{second} \end{{align}}"
    assert verdict in [entry.verdict.value for entry in graded(text).entries]


@pytest.mark.parametrize(
    "text",
    [
        r"\begin{align} M_{11} &= A & M_{22} &= B \\ &= C \end{align}",
        r"\begin{align} M_{11} &= A & M_{22} &= B \\ &+ C & &+ D \end{align}",
    ],
)
def test_a_row_that_may_go_on_with_two_equations(read, text):
    answer = read(text).answers["M"].texts
    assert all(isinstance(entry, Refusal) for entry in answer.values())


@pytest.mark.parametrize(
    "behind",
    [
        *(
            r"\text{ + 3} l_1",
            r"\text{ times } 2",
            r"\text{ minus } \theta_1",
            r"\mbox{$+ \theta_1$}",
        ),
        *(
            r"\text{$+\theta_1$}",
            r"\quad\text{if } m_1>3",
            r"\text{ plus three}",
            r"\textrm{ and also } + l_1",
        ),
        *(
            r"\text{, that is } = 3",
            r"\Rightarrow 3",
            r"\text{ (when folded)}",
            r"\text{ plus}",
            r"\text{ - 2}",
        ),
        *(
            r"\quad \text{(2 of 3)}",
            r"\text{ for } q_2 > 0",
            r"\text{ words } \\ l_1",
            r", \\ 2 l_1",
        ),
    ],
)
def test_words_that_may_change_a_formula_refuse_it(read, behind):
    text = rf"\begin{{gather}} V = {V} {behind} \end{{gather}}"
    answer = read("\n" + text).answers["V"]
    assert isinstance(answer, Refusal)
    assert "line 2" in answer.reason


def test_words_in_front_of_a_formula_part_no_product(read):
    assert isinstance(read(rf"\[ 2 \text{{ of these: }} V = {V} \]").answers["V"], Refusal)


@pytest.mark.parametrize(
    "behind",
    [
        *(
            r"\text{ (potential energy)}",
            r"\quad\text{where } x = 3",
            r", \quad \text{with } m_1 > 0",
            r"\text{.}",
        ),
        *(
            r"\text{ and } a = 2",
            r"\quad \text{(left-hand side).}",
            r", \text{ for } i = 1, 2",
            r"~\text{as required},",
        ),
    ],
)
def test_words_that_change_nothing(graded, behind):
    (entry,) = graded(rf"\[ V = {V} {behind} \]").entries
    assert entry.verdict.value == "correct"


def test_a_value_of_a_joint_behind_a_formula_is_listed(read):
    sheet = read(r"\[ V = m_1 g, \theta_1 = 3 \]")
    assert sheet.answers == {"V": "m_1 g"}
    assert sheet.left_out == (r"line 1: \theta_1 = 3",)


GRAVITY_ROWS = r"\begin{bmatrix} A \\ B \end{bmatrix}".replace(
    "A", f"{GRAVITY[0]} + {GRAVITY[1]}"
).replace("B", r"\tfrac12 m_2 g l_2 c_{12}")


@pytest.mark.parametrize(
    "side",
    [
        r"\frac{\partial V}{\partial q}",
        r"\left(\frac{\partial V}{\partial q}\right)^T",
        r"\nabla_q V",
        r"-\sum_i J_i^T m_i g",
        r"\begin{bmatrix} \frac{\partial V}{\partial q_1} & \frac{\partial V}{\partial q_2} \end{bmatrix}^T",
        r"\frac{1}{2} \begin{bmatrix} 1 \\ 2 \end{bmatrix} x",
    ],
)
def test_a_chain_before_a_matrix(read, graded, side):
    text = rf"\[ \bm g(q) = {side} = {GRAVITY_ROWS} \]"
    assert [entry.verdict.value for entry in graded(text).entries] == ["correct"] * 2
    assert any("line 1: a side of g's equation is not read" in note for note in read(text).notes)
    wrong = text.replace("c_{12}", "s_{12}")
    assert "wrong" in [entry.verdict.value for entry in graded(wrong).entries]


@pytest.mark.parametrize(
    "text",
    [
        r"\def\theta{\phi} \[ V = m_1 g \sin\theta_1 \]",
        r"\let\theta\phi \[ V = m_1 g \sin\theta_1 \]",
        r"\renewcommand{\frac}[2]{#2/#1} \[ V = \frac{m_1}{g} \]",
        r"\edef\cos{\sin} \[ V = \cos q_1 \]",
        r"\DeclareDocumentCommand{\tfrac}{mm}{#1} \[ V = \tfrac12 m_1 \]",
        r"\def\label#1{3} \[ V = m_1 \label{x} \]",
        r"\renewcommand{\quad}{+} \[ V = m_1 \quad g \]",
    ],
)
def test_a_macro_with_a_new_meaning_refuses_the_answers_that_use_it(read, text):
    answer = read(text).answers["V"]
    assert isinstance(answer, Refusal)
    assert "macro" in answer.reason


@pytest.mark.parametrize(
    "text",
    [
        r"\expandafter\def\csname cos\endcsname{\sin}",
        r"\catcode`\+=13",
        r"\def\,{+}",
        r"\let~=+",
        r"\renewenvironment{bmatrix}{(}{)}",
        r"\lowercase{\def\x{y}}",
    ],
)
def test_what_may_change_any_sign_refuses_the_file(read, text):
    with pytest.raises(AnswerError, match=r"line 2: .*may change"):
        read(f"\n{text} \\[ V = {V} \\]")


@pytest.mark.parametrize(
    "text", [r"\renewcommand{\phi}{\varphi}", r"\newcommand{\R}{\mathbb{R}}", r"\makeatletter"]
)
def test_harmless_definitions(graded, text):
    assert graded(rf"{text} \[ V = {V} \]").entries[0].verdict.value == "correct"


def test_approx_is_noted(read):
    assert r"line 1: \approx is read as =" in read(rf"\[ V \approx {V} \]").notes
    assert r"line 1: \approx is read as =" in read(rf"\[ M_{{11}} = a \approx {M11} \]").notes


@pytest.mark.parametrize(
    "mark",
    [
        *(
            "*",
            r"\ast",
            r"\cdot",
            r"\text{sym}",
            r"\text{sym.}",
            r"\star",
            r"\mathrm{sym.}",
            r"\mbox{symm.}",
            r"{*}",
            "",
        ),
    ],
)
def test_a_mark_for_the_other_half(graded, mark):
    for rows in (f"{M11} & {M12} \\\\ {mark} & {M22}", f"{M11} & {mark} \\\\ {M12} & {M22}"):
        report = graded(rf"\[ M(q) = \begin{{bmatrix}} {rows} \end{{bmatrix}} \]")
        assert [entry.verdict.value for entry in report.entries] == ["correct"] * 4
    wrong = f"{M11} & {M22} \\\\ {mark} & {M22}"
    report = graded(rf"\[ M(q) = \begin{{bmatrix}} {wrong} \end{{bmatrix}} \]")
    assert [entry.verdict.value for entry in report.entries] == [
        "correct",
        "wrong",
        "wrong",
        "correct",
    ]


@pytest.mark.parametrize("rows", [r"* & * \\ * & 1", r"1 & * \\ * & 2", r"* & 1 \\ 1 & 2"])
def test_marks_that_refer_to_nothing(graded, rows):
    text = rf"\[ M = \begin{{bmatrix}} {rows} \end{{bmatrix}} \]"
    try:
        verdicts = [entry.verdict.value for entry in graded(text).entries]
    except AnswerError:
        return
    assert "unreadable" in verdicts


@pytest.mark.parametrize("word", ["m", "Nm", "kg m^2", "mm/", "rad deg"])
def test_a_unit_without_end_takes_no_time(read, word):
    begin = time.process_time()
    answer = read(rf"\[ V = 3 \text{{{word * 2000}!}} q_1 \]").answers["V"]
    assert isinstance(answer, Refusal)
    assert time.process_time() - begin < 5
