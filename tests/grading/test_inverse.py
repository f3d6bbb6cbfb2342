"""Judging inverse kinematics: right branches close, and wrong ones say where and why."""

from itertools import product

import numpy as np
import pytest

from dhkit.description import from_dh, library_robot, pose, with_base, with_tool, world_to_tool
from dhkit.errors import AnswerError
from dhkit.expressions import read
from dhkit.grading.judging.inverse import CLOSES, POSE_NAMES, judge_inverse
from dhkit.grading.mistakes.library import LIBRARY
from dhkit.grading.report import Verdict

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
    return judge_inverse(description, [[read(formula) for formula in branch] for branch in branches], **options)


def wrong(robot, joint, formula, branch=0):
    """The judgement of a branch with one formula of another form: ``{}`` stands for the right one."""
    formulas = list(ARMS[robot][branch])
    formulas[joint] = formula.replace("{}", f"({formulas[joint]})")
    return judge(robot, [formulas]).branches[0]


@pytest.mark.parametrize("name", ARMS)
def test_right_branches_close_and_cover_all_solutions(name):
    judged = judge(name, ARMS[name])
    assert {branch.verdict for branch in judged.branches} == {CORRECT}
    assert all(branch.closed == branch.poses == 1000 for branch in judged.branches)
    assert judged.solutions == judged.covered == len(ARMS[name])
    assert judged.duplicates == ()
    assert not any("solutions" in note for note in judged.notes)


def test_fewer_branches_are_said():
    judged = judge("puma560_cao", ARMS["puma560_cao"][:3])
    assert judged.verdict is CORRECT
    assert (judged.solutions, judged.covered) == (8, 3)
    assert "3 of the 8 solutions" in judged.notes[-1]


def test_positions_alone_are_asked_of_an_arm_of_two_joints():
    assert judge("planar2r", ARMS["planar2r"]).notes == ("asked for what the arm can meet: x, y, z",)


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
        ("cobra600", 2, "-pz", "missing_offset"),
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
    assert judged.closed < judged.poses == 1000
    assert judged.joint == joint
    assert [(found.mistake, found.joint) for found in judged.explanations] == [(mistake, joint)]
    assert mistake in LIBRARY


def test_several_mistakes_of_a_branch_are_all_named():
    formulas = ["atan(py/px)", "sqrt(px^2 + py^2)*1000"]
    judged = judge("polar_rp", [formulas]).branches[0]
    assert [(found.mistake, found.joint) for found in judged.explanations] == [
        ("quadrant", 0),
        ("millimetres_for_metres", 1),
    ]
    puma = list(ARMS["puma560_cao"][0])
    puma[0], puma[5] = f"{puma[0]} + pi/3", f"({puma[5]})/deg"
    judged = judge("puma560_cao", [puma]).branches[0]
    assert [(found.mistake, found.joint) for found in judged.explanations] == [
        ("missing_offset", 0),
        ("degrees_for_radians", 5),
    ]


def test_what_has_no_name_has_a_place():
    judged = wrong("puma560_cao", 1, "{} + 0.1*px")
    assert judged.joint == 1
    assert judged.explanations[0].mistake is None
    assert judged.explanations[0].sentence == "q2 is the first that is wrong"


def test_the_witness_is_a_pose_that_does_not_close():
    judged = wrong("cobra600", 3, "-{}")
    description, witness = library_robot("cobra600"), judged.witness
    T = np.eye(4)
    T[:3, 3] = [witness.pose[name] for name in POSE_NAMES[:3]]
    T[:3, :3] = np.reshape([witness.pose[name] for name in POSE_NAMES[3:]], (3, 3))
    assert np.abs(world_to_tool(description, witness.truth) - T).max() < CLOSES
    assert np.abs(world_to_tool(description, witness.answer) - T).max() > 1e-3
    assert witness.answer[:3] == pytest.approx(witness.truth[:3])


def test_no_value_where_the_pose_is_reachable_is_wrong():
    judged = wrong("polar_rp", 1, "sqrt(px)*sqrt(px)*{}/abs(px)")
    assert judged.verdict is WRONG
    assert judged.without_value == judged.poses - judged.closed > 300
    assert "has no value on" in judged.statement
    assert judged.witness.answer[1] is None


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
    judged = judge("irb140", [[first, second, f"atan2({s3}, {c3})", fourth, fifth, sixth]]).branches[0]
    assert judged.closed == judged.poses < 1000, judged
    assert judged.verdict is CORRECT


def test_duplicates():
    judged = judge("planar2r", [planar2r("+"), planar2r("+")])
    assert [branch.verdict for branch in judged.branches] == [CORRECT, WRONG]
    assert judged.branches[1].statement == "gives the same solutions as branch 1"
    assert judged.duplicates == ((0, 1),)
    assert (judged.solutions, judged.covered) == (2, 1)
    assert judged.branches[1].explanations[0].mistake == "elbow_sign"
    thrice = judge("polar_rp", [polar_rp("+"), polar_rp("-"), polar_rp("+")])
    assert thrice.duplicates == ((0, 2),)
    assert thrice.branches[2].explanations[0].mistake == "duplicate_branch"


def test_base_and_tool_are_in_the_pose():
    arm = with_tool(with_base(library_robot("planar2r"), pose((0.1, 0.2, 0))), pose((0.1, 0, 0)))
    moved = [
        [formula.replace("px", "(px - 0.1)").replace("py", "(py - 0.2)").replace("l2", "(l2 + 0.1)") for formula in b]
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
    assert judged.branches[0].joint == 0
    assert "how many solutions there are is open" in judged.notes[-1]
    one = from_dh([(0.3, 0.1, 0.2, "pi/6")])
    assert judge(one, [["atan2(py, px) - 0.3"]]).verdict is CORRECT


def test_a_slide_without_limits():
    arm = from_dh([(0, 0.1, 0, 0)], kinds="P")
    assert judge(arm, [["pz - 0.1"]]).verdict is CORRECT
    assert judge(arm, [["pz"]]).branches[0].explanations[0].mistake == "missing_offset"


def test_poses_are_the_same_each_time():
    formulas = [["atan(py/px)", "sqrt(px^2 + py^2)"]]
    first = judge("polar_rp", formulas)
    assert first.branches[0].witness == judge("polar_rp", formulas).branches[0].witness
    assert first.branches[0].witness != judge("polar_rp", formulas, seed=1).branches[0].witness


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
    wrong = judge("planar2r", [[shoulder.replace("py, px", "px, py"), elbow]]).branches[0]
    assert wrong.joint == 0 and wrong.explanations[0].mistake == "atan2_arguments"
