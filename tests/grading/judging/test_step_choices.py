"""Steps of inverse kinematics followed along the student's own roots, and what else a step may hold."""

import numpy as np
import pytest

import dhkit
from dhkit.description import library_robot, pose
from dhkit.grading import Verdict
from dhkit.grading.answers.sheet import sheet_of
from dhkit.grading.remarks import NoteKind
from dhkit.grading.sheet_judge import judge_sheet
from grading.inverse_steps_corpus import PUMA

REACH = "(px^2+py^2-l1^2-l2^2)/(2*l1*l2)"
BETA = "acos((px^2+py^2+l1^2-l2^2)/(2*l1*sqrt(px^2+py^2)))"
REACH3 = "(px^2+py^2+(pz-d1)^2-a2^2-a3^2)/(2*a2*a3)"
FRONT = "atan2(pz-d1, sqrt(px^2+py^2)) - atan2(a3*s3, a2+a3*c3)"
BACK = "pi - atan2(pz-d1, sqrt(px^2+py^2)) - atan2(a3*s3, a2+a3*c3)"
TABLE_X = "(px*c1+py*s1)"


def judged(robot, steps):
    arm = robot if not isinstance(robot, str) else library_robot(robot)
    return judge_sheet(arm, sheet_of({"robot": "arm", "answer": {"ik": {"steps": steps}}}), seed=3)


def steps(*pairs):
    """Return steps of joints and their solutions."""
    return [{"joint": joint, "solution": solution} for joint, solution in pairs]


def reached(arm, formulas, T):
    """Whether joint values by formulas, in Python and in the order of steps, reach a pose: the truth of a sheet."""
    values = {name: getattr(np, name) for name in ("sqrt", "pi")} | {
        "acos": np.arccos,
        "atan2": np.arctan2,
    }
    values |= {name: float(x) for name, x in arm.description.numbers.values.items()}
    values |= dict(zip(("px", "py", "pz"), T[:3, 3], strict=True)) | dict(d1=0.1, a2=0.2, a3=0.15)
    q = np.zeros(arm.n)
    for joint, formula in formulas:
        # Our own formulas.
        q[joint - 1] = eval(formula.replace("^", "**"), {"__builtins__": {}}, values)
        values |= {
            f"q{joint}": q[joint - 1],
            f"s{joint}": np.sin(q[joint - 1]),
            f"c{joint}": np.cos(q[joint - 1]),
        }
    return np.abs(arm.fk(q) - T)[:3, 3].max() < 1e-9


@pytest.mark.parametrize(
    ("order", "first", "second", "wrong"),
    [
        ((2, 1), f"acos({REACH})", f"atan2(py,px) - {BETA}", None),
        ((2, 1), f"acos({REACH})", f"atan2(py,px) + {BETA}", 2),
        ((2, 1), f"-acos({REACH})", f"atan2(py,px) + {BETA}", None),
        ((1, 2), f"atan2(py,px) + {BETA}", f"acos({REACH})", 2),
        ((1, 2), f"atan2(py,px) + {BETA}", f"-acos({REACH})", None),
        ((2, 1), f"±acos({REACH})", f"atan2(py,px) ± {BETA}", 2),
        # Signs of textbooks belong together: + with the first, - with the second.
        ((2, 1), f"±acos({REACH})", f"atan2(py,px) ∓ {BETA}", None),
        ((2, 1), f"∓acos({REACH})", f"atan2(py,px) ± {BETA}", None),
        ((2, 1), f"±acos({REACH})", "atan2(py,px) - atan2(l2*s2, l1+l2*c2)", None),
        ((2, 1), f"acos({REACH})", "atan2(py,px) - atan2(l2*s2, l1+l2*c2)", None),
    ],
)
def test_later_roots_belong_to_those_that_were_chosen(order, first, second, wrong):
    """Also where a formula does not name the earlier joint."""
    given = list(zip(order, (first, second), strict=True))
    verdicts = [entry.verdict for entry in judged("planar2r", steps(*given)).entries]
    assert verdicts == [Verdict.WRONG if k == wrong else Verdict.CORRECT for k in (1, 2)]
    if not any(sign in first + second for sign in "±∓"):
        arm = dhkit.Arm.load("planar2r")
        assert reached(arm, given, arm.fk([0.3, 0.8])) == (wrong is None)


@pytest.mark.parametrize(
    ("waist", "elbow", "shoulder", "is_right"),
    [
        ("atan2(py,px)", f"±acos({REACH3})", FRONT, True),
        ("atan2(py,px)", f"acos({REACH3})", FRONT, True),
        ("atan2(py,px)", f"acos({REACH3})", BACK, False),
        ("atan2(-py,-px)", f"acos({REACH3})", BACK, True),
        ("atan2(-py,-px)", f"±acos({REACH3})", FRONT, False),
        (["atan2(py,px)", "atan2(-py,-px)"], f"±acos({REACH3})", FRONT, False),
        (
            ["atan2(py,px)", "atan2(-py,-px)"],
            f"±acos({REACH3})",
            "atan2(pz-d1, px*c1+py*s1) - atan2(a3*s3, a2+a3*c3)",
            True,
        ),
    ],
)
def test_one_root_of_the_waist_asks_for_its_own_shoulder_alone(waist, elbow, shoulder, is_right):
    entries = judged("ax12_arm", steps((1, waist), (3, elbow), (2, shoulder))).entries
    assert [entry.verdict for entry in entries[:2]] == [Verdict.CORRECT] * 2
    assert (entries[2].verdict is Verdict.CORRECT) is is_right, entries[2].statement


@pytest.mark.slow
def test_the_wrist_needs_the_sign_of_a_sine_that_was_chosen_before():
    arm = [dict(step) for step in PUMA[:3]]
    ay, ax = "(c1*r23-s1*r13)", "(c23*(c1*r13+s1*r23)+s23*r33)"
    pitch = "acos(c23*r33 - s23*(c1*r13+s1*r23))"
    for sign, roll, verdict in (
        ("", f"atan2({ay}, {ax})", Verdict.WRONG),
        ("", f"atan2(-{ay}, -{ax})", Verdict.CORRECT),
        ("±", f"atan2(-{ay}, -{ax})", Verdict.WRONG),
        ("±", f"atan2(-{ay}/s5, -{ax}/s5)", Verdict.CORRECT),
    ):
        entries = judged("puma560", [*arm, *steps((5, f"{sign}{pitch}"), (4, roll))]).entries
        assert entries[3].verdict is Verdict.CORRECT and entries[4].verdict is verdict, (sign, roll)


def test_a_step_without_a_solution_leaves_all_roots_open():
    equation = dict(joint=2, equation="px^2+py^2 = l1^2 + l2^2 + 2*l1*l2*c2")
    general = [equation, *steps((1, "atan2(py,px) - atan2(l2*s2, l1+l2*c2)"))]
    one = [equation, *steps((1, f"atan2(py,px) + {BETA}"))]
    for given in (general, one):
        assert [entry.verdict for entry in judged("planar2r", given).entries] == [
            Verdict.CORRECT
        ] * 2


@pytest.mark.parametrize(
    "equation",
    [
        "c2*(px*s1 - py*c1 - d3) = 0",
        "s2*(px*s1 - py*c1) = d3*s2",
        "(px*s1 - py*c1 - d3)*(c2 + 2) = 0",
    ],
)
def test_a_factor_of_zero_determines_nothing(equation):
    entry = judged("puma560", [PUMA[0], dict(joint=2, equation=equation)]).entries[1]
    assert entry.verdict is Verdict.INCOMPLETE and "does not determine q2" in entry.statement


@pytest.mark.parametrize(
    ("robot", "equation", "verdict"),
    [
        ("ax12_arm", "c1 = px/sqrt(px^2+py^2)", Verdict.INCOMPLETE),
        ("ax12_arm", "px*c1 + py*s1 = sqrt(px^2+py^2)", Verdict.UNDECIDED),
        ("ax12_arm", "px*c1 + py*s1 = ±sqrt(px^2+py^2)", Verdict.CORRECT),
        ("ax12_arm", "s1 = sqrt(1-c1^2)", Verdict.INCOMPLETE),
        ("ax12_arm", "s1 = ±sqrt(1-c1^2)", Verdict.INCOMPLETE),
        ("ax12_arm", "px*c1 + py*s1 = 2*sqrt(px^2+py^2)", Verdict.WRONG),
        ("puma560", "px*c1 + py*s1 = sqrt(px^2+py^2)", Verdict.WRONG),
    ],
)
def test_an_equation_of_one_root_passes_and_says_so(robot, equation, verdict):
    report = judged(robot, [dict(joint=1, equation=equation)])
    assert report.entries[0].verdict is verdict, report.entries[0].statement
    remarks = [note.values[0] for note in report.notes if note.kind is NoteKind.STEP_REMARK]
    assert bool(remarks) == (verdict is Verdict.UNDECIDED and "±" not in equation)
    assert all("true of one root alone" in remark for remark in remarks)


def test_an_equation_for_the_joint_itself_is_a_solution():
    given = [
        dict(joint=2, equation=f"q2 = ±acos({REACH})"),
        dict(joint=1, equation="q1 = atan2(px,py)"),
    ]
    entries = judged("planar2r", given).entries
    assert [entry.verdict for entry in entries] == [Verdict.CORRECT, Verdict.WRONG]


def test_a_solution_that_is_right_within_the_limits_alone_says_so():
    report = judged("cobra600", steps((2, "asin(sqrt(1-((px^2+py^2-a1^2-a2^2)/(2*a1*a2))^2))")))
    assert report.entries[0].verdict is Verdict.CORRECT
    remark = next(note.values[0] for note in report.notes if note.kind is NoteKind.STEP_REMARK)
    assert "right within the joint limits; beyond them at" in remark


def test_an_equation_that_says_nothing_does_not_cost_a_right_solution():
    report = judged("puma560", [dict(PUMA[0], equation="s1^2 + c1^2 = 1")])
    assert report.entries[0].verdict is Verdict.CORRECT
    assert "it says nothing" in next(
        n.values[0] for n in report.notes if n.kind is NoteKind.STEP_REMARK
    )
    alone = judged("puma560", [dict(joint=1, equation="s1^2 + c1^2 = 1")])
    assert alone.missing == tuple(f"ik{k}" for k in range(2, 7))
    assert "ik1: the equation holds for every pose" in str(alone)


def test_a_length_of_the_table_is_not_another_of_the_same_value():
    # a2 and d4 of this PUMA are both 0.4318 m.
    known = "px^2+py^2+(pz-d1)^2 - d3^2 - a2^2 - a3^2 - d4^2"
    report = judged("puma560", [PUMA[0], dict(joint=3, equation=f"2*d4*(a3*c3 - a2*s3) = {known}")])
    assert report.entries[1].verdict is Verdict.WRONG
    assert NoteKind.ONLY_AT_VALUES in [note.kind for note in report.notes]


@pytest.mark.slow
def test_angles_of_the_table_are_read_as_such_where_all_steps_then_pass():
    """The Manutec r3 has an offset at joint 2; the worked solution writes theta2."""
    links = [f"(a2+a3*c3)*c2 - a3*s3*s2 = {TABLE_X}", "a3*s3*c2 + (a2+a3*c3)*s2 = pz"]
    elbow = f"2*a2*a3*c3 = {TABLE_X}^2 + pz^2 - a2^2 - a3^2"
    given = [
        dict(joint=1, equation="px*s1 = py*c1"),
        dict(joint=3, equation=elbow),
        dict(joint=2, equation=links, solution=f"atan2(pz, {TABLE_X}) - atan2(a3*s3, a2+a3*c3)"),
    ]
    report = judged("manutec_r3", given)
    assert [entry.verdict for entry in report.entries] == [Verdict.CORRECT] * 3
    assert NoteKind.TABLE_ANGLES in [note.kind for note in report.notes]
    in_values = [
        *given[:2],
        dict(given[2], equation=[links[0].replace("c2 -", "(-s2) -").replace("*s2 =", "*c2 =")]),
    ]
    del in_values[2]["solution"]
    other = judged("manutec_r3", in_values)
    assert other.entries[2].verdict in (Verdict.CORRECT, Verdict.INCOMPLETE)
    assert NoteKind.TABLE_ANGLES not in [note.kind for note in other.notes]


@pytest.mark.parametrize(
    ("change", "mistake"),
    [
        (
            lambda arm: arm.with_tool(pose((0.02, 0, 0.1), euler=(0, 30, 0), degrees=True)),
            "tool_not_taken_off",
        ),
        (
            lambda arm: arm.with_base(pose((0.2, 0, 0.1), euler=(0, 30, 0), degrees=True)),
            "base_not_taken_off",
        ),
    ],
)
def test_tools_and_bases_that_are_not_taken_off(change, mistake):
    changed = change(dhkit.Arm.load("puma560")).description
    report = judge_sheet(
        changed, sheet_of({"robot": "arm", "answer": {"ik": {"steps": PUMA[:1]}}}), seed=3
    )
    assert report.entries[0].verdict is Verdict.WRONG
    assert {diagnosis.mistake for diagnosis in report.diagnosis} == {mistake}


@pytest.mark.parametrize(
    ("equation", "solution"),
    [
        (f"D = {REACH}", "atan2(±sqrt(1-D^2), D)"),
        (None, f"theta2 = atan2(±sqrt(1-D^2), D), where D = {REACH}"),
        (f"c2 = {REACH} = D", "±acos(D)"),
        ([f"k_{{2}} = {REACH}", "c2 = k_2"], "±acos(k2)"),
        (
            [r"r = hypot(px, py)", "r^2 = l1^2+l2^2+2*l1*l2*c2 (3.4)"],
            "±acos((r^2-l1^2-l2^2)/(2*l1*l2))  (3.5)",
        ),
        ("Eq(px**2 + py**2, l1**2 + l2**2 + 2*l1*l2*cos(q2))", f"q[1] = wrapToPi(±acos({REACH}))"),
        ("T(1,4)^2 + T(2,4)^2 = l1^2 + l2^2 + 2*l1*l2*cos(q(2))", f"q(2) = ±acos({REACH});"),
        (
            "T[0,3]**2 + T[1][3]**2 = l1**2 + l2**2 + 2*l1*l2*c2",
            f"±acos({REACH.replace('px', 'p[0]')})",
        ),
        ("P_x^2 + P_y^2 = l1^2 + l2^2 + 2*l1*l2*c2", f"deg2rad(±acosd({REACH}))"),
        (
            r"p_x^2 + p_y^2 &= l_1^2 + l_2^2 + 2 l_1 l_2 c_2 \tag{7}",
            rf"\theta_2 &= \pm\arccos({REACH}) \\",
        ),
    ],
)
def test_notations_of_steps(equation, solution):
    given = {"joint": 2, "solution": solution} | ({"equation": equation} if equation else {})
    entry = judged("planar2r", [given]).entries[0]
    assert entry.verdict in (Verdict.CORRECT, Verdict.UNDECIDED), (entry.verdict, entry.statement)


def test_a_quantity_defined_in_one_step_is_known_in_the_next():
    x = "x = px*c1 + py*s1"
    ax = "ax = c23*(c1*r13+s1*r23)+s23*r33"  # a name that Paul gives to r13
    given = [
        PUMA[0],
        dict(
            PUMA[1],
            equation=[x, "y = pz - d1", "2*a2*(a3*c3 - d4*s3) = x^2 + y^2 - a2^2 - a3^2 - d4^2"],
        ),
        dict(
            joint=2,
            equation="(a2+a3*c3-d4*s3)*c2 - (d4*c3+a3*s3)*s2 = x",
            solution=PUMA[2]["solution"],
        ),
        dict(
            joint=4,
            equation=[ax, "ay = c1*r23-s1*r13"],
            solution=["atan2(ay, ax)", "atan2(-ay, -ax)"],
        ),
    ]
    assert [entry.verdict for entry in judged("puma560", given).entries[:4]] == [
        Verdict.CORRECT
    ] * 4


def turntable(links, a1, offset=0.0):
    """Return a turntable with two or three parallel joints, or with three and a roll: 3, 4 or 5 joints."""
    right = np.pi / 2
    rows = [(0, 0.349, a1, -right), (0, offset, 0.221, 0), (0, 0, 0.221, 0)]
    rows += {3: [], 4: [(0, 0, 0.145, 0)], 5: [(right, 0, 0, right), (0, 0.145, 0, 0)]}[links]
    return dhkit.description.from_dh(rows, name="turntable")


BOTH = ["atan2(py, px)", "atan2(-py, -px)"]
AXIS_5 = ["atan2(r23, r13)", "atan2(-r23, -r13)"]
LEFT_AND_RIGHT = "atan2(py, px) - atan2(d2, ±sqrt(px^2 + py^2 - d2^2))"


@pytest.mark.parametrize(
    ("arm", "solution", "verdict"),
    [
        *((turntable(n, a1), BOTH, "correct") for n in (3, 4, 5) for a1 in (0.3, 0.45, 0.5)),
        (turntable(3, 0.5), ["atan2(py, px)", "atan2(-py, px)"], "wrong"),
        (turntable(5, 0.5), ["atan2(py, px)", "atan2(py, px) + 0.1"], "wrong"),
        (turntable(5, 0.05, 0.03), LEFT_AND_RIGHT, "correct"),
        (turntable(5, 0.05, 0.03), LEFT_AND_RIGHT.replace(" - atan2", " + atan2"), "wrong"),
        (turntable(5, 0.05), AXIS_5, "correct"),
    ],
)
def test_a_root_is_right_though_later_joints_do_not_reach_the_pose_after_it(arm, solution, verdict):
    """With the shoulder far from axis 1, or beside it, one of two roots alone leads to a solution at most poses."""
    given = {"joint": 1, "solution": solution}
    assert judged(arm, [given]).entries[0].verdict.value == verdict
    if verdict == "correct":
        # The equation of a root that leads nowhere determines the joint as well.
        equation = "s1*px - c1*py = -d2" if "d2" in solution else "s1*px - c1*py = 0"
        assert judged(arm, [given | {"equation": equation}]).entries[0].verdict.value == verdict
