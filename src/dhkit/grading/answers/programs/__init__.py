"""Answers out of Python, MATLAB and notebooks: what each name stands for, by rules that leave nothing out.

A program is parsed into bindings (``bindings.py``), its names are resolved (``standing.py``), and the formulas of its
answers are written out in names of the robot (``definitions.py``, ``program_answers.py``). Nothing is ever run.
"""
