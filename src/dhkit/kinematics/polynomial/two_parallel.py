"""Six revolute joints of which axes 2 and 3 are parallel, and axes 4 and 5 or axes 5 and 6 meet.

Most arms with an offset wrist are of this kind (FANUC CRX, ABB GoFa, Kinova Jaco, UFACTORY xArm 6). With q1 known, the
direction k of axes 2 and 3 is known in the tool. Turned by the joints of the wrist it must fit axis 4, and so must the
tool's position along k, which joints 2 and 3 do not change: these are quadratic equations for joints 4 and 6, one after
the other, with two roots each. Joint 5 and the direction of link 3 follow. What remains is the length of link 2,

    F(q1) = |p_3(q1) - p_2|^2 - a_2^2 = 0,

with the axes 2 and 3 at p_2 and p_3 across k. Its product over all four combinations of roots, times the denominators
that occur on the way, is a trigonometric polynomial in q1. Its degree is 8, like that of the input-output equation of
every arm of six revolute joints (Primrose 1986, On the input-output equation of the general 7R-mechanism); ``solve``
measures for each pose whether the coefficients beyond 8 vanish.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dhkit.cached_property import cached_property
from dhkit.description import Array
from dhkit.description.poses import inverse_pose
from dhkit.kernels import Kernel, kernel
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.chain import Chain
from dhkit.kinematics.polynomial.extension import SIGNS
from dhkit.kinematics.polynomial.pose_results import (
    OUTPUT_SIZES,
    PoseResults,
    with_more,
)
from dhkit.kinematics.polynomial.solve import Candidates

if TYPE_CHECKING:
    from dhkit.symbolic import Graph, Pipeline


@dataclass(frozen=True, eq=False)
class TwoParallel:
    """An arm of this kind."""

    chain: Chain
    meeting: tuple[int, int]
    """The axes that meet: (4, 5) or (5, 6)."""
    length: float
    """The reach, m, by which lengths are divided."""

    @property
    def geometry(self) -> str:
        """The arrangement of the axes in words."""
        return f"axes 2 and 3 parallel, {self.meeting[0]} and {self.meeting[1]} meet"

    @classmethod
    def fit(cls, axes: Axes) -> TwoParallel | None:
        """Return an arm as one of this kind; None if it is not."""
        if axes.kinds != "RRRRRR" or not axes.parallel(2, 3) or axes.parallel(2, 4):
            return None
        chain = Chain.of(axes)
        smallest = axes.tolerance * axes.scale
        across_5 = np.hypot(chain.a[4], chain.d[4] * np.sin(chain.alpha[4]))
        across_4 = np.hypot(chain.a[3], chain.d[4] * np.sin(chain.alpha[3]))
        if axes.meeting_point(4, 5) is not None and across_5 > smallest:
            return cls(chain, (4, 5), axes.scale)
        if axes.meeting_point(5, 6) is not None and across_4 > smallest:
            return cls(chain, (5, 6), axes.scale)
        return None

    @cached_property
    def parameters(self) -> Array:
        """The arm's numbers in the programs, shape (49,), lengths as shares of the reach.

        See :class:`dhkit.kinematics.polynomial.two_parallel_program.Numbers`.
        """
        chain = self.chain
        first = inverse_pose(chain.T_world_first)
        last = inverse_pose(chain.T_last_tool)
        angles = [(np.cos(angle), np.sin(angle)) for angle in chain.alpha[:5]]
        return np.concatenate(
            [
                [1.0 / self.length],
                chain.offset,
                chain.d[:5] / self.length,
                chain.a[:5] / self.length,
                np.ravel(angles),
                np.ravel(_scaled(first, self.length)[:3]),
                np.ravel(_scaled(last, self.length)[:3]),
            ]
        )

    @property
    def kernels(self) -> Sequence[Kernel]:
        """The kernels of the programs."""
        return [self.pose_kernel, self._joints_kernel]

    @property
    def pose_kernel(self) -> Kernel:
        """The kernel of :func:`dhkit.kinematics.polynomial.two_parallel_pose.pose_program`."""

        def derived() -> Pipeline:
            from dhkit.kinematics.polynomial.two_parallel_pose import pose_program

            return pose_program(self.meeting)

        types = ("float64",) * len(OUTPUT_SIZES)
        return kernel("two_parallel_pose", f"{self.meeting}", derived, types, is_loop=True)

    @property
    def _joints_kernel(self) -> Kernel:
        def derived() -> Graph:
            from dhkit.kinematics.polynomial.two_parallel_program import joints_program

            return joints_program(self.meeting)

        return kernel("two_parallel_joints", f"{self.meeting}", derived, ("float64",) * 2)

    def candidates(self, poses: Array) -> Candidates:
        """Return joint values at the roots of the polynomial of poses, shape (N, 16), m."""
        return self.candidates_of(PoseResults.of(self, poses), poses)

    def candidates_of(self, results: PoseResults, poses: Array) -> Candidates:
        """Return joint values at the roots that the program found at poses, shape (N, 16), m."""
        found = results.candidates()
        also = results.more[results.is_near].astype(np.uint8)
        if not also.any():
            return found
        # Roots that serve several combinations of signs have several solutions: bit k tells whether number k fits.
        fits = (also[:, None] >> np.arange(len(SIGNS))) & 1
        root, choice = np.nonzero(fits)
        more, errors = self._with_signs(
            poses[found.owner[root]], found.q[root, :1], np.array(SIGNS)[choice]
        )
        return with_more(found, more, errors, root)

    def _with_signs(self, poses: Array, q_1: Array, signs: Array) -> tuple[Array, Array]:
        """Return joint values (K, 6), rad, and errors (K,) of poses (K, 16) near roots (K, 1) with signs (K, 2)."""
        q = np.empty((len(poses), 6))
        error = np.empty((len(poses), 1))
        self._joints_kernel(self.parameters, [poses, q_1, signs], [q, error])
        return q, error[:, 0]


def _scaled(T: Array, length: float) -> Array:
    """Return a pose whose position is a share of a length."""
    scaled = T.copy()
    scaled[:3, 3] /= length
    return scaled
