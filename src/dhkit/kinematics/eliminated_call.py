"""Inverse kinematics by elimination of one pose or a few, compiled; see :mod:`dhkit.kernels.single_calls`."""

from __future__ import annotations

import logging
import math
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from dhkit.description import Array, Description, world_to_tool
from dhkit.kernels import FastCall, SingleCall, never
from dhkit.kernels.background import Background
from dhkit.kinematics.closed_form.family import ALL_COORDINATES
from dhkit.kinematics.eliminated import branch_names, elimination_kernels, has_curves
from dhkit.kinematics.polynomial.pose_results import OUTPUT_SIZES, PoseProgram
from dhkit.kinematics.polynomial.root_kinds import ROOTS
from dhkit.kinematics.polynomial.six_joints import six_joints
from dhkit.kinematics.polynomial.solve import SAME_SOLUTION
from dhkit.kinematics.solutions import IKFlag, IKSolutions, IKStatus

log = logging.getLogger(__name__)

_NO_DISTANCE = bytes(8)
_STATUS = bytes([IKStatus.ok])
_FEW = 16
"""Largest number of poses that are solved one after the other."""
_BESIDE = 2 * SAME_SOLUTION
_INSIDE = 0
_OUTSIDE = int(IKFlag.out_of_limits)


class EliminatedPoseCall:
    """All solutions of few poses of an arm of six revolute joints by elimination, or None of what it does not take.

    It does not take poses without solutions, nor those of which two solutions nearly coincide or one does not close.
    """

    def __init__(self, description: Description, arm: PoseProgram) -> None:
        numbers = description.numbers
        middle = np.arange(1.0, description.n + 1.0) / description.n
        self._description = description
        # Which solutions are outside their limits, and the number of solutions; the roots' details are left out.
        self._packed = struct.Struct(f"{ROOTS}d{8 * OUTPUT_SIZES[2]}xd8x")
        self._shared: dict[int, dict[str, object]] = {}
        self._call: FastCall = SingleCall(
            arm.pose_kernel,
            np.concatenate([arm.parameters, numbers.lower, numbers.upper]),
            (ROOTS, description.n),
            install=self._install,
            example=[world_to_tool(description, middle)],
        )

    def _install(self, call: FastCall) -> None:
        # What the function does not take goes the ordinary way, whose kernels small batches do not compile.
        if call is not never:
            for one in elimination_kernels(self._description):
                one.compile()
        self._call = call

    def compile(self) -> None:
        """Compile the function now, and the kernels of the ordinary way."""
        if isinstance(self._call, SingleCall):
            self._call.compile()

    def __call__(self, T: Any, out: Array | None) -> IKSolutions | None:
        """Return the solutions.

        Parameters
        ----------
        T
            Poses of the tool in the world, shape (4, 4), or (N, 4, 4) with few of them, m.
        out
            None is taken.
        """
        if out is not None or type(T) is not np.ndarray:
            return None
        if T.ndim != 2:
            return self._few(T)
        found = self._sure(T)
        if found is None:
            return None
        q, flags = found
        count = len(flags)
        shared = self._shared.get(count) or self._shared_by(count)
        return IKSolutions.of_packed(q, _summary(count, flags, count), shared)

    def _few(self, T: Array) -> IKSolutions | None:
        """Return the solutions of poses (N, 4, 4), one after the other; the batch's kernels need many poses."""
        if T.shape[1:] != (4, 4) or not 0 < len(T) <= _FEW:
            return None
        found = []
        for pose in T:
            one = self._sure(pose)
            if one is None:
                return None
            found.append(one)
        counts = [len(flags) for _, flags in found]
        B = max(counts)
        q = np.full((len(T), B, self._description.n), np.nan)
        for k, (joints, _) in enumerate(found):
            q[k, : counts[k]] = joints
        packed = b"".join(_summary(len(flags), flags, B) for _, flags in found)
        shared = self._shared.get(B) or self._shared_by(B)
        return IKSolutions.of_packed(q, packed, {**shared, "batch": (len(T),)})

    def _sure(self, T: Any) -> tuple[Array, bytes] | None:
        """Return the sorted solutions (K, 6) of a pose, rad, and their flags; None of a pose that is not taken."""
        found = self._call(T, None)
        if found is None:
            return None
        q, packed = found
        *are_outside, verdict = self._packed.unpack(packed)
        # The ordinary way says whether a pose without solutions is out of reach. False for NaN.
        if not verdict > 0.0:
            return None
        count = int(verdict)
        if verdict != count and not are_different(q[:count]):
            return None
        flags = bytes(count)
        if 1.0 in are_outside:
            flags = bytes([_OUTSIDE if outside else _INSIDE for outside in are_outside[:count]])
        return q[:count].copy(), flags

    def _shared_by(self, count: int) -> dict[str, object]:
        """Return what all poses with so many solutions share, see :meth:`IKSolutions.of_packed`."""
        self._shared[count] = {
            "branches": branch_names(count),
            "met": ALL_COORDINATES,
            "description": self._description,
            "batch": (),
        }
        return self._shared[count]


def _summary(count: int, flags: bytes, branches: int) -> bytes:
    """Return what :meth:`IKSolutions.of_packed` reads of a pose with ``count`` solutions of ``branches``."""
    rest = bytes(branches - count)
    return b"%b%b%b%b%b%b" % (_NO_DISTANCE, b"\1" * count, rest, flags, rest, _STATUS)


def are_different(q: Array) -> bool:
    """Return whether no two solutions (K, 6) of a pose, rad, are the same, as ``are_distinct`` tells of many poses."""
    rows = sorted(q.tolist())
    # Those at -pi once more after those at pi.
    beyond = [[row[0] + math.tau, *row[1:]] for row in rows if row[0] < _BESIDE - math.pi]
    around = rows + beyond
    for k, row in enumerate(rows):
        for other in around[k + 1 :]:
            if other[0] - row[0] > SAME_SOLUTION:
                break
            pairs = zip(row, other, strict=True)
            if all(abs(math.remainder(a - b, math.tau)) <= SAME_SOLUTION for a, b in pairs):
                return False
    return True


class EliminationCall:
    """Takes no pose, but counts calls: the kernels of an elimination are compiled after many, in a thread.

    Otherwise they would stay interpreted, because small batches do not count towards compiling.
    """

    def __init__(self, description: Description, install: Callable[[FastCall], None]) -> None:
        self._description = description
        self._install = install
        self._background = Background("elimination", self._compile_in_thread)

    def __call__(self, *_: object) -> None:
        """Count a call."""
        self._background.count()

    def compile(self) -> None:
        """Compile the kernels now."""
        for one in elimination_kernels(self._description):
            one.compile()
        self._install(never)

    def _compile_in_thread(self) -> None:
        try:
            self.compile()
        except Exception as error:
            log.warning("single calls of inverse kinematics stay interpreted (%s)", error)
            self._install(never)


def elimination_call(
    description: Description, install: Callable[[FastCall], None]
) -> EliminatedPoseCall | EliminationCall:
    """Return the function of an arm of six revolute joints without a closed form.

    Parameters
    ----------
    description
        The robot.
    install
        Called with the function that takes the place of this one.
    """
    if has_curves(description):
        return EliminationCall(description, install)
    return EliminatedPoseCall(description, six_joints(description).elimination)
