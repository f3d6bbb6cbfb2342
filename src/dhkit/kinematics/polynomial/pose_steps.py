"""Steps of programs for one pose that all ways of elimination share: from roots to sorted solutions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce
from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.polynomial.root_kinds import (
    DOUBTFUL,
    IS_BESIDE,
    IS_DELICATE,
    IS_REAL,
    IS_TRIED,
    NEAR_SOLUTION,
    NONE,
    ROOTS,
    SOLUTION,
)
from dhkit.kinematics.polynomial.root_steps import OF_ROOT, sorted_step
from dhkit.kinematics.polynomial.solve import CLOSES, INEXACT, SAME_ANGLE, SORTED_BY, sorting_key
from dhkit.kinematics.solutions import LIMIT_SLACK
from dhkit.symbolic import Graph, PipelineStep

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
RESULTS = ("sorted_q", "sorted_is_outside", "sorted_details", "verdict", "error")
"""Outputs of a pose's program; the roots are sorted by their joint values, and those without a solution are the last.

- joint values, 16 times 6, rad, NaN where there is no solution;
- whether a joint is outside its limits, 16 times;
- details of the root, 16 times 4: what is known of it, as the sum of ``IS_TRIED``, ``IS_REAL``, ``IS_BESIDE`` and
  ``IS_DELICATE``; the error of its joint values; its angle, rad; and a number that the way of elimination reads, 0
  where the root has just one solution;
- ``verdict``, the number of solutions if all are known, plus a fraction if some lie so near that they may be the same
  one; 0 if they are not known, or T is no pose;
- ``error``, the largest coefficient beyond the degree of the polynomial, relative to the others.
"""
_AWAY_FROM_ROOT = 1e-5
"""Half the distance of a solution from its root, rad, above which it may be that of another root."""
_OF_SOLUTION = ("q", "is_outside", "details", "kind")
_KEY_OFFSET = 8.0
"""Subtracted from keys, so that those of solutions are negative and 0 comes last."""


def solving_steps(
    parameters: _SX, solutions: Graph, shared: Sequence[str]
) -> tuple[PipelineStep, ...]:
    """Return the steps from the outputs of :func:`root_steps` to the sorted results.

    Roots that are surely complex, about half of them all, are skipped.

    Parameters
    ----------
    parameters
        Symbols of the pipeline's parameters.
    solutions
        Program of :func:`known_solutions`.
    shared
        Outputs of earlier steps that it uses for all roots.
    """
    sizes = {one.name: one.size for one in solutions.outputs}
    return (
        PipelineStep(
            solutions,
            ROOTS,
            each={name: f"sorted_{name}" for name in OF_ROOT},
            shared={name: name for name in shared},
            skips="sorted_is_idle",
        ),
        sorted_step(
            parameters,
            "sorted_solutions",
            "key",
            {name: sizes[name] for name in _OF_SOLUTION},
            missing=("q", "kind"),
        ),
        _verdict(parameters),
    )


def _verdict(parameters: _SX) -> PipelineStep:
    """Return the step that tells whether all solutions are known, as ``verdict`` of :data:`RESULTS`."""
    kinds = ca.SX.sym("kinds", ROOTS)
    posed = ca.SX.sym("posed")
    error = ca.SX.sym("error")
    terms = ca.vertsplit(kinds)
    while len(terms) > 1:
        terms = [sum(terms[k + 1 : k + 2], terms[k]) for k in range(0, len(terms), 2)]
    (total,) = terms
    # Complex roots come in pairs: an odd number is not all.
    pairs = ca.floor(total / 2.0)
    is_even = total - 2.0 * pairs < 1.0
    is_known = ca.logic_and(posed == 1.0, error < INEXACT)
    is_sure = ca.logic_and(ca.logic_and(is_known, total < DOUBTFUL), is_even)
    verdict = ca.if_else(is_sure, total, 0.0)
    inputs = {"parameters": parameters, "kinds": kinds, "posed": posed, "error": error}
    return PipelineStep(
        Graph.of("verdict", inputs, {"verdict": verdict}),
        shared={"kinds": "sorted_kind", "posed": "posed", "error": "error"},
    )


def known_solutions(
    parameters: _SX,
    inputs: dict[str, _SX],
    of_root: Sequence[_SX],
    q: _SX,
    error: _SX,
    closeness: _SX,
    is_delicate: _SX,
    place: int,
    more: _SX = 0.0,
) -> Graph:
    """Return the program of the last step: joint values at roots, and what is known of them.

    Parameters
    ----------
    parameters
        Symbols of the parameters; the last twelve are lower and upper limits.
    inputs
        Inputs of the step, the root's ``angle`` among them, rad, besides ``is_tried`` and ``is_real``.
    of_root
        Symbols of ``is_tried`` and ``is_real``.
    q, error
        Joint values, 6 x 1, rad, and their error.
    closeness, is_delicate
        Whether another root is near, and whether the solution may be singular.
    place
        Index of the joint that the polynomial is in.
    more
        The last detail, above 0 at a root that has further solutions.
    """
    is_tried, is_real = of_root
    # Iteration from joint values that are not those of the root may lead to the solution of another root.
    away = ca.fabs(ca.sin((q[place] - inputs["angle"]) / 2.0))
    is_delicate = ca.logic_or(is_delicate, ca.logic_not(away < _AWAY_FROM_ROOT))
    is_alone = ca.logic_not(ca.logic_or(is_delicate, more > 0.0))
    is_sure = ca.logic_and(ca.logic_and(is_real != 0.0, error <= CLOSES), is_alone)
    of_complex = ca.if_else(is_real != 0.0, DOUBTFUL, NONE)
    one = ca.if_else(closeness > 0.0, NEAR_SOLUTION, SOLUTION)
    kind = ca.if_else(is_tried != 0.0, ca.if_else(is_sure, one, DOUBTFUL), of_complex)
    # As dhkit.kinematics.eliminated.ordered has it. Angles at -pi are those at pi.
    some = ca.vertsplit(q[:SORTED_BY])
    around = [ca.if_else(x < SAME_ANGLE - math.pi, x + math.tau, x) for x in some]
    order = sorting_key([ca.floor(x / SAME_ANGLE + 0.5) * SAME_ANGLE for x in around])
    # Finite even where q is NaN: the place at which a root is stored follows from it.
    order = ca.if_else(ca.fabs(order) < _KEY_OFFSET, order, 0.0)

    # lower <= q + 2 pi k <= upper for some whole k.
    lower = parameters[-12:-6] - LIMIT_SLACK
    upper = parameters[-6:] + LIMIT_SLACK
    windings = ca.floor((upper - q) / math.tau) + ca.floor((q - lower) / math.tau)
    is_outside = reduce(ca.fmin, ca.vertsplit(windings)) < 0.0

    def at_tried(x: _SX) -> _SX:
        """Return 0 where the root is complex: what follows from it is without meaning."""
        return ca.if_else(is_tried != 0.0, x, 0.0)

    known = [
        (is_tried != 0.0, IS_TRIED),
        (is_real != 0.0, IS_REAL),
        (closeness > 0.0, IS_BESIDE),
        (is_delicate, IS_DELICATE),
    ]
    state = sum(ca.if_else(is_so, float(bit), 0.0) for is_so, bit in known)
    details = [state, *map(at_tried, (error, inputs["angle"], more))]
    outputs = {
        "q": ca.vertcat(*map(at_tried, ca.vertsplit(q))),
        "is_outside": at_tried(is_outside),
        "details": ca.vertcat(*details),
        "kind": kind,
        # Roots without a solution come last, with the key 0, as skipped ones have: all other keys are negative.
        "key": ca.if_else(kind != NONE, at_tried(order) - _KEY_OFFSET, 0.0),
    }
    return Graph.of("solutions", inputs, outputs)
