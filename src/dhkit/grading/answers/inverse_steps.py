"""Steps of inverse kinematics as syntax trees: equations with two sides, and solutions with their signs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Tree
from dhkit.grading.answers.reading import read_answer
from dhkit.grading.answers.sheet_values import InverseStep
from dhkit.grading.answers.tokens import quote
from dhkit.grading.answers.vocabulary import Vocabulary

EQUALS = re.compile(r"&?\s*(?<![<>!=])==?(?!=)")
"""What stands between the two sides of an equation."""
EITHER_SIGN = re.compile(r"±|\\pm\b|\+/?-(?=[^+-])")
"""Plus or minus: two formulas in one."""
HEAD = re.compile(r"^\s*[A-Za-z_\\{}]*[0-9]*[_{}0-9]*\s*=(?!=)")
"""The name of a joint before its formula: q1 = ..."""


@dataclass(frozen=True)
class GivenStep:
    """A step as it was read.

    Attributes
    ----------
    joint
        The joint, from 0.
    text
        Its formulas as they were typed.
    equations
        Both sides of each equation.
    solutions
        Formulas of the joint's value, one for each root.
    error
        Why a formula could not be read; empty if all were.
    """

    joint: int
    text: str
    equations: tuple[tuple[Tree, Tree], ...] = ()
    solutions: tuple[Tree, ...] = ()
    error: str = ""


def given_steps(steps: Sequence[InverseStep], vocabulary: Vocabulary) -> list[GivenStep]:
    """Return the steps of a sheet; one that cannot be read says why."""
    return [_given(step, vocabulary) for step in steps]


def _given(step: InverseStep, vocabulary: Vocabulary) -> GivenStep:
    text = "; ".join([*step.equations, *(f"q{step.joint} = {formula}" for formula in step.solutions)])
    try:
        equations = tuple(_equation(equation, vocabulary) for equation in step.equations)
        solutions = tuple(
            read_answer(formula, vocabulary) for given in step.solutions for formula in _with_both_signs(given)
        )
    except AnswerError as error:
        return GivenStep(step.joint - 1, text, error=str(error))
    return GivenStep(step.joint - 1, text, equations, solutions)


def _equation(text: str, vocabulary: Vocabulary) -> tuple[Tree, Tree]:
    sides = EQUALS.split(text)
    if len(sides) != 2:
        raise AnswerError(f"{quote(text)}: {len(sides) - 1} equals signs; expected an equation with one")
    left, right = (read_answer(side, vocabulary) for side in sides)
    return left, right


def _with_both_signs(text: str) -> list[str]:
    """Return a formula, or two where it has the sign ±: first with +, then with -."""
    text = HEAD.sub("", text)
    if not EITHER_SIGN.search(text):
        return [text]
    return [EITHER_SIGN.sub(sign, text) for sign in "+-"]
