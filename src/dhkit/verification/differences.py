"""Differences of two arms in words: axes, zero positions and bodies, joint by joint and link by link."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dhkit.description import Array, Description
from dhkit.description.frames import carrying, world_to_frames
from dhkit.model import PinocchioModel, pinocchio_model

_STEPS = 360
"""Number of angles tried for a zero position before the best is refined."""
_DIGITS = 6
"""Number of significant digits in sentences."""


def differences(description: Description, model: PinocchioModel, tolerance: float) -> Iterator[str]:
    """Yield sentences about the differences of a Pinocchio model from a description with as many joints.

    Axes are compared with all joints at zero. A joint whose zero position differs moves all axes after it. Bodies are
    compared if the axes agree.

    Parameters
    ----------
    description, model
        The two arms.
    tolerance
        Largest difference that counts as equal: of directions, of positions as shares of the reach, and of masses and
        moments as shares of the largest.
    """
    tolerance = max(tolerance, 1e-9)
    reach = max(1.0, description.reach)
    ours = _screws(description)
    theirs = _model_screws(model)
    different = [
        i for i in range(description.n) if _distance(ours[i], theirs[i], reach) > tolerance
    ]
    if different:
        yield from _axes(description, ours, theirs, different[0], reach, tolerance)
    elif all(joint.bodies for joint in description.joints):
        yield from _bodies(description, pinocchio_model(description), model, tolerance)


def _screws(description: Description) -> Array:
    """Return each joint's axis at zero as linear velocity of the world's origin and angular velocity, shape (n, 6)."""
    frames = list(world_to_frames(description, np.zeros(description.n)))
    screws = []
    for T, is_prismatic in zip(
        carrying(description.convention, frames), description.numbers.prismatic, strict=True
    ):
        z = T[:3, 2]
        p = T[:3, 3]
        # Prismatic: (z; 0). Revolute, about z through p: (p x z; z).
        screws.append(np.concatenate([z, np.zeros(3)] if is_prismatic else [np.cross(p, z), z]))
    return np.array(screws)


def _model_screws(model: PinocchioModel) -> Array:
    """Return the axes of a Pinocchio model, as :func:`_screws` does those of a description."""
    import pinocchio as pin

    data = model.createData()
    J = pin.computeJointJacobians(model, data, np.zeros(model.nq))
    return np.reshape(np.array(J), (6, model.nv)).T


def _distance(a: Array, b: Array, reach: float) -> float:
    """Return the largest difference of two screws, linear velocities as shares of the reach."""
    difference = np.abs(a - b)
    return float(max(difference[:3].max() / reach, difference[3:].max()))


def _axes(
    description: Description, ours: Array, theirs: Array, first: int, reach: float, tolerance: float
) -> Iterator[str]:
    """Yield the difference of the first differing axis, or the zero position that explains all differing axes."""
    name = f"joint {first + 1} ({description.joints[first].name})"
    a = ours[first]
    b = theirs[first]
    if _distance(a, -b, reach) <= tolerance:
        yield f"{name} moves the other way in the URDF"
        return

    # Another zero position of an earlier joint turns all axes after it.
    for k in reversed(range(first)):
        if description.numbers.prismatic[k]:
            continue
        angle, residual = _zero_offset(ours, theirs, k, reach)
        if residual <= max(tolerance, 1e-7):
            degrees = np.degrees(angle)
            other = f"joint {k + 1} ({description.joints[k].name})"
            yield f"{other}: the URDF's zero is at {degrees:.{_DIGITS}g} degrees of the table's"
            return

    direction = slice(0, 3) if description.numbers.prismatic[first] else slice(3, 6)
    cosine = float(np.clip(a[direction] @ b[direction], -1.0, 1.0))
    if abs(cosine) < 1 - tolerance:
        turn = np.degrees(np.arccos(cosine))
        yield f"{name}: with all joints at zero its axis is turned by {turn:.{_DIGITS}g} degrees"
    else:
        # The distance of parallel axes, from p x z.
        gap = np.linalg.norm(a[:3] - np.sign(cosine) * b[:3])
        yield f"{name}: with all joints at zero its axis lies {gap:.{_DIGITS}g} m beside the table's"


def _zero_offset(ours: Array, theirs: Array, k: int, reach: float) -> tuple[float, float]:
    """Return the rotation about axis k, rad, that best aligns our later axes with theirs, and the distance left."""
    from scipy.optimize import minimize_scalar

    def distance(angle: float) -> float:
        rotated = _rotate_screws(ours[k], ours[k + 1 :], angle)
        return max(_distance(a, b, reach) for a, b in zip(rotated, theirs[k + 1 :], strict=True))

    grid = np.linspace(-np.pi, np.pi, _STEPS)
    best = min(grid, key=distance)
    step = grid[1] - grid[0]
    found = minimize_scalar(
        distance, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-12}
    )
    return float(found.x), float(found.fun)


def _rotate_screws(axis: Array, screws: Array, angle: float) -> Array:
    """Return screws, shape (k, 6), rotated about a revolute axis by an angle, rad."""
    from scipy.spatial.transform import Rotation

    # The axis is (point x z; z), with the point that is nearest to the origin: z x (point x z) = point.
    z = axis[3:]
    point = np.cross(z, axis[:3])

    # The motion x -> R x + p leaves the point in place. A screw (v; w) becomes (R v + p x R w; R w).
    R = Rotation.from_rotvec(angle * z).as_matrix()
    p = point - R @ point
    w = screws[:, 3:] @ R.T
    v = screws[:, :3] @ R.T + np.cross(p, w)
    return np.concatenate([v, w], axis=1)


class _WorldBody(NamedTuple):
    """A link's body in world axes."""

    mass: float
    """kg."""
    com: Array
    """Centre of mass in the world, shape (3,), m."""
    inertia: Array
    """Inertia about the centre of mass, shape (3, 3), kg m^2."""


def _bodies(
    description: Description, table: PinocchioModel, urdf: PinocchioModel, tolerance: float
) -> Iterator[str]:
    """Yield a sentence for each difference of masses, centres of mass and inertias."""
    reach = max(1.0, description.reach)
    pairs = list(zip(_world_bodies(table), _world_bodies(urdf), strict=True))
    largest_mass = max(max(ours.mass, theirs.mass) for ours, theirs in pairs) or 1.0
    largest_inertia = max(np.abs(ours.inertia).max() for ours, _ in pairs) or 1.0
    for i, (ours, theirs) in enumerate(pairs):
        name = f"link {i + 1} ({description.joints[i].name})"
        com_gap = np.linalg.norm(ours.com - theirs.com)
        if abs(ours.mass - theirs.mass) > tolerance * largest_mass:
            yield f"{name}: mass is {theirs.mass:.{_DIGITS}g} kg in the URDF, {ours.mass:.{_DIGITS}g} kg in the table"
        elif ours.mass > 0 and com_gap > tolerance * reach:
            yield f"{name}: the centres of mass are {com_gap:.{_DIGITS}g} m apart"

        inertia_gap = np.abs(ours.inertia - theirs.inertia).max()
        if inertia_gap > tolerance * max(largest_inertia, 1e-6):
            yield f"{name}: the inertias about the centre of mass differ by up to {inertia_gap:.{_DIGITS}g} kg m^2"


def _world_bodies(model: PinocchioModel) -> list[_WorldBody]:
    """Return the body of each link with all joints at zero."""
    import pinocchio as pin

    data = model.createData()
    pin.forwardKinematics(model, data, np.zeros(model.nq))
    bodies = []
    for i in range(1, model.njoints):
        body = model.inertias[i]
        R = data.oMi[i].rotation
        com = data.oMi[i].act(body.lever)
        inertia = R @ body.inertia @ R.T
        bodies.append(_WorldBody(float(body.mass), com, inertia))
    return bodies
