"""Statements of tasks: they say what the task asks for, with the arm's numbers, and show names as they are."""

import tomllib

import pytest

from dhkit.description import library_robot, with_parameters, with_tool
from dhkit.description.poses import pose
from dhkit.grading.answers.sheet import sheet_of
from dhkit.report.document import html_text, typst_text
from dhkit.report.statement import arm_html, statement

ARM = library_robot("planar2r")


def page(task="", names="", description=ARM, student="ada"):
    tables = tomllib.loads(f"[task]\n{task}\n[names]\n{names}\n[answer]\nV = '0'\n")
    document = statement(description, sheet_of(tables), student, "sheet.toml", b"")
    assert typst_text(document)
    return html_text(document)


@pytest.mark.parametrize(
    ("task", "sentence"),
    [
        ("", "the answer sheet lists those that can be handed in"),
        ('asked = ["M"]', "M: Mass matrix"),
        ('asked = ["A2"]', "A2: Transform from frame 2 to frame 1"),
        ('asked = ["ik", "dh"]', "Inverse kinematics: each joint value"),
        ('asked = ["J"]\nJ_rows = ["vx", "wz"]', "Rows of J, in this order: vx, wz."),
        ("friction = true", "includes the viscous friction"),
        ("total_derivative = true", "total time derivative"),
        ('proof = "required"', "only if it can be proved"),
        ('frames = "given"', "must have the frames of the table"),
        ('zero = "given"', "the zero pose of the table"),
        ("values = false", "answers in numbers do not pass"),
    ],
)
def test_a_requirement_is_stated_where_the_task_has_it(task, sentence):
    assert sentence in page(task)
    assert task == "" or sentence not in page()


def test_names_are_those_of_the_task():
    text = page(names='q = ["a", "b"]\nangles = "absolute"\nparameters = { lc1 = "l1/2" }')
    for words in ("a, b", "Angles count from a fixed direction", "lc1 stands for", "l1/2"):
        assert words in text
    assert "q1, q2" in page() and "qdd1, qdd2" in page()


def test_bodies_are_shown_where_the_dynamics_are_asked_for():
    assert "centre of mass" in page('asked = ["K"]') and "m1*l1^2" not in page('asked = ["T"]')
    assert "centre of mass" not in page('asked = ["T", "dh"]')


def test_numbers_and_the_tool_are_those_of_the_arm():
    arm = with_tool(with_parameters(ARM, l1=0.47, l2="l1/3"), pose((0.1, 0, 0), quat=(0, 0, 1, 1)))
    text = page(description=arm)
    for words in ("0.47", "l1/3", "The tool lies at (0.1, 0, 0) m in frame 2, turned by roll"):
        assert words in text
    assert "The tool lies" not in page()


def test_the_name_of_a_student_is_shown_as_it_is():
    assert "<b>" not in page(student="<b>x</b>")


def test_rotors_are_printed_where_equations_of_motion_are_asked_for():
    puma = library_robot("puma560")
    assert "Drives: inertia of the rotor" in arm_html(puma, ["M"])
    assert "Drives" not in arm_html(puma, ["T"])
    assert "Drives" not in arm_html(library_robot("planar2r"), ["M"])
