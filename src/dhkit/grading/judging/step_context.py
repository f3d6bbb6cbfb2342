"""What the judges of equations and of solutions of a step share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from dhkit.description import Array, Description
from dhkit.errors import DescriptionError
from dhkit.expressions.syntax import Name, Tree
from dhkit.expressions.trees import names_of
from dhkit.grading.judging.inverse_edits import Lengths
from dhkit.grading.judging.inverse_mistakes import lengths_of
from dhkit.grading.judging.inverse_poses import Mask, Poses
from dhkit.grading.report import Verdict, Witness
from dhkit.symbolic import InverseDerivation, inverse_derivation, table_lengths
from dhkit.symbolic.inverse.chain import ExactChain
from dhkit.symbolic.inverse.steps import DerivationStep as DerivedStep


@dataclass
class Part:
    """The verdict on a part of a step: its equations, or its solutions."""

    verdict: Verdict
    statement: str
    mistakes: list[tuple[str, str]] = field(default_factory=list)
    """Mistakes with details."""
    difference: str | None = None
    witness: Witness | None = None
    remark: str = ""
    """What a reader should know of a part that passes."""


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
        return next((step for step in steps if step.unknown is not None and step.unknown.joint == joint), None)

    def lengths(self, trees: Sequence[Tree]) -> Lengths:
        """Return the lengths that formulas may contain: by name where formulas use the names of the table's.

        Lengths of base and tool have no names.
        """
        names = set().union(*map(names_of, trees))
        table = table_lengths(self.description)
        every = lengths_of(self.description)
        if not names & {*table}:
            return every
        numbers = self.description.numbers.values
        values = {name: float(numbers[name]) for name in self.description.parameters}
        values |= {name: float(value) for name, value in table.items()}
        named = [abs(value) for value in values.values()]
        others = [
            (tree, value)
            for tree, value in zip(every.trees, every.values, strict=True)
            if not np.any(np.isclose(value, named, rtol=1e-9))
        ]
        trees_of_all = (*(Name(name, 0) for name in values), *(tree for tree, _ in others))
        return Lengths(tuple(values), trees_of_all, (*named, *(value for _, value in others)), every.of_tool)

    @cached_property
    def solved_poses(self) -> Poses:
        """The poses at which solutions are tried: those of joint values within the limits, then those of any angles.

        Of these the poses at which the arm has most solutions: elsewhere a root may be right, and later joints out of
        reach. Without a closed form the poses alone.
        """
        return self._solved[0]

    @property
    def within_limits(self) -> Mask:
        """Which of :attr:`solved_poses` are those of joint values within the limits, shape (S,)."""
        return self._solved[1]

    @cached_property
    def _solved(self) -> tuple[Poses, Mask]:
        inside = self.poses
        count = len(inside.q)
        if not inside.has_closed_form:
            return inside, np.ones(count, dtype=bool)
        every = inside.followed_by(Poses.random(self.description, count, self.seed, whole_turns=True))
        found = np.sum(np.all(np.isfinite(every.solutions), axis=-1), axis=1)
        rows = np.flatnonzero(found == found.max())
        return every.at(rows), rows < count

    def misread(self, poses: Poses) -> Iterator[tuple[str, dict[str, Array | float]]]:
        """Yield mistakes in which the pose is another frame's, each with the values that formulas then mean."""
        numbers = self.description.numbers
        outside = np.linalg.inv(numbers.T_world_base)
        inside = np.linalg.inv(numbers.T_last_tool)
        for mistake, before, behind in (
            ("tool_not_taken_off", None, inside),
            ("base_not_taken_off", outside, None),
            ("base_and_tool_not_taken_off", outside, inside),
        ):
            if all(T is None or not np.allclose(T, np.eye(4), atol=1e-12) for T in (before, behind)):
                T = poses.T if before is None else before @ poses.T
                yield mistake, replace(poses, T=T if behind is None else T @ behind).values

    @cached_property
    def chains(self) -> tuple[ExactChain, ExactChain]:
        """The arm with named lengths, and with numbers."""
        named, numbers = (ExactChain.of(self.description, named=named, in_joint_values=True) for named in (True, False))
        return named, numbers
