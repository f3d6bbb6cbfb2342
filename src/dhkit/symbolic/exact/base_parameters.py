"""Base parameters: the fewest combinations of inertial parameters that the torques depend on.

1. Moments that are symmetric about a revolute joint's axis, and all second moments of a prismatic joint's link, are
   added to the link before (Gautier & Khalil, 1990, "Direct calculation of minimum set of inertial parameters of serial
   robots"), exactly, with symbols.
2. Parameters that have no effect, or that depend on others, are found as zero or linearly dependent columns of the
   regressor at random lengths and angles, and are grouped exactly.
3. Substitution proves that the grouped equations equal the full ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dhkit.cached_property import cached_property
from dhkit.description import Array, Description, Named, joint_array, takes_robot
from dhkit.display import MOST_ROWS, counted, html_table, repr_line
from dhkit.expressions import Expression
from dhkit.symbolic.exact import composite
from dhkit.symbolic.exact.composite import JointTransform, RigidBody
from dhkit.symbolic.exact.dependencies import MissingReciprocalError, independent
from dhkit.symbolic.exact.exact_arm import ExactArm, ExactRow
from dhkit.symbolic.exact.lagrangian import Lagrangian, Proof, lagrangian
from dhkit.symbolic.exact.regressor import Regressor, regressor as exact_regressor
from dhkit.symbolic.ring import Constant, Element, Elements, Ring, RingError, translated
from dhkit.symbolic.ring.bounds import BOUNDS
from dhkit.symbolic.ring.notation import constants_of, generators_of

_SECOND = {"XX": (0, 0), "XY": (0, 1), "XZ": (0, 2), "YY": (1, 1), "YZ": (1, 2), "ZZ": (2, 2)}
"""Khalil's names of second moments, with their places in the inertia matrix."""
_MOMENT = {"MX": 0, "MY": 1, "MZ": 2}
"""Khalil's names of first moments, with their axes."""
_READABLE = 30
"""Largest number of terms of a definition that a notebook shows; of a longer one it shows the number of terms."""
_LONGEST_DEFINITION = 200
"""Largest number of characters of a definition that a notebook shows."""


class BaseColumn(NamedTuple):
    """What a base parameter is named after."""

    kind: str
    """Khalil's name without its number: ``"XX"``, ``"MX"``, ``"M"``, ``"Ia"`` or ``"Ic"``."""
    joints: tuple[int, ...]
    """The link or the joints that it belongs to, counted from 1."""


@dataclass(frozen=True, eq=False, repr=False)
class BaseParameters:
    """The fewest combinations of inertial parameters that determine an arm's torques.

    Names follow Khalil: inertia ``XX2`` ... ``ZZ2`` about the origin of link 2's joint frame, first moments ``MX2
    MY2 MZ2``, mass ``M2``, rotor inertia at the joint side ``Ia2``, and that of a drive that two joints move together
    ``Ic23``. The joint frame moves with the link and has its z axis along the joint; in the modified convention it is
    the DH frame.

    Attributes
    ----------
    definitions
        The combination that each name stands for, an element of ``full``'s ring.
    lagrangian
        The equations of motion in base parameters.
    full
        The equations of motion in all inertial parameters.

    Examples
    --------
    >>> import numpy as np
    >>> from dhkit import Arm
    >>> arm = Arm.load("planar2r")
    >>> base = arm.base_parameters()
    >>> print(base.definitions["MX1"])
    l1*(m1 + m2) + rx1
    >>> Y = base.regressor([0.3, -0.5], [1.0, 0.2], [0.5, -1.0])
    >>> tau = arm.inverse_dynamics([0.3, -0.5], [1.0, 0.2], [0.5, -1.0])
    >>> bool(np.allclose(Y @ base.values(), tau))
    True
    """

    definitions: Mapping[str, Element]
    lagrangian: Lagrangian
    full: Lagrangian

    @property
    def names(self) -> tuple[str, ...]:
        """The base parameters' names, link by link."""
        return tuple(self.definitions)

    @property
    def columns(self) -> tuple[BaseColumn, ...]:
        """What each base parameter is named after, in the order of ``names``."""
        columns = _columns(self.full.arm)
        return tuple(columns[name] for name in self.names)

    def __len__(self) -> int:
        return len(self.definitions)

    def __repr__(self) -> str:
        return repr_line(
            "BaseParameters", f"{self.full.description.name}, {len(self)}", ", ".join(self.names)
        )

    def _repr_html_(self) -> str:
        rows = []
        for name in self.names[:MOST_ROWS]:
            element = self.definitions[name]
            rows.append(
                (name, str(element) if len(element) <= _READABLE else counted(len(element), "term"))
            )
        caption = f"Base parameters of {self.full.description.name}"
        return html_table(
            ("parameter", "stands for"), rows, caption, count=len(self), longest=_LONGEST_DEFINITION
        )

    def values(self) -> Array:
        """Return the arm's base parameters as numbers.

        Returns
        -------
        Array
            Shape (parameters,), in the order of ``names``, SI: masses in kg, first moments in kg m, second moments in
            kg m^2, rotor inertias in kg m^2 (revolute joint) or kg (prismatic joint).

        Examples
        --------
        >>> from dhkit import Arm
        >>> base = Arm.load("planar2r").base_parameters()
        >>> {name: round(float(value), 4) for name, value in zip(base.names, base.values())}
        {'ZZ1': 0.5417, 'MX1': 1.25, 'MY1': 0.0, 'ZZ2': 0.08, 'MX2': 0.3, 'MY2': 0.0}
        """
        constants = self.lagrangian.constants
        return np.array([constants[name] for name in self.names])

    def regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """Return the matrix Y with tau = Y beta, where beta are base parameters such as :meth:`values`.

        The torques are those of ``inverse_dynamics`` without friction and without a wrench; they include the drives'
        inertia, whose parameters are ``Ia...`` or are grouped with second moments.

        Parameters
        ----------
        q, qd, qdd
            Joint values, rates and accelerations, shape (..., n), rad, m and seconds; batch axes broadcast.

        Returns
        -------
        Array
            Shape (..., n, parameters), columns in the order of ``names``; NaN where a state is not finite.

        Raises
        ------
        ValueError, TypeError
            An argument of another shape, or not numeric.

        Examples
        --------
        >>> from dhkit import Arm
        >>> base = Arm.load("puma560").base_parameters()
        >>> base.regressor([[0.1] * 6, [0.2] * 6], [0.0] * 6, [0.0] * 6).shape
        (2, 6, 40)
        """
        description = self.full.description
        q, qd, qdd = np.broadcast_arrays(
            joint_array(description, q, "q"),
            joint_array(description, qd, "qd"),
            joint_array(description, qdd, "qdd"),
        )
        finite = np.isfinite(q + qd + qdd).all(axis=-1)
        states = (np.where(finite[..., None], x, 0.0) for x in (q, qd, qdd))
        Y = self.lagrangian.evaluate(self._exact_regressor.Y, *states)
        Y[~finite] = np.nan
        return Y

    @cached_property
    def _exact_regressor(self) -> Regressor:
        """The regressor of the equations in base parameters, as elements."""
        return exact_regressor(self.lagrangian)

    def prove(self) -> Proof:
        """Decide whether the equations in base parameters equal the full ones, by substituting the definitions.

        M and g are compared; C consists of derivatives of M.
        """
        short = self.lagrangian
        full = self.full
        definitions = {
            short.arm.ring.place("constant", name): element
            for name, element in self.definitions.items()
        }

        substituted = _substitute(np.column_stack([short.M, short.g]), full.arm.ring, definitions)
        difference = substituted - np.column_stack([full.M, full.g])
        return Proof("M and g in base parameters are those in all parameters", difference)


@takes_robot
@lru_cache(maxsize=32)
def base_parameters(description: Description) -> BaseParameters:
    """Return an arm's base parameters with their definitions, and its equations of motion in them.

    Parameters
    ----------
    description
        The robot, with a body on every link.

    Returns
    -------
    BaseParameters
        Names and definitions, the equations of motion in them, their numbers and their regressor.

    Raises
    ------
    DescriptionError
        A link has no body.
    RingError
        The equations are too long, or a dependency between parameters is not a polynomial.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> base = base_parameters(library_robot("planar2r"))
    >>> base.names
    ('ZZ1', 'MX1', 'MY1', 'ZZ2', 'MX2', 'MY2')
    >>> bool(base.prove())
    True
    """
    # Grouping may divide by a sum of lengths whose reciprocal the ring does not have: derive again in one that has it.
    needed: tuple[Expression, ...] = ()
    for _ in range(description.n):
        full = lagrangian(description, "inertial", needed)
        terms = sum(len(element) for element in full.M.flat)
        if terms > BOUNDS.inertial_terms:
            raise RingError(
                f"{description.name}: M of {terms} terms is too long for base parameters; "
                f"at most {BOUNDS.inertial_terms}"
            )

        definitions = _regroup(full.arm)
        try:
            definitions = independent(_equations(full.arm, definitions), definitions)
        except MissingReciprocalError as missing:
            needed = (*needed, missing.reciprocal)
            continue
        return BaseParameters(Named(definitions), _equations(full.arm, definitions), full)
    raise RingError(f"{description.name}: base parameters were not found")


def _regroup(arm: ExactArm) -> dict[str, Element]:
    """Return the parameters that remain after moving shared moments to the links before, by name."""
    bodies = composite.joint_bodies(arm)
    steps = composite.joint_steps(arm)
    for j in range(arm.n - 1, 0, -1):
        shared, bodies[j] = _split(arm.ring, arm.ring.kinds[j], bodies[j])
        bodies[j - 1] = bodies[j - 1] + shared.moved(_at_zero(arm, j, steps[j]))

    definitions: dict[str, Element] = {}
    couplings: dict[tuple[int, ...], Element] = {
        (i + 1, j + 1): inertia for i, j, inertia in arm.couplings
    }
    for name, (kind, joints) in _columns(arm).items():
        body = bodies[joints[0] - 1]
        if kind == "Ic":
            definitions[name] = couplings[joints]
        elif kind == "Ia":
            definitions[name] = arm.armature[joints[0] - 1]
        elif kind == "M":
            definitions[name] = body.mass
        elif kind in _MOMENT:
            definitions[name] = body.moment[_MOMENT[kind]]
        else:
            definitions[name] = body.second[_SECOND[kind]]
    return {name: element for name, element in definitions.items() if element}


def _columns(arm: ExactArm) -> dict[str, BaseColumn]:
    """Return all parameters by name, link by link, of which some are base parameters."""
    end = _ending(arm)
    kinds = (*_SECOND, *_MOMENT, "M", "Ia")
    columns = {
        f"{kind}{j}{end}": BaseColumn(kind, (j,)) for j in range(1, arm.n + 1) for kind in kinds
    }
    for i, j, _ in arm.couplings:
        columns[f"Ic{i + 1}{j + 1}{end}"] = BaseColumn("Ic", (i + 1, j + 1))
    return columns


def _ending(arm: ExactArm) -> str:
    """Return the ending of base parameters' names: an underscore where a parameter of the file has such a name."""
    names = {f"Ic{i + 1}{j + 1}" for i, j, _ in arm.couplings}
    for j in range(1, arm.n + 1):
        names |= {f"{key}{j}" for key in (*_SECOND, *_MOMENT, "M", "Ia")}
    return "" if names.isdisjoint(arm.ring.constants) else "_"


def _split(ring: Ring, kind: str, body: RigidBody) -> tuple[RigidBody, RigidBody]:
    """Return the part of a link that moves the link before in the same way, for every joint value, and the rest."""
    zero = ring.zero
    moment = np.array([zero] * 3, dtype=object)
    second = np.full((3, 3), zero, dtype=object)

    # Prismatic: the link does not turn in the link before, so that its inertia may be that link's.
    if kind != "R":
        return RigidBody(zero, moment, body.second), RigidBody(body.mass, body.moment, second)

    # Revolute: a body that is symmetric about z looks the same for every angle: M, MZ, and YY in both XX and YY.
    # Left are XX - YY, XY, XZ, YZ, ZZ, MX and MY.
    moment[2] = body.moment[2]
    second[0, 0] = second[1, 1] = body.second[1, 1]
    symmetric = RigidBody(body.mass, moment, second)
    return symmetric, RigidBody(zero, body.moment - moment, body.second - second)


def _at_zero(arm: ExactArm, j: int, step: JointTransform) -> JointTransform:
    """Return a joint's step with its variable at zero, on which shared moments do not depend."""
    ring = arm.ring
    if ring.kinds[j] == "R":
        zero_position = {ring.place("sine", j): ring.zero, ring.place("cosine", j): ring.one}
    else:
        zero_position = {ring.place("position", j): ring.zero}
    R = _substitute(step.R, ring, zero_position)
    p = _substitute(step.p, ring, zero_position)
    return JointTransform(R, p)


def _substitute(elements: Elements, ring: Ring, replacements: Mapping[int, Element]) -> Elements:
    """Return an array of elements in another ring; see :func:`dhkit.symbolic.ring.translated`."""
    array = np.empty(elements.shape, dtype=object)
    for place, element in np.ndenumerate(elements):
        array[place] = translated(element, ring, replacements)
    return array


def _equations(arm: ExactArm, definitions: Mapping[str, Element]) -> Lagrangian:
    """Return the equations of motion with a symbol for each definition."""
    ring = Ring(arm.ring.kinds, [*_kept(arm), *(Constant(name) for name in definitions)])
    end = _ending(arm)

    def parameter(name: str) -> Element:
        """Return a base parameter; 0 for one that has no effect or was grouped with others."""
        return ring.constant(f"{name}{end}") if f"{name}{end}" in definitions else ring.zero

    # Values of the base parameters: their definitions, which do not depend on the state.
    generator_values = arm.ring.values(arm.values, np.zeros(arm.n))
    base_values = {
        name: float(element.value(generator_values)) for name, element in definitions.items()
    }
    kept_values = {text: arm.values[text] for text in ring.constants if text in arm.values}

    short = replace(
        arm,
        ring=ring,
        rows=tuple(_row(row, ring) for row in arm.rows),
        bodies=(),
        gear=(ring.one,) * arm.n,
        rotor=tuple(parameter(f"Ia{j}") for j in range(1, arm.n + 1)),
        couplings=tuple((i, j, parameter(f"Ic{i + 1}{j + 1}")) for i, j, _ in arm.couplings),
        gravity=_substitute(arm.gravity, ring, {}),
        origin=_substitute(arm.origin, ring, {}),
        tool=_substitute(arm.tool, ring, {}),
        parameters=arm.parameters | base_values,
        values=kept_values | base_values,
        inertial=tuple(definitions),
    )

    bodies = []
    for j in range(1, arm.n + 1):
        mass = parameter(f"M{j}")
        moment = np.array([parameter(f"{key}{j}") for key in _MOMENT], dtype=object)
        second = np.empty((3, 3), dtype=object)
        for key, (row, column) in _SECOND.items():
            second[row, column] = second[column, row] = parameter(f"{key}{j}")
        bodies.append(RigidBody(mass, moment, second))

    M = composite.mass_matrix(short, bodies)
    V = composite.potential_energy(short, bodies)
    return Lagrangian(short, M, V, Named(definitions))


def _row(row: ExactRow, ring: Ring) -> ExactRow:
    """Return a row of the table in another ring."""
    a, d, ca, sa, c, s = (translated(x, ring, {}) for x in (row.a, row.d, *row.alpha, *row.theta))
    return ExactRow(a, d, (ca, sa), (c, s))


def _kept(arm: ExactArm) -> list[Constant]:
    """Return the constants that do not depend on an inertial parameter: those of table, placement and gravity."""
    geometry = [*arm.gravity, *arm.origin, *arm.tool]
    for row in arm.rows:
        geometry += [row.a, row.d, *row.alpha, *row.theta]
    inertial = [*arm.gear, *arm.rotor, *(inertia for *_, inertia in arm.couplings)]
    for body in chain.from_iterable(arm.bodies):
        inertial += [body.mass, *body.moment, *body.second.flat]

    dropped = _constants(inertial) - _constants(geometry)
    return [c for c in arm.ring.given if dropped.isdisjoint({c.text, *c.symbols})]


def _constants(elements: Sequence[Element]) -> set[str]:
    """Return the texts of the constants that occur in elements."""
    return {generator.text for generator in constants_of(generators_of(elements))}
