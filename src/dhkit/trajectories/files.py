"""Trajectory files by their suffix: .npz and .mat without loss, .csv and .yaml as samples; samples from elsewhere."""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.description import Array, Description, Payload, Robot, description_of, write_atomically
from dhkit.description.joint_text import degrees_hint, joint_text
from dhkit.errors import DescriptionError
from dhkit.symbolic import Friction
from dhkit.trajectories.archives import ARCHIVES, archive_bytes, archive_format, read_archive
from dhkit.trajectories.bounds import BOUNDS
from dhkit.trajectories.labels import FileKind, checked_suffix, decoded
from dhkit.trajectories.matlab_samples import MATRICES, matlab_table
from dhkit.trajectories.ros_yaml import MESSAGE, POINT, ROWS, TIMES, parse_message, trajectory_text
from dhkit.trajectories.tables import check_columns, read_table, select_columns, table_text
from dhkit.trajectories.trajectory import Trajectory

log = logging.getLogger(__name__)

TABLES = (".csv", ".yaml", ".yml")
"""Suffixes of files with samples that dhkit writes."""
_SAMPLES = (*TABLES, ".mat")
"""Suffixes of files with samples from other programs."""
TRAJECTORY = FileKind(
    "trajectory",
    arrays=("breaks", "coefficients"),
    most=200_000_000,
    optional=("payload", "friction"),
    otherwise="; Trajectory.read takes samples from elsewhere, the command files without dhkit's first line",
)
_COMMENTS_LENGTH = 2_000
"""Number of characters that hold a table's comments: label, and payload and friction as 11 numbers of 25 characters."""
_BESIDE = re.compile(r"^\s*#\s*(payload|friction)\s*:(.*)$", re.MULTILINE)
_FIRST_LINE = 200
"""Number of bytes that hold the first line of a table."""
_DEFAULT_RATE = 1000.0
"""Samples per second if no rate is given."""
_TURNS = 3
"""Whole turns of a joint without limits beyond which degrees may be meant."""
_MAX_JUMP = 1e-6
"""Largest jump of joint values, rad or m, and speeds between pieces of a motion, absolute and relative."""
_NANOSECONDS = 1_000_000_000
"""Nanoseconds per second."""
LEFT_OUT: tuple[object, ...] = (None, "", [])
"""Values of a row that a message's point leaves out."""


def save_trajectory(trajectory: Trajectory, path: str | Path, rate: float | None = None) -> Path:
    """Write a trajectory and return its path; after a failure there is no file, or the old one.

    Parameters
    ----------
    trajectory
        The motion, with its payload and friction. Its report is not written.
    path
        The suffix chooses the format: ``.npz`` and ``.mat`` hold every number and the robot; ``.csv`` holds samples
        ``t, q1 ..., qd1 ..., qdd1 ...``, and ``.yaml`` or ``.yml`` those of a ROS JointTrajectory, times in whole ns.
    rate
        Samples per second, 1000 if not given; only for ``.csv`` and ``.yaml``.

    Raises
    ------
    ValueError
        Another suffix, a rate that is not positive, or one for an archive.
    OSError
        The file cannot be written.
    """
    path = Path(path)
    suffix = checked_suffix(path, ARCHIVES + TABLES)
    if suffix in ARCHIVES:
        if rate is not None:
            raise ValueError(f"rate is {rate!r}: {suffix} holds no samples; expected no rate")
        arrays = {
            "breaks": trajectory.breaks,
            "coefficients": trajectory.coefficients,
        } | _load_numbers(trajectory)
        write_atomically(
            path, archive_bytes(suffix, TRAJECTORY.archived(trajectory.description, arrays))
        )
        return path

    comments: list[str] = []
    for name, numbers in _load_numbers(trajectory).items():
        words = [f"{x:.17g}" for x in numbers.tolist()]
        comments.append(f"{name}: {' '.join(words)}")
    times = trajectory.sample_times(_DEFAULT_RATE if rate is None else rate)
    write = _csv if suffix == ".csv" else _yaml
    text = write(trajectory, times, tuple(comments))
    write_atomically(path, TRAJECTORY.labelled(trajectory.description, text))
    return path


def load_trajectory(path: str | Path, description: Description | None = None) -> Trajectory:
    """Read a trajectory that :func:`save_trajectory` wrote.

    Archives give the same motion to the last bit; samples give polynomials of degree 5 through their values, rates and
    accelerations.

    Parameters
    ----------
    path
        The file. It may come from anywhere: nothing in it is executed, and at most 200 MB are read.
    description
        The robot. If not given, the file's: the library's of that name, or for an archive the one that it contains.

    Raises
    ------
    DescriptionError
        One line: the file cannot be read, is damaged, is not a trajectory, or is one of another robot.
    """
    path = Path(path)
    suffix, content = TRAJECTORY.read(path, ARCHIVES + TABLES)
    try:
        if suffix in ARCHIVES:
            return _from_archive(read_archive(suffix, content, TRAJECTORY), description)
        text = decoded(content)
        robot = TRAJECTORY.robot_of_table(text, description)
        samples = _table_samples(text, robot) if suffix == ".csv" else _message_samples(text, robot)
        motion = samples.trajectory(robot)
        TRAJECTORY.require_unchanged(text)
        return motion
    except (DescriptionError, ValueError, TypeError) as error:
        raise DescriptionError(f"{path}: {error}") from None


def written_by_dhkit(path: str | Path) -> str:
    """Return the kind of a file that dhkit wrote, such as ``dhkit trajectory``; empty for files of other programs.

    Parameters
    ----------
    path
        File.

    Returns
    -------
    str
        Title in the file's label; empty where it has none.

    Raises
    ------
    DescriptionError
        The file cannot be read, is damaged, or has another suffix.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.trajectories import quintic
    >>> path = quintic(library_robot("planar2r"), [0, 0], [0.5, 1.0], duration=2.0).save("motion.npz")
    >>> written_by_dhkit(path)
    'dhkit trajectory'
    """
    path = Path(path)
    suffix, content = TRAJECTORY.read(path, ARCHIVES + TABLES)
    if suffix in ARCHIVES:
        try:
            return archive_format(suffix, content, TRAJECTORY.most).rpartition(" ")[0]
        except DescriptionError as error:
            raise DescriptionError(f"{path}: {error}") from None
    first = content[:_FIRST_LINE].partition(b"\n")[0].decode("utf-8-sig", errors="replace").strip()
    return first.removeprefix("# ") if first.startswith("# dhkit ") else ""


def read_motion(
    path: str | Path,
    description: Robot,
    *,
    degrees: bool = False,
    columns: Mapping[str, str] | None = None,
) -> Trajectory:
    """Read a motion of a robot: a file that dhkit wrote, or samples from another program, as the file's label tells.

    Parameters
    ----------
    path
        As for :func:`load_trajectory` and :func:`read_samples`.
    description
        The robot.
    degrees, columns
        For samples from other programs, as for :func:`read_samples`.

    Returns
    -------
    Trajectory
        The motion.

    Raises
    ------
    DescriptionError
        One line: what is wrong in the file.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.trajectories import quintic
    >>> arm = library_robot("planar2r")
    >>> path = quintic(arm, [0, 0], [0.5, 1.0], duration=2.0).save("motion.npz")
    >>> read_motion(path, arm).duration
    2.0
    """
    description = description_of(description)
    title = written_by_dhkit(path)
    if title not in ("", TRAJECTORY.title):
        raise DescriptionError(f"{path}: a {title}; expected a trajectory")
    if title:
        return load_trajectory(path, description)
    return read_samples(path, description, degrees=degrees, columns=columns)


def read_samples(
    path: str | Path,
    description: Description,
    *,
    degrees: bool = False,
    columns: Mapping[str, str] | None = None,
) -> Trajectory:
    """Read samples that another program wrote; see :meth:`Trajectory.from_samples`.

    Parameters
    ----------
    path
        A ``.csv`` whose header names its columns: t or time, ``q1`` ... ``qn`` or the joints' names, and if they are
        there rates and accelerations, ``qd1`` or ``dq1``, ``qdd1`` or ``ddq1``. A ``.yaml`` of a ROS JointTrajectory,
        its joints in any order. Or a ``.mat`` of arrays, saved in MATLAB by ``save(..., '-v7')`` or older: a vector
        ``t``, ``time`` or ``tout``, and either vectors of the same names as columns or a matrix ``q``, shape (N, n),
        with ``qd`` and ``qdd`` if they are there; a matrix of n+1 columns has the times in its first. Structures that
        Simulink writes, with or without time, count as such matrices; see :func:`matlab_table`.
    description
        The robot.
    degrees
        Whether angles are in degrees.
    columns
        The file's names of columns or variables, by our names: ``t``, ``q1``, ``qd1``, ``qdd1`` and so on, a
        joint's name for its values, and in a ``.mat`` ``q``, ``qd`` and ``qdd`` for matrices. Others keep their names.
        ``{"q": "yout(:,1:6)"}`` takes columns of a matrix.

    Raises
    ------
    DescriptionError
        One line: the file cannot be read, or what is wrong in which line or variable.
    ValueError, TypeError
        ``columns`` has other names, or is given for a ``.yaml``.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> names = {"t": "Time", "shoulder": "axis A", "elbow": "axis B"}
    >>> read_samples("log.csv", library_robot("planar2r"), degrees=True, columns=names)  # doctest: +SKIP
    """
    path = Path(path)
    suffix, content = TRAJECTORY.read(path, _SAMPLES)
    names = check_columns(description, columns, MATRICES if suffix == ".mat" else ())
    if names and suffix not in (".csv", ".mat"):
        raise ValueError(
            f"columns is given; expected none for {suffix}, whose joint_names say which joint is which"
        )
    try:
        samples = _samples(suffix, content, description, names)
        if degrees:
            return samples.in_radians(description).trajectory(description)
        question = samples.degrees_question(description)
        if question:
            log.warning("%s: %s", path, question)
        return samples.trajectory(description)
    except (DescriptionError, ValueError, TypeError) as error:
        raise DescriptionError(f"{path}: {error}") from None


@dataclass(frozen=True, eq=False)
class _FileSamples:
    """Samples of a file, with payload and friction."""

    times: Array
    """Times, shape (N,), s."""
    arrays: list[Array]
    """One to three arrays, shape (N, n): values, rates, accelerations."""
    load: Mapping[str, Any] = field(default_factory=dict)
    """Payload and friction."""

    def in_radians(self, description: Description) -> _FileSamples:
        """Return samples whose angles were in degrees in radians."""
        unit = np.where(description.numbers.prismatic, 1.0, np.pi / 180)
        return replace(self, arrays=[array * unit for array in self.arrays])

    def degrees_question(self, description: Description) -> str:
        """Return a question whether degrees were meant, if some angle is beyond a turn and the joint's limits."""
        q = np.abs(self.arrays[0])
        numbers = description.numbers
        allowed = np.maximum(np.maximum(np.abs(numbers.lower), np.abs(numbers.upper)), math.tau)
        allowed = np.where(np.isfinite(allowed), allowed, _TURNS * math.tau)
        beyond = (q > allowed) & ~numbers.prismatic
        if not beyond.any():
            return ""
        row, i = np.unravel_index(int(np.argmax(np.where(beyond, q, 0.0))), q.shape)
        value = float(self.arrays[0][row, i])
        found = f"{description.joints[int(i)].name} is at {joint_text(value, slides=False)}"
        return f"{found}{degrees_hint(value, slides=False)}; degrees=True (--degrees) reads them"

    def trajectory(self, description: Description) -> Trajectory:
        """Return the motion through the samples, with payload and friction."""
        motion = Trajectory.from_samples(description, self.times, *self.arrays)
        return replace(motion, **self.load)


def _from_archive(values: dict[str, Any], description: Description | None) -> Trajectory:
    """Return the motion of an archive's content."""
    robot = TRAJECTORY.robot_of_archive(values, description)
    breaks = values["breaks"]
    coefficients = values["coefficients"]
    if coefficients.ndim > 1 and coefficients.shape[1] > BOUNDS.coefficients:
        found = f"polynomials of degree {coefficients.shape[1] - 1}"
        raise ValueError(f"{found}; expected at most {BOUNDS.coefficients - 1}")
    if robot.n == 1 and coefficients.ndim == 2:
        coefficients = coefficients[..., None]  # MATLAB drops a last axis of length 1
    if breaks.ndim == 2:
        breaks = breaks.ravel()
    motion = Trajectory(robot, breaks, coefficients, **_load(values))
    _require_continuous(motion)
    TRAJECTORY.require_whole(values)
    return motion


def _load_numbers(motion: Trajectory) -> dict[str, Array]:
    """Return a motion's payload, shape (10,), and width of friction, shape (1,), by name."""
    found = {}
    if motion.payload is not None:
        found["payload"] = motion.payload.numbers
    if motion.friction is not None:
        found["friction"] = np.array([motion.friction.width])
    return found


def _load(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return payload and friction from the numbers of :func:`_load_numbers`.

    Raises
    ------
    DescriptionError, ValueError
        The numbers are not those of a payload or of friction.
    """
    found: dict[str, Any] = {}
    if "payload" in values:
        found["payload"] = Payload.of_numbers(np.ravel(values["payload"]))
    if "friction" in values:
        width = np.ravel(values["friction"])
        if width.shape != (1,):
            raise DescriptionError(f"friction has {width.size} numbers; expected its width alone")
        found["friction"] = Friction(float(width[0]))
    return found


def _commented(text: str) -> dict[str, Array]:
    """Return the numbers of :func:`_load_numbers` that a table's comments name."""
    found: dict[str, Array] = {}
    for name, numbers in _BESIDE.findall(text[:_COMMENTS_LENGTH]):
        if name in found:
            raise DescriptionError(f"{name} is there twice")
        try:
            found[name] = np.array([float(word) for word in numbers.split()])
        except ValueError:
            raise DescriptionError(f"{name}: found {numbers[:40]!r}; expected numbers") from None
    return found


def _require_continuous(motion: Trajectory) -> None:
    """Check that joint values and speeds of a motion do not jump between its pieces, so that an arm can follow it.

    Raises
    ------
    DescriptionError
        A value jumps; names joint and time.
    """
    inner = motion.breaks[1:-1]
    for what, values in (("value", motion.q), ("speed", motion.qd)):
        before = values(inner, "left")
        after = values(inner, "right")
        if not len(inner):
            return
        jumps = np.abs(after - before) / (1 + np.abs(before))
        k, i = np.unravel_index(int(np.argmax(jumps)), jumps.shape)
        if jumps[k, i] > _MAX_JUMP:
            jump = f"jumps from {before[k, i]:.6g} to {after[k, i]:.6g} at {inner[k]:.6g} s"
            raise DescriptionError(f"joint {i + 1}: its {what} {jump}; the file is damaged")


def _csv(trajectory: Trajectory, times: Array, comments: tuple[str, ...]) -> str:
    """Return samples as a table, without its label."""
    columns = ["t"]
    for prefix in ("q", "qd", "qdd"):
        columns += [f"{prefix}{i}" for i in range(1, trajectory.n + 1)]
    values = (times[:, None], trajectory.q(times), trajectory.qd(times), trajectory.qdd(times))
    return table_text(tuple(columns), np.concatenate(values, axis=1), comments)


def _yaml(trajectory: Trajectory, times: Array, comments: tuple[str, ...]) -> str:
    """Return samples as a ROS JointTrajectory, without its label; times are whole nanoseconds, all different."""
    nanoseconds = [round(time * _NANOSECONDS) for time in times.tolist()]
    kept = [k for k, time in enumerate(nanoseconds) if not k or time > nanoseconds[k - 1]]
    nanoseconds = [nanoseconds[k] for k in kept]
    t = np.minimum(np.array(nanoseconds) / _NANOSECONDS, trajectory.duration)
    names = tuple(joint.name for joint in trajectory.description.joints)
    return trajectory_text(
        names, nanoseconds, trajectory.q(t), trajectory.qd(t), trajectory.qdd(t), comments
    )


def _samples(
    suffix: str, content: bytes, description: Description, columns: Mapping[str, str]
) -> _FileSamples:
    """Return the samples of a file of another program; a table that dhkit wrote must be of this robot."""
    if suffix == ".mat":
        table = matlab_table(description, content, TRAJECTORY.most, columns)
        return _FileSamples(*select_columns(description, table))
    text = decoded(content)
    if text.startswith(f"# {TRAJECTORY.title}"):
        TRAJECTORY.robot_of_table(text, description)
    return (
        _table_samples(text, description, columns)
        if suffix == ".csv"
        else _message_samples(text, description)
    )


def _table_samples(
    text: str, description: Description, columns: Mapping[str, str] | None = None
) -> _FileSamples:
    """Return the samples of a table, with the payload and friction of its comments."""
    times, arrays = select_columns(description, read_table(text), columns)
    return _FileSamples(times, arrays, _load(_commented(text)))


def _message_samples(text: str, description: Description) -> _FileSamples:
    """Return the samples of a ROS JointTrajectory, with the payload and friction of its comments."""
    message = parse_message(text)
    if unknown := next((key for key in message if key not in MESSAGE), None):
        raise DescriptionError(f"unknown key {unknown[:40]!r}; expected {', '.join(MESSAGE)}")
    names = message.get("joint_names")
    points = message.get("points")
    own = [joint.name for joint in description.joints]
    if not isinstance(names, list) or not isinstance(points, list) or not points:
        raise DescriptionError(
            "no joint_names and points in it; expected a trajectory_msgs/JointTrajectory"
        )
    if not all(isinstance(name, str) for name in names) or sorted(names) != sorted(own):
        raise DescriptionError(
            f"joint_names: found {', '.join(map(str, names))[:120]}; expected {', '.join(own)}, in any order"
        )
    order = [names.index(name) for name in own]

    times = []
    columns = []
    for k, point in enumerate(points):
        if not isinstance(point, dict):
            raise DescriptionError(f"points[{k}]: expected positions and time_from_start")
        if unknown := next((key for key in point if key not in POINT), None):
            raise DescriptionError(
                f"points[{k}]: unknown key {unknown[:40]!r}; expected {', '.join(POINT)}"
            )
        times.append(_seconds(point.get("time_from_start"), k))
        q, qd, qdd = (_row(point.get(key), key, k, len(own)) for key in ROWS)
        columns.append([row for row in (q, qd, qdd) if row is not None])
        is_complete = q is not None and (qd is not None or qdd is None)
        if not is_complete or len(columns[-1]) != len(columns[0]):
            raise DescriptionError(
                f"points[{k}]: expected positions, and velocities and accelerations as in points[0]"
            )
    arrays = np.array(columns)[:, :, order]
    listed = [arrays[:, i] for i in range(arrays.shape[1])]
    return _FileSamples(np.array(times), listed, _load(_commented(text)))


def _seconds(value: Any, k: int) -> float:
    """Return a duration, s."""
    if isinstance(value, dict):
        for whole, part in TIMES:
            if whole in value and part in value:
                # Added as integers and rounded once, so that whole nanoseconds come back unchanged.
                return (
                    _whole(value[whole], k) * _NANOSECONDS + _whole(value[part], k)
                ) / _NANOSECONDS
    raise DescriptionError(f"points[{k}].time_from_start: expected sec and nanosec")


def _whole(text: Any, k: int) -> int:
    """Return a whole number of point k from its text."""
    if (
        not isinstance(text, str)
        or len(text) > BOUNDS.digits
        or not text.isascii()
        or not text.isdigit()
    ):
        raise DescriptionError(
            f"points[{k}].time_from_start: found {str(text)[:40]!r}; expected a whole number"
        )
    return int(text)


def _row(value: Any, key: str, k: int, n: int) -> list[float] | None:
    """Return a row of n numbers of point k; None if the point leaves it out."""
    if value in LEFT_OUT:
        return None
    if not isinstance(value, list) or len(value) != n:
        found = f"{len(value)} values" if isinstance(value, list) else repr(value)[:40]
        raise DescriptionError(f"points[{k}].{key}: found {found}; expected {n}")
    try:
        row = [float(entry) for entry in value]
    except (TypeError, ValueError):
        raise DescriptionError(
            f"points[{k}].{key}: found {value!r:.60}; expected numbers"
        ) from None
    if not np.isfinite(row).all():
        raise DescriptionError(f"points[{k}].{key}: found {value!r:.60}; expected finite numbers")
    return row
