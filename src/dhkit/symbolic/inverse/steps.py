"""Steps of a derivation of inverse kinematics as values, and the workbench on which families write them down."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

from dhkit.symbolic.inverse.chain import INNER, POSE, ExactChain, is_identity, undone
from dhkit.symbolic.inverse.forms import Form, Unknown
from dhkit.symbolic.ring import Element, Elements
from dhkit.symbolic.ring.elements import element_array
from dhkit.symbolic.ring.ring import translated


class View(Enum):
    """Subject of the figure of a step."""

    TOP = "top"
    """The arm's plane seen along axis 1."""
    TRIANGLE = "triangle"
    """Two links and the point that they reach, seen along their axes."""
    SLIDE = "slide"
    """A slide and the point that it reaches, seen along the axis that turns it."""


@dataclass(frozen=True, eq=False)
class Figure:
    """The figure of a step.

    Attributes
    ----------
    view
        What it shows.
    labels
        Names of the axes, and of the point.
    first
        Of a triangle: the first link before it turns, x and y, m.
    """

    view: View
    labels: tuple[str, ...]
    first: tuple[Element, ...] = ()


@dataclass(frozen=True, eq=False)
class Definition:
    """A quantity that a step defines in known ones.

    Attributes
    ----------
    name
        Its name in the ring.
    element
        Its value in the pose's entries, lengths, and joints of earlier steps.
    """

    name: str
    element: Element


@dataclass(frozen=True, eq=False)
class Choice:
    """The rule that names the two roots of a step at a pose.

    Attributes
    ----------
    names
        The name of the root where the product of the factors is positive, and that of the other one.
    factors
        Quantities of which the signs count; a factor of zero counts as positive.
    """

    names: tuple[str, str]
    factors: tuple[Element, ...]


@dataclass(frozen=True, eq=False)
class DerivationStep:
    """A step of a derivation.

    Attributes
    ----------
    title
        What it finds.
    look
        What is looked at, in a sentence.
    definitions
        Quantities defined before the equation.
    form
        The equation and its solution; None for a step that only defines quantities.
    nothing
        When there is no solution, with the distance that is missing; empty if there always is one.
    singular
        When the solution is not unique or not smooth; empty if never.
    choice
        The rule that names the roots, where there are two.
    figure
        Its figure.
    """

    title: str
    look: str
    definitions: tuple[Definition, ...] = ()
    form: Form | None = None
    nothing: str = ""
    singular: str = ""
    choice: Choice | None = None
    figure: Figure | None = None

    @property
    def unknown(self) -> Unknown | None:
        """Unknown that the step solves for."""
        return None if self.form is None else self.form.unknown

    @property
    def elements(self) -> list[Element]:
        """The elements of its equation, of its solution, and of the rule that names the roots."""
        found: list[Element] = []
        if self.form is not None:
            found += self.form.letters.values()
            found += [side for equation in self.form.equations for side in equation]
        return found + list(self.choice.factors if self.choice else ())


@dataclass(frozen=True, eq=False)
class Condition:
    """An equation that a pose has to satisfy for a solution to exist: the pose lies in the arm's plane."""

    look: str
    left: Element
    right: Element


@dataclass(eq=False)
class Workbench:
    """The steps so far, and what is known.

    Attributes
    ----------
    chain
        The arm.
    undoes_tool
        Whether the pose is taken back through the tool and the last link, too; arms that cannot reach every pose keep
        them.
    """

    chain: ExactChain
    undoes_tool: bool
    steps: list[DerivationStep] = field(default_factory=list)
    conditions: list[Condition] = field(default_factory=list)
    meanings: dict[str, Element] = field(default_factory=dict)
    """Values of the names of the pose and of defined quantities if the pose is that of the arm."""

    sum: tuple[tuple[int, int], ...] = ()
    """The joints whose angles add up to phi, from 1, each with 1 or -1; empty without phi."""

    def __post_init__(self) -> None:
        chain = self.chain
        tool = chain.tool_pose
        self._mean(POSE, [*tool[:3, 3], *tool[:3, :3].flat])
        last = chain.last if self.undoes_tool else None
        if is_identity(chain.first) and (last is None or is_identity(last)):
            self.T = chain.given_pose
            return
        identity = chain.part(1, 0)
        given = undone(chain.first, chain.given_pose, identity if last is None else last)
        inner = chain.whole if last is not None else chain.whole @ chain.last
        self._mean(INNER, [*inner[:3, 3], *inner[:3, :3].flat])
        values = dict(zip(INNER, [*given[:3, 3], *given[:3, :3].flat], strict=True))
        what = "base and tool" if self.undoes_tool else "base"
        self.steps.append(
            DerivationStep(
                f"The pose without {what}",
                f"The constant transforms before axis 1{f' and behind joint {chain.n}' * self.undoes_tool} are taken "
                "off: what remains, h, depends on the joints alone.",
                tuple(Definition(self.chain.names[name], values[name]) for name in INNER),
            )
        )
        self.T = identity.copy()
        self.T[:3, 3] = chain.named(INNER[:3])
        self.T[:3, :3] = chain.named(INNER[3:]).reshape(3, 3)

    def _mean(self, names: Sequence[str], elements: Iterable[Element]) -> None:
        self.meanings |= {self.chain.names[name]: element for name, element in zip(names, elements, strict=True)}

    def define(self, name: str, element: Element) -> tuple[Definition, Element]:
        """Return a definition and its symbol; a quantity that is a symbol or a number already needs none."""
        own = self.chain.names[name]
        self.meanings[own] = self.meaning(element)
        return Definition(own, element), self.chain.symbol(name)

    def define_all(self, **elements: Element) -> tuple[tuple[Definition, ...], Elements]:
        """Return definitions and their symbols, shape (k,)."""
        pairs = [self.define(name, element) for name, element in elements.items()]
        return tuple(definition for definition, _ in pairs), element_array([symbol for _, symbol in pairs])

    def add(self, step: DerivationStep) -> None:
        """Append a step."""
        self.steps.append(step)

    def meaning(self, element: Element) -> Element:
        """Return an element for the pose of the arm itself, in sines and cosines of its joints."""
        ring = self.chain.ring
        places = {ring.place("constant", name): value for name, value in self.meanings.items()}
        used = {k for monomial in element.terms for k, exponent in enumerate(monomial) if exponent and k in places}
        return translated(element, ring, {k: places[k] for k in used}) if used else element

    def unknown(self, i: int) -> Unknown:
        """Return joint i, from 1, as an unknown."""
        chain = self.chain
        if chain.description.kinds[i - 1] == "R":
            return Unknown(f"theta{i}", i - 1, chain.cosine_and_sine(i))
        return Unknown(f"q{i}", i - 1, (chain.ring.position(i - 1),))

    def phi(self, cosine: Element, sine: Element, senses: Sequence[tuple[int, int]]) -> Unknown:
        """Return the angle phi as an unknown, with what its cosine and sine are for the arm itself."""
        self.sum = tuple(senses)
        self._mean(("cphi", "sphi"), (cosine, sine))
        return Unknown("phi", None, tuple(self.chain.named(("cphi", "sphi"))))


def names_in(elements: Iterable[Element]) -> set[str]:
    """Return the names of the constants in elements."""
    found = set()
    for element in elements:
        generators = element.ring.generators
        used = {k for monomial in element.terms for k, exponent in enumerate(monomial) if exponent}
        found |= {generators[k].text for k in used if generators[k].kind == "constant"}
    return found


def without_unused(steps: Sequence[DerivationStep], further: Iterable[Element] = ()) -> list[DerivationStep]:
    """Return steps without the definitions that nothing uses."""
    kept: list[DerivationStep] = []
    used = names_in(further)
    for step in reversed(steps):
        used |= names_in(step.elements)
        definitions = []
        for definition in reversed(step.definitions):
            if definition.name in used:
                definitions.append(definition)
                used |= names_in([definition.element])
        kept.append(replace(step, definitions=tuple(reversed(definitions))))
    return [step for step in reversed(kept) if step.form is not None or step.definitions]
