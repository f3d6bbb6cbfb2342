"""The forms of equations that derivations of inverse kinematics solve, each with its solution and its lemma.

A form has letters (A, B, C ...) that stand for known quantities. Its lemma, that the solution satisfies the equation
and that there is no other one, is proved once, in a ring of the letters.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np

from dhkit.description import Array
from dhkit.symbolic.exact.lagrangian import Proof
from dhkit.symbolic.ring import Element, Elements, Ring
from dhkit.symbolic.ring.ring import Constant

ZERO_RADICAND = 1e-12
"""Largest size of a negative radicand that counts as zero, as a share of the radicand's terms: they are rounded."""


@dataclass(frozen=True)
class Unknown:
    """The quantity that a step solves for.

    Attributes
    ----------
    name
        theta3 of a revolute joint, q3 of a prismatic one, or phi.
    joint
        The joint, from 0; None for phi, a sum of joint angles.
    symbols
        Cosine and sine of an angle, or the value of a prismatic joint.
    """

    name: str
    joint: int | None
    symbols: tuple[Element, ...]

    @property
    def is_angle(self) -> bool:
        """Whether the unknown is an angle, not a length."""
        return len(self.symbols) == 2

    @property
    def cosine(self) -> Element:
        """The cosine of an angle."""
        return self.symbols[0]

    @property
    def sine(self) -> Element:
        """The sine of an angle."""
        return self.symbols[1]


@dataclass(frozen=True, eq=False)
class Form(ABC):
    """An equation of a known form.

    Attributes
    ----------
    unknown
        The quantity that it is solved for.
    letters
        The known quantities by letter.
    """

    unknown: Unknown
    letters: Mapping[str, Element]

    has_two_roots: ClassVar[bool] = False
    statement: ClassVar[str]
    """The lemma in words."""
    text: ClassVar[tuple[str, ...]]
    """The solution as text, in one or two alternatives; <A> stands for the letter A or its value."""
    latex: ClassVar[tuple[str, ...]]
    """The same in LaTeX."""
    code: ClassVar[str]
    """The same as code, where <s> is 1 or -1, and root(x) the square root of x, or 0 if x is negative."""
    guard: ClassVar[tuple[str, str]] = ("", "")
    """The radicand, and the quantity that its size is compared with, as code; empty without a root."""

    @property
    def derived(self) -> dict[str, tuple[str, Element]]:
        """Further quantities in the solution, by their placeholders: as text in the letters, and as elements."""
        return {}

    @property
    @abstractmethod
    def equations(self) -> tuple[tuple[Element, Element], ...]:
        """Both sides of the equations."""

    @abstractmethod
    def solve(self, letters: Mapping[str, Array], sign: float) -> tuple[Array, Array]:
        """Return the unknown at values of the letters, and the radicand as a share of its terms.

        Parameters
        ----------
        letters
            Values of the letters, shape (N,) or ().
        sign
            1 or -1, the root that is taken.

        Returns
        -------
        tuple
            The unknown, rad or m, and the radicand over the size of its terms; 1 without a root.
        """

    @staticmethod
    @abstractmethod
    def lemma() -> Proof:
        """Prove that the solution satisfies the equation, and that there is no other."""


class Circle(Form):
    """A cos x + B sin x = C."""

    has_two_roots = True
    statement = (
        "A cos x + B sin x = C holds for x = atan2(B, A) +- atan2(sqrt(A^2 + B^2 - C^2), C), "
        "and for no other angle"
    )
    text = ("atan2(<B>, <A>) ± atan2(sqrt(<D>), <C>)",)
    latex = (r"\mathrm{atan2}(<B>,\, <A>) \pm \mathrm{atan2}\bigl(\sqrt{<D>},\, <C>\bigr)",)
    code = "atan2(<B>, <A>) + <s>*atan2(root(<D>), <C>)"
    guard = "<D>", "<A>*<A> + <B>*<B>"

    @property
    def derived(self) -> dict[str, tuple[str, Element]]:
        """The radicand."""
        A, B, C = (self.letters[k] for k in "ABC")
        words = " + ".join(f"{k}^2" for k in "AB" if not self.letters[k].is_zero)
        return {"D": (f"{words} - C^2", A * A + B * B - C * C)}

    @property
    def equations(self) -> tuple[tuple[Element, Element], ...]:
        """A cos x + B sin x, and C."""
        A, B, C = (self.letters[k] for k in "ABC")
        return ((A * self.unknown.cosine + B * self.unknown.sine, C),)

    def solve(self, letters: Mapping[str, Array], sign: float) -> tuple[Array, Array]:
        """Return the angle and the radicand."""
        # x = atan2(B, A) +- atan2(R, C) with R^2 = A^2 + B^2 - C^2
        A, B, C = (letters[k] for k in "ABC")
        size = A * A + B * B
        radicand = size - C * C
        R = np.sqrt(np.maximum(radicand, 0.0))
        angle = np.arctan2(B, A) + sign * np.arctan2(R, C)
        return angle, radicand / np.maximum(size, np.finfo(float).tiny)

    @staticmethod
    def lemma() -> Proof:
        """Prove the solution, with N = A^2 + B^2 and R^2 = N - C^2; any solution has B cos x - A sin x = +-R."""
        ring = _ring("A B C", {"R": "A^2 + B^2 - C^2"}, "X")
        A, B, C, R = map(ring.constant, "ABCR")
        c = ring.cosine(0)
        s = ring.sine(0)
        N = A * A + B * B

        # The solutions hold: (x, y) = N (cos, sin) of the sum of the two arc tangents satisfies A x + B y = C N.
        zeros = []
        for sign in (1, -1):
            x = A * C - sign * B * R
            y = B * C + sign * A * R
            zeros.append(A * x + B * y - C * N)
            zeros.append(x * x + y * y - N * N)

        # There are no others: (B cos x - A sin x)^2 = N - (A cos x + B sin x)^2
        left_side = A * c + B * s
        zeros.append((B * c - A * s) ** 2 - (N - left_side * left_side))
        return Proof(Circle.statement, _column(zeros))


class Line(Form):
    """X sin x = Y cos x."""

    has_two_roots = True
    statement = (
        "X sin x = Y cos x holds for x = atan2(Y, X) and x = atan2(-Y, -X), and for no other angle"
    )
    text = ("atan2(<Y>, <X>)", "atan2(<mY>, <mX>)")
    latex = (r"\mathrm{atan2}(<Y>,\, <X>)", r"\mathrm{atan2}(<mY>,\, <mX>)")
    code = "atan2(<s>*<Y>, <s>*<X>)"

    @property
    def derived(self) -> dict[str, tuple[str, Element]]:
        """The opposite direction."""
        return {f"m{k}": (f"-{k}", -self.letters[k]) for k in "XY"}

    @property
    def equations(self) -> tuple[tuple[Element, Element], ...]:
        """X sin x, and Y cos x."""
        return ((self.letters["X"] * self.unknown.sine, self.letters["Y"] * self.unknown.cosine),)

    def solve(self, letters: Mapping[str, Array], sign: float) -> tuple[Array, Array]:
        """Return the angle."""
        return np.arctan2(sign * letters["Y"], sign * letters["X"]), np.array(1.0)

    @staticmethod
    def lemma() -> Proof:
        """Prove it: (X, Y) is then (X cos x + Y sin x) times (cos x, sin x), so that x is its direction or opposite."""
        return Proof(Line.statement, _along(["X", "Y"]))


class Direction(Form):
    """k cos x = X and k sin x = Y, with a known k that is not zero."""

    statement = "k cos x = X, k sin x = Y hold for x = atan2(k Y, k X) alone, where k is not 0"
    text = ("atan2(<kY>, <kX>)",)
    latex = (r"\mathrm{atan2}(<kY>,\, <kX>)",)
    code = "atan2(<kY>, <kX>)"

    @property
    def derived(self) -> dict[str, tuple[str, Element]]:
        """The products with k, without a k of 1 or -1."""
        k = self.letters["k"]
        factor = "k*"
        if k == 1:
            factor = ""
        elif k == -1:
            factor = "-"
        return {f"k{letter}": (f"{factor}{letter}", k * self.letters[letter]) for letter in "XY"}

    @property
    def equations(self) -> tuple[tuple[Element, Element], ...]:
        """The two equations."""
        k = self.letters["k"]
        return (k * self.unknown.cosine, self.letters["X"]), (
            k * self.unknown.sine,
            self.letters["Y"],
        )

    def solve(self, letters: Mapping[str, Array], sign: float) -> tuple[Array, Array]:
        """Return the angle."""
        k = letters["k"]
        return np.arctan2(k * letters["Y"], k * letters["X"]), np.array(1.0)

    @staticmethod
    def lemma() -> Proof:
        """Prove that (k X, k Y) is k^2 (cos x, sin x), whose direction is x."""
        ring = _ring("k", {}, "X")
        k = ring.constant("k")
        c = ring.cosine(0)
        s = ring.sine(0)
        return Proof(
            Direction.statement, _column([k * (k * c) - k * k * c, k * (k * s) - k * k * s])
        )


class Flip(Form):
    """k cos x = X and k sin x = Y, with a k that is not known yet."""

    has_two_roots = True
    statement = "k cos x = X, k sin x = Y hold for x = atan2(Y, X) if k > 0, and x = atan2(-Y, -X) if k < 0, alone"
    text = ("atan2(<Y>, <X>)", "atan2(<mY>, <mX>)")
    latex = (r"\mathrm{atan2}(<Y>,\, <X>)", r"\mathrm{atan2}(<mY>,\, <mX>)")
    code = "atan2(<s>*<Y>, <s>*<X>)"

    @property
    def derived(self) -> dict[str, tuple[str, Element]]:
        """The opposite direction."""
        return {f"m{k}": (f"-{k}", -self.letters[k]) for k in "XY"}

    @property
    def equations(self) -> tuple[tuple[Element, Element], ...]:
        """The two equations."""
        k = self.letters["k"]
        return (k * self.unknown.cosine, self.letters["X"]), (
            k * self.unknown.sine,
            self.letters["Y"],
        )

    def solve(self, letters: Mapping[str, Array], sign: float) -> tuple[Array, Array]:
        """Return the angle."""
        return np.arctan2(sign * letters["Y"], sign * letters["X"]), np.array(1.0)

    @staticmethod
    def lemma() -> Proof:
        """Prove that X sin x = Y cos x follows, of which the two angles are the only solutions."""
        ring = _ring("k", {}, "X")
        k = ring.constant("k")
        c = ring.cosine(0)
        s = ring.sine(0)
        return Proof(
            Flip.statement,
            np.concatenate([_column([(k * c) * s - (k * s) * c]), _along(["X", "Y"])]),
        )


class CosineAndSquare(Form):
    """cos x = X and sin^2 x = S."""

    has_two_roots = True
    statement = "cos x = X, sin^2 x = S, with X^2 + S = 1, hold for x = atan2(+-sqrt(S), X), and for no other angle"
    text = ("atan2(±sqrt(<S>), <X>)",)
    latex = (r"\mathrm{atan2}\bigl(\pm\sqrt{<S>},\, <X>\bigr)",)
    code = "atan2(<s>*root(<S>), <X>)"

    @property
    def equations(self) -> tuple[tuple[Element, Element], ...]:
        """The two equations."""
        return (self.unknown.cosine, self.letters["X"]), (self.unknown.sine**2, self.letters["S"])

    def solve(self, letters: Mapping[str, Array], sign: float) -> tuple[Array, Array]:
        """Return the angle and the radicand, which is a sum of squares."""
        S = letters["S"]
        sine = sign * np.sqrt(np.maximum(S, 0.0))
        return np.arctan2(sine, letters["X"]), S

    @staticmethod
    def lemma() -> Proof:
        """Prove that the roots of sin^2 x = S are the sines of x and -x."""
        ring = _ring("X", {"R": "1 - X^2"}, "X")
        X = ring.constant("X")
        R = ring.constant("R")
        c = ring.cosine(0)
        s = ring.sine(0)
        return Proof(CosineAndSquare.statement, _column([X * X + R * R - 1, s * s - (1 - c * c)]))


class Turned(Form):
    """(x, y) is (u, v) turned by an angle: u cos - v sin = x, u sin + v cos = y."""

    statement = (
        "u cos t - v sin t = x, u sin t + v cos t = y hold for t = atan2(u y - v x, u x + v y) alone, "
        "where u, v are not both 0"
    )
    text = ("atan2(<UY>, <UX>)",)
    latex = (r"\mathrm{atan2}(<UY>,\, <UX>)",)
    code = "atan2(<UY>, <UX>)"

    @property
    def derived(self) -> dict[str, tuple[str, Element]]:
        """Sine and cosine, times the square of the length."""
        U, V, X, Y = (self.letters[k] for k in "UVXY")
        return {"UY": ("U*Y - V*X", U * Y - V * X), "UX": ("U*X + V*Y", U * X + V * Y)}

    @property
    def equations(self) -> tuple[tuple[Element, Element], ...]:
        """The two equations."""
        c, s = self.unknown.symbols
        U, V, X, Y = (self.letters[k] for k in "UVXY")
        return (U * c - V * s, X), (U * s + V * c, Y)

    def solve(self, letters: Mapping[str, Array], sign: float) -> tuple[Array, Array]:
        """Return the angle."""
        U, V, X, Y = (letters[k] for k in "UVXY")
        return np.arctan2(U * Y - V * X, U * X + V * Y), np.array(1.0)

    @staticmethod
    def lemma() -> Proof:
        """Prove that (u x + v y, u y - v x) is (u^2 + v^2) (cos t, sin t)."""
        ring = _ring("u v", {}, "X")
        u = ring.constant("u")
        v = ring.constant("v")
        c = ring.cosine(0)
        s = ring.sine(0)
        x = u * c - v * s
        y = u * s + v * c
        size = u * u + v * v
        return Proof(
            Turned.statement, _column([u * x + v * y - size * c, u * y - v * x - size * s])
        )


class Square(Form):
    """(z + M)^2 = S for a prismatic joint's value z; Q is the squared length that the size of S is compared with."""

    has_two_roots = True
    statement = "(z + M)^2 = S holds for z = -M +- sqrt(S), and for no other number"
    text = ("<mM> ± sqrt(<S>)",)
    latex = (r"<mM> \pm \sqrt{<S>}",)
    code = "<mM> + <s>*root(<S>)"
    guard = "<S>", "<Q>"

    @property
    def derived(self) -> dict[str, tuple[str, Element]]:
        """-M."""
        return {"mM": ("-M", -self.letters["M"])}

    @property
    def equations(self) -> tuple[tuple[Element, Element], ...]:
        """(z + M)^2, and S."""
        return (((self.unknown.symbols[0] + self.letters["M"]) ** 2, self.letters["S"]),)

    def solve(self, letters: Mapping[str, Array], sign: float) -> tuple[Array, Array]:
        """Return the value and the radicand."""
        # z = -M +- sqrt(S)
        M = letters["M"]
        S = letters["S"]
        value = -M + sign * np.sqrt(np.maximum(S, 0.0))
        return value, S / np.maximum(letters["Q"], np.finfo(float).tiny)

    @staticmethod
    def lemma() -> Proof:
        """Prove that (z + M)^2 - S is the product of its two factors."""
        ring = _ring("z M R", {}, "")
        z, M, R = map(ring.constant, "zMR")
        return Proof(Square.statement, _column([(z + M) ** 2 - R * R - (z + M - R) * (z + M + R)]))


class Sliding(Form):
    """z = Z for a prismatic joint's value."""

    statement = "z = Z gives z"
    text = ("<Z>",)
    latex = ("<Z>",)
    code = "<Z>"

    @property
    def equations(self) -> tuple[tuple[Element, Element], ...]:
        """z, and Z."""
        return ((self.unknown.symbols[0], self.letters["Z"]),)

    def solve(self, letters: Mapping[str, Array], sign: float) -> tuple[Array, Array]:
        """Return the value."""
        return letters["Z"], np.array(1.0)

    @staticmethod
    def lemma() -> Proof:
        """Return a proof of 0 = 0: there is nothing to solve."""
        ring = _ring("z", {}, "")
        return Proof(Sliding.statement, _column([ring.zero]))


@dataclass(frozen=True, eq=False)
class Remainder(Form):
    """The angle that is left of a sum of angles when all others are known: cos x = X and sin x = Y.

    Attributes
    ----------
    terms
        Names of the sum and of the known angles, each with 1 or -1, that add up to the angle.
    """

    terms: tuple[tuple[str, int], ...] = ()

    statement = "cos x = X, sin x = Y hold for x = atan2(Y, X), and for no other angle"
    text = latex = ("<sum>",)
    code = "<sum>"

    @property
    def equations(self) -> tuple[tuple[Element, Element], ...]:
        """The two equations."""
        c, s = self.unknown.symbols
        return (c, self.letters["X"]), (s, self.letters["Y"])

    def solve(self, letters: Mapping[str, Array], sign: float) -> tuple[Array, Array]:
        """Return the angle."""
        return np.arctan2(letters["Y"], letters["X"]), np.array(1.0)

    @staticmethod
    def lemma() -> Proof:
        """Prove that (X, Y) then has length 1, so that its direction is the angle."""
        ring = _ring("", {}, "X")
        c = ring.cosine(0)
        s = ring.sine(0)
        return Proof(Remainder.statement, _column([c * c + s * s - 1]))


FORMS: tuple[type[Form], ...] = (
    Circle, Line, Direction, Flip, CosineAndSquare, Turned, Square, Sliding, Remainder
)  # fmt: skip


@cache
def lemmas() -> dict[str, Proof]:
    """Return the lemma of every form, by the form's name."""
    return {form.__name__: form.lemma() for form in FORMS}


def _ring(names: str, roots: Mapping[str, str], angle: str) -> Ring:
    """Return a ring of letters, roots of expressions in them, and an angle's cosine and sine if there is one."""
    from dhkit.expressions import parse

    constants = [Constant(name) for name in names.split()]
    constants += [Constant(name, square=parse(text, names.split())) for name, text in roots.items()]
    return Ring("R" if angle else "", constants)


def _along(names: Sequence[str]) -> Elements:
    """Return two elements that are zero if X sin x = Y cos x makes (X, Y) a multiple of (cos x, sin x)."""
    ring = _ring(" ".join(names), {}, "X")
    X, Y = (ring.constant(name) for name in names)
    c = ring.cosine(0)
    s = ring.sine(0)

    # The components along (c, s) and (-s, c); the second one is zero by the equation.
    along = X * c + Y * s
    across = Y * c - X * s
    return _column([X - (along * c - across * s), Y - (along * s + across * c)])


def _column(elements: Sequence[Element]) -> Elements:
    """Return elements as an array, shape (k,)."""
    column = np.empty(len(elements), dtype=object)
    column[:] = elements
    return column
