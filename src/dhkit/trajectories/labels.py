"""Labels of the files that dhkit writes: kind, robot and digest, in an archive's texts or a table's first comments."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.description import Description, from_toml, library_robot, robots, to_toml
from dhkit.description.files import read_bounded
from dhkit.errors import DescriptionError

TEXTS = ("format", "robot", "digest", "toml", "content")
"""Names of an archive's texts: its kind and version, the robot's name, digest and whole file, the arrays' digest."""
_DIGEST_DIGITS = 16
"""Length of digests of content; they detect damage and changes by hand, not forgery."""
_CONTENT = "# content: "
"""Beginning of a table's third line."""
_LABEL_LENGTH = 1000
"""Number of characters that hold a table's first two lines."""


@dataclass(frozen=True)
class FileKind:
    """A kind of file that dhkit writes for one robot."""

    noun: str
    """Name of the content in messages, such as ``trajectory``."""
    arrays: tuple[str, ...]
    """Names of an archive's arrays of numbers."""
    most: int
    """Largest size of a file, and of its unpacked content, bytes."""
    optional: tuple[str, ...] = ()
    """Names of further arrays that an archive may have."""
    otherwise: str = ""
    """Advice in messages on tables that do not name their robot."""

    @property
    def title(self) -> str:
        """First comment of a table."""
        return f"dhkit {self.noun}"

    @property
    def version(self) -> str:
        """An archive's text ``format``."""
        return f"{self.title} 1"

    def read(self, path: Path, known: tuple[str, ...]) -> tuple[str, bytes]:
        """Return a file's suffix, one of the known ones, and its bytes.

        Raises
        ------
        DescriptionError
            Another suffix, or a file that cannot be read or is too long.
        """
        try:
            suffix = checked_suffix(path, known)
        except ValueError as error:
            raise DescriptionError(str(error)) from None
        return suffix, read_bounded(path, self.most, f"a {self.noun}")

    def archived(self, description: Description, arrays: Mapping[str, Any]) -> dict[str, Any]:
        """Return the content of an archive: the robot as texts, and arrays by name."""
        texts = (
            self.version,
            description.name,
            description.digest,
            to_toml(description),
            self._digest_of_arrays(arrays),
        )
        return dict(zip(TEXTS, texts, strict=True)) | dict(arrays)

    def require_whole(self, values: Mapping[str, Any]) -> None:
        """Check that an archive's arrays are unchanged since dhkit wrote them.

        Raises
        ------
        DescriptionError
            Their digest differs from the one in the archive.
        """
        if values["content"] != self._digest_of_arrays(values):
            raise DescriptionError(
                "its numbers differ from those that were written; the file is damaged"
            )

    def _digest_of_arrays(self, arrays: Mapping[str, Any]) -> str:
        # Shapes are left out: MATLAB adds and drops axes of length 1.
        found = hashlib.sha256()
        for name in (*self.arrays, *self.optional):
            if name in arrays:
                numbers = np.ascontiguousarray(arrays[name], dtype="<f8")
                found.update(f"{name} {numbers.size}\n".encode() + numbers.tobytes())
        return found.hexdigest()[:_DIGEST_DIGITS]

    def robot_of_archive(
        self, values: Mapping[str, Any], description: Description | None
    ) -> Description:
        """Return the robot of an archive: the one given, the library's if it is equal, or the archive's own.

        Raises
        ------
        DescriptionError
            Another kind or version of file, a robot that does not fit its name and digest, or another than the given.
        """
        if values["format"] != self.version:
            raise DescriptionError(
                f"format is {values['format'][:40]!r}; expected {self.version!r}"
            )
        own = from_toml(values["toml"], file="its robot")
        if own.digest != values["digest"] or own.name != values["robot"]:
            raise DescriptionError(
                f"its robot is not the {values['robot'][:40]!r} that it names; the file is damaged"
            )
        if description is not None:
            return self._same_robot(own.name, own.digest, description)
        # The library's robot has the folder of its meshes.
        return library_robot(own.name) if _in_library(own.name, own.digest) else own

    def labelled(self, description: Description, text: str) -> str:
        """Return a table after its label: comments with kind, robot, and digest of robot and lines."""
        robot = f"# robot: {description.name} {description.digest}"
        return f"# {self.title}\n{robot}\n{_CONTENT}{_digest_of_lines([robot, *text.splitlines()])}\n{text}"

    def require_unchanged(self, text: str) -> None:
        """Check that a table's lines are unchanged since dhkit wrote them.

        Raises
        ------
        DescriptionError
            No digest in its third line, or another than that of the lines that follow.
        """
        lines = text.splitlines()
        if len(lines) < 3 or not lines[2].startswith(_CONTENT):
            raise DescriptionError(
                f"no comment '{_CONTENT}DIGEST' in its third line{self.otherwise}"
            )
        if lines[2].removeprefix(_CONTENT).strip() != _digest_of_lines([lines[1], *lines[3:]]):
            raise DescriptionError(
                f"changed since dhkit wrote it: its digest differs{self.otherwise}"
            )

    def robot_of_table(self, text: str, description: Description | None) -> Description:
        """Return the robot that a table's first two comments name: the one given, or the library's.

        Raises
        ------
        DescriptionError
            Other comments, another robot than the given, or none given and one that the library does not have.
        """
        lines = text[:_LABEL_LENGTH].splitlines()[:2]
        words = lines[1].removeprefix("# robot: ").split() if len(lines) == 2 else []
        if (
            not lines
            or lines[0] != f"# {self.title}"
            or len(words) != 2
            or not lines[1].startswith("# robot: ")
        ):
            raise DescriptionError(
                f"does not begin with '# {self.title}' and '# robot: NAME DIGEST'{self.otherwise}"
            )
        name, digest = words
        if description is not None:
            return self._same_robot(name, digest, description)
        if not _in_library(name, digest):
            raise DescriptionError(
                f"its robot {name[:40]} ({digest[:12]}) is not the library's; give the robot, or a file of .npz, which"
                " holds it"
            )
        return library_robot(name)

    def _same_robot(self, name: str, digest: str, description: Description) -> Description:
        if description.digest != digest:
            raise DescriptionError(
                f"this {self.noun} was made for the robot {name[:40]} (digest {digest[:12]}); expected one for"
                f" {description.name} (digest {description.digest})"
            )
        return description


def checked_suffix(path: Path, known: tuple[str, ...]) -> str:
    """Return a path's suffix in lower case.

    Raises
    ------
    ValueError
        The suffix is none of ``known``.
    """
    suffix = path.suffix.lower()
    if suffix not in known:
        raise ValueError(
            f"{path}: found suffix {path.suffix!r}; expected one of {', '.join(known)}"
        )
    return suffix


def decoded(content: bytes) -> str:
    """Return a file's text.

    Raises
    ------
    DescriptionError
        The file is not UTF-8; names the byte.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DescriptionError(f"byte {error.start} is not UTF-8; expected text") from None


def _digest_of_lines(lines: Sequence[str]) -> str:
    # Independent of line ends, which mail and version control change.
    return hashlib.sha256("\n".join(lines).rstrip().encode()).hexdigest()[:_DIGEST_DIGITS]


def _in_library(name: str, digest: str) -> bool:
    return name in robots() and library_robot(name).digest == digest
