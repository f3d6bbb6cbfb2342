"""Letters are letters: one that is left out is not a number, though its value is 1 or that of another letter."""

import re

import numpy as np
import pytest

from dhkit import Arm
from dhkit.description import from_toml, library_robot, to_toml
from dhkit.grading.remarks import NoteKind
from grading_answers import written

VALUES = (1.0, 1.0, 0.5, 2.0, 0.7)
"""Values that letters take: several are equal, are 1, or multiply to 1."""
LETTER = re.compile(r"(?<![\w.])(g|l1|l2|m1|m2)(\^2)?(?![\w(^])")


def with_values(rng):
    """Return a planar arm whose letters have values of these."""
    text = to_toml(library_robot("planar2r"))
    for name in ("g", "l1", "l2", "m1", "m2"):
        text, count = re.subn(rf"(?m)^{name} = [\d.]+$", f"{name} = {rng.choice(VALUES)}", text)
        assert count == 1
    return Arm(from_toml(text))


def without_one_letter(rng, answer):
    """Return an answer in which one letter, or its square, is left out in one place."""
    place = rng.choice(list(LETTER.finditer(answer)))
    before, after = answer[: place.start()], answer[place.end() :]
    if after.startswith("*"):
        return before + after[1:]
    return before[:-1] + after if before.endswith("*") else f"{before}1{after}"


@pytest.mark.slow
def test_an_answer_that_lacks_a_letter_is_not_right(law):
    rng = np.random.default_rng(0)
    for _ in range(law.samples(5000, quick=60)):
        arm = with_values(rng)
        quantity = str(rng.choice(["M", "h", "g"]))
        elements = getattr(arm.lagrangian, quantity)
        entries = written(elements, arm.lagrangian.arm)
        i = int(rng.integers(2))
        place = (i, i) if quantity == "M" else (i,)
        right = entries[i][i] if quantity == "M" else entries[i]
        if not LETTER.search(right):
            continue
        wrong = without_one_letter(rng, right)
        if quantity == "M":
            entries[i][i] = wrong
        else:
            entries[i] = wrong
        report = arm.grade({quantity: entries}, explain=False)
        passes = [entry.verdict.passes for entry in report.entries if entry.index == place]
        law.holds(
            "answers without a letter that pass",
            sum(passes),
            0,
            (wrong, dict(arm.description.parameters)),
        )


def test_numbers_may_stand_where_they_are_written():
    arm = Arm.load("planar2r")
    numbers = {name: float(value) for name, value in arm.description.numbers.values.items()}
    g = written(arm.lagrangian.g, arm.lagrangian.arm)
    with_number = [re.sub(r"\bg\b", f"{numbers['g']}", entry) for entry in g]
    assert arm.grade({"g": with_number}).verdict.passes


def test_a_sheet_without_letters_is_judged_at_the_values_of_the_file():
    arm = Arm.load("planar2r")
    values = {name: f"({float(value)})" for name, value in arm.description.numbers.values.items()}
    g = [
        LETTER.sub(lambda m: values[m[1]] + (m[2] or ""), entry)
        for entry in written(arm.lagrangian.g)
    ]
    report = arm.grade({"g": g})
    assert report.verdict.passes
    assert "judged at" in str(report)


@pytest.mark.parametrize("pair", [("l1", "l2"), ("m1", "m2")])
def test_a_letter_of_the_same_value_is_another_letter(pair):
    text = to_toml(library_robot("planar2r"))
    for name in pair:
        text = re.sub(rf"(?m)^{name} = [\d.]+$", f"{name} = 0.5", text)
    arm = Arm(from_toml(text))
    g = written(arm.lagrangian.g, arm.lagrangian.arm)
    exchanged = [re.sub(rf"\b{pair[0]}\b", pair[1], entry) for entry in g]
    assert not arm.grade({"g": exchanged}).verdict.passes


def test_a_task_may_ask_for_letters():
    arm = Arm.load("planar2r")
    values = {name: f"({float(value)})" for name, value in arm.description.numbers.values.items()}
    g = [
        LETTER.sub(lambda m: values[m[1]] + (m[2] or ""), entry)
        for entry in written(arm.lagrangian.g)
    ]
    report = arm.grade({"g": g}, task={"values": False})
    assert report.verdict.value == "incomplete"
    assert all("the task asks for letters" in entry.statement for entry in report.entries)
    assert arm.grade({"g": g}, task={"values": True}).verdict.passes
    assert arm.grade({"g": written(arm.lagrangian.g)}, task={"values": False}).verdict.passes


def with_lengths(l1, l2):
    text = to_toml(library_robot("planar2r"))
    for name, value in (("l1", l1), ("l2", l2)):
        text = re.sub(rf"(?m)^{name} = [\d.]+$", f"{name} = {value}", text)
    return Arm(from_toml(text))


RIGHT = "acos((px^2 + py^2 - l1^2 - l2^2)/(2*l1*l2))"
FIRST = "atan2(py, px) - atan2(l2*sin(q2), l1 + l2*cos(q2))"
INVERSE = {
    "right": (RIGHT, FIRST, True),
    "a length left out": (RIGHT.replace("2*l1*l2", "2*l2"), FIRST, False),
    "lengths exchanged": (RIGHT, "atan2(py, px) - atan2(l1*sin(q2), l2 + l1*cos(q2))", False),
    "a length not squared": (RIGHT.replace("l1^2", "l1"), FIRST, False),
    "numbers": (
        RIGHT.replace("l1", "1").replace("l2", "1"),
        "atan2(py, px) - atan2(sin(q2), 1 + cos(q2))",
        True,
    ),
}


@pytest.mark.parametrize("name", INVERSE)
def test_inverse_kinematics_in_letters_is_right_at_other_values_too(name):
    arm = with_lengths(1.0, 1.0)
    second, first, passes = INVERSE[name]
    steps = [{"joint": 2, "solution": f"±{second}"}, {"joint": 1, "solution": first}]
    report = arm.grade({"ik": {"steps": steps}})
    assert report.verdict.passes == passes, str(report)
    by_chance = any(note.kind is NoteKind.ONLY_AT_VALUES for note in report.notes)
    assert by_chance == (not passes)


PLANAR = {"l1": 0.5, "l2": 0.4}
ACOS = "±acos((px^2+py^2-{})/({}))"
BOTH = "atan2(py,px)-atan2({l2}*s2,{l1}+{l2}*c2)"


@pytest.mark.parametrize(
    ("squares", "product", "shoulder", "verdicts", "at_values"),
    [
        ("l1^2-l2^2", "2*l1*l2", BOTH.format(l1="l1", l2="l2"), ["correct", "correct"], {}),
        ("0.41", "0.4", BOTH.format(l1="0.5", l2="0.4"), ["correct", "correct"], PLANAR),
        (
            "0.25-l2^2",
            "2*0.5*l2",
            BOTH.format(l1="0.5", l2="l2"),
            ["correct", "correct"],
            {"l1": 0.5},
        ),
        (
            "0.25-l2^2",
            "1.0*l2",
            BOTH.format(l1="0.5", l2="l2"),
            ["correct", "correct"],
            {"l1": 0.5},
        ),
        ("0.25-l2^2", "l2", BOTH.format(l1="0.5", l2="l2"), ["wrong", "correct"], {"l1": 0.5}),
        ("l1^2-l2^2", "l2", BOTH.format(l1="l1", l2="l2"), ["wrong", "correct"], {}),
    ],
)
def test_numbers_in_inverse_kinematics_stand_where_they_are_written(
    squares, product, shoulder, verdicts, at_values
):
    steps = [
        {"joint": 2, "solution": ACOS.format(squares, product)},
        {"joint": 1, "solution": shoulder},
    ]
    arm = Arm.load("planar2r")
    report = arm.grade({"ik": {"steps": steps}}, explain=False)
    assert [entry.verdict.value for entry in report.entries] == verdicts
    assert report.at_values == at_values
    in_letters = arm.grade({"ik": {"steps": steps}}, task={"values": False}, explain=False)
    assert in_letters.verdict.passes == (verdicts == ["correct", "correct"] and not at_values)


@pytest.mark.parametrize(
    ("lengths", "squares", "product", "shoulder"),
    [
        ((1.0, 0.5), "a1^2-a2^2", "2*a2", ("a1", "a2")),
        ((1.0, 0.5), "a1-a2^2", "2*a1*a2", ("a1", "a2")),
        ((0.4, 0.4), "2*a1^2", "2*a1*a2", ("a2", "a1")),
    ],
)
def test_lengths_of_the_table_are_letters_in_inverse_kinematics(
    lengths, squares, product, shoulder
):
    arm = Arm.from_dh([(0, 0, length, 0) for length in lengths])
    first, second = shoulder
    wrong = [
        {"joint": 2, "solution": ACOS.format(squares, product)},
        {"joint": 1, "solution": BOTH.format(l1=first, l2=second)},
    ]
    assert not arm.grade({"ik": {"steps": wrong}}, explain=False).entries[0].verdict.passes
    right = [
        {"joint": 2, "solution": ACOS.format("a1^2-a2^2", "2*a1*a2")},
        {"joint": 1, "solution": BOTH.format(l1="a1", l2="a2")},
    ]
    assert arm.grade({"ik": {"steps": right}}, explain=False).verdict.passes


@pytest.mark.parametrize(
    ("values", "answer"),
    [
        ({}, {"V": "g*l1*s1+m2*g*(l1*s1+l2*s12/2)"}),
        ({}, {"K": "l1^2*qd1^2/3+m2*(l1^2*qd1^2+l2^2*(qd1+qd2)^2/3+l1*l2*c2*qd1*(qd1+qd2))/2"}),
        ({}, {"h": ["-m2*l2*s2*(qd1*qd2 + qd2^2/2)/2", "m2*l2*s2*qd1^2/4"]}),
        ({"l2": 2.0}, {"V": "m1*g*l1/2*s1+m2*g*(l1*s1+s12)"}),
        ({"l2": 2.0}, {"C": [["-m2*l1*s2*qd2", "-m2*l1*s2*(qd1+qd2)"], ["m2*l1*s2*qd1", "0"]]}),
        (
            {"m2": 3.0},
            {
                "M": [["m1*l1^2/3+m2*(l1^2+l2^2/3+l1*l2*c2)", "m2*l2*(l2/3+l1*c2/2)"]] * 1
                + [["0", "l2^2"]]
            },
        ),
        ({"l2": 2.0}, {"g": ["m1*g*l1*c1/2+m2*g*(l1*c1+c12)", "m2*g*(2*cos((q1+q2)/2)^2-1)"]}),
    ],
)
def test_a_letter_whose_value_cancels_a_factor_of_the_truth_is_left_out(values, answer):
    text = to_toml(library_robot("planar2r"))
    for name, value in values.items():
        text = re.sub(rf"(?m)^{name} = [\d.]+$", f"{name} = {value}", text)
    report = Arm(from_toml(text)).grade(answer, explain=False)
    assert not report.verdict.passes, str(report)
    assert not report.at_values


def test_a_letter_of_value_0_is_a_letter():
    text = re.sub(r"(?m)^l2 = [\d.]+$", "l2 = 0.4\ne = 0.0", to_toml(library_robot("planar2r")))
    arm = Arm(from_toml(text.replace("d = 0", 'd = "e"', 1)))
    rows = [["q1", "e", "l1", "0"], ["q2", "0", "l2", "0"]]
    table = {"convention": "standard", "rows": rows}
    assert arm.grade({"dh": table}).verdict.passes
    rows[0][1] = "0"
    assert arm.grade({"dh": table}).entries[0].verdict.value == "wrong"
    assert (
        arm.grade(
            {
                "T": [
                    ["c12", "-s12", "0", "l1*c1+l2*c12"],
                    ["s12", "c12", "0", "l1*s1+l2*s12"],
                    ["0", "0", "1", "0"],
                    ["0", "0", "0", "1"],
                ]
            }
        ).verdict.value
        == "wrong"
    )


def test_a_christoffel_c_in_numbers_is_called_that():
    arm = Arm.load("planar2r")
    values = {name: f"({float(value)})" for name, value in arm.description.numbers.values.items()}
    C = [
        [LETTER.sub(lambda m: values[m[1]] + (m[2] or ""), entry) for entry in row]
        for row in written(arm.lagrangian.C)
    ]
    kinds = [note.kind for note in arm.grade({"C": C}).notes]
    assert NoteKind.CHRISTOFFEL in kinds and NoteKind.NOT_SKEW not in kinds
