"""Exact equations of motion M qdd + C qd + g = tau of an arm, and proofs about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, takes_robot
from dhkit.display import repr_line
from dhkit.expressions import Expression
from dhkit.formats import format_function
from dhkit.symbolic.exact import composite
from dhkit.symbolic.exact.exact_arm import ExactArm, exact_arm
from dhkit.symbolic.exact.naming import Symbols
from dhkit.symbolic.ring import Element, Elements, RingError
from dhkit.symbolic.ring.elements import READABLE
from dhkit.symbolic.ring.notation import notation
from dhkit.symbolic.textbook import TextbookDerivation, derive

_HALF = Fraction(1, 2)
QUANTITIES = {
    "M": "mass matrix",
    "C": "Coriolis matrix",
    "h": "Coriolis and centrifugal torques",
    "g": "gravity torques",
    "tau": "joint torques",
    "K": "kinetic energy",
    "V": "potential energy",
}
"""The quantities of a Lagrangian that can be printed, by attribute, with their names in words."""


@dataclass(frozen=True, eq=False, repr=False)
class Proof:
    """A statement decided in the exact ring: it is true if the difference of its two sides is zero.

    Attributes
    ----------
    statement
        The statement in words.
    difference
        Left side minus right side, an array of elements; all zero if the statement is true.
    """

    statement: str
    difference: Elements

    def __bool__(self) -> bool:
        return all(element.is_zero for element in self.difference.flat)

    def __repr__(self) -> str:
        return repr_line("Proof", summary=f"{'proved' if self else 'NOT TRUE'}: {self.statement}")

    @property
    def places(self) -> tuple[tuple[int, ...], ...]:
        """Indices, from 0, of the entries in which the two sides differ."""
        return tuple(
            place for place, element in np.ndenumerate(self.difference) if not element.is_zero
        )

    def __str__(self) -> str:
        if self:
            return f"proved: {self.statement}"
        place = self.places[0]
        where = ", ".join(str(k + 1) for k in place)
        return f"NOT TRUE: {self.statement}; entry {where} differs by {self.difference[place]}"


@dataclass(frozen=True, eq=False, repr=False)
class Lagrangian:
    """An arm's equations of motion in the exact ring, derived by composite bodies and Christoffel symbols.

    Entries of arrays are elements, exact functions of the state; ``str(lag.M[0, 0])`` prints one, :meth:`evaluate`
    gives numbers.

    Attributes
    ----------
    arm
        The description in the ring.
    M
        Mass matrix with reflected rotor inertia, shape (n, n), kg m^2, kg m and kg.
    V
        Potential energy, J; zero at the world's origin.
    definitions
        For equations in base parameters, the combination that each symbol stands for, by name.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> lag = lagrangian(library_robot("planar2r"))
    >>> print(lag.M[1, 1])
    m2*l2^2/3
    >>> bool(lag.prove_euler_lagrange()), bool(lag.prove_skew_symmetry())
    (True, True)
    """

    arm: ExactArm
    M: Elements
    V: Element
    definitions: Mapping[str, Element] = field(default_factory=dict)

    @property
    def description(self) -> Description:
        """The robot."""
        return self.arm.description

    @property
    def n(self) -> int:
        """The number of joints."""
        return self.arm.n

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence for each number that is a symbol because it cannot be written exactly."""
        return self.arm.notes

    @property
    def constants(self) -> dict[str, float]:
        """Values of the symbols, SI, by their printed names."""
        return notation(self.arm.ring).printed(self.arm.parameters)

    # Quantities

    @cached_property
    def christoffel(self) -> Elements:
        """Christoffel symbols of the first kind, shape (n, n, n).

        c_ijk = (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) / 2 (Siciliano et al., Robotics, 2009, eq. 7.45).
        """
        n = self.n

        # dM[i, j, k] = dM_ij/dq_k, symmetric in i and j
        dM = np.empty((n, n, n), dtype=object)
        for i in range(n):
            for j in range(i, n):
                for k in range(n):
                    dM[i, j, k] = dM[j, i, k] = self.M[i, j].by_position(k)

        # c_ijk is symmetric in j and k
        c = np.empty((n, n, n), dtype=object)
        for i in range(n):
            for j in range(n):
                for k in range(j, n):
                    c[i, j, k] = c[i, k, j] = (dM[i, j, k] + dM[i, k, j] - dM[j, k, i]) * _HALF
        return c

    @cached_property
    def C(self) -> Elements:
        """Coriolis matrix of the Christoffel symbols, shape (n, n): C_ij = sum_k c_ijk qd_k."""
        return self.christoffel @ self._rates

    @cached_property
    def h(self) -> Elements:
        """Coriolis and centrifugal torques C qd, shape (n,), N m or N."""
        return self.C @ self._rates

    @cached_property
    def g(self) -> Elements:
        """Gravity torques dV/dq, shape (n,), N m or N."""
        return np.array([self.V.by_position(i) for i in range(self.n)], dtype=object)

    @cached_property
    def K(self) -> Element:
        """Kinetic energy qd^T M qd / 2, J."""
        return self._rates @ self.M @ self._rates * _HALF  # type: ignore[no-any-return]

    @cached_property
    def tau(self) -> Elements:
        """Joint torques M qdd + C qd + g, shape (n,), N m or N."""
        ring = self.arm.ring
        qdd = np.array([ring.acceleration(i) for i in range(self.n)], dtype=object)
        return self.M @ qdd + self.h + self.g  # type: ignore[no-any-return]

    @property
    def _rates(self) -> Elements:
        """Joint rates qd as elements, shape (n,)."""
        return np.array([self.arm.ring.rate(i) for i in range(self.n)], dtype=object)

    def replaced(self, **quantities: Any) -> Lagrangian:
        """Return equations in which some quantities are replaced, to compare them with the right ones.

        Parameters
        ----------
        **quantities
            Any of M, V, C, h, g, K, tau, as elements of this ring. Quantities derived from a replaced one follow it.

        Raises
        ------
        ValueError
            No such quantity, a wrong shape, or entries that are not elements of this ring.
        """
        for name, given in quantities.items():
            if name not in QUANTITIES:
                raise ValueError(f"no quantity {name!r}; expected {', '.join(QUANTITIES)}")
            shape = np.shape(getattr(self, name))
            entries = np.ravel(np.asarray(given, dtype=object)) if shape else [given]
            in_ring = all(
                isinstance(entry, Element) and entry.ring == self.arm.ring for entry in entries
            )
            if np.shape(given) != shape or not in_ring:
                raise ValueError(
                    f"{name}: expected an array of shape {shape} of elements of these equations' ring"
                )

        M = quantities.pop("M", self.M)
        V = quantities.pop("V", self.V)
        other = Lagrangian(self.arm, M, V, self.definitions)

        # The others are cached properties: a value in the instance's dictionary takes the place of the computation.
        vars(other).update(quantities)
        return other

    def evaluate(
        self,
        elements: Element | Elements,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
    ) -> Array:
        """Return values at states (..., n), shape ``(..., *elements.shape)``; see :meth:`ExactArm.evaluate`.

        Parameters
        ----------
        elements
            Elements, or arrays of them, such as ``M`` or ``tau``.
        q, qd, qdd
            Joint values, rates and accelerations, shape (..., n), rad, m and seconds.

        Examples
        --------
        >>> from dhkit import Arm
        >>> arm = Arm.load("planar2r")
        >>> arm.lagrangian.evaluate(arm.lagrangian.g, [0, 0]).round(3)
        array([15.206,  2.943])
        """
        return self.arm.evaluate(elements, q, qd, qdd)

    # Reading

    def text(self, what: str | Sequence[str] = ("M", "C", "g")) -> str:
        """Return some of M, C, h, g, tau, K and V as text, entry by entry, in the angles that make them shortest.

        Parameters
        ----------
        what
            Quantities by name: ``"M"``, ``"C"``, ``"h"``, ``"g"``, ``"tau"``, ``"K"``, ``"V"``.

        Returns
        -------
        str
            One line an entry, then the abbreviations.

        Raises
        ------
        RingError
            An entry is too long to be read.

        Examples
        --------
        >>> from dhkit import Arm
        >>> arm = Arm.load("planar2r")
        >>> print(arm.lagrangian.text(("g",)).splitlines()[1])
        g2 = m2*g*l2*c12/2
        """
        quantities = format_function("readable")(self, what)
        return str(format_function("equations_text")(quantities))

    def latex(self, what: str | Sequence[str] = ("M", "C", "g")) -> str:
        """Return some of M, C, h, g, tau, K and V in LaTeX, for a page that loads amsmath.

        Parameters
        ----------
        what
            Quantities by name: ``"M"``, ``"C"``, ``"h"``, ``"g"``, ``"tau"``, ``"K"``, ``"V"``.

        Raises
        ------
        RingError
            An entry is too long to be read.

        Examples
        --------
        >>> from dhkit import Arm
        >>> arm = Arm.load("planar2r")
        >>> "g_{2}" in arm.lagrangian.latex(("g",)) or "g" in arm.lagrangian.latex(("g",))
        True
        """
        quantities = format_function("readable")(self, what)
        return str(format_function("equations_latex")(quantities))

    def sympy(self, what: str | Sequence[str] = tuple(QUANTITIES)) -> dict[str, object]:
        """Return sympy matrices M and C, columns h, g and tau, and expressions K and V by name, not simplified.

        Parameters
        ----------
        what
            Quantities by name: ``"M"``, ``"C"``, ``"h"``, ``"g"``, ``"tau"``, ``"K"``, ``"V"``.

        Examples
        --------
        >>> from dhkit import Arm
        >>> arm = Arm.load("planar2r")
        >>> arm.lagrangian.sympy(("g",))["g"][1]
        g*l2*m2*cos(q1 + q2)/2
        """
        quantities = format_function("quantities")(self, what)
        matrices: dict[str, object] = format_function("equations_sympy")(quantities)
        return matrices

    def __str__(self) -> str:
        size = sum(len(element) for element in self.M.flat)
        if size <= READABLE:
            return self.text()
        return f"{self.description.name}: M qdd + C qd + g = tau, M of {size} terms; .text(('g',)) prints a part"

    def __repr__(self) -> str:
        return repr_line(
            "Lagrangian", self.description.name, ", ".join(self.arm.ring.constants) or "in numbers"
        )

    def _repr_latex_(self) -> str | None:
        return self.latex() if sum(len(element) for element in self.M.flat) <= READABLE else None

    # Proofs

    def prove_skew_symmetry(self) -> Proof:
        """Decide whether dM/dt - 2 C is skew-symmetric, for every state."""
        dM_dt = np.empty_like(self.M)
        for place, entry in np.ndenumerate(self.M):
            dM_dt[place] = entry.by_time()

        # N is skew-symmetric exactly if N + N^T = 0.
        N = dM_dt - 2 * self.C
        return Proof("dM/dt - 2 C is skew-symmetric", N + N.T)

    def prove_euler_lagrange(self, other: TextbookDerivation | None = None) -> Proof:
        """Decide whether M qdd + C qd + g equals the Euler-Lagrange equation of the textbook's derivation.

        The textbook's derivation differentiates the positions of the centres of mass and applies d/dt dL/dqd - dL/dq to
        the Lagrangian; both derivations share the table in the ring and nothing else.

        Parameters
        ----------
        other
            A derivation of the same description with the same symbols, possibly with mistakes; the right one if not
            given.
        """
        if self.arm.inertial and not self.arm.bodies:
            raise RingError(
                "base parameters: prove the full equations (base.full), and that both are equal (base.prove())"
            )
        textbook = other or derive(self.description, symbols=self.arm.symbols)
        if textbook.arm.ring != self.arm.ring:
            raise RingError(
                f"the other derivation is of {textbook.arm.description.name} with symbols {textbook.arm.symbols!r}; "
                f"expected {self.description.name} with {self.arm.symbols!r}"
            )
        return Proof("M qdd + C qd + g = d/dt dL/dqd - dL/dq", self.tau - textbook.tau)


@takes_robot
def lagrangian(
    description: Description, symbols: Symbols = "file", needed: tuple[Expression, ...] = ()
) -> Lagrangian:
    """Return a description's equations of motion; see :func:`dhkit.symbolic.exact_arm` for the arguments.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    symbols
        ``"none"``, ``"file"`` or ``"inertial"``: names that stay symbols.
    needed
        Further expressions whose constants the ring contains.

    Returns
    -------
    Lagrangian
        M, C, g, energies and torques as elements of one ring, with proofs.

    Raises
    ------
    DescriptionError
        A link has no body.
    RingError
        The equations are too long.
    ValueError
        Another choice of symbols.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> lag = lagrangian(library_robot("planar2r"))
    >>> print(lag.M[1, 1])
    m2*l2^2/3
    """
    arm = exact_arm(description, symbols, needed)
    return Lagrangian(arm, composite.mass_matrix(arm), composite.potential_energy(arm))
