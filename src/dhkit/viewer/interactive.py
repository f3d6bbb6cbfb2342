"""Data for pages: the arm, its table and its motions as numbers and text, which a page without Python reads too."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control import SimulationResult
from dhkit.description import Array, Description
from dhkit.kinematics import classify
from dhkit.trajectories import Trajectory
from dhkit.viewer.motion import Motion, check_motion, exceeded_limit, interpolate, played_motion
from dhkit.viewer.scene import frame_labels

COLUMNS = ("theta", "d", "a", "alpha")
_SAMPLE_RATE = 30.0
"""Samples per second of a motion in a page, Hz; the page draws straight lines between them."""
_MIN_SAMPLES = 121
_MAX_SAMPLES = 6001
_LIMIT_SAMPLES = 4_001
"""Samples of a trajectory at which its limits are checked."""
_DIGITS = 6
"""Decimals of joint values in a page: 1e-6 rad are 6 um on an arm of 6 m."""


def listed(array: Array | None) -> list[Any] | None:
    """Return an array of any shape as nested lists for JSON, in which infinity and NaN are null."""
    if array is None:
        return None
    if array.ndim > 1:
        return [listed(row) for row in array]
    return [float(entry) if np.isfinite(entry) else None for entry in array]


def table_texts(description: Description) -> tuple[tuple[str, ...], ...]:
    """Return theta, d, a and alpha of each row as the robot file writes them."""
    rows = []
    for joint in description.joints:
        row = tuple(str(getattr(joint, name)) for name in COLUMNS)
        rows.append(row)
    return tuple(rows)


def limits_state(description: Description) -> dict[str, Any]:
    """Return the limits of the joints by name, null where there is none."""
    numbers = description.numbers
    return {
        name: listed(getattr(numbers, name)) for name in ("lower", "upper", "velocity", "effort")
    }


def arm_state(description: Description, *, assumed_bodies: bool = False) -> dict[str, object]:
    """Return an arm's values for panels: joints with limits, configurations by name, family, reach (m)."""
    limits = limits_state(description)
    numbers = description.numbers
    fit = classify(description)
    configurations = numbers.configurations
    joints = []
    for i, joint in enumerate(description.joints):
        state = {"name": joint.name, "unit": "rad" if joint.is_revolute else "m"}
        joints.append(state | {name: values[i] for name, values in limits.items()})
    return {
        "name": description.name,
        "n": description.n,
        "joints": joints,
        "configurations": [*configurations, *([] if "random" in configurations else ["random"])],
        "named": {name: q.tolist() for name, q in configurations.items()},
        "family": fit.words,
        "closed_form": fit.fit is not None,
        "bodies": all(joint.bodies for joint in description.joints),
        "assumed_bodies": assumed_bodies,
        "parameters": list(numbers.values),
        "reach": description.reach,
        "length": description.units.length,
    }


def interactive_data(
    description: Description,
    q: ArrayLike,
    motions: Mapping[str, Motion],
    *,
    caption: str,
    links: Mapping[str, str],
    ghosts: Sequence[tuple[str, str]],
    overlays: Sequence[tuple[str, str]],
) -> dict[str, Any]:
    """Return the data that ``static/offline/desk.js`` reads.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values at the beginning, shape (n,), rad and m.
    motions
        Motions, by the names that the page gives them.
    caption
        Text about the page: paragraphs, one a line.
    links
        Addresses of further pages, by the texts that lead there.
    ghosts, overlays
        Names and colors (``#rrggbb``) of ghosts, and of other things that are drawn beside the arm.
    """
    numbers = description.numbers
    limits = limits_state(description)
    rows = []
    for i, joint in enumerate(description.joints):
        row = {
            "kind": "R" if joint.is_revolute else "P",
            "lower": limits["lower"][i],
            "upper": limits["upper"][i],
        }
        rows.append(row | {name: float(getattr(numbers, name)[i]) for name in COLUMNS})
    return {
        "arm": arm_state(description),
        "q": np.asarray(q, dtype=float).tolist(),
        "table": {
            "convention": description.convention.value,
            "texts": table_texts(description),
            "rows": rows,
            "base": numbers.T_world_base.ravel().tolist(),
            "tool": numbers.T_last_tool.ravel().tolist(),
        },
        "parameters": numbers.values,
        "labels": [
            {"frame": label.frame, "text": label.text} for label in frame_labels(description)
        ],
        "motions": [_motion_state(description, name, motion) for name, motion in motions.items()],
        "about": {
            "caption": caption,
            "source": description.source,
            "links": [{"text": text, "href": address} for text, address in links.items()],
            "ghosts": [{"text": text, "color": color} for text, color in ghosts],
            "overlays": [{"text": text, "color": color} for text, color in overlays],
        },
    }


def _motion_state(description: Description, name: str, motion: Motion) -> dict[str, Any]:
    """Return a motion at equal steps of time, with rates and torques where they are known."""
    times, q, reference_q = played_motion(description, motion)
    count = int(np.clip(math.ceil(_SAMPLE_RATE * times[-1]) + 1, _MIN_SAMPLES, _MAX_SAMPLES))
    grid = np.linspace(0.0, times[-1], count)
    sampled_q = interpolate(times, q, grid)
    tau: Array | None = None
    # Limits are checked at the motion's own samples, of which the page may have fewer.
    if isinstance(motion, Trajectory):
        checked = np.linspace(0.0, motion.duration, _LIMIT_SAMPLES)
        has_bodies = all(joint.bodies for joint in description.joints)
        qd = motion.qd(grid)
        tau = motion.tau(grid) if has_bodies else None
        checked_tau = motion.tau(checked) if has_bodies else None
        excess = exceeded_limit(description, motion.q(checked), motion.qd(checked), checked_tau)
    elif isinstance(motion, SimulationResult):
        qd, tau = (
            interpolate(motion.t, rows, grid + motion.t[0]) for rows in (motion.qd, motion.tau)
        )
        excess = exceeded_limit(description, motion.q, motion.qd, motion.tau)
    else:
        qd = np.gradient(sampled_q, grid, axis=0)
        given_times, given_q = check_motion(description, *motion)
        excess = exceeded_limit(
            description, given_q, np.gradient(given_q, given_times, axis=0), None
        )
    return {
        "name": name,
        "duration": float(grid[-1]),
        "times": grid.tolist(),
        "q": _rounded(sampled_q),
        "qd": _rounded(qd),
        "tau": None if tau is None else _rounded(tau),
        "reference": None
        if reference_q is None
        else _rounded(interpolate(times, reference_q, grid)),
        "limits": limits_state(description),
        "contacts": None,
        "excess": excess,
        "step": float(grid[1]) if len(grid) == _MAX_SAMPLES else None,
    }


def _rounded(values: Array) -> list[list[float]]:
    rounded: list[list[float]] = np.round(values, _DIGITS).tolist()
    return rounded
