"""Decision whether two tables are one arm in different frames: by a motion that maps their joint axes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Convention
from dhkit.grading.judging.frame_changes import (
    SAME,
    FrameChange,
    frame_changes,
    joint_changes,
    wrapped,
)
from dhkit.grading.judging.table_arms import TableArm

_MAX_STEPS = 12
"""Largest number of Newton steps; five or six are enough from within an eighth of a turn."""
STATES = 4
"""Random joint values and parameters at which two arms are compared in doubles."""


@dataclass(frozen=True, eq=False)
class Overlay:
    """Relation between two arms that are one: truth(senses q + offsets) = B answer(q) W.

    Attributes
    ----------
    truth, answer
        The arms.
    senses
        +1 or -1 for each joint, shape (n,).
    offsets
        The truth's joint values at the answer's zero pose, shape (n,), rad and m.
    B
        Motion of the answer's frame 0 to the truth's, shape (4, 4), m; W is that of frame n.
    """

    truth: TableArm
    answer: TableArm
    senses: Array
    offsets: Array
    B: Array

    @cached_property
    def differences(self) -> Array:
        """Poses of the answer's frames in the truth's, shape (n + 1, 4, 4), m."""
        own = self.truth.frames(self.offsets)
        return np.linalg.inv(own) @ self.B @ self.answer.frames(np.zeros(self.answer.n))

    def holds(self) -> bool:
        """Whether both arms move alike at joint values that were not used to find the relation."""
        W = np.linalg.inv(self.differences[-1])
        for q in np.random.default_rng(1).uniform(-2, 2, (STATES, self.answer.n)):
            # truth(senses q + offsets) = B answer(q) W
            of_truth = self.truth.frames(self.senses * q + self.offsets)[-1]
            of_answer = self.B @ self.answer.frames(q)[-1] @ W
            gap = of_truth - of_answer
            gap[:3, 3] /= self.truth.scale
            if not np.max(np.abs(gap)) <= SAME:
                return False
        return True

    def is_allowed(self, strict: bool) -> bool:
        """Whether frames 0 and n differ by free choices, and not by a wrong number.

        They may differ by the file's own numbers, which the answer then leaves to base and tool. A last link of another
        length is wrong in any case if the file gives its length (``strict``).
        """
        tolerance = SAME * self.truth.scale
        is_standard = self.answer.convention is Convention.STANDARD
        first = self.differences[0]
        last = self.differences[-1]
        given = self.answer.entries
        known = self.truth.entries
        if strict and is_standard and abs(abs(given[-1, 2]) - abs(known[-1, 2])) > tolerance:
            return False

        # A wrong length is not another zero of a prismatic joint, though such a zero could make up for it.
        if np.any(np.abs(self.offsets[~_free(self.answer, self.truth)]) > tolerance):
            return False

        # Frames 0 and n may be rotated by right angles alone: entries of their rotations are 0, 1 or -1.
        rotations = np.abs(np.concatenate([first[:3, :3].ravel(), last[:3, :3].ravel()]))
        if np.any(np.minimum(rotations, np.abs(1 - rotations)) > SAME):
            return False

        # Their origins may differ by those lengths of the file that the answer leaves out, as zeros in its table: d of
        # the first row (in the modified convention a and d), and d of the last row.
        columns = slice(1, 2) if is_standard else slice(1, 3)
        for D, given_lengths, known_lengths in (
            (first, given[0, columns], known[0, columns]),
            (last, given[-1, 1:2], known[-1, 1:2]),
        ):
            origin = D[:3, 3]
            if not np.max(np.abs(origin)) > tolerance:
                continue
            left_out = np.where(given_lengths == 0, known_lengths, 0)
            if not abs(np.linalg.norm(origin) - np.linalg.norm(left_out)) <= tolerance:
                return False
        return True

    def change_counts(self) -> tuple[int, int]:
        """Return the number of changes, and of those of joint variables."""
        return len(self.changes), sum(change.change.concerns_joint for change in self.changes)

    @property
    def moves_zero(self) -> bool:
        """Whether a joint variable has another zero or the opposite sense."""
        for sense, offset, kind in zip(self.senses, self.offsets, self.truth.kinds, strict=True):
            is_moved = (
                abs(wrapped(offset)) > SAME
                if kind == "R"
                else abs(offset) > SAME * self.truth.scale
            )
            if sense < 0 or is_moved:
                return True
        return False

    @cached_property
    def changes(self) -> tuple[FrameChange, ...]:
        """Changes of frames and joint variables."""
        # Lengths are compared as finely as arms are: a wrong number is not a choice of frames.
        tolerance = SAME * self.truth.scale
        changes: list[FrameChange] = []
        for i, D in enumerate(self.differences):
            changes += frame_changes(i, D, tolerance)
        joints = zip(self.truth.kinds, self.senses, self.offsets, strict=True)
        for i, (kind, sense, offset) in enumerate(joints, start=1):
            changes += joint_changes(i, kind == "R", float(sense), float(offset), tolerance)
        return tuple(changes)


def _free(answer: TableArm, truth: TableArm) -> NDArray[np.bool_]:
    """Return a mask (n,) of the joints that may have another zero: all but prismatic ones with the file's own d."""
    is_prismatic = np.array([kind != "R" for kind in truth.kinds])
    has_other_d = np.abs(answer.entries[:, 1] - truth.entries[:, 1]) > SAME
    return ~is_prismatic | has_other_d


def overlaid(answer: TableArm, truth: TableArm, strict: bool) -> Overlay | None:
    """Return the relation between two arms with the fewest changes; None if they are two different arms."""
    matching = _Matching(answer, truth, truth.scale)
    if not matching.links_agree:
        return None
    best: Overlay | None = None
    nothing_matched = _Match(np.ones(0), np.eye(4), np.zeros(truth.n))
    for match in matching.solutions(nothing_matched):
        aligned = _align_ends(Overlay(truth, answer, match.senses, match.offsets, match.B))
        for overlay in (aligned, _slide_along_first_axis(aligned), matching.fit_ends(aligned)):
            if overlay is None or not overlay.holds() or not overlay.is_allowed(strict):
                continue
            if best is None or overlay.change_counts() < best.change_counts():
                best = overlay
    return best


class _Match(NamedTuple):
    """Motion and joint values that map the first axes of the answer to those of the truth."""

    senses: Array
    """+1 or -1 for each axis that is mapped, shape (k,)."""
    B: Array
    """Motion of the answer's frame 0 to the truth's, shape (4, 4), m."""
    offsets: Array
    """The truth's joint values at the answer's zero pose, shape (n,), rad and m; 0 for joints not determined yet."""


@dataclass(frozen=True, eq=False)
class _Matching:
    """Search for a rigid motion and joint values that map the axes of one arm, or their reverses, to another's.

    Axis after axis, Newton's method determines the rigid motion and the offsets of the preceding joints, from four
    starts a quarter turn apart.

    Axes are screws in frame 0, whose moments are divided by ``scale``: s_m of the answer at its zero pose, S_m of the
    truth. With the senses e_m the equations are, for each axis m,

        Ad(B) s_m - e_m S_m(offsets) = 0

    and their derivatives are Lie brackets: along a motion with the twist x, which replaces B by exp(x) B,
    d Ad(B) s_m = [x, Ad(B) s_m]; along joint j, which carries the axes m > j, dS_m / dq_j = [S_j, S_m].
    """

    answer: TableArm
    truth: TableArm
    scale: float

    @cached_property
    def own(self) -> Array:
        """Axes s_m of the answer at its zero pose, as screws, shape (n, 6)."""
        return self.answer.screws(np.zeros(self.answer.n), self.scale)

    @property
    def links_agree(self) -> bool:
        """Whether neighbouring axes have the same angle and common normal in both arms, whatever the senses."""
        invariants = [
            _invariants(arm.screws(np.zeros(arm.n), self.scale))
            for arm in (self.answer, self.truth)
        ]
        return bool(np.max(np.abs(invariants[0] - invariants[1]), initial=0.0) < SAME)

    def solutions(self, match: _Match) -> Iterator[_Match]:
        """Yield matches of all axes, given a match of the first ones."""
        if len(match.senses) == self.truth.n:
            yield match
            return
        for sense in (1.0, -1.0):
            senses = np.append(match.senses, sense)
            for start in self.starts(match):
                solved = self.solve(start._replace(senses=senses))
                if solved is not None:
                    yield from self.solutions(solved)
                    break

    def starts(self, match: _Match) -> Iterator[_Match]:
        """Yield starts of Newton's method for the next axis: four positions of the joint before it.

        The first axis has no joint before it: its starts are the arm as it stands, and half and quarter turns of it.
        """
        k = len(match.senses)
        if k == 0:
            for turn in (np.eye(4), *(_half_turn(axis) for axis in range(3)), *_quarter_turns()):
                yield match._replace(B=turn @ match.B)
            return
        if self.truth.kinds[k - 1] != "R":
            yield match
            return
        for quarter in (0, 2, 1, -1):
            angle = quarter * np.pi / 2
            if k == 1:
                # The first joint turns the whole arm: the motion B takes up its angle.
                screw = self.truth.screws(match.offsets, self.scale)[0]
                yield match._replace(B=_exponential(screw * angle, self.scale) @ match.B)
                continue
            offsets = match.offsets.copy()
            offsets[k - 1] += angle
            yield match._replace(offsets=offsets)

    def solve(self, start: _Match) -> _Match | None:
        """Return the match of the first axes near a start; None if there is none.

        The unknowns are the motion B and the offsets of the joints between the first and the last of these axes.
        """
        senses, B, offsets = start
        k = len(senses)
        between = slice(1, k - 1)
        is_later = np.arange(k) > np.arange(1, k - 1)[:, None]
        is_free = _free(self.answer, self.truth)[1 : len(is_later) + 1]
        carried = is_later * senses * is_free[:, None]
        stroke = np.where([kind == "R" for kind in self.truth.kinds[between]], 1, self.scale)
        for _ in range(_MAX_STEPS):
            target = self.truth.screws(offsets, self.scale)[:k]
            moved = self.own[:k] @ _adjoint(B, self.scale).T
            gap = (moved - senses[:, None] * target).ravel()
            if not np.all(np.isfinite(gap)):
                return None
            if np.max(np.abs(gap)) < SAME / 100:
                return _Match(senses, B, offsets)

            by_motion = moved @ _BRACKETS
            by_joints = -_brackets(target[1:-1], target) * carried[..., None]
            columns = np.concatenate([by_motion, by_joints])

            step = _newton_step(columns.reshape(len(columns), -1), gap)
            B = _exponential(step[:6], self.scale) @ B
            offsets = offsets.copy()
            offsets[between] += step[6:] * stroke
        return None

    def fit_ends(self, overlay: Overlay) -> Overlay | None:
        """Move frames 0 and n to the file's, as far as the axes leave them free: joints on one line share an offset.

        Newton's method as in :meth:`solve`, with the axes and the poses of frames 0 and n as equations, and all offsets
        as unknowns; None if it does not converge.
        """
        n = self.truth.n
        B = overlay.B
        offsets = overlay.offsets
        senses = overlay.senses[:, None]

        # Frames 0 and n of the answer shall stand on the truth's, turned by right angles alone.
        square_0, square_n = (_nearest_square(D) for D in overlay.differences[[0, -1]])
        frame_n = self.answer.frames(np.zeros(self.answer.n))[-1]

        is_free = _free(self.answer, self.truth)
        is_later = np.arange(n) > np.arange(n)[:, None]
        carried = is_later[..., None] * senses * is_free[:, None, None]
        stroke = np.where([kind == "R" for kind in self.truth.kinds], 1, self.scale)
        for _ in range(_MAX_STEPS):
            target = self.truth.screws(offsets, self.scale)
            moved = self.own @ _adjoint(B, self.scale).T
            given = _scaled(np.array([B, B @ frame_n]), self.scale)
            wanted = _scaled(
                np.array([square_0, self.truth.frames(offsets)[-1] @ square_n]), self.scale
            )
            gap = np.concatenate([(moved - senses * target).ravel(), (given - wanted).ravel()])
            if np.max(np.abs(gap)) < SAME / 100:
                return replace(overlay, B=B, offsets=offsets)

            # Along a twist x:    d(T of given) = x^ T
            axes_by_motion = moved @ _BRACKETS
            ends_by_motion = np.array([_rate(unit) @ given for unit in np.eye(6)])
            # Along joint j:      d(T of frame n) = S_j^ T, and frame 0 stays
            axes_by_joints = -_brackets(target, target) * carried
            ends_by_joints = np.array(
                [[0 * wanted[1], -_rate(screw) @ wanted[1]] for screw in target]
            )
            ends_by_joints = ends_by_joints * is_free[:, None, None, None]

            by_motion = np.hstack([axes_by_motion.reshape(6, -1), ends_by_motion.reshape(6, -1)])
            by_joints = np.hstack([axes_by_joints.reshape(n, -1), ends_by_joints.reshape(n, -1)])

            step = _newton_step(np.vstack([by_motion, by_joints]), gap)
            B = _exponential(step[:6], self.scale) @ B
            offsets = offsets + step[6:] * stroke
        return None


def _newton_step(
    columns: NDArray[np.floating[Any]], gap: NDArray[np.floating[Any]]
) -> NDArray[np.floating[Any]]:
    """Return the least-squares step x of gap + J x = 0, shape (k,), none of its entries larger than 1.5.

    ``columns`` are those of J as rows, shape (k, len(gap)). A step of 1.5 rad, or 1.5 times the scale, stays in the
    neighbourhood of the start.
    """
    step: NDArray[np.floating[Any]] = -np.linalg.lstsq(columns.T, gap, rcond=1e-8)[0]
    largest = max(float(np.max(np.abs(step))), 1e-300)
    step *= min(1.0, 1.5 / largest)
    return step


def _nearest_square(D: Array) -> Array:
    """Return the nearest rotation by right angles without a translation, shape (4, 4); the identity if none is near."""
    square = np.eye(4)
    R = np.rint(D[:3, :3])
    if np.array_equal(R @ R.T, np.eye(3)):
        square[:3, :3] = R
    return square


def _scaled(T: Array, scale: float) -> Array:
    """Return transforms, shape (..., 4, 4), with lengths divided by a scale."""
    scaled = T.copy()
    scaled[..., :3, 3] /= scale
    return scaled


def _rate(screw: NDArray[np.floating[Any]]) -> Array:
    """Return the matrix S^ of a screw S, shape (4, 4): dT = S^ T for a transform T that moves along it."""
    rate = np.zeros((4, 4))
    rate[:3, :3] = _skew(screw[:3])
    rate[:3, 3] = screw[3:]
    return rate


def _align_ends(overlay: Overlay) -> Overlay:
    """Choose the first and last offset, which base and tool can take up, so that frames 0 and n agree."""
    truth = overlay.truth
    n = overlay.truth.n
    own = truth.frames(overlay.offsets)
    other = overlay.B @ overlay.answer.frames(np.zeros(n))
    screws = truth.screws(overlay.offsets, 1.0)
    first = _joint_travel(screws[0], own[0], other[0], truth.scale)
    last = _joint_travel(screws[-1], own[-1], other[-1], truth.scale)

    # Moving the first joint moves the whole arm: truth(q + o1) = exp(o1) truth(q).
    offsets = overlay.offsets.copy()
    offsets[0] -= first
    if n > 1:
        offsets[-1] += last
    return replace(overlay, offsets=offsets, B=_exponential(-screws[0] * first, 1.0) @ overlay.B)


def _slide_along_first_axis(overlay: Overlay) -> Overlay:
    """Move the answer along the first axis until the origins of frames n have the same height on it.

    The axes stay where they are if all of them are parallel.
    """
    screw = overlay.truth.screws(overlay.offsets, 1.0)[0]
    axis = screw[:3] if np.any(screw[:3]) else screw[3:]
    own = overlay.truth.frames(overlay.offsets)[-1]
    other = overlay.B @ overlay.answer.frames(np.zeros(overlay.answer.n))[-1]
    B = overlay.B.copy()
    B[:3, 3] += axis * (axis @ (own[:3, 3] - other[:3, 3]))
    return replace(overlay, B=B)


def _joint_travel(screw: Array, start: Array, end: Array, scale: float) -> float:
    """Return the joint travel, rad or m, that moves a frame's origin, or on the axis its x axis, to another's."""
    axis = screw[:3]
    moment = screw[3:]
    if not np.any(axis):
        # A prismatic joint: the screw is (0; direction).
        return float(moment @ (end[:3, 3] - start[:3, 3]))

    # The point of the axis that is nearest to the origin is z x (p x z); a and b are the distances from the axis.
    point = np.cross(axis, moment)
    a = _perpendicular_part(axis, start[:3, 3] - point)
    b = _perpendicular_part(axis, end[:3, 3] - point)
    if min(float(np.linalg.norm(a)), float(np.linalg.norm(b))) <= SAME * scale:
        a = _perpendicular_part(axis, start[:3, 0])
        b = _perpendicular_part(axis, end[:3, 0])

    # tan(angle) = z . (a x b) / (a . b)
    return float(np.arctan2(axis @ np.cross(a, b), a @ b))


def _perpendicular_part(axis: Array, vector: Array) -> Array:
    """Return the part of a vector at right angles to a unit axis, shape (3,)."""
    return vector - (axis @ vector) * axis


def _invariants(screws: Array) -> Array:
    """Return invariants of neighbouring screws under motions and changes of sense, shape (n - 1, 3).

    The cosines of the angles between their axes, the distances of the axes times the sines of these angles and, for
    parallel axes, their distances; of axes at the distance d and angle a: |cos a|, |d sin a| and d. Two revolute joints
    have all three; beside a prismatic joint, whose screw is (0; z), the second one is the cosine of the angle.
    """
    z1, m1 = screws[:-1, :3], screws[:-1, 3:]
    z2, m2 = screws[1:, :3], screws[1:, 3:]

    # cos a = z1 . z2, and the reciprocal product z1 . m2 + m1 . z2 = -d sin a up to its sign
    cosine = np.sum(z1 * z2, axis=1)
    reciprocal = np.sum(z1 * m2 + m1 * z2, axis=1)

    # d = |m2 - m1| for parallel axes of the same sense
    are_revolute = np.any(z1, axis=1) & np.any(z2, axis=1)
    are_parallel = are_revolute & (np.abs(np.abs(cosine) - 1) < SAME)
    distance = np.linalg.norm(m2 * np.sign(cosine)[:, None] - m1, axis=1)
    return np.stack(
        [np.abs(cosine), np.abs(reciprocal), np.where(are_parallel, distance, 0)], axis=1
    )


def _brackets(first: Array, second: Array) -> Array:
    """Return the Lie brackets [first_j, second_m] of screws (J, 6) and (M, 6), shape (J, M, 6)."""
    brackets: Array = second @ np.tensordot(first, _BRACKETS, 1)
    return brackets


def _unit_brackets() -> Array:
    """Return the matrices U_k, shape (6, 6, 6), of brackets with the six unit screws e_k: [e_k, s] = s U_k, s a row.

    [(w; v), (z; m)] = (w x z; w x m + v x z)
    """
    brackets = np.zeros((6, 6, 6))
    for k, unit in enumerate(np.eye(3)):
        crossed = _skew(unit).T
        brackets[k, :3, :3] = crossed
        brackets[k, 3:, 3:] = crossed
        brackets[k + 3, :3, 3:] = crossed
    return brackets


def _skew(p: NDArray[np.floating[Any]]) -> Array:
    """Return the matrix of p x, shape (3, 3)."""
    return np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])


def _adjoint(T: Array, scale: float) -> Array:
    """Return the matrix Ad(T) = [[R, 0], [p^ R, R]] that maps screws as a motion moves them, shape (6, 6)."""
    R = T[:3, :3]
    return np.block([[R, np.zeros((3, 3))], [_skew(T[:3, 3]) @ R / scale, R]])


def _exponential(screw: NDArray[np.floating[Any]], scale: float) -> Array:
    """Return the motion along a screw (angles in rad; lengths in m over the scale), shape (4, 4), m.

    exp(w; v) = [[R, V v], [0, 1]] with the angle t = |w|, K = w^ and (Lynch & Park, Modern Robotics, 2017, ch. 3)

        R = 1 + sin(t)/t K + (1 - cos(t))/t^2 K^2
        V = 1 + (1 - cos(t))/t^2 K + (1 - sin(t)/t)/t^2 K^2
    """
    w = screw[:3]
    v = screw[3:] * scale
    angle = float(np.linalg.norm(w))
    K = _skew(w)
    if angle < 1e-12:
        R = np.eye(3) + K
        V = np.eye(3) + K / 2
    else:
        s = np.sin(angle) / angle
        c = (1 - np.cos(angle)) / angle**2
        R = np.eye(3) + s * K + c * K @ K
        V = np.eye(3) + c * K + (1 - s) / angle**2 * K @ K
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = V @ v
    return T


def _half_turn(axis: int) -> Array:
    """Return the rotation by half a turn about a coordinate axis, from 0, shape (4, 4)."""
    signs = np.full(4, -1.0)
    signs[[axis, 3]] = 1
    return np.diag(signs)


def _quarter_turns() -> list[Array]:
    """Return the rotations by a quarter turn about each coordinate axis, in both senses, shape (4, 4) each."""
    turns = []
    for unit in np.eye(6)[:3]:
        turns.append(_exponential(np.pi / 2 * unit, 1.0))
        turns.append(_exponential(-np.pi / 2 * unit, 1.0))
    return turns


_BRACKETS = _unit_brackets()
"""Brackets with the six unit screws, shape (6, 6, 6)."""
