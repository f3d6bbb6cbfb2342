"""Equations in typst: they have the values of the elements, and the lines of the same equations in LaTeX."""

from __future__ import annotations

import re

import numpy as np
import pytest

from dhkit.description import library_robot
from dhkit.symbolic import base_parameters, inverse_derivation, lagrangian, symbolic_kinematics
from dhkit.symbolic.equations import displays, kinematic_quantities, quantities, rounded
from dhkit.symbolic.equations.inverse_writing import LATEX, TYPST, Phrases
from dhkit.symbolic.equations.latex import latex_lines
from dhkit.symbolic.equations.typst import math_lines, math_text, quantity_rows
from dhkit.symbolic.ring.notation import notation
from dhkit.verification import random_states

TOKEN = re.compile(
    r"\\\(|\\\)|frac\(|inline\(|sqrt\(|dot\.double\(q\)_\([\d,]+\)|dot\(q\)_\([\d,]+\)|"
    r"(?:upright|italic)\(\"\w+\"\)(?:_\([\w ,()\"]*?\))?|[A-Za-z]+(?:_\([\w ,]*\))?|\d+\.?\d*|[()+\-,^]"
)


def value_of(typst: str, names: dict[str, float]) -> float:
    """Return the value of a sum in typst, by a translation to Python of its own: products are written side by side."""
    python: list[str] = []
    for token in TOKEN.findall(typst):
        if token == "thin":
            continue
        operand = token not in (r"\)", ")", "+", "-", ",", "^", "times")
        if operand and python and not python[-1].endswith(("(", "+", "-", ",", "**", "*")):
            python.append("*")
        if token in ("frac(", "sqrt("):
            python.append(f"{token[:-1]}_(")
        elif token == "inline(":
            python.append("(")
        elif token in (r"\(", r"\)"):
            python.append(token[1])
        elif token == "^":
            python.append("**")
        elif token == "times":
            python.append("*")
        elif token in "()+-," or token[0].isdigit():
            python.append(token)
        else:
            python.append(f"({names[token]!r})")
    scope = {"frac_": lambda a, b: a / b, "sqrt_": np.sqrt}
    return float(eval("".join(python), {"__builtins__": {}}, scope))


def names_of(arm, element, q, qd) -> dict[str, float]:
    """Return values by the typst of variables and constants."""
    ring = element.ring
    values = ring.values(arm.values, q, qd, np.zeros(arm.n))
    names = {}
    for generator, value in zip(ring.generators, values, strict=True):
        text = (
            math_text(ring._element(generator.key)).typst if generator.kind == "constant" else None
        )
        if text is None:
            kind, number = re.fullmatch(r"(qdd|qd|q|s|c)(\d[\d_]*)", generator.text).groups()
            symbol = {"qdd": "dot.double(q)", "qd": "dot(q)"}.get(kind, kind)
            text = f"{symbol}_({number.replace('_', ',')})"
        names[text] = float(value)
    return names


@pytest.mark.parametrize("name", ["planar2r", "cart_pendulum", "polar_rp"])
@pytest.mark.parametrize("quantity", ["M", "C", "g", "K"])
def test_typst_has_the_value_of_the_element(name, quantity):
    description = library_robot(name)
    lag = lagrangian(description)
    q, qd = random_states(description, 2, seed=4)
    (shown,) = quantities(lag, quantity)
    for element in shown.elements.flat:
        if not element:
            continue
        expected = float(lag.evaluate(element, q, qd))
        found = value_of(math_text(element).typst, names_of(lag.arm, element, q, qd))
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", ["planar2r", "puma560", "panda"])
def test_lines_break_at_the_same_terms_as_latex(name):
    kinematics = symbolic_kinematics(library_robot(name))
    for quantity in kinematic_quantities(kinematics, ("T", "J")):
        for element in quantity.elements.flat:
            lines = math_lines(element, 30)
            assert [line.latex for line in lines] == latex_lines(element, 30)
            for line in lines:
                assert line.latex.count("+") + line.latex.count("-") == line.typst.count(
                    "+"
                ) + line.typst.count("-")


def test_a_matrix_is_one_row_where_latex_has_a_matrix():
    (M,) = quantities(lagrangian(library_robot("planar2r")), "M")
    (row,) = quantity_rows(M, 34)
    assert row.left.typst == "M (q)" and row.right.typst.startswith('mat(delim: "(", ')
    assert row.right.latex in displays([M])[0]


def test_rounding_keeps_values_to_its_digits():
    description = library_robot("puma560")
    lag = lagrangian(description, "none")
    q = random_states(description, 1, seed=2)[0]
    (M,) = quantities(lag, "M")
    exact = lag.evaluate(M.elements, q)
    found = lag.evaluate(rounded(M, 4).elements, q)
    assert np.abs(found - exact).max() < 2e-3 * np.abs(exact).max()
    assert np.abs(found - exact).max() > 0


def test_rounding_leaves_symbols_and_short_fractions():
    (M,) = quantities(lagrangian(library_robot("planar2r")), "M")
    for before, after in zip(M.elements.flat, rounded(M, 2).elements.flat, strict=True):
        assert before.terms == after.terms


@pytest.mark.parametrize("name", ["puma560", "ur5", "stanford", "al5d", "cart_pendulum"])
def test_derivations_have_the_same_steps_in_both_notations(name):
    derivation = inverse_derivation(library_robot(name))
    latex, typst = Phrases(derivation, LATEX), Phrases(derivation, TYPST)
    for step in derivation.steps:
        if step.form is None:
            continue
        one, other = latex.solution(step.form), typst.solution(step.form)
        assert len(one.alternatives) == len(other.alternatives)
        assert len(one.letters) == len(other.letters)
        assert not any(
            "\\" in text.replace(r"\(", "").replace(r"\)", "") for text in other.alternatives
        )
        assert len(latex.equations(step)) == len(typst.equations(step))


@pytest.mark.parametrize(
    "name",
    [
        "planar2r",
        *(pytest.param(x, marks=pytest.mark.slow) for x in ("puma560", "ur5", "stanford")),
    ],
)
def test_typst_compiles_equations(name):
    pytest.importorskip("typst")
    from dhkit.report.document import Document, Formulas, pdf

    description = library_robot(name)
    rows = []
    for quantity in quantities(base_parameters(description).lagrangian, "M,g"):
        rows += quantity_rows(quantity, 34)
    assert pdf(Document(name, (Formulas(tuple(rows)),))).pages >= 1
    assert notation(lagrangian(description).arm.ring) is not None
