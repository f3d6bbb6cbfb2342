"""The numbers that an arm's dynamics depend on: of one arm, or as symbols for all arms of a pattern."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from dhkit.description import Array, Convention, Description, Robot, description_of, require_bodies
from dhkit.display import counted, repr_line
from dhkit.symbolic.differentiable.joint_frames import JointRow, joint_rows
from dhkit.symbolic.differentiable.moments import Moments, regroup
from dhkit.symbolic.differentiable.number_patterns import NumberPattern
from dhkit.symbolic.differentiable.vectors import Scalar, Vector3, about_x, is_zero, plus

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True)
class InertialTable:
    """Joint frames, moments of links, drives and gravity, each number a float or a symbol.

    ``InertialTable.of`` holds an arm's own numbers. ``InertialTable.parametric`` keeps numbers that are 0, 1 or -1 and
    has symbols for the others, so that one derivation and one compiled kernel serve every arm of the same pattern.
    Links hold their base parameters (:func:`dhkit.symbolic.differentiable.moments.regroup`).
    """

    rows: tuple[JointRow, ...]
    links: tuple[Moments, ...]
    armature: tuple[Scalar, ...]
    """Rotor inertias at the joint side, gear^2 times rotor inertia, kg m^2 or kg."""
    couplings: tuple[tuple[int, int, Scalar], ...]
    """Joints i < j, from 0, and the nonzero inertia of drives that move both together, kg m^2, kg m or kg."""
    gravity: Vector3
    """Free-fall acceleration in frame 0, m/s^2."""
    potential: Scalar
    """Potential energy of the mass regrouped to the base, J; zero at the world's origin."""

    @classmethod
    def of(cls, description: Robot) -> InertialTable:
        """Return the table of an arm.

        Raises
        ------
        DescriptionError
            A link without a body.
        """
        description = description_of(description)
        numbers = _numbers(description) + 0.0  # -0.0 + 0.0 is 0.0
        return cls._filled(description, numbers.tolist())

    @classmethod
    def parametric(cls, *descriptions: Description) -> tuple[InertialTable, casadi.SX]:
        """Return a table of symbols, and the symbols; their values are those of :func:`inertial_pattern`."""
        entries, symbols = _pattern(descriptions).entries()
        return cls._filled(descriptions[0], entries), symbols

    def __repr__(self) -> str:
        return repr_line("InertialTable", counted(self.n, "joint"))

    @classmethod
    def _filled(cls, description: Description, entries: Sequence[Scalar]) -> InertialTable:
        """Return the table of entries in the order of :func:`_numbers`."""
        n = description.n
        prismatic = description.numbers.prismatic.tolist()
        joints = entries[: 6 * n]
        moments = entries[6 * n : 16 * n]
        armature = entries[16 * n : 17 * n]
        x, y, z, potential, *coupling = entries[17 * n :]

        pairs = zip(combinations(range(n), 2), coupling, strict=True)
        return cls(
            rows=tuple(JointRow(prismatic[i], *joints[6 * i : 6 * i + 6]) for i in range(n)),
            links=tuple(Moments.of_entries(moments[10 * i : 10 * i + 10]) for i in range(n)),
            armature=tuple(armature),
            couplings=tuple((i, j, inertia) for (i, j), inertia in pairs if not is_zero(inertia)),
            gravity=(x, y, z),
            potential=potential,
        )

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.rows)

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Whether each joint is prismatic."""
        return tuple(row.prismatic for row in self.rows)

    def with_load(self, load: Moments, potential: Scalar) -> InertialTable:
        """Return the table with a load added to the last link.

        Parameters
        ----------
        load
            The load's moments in the last joint frame.
        potential
            The load's potential energy if it were at the origin of frame 0, J.
        """
        links = (*self.links[:-1], self.links[-1].joined(load))
        return replace(self, links=links, potential=self.potential + potential)


def inertial_pattern(*descriptions: Description) -> tuple[str, Array]:
    """Return the pattern of an arm's dynamics as text, and the values of its parametric table's symbols.

    Parameters
    ----------
    descriptions
        One arm, or several arms of the same kinds of joints that share a table.

    Returns
    -------
    tuple[str, Array]
        The pattern, and the values: shape (symbols,) of one arm, (B, symbols) of several.

    Raises
    ------
    DescriptionError
        A link without a body.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> pattern, values = inertial_pattern(library_robot("planar2r"))
    >>> values.shape
    (6,)
    """
    pattern = _pattern(descriptions)
    values = pattern.parameters
    return f"{descriptions[0].kinds} {pattern.code}", values[0] if len(
        descriptions
    ) == 1 else values


def _pattern(descriptions: Sequence[Description]) -> NumberPattern:
    # A batch repeats few arms: each is worked out once.
    numbers: dict[int, Array] = {}
    for description in descriptions:
        if id(description) not in numbers:
            numbers[id(description)] = _numbers(description)
    return NumberPattern.of(np.stack([numbers[id(description)] for description in descriptions]))


def _numbers(description: Description) -> Array:
    """Return an arm's numbers, shape (17 n + 4 + n (n - 1) / 2,).

    Six numbers a joint, ten a link, armatures, gravity, the base's energy, and the couplings, row by row.
    """
    require_bodies(description)
    numbers = description.numbers
    rows = joint_rows(description)
    # Regrouped in exact arithmetic: moments that cancel become 0, and the result is rounded once.
    base, links = regroup(exact_moments(description), rows)

    # In the axes of frame 0: g_0 = R^T g. The mass at frame 0's origin p, and the base's first moments h there, have
    #   V = -m g . p - g_0 . h
    gravity = numbers.T_world_base[:3, :3].T @ numbers.gravity
    mass = base.mass + sum(link.mass for link in links)
    first = np.array(base.first, dtype=float)
    energy = -(gravity @ first) - float(mass) * (numbers.gravity @ numbers.T_world_base[:3, 3])

    joints: list[float] = []
    for row in rows:
        joints += row.entries
    moments: list[float] = []
    for link in links:
        moments += [float(entry) for entry in link.entries]
    coupling = numbers.coupling[np.triu_indices(description.n, 1)]
    return np.array(
        [*joints, *moments, *numbers.armature, *gravity, energy, *coupling], dtype=float
    )


def exact_moments(description: Description) -> list[Moments]:
    """Return the links' moments in their joint frames, as exact fractions."""
    numbers = description.numbers
    is_standard = description.convention is Convention.STANDARD
    moments = []
    for i in range(description.n):
        mass = Fraction(float(numbers.mass[i]))
        com = _exact_vector(numbers.com[i])
        inertia = [_exact_vector(row) for row in numbers.inertia[i]]
        if is_standard:
            # DH frame i in the joint frame is Tx(a) Rx(alpha): c' = a x + Rx c, I' = Rx I Rx^T.
            a = Fraction(float(numbers.a[i]))
            c = Fraction(float(numbers.cos_alpha[i]))
            s = Fraction(float(numbers.sin_alpha[i]))
            com = plus((a, 0, 0), about_x(c, s, com))
            rows = [about_x(c, s, row) for row in inertia]
            inertia = [
                about_x(c, s, (column[0], column[1], column[2]))
                for column in zip(*rows, strict=True)
            ]
        moments.append(Moments.of_body(mass, com, inertia))
    return moments


def _exact_vector(vector: Array) -> Vector3:
    """Return three doubles, shape (3,), as exact fractions."""
    x, y, z = (Fraction(x) for x in vector.tolist())
    return (x, y, z)
