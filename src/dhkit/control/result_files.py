"""Files of simulations: .npz and .mat hold all arrays and the robot, .csv one line for each state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.control.result import EnergyAudit, SimulationResult
from dhkit.description import Array, Description, write_atomically
from dhkit.errors import DescriptionError
from dhkit.trajectories.archives import ARCHIVES, archive_bytes, read_archive
from dhkit.trajectories.labels import FileKind, checked_suffix, decoded
from dhkit.trajectories.tables import read_table, table_text

SUFFIXES = (*ARCHIVES, ".csv")
ROWS = ("q", "qd", "qdd", "tau", "tau_asked", "reference_q", "reference_qd")
"""Names of the arrays of shape (N+1, n), in the order of a table's columns."""
POSES = "reference_poses"
"""Name of the array of the reference's poses, stored if they are not those of the arm that moved."""
ENERGIES = tuple(field.name for field in fields(EnergyAudit))
AUDIT = "audit_"
SATURATED = "saturated"
"""Prefix of the names of the energy balance's numbers, and name of the shares of saturation."""
COMMENTS_LENGTH = 10_000
"""Number of characters of a table that are searched for comments: enough for 40 named numbers of 25 characters."""
SIMULATION = FileKind(
    "simulation",
    arrays=("t", *ROWS, SATURATED, POSES, *(f"{AUDIT}{name}" for name in ENERGIES)),
    most=500_000_000,  # 1.4 million states of six joints
)


def save_result(result: SimulationResult, path: str | Path) -> Path:
    """Write a simulation to a file, whole or not at all, and return its path.

    Parameters
    ----------
    result
        The simulation.
    path
        The suffix decides. ``.npz`` and ``.mat`` hold the arrays ``t, q, qd, qdd, tau, tau_asked, reference_q,
        reference_qd, saturated``, the numbers ``audit_change`` ... and the robot. ``.csv`` holds the columns ``t, q1
        ..., qd1 ..., qdd1 ..., tau1 ..., tau_asked1 ..., reference_q1 ..., reference_qd1 ...``, and in comments the
        robot's name and digest, the audit and the shares of saturation. Units are SI and radians.

    Raises
    ------
    ValueError
        Another suffix, more than 500 MB, or a result that :func:`load_result` would refuse: not finite, or arrays
        that do not fit together.
    OSError
        The file cannot be written.
    """
    path = Path(path)
    suffix = checked_suffix(path, SUFFIXES)
    values = {name: getattr(result, name) for name in ("t", *ROWS, SATURATED, POSES)}
    values |= {f"{AUDIT}{name}": np.float64(value) for name, value in asdict(result.audit).items()}
    _checked_arrays(values, result.description.n)
    if suffix == ".csv":
        if len(result.reference_poses):
            raise ValueError(
                f"{path}: a table has no room for the reference's poses of another arm; expected .npz or .mat"
            )
        content = SIMULATION.labelled(result.description, _csv(values)).encode()
    else:
        content = archive_bytes(suffix, SIMULATION.archived(result.description, values))
    if len(content) > SIMULATION.most:
        raise ValueError(
            f"{path}: {len(content) / 1e6:.0f} MB; expected at most {SIMULATION.most / 1e6:g} MB"
        )
    write_atomically(path, content)
    return path


def load_result(path: str | Path, description: Description | None = None) -> SimulationResult:
    """Read a simulation that :func:`save_result` wrote; all formats give the same numbers to the last bit.

    Parameters
    ----------
    path
        The file. It may come from anywhere: nothing in it is executed, and at most 500 MB are read.
    description
        The robot. If not given, the one named in the file: from the library, or for an archive the one that it holds.

    Raises
    ------
    DescriptionError
        In one line: the file cannot be read, is damaged, is not a simulation, or is one of another robot.
    """
    path = Path(path)
    suffix, content = SIMULATION.read(path, SUFFIXES)
    try:
        if suffix == ".csv":
            text = decoded(content)
            robot = SIMULATION.robot_of_table(text, description)
            checked = _checked_arrays(_csv_values(text, robot.n), robot.n)
            SIMULATION.require_unchanged(text)
        else:
            values = read_archive(suffix, content, SIMULATION)
            robot = SIMULATION.robot_of_archive(values, description)
            checked = _checked_arrays(values, robot.n)
            SIMULATION.require_whole(values)
    except (DescriptionError, ValueError) as error:
        raise DescriptionError(f"{path}: {error}") from None
    audit = EnergyAudit(**{name: float(checked[f"{AUDIT}{name}"]) for name in ENERGIES})
    arrays: dict[str, Any] = {name: checked[name] for name in ("t", *ROWS, SATURATED, POSES)}
    return SimulationResult(robot, audit=audit, **arrays)


def _checked_arrays(values: Mapping[str, Any], n: int) -> dict[str, Array]:
    """Return a simulation's arrays by name, in their shapes.

    Raises
    ------
    ValueError
        Shapes that do not fit together, a number that is not finite, times that do not begin with 0 and increase, or
        shares that are not from 0 to 1; names the array.
    """
    states = int(np.size(values["t"]))
    if not states:
        raise ValueError("t has no values; expected one state or more")
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(SIMULATION.arrays, ())
    shapes |= dict.fromkeys(ROWS, (states, n))
    shapes |= {"t": (states,), SATURATED: (n,) if np.size(values[SATURATED]) else (0,)}
    shapes[POSES] = (states, 12) if np.size(values[POSES]) else (0, 12)
    arrays = {
        name: _shaped(name, np.asarray(values[name], dtype=float), shape)
        for name, shape in shapes.items()
    }
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            row = (
                f", the first in row {int(np.argwhere(~np.isfinite(array))[0, 0])}"
                if array.ndim
                else ""
            )
            raise ValueError(f"{name} has values that are not finite{row}")
    t = arrays["t"]
    shares = arrays[SATURATED]
    if arrays[f"{AUDIT}turnover"] < 0:
        raise ValueError(
            f"{AUDIT}turnover is {float(arrays[f'{AUDIT}turnover']):g}; expected 0 or more"
        )
    if t[0] != 0:
        raise ValueError(f"t begins with {t[0]:g} s; expected 0")
    if (np.diff(t) <= 0).any():
        k = int(np.flatnonzero(np.diff(t) <= 0)[0])
        raise ValueError(f"t does not increase: t[{k}] is {t[k]:g} s, t[{k + 1}] is {t[k + 1]:g} s")
    if ((shares < 0) | (shares > 1)).any():
        raise ValueError(f"{SATURATED} is {shares.tolist()}; expected shares from 0 to 1")
    return arrays


def _shaped(name: str, array: Array, shape: tuple[int, ...]) -> Array:
    """Return an array in a shape from which it differs at most by axes that MATLAB adds, of length 1 or empty."""
    empty = array.size == 0 and 0 in shape
    if not empty and [length for length in array.shape if length != 1] != [
        length for length in shape if length != 1
    ]:
        raise ValueError(f"{name} has shape {array.shape}; expected {shape}")
    return array.reshape(shape)


def _columns(n: int) -> tuple[str, ...]:
    columns = ["t"]
    for name in ROWS:
        columns += [f"{name}{i}" for i in range(1, n + 1)]
    return tuple(columns)


def _csv(values: Mapping[str, Array]) -> str:
    n = values["q"].shape[1]
    numbers = [SATURATED, *(f"{AUDIT}{name}" for name in ENERGIES)]
    comments = []
    for name in numbers:
        texts = [f"{x:.17g}" for x in np.atleast_1d(values[name])]
        comments.append(f"{name}: {' '.join(texts)}")
    rows = np.concatenate([values["t"][:, None], *(values[name] for name in ROWS)], axis=1)
    return table_text(_columns(n), rows, tuple(comments))


def _csv_values(text: str, n: int) -> dict[str, Any]:
    names, table = read_table(text)
    expected = _columns(n)
    if names != expected:
        raise DescriptionError(
            f"columns {', '.join(names)[:80]}; expected {', '.join(expected)[:200]}"
        )
    values = dict(zip(ROWS, np.split(table[:, 1:], len(ROWS), axis=1), strict=True)) | {
        "t": table[:, 0]
    }
    values[POSES] = np.zeros((0, 12))
    return values | _comment_values(text)


def _comment_values(text: str) -> dict[str, Array]:
    """Return the named numbers in the comments at the head of a table."""
    lines = takewhile(lambda line: line.startswith("#"), text[:COMMENTS_LENGTH].splitlines())
    stated = {}
    for line in lines:
        name, _, numbers = line.removeprefix("# ").partition(":")
        stated[name] = numbers
    values = {}
    for name in (name for name in SIMULATION.arrays if name not in ("t", POSES, *ROWS)):
        if name not in stated:
            raise DescriptionError(
                f"no comment '# {name}: ...'; expected a simulation that dhkit saved"
            )
        try:
            values[name] = np.array([float(word) for word in stated[name].split()])
        except ValueError:
            raise DescriptionError(
                f"{name} is {stated[name].strip()[:40]!r}; expected numbers"
            ) from None
    return values
