"""A derivation of inverse kinematics as a program: the statements that code in any language consists of."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from dhkit.symbolic.equations.collected import collected
from dhkit.symbolic.equations.inverse_writing import PLACEHOLDER
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
_LOCAL = frozenset(["T", "q", "b", "k", "status", "wrap", "root", "branches", "found", "nargin", "true", "false"])
"""Names that the code around the statements uses."""


@dataclass(frozen=True)
class InverseProgram:
    """Statements that compute one branch, for signs root1, root2 ... of the roots.

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
        In their order.
    joints
        Expressions of the joint values.
    turning
        Which of them are angles.
    words
        Sentences about the derivation.
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
    words: tuple[str, ...]

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
"""Comments of the generated functions."""


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

    def product(self, coefficient: Fraction, numerator: Sequence[str], denominator: Sequence[str]) -> str:
        exact = Fraction(float(coefficient)) == coefficient
        number = repr(float(coefficient)) if exact else f"({coefficient.numerator}.0/{coefficient.denominator}.0)"
        factors = [*([number] if coefficient != 1 or not numerator else []), *numerator]
        return "*".join(factors) + "".join(f"/{divisor}" for divisor in denominator)

    def total(self, terms: Sequence[tuple[bool, str]]) -> str:
        signed = "".join(f" {'-' if negative else '+'} {term}" for negative, term in terms)
        return f"-{signed[3:]}" if signed.startswith(" - ") else signed[3:]


def inverse_program(derivation: InverseDerivation, syntax: Syntax) -> InverseProgram:
    """Return a derivation as a program; expressions are in a language's syntax."""
    return _Statements(derivation, syntax).program()


class _Statements:
    def __init__(self, derivation: InverseDerivation, syntax: Syntax) -> None:
        self.derivation = derivation
        self.chain = derivation.chain
        self.syntax = syntax
        elements = self._elements()
        ring = self.chain.ring
        variables = {g.text for g in ring.generators if g.kind != "constant"}
        taken = {*RESERVED, *_LOCAL, *variables, *(f"theta{i + 1}" for i in range(derivation.n)), "phi"}
        taken |= {f"root{k + 1}" for k in range(derivation.n)}
        self.names: dict[str, str] = {}
        for name in sorted(symbols_of(constants_of(generators_of(elements)))):
            own = identifier(name)
            while own in taken or own in self.names.values() or re.fullmatch(r"[A-Zk]\w*_", own):
                own += "_"
            self.names[name] = own
        self.used = {g.text for g in generators_of(elements)}
        self.printer: Printer[str] = Printer(ring.generators, _CodeWriter(syntax, self.names))
        self.root = 0

    def program(self) -> InverseProgram:
        derivation = self.derivation
        chain = self.chain
        pose = {chain.names[name]: name for name in POSE}
        entries = [(self.names[own], *_entry(name)) for own, name in pose.items() if own in self.names]
        constants = [(self.names[name], value) for name, value in chain.lengths.items() if name in self.names]
        statements = [statement for step in derivation.steps for statement in self._step(step)]
        statements += self._conditions()
        statements += [self._digit(choice) for choice in derivation.choices]
        turning = tuple(kind == "R" for kind in derivation.description.kinds)
        words = (derivation.geometry, *(note for note in derivation.notes))
        return InverseProgram(
            harmless(derivation.description.name),
            identifier(derivation.description.name),
            derivation.n,
            self.root,
            derivation.branches,
            tuple(constants),
            tuple(entries),
            tuple(statements),
            tuple(self._joint(i) for i in range(derivation.n)),
            turning,
            words,
        )

    def _elements(self) -> list[Element]:
        derivation = self.derivation
        found = [d.element for step in derivation.steps for d in step.definitions]
        for step in derivation.steps:
            if step.form is not None and not isinstance(step.form, Remainder):
                found += [step.form.letters[letter] for letter in self._letters(step.form)]
            found += step.choice.factors if step.choice else ()
        return found + [side for c in derivation.conditions for side in (c.left, c.right)]

    def _text(self, element: Element) -> str:
        return self.printer.sum(collected(element))

    def _step(self, step: DerivationStep) -> Iterator[Statement]:
        head = step.unknown.name if step.unknown else step.title
        yield Comment(f"{head}: {step.look}")
        for definition in step.definitions:
            yield Let(self.names[definition.name], self._text(definition.element))
        if step.form is None:
            return
        yield from self._solution(step.form)
        unknown = step.form.unknown
        if unknown.is_angle:
            functions = ("cos", "sin")
            for function, symbol in zip(functions, unknown.symbols, strict=True):
                (generator,) = generators_of([symbol])
                if generator.text in self.used:
                    own = self.names.get(generator.text, generator.text)
                    yield Let(own, self.syntax.call(function, [unknown.name]))

    def _solution(self, form: Form) -> Iterator[Statement]:
        name = form.unknown.name
        if isinstance(form, Remainder):
            signed = "".join(f" {'+' if sign > 0 else '-'} {angle}" for angle, sign in form.terms)
            yield Let(name, signed[3:] if signed.startswith(" + ") else f"-{signed[3:]}")
            return
        words = self._words(form)
        guard, least = (self._filled(text, words) for text in form.guard)
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

        if "D" in words:
            yield Let(f"D_{name}", in_letters(words["D"]))
            guard = words["D"] = f"D_{name}"
        if guard:
            yield Guard(in_letters(guard), f"-{ZERO_RADICAND!r}*({in_letters(least)})")
        sign = "1.0"
        if form.has_two_roots:
            self.root += 1
            sign = f"root{self.root}"
        expression = self._filled(form.code.replace("<s>", "SIGN"), words)
        # A derived sum is a factor or an argument alone, so that it needs no brackets.
        expression = in_letters(expression).replace("SIGN", sign)
        yield Let(name, self._calls(expression))

    def _calls(self, expression: str) -> str:
        return re.sub(r"\batan2\(", f"{self.syntax.functions.get('atan2', 'atan2')}(", expression)

    def _words(self, form: Form) -> dict[str, str]:
        """Return what stands in the code of a form, in its letters; squares are written as products."""
        derived = {k: re.sub(r"\b([A-Zk])\^2", r"\1*\1", text) for k, (text, _) in form.derived.items()}
        return {k: derived.get(k, k) for k in self._placeholders(form)}

    def _letters(self, form: Form) -> list[str]:
        """Return the letters that the code of a form contains."""
        words = self._words(form)
        texts = [*words.values(), *(self._filled(text, words) for text in form.guard)]
        return sorted({letter for text in texts for letter in _LETTER.findall(text)} & set(form.letters))

    @staticmethod
    def _placeholders(form: Form) -> list[str]:
        return [k for k in PLACEHOLDER.findall(" ".join([form.code, *form.guard])) if k != "s"]

    @staticmethod
    def _filled(template: str, words: dict[str, str]) -> str:
        return PLACEHOLDER.sub(lambda match: words[match[1]], template)

    def _conditions(self) -> Iterator[Statement]:
        reach = self.derivation.description.reach or 1.0
        for condition in self.derivation.conditions:
            yield Comment(condition.look)
            yield Let("off", f"{self._text(condition.left)} - ({self._text(condition.right)})")
            yield Guard(repr(IN_PLANE * reach), self.syntax.call("abs", ["off"]))

    def _digit(self, choice: Choice) -> Digit:
        is_inverted = in_branch_order(choice)[0] != choice.names[0]
        texts = []
        for factor in choice.factors:
            if len(factor) == 1 and not any(next(iter(factor.terms))):
                is_inverted ^= next(iter(factor.terms.values())) < 0
            elif len(factor):
                texts.append(self._text(factor))
        return Digit(tuple(texts), is_inverted)

    def _joint(self, i: int) -> str:
        if self.derivation.description.kinds[i] != "R":
            return f"q{i + 1}"
        offset = self.chain.number(self.chain.offsets[i])
        if offset == 0:
            return f"theta{i + 1}"
        return f"theta{i + 1} {'-' if offset > 0 else '+'} {abs(offset)!r}"


def _entry(name: str) -> tuple[int, int]:
    """Return row and column, from 0, of an entry of the pose by its name."""
    return ("xyz".index(name[1]), 3) if name[0] == "p" else (int(name[1]) - 1, int(name[2]) - 1)
