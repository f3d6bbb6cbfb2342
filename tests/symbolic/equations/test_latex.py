"""LaTeX that fits a page, compiles where TeX is, and becomes MathML without loss."""

import re
import subprocess
from collections import Counter
from xml.etree import ElementTree

import pytest

from acceptance import slow_if
from conftest import require
from dhkit.description import library_robot
from dhkit.expressions import parse
from dhkit.symbolic.equations import (
    displays,
    equation_mathml,
    equations_latex,
    latex_document,
    latex_text,
    quantities,
)
from dhkit.symbolic.equations.latex_names import latex_names
from dhkit.symbolic.exact.lagrangian import lagrangian
from dhkit.symbolic.ring import Constant, Ring
from symbolic.equations.latex_width import latex_width

LINES_OF_A_PAGE = 46
"""Of article in 11 points, less what displays stand apart."""
LINE = 32.8
"""Width of its text, em."""
GREEK = {r"\tau": "τ", r"\theta": "θ", r"\beta": "β", r"\pi": "π", r"\lambda": "λ"}
FUNCTIONS = {r"\sin": "sin", r"\cos": "cos"}
ACCENTS = {r"\dot": "˙", r"\ddot": "¨"}


def test_names_are_the_fields():
    wanted = {
        "m2": "m_{2}",
        "l1": "l_{1}",
        "Ixx2": "I_{xx,2}",
        "rx2": "r_{x2}",
        "Jm2": "J_{m2}",
        "G2": "G_{2}",
        "d10": "d_{10}",
        "mc": "m_{c}",
        "theta": r"\theta",
        "theta1": r"\theta_{1}",
        "lc1": "l_{c1}",
        "m_tool": r"m_{\mathrm{tool}}",
        "MX3": r"\mathit{MX}_{3}",
        "XX2": r"\mathit{XX}_{2}",
        "Ia3": r"\mathit{Ia}_{3}",
        "payload": r"\mathrm{payload}",
        "I1": "I_{1}",
        "g": "g",
    }
    assert latex_names(wanted) == wanted
    both = latex_names(["lc1", "l_c1", "q_1"], taken=["q_{1}"])
    assert both == {"lc1": r"\mathrm{lc1}", "l_c1": r"\mathrm{l\_c1}", "q_1": r"\mathrm{q\_1}"}


def test_planar2r():
    lag = lagrangian(library_robot("planar2r"))
    assert latex_text(lag.M[0, 0]) == (
        r"\tfrac{1}{3} m_{1} l_{1}^{2} + m_{2} \bigl(l_{1}^{2} + \tfrac{1}{3} l_{2}^{2} + l_{1} l_{2} c_{2}\bigr)"
    )
    assert r"\begin{pmatrix}" in lag.latex(("M",))
    assert r"\ddot{q}_{1}" in lag.latex(("tau",))


def test_constants():
    half = parse("sqrt(2)")
    ring = Ring(
        "RP",
        [
            Constant("m1"),
            Constant("m2"),
            Constant("sqrt(2)", half, square=parse("2")),
            Constant("cos(beta)", parse("cos(beta)", ["beta"])),
            Constant(
                "1/(m1 + m2)",
                1 / parse("m1 + m2", ["m1", "m2"]),
                reciprocal_of=parse("m1 + m2", ["m1", "m2"]),
            ),
            Constant("1/m2", 1 / parse("m2", ["m2"]), reciprocal_of=parse("m2", ["m2"])),
        ],
    )
    root, cosine, inverse = (
        ring.constant("sqrt(2)"),
        ring.constant("cos(beta)"),
        ring.constant("1/(m1 + m2)"),
    )
    assert latex_text(root * ring.sine(0)) == r"\sqrt{2} s_{1}"
    assert latex_text(cosine * cosine * 3) == r"3 \cos^{2}(\beta)"
    assert latex_text(inverse * ring.position(1)) == r"\frac{q_{2}}{m_{1} + m_{2}}"
    assert latex_text(ring.constant("1/m2") * ring.constant("m1")) == r"\frac{m_{1}}{m_{2}}"
    assert latex_text(ring.constant("1/m2") * 2) == r"\frac{2}{m_{2}}"


@pytest.mark.parametrize(
    ("name", "what"),
    [("planar2r", "M C h g tau"), ("planar3r", "M C g"), ("cart_pendulum", "M C g")],
)
def test_fits_a_page(name, what):
    shown = displays(quantities(lagrangian(library_robot(name)), what.split()))
    lines = [
        line
        for display in shown
        for line in display.splitlines()
        if not line.startswith(("\\begin", "\\end"))
    ]
    assert len(lines) + 1.2 * len(shown) < LINES_OF_A_PAGE
    assert all(latex_width(line) < LINE for line in lines if "pmatrix" not in line)


@pytest.mark.parametrize(
    ("name", "symbols", "what"),
    [
        ("planar2r", "file", "M C h g tau K V"),
        ("planar3r", "file", "M C g"),
        ("puma560", "inertial", "g"),
        ("al5d", "none", "M g"),
    ],
)
def test_compiles(name, symbols, what, tmp_path):
    pdflatex = require("pdflatex", "Debian's texlive-latex-recommended has it")
    latex = equations_latex(quantities(lagrangian(library_robot(name), symbols), what.split()))
    (tmp_path / "equations.tex").write_text(latex_document(latex, r"a_b & $x$ \ ^ %"))
    run = subprocess.run(
        [pdflatex, "-interaction=nonstopmode", "-halt-on-error", "equations.tex"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stdout[-2000:]
    assert "Overfull" not in run.stdout
    if name.startswith("planar"):
        assert "(1 page" in run.stdout


def latex_tokens(latex):
    """Count what a reader sees: letters, numbers, Greek letters, functions, accents and signs."""
    latex = latex.replace(r"\begin{pmatrix}", "(").replace(r"\end{pmatrix}", ")")
    latex = re.sub(
        r"\\(begin|end)\{[^}]*\}|\\(mathrm|mathit|tfrac|frac|sqrt|[bB]igl|[bB]igr|qquad)(?![a-z])",
        " ",
        latex,
    )
    latex = latex.replace(r"\\", " ").replace(r"\,", " ")
    counts = Counter()
    for command in re.findall(r"\\[a-z]+", latex):
        counts[(GREEK | FUNCTIONS | ACCENTS | {r"\times": "×"})[command]] += 1
    latex = re.sub(r"\\[a-z]+", " ", latex)
    counts.update(re.findall(r"\d+(?:\.\d+)?|[A-Za-z]|[-+=()_,](?<!_)", latex))
    return counts


def mathml_tokens(text):
    counts = Counter()
    for node in ElementTree.fromstring(text).iter():
        if node.tag.endswith(("mi", "mn", "mo")) and node.text:
            counts.update([node.text.replace("−", "-")])
    return counts


@pytest.mark.parametrize(
    ("name", "symbols", "what"),
    [
        ("planar2r", "file", "M C h g tau K V"),
        ("planar3r", "file", "M C tau"),
        ("polar_rp", "file", "M h g"),
        ("al5d", "none", "M g"),
        ("jaco", "none", "g"),
        slow_if(True, "puma560", "inertial", "M g"),
    ],
)
def test_mathml_has_every_symbol_and_number(name, symbols, what):
    for display in displays(quantities(lagrangian(library_robot(name), symbols), what.split())):
        assert mathml_tokens(equation_mathml(display)) == latex_tokens(display)


def test_mathml_of_names():
    for latex in latex_names(
        ["m_tool", "l_c1", "lc1", "payload", "MX3", "theta1", "Ixx2", "Jm2"]
    ).values():
        letters = latex_tokens(latex.replace(r"\_", " "))
        assert letters - mathml_tokens(equation_mathml(latex)) == Counter()
