"""Derivations of inverse kinematics in words and formulas: the part that text, LaTeX, pages and code share."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from dhkit.symbolic.equations.collected import collected
from dhkit.symbolic.equations.latex import LatexWriter
from dhkit.symbolic.equations.latex_names import Face, Part, TypesetName, typeset_names
from dhkit.symbolic.equations.text import TextWriter
from dhkit.symbolic.equations.typst import typst_printer
from dhkit.symbolic.equations.writing import Printer
from dhkit.symbolic.inverse.derivation import InverseDerivation
from dhkit.symbolic.inverse.forms import Circle, CosineAndSquare, Flip, Form, Remainder, Unknown
from dhkit.symbolic.inverse.steps import Choice, DerivationStep
from dhkit.symbolic.ring import Element, Ring
from dhkit.symbolic.ring.notation import Notation, generators_of, notation, symbols_of

_INLINE = 70
"""Largest number of characters of the letters' values that are written inside a solution; longer ones are listed after
it. In LaTeX and typst twice as many."""
PLACEHOLDER = re.compile(r"<(\w+)>")
"""A placeholder in the solution of a form."""
_ANGLE = re.compile(r"\b(theta|phi)(\d*)\b")


@dataclass(frozen=True)
class Solution:
    """The solution of a step, written.

    Attributes
    ----------
    unknown
        The quantity that it gives.
    alternatives
        Its formulas: one, with a sign ± where there are two roots, or two.
    letters
        Letters in them with their values.
    """

    unknown: str
    alternatives: tuple[str, ...]
    letters: tuple[tuple[str, str], ...]


def _text_printer(ring: Ring, names: Mapping[str, TypesetName], written: Notation) -> Printer[str]:
    """Return the printer of a ring's elements as text."""
    return Printer(ring.generators, TextWriter(written))


def _latex_printer(ring: Ring, names: Mapping[str, TypesetName], written: Notation) -> Printer[str]:
    """Return the printer of a ring's elements in LaTeX, with these names of constants."""
    latex = {name: typeset.latex for name, typeset in names.items()}
    return Printer(ring.generators, LatexWriter(latex, written))


@dataclass(frozen=True)
class Style:
    """A notation of derivations.

    Attributes
    ----------
    printer
        Makes the printer of a ring's elements from the ring, the constants' symbols and their printed names.
    templates
        Returns the templates of a form's solution.
    angle, position
        Replacements of theta1 and q1, whose number is group 2 and group 1.
    phi
        The angle phi.
    square
        What is written after a factor that is squared.
    inline
        Largest number of characters of the letters' values that are written inside a solution.
    circle_without_sine
        The value of atan2(0, A).
    """

    printer: Callable[[Ring, Mapping[str, TypesetName], Notation], Printer[str]]
    templates: Callable[[Form], tuple[str, ...]]
    angle: str
    position: str
    phi: str
    square: str
    inline: int
    circle_without_sine: tuple[str, str]


TEXT = Style(
    printer=_text_printer,
    templates=lambda form: form.text,
    angle=r"\g<0>",
    position=r"\g<0>",
    phi="phi",
    square="^2",
    inline=_INLINE,
    circle_without_sine=("atan2(0, A)", "0 where A > 0, else pi"),
)
"""Formulas as text."""
LATEX = Style(
    printer=_latex_printer,
    templates=lambda form: form.latex,
    angle=r"\\theta_{\2}",
    position=r"q_{\1}",
    phi=r"\varphi",
    square="^{2}",
    inline=2 * _INLINE,
    circle_without_sine=(
        r"\mathrm{atan2}(0,\, A)",
        r"0 \text{ where } A > 0, \text{ else } \pi",
    ),
)
"""Formulas in LaTeX."""
TYPST = Style(
    printer=typst_printer,
    templates=lambda form: tuple(t.replace("atan2(", 'op("atan2") (') for t in form.text),
    angle=r"theta_(\2)",
    position=r"q_(\1)",
    phi="phi",
    square="^2",
    inline=2 * _INLINE,
    circle_without_sine=('op("atan2") (0, A)', '0 " where " A > 0, " else " pi'),
)
"""Formulas in typst."""


class Phrases:
    """Writes the formulas of one derivation in one notation.

    Parameters
    ----------
    derivation
        The derivation.
    style
        The notation: :data:`TEXT`, :data:`LATEX` or :data:`TYPST`.
    """

    def __init__(self, derivation: InverseDerivation, style: Style) -> None:
        self.derivation = derivation
        self.style = style
        ring = derivation.chain.ring
        names = _written_names(derivation)
        typeset = typeset_names(set(names.names.values()) | symbols_of(ring.generators))
        for name in ("cphi", "sphi"):
            typeset[names(derivation.chain.names[name])] = _phi_name(name[0], derivation)
        self._printer: Printer[str] = style.printer(ring, typeset, names)

    def marked(self, element: Element) -> str:
        """Return an element with a positive term first if it has one, and line ends where lines may be broken."""
        products = list(collected(element))
        first = next((k for k, product in enumerate(products) if product.coefficient > 0), 0)
        if products:
            products.insert(0, products.pop(first))
        return self._printer.sum(products)

    def element(self, element: Element) -> str:
        """Return an element in one line, with a positive term first if it has one."""
        return self.marked(element).replace("\n", "")

    def name(self, name: str) -> str:
        """Return a defined quantity's name."""
        return self.element(self.derivation.chain.ring.constant(name))

    def unknown(self, unknown: Unknown) -> str:
        """Return the name of an unknown."""
        return self.angles(unknown.name)

    def angles(self, text: str) -> str:
        """Return a text with theta1, phi and q1 in this notation."""
        if self.style.angle == r"\g<0>":
            return text
        text = _ANGLE.sub(
            lambda m: self.style.phi if m[1] == "phi" else m.expand(self.style.angle), text
        )
        return re.sub(r"\bq(\d+)\b", self.style.position, text)

    def equations(self, step: DerivationStep) -> list[tuple[str, str]]:
        """Return both sides of a step's equations; the angle that remains of phi as a sum."""
        form = step.form
        if form is None:
            return []
        if isinstance(form, Remainder):
            return [(self.unknown(form.unknown), self._sum(form.terms))]
        sides = [(self.element(left), self.element(right)) for left, right in form.equations]
        if isinstance(form, CosineAndSquare):
            # The ring writes the square of a sine as 1 - c^2.
            cosine_equation, (_, square) = sides
            sides = [cosine_equation, (self.element(form.unknown.sine) + self.style.square, square)]
        return sides

    def solution(self, form: Form) -> Solution:
        """Return a form's solution."""
        name = self.unknown(form.unknown)
        if isinstance(form, Remainder):
            return Solution(name, (self._sum(form.terms),), ())
        templates = self.style.templates(form)
        placeholders = dict.fromkeys(PLACEHOLDER.findall(" ".join(templates)))
        derived = form.derived

        # Short values are written into the formulas.
        values = {
            k: self.element(derived[k][1] if k in derived else form.letters[k])
            for k in placeholders
        }
        if sum(map(len, values.values())) <= self.style.inline:
            alternatives = [_filled(template, values).removeprefix("0 ") for template in templates]
            return Solution(name, tuple(alternatives), ())

        # Otherwise letters stand in the formulas, and their values follow.
        in_letters = {}
        for k in placeholders:
            if k in derived:
                in_letters[k] = self._letters(derived[k][0])
            elif form.letters[k].is_zero:
                in_letters[k] = "0"
            else:
                in_letters[k] = k
        occurring = sorted(set(re.findall(r"[A-Zk](?![a-z])", " ".join(in_letters.values()))))
        letters = [(k, self.element(form.letters[k])) for k in occurring if k in form.letters]
        if isinstance(form, Circle) and form.letters["B"].is_zero:
            letters.append(self.style.circle_without_sine)
        alternatives = [_filled(template, in_letters) for template in templates]
        return Solution(name, tuple(alternatives), tuple(letters))

    def rule(self, choice: Choice) -> str:
        """Return the rule that names two roots, in words."""
        # The first name is that of a positive product. Numbers are left out: negative ones exchange the names.
        sign = 1
        texts = []
        for factor in choice.factors:
            if is_number(factor):
                (number,) = factor.terms.values()
                sign *= -1 if number < 0 else 1
            elif len(factor):
                texts.append(self.element(factor))
        first, second = choice.names if sign > 0 else choice.names[::-1]
        if len(texts) == 1:
            return f"{first} where {texts[0]} > 0, else {second}"
        return f"{first} where {' and '.join(texts)} have the same sign, else {second}"

    def _letters(self, text: str) -> str:
        """Return an expression in letters in this notation."""
        return (
            text if self.style is TEXT else text.replace("*", " ").replace("^2", self.style.square)
        )

    def _sum(self, terms: Sequence[tuple[str, int]]) -> str:
        """Return a sum of angles, each with 1 or -1."""
        signed = "".join(f" {'+' if sign > 0 else '-'} {self.angles(name)}" for name, sign in terms)
        return signed[3:] if signed.startswith(" + ") else f"-{signed[3:]}"

    # Angles of joints

    def joint_values(self) -> Iterator[tuple[str, str]]:
        """Yield joints whose table has an offset, with their value: q2, theta2 - pi/2."""
        derivation = self.derivation
        for i, (kind, offset) in enumerate(
            zip(derivation.description.kinds, derivation.chain.offsets, strict=True)
        ):
            if kind == "R" and not offset.is_zero:
                summand = self.constants(-offset)
                signed = f"- {summand[1:]}" if summand.startswith("-") else f"+ {summand}"
                yield self.angles(f"q{i + 1}"), self.angles(f"theta{i + 1} {signed}")

    def constants(self, expression: object) -> str:
        """Return an expression of the file's parameters."""
        return self._printer.expression(expression).replace("\n", "")  # type: ignore[arg-type]


def is_number(element: Element) -> bool:
    """Return whether an element is a number other than 0."""
    if len(element) != 1:
        return False
    (monomial,) = element.terms
    return not any(monomial)


def phi_label(derivation: InverseDerivation) -> str:
    """Return 23 for phi = theta2 + theta3; phi where an angle is subtracted, or there are two-digit joints."""
    is_plain = all(sense > 0 and joint < 10 for joint, sense in derivation.sum)
    return "".join(str(joint) for joint, _ in derivation.sum) if is_plain else "phi"


def _phi_name(function: str, derivation: InverseDerivation) -> TypesetName:
    r"""Return the name of the cosine or sine of phi: c_{23}, or c_{\varphi}."""
    label = phi_label(derivation)
    subscript = Part("varphi", Face.GREEK) if label == "phi" else Part(label)
    return TypesetName(Part(function), (subscript,))


def _written_names(derivation: InverseDerivation) -> Notation:
    """Return the printed names of the ring's constants: c23 for the cosine of phi."""
    names = dict(notation(derivation.chain.ring).names)
    if derivation.sum:
        label = phi_label(derivation)
        for function in ("c", "s"):
            names[derivation.chain.names[f"{function}phi"]] = f"{function}{label}"
    return Notation(names)


def _filled(template: str, texts: dict[str, str]) -> str:
    """Return a template with texts for its placeholders."""
    return PLACEHOLDER.sub(lambda match: texts[match[1]], template)


def solved_before(derivation: InverseDerivation, step: DerivationStep) -> list[str]:
    """Return the joints and defined quantities of earlier steps that a step uses, in their order."""
    elements = [definition.element for definition in step.definitions]
    if isinstance(step.form, Flip):
        # k is not known yet.
        elements += [step.form.letters["X"], step.form.letters["Y"]]
    else:
        elements += step.elements

    own = step.unknown.joint if step.unknown else None
    joints = _joints_in(elements, _joints_of_quantities(derivation, step)) - {own}
    kinds = derivation.description.kinds
    return [f"theta{i + 1}" if kinds[i] == "R" else f"q{i + 1}" for i in sorted(joints) if i >= 0]


def _joints_of_quantities(
    derivation: InverseDerivation, step: DerivationStep
) -> dict[str, set[int]]:
    """Return the joints that each quantity of the steps before one depends on, by name; phi is such a quantity."""
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
    """Return the joints, from 0, that elements depend on, themselves or by the quantities in them."""
    joints: set[int] = set()
    for generator in generators_of(elements):
        if generator.kind == "constant":
            joints |= of_quantities.get(generator.text, set())
        else:
            joints.add(generator.joint)
    return joints
