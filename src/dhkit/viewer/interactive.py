"""What a page without Python needs to know: the arm, its table and its motions as numbers and text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control import SimulationResult
from dhkit.description import Array, Description
from dhkit.kinematics import classify
from dhkit.trajectories import Trajectory
from dhkit.viewer.motion import Motion, check_motion, exceeded_limit, played_motion
from dhkit.viewer.scene import frame_labels

if TYPE_CHECKING:
    from numpy.typing import NDArray

COLUMNS = ("theta", "d", "a", "alpha")
RATE = 30.0
"""Samples a second of a motion in a page, which draws straight lines between them."""
MIN_SAMPLES, MAX_SAMPLES = 121, 6001
CHECKED = 4_001
"""Samples of a trajectory at which its limits are looked at."""
DIGITS = 6
"""Of joint values in a page: 1e-6 rad are 6 um on an arm of 6 m."""


def listed(array: Array | None) -> list[Any] | None:
    """Return an array as JSON has it: infinities and NaN are null."""
    if array is None:
        return None
    return [listed(row) if np.ndim(row) else (float(row) if np.isfinite(row) else None) for row in array]


def table_texts(description: Description) -> tuple[tuple[str, ...], ...]:
    """Return theta, d, a and alpha of each row as the robot file has them."""
    return tuple(tuple(str(getattr(joint, name)) for name in COLUMNS) for joint in description.joints)


def limits_state(description: Description) -> dict[str, Any]:
    """Return the limits of the joints by name, null where there is none."""
    numbers = description.numbers
    return {name: listed(getattr(numbers, name)) for name in ("lower", "upper", "velocity", "effort")}


def arm_state(description: Description, *, assumed_bodies: bool = False) -> dict[str, Any]:
    """Return what panels know of an arm: joints with limits, configurations by name, family, reach."""
    limits, numbers = limits_state(description), description.numbers
    fit = classify(description)
    named = {"zero": np.zeros(description.n)} | dict(numbers.configurations)
    return {
        "name": description.name,
        "n": description.n,
        "joints": [
            {"name": joint.name, "unit": "rad" if joint.is_revolute else "m"}
            | {name: values[i] for name, values in limits.items()}
            for i, joint in enumerate(description.joints)
        ],
        "configurations": [*named, *([] if "random" in named else ["random"])],
        "named": {name: q.tolist() for name, q in named.items()},
        "family": fit.words,
        "closed_form": fit.fit is not None,
        "bodies": all(joint.bodies for joint in description.joints),
        "assumed_bodies": assumed_bodies,
        "parameters": list(numbers.values),
        "reach": description.reach,
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
    """Return what ``static/offline/desk.js`` reads.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values that the page begins with, shape (n,), rad and m.
    motions
        By the name that the page gives them.
    caption
        Paragraphs, one a line.
    links
        Addresses by the text that leads there.
    ghosts, overlays
        Names and colors (``#rrggbb``) of what is drawn beside the arm.
    """
    numbers, limits = description.numbers, limits_state(description)
    rows = [
        {"kind": "R" if joint.is_revolute else "P", "lower": limits["lower"][i], "upper": limits["upper"][i]}
        | {name: float(getattr(numbers, name)[i]) for name in COLUMNS}
        for i, joint in enumerate(description.joints)
    ]
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
        "labels": [{"frame": label.frame, "text": label.text} for label in frame_labels(description)],
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
    excess = _exceeded(description, motion)
    grid = np.linspace(0.0, times[-1], int(np.clip(math.ceil(RATE * times[-1]) + 1, MIN_SAMPLES, MAX_SAMPLES)))
    tau: Array | None = None
    if isinstance(motion, Trajectory):
        qd = motion.qd(grid)
        tau = motion.tau(grid) if all(joint.bodies for joint in description.joints) else None
    elif isinstance(motion, SimulationResult):
        qd, tau = _at(grid, motion.t, motion.qd), _at(grid, motion.t, motion.tau)
    else:
        qd = np.gradient(_at(grid, times, q), grid, axis=0)
    q = _at(grid, times, q)
    return {
        "name": name,
        "duration": float(grid[-1]),
        "times": grid.tolist(),
        "q": _rounded(q),
        "qd": _rounded(qd),
        "tau": None if tau is None else _rounded(tau),
        "reference": None if reference_q is None else _rounded(_at(grid, times, reference_q)),
        "limits": limits_state(description),
        "touching": None,
        "excess": excess,
        "step": float(grid[1]) if len(grid) == MAX_SAMPLES else None,
    }


def _exceeded(description: Description, motion: Motion) -> str | None:
    """Return the limit that a motion exceeds most, at its own samples, which a page may have fewer of."""
    if isinstance(motion, Trajectory):
        times = np.linspace(0.0, motion.duration, CHECKED)
        bodies = all(joint.bodies for joint in description.joints)
        return exceeded_limit(description, motion.q(times), motion.qd(times), motion.tau(times) if bodies else None)
    if isinstance(motion, SimulationResult):
        return exceeded_limit(description, motion.q, motion.qd, motion.tau)
    times, q = check_motion(description, *motion)
    return exceeded_limit(description, q, np.gradient(q, times, axis=0), None)


def _at(grid: Array, times: Array, rows: Array) -> Array:
    """Return rows, shape (N, n), at times of a grid that begins at 0."""
    return np.stack([np.interp(grid + times[0], times, column) for column in rows.T], axis=1)


def _rounded(values: NDArray[Any]) -> Any:
    return np.round(values, DIGITS).tolist()
