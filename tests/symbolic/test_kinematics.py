"""Exact kinematics that can be read: against numbers, and printed as text, LaTeX, sympy and code."""

from __future__ import annotations

import importlib
import subprocess
from pathlib import Path

import numpy as np
import pytest

from dhkit import Arm
from dhkit.cli import main
from dhkit.description import link_transforms
from dhkit.expressions import exact as number, parse, substitute
from dhkit.symbolic import symbolic_kinematics

ARMS = ["planar2r", "puma560", "stanford", "panda", "ur5", "polar_rp", "al5d"]
CLOSE = 1e-12


def states(arm, count=5):
    return np.random.default_rng(1).uniform(-1.5, 1.5, (count, arm.n))


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("symbols", ["file", "none"])
def test_matrices_are_the_arms(name, symbols):
    arm = Arm.load(name)
    kinematics, q = symbolic_kinematics(arm, symbols), states(arm)
    transforms = link_transforms(arm.description, q)
    for i in range(1, arm.n + 1):
        assert np.abs(kinematics.A(i).evaluate(q) - transforms[:, i - 1]).max() < CLOSE
    assert np.abs(kinematics.T.evaluate(q) - arm.fk(q)).max() < CLOSE
    assert np.abs(kinematics.J.evaluate(q) - arm.jacobian(q)).max() < CLOSE


def test_base_tool_and_arms_without_bodies():
    from dhkit import pose

    arm = Arm.from_dh(
        [(0.3, 0.2, "l", 0.7), ("pi/6", 0.1, 0, "-pi/4")], kinds="RP", parameters={"l": 0.4}
    )
    arm = arm.with_base(pose((0.1, 0.2, 0.3), euler=(0.3, 0.2, 0.1))).with_tool(
        pose((0, 0, 0.1), euler=(0, 0.5, 0))
    )
    q = states(arm)
    assert np.abs(arm.symbolic.T.evaluate(q) - arm.fk(q)).max() < CLOSE
    assert np.abs(arm.symbolic.J.evaluate(q) - arm.jacobian(q)).max() < CLOSE


@pytest.mark.parametrize("name", ["planar2r", "puma560", "stanford"])
def test_text_reads_back(name):
    arm = Arm.load(name)
    (q,) = states(arm, 1)
    values = {f"q{i + 1}": number(float(x)) for i, x in enumerate(q)}
    values |= {k: number(v) for k, v in arm.symbolic.constants.items()}
    lines = [
        line
        for line in arm.symbolic.T.text().replace("\n      ", " ").splitlines()
        if line.startswith("T")
    ]
    where = arm.symbolic.T.text().replace("\n      ", " ").partition("where ")[2].splitlines()[0]
    for angle in where.split(", "):
        head, _, body = angle.partition(" = ")
        values[head] = number(float(substitute(parse(body, tuple(values)), values)))
    T = arm.fk(q)
    for line in lines:
        *heads, body = line.split(" = ")
        value = float(substitute(parse(body, tuple(values)), values))
        for head in heads:
            assert T[int(head[1]) - 1, int(head[2]) - 1] == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize("name", ["planar2r", "puma560", "stanford"])
def test_sympy_and_python_give_the_numbers(name, tmp_path, monkeypatch):
    import sympy

    arm, kinematics = Arm.load(name), Arm.load(name).symbolic
    (q,) = states(arm, 1)
    values = {f"q{i + 1}": float(x) for i, x in enumerate(q)} | kinematics.constants
    A = kinematics.A(2).sympy().subs({sympy.Symbol(key): value for key, value in values.items()})
    assert np.abs(np.array(A, dtype=float) - link_transforms(arm.description, q)[1]).max() < CLOSE
    file = tmp_path / f"generated_{name}.py"
    file.write_text(kinematics.code(("A1", "T", "J")))
    monkeypatch.syspath_prepend(str(tmp_path))
    code = importlib.import_module(file.stem)
    assert np.abs(code.tool_pose(q) - arm.fk(q)).max() < CLOSE
    assert np.abs(code.jacobian(np.stack([q, q])) - arm.jacobian(q)).max() < CLOSE
    assert np.abs(code.A1(q) - link_transforms(arm.description, q)[0]).max() < CLOSE


def test_c_gives_the_numbers(tmp_path):
    import ctypes
    import shutil

    if shutil.which("gcc") is None:
        pytest.skip("no gcc")
    arm = Arm.load("puma560")
    (tmp_path / "k.c").write_text(arm.symbolic.code("T,J", "c"))
    library = tmp_path / "k.so"
    subprocess.run(
        [
            "gcc",
            "-std=c99",
            "-Wall",
            "-Werror",
            "-shared",
            "-fPIC",
            "-o",
            library,
            tmp_path / "k.c",
            "-lm",
        ],
        check=True,
    )
    code, (q,) = ctypes.CDLL(str(library)), states(arm, 1)
    T, J = np.empty((4, 4)), np.empty((6, 6))
    pointer = ctypes.POINTER(ctypes.c_double)
    code.puma560_T(q.ctypes.data_as(pointer), T.ctypes.data_as(pointer))
    code.puma560_J(q.ctypes.data_as(pointer), J.ctypes.data_as(pointer))
    assert np.abs(T - arm.fk(q)).max() < CLOSE
    assert np.abs(J - arm.jacobian(q)).max() < CLOSE


def test_what_is_printed():
    kinematics = Arm.load("planar2r").symbolic
    assert "T14 = l1*c1 + l2*c12" in kinematics.T.text()
    assert "A1_12 = -s1" in str(kinematics.A(1))
    assert r"A_{1} = \begin{pmatrix}" in kinematics.A(1).latex()
    assert r"J(q) = \begin{pmatrix}" in kinematics.J._repr_latex_()
    assert r"(A_{2})_{11}" in Arm.load("al5d").symbolic.latex("A") or r"A_{2} =" in Arm.load(
        "al5d"
    ).symbolic.latex("A")
    assert "function T = planar2r_T(q, p)" in kinematics.code("T", "matlab")
    assert repr(kinematics.T) == "<T of planar2r, shape (4, 4)>"
    assert list(kinematics.sympy()) == ["A1", "A2", "T", "J"]
    for wrong in (0, 3, "1", 1.5):
        with pytest.raises(ValueError, match="expected a link from 1 to 2"):
            kinematics.A(wrong)
    with pytest.raises(
        ValueError, match=r"no quantity 'M'; expected some of A, A1 \.\.\. A2, T, J"
    ):
        kinematics.text("M")
    with pytest.raises(ValueError, match="language is 'rust'"):
        kinematics.code("T", "rust")


@pytest.mark.parametrize("form", ["text", "latex", "python", "c", "matlab", "html"])
def test_the_command_prints_them(form, capsys, tmp_path: Path):
    with pytest.raises(SystemExit) as stopped:
        main(["equations", "puma560", "--what", "A,T,J", "--format", form])
    assert stopped.value.code == 0
    out = capsys.readouterr().out
    assert len(out) > 1000
    assert "quations of motion" not in out
    with pytest.raises(SystemExit) as stopped:
        main(["equations", "puma560", "--what", "A1,M", "--format", form])
    assert stopped.value.code == 2
    assert "no quantity 'A1'" in capsys.readouterr().err
