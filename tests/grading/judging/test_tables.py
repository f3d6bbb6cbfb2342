"""Judging tables: the file's own is proved, other frames are recognised, and mistakes have names."""

import re
from dataclasses import replace

import numpy as np
import pytest

from acceptance import only_accepting, slow_if
from dhkit.description import Convention, from_dh, from_toml, library_robot, robots, to_toml
from dhkit.errors import AnswerError
from dhkit.expressions import read
from dhkit.grading.answers.sheet_values import Requirements
from dhkit.grading.catalogue import LIBRARY
from dhkit.grading.grade_report import Verdict
from dhkit.grading.judging.tables import judge_table
from dhkit.grading.remarks import Note, NoteKind

CORRECT, WRONG, UNDECIDED = Verdict.CORRECT, Verdict.WRONG, Verdict.UNDECIDED
ALL_STANDARD = [name for name in robots() if library_robot(name).convention is Convention.STANDARD]


def own_table(description):
    """The file's table as text, its variable added."""
    rows = []
    for i, joint in enumerate(description.joints, start=1):
        theta, d = joint.theta.text, joint.d.text
        theta, d = (f"q{i} + {theta}", d) if joint.is_revolute else (theta, f"q{i} + {d}")
        rows.append([theta, d, joint.a.text, joint.alpha.text])
    return rows


def other_table(description):
    """The file's table in the other convention."""
    rows = own_table(description)
    links = [row[2:] for row in rows]
    standard = description.convention is Convention.STANDARD
    moved = [["0", "0"], *links[:-1]] if standard else [*links[1:], ["0", "0"]]
    return [[*row[:2], *link] for row, link in zip(rows, moved, strict=True)]


def other(convention):
    return Convention.MODIFIED if convention is Convention.STANDARD else Convention.STANDARD


def judge(robot, rows, convention=None):
    description = library_robot(robot) if isinstance(robot, str) else robot
    trees = [[read(str(entry)) for entry in row] for row in rows]
    return judge_table(description, trees, convention or description.convention)


def with_entries(rows, **entries):
    """Replace entries: d2="0" is d in row 2."""
    rows = [list(row) for row in rows]
    for place, entry in entries.items():
        rows[int(place[-1]) - 1][("theta", "d", "a", "alpha").index(place[:-1])] = entry
    return rows


def verdicts(judgement):
    return tuple(entry.verdict for entry in judgement.entries)


def frames(judgement):
    """How frames differ from the file's, in words."""
    return tuple(map(str, judgement.other_frames))


def slipped(judgement):
    """Whether one slip is named though the table would be right in other frames: it is wrong then."""
    noted = Note(NoteKind.RIGHT_IN_OTHER_FRAMES, "dh") in judgement.notes
    assert noted == bool(judgement.other_frames and judgement.verdict is WRONG)
    return noted


def mistakes(judgement):
    """Each mistake with the rows that it concerns, from 0; choices of frames are none."""
    return [
        (found.mistake, *(int(entry.removeprefix("dh")) - 1 for entry in found.entries))
        for found in judgement.diagnosis
        if found.mistake != "other_frames"
    ]


@pytest.mark.parametrize("name", robots())
def test_the_own_table_is_proved_in_both_conventions(name):
    description = library_robot(name)
    assert set(verdicts(judge(name, own_table(description)))) == {CORRECT}
    elsewhere = judge(name, other_table(description), other(description.convention))
    assert set(verdicts(elsewhere)) == {CORRECT}
    conventions = (description.convention.value, other(description.convention).value)
    assert elsewhere.notes == (Note(NoteKind.OTHER_CONVENTION, "dh", conventions),)


def test_full_turns_units_and_forms_are_equal():
    rows = [["q1 + 2*pi", "387*mm", "0.3 + 0.025", "0"], ["-(-q2)", "0", "27.5*cm", "-180*deg"]]
    rows += [["0", "q3", "0", "4*pi"], ["q4", "0", "0", "0"]]
    assert set(verdicts(judge("cobra600", rows))) == {CORRECT}
    rows[1][3] = "3.141592653589793"
    assert verdicts(judge("cobra600", rows))[1] is CORRECT


def test_both_sign_flips_at_once_are_the_same_a():
    """Rz(theta + pi) Tx(-a) puts the same point elsewhere in other axes."""
    rows = [["q1", "0", "l1", "0"], ["q2 + pi", "0", "-l2", "0"]]
    judgement = judge("planar2r", rows)
    assert verdicts(judgement) == (CORRECT, UNDECIDED)
    assert frames(judgement) == ("frame 2's x axis points the other way",)


def test_numbers_in_place_of_parameters():
    description = library_robot("planar2r")
    l1, l2 = (float(description.numbers.a[i]) for i in (0, 1))
    judgement = judge("planar2r", [["q1", "0", l1, "0"], ["q2", "0", l2, "0"]])
    assert set(verdicts(judgement)) == {CORRECT}
    assert judgement.at_values == {"l1": l1, "l2": l2}
    turned = judge("planar2r", [["q1", "0", l1, "0"], ["q2 + pi", "0", -l2, "0"]])
    assert verdicts(turned) == (CORRECT, UNDECIDED)
    assert frames(turned) == ("frame 2's x axis points the other way",)
    outside = judge("planar2r", [["q1", "0", f"{l1}*exp(0)", "0"], ["q2", "0", l2, "0"]])
    assert verdicts(outside) == (UNDECIDED, CORRECT)
    assert verdicts(judge("planar2r", [["q1", "0", "l2", "0"], ["q2", "0", "l1", "0"]])) == (
        WRONG,
        WRONG,
    )


def test_what_the_ring_has_not_is_judged_in_doubles():
    rows = own_table(library_robot("puma560"))
    assert verdicts(judge("puma560", with_entries(rows, alpha1="2*atan(exp(0))"))) == (
        UNDECIDED,
        *[CORRECT] * 5,
    )
    assert verdicts(judge("puma560", with_entries(rows, alpha1="exp(0)"))) == (
        WRONG,
        *[CORRECT] * 5,
    )
    for entry in ("1/0", "1e300", "sqrt(-1)", "10^40*exp(1)"):
        assert verdicts(judge("puma560", with_entries(rows, d1=entry))) == (WRONG, *[CORRECT] * 5)


# Frames of one's own choice


def turned_x(rows, i):
    """Turn frame i's x axis by 180 degrees about z: a, alpha, and both thetas change."""
    rows = [list(row) for row in rows]
    theta, d, a, alpha = rows[i - 1]
    rows[i - 1] = [f"{theta} + pi", d, f"-({a})", f"-({alpha})"]
    if i < len(rows):
        rows[i][0] = f"{rows[i][0]} + pi"
    return rows


def reversed_z(rows, i):
    """Reverse frame i's z axis: the joint counts the other way round."""
    rows = [list(row) for row in rows]
    rows[i - 1][3] = f"{rows[i - 1][3]} + pi"
    if i < len(rows):
        theta, d, a, alpha = rows[i]
        q = f"q{i + 1}"
        theta, d = (
            (f"{q} - ({theta} - {q})", f"-({d})")
            if q in theta
            else (f"-({theta})", f"{q} - ({d} - {q})")
        )
        rows[i] = [theta, d, a, f"{alpha} - pi"]
    return rows


@only_accepting
@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["planar2r", "polar_rp", "stanford", "puma560", "ur5", "cobra600", "jaco"]
)
@pytest.mark.parametrize("change", [turned_x, reversed_z])
def test_reversed_axes_are_the_same_arm(name, change):
    rows, word = own_table(library_robot(name)), "x" if change is turned_x else "z"
    for i in range(1, len(rows) + 1):
        judgement = judge(name, change(rows, i))
        assert judgement.verdict is UNDECIDED or slipped(judgement)
        end = f"q{i} is counted from the other end: by 180 degrees" if i == len(rows) else ""
        assert {f"frame {i}'s {word} axis points the other way", end} & {*frames(judgement)}
        assert len(frames(judgement)) <= 2
        if change is reversed_z and i < len(rows):
            assert f"q{i + 1} is counted the other way round" in frames(judgement)


def test_several_frames_at_once():
    rows = own_table(library_robot("puma560"))
    judgement = judge("puma560", turned_x(reversed_z(turned_x(rows, 2), 3), 5))
    assert judgement.verdict is UNDECIDED
    words = " | ".join(frames(judgement))
    for frame, axis in ((2, "x"), (3, "z"), (5, "x")):
        assert f"frame {frame}'s {axis} axis points the other way" in words


def test_frames_slide_along_parallel_axes():
    rows = with_entries(own_table(library_robot("cobra600")), d1="0", d2="0.387")
    judgement = judge("cobra600", rows)
    assert verdicts(judgement) == (UNDECIDED, UNDECIDED, CORRECT, CORRECT)
    assert frames(judgement) == ("frame 1 is slid along its z axis, by -0.387 m",)


@pytest.mark.slow
def test_the_ends_may_be_elsewhere_but_not_anywhere():
    rows = own_table(library_robot("puma560_cao"))
    at_the_wrist = judge("puma560_cao", with_entries(rows, d6="0"))
    assert slipped(at_the_wrist) and mistakes(at_the_wrist) == [("d_forgotten", 5)]
    assert frames(at_the_wrist) == ("frame 6 is slid along its z axis, by -0.05588 m",)
    assert judge("puma560_cao", with_entries(rows, d6="0.056")).verdict is WRONG
    rows = own_table(library_robot("puma560"))
    assert slipped(judge("puma560", with_entries(rows, d1="0")))
    for wrong in ("0.6718", "0.4318"):
        assert judge("puma560", with_entries(rows, d1=wrong)).verdict is WRONG


def test_a_base_frame_upside_down():
    """With z0 down, d1 is negative; that it may be a slip is said as well."""
    judgement = judge("puma560", with_entries(own_table(library_robot("puma560")), d1="-0.67183"))
    assert slipped(judgement)
    assert frames(judgement)[0] == "frame 0's z axis points the other way"
    assert mistakes(judgement) == [("length_sign", 0)]


def test_parallel_axes_leave_the_height_of_the_base_open():
    rows = own_table(library_robot("cobra600"))
    judgement = judge("cobra600", with_entries(rows, d1="0"))
    assert slipped(judgement)
    assert frames(judgement)[0] == "frame 0 is slid along its z axis, by 0.387 m"
    assert judge("cobra600", with_entries(rows, d1="0.4")).verdict is WRONG
    assert judge("planar2r", [["q1", "0.1", "l1", "0"], ["q2", "0", "l2", "0"]]).verdict is WRONG


def test_another_zero_is_said():
    rows = with_entries(
        own_table(library_robot("puma560")), theta2="q2 + pi/2", theta3="q3 - 30*deg"
    )
    judgement = judge("puma560", rows)
    assert slipped(judgement)
    assert frames(judgement) == (
        "q2 is counted from another zero: there the file's q2 is 90 degrees",
        "q3 is counted from another zero: there the file's q3 is -30 degrees",
    )
    rows = with_entries(own_table(library_robot("stanford")), d3="q3 + 0.2")
    words = "q3 is counted from another zero: there the file's q3 is 0.2 m"
    assert frames(judge("stanford", rows)) == (words,)


def test_another_zero_between_parallel_axes():
    """The slide's zero, and not the height of the hand: frame 4 stays where it is."""
    rows = with_entries(own_table(library_robot("cobra600")), d3="q3 + 0.1")
    judgement = judge("cobra600", rows)
    assert slipped(judgement)
    assert "q3 is counted from another zero: there the file's q3 is 0.1 m" in frames(judgement)
    assert len(frames(judgement)) <= 2


@pytest.mark.parametrize(
    "name", ["puma560", "stanford", slow_if(True, "ur5"), "al5d", slow_if(True, "panda")]
)
def test_another_zero_in_the_other_convention(name):
    description = library_robot(name)
    rows = other_table(description)
    rows[1][0] = f"{rows[1][0]} + pi/2"
    judgement = judge(description, rows, other(description.convention))
    assert slipped(judgement)
    assert frames(judgement) == (
        "q2 is counted from another zero: there the file's q2 is 90 degrees",
    )


@only_accepting
@pytest.mark.slow
@pytest.mark.parametrize("name", robots())
def test_another_length_is_another_arm(name):
    """Every length of every robot, changed by a tenth, is found out, whatever the frames."""
    description = library_robot(name)
    rows = own_table(description)
    for i in range(description.n):
        for column, values in ((1, description.numbers.d), (2, description.numbers.a)):
            if values[i] != 0:
                changed = [list(row) for row in rows]
                changed[i][column] = f"1.1*({changed[i][column]})"
                if column == 1 and not description.joints[i].is_revolute:
                    continue  # a sliding joint's offset is a zero of one's own
                judgement = judge(description, changed)
                assert verdicts(judgement)[i] is WRONG, (i, column, judgement)
                assert judgement.diagnosis[0].mistake == "wrong_length"


def test_another_twist_is_another_arm():
    rows = own_table(library_robot("puma560"))
    for i in range(1, 6):
        assert (
            verdicts(
                judge("puma560", with_entries(rows, **{f"alpha{i}": f"{rows[i - 1][3]} + 0.1"}))
            )[i - 1]
            is WRONG
        )


# Mistakes


@pytest.mark.parametrize(
    ("name", "entries", "mistake"),
    [
        ("puma560", {"alpha3": "pi/2"}, "alpha_sign"),
        ("puma560", {"alpha3": "0"}, "alpha_forgotten"),
        ("puma560", {"alpha3": "-90"}, "degrees_for_radians"),
        ("puma560", {"d3": "0.0203", "a3": "0.15005"}, "a_d_exchanged"),
        ("puma560", {"d3": "-0.15005"}, "length_sign"),
        ("puma560", {"d3": "150.05"}, "millimetres_for_metres"),
        ("puma560", {"d3": "0"}, "d_forgotten"),
        ("puma560", {"a2": "0"}, "a_forgotten"),
        ("puma560", {"a2": "0.5"}, "wrong_length"),
        ("puma560", {"alpha3": "pi/3"}, "wrong_twist"),
        ("puma560", {"theta3": "0"}, "variable_forgotten"),
        ("puma560", {"theta3": "q2"}, "variable_of_another_joint"),
        ("puma560", {"theta3": "0", "d3": "0.15005 + q3"}, "variable_column"),
        ("stanford", {"theta3": "q3 - pi/2", "d3": "0"}, "variable_column"),
        ("stanford", {"theta3": "0"}, "theta_offset_forgotten"),
        ("stanford", {"theta3": "0.3"}, "wrong_theta"),
        ("stanford", {"theta3": "-90"}, "degrees_for_radians"),
        ("stanford", {"d3": "q3 + 0.0203", "a3": "0"}, None),
    ],
)
def test_mistakes_of_a_row_have_names(name, entries, mistake):
    place = int(next(iter(entries))[-1]) - 1
    judgement = judge(name, with_entries(own_table(library_robot(name)), **entries))
    assert verdicts(judgement)[place] is not CORRECT
    if mistake is not None:
        assert mistakes(judgement) == [(mistake, place)]
    assert all(found.mistake in LIBRARY for found in judgement.diagnosis)


@pytest.mark.parametrize(
    ("theta", "mistake"),
    [
        ("q2", "theta_offset_forgotten"),
        ("q2 + pi/2", "theta_offset_sign"),
        ("q2 - 90", "degrees_for_radians"),
    ],
)
def test_a_missing_offset_is_another_zero_and_is_named_too(theta, mistake):
    judgement = judge(
        "kuka_kr30_3", with_entries(own_table(library_robot("kuka_kr30_3")), theta2=theta)
    )
    assert mistakes(judgement) == [(mistake, 1)]
    assert slipped(judgement)
    assert len(frames(judgement)) == 1


@pytest.mark.parametrize(
    "theta",
    [
        "q2",
        slow_if(True, "q2 + pi/2"),
        "q2 - 90",
        slow_if(True, "q2 + 1"),
        "q2 + 0.3 - pi/2",
        slow_if(True, "q2 + pi/2 - 1/3"),
    ],
)
def test_another_zero_has_one_verdict_one_note_and_one_score_whatever_the_constant(theta):
    description = library_robot("kuka_kr30_3")
    for sensed in (theta, f"-({theta}) + 2*q2 + 0.1"):
        judgement = judge("kuka_kr30_3", with_entries(own_table(description), theta2=sensed))
        assert verdicts(judgement) == (CORRECT, WRONG, *[CORRECT] * (description.n - 2))
        assert judgement.notes == (Note(NoteKind.RIGHT_IN_OTHER_FRAMES, "dh"),)
        assert judgement.diagnosis[-1].mistake == "other_frames"
        assert judgement.diagnosis[-1].entries == ("dh2",)


def test_another_zero_of_several_joints_and_of_a_prismatic_one():
    description = library_robot("stanford")
    own = own_table(description)
    moved = with_entries(
        own,
        theta1="q1 + 0.2",
        theta2=f"{own[1][0]} - 0.7",
        d3=f"{own[2][1]} + 1/8",
        theta6="q6 + 1",
    )
    judgement = judge(description, moved)
    assert verdicts(judgement) == (WRONG, WRONG, WRONG, CORRECT, CORRECT, WRONG)
    assert slipped(judgement)
    assert judgement.moves_zero


def test_rows_exchanged():
    rows = own_table(library_robot("puma560"))
    for exchanged in ([rows[0], rows[2], rows[1], *rows[3:]], with_renamed(rows, 1, 2)):
        judgement = judge("puma560", exchanged)
        assert verdicts(judgement)[1] is verdicts(judgement)[2] is WRONG
        assert mistakes(judgement) == [("rows_exchanged", 1), ("rows_exchanged", 2)]


def with_renamed(rows, i, j):
    """Exchange two rows, and their variables back."""
    rows = [list(row) for row in rows]
    rows[i], rows[j] = rows[j], rows[i]
    for k in (i, j):
        rows[k][0] = (
            rows[k][0]
            .replace(f"q{i + j + 1 - k + 1}", f"q{k + 1}")
            .replace(f"q{i + j - k + 1}", f"q{k + 1}")
        )
    return rows


@pytest.mark.parametrize("name", ["puma560", "stanford", "ur5", "al5d", "panda", "planar2r"])
def test_the_table_of_the_other_convention(name):
    description = library_robot(name)
    judgement = judge(description, other_table(description))
    assert judgement.verdict is WRONG
    assert mistakes(judgement) == [("other_convention", *range(description.n))]


def test_a_mirrored_turret_is_the_same_arm():
    """Reversing the twist of two axes that meet, with nothing beyond but planar links, reverses a joint."""
    judgement = judge(
        "pan_tilt", with_entries(own_table(library_robot("pan_tilt")), alpha1="-pi/2")
    )
    assert "q2 is counted the other way round" in frames(judgement)
    assert mistakes(judgement) == [("alpha_sign", 0)]


@pytest.mark.slow
def test_a_task_may_give_frames_and_the_zero_pose():
    description = library_robot("puma560")
    turned = with_entries(own_table(description), theta2="q2 + pi/2", theta3="q3 - 30*deg")
    trees = [[read(str(entry)) for entry in row] for row in turned]
    for task in (Requirements(frames_given=True), Requirements(zero_given=True)):
        judgement = judge_table(description, trees, description.convention, task=task)
        assert judgement.verdict is WRONG
        assert "the task gives the" in judgement.entries[1].statement
        assert [found.mistake for found in judgement.diagnosis] == ["other_frames"]
    trees = [[read(str(entry)) for entry in row] for row in turned_x(own_table(description), 2)]
    assert (
        judge_table(
            description, trees, description.convention, task=Requirements(zero_given=True)
        ).verdict
        is UNDECIDED
    )


def test_one_joint():
    arm = from_dh([(0, 0.3, 0.2, "pi/2")])
    assert judge(arm, [["q1", "0.3", "0.2", "pi/2"]]).verdict is CORRECT
    assert judge(arm, [["q1", "0.3", "0.3", "pi/2"]]).verdict is WRONG


@pytest.mark.parametrize(
    ("rows", "complaint"),
    [
        ([["q1", "0", "l1", "0"]], "1 row; expected 2"),
        (
            [["q1", "0", "l1"], ["q2", "0", "l2", "0"]],
            "row 1: 3 entries; expected theta, d, a, alpha",
        ),
        ([["q1", "0", "l1", "0"], ["q3", "0", "l2", "0"]], "row 2, theta: unknown name 'q3'"),
        ([["q1", "0", "l1", "0"], ["q2", "0", "foo(l2)", "0"]], "unknown function 'foo'"),
    ],
)
def test_what_cannot_be_read(rows, complaint):
    with pytest.raises(AnswerError, match=complaint):
        judge("planar2r", rows)


def test_an_unknown_convention():
    with pytest.raises(ValueError, match="classic"):
        judge("planar2r", own_table(library_robot("planar2r")), "classic")


@pytest.mark.slow
def test_random_gauges_of_random_arms():
    """Any composition of reversals leaves an arm the same."""
    random = np.random.default_rng(3)
    for _ in range(10):
        n = int(random.integers(2, 6))
        kinds = "".join(random.choice(["R", "R", "P"], n))
        rows = [
            (
                f"pi/12*{random.integers(-6, 6)}",
                *np.round(random.uniform(0.1, 0.5, 2), 3).tolist(),
                x,
            )
            for x in random.choice(["0", "pi/2", "-pi/2", "pi/6"], n)
        ]
        arm = replace(from_dh(rows, kinds=kinds), name="random")
        table = own_table(arm)
        for _ in range(2):
            change = turned_x if random.random() < 0.5 else reversed_z
            table = change(table, int(random.integers(1, n)))
        assert judge(arm, table).verdict in (CORRECT, UNDECIDED), (kinds, rows, table)


def test_letters_of_equal_value_are_letters_in_other_frames_too():
    text = to_toml(library_robot("planar2r"))
    for name in ("l1", "l2"):
        text = re.sub(rf"(?m)^{name} = [\d.]+$", f"{name} = 2.0", text)
    description = from_toml(text)
    wrong = judge(description, [["q1 + pi", "0", "-2", "0"], ["q2 - pi", "0", "l1", "0"]])
    assert wrong.verdict is WRONG
    right = judge(description, [["q1 + pi", "0", "-2", "0"], ["q2 - pi", "0", "l2", "0"]])
    assert right.verdict is UNDECIDED and dict(right.at_values) == {"l1": 2.0}


def test_a_number_may_stand_in_one_entry_of_a_row():
    arm = from_dh(
        [("beta", "l1", 0, "beta"), (0, 0, "l2", 0)],
        parameters={"beta": "pi/2", "l1": 1.0, "l2": 0.5},
    )
    row = ["q2", "0", "l2", "0"]
    assert dict(judge(arm, [["q1 + beta", "l1", "0", "pi/2"], row]).at_values) == {
        "beta": pytest.approx(np.pi / 2)
    }
    assert judge(arm, [["q1 + pi/2", "1", "0", "beta"], row]).verdict is CORRECT
    assert judge(arm, [["q1 + pi/2", "2", "0", "beta"], row]).verdict is WRONG
