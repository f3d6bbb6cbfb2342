"""Nonlinear programs made of blocks: one small function, applied at many points, with exact sparse derivatives.

CasADi would derive a whole program at once, in time proportional to its size. Here each small function is derived once
and evaluated at all its points; the derivatives of the program are these values at other indices.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array

if TYPE_CHECKING:
    import casadi

Indices = NDArray[np.int_]


class LocalFunction:
    """Rows and a cost of a few variables, with their first and second derivatives.

    Parameters
    ----------
    z, p
        Variables and parameters, symbols of shape (., 1).
    rows
        Expressions of shape (m, 1), without unit.
    cost
        Expression of shape (1, 1) that is added to the objective.
    """

    def __init__(self, z: casadi.SX, p: casadi.SX, rows: casadi.SX, cost: casadi.SX | None = None) -> None:
        import casadi

        cost = casadi.SX(1, 1) if cost is None else cost
        rows, self.has_cost = casadi.densify(rows), cost.nnz() > 0
        self.count: int = rows.numel()
        multipliers, weight = casadi.SX.sym("multipliers", self.count), casadi.SX.sym("weight")
        jacobian, gradient = casadi.jacobian(rows, z), casadi.jacobian(cost, z).T
        hessian = casadi.triu(casadi.hessian(weight * cost + casadi.dot(multipliers, rows), z)[0])

        def function(name: str, inputs: list[casadi.SX], result: casadi.SX) -> casadi.Function:
            return casadi.Function(name, inputs, [result], {"cse": True})

        self.rows, self.cost = function("rows", [z, p], rows), function("cost", [z, p], casadi.densify(cost))
        # Derivatives return their nonzeros, (nonzeros, 1), whose rows and columns are these.
        self.jacobian, self.jacobian_at = function("jacobian", [z, p], _nonzeros(jacobian)), _triplet(jacobian)
        self.gradient, self.gradient_at = function("gradient", [z, p], _nonzeros(gradient)), _triplet(gradient)
        inputs = [z, p, multipliers, weight]
        self.hessian, self.hessian_at = function("hessian", inputs, _nonzeros(hessian)), _triplet(hessian)


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of one kind at each point of a block."""

    what: str
    """Name of the limited quantity, such as ``"torque"``."""
    low: Array
    """Lower bounds at each point, shape (count,), without unit."""
    high: Array

    @classmethod
    def of(cls, what: str, count: int, low: float = -np.inf, high: float = np.inf) -> Rows:
        """Return rows with equal bounds; those without bounds get them from the task's limits."""
        return cls(what, np.full(count, low), np.full(count, high))

    @property
    def count(self) -> int:
        """Number of rows at each point."""
        return len(self.low)


@dataclass(frozen=True, eq=False)
class Block:
    """A local function at P points of a program."""

    function: LocalFunction
    variables: Indices
    """Indices of its variables in those of the program, shape (variables, P)."""
    parameters: Indices
    """Indices of its parameters in those of the program, shape (parameters, P)."""
    rows: tuple[Rows, ...] = ()
    """Kinds of its rows, in order."""
    intervals: Indices | None = None
    """First and last of the mesh's intervals that a point belongs to, shape (P, 2); None for the whole motion."""
    is_limited: NDArray[np.bool_] | None = None
    """Whether each point's rows are limited, shape (P,); None for all."""

    @property
    def points(self) -> int:
        """The number of points."""
        points: int = self.variables.shape[1]
        return points

    @property
    def count(self) -> int:
        """The number of rows at all points."""
        count: int = self.function.count * self.points
        return count


@dataclass(frozen=True, eq=False)
class BlockProgram:
    """A nonlinear program: the sum of its blocks' costs, and all their rows, point by point."""

    variables: int
    """Number of variables."""
    parameters: int
    """Number of parameters."""
    blocks: tuple[Block, ...]

    @property
    def rows(self) -> int:
        """The number of rows."""
        count: int = sum(block.count for block in self.blocks)
        return count

    @cached_property
    def functions(self) -> tuple[casadi.Function, dict[str, casadi.Function]]:
        """The program's function of x and p for :func:`casadi.nlpsol`, and its derivatives as options of it."""
        import casadi

        x, p = casadi.MX.sym("x", self.variables), casadi.MX.sym("p", self.parameters)
        multipliers, weight = casadi.MX.sym("lam_g", self.rows), casadi.MX.sym("lam_f")
        cost, rows = casadi.MX(1, 1), []
        jacobian, gradient, hessian = (
            _Nonzeros(shape) for shape in ((self.rows, self.variables), (self.variables, 1), (self.variables,) * 2)
        )
        begin = 0
        for block in self.blocks:
            function, points, at = block.function, block.points, block.variables
            inputs = [_gather(x, at), _gather(p, block.parameters)]
            if function.count:
                rows.append(casadi.vec(function.rows.map(points)(*inputs)))
                i, j = function.jacobian_at
                here = begin + i[:, None] + function.count * np.arange(points)
                jacobian.add(here, at[j], function.jacobian.map(points)(*inputs))
            if function.has_cost:
                cost += casadi.sum2(function.cost.map(points)(*inputs))
                i, _ = function.gradient_at
                gradient.add(at[i], np.zeros_like(at[i]), function.gradient.map(points)(*inputs))
            i, j = function.hessian_at
            if len(i):
                weights = casadi.reshape(multipliers[begin : begin + block.count], function.count, points)
                values = function.hessian.map(points)(*inputs, weights, casadi.repmat(weight, 1, points))
                hessian.add(np.minimum(at[i], at[j]), np.maximum(at[i], at[j]), values)
            begin += block.count
        g = casadi.vertcat(casadi.MX(0, 1), *rows)

        def derivative(inputs: list[casadi.MX], values: dict[str, casadi.MX]) -> casadi.Function:
            given = {"x": x, "p": p, "lam_f": weight, "lam_g": multipliers}
            names = [name for name, symbol in given.items() if any(symbol is other for other in inputs)]
            return casadi.Function("derivative", inputs, list(values.values()), names, list(values))

        program = casadi.Function("nlp", [x, p], [cost, g], ["x", "p"], ["f", "g"])
        return program, {
            "grad_f": derivative([x, p], {"f": cost, "grad_f_x": casadi.densify(gradient.matrix)}),
            "jac_g": derivative([x, p], {"g": g, "jac_g_x": jacobian.matrix}),
            "hess_lag": derivative([x, p, weight, multipliers], {"triu_hess_gamma_x_x": hessian.matrix}),
        }


class _Nonzeros:
    """Sparse matrix as a sum of values at given places."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape
        self._rows: list[Indices] = []
        self._columns: list[Indices] = []
        self._values: list[casadi.MX] = []

    def add(self, rows: Indices, columns: Indices, values: casadi.MX) -> None:
        """Add values, shape (k, P), at rows and columns of the same shape."""
        import casadi

        self._rows.append(rows.ravel(order="F"))
        self._columns.append(columns.ravel(order="F"))
        self._values.append(casadi.vec(values))

    @property
    def matrix(self) -> casadi.MX:
        import casadi

        if not self._values:
            return casadi.MX(*self.shape)
        rows, columns = np.concatenate(self._rows), np.concatenate(self._columns)
        values = casadi.vertcat(*self._values)
        # In CasADi's order, by columns; values at the same place are added.
        places, order = np.unique(columns * self.shape[0] + rows, return_inverse=True)
        pattern = casadi.Sparsity.triplet(
            *self.shape, (places % self.shape[0]).tolist(), (places // self.shape[0]).tolist()
        )
        if len(places) == len(order):
            return casadi.MX(pattern, values[np.argsort(order).tolist()])
        adding = casadi.Sparsity.triplet(len(places), len(order), order.tolist(), list(range(len(order))))
        return casadi.MX(pattern, casadi.DM(adding, 1.0) @ values)


def _gather(vector: casadi.MX, indices: Indices) -> casadi.MX:
    import casadi

    if not indices.size:
        return casadi.MX(*indices.shape)
    return casadi.reshape(vector[indices.ravel(order="F").tolist()], *indices.shape)


def _nonzeros(matrix: casadi.SX) -> casadi.SX:
    column: casadi.SX = matrix.nz[:]
    return column


def _triplet(matrix: casadi.SX) -> tuple[Indices, Indices]:
    rows, columns = matrix.sparsity().get_triplet()
    return np.array(rows, dtype=int), np.array(columns, dtype=int)
