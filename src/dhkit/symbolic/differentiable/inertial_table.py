"""The numbers that an arm's dynamics depend on: of one arm, or symbols for all arms of a pattern."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Convention, Description, Robot, description_of, require_bodies
from dhkit.display import counted, repr_line
from dhkit.symbolic.differentiable.bodies import Moments, regrouped
from dhkit.symbolic.differentiable.frames import FOLDED
from dhkit.symbolic.differentiable.joint_frames import JointRow, joint_rows
from dhkit.symbolic.differentiable.vectors import Scalar, Vector3, about_x, plus

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True)
class InertialTable:
    """Joint frames, moments of links, drives and gravity, each number a float or a symbol.

    ``InertialTable.of`` takes an arm's own numbers. ``InertialTable.parametric`` keeps those that are 0, 1 or -1 and
    puts symbols for the rest: one derivation, and one compiled kernel, serve every arm of the same pattern.
    Links hold their base parameters (:func:`dhkit.symbolic.differentiable.bodies.regrouped`).
    """

    rows: tuple[JointRow, ...]
    links: tuple[Moments, ...]
    armature: tuple[Scalar, ...]
    """gear^2 rotor inertia, kg m^2 or kg."""
    gravity: Vector3
    """Free-fall acceleration in frame 0, m/s^2."""
    potential: Scalar
    """J: the potential energy of what has been regrouped to the base, zero at the world's origin."""

    @classmethod
    def of(cls, description: Robot) -> InertialTable:
        """Return the table of an arm.

        Raises
        ------
        DescriptionError
            A link without a body.
        """
        description = description_of(description)
        return cls._filled(description, _numbers(description).tolist())

    @classmethod
    def parametric(cls, *descriptions: Description) -> tuple[InertialTable, casadi.SX]:
        """Return a table of symbols, and the symbols; their values are those of :func:`inertial_pattern`."""
        import casadi

        numbers, folded = _folded(descriptions)
        symbols = casadi.SX.sym("parameter", int(np.sum(~folded)))
        waiting = iter(casadi.vertsplit(symbols) if symbols.numel() else ())
        entries = [x if fold else next(waiting) for x, fold in zip(numbers[0].tolist(), folded, strict=True)]
        return cls._filled(descriptions[0], entries), symbols

    def __repr__(self) -> str:
        return repr_line("InertialTable", counted(self.n, "joint"))

    @classmethod
    def _filled(cls, description: Description, entries: Sequence[Scalar]) -> InertialTable:
        n = description.n
        prismatic = description.numbers.prismatic.tolist()
        x, y, z, potential = entries[17 * n :]
        return cls(
            tuple(JointRow(prismatic[i], *entries[6 * i : 6 * i + 6]) for i in range(n)),
            tuple(Moments.of_entries(entries[6 * n + 10 * i : 6 * n + 10 * i + 10]) for i in range(n)),
            tuple(entries[16 * n : 17 * n]),
            (x, y, z),
            potential,
        )

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.rows)

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Which joints slide."""
        return tuple(row.prismatic for row in self.rows)

    def with_load(self, load: Moments, potential: Scalar) -> InertialTable:
        """Return the table with mass joined to the last link.

        Parameters
        ----------
        load
            Its moments in the last joint frame.
        potential
            Its potential energy if it were in the origin of frame 0, J.
        """
        links = (*self.links[:-1], self.links[-1].joined(load))
        return replace(self, links=links, potential=self.potential + potential)


def inertial_pattern(*descriptions: Description) -> tuple[str, Array]:
    """Return what a parametric table's expressions depend on, as text, and the values of its symbols.

    Parameters
    ----------
    descriptions
        An arm, or several of the same kinds of joints that are to share a table.

    Returns
    -------
    tuple[str, Array]
        The pattern, and the values: shape (symbols,) of one arm, (B, symbols) of several.

    Raises
    ------
    DescriptionError
        A link without a body.
    """
    numbers, folded = _folded(descriptions)
    codes = np.where(folded, np.select([numbers[0] == x for x in FOLDED], list("0+-"), "p"), "p")
    values: Array = numbers[:, ~folded]
    return f"{descriptions[0].kinds} {''.join(codes)}", values[0] if len(descriptions) == 1 else values


def _folded(descriptions: Sequence[Description]) -> tuple[Array, NDArray[np.bool_]]:
    """Return all numbers, a row for each arm, and which of them are 0, 1 or -1 in all arms alike."""
    rows = {id(description): _numbers(description) for description in {id(x): x for x in descriptions}.values()}
    numbers = np.stack([rows[id(description)] for description in descriptions])
    folded: NDArray[np.bool_] = np.isin(numbers[0], FOLDED) & (numbers == numbers[0]).all(axis=0)
    return numbers, folded


def _numbers(description: Description) -> Array:
    """Return all numbers in one row: six of each joint, ten of each link, drives, gravity and the base's energy."""
    require_bodies(description)
    numbers = description.numbers
    rows = joint_rows(description)
    # Exact arithmetic of the rounded numbers: what cancels leaves 0, and the equations change by one rounding at most.
    base, links = regrouped(exact_moments(description), rows)
    gravity = numbers.T_world_base[:3, :3].T @ numbers.gravity
    mass = base.mass + sum(link.mass for link in links)
    energy = -(gravity @ _floats(base.first)) - float(mass) * (numbers.gravity @ numbers.T_world_base[:3, 3])
    joints = [entry for row in rows for entry in row.entries]
    moments = [float(entry) for link in links for entry in link.entries]
    # Adding 0.0 turns -0.0, which a pattern would call 0 as well, into 0.0.
    return np.array([*joints, *moments, *numbers.armature, *gravity, energy], dtype=float) + 0.0


def exact_moments(description: Description) -> list[Moments]:
    """Return the links' moments in their joint frames, exact."""
    numbers = description.numbers
    standard = description.convention is Convention.STANDARD
    made = []
    for i in range(description.n):
        inertia = [[Fraction(x) for x in row] for row in numbers.inertia[i].tolist()]
        x, y, z = (Fraction(x) for x in numbers.com[i].tolist())
        com: Vector3 = (x, y, z)
        if standard:
            # DH frame i lies behind the joint: Tx(a) Rx(alpha) from the joint frame.
            c, s = Fraction(float(numbers.cos_alpha[i])), Fraction(float(numbers.sin_alpha[i]))
            com = plus((Fraction(float(numbers.a[i])), 0, 0), about_x(c, s, com))
            half = [about_x(c, s, (row[0], row[1], row[2])) for row in inertia]
            inertia = [list(about_x(c, s, (col[0], col[1], col[2]))) for col in zip(*half, strict=True)]
        made.append(Moments.of_body(Fraction(float(numbers.mass[i])), com, inertia))
    return made


def _floats(a: Vector3) -> Array:
    return np.array([float(x) for x in a])
