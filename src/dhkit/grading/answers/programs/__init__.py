"""Answers out of Python, MATLAB and notebooks, whose statements are read one after the other and never run.

    text -> statements -> Scope -> AnswerSheet
    (ast, matlab_tokens; python_program, matlab_program; program_answers)

A ``Scope`` binds each name once to a value (``values.py``): a formula as text, a matrix of them, a function, or
``Unread`` with the reason. An answer is judged if all names that it is made of were bound once, to values that are
read, and are not changed anywhere else in the file. Functions of the file are applied to their arguments.
``library.py`` has the functions of SymPy, NumPy and MATLAB that are known, ``python_changes.py`` finds what statements
that are not read may change.
"""
