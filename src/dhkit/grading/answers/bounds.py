"""Bounds on answers: sheets, papers, notebooks and programs of students."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Largest sizes that are read; a larger one is refused with a message that names the bound, or is cut."""

    # Sheets and files.
    sheet_bytes: int = 4_000_000
    """Size of a sheet: a PUMA's M and C, multiplied out in numbers, are 2 MB."""
    names: int = 100
    """Names that a student defines."""
    branches: int = 64
    """Branches of inverse kinematics."""
    steps: int = 64
    """Steps of inverse kinematics, and equations and solutions of one step."""
    listed_statements: int = 20
    """Statements of a program or a document that are listed as left out."""
    code_characters: int = 1_000_000
    """Characters of code or LaTeX; a notebook may be longer, since its figures do not count."""
    unread_characters: int = 1_000
    """Characters that are kept of an entry that cannot be read."""

    # Formulas.
    entry_characters: int = 200_000
    """Characters of one entry: a PUMA's first, multiplied out in numbers, has 30,000."""
    nesting: int = 50
    """Depth of nested brackets, and of nested arguments in LaTeX."""
    letters: int = 64
    """Letters in a row in LaTeX."""
    tokens: int = 300_000
    """Tokens of an answer, its names written out."""
    meaning_tokens: int = 20_000
    """Tokens that a student's own name stands for, after the names in its meaning are replaced."""
    entry_name_characters: int = 40
    """Characters of a name that may be an entry."""
    name_characters: int = 64
    """Characters of a name that is taken apart."""
    derivative_nodes: int = 2_000
    """Nodes of a derivative: a product of k factors becomes up to k products of k factors."""
    object_nodes: int = 20_000
    """Nodes of an expression of sympy or CasADi: a PUMA's inverse dynamics in CasADi has 1,100."""
    shown_casadi_nodes: int = 500
    """Nodes of a CasADi expression that is shown as its text."""
    shown_casadi_characters: int = 1_000
    """Characters of the text of a CasADi expression."""
    pretty_lines: int = 200
    """Lines of a formula that sympy has drawn with characters."""
    pretty_columns: int = 2_000
    """Characters of one of these lines."""
    pretty_nesting: int = 30
    """Depth of fractions, powers and brackets inside one another in such a formula."""

    # Matrices.
    matrix_entries: int = 1_024
    """Entries of a matrix."""
    diagonal_rows: int = 30
    """Rows of a matrix that is given by its diagonal: arms have fewer joints."""
    matrix_power: int = 8
    """Power of a matrix."""
    matrix_products: int = 64
    """Products of matrices in an answer, powers written out."""
    entry_products: int = 20_000
    """Products of two entries in an answer."""

    # Documents and programs.
    statements: int = 5_000
    """Statements of a document or a program; those of a function count each time that it is applied."""
    definitions: int = 2_000
    """Names that the answers of one file are made of: reading each takes about a millisecond. Definitions that are
    looked through for one formula may be ten times as many."""
    macros: int = 300
    """Macros that a document defines."""
    blank_pieces: int = 8
    """Pieces in front of a row that may all be blank: labels and line breaks."""
    row_ending_characters: int = 200
    """Characters at the end of a row that are searched for an operator or punctuation: bounds the time."""
    side_characters: int = 200
    """Characters of a side of an equation that may be a name."""
    matlab_tokens: int = 200_000
    """Tokens of one statement in MATLAB."""
    call_depth: int = 20
    """Depth of calls of the program's own functions."""
    index: int = 1_000
    """Index of an entry, and dimension of a matrix, that is read."""
    symbol_index: int = 1_000
    """Index in ``symbols('q1:4')``."""

    # Answers of executed programs.
    file_name_characters: int = 60
    """Characters of the name of the copy that is executed."""
    executed_names: int = 2_000
    """Names, and functions, of a program."""
    value_nesting: int = 6
    """Depth of lists and objects in a value."""
    list_values: int = 1_000
    """Values of a list."""


BOUNDS = Bounds()
