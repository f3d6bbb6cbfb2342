"""The library of mistakes: stable names, what a student learns from each, and where to look."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from dhkit.grading.capitals import capitalised
from dhkit.grading.judging.inverse import INVERSE_MISTAKES
from dhkit.grading.judging.tables import TABLE_MISTAKES
from dhkit.symbolic.mistakes import MISTAKES
from dhkit.symbolic.textbook_kinematics import KINEMATIC_MISTAKES

__all__ = ["LIBRARY", "PARAMETER_MISTAKES", "hint_of", "of_links", "sentence_of"]

PARAMETER_MISTAKES = {
    "parameter_forgotten": Fraction(0),
    "parameter_halved": Fraction(1, 2),
    "parameter_doubled": Fraction(2),
    "parameter_sign": Fraction(-1),
}
"""What a parameter is multiplied by."""

OTHER_MISTAKES: Mapping[str, str] = {
    "gravity_torque_relative_angle": (
        "the gravity torques use the joint's own angle in place of the sum of the angles up to it"
    ),
    "zero_shifted": "the zero pose is a quarter turn off: the joint's sine stands for its cosine, with a sign",
    "zero_shifted_back": "the zero pose is a quarter turn off, the other way: cosine for sine, with a sign",
    "coriolis_transposed": "C is transposed: C_ij belongs to torque i and rate j",
    "equations_exchanged": "rows are exchanged: one joint's equation stands in another's place",
    "centrifugal_index": "the squares of rates have the wrong index: one joint's rate stands for another's",
    "parameter_forgotten": "a parameter is missing, as if it were zero",
    "parameter_halved": "a parameter counts by half: was a full length meant, or half of it?",
    "parameter_doubled": "a parameter counts twice: was half a length meant, or the full one?",
    "parameter_sign": "a parameter has the wrong sign",
    "parameter_for_another": "one parameter stands where another belongs",
    "parameters_exchanged": "two parameters are exchanged",
    "links_exchanged": "two links are exchanged: each has the other's parameters",
    "friction_forgotten": "friction is missing from the joint torques",
    "friction_sign": "friction has the wrong sign: it must be overcome, so it adds to the torque of the motion",
    "degrees_for_radians": "degrees are used where radians belong: sine and cosine take radians",
    "mass_matrix_not_symmetric": "M is symmetric, and its mirrored entry is right",
    "velocity_torques_sign": "all Coriolis and centrifugal torques have the wrong sign",
    "lagrangian_sum": "L is K + V; the Lagrangian is K - V",
    "motor_torques": (
        "these are the motors' torques; generalised forces of absolute angles are others, S^-T tau for y = S q"
    ),
    "too_few_digits": "the decimals have too few digits: four or more are asked for",
    "entry_sign": "the whole entry has the wrong sign",
    "entry_halved": "the whole entry is half of what it should be",
    "entry_doubled": "the whole entry is twice what it should be",
}

LIBRARY: Mapping[str, str] = {
    **INVERSE_MISTAKES,
    **TABLE_MISTAKES,
    **KINEMATIC_MISTAKES,
    **MISTAKES,
    **OTHER_MISTAKES,
    "other_frames": "the table describes the same arm, in other frames",
}
"""Mistakes by stable name, each with what is then the case."""

_HINTS = (
    (
        ("gravity", "height", "potential"),
        "Look again at the potential energy: which way does it grow, and of which point?",
    ),
    (("velocity", "com", "steiner"), "Look again at the velocity of the centre of mass."),
    (("omega",), "Look again at the angular velocity: which joints turn this link?"),
    (("inertia",), "Look again at the inertia: about which point, and about which axes?"),
    (("half", "translation", "rotation_half"), "Look again at the factors in the kinetic energy."),
    (("rotor",), "Look again at the drives' inertia."),
    (
        ("mass_rate", "kinetic_gradient", "christoffel", "coriolis", "centrifugal"),
        "Look again at the terms with rates.",
    ),
    (("equations", "links", "parameter"), "Look again at the indices and at which parameter stands where."),
    (("friction",), "Look again at friction."),
    (("degrees",), "Look again at the units of angles."),
    (("zero",), "Look again at where each joint's angle is zero."),
    (("mass",), "Look again at the masses."),
    (("entry",), "Look again at this entry's factor and sign."),
)


def of_links() -> list[str]:
    """Return the mistakes of the textbook's derivation, in the order in which they are tried."""
    return list(MISTAKES)


def sentence_of(name: str, where: str = "") -> str:
    """Return what a student learns from a mistake, with the link or the parameters that it concerns."""
    sentence = LIBRARY[name.partition("@")[0]]
    text = f"{where}: {sentence}" if where else sentence
    return capitalised(text if text.endswith("?") else f"{text}.")


def hint_of(name: str | None) -> str:
    """Return where to look, without saying what is wrong."""
    for beginnings, hint in _HINTS:
        if name and name.startswith(beginnings):
            return hint
    return "Look again at the entries that are marked as wrong."
