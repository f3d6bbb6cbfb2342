"""Base parameters: the fewest combinations of inertial parameters that the torques depend on.

What part of a link is symmetric about its joint's axis might as well belong to the link before, and a sliding link
turns with the one before (Gautier & Khalil, 1990, "Direct calculation of minimum set of inertial parameters of serial
robots"). That is done exactly, with symbols. What depends on others still, or has no effect, is found in the columns
of the regressor, lengths and angles being in general position, and grouped exactly. That the grouped equations are the
full ones can be proved by substitution.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain

import numpy as np

from dhkit.description import Description, Named, takes_robot
from dhkit.display import MOST_ROWS, counted, html_table, repr_line
from dhkit.expressions import Expression
from dhkit.symbolic.exact import composite
from dhkit.symbolic.exact.composite import RigidBody, Step
from dhkit.symbolic.exact.dependencies import MissingReciprocalError, independent
from dhkit.symbolic.exact.exact_arm import ExactArm, ExactRow
from dhkit.symbolic.exact.lagrangian import Lagrangian, Proof, lagrangian
from dhkit.symbolic.ring import Constant, Element, Elements, Ring, RingError, translated

SECOND = {"XX": (0, 0), "XY": (0, 1), "XZ": (0, 2), "YY": (1, 1), "YZ": (1, 2), "ZZ": (2, 2)}
MOMENT = {"MX": 0, "MY": 1, "MZ": 2}
READABLE, LONGEST_DEFINITION = 30, 200
"""Terms and characters of a definition that a notebook shows."""
MAX_TERMS = 60_000
"""Terms of M in all inertial parameters: three times a Jaco's, a minute on sympy's rings."""


@dataclass(frozen=True, eq=False, repr=False)
class BaseParameters:
    """The fewest combinations of inertial parameters that decide an arm's torques.

    They are Khalil's, in each joint's own frame (its z along the joint, moving with the link; the DH frame itself in
    the modified convention): moments ``XX2`` ... ``ZZ2`` about its origin, first moments ``MX2 MY2 MZ2``, mass ``M2``,
    and ``Ia2`` for the rotor's inertia as the joint sees it.

    Attributes
    ----------
    definitions
        What each stands for, by name: an element of ``full``'s ring.
    lagrangian
        The equations of motion in them.
    full
        The equations of motion in all inertial parameters.
    """

    definitions: Mapping[str, Element]
    lagrangian: Lagrangian
    full: Lagrangian

    @property
    def names(self) -> tuple[str, ...]:
        """The base parameters' names, link by link."""
        return tuple(self.definitions)

    def __len__(self) -> int:
        return len(self.definitions)

    def __repr__(self) -> str:
        return repr_line("BaseParameters", f"{self.full.description.name}, {len(self)}", ", ".join(self.names))

    def _repr_html_(self) -> str:
        shown = {name: self.definitions[name] for name in self.names[:MOST_ROWS]}
        rows = [
            (name, str(element) if len(element) <= READABLE else counted(len(element), "term"))
            for name, element in shown.items()
        ]
        caption = f"Base parameters of {self.full.description.name}"
        return html_table(("parameter", "stands for"), rows, caption, count=len(self), longest=LONGEST_DEFINITION)

    def prove(self) -> Proof:
        """Decide whether the equations in base parameters are the full ones, by putting the definitions in.

        M and g decide everything else: C is made of M's derivatives.
        """
        short, ring = self.lagrangian, self.full.arm.ring
        places = {short.arm.ring.place("constant", name): element for name, element in self.definitions.items()}
        back = _mapped(np.column_stack([short.M, short.g]), ring, places)
        difference = back - np.column_stack([self.full.M, self.full.g])
        return Proof("M and g in base parameters are those in all parameters", difference)


@takes_robot
@lru_cache(maxsize=32)
def base_parameters(description: Description) -> BaseParameters:
    """Return an arm's base parameters, with what each stands for, and its equations of motion in them.

    Raises
    ------
    DescriptionError
        A link has no body.
    RingError
        The equations are too long, or a parameter depends on others by no polynomial.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> base = base_parameters(library_robot("planar2r"))
    >>> base.names
    ('ZZ1', 'MX1', 'MY1', 'ZZ2', 'MX2', 'MY2')
    >>> bool(base.prove())
    True
    """
    needed: tuple[Expression, ...] = ()
    for _ in range(description.n):
        full = lagrangian(description, "inertial", needed)
        if (terms := sum(len(element) for element in full.M.flat)) > MAX_TERMS:
            raise RingError(
                f"{description.name}: M of {terms} terms is too long for base parameters; at most {MAX_TERMS}"
            )
        definitions = _regrouped(full.arm)
        try:
            definitions = independent(_equations(full.arm, definitions), definitions)
        except MissingReciprocalError as missing:
            needed = (*needed, missing.reciprocal)
            continue
        return BaseParameters(Named(definitions), _equations(full.arm, definitions), full)
    raise RingError(f"{description.name}: base parameters were not found")


def _regrouped(arm: ExactArm) -> dict[str, Element]:
    """Move to the link before what may as well be its own, and name what is left."""
    bodies, steps = composite.joint_bodies(arm), composite.joint_steps(arm)
    for j in range(arm.n - 1, 0, -1):
        moving, bodies[j] = _split(arm.ring, arm.ring.kinds[j], bodies[j])
        bodies[j - 1] = bodies[j - 1] + moving.moved(_at_rest(arm, j, steps[j]))
    definitions: dict[str, Element] = {}
    end = _ending(arm)
    for j, body in enumerate(bodies, start=1):
        definitions |= {f"{key}{j}{end}": body.second[place] for key, place in SECOND.items()}
        definitions |= {f"{key}{j}{end}": body.moment[k] for key, k in MOMENT.items()}
        definitions |= {f"M{j}{end}": body.mass, f"Ia{j}{end}": arm.armature[j - 1]}
    return {name: element for name, element in definitions.items() if element}


def _ending(arm: ExactArm) -> str:
    """Return what our names end in: an underscore where a parameter of the file has one of them."""
    names = {f"{key}{j}" for key in (*SECOND, *MOMENT, "M", "Ia") for j in range(1, arm.n + 1)}
    return "" if names.isdisjoint(arm.ring.constants) else "_"


def _split(ring: Ring, kind: str, body: RigidBody) -> tuple[RigidBody, RigidBody]:
    """Return what of a link may belong to the link before, and what is left of it."""
    zero = ring.zero
    moment, second = np.array([zero] * 3, dtype=object), np.full((3, 3), zero, dtype=object)
    if kind != "R":
        return RigidBody(zero, moment, body.second), RigidBody(body.mass, body.moment, second)
    moment[2] = body.moment[2]
    second[0, 0] = second[1, 1] = body.second[1, 1]
    moving = RigidBody(body.mass, moment, second)
    return moving, RigidBody(zero, body.moment - moment, body.second - second)


def _at_rest(arm: ExactArm, j: int, step: Step) -> Step:
    """Return a joint's step with its variable at zero: what is moved does not feel it."""
    ring = arm.ring
    if ring.kinds[j] == "R":
        places = {ring.place("sine", j): ring.zero, ring.place("cosine", j): ring.one}
    else:
        places = {ring.place("position", j): ring.zero}
    return Step(_mapped(step.R, ring, places), _mapped(step.p, ring, places))


def _mapped(elements: Elements, ring: Ring, places: Mapping[int, Element]) -> Elements:
    array = np.empty(elements.shape, dtype=object)
    for place, element in np.ndenumerate(elements):
        array[place] = translated(element, ring, places)
    return array


def _equations(arm: ExactArm, definitions: Mapping[str, Element]) -> Lagrangian:
    """Return the equations of motion with a symbol for each definition."""
    ring = Ring(arm.ring.kinds, [*_kept(arm), *(Constant(name) for name in definitions)])
    end = _ending(arm)

    def named(name: str) -> Element:
        return ring.constant(f"{name}{end}") if f"{name}{end}" in definitions else ring.zero

    def body(j: int) -> RigidBody:
        second = np.empty((3, 3), dtype=object)
        for key, (row, column) in SECOND.items():
            second[row, column] = second[column, row] = named(f"{key}{j}")
        return RigidBody(named(f"M{j}"), np.array([named(f"{key}{j}") for key in MOMENT], dtype=object), second)

    numbers = arm.ring.values(arm.values, np.zeros(arm.n))
    short = replace(
        arm,
        ring=ring,
        rows=tuple(_row(row, ring) for row in arm.rows),
        bodies=(),
        gear=(ring.one,) * arm.n,
        rotor=tuple(named(f"Ia{j}") for j in range(1, arm.n + 1)),
        gravity=_mapped(arm.gravity, ring, {}),
        origin=_mapped(arm.origin, ring, {}),
        tool=_mapped(arm.tool, ring, {}),
        parameters=arm.parameters | {name: float(element.value(numbers)) for name, element in definitions.items()},
        values={text: arm.values[text] for text in ring.constants if text in arm.values}
        | {name: float(element.value(numbers)) for name, element in definitions.items()},
        inertial=tuple(definitions),
    )
    bodies = [body(j) for j in range(1, arm.n + 1)]
    M, V = composite.mass_matrix(short, bodies), composite.potential_energy(short, bodies)
    return Lagrangian(short, M, V, Named(definitions))


def _row(row: ExactRow, ring: Ring) -> ExactRow:
    a, d, ca, sa, c, s = (translated(x, ring, {}) for x in (row.a, row.d, *row.alpha, *row.theta))
    return ExactRow(a, d, (ca, sa), (c, s))


def _kept(arm: ExactArm) -> list[Constant]:
    """Return the constants of table and gravity: those that are not, or hold, an inertial parameter."""
    geometry = [*arm.gravity, *arm.origin, *arm.tool]
    for row in arm.rows:
        geometry += [row.a, row.d, *row.alpha, *row.theta]
    inertial = [*arm.gear, *arm.rotor]
    for body in chain.from_iterable(arm.bodies):
        inertial += [body.mass, *body.moment, *body.second.flat]
    names = _constants(inertial) - _constants(geometry)
    return [constant for constant in arm.ring.given if constant.text not in names and not constant.symbols & names]


def _constants(elements: Sequence[Element]) -> set[str]:
    return {
        generator.text
        for element in elements
        for monomial in element.terms
        for generator, exponent in zip(element.ring.generators, monomial, strict=True)
        if exponent and generator.kind == "constant"
    }
