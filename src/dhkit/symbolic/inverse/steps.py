"""Steps of a derivation of inverse kinematics as values, and the workbench on which families write them down."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

from dhkit.symbolic.exact.transforms import identity
from dhkit.symbolic.inverse.chain import INNER, POSE, ExactChain, is_identity, undone
from dhkit.symbolic.inverse.forms import Form, Unknown
from dhkit.symbolic.ring import Element, Elements
from dhkit.symbolic.ring.elements import element_array
from dhkit.symbolic.ring.notation import constants_of, generators_of
from dhkit.symbolic.ring.ring import translated


class View(Enum):
    """The scene that the figure of a step shows."""

    TOP = "top"
    """The arm's plane seen along axis 1."""
    TRIANGLE = "triangle"
    """Two links and the point that they reach, seen along their axes."""
    SLIDE = "slide"
    """A prismatic joint and the point that it reaches, seen along the axis that turns it."""


@dataclass(frozen=True, eq=False)
class Figure:
    """The figure of a step.

    Attributes
    ----------
    view
        The scene that it shows.
    labels
        Names of the axes, and of the point.
    first
        For a triangle, the first link before it turns, x and y, m.
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
        Quantities whose signs are multiplied; a factor of zero counts as positive.
    """

    names: tuple[str, str]
    factors: tuple[Element, ...]


@dataclass(frozen=True, eq=False)
class DerivationStep:
    """A step of a derivation.

    Attributes
    ----------
    title
        The quantity that it finds.
    look
        The geometric idea, in one or more sentences.
    definitions
        Quantities defined before the equation.
    form
        The equation and its solution; None for a step that only defines quantities.
    nothing
        The condition under which there is no solution, with the distance that is missing; empty if there always is one.
    singular
        The condition under which the solution is not unique or not smooth; empty if it always is.
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
        """The quantity that the step solves for; None if it only defines quantities."""
        return None if self.form is None else self.form.unknown

    @property
    def elements(self) -> list[Element]:
        """The elements of its equation, of its solution, and of the rule that names the roots."""
        found: list[Element] = []
        if self.form is not None:
            found += self.form.letters.values()
            for left, right in self.form.equations:
                found += [left, right]
        if self.choice is not None:
            found += self.choice.factors
        return found


@dataclass(frozen=True, eq=False)
class Condition:
    """An equation that a pose has to satisfy for a solution to exist: the pose lies in the arm's plane."""

    look: str
    left: Element
    right: Element


@dataclass(eq=False)
class Workbench:
    """The steps so far, and the quantities that they have found.

    Attributes
    ----------
    chain
        The arm.
    undoes_tool
        Whether the constant transform after the last joint, F, is divided out of the pose as E is; arms that cannot
        reach every pose keep it.
    T
        The pose that the steps start from: E^-1 T F^-1, or E^-1 T; its entries are symbols.
    """

    chain: ExactChain
    undoes_tool: bool
    steps: list[DerivationStep] = field(default_factory=list)
    conditions: list[Condition] = field(default_factory=list)
    meanings: dict[str, Element] = field(default_factory=dict)
    """Values of the pose's entries and of defined quantities in the joints, if the pose is that of the arm, by name."""

    sum: tuple[tuple[int, int], ...] = ()
    """The joints whose angles add up to phi, from 1, each with 1 or -1; empty without phi."""

    def __post_init__(self) -> None:
        chain = self.chain
        self._set_meanings(POSE, _entries(chain.tool_pose))

        E = chain.first
        F = chain.last if self.undoes_tool else identity(chain.ring)
        if is_identity(E) and is_identity(F):
            self.T = chain.given_pose
            return

        # h = E^-1 T F^-1 = J_1 C_1 ... J_n, or with F kept, h = E^-1 T = J_1 C_1 ... J_n F
        given = undone(E, chain.given_pose, F)
        in_joints = chain.whole if self.undoes_tool else chain.whole @ chain.last
        self._set_meanings(INNER, _entries(in_joints))

        what = "base and tool" if self.undoes_tool else "base"
        after = f" and after joint {chain.n}" if self.undoes_tool else ""
        definitions = [
            Definition(chain.names[name], entry)
            for name, entry in zip(INNER, _entries(given), strict=True)
        ]
        self.steps.append(
            DerivationStep(
                f"The pose without {what}",
                f"The constant transforms before axis 1{after} are taken off: what remains, h, depends on the joints "
                "alone.",
                tuple(definitions),
            )
        )
        self.T = identity(chain.ring)
        self.T[:3, 3] = chain.named(INNER[:3])
        self.T[:3, :3] = chain.named(INNER[3:]).reshape(3, 3)

    def _set_meanings(self, names: Sequence[str], elements: Iterable[Element]) -> None:
        """Set the values of quantities in the joints; names are the usual ones."""
        for name, element in zip(names, elements, strict=True):
            self.meanings[self.chain.names[name]] = element

    def define(self, name: str, element: Element) -> tuple[Definition, Element]:
        """Return the definition of a quantity by its usual name, and its symbol."""
        own = self.chain.names[name]
        self.meanings[own] = self.meaning(element)
        return Definition(own, element), self.chain.symbol(name)

    def define_all(self, **elements: Element) -> tuple[tuple[Definition, ...], Elements]:
        """Return definitions and their symbols, shape (k,)."""
        definitions = []
        symbols = []
        for name, element in elements.items():
            definition, symbol = self.define(name, element)
            definitions.append(definition)
            symbols.append(symbol)
        return tuple(definitions), element_array(symbols)

    def add(self, step: DerivationStep) -> None:
        """Append a step."""
        self.steps.append(step)

    def meaning(self, element: Element) -> Element:
        """Return an element for the pose of the arm itself, in sines and cosines of its joints."""
        ring = self.chain.ring
        meanings = {ring.place("constant", name): value for name, value in self.meanings.items()}
        replacements = {k: meanings[k] for k in element.used_generators if k in meanings}
        return translated(element, ring, replacements) if replacements else element

    def unknown(self, i: int) -> Unknown:
        """Return joint i, from 1, as an unknown."""
        chain = self.chain
        if chain.description.kinds[i - 1] == "R":
            return Unknown(f"theta{i}", i - 1, chain.cosine_and_sine(i))
        return Unknown(f"q{i}", i - 1, (chain.ring.position(i - 1),))

    def phi(self, cosine: Element, sine: Element, senses: Sequence[tuple[int, int]]) -> Unknown:
        """Return the angle phi as an unknown.

        Parameters
        ----------
        cosine, sine
            Cosine and sine of phi in the joints.
        senses
            The joints whose angles add up to phi, from 1, each with 1 or -1.
        """
        self.sum = tuple(senses)
        self._set_meanings(("cphi", "sphi"), (cosine, sine))
        return Unknown("phi", None, tuple(self.chain.named(("cphi", "sphi"))))


def names_in(elements: Iterable[Element]) -> set[str]:
    """Return the names of the constants in elements."""
    return {generator.text for generator in constants_of(generators_of(elements))}


def _entries(T: Elements) -> list[Element]:
    """Return the twelve entries of a pose in the order of :data:`POSE`: position, then rotation row by row."""
    return [*T[:3, 3], *T[:3, :3].flat]


def without_unused(
    steps: Sequence[DerivationStep], further: Iterable[Element] = ()
) -> list[DerivationStep]:
    """Return steps without the definitions that neither a later step nor a further element uses."""
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
