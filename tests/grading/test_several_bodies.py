"""Students' answers about links of several bodies: the payload forgotten, misplaced, or exchanged is named so."""

import pytest

from dhkit import Arm
from dhkit.description import read_robot
from dhkit.grading import Verdict
from dhkit.grading.explanation import explanation_text
from dhkit.grading.judging.truth import truth_of
from dhkit.grading.mistakes.diagnosis import variants_of
from dhkit.symbolic.mistakes import MadeAt
from dhkit.symbolic.ring import element_array
from dhkit.symbolic.textbook import derive
from grading_answers import named, written

FILE = """
format = 1
name = "loaded2r"
convention = "modified"
gravity = [0, "-g", 0]
[parameters]
g = 9.81
l1 = 0.5
l2 = 0.4
lc = 0.18
m1 = 2.0
m2 = 1.5
mp = 0.7
I2 = 0.03

[[joint]]
type = "revolute"
a = 0
alpha = 0
d = 0
theta = 0
body = { mass = "m1", com = ["l1/2", 0, 0], inertia = { yy = "m1*l1^2/12", zz = "m1*l1^2/12" } }

[[joint]]
type = "revolute"
a = "l1"
alpha = 0
d = 0
theta = 0
bodies = [
    { name = "arm", mass = "m2", com = ["lc", 0, 0], inertia = { yy = "I2", zz = "I2" } },
    { name = "payload", mass = "mp", com = ["l2", 0, 0] },
]
[tool]
xyz = ["l2", 0, 0]
"""
V = "{m1}*g*l1/2*s1 + {m2}*g*(l1*s1 + lc*s12) + {mp}*g*(l1*s1 + {at}*s12)"
G = [
    "({m1}*l1/2 + ({m2} + {mp})*l1)*g*c1 + ({m2}*lc + {mp}*{at})*g*c12",
    "({m2}*lc + {mp}*{at})*g*c12",
]
M22 = "I2 + {m2}*lc^2 + {mp}*{at}^2"
M12 = M22 + " + ({m2}*lc + {mp}*{at})*l1*c2"
M11 = M22 + " + {m1}*l1^2/3 + ({m2} + {mp})*l1^2 + 2*({m2}*lc + {mp}*{at})*l1*c2"
RIGHT = {"m1": "m1", "m2": "m2", "mp": "mp", "at": "l2"}


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("robots") / "loaded2r.toml"
    path.write_text(FILE)
    return Arm(read_robot(path))


def answers(**changed):
    values = RIGHT | changed

    def entry(text):
        return text.format(**values)

    return {
        "g": [entry(text) for text in G],
        "M": [[entry(M11), entry(M12)], [entry(M12), entry(M22)]],
        "V": entry(V),
    }


def test_right_answers_are_right(arm):
    assert arm.grade(answers()).verdict is Verdict.CORRECT


@pytest.mark.parametrize("quantities", [("g",), ("M",), ("V",), ("g", "M", "V")])
@pytest.mark.parametrize(
    ("changed", "mistake", "sentence"),
    [
        ({"mp": "0"}, "payload_forgotten", "Link 2, payload: the payload is missing."),
        (
            {"at": "lc"},
            "payload_at_com",
            "Link 2, payload: the payload is placed at the link's centre of mass.",
        ),
        (
            {"m1": "mp", "mp": "m1"},
            "parameters_exchanged",
            "m1 and mp: two parameters are exchanged.",
        ),
    ],
)
def test_what_is_wrong_with_a_payload_is_named(arm, quantities, changed, mistake, sentence):
    wrong = answers(**changed)
    report = arm.grade({name: wrong[name] for name in quantities})
    assert report.verdict is Verdict.WRONG
    (diagnosis,) = report.diagnosis
    assert (diagnosis.mistake, diagnosis.sentence) == (mistake, sentence), str(report)


@pytest.mark.parametrize(
    ("quantities", "mistake"), [(("M",), "payload_not_moved"), (("V", "g"), "gravity_forgotten")]
)
def test_a_payload_in_one_energy_only(arm, quantities, mistake):
    """The sheet's other quantities are right, so it is not missing altogether."""
    wrong = answers(mp="0")
    report = arm.grade(answers() | {name: wrong[name] for name in quantities})
    assert [one.mistake for one in report.diagnosis] == [mistake], str(report)


def test_masses_on_one_link_exchanged_are_named(arm):
    """It is the same as their centres of mass exchanged."""
    report = arm.grade({"g": answers(m2="mp", mp="m2")["g"]})
    assert {"parameters_exchanged (m2 and mp)", "parameters_exchanged (l2 and lc)"} <= named(
        report
    ), str(report)


def test_mistakes_at_one_body_are_found(arm):
    """Every mistake of the textbook at one body that changes gravity's torques is found, by this or an equal name."""
    truth = truth_of(arm.description)
    at_bodies = [
        variant
        for variant in variants_of(truth, frozenset()).dynamic
        if variant.made.body is not None
    ]
    assert {variant.made.body for variant in at_bodies} == {"arm", "payload"}
    found = 0
    for variant in at_bodies:
        change = element_array(variant.adds_to("g", truth.coordinates))
        if not any(change):
            continue
        answer = written(truth.of("g") + change, truth.arm("g"))
        assert {variant.identity, variant.name} & named(arm.grade({"g": answer})), variant.name
        found += 1
    assert found >= 10


def test_mistakes_at_two_bodies_add_up(arm):
    made = {MadeAt("height_at_joint", 2, "payload"), MadeAt("gravity_sign", 2, "arm")}
    wrong = derive(arm.description, made)
    truth = truth_of(arm.description)
    report = arm.grade({"g": written(element_array(wrong.g), truth.arm("g"))})
    assert report.verdict is Verdict.WRONG
    named = " ".join(str(found.mistake) for found in report.diagnosis)
    assert "height_at_joint" in named and "gravity_sign" in named, str(report)


def test_the_worked_solution_has_each_body(arm):
    text = explanation_text(arm.description)
    assert "Link 1: its energies" in text
    assert "Link 2, payload: where its centre of mass is" in text
    assert "p_22 = o_2 + R_2 c_22" in text
    assert "Link 2, arm: its energies" in text
