"""Derivatives of programs made of blocks, against CasADi's own of the same program written out."""

import casadi
import numpy as np
import pytest

from dhkit.planning.program import Block, BlockProgram, LocalFunction, Scaling


@pytest.fixture
def functions():
    """Two local functions with shared variables, and the same as Python functions of CasADi's symbols."""
    z, p = casadi.SX.sym("z", 3), casadi.SX.sym("p", 2)
    both = (
        casadi.vertcat(z[0] * casadi.sin(z[1]) + p[0], z[2] ** 2 * z[0]),
        p[1] * casadi.exp(z[0] - z[2]),
    )
    y = casadi.SX.sym("y", 1)
    return LocalFunction(z, p, *both), LocalFunction(y, casadi.SX(0, 1), y**3), (z, p, both)


def chain(functions, points=5):
    """A chain in which neighbouring points share a variable, with a cubic of every second variable."""
    first, second, _ = functions
    k = np.arange(points)
    variables = np.stack([2 * k, 2 * k + 1, 2 * k + 2])
    parameters = np.stack([k, np.full(points, points)])
    blocks = (
        Block(first, variables, parameters),
        Block(second, 2 * k[None], np.zeros((0, points), dtype=int)),
    )
    return BlockProgram(2 * points + 1, points + 1, blocks)


def written_out(functions, points=5):
    _, _, (z, p, (rows, cost)) = functions
    function = casadi.Function("both", [z, p], [rows, cost])
    x, q = casadi.SX.sym("x", 2 * points + 1), casadi.SX.sym("q", points + 1)
    values = [
        function(x[2 * k : 2 * k + 3], casadi.vertcat(q[k], q[points])) for k in range(points)
    ]
    g = casadi.vertcat(*(value[0] for value in values), *(x[2 * k] ** 3 for k in range(points)))
    return x, q, sum(value[1] for value in values), g


def test_values_and_derivatives_are_those_of_the_program_written_out(functions):
    program, (x, q, f, g) = chain(functions), written_out(functions)
    weights, weight = casadi.SX.sym("lam", g.numel()), casadi.SX.sym("weight")
    hessian = casadi.triu(casadi.hessian(weight * f + casadi.dot(weights, g), x)[0])
    truth = casadi.Function(
        "truth",
        [x, q, weight, weights],
        [f, g, casadi.gradient(f, x), casadi.jacobian(g, x), hessian],
    )
    rng = np.random.default_rng(5)
    at = [
        rng.normal(size=size) for size in (program.variables, program.parameters, 1, program.rows)
    ]
    function, derivatives = program.functions
    for units in (program.unscaled, scaling(program, rng)):
        u, r = units.unit, units.row_unit
        arguments = [units.scaled(at[0]), np.concatenate([at[1], units.vector]), at[2], at[3] * r]
        found = [
            *function(*arguments[:2]),
            derivatives["grad_f"](*arguments[:2])[1],
            derivatives["jac_g"](*arguments[:2])[1],
            derivatives["hess_lag"](*arguments),
        ]
        f, g, gradient, jacobian, hessian = (np.array(value) for value in truth(*at))
        expected = (
            f,
            g / r[:, None],
            gradient * u[:, None],
            jacobian * u / r[:, None],
            hessian * u * u[:, None],
        )
        for ours, theirs in zip(found, expected, strict=True):
            np.testing.assert_allclose(np.array(ours), theirs, rtol=1e-12, atol=1e-12)


def scaling(program, rng):
    sizes = program.variables, program.variables, program.rows
    return Scaling(*(rng.uniform(0.5, 2.0, size) for size in sizes))


def test_derivatives_are_sparse(functions):
    _, derivatives = chain(functions, 50).functions
    assert derivatives["jac_g"].nnz_out(1) == 50 * (2 + 2) + 50
    # At each point z0 z1 and z0 z2; and the squares of all variables.
    assert derivatives["hess_lag"].nnz_out(0) == 50 * 2 + 101
