"""Transforms and Jacobians by hand: what goes wrong for those who differentiate the tool's position."""

import pytest
import sympy
from sympy import cos, sin

from acceptance import slow_if
from dhkit import Arm
from dhkit.description import from_dh
from dhkit.errors import AnswerError
from dhkit.grading import Verdict

q1, q2, q3, l1, l2, l3, d1, a2, a3 = sympy.symbols("q1 q2 q3 l1 l2 l3 d1 a2 a3")


class Cosine(sympy.Function):
    """A cosine whose derivative is taken for the sine."""

    def fdiff(self, argindex=1):
        return sympy.Function("sin")(self.args[0])


def planar(lengths, cosine=cos):
    angles = [q1, q1 + q2, q1 + q2 + q3]
    pairs = list(zip(lengths, angles, strict=False))
    return [
        sum(a * cosine(x) for a, x in pairs),
        sum(a * sin(x) for a, x in pairs),
        sympy.Integer(0),
    ]


def elbow(cosine=cos):
    reach = a2 * cosine(q2) + a3 * cosine(q2 + q3)
    return [cosine(q1) * reach, sin(q1) * reach, d1 + a2 * sin(q2) + a3 * sin(q2 + q3)]


def arm_of(name):
    if name != "elbow":
        return Arm.load(name)
    rows = [(0, "d1", 0, "pi/2"), (0, 0, "a2", 0), (0, 0, "a3", 0)]
    return Arm(from_dh(rows, parameters={"d1": 0.4, "a2": 0.5, "a3": 0.3}))


POSITIONS = {
    "planar2r": lambda cosine=cos: planar([l1, l2], cosine),
    "planar3r": lambda cosine=cos: planar([l1, l2, l3], cosine),
    "elbow": elbow,
}
AXES = {
    "planar2r": [[0, 0], [0, 0], [1, 1]],
    "planar3r": [[0, 0, 0], [0, 0, 0], [1, 1, 1]],
    "elbow": [[0, sin(q1), sin(q1)], [0, -cos(q1), -cos(q1)], [1, 0, 0]],
}


def jacobian(name, cosine=cos):
    axes = AXES[name]
    rows = sympy.Matrix(POSITIONS[name](cosine)).jacobian([q1, q2, q3][: len(axes[0])])
    return [*rows.replace(Cosine, cos).doit().tolist(), *axes]


def graded(name, rows):
    report = arm_of(name).grade(J=[[str(entry) for entry in row] for row in rows])
    return report, [one.mistake for one in report.diagnosis]


@pytest.mark.parametrize("name", POSITIONS)
def test_the_derivative_of_the_position_is_the_linear_half(name):
    report, _ = graded(name, jacobian(name))
    assert report.verdict.value == "correct", str(report)


@pytest.mark.parametrize("name", [slow_if(k > 0, name) for k, name in enumerate(POSITIONS)])
def test_a_cosine_differentiated_without_its_minus_sign(name):
    report, found = graded(name, jacobian(name, Cosine))
    assert found == ["derivative_of_cosine"], str(report)


@pytest.mark.parametrize("name", [slow_if(k > 1, name) for k, name in enumerate(POSITIONS)])
def test_rows_of_x_and_y_exchanged(name):
    x, y, *others = jacobian(name)
    report, found = graded(name, [y, x, *others])
    assert found == ["jacobian_x_y_exchanged"], str(report)


def test_axes_in_the_angular_half_that_no_joint_turned():
    report, found = graded("elbow", [*jacobian("elbow")[:3], [0, 0, 0], [0, 0, 0], [1, 1, 1]])
    assert found == ["angular_axes_unturned"], str(report)


@pytest.mark.parametrize(("name", "joints"), [("planar2r", [q1, q2]), ("planar3r", [q1, q2, q3])])
def test_cosines_of_sums_split_up_in_the_pose(name, joints):
    c, s = sum(map(cos, joints)), sum(map(sin, joints))
    x, y, z = (
        p.replace(cos, lambda u: sum(map(cos, u.args)) if u.is_Add else cos(u)).replace(
            sin, lambda u: sum(map(sin, u.args)) if u.is_Add else sin(u)
        )
        for p in POSITIONS[name]()
    )
    T = [[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]]
    report = Arm.load(name).grade(T=[[str(entry) for entry in row] for row in T])
    assert [one.mistake for one in report.diagnosis] == ["sum_of_angles_split"], str(report)


ROWS = [["-l1*s1 - l2*s12", "-l2*s12"], ["l1*c1 + l2*c12", "l2*c12"], ["1", "1"]]
"""Positions in the plane, and the angle, of planar2r."""


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("as_text", [False, True])
def test_a_planar_jacobian_has_the_rows_of_its_plane(count, as_text):
    arm = Arm.load("planar2r")
    rows = ROWS[:count]
    text = "[" + "; ".join(", ".join(row) for row in rows) + "]"
    report = arm.grade({"J": text if as_text else rows})
    assert report.verdict is Verdict.CORRECT
    assert len(report.entries) == 2 * count
    wrong = [["l1*s1 - l2*s12", "-l2*s12"], *rows[1:]]
    found = arm.grade({"J": wrong})
    assert [entry.index for entry in found.entries if not entry.verdict.passes] == [(0, 0)]


def test_three_rows_of_other_arms_are_the_position():
    """A turntable with a slide that reaches outwards and upwards."""
    arm = Arm.from_dh([(0, 0.3, 0, "pi/2"), (0, 0, 0.5, 0)])
    rows = [["-0.5*s1*c2", "-0.5*c1*s2"], ["0.5*c1*c2", "-0.5*s1*s2"], ["0", "0.5*c2"]]
    assert arm.grade({"J": rows}).verdict.passes
    assert not arm.grade({"J": [*rows[:2], ["0", "-0.5*c2"]]}).verdict.passes


def test_other_numbers_of_rows_are_refused():
    with pytest.raises(AnswerError, match="J: found a list of 4; expected a list of 6"):
        Arm.load("planar2r").grade({"J": [["1", "1"]] * 4})


def test_a_task_says_which_rows_are_asked_for():
    arm = Arm.load("planar2r")
    rows = [["1", "1"], ["-l1*s1 - l2*s12", "-l2*s12"], ["l1*c1 + l2*c12", "l2*c12"]]
    task = {"J_rows": ["wz", "vx", "vy"]}
    report = arm.grade({"J": rows}, task=task)
    assert report.verdict is Verdict.CORRECT and report.entries[0].name == "J61"
    assert arm.grade({"J": [rows[1], rows[0], rows[2]]}, task=task).verdict is Verdict.WRONG
    with pytest.raises(AnswerError, match="expected a list of 3"):
        arm.grade({"J": rows[:2]}, task=task)
    for wrong in (["vx", "vx"], ["phi"], "vx"):
        with pytest.raises(AnswerError, match=r"task\.J_rows"):
            arm.grade({"J": rows}, task={"J_rows": wrong})


@pytest.mark.slow
def test_the_four_rows_of_a_scara():
    # vx, vy, vz and wz; the slide's axis points down.
    arm = Arm.load("cobra600")
    c12, s12 = "0.275*cos(q1+q2)", "0.275*sin(q1+q2)"
    right = [
        [f"-0.325*sin(q1)-{s12}", f"-{s12}", "0", "0"],
        [f"0.325*cos(q1)+{c12}", c12, "0", "0"],
        ["0", "0", "-1", "0"],
        ["1", "1", "0", "-1"],
    ]
    assert arm.grade({"J": right}).verdict.passes
    wrong = [*right[:2], ["0", "0", "1", "0"], right[3]]
    assert [
        entry.name for entry in arm.grade({"J": wrong}).entries if not entry.verdict.passes
    ] == ["J33"]
