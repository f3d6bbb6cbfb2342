"""Steps of inverse kinematics as syntax trees: equations with two sides, and solutions with their signs."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree
from dhkit.expressions.trees import (
    equal_parts,
    names_of,
    operands,
    replaced_everywhere,
    with_operands,
)
from dhkit.grading.answers.pose_entries import with_pose_entries
from dhkit.grading.answers.reading import answer_tokens, meaning_of, read_answer
from dhkit.grading.answers.sheet_values import InverseStep
from dhkit.grading.answers.tokens import nesting, quote
from dhkit.grading.answers.typeset import typeset_equations
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, Meaning, Vocabulary, plain_name

_EQUALS = re.compile(r"&?\s*(?<![<>!=:])==?(?!=)\s*&?")
"""Sign between the two sides of an equation."""
_EITHER_SIGN = re.compile(r"±|∓|\\pm\b|\\mp\b|\+/-|-/\+")
"""Plus or minus, and minus or plus: two formulas in one."""
_UNCLEAR_SIGN = re.compile(r"\+-(?=\s*[A-Za-z\\(])")
"""Signs that may be meant as plus or minus, or as a minus that a program wrote."""
_EQUATION_NUMBER = re.compile(
    r"(?:\\(?:tag|label|eqno)\s*\{[^{}]*\}|\\(?:nonumber|notag|quad|qquad)\b|\\\\|(?<=[\w)\]}²])\s+\(\s*(?:[A-Z]\.)?\d+(?:\.\d+)*[a-z]?\s*\)"
    r"|[.,;\s])+$"
)
"""Text that may follow a formula: its number in the text, marks of typesetting."""
_OBJECT = re.compile(r"^\s*(?:\w+\.)?Eq\s*\((.*)\)$", re.DOTALL)
"""An equation of sympy's: Eq(left, right)."""
_TURNED_BACK = re.compile(
    r"^\s*(?:\w+\.)?(?:wrapToPi|wrapTo2Pi|wrap_to_pi|mod|fmod)\s*\((.*?)(?:,\s*2\s*\*?\s*(?:\w+\.)?pi\s*)?\)$",
    re.DOTALL,
)
"""A formula whose whole turns are taken off, which changes nothing."""
_SQUARE_OF_NAME = re.compile(
    r"^\s*(\\?[A-Za-z]\w*)\s*(?:\^|\*\*)\s*(?:2|\{2\}|\(2\))\s*$", re.ASCII
)
"""The square of a name, on a side of its own: r^2 = px^2 + py^2 defines r."""
_FUNCTION_OF_NAME = re.compile(r"^\s*\\?(cos|tan)\s*\(?\s*(\\?[A-Za-z]\w*)\s*\)?\s*$", re.ASCII)
"""A function of a name on a side of its own: cos(gamma) = ... and tan(beta) = y/x define angles."""
_ANOTHER = re.compile(r"[,;]\s*(?:where|with)?\s*(?=[^,;=()]*=)")
"""Text between a formula and the definition of a quantity in it."""
_COMMA = re.compile(",")
_JOINT_LETTERS = ("q", "th", "Th", "varth")
"""Beginnings of names that are a joint's variable and nothing else: q1, theta_1, th1."""


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

    def changed(self, formula: Callable[[Tree], Tree]) -> GivenStep:
        """Return the step with a function applied to all its formulas."""
        equations = tuple((formula(left), formula(right)) for left, right in self.equations)
        return replace(self, equations=equations, solutions=tuple(map(formula, self.solutions)))

    @property
    def read_as(self) -> tuple[str, str]:
        """The step as it was read, in the robot's own names, as plain text and as LaTeX; empty if it is too long."""
        joint = Name(f"q{self.joint + 1}", 0)
        return typeset_equations(
            [*self.equations, *((joint, formula) for formula in self.solutions)]
        )


def given_steps(steps: Sequence[InverseStep], vocabulary: Vocabulary) -> list[GivenStep]:
    """Return the steps of a sheet; one that cannot be read says why.

    An equation ``D = ...`` of a name that is not a joint's defines it, for its own step and the later ones;
    ``r^2 = ...`` defines the length r. A name with two signs, ``S = ±sqrt(1 - D^2)``, holds for its own step.
    """
    given: list[GivenStep] = []
    defined: set[str] = set()
    for step in steps:
        text = "; ".join(
            [*step.equations, *(_titled(step.joint, formula) for formula in step.solutions)]
        )
        reading = _Reading(step.joint, vocabulary, frozenset(defined))
        try:
            if step.joint - 1 in [other.joint for other in given if not other.error]:
                raise AnswerError(
                    f"joint {step.joint} has a step already; expected all of its formulas in one"
                )
            given.append(reading.step(step, text))
        except AnswerError as error:
            hint = (
                "; a quantity of your own is defined by an equation, D = ..."
                if "unknown name" in str(error)
                else ""
            )
            given.append(GivenStep(step.joint - 1, text, error=f"{error}{hint}"))
        reading.forget_signs()
        defined |= reading.defined
    return given


def _titled(joint: int, formula: str) -> str:
    return formula if _EQUALS.search(formula) else f"q{joint} = {formula}"


class _Reading:
    """Reading of one step.

    Parameters
    ----------
    joint
        The joint that the step finds, from 1.
    vocabulary
        Meanings of names; definitions are added to it.
    earlier
        Names that earlier steps have defined: this one may define them anew.
    """

    def __init__(self, joint: int, vocabulary: Vocabulary, earlier: frozenset[str]) -> None:
        self.joint = joint
        self.vocabulary = vocabulary
        self.earlier = earlier
        self.defined: set[str] = set()
        self.has_solutions = False
        self.signed: dict[str, dict[str, Meaning]] = {}
        """Names that are defined with two signs, and their expression with each sign."""
        self.sides: list[tuple[Tree, dict[str, Tree]]] = []
        """Functions of the joint that an equation gives, cos(q2) = D, and their value with each sign."""

    def step(self, step: InverseStep, text: str) -> GivenStep:
        equations = list[tuple[Tree, Tree]]()
        solutions = list[Tree]()
        self.has_solutions = bool(step.solutions)
        for equation in step.equations:
            for left, right in self._equations(self._plain(equation)):
                if not step.solutions and self._is_solution(left, right):
                    solutions += self._both_signs(right)
                else:
                    equations.append(self._equation(left, right))
                    self._keep_function(left, right)
        for formula in step.solutions:
            solutions += self._solutions(self._plain(formula))
        if not equations and not solutions:
            raise AnswerError(
                f"{quote(text)}: defines quantities, and has no equation or solution of q{self.joint}"
            )
        return GivenStep(self.joint - 1, text, tuple(equations), tuple(solutions))

    def _plain(self, text: str) -> str:
        """Return a formula without its number in the text, and with entries of the pose by name."""
        if _UNCLEAR_SIGN.search(text):
            raise AnswerError(f"{quote(text)}: '+-' may be ± or a minus; write ± or +(-...)")
        return with_pose_entries(_EQUATION_NUMBER.sub("", text), self.vocabulary)

    def forget_signs(self) -> None:
        """Take the names with two signs back: which sign a later step means is not known."""
        for name in self.signed:
            self.vocabulary.refuse(
                name, f"it has two signs; write the sine or cosine of q{self.joint} in its place"
            )

    def _read(self, text: str, sign: str = "+") -> Tree:
        """Return the tree of a formula, with ± as a sign."""
        self._take_sign(sign)
        return _without_squared_roots(read_answer(_with_sign(text, sign), self.vocabulary))

    def _take_sign(self, sign: str) -> None:
        """Let names with two signs stand for their expression with one of them."""
        for name, meanings in self.signed.items():
            self.vocabulary.redefine(name, meanings[sign])

    def _meaning(self, text: str, sign: str) -> Meaning:
        self._take_sign(sign)
        return meaning_of(_with_sign(text, sign), self.vocabulary)

    def _keep_function(self, left: str, right: str) -> None:
        """Keep the value of a function of the joint: cos(q2) = D makes atan2(sqrt(1 - c2^2), c2) one of D."""
        own = f"q{self.joint}"
        for one, other in ((left, right), (right, left)):
            function = self._read(one)
            if (
                _EITHER_SIGN.search(one)
                or not isinstance(function, Call)
                or own not in names_of(function)
            ):
                continue
            values = {sign: self._with_values(self._read(other, sign), sign) for sign in "+-"}
            if not any(own in names_of(value) for value in values.values()):
                self.sides.append((function, values))
                return

    def _with_values(self, tree: Tree, sign: str) -> Tree:
        """Return a tree with the values that equations give instead of functions of the joint."""
        for function, values in self.sides:
            places = equal_parts([function, tree])[id(function)]
            tree = replaced_everywhere(tree, places, values[sign])
        return tree

    def _sides(self, text: str) -> list[str]:
        """Return the sides of a chain of equations; those that are names without a meaning are defined, and left out.

        A chain that only defines has one side left.
        """
        made = _OBJECT.match(text)
        sides = _parts(made[1], _COMMA) if made else _EQUALS.split(text)
        new = [name for name in map(self._new_name, sides) if name]
        known = [side for side in sides if not self._new_name(side)]
        if new and known:
            for name in new:
                self._define(name, known[-1])
            return known
        if len(sides) == 2 and self._defines_by_function(*sides):
            return sides[1:]
        return sides

    def _defines_by_function(self, left: str, right: str) -> bool:
        """Define the name on the left side of r^2 = ..., cos(gamma) = ... or tan(beta) = y/x; whether there is one.

        A length is positive, and an angle of a triangle between 0 and pi; that of a quotient is in the quadrant of its
        numerator and denominator.
        """
        square = _SQUARE_OF_NAME.match(left)
        function = _FUNCTION_OF_NAME.match(left)
        if square and self._new_name(square[1]):
            self._define(square[1], f"sqrt({right})")
        elif function and function[1] == "cos" and self._new_name(function[2]):
            self._define(function[2], f"acos({right})")
        elif function and self._new_name(function[2]):
            numerator, slash, denominator = right.partition("/")
            is_quotient = (
                slash and "/" not in denominator and not any(map(nesting, numerator + denominator))
            )
            self._define(
                function[2],
                f"atan2({numerator}, {denominator})" if is_quotient else f"atan({right})",
            )
        else:
            return False
        return True

    def _define(self, name: str, text: str) -> None:
        """Let a name stand for a formula."""
        plus, minus = (self._meaning(text, sign) for sign in "+-")
        if plus != minus:
            self.signed[name] = {"+": plus, "-": minus}
        self.vocabulary.redefine(name, plus)
        self.defined.add(plain_name(name))

    def _new_name(self, side: str) -> str:
        """Return the name that a side consists of, if the side defines it; else nothing.

        A definition is not of a joint's variable, a parameter or the pose; names that are only spelled as one of these
        may be anything, such as phi1, theta23 = theta2 + theta3, s and D beside a parameter d.
        """
        try:
            tokens = answer_tokens(side.strip(), self.vocabulary)
        except AnswerError:
            return ""
        if len(tokens) != 1 or tokens[0].kind != "name":
            return ""
        name = tokens[0].text
        if name in FUNCTION_NAMES and len(name) > 1:
            return ""
        is_old = plain_name(name) in self.earlier - self.defined
        if is_old or not self.vocabulary.knows(name) or self.vocabulary.is_alias(name):
            return name
        is_free = not self.vocabulary.is_own(plain_name(name)) and self._is_no_joint(name)
        return name if is_free else ""

    def _is_no_joint(self, name: str) -> bool:
        """Whether a name that is spelled as a joint's variable may be something else."""
        tree = self._read(name)
        if isinstance(tree, Call):
            return False  # c2 and s23 are a cosine and a sine
        if not isinstance(tree, Name) or not self.vocabulary.is_position(name):
            return True
        is_found_here = tree.text == f"q{self.joint}" and not self.has_solutions
        return not plain_name(name).startswith(_JOINT_LETTERS) and not is_found_here

    def _equations(self, text: str) -> list[tuple[str, str]]:
        """Return the sides of the equations of a text: a chain has several, a definition none."""
        sides = self._sides(text)
        if len(sides) == 1 and _EQUALS.search(text):
            return []
        if len(sides) < 2 or not all(side.strip() for side in sides):
            raise AnswerError(
                f"{quote(text)}: no equals sign between two sides; expected an equation"
            )
        return list(pairwise(sides))

    def _is_solution(self, left: str, right: str) -> bool:
        """Whether an equation has the step's joint on its left side, and not on its right."""
        own = f"q{self.joint}"
        if _EITHER_SIGN.search(left) or not _is_name(self._read(left), own):
            return False
        return own not in names_of(self._with_values(self._read(right), "+"))

    def _equation(self, left: str, right: str) -> tuple[Tree, Tree]:
        """Return both sides; with two signs those of one equation that holds with either.

        It is left^2 = X for left = ±sqrt(X), else the product of both equations, each less its right side, and zero.
        """
        plus, minus = ((self._read(left, sign), self._read(right, sign)) for sign in "+-")
        if plus == minus:
            return plus
        if plus[0] == minus[0] and (square := _square_of_both(plus[1], minus[1])):
            return Power(plus[0], Number(Fraction(2), "2", 0), 0), square
        differences = [Sum(((True, left), (False, right))) for left, right in (plus, minus)]
        return Product(tuple((True, difference) for difference in differences)), Number(
            Fraction(0), "0", 0
        )

    def _both_signs(self, text: str) -> list[Tree]:
        """Return a formula, or two where it has the sign ±: first with +, then with -."""
        text = _EQUATION_NUMBER.sub("", text)
        if wrapped := _TURNED_BACK.match(text):
            text = wrapped[1]
        plus, minus = (self._with_values(self._read(text, sign), sign) for sign in "+-")
        return [plus] if plus == minus else [plus, minus]

    def _solutions(self, text: str) -> list[Tree]:
        """Return the formulas of a solution; definitions may follow it, and the joint's name in front."""
        formula, *others = _parts(text, _ANOTHER)
        for other in others:
            if len(self._sides(other)) != 1:
                raise AnswerError(f"{quote(other)}: no definition of a new name, after a solution")
        sides = _EQUALS.split(formula)
        for head in sides[:-1]:
            if self._new_name(head) or not _is_name(self._read(head), f"q{self.joint}"):
                raise AnswerError(
                    f"{quote(head.strip())} stands in front of a solution of q{self.joint}"
                )
        return self._both_signs(sides[-1])


def _is_name(tree: Tree, text: str) -> bool:
    return isinstance(tree, Name) and tree.text == text


def _without_squared_roots(tree: Tree) -> Tree:
    """Return a formula with X instead of sqrt(X)^2: r is a root where r^2 = X is given."""
    tree = with_operands(tree, [_without_squared_roots(child) for child in operands(tree)])
    match tree:
        case Power(Call("sqrt", (radicand,)), Number(value)) if value == 2:
            return radicand
    return tree


def _square_of_both(plus: Tree, minus: Tree) -> Tree | None:
    """Return X if two formulas are sqrt(X) and -sqrt(X); else None."""
    match plus, minus:
        case (
            Call("sqrt", (radicand,)) | Sum(((True, Call("sqrt", (radicand,))),)),
            Sum(((False, Call("sqrt", (other,))),)),
        ) if radicand == other:
            return radicand
    return None


def _with_sign(text: str, sign: str) -> str:
    """Return a formula with ± read as a sign, and ∓ as the other."""
    other = "-" if sign == "+" else "+"
    return _EITHER_SIGN.sub(lambda match: other if match[0] in ("∓", r"\mp", "-/+") else sign, text)


def _parts(text: str, separator: re.Pattern[str]) -> list[str]:
    """Return the parts of a text between separators outside brackets."""
    depth = 0
    begin = 0
    parts = []
    for at, character in enumerate(text):
        depth += nesting(character)
        if depth == 0 and at >= begin and (match := separator.match(text, at)):
            parts.append(text[begin:at])
            begin = match.end()
    return [*parts, text[begin:]]
