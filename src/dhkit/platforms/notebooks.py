"""Packages for platforms that execute notebooks: Otter and nbgrader."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import product

from dhkit.errors import AnswerError
from dhkit.grading.answers.sheet import shape_of
from dhkit.grading.grade_report import entry_name
from dhkit.platforms.contents import Installation, Package, Task
from dhkit.report.statement import task_html

_KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}
_SETUP_CELL = """\
import sympy as sp

q = sp.symbols("q1:{after}")
qd = sp.symbols("qd1:{after}")
qdd = sp.symbols("qdd1:{after}")
{parameters}"""


def otter_package(task: Task, installation: Installation) -> Package:
    """Return the folder from which ``otter generate`` makes an autograder, and the students' notebook.

    Source: Otter-Grader, Test Files (OK format) and Creating Autograders.
    """
    cells = [_title(task), _code(_setup(task))]
    for quantity in _quantities(task):
        cells += [
            _text(f"**{quantity}** ({task.points_of(quantity):g} points)"),
            _code(f"{quantity} = ..."),
            _code(f'grader.check("{quantity}")'),
        ]
    cells.insert(1, _code("import otter\ngrader = otter.Notebook()"))
    files = {f"tests/{quantity}.py": _otter_test(task, quantity) for quantity in _quantities(task)}
    files[f"{task.name}.ipynb"] = _notebook(cells)
    files["requirements.txt"] = f"{installation.requirement}\n"
    texts = {name: text.encode() for name, text in files.items()}
    return Package({**task.files, **installation.files, **texts})


def nbgrader_package(task: Task, installation: Installation) -> Package:
    """Return a course folder whose source notebook nbgrader releases and judges.

    Source: nbgrader, Developing assignments, and the metadata of its cells, schema 3.
    """
    cells = [_title(task), _code(_setup(task), _cell("setup", locked=True))]
    for quantity in _quantities(task):
        solution = f"### BEGIN SOLUTION\n{quantity} = None\n### END SOLUTION"
        points = task.points_of(quantity)
        check = (
            "from dhkit.platforms.notebook_checks import check\n"
            f'result = check("task.toml", "{quantity}", {quantity})\n'
            "print(result)\n"
            "result.points"
        )
        cells += [
            _text(f"**{quantity}** ({points:g} points)"),
            _code(solution, _cell(f"answer-{quantity}", solution=True)),
            _code(check, _cell(f"check-{quantity}", locked=True, grade=True, points=points)),
        ]
    folder = f"source/{task.name}"
    files = {
        f"{folder}/{task.name}.ipynb": _notebook(cells).encode(),
        "requirements.txt": f"{installation.requirement}\n".encode(),
    }
    beside = {f"{folder}/{name}": content for name, content in task.files.items()}
    return Package({**files, **beside, **installation.files})


def _quantities(task: Task) -> Sequence[str]:
    """Return the quantities of a notebook.

    Raises
    ------
    AnswerError
        The task asks for tables or inverse kinematics, which are not assigned to a name.
    """
    tables = [name for name in task.asked if name in ("dh", "ik")]
    if tables or not task.asked:
        found = ", ".join(tables) or "nothing"
        raise AnswerError(
            f"{task.name}: asked: found {found}; notebooks take quantities such as M, g, T"
        )
    return task.asked


def _entries(task: Task, quantity: str) -> list[str]:
    """Return the names of a quantity's entries; the last row of a pose is known to everybody."""
    shape = shape_of(quantity, task.description.n)
    if shape == (4, 4):
        shape = (3, 4)
    indices = product(*(range(size) for size in shape))
    return [entry_name(quantity, index) for index in indices]


def _otter_test(task: Task, quantity: str) -> str:
    """Return a test file of Otter: a case for each entry, all of the same worth."""
    entries = _entries(task, quantity)
    weights = {name: task.rubric.weights.get(name, 1.0) for name in entries}
    whole = sum(weights.values()) or 1.0
    call = f'check("task.toml", "{quantity}", {quantity})'
    cases = [
        {
            "code": f">>> from dhkit.platforms.notebook_checks import check\n>>> {call}.passes({name!r})\nTrue",
            "hidden": False,
            "locked": False,
            "points": task.points_of(quantity) * weights[name] / whole,
            "failure_message": f"{name} is not right",
        }
        for name in entries
    ]
    suites = [{"cases": cases, "scored": True, "setup": "", "teardown": "", "type": "doctest"}]
    test = {"name": quantity, "points": None, "suites": suites}
    # JSON's true and null are Python's True and None: written as a literal of Python.
    return f"OK_FORMAT = True\n\ntest = {test!r}\n"


def _setup(task: Task) -> str:
    """Return the cell that makes the symbols; a parameter of an answer's name gets an underscore, as g_ beside g."""
    lines = []
    for name in sorted(task.description.parameters):
        variable = f"{name}_" if name in task.asked else name
        lines.append(f'{variable} = sp.Symbol("{name}")')
    return _SETUP_CELL.format(after=task.description.n + 1, parameters="\n".join(lines)).rstrip()


def _title(task: Task) -> dict[str, object]:
    return _text(f"# {task.title}\n\n{task_html(task.description, task.sheet)}")


def _text(source: str) -> dict[str, object]:
    return {"cell_type": "markdown", "metadata": {}, "source": source}


def _code(source: str, nbgrader: dict[str, object] | None = None) -> dict[str, object]:
    metadata = {} if nbgrader is None else {"nbgrader": nbgrader}
    return {
        "cell_type": "code",
        "execution_count": None,
        "metadata": metadata,
        "outputs": [],
        "source": source,
    }


def _cell(
    name: str,
    *,
    locked: bool = False,
    grade: bool = False,
    solution: bool = False,
    points: float | None = None,
) -> dict[str, object]:
    """Return nbgrader's metadata of a code cell."""
    metadata: dict[str, object] = {
        "grade": grade,
        "grade_id": name,
        "locked": locked,
        "schema_version": 3,
        "solution": solution,
        "task": False,
    }
    return metadata | ({} if points is None else {"points": points})


def _notebook(cells: Sequence[dict[str, object]]) -> str:
    """Return a notebook of format 4.5, whose cells have ids."""
    numbered = [{"id": f"cell-{k}", **cell} for k, cell in enumerate(cells)]
    notebook = {
        "cells": numbered,
        "metadata": {"kernelspec": _KERNEL, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"
