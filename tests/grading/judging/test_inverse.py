"""Judging inverse kinematics: right branches close, and wrong ones say where and why."""

import re
import time
from itertools import product

import numpy as np
import pytest

import acceptance
from acceptance import slow_if
from dhkit.description import from_dh, library_robot, pose, with_base, with_tool, world_to_tool
from dhkit.errors import AnswerError
from dhkit.expressions import read
from dhkit.grading.catalogue import LIBRARY
from dhkit.grading.grade_report import Verdict
from dhkit.grading.judging.inverse import CLOSES, POSE_NAMES, Closure, judge_inverse
from dhkit.grading.judging.numeric import doubles
from dhkit.grading.remarks import Note, NoteKind

CORRECT, WRONG = Verdict.CORRECT, Verdict.WRONG


def planar2r(sign):
    c2 = "((px^2 + py^2 - l1^2 - l2^2)/(2*l1*l2))"
    s2 = f"({sign}sqrt(1 - {c2}^2))"
    return [f"atan2(py, px) - atan2(l2*{s2}, l1 + l2*{c2})", f"atan2({s2}, {c2})"]


def planar3r(sign):
    x, y = "(px - l3*r11)", "(py - l3*r21)"
    c2 = f"(({x}^2 + {y}^2 - l1^2 - l2^2)/(2*l1*l2))"
    s2 = f"({sign}sqrt(1 - {c2}^2))"
    first = f"atan2({y}, {x}) - atan2(l2*{s2}, l1 + l2*{c2})"
    return [first, f"{sign}acos({c2})", "atan2(r21, r11) - q1 - q2"]


def polar_rp(sign):
    return [f"atan2({sign}py, {sign}px)", f"{sign}sqrt(px^2 + py^2)"]


def pan_tilt(sign):
    return [f"atan2({sign}py, {sign}px)", f"atan2(pz - 0.08, {sign}sqrt(px^2 + py^2))"]


def cobra600(sign):
    c2 = "((px^2 + py^2 - 0.325^2 - 0.275^2)/(2*0.325*0.275))"
    s2 = f"({sign}sqrt(1 - {c2}^2))"
    first = f"atan2(py, px) - atan2(0.275*{s2}, 0.325 + 0.275*{c2})"
    return [first, f"atan2({s2}, {c2})", "0.387 - pz", "q1 + q2 - atan2(r21, r11)"]


def puma560_cao(shoulder, elbow, wrist):
    """Wrist centre, arm in the plane turned by q1, wrist as Euler angles ZYZ of frame 6 in frame 3."""
    d2, a2, d4, d6 = "(-0.17145)", "(-0.416306)", "0.497332", "0.05588"
    x, y, z = (f"({p} - {d6}*{r})" for p, r in (("px", "r13"), ("py", "r23"), ("pz", "r33")))
    first = f"atan2({y}, {x}) - atan2({d2}, {shoulder}sqrt({x}^2 + {y}^2 - {d2}^2))"
    u, v = f"(cos(q1)*{x} + sin(q1)*{y})", f"(-{z})"
    s3 = f"(({u}^2 + {v}^2 - {a2}^2 - {d4}^2)/(2*{a2}*{d4}))"
    c3 = f"({elbow}sqrt(1 - {s3}^2))"
    second = f"atan2({v}, {u}) - atan2(-{d4}*{c3}, {a2} + {d4}*{s3})"
    third = f"atan2({s3}, {c3})"
    c, s = "cos(q2 + q3)", "sin(q2 + q3)"

    def along_z3(k):
        return f"({s}*(cos(q1)*r1{k} + sin(q1)*r2{k}) + {c}*r3{k})"

    x3 = f"({c}*(cos(q1)*r13 + sin(q1)*r23) - {s}*r33)"
    y3 = "(cos(q1)*r23 - sin(q1)*r13)"
    fourth = f"atan2({wrist}{y3}, {wrist}{x3})"
    fifth = f"atan2(cos(q4)*{x3} + sin(q4)*{y3}, {along_z3(3)})"
    sixth = f"atan2({wrist}{along_z3(2)}, {wrist}(-{along_z3(1)}))"
    return [first, second, third, fourth, fifth, sixth]


ARMS = {
    "planar2r": [planar2r("+"), planar2r("-")],
    "planar3r": [planar3r("+"), planar3r("-")],
    "polar_rp": [polar_rp("+"), polar_rp("-")],
    "pan_tilt": [pan_tilt("+"), pan_tilt("-")],
    "cobra600": [cobra600("+"), cobra600("-")],
    "puma560_cao": [puma560_cao(*signs) for signs in product("+-", repeat=3)],
}


def judge(robot, branches, **options):
    description = library_robot(robot) if isinstance(robot, str) else robot
    return judge_inverse(
        description, [[read(formula) for formula in branch] for branch in branches], **options
    )


def wrong(robot, joint, formula, branch=0):
    """The judgement of a branch with one formula of another form: ``{}`` stands for the right one."""
    formulas = list(ARMS[robot][branch])
    formulas[joint] = formula.replace("{}", f"({formulas[joint]})")
    return judge(robot, [formulas])


def mistakes(judged, branch=0):
    """Each mistake of a branch with its joint, from 0; None where it is not a single joint's."""
    found = []
    for one in judged.diagnosis:
        place = one.where.split(", ")
        if place[1] == f"branch {branch + 1}":
            found.append(
                (one.mistake, int(place[2].removeprefix("q")) - 1 if len(place) > 2 else None)
            )
    return found


@pytest.mark.parametrize("name", ARMS)
def test_right_branches_close_and_cover_all_solutions(name):
    judged = judge(name, ARMS[name])
    assert {entry.verdict for entry in judged.entries} == {CORRECT}
    assert all(closure == Closure(1000, 1000) for closure in judged.closures)
    assert judged.solutions == judged.covered == len(ARMS[name])
    assert judged.duplicates == ()
    assert not any(note.kind is NoteKind.SOLUTIONS_MISSING for note in judged.notes)


def test_fewer_branches_are_said():
    judged = judge("puma560_cao", ARMS["puma560_cao"][:3])
    assert judged.verdict is CORRECT
    assert (judged.solutions, judged.covered) == (8, 3)
    assert judged.notes == (Note(NoteKind.SOLUTIONS_MISSING, "ik", ("3", "8")),)


def test_positions_alone_are_asked_of_an_arm_of_two_joints():
    assert judge("planar2r", ARMS["planar2r"]).notes == (
        Note(NoteKind.ASKED_FOR, "ik", ("x", "y", "z")),
    )


@pytest.mark.parametrize(
    ("name", "joint", "formula", "mistake"),
    [
        ("planar2r", 1, "{}*180/pi", "degrees_for_radians"),
        ("planar2r", 0, "{}*180/pi", "degrees_for_radians"),
        ("planar2r", 1, "-{}", "elbow_sign"),
        ("planar2r", 1, "pi - {}", "supplement"),
        ("planar2r", 0, "{} + pi/2", "missing_offset"),
        ("planar2r", 0, "{} + pi", "missing_offset"),
        ("polar_rp", 0, "atan(py/px)", "quadrant"),
        ("polar_rp", 0, "asin(py/sqrt(px^2 + py^2))", "quadrant"),
        ("polar_rp", 0, "acos(px/sqrt(px^2 + py^2))", "sign_lost"),
        ("polar_rp", 0, "atan2(px, py)", "atan2_arguments"),
        ("polar_rp", 0, "-{}", "joint_sign"),
        ("planar2r", 0, "atan2(py, px)", "triangle_angle_forgotten"),
        ("planar3r", 0, "atan2(py - l3*r21, px - l3*r11)", "triangle_angle_forgotten"),
        ("cobra600", 0, "atan2(py, px)", "triangle_angle_forgotten"),
        slow_if(True, "planar3r", 2, "acos(r11) - q1 - q2", "sign_lost"),
        slow_if(True, "planar3r", 2, "asin(r21) - q1 - q2", "quadrant"),
        ("cobra600", 3, "q1 + q2 - acos(r11)", "sign_lost"),
        ("polar_rp", 0, "{} - pi/2", "missing_offset"),
        ("polar_rp", 1, "-{}", "elbow_sign"),
        ("polar_rp", 1, "1000*{}", "millimetres_for_metres"),
        ("polar_rp", 1, "{} - 0.2", "missing_offset"),
        ("pan_tilt", 0, "atan(py/px)", "quadrant"),
        ("pan_tilt", 0, "atan2(px, py)", "atan2_arguments"),
        ("pan_tilt", 1, "-{}", "joint_sign"),
        ("pan_tilt", 1, "{}/deg", "degrees_for_radians"),
        ("planar3r", 2, "-{}", "joint_sign"),
        ("planar3r", 1, "-{}", "elbow_sign"),
        ("planar3r", 2, "atan(r21/r11) - q1 - q2", "quadrant"),
        ("planar3r", 2, "atan2(r11, r21) - q1 - q2", "atan2_arguments"),
        ("planar3r", 2, "{} + 30*deg", "missing_offset"),
        ("cobra600", 2, "pz - 0.387", "joint_sign"),
        ("cobra600", 2, "-pz", "offset_forgotten"),
        ("cobra600", 3, "q1 + q2 - atan2(r11, r21)", "atan2_arguments"),
        ("cobra600", 3, "q1 + q2 - atan(r21/r11)", "quadrant"),
        ("cobra600", 3, "-{}", "joint_sign"),
        ("puma560_cao", 0, "{} + pi/3", "missing_offset"),
        ("cobra600", 1, "pi - {}", "supplement"),
        ("puma560_cao", 3, "{}*180/pi", "degrees_for_radians"),
        ("puma560_cao", 4, "-{}", "joint_sign"),
        ("puma560_cao", 5, "{} + pi", "missing_offset"),
    ],
)
def test_mistakes_have_names_and_places(name, joint, formula, mistake):
    judged = wrong(name, joint, formula)
    assert judged.verdict is WRONG
    assert judged.closures[0].closed < judged.closures[0].poses == 1000
    assert mistakes(judged) == [(mistake, joint)]
    assert mistake in LIBRARY


# Single changes of a formula

ELBOW = "acos((px^2 + py^2 - l1^2 - l2^2)/(2*l1*l2))"
SHOULDER = "atan2(py, px) - atan2(l2*sin(q2), l1 + l2*cos(q2))"
RPR = from_dh([("pi/2", 0, 0, "pi/2"), (0, 0, 0, "-pi/2"), ("-pi/2", 0, 0.3, 0)], kinds="RPR")
"""Swing, telescope and hand in a plane: no closed form of ours."""
RPR_RIGHT = [
    "atan2(py - 0.3*r21, px - 0.3*r11)",
    "sqrt((px - 0.3*r11)^2 + (py - 0.3*r21)^2)",
    "atan2(r21, r11) - q1",
]
RRP = from_dh([(0, 0.4, 0, "-pi/2"), (0, 0.15, 0, "pi/2"), (0, 0, 0, 0)], kinds="RRP")
"""The first three joints of a Stanford arm: no closed form of ours."""
RADIUS = "px^2 + py^2 - 0.15^2"
RRP_RIGHT = [
    f"atan2(py, px) - atan2(0.15, sqrt({RADIUS}))",
    "atan2(px*cos(q1) + py*sin(q1), pz - 0.4)",
    f"sqrt({RADIUS} + (pz - 0.4)^2)",
]
GANTRY = with_base(
    from_dh([(0, 0, 0, "pi/2"), (0, 0, 0, 0)], kinds="PP"), pose(euler=(-np.pi / 2, 0, 0))
)
PUMA3 = from_dh([(0, 0.6, 0, "pi/2"), (0, 0, 0.4, 0), (0, 0, 0.3, 0)])
HEIGHT = "((px^2 + py^2 + (pz - 0.6)^2 - 0.4^2 - 0.3^2)/(2*0.4*0.3))"
PUMA3_RIGHT = [
    "atan2(py, px)",
    "atan2(pz - 0.6, sqrt(px^2 + py^2)) - atan2(0.3*sin(q3), 0.4 + 0.3*cos(q3))",
    f"-acos({HEIGHT})",
]
RIGHT = {
    "planar2r": (library_robot("planar2r"), [SHOULDER, ELBOW]),
    "planar3r": (library_robot("planar3r"), ARMS["planar3r"][0]),
    "polar_rp": (library_robot("polar_rp"), ARMS["polar_rp"][0]),
    "pan_tilt": (library_robot("pan_tilt"), ARMS["pan_tilt"][0]),
    "cobra600": (library_robot("cobra600"), ARMS["cobra600"][0]),
    "puma560_cao": (library_robot("puma560_cao"), ARMS["puma560_cao"][0]),
    "rpr": (RPR, RPR_RIGHT),
    "rrp": (RRP, RRP_RIGHT),
    "gantry": (GANTRY, ["py", "pz"]),
    "puma3": (PUMA3, PUMA3_RIGHT),
}


@pytest.mark.parametrize("name", RIGHT)
def test_the_formulas_that_mistakes_are_made_in_are_right(name):
    arm, formulas = RIGHT[name]
    assert judge(arm, [formulas]).verdict is CORRECT


@pytest.mark.parametrize(
    ("name", "joint", "old", "new", "mistake"),
    [
        ("planar2r", 1, "(2*l1*l2)", "(l1*l2)", "cosine_law_factor"),
        ("puma3", 2, "(2*0.4*0.3)", "(0.4*0.3)", "cosine_law_factor"),
        ("planar2r", 1, "- l1^2 - l2^2", "+ l1^2 + l2^2", "cosine_law_sign"),
        ("planar2r", 1, "- l2^2", "+ l2^2", "cosine_law_sign"),
        ("puma3", 2, "- 0.3^2", "+ 0.3^2", "cosine_law_sign"),
        ("planar2r", 1, "l1^2 - l2^2", "l1 - l2", "cosine_law_squares"),
        ("planar2r", 1, "l1^2", "l1", "cosine_law_squares"),
        ("planar2r", 1, "px^2 + py^2", "sqrt(px^2 + py^2)", "cosine_law_squares"),
        ("puma3", 2, "(pz - 0.6)^2", "(pz - 0.6)", "cosine_law_squares"),
        ("planar3r", 2, "r21", "r12", "rotation_matrix_transposed"),
        ("rpr", 2, "r21", "r12", "rotation_matrix_transposed"),
        ("planar3r", 2, " - q1 - q2", "", "earlier_joints_forgotten"),
        ("planar3r", 2, " - q1", "", "earlier_joints_forgotten"),
        ("rpr", 2, " - q1", "", "earlier_joints_forgotten"),
        ("cobra600", 3, "q1 + q2 - ", "-", "earlier_joints_forgotten"),
        ("polar_rp", 1, "sqrt(px^2 + py^2)", "(px^2 + py^2)", "root_forgotten"),
        ("pan_tilt", 1, "sqrt(px^2 + py^2)", "(px^2 + py^2)", "root_forgotten"),
        ("rrp", 2, RRP_RIGHT[2], RRP_RIGHT[2].removeprefix("sqrt"), "root_forgotten"),
        ("polar_rp", 1, "py^2", "py", "square_forgotten"),
        ("rrp", 2, "(pz - 0.4)^2", "(pz - 0.4)", "square_forgotten"),
        ("pan_tilt", 1, "0.08", "0.08^2", "square_too_much"),
        ("cobra600", 2, "0.387", "0.387^2", "square_too_much"),
        ("planar2r", 1, ELBOW, ELBOW.removeprefix("acos"), "arc_function_forgotten"),
        ("puma3", 2, PUMA3_RIGHT[2], HEIGHT, "arc_function_forgotten"),
        ("planar2r", 0, "atan2(py, px)", "atan2(px, px)", "axis_exchanged"),
        ("gantry", 0, "py", "px", "axis_exchanged"),
        ("cobra600", 2, "pz", "py", "axis_exchanged"),
        ("rrp", 2, "(pz - 0.4)", "(px - 0.4)", "axis_exchanged"),
        (
            "planar2r",
            0,
            "l2*sin(q2), l1 + l2*cos(q2)",
            "l1*sin(q2), l2 + l1*cos(q2)",
            "lengths_exchanged",
        ),
        (
            "puma3",
            1,
            "0.3*sin(q3), 0.4 + 0.3*cos(q3)",
            "0.4*sin(q3), 0.3 + 0.4*cos(q3)",
            "lengths_exchanged",
        ),
        ("pan_tilt", 1, "pz - 0.08", "pz", "offset_forgotten"),
        ("pan_tilt", 1, "pz - 0.08", "pz + 0.08", "term_sign"),
        ("rrp", 1, "pz - 0.4", "pz", "offset_forgotten"),
        ("puma3", 1, "pz - 0.6", "pz", "offset_forgotten"),
        ("rrp", 1, "sin(q1)", "cos(q1)", "term_function"),
        ("planar2r", 0, "l2*cos(q2)", "l2*sin(q2)", "term_function"),
        ("planar2r", 0, "l1 + ", "l2 + ", "term_parameter"),
        ("planar2r", 0, " - atan2(l2", " + atan2(l2", "term_sign"),
        ("rrp", 1, "py*sin(q1)", "(-py*sin(q1))", "term_sign"),
        ("planar2r", 0, " - atan2(l2", " - 2*atan2(l2", "term_factor"),
        ("rrp", 1, "pz - 0.4", "pz - 0.4 - px", "term_extra"),
        ("rpr", 2, "atan2(r21, r11)", "atan2(r11, r21)", "atan2_arguments"),
        ("rrp", 1, RRP_RIGHT[1], "atan2(pz - 0.4, px*cos(q1) + py*sin(q1))", "atan2_arguments"),
        ("planar2r", 1, ELBOW, f"pi - {ELBOW}", "supplement"),
        ("puma3", 2, "acos(", "acos(-1*", "supplement"),
    ],
)
@pytest.mark.slow
def test_a_local_change_of_a_formula_is_named(name, joint, old, new, mistake):
    """The formula that is wrong is named, and none that is right is blamed."""
    arm, formulas = RIGHT[name]
    changed = list(formulas)
    changed[joint] = formulas[joint].replace(old, new)
    assert changed != formulas
    judged = judge(arm, [changed])
    assert judged.verdict is WRONG
    assert mistakes(judged) == [(mistake, joint)]
    assert LIBRARY[mistake].hint == judged.diagnosis[0].hint


@pytest.mark.parametrize(
    ("name", "changes", "mistake"),
    [
        ("planar2r", {"2*l1*l2": "l1*l2"}, "cosine_law_factor"),
        ("planar2r", {"- l1^2 - l2^2": "- l1^2 + l2^2"}, "cosine_law_sign"),
        ("planar3r", {"l1^2 - l2^2": "l1 - l2"}, "cosine_law_squares"),
        ("planar3r", {" - l3*r11": "", " - l3*r21": ""}, "tool_length_forgotten"),
        ("rpr", {" - 0.3*r11": "", " - 0.3*r21": ""}, "tool_length_forgotten"),
        ("puma560_cao", {"px": "py", "py": "px"}, "axis_exchanged"),
        (
            "puma560_cao",
            {f"r{i}{j}": f"r{j}{i}" for i in (1, 2, 3) for j in (1, 2, 3)},
            "rotation_matrix_transposed",
        ),
        ("puma3", {"pz - 0.6": "pz"}, "offset_forgotten"),
    ],
)
def test_the_same_change_in_several_formulas_is_one_mistake(name, changes, mistake):
    arm, formulas = (library_robot(name), ARMS[name][0]) if name in ARMS else RIGHT[name]
    pattern = re.compile("|".join(map(re.escape, changes)))
    changed = [pattern.sub(lambda found: changes[found.group()], formula) for formula in formulas]
    judged = judge(arm, [changed])
    assert judged.verdict is WRONG
    assert mistakes(judged) == [(mistake, None)]


@pytest.mark.slow
@pytest.mark.parametrize("name", RIGHT)
def test_a_right_formula_is_never_blamed(name):
    """Whatever stands for one joint, it alone is blamed."""
    arm, formulas = RIGHT[name]
    for joint in range(arm.n):
        changed = list(formulas)
        changed[joint] = "px + 0.3*py - 0.7*pz"
        assert [place for _, place in mistakes(judge(arm, [changed], samples=200))] == [joint]


def test_an_arm_without_a_closed_form_is_asked_for_what_determines_its_joints():
    judged = judge(RRP, [RRP_RIGHT])
    assert judged.verdict is CORRECT
    assert judged.notes == (
        Note(NoteKind.POSITIONS_ONLY, "ik"),
        Note(NoteKind.NO_CLOSED_FORM, "ik"),
    )
    planar = judge(RPR, [RPR_RIGHT])  # the position leaves the hand's angle open
    assert planar.notes == (Note(NoteKind.NO_CLOSED_FORM, "ik"),)
    assert judge(RPR, [[*RPR_RIGHT[:2], "0"]]).verdict is WRONG


@pytest.mark.parametrize("name", RIGHT)
def test_verdicts_do_not_depend_on_the_seed(name):
    arm, formulas = RIGHT[name]
    seeds = range(200 if acceptance.ACCEPTING else 8)
    assert {judge(arm, [formulas], seed=seed).verdict for seed in seeds} == {CORRECT}
    spoiled = [*formulas[:-1], f"1.001*({formulas[-1]})"]
    assert {judge(arm, [spoiled], seed=seed, explain=False).verdict for seed in seeds} == {WRONG}


# Several mistakes


@pytest.mark.slow
def test_several_mistakes_of_a_branch_are_all_named():
    formulas = ["atan(py/px)", "sqrt(px^2 + py^2)*1000"]
    assert mistakes(judge("polar_rp", [formulas])) == [
        ("quadrant", 0),
        ("millimetres_for_metres", 1),
    ]
    formulas = ["acos(px/sqrt(px^2 + py^2))", "px^2 + py^2"]
    assert mistakes(judge("polar_rp", [formulas])) == [("sign_lost", 0), ("root_forgotten", 1)]
    puma = list(ARMS["puma560_cao"][0])
    puma[0], puma[5] = f"{puma[0]} + pi/3", f"({puma[5]})/deg"
    assert mistakes(judge("puma560_cao", [puma])) == [
        ("missing_offset", 0),
        ("degrees_for_radians", 5),
    ]


def test_what_has_no_name_has_a_place():
    judged = wrong("puma560_cao", 1, "px + 3*py*pz")
    assert mistakes(judged) == [(None, 1)]
    assert judged.diagnosis[0].sentence == "q2 is the first that is wrong."


def test_the_witness_is_a_pose_that_does_not_close():
    formulas = [*ARMS["cobra600"][0][:3], f"-({ARMS['cobra600'][0][3]})"]
    witness = judge("cobra600", [formulas]).entries[0].witness
    state = dict(witness.state)
    for k, formula in enumerate(formulas):
        state[f"q{k + 1}"] = float(doubles(read(formula), state))
    q = [state[f"q{k + 1}"] for k in range(4)]
    T = np.eye(4)
    T[:3, 3] = [witness.state[name] for name in POSE_NAMES[:3]]
    T[:3, :3] = np.reshape([witness.state[name] for name in POSE_NAMES[3:]], (3, 3))
    description = library_robot("cobra600")
    assert witness.answer == pytest.approx(q[3])
    assert np.abs(world_to_tool(description, q) - T).max() > 1e-3
    assert np.abs(world_to_tool(description, [*q[:3], witness.truth]) - T).max() < CLOSES


def test_no_value_where_the_pose_is_reachable_is_wrong():
    judged = wrong("polar_rp", 1, "sqrt(px)*sqrt(px)*{}/abs(px)")
    assert judged.verdict is WRONG
    closure = judged.closures[0]
    assert closure.without_value == closure.poses - closure.closed > 300
    assert "has no value on" in judged.entries[0].statement
    assert judged.entries[0].witness.answer is None


def test_a_branch_is_excused_where_its_solution_does_not_exist():
    """irb140 leans back only to points near enough: behind, its shoulder is off the axis by a1."""
    a1, a2, d1, d4, d6 = 0.07, 0.36, 0.352, 0.38, 0.065
    x, y, z = (f"({p} - {d6}*{r})" for p, r in (("px", "r13"), ("py", "r23"), ("pz", "r33")))
    first = f"atan2(-{y}, -{x})"
    u, v = f"(cos(q1)*{x} + sin(q1)*{y} - {a1})", f"({d1} - {z})"
    s3 = f"(-({u}^2 + {v}^2 - {a2}^2 - {d4}^2)/(2*{a2}*{d4}))"
    c3 = f"sqrt(1 - {s3}^2)"
    second = f"atan2({v}, {u}) - atan2({d4}*{c3}, {a2} - {d4}*{s3})"
    c, s = "cos(q2 + q3)", "sin(q2 + q3)"

    def along_z3(k):
        return f"(-{s}*(cos(q1)*r1{k} + sin(q1)*r2{k}) - {c}*r3{k})"

    x3 = f"({c}*(cos(q1)*r13 + sin(q1)*r23) - {s}*r33)"
    y3 = "(sin(q1)*r13 - cos(q1)*r23)"
    fourth = f"atan2({y3}, {x3})"
    fifth = f"-atan2(cos(q4)*{x3} + sin(q4)*{y3}, {along_z3(3)})"
    sixth = f"atan2({along_z3(2)}, -{along_z3(1)})"
    judged = judge("irb140", [[first, second, f"atan2({s3}, {c3})", fourth, fifth, sixth]])
    assert judged.closures[0].closed == judged.closures[0].poses < 1000, judged
    assert judged.verdict is CORRECT


def test_joint_values_that_are_not_exact_enough_are_said_to_be_near():
    judged = wrong("polar_rp", 1, "{} + 1e-8")
    assert judged.verdict is WRONG
    assert mistakes(judged) == [(None, None)]
    assert "near to a solution" in judged.diagnosis[0].sentence


def test_duplicates():
    judged = judge("planar2r", [planar2r("+"), planar2r("+")])
    assert [entry.verdict for entry in judged.entries] == [CORRECT, WRONG]
    assert judged.entries[1].statement == "gives the same solutions as branch 1"
    assert judged.duplicates == ((0, 1),)
    assert (judged.solutions, judged.covered) == (2, 1)
    assert mistakes(judged, 1) == [("elbow_sign", None)]
    thrice = judge("polar_rp", [polar_rp("+"), polar_rp("-"), polar_rp("+")])
    assert thrice.duplicates == ((0, 2),)
    assert mistakes(thrice, 2) == [("duplicate_branch", None)]


def test_base_and_tool_are_in_the_pose():
    arm = with_tool(with_base(library_robot("planar2r"), pose((0.1, 0.2, 0))), pose((0.1, 0, 0)))
    moved = [
        [
            formula.replace("px", "(px - 0.1)")
            .replace("py", "(py - 0.2)")
            .replace("l2", "(l2 + 0.1)")
            for formula in b
        ]
        for b in ARMS["planar2r"]
    ]
    assert judge(arm, moved).verdict is CORRECT
    assert judge(arm, ARMS["planar2r"]).verdict is WRONG


def test_an_arm_without_a_closed_form():
    """Two axes askew: q1 and q2 from the rotation alone."""
    arm = from_dh([("pi/6", 0.1, 0.2, "pi/6"), (0, 0.3, 0.1, "pi/4"), (0, 0.2, 0.1, "pi/3")])
    q3 = "atan2(r31, r32)"
    judged = judge(arm, [["px", "py", q3]], samples=50)
    assert judged.solutions is None
    assert mistakes(judged) == [(None, 0)]
    assert judged.notes[-1] == Note(NoteKind.NO_CLOSED_FORM, "ik")
    one = from_dh([(0.3, 0.1, 0.2, "pi/6")])
    assert judge(one, [["atan2(py, px) - 0.3"]]).verdict is CORRECT


def test_a_slide_without_limits():
    arm = from_dh([(0, 0.1, 0, 0)], kinds="P")
    assert judge(arm, [["pz - 0.1"]]).verdict is CORRECT
    assert mistakes(judge(arm, [["pz"]])) == [("offset_forgotten", 0)]


def test_poses_are_the_same_each_time():
    formulas = [["atan(py/px)", "sqrt(px^2 + py^2)"]]
    first = judge("polar_rp", formulas)
    assert first.entries == judge("polar_rp", formulas).entries
    assert first.entries != judge("polar_rp", formulas, seed=1).entries


@pytest.mark.parametrize(
    ("branches", "complaint"),
    [
        ([], "no branch"),
        ([["px"]], "branch 1: 1 formula; expected 2"),
        ([["q2", "q1"]], "branch 1: q1, q2 need each other"),
        ([["px", "q2"]], "branch 1, q2: uses q2, which it is to give"),
        ([["px", "q1"], ["px", "pw"]], "branch 2, q2: unknown name 'pw'; expected px, py, pz"),
        ([["foo(px)", "q1"]], "unknown function 'foo'"),
    ],
)
def test_what_cannot_be_read(branches, complaint):
    with pytest.raises(AnswerError, match=complaint):
        judge("planar2r", branches)


def test_a_formula_may_use_joints_that_are_found_before_it():
    # q2 first, as most textbooks do.
    elbow = "acos((px^2 + py^2 - l1^2 - l2^2)/(2*l1*l2))"
    shoulder = "atan2(py, px) - atan2(l2*sin(q2), l1 + l2*cos(q2))"
    judged = judge("planar2r", [[shoulder, elbow], [shoulder, f"-{elbow}"]])
    assert judged.verdict is Verdict.CORRECT and judged.covered == 2
    exchanged = judge("planar2r", [[shoulder.replace("py, px", "px, py"), elbow]])
    assert mistakes(exchanged) == [("atan2_arguments", 0)]


@pytest.mark.slow
def test_the_search_for_mistakes_is_bounded():
    """Long formulas: a sum of 450 terms, squares nested 40 deep, 6 wrong formulas of a PUMA at once."""
    long = "+".join(f"{k}*px*py" for k in range(1, 450))
    nested = "px" + "+1)^2" * 40
    for formula in (long, "(" * 40 + nested):
        assert judge("planar2r", [[formula, f"q1 + {formula}"]]).verdict is WRONG
    branches = [[f"sin({formula})" for formula in branch] for branch in ARMS["puma560_cao"]]
    assert judge("puma560_cao", branches).verdict is WRONG


@pytest.mark.slow
def test_mistakes_that_all_branches_share_are_named_in_each(law):
    """Eight branches with a mistake in each of five formulas: 40 mistakes, in seconds."""
    wrong = [
        [formula.replace("sin", "cos", 1) for formula in branch] for branch in ARMS["puma560_cao"]
    ]
    start = time.process_time()
    named = [(one.where, one.mistake) for one in judge("puma560_cao", wrong).diagnosis]
    law.takes("time of a diagnosis, s", time.process_time() - start, 3.0)
    assert named == [
        (f"ik, branch {b}, q{j}", "term_function") for b in range(1, 9) for j in range(2, 7)
    ]
