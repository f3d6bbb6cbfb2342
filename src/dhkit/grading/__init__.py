"""Grading of students' work: answers are read as text, judged exactly, explained, marked and reported."""

from dhkit.grading.catalogue import LIBRARY
from dhkit.grading.entry_points import grade, grade_answers, robot_of
from dhkit.grading.grade_report import Diagnosis, Entry, GradeReport, Verdict, Witness
from dhkit.grading.marks import Mark, Marks, marks
from dhkit.grading.options import GradeOptions
from dhkit.grading.remarks import Note, NoteKind
from dhkit.grading.rubric import Credit, Rubric
from dhkit.grading.variants import Variant, VariantKey, Variants

__all__ = [
    "LIBRARY",
    "Credit",
    "Diagnosis",
    "Entry",
    "GradeOptions",
    "GradeReport",
    "Mark",
    "Marks",
    "Note",
    "NoteKind",
    "Rubric",
    "Variant",
    "VariantKey",
    "Variants",
    "Verdict",
    "Witness",
    "grade",
    "grade_answers",
    "marks",
    "robot_of",
]
