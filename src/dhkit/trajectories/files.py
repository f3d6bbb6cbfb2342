"""Trajectory files by their suffix: .npz and .mat without loss, .csv and .yaml as samples; samples from elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.description import Array, Description, from_toml, library_robot, robots, to_toml, write_atomically
from dhkit.description.files import read_bounded
from dhkit.errors import DescriptionError
from dhkit.trajectories.archives import MOST_BYTES, mat_bytes, npz_bytes, read_mat, read_npz
from dhkit.trajectories.ros_yaml import parse_message, trajectory_text
from dhkit.trajectories.tables import read_table, select_columns, table_text
from dhkit.trajectories.trajectory import Trajectory

__all__ = ["load_trajectory", "read_samples", "save_trajectory"]

ARCHIVES, TABLES = (".npz", ".mat"), (".csv", ".yaml", ".yml")
FORMAT = "dhkit trajectory"
VERSION = f"{FORMAT} 1"
RATE = 1000.0
"""Samples a second where none are asked for."""
SECOND = 1_000_000_000
"""In ns."""
EXPECTED = "a trajectory"


def save_trajectory(trajectory: Trajectory, path: str | Path, rate: float | None = None) -> Path:
    """Write a trajectory and return its path; the file is there whole, or not at all.

    Parameters
    ----------
    trajectory
        The motion. Its report is not written.
    path
        The suffix decides: ``.npz`` and ``.mat`` hold every number and the robot; ``.csv`` holds samples
        ``t, q1 ..., qd1 ..., qdd1 ...``, and ``.yaml`` or ``.yml`` those of a ROS JointTrajectory, times in whole ns.
    rate
        Samples a second, 1000 if not given; only for ``.csv`` and ``.yaml``.

    Raises
    ------
    ValueError
        Another suffix, a rate that is not positive, or one for an archive.
    OSError
        The file cannot be written.
    """
    path = Path(path)
    suffix = _suffix(path)
    description = trajectory.description
    if suffix in ARCHIVES:
        if rate is not None:
            raise ValueError(f"rate is {rate!r}: {suffix} holds no samples; expected no rate")
        values = {
            "format": VERSION,
            "robot": description.name,
            "digest": description.digest,
            "toml": to_toml(description),
            "breaks": trajectory.breaks,
            "coefficients": trajectory.coefficients,
        }
        write_atomically(path, npz_bytes(values) if suffix == ".npz" else mat_bytes(values))
        return path
    comments = (FORMAT, f"robot: {description.name} {description.digest}")
    times = trajectory.sample_times(RATE if rate is None else rate)
    write_atomically(path, (_csv if suffix == ".csv" else _yaml)(trajectory, times, comments))
    return path


def load_trajectory(path: str | Path, description: Description | None = None) -> Trajectory:
    """Read a trajectory that :func:`save_trajectory` wrote.

    Archives give the same motion to the last bit; samples give one of degree 5 between them, which meets their
    values, rates and accelerations.

    Parameters
    ----------
    path
        The file. It may come from anywhere: nothing in it is executed, and at most 200 MB are read.
    description
        The robot. If not given, that of the file: the library's, or for an archive the one it holds.

    Raises
    ------
    DescriptionError
        One line: the file cannot be read, is damaged, is no trajectory, or is one of another robot.
    """
    path = Path(path)
    try:
        suffix = _suffix(path)
    except ValueError as error:
        raise DescriptionError(str(error)) from None
    content = read_bounded(path, MOST_BYTES, EXPECTED)
    try:
        if suffix in ARCHIVES:
            return _from_archive(read_npz(content) if suffix == ".npz" else read_mat(content), description)
        text = _text(content)
        robot = _robot_named(*_label(text), description)
        samples = _table_samples(text, robot) if suffix == ".csv" else _message_samples(text, robot)
        return samples.trajectory(robot)
    except (DescriptionError, ValueError, TypeError) as error:
        raise DescriptionError(f"{path}: {error}") from None


def read_samples(path: str | Path, description: Description, *, degrees: bool = False) -> Trajectory:
    """Read samples that something else wrote, as :meth:`Trajectory.from_samples` takes them.

    Parameters
    ----------
    path
        A ``.csv`` whose header names its columns: t or time, ``q1`` ... ``qn`` or the joints' names, and if they are
        there rates and accelerations, ``qd1`` or ``dq1``, ``qdd1`` or ``ddq1``. Or a ``.yaml`` of a ROS
        JointTrajectory, its joints in any order.
    description
        The robot that moves so.
    degrees
        Whether angles are in degrees.

    Raises
    ------
    DescriptionError
        One line: the file cannot be read, or what is wrong in which line.
    """
    path = Path(path)
    if path.suffix.lower() not in TABLES:
        raise DescriptionError(f"{path}: found suffix {path.suffix!r}; expected one of {', '.join(TABLES)}")
    text_of = read_bounded(path, MOST_BYTES, "samples of a motion")
    try:
        text = _text(text_of)
        if text.startswith(f"# {FORMAT}"):
            _robot_named(*_label(text), description)
        is_csv = path.suffix.lower() == ".csv"
        samples = _table_samples(text, description) if is_csv else _message_samples(text, description)
        return samples.in_radians(description).trajectory(description) if degrees else samples.trajectory(description)
    except (DescriptionError, ValueError, TypeError) as error:
        raise DescriptionError(f"{path}: {error}") from None


@dataclass(frozen=True, eq=False)
class _Read:
    """Samples of a file."""

    times: Array
    """Shape (N,), s."""
    arrays: list[Array]
    """One to three, shape (N, n): values, rates, accelerations."""

    def in_radians(self, description: Description) -> _Read:
        unit = np.where(description.numbers.prismatic, 1.0, np.pi / 180)
        return _Read(self.times, [array * unit for array in self.arrays])

    def trajectory(self, description: Description) -> Trajectory:
        return Trajectory.from_samples(description, self.times, *self.arrays)


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in ARCHIVES + TABLES:
        raise ValueError(f"{path}: found suffix {path.suffix!r}; expected one of {', '.join(ARCHIVES + TABLES)}")
    return suffix


def _text(content: bytes) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DescriptionError(f"byte {error.start} is not UTF-8; expected text") from None


def _from_archive(values: dict[str, Any], description: Description | None) -> Trajectory:
    if values["format"] != VERSION:
        raise DescriptionError(f"format is {values['format'][:40]!r}; expected {VERSION!r}")
    own = from_toml(values["toml"], file="its robot")
    if own.digest != values["digest"] or own.name != values["robot"]:
        raise DescriptionError(f"its robot is not the {values['robot'][:40]!r} that it names; the file is damaged")
    breaks, coefficients = values["breaks"], values["coefficients"]
    if own.n == 1 and coefficients.ndim == 2:
        coefficients = coefficients[..., None]  # MATLAB drops a last axis of length 1
    if breaks.ndim == 2:
        breaks = breaks.ravel()
    if description is None:
        # The library's robot knows where its meshes are.
        known = own.name in robots() and library_robot(own.name).digest == own.digest
        return Trajectory(library_robot(own.name) if known else own, breaks, coefficients)
    Trajectory(own, breaks, coefficients).require(description)
    return Trajectory(description, breaks, coefficients)


def _label(text: str) -> tuple[str, str]:
    """Return the robot's name and digest that the comments say."""
    lines = text[:1000].splitlines()[:2]
    words = lines[1].removeprefix("# robot: ").split() if len(lines) == 2 else []
    if not lines or lines[0] != f"# {FORMAT}" or len(words) != 2 or not lines[1].startswith("# robot: "):
        raise DescriptionError(
            f"does not begin with '# {FORMAT}' and '# robot: NAME DIGEST'; samples from elsewhere are read by"
            " Trajectory.read"
        )
    return words[0], words[1]


def _robot_named(name: str, digest: str, description: Description | None) -> Description:
    if description is not None:
        if description.digest != digest:
            raise DescriptionError(
                f"a trajectory of {name[:40]} ({digest[:12]}); expected one of {description.name}"
                f" ({description.digest})"
            )
        return description
    if name not in robots() or library_robot(name).digest != digest:
        raise DescriptionError(f"its robot {name[:40]} ({digest[:12]}) is not the library's; give the robot")
    return library_robot(name)


def _csv(trajectory: Trajectory, times: Array, comments: tuple[str, ...]) -> str:
    places = range(1, trajectory.n + 1)
    columns = ("t", *(f"{prefix}{i}" for prefix in ("q", "qd", "qdd") for i in places))
    values = (times[:, None], trajectory.q(times), trajectory.qd(times), trajectory.qdd(times))
    return table_text(columns, np.concatenate(values, axis=1), comments)


def _yaml(trajectory: Trajectory, times: Array, comments: tuple[str, ...]) -> str:
    nanoseconds = [round(time * SECOND) for time in times.tolist()]
    kept = [k for k, time in enumerate(nanoseconds) if not k or time > nanoseconds[k - 1]]
    nanoseconds = [nanoseconds[k] for k in kept]
    t = np.minimum(np.array(nanoseconds) / SECOND, trajectory.duration)
    names = tuple(joint.name for joint in trajectory.description.joints)
    return trajectory_text(names, nanoseconds, trajectory.q(t), trajectory.qd(t), trajectory.qdd(t), comments)


def _table_samples(text: str, description: Description) -> _Read:
    return _Read(*select_columns(description, read_table(text)))


def _message_samples(text: str, description: Description) -> _Read:
    message = parse_message(text)
    names, points = message.get("joint_names"), message.get("points")
    own = [joint.name for joint in description.joints]
    if not isinstance(names, list) or not isinstance(points, list) or not points:
        raise DescriptionError("no joint_names and points in it; expected a trajectory_msgs/JointTrajectory")
    if not all(isinstance(name, str) for name in names) or sorted(names) != sorted(own):
        raise DescriptionError(
            f"joint_names: found {', '.join(map(str, names))[:120]}; expected {', '.join(own)}, in any order"
        )
    order = [names.index(name) for name in own]
    times, columns = [], []
    for k, point in enumerate(points):
        if not isinstance(point, dict):
            raise DescriptionError(f"points[{k}]: expected positions and time_from_start")
        times.append(_seconds(point.get("time_from_start"), k))
        rows = [_row(point.get(key), key, k, len(own)) for key in ("positions", "velocities", "accelerations")]
        columns.append([row for row in rows if row is not None])
        if rows[0] is None or (rows[1] is None and rows[2] is not None) or len(columns[-1]) != len(columns[0]):
            raise DescriptionError(f"points[{k}]: expected positions, and velocities and accelerations as in points[0]")
    arrays = np.array(columns)[:, :, order]
    return _Read(np.array(times), [arrays[:, i] for i in range(arrays.shape[1])])


def _seconds(value: Any, k: int) -> float:
    """Return a duration, s: sec and nanosec, or secs and nsecs as ROS 1 has it."""
    if isinstance(value, dict):
        for whole, part in (("sec", "nanosec"), ("secs", "nsecs")):
            if whole in value and part in value:
                # Seconds and a fraction that is rounded once, so that what was written in ns comes back.
                return (_whole(value[whole], k) * SECOND + _whole(value[part], k)) / SECOND
    raise DescriptionError(f"points[{k}].time_from_start: expected sec and nanosec")


def _whole(text: Any, k: int) -> int:
    if not isinstance(text, str) or len(text) > 20 or not text.isascii() or not text.isdigit():
        raise DescriptionError(f"points[{k}].time_from_start: found {str(text)[:40]!r}; expected a whole number")
    return int(text)


def _row(value: Any, key: str, k: int, n: int) -> list[float] | None:
    if value in (None, "", []):
        return None
    if not isinstance(value, list) or len(value) != n:
        found = f"{len(value)} values" if isinstance(value, list) else repr(value)[:40]
        raise DescriptionError(f"points[{k}].{key}: found {found}; expected {n}")
    try:
        row = [float(entry) for entry in value]
    except (TypeError, ValueError):
        raise DescriptionError(f"points[{k}].{key}: found {value!r:.60}; expected numbers") from None
    if not np.isfinite(row).all():
        raise DescriptionError(f"points[{k}].{key}: found {value!r:.60}; expected finite numbers")
    return row
