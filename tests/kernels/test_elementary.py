"""Sine, cosine and arc tangent against extended precision, compiled and interpreted."""

import casadi
import numpy as np
import pytest

from dhkit.kernels import kernel
from dhkit.kernels.elementary import EXACT_RANGE
from dhkit.symbolic import Graph

SINE_ERROR = 2.3e-16
SINE_ULP = 2.0
SINE_ULP_ABOVE = 1e-5
ATAN_ULP = 4.0
CHUNK = 500_000


def graph(name):
    x = casadi.SX.sym("x", 2)
    y = (
        casadi.vertcat(casadi.sin(x[0]), casadi.cos(x[0]))
        if name == "sincos"
        else casadi.atan2(x[0], x[1])
    )
    return Graph.of(name, {"parameters": casadi.SX(0, 1), "x": x}, {"y": y})


def evaluate(name, x):
    run = kernel(f"test_{name}", "", lambda: graph(name))
    y = np.empty((len(x), 2 if name == "sincos" else 1))
    run(np.empty(0), [x], [y])
    return y


def ulps(seen, exact):
    exact = np.asarray(exact)
    return np.abs(seen - exact) / np.spacing(np.abs(exact.astype(float)))


@pytest.fixture(params=["compiled", "interpreted"])
def mode(request):
    request.getfixturevalue(request.param)
    return request.param


def check_sincos(law, x, where):
    y = evaluate("sincos", np.stack([x, x], axis=1))
    for k, function in enumerate((np.sin, np.cos)):
        exact = function(x.astype(np.longdouble))
        error = np.abs(y[:, k] - exact)
        law.holds("sine and cosine, absolute", float(error.max()), SINE_ERROR, where)
        large = np.abs(exact) > SINE_ULP_ABOVE
        law.holds(
            "sine and cosine, ulp", float(ulps(y[large, k], exact[large]).max()), SINE_ULP, where
        )


def test_extended_precision_is_there_to_compare_with():
    assert np.finfo(np.longdouble).nmant >= 63


def test_sine_and_cosine_of_random_angles(law, mode):
    total = law.samples(10_000_000)
    rng = np.random.default_rng(3)
    for start in range(0, total, CHUNK):
        x = rng.uniform(-1.0, 1.0, min(CHUNK, total - start)) * rng.choice([4.0, 100.0, 1e5])
        check_sincos(law, x, mode)


def test_sine_and_cosine_of_the_doubles_nearest_to_quarter_turns(law, mode):
    last = int(1e5 / (np.pi / 2))
    k = np.arange(-last, last + 1, dtype=np.longdouble)
    # More digits of pi than a double has make the nearest double the right one.
    pi = np.longdouble(3.141592653589793) + np.longdouble(1.2246467991473532e-16)
    near = (k * pi / 2).astype(float)
    for x in (near, np.nextafter(near, np.inf), np.nextafter(near, -np.inf)):
        law.samples(len(x))
        check_sincos(law, x, mode)


def test_beyond_the_exact_range(mode):
    """Right up to 1e6, NaN beyond, and NaN of what is not a number."""
    x = np.concatenate(
        [np.linspace(1e5, EXACT_RANGE, 10_001), -np.linspace(1e5, EXACT_RANGE, 10_001)]
    )
    y = evaluate("sincos", np.stack([x, x], axis=1))
    assert np.abs(y[:, 0] - np.sin(x.astype(np.longdouble))).max() < SINE_ERROR
    beyond = np.array([np.nextafter(EXACT_RANGE, np.inf), -1e7, 1e300, np.inf, -np.inf, np.nan])
    assert np.isnan(evaluate("sincos", np.stack([beyond, beyond], axis=1))).all()


def test_small_angles_keep_their_relative_precision(mode):
    x = np.geomspace(1e-300, 1e-3, 1000)
    y = evaluate("sincos", np.stack([x, x], axis=1))
    assert ulps(y[:, 0], np.sin(x.astype(np.longdouble))).max() <= SINE_ULP


def test_arc_tangent(law, mode):
    total = law.samples(10_000_000)
    rng = np.random.default_rng(4)
    for start in range(0, total, CHUNK):
        count = min(CHUNK, total - start)
        xy = rng.normal(size=(count, 2)) * 10.0 ** rng.uniform(-12, 12, (count, 2))
        exact = np.arctan2(xy[:, 0].astype(np.longdouble), xy[:, 1].astype(np.longdouble))
        law.holds(
            "arc tangent, ulp",
            float(ulps(evaluate("atan2", xy)[:, 0], exact).max()),
            ATAN_ULP,
            mode,
        )


def test_arc_tangent_of_axes_and_of_what_is_no_number(mode):
    points = [
        (0, 1),
        (1, 0),
        (0, -1),
        (-1, 0),
        (0, 0),
        (-0.0, -1.0),
        (np.nan, 1),
        (1, np.nan),
        (5e-324, -1.0),
    ]
    angles = evaluate("atan2", np.array(points, dtype=float))[:, 0]
    assert angles[:6].tolist() == [0, np.pi / 2, np.pi, -np.pi / 2, 0, np.pi]
    assert np.isnan(angles[6:8]).all()
    assert angles[8] == np.pi
