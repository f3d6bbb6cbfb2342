# ruff: noqa: E501
"""Steps of inverse kinematics by hand for six arms, and answers that have one labelled mistake each.

The steps were written by hand after books (Craig 2005 for the PUMA, Hawkins 2013 for the UR, Paul 1981 for the
Stanford arm).
"""

import copy
import re

PUMA = [
    dict(
        joint=1,
        equation="px*s1 - py*c1 = d3",
        solution=[
            "atan2(px,-py) + atan2(sqrt(px^2+py^2-d3^2), d3)",
            "atan2(px,-py) - atan2(sqrt(px^2+py^2-d3^2), d3)",
        ],
    ),
    dict(
        joint=3,
        equation="2*a2*(a3*c3 - d4*s3) = px^2+py^2+(pz-d1)^2 - d3^2 - a2^2 - a3^2 - d4^2",
        solution="atan2(-d4, a3) ± atan2(sqrt((2*a2)^2*(a3^2+d4^2) - (px^2+py^2+(pz-d1)^2 - d3^2 - a2^2 - a3^2 - d4^2)^2), px^2+py^2+(pz-d1)^2 - d3^2 - a2^2 - a3^2 - d4^2)",
    ),
    dict(
        joint=2,
        equation=[
            "(a2+a3*c3-d4*s3)*c2 - (d4*c3+a3*s3)*s2 = px*c1+py*s1",
            "(a2+a3*c3-d4*s3)*s2 + (d4*c3+a3*s3)*c2 = pz-d1",
        ],
        solution="atan2((a2+a3*c3-d4*s3)*(pz-d1) - (d4*c3+a3*s3)*(px*c1+py*s1), (a2+a3*c3-d4*s3)*(px*c1+py*s1)+(d4*c3+a3*s3)*(pz-d1))",
    ),
    dict(
        joint=4,
        equation="s4*(c23*(c1*r13+s1*r23)+s23*r33) = c4*(c1*r23 - s1*r13)",
        solution=[
            "atan2(c1*r23-s1*r13, c23*(c1*r13+s1*r23)+s23*r33)",
            "atan2(-(c1*r23-s1*r13), -(c23*(c1*r13+s1*r23)+s23*r33))",
        ],
    ),
    dict(
        joint=5,
        equation=[
            "c5 = c23*r33 - s23*(c1*r13+s1*r23)",
            "s5 = -c4*(c23*(c1*r13+s1*r23)+s23*r33) - s4*(c1*r23-s1*r13)",
        ],
        solution="atan2(-c4*(c23*(c1*r13+s1*r23)+s23*r33) - s4*(c1*r23-s1*r13), c23*r33 - s23*(c1*r13+s1*r23))",
    ),
    dict(
        joint=6,
        equation=[
            "s6 = c4*(c1*r21-s1*r11) - s4*(c23*(c1*r11+s1*r21)+s23*r31)",
            "c6 = c4*(c1*r22-s1*r12) - s4*(c23*(c1*r12+s1*r22)+s23*r32)",
        ],
        solution="atan2(c4*(c1*r21-s1*r11) - s4*(c23*(c1*r11+s1*r21)+s23*r31), c4*(c1*r22-s1*r12) - s4*(c23*(c1*r12+s1*r22)+s23*r32))",
    ),
]
P2 = [
    dict(
        joint=2,
        equation="px^2+py^2 = l1^2 + l2^2 + 2*l1*l2*c2",
        solution="±acos((px^2+py^2-l1^2-l2^2)/(2*l1*l2))",
    ),
    dict(
        joint=1,
        equation=["(l1+l2*c2)*c1 - l2*s2*s1 = px", "(l1+l2*c2)*s1 + l2*s2*c1 = py"],
        solution="atan2(py,px) - atan2(l2*s2, l1+l2*c2)",
    ),
]
P3 = [
    dict(
        joint=2,
        equation="(px-l3*r11)^2+(py-l3*r21)^2 = l1^2+l2^2+2*l1*l2*c2",
        solution="±acos(((px-l3*r11)^2+(py-l3*r21)^2-l1^2-l2^2)/(2*l1*l2))",
    ),
    dict(
        joint=1,
        equation=["(l1+l2*c2)*c1 - l2*s2*s1 = px-l3*r11", "(l1+l2*c2)*s1 + l2*s2*c1 = py-l3*r21"],
        solution="atan2(py-l3*r21,px-l3*r11) - atan2(l2*s2, l1+l2*c2)",
    ),
    dict(joint=3, equation=["c123 = r11", "s123 = r21"], solution="atan2(r21,r11) - q1 - q2"),
]
SC = [
    dict(
        joint=2,
        equation="px^2+py^2 = a1^2+a2^2+2*a1*a2*c2",
        solution="±acos((px^2+py^2-a1^2-a2^2)/(2*a1*a2))",
    ),
    dict(
        joint=1,
        equation=["(a1+a2*c2)*c1 - a2*s2*s1 = px", "(a1+a2*c2)*s1 + a2*s2*c1 = py"],
        solution="atan2(py,px) - atan2(a2*s2, a1+a2*c2)",
    ),
    dict(joint=3, equation="pz = d1 - q3", solution="d1 - pz"),
    dict(
        joint=4,
        equation=["cos(q1+q2-q4) = r11", "sin(q1+q2-q4) = r21"],
        solution="q1+q2-atan2(r21,r11)",
    ),
]
UR = [
    dict(
        joint=1,
        equation="(px-d6*r13)*s1 - (py-d6*r23)*c1 = d4",
        solution="atan2(px-d6*r13,-(py-d6*r23)) ± atan2(sqrt((px-d6*r13)^2+(py-d6*r23)^2-d4^2), d4)",
    ),
    dict(joint=5, equation="c5 = r13*s1 - r23*c1", solution="±acos(r13*s1-r23*c1)"),
    dict(
        joint=6,
        equation=["s5*c6 = r11*s1 - r21*c1", "s5*s6 = -(r12*s1 - r22*c1)"],
        solution="atan2(-(r12*s1-r22*c1)/s5,(r11*s1-r21*c1)/s5)",
    ),
]
ST = [
    dict(
        joint=1,
        equation="px*s1 - py*c1 = a3 - d2",
        solution="atan2(px,-py) ± atan2(sqrt(px^2+py^2-(d2-a3)^2), a3-d2)",
    ),
    dict(
        joint=3,
        equation="(px*c1+py*s1)^2 + (pz-d1)^2 = q3^2",
        solution="±sqrt((px*c1+py*s1)^2 + (pz-d1)^2)",
    ),
    dict(
        joint=2,
        equation=["q3*s2 = px*c1+py*s1", "q3*c2 = pz - d1"],
        solution="atan2((px*c1+py*s1)/q3,(pz-d1)/q3)",
    ),
]
ARMS = dict(puma560=PUMA, planar2r=P2, planar3r=P3, cobra600=SC, ur5=UR, stanford=ST)
"""Right steps by robot; those of the UR and the Stanford arm are not complete."""

MISTAKES = [
    ("puma560", 0, "equation", None, "tan(q1) = py/px", "shoulder_offset_forgotten"),
    ("puma560", 0, "equation", None, "px*s1 - py*c1 = 0.15", "rounded_length"),
    (
        "puma560",
        0,
        "solution",
        None,
        ["atan2(py,px) - atan2(d3, sqrt(px^2+py^2-d3^2))"],
        "term_sign",
    ),
    ("puma560", 1, "solution", "atan2(-d4, a3) ±", "±", "missing_offset"),
    (
        "puma560",
        1,
        "solution",
        None,
        [
            "-atan2(d4,a3) ± acos(-(px^2+py^2+(pz-d1)^2 - d3^2 - a2^2 - a3^2 - d4^2)/(2*a2*sqrt(a3^2+d4^2)))"
        ],
        "supplement",
    ),
    ("puma560", 1, "equation", " - a3^2", "", "length_forgotten|term_sign"),
    (
        "puma560",
        1,
        "equation",
        None,
        "-2*a2*d4*s3 = px^2+py^2+(pz-d1)^2 - d3^2 - a2^2 - d4^2",
        "length_taken_as_zero",
    ),
    (
        "puma560",
        2,
        "equation",
        None,
        ["a2*c2 + a3*c3 - d4*s3 = px*c1+py*s1", "a2*s2 + a3*s3 + d4*c3 = pz-d1"],
        "sum_of_angles_forgotten",
    ),
    (
        "puma560",
        2,
        "solution",
        None,
        ["atan2(pz-d1, sqrt(px^2+py^2-d3^2)) - atan2(d4*c3+a3*s3, a2+a3*c3-d4*s3)"],
        "sign_lost",
    ),
    ("puma560", 3, "solution", None, ["atan2(r23,r13)"], "rotation_not_reduced"),
    (
        "puma560",
        3,
        "solution",
        None,
        ["atan2(c1*r23-s1*r13, c2*(c1*r13+s1*r23)+s2*r33)"],
        "sum_of_angles_forgotten",
    ),
    ("ur5", 0, "equation", None, "(px+d6*r13)*s1 - (py+d6*r23)*c1 = d4", "tool_length_added"),
    ("ur5", 0, "equation", None, "(px-d6*r11)*s1 - (py-d6*r21)*c1 = d4", "tool_axis_exchanged"),
    ("ur5", 1, "solution", None, ["±acos((px*s1-py*c1)/d6)"], "length_forgotten"),
    ("ur5", 2, "solution", None, ["atan2(-(r12*s1-r22*c1), r11*s1-r21*c1)"], "divisor_sign_lost"),
    ("planar2r", 0, "equation", None, "sqrt(px^2+py^2) = l1^2+l2^2+2*l1*l2*c2", "root_too_much"),
    (
        "planar2r",
        1,
        "solution",
        None,
        ["atan2(py,px) - atan2(l2*s2, l2+l1*c2)"],
        "lengths_exchanged",
    ),
    (
        "planar3r",
        0,
        "solution",
        None,
        ["±acos(((px-l3*r11)^2+(py-l3*r12)^2-l1^2-l2^2)/(2*l1*l2))"],
        "rotation_matrix_transposed",
    ),
    ("puma560", 0, "equation", "- py*c1", "+ py*c1", "term_sign"),
    ("puma560", 0, "equation", "= d3", "= 0", "shoulder_offset_forgotten"),
    ("puma560", 0, "equation", "= d3", "= -d3", "term_sign"),
    ("puma560", 0, "equation", "px*s1 - py*c1", "px*c1 - py*s1", "axis_exchanged|term_function"),
    ("puma560", 0, "equation", "= d3", "= d4", "term_parameter"),
    ("puma560", 0, "solution", "atan2(px,-py)", "atan2(-py,px)", "atan2_arguments"),
    (
        "puma560",
        0,
        "solution",
        None,
        ["atan2(py,px)", "atan2(-py,-px)"],
        "shoulder_offset_forgotten",
    ),
    ("puma560", 0, "solution", None, ["atan(py/px) + asin(d3/sqrt(px^2+py^2))"], "quadrant"),
    ("puma560", 0, "solution", "-d3^2", "+d3^2", "term_sign"),
    ("puma560", 1, "equation", "2*a2*(", "a2*(", "term_factor|cosine_law_factor"),
    ("puma560", 1, "equation", "(pz-d1)^2", "pz^2", "offset_forgotten"),
    ("puma560", 1, "equation", "- d4*s3", "+ d4*s3", "term_sign"),
    ("puma560", 1, "equation", "- d3^2 ", "", "length_forgotten|term_sign|offset_forgotten"),
    ("puma560", 1, "equation", "- a2^2", "+ a2^2", "term_sign|cosine_law_sign"),
    ("puma560", 2, "equation", "px*c1+py*s1", "px*s1+py*c1", "axis_exchanged|term_function"),
    ("puma560", 2, "equation", "= pz-d1", "= pz", "offset_forgotten|length_forgotten"),
    ("puma560", 2, "solution", "atan2((a2", "-atan2((a2", "joint_sign"),
    ("puma560", 3, "equation", "all_transposed", None, "rotation_matrix_transposed"),
    ("puma560", 3, "solution", "all_transposed", None, "rotation_matrix_transposed"),
    ("puma560", 3, "equation", "+s23*r33", "-s23*r33", "term_sign"),
    ("puma560", 4, "equation", "c5 = c23", "s5 = c23", "term_function"),
    ("puma560", 4, "solution", None, ["acos(c23*r33 - s23*(c1*r13+s1*r23))"], "sign_lost"),
    ("puma560", 5, "solution", "atan2(", "-atan2(", "joint_sign"),
    ("puma560", 5, "solution", "all_transposed", None, "rotation_matrix_transposed"),
    ("planar2r", 0, "equation", "+ 2*l1*l2*c2", "- 2*l1*l2*c2", "supplement"),
    ("planar2r", 0, "equation", "2*l1*l2", "l1*l2", "term_factor|cosine_law_factor"),
    (
        "planar2r",
        0,
        "solution",
        None,
        ["acos((l1^2+l2^2-px^2-py^2)/(2*l1*l2))"],
        "supplement|cosine_law_sign|elbow_sign",
    ),
    (
        "planar2r",
        0,
        "solution",
        None,
        ["acos((px^2+py^2-l1^2-l2^2)/(2*l1*l2))", "acos((px^2+py^2-l1^2-l2^2)/(2*l1*l2))"],
        "duplicate_branch",
    ),
    ("planar2r", 1, "solution", "- atan2(l2", "+ atan2(l2", "term_sign"),
    ("planar2r", 1, "solution", " - atan2(l2*s2, l1+l2*c2)", "", "triangle_angle_forgotten"),
    ("planar2r", 1, "solution", None, ["atan(py/px) - atan2(l2*s2, l1+l2*c2)"], "quadrant"),
    ("planar2r", 1, "solution", "atan2(py,px)", "atan2(px,py)", "atan2_arguments"),
    (
        "planar3r",
        0,
        "equation",
        None,
        "px^2+py^2 = l1^2+l2^2+2*l1*l2*c2",
        "tool_length_forgotten|axis_exchanged",
    ),
    (
        "planar3r",
        0,
        "solution",
        None,
        ["±acos((px^2+py^2-l1^2-l2^2)/(2*l1*l2))"],
        "tool_length_forgotten",
    ),
    ("planar3r", 2, "solution", " - q2", "", "earlier_joints_forgotten"),
    (
        "planar3r",
        2,
        "solution",
        "atan2(r21,r11)",
        "atan2(r12,r11)",
        "rotation_matrix_transposed|joint_sign|axis_exchanged",
    ),
    ("cobra600", 2, "solution", "d1 - pz", "pz - d1", "joint_sign"),
    ("cobra600", 2, "equation", "pz = d1 - q3", "pz = -q3", "length_forgotten|offset_forgotten"),
    ("cobra600", 3, "equation", "-q4", "+q4", "term_sign"),
    (
        "cobra600",
        1,
        "solution",
        "atan2(a2*s2, a1+a2*c2)",
        "atan2(a1*s2, a2+a1*c2)",
        "lengths_exchanged|term_parameter",
    ),
    ("ur5", 0, "equation", "= d4", "= 0", "shoulder_offset_forgotten"),
    ("ur5", 0, "equation", None, "px*s1 - py*c1 = d4", "tool_length_forgotten"),
    ("ur5", 1, "equation", "r13*s1", "r31*s1", "rotation_matrix_transposed"),
    ("ur5", 1, "equation", "- r23*c1", "+ r23*c1", "term_sign"),
    ("ur5", 2, "equation", "s5*c6", "c5*c6", "term_function"),
    ("ur5", 2, "solution", "atan2(-(", "atan2((", "term_sign|joint_sign"),
    ("stanford", 0, "equation", "a3 - d2", "d2 - a3", "term_sign|lengths_exchanged"),
    (
        "stanford",
        0,
        "equation",
        "a3 - d2",
        "- d2",
        "lengths_exchanged|term_parameter|shoulder_offset_forgotten|term_extra",
    ),
    ("stanford", 1, "equation", "(pz-d1)^2", "pz^2", "offset_forgotten"),
    ("stanford", 1, "solution", None, ["(px*c1+py*s1)^2 + (pz-d1)^2"], "root_forgotten"),
    ("stanford", 2, "equation", "pz - d1", "pz", "offset_forgotten|length_forgotten"),
]
"""Robot, step, equation or solution, what is replaced (None: all), by what, and the mistakes that it may be called."""

RIGHT = [
    ("puma560", 0, "equation", None, r"p_x \sin\theta_1 - p_y \cos\theta_1 = d_3"),
    ("puma560", 0, "equation", None, "d3 + py*cos(q1) == px*sin(q1)"),
    ("puma560", 0, "equation", None, "2*px*s1 - 2*py*c1 - 2*d3 = 0"),
    ("puma560", 0, "equation", None, "px*sin(th1) - py*cos(th1) = 0.15005"),
    ("puma560", 0, "equation", None, "px*s1/d3 - py*c1/d3 = 1"),
    ("puma560", 0, "equation", None, "(px*s1 - d3)^2 = py^2*c1^2"),
    ("puma560", 0, "solution", None, "atan2(py, px) + asin(d3/sqrt(px**2 + py**2))"),
    ("puma560", 0, "solution", None, "q1 = atan2(py,px) + atan2(d3, ±sqrt(px^2+py^2-d3^2))"),
    (
        "puma560",
        0,
        "solution",
        None,
        ["atan2(py, px) + atan2(0.15005, sqrt(px^2 + py^2 - 0.15005^2))"],
    ),
    (
        "puma560",
        1,
        "equation",
        None,
        "px^2 + py^2 + (pz - d1)^2 = a2^2 + a3^2 + d4^2 + d3^2 + 2*a2*a3*c3 - 2*a2*d4*s3",
    ),
    (
        "puma560",
        3,
        "equation",
        None,
        "tan(q4) = (c1*r23 - s1*r13)/(c23*(c1*r13 + s1*r23) + s23*r33)",
    ),
    (
        "puma560",
        4,
        "equation",
        None,
        "c5 = cos(q2+q3)*r33 - sin(q2+q3)*(cos(q1)*r13 + sin(q1)*r23)",
    ),
    ("planar2r", 0, "equation", None, "cos(q2) = (px^2 + py^2 - l1^2 - l2^2)/(2*l1*l2)"),
    (
        "planar2r",
        0,
        "solution",
        None,
        "atan2(±sqrt(1 - ((px^2+py^2-l1^2-l2^2)/(2*l1*l2))^2), (px^2+py^2-l1^2-l2^2)/(2*l1*l2))",
    ),
    ("planar2r", 0, "solution", None, ["acos((px^2+py^2-l1^2-l2^2)/(2*l1*l2))"]),
    ("planar2r", 1, "equation", None, ["l1*c1 + l2*c12 = px", "l1*s1 + l2*s12 = py"]),
    ("planar2r", 1, "equation", None, "px*s1 - py*c1 = -l2*s2"),
    ("planar2r", 1, "solution", None, "atan2((l1+l2*c2)*py - l2*s2*px, (l1+l2*c2)*px + l2*s2*py)"),
    (
        "planar3r",
        1,
        "equation",
        None,
        ["l1*c1 + l2*c12 + l3*r11 = px", "l1*s1 + l2*s12 + l3*r21 = py"],
    ),
    ("planar3r", 2, "equation", None, ["cos(q1 + q2 + q3) = r22", "sin(q1 + q2 + q3) = -r12"]),
    ("planar3r", 2, "solution", None, "atan2(-r12, r22) - (q1 + q2)"),
    ("cobra600", 2, "equation", None, "q3 + pz - 0.387 = 0"),
    (
        "cobra600",
        3,
        "solution",
        None,
        "atan2(r12, -r22) + q1 + q2 - pi/2 - pi/2 + pi + 0*px - 2*atan2(r12,-r22) - 0",
    ),
    ("ur5", 0, "equation", None, "c1*(py - d6*r23) + d4 = s1*(px - d6*r13)"),
    ("ur5", 1, "equation", None, "(px*s1 - py*c1 - d4)/d6 = c5"),
    ("ur5", 1, "solution", None, "±acos((px*s1 - py*c1 - d4)/d6)"),
    ("stanford", 1, "equation", None, "q3 = sqrt((px*c1+py*s1)^2 + (pz-d1)^2)"),
]
"""Right equations and solutions in other notations."""

TRANSPOSED = {f"r{i}{j}": f"r{j}{i}" for i in "123" for j in "123"}


def with_change(robot, k, key, old, new):
    """Return an arm's steps with a change in step k."""
    steps = copy.deepcopy(ARMS[robot])
    if old is None:
        steps[k][key] = new
        return steps

    def changed(text):
        if old == "all_transposed":
            return re.sub(r"r[123]{2}", lambda match: TRANSPOSED[match[0]], text)
        return text.replace(old, new)

    given = steps[k][key]
    steps[k][key] = [changed(text) for text in given] if isinstance(given, list) else changed(given)
    assert steps != ARMS[robot]
    return steps
