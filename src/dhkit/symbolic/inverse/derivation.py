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
from dhkit.symbolic.inverse.steps import Choice, Condition, DerivationStep, Workbench, names_in, without_unused
from dhkit.symbolic.inverse.wrists import FLIPS
from dhkit.symbolic.ring import Element
from dhkit.symbolic.ring.elements import element_array

_LANGUAGES = ("c", "python", "matlab")
_CLOSES = 1e-9
_FOUND = 1e-6
"""Largest error, rad and share of the reach, with which a branch closes forward kinematics, and with which joint values
are those that a pose was computed from: near singular poses joints are less certain than poses."""
IN_PLANE = 1e-9
"""Share of the reach by which a pose may be off the plane of an arm that moves in one."""
_SAMPLES = 200
"""Number of random poses at which a proof looks whether branches close and none is missing."""


@dataclass(frozen=True, eq=False)
class InverseProof:
    """Proved statements of a derivation, and those that were only sampled.

    Attributes
    ----------
    identities
        For each step that its equations hold for the pose of the arm itself.
    lemmas
        For each form of equation that its solution is right and complete.
    samples
        Number of random poses at which the branches were tried.
    closed
        Whether all branches closed forward kinematics there.
    complete
        Whether the joint values that each pose was computed from were among them.
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
        """Proved statements, and sampled ones."""
        proved = f"{len(self.identities)} identities and {len(self.lemmas)} lemmas"
        failed = [proof.statement for proof in (*self.identities, *self.lemmas) if not proof]
        sampled = (
            f"sampled: at {self.samples} random poses every branch closes forward kinematics: "
            f"{'yes' if self.closed else 'NO'}; none is missing: {'yes' if self.complete else 'NO'}"
        )
        if failed:
            return f"NOT TRUE: {'; '.join(failed)}. {sampled}"
        return (
            f"proved: {proved} (the equations hold for T = base A_1 ... A_n tool; their solutions are all). {sampled}"
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
        What is not as in the robot file: names of lengths, numbers instead of symbols.
    sum
        The joints whose angles add up to phi, from 1, each with 1 or -1; empty without phi.
    meanings
        What each name of the pose and of a defined quantity is if the pose is that of the arm itself.

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
        """Arrangement of the arm's axes, in words."""
        kinds = self.description.kinds
        if self.family.name != "parallel_chain":
            return self.family.geometry
        return f"{kinds.count('R')} parallel revolute axes{', a slide along them' * ('P' in kinds)}"

    @cached_property
    def choices(self) -> tuple[Choice, ...]:
        """The rules that name branches, in the order of their names: shoulder, elbow, wrist."""
        found = [step.choice for step in self.steps if step.choice is not None]
        return tuple(sorted(found, key=lambda choice: choice.names == FLIPS))

    @property
    def branches(self) -> tuple[str, ...]:
        """Names of the branches, as those of ``arm.ik``."""
        return tuple(" ".join(names) for names in product(*(in_branch_order(choice) for choice in self.choices)))

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
        return repr_line("InverseDerivation", self.description.name, f"{self.geometry}, {len(self.steps)} steps")

    def _repr_html_(self) -> str:
        return str(format_function("inverse_table")(self))

    # Proof

    def identities(self) -> Iterator[Proof]:
        """Yield for each step the proof that its equations hold for T = base A_1 ... A_n tool."""
        bench = Workbench(self.chain, self.family.undoes_tool)
        bench.meanings = self.meanings
        for step in self.steps:
            sides = [(self.chain.ring.constant(d.name), d.element) for d in step.definitions]
            sides += step.form.equations if step.form else ()
            yield _proof(bench, step.title, sides)
        for condition in self.conditions:
            yield _proof(bench, condition.look, [(condition.left, condition.right)])

    def prove(self, samples: int = _SAMPLES, seed: int = 0) -> InverseProof:
        """Prove the derivation: each equation an identity, each solution a lemma; and try it at random poses.

        Parameters
        ----------
        samples, seed
            Number and seed of the random joint values whose poses are solved.
        """
        used = dict.fromkeys(type(step.form).__name__ for step in self.steps if step.form is not None)
        rng = np.random.default_rng(seed)
        numbers = self.description.numbers
        span = np.where(numbers.prismatic, max(self.description.reach, 1e-3), np.pi)
        q = rng.uniform(-span, span, (samples, self.n))
        T = world_to_tool(self.description, q)
        found = self.solve(T)
        return InverseProof(
            tuple(self.identities()),
            tuple(lemmas()[name] for name in used),
            samples,
            self._closes(found, T),
            self._contains(found, q),
        )

    def _closes(self, found: Array, T: Array) -> bool:
        valid = np.asarray(np.isfinite(found).all(axis=-1))
        reached = world_to_tool(self.description, np.where(valid[..., None], found, 0.0))
        scale = self.description.reach or 1.0
        gap = np.abs(reached - T[:, None])[..., :3, :]
        gap[..., 3] /= scale
        if self.family.aims:
            return True
        error = gap[..., 3].max(axis=-1) if not self.family.undoes_tool else gap.max(axis=(-1, -2))
        return bool(np.all(error[valid] < _CLOSES)) and bool(valid.any(axis=1).all())

    def _contains(self, found: Array, q: Array) -> bool:
        slides = self.description.numbers.prismatic
        away = np.abs(found - q[:, None])
        away = np.where(slides, away / (self.description.reach or 1.0), np.abs((away + np.pi) % (2 * np.pi) - np.pi))
        return bool(np.all(np.nanmin(np.where(np.isnan(away), np.inf, away).max(axis=-1), axis=1) < _FOUND))

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
        result = np.full((len(poses), len(self.branches), self.n), np.nan)
        with np.errstate(all="ignore"):
            for values, is_solved in self.candidates(poses):
                rows = np.flatnonzero(is_solved)
                result[rows, self._named(values)[rows]] = self._joints(values)[rows]
        return result.reshape((*T.shape[:-2], len(self.branches), self.n))

    def candidates(self, T: Array) -> Iterator[tuple[Values, Array]]:
        """Yield for each choice of roots the values of all quantities at poses (N, 4, 4), and which are solutions."""
        rooted = [k for k, step in enumerate(self.steps) if step.form is not None and step.form.has_two_roots]
        for signs in product((1.0, -1.0), repeat=len(rooted)):
            yield self._branch(T, dict(zip(rooted, signs, strict=True)))

    def _branch(self, T: Array, signs: Mapping[int, float]) -> tuple[Values, Array]:
        """Return the values of all quantities for signs of roots, and whether they are solutions, shape (N,)."""
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
            values.set_unknown(step.form.unknown, np.broadcast_to(found, count))
        for condition in self.conditions:
            off = np.abs(values.of(condition.left) - values.of(condition.right))
            is_solved &= np.broadcast_to(off <= IN_PLANE * (self.description.reach or 1.0), count)
        return values, is_solved

    def _joints(self, values: Values) -> Array:
        """Return joint values (N, n), rad in (-pi, pi] and m."""
        q = np.stack([values.joints[i] for i in range(self.n)], axis=1)
        for i, offset in enumerate(self.chain.offsets):
            if self.description.kinds[i] == "R":
                turned = q[:, i] - self.chain.number(offset)
                q[:, i] = turned - 2 * np.pi * np.ceil((turned - np.pi) / (2 * np.pi))
        return q

    def _named(self, values: Values) -> Array:
        """Return the indices of branches by the rules that name them, shape (N,)."""
        count = len(values.joints[0])
        index = np.zeros(count, dtype=int)
        for choice in self.choices:
            sign = np.ones(count)
            for factor in choice.factors:
                sign = sign * np.where(values.of(factor) < 0, -1.0, 1.0)
            first = np.where(sign > 0, choice.names[0], choice.names[1]) == in_branch_order(choice)[0]
            index = 2 * index + np.where(first, 0, 1)
        return index


class Values:
    """Values of a ring's generators at N poses: what is given, and then what step after step finds."""

    def __init__(self, chain: ExactChain, T: Array) -> None:
        self._chain = chain
        ring = chain.ring
        self._values: list[Any] = [chain.values.get(g.text, np.nan) for g in ring.generators]
        self.joints: dict[int, Array] = {}
        """theta_i or q_i by joint, from 0, shape (N,) each."""
        for name, value in zip(POSE, [*T[:, :3, 3].T, *T[:, :3, :3].reshape(-1, 9).T], strict=True):
            self.set_constant(chain.names[name], value)

    def set_constant(self, name: str, value: Array) -> None:
        """Set a defined quantity."""
        self._values[self._chain.ring.place("constant", name)] = value

    def set_unknown(self, unknown: Unknown, value: Array) -> None:
        """Set what a step solves for."""
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


_SHOULDERS = {frozenset(("left", "right")): ("left", "right")}


def in_branch_order(choice: Choice) -> tuple[str, str]:
    """Return the names of a choice in the order of branches: left before right."""
    return _SHOULDERS.get(frozenset(choice.names), choice.names)


def _proof(bench: Workbench, what: str, sides: Sequence[tuple[Element, Element]]) -> Proof:
    differences = [bench.meaning(left) - bench.meaning(right) for left, right in sides]
    return Proof(f"{what}: holds for the pose of the arm itself", element_array(differences))


def _subjects(note: str) -> set[str]:
    """Return the symbols that a note on constant angles is about: "cos(0.3) and sin(0.3) are symbols, ..."."""
    return set(note.partition(" are symbols")[0].split(" and "))


@takes_robot
def inverse_derivation(description: Description) -> InverseDerivation:
    """Derive an arm's inverse kinematics in closed form, step by step.

    Lengths of the table that are numbers get names (a2, d3; i is the row's number), and angles stay numbers. Where an
    arm has a closed form only by the values of its parameters, these values are used, and a note says so.

    Raises
    ------
    DescriptionError
        No closed form is known: says which axes do not meet or are not parallel, and what to use instead.
    """
    description, notes = without_rounding(description)
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
    conditions = [side for condition in bench.conditions for side in (condition.left, condition.right)]
    steps = without_unused(bench.steps, conditions)
    used = names_in([d.element for step in steps for d in step.definitions] + [e for s in steps for e in s.elements])
    named = {name: value for name, value in chain.lengths.items() if name in used}
    own = [f"{name} = {value:.6g}" for name, value in named.items() if name not in description.parameters]
    if own:
        notes.append(f"lengths of the table by the numbers of their rows, m: {', '.join(own)}")
    # Notes on constant angles begin with the symbols that they are about.
    notes += [note for note in chain.notes if " are symbols" not in note or _subjects(note) & used]
    return InverseDerivation(
        chain, family, tuple(steps), tuple(bench.conditions), tuple(notes), bench.sum, bench.meanings
    )
