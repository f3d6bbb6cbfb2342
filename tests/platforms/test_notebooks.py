"""Otter and nbgrader: notebooks and tests in their formats; in make accept the platforms themselves run them."""

import json
import os
import subprocess
import sysconfig
import venv
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

from dhkit.errors import AnswerError
from dhkit.platforms import pack
from dhkit.platforms.notebook_checks import check

from .conftest import RIGHT_G, TASK, WRONG_G, M

SOLUTION = {
    "M": f"from sympy import cos\nq1, q2 = q\nM = {M}",
    "g": f"g = {WRONG_G}",
}


def notebook_of(package, name):
    notebook = nbformat.reads(package.files[name].decode(), as_version=4)
    nbformat.validate(notebook)
    return notebook


def solve(notebook):
    """Fill the students' cells."""
    for cell in notebook.cells:
        for quantity, source in SOLUTION.items():
            grade_id = cell.metadata.get("nbgrader", {}).get("grade_id")
            if cell.source == f"{quantity} = ..." or grade_id == f"answer-{quantity}":
                cell.source = source


def test_a_check_gives_the_points_of_a_quantity(task):
    assert check(task, "M", M).points == pytest.approx(40 / 3)
    half = check(task, "g", WRONG_G)
    assert half.points == pytest.approx(10 / 3)
    assert half.passes("g1")
    assert not half.passes("g2")
    assert "g2" in repr(half)


def test_a_check_takes_what_notebooks_compute(task):
    import casadi
    import sympy

    q = sympy.symbols("q1:3")
    names = {name: sympy.Symbol(name) for name in ("m1", "m2", "l1", "l2")}
    expression = sympy.sympify(RIGHT_G, locals={**names, "q1": q[0], "q2": q[1]})
    assert check(task, "g", sympy.Matrix(expression)).points == pytest.approx(20 / 3)
    nothing = check(task, "g", None)
    assert nothing.points == 0
    assert nothing.report.error
    assert check(task, "g", casadi.SX.sym("q1")).points == 0


def test_otters_tests_are_of_its_format(task):
    package = pack("otter", task)
    for quantity in ("M", "g"):
        scope: dict = {}
        exec(package.files[f"tests/{quantity}.py"].decode(), scope)
        assert scope["OK_FORMAT"] is True
        test = scope["test"]
        assert test["name"] == quantity
        cases = test["suites"][0]["cases"]
        assert sum(case["points"] for case in cases) == pytest.approx(
            {"M": 40 / 3, "g": 20 / 3}[quantity]
        )
        assert all(case["code"].startswith(">>> ") for case in cases)


@pytest.mark.slow
def test_nbgraders_cells_have_its_metadata(task, tmp_path):
    package = pack("nbgrader", task)
    notebook = notebook_of(package, "source/dynamics/dynamics.ipynb")
    cells = {
        cell.metadata.nbgrader.grade_id: cell.metadata.nbgrader
        for cell in notebook.cells
        if "nbgrader" in cell.metadata
    }
    assert set(cells) == {"setup", "answer-M", "check-M", "answer-g", "check-g"}
    assert cells["check-M"].points == pytest.approx(40 / 3)
    assert cells["check-M"].locked
    assert cells["answer-M"].solution
    solve(notebook)
    package.write(tmp_path / "course")
    ran = NotebookClient(
        notebook,
        timeout=120,
        resources={"metadata": {"path": str(tmp_path / "course/source/dynamics")}},
    ).execute()
    results = [
        float(cell.outputs[-1]["data"]["text/plain"])
        for cell in ran.cells
        if cell.metadata.get("nbgrader", {}).get("grade")
    ]
    assert results == pytest.approx([40 / 3, 10 / 3])


def test_an_answer_does_not_hide_a_parameter(tmp_path):
    path = tmp_path / "dynamics.toml"
    path.write_text(TASK)
    setup = next(
        cell.source
        for cell in notebook_of(pack("otter", path), "dynamics.ipynb").cells
        if "sympy" in cell.source
    )
    assert 'g_ = sp.Symbol("g")' in setup
    assert 'm1 = sp.Symbol("m1")' in setup


def test_a_task_that_asks_for_nothing_is_refused(tmp_path):
    path = tmp_path / "task.toml"
    path.write_text('robot = "planar2r"\n')
    with pytest.raises(AnswerError, match="asked: found nothing"):
        pack("otter", path)


def test_tables_and_functions_are_refused_where_they_cannot_be_judged(tmp_path):
    path = tmp_path / "task.toml"
    path.write_text(TASK.replace('"g"]', '"g", "ik"]'))
    with pytest.raises(AnswerError, match="asked: found ik; notebooks take"):
        pack("nbgrader", path)
    path.write_text(TASK.replace("[rubric]", "values = false\n[rubric]", 1))
    numeric = check(path, "M", lambda q: np.zeros((2, 2)))
    assert numeric.points == 0
    assert "asks for formulas" in numeric.report.error


def test_otter_weighs_entries_as_the_rubric_does(tmp_path):
    path = tmp_path / "task.toml"
    path.write_text(TASK + "M21 = 0\n")
    scope: dict = {}
    exec(pack("otter", path).files["tests/M.py"].decode(), scope)
    points = [case["points"] for case in scope["test"]["suites"][0]["cases"]]
    assert points == pytest.approx([40 / 9, 40 / 9, 0, 40 / 9])


@pytest.fixture(scope="module")
def platforms(tmp_path_factory):
    """Return a folder with the programs of Otter and nbgrader, in an environment that also sees this one's packages."""
    folder = tmp_path_factory.mktemp("platforms")
    venv.create(folder, with_pip=True)
    (site,) = folder.glob("lib/python*/site-packages")
    paths = [sysconfig.get_paths()["purelib"], str(Path(__file__).parents[2] / "src")]
    (site / "dhkit.pth").write_text("\n".join(paths))
    pip = [folder / "bin" / "pip", "install", "--quiet", "otter-grader", "nbgrader"]
    subprocess.run(pip, check=True, timeout=600, stderr=subprocess.DEVNULL)
    return folder / "bin"


def run(programs, folder, *command):
    environment = {**os.environ, "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(
        [programs / command[0], *command[1:]],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.law
@pytest.mark.skipif("DHKIT_ACCEPT" not in os.environ, reason="in make accept")
def test_otter_judges_a_notebook(platforms, task, tmp_path):
    package = pack("otter", task)
    folder = tmp_path / "otter"
    package.write(folder)
    notebook = notebook_of(package, "dynamics.ipynb")
    solve(notebook)
    nbformat.write(notebook, folder / "ada.ipynb")
    run(platforms, folder, "otter", "generate", "task.toml", "-o", "autograder.zip")
    run(platforms, folder, "otter", "run", "ada.ipynb", "-a", "autograder.zip", "-o", ".")
    tests = json.loads((folder / "results.json").read_text())["tests"]
    scores = {test["name"]: test.get("score") for test in tests}
    assert scores["M"] == pytest.approx(40 / 3, abs=1e-4)
    assert scores["g"] == pytest.approx(10 / 3, abs=1e-4)


@pytest.mark.law
@pytest.mark.skipif("DHKIT_ACCEPT" not in os.environ, reason="in make accept")
def test_nbgrader_judges_a_class(platforms, task, tmp_path):
    folder = tmp_path / "course"
    pack("nbgrader", task).write(folder)
    (folder / "nbgrader_config.py").write_text(
        f'c = get_config()\nc.CourseDirectory.course_id = "course"\nc.CourseDirectory.root = {str(folder)!r}\n'
    )
    run(platforms, folder, "nbgrader", "generate_assignment", "dynamics")
    released = folder / "release" / "dynamics"
    text = (released / "dynamics.ipynb").read_text()
    for student in ("ada", "bob"):
        place = folder / "submitted" / student / "dynamics"
        place.mkdir(parents=True)
        notebook = nbformat.reads(text, as_version=4)
        if student == "ada":
            solve(notebook)
        nbformat.write(notebook, place / "dynamics.ipynb")
        # Another robot in the student's folder is replaced by the instructor's.
        (place / "task.toml").write_text(TASK.replace("planar2r", "planar3r"))
    run(platforms, folder, "nbgrader", "autograde", "dynamics")
    run(platforms, folder, "nbgrader", "export")
    head, *rows = [line.split(",") for line in (folder / "grades.csv").read_text().split()]
    scores = {row[head.index("student_id")]: float(row[head.index("score")]) for row in rows}
    assert scores == pytest.approx({"ada": 20 - 10 / 3, "bob": 0.0})
