"""Meanings of names: the many spellings of joint variables, of their rates, and of sines of sums of angles."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import pairwise, product
from typing import TypeAlias

from dhkit.description import Description
from dhkit.errors import AnswerError
from dhkit.expressions import CONSTANTS
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.tokens import quote

Meaning: TypeAlias = tuple[str, ...]
"""Tokens that a name stands for, in the robot's own names."""

_SPELLINGS = (
    dict(
        sin="sin Sin SIN s",
        cos="cos Cos COS c",
        tan="tan Tan TAN",
        asin="asin arcsin ArcSin Asin ASIN",
    )
    | dict(acos="acos arccos ArcCos Acos ACOS", atan="atan arctan ArcTan Atan ATAN")
    | dict(atan2="atan2 arctan2 Atan2 ATAN2", sqrt="sqrt Sqrt SQRT", hypot="hypot")
    | dict(
        abs="abs Abs ABS fabs",
        sign="sign Sign sgn",
        exp="exp Exp",
        pow="pow Pow power",
        square="square",
    )
    | dict(min="min Min fmin", max="max Max fmax", sec="sec Sec", csc="csc Csc", cot="cot Cot")
    | dict(
        sind="sind", cosd="cosd", tand="tand", radians="radians deg2rad", degrees="degrees rad2deg"
    )
    | dict(asind="asind", acosd="acosd", atand="atand", atan2d="atan2d")
    | dict(Rational="Rational", number="Integer Float S sympify")
)
"""Functions that may be called, each with its spellings."""


def _function_by_spelling() -> dict[str, str]:
    functions: dict[str, str] = {}
    for function, spellings in _SPELLINGS.items():
        functions |= dict.fromkeys(spellings.split(), function)
    return functions


FUNCTION_NAMES = _function_by_spelling()
"""The function of each spelling."""

_ANGLES = ("q", "th", "theta", "Theta", "vartheta", "t", "phi", "varphi")
_SLIDES = ("d", "r", "x", "s", "rho")
"""Letters for the variable of a prismatic joint, beside those of all joints."""


_RATES = re.compile(r"(?:omega|Omega)(\d+)", re.ASCII)
_DOTS = {"d": 1, "dot": 1, "p": 1, "D": 1, "dd": 2, "ddot": 2, "pp": 2, "d2": 2, "DD": 2}
"""Marks of a derivative by time, and its order."""

_LETTERS = "|".join(sorted((*_ANGLES, *_SLIDES), key=len, reverse=True))
_VARIABLE = re.compile(
    rf"(dot|ddot|d|dd|d2|D|DD)??({_LETTERS})(d|dot|p|dd|ddot|pp)??(\d+)(d|dot|p|dd|ddot|pp)?",
    re.ASCII,
)
_SINE_OR_COSINE = re.compile(r"([csCS]|cos|sin|[csCS](?:q|th|theta|t))(\d(?:[pm]?\d)*)", re.ASCII)
"""The sine or the cosine of a sum of joint angles: c1, s12, c_{1-2}."""


def plain_name(text: str) -> str:
    r"""Return a name without the marks of typesetting: \theta_{1} and theta_1 are theta1."""
    return re.sub(r"[\\_{}\s]", "", text)


class Vocabulary:
    """The names that an answer may use.

    Parameters
    ----------
    description
        The robot: its parameters go by their names in the file, its joint variables by q1, theta1, th_1 and so on.
    q, qd, qdd
        The student's own names of the joint variables; what is not named keeps the usual ones.
    further
        Names that the task has besides, such as px and r11.
    sums
        For each joint, the indices (from 0) of the joints whose angles add up to the student's variable: with absolute
        angles the joint and the parallel joints before it; by default the joint alone.

    Raises
    ------
    AnswerError
        An invalid name, or one with two meanings.
    """

    def __init__(
        self,
        description: Description,
        *,
        q: Sequence[str] = (),
        qd: Sequence[str] = (),
        qdd: Sequence[str] = (),
        further: Iterable[str] = (),
        sums: Sequence[Sequence[int]] = (),
    ) -> None:
        self.kinds = description.kinds
        self.sums = tuple(tuple(joints) for joints in sums) or tuple(
            (i,) for i in range(description.n)
        )
        self.symbols = tuple(description.parameters)
        self.own: dict[str, Meaning] = {}
        self.numbers = _numbering(q) or {str(i + 1): i + 1 for i in range(description.n)}
        """Joints, from 1, by the numbers in their names: those of the student's own names come first."""
        for given, kind in ((q, "q"), (qd, "qd"), (qdd, "qdd")):
            self._name_joints(given, kind)
        self.further = tuple(further)
        self.gravity = _gravity(description)
        self._meanings: dict[str, Meaning | None] = {}
        self.aliases: set[str] = set()
        """Names in ``own`` that are other names for the task's variables and parameters."""
        self.taken_for: dict[str, str] = {}
        """Names that were not exactly known ones, and the names that they were taken for."""
        self.refused: dict[str, str] = {}
        """Names that could not be defined, and why."""
        self.first_index: int | None = None
        """First index, 0 or 1, in square brackets on the whole sheet; None where that is not known."""

    def _name_joints(self, given: Sequence[str], kind: str) -> None:
        if given and len(given) != len(self.kinds):
            raise AnswerError(
                f"names: {kind}: found {len(given)} names; expected {len(self.kinds)}, one a joint"
            )
        for i, name in enumerate(given, start=1):
            own = plain_name(name)
            if not re.fullmatch(r"[A-Za-z]\w*", own, re.ASCII):
                raise AnswerError(
                    f"names: {kind}: found {quote(name)}; expected a name such as th1"
                )
            self._add(own, self._own_variable(kind, i))
            if kind == "q":
                for order, rate in ((1, "qd"), (2, "qdd")):
                    for spelling in _rate_names(own, order):
                        self.own.setdefault(spelling, self._own_variable(rate, i))

    def _own_variable(self, kind: str, i: int) -> Meaning:
        """Return the student's variable of joint i, from 1, as a sum of joint variables; kind is q, qd or qdd."""
        return _sum_of([(f"{kind}{joint + 1}",) for joint in self.sums[i - 1]])

    def _add(self, name: str, meaning: Meaning) -> None:
        if self.own.get(name, meaning) != meaning:
            raise AnswerError(f"names: {quote(name)} stands for two things")
        self.own[name] = meaning

    def define(self, name: str, meaning: Meaning) -> None:
        """Give a name a meaning.

        Raises
        ------
        AnswerError
            It has another one already.
        """
        self._add(plain_name(name), meaning)
        self._meanings.clear()

    def define_aliases(self, aliases: Mapping[str, Meaning]) -> None:
        """Give names a meaning that have none."""
        for name, meaning in aliases.items():
            if not self.knows(name):
                self.own[name] = meaning
                self.aliases.add(name)
        self._meanings.clear()

    def is_alias(self, name: str) -> bool:
        """Whether it is another name of the task's variable or parameter, which a student may define otherwise."""
        return plain_name(name) in self.aliases

    def redefine(self, name: str, meaning: Meaning) -> None:
        """Give a name a meaning instead of any other."""
        self.aliases.discard(plain_name(name))
        self.refused.pop(plain_name(name), None)
        self.own[plain_name(name)] = meaning
        self._meanings.clear()

    def refuse(self, name: str, why: str) -> None:
        """Take a name's meaning away."""
        self.refused[plain_name(name)] = why
        self._meanings.clear()

    def is_own(self, name: str) -> bool:
        """Whether a name is one of the student's own, or a parameter of the file."""
        return name in self.own or name in self._exact

    def is_state(self, name: str) -> bool:
        """Whether a name is a joint's variable, rate or acceleration."""
        return self._is_variable(name, ("q", "qd", "qdd"))

    def knows(self, name: str) -> bool:
        """Whether a name, as typed, has a meaning."""
        return self.find(name) is not None

    def is_position(self, name: str) -> bool:
        """Whether a name is a joint's variable."""
        return self._is_variable(name, ("q",))

    def _is_variable(self, name: str, kinds: Sequence[str]) -> bool:
        meaning = self.find(name) if name else None
        joints = range(1, len(self.kinds) + 1)
        return meaning is not None and any(
            meaning == self._own_variable(kind, joint) for kind, joint in product(kinds, joints)
        )

    def find(self, name: str) -> Meaning | None:
        """Return the meaning of a name, None if it is unknown: the student's own names first, then the file's."""
        if name not in self._meanings:
            self._meanings[name] = self._look_up(name)
        return self._meanings[name]

    def _look_up(self, name: str) -> Meaning | None:
        plain = plain_name(name)
        if plain in self.refused:
            return None
        for text in (name, plain):
            if text in self.own:
                return self.own[text]
            if text in self._exact:
                return self._exact[text]
        if plain in CONSTANTS:
            return (plain,)
        if plain in ("dt", "ddt"):
            return None
        if why := self._ambiguous(plain):
            self.refused[plain] = why
            return None
        meaning = (
            self._joint_variable(plain)
            or self._sine_or_cosine(plain)
            or (self.gravity if plain == "g" else None)
        )
        if meaning is None and len(self._by_lower_case.get(plain.lower(), ())) == 1:
            (symbol,) = self._by_lower_case[plain.lower()]
            self.taken_for[name] = symbol
            return (symbol,)
        return meaning

    def is_exactly(self, name: str) -> bool:
        """Whether a name is one of the file's parameters or of the student's own, letter by letter."""
        return name in self.own or name in self.symbols or name in self.further

    @cached_property
    def _exact(self) -> dict[str, Meaning]:
        names = [*self.further, *self.symbols]
        meanings: dict[str, Meaning] = {plain_name(name): (name,) for name in names}
        return meanings | {name: (name,) for name in names}

    @cached_property
    def _by_lower_case(self) -> dict[str, set[str]]:
        """Parameters by their names in small letters."""
        loose: dict[str, set[str]] = {}
        for name in self.symbols:
            loose.setdefault(plain_name(name).lower(), set()).add(name)
        return loose

    def _joint_variable(self, name: str) -> Meaning | None:
        """Return a joint's variable, rate or acceleration, in any of the usual spellings."""
        angular = _RATES.fullmatch(name)
        if (
            angular
            and angular[1] in self.numbers
            and self.kinds[self.numbers[angular[1]] - 1] == "R"
        ):
            self.taken_for[name] = f"the rate of joint {self.numbers[angular[1]]}"
            return self._own_variable("qd", self.numbers[angular[1]])
        match = _VARIABLE.fullmatch(name)
        if match is None:
            alone = (
                len(self.kinds) == 1 and not name[-1:].isdigit() and (len(name) > 1 or name == "q")
            )
            return self._joint_variable(name + "1") if alone else None
        before, letter, between, number, after = match.groups()
        joints = self._numbered(number)
        if not joints:
            return None
        marks = [mark for mark in (before, between, after) if mark]
        if len(marks) > 1 or (
            letter in _SLIDES and letter not in _ANGLES and self.kinds[joints[0] - 1] == "R"
        ):
            return None
        dots = _DOTS[marks[0]] if marks else 0
        kind = ("q", "qd", "qdd")[dots]
        return _sum_of([self._own_variable(kind, joint) for joint in joints])

    def _numbered(self, number: str) -> list[int]:
        """Return which joint a number means, or several in a row: theta12 is theta1 + theta2."""
        if number in self.numbers:
            return [self.numbers[number]]
        if len(number) > 3 or not all(digit in self.numbers for digit in number):
            return []
        digits = [self.numbers[digit] for digit in number]
        are_in_a_row = all(b == a + 1 for a, b in pairwise(digits))
        are_revolute = all(self.kinds[k - 1] == "R" for k in digits)
        return digits if are_in_a_row and are_revolute else []

    def _sine_or_cosine(self, name: str) -> Meaning | None:
        """Return the sine or the cosine of a sum of joint angles: c1, s12, c_{1-2}."""
        match = _SINE_OR_COSINE.fullmatch(name)
        if match is None:
            return None
        numbers = re.findall(r"[pm]?\d", match[2])
        joints = [self.numbers.get(x[-1], 0) for x in numbers]
        if not all(joint and self.kinds[joint - 1] == "R" for joint in joints):
            return None
        angle: list[str] = []
        for x, joint in zip(numbers, joints, strict=True):
            angle += ["-" if x[0] == "m" else "+", *self._own_variable("q", joint)]
        return ("cos" if match[1][0] in "cC" else "sin", "(", *angle[1:], ")")

    def _ambiguous(self, name: str) -> str:
        """Return why a name of an arm of ten joints or more has two meanings: c12 is cos(q12) or cos(q1 + q2)."""
        match = _SINE_OR_COSINE.fullmatch(name)
        if match is None or len(match[2]) < 2 or match[2] not in self.numbers:
            return ""
        function = "cos" if match[1][0] in "cC" else "sin"
        summed = " + ".join(f"q{digit}" for digit in match[2])
        return f"it may be {function}(q{match[2]}) or {function}({summed}); write one of them"

    def split(self, name: str) -> list[str] | None:
        """Return the known names that an unknown one is a product of, where there is one way: m2l1 is m2 l1."""
        if len(name) > BOUNDS.name_characters:
            return None
        fewest: dict[int, list[list[str]]] = {len(name): [[]]}
        for start in reversed(range(len(name))):
            ways: list[list[str]] = []
            for end in range(start + 1, len(name) + 1):
                factor = name[start:end]
                if end in fewest and self._is_factor(factor):
                    ways += [[factor, *rest] for rest in fewest[end]]
            if ways:
                shortest = min(map(len, ways))
                fewest[start] = [way for way in ways if len(way) == shortest][:4]
        products = fewest.get(0, [])
        is_product = len(products) == 1 and any(len(piece) > 1 for piece in products[0])
        return products[0] if is_product else None

    def _is_factor(self, piece: str) -> bool:
        is_known = (
            piece in self.own
            or piece in self._exact
            or bool(self._joint_variable(piece) or self._sine_or_cosine(piece))
        )
        return piece[0].isalpha() and is_known and self.knows(piece)

    def nearest(self, name: str) -> str:
        """Return a hint: why a name could not be defined, or the known name that is nearest."""
        if plain_name(name) in self.refused:
            return self.refused[plain_name(name)][:200]
        known = [
            *(other for other in self.own if other not in self.aliases),
            *self.further,
            *self.symbols,
            *FUNCTION_NAMES,
        ]
        for i in range(1, len(self.kinds) + 1):
            known += [f"q{i}", f"qd{i}", f"qdd{i}", f"c{i}", f"s{i}"]
        known = [other for other in known if len(other) <= BOUNDS.name_characters]
        close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
        own = (
            other
            for other in self.own
            if len(other) <= BOUNDS.name_characters and other not in self.aliases
        )
        listed = [*self.further[:4:3], *own, *self.symbols, "q1", "qd1", "c1", "s1"]
        return (
            f"did you mean {close[0]!r}?"
            if close
            else f"known are {', '.join(dict.fromkeys(listed[:12]))}"
        )


def _sum_of(terms: Sequence[Meaning]) -> Meaning:
    """Return a sum in brackets; one term as it is."""
    if len(terms) == 1:
        return terms[0]
    tokens: list[str] = []
    for term in terms:
        tokens += ["+", *term]
    return ("(", *tokens[1:], ")")


def _numbering(q: Sequence[str]) -> dict[str, int]:
    """Return which joint a number means where all of a student's names end in one: q0 is the first."""
    ends = [re.fullmatch(r".*?(\d+)", plain_name(name)) for name in q]
    numbers = {match[1]: i for i, match in enumerate(ends, start=1) if match}
    return numbers if len(numbers) == len(q) else {}


def _rate_names(name: str, dots: int) -> list[str]:
    """Return the usual spellings of the derivative of a student's own name: xdot, dx, xd, x1dot and xdot1."""
    letters, number = re.fullmatch(r"(.*?)(\d*)", name).groups()  # type: ignore[union-attr]
    marks = ("dot", "d", "p") if dots == 1 else ("ddot", "dd", "pp")
    before = ("d", "dot", "D") if dots == 1 else ("dd", "d2", "ddot", "DD")
    return [
        *(f"{name}{mark}" for mark in marks),
        *(f"{letters}{mark}{number}" for mark in marks),
        *(f"{mark}{name}" for mark in before),
    ]


def _gravity(description: Description) -> Meaning | None:
    """Return the size of gravity where the file gives it as a number along one axis."""
    along = [x.rational for x in description.gravity if x.rational != 0]
    if len(along) != 1 or along[0] is None:
        return None
    size = abs(along[0])
    return ("(", str(size.numerator), "/", str(size.denominator), ")")
