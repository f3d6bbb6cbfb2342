"""Mistakes as values, and the mistakes that :mod:`dhkit.symbolic.textbook` can make on purpose.

A mistake has an identity that does not change between versions, a subject, a sentence that states it, and a hint. It is
made at every link, at one link, or at one body of a link.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction

from dhkit.display import repr_line, value_line

_HALF = Fraction(1, 2)


class Subject(Enum):
    """The part of an answer that contains a mistake."""

    TABLE = "table"
    TRANSFORM = "transform"
    JACOBIAN = "Jacobian"
    ENERGY = "energy"
    EQUATION = "equation"
    INVERSE = "inverse"
    WRITING = "writing"
    """Units, signs and digits of any answer."""


@dataclass(frozen=True)
class Mistake:
    """A mistake that students make.

    Attributes
    ----------
    identity
        A stable name.
    subject
        The part of an answer that contains it.
    sentence
        Statement of the mistake without its place: a clause that begins with its subject.
    hint
        Where to look, without stating the mistake.
    """

    identity: str
    subject: Subject
    sentence: str
    hint: str

    def __str__(self) -> str:
        return self.sentence

    def __repr__(self) -> str:
        return repr_line(f"Mistake {self.identity}", summary=self.sentence)


@dataclass(frozen=True)
class MadeAt:
    """A mistake and the place where it is made.

    Attributes
    ----------
    identity
        The mistake's identity.
    link
        The link, counted from 1; None if made at every link.
    body
        Name of one of the link's bodies; None if made at all of them.
    """

    identity: str
    link: int | None = None
    body: str | None = None

    def __str__(self) -> str:
        link = "" if self.link is None else f" at link {self.link}"
        return (
            f"{self.identity}{link}" if self.body is None else f"{self.identity}{link}, {self.body}"
        )

    __repr__ = value_line


def made_at(mistakes: Iterable[MadeAt | str]) -> frozenset[MadeAt]:
    """Return mistakes as values; an identity alone means every link.

    Raises
    ------
    TypeError
        One text was given instead of a set of identities.
    """
    if isinstance(mistakes, str):
        raise TypeError(
            f"mistakes is {mistakes!r}; expected a set of identities, as in {{{mistakes!r}}}"
        )
    return frozenset(
        MadeAt(mistake) if isinstance(mistake, str) else mistake for mistake in mistakes
    )


def catalogue(*groups: Iterable[Mistake]) -> dict[str, Mistake]:
    """Return mistakes by identity, in their order.

    Raises
    ------
    ValueError
        Two mistakes have one identity.
    """
    found: dict[str, Mistake] = {}
    for group in groups:
        for mistake in group:
            if mistake.identity in found:
                raise ValueError(f"two mistakes are called {mistake.identity!r}")
            found[mistake.identity] = mistake
    return found


_POTENTIAL = (
    "Look again at the potential energy: which way does it grow, and of which point is the height?"
)
_COM_VELOCITY = "Look again at the velocity of the centre of mass: differentiate its position."
_ANGULAR_VELOCITY = "Look again at the angular velocity: which joints turn this link?"
_INERTIA = "Look again at the inertia: of which body, about which point, and about which axes?"
_KINETIC_FACTORS = "Look again at the factors in the kinetic energy."
_DRIVES = "Look again at the drives: how fast does the rotor turn when the joint does?"
_RATE_TERMS = "Look again at the terms with rates: d/dt of dK/dqd, less dK/dq."
_MASSES = "Look again at the masses: which body moves with which joint?"


def _energy(hint: str, **sentences: str) -> list[Mistake]:
    """Return mistakes in an energy with one hint, each an identity with its sentence."""
    return [
        Mistake(identity, Subject.ENERGY, sentence, hint)
        for identity, sentence in sentences.items()
    ]


def _equation(hint: str, **sentences: str) -> list[Mistake]:
    """Return mistakes in the equations of motion with one hint, each an identity with its sentence."""
    return [
        Mistake(identity, Subject.EQUATION, sentence, hint)
        for identity, sentence in sentences.items()
    ]


MISTAKES: Mapping[str, Mistake] = catalogue(
    _energy(
        _POTENTIAL,
        gravity_sign="gravity has the wrong sign: V falls where it should rise",
        gravity_forgotten="gravity is missing: V is zero",
    ),
    _energy(_MASSES, mass_forgotten="the link's mass is missing"),
    _energy(_INERTIA, inertia_forgotten="the link's inertia about its centre of mass is missing"),
    _energy(
        _POTENTIAL,
        height_at_joint="the height is that of the joint instead of the centre of mass",
        height_at_end="the height is that of the link's end instead of the centre of mass",
        height_relative_angle="the height uses the joint's own angle instead of the sum of the angles up to it",
        height_forgotten="the link's potential energy is missing",
    ),
    _energy(
        _COM_VELOCITY,
        com_at_end="the centre of mass is taken at the link's end, where its frame is",
        velocity_at_joint="the velocity is that of the joint instead of the centre of mass: no parallel-axis term",
        velocity_cross_term="the square of the velocity lacks the cross term 2 v.(omega x r)",
        velocity_relative_angle="the velocity uses the joint's own angle instead of the sum of the angles up to it: "
        "the joints before are taken as still",
        com_rotation_transposed="the link's rotation is transposed where its centre of mass is placed",
    ),
    _energy(
        _ANGULAR_VELOCITY,
        omega_relative="the angular velocity is that of the joint alone, without the joints before it",
        omega_unturned="the angular velocity is not turned by the joints' angles into the link's axes, about which its "
        "inertia is given",
    ),
    _energy(
        _INERTIA,
        inertia_doubled="the link's inertia about its centre of mass counts twice",
        inertia_about_joint="the inertia about the joint is used as if it were about the centre of mass: Steiner twice",
        inertia_about_com_at_joint=(
            "the inertia about the centre of mass is used as if it were about the joint: no parallel-axis term"
        ),
        inertia_axes="the inertia's moments are exchanged in turn: taken about the wrong axes",
    ),
    _energy(
        _KINETIC_FACTORS,
        half_forgotten="the kinetic energy lacks its factor 1/2",
        half_squared="the kinetic energy has the factor 1/4 instead of 1/2",
        translation_half_forgotten="the energy of translation lacks its factor 1/2",
        rotation_half_forgotten="the energy of rotation lacks its factor 1/2",
    ),
    _energy(
        _DRIVES,
        rotor_forgotten="the rotor's inertia is missing",
        rotor_gear="the rotor's inertia is multiplied by the gear ratio instead of its square",
        rotor_without_gear="the rotor's inertia is taken without the gear: the rotor turns N times per joint turn",
    ),
    _energy(
        _POTENTIAL,
        gravity_axis="gravity acts along the wrong axis: that along x is taken along y, y along z, z along x",
        gravity_axis_back="gravity acts along the wrong axis: that along x is taken along z, z along y, y along x",
    ),
    _equation(
        "Look again at the sign of dV/dq.",
        potential_gradient_sign="dV/dq has the wrong sign in Euler and Lagrange's equation",
    ),
    _equation(
        _RATE_TERMS,
        mass_rate_omitted="d/dt dK/dqd lacks dM/dt qd: M was taken for constant",
        mass_rate_halved="d/dt dK/dqd - dK/dq is replaced by half of dM/dt qd",
        kinetic_gradient_omitted="dK/dq is missing from Euler and Lagrange's equation",
        kinetic_gradient_sign="dK/dq has the wrong sign in Euler and Lagrange's equation",
        christoffel_indices=(
            "the indices of the Christoffel symbols are exchanged: dM_jk/dq_i is added and dM_ij/dq_k taken off"
        ),
        coriolis_missing="products of two different rates are missing",
        coriolis_halved="products of two different rates have half their factor",
        coriolis_doubled="products of two different rates have twice their factor",
        coriolis_sign="products of two different rates have the wrong sign",
        centrifugal_missing="squares of rates are missing",
        centrifugal_sign="squares of rates have the wrong sign",
        centrifugal_halved="squares of rates have half their factor",
        centrifugal_doubled="squares of rates have twice their factor",
        velocity_torques_doubled="all terms with products of rates count twice",
        velocity_torques_halved="all terms with products of rates count by half",
    ),
)
"""Mistakes of a derivation by identity, frequent ones first."""

VELOCITY_FACTORS = {
    "coriolis_missing": (False, Fraction(0)),
    "coriolis_halved": (False, _HALF),
    "coriolis_doubled": (False, Fraction(2)),
    "coriolis_sign": (False, Fraction(-1)),
    "centrifugal_missing": (True, Fraction(0)),
    "centrifugal_sign": (True, Fraction(-1)),
    "centrifugal_halved": (True, _HALF),
    "centrifugal_doubled": (True, Fraction(2)),
}
"""Factors of terms with rates, with True for squares of a rate and False for products of two different rates."""

STEP_FACTORS = {
    "mass_rate_omitted": (Fraction(0), Fraction(1)),
    "mass_rate_halved": (_HALF, Fraction(0)),
    "kinetic_gradient_omitted": (Fraction(1), Fraction(0)),
    "kinetic_gradient_sign": (Fraction(1), Fraction(-1)),
    "christoffel_indices": (Fraction(0), Fraction(-1)),
    "velocity_torques_doubled": (Fraction(2), Fraction(2)),
    "velocity_torques_halved": (_HALF, _HALF),
}
"""Factors of dM/dt qd and of dK/dq in the Euler-Lagrange equation."""

ROTOR_MISTAKES = frozenset(("rotor_forgotten", "rotor_gear", "rotor_without_gear"))
"""Mistakes in the kinetic energy of the rotors."""

LINK_MISTAKES = frozenset(MISTAKES) - {
    *VELOCITY_FACTORS,
    *STEP_FACTORS,
    *ROTOR_MISTAKES,
    "potential_gradient_sign",
}
"""Mistakes that change a link's own energies."""


def has(
    mistakes: Collection[MadeAt], identity: str, i: int | None = None, body: str | None = None
) -> bool:
    """Return whether a mistake is made at every link, at link i (counted from 0), or at its body of this name."""
    if MadeAt(identity) in mistakes:
        return True
    return i is not None and (
        MadeAt(identity, i + 1) in mistakes or MadeAt(identity, i + 1, body) in mistakes
    )


def check_mistake(
    made: object,
    n: int,
    known: Mapping[str, Mistake] = MISTAKES,
    bodies: Sequence[Sequence[str]] = (),
) -> None:
    """Check that a mistake is in a catalogue and is made at a link and body of an arm of n joints.

    Parameters
    ----------
    made
        A mistake where it is made.
    n
        The number of joints.
    known
        The catalogue.
    bodies
        The names of each link's bodies, where a mistake may be made at one of them.

    Raises
    ------
    TypeError
        Not a :class:`MadeAt`.
    ValueError
        No such mistake, no such link, or no such body.
    """
    if not isinstance(made, MadeAt):
        raise TypeError(f"mistake {made!r}: expected MadeAt(identity, link)")
    if made.identity not in known:
        raise ValueError(f"no mistake {made.identity!r}; expected one of {', '.join(known)}")
    if made.link is not None and not 1 <= made.link <= n:
        raise ValueError(f"mistake {made.identity!r}: no link {made.link}; expected 1 to {n}")

    if made.body is None:
        return
    names = bodies[made.link - 1] if made.link is not None and bodies else ()
    if made.identity not in LINK_MISTAKES or made.body not in names:
        where = "" if made.link is None else f" of link {made.link}"
        expected = ", ".join(filter(None, names)) or "none"
        raise ValueError(
            f"mistake {made.identity!r}: no body {made.body!r}{where}; expected {expected}"
        )
