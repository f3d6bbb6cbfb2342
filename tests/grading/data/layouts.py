"""What a sheet, a program or a paper looks like around the formulas; answers are trees by quantity."""

from __future__ import annotations

import json

from grading.data.trees import NOTATIONS, Notation, matrix, terms, written

VECTORS = ("h", "g", "tau")


def shape(answer):
    """Return 0, 1 or 2: a number, a vector, a matrix."""
    return 0 if isinstance(answer, tuple) else 1 if isinstance(answer[0], tuple) else 2


def quoted(text: str) -> str:
    """Return a TOML string."""
    if "'" not in text and "\n" not in text:
        return f"'{text}'"
    return json.dumps(text, ensure_ascii=False)


def toml_value(value) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {toml_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    return str(value).lower() if isinstance(value, bool) else quoted(value)


def toml_sheet(robot, texts, names=None, task=None, tables="") -> str:
    """Return an answer sheet; texts are strings, lists of strings or lists of rows."""
    lines = ["format = 1", f'robot = "{robot}"']
    for title, values in (("names", names), ("task", task)):
        if values:
            lines += [
                "",
                f"[{title}]",
                *(f"{key} = {toml_value(value)}" for key, value in values.items()),
            ]
    lines += ["", "[answer]"]
    for name, text in texts.items():
        if isinstance(text, str):
            lines.append(f"{name} = {quoted(text)}")
        else:
            rows = [f"    {toml_value(row)}," for row in text]
            lines += [f"{name} = [", *rows, "]"]
    return "\n".join(lines) + "\n" + tables


def entry_texts(answers, notation: Notation) -> dict:
    """Return answers entry by entry."""

    def text(value):
        return (
            written(value, notation) if isinstance(value, tuple) else [text(one) for one in value]
        )

    return {name: text(value) for name, value in answers.items()}


def whole_texts(answers, notation: Notation) -> dict:
    """Return matrices and vectors as one text each, as the notation writes them."""
    texts = {}
    for name, value in answers.items():
        rows = {0: None, 1: [[one] for one in value], 2: value}[shape(value)]
        texts[name] = written(value, notation) if rows is None else matrix(rows, notation)
    return texts


MATLAB_HEADER = """% Homework 4, robot dynamics
clear; clc
syms m1 m2 m3 l1 l2 l3 g real
"""


def matlab_file(answers, style=0, notation=None) -> str:
    """Return a script: matrices in one statement, row by row, or entry by entry."""
    notation = notation or NOTATIONS[("matlab_dots", "matlab_names", "matlab")[style % 3]]
    lines = (
        [MATLAB_HEADER]
        if style % 2 == 0
        else ["function [M, C, g] = arm(q, qd)", "% all in SI units"]
    )
    for name, value in answers.items():
        unit = {"g": " % N m", "tau": " % N m", "M": " % kg m^2"}.get(name, "")
        if shape(value) == 0:
            lines.append(f"{name} = {written(value, notation)};{unit}")
            continue
        rows = [[one] for one in value] if shape(value) == 1 else value
        texts = [[written(one, notation) for one in row] for row in rows]
        if style % 3 == 0:
            lines.append(
                f"{name} = [" + "; ...\n     ".join(", ".join(row) for row in texts) + f"];{unit}"
            )
        elif style % 3 == 1:
            name = {"g": "G"}.get(name, name)  # g stays the constant
            lines.append(f"{name} = zeros({len(rows)},{len(rows[0])});")
            for i, row in enumerate(texts):
                for j, one in enumerate(row):
                    index = f"{i + 1}" if shape(value) == 1 else f"{i + 1},{j + 1}"
                    lines.append(f"{name}({index}) = {broken(one)};{unit}")
        else:
            lines.append(
                f"{name} = ["
                + "\n     ".join("  ".join(tight(one) for one in row) for row in texts)
                + f"];{unit}"
            )
    return "\n".join(lines) + "\n"


def broken(text, sign=" ...\n      ") -> str:
    """Return a long text continued over lines at its sums."""
    depth, out, since = 0, "", 0
    for k, c in enumerate(text):
        depth += (c in "([{") - (c in ")]}")
        if since > 50 and not depth and c in "+-" and text[k - 1] == " ":
            out, since = out + sign, 0
        out, since = out + c, since + 1
    return out


def tight(text) -> str:
    """Return a text without blanks, as an entry of a matrix whose columns are parted by blanks."""
    return text.replace(" ", "")


def python_file(answers, style=0, notation=None) -> str:
    """Return a program in sympy or numpy."""
    sympy = style % 2 == 0
    notation = notation or (
        Notation(q="q{}", qd="dq{}", qdd="ddq{}", prefix="sp." if sympy else "np.")
        if style % 4 < 2
        else NOTATIONS["numpy"]
    )
    prefix = notation.prefix or "np."
    lines = ["import sympy as sp" if prefix == "sp." else "import numpy as np", ""]
    if prefix == "sp.":
        lines += [
            'g, l1, l2, m1, m2 = sp.symbols("g l1 l2 m1 m2", positive=True)',
            'q1, q2 = sp.symbols("q1 q2")',
            "",
        ]
    if style % 3 == 1:
        lines += ["", "def dynamics(q, qd):", '    """Mass matrix and the rest, SI."""']
    pad = "    " if style % 3 == 1 else ""
    for name, value in answers.items():
        if shape(value) == 0:
            lines.append(
                f"{pad}{name} = ({broken(written(value, notation), chr(10) + pad + '     ')})"
            )
            continue
        rows = [[one] for one in value] if shape(value) == 1 else value
        texts = [[written(one, notation) for one in row] for row in rows]
        if style % 5 == 4:
            for i, row in enumerate(texts):
                for j, one in enumerate(row):
                    index = f"{i + 1}" if shape(value) == 1 else f"{i + 1}{j + 1}"
                    lines.append(f"{pad}{name}{index} = {one}  # SI")
            continue
        maker = "sp.Matrix" if prefix == "sp." else "np.array"
        if shape(value) == 1 and style % 2:
            body = ",\n          ".join(row[0] for row in texts)
            lines.append(f"{pad}{name} = {maker}([{body}])")
        else:
            body = f",\n{pad}              ".join("[" + ", ".join(row) + "]" for row in texts)
            lines.append(f"{pad}{name} = {maker}([{body}])")
    if style % 3 == 1:
        lines.append(f"    return {', '.join(answers)}")
    return "\n".join(lines) + "\n"


NAMES = {
    "M": r"\mathbf{M}(q)",
    "tau": r"\boldsymbol{\tau}",
    "g": r"\mathbf{g}(q)",
    "h": r"\mathbf{h}",
    "C": "C",
}


def tex_file(answers, style=0, notation=None) -> str:
    """Return a paper: matrices, or align with an entry a row, long ones continued."""
    notation = (
        notation
        or NOTATIONS[
            ("latex", "latex_short", "latex_q", "latex_roman", "latex_bare", "latex_braces")[
                style % 6
            ]
        ]
    )
    lines = [
        r"\documentclass{article}",
        r"\usepackage{amsmath}",
        r"\begin{document}",
        "The equations of motion follow.",
    ]
    for name, value in answers.items():
        if shape(value) == 0:
            lines += [r"\begin{align}", tex_rows(name, value, notation, style), r"\end{align}"]
            continue
        if style % 2 == 0 and (shape(value) == 2 or style % 4 == 0):
            rows = [[one] for one in value] if shape(value) == 1 else value
            body = matrix(rows, notation, ("bmatrix", "pmatrix")[style // 2 % 2]).replace(
                r"\\ ", "\\\\\n  "
            )
            head = {"tau": r"\tau"}.get(name, name) if style % 3 else NAMES.get(name, name)
            lines += [r"\[", f"{head} = {body}", r"\]"]
            continue
        head = r"\tau" if name == "tau" else name
        rows = []
        for i, row in enumerate([[one] for one in value] if shape(value) == 1 else value):
            for j, one in enumerate(row):
                index = f"{i + 1}" if shape(value) == 1 else f"{{{i + 1}{j + 1}}}"
                rows.append(tex_rows(f"{head}_{index}", one, notation, style))
        lines += [r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"]
    return "\n".join([*lines, r"\end{document}"]) + "\n"


def tex_rows(name, tree, notation, style) -> str:
    """Return ``name &= ...`` with long sums continued on rows of their own."""
    parts = terms(tree)
    if len(parts) < 3 or style % 3 == 0:
        return f"{name} &= {written(tree, notation)}"
    rows, text = [], ""
    for k, (sign, one) in enumerate(parts):
        piece = written(("*", ("n", "1"), one) if False else one, notation)
        if one[0] in "+-":
            piece = f"({piece})"
        text += (" - " if sign < 0 else " + " if k else "") + piece
        if len(text) > 60 and k + 1 < len(parts):
            rows.append(text)
            text = ""
    rows.append(text)
    begin = (r"&\quad", r"&", r"& \qquad {}")[style // 3 % 3]
    return f"{name} &= " + f" \\\\\n  {begin}".join(
        row.strip() if k == 0 else row for k, row in enumerate(rows) if row
    )


def notebook(answers, style=0) -> str:
    """Return a notebook with one cell of text and one of code."""
    cells = [
        {
            "cell_type": "markdown",
            "metadata": {},
            "source": ["# Homework\n", "Lagrange's equations"],
        },
        {
            "cell_type": "code",
            "metadata": {},
            "execution_count": 1,
            "outputs": [],
            "source": python_file(answers, style).splitlines(True),
        },
    ]
    return json.dumps(
        {"cells": cells, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}, ensure_ascii=False
    )
