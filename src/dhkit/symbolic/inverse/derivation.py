"""The derivation of an arm's inverse kinematics, with its proof."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, takes_robot, world_to_tool, write_atomically
from dhkit.display import repr_line
from dhkit.errors import DescriptionError
from dhkit.formats import format_function
from dhkit.symbolic.exact.lagrangian import Proof
from dhkit.symbolic.inverse.chain import POSE, ExactChain, without_rounding
from dhkit.symbolic.inverse.families import Derivable, family_of
from dhkit.symbolic.inverse.forms import ZERO_RADICAND, Unknown, lemmas
from dhkit.symbolic.inverse.missing import why_not
from dhkit.symbolic.inverse.steps import (
    Choice,
    Condition,
    DerivationStep,
    Workbench,
    names_in,
    without_unused,
)
from dhkit.symbolic.inverse.wrists import FLIPS
from dhkit.symbolic.ring import Element
from dhkit.symbolic.ring.elements import element_array

_LANGUAGES = ("c", "python", "matlab")
_POSE_TOLERANCE = 1e-9
"""Largest error of a branch's pose: of entries of the rotation, and of the position as a share of the reach."""
_JOINT_TOLERANCE = 1e-6
"""Largest difference, rad or share of the reach, of joint values that count as equal. It is larger than that of poses:
near singular poses joint values are less certain."""
IN_PLANE = 1e-9
"""Largest distance of a pose from the plane of a planar arm, as a share of the reach."""
_SAMPLES = 200
"""Number of random poses at which a proof tests whether branches close and none is missing."""


@dataclass(frozen=True, eq=False)
class InverseProof:
    """The proofs of a derivation, and the results of sampling.

    Attributes
    ----------
    identities
        A proof for each step: its equations hold for the pose of the arm itself.
    lemmas
        A proof for each form of equation: its solution is right and complete.
    samples
        Number of random poses at which the branches were tried.
    closed
        Whether all branches closed forward kinematics there.
    complete
        Whether the joint values that each pose was computed from were among the branches.
    """

    identities: tuple[Proof, ...]
    lemmas: tuple[Proof, ...]
    samples: int
    closed: bool
    complete: bool

    def __bool__(self) -> bool:
        return all(self.identities) and all(self.lemmas) and self.closed and self.complete

    @property
    def statement(self) -> str:
        """The result in words: proved, and sampled."""
        proved = f"{len(self.identities)} identities and {len(self.lemmas)} lemmas"
        failed = [proof.statement for proof in (*self.identities, *self.lemmas) if not proof]
        sampled = (
            f"sampled: at {self.samples} random poses every branch closes forward kinematics: "
            f"{'yes' if self.closed else 'NO'}; none is missing: {'yes' if self.complete else 'NO'}"
        )
        if failed:
            return f"NOT TRUE: {'; '.join(failed)}. {sampled}"
        return (
            f"proved: {proved} (the equations hold for T = base A_1 ... A_n tool; "
            f"their solutions are all). {sampled}"
        )

    def __str__(self) -> str:
        return self.statement

    def __repr__(self) -> str:
        return repr_line("InverseProof", summary="proved" if self else "NOT TRUE")


@dataclass(frozen=True, eq=False, repr=False)
class InverseDerivation:
    """Inverse kinematics derived step by step, as a textbook does.

    Attributes
    ----------
    chain
        The arm in exact numbers.
    family
        The family of arms that share the derivation.
    steps
        The steps, each in quantities of those before it.
    conditions
        Equations that a pose has to satisfy besides: an arm in a plane.
    notes
        Differences from the robot file: names of lengths, numbers instead of symbols.
    sum
        The joints whose angles add up to phi, from 1, each with 1 or -1; empty without phi.
    meanings
        Values of the pose's entries and of defined quantities in the joints, if the pose is that of the arm, by name.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> derivation = inverse_derivation(library_robot("planar2r"))
    >>> print(derivation.steps[1].form.equations[0][0])
    2*l1*l2*c2
    >>> bool(derivation.prove())
    True
    """

    chain: ExactChain
    family: Derivable
    steps: tuple[DerivationStep, ...]
    conditions: tuple[Condition, ...]
    notes: tuple[str, ...]
    sum: tuple[tuple[int, int], ...]
    meanings: dict[str, Element]

    @property
    def description(self) -> Description:
        """The robot."""
        return self.chain.description

    @property
    def n(self) -> int:
        """The number of joints."""
        return self.chain.n

    @property
    def geometry(self) -> str:
        """The arrangement of the arm's axes in words."""
        kinds = self.description.kinds
        if self.family.name != "parallel_chain":
            return self.family.geometry
        slide = " and a prismatic joint along them" if "P" in kinds else ""
        return f"{kinds.count('R')} parallel revolute axes{slide}"

    @cached_property
    def choices(self) -> tuple[Choice, ...]:
        """The rules that name branches, in the order of their names: shoulder, elbow, wrist."""
        found = [step.choice for step in self.steps if step.choice is not None]
        return tuple(sorted(found, key=lambda choice: choice.names == FLIPS))

    @property
    def branches(self) -> tuple[str, ...]:
        """Names of the branches, as those of ``arm.ik``."""
        names_of_choices = [in_branch_order(choice) for choice in self.choices]
        return tuple(" ".join(names) for names in product(*names_of_choices))

    # Reading

    def text(self) -> str:
        """Return the derivation as text."""
        return str(format_function("inverse_text")(self))

    def latex(self) -> str:
        """Return the derivation in LaTeX, for a page that loads amsmath."""
        return str(format_function("inverse_latex")(self))

    def html(self) -> str:
        """Return the derivation as one page of HTML, with MathML and figures."""
        return str(format_function("inverse_page")(self))

    def sympy(self) -> dict[str, Any]:
        """Return sympy expressions: definitions and solutions by name, equations by the name of their unknown."""
        expressions: dict[str, Any] = format_function("inverse_sympy")(self)
        return expressions

    def code(self, language: str = "c") -> dict[str, str]:
        """Return source files by name that compute all branches, in ``"c"``, ``"python"`` or ``"matlab"``.

        Parameters
        ----------
        language
            ``"c"``, ``"python"`` or ``"matlab"``.

        Raises
        ------
        ValueError
            Another language.
        """
        if language not in _LANGUAGES:
            raise ValueError(f"language is {language!r}; expected one of {', '.join(_LANGUAGES)}")
        files: dict[str, str] = format_function(f"inverse_{language}")(self)
        return files

    def export(self, folder: str | Path, language: str = "c") -> tuple[Path, ...]:
        """Write the files of :meth:`code` into a folder, which is made if there is none; return their paths.

        Parameters
        ----------
        folder
            Folder to write into; it is made if there is none.
        language
            ``"c"``, ``"python"`` or ``"matlab"``.

        Raises
        ------
        ValueError
            Another language.
        DescriptionError
            The folder is a file.
        """
        files = self.code(language)
        place = Path(folder)
        if place.exists() and not place.is_dir():
            raise DescriptionError(f"{place} is a file; expected a folder")
        for name, text in files.items():
            write_atomically(place / name, text)
        return tuple(place / name for name in files)

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        return repr_line(
            "InverseDerivation", self.description.name, f"{self.geometry}, {len(self.steps)} steps"
        )

    def _repr_html_(self) -> str:
        return str(format_function("inverse_table")(self))

    # Proof

    def identities(self) -> Iterator[Proof]:
        """Yield for each step the proof that its equations hold for T = base A_1 ... A_n tool."""
        bench = Workbench(self.chain, self.family.undoes_tool)
        bench.meanings = self.meanings
        for step in self.steps:
            equations = [(self.chain.ring.constant(d.name), d.element) for d in step.definitions]
            if step.form is not None:
                equations += step.form.equations
            yield _proof(bench, step.title, equations)
        for condition in self.conditions:
            yield _proof(bench, condition.look, [(condition.left, condition.right)])

    def prove(self, samples: int = _SAMPLES, seed: int = 0) -> InverseProof:
        """Prove the derivation: each equation an identity, each solution a lemma; and try it at random poses.

        Parameters
        ----------
        samples, seed
            Number and seed of the random joint values whose poses are solved.
        """
        rng = np.random.default_rng(seed)
        numbers = self.description.numbers
        span = np.where(numbers.prismatic, max(self.description.reach, 1e-3), np.pi)
        q = rng.uniform(-span, span, (samples, self.n))
        T = world_to_tool(self.description, q)
        found = self.solve(T)

        forms = dict.fromkeys(
            type(step.form).__name__ for step in self.steps if step.form is not None
        )
        return InverseProof(
            identities=tuple(self.identities()),
            lemmas=tuple(lemmas()[name] for name in forms),
            samples=samples,
            closed=self._closes(found, T),
            complete=self._contains(found, q),
        )

    def _closes(self, found: Array, T: Array) -> bool:
        """Return whether all solutions (N, B, n) reach their poses (N, 4, 4), and each pose has one."""
        if self.family.aims:
            return True
        is_solution = np.asarray(np.isfinite(found).all(axis=-1))
        reached = world_to_tool(self.description, np.where(is_solution[..., None], found, 0.0))

        # Entries of the rotation, and of the position as a share of the reach, shape (N, B, 3, 4).
        gap = np.abs(reached - T[:, None])[..., :3, :]
        gap[..., 3] /= self.description.reach or 1.0

        # An arm that cannot reach every pose keeps the position alone.
        error = gap.max(axis=(-1, -2)) if self.family.undoes_tool else gap[..., 3].max(axis=-1)
        all_close = bool(np.all(error[is_solution] < _POSE_TOLERANCE))
        all_solved = bool(is_solution.any(axis=1).all())
        return all_close and all_solved

    def _contains(self, found: Array, q: Array) -> bool:
        """Return whether the solutions (N, B, n) of each pose contain the joint values (N, n) that it was made from."""
        difference = np.abs(found - q[:, None])
        of_length = difference / (self.description.reach or 1.0)
        of_angle = np.abs((difference + np.pi) % (2 * np.pi) - np.pi)
        difference = np.where(self.description.numbers.prismatic, of_length, of_angle)

        # The largest difference of a joint; a branch without a solution is infinitely far away.
        of_branch = np.where(np.isnan(difference), np.inf, difference).max(axis=-1)
        return bool(np.all(of_branch.min(axis=1) < _JOINT_TOLERANCE))

    # Numbers

    def solve(self, T: ArrayLike) -> Array:
        """Return joint values by the formulas of the steps.

        Parameters
        ----------
        T
            Poses of the tool in the world, shape (..., 4, 4), m.

        Returns
        -------
        Array
            Shape (..., B, n), rad in (-pi, pi] and m, in the order of :attr:`branches`; NaN where a branch has no
            solution. For checking: ``arm.ik`` is faster and keeps its accuracy at singular poses.

        Raises
        ------
        ValueError
            T has another shape.
        """
        T = np.asarray(T, dtype=float)
        if T.shape[-2:] != (4, 4):
            raise ValueError(f"T has shape {T.shape}; expected (..., 4, 4)")
        poses = T.reshape(-1, 4, 4)
        B = len(self.branches)
        result = np.full((len(poses), B, self.n), np.nan)

        # The same choice of roots may have different names at different poses.
        with np.errstate(all="ignore"):
            for values, is_solved in self.candidates(poses):
                rows = np.flatnonzero(is_solved)
                branch = self._branch_index(values)
                result[rows, branch[rows]] = self._joints(values)[rows]
        return result.reshape((*T.shape[:-2], B, self.n))

    def roots(self, T: Array) -> Array:
        """Return joint values for each choice of roots, whether or not later steps have a solution after them.

        Parameters
        ----------
        T
            Poses of the tool in the world, shape (N, 4, 4), m.

        Returns
        -------
        Array
            Shape (N, C, n), rad in (-pi, pi] and m; NaN from the first step of a choice on that has no solution.
        """
        with np.errstate(all="ignore"):
            return np.stack([self._joints(values) for values, _ in self.candidates(T)], axis=1)

    def candidates(self, T: Array) -> Iterator[tuple[Values, Array]]:
        """Yield for each choice of roots the values of all quantities at poses (N, 4, 4), and a solution mask (N,).

        Parameters
        ----------
        T
            Poses of the tool in the world, shape (N, 4, 4), m.
        """
        with_roots = [
            k
            for k, step in enumerate(self.steps)
            if step.form is not None and step.form.has_two_roots
        ]
        for signs in product((1.0, -1.0), repeat=len(with_roots)):
            yield self._evaluate(T, dict(zip(with_roots, signs, strict=True)))

    def _evaluate(self, T: Array, signs: Mapping[int, float]) -> tuple[Values, Array]:
        """Return the values of all quantities for the roots' signs by step, and a mask (N,) of solutions."""
        count = len(T)
        values = Values(self.chain, T)
        is_solved = np.ones(count, dtype=bool)
        for k, step in enumerate(self.steps):
            for definition in step.definitions:
                values.set_constant(definition.name, values.of(definition.element))
            if step.form is None:
                continue
            letters = {letter: values.of(element) for letter, element in step.form.letters.items()}
            found, radicand = step.form.solve(letters, signs.get(k, 1.0))
            is_solved &= np.broadcast_to(radicand >= -ZERO_RADICAND, count)
            values.set_unknown(step.form.unknown, np.where(is_solved, found, np.nan))

        for condition in self.conditions:
            distance = np.abs(values.of(condition.left) - values.of(condition.right))
            is_solved &= np.broadcast_to(
                distance <= IN_PLANE * (self.description.reach or 1.0), count
            )
        return values, is_solved

    def _joints(self, values: Values) -> Array:
        """Return joint values (N, n), rad in (-pi, pi] and m."""
        q = np.stack([values.joints[i] for i in range(self.n)], axis=1)
        for i, offset in enumerate(self.chain.offsets):
            if self.description.kinds[i] == "R":
                # q = theta - offset, wrapped into (-pi, pi]
                angle = q[:, i] - self.chain.number(offset)
                q[:, i] = angle - 2 * np.pi * np.ceil((angle - np.pi) / (2 * np.pi))
        return q

    def _branch_index(self, values: Values) -> Array:
        """Return the index in :attr:`branches` of the solution at each pose, shape (N,)."""
        count = len(values.joints[0])
        index = np.zeros(count, dtype=int)
        for choice in self.choices:
            # The sign of the product of the factors names the root.
            sign = np.ones(count)
            for factor in choice.factors:
                sign = sign * np.where(values.of(factor) < 0, -1.0, 1.0)
            name = np.where(sign > 0, choice.names[0], choice.names[1])

            # Branches are numbered in binary: one digit a choice, 0 for its first name.
            digit = np.where(name == in_branch_order(choice)[0], 0, 1)
            index = 2 * index + digit
        return index


class Values:
    """Values of a ring's generators at N poses: those of constants and poses, then those that each step finds."""

    def __init__(self, chain: ExactChain, T: Array) -> None:
        self._chain = chain
        self._values: list[Any] = [chain.values.get(g.text, np.nan) for g in chain.ring.generators]
        self.joints: dict[int, Array] = {}
        """Values of theta_i or q_i by joint, from 0, shape (N,) each, rad or m."""

        position = T[:, :3, 3].T
        rotation = T[:, :3, :3].reshape(-1, 9).T
        for name, value in zip(POSE, [*position, *rotation], strict=True):
            self.set_constant(chain.names[name], value)

    def set_constant(self, name: str, value: Array) -> None:
        """Set a defined quantity."""
        self._values[self._chain.ring.place("constant", name)] = value

    def set_unknown(self, unknown: Unknown, value: Array) -> None:
        """Set the value of an unknown, shape (N,), rad or m."""
        ring = self._chain.ring
        if unknown.joint is None:
            self.set_constant(self._chain.names["cphi"], np.cos(value))
            self.set_constant(self._chain.names["sphi"], np.sin(value))
            return
        self.joints[unknown.joint] = value
        if unknown.is_angle:
            self._values[ring.place("cosine", unknown.joint)] = np.cos(value)
            self._values[ring.place("sine", unknown.joint)] = np.sin(value)
        else:
            self._values[ring.place("position", unknown.joint)] = value

    def of(self, element: Element) -> Array:
        """Return an element's values, shape (N,) or ()."""
        return np.asarray(element.value(self._values))


def in_branch_order(choice: Choice) -> tuple[str, str]:
    """Return the names of a choice in the order of branches: left before right, else as they are."""
    return ("left", "right") if choice.names == ("right", "left") else choice.names


def _proof(bench: Workbench, what: str, equations: Sequence[tuple[Element, Element]]) -> Proof:
    """Return the proof that both sides of equations are equal if the pose is that of the arm itself."""
    differences = [bench.meaning(left) - bench.meaning(right) for left, right in equations]
    return Proof(f"{what}: holds for the pose of the arm itself", element_array(differences))


def _subjects(note: str) -> set[str]:
    """Return the symbols that a note on constant angles is about: "cos(0.3) and sin(0.3) are symbols, ..."."""
    return set(note.partition(" are symbols")[0].split(" and "))


@takes_robot
def inverse_derivation(description: Description) -> InverseDerivation:
    """Derive an arm's inverse kinematics in closed form, step by step.

    Lengths of the table that are numbers get names (a2, d3; i is the row's number), and angles stay numbers. Where an
    arm has a closed form only by the values of its parameters, these values are used, and a note says so.

    Parameters
    ----------
    description
        The robot.

    Returns
    -------
    InverseDerivation
        Steps with their formulas, in text, LaTeX and as a program.

    Raises
    ------
    DescriptionError
        No closed form is known; the message names the axes that do not meet or are not parallel, and an alternative.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> inverse_derivation(library_robot("planar2r"))
    <InverseDerivation of planar2r: 2 parallel revolute axes, 3 steps>
    """
    description, notes = without_rounding(description)

    # With named lengths first; an arm may fit a family only by the values of its parameters.
    chain = ExactChain.of(description, named=True)
    family = family_of(chain)
    if family is None:
        numbers = ExactChain.of(description, named=False)
        family = family_of(numbers)
        if family is None:
            raise DescriptionError(f"{description.name}: {why_not(numbers)}")
        chain = numbers
        notes.append(
            f"{family.geometry}: only with the values of the parameters, which therefore stand as numbers here"
        )

    bench = Workbench(chain, family.undoes_tool)
    family.derive(bench)
    in_conditions: list[Element] = []
    for condition in bench.conditions:
        in_conditions += [condition.left, condition.right]
    steps = without_unused(bench.steps, in_conditions)

    # Notes on the lengths and constant angles that the steps use.
    in_steps: list[Element] = []
    for step in steps:
        in_steps += [definition.element for definition in step.definitions]
        in_steps += step.elements
    used = names_in(in_steps)
    own = [name for name in chain.lengths if name in used and name not in description.parameters]
    if own:
        lengths = [f"{name} = {chain.lengths[name]:.6g}" for name in own]
        notes.append(f"lengths of the table by the numbers of their rows, m: {', '.join(lengths)}")
    # Notes on constant angles begin with the symbols that they are about.
    notes += [note for note in chain.notes if " are symbols" not in note or _subjects(note) & used]
    return InverseDerivation(
        chain=chain,
        family=family,
        steps=tuple(steps),
        conditions=tuple(bench.conditions),
        notes=tuple(notes),
        sum=bench.sum,
        meanings=bench.meanings,
    )
