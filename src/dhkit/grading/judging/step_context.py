"""Arm, poses and worked solution, which the judges of a step's equations and of its solutions share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from dhkit.description import Array, Description
from dhkit.errors import DescriptionError
from dhkit.expressions.syntax import Name, Number, Tree
from dhkit.expressions.trees import names_of
from dhkit.grading.grade_report import Verdict, Witness
from dhkit.grading.judging.inverse_edits import Lengths
from dhkit.grading.judging.inverse_mistakes import lengths_of
from dhkit.grading.judging.inverse_poses import Mask, Poses
from dhkit.symbolic import InverseDerivation, inverse_derivation, table_lengths
from dhkit.symbolic.inverse.chain import ExactChain
from dhkit.symbolic.inverse.steps import DerivationStep as DerivedStep

_SAME_LENGTH = 1e-9
"""Largest difference of two equal lengths from rounding, relative to the length."""
_IDENTITY = 1e-12
"""Largest entry, m or without unit, by which a transform that does nothing differs from the identity."""


@dataclass
class Part:
    """The verdict on a part of a step: its equations, or its solutions."""

    verdict: Verdict
    statement: str
    mistakes: list[tuple[str, str]] = field(default_factory=list)
    """Identifiers of mistakes in the catalogue, each with a detail for its sentence; the detail may be empty."""
    difference: str | None = None
    """Difference of the sides of a wrong equation, as text."""
    witness: Witness | None = None
    remark: str = ""
    """Reservation about a part that passes, such as a condition on the lengths; empty without one."""


class StepContext:
    """An arm and the poses at which steps are tried.

    Parameters
    ----------
    description
        The robot.
    poses
        Random poses with their solutions.
    seed
        Seed of further poses.
    explain
        Whether to look for mistakes.
    """

    def __init__(self, description: Description, poses: Poses, seed: int, explain: bool) -> None:
        self.description = description
        self.poses = poses
        self.seed = seed
        self.explain = explain

    @cached_property
    def derivation(self) -> InverseDerivation | None:
        """The worked solution; None without a closed form."""
        try:
            return inverse_derivation(self.description)
        except DescriptionError:
            return None

    def derived(self, joint: int) -> DerivedStep | None:
        """Return the derivation's step for a joint, from 0; None without a derivation."""
        steps = self.derivation.steps if self.derivation is not None else ()
        return next(
            (step for step in steps if step.unknown is not None and step.unknown.joint == joint),
            None,
        )

    @cached_property
    def roots(self) -> Array:
        """Joint values by the worked solution at :attr:`solved_poses`, shape (S, C, n), rad and m; C = 0 without one.

        Later joints may have no solution after a root: their values are NaN.
        """
        poses = self.solved_poses
        if self.derivation is None:
            return np.empty((len(poses.q), 0, self.description.n))
        return self.derivation.roots(poses.T)

    def lengths(self, trees: Sequence[Tree]) -> Lengths:
        """Return the lengths that formulas may contain, with the names d1, a1 ... if the formulas use such names.

        Lengths of base and tool have no names.
        """
        names = set().union(*map(names_of, trees))
        table = table_lengths(self.description)
        every = lengths_of(self.description)
        if not names & {*table}:
            return every

        # First the lengths with a name: parameters, and entries of the table.
        numbers = self.description.numbers.values
        named = {name: float(numbers[name]) for name in self.description.parameters}
        named |= {name: float(value) for name, value in table.items()}
        sizes = [abs(value) for value in named.values()]
        formulas: list[Name | Number] = [Name(name, 0) for name in named]

        # Then those of base and tool that equal none of them.
        others = [not np.any(np.isclose(value, sizes, rtol=_SAME_LENGTH)) for value in every.values]
        formulas += [tree for tree, is_other in zip(every.trees, others, strict=True) if is_other]
        other_sizes = [
            value for value, is_other in zip(every.values, others, strict=True) if is_other
        ]
        return Lengths(tuple(named), tuple(formulas), (*sizes, *other_sizes), every.of_tool)

    @cached_property
    def solved_poses(self) -> Poses:
        """The poses at which solutions are tried: those of joint values within the limits, then those of any angles.

        Only poses at which the arm has the largest number of solutions are kept: at others a root may be right though
        later joints cannot reach the pose. Without a closed form they are :attr:`poses` themselves.
        """
        return self._solved[0]

    @property
    def within_limits(self) -> Mask:
        """Mask (S,) of those among :attr:`solved_poses` that joint values within the limits give."""
        return self._solved[1]

    @cached_property
    def _solved(self) -> tuple[Poses, Mask]:
        """Both of :attr:`solved_poses` and :attr:`within_limits`."""
        inside = self.poses
        count = len(inside.q)
        if not inside.has_closed_form:
            return inside, np.ones(count, dtype=bool)
        every = inside.followed_by(
            Poses.random(self.description, count, self.seed, whole_turns=True)
        )
        found = np.sum(np.all(np.isfinite(every.solutions), axis=-1), axis=1)
        rows = np.flatnonzero(found == found.max())
        return every.at(rows), rows < count

    def misread(self, poses: Poses) -> Iterator[tuple[str, dict[str, Array | float]]]:
        """Yield mistakes in which the pose is another frame's, each with the values that formulas then mean.

        T_base_last = T_world_base^-1 T_world_tool T_last_tool^-1; one of the outer factors, or both, are put in.
        """
        numbers = self.description.numbers
        T_base_world = np.linalg.inv(numbers.T_world_base)
        T_tool_last = np.linalg.inv(numbers.T_last_tool)
        has_base = not np.allclose(T_base_world, np.eye(4), atol=_IDENTITY)
        has_tool = not np.allclose(T_tool_last, np.eye(4), atol=_IDENTITY)
        if has_tool:
            yield "tool_not_taken_off", replace(poses, T=poses.T @ T_tool_last).values
        if has_base:
            yield "base_not_taken_off", replace(poses, T=T_base_world @ poses.T).values
        if has_base and has_tool:
            yield (
                "base_and_tool_not_taken_off",
                replace(poses, T=T_base_world @ poses.T @ T_tool_last).values,
            )

    @cached_property
    def chains(self) -> tuple[ExactChain, ExactChain]:
        """The arm with named lengths, and with numbers."""
        with_names = ExactChain.of(self.description, named=True, in_joint_values=True)
        with_numbers = ExactChain.of(self.description, named=False, in_joint_values=True)
        return with_names, with_numbers
