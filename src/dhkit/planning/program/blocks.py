"""Nonlinear programs made of blocks: one small function, applied at many points, with exact sparse derivatives.

CasADi would derive a whole program at once, in time proportional to its size. Here each small function is derived once
and evaluated at all its points; the derivatives of the program are these values at other indices.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array

if TYPE_CHECKING:
    import casadi

Indices = NDArray[np.int_]


class LocalFunction:
    """Rows g(z, p) and a cost f(z, p) of a few variables, with their first and second derivatives.

    Derivatives are the gradient df/dz, the Jacobian dg/dz, and the upper triangle of the Lagrangian's Hessian
    d^2 (w f + lam . g) / dz^2 for a weight w and multipliers lam of the rows.

    Parameters
    ----------
    z, p
        Variables and parameters, symbols of shape (., 1).
    rows
        Expressions of shape (m, 1), without unit.
    cost
        Expression of shape (1, 1) that is added to the objective.
    """

    def __init__(
        self, z: casadi.SX, p: casadi.SX, rows: casadi.SX, cost: casadi.SX | None = None
    ) -> None:
        import casadi

        cost = casadi.SX(1, 1) if cost is None else cost
        rows = casadi.densify(rows)
        self.has_cost = cost.nnz() > 0
        self.count: int = rows.numel()
        jacobian = casadi.jacobian(rows, z)
        gradient = casadi.jacobian(cost, z).T

        multipliers = casadi.SX.sym("multipliers", self.count)
        weight = casadi.SX.sym("weight")
        lagrangian = weight * cost + casadi.dot(multipliers, rows)
        hessian = casadi.triu(casadi.hessian(lagrangian, z)[0])

        def function(name: str, inputs: list[casadi.SX], result: casadi.SX) -> casadi.Function:
            return casadi.Function(name, inputs, [result], {"cse": True})

        self.rows = function("rows", [z, p], rows)
        self.cost = function("cost", [z, p], casadi.densify(cost))

        # Derivatives return their nonzeros, shape (nonzeros, 1); their rows and columns are in the attributes ``_at``.
        self.jacobian = function("jacobian", [z, p], _nonzeros(jacobian))
        self.jacobian_at = _triplet(jacobian)
        self.gradient = function("gradient", [z, p], _nonzeros(gradient))
        self.gradient_at = _triplet(gradient)
        inputs = [z, p, multipliers, weight]
        self.hessian = function("hessian", inputs, _nonzeros(hessian))
        self.hessian_at = _triplet(hessian)


class RowKind(Enum):
    """Purpose of rows, which decides their bounds and units."""

    CONTINUITY = "continuity"
    """Difference of a variable and its expression, which must be zero."""
    TIME = "time"
    """Time that an interval takes beyond its duration, s; at most zero."""
    DURATION = "duration"
    """The duration of the motion."""
    LIMIT = "limit"
    """A limit of the motion."""
    PLANE = "plane"
    """Distance beyond a plane, m; at least zero."""
    POSITIVE_PART = "positive part"
    """Excess of a variable over the quantity whose positive part it bounds; at least zero."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of one kind at each point of a block."""

    kind: RowKind
    what: str
    """Name of the limited quantity, for messages."""
    count: int
    """Number of rows at each point."""
    limit: int = -1
    """Place of the limit among the motion's constraints, see :class:`dhkit.planning.criteria.Limit`."""
    order: int | None = None
    """Order of the derivative by time of joint values that the rows are; None if they have no unit."""
    of_joints: bool = False
    """Whether there is one row for each joint."""


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
class Scaling:
    """Units in which a program is solved."""

    offset: Array
    """Values that count as 0, shape (variables,)."""
    unit: Array
    """Units of the variables, shape (variables,)."""
    row_unit: Array
    """Units of the rows, shape (rows,)."""

    @property
    def vector(self) -> Array:
        """All of them, in this order."""
        return np.concatenate([self.offset, self.unit, self.row_unit])

    def scaled(self, x: Array) -> Array:
        """Return variables, shape (variables,), in these units."""
        return (x - self.offset) / self.unit

    def variables(self, scaled: Array) -> Array:
        """Return variables from those in these units, shape (variables,)."""
        return self.offset + self.unit * scaled


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

    def row_units(self, unit_of: Callable[[Rows], float]) -> Array:
        """Return the units of all rows, shape (rows,), from those of their kinds."""
        units = [np.zeros(0)]
        for block in self.blocks:
            each = [np.full(rows.count, unit_of(rows)) for rows in block.rows]
            units.append(np.tile(np.concatenate([np.zeros(0), *each]), block.points))
        return np.concatenate(units)

    @property
    def unscaled(self) -> Scaling:
        """Units of 1."""
        return Scaling(np.zeros(self.variables), np.ones(self.variables), np.ones(self.rows))

    @cached_property
    def functions(self) -> tuple[casadi.Function, dict[str, casadi.Function]]:
        """The program's function of x and p for :func:`casadi.nlpsol`, and its derivatives as options of it.

        The program is solved in the units of a :class:`Scaling`: with variables y and rows h such that

            x = offset + unit y,    h = g / row_unit,

        and its p are the parameters followed by those of the scaling. With D = diag(unit), R = diag(row_unit) and
        multipliers lam of h, those of g are R^-1 lam, and the derivatives by y are

            D df/dx,    R^-1 (dg/dx) D,    D (d^2 (w f + (R^-1 lam) . g) / dx^2) D.
        """
        import casadi

        y = casadi.MX.sym("x", self.variables)
        given = casadi.MX.sym("p", self.parameters + 2 * self.variables + self.rows)
        edges = np.cumsum([0, self.parameters, self.variables, self.variables, self.rows])
        p, offset, unit, row_unit = casadi.vertsplit(given, edges.tolist())
        x = offset + unit * y

        scaled_multipliers = casadi.MX.sym("lam_g", self.rows)

        # lam . h = lam . (g / row_unit): the multipliers of g are those of h over the units of the rows.
        multipliers = scaled_multipliers / row_unit
        weight = casadi.MX.sym("lam_f")

        cost = casadi.MX(1, 1)
        rows = []
        jacobian = _Nonzeros((self.rows, self.variables))
        gradient = _Nonzeros((self.variables, 1))
        hessian = _Nonzeros((self.variables, self.variables))
        begin = 0
        for block in self.blocks:
            function = block.function
            points = block.points
            at = block.variables
            local = (_gather(x, at), _gather(p, block.parameters))

            # Entry (i, j) of a point's derivatives is one of the program's, at that point's rows and variables.
            if function.count:
                rows.append(casadi.vec(function.rows.map(points)(*local)))
                i, j = function.jacobian_at
                row = begin + i[:, None] + function.count * np.arange(points)
                jacobian.add(row, at[j], function.jacobian.map(points)(*local))
            if function.has_cost:
                cost += casadi.sum2(function.cost.map(points)(*local))
                i, _ = function.gradient_at
                gradient.add(at[i], np.zeros_like(at[i]), function.gradient.map(points)(*local))
            i, j = function.hessian_at
            if len(i):
                of_rows = casadi.reshape(
                    multipliers[begin : begin + block.count], function.count, points
                )
                values = function.hessian.map(points)(
                    *local, of_rows, casadi.repmat(weight, 1, points)
                )
                # The upper triangle.
                hessian.add(np.minimum(at[i], at[j]), np.maximum(at[i], at[j]), values)
            begin += block.count
        scaled_rows = casadi.vertcat(casadi.MX(0, 1), *rows) / row_unit

        inputs = {"x": y, "p": given}
        with_weights = {**inputs, "lam_f": weight, "lam_g": scaled_multipliers}

        def function_of(
            arguments: dict[str, casadi.MX], results: dict[str, casadi.MX]
        ) -> casadi.Function:
            symbols = list(arguments.values())
            values = list(results.values())
            return casadi.Function("program", symbols, values, list(arguments), list(results))

        # D df/dx,  R^-1 (dg/dx) D,  D H D  with the Hessian H
        scaled_gradient = casadi.densify(gradient.matrix()) * unit
        scaled_jacobian = jacobian.matrix(1 / row_unit, unit)
        scaled_hessian = hessian.matrix(unit, unit)
        return function_of(inputs, {"f": cost, "g": scaled_rows}), {
            "grad_f": function_of(inputs, {"f": cost, "grad_f_x": scaled_gradient}),
            "jac_g": function_of(inputs, {"g": scaled_rows, "jac_g_x": scaled_jacobian}),
            "hess_lag": function_of(with_weights, {"triu_hess_gamma_x_x": scaled_hessian}),
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

    def matrix(
        self, row_factors: casadi.MX | None = None, column_factors: casadi.MX | None = None
    ) -> casadi.MX:
        """Return the matrix, with its rows and columns multiplied by factors, shape (rows, 1) and (columns, 1)."""
        import casadi

        if not self._values:
            return casadi.MX(*self.shape)
        rows = np.concatenate(self._rows)
        columns = np.concatenate(self._columns)
        values = casadi.vertcat(*self._values)

        # The nonzeros in CasADi's order, by columns, where entry (i, j) of m rows has the number i + m j: place of each
        # value among them.
        positions, place = np.unique(columns * self.shape[0] + rows, return_inverse=True)
        i = (positions % self.shape[0]).tolist()
        j = (positions // self.shape[0]).tolist()
        if len(positions) == len(place):
            nonzeros = values[np.argsort(place).tolist()]
        else:
            # Values at the same place are added, by a matrix with a 1 at (place, value).
            adding = casadi.Sparsity.triplet(
                len(positions), len(place), place.tolist(), list(range(len(place)))
            )
            nonzeros = casadi.DM(adding, 1.0) @ values
        if row_factors is not None and column_factors is not None:
            nonzeros = nonzeros * row_factors[i] * column_factors[j]
        return casadi.MX(casadi.Sparsity.triplet(*self.shape, i, j), nonzeros)


def _gather(vector: casadi.MX, indices: Indices) -> casadi.MX:
    """Return the entries of a vector at indices, in the shape of the indices."""
    import casadi

    if not indices.size:
        return casadi.MX(*indices.shape)
    return casadi.reshape(vector[indices.ravel(order="F").tolist()], *indices.shape)


def _nonzeros(matrix: casadi.SX) -> casadi.SX:
    column: casadi.SX = matrix.nz[:]
    return column


def _triplet(matrix: casadi.SX) -> tuple[Indices, Indices]:
    """Return the rows and the columns of a matrix's nonzeros."""
    rows, columns = matrix.sparsity().get_triplet()
    return np.array(rows, dtype=int), np.array(columns, dtype=int)
