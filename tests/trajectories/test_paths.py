"""The composition of a joint path with a time law, against evaluating one after the other."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from dhkit.description import library_robot
from dhkit.trajectories import JointPath

ARM = library_robot("planar2r")
SAME = 1e-11  # of the largest value


def random_path(pieces, degree, seed):
    """Return a continuous path with corners."""
    rng = np.random.default_rng(seed)
    breaks = np.concatenate([[0], np.cumsum(rng.uniform(0.2, 1, pieces))])
    breaks /= breaks[-1]
    breaks[-1] = 1.0
    coefficients = rng.uniform(-1, 1, (pieces, degree + 1, 2))
    for k in range(1, pieces):
        w = breaks[k] - breaks[k - 1]
        coefficients[k, 0] = sum(coefficients[k - 1, j] * w**j for j in range(degree + 1))
    return JointPath(ARM, breaks, coefficients)


def random_law(pieces, seed):
    """Return breaks and coefficients (pieces, 3) of a law from rest to rest, accelerations constant in each piece."""
    rng = np.random.default_rng(seed)
    breaks = np.concatenate([[0], np.cumsum(rng.uniform(0.2, 1, pieces))])
    h = np.diff(breaks)
    rates = np.concatenate([[0], rng.uniform(0.1, 1, pieces - 1), [0]])
    ways = h * (rates[:-1] + rates[1:]) / 2
    rates, ways = rates / ways.sum(), ways / ways.sum()
    s = np.concatenate([[0], np.cumsum(ways)])
    return breaks, np.stack([s[:-1], rates[:-1], np.diff(rates) / h / 2], axis=1)


def law_at(breaks, rows, t):
    k = np.clip(np.searchsorted(breaks, t, "right") - 1, 0, len(rows) - 1)
    u = t - breaks[k]
    s = sum(rows[k, j] * u**j for j in range(rows.shape[1]))
    return s, sum(j * rows[k, j] * u ** (j - 1) for j in range(1, rows.shape[1]))


@given(st.integers(1, 5), st.integers(1, 5), st.integers(2, 6), st.integers(0, 1000))
def test_values_and_rates_are_those_of_the_chain_rule(pieces, degree, parts, seed):
    path, (breaks, rows) = random_path(pieces, degree, seed), random_law(parts, seed + 1)
    motion = path.timed(breaks, rows)
    assert motion.coefficients.shape[1] == 2 * degree + 1
    assert motion.duration == breaks[-1]
    t = np.random.default_rng(seed).uniform(0, breaks[-1], 200)
    s, rate = law_at(breaks, rows, t)
    scale = np.abs(path.q(s)).max()
    assert np.abs(motion.q(t) - path.q(s)).max() < SAME * scale
    # Beside a corner of the path rounding decides which side counts.
    clear = np.abs(s[:, None] - path.breaks).min(axis=1) > 1e-9
    expected = path.qs(s) * rate[:, None]
    assert np.abs(motion.qd(t) - expected)[clear].max(initial=0) < 100 * SAME * max(
        1, np.abs(expected).max()
    )


def test_breaks_of_both_are_breaks_once():
    path = random_path(4, 3, 0)
    law = np.array([0.0, 1.0, 3.0]), np.array([[0.0, 0.5], [0.5, 0.25]])
    motion = path.timed(*law)
    expected = [2 * s if s < 0.5 else 1 + 4 * (s - 0.5) for s in path.breaks]
    assert motion.breaks == pytest.approx(sorted({*np.round(expected, 12), 1.0}), abs=1e-9)
    # A path's break where the law has one too is one.
    halves = JointPath(
        ARM, np.array([0.0, 0.5, 1.0]), np.array([[[0.0, 0], [1, 1]], [[0.5, 0.5], [2, 0]]])
    )
    assert halves.timed(*law).breaks == pytest.approx([0, 1, 3])


def test_a_law_of_rest_leaves_the_arm_where_it_is():
    path = random_path(3, 3, 1)
    motion = path.timed([0, 1, 2, 3], [[0, 0.5], [0.5, 0], [0.5, 0.5]])
    assert np.array_equal(motion.q([1.2, 1.8]), motion.q([1.5, 1.5]))
    assert not motion.qd(1.5).any()


@pytest.mark.parametrize(
    ("breaks", "rows", "complaint"),
    [
        ([0, 1], [[0, 0.9]], r"s goes from 0 to 0.9; expected from 0 to 1"),
        ([0, 1], [[0, 3, -2]], r"s goes back at 1 s; expected an s\(t\) that never does"),
        ([0, 1, 2], [[0, 0.4], [0.6, 0.4]], r"s jumps by 0.2 at a break"),
        ([0, 1], [0, 1], r"coefficients has shape \(2,\); expected \(K, p\+1\)"),
        ([0, 1, 2], [[0, 1]], r"coefficients has shape"),
    ],
)
def test_what_is_no_law_is_named(breaks, rows, complaint):
    with pytest.raises(ValueError, match=complaint):
        random_path(2, 3, 0).timed(breaks, rows)


def test_a_path_ends_with_one():
    with pytest.raises(ValueError, match="breaks end with 2; expected 1"):
        JointPath(ARM, np.array([0.0, 2.0]), np.zeros((1, 2, 2)))
