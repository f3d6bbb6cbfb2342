"""The numbers that an arm's dynamics depend on: of one arm, or as symbols for all arms of a pattern."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, combinations
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
    """Joints i < j, from 0, and the drives' inertia that both turn, kg m^2, kg m or kg, where it is not 0."""
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
        return cls._filled(description, (_numbers(description) + 0.0).tolist())

    @classmethod
    def parametric(cls, *descriptions: Description) -> tuple[InertialTable, casadi.SX]:
        """Return a table of symbols, and the symbols; their values are those of :func:`inertial_pattern`."""
        entries, symbols = _pattern(descriptions).entries()
        return cls._filled(descriptions[0], entries), symbols

    def __repr__(self) -> str:
        return repr_line("InertialTable", counted(self.n, "joint"))

    @classmethod
    def _filled(cls, description: Description, entries: Sequence[Scalar]) -> InertialTable:
        n = description.n
        prismatic = description.numbers.prismatic.tolist()
        x, y, z, potential, *coupling = entries[17 * n :]
        pairs = zip(combinations(range(n), 2), coupling, strict=True)
        return cls(
            tuple(JointRow(prismatic[i], *entries[6 * i : 6 * i + 6]) for i in range(n)),
            tuple(Moments.of_entries(entries[6 * n + 10 * i : 6 * n + 10 * i + 10]) for i in range(n)),
            tuple(entries[16 * n : 17 * n]),
            tuple((i, j, entry) for (i, j), entry in pairs if not is_zero(entry)),
            (x, y, z),
            potential,
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
    """
    pattern = _pattern(descriptions)
    values = pattern.parameters
    return f"{descriptions[0].kinds} {pattern.code}", values[0] if len(descriptions) == 1 else values


def _pattern(descriptions: Sequence[Description]) -> NumberPattern:
    # A batch repeats few arms: each is worked out once.
    rows = {id(description): _numbers(description) for description in {id(x): x for x in descriptions}.values()}
    return NumberPattern.of(np.stack([rows[id(description)] for description in descriptions]))


def _numbers(description: Description) -> Array:
    """Return an arm's numbers, shape (17 n + 4 + n (n - 1) / 2,).

    Six a joint, ten a link, armatures, gravity, the base's energy, and the couplings, row by row.
    """
    require_bodies(description)
    numbers = description.numbers
    rows = joint_rows(description)
    # Regrouped in exact arithmetic: moments that cancel become 0, and the result is rounded once.
    base, links = regroup(exact_moments(description), rows)
    gravity = numbers.T_world_base[:3, :3].T @ numbers.gravity
    mass = base.mass + sum(link.mass for link in links)
    energy = -(gravity @ np.array(base.first, dtype=float)) - float(mass) * (
        numbers.gravity @ numbers.T_world_base[:3, 3]
    )
    joints = list(chain.from_iterable(row.entries for row in rows))
    coupling = numbers.coupling[np.triu_indices(description.n, 1)]
    moments = [float(entry) for link in links for entry in link.entries]
    return np.array([*joints, *moments, *numbers.armature, *gravity, energy, *coupling], dtype=float)


def exact_moments(description: Description) -> list[Moments]:
    """Return the links' moments in their joint frames, as exact fractions."""
    numbers = description.numbers
    standard = description.convention is Convention.STANDARD
    moments = []
    for i in range(description.n):
        inertia = [[Fraction(x) for x in row] for row in numbers.inertia[i].tolist()]
        x, y, z = (Fraction(x) for x in numbers.com[i].tolist())
        com: Vector3 = (x, y, z)
        if standard:
            # The transform from the joint frame to DH frame i is Tx(a) Rx(alpha).
            c = Fraction(float(numbers.cos_alpha[i]))
            s = Fraction(float(numbers.sin_alpha[i]))
            com = plus((Fraction(float(numbers.a[i])), 0, 0), about_x(c, s, com))
            half = [about_x(c, s, (row[0], row[1], row[2])) for row in inertia]
            inertia = [list(about_x(c, s, (col[0], col[1], col[2]))) for col in zip(*half, strict=True)]
        moments.append(Moments.of_body(Fraction(float(numbers.mass[i])), com, inertia))
    return moments
