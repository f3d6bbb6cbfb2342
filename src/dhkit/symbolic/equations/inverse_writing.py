"""Derivations of inverse kinematics in words and formulas: what text, LaTeX, pages and code have in common."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from dhkit.symbolic.equations.collected import collected
from dhkit.symbolic.equations.latex import LatexWriter
from dhkit.symbolic.equations.latex_names import latex_names
from dhkit.symbolic.equations.text import TextWriter
from dhkit.symbolic.equations.writing import Printer
from dhkit.symbolic.inverse.derivation import InverseDerivation
from dhkit.symbolic.inverse.forms import Circle, CosineAndSquare, Flip, Form, Remainder, Unknown
from dhkit.symbolic.inverse.steps import Choice, DerivationStep
from dhkit.symbolic.ring import Element
from dhkit.symbolic.ring.notation import Notation, notation, symbols_of

_INLINE = 70
"""Longest text of what stands in a solution instead of its letters; longer ones are listed behind it."""
PLACEHOLDER = re.compile(r"<(\w+)>")
_ANGLE = re.compile(r"\b(theta|phi)(\d*)\b")


@dataclass(frozen=True)
class Solution:
    """The solution of a step, written.

    Attributes
    ----------
    unknown
        What it gives.
    alternatives
        Its formulas: one, with a sign ± where there are two roots, or two.
    letters
        Letters in them with what they stand for.
    """

    unknown: str
    alternatives: tuple[str, ...]
    letters: tuple[tuple[str, str], ...]


class Phrases:
    """Writes the formulas of one derivation in one notation.

    Parameters
    ----------
    derivation
        The derivation.
    latex
        Whether they are LaTeX; else text.
    """

    def __init__(self, derivation: InverseDerivation, *, latex: bool) -> None:
        self.derivation = derivation
        self.is_latex = latex
        ring = derivation.chain.ring
        self._printer: Printer[str]
        if latex:
            names = _written_names(derivation)
            typeset = latex_names(set(names.names.values()) | symbols_of(ring.generators))
            for name in ("cphi", "sphi"):
                own = derivation.chain.names[name]
                typeset[names(own)] = _phi_latex(name[0], derivation)
            self._printer = Printer(ring.generators, LatexWriter(typeset, names))
        else:
            self._printer = Printer(ring.generators, TextWriter(_written_names(derivation)))

    def element(self, element: Element) -> str:
        """Return an element in one line, with a positive term first if it has one."""
        products = list(collected(element))
        first = next((k for k, product in enumerate(products) if product.coefficient > 0), 0)
        if products:
            products.insert(0, products.pop(first))
        return self._printer.sum(products).replace("\n", "")

    def name(self, name: str) -> str:
        """Return a defined quantity's name."""
        return self.element(self.derivation.chain.ring.constant(name))

    def unknown(self, unknown: Unknown) -> str:
        """Return what a step solves for."""
        return self.angles(unknown.name)

    def angles(self, text: str) -> str:
        """Return a text with theta1, phi and q1 in this notation."""
        if not self.is_latex:
            return text
        text = _ANGLE.sub(lambda m: r"\varphi" if m[1] == "phi" else rf"\theta_{{{m[2]}}}", text)
        return re.sub(r"\bq(\d+)\b", r"q_{\1}", text)

    def equations(self, step: DerivationStep) -> list[tuple[str, str]]:
        """Return both sides of a step's equations; the angle that remains of phi as a sum."""
        form = step.form
        if form is None:
            return []
        if isinstance(form, Remainder):
            return [(self.unknown(form.unknown), self._sum(form.terms))]
        sides = [(self.element(left), self.element(right)) for left, right in form.equations]
        if isinstance(form, CosineAndSquare):  # the ring writes the square of a sine as 1 - c^2
            squared = "^{2}" if self.is_latex else "^2"
            sides[1] = self.element(form.unknown.sine) + squared, sides[1][1]
        return sides

    def solution(self, form: Form) -> Solution:
        """Return a form's solution."""
        name = self.unknown(form.unknown)
        if isinstance(form, Remainder):
            return Solution(name, (self._sum(form.terms),), ())
        templates = form.latex if self.is_latex else form.text
        used = dict.fromkeys(PLACEHOLDER.findall(" ".join(templates)))
        derived = form.derived
        inline = {k: derived[k][1] if k in derived else form.letters[k] for k in used}
        texts = {k: self.element(element) for k, element in inline.items()}
        if sum(map(len, texts.values())) <= _INLINE * (2 if self.is_latex else 1):
            written = [_filled(template, texts).removeprefix("0 ") for template in templates]
            return Solution(name, tuple(written), ())
        zero = {k for k, element in form.letters.items() if element.is_zero}
        words = {k: self._letters(derived[k][0]) if k in derived else "0" if k in zero else k for k in used}
        needed = sorted(set(re.findall(r"[A-Zk](?![a-z])", " ".join(words.values()))))
        letters = tuple((k, self.element(form.letters[k])) for k in needed if k in form.letters)
        if isinstance(form, Circle) and "B" in zero:
            zero_angle = r"\mathrm{atan2}(0,\, A)" if self.is_latex else "atan2(0, A)"
            otherwise = r"0 \text{ where } A > 0, \text{ else } \pi" if self.is_latex else "0 where A > 0, else pi"
            letters += ((zero_angle, otherwise),)
        return Solution(name, tuple(_filled(template, words) for template in templates), letters)

    def rule(self, choice: Choice) -> str:
        """Return the rule that names two roots, in words."""
        plus, minus = choice.names
        factors = [factor for factor in choice.factors if len(factor)]
        sign = 1
        shown = []
        for factor in factors:
            if self._is_number(factor):
                sign *= -1 if float(next(iter(factor.terms.values()))) < 0 else 1
            else:
                shown.append(factor)
        if sign < 0:
            plus, minus = minus, plus
        texts = [self.element(factor) for factor in shown]
        if len(texts) == 1:
            return f"{plus} where {texts[0]} > 0, else {minus}"
        return f"{plus} where {' and '.join(texts)} have the same sign, else {minus}"

    @staticmethod
    def _is_number(element: Element) -> bool:
        return len(element) == 1 and not any(next(iter(element.terms)))

    def _letters(self, text: str) -> str:
        return text.replace("*", r" ").replace("^2", "^{2}") if self.is_latex else text

    def _sum(self, terms: Sequence[tuple[str, int]]) -> str:
        signed = "".join(f" {'+' if sign > 0 else '-'} {self.angles(name)}" for name, sign in terms)
        return signed[3:] if signed.startswith(" + ") else f"-{signed[3:]}"

    # Angles of joints

    def joint_values(self) -> Iterator[tuple[str, str]]:
        """Yield joints whose table has an offset, with what their value is: q2, theta2 - pi/2."""
        derivation = self.derivation
        for i, (kind, offset) in enumerate(zip(derivation.description.kinds, derivation.chain.offsets, strict=True)):
            if kind == "R" and not offset.is_zero:
                own = self.constants(-offset)
                sign = "" if own.startswith("-") else "+ "
                text = f"theta{i + 1} {sign}{own}" if sign else f"theta{i + 1} - {own[1:]}"
                yield self.angles(f"q{i + 1}"), self.angles(text)

    def constants(self, expression: object) -> str:
        """Return an expression of the file's parameters."""
        return self._printer.expression(expression).replace("\n", "")  # type: ignore[arg-type]


def phi_label(derivation: InverseDerivation) -> str:
    """Return 23 for phi = theta2 + theta3; phi where an angle is subtracted, or there are two-digit joints."""
    joints = [i for i, sense in derivation.sum if sense > 0]
    plain = len(joints) == len(derivation.sum) and all(i < 10 for i in joints)
    return "".join(map(str, joints)) if plain else "phi"


def _phi_latex(function: str, derivation: InverseDerivation) -> str:
    label = phi_label(derivation)
    return rf"{function}_{{{label if label != 'phi' else chr(92) + 'varphi'}}}"


def _written_names(derivation: InverseDerivation) -> Notation:
    """Return the printed names of the ring's constants: c23 for the cosine of phi."""
    own = notation(derivation.chain.ring)
    label = phi_label(derivation)
    names = {derivation.chain.names[f"{k}phi"]: f"{k}{label}" for k in "cs"} if derivation.sum else {}
    return Notation(own.names | names)


def _filled(template: str, texts: dict[str, str]) -> str:
    return PLACEHOLDER.sub(lambda match: texts[match[1]], template)


def solved_before(derivation: InverseDerivation, step: DerivationStep) -> list[str]:
    """Return the joints and defined quantities of earlier steps that a step uses, in their order."""
    elements = [*step.elements, *(definition.element for definition in step.definitions)]
    if isinstance(step.form, Flip):  # what the unknown is multiplied by is not known yet
        elements = [step.form.letters["X"], step.form.letters["Y"], *(d.element for d in step.definitions)]
    joints = _joints_in(elements, _joints_of_quantities(derivation, step))
    own = step.unknown.joint if step.unknown else None
    kinds = derivation.description.kinds
    return [f"theta{i + 1}" if kinds[i] == "R" else f"q{i + 1}" for i in sorted(joints - {own}) if i >= 0]


def _joints_of_quantities(derivation: InverseDerivation, step: DerivationStep) -> dict[str, set[int]]:
    """Return the joints behind each quantity that steps before one define, or find as phi, by name."""
    names = derivation.chain.names
    found = dict[str, set[int]]()
    for earlier in derivation.steps:
        if earlier is step:
            break
        for definition in earlier.definitions:
            found[definition.name] = _joints_in([definition.element], found)
        if earlier.unknown is not None and earlier.unknown.joint is None:
            found[names["cphi"]] = found[names["sphi"]] = _joints_in(earlier.elements, found)
    return found


def _joints_in(elements: Iterable[Element], of_quantities: Mapping[str, set[int]]) -> set[int]:
    """Return the joints in elements, from 0, and those behind the quantities in them."""
    joints: set[int] = set()
    for element in elements:
        used = {k for monomial in element.terms for k, exponent in enumerate(monomial) if exponent}
        for generator in (element.ring.generators[k] for k in used):
            is_quantity = generator.kind == "constant"
            joints |= of_quantities.get(generator.text, set()) if is_quantity else {generator.joint}
    return joints
