"""The instructor's key of a task's variants: each student's arm, from which grading runs."""

from __future__ import annotations

import hashlib
import json
import unicodedata
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from dhkit.cached_property import cached_property
from dhkit.description import Description, read_robot, to_toml
from dhkit.description.files import read_bounded
from dhkit.display import counted, repr_line
from dhkit.errors import AnswerError, DescriptionError
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.sheet_judge import package_version
from dhkit.grading.variants.students import student_id
from dhkit.grading.variants.variants import Variant, Variants

FORMAT = 1
"""Version of the key's format."""
FILE = "variants.json"
TASK = "task.toml"
ROBOTS = "robots"


@dataclass(frozen=True, repr=False)
class VariantKey:
    r"""The key of a task's variants: a folder with ``variants.json``, the task, and a robot file for each student.

    Attributes
    ----------
    folder
        The folder.
    seed
        Seed of the variants.
    digest
        SHA-256 of the task's file, hexadecimal.
    variants
        For each student the robot, the convention, the drawn numbers and the SHA-256 of the robot file.

    Examples
    --------
    >>> from pathlib import Path
    >>> text = 'robot = "planar2r"\n[variants.parameters]\nl1 = [0.3, 0.6]\n'
    >>> size = Path("task.toml").write_text(text)
    >>> variants = Variants.load("task.toml")
    >>> for name, content in key_files(variants, Path("task.toml"), [variants.of("ada", 7)], 7).items():
    ...     Path("key", name).parent.mkdir(parents=True, exist_ok=True)
    ...     size = Path("key", name).write_bytes(content)
    >>> key = VariantKey.read("key")
    >>> key.robot_of("ada").parameters["l1"].text
    '0.36'
    >>> key.robot_of("bob")
    Traceback (most recent call last):
    ...
    dhkit.errors.AnswerError: student 'bob' has no variant in key; not judged
    """

    folder: Path
    seed: int
    digest: str
    variants: Mapping[str, Mapping[str, object]] = field(repr=False)

    @classmethod
    def read(cls, path: str | Path) -> VariantKey:
        """Read a key.

        Parameters
        ----------
        path
            The folder of the key, or its ``variants.json``.

        Returns
        -------
        VariantKey
            The key; robot files are read when they are asked for.

        Raises
        ------
        AnswerError
            The file is missing or is not a key.
        """
        path = Path(path)
        file = path / FILE if path.is_dir() else path
        content = read_bounded(file, BOUNDS.key_bytes, "the key of a task's variants", AnswerError)
        refusal = AnswerError(f"{file}: not the key of a task's variants, format {FORMAT}")
        try:
            data = json.loads(content)
        except (ValueError, RecursionError):
            raise refusal from None
        if not isinstance(data, dict) or data.get("format") != FORMAT:
            raise refusal
        seed = data.get("seed")
        digest = data.get("task_sha256")
        students = data.get("students")
        if (
            not isinstance(seed, int)
            or not isinstance(digest, str)
            or not isinstance(students, dict)
        ):
            raise refusal
        for student, variant in students.items():
            if student_id(student) != student or not isinstance(variant, dict):
                raise refusal
        return cls(file.parent, seed, digest, students)

    @property
    def task(self) -> Path:
        """The task's file, whose robot and ranges no longer count."""
        return self.folder / TASK

    @cached_property
    def _ids(self) -> dict[str, str]:
        return {_comparable(student): student for student in self.variants}

    def __contains__(self, student: str) -> bool:
        """Whether the key has a student; case does not count."""
        return _comparable(student) in self._ids

    def robot_of(self, student: str) -> Description:
        """Return a student's arm.

        Parameters
        ----------
        student
            The student's id; case does not count.

        Returns
        -------
        Description
            The arm by which the student's answers are judged.

        Raises
        ------
        AnswerError
            The key has no such student, or the robot file is not the one that was written with the key.
        """
        found = self._ids.get(_comparable(student))
        if found is None:
            raise AnswerError(
                f"student {student[:80]!r} has no variant in {self.folder}; not judged"
            )
        path = self.folder / ROBOTS / f"{found}.toml"
        try:
            content = path.read_bytes()
            if hashlib.sha256(content).hexdigest() != self.variants[found].get("robot_sha256"):
                raise AnswerError(f"{path}: not the robot file that was written with {FILE}")
            return read_robot(path)
        except (OSError, DescriptionError) as error:
            raise AnswerError(f"{path}: {error}") from None

    @cached_property
    def examples(self) -> tuple[Description, ...]:
        """An arm for each robot and convention in the key: students with the same have other numbers in it alone."""
        first: dict[tuple[object, object], str] = {}
        for student, variant in self.variants.items():
            first.setdefault((variant.get("robot"), variant.get("convention")), student)
        arms = []
        for student in first.values():
            # A robot file that is missing or was changed is told where its student's sheets are judged.
            with suppress(AnswerError):
                arms.append(self.robot_of(student))
        return tuple(arms)

    def changed(self, variants: Sequence[Variant]) -> list[str]:
        """Return the students who are in the key with other numbers than these variants have.

        Parameters
        ----------
        variants
            Variants of a later run.

        Returns
        -------
        list[str]
            Their ids.
        """
        return [
            variant.student
            for variant in variants
            if variant.student in self.variants
            and self.variants[variant.student] != _entry(variant)
        ]

    def __repr__(self) -> str:
        students = counted(len(self.variants), "student")
        return repr_line("VariantKey", str(self.folder), f"{students}, seed {self.seed}")


def _comparable(student: str) -> str:
    """Return an id as file systems may change it: in one of Unicode's forms, whatever the case."""
    return unicodedata.normalize("NFC", student).casefold()


def key_files(
    variants: Variants, task: Path, drawn: Sequence[Variant], seed: int
) -> dict[str, bytes]:
    """Return the files of a key, by their path in its folder.

    Parameters
    ----------
    variants
        What varies.
    task
        The task's file.
    drawn
        The variants of all students.
    seed
        Seed of the variants.
    """
    content = {
        "format": FORMAT,
        "dhkit": package_version(),
        "seed": seed,
        "task_sha256": variants.digest,
        "students": {variant.student: _entry(variant) for variant in drawn},
    }
    text = json.dumps(content, ensure_ascii=False, indent=1)
    files = {FILE: f"{text}\n".encode(), TASK: task.read_bytes()}
    for variant in drawn:
        files[f"{ROBOTS}/{variant.student}.toml"] = to_toml(variant.description).encode()
    return files


def _entry(variant: Variant) -> dict[str, object]:
    robot, convention, values = variant.numbers
    return {
        "robot": robot,
        "convention": convention,
        "values": dict(values),
        "robot_sha256": hashlib.sha256(to_toml(variant.description).encode()).hexdigest(),
    }
