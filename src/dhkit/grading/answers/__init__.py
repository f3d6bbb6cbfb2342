"""Answers read as text: notations, names, sheets, source files and other libraries' objects; nothing is executed."""

from dhkit.grading.answers.matrices import read_matrix
from dhkit.grading.answers.reading import read_answer
from dhkit.grading.answers.vocabulary import Vocabulary

__all__ = ["Vocabulary", "read_answer", "read_matrix"]
