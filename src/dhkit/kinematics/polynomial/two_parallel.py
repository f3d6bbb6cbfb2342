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
from numpy.typing import NDArray

from dhkit.cached_property import cached_property
from dhkit.description import Array
from dhkit.description.poses import inverse_pose
from dhkit.kernels import Kernel, kernel
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.chain import Chain
from dhkit.kinematics.polynomial.extension import SIGNS
from dhkit.kinematics.polynomial.trigonometric import SAMPLES

if TYPE_CHECKING:
    from dhkit.symbolic import Graph

_OUTPUTS = {"value": 1, "signs": 2, "joints": 2}
"""Number of outputs of the programs."""


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
        """The numbers of the programs, shape (49,), lengths as shares of the reach: see :func:`_named`."""
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
        return [_kernel(name, self.meeting) for name in _OUTPUTS]

    def first_angle(self, poses: Array) -> Array:
        """Return the first angle at which the polynomial is evaluated, shape (N,), rad.

        Where k and axis 6 are parallel, a denominator is 0. The two angles at which they are nearest to parallel, pi
        apart, lie in the middle between two of the angles.
        """
        chain = self.chain
        R_first_world = chain.T_world_first[:3, :3].T
        axis_6 = poses.reshape(-1, 4, 4)[:, :3, :3] @ chain.T_last_tool[:3, :3].T[:, 2]
        axis_6 = axis_6 @ R_first_world.T
        # In the first frame, k at q1 = 0 is Rx(alpha_1) (0, 0, 1), and joint 1 turns it about z.
        of_k = np.arctan2(-np.sin(chain.alpha[0]), 0.0)
        nearest = np.arctan2(axis_6[:, 1], axis_6[:, 0]) - of_k
        return np.asarray(nearest + np.pi / SAMPLES)

    def values(self, poses: Array, angles: Array) -> Array:
        """Return the polynomial's values.

        Parameters
        ----------
        poses
            Poses of the tool in the world, shape (N, 16), m.
        angles
            Angles of joint 1, shape (N, S), rad.
        """
        run = _kernel("value", self.meeting)
        pairs = np.stack([np.cos(angles), np.sin(angles)], axis=-1).reshape(-1, 2)
        values = np.empty((angles.size, 1))
        run(self.parameters, [np.repeat(poses, angles.shape[1], axis=0), pairs], [values])
        return values.reshape(angles.shape)

    def starts(
        self, poses: Array, owner: NDArray[np.intp], angles: Array
    ) -> tuple[NDArray[np.intp], Array, Array]:
        """Return joint values near the solutions at roots of the polynomial.

        Parameters
        ----------
        poses
            Shape (N, 16), m.
        owner, angles
            Index of each root's pose, and the roots, shape (K,) each, rad.

        Returns
        -------
        tuple[NDArray[np.intp], Array, Array]
            Indices of the roots, shape (L,), ascending; joint values, shape (L, 6), rad, in (-pi, pi]; and their
            errors, shares of the reach and rad, shape (L,). A root that serves several combinations of signs has
            several solutions.
        """
        count = len(angles)
        poses = poses[owner]
        q_1 = angles[:, None]
        signs = np.empty((count, 2))
        also = np.empty((count, len(SIGNS)))
        _kernel("signs", self.meeting)(self.parameters, [poses, q_1], [signs, also])
        rows = np.arange(count)
        if (also > 0).any():
            more, choice = np.nonzero(also > 0)
            rows = np.concatenate([rows, more])
            order = np.argsort(rows, kind="stable")
            rows = rows[order]
            signs = np.concatenate([signs, np.array(SIGNS)[choice]])[order]
            poses = poses[rows]
            q_1 = q_1[rows]

        q = np.empty((len(rows), 6))
        error = np.empty((len(rows), 1))
        _kernel("joints", self.meeting)(self.parameters, [poses, q_1, signs], [q, error])
        return rows, q, error[:, 0]


def _kernel(name: str, meeting: tuple[int, int]) -> Kernel:
    """Return the kernel of one of the programs."""

    def derived() -> Graph:
        from dhkit.kinematics.polynomial import two_parallel_program as programs

        derive = {
            "value": programs.value_program,
            "signs": programs.signs_program,
            "joints": programs.joints_program,
        }
        return derive[name](meeting)

    return kernel(f"two_parallel_{name}", f"{meeting}", derived, ("float64",) * _OUTPUTS[name])


def _scaled(T: Array, length: float) -> Array:
    """Return a pose whose position is a share of a length."""
    scaled = T.copy()
    scaled[:3, 3] /= length
    return scaled
