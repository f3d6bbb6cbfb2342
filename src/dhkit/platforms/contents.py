"""Files to upload: a task with its robot, and packages of files as a zip file or a folder."""

from __future__ import annotations

import hashlib
import io
import re
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from dhkit import __version__
from dhkit.description import Description
from dhkit.description.files import read_bounded, whole_folder, write_atomically
from dhkit.errors import AnswerError, DescriptionError
from dhkit.grading.answers.sheet import quantity_names, read_task
from dhkit.grading.answers.sheet_values import AnswerSheet
from dhkit.grading.catalogue import LIBRARY
from dhkit.grading.entry_points import robot_of
from dhkit.grading.rubric import Rubric
from dhkit.grading.variants.key import FILE, ROBOTS, TASK, VariantKey

_TASK_BYTES = 1_000_000
_ROBOT_BYTES = 2_000_000
_WHEEL_BYTES = 200_000_000
"""Largest files of a task, a robot and a wheel, bytes."""
_WHEEL_NAME = re.compile(r"dhkit_robotics-[\w.!+]+-[\w.]+-[\w.]+-[\w.]+\.whl")
_FILE_MODE = 0o644
_PROGRAM_MODE = 0o755
_REGULAR_FILE = 0o100000
"""Bits of Unix file modes, which zip files keep in the upper half of the external attributes."""
_FIRST_DATE = (1980, 1, 1, 0, 0, 0)
"""Date of every file in a zip file, the earliest there is: the same task gives the same bytes."""


@dataclass(frozen=True)
class Package:
    """Files to upload, by their path in the package."""

    files: Mapping[str, bytes]
    programs: frozenset[str] = frozenset()
    """Paths of files that are executed."""

    def zipped(self) -> bytes:
        """Return the package as a zip file."""
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in sorted(self.files.items()):
                entry = zipfile.ZipInfo(name, _FIRST_DATE)
                entry.compress_type = zipfile.ZIP_DEFLATED
                mode = _PROGRAM_MODE if name in self.programs else _FILE_MODE
                entry.external_attr = (_REGULAR_FILE | mode) << 16
                archive.writestr(entry, content)
        return stream.getvalue()

    def write(self, output: Path) -> None:
        """Write the package: a zip file if the name ends in ``.zip``, or else a new folder.

        Raises
        ------
        AnswerError
            The folder exists.
        OSError
            It cannot be written.
        """
        if output.suffix.lower() == ".zip":
            write_atomically(output, self.zipped())
            return
        if output.exists():
            raise AnswerError(
                f"{output}: exists; expected the name of a new folder, or of a zip file"
            )
        with whole_folder(output) as folder:
            for name, content in self.files.items():
                path = folder / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
                path.chmod(_PROGRAM_MODE if name in self.programs else _FILE_MODE)


@dataclass(frozen=True)
class Task:
    """An instructor's task that is complete in itself: its file, and the robot's file where it has one."""

    name: str
    """Name of the task: that of its file, or of its folder for a file task.toml."""
    sheet: AnswerSheet
    description: Description
    """The robot."""
    rubric: Rubric
    files: Mapping[str, bytes] = field(repr=False)
    """``task.toml``, and the robot's file at the place that the task names."""

    @classmethod
    def read(cls, path: Path) -> Task:
        """Return the task of a file.

        Raises
        ------
        AnswerError
            The file is no task, names no robot, or has no valid rubric.
        DescriptionError
            The robot's file describes no robot.
        """
        sheet = read_task(path)
        if sheet.variants:
            raise AnswerError(
                f"{path}: has variants; expected the folder key of `dhkit task variants` (for Gradescope), or a "
                "task without them"
            )
        if not sheet.robot:
            raise AnswerError(
                f"{path}: robot: missing; expected a library name, or a file beside the task"
            )
        description = robot_of(sheet, path.parent)
        files = {"task.toml": _content(path, _TASK_BYTES, "a task")}
        if sheet.robot.endswith(".toml"):
            place = PurePosixPath(sheet.robot)
            if place.name == "task.toml" or ".." in place.parts:
                raise AnswerError(
                    f"{path}: robot: {sheet.robot!r}; expected another name, below the task's folder"
                )
            files[str(place)] = _content(path.parent / sheet.robot, _ROBOT_BYTES, "a robot")
        # Courses have a folder for each task, and task.toml in it.
        name = path.parent.name if path.stem == "task" and path.parent.name else path.stem
        return cls(name, sheet, description, _rubric_of(sheet, path), files)

    @classmethod
    def of_student(cls, key: VariantKey, student: str) -> Task:
        """Return the task of a student whose robot is in the key of a task's variants.

        Raises
        ------
        AnswerError
            The key has no such student, or was changed.
        """
        sheet = read_task(key.task)
        rubric = _rubric_of(sheet, key.task)
        return cls(key.task.stem, sheet, key.robot_of(student), rubric, {})

    @property
    def title(self) -> str:
        """A line that tells the task from others: its name, its robot and what is asked."""
        return f"{self.name}: {self.description.name}, {', '.join(self.asked) or 'equations'}"

    @property
    def digest(self) -> str:
        """SHA-256 of the task's name, file and robot, hexadecimal: two tasks have two."""
        parts = [self.name.encode(), self.description.digest.encode()]
        for name, content in sorted(self.files.items()):
            parts += [name.encode(), content]
        return hashlib.sha256(b"\0".join(parts)).hexdigest()

    @property
    def asked(self) -> tuple[str, ...]:
        """Quantities that are asked for; those that the rubric weighs where the task does not say."""
        weighed = tuple(name for name, weight in self.rubric.weights.items() if weight > 0)
        known = (*quantity_names(self.description.n), "dh", "ik")
        return self.sheet.task.asked or tuple(name for name in weighed if name in known)

    def points_of(self, quantity: str) -> float:
        """Return the points of a quantity: its share of the rubric's points by weight."""
        weights = self.rubric.weights
        named = {name: weights[name] for name in self.asked if weights.get(name, 0) > 0}
        shares = named or dict.fromkeys(self.asked, 1.0)
        return self.rubric.points * shares.get(quantity, 0.0) / sum(shares.values())


@dataclass(frozen=True)
class Installation:
    """How dhkit gets onto a platform."""

    wheel_name: str = ""
    wheel: bytes = field(default=b"", repr=False)

    @classmethod
    def of(cls, wheel: Path | None) -> Installation:
        """Return the installation of a wheel; without one, of this version from the package index.

        Raises
        ------
        AnswerError
            The file is no wheel of dhkit.
        """
        if wheel is None:
            return cls()
        if not _WHEEL_NAME.fullmatch(wheel.name):
            raise AnswerError(
                f"{wheel}: expected a wheel of dhkit, dhkit_robotics-{__version__}-py3-none-any.whl"
            )
        content = _content(wheel, _WHEEL_BYTES, "a wheel")
        if not zipfile.is_zipfile(io.BytesIO(content)):
            raise AnswerError(f"{wheel}: no wheel: not a zip file")
        return cls(wheel.name, content)

    @property
    def requirement(self) -> str:
        """What pip is told to install, from the folder where :attr:`files` lie."""
        return f"./{self.wheel_name}" if self.wheel_name else f"dhkit-robotics=={__version__}"

    @property
    def files(self) -> dict[str, bytes]:
        """The wheel by its name; empty without one."""
        return {self.wheel_name: self.wheel} if self.wheel_name else {}


def key_contents(key: VariantKey) -> dict[str, bytes]:
    """Return the files of a key of variants, by their path in its folder.

    Raises
    ------
    AnswerError
        A file is missing, or was changed since the key was written.
    """
    for student in key.variants:
        key.robot_of(student)
    names = [FILE, TASK, *(f"{ROBOTS}/{student}.toml" for student in key.variants)]
    return {name: _content(key.folder / name, _ROBOT_BYTES, "a key") for name in names}


def _rubric_of(sheet: AnswerSheet, path: Path) -> Rubric:
    rubric = Rubric.from_data(sheet.rubric or {}, f"{path}: rubric: ")
    rubric.require_mistakes(LIBRARY, f"{path}: rubric: ")
    return rubric


def _content(path: Path, most: int, what: str) -> bytes:
    try:
        return read_bounded(path, most, what)
    except DescriptionError as error:
        raise AnswerError(str(error)) from None
