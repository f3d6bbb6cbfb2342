"""Quantities to print: M, C, h, g, tau, K and V of a Lagrangian; A1 ... An, T and J of kinematics."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from dhkit.expressions.exact import MAX_FRACTION_PART
from dhkit.symbolic.exact.compact import shortened
from dhkit.symbolic.exact.lagrangian import QUANTITIES, Lagrangian
from dhkit.symbolic.kinematics import SymbolicKinematics
from dhkit.symbolic.ring import Element, Elements, RingError, element_array
from dhkit.symbolic.ring.notation import constants_of, entry_name, generators_of, symbols_of

KINEMATIC_QUANTITIES = {
    "A": "link transforms",
    "T": "pose of the tool in the world",
    "J": "Jacobian of the tool, in the world's axes",
}
"""The quantities of kinematics that can be printed, with their names in words; A stands for A1 ... An."""
_LINK = re.compile(r"A([1-9][0-9]*)")
_NOISE = 1e-7
"""Size of terms of equations with symbols that rounded equations leave out, as a share of the entry's largest."""
MAX_PRINTED_TERMS = 2_000
"""Largest number of terms of an entry that text and LaTeX print."""


@dataclass(frozen=True, eq=False)
class Quantity:
    """A matrix, vector or scalar to print.

    Attributes
    ----------
    name
        One of :data:`QUANTITIES`, ``definitions``, A1 ... An, T or J.
    elements
        Its entries, shape (n, n), (n,) or (); for kinematics (4, 4) or (6, n).
    labels
        Names of the entries, for definitions.
    """

    name: str
    elements: Elements
    labels: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """The quantity in words."""
        if link := _LINK.fullmatch(self.name):
            return f"transform of link {link[1]}"
        return (QUANTITIES | KINEMATIC_QUANTITIES).get(self.name, "base parameters")

    @property
    def is_symmetric(self) -> bool:
        """Whether the matrix is symmetric, so that one triangle is printed: the mass matrix is."""
        return self.name == "M"

    @property
    def entries(self) -> Iterator[tuple[tuple[str, ...], Element]]:
        """Entries that are not zero, each with its names, which count from 1: M12 and M21."""
        for place, element in np.ndenumerate(self.elements):
            if not element:
                continue
            if not self.is_symmetric or place[0] == place[1]:
                yield (self.head(place),), element
            elif place[0] < place[1]:
                yield (self.head(place), self.head(place[::-1])), element

    @property
    def zeros(self) -> list[str]:
        """The names of the entries that are zero."""
        return [self.head(place) for place, element in np.ndenumerate(self.elements) if not element]

    def head(self, place: tuple[int, ...]) -> str:
        """Return an entry's name."""
        if self.labels:
            return self.labels[place[0]]
        # A1_12, since A112 would be read as a number
        return entry_name(f"{self.name}_" if _LINK.fullmatch(self.name) else self.name, place)


def elements_of(quantities: Sequence[Quantity]) -> list[Element]:
    """Return the entries of all quantities."""
    elements: list[Element] = []
    for quantity in quantities:
        elements += quantity.elements.flat
    return elements


def _listed(what: str | Sequence[str]) -> list[str]:
    """Return names one by one; in one text they are separated by commas or spaces."""
    return what.replace(",", " ").split() if isinstance(what, str) else list(what)


def quantities(lag: Lagrangian, what: str | Sequence[str]) -> list[Quantity]:
    """Return quantities of a Lagrangian by name, in the angles that make each entry shortest.

    Names in one text are separated by commas or spaces.

    Raises
    ------
    ValueError
        No such quantity, or none at all.
    """
    names = _listed(what)
    unknown = [name for name in names if name not in QUANTITIES]
    if unknown or not names:
        raise ValueError(
            f"no quantity {unknown[0] if unknown else ''!r}; expected some of {', '.join(QUANTITIES)}"
        )
    return [
        Quantity(name, shortened(lag.arm, element_array(getattr(lag, name))))
        for name in dict.fromkeys(names)
    ]


def kinematic_quantities(
    kinematics: SymbolicKinematics, what: str | Sequence[str]
) -> list[Quantity]:
    """Return A1 ... An (A: all of them), T and J by name, in the angles that make each entry shortest.

    Raises
    ------
    ValueError
        No such quantity, or none at all.
    """
    links = [f"A{i}" for i in range(1, kinematics.n + 1)]
    names: list[str] = []
    for name in _listed(what):
        names += links if name == "A" else [name]
    unknown = [name for name in names if name not in (*links, "T", "J")]
    if unknown or not names:
        raise ValueError(
            f"no quantity {unknown[0] if unknown else ''!r}; expected some of A, {links[0]} ... {links[-1]}, T, J"
        )
    found = {name: kinematics.elements(name) for name in dict.fromkeys(names)}
    return [Quantity(name, shortened(kinematics.arm, x)) for name, x in found.items()]


def is_kinematic(what: str | Sequence[str]) -> bool:
    """Return whether all names are of kinematics: A, A1 ... An, T, J."""
    names = _listed(what)
    return bool(names) and all(
        name in KINEMATIC_QUANTITIES or _LINK.fullmatch(name) for name in names
    )


def readable(lag: Lagrangian, what: str | Sequence[str]) -> list[Quantity]:
    """Return :func:`quantities`, followed by the definitions of the base parameters in them.

    Raises
    ------
    ValueError
        No such quantity, or none at all.
    """
    found = quantities(lag, what)
    used = {generator.text for generator in generators_of(elements_of(found))}
    labels = tuple(name for name in lag.definitions if name in used)
    if not labels:
        return found
    elements = np.empty(len(labels), dtype=object)
    elements[:] = [lag.definitions[name] for name in labels]
    return [*found, Quantity("definitions", elements, labels)]


def rounded(quantity: Quantity, digits: int) -> Quantity:
    """Return a quantity whose coefficients are rounded to significant digits, to be read; short fractions stay exact.

    Terms smaller than a unit of the digit after the last one of the entry's largest coefficient are left out; in
    equations with symbols, whose sizes are not known, those smaller by a factor of 1e-7.

    Parameters
    ----------
    quantity
        The quantity.
    digits
        Number of significant digits, 1 or more.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.symbolic.exact.lagrangian import lagrangian
    >>> (M,) = quantities(lagrangian(library_robot("puma560"), "none"), "M")
    >>> print(M.elements[4, 4], rounded(M, 3).elements[4, 4])
    0.171348451657 0.171
    """
    elements = np.empty(quantity.elements.shape, dtype=object)
    for place, element in np.ndenumerate(quantity.elements):
        largest = max((abs(float(c)) for c in element.terms.values()), default=0.0)
        has_symbols = bool(symbols_of(constants_of(generators_of([element]))))
        least = largest * (_NOISE if has_symbols else 10.0 ** -(digits + 1))
        terms = {
            monomial: _rounded(coefficient, digits)
            for monomial, coefficient in element.terms.items()
            if abs(float(coefficient)) >= least
        }
        elements[place] = element.ring.from_terms(terms)
    return Quantity(quantity.name, elements, quantity.labels)


def _rounded(value: Fraction, digits: int) -> Fraction:
    """Return a rational rounded to significant digits; a short fraction as it is."""
    is_short = max(abs(value.numerator), value.denominator) <= MAX_FRACTION_PART
    return value if is_short else Fraction(f"{float(value):.{digits - 1}e}")


def check_length(quantities: Sequence[Quantity]) -> None:
    """Check that all entries are short enough to be read.

    Raises
    ------
    RingError
        An entry has more than :data:`MAX_PRINTED_TERMS` terms.
    """
    for quantity in quantities:
        for place, element in np.ndenumerate(quantity.elements):
            if len(element) > MAX_PRINTED_TERMS:
                raise RingError(
                    f"{quantity.head(place)} has {len(element)} terms, more than the {MAX_PRINTED_TERMS} that text and "
                    "LaTeX print; code (python, c, matlab) has no limit, and symbols='none' or base parameters are "
                    "shorter"
                )
