"""Numeric inverse kinematics of one pose by a compiled search; see :mod:`dhkit.kernels.single_calls`."""

from __future__ import annotations

import struct
from functools import lru_cache
from typing import Any

import numpy as np

from dhkit.description import Array, Description, world_to_tool
from dhkit.kernels import FastCall, SingleCall
from dhkit.kernels.call_source import MAX_ITEMS
from dhkit.kinematics.closed_form.family import ALL_COORDINATES
from dhkit.kinematics.newton import Newton, closes, descent_kernel
from dhkit.kinematics.numeric import RESTARTS, NumericSearch, doubling
from dhkit.kinematics.solutions import IKSolutions, IKStatus

_FLOAT = np.dtype(np.float64)
_SIZE = 6
"""Number of coordinates of a pose that is to be reached."""
_PACKED = struct.Struct(f"{_SIZE + 1}d")
"""The error, 6 numbers, and whether T is a pose, 1 or 0."""
_FOUND = struct.pack("=d?BB", 0.0, True, 0, IKStatus.ok)
"""Distance, valid, flags and status of a pose that is reached, as :meth:`IKSolutions.of_packed` reads them."""


@lru_cache(maxsize=64)
def numeric_call(description: Description) -> NumericCall:
    """Return the function of an arm, the same one each time.

    Parameters
    ----------
    description
        The robot.
    """
    return NumericCall(description)


class NumericCall:
    """One solution of one pose or of a few inside the limits, or None of what it does not take and does not find.

    It begins as :func:`dhkit.kinematics.solve_numerically` does, with the same starts in the same order.
    """

    def __init__(self, description: Description) -> None:
        newton = Newton.of(description, position_only=False, limits=True)
        kernel, table = descent_kernel(description, _SIZE)
        self._newton = newton
        self._n = description.n
        self._middle = newton.middle
        self._last_search: NumericSearch | None = None
        self._shared = {
            "branches": ("numeric",),
            "met": ALL_COORDINATES,
            "description": description,
            "batch": (),
        }
        # At a solution, where rounding is not amplified.
        solution = newton.inside(newton.middle + 0.1)
        self._call: FastCall = SingleCall(
            kernel,
            np.concatenate([table, newton.parameters]),
            (1, description.n),
            install=self._install,
            example=[world_to_tool(description, solution), solution, np.ones(1)],
        )

    def _install(self, call: FastCall) -> None:
        self._call = call

    def compile(self) -> None:
        """Compile the search now."""
        if isinstance(self._call, SingleCall):
            self._call.compile()

    def __call__(self, T: Any, q0: Any, tolerance: float, seed: int) -> IKSolutions | None:
        """Return the solution.

        Parameters
        ----------
        T
            Poses of the tool in the world, shape (4, 4), or (N, 4, 4) with few of them, m.
        q0
            Start, shape (n,) or (N, n), rad and m; None for the middle of the limits.
        tolerance
            Largest error: position as a share of the reach, rotation in rad.
        seed
            Seed of the random starts.
        """
        if not 0.0 < tolerance < 1.0 or seed < 0:
            return None
        first = self._middle if q0 is None else q0
        if type(T) is np.ndarray and T.ndim == 3:
            with np.errstate(all="ignore"):
                return self._few(T, first, tolerance, seed)
        found = self._call(T, first, np.array([tolerance]), None)
        if found is None:
            return None
        q, packed = found
        x, y, z, a, b, c, posed = _PACKED.unpack(packed)
        if not posed:
            return None
        square = max(x * x + y * y + z * z, a * a + b * b + c * c)
        # False where the start is not finite.
        if square <= tolerance * tolerance:
            return IKSolutions.of_packed(q, _FOUND, self._shared, complete=False)
        with np.errstate(all="ignore"):
            restarted = self._restarted(T, first, tolerance, seed)
        if restarted is None:
            return None
        return IKSolutions.of_packed(restarted[None], _FOUND, self._shared, complete=False)

    def _few(self, T: Array, first: Any, tolerance: float, seed: int) -> IKSolutions | None:
        """Return the solutions of poses (N, 4, 4): searched for together, and restarted one by one."""
        count = len(T)
        if count > MAX_ITEMS or T.shape[1:] != (4, 4):
            return None
        if type(first) is not np.ndarray or first.dtype is not _FLOAT:
            return None
        if first.shape not in ((self._n,), (count, self._n)):
            return None
        starts = np.array(np.broadcast_to(first, (count, self._n)), order="C")
        found = self._call(T, starts, np.full((count, 1), tolerance), None)
        if found is None:
            return None
        q, packed = found
        results = np.frombuffer(packed).reshape(count, _SIZE + 1)
        if not results[:, _SIZE].all():
            return None
        for k in np.flatnonzero(~closes(results[:, :_SIZE], tolerance)):
            restarted = self._restarted(T[k], starts[k], tolerance, seed)
            if restarted is None:
                return None
            q[k, 0] = restarted
        shared = {**self._shared, "batch": (count,)}
        return IKSolutions.of_packed(q, _FOUND * count, shared, complete=False)

    def _restarted(self, T: Array, first: Array, tolerance: float, seed: int) -> Array | None:
        """Return the solution (n,) from further starts, the nearest to the first start of those found together."""
        if not np.isfinite(first).all():
            return None
        starts = self._search(seed).starts(T.reshape(1, 16))[0]
        for begin, end in doubling(RESTARTS):
            solutions = self._reached(T, starts[begin:end], tolerance)
            if len(solutions) > 1:
                newton = self._newton
                moved = (solutions - newton.inside(first)) / newton.units
                nearest = np.argmin((moved**2).sum(axis=1))
                solutions = solutions[nearest : nearest + 1]
            if len(solutions):
                solution: Array = solutions[0]
                return solution
        return None

    def _reached(self, T: Array, starts: Array, tolerance: float) -> Array:
        """Return the solutions (K, n) of one pose that searches from starts (k, n) end in."""
        solutions = []
        for begin in range(0, len(starts), MAX_ITEMS):
            some = starts[begin : begin + MAX_ITEMS]
            count = len(some)
            goals = np.empty((count, 4, 4))
            goals[:] = T
            q, packed = self._call(goals, some, np.full((count, 1), tolerance), None)
            error = np.frombuffer(packed).reshape(count, _SIZE + 1)[:, :_SIZE]
            solutions.append(q[closes(error, tolerance), 0])
        return np.concatenate(solutions)

    def _search(self, seed: int) -> NumericSearch:
        """Return the search whose starts are used, kept for its random joint positions."""
        search = self._last_search
        if search is None or search.seed != seed:
            search = NumericSearch(self._newton, 1.0, RESTARTS, seed)
            self._last_search = search
        return search
