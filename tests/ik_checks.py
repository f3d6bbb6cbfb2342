"""What the tests of inverse kinematics share: closure, measures read off the frames, differences of angles."""

from __future__ import annotations

import numpy as np

from dhkit.description import (
    Convention,
    Description,
    from_dh,
    library_robot,
    world_to_frames,
    world_to_tool,
)
from dhkit.kinematics import IKSolutions, forward_kinematics

FAMILY_A = (
    "puma560",
    "puma560_akb",
    "puma560_cao",
    "puma560_cao_printed",
    "irb140",
    "kr5",
    "kuka_kr30_3",
    "adept_viper_s850",
)
FAMILY_B = ("ur3", "ur5", "ur10")
SIX_JOINTS = (*FAMILY_A, *FAMILY_B, "stanford")
FEW_JOINTS = (
    "cobra600",
    "planar2r",
    "planar3r",
    "polar_rp",
    "cart_pendulum",
    "pan_tilt",
    "ax12_arm",
    "al5d",
)
FIVE_JOINTS = {
    "scorbot": from_dh(
        [[0, 349, 16, -90], [0, 0, 221, 0], [0, 0, 221, 0], [90, 0, 0, 90], [0, 145, 0, 0]],
        name="scorbot",
        length="mm",
        angle="deg",
    )
}


def robot(name: str) -> Description:
    """Return a robot of the library, or of ``FIVE_JOINTS``."""
    return FIVE_JOINTS[name] if name in FIVE_JOINTS else library_robot(name)


def closure(
    arm: Description, solutions: IKSolutions, T: np.ndarray, fk=forward_kinematics
) -> float:
    """Return the worst error of forward kinematics of all returned branches, lengths over the reach.

    For one arm of many take ``fk=world_to_tool``: it needs no kernel of the arm's own.
    """
    count = solutions.valid.sum()
    if not count:
        return 0.0
    poses = np.broadcast_to(T[..., None, :, :], (*solutions.valid.shape, 4, 4))[solutions.valid]
    error = np.abs(fk(arm, solutions.q[solutions.valid]) - poses)[:, :3]
    error[..., 3] /= arm.reach or 1.0
    if solutions.met[0] == "azimuth":
        return aim(arm, solutions.q[solutions.valid], poses[:, :3, 3])
    return float(error.max() if len(solutions.met) == 6 else error[..., 3].max())


def aim(arm: Description, q: np.ndarray, targets: np.ndarray) -> float:
    """Return the worst angle by which a pan and tilt misses targets, seen from the foot of its tool on axis 2."""
    z, p, _ = axes_of(arm, q)
    axis, point, tool = z[:, 1], p[:, 1], world_to_tool(arm, q)[:, :3, 3]

    def across(x: np.ndarray) -> np.ndarray:
        v = x - point - np.sum((x - point) * axis, axis=-1, keepdims=True) * axis
        return v / np.linalg.norm(v, axis=-1, keepdims=True)

    return float(np.linalg.norm(across(tool) - across(targets), axis=-1).max())


def gaps(arm: Description, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the largest difference of joint vectors (..., n), angles modulo whole turns, slides over the reach."""
    difference = np.abs(a - b)
    turned = np.abs(np.remainder(a - b + np.pi, 2 * np.pi) - np.pi)
    return np.where(arm.numbers.prismatic, difference / (arm.reach or 1.0), turned).max(axis=-1)


def axes_of(arm: Description, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return directions (N, n, 3) and points (N, n, 3) of the axes, and the frames' origins (N, n + 1, 3)."""
    T = world_to_frames(arm, q)
    shift = 0 if arm.convention is Convention.STANDARD else 1
    carrying = T[:, shift : shift + arm.n]
    return carrying[..., :3, 2], carrying[..., :3, 3], T[..., :3, 3]


def sine_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.cross(a, b), axis=-1)


def bend(axis: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return the absolute sine of the angle at b from a to c, seen along an axis."""

    def across(v: np.ndarray) -> np.ndarray:
        v = v - np.sum(v * axis, axis=-1, keepdims=True) * axis
        return v / np.linalg.norm(v, axis=-1, keepdims=True)

    return sine_between(across(b - a), across(c - b))


def measures(arm: Description, q: np.ndarray) -> dict[str, np.ndarray]:
    """Return |sin wrist|, |sin elbow| (or the boom's length over the reach) and the wrist's distance from axis 1."""
    z, p, origins = axes_of(arm, q)
    if arm.name in FAMILY_B:
        centre, end, wrist = origins[:, 5], p[:, 3], sine_between(z[:, 3], z[:, 5])
    else:
        centre, wrist = origins[:, 4], sine_between(z[:, 3], z[:, 5])
        end = centre
    if arm.name == "stanford":
        boom = centre - p[:, 1]
        elbow = np.abs(np.sum(boom * z[:, 2], axis=-1)) / arm.reach
    else:
        elbow = bend(z[:, 1], p[:, 1], p[:, 2], end)
    radial = sine_between(z[:, 0], centre - p[:, 0]) / arm.reach
    return {"wrist": wrist, "elbow": elbow, "shoulder": radial}


def along_plane(arm: Description, q: np.ndarray) -> np.ndarray:
    """Return how far the wrist is from axis 1 along the arm's plane, over the reach: 0 where both shoulders are one."""
    z, p, origins = axes_of(arm, q)
    lever = (origins[:, 5] if arm.name in FAMILY_B else origins[:, 4]) - p[:, 0]
    return np.abs(np.sum(np.cross(z[:, 0], z[:, 1]) * lever, axis=-1)) / arm.reach
