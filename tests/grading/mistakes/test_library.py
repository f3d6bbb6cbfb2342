"""The catalogue of mistakes: one sentence and one hint each, no identity twice, and each of them can be provoked."""

import pytest

from dhkit import Arm
from dhkit.grading import LIBRARY
from dhkit.grading.catalogue import INVERSE, JACOBIAN, TABLE, hint_of, sentence_of
from dhkit.grading.judging.truth import truth_of
from dhkit.grading.mistakes.diagnosis import variants_of
from dhkit.symbolic import Mistake, Subject
from dhkit.symbolic.mistakes import catalogue
from dhkit.symbolic.textbook_kinematics import KINEMATIC_MISTAKES
from grading_answers import ROBOTS, corpus_robot

ARM = Arm.load("planar2r")
POLAR = Arm.load("polar_rp")
M11, M12, M22 = (
    "(m1/3 + m2)*l1^2 + m2*l2^2/3 + m2*l1*l2*c2",
    "m2*l2^2/3 + m2*l1*l2*c2/2",
    "m2*l2^2/3",
)
G = ["m1*g*l1*c1/2 + m2*g*l1*c1 + m2*g*l2*c12/2", "m2*g*l2*c12/2"]
H = ["-m2*l1*l2*s2*qd1*qd2 - m2*l1*l2*s2*qd2^2/2", "m2*l1*l2*s2*qd1^2/2"]
SCALED = "(1000*m1*l1^2/3)*0"
SLIPS = {
    "term_missing": {"g": ["m1*g*l1*c1/2 + m2*g*l2*c12/2", G[1]]},
    "term_sign": {"g": ["m1*g*l1*c1/2 + m2*g*l1*c1 - m2*g*l2*c12/2", G[1]]},
    "term_factor": {"g": ["m1*g*l1*c1/2 + 3*m2*g*l1*c1 + m2*g*l2*c12/2", G[1]]},
    "term_extra": {"g": [G[0] + " + m1*g*l2*c2", G[1]]},
    "term_function": {"g": ["m1*g*l1*s1/2 + m2*g*l1*c1 + m2*g*l2*c12/2", G[1]]},
    "term_angle": {"g": ["m1*g*l1*c2/2 + m2*g*l1*c1 + m2*g*l2*c12/2", G[1]]},
    "term_rate": {"h": ["-m2*l1*l2*s2*qd1^2 - m2*l1*l2*s2*qd2^2/2", H[1]]},
    "centrifugal_index": {"h": ["-m2*l1*l2*s2*qd1*qd2 - m2*l1*l2*s2*qd1^2/2", H[1]]},
    "rates_missing": {"C": [["0", "-m2*l1*l2*s2/2"], ["m2*l1*l2*s2/2", "0"]]},
    "term_parameter": {"g": ["m1*g*l1*c1/2 + m2*g*l2*c1 + m2*g*l2*c12/2", G[1]]},
    "term_replaced": {"g": ["m1*g*l1*c1/2 + m2*g*l1*c1 + m2*qd1*l2*c12/2", G[1]]},
    "exponent_dropped": {"M": [["m1*l1/3 + m2*l1^2 + m2*l2^2/3 + m2*l1*l2*c2", M12], [M12, M22]]},
    "square_of_sum": {
        "K": "m1*l1^2*qd1^2/6 + m2*(l1^2*qd1^2 + l2^2*qd1^2/3 + l2^2*qd2^2/3 + l1*l2*c2*qd1*(qd1 + qd2))/2 + "
        "m2*l2^2*qd1*qd2*0"
    },
    "entry_sign": {"g": [G[0], f"-({G[1]})"]},
    "entry_halved": {"M": [[M11, M12], [M12, "m2*l2^2/6"]], "g": G},
    "entry_doubled": {"h": [H[0], f"2*({H[1]})"]},
    "entry_zero": {"g": [G[0], "0"]},
    "factor_missing": {"g": ["m1*l1*c1/2 + m2*g*l1*c1 + m2*g*l2*c12/2", G[1]]},
    "factor_extra": {"g": ["m1*g*l1*l2*c1/2 + m2*g*l1*c1 + m2*g*l2*c12/2", G[1]]},
    "too_few_digits": {"M": [[M11, M12], [M12, "0.33*m2*l2^2"]]},
    "mass_matrix_not_symmetric": {"M": [[M11, M12], ["m2*l2^2/3 + m2*l1*l2*c1", M22]]},
    "degrees_for_radians": {
        "g": [
            G[0].replace("c12", "cosd(q1 + q2)").replace("c1", "cosd(q1)"),
            "m2*g*l2*cosd(q1 + q2)/2",
        ]
    },
    "weight_on_vertical_axis": None,
    "duplicate_branch": None,
}
"""Answers with one slip; those without a table are made below."""


def test_the_catalogue_refuses_one_identity_twice():
    mistake = Mistake("a", Subject.ENERGY, "b", "c")
    with pytest.raises(ValueError, match="two mistakes are called 'a'"):
        catalogue([mistake], [mistake])


def test_each_mistake_has_a_sentence_and_a_hint_of_its_own_subject():
    assert all(identity == mistake.identity for identity, mistake in LIBRARY.items())
    sentences = [mistake.sentence for mistake in LIBRARY.values()]
    assert len(set(sentences)) == len(sentences)
    subjects: dict[str, Subject] = {}
    for mistake in LIBRARY.values():
        assert mistake.hint.startswith("Look again") and mistake.sentence[-1] not in ".!"
        # A hint belongs to one subject: it must not send a student from the table to the energies.
        assert subjects.setdefault(mistake.hint, mistake.subject) is mistake.subject, mistake
        assert (
            sentence_of(mistake.identity).endswith((".", "?"))
            and hint_of(mistake.identity) == mistake.hint
        )


def test_every_mistake_can_be_provoked():
    """By a variant on a robot of the corpus, by a slip below, or by the tests of tables and of inverse kinematics."""
    tables = [variants_of(truth_of(corpus_robot(robot)), frozenset()) for robot in ROBOTS]
    made = {variant.identity for variants in tables for variant in variants.dynamic}
    # Tests/grading/test_findings.py.
    friction = {
        "friction_forgotten",
        "friction_sign",
        "friction_gear",
    }
    absolute = {"relative_for_absolute", "motor_torques"}
    tests = {*KINEMATIC_MISTAKES, *JACOBIAN, *TABLE, *INVERSE, *SLIPS, *friction, *absolute}
    bodies = {
        "payload_forgotten",
        "payload_not_moved",
        "payload_at_com",
        "gear_inverted",
        "sphere_for_rod",
        "parameter_sin_cos",
    }
    assert set(LIBRARY) - made - tests - bodies == set()


@pytest.mark.parametrize("mistake", [name for name, answers in SLIPS.items() if answers])
def test_slips_are_named(mistake):
    report = ARM.grade(SLIPS[mistake])
    found = {one.mistake for one in report.diagnosis}
    alike = {name.partition(" (")[0] for one in report.diagnosis for name in one.equivalent}
    assert mistake in found | alike, str(report)
    assert all(
        entry.verdict.value == "wrong"
        for entry in report.entries
        if entry.name in report.diagnosis[0].entries
    )


def test_a_weight_on_a_vertical_axis():
    arm = Arm.load("pan_tilt")
    right = arm.lagrangian.g[1]
    report = arm.grade(g=["0.5*9.81*cos(q1)", str(right)])
    assert [one.mistake for one in report.diagnosis] == ["weight_on_vertical_axis"], str(report)


@pytest.mark.parametrize(
    ("declared", "mistake"),
    [("absolute", "relative_for_absolute"), ("relative", "absolute_for_relative")],
)
def test_angles_that_are_declared_wrongly(declared, mistake):
    relative = [[M11, M12], [M12, M22]]
    absolute = [
        ["(m1/3 + m2)*l1^2", "m2*l1*l2*cos(q2 - q1)/2"],
        ["m2*l1*l2*cos(q2 - q1)/2", "m2*l2^2/3"],
    ]
    answer = relative if declared == "absolute" else absolute
    report = ARM.grade(M=answer, names={"angles": declared})
    assert mistake in {one.mistake for one in report.diagnosis}, str(report)
