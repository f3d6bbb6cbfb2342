"""A derivation of inverse kinematics as a program: the statements that code in any language consists of."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from dhkit.symbolic.equations.collected import collected
from dhkit.symbolic.equations.inverse_writing import PLACEHOLDER, is_number
from dhkit.symbolic.equations.programs import RESERVED, harmless, identifier
from dhkit.symbolic.equations.writing import Printer
from dhkit.symbolic.inverse.chain import POSE
from dhkit.symbolic.inverse.derivation import IN_PLANE, InverseDerivation, in_branch_order
from dhkit.symbolic.inverse.forms import ZERO_RADICAND, Form, Remainder
from dhkit.symbolic.inverse.steps import Choice, DerivationStep
from dhkit.symbolic.languages.statements import Comment, Digit, Guard, Let, Statement
from dhkit.symbolic.languages.syntax import Syntax
from dhkit.symbolic.ring import Element, Generator
from dhkit.symbolic.ring.notation import constants_of, generators_of, symbols_of

_LETTER = re.compile(r"\b[A-Zk]\b")
"""A letter of a form: A, B, C ... and k."""
_LOCAL = frozenset(
    ["T", "q", "b", "k", "status", "wrap", "root", "branches", "found", "nargin", "true", "false"]
)
"""Names that the code around the statements uses."""


@dataclass(frozen=True)
class InverseProgram:
    """Statements that compute one branch, for signs root1, root2 ... of the roots.

    The code around them counts k from 0 to 2^roots - 1; bit r of k is the sign of root r + 1. ``Guard`` leaves the
    round where the branch does not exist, and each ``Digit`` appends one binary digit to b, the number of the branch.

    Attributes
    ----------
    robot, name
        The robot's name, safe in comments, and as an identifier.
    n, roots
        Numbers of joints and of roots.
    branches
        Names of the branches.
    constants
        Names and values of the constants, SI.
    pose
        Entries of the pose that are used: name, row and column from 0.
    statements
        The statements in the order in which they are executed.
    joints
        Expressions of the joint values.
    turning
        For each joint, whether its value is an angle.
    geometry
        The arrangement of the axes, in words.
    notes
        Further sentences about the derivation.
    """

    robot: str
    name: str
    n: int
    roots: int
    branches: tuple[str, ...]
    constants: tuple[tuple[str, float], ...]
    pose: tuple[tuple[str, int, int], ...]
    statements: tuple[Statement, ...]
    joints: tuple[str, ...]
    turning: tuple[bool, ...]
    geometry: str
    notes: tuple[str, ...]

    @property
    def has_roots(self) -> bool:
        """Whether the statements call ``root``."""
        return any(isinstance(each, Let) and "root(" in each.expression for each in self.statements)

    def joint(self, i: int) -> str:
        """Return the expression of a joint's value; angles are turned into (-pi, pi]."""
        return f"wrap({self.joints[i]})" if self.turning[i] else self.joints[i]


ABOUT = (
    "The joint values that bring the tool to a pose T, branch by branch: SI units and radians in (-pi, pi].",
    "Branches that do not reach the pose have status 0, the others 1; all have 0 where T is not a pose.",
    "At singular poses, where solutions coincide or are not unique, one of them is returned.",
)
"""Sentences of the generated functions' comments."""


class _CodeWriter:
    """Writes expressions with ``+ - * /`` and calls, which all languages share."""

    def __init__(self, syntax: Syntax, names: dict[str, str]) -> None:
        self._syntax = syntax
        self._names = names

    def symbol(self, name: str) -> str:
        return self._names[name]

    def variable(self, generator: Generator) -> str:
        return generator.text

    def pi(self) -> str:
        return self._syntax.pi

    def call(self, function: str, arguments: Sequence[str]) -> str:
        return self._syntax.call(function, arguments)

    def power(self, base: str, exponent: int) -> str:
        return "*".join([base] * exponent)

    def brackets(self, inner: str) -> str:
        return f"({inner})"

    def product(
        self, coefficient: Fraction, numerator: Sequence[str], denominator: Sequence[str]
    ) -> str:
        factors = list(numerator)
        if coefficient != 1 or not numerator:
            is_double = Fraction(float(coefficient)) == coefficient
            quotient = f"({coefficient.numerator}.0/{coefficient.denominator}.0)"
            factors.insert(0, repr(float(coefficient)) if is_double else quotient)
        return "*".join(factors) + "".join(f"/{divisor}" for divisor in denominator)

    def total(self, terms: Sequence[tuple[bool, str]]) -> str:
        signed = "".join(f" {'-' if negative else '+'} {term}" for negative, term in terms)
        return f"-{signed[3:]}" if signed.startswith(" - ") else signed[3:]


def inverse_program(derivation: InverseDerivation, syntax: Syntax) -> InverseProgram:
    """Return a derivation as a program; expressions are in a language's syntax."""
    return _Statements(derivation, syntax).program()


class _Statements:
    """Writes the statements of one derivation.

    Attributes
    ----------
    names
        Identifiers of the constants by name in the ring.
    used
        Texts of the generators that occur in expressions.
    roots
        Number of roots so far.
    """

    def __init__(self, derivation: InverseDerivation, syntax: Syntax) -> None:
        self.derivation = derivation
        self.chain = derivation.chain
        self.syntax = syntax
        ring = self.chain.ring
        generators = generators_of(self._elements())
        self.used = {generator.text for generator in generators}

        taken = {*RESERVED, *_LOCAL, "phi"}
        taken |= {generator.text for generator in ring.generators if generator.kind != "constant"}
        for i in range(derivation.n):
            taken |= {f"theta{i + 1}", f"root{i + 1}"}
        self.names: dict[str, str] = {}
        for name in sorted(symbols_of(constants_of(generators))):
            own = identifier(name)
            # Names like A_theta1 are those of letters.
            while own in taken or own in self.names.values() or re.fullmatch(r"[A-Zk]\w*_", own):
                own += "_"
            self.names[name] = own
        self.printer: Printer[str] = Printer(ring.generators, _CodeWriter(syntax, self.names))
        self.roots = 0

    def program(self) -> InverseProgram:
        """Return the program."""
        derivation = self.derivation
        chain = self.chain
        pose = []
        for name in POSE:
            own = chain.names[name]
            if own in self.names:
                row, column = _entry(name)
                pose.append((self.names[own], row, column))
        constants = [
            (self.names[name], value) for name, value in chain.lengths.items() if name in self.names
        ]

        statements: list[Statement] = []
        for step in derivation.steps:
            statements += self._step(step)
        statements += self._conditions()
        statements += [self._digit(choice) for choice in derivation.choices]
        return InverseProgram(
            robot=harmless(derivation.description.name),
            name=identifier(derivation.description.name),
            n=derivation.n,
            roots=self.roots,
            branches=derivation.branches,
            constants=tuple(constants),
            pose=tuple(pose),
            statements=tuple(statements),
            joints=tuple(self._joint(i) for i in range(derivation.n)),
            turning=tuple(kind == "R" for kind in derivation.description.kinds),
            geometry=derivation.geometry,
            notes=derivation.notes,
        )

    def _elements(self) -> list[Element]:
        """Return all elements whose expressions the program contains."""
        derivation = self.derivation
        found: list[Element] = []
        for step in derivation.steps:
            found += [definition.element for definition in step.definitions]
        for step in derivation.steps:
            if step.form is not None and not isinstance(step.form, Remainder):
                found += [step.form.letters[letter] for letter in self._letters(step.form)]
            if step.choice is not None:
                found += step.choice.factors
        for condition in derivation.conditions:
            found += [condition.left, condition.right]
        return found

    def _text(self, element: Element) -> str:
        """Return an element's expression."""
        return self.printer.sum(collected(element))

    def _step(self, step: DerivationStep) -> Iterator[Statement]:
        """Yield the statements of a step: definitions, the unknown, and its cosine and sine where they are used."""
        head = step.unknown.name if step.unknown else step.title
        yield Comment(f"{head}: {step.look}")
        for definition in step.definitions:
            yield Let(self.names[definition.name], self._text(definition.element))
        if step.form is None:
            return
        yield from self._solution(step.form)
        unknown = step.form.unknown
        if unknown.is_angle:
            for function, symbol in zip(("cos", "sin"), unknown.symbols, strict=True):
                (generator,) = generators_of([symbol])
                if generator.text in self.used:
                    own = self.names.get(generator.text, generator.text)
                    yield Let(own, self.syntax.call(function, [unknown.name]))

    def _solution(self, form: Form) -> Iterator[Statement]:
        """Yield the statements that compute a form's unknown: its letters, the radicand with its test, the solution."""
        name = form.unknown.name
        if isinstance(form, Remainder):
            signed = "".join(f" {'+' if sign > 0 else '-'} {angle}" for angle, sign in form.terms)
            yield Let(name, signed[3:] if signed.startswith(" + ") else f"-{signed[3:]}")
            return

        # A letter whose value is a name stands for it; others become local variables.
        words = self._words(form)
        letters: dict[str, str] = {}
        for letter in self._letters(form):
            text = self._text(form.letters[letter])
            if re.fullmatch(r"[A-Za-z]\w*", text):
                letters[letter] = text
            else:
                letters[letter] = f"{letter}_{name}"
                yield Let(letters[letter], text)

        def in_letters(text: str) -> str:
            return _LETTER.sub(lambda match: letters[match[0]], text)

        # The radicand D of a circle is computed once.
        guard, least = (self._filled(text, words) for text in form.guard)
        if "D" in words:
            yield Let(f"D_{name}", in_letters(words["D"]))
            words["D"] = f"D_{name}"
            guard = f"D_{name}"
        if guard:
            yield Guard(in_letters(guard), f"-{ZERO_RADICAND!r}*({in_letters(least)})")

        sign = "1.0"
        if form.has_two_roots:
            self.roots += 1
            sign = f"root{self.roots}"
        expression = self._filled(form.code.replace("<s>", "SIGN"), words)
        # A derived sum is a factor or an argument alone, so that it needs no brackets.
        expression = in_letters(expression).replace("SIGN", sign)
        yield Let(name, self._calls(expression))

    def _calls(self, expression: str) -> str:
        """Return an expression with the language's name of atan2."""
        return re.sub(r"\batan2\(", f"{self.syntax.functions.get('atan2', 'atan2')}(", expression)

    def _words(self, form: Form) -> dict[str, str]:
        """Return the values of the placeholders in a form's code, in its letters; squares are written as products."""
        derived = {
            k: re.sub(r"\b([A-Zk])\^2", r"\1*\1", text) for k, (text, _) in form.derived.items()
        }
        return {k: derived.get(k, k) for k in self._placeholders(form)}

    def _letters(self, form: Form) -> list[str]:
        """Return the letters that the code of a form contains."""
        words = self._words(form)
        texts = [*words.values(), *(self._filled(text, words) for text in form.guard)]
        occurring = set(_LETTER.findall(" ".join(texts)))
        return sorted(occurring & set(form.letters))

    @staticmethod
    def _placeholders(form: Form) -> list[str]:
        """Return the placeholders in a form's code, without that of the root's sign."""
        return [k for k in PLACEHOLDER.findall(" ".join([form.code, *form.guard])) if k != "s"]

    @staticmethod
    def _filled(template: str, words: dict[str, str]) -> str:
        """Return a template with words for its placeholders."""
        return PLACEHOLDER.sub(lambda match: words[match[1]], template)

    def _conditions(self) -> Iterator[Statement]:
        """Yield the statements that test the conditions on the pose."""
        reach = self.derivation.description.reach or 1.0
        for condition in self.derivation.conditions:
            yield Comment(condition.look)
            yield Let("off", f"{self._text(condition.left)} - ({self._text(condition.right)})")
            yield Guard(repr(IN_PLANE * reach), self.syntax.call("abs", ["off"]))

    def _digit(self, choice: Choice) -> Digit:
        """Return the digit of a choice: 0 for the root that comes first in the order of branches."""
        is_inverted = in_branch_order(choice)[0] != choice.names[0]
        texts = []
        for factor in choice.factors:
            if is_number(factor):
                (number,) = factor.terms.values()
                is_inverted ^= number < 0
            elif len(factor):
                texts.append(self._text(factor))
        return Digit(tuple(texts), is_inverted)

    def _joint(self, i: int) -> str:
        """Return the expression of joint i's value, i from 0: theta_i minus its offset."""
        if self.derivation.description.kinds[i] != "R":
            return f"q{i + 1}"
        offset = self.chain.number(self.chain.offsets[i])
        if offset == 0:
            return f"theta{i + 1}"
        return f"theta{i + 1} {'-' if offset > 0 else '+'} {abs(offset)!r}"


def _entry(name: str) -> tuple[int, int]:
    """Return row and column, from 0, of an entry of the pose by its name."""
    return ("xyz".index(name[1]), 3) if name[0] == "p" else (int(name[1]) - 1, int(name[2]) - 1)
