"""Names of a ring's generators in equations; no two generators have the same name.

A ring's generators are joint variables, their rates and accelerations, sines and cosines of joint angles, and
constants: parameters of the robot file, and functions of parameters.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dhkit.symbolic.ring import Element, Generator, Ring, angle_name


@dataclass(frozen=True)
class Notation:
    """Names of constants in equations: their own, unless a variable, a sine or an entry has that name.

    Attributes
    ----------
    names
        Printed name of each symbol of the constants.
    """

    names: Mapping[str, str]

    def __call__(self, name: str) -> str:
        """Return the printed name of a constant."""
        return self.names.get(name, name)

    def printed(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return constants' values by their printed names."""
        return {self(name): value for name, value in values.items()}


@dataclass(frozen=True)
class SineOrCosine:
    """A sine or cosine that occurs in equations, of the sum of some joints' variables."""

    name: str
    """Its name in equations, such as s23."""
    function: str
    """``sin`` or ``cos``."""
    joints: tuple[int, ...]

    @property
    def text(self) -> str:
        """The angle: q2 + q3."""
        return " + ".join(f"q{joint + 1}" for joint in self.joints)


@lru_cache(maxsize=64)
def notation(ring: Ring) -> Notation:
    """Return the printed names of a ring's constants; a name that has another meaning gets an underscore."""
    names = sorted(symbols_of(constants_of(ring.generators)))
    taken = {*variables(ring), *entry_names(ring.n)}
    return Notation(distinct(names, taken))


def variables(ring: Ring) -> set[str]:
    """Return the names of joint variables, rates, accelerations, sines and cosines of sums of neighbouring ones."""
    names = {g.text for g in ring.generators if g.kind != "constant"}
    for i in range(ring.n):
        names |= {f"q{i + 1}", f"qd{i + 1}", f"qdd{i + 1}"}

    # Sums of neighbouring joint variables, from joint a to joint b - 1.
    for a in range(ring.n):
        for b in range(a + 1, ring.n + 1):
            index = angle_name(range(a, b))
            names |= {f"s{index}", f"c{index}"}
    return names


def entry_names(n: int) -> set[str]:
    """Return the names of the entries of all printed quantities of n joints (see ``quantities.py``): M12, g1, K."""
    names = {"K", "V"}
    names |= {f"A{i + 1}" for i in range(n)}  # link transforms, as wholes
    shapes = {"h": (n,), "g": (n,), "tau": (n,), "M": (n, n), "C": (n, n), "T": (4, 4), "J": (6, n)}
    for quantity, shape in shapes.items():
        names |= {entry_name(quantity, place) for place in np.ndindex(shape)}
    return names


def entry_name(quantity: str, place: tuple[int, ...]) -> str:
    """Return an entry's name, counted from 1: M12, or M1_12 where an index has two digits."""
    return quantity + (angle_name(place) if place else "")


def renamings(elements: Iterable[Element]) -> list[str]:
    """Return one sentence for each constant of elements whose printed name differs from that in the robot file."""
    notes: dict[str, None] = {}
    for element in elements:
        used = symbols_of(constants_of(generators_of([element])))
        notes |= dict.fromkeys(
            f"{name} is written {written}: {name} means something else in the equations"
            for name, written in notation(element.ring).names.items()
            if name != written and name in used
        )
    return list(notes)


def distinct(names: Iterable[str], taken: Collection[str]) -> dict[str, str]:
    """Return distinct printed names: each name followed by underscores until it is neither taken nor another's."""
    names = list(names)
    used = {*taken, *names}
    printed_names = {}
    for name in names:
        printed = name  # its own name is free, unless it is taken; the names of others are not
        while printed in taken or (printed != name and printed in used):
            printed += "_"
        used.add(printed)
        printed_names[name] = printed
    return printed_names


def symbols_of(generators: Iterable[Generator]) -> set[str]:
    """Return the names of the parameters in constants: a parameter's own, and those in a function of parameters."""
    found: set[str] = set()
    for g in generators:
        found |= {g.text} if g.meaning is None else g.meaning.symbols
    return found


def generators_of(elements: Iterable[Element]) -> list[Generator]:
    """Return the generators that occur in elements, which may be of several rings of one arm: equal ones once."""
    found: dict[Generator, None] = {}
    for element in elements:
        found |= dict.fromkeys(element.ring.generators[k] for k in sorted(element.used_generators))
    return list(found)


def constants_of(generators: Iterable[Generator]) -> list[Generator]:
    """Return the constants among generators."""
    return [g for g in generators if g.kind == "constant"]


def angles_of(generators: Iterable[Generator]) -> list[SineOrCosine]:
    """Return the sines and cosines among generators: of single joints, then of sums; the cosine before the sine."""
    # A set, since generators of different rings may have the same name. Only sines and cosines have joints.
    found = {
        SineOrCosine(g.text, "sin" if g.kind == "sine" else "cos", g.joints)
        for g in generators
        if g.joints
    }
    return sorted(found, key=lambda angle: (len(angle.joints) > 1, angle.joints, angle.function))
