"""Python, C and MATLAB compute what the equations say."""

import ctypes
import re
import subprocess

import numpy as np
import pytest
from hypothesis import given, strategies as st

from acceptance import slow_if
from conftest import require
from dhkit.description import library_robot, read_robot
from dhkit.symbolic.equations import (
    equations_c,
    equations_matlab,
    equations_python,
    matlab_files,
    quantities,
)
from dhkit.symbolic.equations.programs import INPUTS, harmless, identifier
from dhkit.symbolic.equations.python_code import FUNCTION_NAMES
from dhkit.symbolic.exact.lagrangian import lagrangian
from dhkit.symbolic.languages.printing import NUMPY

TOLERANCE = 1e-12
"""Of the largest entry: code rounds in another order than the exact terms' sum."""
STRICT = ["-std=c99", "-O1", "-Wall", "-Wextra", "-pedantic", "-Werror", "-shared", "-fPIC"]
EVERYTHING = "M C h g tau K V"
CASES = [
    ("planar2r", "file", EVERYTHING),
    ("planar2r", "inertial", EVERYTHING),
    ("cart_pendulum", "file", EVERYTHING),
    ("polar_rp", "file", EVERYTHING),
    ("stanford", "none", EVERYTHING),
    ("al5d", "none", EVERYTHING),
    ("jaco", "none", "M g V"),
    ("puma560", "none", "M g tau"),
    ("clashing", "file", EVERYTHING),
]
CLASHING = """
format = 1
name = "int.end-1"
convention = "standard"
gravity = [0, "-g1", 0]

[parameters]
g1 = 9.81
c1 = 0.5
qdd1 = 2.0
qd2 = 1.5
int = 0.4
end = 0.3
lambda = 0.7
p = 0.1
M = 0.2
NAN = 0.6

[[joint]]
type = "revolute"
a = "c1"
alpha = 0
d = "NAN"
theta = "lambda"
body = { mass = "qdd1", com = ["-p", "M", 0], inertia = { yy = "qdd1*c1^2/12", zz = "qdd1*c1^2/12" } }

[[joint]]
type = "prismatic"
a = "sqrt(int)"
alpha = "end"
d = 0
theta = 0
body = { mass = "qd2/(qdd1 + qd2)", com = ["-int/2", 0, "end"], inertia = { xx = 1, yy = 1, zz = "1 + abs(sin(p))/7" } }
"""


@pytest.fixture(scope="module")
def equations(tmp_path_factory):
    """Equations by name and symbols, with states."""
    path = tmp_path_factory.mktemp("robots") / "clashing.toml"
    path.write_text(CLASHING)

    def made(name, symbols):
        description = read_robot(path) if name == "clashing" else library_robot(name)
        lag = lagrangian(description, symbols)
        q, qd, qdd = np.random.default_rng(1).uniform(-2, 2, (3, 3, lag.n))
        return lag, {"q": q, "qd": qd, "qdd": qdd}

    return made


def expected(lag, quantity, states):
    flat = quantity.elements.reshape(-1)
    return lag.evaluate(flat, *states.values()).reshape(-1, *quantity.elements.shape)


def assert_equal(found, wanted):
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max() <= TOLERANCE * max(1.0, np.abs(wanted).max())


@pytest.mark.parametrize(("name", "symbols", "what"), CASES)
def test_python(name, symbols, what, equations):
    lag, states = equations(name, symbols)
    listed = quantities(lag, what.split())
    module = {}
    exec(compile(equations_python(lag, listed), "generated", "exec"), module)
    for quantity in listed:
        inputs = [states[key] for key in INPUTS[quantity.name].split()]
        function = module[FUNCTION_NAMES[quantity.name]]
        wanted = expected(lag, quantity, states)
        assert_equal(function(*inputs), wanted)
        assert_equal(np.asarray(function(*(x[0] for x in inputs))), wanted[0])


@pytest.mark.parametrize(
    ("name", "symbols", "what"), [slow_if(case[0] in {"al5d", "jaco"}, *case) for case in CASES]
)
def test_c(name, symbols, what, equations, tmp_path):
    gcc = require("gcc", "the compiler of Debian's gcc")
    lag, states = equations(name, symbols)
    listed = quantities(lag, what.split())
    source, library = tmp_path / "equations.c", tmp_path / "equations.so"
    source.write_text(equations_c(lag, listed))
    subprocess.run([gcc, *STRICT, str(source), "-o", str(library), "-lm"], check=True)
    subprocess.run(
        [gcc, "-std=gnu17", "-fsyntax-only", "-Wall", "-Werror", str(source)], check=True
    )
    functions = ctypes.CDLL(str(library))
    for quantity in listed:
        function = functions[f"{identifier(lag.description.name)}_{quantity.name}"]
        wanted = expected(lag, quantity, states)
        for k, row in enumerate(wanted):
            assert_equal(
                called(
                    function, [states[key][k] for key in INPUTS[quantity.name].split()], row.shape
                ),
                row,
            )


def called(function, inputs, shape):
    pointers = [
        x.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for x in map(np.ascontiguousarray, inputs)
    ]
    if not shape:
        function.restype = ctypes.c_double
        return np.array(function(*pointers))
    result = np.full(shape, np.nan)
    function(*pointers, result.ctypes.data_as(ctypes.POINTER(ctypes.c_double)))
    return result


@pytest.mark.parametrize(("name", "symbols", "what"), CASES)
def test_matlab(name, symbols, what, equations, tmp_path):
    octave = require("octave", "Debian's octave runs MATLAB's language")
    lag, states = equations(name, symbols)
    listed = quantities(lag, what.split())
    for file, text in matlab_files(lag, listed).items():
        (tmp_path / file).write_text(text)
    lines = ["1;"]
    for k in range(3):
        lines += [
            f"{key} = [{'; '.join(repr(float(x)) for x in values[k])}];"
            for key, values in states.items()
        ]
        for quantity in listed:
            call = f"{identifier(lag.description.name)}_{quantity.name}({', '.join(INPUTS[quantity.name].split())})"
            lines.append(f"printf('%.17g ', {call}.'); printf('\\n');")
    (tmp_path / "run_all.m").write_text("\n".join(lines))
    run = subprocess.run(
        [octave, "--no-gui", "-qf", "run_all.m"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    rows = iter(run.stdout.splitlines())
    wanted = [expected(lag, quantity, states) for quantity in listed]
    for k in range(3):
        for values in wanted:
            assert_equal(
                np.array(next(rows).split(), dtype=float).reshape(values[k].shape), values[k]
            )


def test_parameters_can_be_changed(equations):
    import dataclasses

    lag, states = equations("planar2r", "file")
    module = {}
    exec(compile(equations_python(lag, quantities(lag, ["M"])), "generated", "exec"), module)
    heavier = dataclasses.replace(module["PARAMETERS"], m2=3.0)
    change = module["mass_matrix"](states["q"], heavier) - module["mass_matrix"](states["q"])
    assert np.allclose(change[:, 1, 1], 1.5 * 0.4**2 / 3)


@given(st.floats())
def test_a_number_in_python_is_read_as_the_same_double(value):
    assert np.array_equal(eval(NUMPY.number(value)), value, equal_nan=True)


def test_names_cannot_break_out():
    wicked = 'a"; system("x") */ %{ \n """ + \\'
    assert re.fullmatch(r"a[a-z_]+", identifier(wicked))
    assert identifier("6R").isidentifier()
    assert set(harmless(wicked)).isdisjoint("\"'\\/*%\n;{}#<&")


@pytest.mark.parametrize("write", [equations_python, equations_c, equations_matlab])
def test_code_has_no_limit(write):
    lag = lagrangian(library_robot("panda"))
    text = write(lag, quantities(lag, ["M"]))
    assert max(map(len, text.splitlines())) < 400
