"""Where students go wrong when they derive equations of motion: places in :mod:`dhkit.symbolic.textbook`, by name."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

__all__ = ["LINK_MISTAKES", "MISTAKES", "ROTOR_MISTAKES", "STEP_FACTORS", "VELOCITY_FACTORS", "check_mistake", "has"]

HALF = Fraction(1, 2)

MISTAKES: Mapping[str, str] = {
    "gravity_sign": "gravity has the wrong sign: V falls where it should rise",
    "gravity_forgotten": "gravity is missing: V is zero",
    "mass_forgotten": "the link's mass is missing",
    "inertia_forgotten": "the link's inertia about its centre of mass is missing",
    "height_at_joint": "the height is that of the joint in place of the centre of mass",
    "height_at_end": "the height is that of the link's end in place of the centre of mass",
    "height_relative_angle": "the height uses the joint's own angle in place of the sum of the angles up to it",
    "height_forgotten": "the link's potential energy is missing",
    "com_at_end": "the centre of mass is taken at the link's end, the full length in place of the half",
    "velocity_at_joint": "the velocity is that of the joint in place of the centre of mass: no parallel-axis term",
    "velocity_cross_term": "the square of the velocity lacks the cross term 2 v.(omega x r)",
    "velocity_relative_angle": "the velocity uses the joint's own angle in place of the sum of the angles up to it",
    "rotation_transposed": "the link's rotation is transposed where its centre of mass is placed",
    "omega_relative": "the angular velocity is that of the joint alone, without the joints before it",
    "inertia_doubled": "the link's inertia about its centre of mass counts twice",
    "inertia_about_joint": "the inertia about the joint is used as if it were about the centre of mass: Steiner twice",
    "inertia_about_com_at_joint": (
        "the inertia about the centre of mass is used as if it were about the joint: no parallel-axis term"
    ),
    "inertia_axes": "the inertia's moments are exchanged in turn: taken about the wrong axes",
    "half_forgotten": "the kinetic energy lacks its factor 1/2",
    "half_squared": "the kinetic energy has the factor 1/4 in place of 1/2",
    "translation_half_forgotten": "the energy of translation lacks its factor 1/2",
    "rotation_half_forgotten": "the energy of rotation lacks its factor 1/2",
    "rotor_forgotten": "the rotor's inertia is missing",
    "rotor_gear": "the rotor's inertia is multiplied by the gear ratio in place of its square",
    "gravity_axis": "gravity acts along the wrong axis: its components are exchanged in turn, x to y to z",
    "gravity_axis_back": "gravity acts along the wrong axis: its components are exchanged in turn, z to y to x",
    "potential_gradient_sign": "dV/dq has the wrong sign in Euler and Lagrange's equation",
    "mass_rate_omitted": "d/dt dK/dqd lacks dM/dt qd: M was taken for constant",
    "mass_rate_halved": "d/dt dK/dqd - dK/dq is replaced by half of dM/dt qd",
    "kinetic_gradient_omitted": "dK/dq is missing from Euler and Lagrange's equation",
    "kinetic_gradient_sign": "dK/dq has the wrong sign in Euler and Lagrange's equation",
    "christoffel_indices": (
        "the indices of the Christoffel symbols are exchanged: dM_jk/dq_i is added and dM_ij/dq_k taken off"
    ),
    "coriolis_missing": "products of two different rates are missing",
    "coriolis_halved": "products of two different rates have half their factor",
    "coriolis_doubled": "products of two different rates have twice their factor",
    "coriolis_sign": "products of two different rates have the wrong sign",
    "centrifugal_missing": "squares of rates are missing",
    "centrifugal_sign": "squares of rates have the wrong sign",
}
"""Places where a derivation goes wrong, by stable names, each with what is then the case; the more frequent first."""

VELOCITY_FACTORS = {
    "coriolis_missing": (False, Fraction(0)),
    "coriolis_halved": (False, HALF),
    "coriolis_doubled": (False, Fraction(2)),
    "coriolis_sign": (False, Fraction(-1)),
    "centrifugal_missing": (True, Fraction(0)),
    "centrifugal_sign": (True, Fraction(-1)),
}
"""Whether squares of rates are meant, and their factor."""

STEP_FACTORS = {
    "mass_rate_omitted": (Fraction(0), Fraction(1)),
    "mass_rate_halved": (HALF, Fraction(0)),
    "kinetic_gradient_omitted": (Fraction(1), Fraction(0)),
    "kinetic_gradient_sign": (Fraction(1), Fraction(-1)),
    "christoffel_indices": (Fraction(0), Fraction(-1)),
}
"""Factors of dM/dt qd and of dK/dq in Euler and Lagrange's equation."""

ROTOR_MISTAKES = frozenset(("rotor_forgotten", "rotor_gear"))

LINK_MISTAKES = frozenset(MISTAKES) - {*VELOCITY_FACTORS, *STEP_FACTORS, *ROTOR_MISTAKES, "potential_gradient_sign"}
"""Those that change a link's own energies."""


def has(mistakes: frozenset[str], mistake: str, i: int | None = None) -> bool:
    """Return whether a mistake is made, at link i (from 0) if one is given."""
    return mistake in mistakes or (i is not None and f"{mistake}@{i + 1}" in mistakes)


def check_mistake(mistake: object, n: int) -> None:
    """Refuse what is no mistake of :data:`MISTAKES`, or made at no link of an arm of n joints.

    Raises
    ------
    TypeError
        Not a name.
    ValueError
        No such mistake, or no such link.
    """
    if not isinstance(mistake, str):
        raise TypeError(f"mistake {mistake!r}: expected a name")
    name, at, link = mistake.partition("@")
    if name not in MISTAKES:
        raise ValueError(f"no mistake {name!r}; expected one of {', '.join(MISTAKES)}")
    if at and (not link.isdecimal() or not 1 <= int(link) <= n):
        raise ValueError(f"mistake {mistake!r}: no link {link!r}; expected 1 to {n}")
