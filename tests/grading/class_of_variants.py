"""A class that hands in six files a student about an arm of their own: who made which mistake, and the marks."""

from __future__ import annotations

import json
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path

from dhkit.grading.variants import Variants
from dhkit.grading.variants.key import key_files

TASK = """
robot = "planar2r"
[task]
asked = ["g"]
[rubric]
points = 10
[rubric.weights]
g = 1
[variants.parameters]
l1 = [0.300, 0.600, 0.001]
l2 = [0.300, 0.600, 0.001]
m1 = [1.00, 3.00, 0.01]
m2 = [1.00, 3.00, 0.01]
"""
SEED = 11
KINDS = ("toml", "py", "m", "tex", "python.ipynb", "octave.ipynb")
MISTAKES = {"": 10.0, "half_forgotten": 5.0, "relative_angle": 0.0, "sign": 5.0}
"""Points by mistake: g1 and g2 are worth 5 each."""


@dataclass(frozen=True)
class File:
    """A file that a student hands in, and the points that it is worth."""

    name: str
    content: str
    points: float


def write_class(folder: Path, students: int, files: int) -> dict[str, float]:
    """Write the key of a class's variants and the export of its files; return the points of each file.

    Each student hands in some of the kinds: with a single file, the kinds take turns.
    """
    task = folder / "task.toml"
    task.write_text(TASK)
    variants = Variants.load(task)
    drawn = [variants.of(f"student{k:03}", SEED) for k in range(students)]
    for name, content in key_files(variants, task, drawn, SEED).items():
        path = folder / "key" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    points = {}
    with zipfile.ZipFile(folder / "class.zip", "w") as archive:
        for k, variant in enumerate(drawn):
            for file in _files(k, variant.student, dict(variant.values), files):
                archive.writestr(file.name, file.content)
                points[file.name] = file.points
    return points


def _files(k: int, student: str, values: dict[str, str], count: int) -> list[File]:
    """Return the files of a student; a third of all have a mistake, which differs from file to file."""
    files = []
    wrong = [name for name in MISTAKES if name]
    for j in range(count):
        number = count * k + j
        kind = KINDS[number % len(KINDS)]
        # The third that is wrong moves on by one every six files, so that every kind is in it.
        is_wrong = number % 3 == number // len(KINDS) % 3
        mistake = wrong[number // 3 % len(wrong)] if is_wrong else ""
        name = f"{student}_{9000 + k}_{50_000 + number}_answer{j}.{kind}"
        files.append(File(name, _text(kind, _formulas(values, mistake)), MISTAKES[mistake]))
    return files


def _formulas(p: dict[str, str], mistake: str) -> tuple[str, str]:
    """Return g1 and g2 with a student's numbers."""
    half = "" if mistake == "half_forgotten" else "/2"
    angle = "q2" if mistake == "relative_angle" else "q1 + q2"
    sign = "-" if mistake == "sign" else ""
    second = f"9.81*{p['m2']}*{p['l2']}*cos({angle})/2"
    first = f"9.81*({p['m1']}{half} + {p['m2']})*{p['l1']}*cos(q1) + {second}"
    return first, f"{sign}{second}"


def _text(kind: str, formulas: tuple[str, str]) -> str:
    """Return a file's content."""
    g1, g2 = formulas
    python = f"from math import cos\ng1 = {g1}\ng2 = {g2}\n"
    matlab = f"g1 = {g1};\ng2 = {g2};\n"
    match kind:
        case "toml":
            return f'format = 1\nrobot = "puma560"\n[answer]\ng1 = "{g1}"\ng2 = "{g2}"\n'
        case "py":
            return python
        case "m":
            return matlab
        case "tex":
            return (
                f"\\begin{{align}}\ng_1 &= {_latex(g1)} \\\\\ng_2 &= {_latex(g2)}\n\\end{{align}}\n"
            )
        case "python.ipynb":
            return _notebook("python", python)
        case _:
            return _notebook("octave", matlab)


def _latex(formula: str) -> str:
    formula = re.sub(r"\(([\d.]+)/2", r"(\\frac{\1}{2}", formula)
    formula = re.sub(r"q(\d)", r"q_\1", formula)
    return formula.replace("cos", r"\cos").replace("*", r" \cdot ")


def _notebook(language: str, code: str) -> str:
    cell = {"cell_type": "code", "metadata": {}, "outputs": [], "execution_count": None}
    return json.dumps(
        {
            "nbformat": 4,
            "nbformat_minor": 5,
            "metadata": {"kernelspec": {"name": language, "language": language}},
            "cells": [cell | {"source": code, "id": "a"}],
        }
    )
