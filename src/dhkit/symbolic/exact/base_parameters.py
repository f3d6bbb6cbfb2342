"""Base parameters: the fewest combinations of inertial parameters that the torques depend on.

What part of a link is symmetric about its joint's axis might as well belong to the link before, and a sliding link
turns with the one before (Gautier & Khalil, 1990, "Direct calculation of minimum set of inertial parameters of serial
robots"). That is done exactly, with symbols. What depends on others still, or has no effect, is found in the columns
of the regressor, lengths and angles being in general position, and grouped exactly. That the grouped equations are the
full ones can be proved by substitution.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache, reduce
from itertools import combinations, islice

import numpy as np

from dhkit.description import Array, Description, Named
from dhkit.expressions import Expression, exact, substitute
from dhkit.symbolic.exact import composite
from dhkit.symbolic.exact.composite import RigidBody, Step
from dhkit.symbolic.exact.exact_arm import ExactArm, ExactRow
from dhkit.symbolic.exact.lagrangian import Lagrangian, Proof, lagrangian
from dhkit.symbolic.ring import Constant, Element, Elements, Ring, RingError, translated
from dhkit.symbolic.ring.polynomials import Monomial

__all__ = ["BaseParameters", "base_parameters"]

SECOND = {"XX": (0, 0), "XY": (0, 1), "XZ": (0, 2), "YY": (1, 1), "YZ": (1, 2), "ZZ": (2, 2)}
MOMENT = {"MX": 0, "MY": 1, "MZ": 2}
MAX_TERMS = 60_000
"""Terms of M in all inertial parameters: three times a Jaco's, a minute on sympy's rings."""
MOST = 3
"""Parameters that one may depend on: a sliding joint's moment on two of the link that it slides in, and a mass."""
TRIES = 200
DEPENDENT = 1e-9
"""What is left of a column of unit length, others taken off, where it depends on them; roundings leave 1e-14."""


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
        return f"<BaseParameters of {self.full.description.name}: {', '.join(self.names)}>"

    def prove(self) -> Proof:
        """Decide whether the equations in base parameters are the full ones, by putting the definitions in.

        M and g decide everything else: C is made of M's derivatives.
        """
        short, ring = self.lagrangian, self.full.arm.ring
        places = {short.arm.ring.place("constant", name): element for name, element in self.definitions.items()}
        back = _mapped(np.column_stack([short.M, short.g]), ring, places)
        difference = back - np.column_stack([self.full.M, self.full.g])
        return Proof("M and g in base parameters are those in all parameters", difference)


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
            definitions = _independent(_equations(full.arm, definitions), definitions)
        except _MissingReciprocalError as missing:
            needed = (*needed, missing.reciprocal)
            continue
        return BaseParameters(Named(definitions), _equations(full.arm, definitions), full)
    raise RingError(f"{description.name}: base parameters were not found")


class _MissingReciprocalError(Exception):
    """A parameter depends on another by a fraction whose reciprocal the ring has not."""

    def __init__(self, reciprocal: Expression) -> None:
        super().__init__(str(reciprocal))
        self.reciprocal = reciprocal


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
    for body in arm.bodies:
        inertial += [body.mass, *body.moment, *body.second.flat]
    names = _constants(inertial) - _constants(geometry)
    return [
        constant
        for constant in arm.ring.given
        if constant.text not in names and not (constant.meaning and constant.meaning.symbols & names)
    ]


def _constants(elements: Sequence[Element]) -> set[str]:
    return {
        generator.text
        for element in elements
        for monomial in element.terms
        for generator, exponent in zip(element.ring.generators, monomial, strict=True)
        if exponent and generator.kind == "constant"
    }


def _independent(trial: Lagrangian, definitions: Mapping[str, Element]) -> dict[str, Element]:
    """Drop what has no effect, and group what depends on parameters before it."""
    regressor = _Regressor.of(trial, list(definitions))
    merged: dict[str, Element] = {}
    basis = np.zeros((len(regressor.rows), 0))
    for name in definitions:
        column = regressor.column(name)
        if not column.any():
            continue
        rest = column / np.linalg.norm(column)
        for _ in range(2):  # once more, so that roundings go as well
            rest = rest - basis @ (basis.T @ rest)
        if np.linalg.norm(rest) > DEPENDENT:
            merged[name] = definitions[name]
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
            continue
        for other, factor in regressor.grouping(name, list(merged)).items():
            merged[other] = merged[other] + definitions[name] * translated(factor, definitions[name].ring, {})
    return merged


@dataclass(frozen=True, eq=False)
class _Regressor:
    """Coefficients of the parameters in M and g, which decide the torques: a row for every entry and monomial of state.

    Attributes
    ----------
    ring, names
        Of the parameters.
    rows
        The coefficient of each parameter: terms without the state.
    numbers
        What the rows are worth where lengths and angles are anything, shape (rows, parameters).
    """

    ring: Ring
    names: Sequence[str]
    rows: Sequence[Mapping[str, Mapping[Monomial, Fraction]]]
    numbers: Array

    @classmethod
    def of(cls, trial: Lagrangian, names: Sequence[str]) -> _Regressor:
        ring = trial.arm.ring
        places = {ring.place("constant", name): name for name in names}
        of_state = [k for k, generator in enumerate(ring.generators) if generator.kind != "constant"]
        terms: dict[tuple[int, Monomial], dict[str, dict[Monomial, Fraction]]] = {}
        for i, element in enumerate([*trial.M[np.triu_indices(trial.n)], *trial.g]):
            for monomial, coefficient in element.terms.items():
                place = next(place for place in places if monomial[place])
                rest = list(monomial)
                for k in (*of_state, place):
                    rest[k] = 0
                row = terms.setdefault((i, tuple(monomial[k] for k in of_state)), {})
                row.setdefault(places[place], {})[tuple(rest)] = coefficient
        anywhere = _somewhere(ring)
        numbers = np.zeros((len(terms), len(names)))
        for k, row in enumerate(terms.values()):
            for name, entry in row.items():
                numbers[k, names.index(name)] = sum(_worth(m, c, anywhere) for m, c in entry.items())
        return cls(ring, names, list(terms.values()), numbers)

    def column(self, name: str) -> Array:
        """Return a parameter's column of numbers."""
        column: Array = self.numbers[:, self.names.index(name)]
        return column

    def grouping(self, name: str, kept: Sequence[str]) -> dict[str, Element]:
        """Return by which factors a dependent parameter enters those before it, exactly.

        The fewest columns that it depends on are found in numbers; the factors are quotients of determinants (Cramer's
        rule) of exact entries, of the rows where those are shortest.
        """
        column = self.column(name)
        for size in range(1, MOST + 1):
            for support in combinations(kept, size):
                A = np.column_stack([self.column(other) for other in support])
                factors, *_ = np.linalg.lstsq(A, column, rcond=None)
                if np.linalg.norm(A @ factors - column) <= DEPENDENT * np.linalg.norm(column):
                    return self._factors(name, support)
        raise RingError(f"{name} depends on more than {MOST} parameters before it; base parameters were not found")

    def _factors(self, name: str, support: Sequence[str]) -> dict[str, Element]:
        ring, polynomials = self.ring, self.ring.polynomials
        places = [self.names.index(other) for other in support]
        touching = [k for k, row in enumerate(self.rows) if not row.keys().isdisjoint(support)]
        touching.sort(key=lambda k: sum(len(entry) for entry in self.rows[k].values()))
        fractions: tuple[list[Element], Element] | None = None
        for chosen in islice(combinations(touching, len(support)), TRIES):
            if abs(np.linalg.det(self.numbers[np.ix_(chosen, places)])) < DEPENDENT:
                continue
            A = [[ring.from_terms(self.rows[k].get(other, {})) for other in support] for k in chosen]
            right = [ring.from_terms(self.rows[k].get(name, {})) for k in chosen]
            whole = _determinant(A)
            parts = [
                _determinant([[*r[:j], b, *r[j + 1 :]] for r, b in zip(A, right, strict=True)]) for j in range(len(A))
            ]
            quotients = [polynomials.quotient(part.polynomial, whole.polynomial) for part in parts]
            if all(quotient is not None for quotient in quotients):
                return {other: Element(ring, x) for other, x in zip(support, quotients, strict=True)}
            fractions = fractions or (parts, whole)
        if fractions is None:
            raise RingError(f"{name} depends on {', '.join(support)}, but not exactly; base parameters were not found")
        parts, whole = fractions
        inverse = 1 / _expression(whole)
        try:
            factor = ring.read(inverse)
        except RingError:
            raise _MissingReciprocalError(inverse) from None
        return {other: part * factor for other, part in zip(support, parts, strict=True)}


def _expression(element: Element) -> Expression:
    """Return an element of constants as an expression in the parameters."""
    meanings = {k: g.meaning or Expression.symbol(g.text) for k, g in enumerate(element.ring.generators)}
    return Expression.sum(
        reduce(operator.mul, (meanings[k] ** e for k, e in enumerate(monomial) if e), Expression.number(coefficient))
        for monomial, coefficient in element.terms.items()
    )


def _somewhere(ring: Ring) -> list[float]:
    """Return a number for each generator, lengths and angles in general position: what their relations allow."""
    rng = np.random.default_rng(0)
    known: dict[str, float] = {}
    values = {name: exact(float(x)) for name, x in zip(_symbols(ring), rng.uniform(0.5, 2.0, 1000), strict=False)}
    for constant in ring.given:
        if constant.text in known:
            continue
        if constant.text.startswith("cos(") and constant.meaning is not None:
            angle = rng.uniform(0.2, 1.4)
            known[constant.text], known[f"sin{constant.text[3:]}"] = math.cos(angle), math.sin(angle)
        elif constant.reciprocal_of is not None:
            so_far = [known.get(generator.text, 1.0) for generator in ring.generators]
            known[constant.text] = 1 / float(ring.read(constant.reciprocal_of).value(so_far))
        else:
            known[constant.text] = float(substitute(constant.meaning or Expression.symbol(constant.text), values))
    return [known.get(generator.text, 1.0) for generator in ring.generators]


def _symbols(ring: Ring) -> list[str]:
    found = {constant.text for constant in ring.given if constant.meaning is None}
    return sorted(found.union(*(constant.meaning.symbols for constant in ring.given if constant.meaning)))


def _worth(monomial: Monomial, coefficient: Fraction, values: Sequence[float]) -> float:
    number = float(coefficient)
    for value, exponent in zip(values, monomial, strict=True):
        if exponent:
            number *= value**exponent
    return number


def _determinant(A: list[list[Element]]) -> Element:
    if len(A) == 1:
        return A[0][0]
    minors = [_determinant([row[:j] + row[j + 1 :] for row in A[1:]]) for j in range(len(A))]
    signed = [(1 if j % 2 == 0 else -1) * A[0][j] * minor for j, minor in enumerate(minors)]
    return signed[0].ring.sum(signed)
