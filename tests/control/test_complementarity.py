"""Which joints hold: the solution of the complementarity problem, against trying every combination."""

import itertools

import numpy as np
import pytest

from dhkit.control.plant import bounded_forces

ROUNDING = 1e-12


def by_enumeration(A, b, lower, upper):
    """Return the torques of the one combination of holding, forwards and backwards that contradicts nothing."""
    found = []
    for sides in itertools.product((0, 1, -1), repeat=len(b)):
        side = np.array(sides)
        if np.any(np.isinf(np.where(side > 0, upper, np.where(side < 0, lower, 0.0)))):
            continue
        held = side == 0
        f = np.where(side > 0, upper, np.where(side < 0, lower, 0.0))
        f[held] = np.linalg.solve(
            A[np.ix_(held, held)], b[held] - A[np.ix_(held, ~held)] @ f[~held]
        )
        w = b - A @ f
        scale = ROUNDING * max(1.0, np.abs(w).max(), np.abs(f[held]).max(initial=0.0))
        inside = np.all((lower - scale <= f)[held] & (f <= upper + scale)[held])
        if inside and np.all((w * side)[~held] >= -scale):
            found.append(f)
    return found


@pytest.mark.parametrize("m", [1, 2, 3, 4])
def test_it_is_what_enumeration_finds(law, m):
    rng = np.random.default_rng(m)
    for _ in range(law.samples(2000)):
        root = rng.normal(size=(m, m))
        A = root @ root.T + 1e-3 * np.eye(m)
        b = rng.normal(size=m) * 10.0 ** rng.uniform(-2, 2)
        upper, lower = rng.uniform(0, 2, m), -rng.uniform(0, 2, m)
        upper[rng.random(m) < 0.2] = np.inf
        lower[rng.random(m) < 0.2] = -np.inf
        f, side = bounded_forces(A, b, lower, upper)
        found = by_enumeration(A, b, lower, upper)
        gap = min(np.abs(f - other).max() / max(1.0, np.abs(f).max()) for other in found)
        law.holds("torques against enumeration", gap, 1e-9)
        assert np.all(f[side > 0] == upper[side > 0])
        assert np.all(f[side < 0] == lower[side < 0])


def test_many_joints_end():
    rng = np.random.default_rng(0)
    for m in (12, 30):
        for _ in range(200):
            root = rng.normal(size=(m, m))
            A = root @ root.T + 1e-6 * np.eye(m)
            b = rng.normal(size=m)
            f, side = bounded_forces(A, b, -np.ones(m), np.ones(m))
            w = b - A @ f
            assert np.all(np.abs(f) <= 1 + 1e-9)
            assert np.all((w * side)[side != 0] >= -1e-9 * np.abs(w).max())
