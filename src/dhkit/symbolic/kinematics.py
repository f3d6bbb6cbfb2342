"""Exact kinematics of an arm: link transforms A_1 ... A_n, the tool's pose T and its Jacobian J."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, takes_robot
from dhkit.formats import format_function
from dhkit.symbolic.exact.exact_arm import ExactArm
from dhkit.symbolic.exact.naming import Symbols
from dhkit.symbolic.ring import Element, Elements
from dhkit.symbolic.ring.elements import READABLE
from dhkit.symbolic.ring.notation import notation
from dhkit.symbolic.textbook_kinematics import TextbookKinematics, derive_kinematics

if TYPE_CHECKING:
    from dhkit.symbolic.inverse import InverseDerivation

_LANGUAGES = ("python", "c", "matlab")


@dataclass(frozen=True, eq=False, repr=False)
class SymbolicMatrix:
    """A matrix of exact functions of the joint positions: one of A1 ... An, T and J.

    Attributes
    ----------
    name
        A1 ... An, T or J.
    elements
        Its entries in the exact ring, shape (4, 4), or (6, n) for J.
    kinematics
        The kinematics that it belongs to.
    """

    name: str
    elements: Elements
    kinematics: SymbolicKinematics

    def __getitem__(self, place: Any) -> Any:
        return self.elements[place]

    def evaluate(self, q: ArrayLike) -> Array:
        """Return its values at joint positions (..., n), rad and m: shape (..., 4, 4) or (..., 6, n).

        Parameters
        ----------
        q
            Joint values, shape (..., n), rad and m.

        Examples
        --------
        >>> from dhkit import Arm
        >>> arm = Arm.load("planar2r")
        >>> float(arm.symbolic.T.evaluate([0.0, 0.0])[0, 3])
        0.9
        """
        return self.kinematics.arm.evaluate(self.elements, q)

    def text(self) -> str:
        """Return the matrix as text, entry by entry, in the angles that make each entry shortest."""
        return self.kinematics.text(self.name)

    def latex(self) -> str:
        """Return the matrix in LaTeX, for a page that loads amsmath."""
        return self.kinematics.latex(self.name)

    def sympy(self) -> Any:
        """Return the matrix as a ``sympy.Matrix`` in q1, q2 ... and the file's parameters."""
        return self.kinematics.sympy(self.name)[self.name]

    def code(self, language: str = "python") -> str:
        """Return a function that computes it, in ``"python"``, ``"c"`` or ``"matlab"``.

        Parameters
        ----------
        language
            ``"python"``, ``"c"`` or ``"matlab"``.
        """
        return self.kinematics.code(self.name, language)

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        return f"<{self.name} of {self.kinematics.description.name}, shape {self.elements.shape}>"

    def _repr_latex_(self) -> str | None:
        return (
            self.latex()
            if sum(len(element) for element in self.elements.flat) <= READABLE
            else None
        )


@dataclass(frozen=True, eq=False, repr=False)
class SymbolicKinematics:
    """An arm's forward kinematics and Jacobian in the exact ring; links need no bodies.

    Attributes
    ----------
    description
        The robot.
    derivation
        The derivation, step by step: link transforms by their four elementary motions, their product, the Jacobian's
        columns by axes and levers.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> kinematics = symbolic_kinematics(library_robot("planar2r"))
    >>> print(kinematics.T[0, 3])
    l1*c1 + l2*(c1*c2 - s1*s2)
    >>> print(kinematics.A(1).sympy()[0, 3])
    l1*cos(q1)
    """

    description: Description
    derivation: TextbookKinematics
    definitions = ()
    """Empty: kinematics have no symbols that stand for combinations of others."""

    @property
    def arm(self) -> ExactArm:
        """The description in the ring."""
        return self.derivation.arm

    @property
    def n(self) -> int:
        """The number of joints."""
        return self.description.n

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence for each number that is a symbol because it cannot be written exactly."""
        return self.arm.notes

    @property
    def constants(self) -> dict[str, float]:
        """Values of the symbols, SI, by their printed names."""
        return notation(self.arm.ring).printed(self.arm.parameters)

    def A(self, i: int) -> SymbolicMatrix:
        """Return the transform of link i, from 1: frame i in frame i - 1, m.

        Parameters
        ----------
        i
            Number of the link, from 1.

        Raises
        ------
        ValueError
            No such link.

        Examples
        --------
        >>> from dhkit import Arm
        >>> arm = Arm.load("planar2r")
        >>> print(arm.symbolic.A(2).text().splitlines()[0])
        A2_11 = c2
        """
        if i not in range(1, self.n + 1):
            raise ValueError(f"A({i!r}): expected a link from 1 to {self.n}")
        return self.matrix(f"A{i}")

    @cached_property
    def T(self) -> SymbolicMatrix:
        """The tool in the world, base A_1 ... A_n tool, m."""
        return self.matrix("T")

    @cached_property
    def J(self) -> SymbolicMatrix:
        """The Jacobian (6, n): linear velocity of the tool's origin, then angular velocity, in the world's axes."""
        return self.matrix("J")

    @cached_property
    def ik(self) -> InverseDerivation:
        """Inverse kinematics derived step by step; see :func:`dhkit.symbolic.inverse_derivation`.

        Raises
        ------
        DescriptionError
            No closed form is known; the message names the axes that do not meet or are not parallel.
        """
        from dhkit.symbolic.inverse import inverse_derivation

        return inverse_derivation(self.description)

    def matrix(self, name: str) -> SymbolicMatrix:
        """Return one of A1 ... An, T and J by its name.

        Parameters
        ----------
        name
            ``"A1"`` ... ``"An"``, ``"T"`` or ``"J"``.
        """
        return SymbolicMatrix(name, self.elements(name), self)

    # Reading

    def text(self, what: str | Sequence[str] = ("A", "T")) -> str:
        """Return some of A (all links), A1 ... An, T and J as text.

        Parameters
        ----------
        what
            Quantities by name: ``"A1"`` ... ``"An"``, ``"T"``, ``"J"``.
        """
        quantities = format_function("kinematic_quantities")(self, what)
        return str(format_function("equations_text")(quantities))

    def latex(self, what: str | Sequence[str] = ("A", "T")) -> str:
        """Return some of A, A1 ... An, T and J in LaTeX, for a page that loads amsmath.

        Parameters
        ----------
        what
            Quantities by name: ``"A1"`` ... ``"An"``, ``"T"``, ``"J"``.
        """
        quantities = format_function("kinematic_quantities")(self, what)
        return str(format_function("equations_latex")(quantities))

    def sympy(self, what: str | Sequence[str] = ("A", "T", "J")) -> dict[str, object]:
        """Return sympy matrices by name, not simplified.

        Parameters
        ----------
        what
            Quantities by name: ``"A1"`` ... ``"An"``, ``"T"``, ``"J"``.
        """
        quantities = format_function("kinematic_quantities")(self, what)
        matrices: dict[str, object] = format_function("equations_sympy")(quantities)
        return matrices

    def code(self, what: str | Sequence[str] = ("T", "J"), language: str = "python") -> str:
        """Return functions that compute some of A, A1 ... An, T and J, in ``"python"``, ``"c"`` or ``"matlab"``.

        Parameters
        ----------
        what
            Quantities by name: ``"A1"`` ... ``"An"``, ``"T"``, ``"J"``.
        language
            ``"python"``, ``"c"`` or ``"matlab"``.

        Raises
        ------
        ValueError
            Another language, or no such quantity.
        """
        if language not in _LANGUAGES:
            raise ValueError(f"language is {language!r}; expected one of {', '.join(_LANGUAGES)}")
        quantities = format_function("kinematic_quantities")(self, what)
        return str(format_function(f"equations_{language}")(self, quantities))

    def __str__(self) -> str:
        return self.text("A")

    def __repr__(self) -> str:
        return f"<SymbolicKinematics of {self.description.name}: A(1) ... A({self.n}), T, J>"

    def elements(self, name: str) -> Elements:
        """Return a quantity's entries by its name, as an array of elements.

        Parameters
        ----------
        name
            ``"A1"`` ... ``"An"``, ``"T"`` or ``"J"``.

        Raises
        ------
        ValueError
            The name is none of A1 ... An, T and J.
        """
        names = [*(f"A{i}" for i in range(1, self.n + 1)), "T", "J"]
        if name not in names:
            raise ValueError(f"no quantity {name!r}; expected one of {', '.join(names)}")
        matrix = (
            self.derivation.A[int(name[1:]) - 1]
            if name.startswith("A")
            else getattr(self.derivation, name)
        )

        # Sums of no terms are the number 0, not an element.
        entries = np.empty(matrix.shape, dtype=object)
        zero = self.arm.ring.zero
        for place, entry in np.ndenumerate(matrix):
            entries[place] = entry if isinstance(entry, Element) else zero + entry
        return entries


@takes_robot
def symbolic_kinematics(description: Description, symbols: Symbols = "file") -> SymbolicKinematics:
    """Return an arm's exact kinematics; see :func:`dhkit.symbolic.exact_arm` for ``symbols``.

    Parameters
    ----------
    description
        The robot.
    symbols
        ``"none"``, ``"file"`` or ``"inertial"``: names that stay symbols.

    Returns
    -------
    SymbolicKinematics
        Link transforms, the tool's pose and the Jacobian as elements of one ring.

    Raises
    ------
    RingError
        The expressions are too long.
    ValueError
        Another choice of symbols.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> print(symbolic_kinematics(library_robot("planar2r")).T[0, 3])
    l1*c1 + l2*(c1*c2 - s1*s2)
    """
    return SymbolicKinematics(description, derive_kinematics(description, symbols=symbols))
