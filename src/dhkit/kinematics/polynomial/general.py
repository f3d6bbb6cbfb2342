"""Six revolute joints of any geometry, by the elimination of Raghavan and Roth.

Joints i, i + 1 and i + 2 move the line of axis i + 3, and so do the three other joints from the other side; axis i + 3
itself does not move it. A line with direction n through the point f gives 14 equations

    f, n, f x n, (f . f) n - 2 (f . n) f, f . f, f . n    equal on both sides,

which are bilinear in cosine and sine of two joints on each side, and linear in those of joint i (Raghavan and Roth
1993, Inverse kinematics of the general 6R manipulator and related linkages, J. Mech. Des. 115). Eight combinations of
them serve to eliminate the two joints of the other side; the six that are left, and the six multiplied by e^(i q) of
joint i + 1, are linear in 12 products of powers of e^(i q) of joints i + 1 and i + 2: their determinant is the
polynomial.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.cached_property import cached_property
from dhkit.description import Array, Description
from dhkit.description.poses import inverse_pose, turned_about
from dhkit.kernels import Kernel, kernel
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.forward import tool_kernel
from dhkit.kinematics.newton import Newton, error_kernel, magnitude
from dhkit.kinematics.polynomial.pose_results import (
    OUTPUT_SIZES,
    PoseResults,
    with_more,
)
from dhkit.kinematics.polynomial.solve import Candidates
from dhkit.kinematics.polynomial.trigonometric import angles, real_roots, roots_kernel

if TYPE_CHECKING:
    from dhkit.symbolic import Pipeline

Complex: TypeAlias = "NDArray[np.complex128]"
Coefficients: TypeAlias = "tuple[Array, Array, Array]"
"""What 1, the cosine and the sine of joint i are multiplied by."""

_EQUATIONS = 14
_PRODUCTS = 8
"""Number of products of cosines and sines of the two joints that are eliminated, without 1."""
_ANGLES = 2 * np.pi / 3 * np.arange(3)
_OF_VALUES = np.linalg.inv(np.stack([np.ones(3), np.cos(_ANGLES), np.sin(_ANGLES)], axis=1))
"""From values at three angles to the factors of 1, cosine and sine."""
_OF_TWO_ANGLES = np.kron(_OF_VALUES, _OF_VALUES)
_AS_POWERS = np.array([[0, 1, 0], [0.5, 0, 0.5], [0.5j, 0, -0.5j]])
"""1, cosine and sine times x = e^(i q), as factors of 1, x and x^2."""
_CHANGES = (1e-15, 1e-14, 1e-13)
"""Shares of their largest entry by which matrices are changed that are exactly singular."""
_DOUBLE = 1e-7
"""Share of a matrix's norm below which a second vector counts as taken to 0."""
_MIXED = 0.7 + 0.3j
"""Factor t of t x + y, by which two solutions differ even if they share x or y."""
_OF_TWO_POWERS: Complex = np.kron(_AS_POWERS, _AS_POWERS)
_EACH = slice(None)
_NEAR = 1e-6
"""Error of joint values, share of the reach and rad, above which a root is solved once more."""
_FIRST_ANGLE = 0.1
"""First angle at which polynomials are evaluated, rad."""
_WORK = 4
"""A pose counts as so many items towards compiling its program, which takes about 3 s."""


@dataclass(frozen=True, eq=False)
class _FarSide:
    """The equations' side of the far joints for N poses: ``constant`` + Q R p, with the products p without 1."""

    six: tuple[Complex, Complex, Complex]
    """Six equations without p, in powers of e^(i q) of joints i + 1 and i + 2, shape (N, 6, 9) each: what does not
    depend on joint i, and what its cosine and its sine are multiplied by."""
    constant: Array
    """Shape (N, 14)."""
    Q: Array
    """Orthonormal columns, shape (N, 14, 8)."""
    R: Array
    """Triangular, shape (N, 8, 8)."""


@dataclass(frozen=True, eq=False)
class CompiledGeneral:
    """An elimination as a program for one pose; by LAPACK until it is compiled."""

    lapack: General

    @cached_property
    def parameters(self) -> Array:
        """See :func:`dhkit.kinematics.polynomial.general_pose.pose_program`."""
        arm = self.lapack
        numbers = (arm.T_tool_world[:3], arm.directions, arm.points, *arm.near_side)
        return np.concatenate([[1.0 / arm.newton.length], *map(np.ravel, numbers)])

    @property
    def pose_kernel(self) -> Kernel:
        """The kernel of :func:`dhkit.kinematics.polynomial.general_pose.pose_program`."""
        arm = self.lapack

        def derived() -> Pipeline:
            from dhkit.kinematics.polynomial.general_pose import pose_program

            return pose_program(arm.joint, arm.is_reversed)

        types = ("float64",) * len(OUTPUT_SIZES)
        return kernel("general_pose", f"{arm.joint} {arm.is_reversed}", derived, types)

    @property
    def kernels(self) -> Sequence[Kernel]:
        """The kernels of both ways."""
        return [self.pose_kernel, *self.lapack.kernels]

    def candidates(self, poses: Array) -> Candidates:
        """Return joint values at the roots of the polynomial of poses, shape (N, 16), m."""
        if not self.pose_kernel.is_compiled_for(_WORK * len(poses)):
            return self.lapack.candidates(poses)
        return self.candidates_of(PoseResults.of(self, poses), poses)

    def candidates_of(self, results: PoseResults, poses: Array) -> Candidates:
        """Return joint values at the roots that the program found at poses; of a root with two solutions just one."""
        return results.candidates()

    def candidates_by_lapack(self, poses: Array) -> Candidates:
        """Return joint values at the roots of the polynomial of poses, shape (N, 16), m, all where two share a root."""
        if not self.pose_kernel.is_compiled_for(_WORK * len(poses)):
            return self.lapack.candidates(poses)
        return self.lapack.candidates_at(PoseResults.of(self, poses), poses)


@dataclass(frozen=True, eq=False)
class General:
    """An arm of six revolute joints, with the joint that the polynomial is in."""

    directions: Array
    """Directions of the axes at zero joint positions, shape (6, 3)."""
    points: Array
    """A point of each axis, shape (6, 3), as shares of the reach."""
    T_tool_world: Array
    """The world in the tool at zero joint positions, shape (4, 4), m."""
    newton: Newton
    """Errors of poses; its length, the reach, divides lengths."""
    joint: int = 3
    """Joint i: 1, 2 or 3."""
    is_reversed: bool = False
    """Whether joints are counted from the tool, so that joint i is joint 7 - i of the robot."""

    @classmethod
    def of(cls, description: Description) -> General:
        """Return an arm; see :meth:`variants`."""
        axes = Axes.of(description)
        newton = Newton.of(description, position_only=False, limits=False)
        T_tool_world = inverse_pose(axes.T_world_tool)
        return cls(axes.directions, axes.points / axes.scale, T_tool_world, newton)

    def variants(self) -> list[General]:
        """Return the six ways of elimination: for some arms some of them have a polynomial that is always 0."""
        # M = E_1 ... E_6 with rotations E_i about the axes. Then M^-1 = E_6^-1 ... E_1^-1, whose axes are the opposite.
        from_tool = replace(
            self, directions=-self.directions[::-1], points=self.points[::-1], is_reversed=True
        )
        return [replace(arm, joint=joint) for joint in (3, 2, 1) for arm in (self, from_tool)]

    @property
    def kernels(self) -> Sequence[Kernel]:
        """The kernels of the roots and of the errors; all else is linear algebra by LAPACK."""
        tool, _ = tool_kernel(self.newton.description)
        return [roots_kernel(), tool, error_kernel(self.newton.size)]

    def candidates(self, poses: Array) -> Candidates:
        """Return joint values at the roots of the polynomial of poses, shape (N, 16), m."""
        motions = self._motions(poses)
        side = self._reduced(motions)
        roots = real_roots(self._values(side), _FIRST_ANGLE)
        of_root, q = self._joints_at_roots(motions, side, roots.owner, roots.angle)
        owner = roots.owner[of_root]
        error = magnitude(self.newton.error(q, poses[owner]))
        is_near = roots.is_delicate
        return Candidates(
            q,
            error,
            np.ones(len(q), dtype=bool),
            owner,
            of_root,
            roots.expected,
            is_near,
            is_near,
            roots.error,
        )

    def polynomial_values(self, poses: Array) -> Array:
        """Return the values of the polynomial of poses (N, 16), m, at equally spaced angles, shape (N, SAMPLES)."""
        return self._values(self._reduced(self._motions(poses)))

    def _values(self, side: _FarSide) -> Array:
        """Return the values of the polynomials at equally spaced angles, shape (N, SAMPLES)."""
        count = len(side.constant)
        values = [
            np.linalg.det(_matrix(side.six, np.full(count, _FIRST_ANGLE + angle)))
            for angle in angles()
        ]
        # The determinant is real up to a constant factor of absolute value 1.
        real: Array = (np.array(values).T * self._phase).real
        return real

    def candidates_at(self, results: PoseResults, poses: Array) -> Candidates:
        """Return joint values at the roots that the elimination's program found at poses, shape (N, 16), m.

        Those of the program are kept, but where they may be singular or do not close.
        """
        found = results.candidates()
        is_clean = (~results.is_delicate & (results.error < _NEAR))[results.is_near]
        asked = np.flatnonzero(~is_clean)
        owner = found.owner[asked]
        motions = self._motions(poses)
        angles = results.angle[results.is_near][asked]
        of_root, q = self._joints_at_roots(motions, self._reduced(motions), owner, angles)
        error = magnitude(self.newton.error(q, poses[owner[of_root]]))
        return with_more(found, q, error, asked[of_root], is_clean)

    def _joints_at_roots(
        self, motions: Array, side: _FarSide, owner: NDArray[np.intp], roots: Array
    ) -> tuple[NDArray[np.intp], Array]:
        """Return indices of roots, shape (L,), ascending, and joint values, shape (L, 6), rad, in (-pi, pi].

        Parameters
        ----------
        motions, side
            Of the poses.
        owner, roots
            Index of each root's pose, and the roots, shape (K,) each, rad.
        """
        of_root, null = _null_vectors(_matrix(side.six, roots, owner))
        order = np.argsort(of_root, kind="stable")
        of_root = of_root[order]
        null = null[order]
        kept = roots[of_root]
        owner = owner[of_root]
        second = np.angle((null[:, 1:] * null[:, :-1].conj()).sum(axis=(1, 2)))
        third = np.angle((null[:, :, 1:] * null[:, :, :-1].conj()).sum(axis=(1, 2)))

        # The equations, eight of which were to eliminate the other joints, now give the products of those.
        constant, cosine, sine = self.near_side
        factors = (
            constant + np.cos(kept)[:, None, None] * cosine + np.sin(kept)[:, None, None] * sine
        )
        near = np.einsum("nij,nj->ni", factors, _products(second, third))
        right = (near - side.constant[owner])[:, None, :] @ side.Q[owner]
        products = _solved(side.R[owner], np.swapaxes(right, 1, 2))
        # Their order is cos b, sin b, cos a, cos a cos b, cos a sin b, sin a, ...
        a = np.arctan2(products[:, 5, 0], products[:, 2, 0])
        b = np.arctan2(products[:, 1, 0], products[:, 0, 0])
        q = self._joints(motions[owner], (kept, second, third), (a, b))
        q -= math.tau * np.ceil((q - math.pi) / math.tau)
        return of_root, q

    def _joints(
        self, motions: Array, near: tuple[Array, Array, Array], far: tuple[Array, Array]
    ) -> Array:
        """Return all joint values, the last one from the rotation, in the robot's order."""
        i = self.joint - 1
        places = self._far_places
        q = np.zeros((len(motions), 6))
        for place, angle in zip((i, i + 1, i + 2, *places), (*near, *far), strict=True):
            q[:, place] = angle

        # E_i E_(i+1) E_(i+2) E_(i+3) = E_(i-1)^-1 ... M ... E_(i+4)^-1.
        before = [turned_about(self.directions[k], q[:, k]) for k in range(i + 3)]
        after = [turned_about(self.directions[k], q[:, k]) for k in range(i + 4, 6)]
        rest = np.swapaxes(_product(before, len(q)), 1, 2) @ motions[:, :3, :3]
        rest = rest @ np.swapaxes(_product(after, len(q)), 1, 2)
        axis = self.directions[i + 3]
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        across /= np.linalg.norm(across)
        turned = rest @ across
        q[:, i + 3] = np.arctan2(turned @ np.cross(axis, across), turned @ across)
        return q[:, ::-1] if self.is_reversed else q

    @property
    def _far_places(self) -> tuple[int, int]:
        """Indices, from 0, of the two joints that are eliminated."""
        return {1: (4, 5), 2: (5, 0), 3: (0, 1)}[self.joint]

    def _motions(self, poses: Array) -> Array:
        """Return M, the motions from zero joint positions to poses (N, 16) in the world, shape (N, 4, 4)."""
        M = poses.reshape(-1, 4, 4) @ self.T_tool_world
        M[:, :3, 3] /= self.newton.length
        return inverse_pose(M) if self.is_reversed else M

    @cached_property
    def _phase(self) -> complex:
        """Complex number of absolute value 1 that makes determinants real."""
        T = inverse_pose(self.T_tool_world)
        T[:3, 3] += 0.1 * self.newton.length
        six = self._reduced(self._motions(T.reshape(1, 16))).six
        value = np.linalg.det(_matrix(six, np.array([0.3])))[0]
        return complex(np.conj(value) / abs(value)) if value else 1.0

    @cached_property
    def near_side(self) -> Coefficients:
        """The equations' side of joint i, in products of the two joints after it, shape (14, 9) each.

        Its origin is on axis i, about which R = n n^T + cos q (1 - n n^T) + sin q [n] turns all vectors.
        """
        i = self.joint - 1
        origin = self.points[i]
        values = []
        for second in _ANGLES:
            for third in _ANGLES:
                line = self._moved(i + 2, third, self.points[i + 3], self.directions[i + 3])
                point, direction = self._moved(i + 1, second, *line)
                values.append(_equations(point - origin, direction))
        # Of values at nine pairs of angles, shape (9, 14), to factors of the products.
        still = (_OF_TWO_ANGLES @ np.array(values)).T

        axis = self.directions[i]
        along = np.outer(axis, axis)
        constant = _of_vectors(along) @ still
        constant[12:] = still[12:]
        return constant, _of_vectors(np.eye(3) - along) @ still, _of_vectors(_cross(axis)) @ still

    def _reduced(self, motions: Array) -> _FarSide:
        """Return the far side of the equations at motions (N, 4, 4), and the six equations without the far joints."""
        other = self._far_side(motions)
        Q, R = np.linalg.qr(other[:, :, 1:], mode="complete")
        null = np.swapaxes(Q[:, :, _PRODUCTS:], 1, 2)
        constant, cosine, sine = (null @ side for side in self.near_side)
        constant[:, :, 0] -= np.einsum("nij,nj->ni", null, other[:, :, 0])
        six = (constant @ _OF_TWO_POWERS, cosine @ _OF_TWO_POWERS, sine @ _OF_TWO_POWERS)
        return _FarSide(six, other[:, :, 0], Q[:, :, :_PRODUCTS], R[:, :_PRODUCTS])

    def _far_side(self, motions: Array) -> Array:
        """Return the equations' other side in products of the two far joints, shape (N, 14, 9)."""
        points, directions, turns, shifts = self._far_lines
        R = motions[:, None, :3, :3]
        position = motions[:, None, :3, 3]
        moved = turns @ (R @ points[:, :, None] + position[..., None])
        point = moved[..., 0] + shifts - self.points[self.joint - 1]
        direction = (turns @ (R @ directions[:, :, None]))[..., 0]
        side: Array = np.einsum("kl,nlj->njk", _OF_TWO_ANGLES, _equations(point, direction))
        return side

    @cached_property
    def _far_lines(self) -> tuple[Array, Array, Array, Array]:
        """Axis i + 3 behind and motions before the tool's, at nine pairs of the far joints' angles.

        They are points and directions, shape (9, 3) each, which joints from axis 5 on have moved, then the rotations
        (9, 3, 3) and shifts (9, 3) by joints 1 and 2.
        """
        i = self.joint - 1
        a, b = self._far_places
        lines = []
        motions = []
        for first in _ANGLES:
            for second in _ANGLES:
                line = (self.points[i + 3], self.directions[i + 3])
                shift = np.zeros(3)
                turned = np.eye(3)
                for place, angle in ((a, first), (b, second)):
                    if place > i + 3:
                        line = self._moved(place, -angle, *line)
                    elif place < i:
                        shift, turned = self._moved(place, -angle, shift, turned)
                lines.append(line)
                # Rows are where unit vectors are moved.
                motions.append((turned.T, shift))
        points, directions = map(np.array, zip(*lines, strict=True))
        turns, shifts = map(np.array, zip(*motions, strict=True))
        return points, directions, turns, shifts

    def _moved(
        self, place: int, angle: float, point: Array, direction: Array
    ) -> tuple[Array, Array]:
        """Return points and directions (..., 3) turned about an axis."""
        R = turned_about(self.directions[place], np.array(angle))
        origin = self.points[place]
        return origin + (point - origin) @ R.T, direction @ R.T


def _equations(point: Array, direction: Array) -> Array:
    """Return one side of the equations for a line, shape (..., 14), from a point and the direction, shape (..., 3)."""
    f_f = np.sum(point * point, axis=-1, keepdims=True)
    f_n = np.sum(point * direction, axis=-1, keepdims=True)
    moment = np.cross(point, direction)
    mixed = f_f * direction - 2 * f_n * point
    return np.concatenate([point, direction, moment, mixed, f_f, f_n], axis=-1)


def _of_vectors(R: Array) -> Array:
    """Return the matrix, shape (14, 14), that multiplies the equations' four vectors by R, and their scalars by 0."""
    matrix = np.zeros((_EQUATIONS, _EQUATIONS))
    matrix[:12, :12] = np.kron(np.eye(4), R)
    return matrix


def _products(second: Array, third: Array) -> Array:
    """Return the products of 1, cosine and sine of one angle with those of another, shape (N, 9)."""
    of_second = np.stack([np.ones_like(second), np.cos(second), np.sin(second)], axis=1)
    of_third = np.stack([np.ones_like(third), np.cos(third), np.sin(third)], axis=1)
    products: Array = (of_second[:, :, None] * of_third[:, None, :]).reshape(-1, 9)
    return products


def _matrix(
    six: tuple[Complex, Complex, Complex], angle: Array, owner: NDArray[np.intp] | slice = _EACH
) -> Complex:
    """Return the matrix whose determinant is the polynomial, shape (K, 12, 12).

    Parameters
    ----------
    six
        See :class:`_FarSide`.
    angle
        Angles of joint i, shape (K,), rad.
    owner
        Index of the pose of each angle; one for each pose unless given.
    """
    constant, cosine, sine = (factor[owner] for factor in six)
    equations = constant + np.cos(angle)[:, None, None] * cosine
    equations += np.sin(angle)[:, None, None] * sine
    matrix = np.zeros((len(equations), 12, 12), dtype=complex)
    matrix[:, :6, :9] = equations
    matrix[:, 6:, 3:] = equations
    return matrix


def _null_vectors(matrices: Complex) -> tuple[NDArray[np.intp], Complex]:
    """Return the vectors that nearly singular matrices (N, 12, 12) take nearly to 0.

    They hold the products x^j y^k, j = 0 to 3, k = 0 to 2, of x and y on the unit circle. A matrix has two of them
    where two solutions share the angle of joint i, as the two flips of a spherical wrist do.

    Returns
    -------
    tuple[NDArray[np.intp], Complex]
        Indices of the matrices, shape (K,), and the vectors, shape (K, 4, 3).
    """
    # Inverse iteration: solutions of A x = b are long in the directions that A takes to 0.
    size = matrices.shape[1]
    b = np.random.default_rng(0).normal(size=(size, 2))
    solved = _solved(matrices, b)
    length = np.linalg.norm(solved, axis=1, keepdims=True)
    basis, _ = np.linalg.qr(solved / np.where(length > 0, length, 1.0))
    residual = np.linalg.norm(matrices @ basis[:, :, 1:], axis=(1, 2))
    is_double = residual < _DOUBLE * np.linalg.norm(matrices, axis=(1, 2))

    single = np.flatnonzero(~is_double)
    double = np.flatnonzero(is_double)
    of_matrix = np.concatenate([single, double, double])
    vectors = np.concatenate([basis[single, :, 0], *_separated(basis[double])])
    return of_matrix, vectors.reshape(-1, 4, 3)


def _separated(basis: Complex) -> tuple[Complex, Complex]:
    """Return the two vectors of products, shape (N, 12) each, in the planes that bases (N, 12, 2) span.

    With P the entries x^j y^k for j < 3 and k < 2, and S the same of t x + y times these, S c = (t x + y) P c for the
    coordinates c of either vector: the eigenvectors of P^+ S.
    """
    products = basis.reshape(-1, 4, 3, 2)
    low = products[:, :3, :2].reshape(-1, 6, 2)
    by_x = products[:, 1:, :2].reshape(-1, 6, 2)
    by_y = products[:, :3, 1:].reshape(-1, 6, 2)
    adjoint = low.conj().swapaxes(1, 2)
    right = adjoint @ (_MIXED * by_x + by_y)
    _, coordinates = np.linalg.eig(_solved(adjoint @ low, right))
    vectors = basis @ coordinates
    return vectors[:, :, 0], vectors[:, :, 1]


def _solved(matrices: NDArray[Any], right: NDArray[Any]) -> NDArray[Any]:
    """Return the solutions of linear equations (N, k, k) and (..., k, m), large where a matrix is nearly singular.

    Should a matrix be exactly singular, all are changed by a random one, hardly larger than rounding.
    """
    size = matrices.shape[1]
    usable = np.isfinite(matrices).all(axis=(1, 2))[:, None, None]
    changed = np.where(usable, matrices, np.eye(size))
    random = np.random.default_rng(0).uniform(-1.0, 1.0, (size, size))
    largest = np.abs(changed).max(axis=(1, 2), keepdims=True)
    for change in (0.0, *_CHANGES):
        try:
            return np.asarray(np.linalg.solve(changed + change * largest * random, right))
        except np.linalg.LinAlgError:
            continue
    return np.zeros((len(matrices), *right.shape[-2:]), dtype=matrices.dtype)


def _product(rotations: list[Array], count: int) -> Array:
    """Return the product of rotations (N, 3, 3), the first on the left; unit matrices for none."""
    product = np.broadcast_to(np.eye(3), (count, 3, 3))
    for R in rotations:
        product = product @ R
    return product


def _cross(axis: Array) -> Array:
    """Return the matrix of the cross product axis x v."""
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
