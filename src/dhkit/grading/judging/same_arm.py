"""Decision whether two tables are one arm in different frames: by a motion that maps their joint axes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Convention
from dhkit.grading.judging.frame_changes import SAME, FrameChange, frame_changes, joint_changes, wrapped
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
            gap = self.truth.frames(self.senses * q + self.offsets)[-1] - self.B @ self.answer.frames(q)[-1] @ W
            gap[:3, 3] /= self.truth.scale
            if not np.max(np.abs(gap)) <= SAME:
                return False
        return True

    def allowed(self, strict: bool) -> bool:
        """Whether frames 0 and n differ by free choices, and not by a wrong number.

        They may differ by the file's own numbers, which the answer then leaves to base and tool. A last link of another
        length is wrong in any case if the file gives its length (``strict``).
        """
        tolerance = SAME * self.truth.scale
        standard = self.answer.convention is Convention.STANDARD
        first = self.differences[0]
        last = self.differences[-1]
        numbers = self.answer.entries
        own = self.truth.entries
        if strict and standard and abs(abs(numbers[-1, 2]) - abs(own[-1, 2])) > tolerance:
            return False
        # A wrong length is not another zero of a sliding joint, though such a zero could make up for it.
        if np.any(np.abs(self.offsets[~_free(self.answer, self.truth)]) > tolerance):
            return False
        turns = np.abs(np.concatenate([first[:3, :3].ravel(), last[:3, :3].ravel()]))
        if np.any(np.minimum(turns, np.abs(1 - turns)) > SAME):
            return False
        columns = slice(1, 2) if standard else slice(1, 3)
        return all(
            abs(np.linalg.norm(D[:3, 3]) - np.linalg.norm(np.where(given == 0, known, 0))) <= tolerance
            for D, given, known in (
                (first, numbers[0, columns], own[0, columns]),
                (last, numbers[-1, 1:2], own[-1, 1:2]),
            )
            if np.max(np.abs(D[:3, 3])) > tolerance
        )

    def length(self) -> tuple[int, int]:
        """Return the number of changes, and of those of joint variables."""
        return len(self.changes), sum(change.change.concerns_joint for change in self.changes)

    @property
    def moves_zero(self) -> bool:
        """Whether a joint variable has another zero or the opposite sense."""
        return any(
            sense < 0 or (abs(wrapped(offset)) > SAME if kind == "R" else abs(offset) > SAME * self.truth.scale)
            for sense, offset, kind in zip(self.senses, self.offsets, self.truth.kinds, strict=True)
        )

    @cached_property
    def changes(self) -> tuple[FrameChange, ...]:
        """Changes of frames and joint variables."""
        # Lengths are compared as finely as arms are: a wrong number is not a choice of frames.
        tolerance = SAME * self.truth.scale
        changes = [change for i, D in enumerate(self.differences) for change in frame_changes(i, D, tolerance)]
        joints = zip(self.truth.kinds, self.senses, self.offsets, strict=True)
        for i, (kind, sense, offset) in enumerate(joints, start=1):
            changes += joint_changes(i, kind == "R", float(sense), float(offset), tolerance)
        return tuple(changes)


def _free(answer: TableArm, truth: TableArm) -> NDArray[np.bool_]:
    """Return which joints may have another zero, shape (n,): all but sliding ones that keep the file's own d."""
    slides = np.array([kind != "R" for kind in truth.kinds])
    return ~slides | (np.abs(answer.entries[:, 1] - truth.entries[:, 1]) > SAME)


def overlaid(answer: TableArm, truth: TableArm, strict: bool) -> Overlay | None:
    """Return the relation between two arms with the fewest changes; None if they are two different arms."""
    matching = _Matching(answer, truth, truth.scale)
    if not matching.links_agree:
        return None
    best = None
    for senses, B, offsets in matching.solutions(np.ones(0), np.eye(4), np.zeros(truth.n)):
        aligned = _align_ends(Overlay(truth, answer, senses, offsets, B))
        for overlay in (aligned, _slide_along_first_axis(aligned), matching.fit_ends(aligned)):
            if overlay is not None and overlay.holds() and overlay.allowed(strict):
                best = min(best or overlay, overlay, key=Overlay.length)
    return best


@dataclass(frozen=True, eq=False)
class _Matching:
    """Search for a rigid motion and joint values that map the axes of one arm, or their reverses, to another's.

    Axis after axis, Newton's method determines the rigid motion and the offsets of the preceding joints, from four
    starts a quarter turn apart.
    """

    answer: TableArm
    truth: TableArm
    scale: float

    @cached_property
    def own(self) -> Array:
        return self.answer.screws(np.zeros(self.answer.n), self.scale)

    @property
    def links_agree(self) -> bool:
        """Whether neighbouring axes have the same angle and common normal in both arms, whatever the senses."""
        invariants = [_invariants(arm.screws(np.zeros(arm.n), self.scale)) for arm in (self.answer, self.truth)]
        return bool(np.max(np.abs(invariants[0] - invariants[1]), initial=0.0) < SAME)

    def solutions(self, senses: Array, B: Array, offsets: Array) -> Iterator[tuple[Array, Array, Array]]:
        """Yield senses, motion and offsets that map all axes, given those that map the first few."""
        k = len(senses)
        if k == self.truth.n:
            yield senses, B, offsets
            return
        for sense in (1.0, -1.0):
            tried = np.append(senses, sense)
            for guess in self.guesses(k, B, offsets):
                solved = self.solve(tried, *guess)
                if solved is not None:
                    yield from self.solutions(tried, *solved)
                    break

    def guesses(self, k: int, B: Array, offsets: Array) -> Iterator[tuple[Array, Array]]:
        """Yield starts for axis k, from 0: four positions of the preceding joint."""
        if k == 0:
            for turn in (np.eye(4), *(_half_turn(axis) for axis in range(3)), *_quarter_turns()):
                yield turn @ B, offsets
            return
        for quarter in (0, 2, 1, -1):
            angle = quarter * np.pi / 2
            if self.truth.kinds[k - 1] != "R":
                yield B, offsets
                return
            if k == 1:
                screw = self.truth.screws(offsets, self.scale)[0]
                yield _exponential(screw * angle, self.scale) @ B, offsets
                continue
            turned = offsets.copy()
            turned[k - 1] += angle
            yield B, turned

    def solve(self, senses: Array, B: Array, offsets: Array) -> tuple[Array, Array] | None:
        """Return the rigid motion and offsets near a start that map the first axes; None if there are none."""
        k = len(senses)
        for _ in range(_MAX_STEPS):
            target = self.truth.screws(offsets, self.scale)[:k]
            moved = self.own[:k] @ _adjoint(B, self.scale).T
            gap = (moved - senses[:, None] * target).ravel()
            if not np.all(np.isfinite(gap)):
                return None
            if np.max(np.abs(gap)) < SAME / 100:
                return B, offsets
            joints = np.arange(1, k - 1)
            later = senses[:, None] * (np.arange(k) > joints[:, None])[..., None]
            later = later * _free(self.answer, self.truth)[1 : len(later) + 1, None, None]
            columns = np.concatenate([moved @ _BRACKETS, -(target @ np.tensordot(target[1:-1], _BRACKETS, 1)) * later])
            step = _newton_step(columns.reshape(len(columns), -1), gap)
            B = _exponential(step[:6], self.scale) @ B
            offsets = offsets.copy()
            offsets[1 : k - 1] += step[6:] * np.where([x == "R" for x in self.truth.kinds[1 : k - 1]], 1, self.scale)
        return None

    def fit_ends(self, overlay: Overlay) -> Overlay | None:
        """Move frames 0 and n to the file's, as far as the axes leave them free: joints on one line share an offset.

        Newton's method as in :meth:`solve`, for the two frames together with the axes; None if it does not converge.
        """
        ends = [_nearest_square(D) for D in overlay.differences[[0, -1]]]
        B = overlay.B
        offsets = overlay.offsets
        senses = overlay.senses[:, None]
        last = self.answer.frames(np.zeros(self.answer.n))[-1]
        later = (np.arange(self.truth.n) > np.arange(self.truth.n)[:, None])[..., None] * senses
        stroke = np.where([kind == "R" for kind in self.truth.kinds], 1, self.scale)
        free = _free(self.answer, self.truth)
        for _ in range(_MAX_STEPS):
            target = self.truth.screws(offsets, self.scale)
            moved = self.own @ _adjoint(B, self.scale).T
            given = _scaled(np.array([B, B @ last]), self.scale)
            wanted = _scaled(np.array([ends[0], self.truth.frames(offsets)[-1] @ ends[1]]), self.scale)
            gap = np.concatenate([(moved - senses * target).ravel(), (given - wanted).ravel()])
            if np.max(np.abs(gap)) < SAME / 100:
                return replace(overlay, B=B, offsets=offsets)
            turned = -(target @ np.tensordot(target, _BRACKETS, 1)) * later
            at_end = np.array([[0 * wanted[1], -_rate(screw) @ wanted[1]] for screw in target])
            turned = turned * free[:, None, None]
            at_end = at_end * free[:, None, None, None]
            whole = np.array([_rate(unit) @ given for unit in np.eye(6)])
            columns = np.vstack(
                [
                    np.hstack([(moved @ _BRACKETS).reshape(6, -1), whole.reshape(6, -1)]),
                    np.hstack([turned.reshape(len(turned), -1), at_end.reshape(len(turned), -1)]),
                ]
            )
            step = _newton_step(columns, gap)
            B = _exponential(step[:6], self.scale) @ B
            offsets = offsets + step[6:] * stroke
        return None


def _newton_step(columns: NDArray[np.floating[Any]], gap: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
    """Return the least-squares step that closes a gap, shape (k,), bounded by 1.5; columns has shape (k, len(gap))."""
    step: NDArray[np.floating[Any]] = -np.linalg.lstsq(columns.T, gap, rcond=1e-8)[0]
    step *= min(1.0, 1.5 / max(float(np.max(np.abs(step))), 1e-300))
    return step


def _nearest_square(D: Array) -> Array:
    """Return the nearest rotation by right angles without a translation, shape (4, 4); the identity if none is near."""
    square = np.eye(4)
    turned = np.rint(D[:3, :3])
    if np.array_equal(turned @ turned.T, np.eye(3)):
        square[:3, :3] = turned
    return square


def _scaled(T: Array, scale: float) -> Array:
    """Return transforms, shape (..., 4, 4), with lengths divided by a scale."""
    scaled = T.copy()
    scaled[..., :3, 3] /= scale
    return scaled


def _rate(screw: NDArray[np.floating[Any]]) -> Array:
    """Return the matrix of a screw, shape (4, 4): the derivative of a transform along it is the matrix times it."""
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
    first, last = (_joint_travel(screws[k], own[k], other[k], truth.scale) for k in (0, -1))
    offsets = overlay.offsets.copy()
    # Moving the first joint moves the whole arm: truth(q + o1) = exp(o1) truth(q).
    offsets[0] -= first
    offsets[-1] += last if n > 1 else 0.0
    return replace(overlay, offsets=offsets, B=_exponential(-screws[0] * first, 1.0) @ overlay.B)


def _slide_along_first_axis(overlay: Overlay) -> Overlay:
    """Move the answer along the first axis until frames n are level, which is free if all axes are parallel."""
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
        return float(moment @ (end[:3, 3] - start[:3, 3]))
    point = np.cross(axis, moment)
    levers = [_perpendicular_part(axis, T[:3, 3] - point) for T in (start, end)]
    if min(float(np.linalg.norm(lever)) for lever in levers) <= SAME * scale:
        levers = [_perpendicular_part(axis, T[:3, 0]) for T in (start, end)]
    a, b = levers
    return float(np.arctan2(axis @ np.cross(a, b), a @ b))


def _perpendicular_part(axis: Array, vector: Array) -> Array:
    """Return the part of a vector at right angles to a unit axis, shape (3,)."""
    return vector - (axis @ vector) * axis


def _invariants(screws: Array) -> Array:
    """Return invariants of neighbouring screws under motions and changes of sense, shape (n - 1, 3).

    The cosines of their angles, their distances times the sines and, for parallel ones, their distances.
    """
    first = screws[:-1]
    second = screws[1:]
    angle = np.sum(first[:, :3] * second[:, :3], axis=1)
    moment = np.sum(first[:, :3] * second[:, 3:] + first[:, 3:] * second[:, :3], axis=1)
    turning = np.any(first[:, :3], axis=1) & np.any(second[:, :3], axis=1)
    parallel = turning & (np.abs(np.abs(angle) - 1) < SAME)
    apart = np.linalg.norm(second[:, 3:] * np.sign(angle)[:, None] - first[:, 3:], axis=1)
    return np.stack([np.abs(angle), np.abs(moment), np.where(parallel, apart, 0)], axis=1)


def _brackets() -> Array:
    """Return the derivatives of screws, as rows, along each of the six unit screws, as matrices, shape (6, 6, 6)."""
    brackets = np.zeros((6, 6, 6))
    for k, unit in enumerate(np.eye(3)):
        crossed = _skew(unit).T
        brackets[k, :3, :3] = brackets[k, 3:, 3:] = brackets[k + 3, :3, 3:] = crossed
    return brackets


def _skew(p: NDArray[np.floating[Any]]) -> Array:
    return np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])


def _adjoint(T: Array, scale: float) -> Array:
    """Return the matrix that maps screws as a motion moves them, shape (6, 6)."""
    R = T[:3, :3]
    return np.block([[R, np.zeros((3, 3))], [_skew(T[:3, 3]) @ R / scale, R]])


def _exponential(screw: NDArray[np.floating[Any]], scale: float) -> Array:
    """Return the motion along a screw (angles in rad; lengths in m over the scale), shape (4, 4), m."""
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
    signs = np.full(4, -1.0)
    signs[[axis, 3]] = 1
    return np.diag(signs)


def _quarter_turns() -> list[Array]:
    units: Array = np.eye(6)
    return [_exponential(angle * unit, 1.0) for unit in units[:3] for angle in (np.pi / 2, -np.pi / 2)]


_BRACKETS = _brackets()
