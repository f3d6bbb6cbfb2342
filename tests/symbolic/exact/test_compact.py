"""Equations in sums of angles: shorter, and equal."""

from __future__ import annotations

import numpy as np
import pytest

import dhkit
from dhkit.description import library_robot
from dhkit.symbolic.exact.base_parameters import base_parameters
from dhkit.symbolic.exact.compact import parallel_runs, shortened
from dhkit.symbolic.exact.lagrangian import lagrangian
from exact_checks import restored


@pytest.mark.parametrize("name", dhkit.robots())
def test_shortened_equations_are_equal(name):
    lag = lagrangian(library_robot(name))
    for elements in (lag.M, lag.g):
        short = shortened(lag.arm, elements)
        for a, b in zip(elements.flat, short.flat, strict=True):
            assert len(b) <= len(a)
            assert (b.ring is a.ring and b == a) or restored(b, lag.arm) == a


def test_a_puma_is_short_in_base_parameters(law):
    law.samples(1)
    base = base_parameters(library_robot("puma560")).lagrangian
    M, g = shortened(base.arm, base.M), shortened(base.arm, base.g)
    law.holds("monomials of the symbolic PUMA's M11", len(M[0, 0]), 140)
    law.holds("monomials of the symbolic PUMA's g", sum(map(len, g)), 55)
    for a, b in zip((*base.M.flat, *base.g), (*M.flat, *g), strict=True):
        assert b.ring is a.ring or restored(b, base.arm) == a


def test_planar3r_has_textbook_angles():
    lag = lagrangian(library_robot("planar3r"))
    M, g = shortened(lag.arm, lag.M), shortened(lag.arm, lag.g)
    assert {"c2", "c3", "c23"} == _angles(M[0, 0])
    assert {"c1", "c12", "c123"} == _angles(g[0])


def test_runs_of_parallel_axes():
    def runs(name):
        return parallel_runs(lagrangian(library_robot(name)).arm)

    assert runs("planar3r") == [(0, 1, 2)]
    assert runs("puma560") == [(1, 2)]
    assert runs("puma560_akb") == [(1, 2)]
    assert runs("ur5") == [(1, 2, 3)]
    assert runs("polar_rp") == []
    assert np.all([len(run) > 1 for name in dhkit.robots() for run in runs(name)])


def _angles(element) -> set[str]:
    return {
        g.text
        for monomial in element.terms
        for g, e in zip(element.ring.generators, monomial, strict=True)
        if e and g.kind in ("sine", "cosine")
    }
