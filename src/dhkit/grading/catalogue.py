"""Library of mistakes: identity, sentence and hint of every mistake that a report can name."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from dhkit.symbolic.mistakes import MISTAKES, Mistake, Subject, catalogue
from dhkit.symbolic.textbook_kinematics import KINEMATIC_MISTAKES, ROW

_UNNAMED_HINT = "Look again at the entries that are marked as wrong."
"""Hint of a diagnosis that names no mistake."""
PARAMETER_FACTORS = {
    "parameter_halved": Fraction(1, 2),
    "parameter_doubled": Fraction(2),
    "parameter_forgotten": Fraction(0),
    "parameter_sign": Fraction(-1),
}
"""Factor, by mistake, by which a parameter of the robot is multiplied."""
UNITS = {
    "millimetres_for_metres": Fraction(1000),
    "centimetres_for_metres": Fraction(100),
    "inches_for_metres": Fraction(10000, 254),
}
"""Factor, by mistake, by which a length in m is multiplied."""
FACTORS = {
    "entry_sign": Fraction(-1),
    "entry_halved": Fraction(1, 2),
    "entry_doubled": Fraction(2),
    "entry_zero": Fraction(0),
}
"""Factor, by mistake, by which a whole entry is multiplied."""


def _catalogue(groups: Mapping[tuple[Subject, str], Mapping[str, str]]) -> dict[str, Mistake]:
    """Return mistakes by identity, of tables that hold, by subject and hint, sentences by identity."""
    mistakes = []
    for (subject, hint), sentences in groups.items():
        mistakes += [
            Mistake(identity, subject, sentence, hint) for identity, sentence in sentences.items()
        ]
    return catalogue(mistakes)


_WRITING = _catalogue(
    {
        (Subject.WRITING, "Look again at the units."): {
            "degrees_for_radians": "angles in degrees are used as if they were in radians",
            "millimetres_for_metres": "lengths in millimetres are used as if they were in metres",
            "centimetres_for_metres": "lengths in centimetres are used as if they were in metres",
            "inches_for_metres": "lengths in inches are used as if they were in metres",
        },
        (Subject.WRITING, "Look again at how many digits are asked for."): {
            "too_few_digits": "the decimals have too few digits: four or more are asked for",
        },
        (Subject.WRITING, "Look again at this entry's factor and sign."): {
            "entry_sign": "the whole entry has the wrong sign",
            "entry_halved": "the whole entry is half of what it should be",
            "entry_doubled": "the whole entry is twice what it should be",
            "entry_zero": "the entry is zero, and should not be",
        },
    }
)

TABLE = _catalogue(
    {
        (
            Subject.TABLE,
            "Look again at the convention: which link do the a and alpha of a row belong to?",
        ): {
            "other_convention": "this is the arm's table in the other convention: rows hold a and alpha of another "
            "link",
        },
        (Subject.TABLE, ROW): {
            "rows_exchanged": "two rows are exchanged",
            "variable_column": "the joint's variable stands in the wrong column: a revolute joint's adds to theta, a "
            "prismatic joint's to d",
            "variable_of_another_joint": "the variable is that of another joint",
            "length_sign": "a length has the wrong sign",
            "wrong_length": "a length is wrong",
            "wrong_theta": "theta is wrong",
            "wrong_twist": "the twist alpha is wrong",
        },
        (Subject.TABLE, "Look again at which frames and which zero pose the task gives."): {
            "other_frames": "the table describes the same arm, in other frames",
        },
    }
)

JACOBIAN = _catalogue(
    {
        (Subject.JACOBIAN, "Look again at the derivatives: d/dq cos(q) = -sin(q)."): {
            "derivative_of_cosine": "the derivative of a cosine lacks its minus sign",
        },
        (
            Subject.JACOBIAN,
            "Look again at the order of the columns: which joint does each belong to?",
        ): {
            "columns_exchanged": "two columns are exchanged: column i is the velocity per rate of joint i",
        },
    }
)

INVERSE = _catalogue(
    {
        (Subject.INVERSE, "Look again at this joint: in which quadrant is the angle?"): {
            "atan2_arguments": "the arguments of atan2 are exchanged: it is atan2(y, x)",
            "quadrant": "the angle is in the wrong quadrant for some poses: atan, asin and acos know only half a turn,"
            " atan2 knows all of it",
            "sign_lost": "the sign is wrong for some poses: acos and sqrt know only one",
            "divisor_sign_lost": "the angle is off by half a turn for some poses: both arguments of atan2 were divided "
            "by a factor, such as a sine, that may be negative",
        },
        (Subject.INVERSE, "Look again at this branch: which sign belongs to it?"): {
            "elbow_sign": "a root or an arc cosine has the wrong sign: it belongs to another branch",
            "joint_sign": "the joint value has the wrong sign",
            "duplicate_branch": "the branch gives the same solutions as another",
        },
        (Subject.INVERSE, "Look again at where this angle or length is counted from."): {
            "missing_offset": "the joint value is off by a constant: it is counted from another zero than in the table",
            "angle_zero": "an angle is off by a quarter or half turn: the table counts it from another zero",
            "supplement": "the angle inside the triangle of the links stands where the joint's belongs: the two add up "
            "to 180 degrees",
            "earlier_joints_forgotten": "the angles of the joints before are not subtracted: the sum of the angles is "
            "given",
            "sum_of_angles_forgotten": "a joint's own angle stands where the sum of angles about parallel axes belongs",
            "sum_of_angles_too_much": "a sum of angles about parallel axes stands where one joint's own angle belongs",
            "offset_forgotten": "a constant length of base or table is not taken off a component of the position",
            "triangle_angle_forgotten": "the angle in the triangle of two links is not taken off: the direction to the"
            " end of the second is given instead of the first link's",
            "tool_length_forgotten": "the length beyond the last joint, of the last link or of the tool, is not taken"
            " off the position: the triangle ends at the last joint",
            "shoulder_offset_forgotten": "the shoulder's offset is missing: the point does not lie in the plane through"
            " axis 1, but beside it",
            "tool_not_taken_off": "the tool is not taken off: the formula is right for the last frame, T tool^-1",
            "base_not_taken_off": "the base is not taken off: the formula is right for the tool in frame 0, base^-1 T",
            "base_and_tool_not_taken_off": "base and tool are not taken off: the formula is right for A_1 ... A_n",
            "tool_length_added": "the length beyond the last joint, of the last link or of the tool, is added to the"
            " position: it is to be taken off",
            "length_forgotten": "a length of the arm is missing",
            "length_taken_as_zero": "the formula is right for an arm in which a length is zero",
            "rounded_length": "a length is rounded: the formula needs all of its digits, or its name",
        },
        (
            Subject.INVERSE,
            "Look again at this step: put the pose of one configuration into both sides, and compare.",
        ): {
            "equation_wrong": "the equation is not an identity of the arm; no single mistake explains it",
            "solution_wrong": "the solution is wrong given the joints before; no single mistake explains it",
        },
        (
            Subject.INVERSE,
            "Look again at the triangle of the links: what does the law of cosines say?",
        ): {
            "cosine_law_factor": "the law of cosines lacks its factor 2: c^2 = a^2 + b^2 - 2 a b cos(C)",
            "cosine_law_sign": "a square in the law of cosines has the wrong sign",
            "cosine_law_squares": "lengths in the law of cosines are not squared",
        },
        (
            Subject.INVERSE,
            "Look again at squares and roots: which length, and which function of the angle, does the formula give?",
        ): {
            "root_forgotten": "a root is missing: the square of a length stands where the length belongs",
            "square_forgotten": "a square is missing: a length or a cosine stands where its square belongs",
            "square_too_much": "the square of a length stands where the length belongs",
            "root_too_much": "a root is taken where its square belongs",
            "arc_function_forgotten": "the sine, cosine or tangent of the angle is given instead of the angle",
        },
        (
            Subject.INVERSE,
            "Look again at which component of the pose and which length stand where.",
        ): {
            "axis_exchanged": "another component of the pose stands where this one belongs",
            "lengths_exchanged": "two lengths are exchanged",
        },
        (
            Subject.INVERSE,
            "Look again at the tool's rotation: rows are the base's axes, columns the tool's.",
        ): {
            "rotation_matrix_transposed": "the rotation matrix is transposed: r_ij stands where r_ji belongs",
            "tool_axis_exchanged": "another axis of the tool is taken: column j of the rotation is its j-th axis",
            "rotation_not_reduced": "the tool's rotation in the base stands where its rotation in the frame after the "
            "joints before belongs: R_36 = R_03^T R_06 for the wrist of six joints",
        },
    }
)

_EQUATION = _catalogue(
    {
        (
            Subject.ENERGY,
            "Look again at the inertia: of which body is this the formula, and about which point?",
        ): {
            "inertia_halved": "the link's inertia about its centre of mass counts by half",
            "disc_for_rod": "the inertia is that of a disc, m r^2/2, instead of a rod's, m l^2/12",
            "point_mass_for_rod": "the inertia is that of a point mass, m l^2, instead of a rod's",
            "rod_about_end": "the inertia is that of a rod about its end, m l^2/3, instead of about its centre, m "
            "l^2/12",
            "sphere_for_rod": "the inertia is that of a sphere, 2 m r^2/5, instead of a rod's, m l^2/12",
            "inertia_quarter_for_rod": "the inertia is m l^2/4 instead of a rod's m l^2/12",
            "rod_with_half_length": "the inertia is that of a rod of half the length, m l^2/48, instead of m l^2/12",
            "inertia_moments_exchanged": "two principal moments of the inertia are exchanged",
        },
        (Subject.ENERGY, "Look again at the heights: from which axis does each angle count?"): {
            "height_sin_cos": "sine and cosine are exchanged in the heights",
        },
        (
            Subject.EQUATION,
            "Look again at the bodies that a link is made of: is each there, and where is its centre of mass?",
        ): {
            "payload_forgotten": "the payload is missing",
            "payload_not_moved": "the payload is missing in the kinetic energy",
            "payload_at_com": "the payload is placed at the link's centre of mass",
        },
        (
            Subject.ENERGY,
            "Look again at the drives: which rotor and which gear belong to which joint?",
        ): {
            "drives_exchanged": "two drives are exchanged: each rotor has the other's gear and inertia",
            "gear_inverted": "the rotor's inertia is divided by the gear ratio's square instead of multiplied",
        },
        (
            Subject.ENERGY,
            "Look again at the table of the dynamics: convention, twists and lengths.",
        ): {
            "convention_in_dynamics": "the table is read in the other convention: a and alpha belong to another link",
            "offset_in_dynamics": "the table's constant offset is missing: the joint's value counts from another zero",
            "twist_sign_in_dynamics": "a twist alpha has the wrong sign in the positions of the links",
        },
        (
            Subject.ENERGY,
            "Look again at the constant angle of the base or of a link, and at its sine and cosine.",
        ): {
            "parameter_sin_cos": "sine and cosine of a constant angle are exchanged",
        },
        (Subject.ENERGY, "Look again at the squares in the kinetic energy."): {
            "square_of_sum": "the square of a sum lacks its mixed term: (a + b)^2 = a^2 + 2 a b + b^2",
            "exponent_dropped": "the exponent is missing: x stands where x^2 belongs",
            "slide_forgotten": "the variable of a prismatic joint is missing in the position of a link",
        },
        (Subject.EQUATION, "Look again at the formulas for sines and cosines of sums."): {
            "sum_of_angles_split": "sines and cosines of a sum of angles are split up: cos(a + b) is not cos(a) + "
            "cos(b)",
            "sum_formula_sign": "a sum formula is wrong: cos(a + b) = cos(a) cos(b) - sin(a) sin(b), sin(a + b) = "
            "sin(a) cos(b) + cos(a) sin(b)",
            "angle_difference": "the difference of two angles stands where their sum belongs",
        },
        (Subject.EQUATION, "Look again at the time derivatives: d/dt cos(q) = -sin(q) dq/dt."): {
            "rate_of_cosine_sign": "d/dt of M has the wrong sign: the derivative of a cosine is minus the sine",
            "chain_rule_forgotten": "d/dt of M lacks the chain rule: d/dt f(q) is df/dq times q's rate",
        },
        (
            Subject.EQUATION,
            "Look again at whether each joint's angle counts from the link before or from a fixed direction.",
        ): {
            "gravity_torque_relative_angle": "the gravity torques use the joint's own angle instead of the sum of the"
            " angles up to it",
            "relative_for_absolute": "the answer is one for angles from the link before, and was declared absolute",
            "absolute_for_relative": "the answer is one for angles from a fixed direction, and was handed in as "
            "relative",
            "motor_torques": "these are the motors' torques; generalised forces of absolute angles are others, S^-T "
            "tau for y = S q",
        },
        (
            Subject.EQUATION,
            "Look again at where each joint's angle is zero, and from which axis it counts.",
        ): {
            "zero_shifted": "the zero pose is a quarter turn off: -sin(q) stands for cos(q), and cos(q) for sin(q)",
            "zero_shifted_back": "the zero pose is a quarter turn off: sin(q) stands for cos(q), and -cos(q) for "
            "sin(q)",
        },
        (Subject.EQUATION, "Look again at the indices and at which parameter stands where."): {
            "coriolis_transposed": "C is transposed: C_ij belongs to torque i and rate j",
            "equations_exchanged": "rows are exchanged: one joint's equation stands in another's place",
            "centrifugal_index": "the squares of rates have the wrong index: one joint's rate stands for another's",
            "parameter_forgotten": "a parameter is missing, as if it were zero",
            "parameter_halved": "a parameter counts by half",
            "parameter_doubled": "a parameter counts twice",
            "parameter_sign": "a parameter has the wrong sign",
            "parameter_for_another": "one parameter stands where another belongs",
            "parameters_exchanged": "two parameters are exchanged",
            "links_exchanged": "two links are exchanged: each has the other's parameters",
            "mass_matrix_not_symmetric": "M is symmetric, and this entry is not its mirror image",
        },
        (
            Subject.EQUATION,
            "Look again at friction: which way does it act, and on which side of the gear is it measured?",
        ): {
            "friction_forgotten": "viscous friction is missing",
            "friction_sign": "viscous friction has the wrong sign: it is part of what the drives have to give",
            "friction_gear": "viscous friction lacks a gear ratio: on the joint's side it is the motor's times its "
            "square",
        },
        (
            Subject.EQUATION,
            "Look again at the signs: the Lagrangian is K - V, and torques are d/dt dL/dqd - dL/dq.",
        ): {
            "velocity_torques_sign": "the terms with products of rates have the wrong sign",
            "lagrangian_sum": "the energies are added: the Lagrangian is K - V",
            "gravity_torque_sign": "the gravity torques have the wrong sign",
        },
        (Subject.EQUATION, "Look again at which way gravity acts on this joint."): {
            "weight_on_vertical_axis": "a gravity torque stands at a joint that gravity does not turn or push",
        },
        (Subject.EQUATION, "Look again at the terms one by one."): {
            "inertial_torques_missing": "the terms with accelerations are missing",
            "velocity_torques_missing": "all terms with products of rates are missing",
            "rates_missing": "the rates are missing: an entry of C is of the first degree in them, of h of the second",
            "gravity_torques_missing": "the terms of gravity are missing",
            "term_missing": "a term is missing",
            "term_sign": "a term has the wrong sign",
            "term_factor": "a term has the wrong factor",
            "term_extra": "there is a term too much",
            "factor_missing": "a term lacks a factor",
            "factor_extra": "a term has a factor too much",
            "term_function": "sine and cosine are exchanged in a term",
            "term_angle": "a term has the wrong angle",
            "term_rate": "a term has another rate or acceleration than it should",
            "term_parameter": "a term has another parameter than it should",
            "term_replaced": "one term stands instead of another",
        },
    }
)

LIBRARY: Mapping[str, Mistake] = catalogue(
    INVERSE.values(),
    JACOBIAN.values(),
    TABLE.values(),
    KINEMATIC_MISTAKES.values(),
    MISTAKES.values(),
    _EQUATION.values(),
    _WRITING.values(),
)
"""All mistakes by identity, in the order in which the command line lists them."""


def capitalize(sentence: str) -> str:
    """Return a sentence with a capital first letter, unless it begins with a symbol: l1, dK/dq, a and d."""
    first, _, rest = sentence.partition(" ")
    is_word = first.rstrip(":").isalpha() and (
        len(first) > 2 or (first == "a" and not rest.startswith("and d "))
    )
    return sentence[0].upper() + sentence[1:] if is_word else sentence


def sentence_of(identity: str, where: str = "", detail: str = "") -> str:
    """Return the sentence that a report prints for a mistake.

    Parameters
    ----------
    identity
        Identity of the mistake in :data:`LIBRARY`.
    where
        Link, joint or parameters at which the mistake was made; empty if it concerns no particular one.
    detail
        Term or entry in which the mistake shows; empty if none is named.
    """
    sentence = LIBRARY[identity].sentence
    text = f"{where}: {sentence}" if where else sentence
    text = f"{text.rstrip('?')}: {detail}" if detail else text
    text = text if text.endswith("?") else f"{text}."
    is_parameter = bool(where) and " " not in where  # the name of a parameter keeps its case
    return text if is_parameter else capitalize(text)


def hint_of(identity: str | None) -> str:
    """Return the hint of a mistake: the place to look at, not the error; for None a general hint."""
    return LIBRARY[identity].hint if identity else _UNNAMED_HINT
