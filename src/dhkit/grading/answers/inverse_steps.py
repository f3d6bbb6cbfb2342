"""Steps of inverse kinematics as syntax trees: equations with two sides, and solutions with their signs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Name, Number, Product, Sum, Tree
from dhkit.grading.answers.pose_entries import with_pose_entries
from dhkit.grading.answers.reading import answer_tokens, meaning_of, read_answer
from dhkit.grading.answers.rewriting import to_plain_grammar
from dhkit.grading.answers.sheet_values import InverseStep
from dhkit.grading.answers.tokens import nesting, quote
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, Vocabulary

EQUALS = re.compile(r"&?\s*(?<![<>!=:])==?(?!=)\s*&?")
"""What stands between the two sides of an equation."""
EITHER_SIGN = re.compile(r"±|∓|\\pm\b|\\mp\b|\+/-|-/\+")
"""Plus or minus, and minus or plus: two formulas in one."""
UNCLEAR_SIGN = re.compile(r"\+-(?=\s*[A-Za-z\\(])")
"""Signs that may be meant as plus or minus, or as a minus that a program wrote."""
EQUATION_NUMBER = re.compile(
    r"(?:\\(?:tag|label|eqno)\s*\{[^{}]*\}|\\(?:nonumber|notag|quad|qquad)\b|\\\\|(?<=[\w)\]}²])\s+\(\s*(?:[A-Z]\.)?\d+(?:\.\d+)*[a-z]?\s*\)"
    r"|[.,;\s])+$"
)
"""What may stand behind a formula: its number in the text, marks of typesetting."""
OBJECT = re.compile(r"^\s*(?:\w+\.)?Eq\s*\((.*)\)$", re.DOTALL)
"""An equation of sympy's: Eq(left, right)."""
TURNED_BACK = re.compile(
    r"^\s*(?:\w+\.)?(?:wrapToPi|wrapTo2Pi|wrap_to_pi|mod|fmod)\s*\((.*?)(?:,\s*2\s*\*?\s*(?:\w+\.)?pi\s*)?\)$",
    re.DOTALL,
)
"""A formula whose whole turns are taken off, which changes nothing."""
ANOTHER = re.compile(r"[,;]\s*(?:where|with)?\s*(?=[^,;=()]*=)")
"""What stands between a formula and the definition of a quantity in it."""
COMMA = re.compile(",")


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
    """Return the steps of a sheet; one that cannot be read says why.

    An equation ``D = ...`` of an unknown name defines it, for its own step and those behind.
    """
    given: list[GivenStep] = []
    for step in steps:
        text = "; ".join([*step.equations, *(_titled(step.joint, formula) for formula in step.solutions)])
        try:
            if step.joint - 1 in [other.joint for other in given if not other.error]:
                raise AnswerError(f"joint {step.joint} has a step already; expected all of its formulas in one")
            given.append(_Reading(step.joint, vocabulary).step(step, text))
        except AnswerError as error:
            hint = "; a quantity of your own is defined by an equation, D = ..." if "unknown name" in str(error) else ""
            given.append(GivenStep(step.joint - 1, text, error=f"{error}{hint}"))
    return given


def _titled(joint: int, formula: str) -> str:
    return formula if EQUALS.search(formula) else f"q{joint} = {formula}"


class _Reading:
    """Reading of one step.

    Parameters
    ----------
    joint
        The joint that the step finds, from 1.
    vocabulary
        What names mean; definitions are added to it.
    """

    def __init__(self, joint: int, vocabulary: Vocabulary) -> None:
        self.joint, self.vocabulary = joint, vocabulary

    def step(self, step: InverseStep, text: str) -> GivenStep:
        equations, solutions = list[tuple[Tree, Tree]](), list[Tree]()
        for equation in step.equations:
            for left, right in self._equations(self._plain(equation)):
                if not step.solutions and self._is_solution(left, right):
                    solutions += self._both_signs(right)
                else:
                    equations.append(self._equation(left, right))
        for formula in step.solutions:
            solutions += self._solutions(self._plain(formula))
        if not equations and not solutions:
            raise AnswerError(f"{quote(text)}: defines quantities, and has no equation or solution of q{self.joint}")
        return GivenStep(self.joint - 1, text, tuple(equations), tuple(solutions))

    def _plain(self, text: str) -> str:
        """Return a formula without its number in the text, and with entries of the pose by name."""
        if UNCLEAR_SIGN.search(text):
            raise AnswerError(f"{quote(text)}: '+-' may be ± or a minus; write ± or +(-...)")
        return with_pose_entries(EQUATION_NUMBER.sub("", text), self.vocabulary)

    def _read(self, text: str) -> Tree:
        return read_answer(text, self.vocabulary)

    def _sides(self, text: str) -> list[str]:
        """Return the sides of a chain of equations; those that are names without a meaning are defined, and left out.

        A chain that only defines has one side left.
        """
        made = OBJECT.match(text)
        sides = _parts(made[1], COMMA) if made else EQUALS.split(text)
        new = [name for name in map(self._new_name, sides) if name]
        known = [side for side in sides if not self._new_name(side)]
        if new and known:
            if EITHER_SIGN.search(known[-1]):
                raise AnswerError(f"{quote(text)}: defines {quote(new[0])} with two signs; write ± where it is used")
            for name in new:
                self.vocabulary.redefine(name, meaning_of(known[-1], self.vocabulary))
        return known if new else sides

    def _new_name(self, side: str) -> str:
        """Return the name that a side consists of, if it has no meaning yet; else nothing."""
        try:
            tokens = answer_tokens(side.strip(), self.vocabulary)
        except AnswerError:
            return ""
        if len(tokens) != 1 or tokens[0].kind != "name" or tokens[0].text in FUNCTION_NAMES:
            return ""
        name = tokens[0].text
        return "" if self.vocabulary.knows(name) and not self.vocabulary.is_alias(name) else name

    def _equations(self, text: str) -> list[tuple[str, str]]:
        """Return the sides of the equations of a text: a chain has several, a definition none."""
        sides = self._sides(text)
        if len(sides) == 1 and EQUALS.search(text):
            return []
        if len(sides) < 2 or not all(side.strip() for side in sides):
            raise AnswerError(f"{quote(text)}: no equals sign between two sides; expected an equation")
        return list(pairwise(sides))

    def _is_solution(self, left: str, right: str) -> bool:
        """Whether an equation has the step's joint on its left side, and not on its right."""
        own = f"q{self.joint}"
        if EITHER_SIGN.search(left) or not _is_name(self._read(left), own):
            return False
        plain = _with_sign(right, "+")
        return own not in [
            x.text for x in to_plain_grammar(answer_tokens(plain, self.vocabulary), self.vocabulary, plain)
        ]

    def _equation(self, left: str, right: str) -> tuple[Tree, Tree]:
        """Return both sides; with two signs the product of both equations, each less its right side, and zero."""
        if not EITHER_SIGN.search(left + right):
            return self._read(left), self._read(right)
        differences = [
            Sum(((True, self._read(_with_sign(left, sign))), (False, self._read(_with_sign(right, sign)))))
            for sign in "+-"
        ]
        return Product(tuple((True, difference) for difference in differences)), Number(Fraction(0), "0", 0)

    def _both_signs(self, text: str) -> list[Tree]:
        """Return a formula, or two where it has the sign ±: first with +, then with -."""
        text = EQUATION_NUMBER.sub("", text)
        if wrapped := TURNED_BACK.match(text):
            text = wrapped[1]
        if not EITHER_SIGN.search(text):
            return [self._read(text)]
        return [self._read(_with_sign(text, sign)) for sign in "+-"]

    def _solutions(self, text: str) -> list[Tree]:
        """Return the formulas of a solution; definitions may stand behind it, and the joint's name in front."""
        formula, *others = _parts(text, ANOTHER)
        for other in others:
            if len(self._sides(other)) != 1:
                raise AnswerError(f"{quote(other)}: no definition of a new name, behind a solution")
        sides = EQUALS.split(formula)
        for head in sides[:-1]:
            if self._new_name(head) or not _is_name(self._read(head), f"q{self.joint}"):
                raise AnswerError(f"{quote(head.strip())} stands in front of a solution of q{self.joint}")
        return self._both_signs(sides[-1])


def _is_name(tree: Tree, text: str) -> bool:
    return isinstance(tree, Name) and tree.text == text


def _with_sign(text: str, sign: str) -> str:
    """Return a formula with ± read as a sign, and ∓ as the other."""
    other = "-" if sign == "+" else "+"
    return EITHER_SIGN.sub(lambda match: other if match[0] in ("∓", r"\mp", "-/+") else sign, text)


def _parts(text: str, separator: re.Pattern[str]) -> list[str]:
    """Return the parts of a text between separators outside brackets."""
    depth, begin, parts = 0, 0, []
    for at, character in enumerate(text):
        depth += nesting(character)
        if depth == 0 and at >= begin and (match := separator.match(text, at)):
            parts.append(text[begin:at])
            begin = match.end()
    return [*parts, text[begin:]]
