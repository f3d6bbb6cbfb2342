"""Differences of two arms in words: axes, zero positions and bodies, joint by joint and link by link."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dhkit.description import Array, Description
from dhkit.description.frames import carrying, world_to_frames
from dhkit.model import PinocchioModel, pinocchio_model

_STEPS = 360
"""Number of angles tried for a zero position before the best is refined."""
_DIGITS = 6


def differences(description: Description, model: PinocchioModel, tolerance: float) -> Iterator[str]:
    """Yield sentences about the differences of a Pinocchio model from a description with as many joints.

    Axes are compared with all joints at zero. A joint whose zero position differs moves all axes after it. Bodies are
    compared if the axes agree.

    Parameters
    ----------
    description, model
        The two arms.
    tolerance
        Largest difference that counts as equal: of directions, positions over the reach, and masses and moments over
        the largest.
    """
    least = max(tolerance, 1e-9)
    reach = max(1.0, description.reach)
    ours = _screws(description)
    theirs = _model_screws(model)
    apart = [i for i in range(description.n) if _distance(ours[i], theirs[i], reach) > least]
    if apart:
        yield from _axes(description, ours, theirs, apart[0], reach, least)
    elif all(joint.bodies for joint in description.joints):
        yield from _bodies(description, pinocchio_model(description), model, least)


def _screws(description: Description) -> Array:
    """Return each joint's axis at zero as linear velocity of the world's origin and angular velocity, shape (n, 6)."""
    frames = list(world_to_frames(description, np.zeros(description.n)))
    screws = []
    for T, slides in zip(carrying(description.convention, frames), description.numbers.prismatic, strict=True):
        # (z; 0) for a prismatic joint, (p x z; z) for a revolute one.
        z = T[:3, 2]
        p = T[:3, 3]
        screws.append(np.concatenate([z, np.zeros(3)] if slides else [np.cross(p, z), z]))
    return np.array(screws)


def _model_screws(model: PinocchioModel) -> Array:
    import pinocchio as pin

    data = model.createData()
    J = pin.computeJointJacobians(model, data, np.zeros(model.nq))
    return np.reshape(np.array(J), (6, model.nv)).T


def _distance(a: Array, b: Array, reach: float) -> float:
    difference = np.abs(a - b)
    return float(max(difference[:3].max() / reach, difference[3:].max()))


def _axes(
    description: Description, ours: Array, theirs: Array, first: int, reach: float, least: float
) -> Iterator[str]:
    """Yield the difference of the first differing axis, or the zero position that explains all differing axes."""
    name = f"joint {first + 1} ({description.joints[first].name})"
    a = ours[first]
    b = theirs[first]
    direction = slice(0, 3) if description.numbers.prismatic[first] else slice(3, 6)
    cosine = float(np.clip(a[direction] @ b[direction], -1.0, 1.0))
    if _distance(a, -b, reach) <= least:
        yield f"{name} moves the other way in the URDF"
        return
    for k in reversed(range(first)):
        offset = _zero_offset(ours, theirs, k, reach) if not description.numbers.prismatic[k] else None
        if offset is not None and offset[1] <= max(least, 1e-7):
            degrees = np.degrees(offset[0])
            other = f"joint {k + 1} ({description.joints[k].name})"
            yield f"{other}: the URDF's zero is at {degrees:.{_DIGITS}g} degrees of the table's"
            return
    if abs(cosine) < 1 - least:
        turn = np.degrees(np.arccos(cosine))
        yield f"{name}: with all joints at zero its axis is turned by {turn:.{_DIGITS}g} degrees"
    else:
        gap = np.linalg.norm(a[:3] - np.sign(cosine) * b[:3])
        yield f"{name}: with all joints at zero its axis lies {gap:.{_DIGITS}g} m beside the table's"


def _zero_offset(ours: Array, theirs: Array, k: int, reach: float) -> tuple[float, float] | None:
    """Return the rotation about axis k, rad, that best aligns our later axes with theirs, and what remains."""
    from scipy.optimize import minimize_scalar

    def apart(angle: float) -> float:
        turned = _rotate_screws(ours[k], ours[k + 1 :], angle)
        return max(_distance(a, b, reach) for a, b in zip(turned, theirs[k + 1 :], strict=True))

    grid = np.linspace(-np.pi, np.pi, _STEPS)
    best = min(grid, key=apart)
    step = grid[1] - grid[0]
    found = minimize_scalar(apart, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-12})
    return float(found.x), float(found.fun)


def _rotate_screws(axis: Array, screws: Array, angle: float) -> Array:
    """Return screws, shape (k, 6), rotated about a revolute axis by an angle, rad."""
    from scipy.spatial.transform import Rotation

    # The axis (p x z; z) passes through p = z x (p x z). About it x goes to R x + p - R p, and a screw (v; w) to
    #     (R v + (p - R p) x R w;  R w).
    z = axis[3:]
    point = np.cross(z, axis[:3])
    R = Rotation.from_rotvec(angle * z).as_matrix()
    p = point - R @ point
    omega = screws[:, 3:] @ R.T
    return np.concatenate([screws[:, :3] @ R.T + np.cross(p, omega), omega], axis=1)


def _bodies(description: Description, table: PinocchioModel, urdf: PinocchioModel, least: float) -> Iterator[str]:
    """Yield a sentence for each difference of masses, centres of mass and inertias."""
    reach = max(1.0, description.reach)
    pairs = list(zip(_world_bodies(table), _world_bodies(urdf), strict=True))
    heaviest = max(max(a[0], b[0]) for a, b in pairs) or 1.0
    largest = max(np.abs(a[2]).max() for a, _ in pairs) or 1.0
    for i, ((mass, com, inertia), (other, other_com, other_inertia)) in enumerate(pairs):
        name = f"link {i + 1} ({description.joints[i].name})"
        if abs(mass - other) > least * heaviest:
            yield f"{name}: mass is {other:.{_DIGITS}g} kg in the URDF, {mass:.{_DIGITS}g} kg in the table"
        elif mass > 0 and (gap := np.linalg.norm(com - other_com)) > least * reach:
            yield f"{name}: the centres of mass are {gap:.{_DIGITS}g} m apart"
        if (gap := np.abs(inertia - other_inertia).max()) > least * max(largest, 1e-6):
            yield f"{name}: the inertias about the centre of mass differ by up to {gap:.{_DIGITS}g} kg m^2"


def _world_bodies(model: PinocchioModel) -> list[tuple[float, Array, Array]]:
    """Return mass, centre of mass and inertia about it of each link, in world axes, with all joints at zero."""
    import pinocchio as pin

    data = model.createData()
    pin.forwardKinematics(model, data, np.zeros(model.nq))
    bodies = []
    for i in range(1, model.njoints):
        body = model.inertias[i]
        R = data.oMi[i].rotation
        bodies.append((float(body.mass), data.oMi[i].act(body.lever), R @ body.inertia @ R.T))
    return bodies
