"""Derivations of inverse kinematics as text, LaTeX, pages, sympy objects and code that is compiled and run."""

import ctypes
import importlib.util
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import sympy
from tools.assets import WORKED_OUT, inverse_page

from conftest import require
from dhkit.description import library_robot, world_to_tool
from dhkit.kinematics import inverse_kinematics
from dhkit.symbolic import inverse_derivation
from dhkit.symbolic.equations import latex_document
from dhkit.verification import random_states
from ik_checks import FEW_JOINTS, FIVE_JOINTS, SIX_JOINTS, robot

LIBRARY = [*SIX_JOINTS, *FIVE_JOINTS, *FEW_JOINTS]
AGREES = 1e-8
"""rad and m: two evaluations of the same formulas near singular poses, where an error of rounding grows."""


def compiled(derivation, folder):
    source, _ = derivation.export(folder, "c")
    library = folder / f"{source.stem}.so"
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, str(source), "-o", str(library), "-lm"], check=True)
    function = getattr(ctypes.CDLL(str(library)), source.stem)
    B, n = len(derivation.branches), derivation.n

    def solve(T):
        q, status, T = np.full((B, n), np.nan), np.zeros(B, dtype=np.int32), np.ascontiguousarray(T)
        count = function(*(ctypes.c_void_p(array.ctypes.data) for array in (T, q, status)))
        assert count == status.sum()
        return np.where(status[:, None] == 1, q, np.nan)

    return solve


def imported(derivation, folder):
    (path,) = derivation.export(folder, "python")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert derivation.branches == module.BRANCHES

    def solve(T):
        q, status = module.inverse_kinematics(T.tolist())
        assert [all(np.isfinite(row)) for row in q] == [one == 1 for one in status]
        return np.array(q)

    return solve


def exported(derivation, language, folder):
    if language == "c":
        require("gcc", shutil.which("gcc") is not None)
        return compiled(derivation, folder)
    return imported(derivation, folder)


@pytest.mark.parametrize("language", ["c", "python"])
@pytest.mark.parametrize("name", LIBRARY)
@pytest.mark.slow
def test_exported_code_gives_the_branches_of_the_kernels(name, language, tmp_path):
    arm = robot(name)
    solve = exported(inverse_derivation(arm), language, tmp_path)
    T = world_to_tool(arm, random_states(arm, 100, seed=4))
    T[::10, :3, 3] *= 3  # out of reach
    kernels = inverse_kinematics(arm, T)
    for k, pose in enumerate(T):
        q = solve(pose)
        assert np.array_equal(np.isfinite(q).all(axis=1), kernels.valid[k]), k
        away = np.abs(q - kernels.q[k])
        turned = np.minimum(away, np.abs(away - 2 * np.pi))
        assert np.nanmax(np.where(arm.numbers.prismatic, away, turned), initial=0) < AGREES
        angles = q[:, ~arm.numbers.prismatic]
        assert (
            np.nanmax(angles, initial=0) <= np.pi and np.nanmin(angles, initial=0) > -np.pi - 1e-12
        )


@pytest.mark.parametrize("language", ["c", "python"])
def test_exported_code_refuses_what_is_no_pose(language, tmp_path):
    derivation = inverse_derivation(library_robot("puma560"))
    solve = exported(derivation, language, tmp_path)
    T = world_to_tool(derivation.description, np.full((1, 6), 0.3))[0]
    assert np.isfinite(solve(T)).any()
    for entry, value in (
        ((0, 3), np.nan),
        ((1, 3), np.inf),
        ((2, 2), np.nan),
        ((0, 0), 2.0),
        ((1, 2), T[1, 2] + 1e-4),
        ((3, 0), 0.1),
        ((3, 3), 2.0),
    ):
        other = T.copy()
        other[entry] = value
        assert np.isnan(solve(other)).all(), entry
    reflected = T @ np.diag([1.0, 1.0, -1.0, 1.0])
    assert np.isnan(solve(reflected)).all()


@pytest.mark.parametrize("language", ["c", "python"])
@pytest.mark.parametrize("name", SIX_JOINTS)
def test_exported_code_reaches_singular_poses(name, language, tmp_path):
    arm = robot(name)
    solve = exported(inverse_derivation(arm), language, tmp_path)
    q = random_states(arm, 40, seed=6)
    q[:, 4] = np.array([0.0, 1e-15, 1e-12, 1e-8])[np.arange(40) % 4]
    for pose in world_to_tool(arm, q):
        found = solve(pose)
        found = found[np.isfinite(found).all(axis=1)]
        assert len(found) and np.abs(world_to_tool(arm, found) - pose).max() < 1e-9


@pytest.mark.parametrize("name", ["puma560", "stanford", "cart_pendulum"])
def test_exported_matlab_runs_in_octave(name, tmp_path):
    if shutil.which("octave") is None:
        pytest.skip("Octave is not installed")
    arm = robot(name)
    derivation = inverse_derivation(arm)
    (path,) = derivation.export(tmp_path, "matlab")
    T = world_to_tool(arm, random_states(arm, 1, seed=4))[0]
    rows = "; ".join(" ".join(repr(float(x)) for x in row) for row in T)
    run = [
        "octave",
        "--quiet",
        "--eval",
        f"cd {tmp_path}; q = {path.stem}([{rows}]); printf('%.17g\\n', q');",
    ]
    found = np.array(
        subprocess.run(run, check=True, capture_output=True, text=True).stdout.split(), dtype=float
    )
    assert np.nanmax(np.abs(found.reshape(-1, arm.n) - derivation.solve(T)), initial=0) < AGREES


def test_code_is_as_readable_as_the_derivation():
    derivation = inverse_derivation(library_robot("puma560"))
    for language in ("c", "python", "matlab"):
        (text, *_) = derivation.code(language).values()
        unwrapped = re.sub(r"\n\s*[*#%]\s", " ", text)
        for step in derivation.steps:
            assert step.look in unwrapped, step.title
        assert max(map(len, text.splitlines())) < 250
    assert "malloc" not in derivation.code("c")["puma560_ik.c"]


@pytest.mark.parametrize("name", LIBRARY)
def test_text_says_everything(name):
    arm = robot(name)
    derivation = inverse_derivation(arm)
    text = derivation.text()
    assert max(map(len, text.splitlines())) <= 110
    joined = " ".join(text.split())
    for branch in derivation.branches:
        assert branch in joined
    for i, kind in enumerate(arm.kinds, start=1):
        assert f"{'theta' if kind == 'R' else 'q'}{i} = " in text
    assert "None" not in text and "<" not in text.replace("<=", "")
    for offset in (
        i
        for i, x in enumerate(derivation.chain.offsets, 1)
        if not x.is_zero and arm.kinds[i - 1] == "R"
    ):
        assert f"q{offset} = theta{offset} " in text


def test_the_pumas_derivation_is_that_of_the_books():
    """Lee and Ziegler 1984, Craig 2005 chapter 4: p_y and p_x give theta1 with d3 beside the plane, then K, theta3.

    Corke's frames differ from Craig's in signs alone.
    """
    text = inverse_derivation(library_robot("puma560")).text()
    for line in (
        "   px*s1 - py*c1 = d3",
        "   theta1 = atan2(px, -py) ± atan2(sqrt(px^2 + py^2 - d3^2), d3)",
        "   2*a2*(a3*c3 - d4*s3) = x^2 + y^2 - a2^2 - a3^2 - d4^2",
        "   theta2 = atan2(y*u - x*v, x*u + y*v)",
        "   theta4 = atan2(ay, ax) or atan2(-ay, -ax)",
        "   theta5 = atan2(-ax*c4 - ay*s4, az)",
        "   the two solutions: right where px*c1 + py*s1 > 0, else left",
    ):
        assert line in text.splitlines(), line


class _Tags(HTMLParser):
    """Counts tags, and holds that they are closed in order."""

    def __init__(self):
        super().__init__()
        self.open, self.seen = [], []

    def handle_starttag(self, tag, attrs):
        self.seen.append(tag)
        if tag not in ("meta", "br", "circle", "path"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in ("circle", "path"):
            assert self.open.pop() == tag


@pytest.mark.parametrize("name", LIBRARY)
def test_a_page_has_every_step_with_its_mathematics_and_figures(name):
    derivation = inverse_derivation(robot(name))
    page = derivation.html()
    tags = _Tags()
    tags.feed(page)
    assert not tags.open
    assert (
        "<script" not in page
        and "http"
        not in page.replace("http://www.w3.org", "").split("</h1>")[1].split("<h2>", 1)[1]
    )
    assert tags.seen.count("section") == len(derivation.steps)
    wanted = sum(step.figure is not None for step in derivation.steps)
    figures = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert len(figures) == wanted and wanted >= (0 if name == "pan_tilt" else 1) - (
        name == "cart_pendulum"
    )
    for figure in figures:
        root = ElementTree.fromstring(figure)
        for text in root.iter("{http://www.w3.org/2000/svg}text"):
            assert 0 <= float(text.get("x")) <= 340 and 0 <= float(text.get("y")) <= 250
    for math in re.findall(r"<math.*?</math>", page, re.DOTALL):
        assert "merror" not in math and "\\" not in math


@pytest.mark.parametrize("name", LIBRARY)
def test_latex_is_balanced_and_converts_without_loss(name):
    derivation = inverse_derivation(robot(name))
    latex = latex_document(derivation.latex(), name)
    assert latex.count("{") == latex.count("}") and latex.count("$") % 2 == 0
    assert latex.count(r"\begin{align*}") == latex.count(r"\end{align*}") > 0
    assert not re.search(r"[^\x00-\x7f]", latex)


@pytest.mark.parametrize("name", ["puma560", "ur5", "stanford", "al5d", "cart_pendulum"])
def test_sympys_solutions_satisfy_sympys_equations(name):
    """Evaluated at one pose of the arm, in sympy: definitions and solutions in the order of the steps."""
    arm = robot(name)
    derivation = inverse_derivation(arm)
    objects, chain = derivation.sympy(), derivation.chain
    T = world_to_tool(arm, random_states(arm, 1, seed=8)[0])
    known = {sympy.Symbol(chain.names[f"p{axis}"]): T[i, 3] for i, axis in enumerate("xyz")}
    known |= {
        sympy.Symbol(chain.names[f"r{i + 1}{j + 1}"]): T[i, j] for i in range(3) for j in range(3)
    }
    known |= {sympy.Symbol(k): v for k, v in chain.lengths.items()}
    checked = 0
    for step in derivation.steps:
        for definition in step.definitions:
            known[sympy.Symbol(definition.name)] = float(objects[definition.name].subs(known))
        if step.form is None:
            continue
        name = step.form.unknown.name
        value = float(objects[name][0].subs(known))
        known[sympy.Symbol(name)] = value
        if name == "phi":
            known |= {sympy.Symbol("cphi"): np.cos(value), sympy.Symbol("sphi"): np.sin(value)}
        if type(step.form).__name__ in ("Flip", "Direction") and step.form.letters["k"] != 1:
            continue  # k is known later, or only up to its sign
        for equation in objects["equations"][name]:
            difference = (equation.lhs - equation.rhs).subs(known)
            if not difference.free_symbols:
                assert abs(float(difference)) < 1e-9
                checked += 1
    assert checked >= 2


def test_formulas_in_sentences_are_typeset():
    """Every name of a letter and an index is in mathematics, and every absolute value and root."""
    page = inverse_derivation(library_robot("puma560")).html()
    words = re.sub(
        r"<math.*?</math>|<svg.*?</svg>|<style.*?</style>|<table.*?</table>", "", page, flags=re.S
    )
    assert not re.findall(r"\b(?:theta\w*|p[xyz]|a[xyz]|[ad]\d|s\d+|c\d+)\b|abs\(|sqrt\(", words)


@pytest.mark.parametrize("name", WORKED_OUT)
def test_the_pages_in_docs_are_fresh(name):
    path = Path(__file__).resolve().parents[3] / "docs" / f"ik-{name}.md"
    assert path.read_text("utf-8") == inverse_page(name), "run make assets"
