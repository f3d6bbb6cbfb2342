"""Verdicts: proved, within rounding, undecided, wrong; energies, factorizations, follow-on errors, coordinates."""

import math

import numpy as np
import pytest

from acceptance import slow_if
from dhkit.arm import Arm
from dhkit.description import from_toml, library_robot, to_toml
from dhkit.errors import AnswerError, DescriptionError
from dhkit.grading import Rubric, Verdict, grade_answers, marks
from dhkit.grading.answers import Vocabulary, read_answer
from dhkit.grading.judging.numeric import doubles
from dhkit.grading.remarks import Note, NoteKind

ARM = Arm.load("planar2r")
M = [
    ["m1*l1^2/3 + m2*(l1^2 + l2^2/3 + l1*l2*c2)", "m2*(l2^2/3 + l1*l2*c2/2)"],
    ["m2*(l2^2/3 + l1*l2*c2/2)", "m2*l2^2/3"],
]
H = ["-m2*l1*l2*s2*(qd1*qd2 + qd2^2/2)", "m2*l1*l2*s2*qd1^2/2"]
G = ["m1*g*l1*c1/2 + m2*g*(l1*c1 + l2*c12/2)", "m2*g*l2*c12/2"]
K = f"(({M[0][0]})*qd1^2 + 2*({M[0][1]})*qd1*qd2 + ({M[1][1]})*qd2^2)/2"
V = "m1*g*l1*s1/2 + m2*g*(l1*s1 + l2*s12/2)"
TAU = [
    f"({M[0][0]})*qdd1 + ({M[0][1]})*qdd2 + {H[0]} + {G[0]}",
    f"({M[1][0]})*qdd1 + ({M[1][1]})*qdd2 + {H[1]} + {G[1]}",
]


def verdict(**answers):
    return ARM.grade(answers).verdict


def test_spongs_equations_are_proved():
    report = ARM.grade(M=M, h=H, g=G, K=K, V=V, tau=TAU, L=f"({K}) - ({V})")
    assert report.verdict is Verdict.CORRECT
    assert all(entry.statement.startswith("proved") for entry in report.entries)
    assert report.diagnosis == () and not report.error


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ("m2*l2^2/3", Verdict.CORRECT),
        ("0.3333*m2*l2^2", Verdict.ROUNDED),
        ("0.33333333*m2*l2^2", Verdict.ROUNDED),
        ("0.333*m2*l2^2", Verdict.WRONG),  # three digits
        ("0.3334*m2*l2^2", Verdict.WRONG),  # more than half a unit off
        ("0.3332*m2*l2^2", Verdict.WRONG),
        ("0.333300000*m2*l2^2", Verdict.WRONG),  # nine digits are a promise
        ("1.000000001*m2*l2^2/3", Verdict.WRONG),
        ("m2*l2^2/3 + 1e-9*m2*l2^2", Verdict.WRONG),
        ("m2*l2^2/3.0000", Verdict.CORRECT),
        ("m2*(0.57735*l2)^2", Verdict.ROUNDED),
        ("m2*(0.5773*l2)^2", Verdict.WRONG),  # 0.57735 is 0.5774 in four digits
        ("0.3333*m2*l2^2 + 0.0001", Verdict.WRONG),
        ("0.3333*m2*l2^2.0", Verdict.ROUNDED),
        ("(0.6667 - 0.3333)*m2*l2^2", Verdict.WRONG),  # 0.3334: cancellation grants nothing
        ("(0.6667 - 0.3335)*m2*l2^2", Verdict.WRONG),
    ],
)
def test_rounding_is_half_a_unit_of_the_last_digit(entry, expected):
    rows = [list(row) for row in M]
    rows[1][1] = entry
    report = ARM.grade(M=rows)
    assert report.of("M")[3].verdict is expected


def test_rounding_states_its_bound():
    rows = [list(row) for row in M]
    rows[1][1] = "0.3333*m2*l2^2"
    assert "at most 0.67 of half a unit" in ARM.grade(M=rows).of("M")[3].statement


def test_one_decimal_cannot_be_two_numbers():
    # 0.3333 may stand for 1/3 or for 0.33334, not for both in one answer.
    answer = "0.3333*(m1*l1^2 + m2*l2^2) + m2*(l1^2 + l1*l2*c2)"
    assert ARM.grade(M=[[answer, M[0][1]], M[1]]).of("M")[0].verdict is Verdict.ROUNDED
    answer = "0.33326*m2*l2^2 + 0.3333*m1*l1^2 + m2*(l1^2 + l1*l2*c2)"
    assert ARM.grade(M=[[answer, M[0][1]], M[1]]).of("M")[0].verdict is Verdict.WRONG


def test_rounding_is_never_inside_an_angle():
    assert verdict(V="m1*g*l1*cos(q1 - 1.5708)/2 + m2*g*(l1*s1 + l2*s12/2)") is Verdict.WRONG
    assert verdict(V="m1*g*l1*cos(q1 - pi/2)/2 + m2*g*(l1*s1 + l2*s12/2)") is Verdict.CORRECT


def test_numbers_in_place_of_parameters_are_the_files():
    report = ARM.grade(g=["2*9.81*0.25*c1 + 1.5*9.81*(0.5*c1 + 0.2*c12)", "1.5*9.81*0.2*c12"])
    assert report.verdict is Verdict.CORRECT
    assert any(note.kind is NoteKind.NUMBERS and "l2 = 0.4" in note.values for note in report.notes)
    assert (
        verdict(g=["2*9.81*0.25*c1 + 1.5*9.81*(0.5*c1 + 0.2*c12)", "1.5*9.81*0.3*c12"])
        is Verdict.WRONG
    )


def test_numbers_and_symbols_may_be_mixed_but_a_factor_of_one_is_no_number():
    rows = [list(row) for row in M]
    rows[1][1] = "m2*0.16/3"  # l2 is a symbol in the other entries
    report = ARM.grade(M=rows)
    assert report.verdict is Verdict.CORRECT
    assert report.notes == (Note(NoteKind.NUMBERS, "M", ("l2 = 0.4",)),)
    rows[1][1] = "m2*0.17/3"
    assert ARM.grade(M=rows).of("M")[3].verdict is Verdict.WRONG
    # mc is 1 kg: a torque without it has forgotten it.
    cart = Arm.load("cart_pendulum")
    tau = [
        "(mc + mp)*qdd1 + mp*l/2*(c2*qdd2 - s2*qd2^2)",
        "mp*l*c2/2*qdd1 + mp*l^2/3*qdd2 + mp*g*l*s2/2",
    ]
    assert cart.grade(tau=tau).verdict is Verdict.CORRECT
    assert (
        cart.grade(K="mc*qd1^2/2 + mp*qd1^2/2 + mp*l*c2*qd1*qd2/2 + mp*l^2*qd2^2/6").verdict
        is Verdict.CORRECT
    )


def test_energies_count_from_any_zero():
    assert verdict(V=f"{V} + 7*m1*g*l2") is Verdict.CORRECT
    assert verdict(V=f"{V} + c1^2 + s1^2") is Verdict.CORRECT
    assert verdict(V=f"{V} + q1") is Verdict.WRONG
    assert verdict(K=f"{K} + 1") is Verdict.WRONG


def test_a_lagrangian_may_differ_by_a_total_derivative_where_the_task_says_so():
    answer = {"L": f"({K}) - ({V}) + qd1*c1*c2 - qd2*s1*s2"}  # d/dt (s1 c2)
    assert ARM.grade(answer).verdict is Verdict.WRONG
    assert ARM.grade(answer, task={"total_derivative": True}).verdict is Verdict.CORRECT
    assert (
        ARM.grade({"L": f"({K}) - ({V}) + qd1*c2"}, task={"total_derivative": True}).verdict
        is Verdict.WRONG
    )


def test_any_factorization_of_coriolis_torques_is_right_and_named():
    a = "-m2*l1*l2*s2/2"
    christoffel = [[f"{a}*qd2", f"{a}*(qd1 + qd2)"], [f"-{a[1:]}*0 + m2*l1*l2*s2/2*qd1", "0"]]
    report = ARM.grade(C=christoffel)
    assert report.verdict is Verdict.CORRECT
    assert report.notes == (Note(NoteKind.CHRISTOFFEL, "C"),)
    report = ARM.grade(C=[[f"2*{a}*qd2", f"{a}*qd2"], ["m2*l1*l2*s2/2*qd1", "0"]])
    assert report.verdict is Verdict.CORRECT
    assert report.notes == (Note(NoteKind.NOT_SKEW, "C"),)
    assert verdict(C=[[f"{a}*qd2", f"{a}*qd2"], ["m2*l1*l2*s2/2*qd1", "0"]]) is Verdict.WRONG


def test_half_angles_are_undecided_or_refuted_with_a_state():
    half = "m2*g*l2/2*(2*cos((q1 + q2)/2)^2 - 1)"
    report = ARM.grade(g=[G[0], half])
    assert report.verdict is Verdict.UNDECIDED
    assert (
        "1000 random states" in report.entries[1].statement
        and "half" not in report.entries[0].statement
    )
    wrong = ARM.grade(g=[G[0], half.replace("1)", "1.000000001)")]).entries[1]
    assert wrong.verdict is Verdict.WRONG
    vocabulary = Vocabulary(ARM.description)
    answer = doubles(read_answer(wrong.answer, vocabulary), wrong.witness.state)
    assert answer == pytest.approx(wrong.witness.answer, rel=1e-12)
    right = doubles(read_answer(G[1], vocabulary), wrong.witness.state)
    assert right == pytest.approx(wrong.witness.truth, rel=1e-12) and right != pytest.approx(
        answer, rel=1e-10
    )


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        slow_if(True, "sqrt((m2*g*l2*c12/2)^2)*sign(c12)", Verdict.UNDECIDED),
        ("abs(m2*g*l2*c12/2)", Verdict.WRONG),
        ("m2*g*l2*c12/2*sqrt(c12)/sqrt(abs(c12))", Verdict.WRONG),  # no real value where c12 < 0
        slow_if(True, "m2*g*l2*c12/2 + max(0, -m2)", Verdict.UNDECIDED),
        ("m2*g*l2*c12/(2*(c1 - c1))", Verdict.UNREADABLE),
        slow_if(True, "m2*g*l2*c12*asin(sin(0.5))", Verdict.UNDECIDED),
        ("m2*g*l2*c12/(2*(q1 - q1))", Verdict.WRONG),
    ],
)
def test_what_the_ring_does_not_have_is_sampled(entry, expected):
    assert ARM.grade(g=[G[0], entry]).entries[1].verdict is expected


def test_a_witness_is_a_state_in_which_both_differ():
    entry = ARM.grade(g=[G[0], "m2*g*l2*c2/2"]).entries[1]
    assert entry.difference == "-m2*g*l2*(c12 - c2)/2"
    state = entry.witness.state
    assert set(state) == {"q1", "q2", "m2", "g", "l2"}
    weight = state["m2"] * state["g"] * state["l2"] / 2
    assert entry.witness.answer == pytest.approx(weight * math.cos(state["q2"]))
    assert entry.witness.truth == pytest.approx(weight * math.cos(state["q1"] + state["q2"]))


def test_errors_that_follow_from_earlier_ones_are_told_from_new_ones():
    wrong_V = "m1*g*l1*s1/2 + m2*g*(l1*s1 + l2*s2/2)"
    wrong_g = ["m1*g*l1*c1/2 + m2*g*l1*c1", "m2*g*l2*c2/2"]
    report = ARM.grade(V=wrong_V, g=wrong_g)
    assert report.of("V")[0].follows == ""
    assert [entry.follows for entry in report.of("g")] == ["V", "V"]
    fresh = ARM.grade(V=wrong_V, g=[wrong_g[0], "m2*g*l2*s2/2"])
    assert [entry.follows for entry in fresh.of("g")] == ["V", ""]


def test_parts_that_do_not_agree_are_told():
    notes = ARM.grade(V=V, g=[G[0], f"-({G[1]})"]).notes
    assert notes == (Note(NoteKind.DISAGREES, "g", ("V",)),)
    doubled = ARM.grade(V=f"2*({V})", g=[f"2*({x})" for x in G])
    assert Note(NoteKind.AGREES, "g", ("V",)) in doubled.notes


def test_transforms_follow_from_wrong_transforms():
    A1 = [["c1", "-s1", 0, "l1*c1"], ["s1", "c1", 0, "l1*s1"], [0, 0, 1, 0], [0, 0, 0, 1]]
    A2 = [["c2", "-s2", 0, "2*l2*c2"], ["s2", "c2", 0, "2*l2*s2"], [0, 0, 1, 0], [0, 0, 0, 1]]
    x, y = "l1*c1 + 2*l2*c12", "l1*s1 + 2*l2*s12"
    T = [["c12", "-s12", 0, x], ["s12", "c12", 0, y], [0, 0, 1, 0], [0, 0, 0, 1]]
    J = [[f"-({y})", "-2*l2*s12"], [x, "2*l2*c12"], [0, 0], [0, 0], [0, 0], [1, 1]]
    report = ARM.grade(A1=A1, A2=A2, T=T, J=J)
    assert {entry.follows for entry in report.of("T") if not entry.verdict.passes} == {"A2"}
    assert {entry.follows for entry in report.of("J") if not entry.verdict.passes} == {"T"}


def test_torques_of_wrong_parts_follow_from_them():
    doubled = [[f"2*({x})" for x in row] for row in M]
    tau = [
        f"2*({M[0][0]})*qdd1 + 2*({M[0][1]})*qdd2 + {H[0]} + {G[0]}",
        f"2*({M[1][0]})*qdd1 + 2*({M[1][1]})*qdd2 + {H[1]} + {G[1]}",
    ]
    report = ARM.grade(M=doubled, h=H, g=G, tau=tau)
    assert {entry.follows for entry in report.of("tau")} == {"M"}
    K2 = f"2*({K})"
    assert {entry.follows for entry in ARM.grade(K=K2, M=doubled).of("M")} == {"K"}
    assert {entry.follows for entry in ARM.grade(M=doubled, h=[f"2*({x})" for x in H]).of("h")} == {
        "M"
    }


def test_absolute_angles():
    # Two uniform rods by their angles from the horizontal, from K = sum m v^2/2 + I w^2/2 by hand.
    names = {"q": ["a", "b"], "angles": "absolute"}
    cross = "m2*l1*l2/2*cos(a - b)"
    report = ARM.grade(
        {
            "M": [["(m1/3 + m2)*l1^2", cross], [cross, "m2*l2^2/3"]],
            "h": ["m2*l1*l2/2*sin(a - b)*bdot^2", "-m2*l1*l2/2*sin(a - b)*adot^2"],
            "g": ["(m1/2 + m2)*g*l1*cos(a)", "m2*g*l2*cos(b)/2"],
            "C": [["0", "m2*l1*l2/2*sin(a-b)*bdot"], ["-m2*l1*l2/2*sin(a-b)*adot", "0"]],
            "V": "(m1/2 + m2)*g*l1*sin(a) + m2*g*l2*sin(b)/2",
        },
        names=names,
    )
    assert report.verdict is Verdict.CORRECT, str(report)
    wrong = ARM.grade({"g": ["(m1/2 + m2)*g*l1*cos(a)", "-m2*g*l2*cos(b)/2"]}, names=names)
    assert wrong.verdict is Verdict.WRONG


def test_viscous_friction_where_the_task_says_so():
    tau = [f"{TAU[0]} + 0.05*qd1", f"{TAU[1]} + 0.02*qd2"]
    assert ARM.grade({"tau": tau}, task={"friction": True}).verdict is Verdict.CORRECT
    assert ARM.grade(tau=tau).verdict is Verdict.WRONG
    report = ARM.grade({"tau": [x.replace("+ 0.0", "- 0.0") for x in tau]}, task={"friction": True})
    assert [found.mistake for found in report.diagnosis] == ["friction_sign"]
    assert (
        ARM.grade({"tau": TAU}, task={"friction": True}).diagnosis[0].mistake
        == "friction_forgotten"
    )


def test_two_mistakes_in_one_quantity_are_both_named():
    # Link 1's height at its joint, gravity's sign at link 2.
    report = ARM.grade(g=["-m2*g*(l1*c1 + l2*c12/2)", "-m2*g*l2*c12/2"])
    assert len(report.diagnosis) == 2
    assert {found.mistake for found in report.diagnosis} >= {"gravity_sign"}


def test_where_nothing_fits_the_terms_are_told():
    (found,) = ARM.grade(M=[[M[0][0] + " + m1*l1*l2 - m2*l1*s2", M[0][1]], M[1]]).diagnosis
    assert found.mistake is None
    assert found.sentence == "Too much: -m2*l1*s2, m1*l1*l2."


def test_slips_in_single_terms_are_named_with_the_term():
    (found,) = ARM.grade(M=[[M[0][0] + " + m1*l1*l2", M[0][1]], M[1]]).diagnosis
    assert found.mistake == "term_extra" and found.sentence == "There is a term too much: m1*l1*l2."
    (found,) = ARM.grade(g=["m1*g*l1*c1/2 + m2*g*l1*c1", G[1]]).diagnosis
    assert found.mistake == "term_missing"
    assert (
        found.sentence == "A term is missing: one with gravity, link 2."
        and found.second_hint == "m2*g*l2*c12/2"
    )
    assert found.hint == "Look again at the terms with gravity, link 2: is each there?"


def test_answers_of_other_kinds():
    sympy = pytest.importorskip("sympy")
    lag = ARM.lagrangian.sympy()
    assert ARM.grade(M=lag["M"], g=lag["g"], K=lag["K"]).verdict is Verdict.CORRECT
    assert ARM.grade(M=sympy.expand(2 * lag["M"])).verdict is Verdict.WRONG
    assert ARM.grade(M=ARM.casadi.mass_matrix, tau=ARM.casadi.inverse_dynamics).verdict in (
        Verdict.CORRECT,
        Verdict.ROUNDED,
    )
    report = ARM.grade(
        M=lambda q: ARM.mass_matrix(q), h=lambda q, qd: ARM.coriolis_matrix(q, qd) @ qd
    )
    assert report.verdict is Verdict.UNDECIDED
    wrong = ARM.grade(g=lambda q: -ARM.gravity_torque(q))
    assert wrong.verdict is Verdict.WRONG
    assert wrong.entries[0].witness.answer == pytest.approx(
        -wrong.entries[0].witness.truth, rel=1e-12
    )
    array = np.array([["m2*g*l2*c12/2"]])
    assert ARM.grade(g=[G[0], array[0, 0]]).verdict is Verdict.CORRECT


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        ({"Q": "1"}, "unknown quantity 'Q'"),
        ({"M": [["1", "2"]]}, r"answer: M: found a list of 1; expected a list of 2"),
        ({"M": "[1, 2; 3]"}, "M: found 2 rows of"),
        ({"g": "m1"}, "g: expected a matrix in brackets"),
        ({"g": [True, "1"]}, r"g\[0\]: found True"),
        ({"V": {"a": 1}}, "V: found dict|V: found a table"),
        ({}, "no answers"),
        ({"V": ""}, "every entry is empty"),
        ({"g": [lambda q: 1, "2"]}, r"g\[0\]"),
    ],
)
def test_what_cannot_be_judged_is_refused(answers, message):
    with pytest.raises(AnswerError, match=message):
        ARM.grade(answers)


def test_an_entry_that_cannot_be_read_leaves_the_others_judged():
    report = ARM.grade(g=["m1*gg*l1", G[1]], V=V)
    assert report.verdict is Verdict.UNREADABLE
    assert report.entries[0].statement.startswith("'m1*gg*l1': unknown name 'gg'")
    assert marks(report, Rubric()).points == 75
    assert [entry.verdict for entry in report.entries[1:]] == [Verdict.CORRECT, Verdict.CORRECT]


def test_a_quantity_that_cannot_be_read_leaves_the_others_judged():
    report = ARM.grade({"G": G, "V": V, "M": [["1"]]})
    assert [(entry.quantity, entry.verdict) for entry in report.entries] == [
        ("V", Verdict.CORRECT),
        ("G", Verdict.UNREADABLE),
        ("M", Verdict.UNREADABLE),
    ]
    assert "did you mean 'g'?" in report.entries[1].statement
    report = ARM.grade(
        {"V": V, "dh": {"rows": [["q1", "0", "l1", "0"]]}, "ik": {"branches": [["q2", "q1"]]}}
    )
    assert [(entry.quantity, entry.verdict.value) for entry in report.entries] == [
        ("V", "correct"),
        ("dh", "unreadable"),
        ("ik", "unreadable"),
    ]


def test_entries_that_stay_empty_make_a_sheet_incomplete():
    report = ARM.grade(M=[["", M[0][1]], [M[1][0], M[1][1]]])
    assert [entry.verdict for entry in report.entries] == [
        Verdict.INCOMPLETE,
        *[Verdict.CORRECT] * 3,
    ]
    assert report.verdict is Verdict.INCOMPLETE and report.missing == ("M11",) and not report


def test_own_numbers_are_those_of_the_shorthand_too():
    names = {"q": ["q0", "q1"]}
    g = ["(m1/2 + m2)*g*l1*c0 + m2*g*l2*c01/2", "m2*g*l2*cos(q0 + q1)/2"]
    assert ARM.grade({"g": g}, names=names).verdict is Verdict.CORRECT
    assert (
        ARM.grade({"g": [x.replace("c0", "c1") for x in g]}, names=names).verdict
        is not Verdict.CORRECT
    )
    h = ["-m2*l1*l2*s1*(q0dot*q1dot + q1dot^2/2)", "m2*l1*l2*s1*q0dot^2/2"]
    assert ARM.grade({"h": h}, names=names).verdict is Verdict.CORRECT


def test_roots_and_cosines_that_are_numbers_may_be_rounded():
    arm = Arm.from_dh([("30*deg", 0, 0.3, 0), (0, 0, 0.2, 0)])
    rows = [["0.8660*c1 - s1/2", "-s1*0.8660 - c1/2", 0, 0], [0] * 4, [0] * 4, [0] * 4]
    report = arm.grade(A1=rows)
    assert [entry.verdict for entry in report.entries[:2]] == [Verdict.ROUNDED, Verdict.ROUNDED]
    rows[0][0] = "0.8661*c1 - s1/2"
    assert arm.grade(A1=rows).entries[0].verdict is Verdict.WRONG


def test_parameters_that_the_truth_does_not_have_are_numbers():
    text = (
        to_toml(ARM.description)
        .replace("viscous = 0.05", 'viscous = "b"')
        .replace("[parameters]", "[parameters]\nb = 0.05")
    )
    arm = Arm(from_toml(text))
    assert arm.grade(V=f"{V} + 0*b").verdict is Verdict.CORRECT
    tau = [f"{TAU[0]} + b*qd1", f"{TAU[1]} + 0.02*qd2"]
    assert arm.grade({"tau": tau}, task={"friction": True}).verdict is Verdict.CORRECT


def test_the_motors_torques_are_no_generalised_forces_of_absolute_angles():
    names = {"q": ["a", "b"], "angles": "absolute"}
    motors = ["(m1/2 + m2)*g*l1*cos(a) + m2*g*l2*cos(b)/2", "m2*g*l2*cos(b)/2"]
    assert ARM.grade({"g": motors}, names=names).diagnosis[0].mistake == "motor_torques"


@pytest.mark.parametrize(
    ("answers", "mistake"),
    [
        ({"h": [f"-({x})" for x in H]}, "velocity_torques_sign"),
        ({"L": f"({K}) + ({V})"}, "lagrangian_sum"),
        ({"M": [[M[0][0], M[0][1]], [M[1][0], "0.33*m2*l2^2"]]}, "too_few_digits"),
        ({"K": "0"}, None),
    ],
)
def test_more_mistakes_are_named(answers, mistake):
    assert ARM.grade(answers).diagnosis[0].mistake == mistake or mistake is None


def test_a_robot_without_bodies_has_kinematics_only():
    arm = Arm.load("puma560_cao")
    bare = Arm.from_dh([(0, 0, 0.3, 0)])
    assert bare.grade(
        A1=[["c1", "-s1", 0, "0.3*c1"], ["s1", "c1", 0, "0.3*s1"], [0, 0, 1, 0], [0, 0, 0, 1]]
    )
    with pytest.raises(DescriptionError, match="no body"):
        bare.grade(M=[["1"]])
    assert arm.n == 6


def test_grading_the_truth_of_other_robots():
    for name in ("polar_rp", "cart_pendulum", "cobra600", "pan_tilt"):
        lag = Arm.load(name).lagrangian
        answers = {what: lag.sympy((what,))[what] for what in ("M", "h", "g", "V")}
        assert grade_answers(library_robot(name), answers).verdict is Verdict.CORRECT, name
