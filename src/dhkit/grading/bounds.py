"""Bounds on submissions other than answers: folders, rubrics, reports of other processes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Largest sizes that are read or shown; :mod:`dhkit.grading.answers.bounds` has those of answers."""

    # Folders of sheets.
    folder_depth: int = 8
    """Depth of folders below the one that is graded."""
    files: int = 200_000
    """Files and folders that are visited: a student may hand in a whole disk."""
    sheets: int = 10_000
    """Sheets of one folder."""
    listed_files: int = 20
    """Unread files that are listed by name."""
    robot_name_characters: int = 200
    """Characters of the name of a robot file that a sheet may give."""
    rubric_bytes: int = 100_000
    """Size of a rubric."""

    # Archives of sheets.
    archive_bytes: int = 4_000_000_000
    """Size of all files of an archive: three hundred students hand in scans and pictures too."""
    archive_ratio: int = 100
    """Size of all files of an archive, as a multiple of its own."""
    archive_free_bytes: int = 100_000_000
    """Size of all files of an archive to which the ratio does not apply: a class of equal sheets packs well."""
    archive_depth: int = 20
    """Folders in which a file of an archive may lie."""
    metadata_bytes: int = 50_000_000
    """Size of the file in which Gradescope names the submitters; it has the results of all autograders."""

    # Variants.
    varied_parameters: int = 30
    """Parameters, and robots, that a task lets vary: their numbers are compared in pairs."""
    students_bytes: int = 10_000_000
    """Size of a list of students: a course system's table has many columns."""
    key_bytes: int = 50_000_000
    """Size of the key of a task's variants: some hundred bytes for a student."""

    # Reports.
    report_bytes: int = 20_000_000
    """Size of a report that is accepted from a process."""
    report_file_bytes: int = 500_000_000
    """Size of a file of reports, one a line: enough for a thousand students with long answers."""
    shown_characters: int = 4000
    """Characters shown of one answer or message: an answer may be a megabyte."""
    converted_characters: int = 4000
    """Characters of LaTeX that are converted to MathML: nobody reads a longer equation, and it takes seconds."""
    notebook_characters: int = 400
    """Characters of an answer, and of a statement about one, that a notebook shows."""


BOUNDS = Bounds()
