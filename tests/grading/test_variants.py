"""Variants of a task: the numbers of each student, lists of students, conventions, and the key."""

import json
import os
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from dhkit.description import Convention, library_robot, to_toml, world_to_tool
from dhkit.dynamics import gravity_torque, mass_matrix
from dhkit.errors import AnswerError, DhkitError
from dhkit.grading import grade_answers
from dhkit.grading.judging.truth import truth_of
from dhkit.grading.variants import VariantKey, Variants
from dhkit.grading.variants.conventions import in_convention
from dhkit.grading.variants.key import key_files
from dhkit.grading.variants.ranges import Range, is_generic, step_of
from dhkit.grading.variants.students import read_students, student_id

RANGES = """[variants.parameters]
l1 = [0.3, 0.6]
l2 = [0.3, 0.6]
m1 = [1.0, 3.0]
m2 = [1.0, 3.0]
"""
PLANAR = f'robot = "planar2r"\n[task]\nasked = ["M", "g"]\n{RANGES}'
STUDENTS = [f"student{k}" for k in range(60)]
ROUNDING = 1e-12
"""Largest difference of the mechanics of one arm in two conventions, relative: sums in another order."""


@pytest.fixture
def varied(tmp_path):
    """Return the variants of a task's text."""

    def varied(text=PLANAR):
        path = tmp_path / "task.toml"
        path.write_text(text, "utf-8")
        return Variants.load(path)

    return varied


# Numbers


def test_a_variant_depends_on_the_seed_and_the_student_alone(varied):
    variants = varied()
    forwards = {student: variants.of(student, 7).numbers for student in STUDENTS}
    backwards = {student: variants.of(student, 7).numbers for student in reversed(STUDENTS[:30])}
    assert all(forwards[student] == numbers for student, numbers in backwards.items())
    others = [
        student for student in STUDENTS if variants.of(student, 8).numbers != forwards[student]
    ]
    assert len(others) == len(STUDENTS)


def test_a_variant_is_the_same_on_every_system(varied):
    """Published once, the numbers of a class must not change with a version of Python or of dhkit."""
    assert dict(varied().of("ada", 7).values) == {
        "l1": "0.38",
        "l2": "0.51",
        "m1": "1.8",
        "m2": "1.6",
    }


@pytest.mark.parametrize("hash_seed", ["0", "1", "random"])
def test_a_variant_is_the_same_in_every_process(varied, tmp_path, hash_seed):
    expected = varied().of("ada", 7).values
    program = (
        "import json, sys; from dhkit.grading.variants import Variants; "
        "print(json.dumps(dict(Variants.load(sys.argv[1]).of('ada', 7).values)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "task.toml")],
        env=os.environ | {"PYTHONHASHSEED": hash_seed},
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(done.stdout) == dict(expected)


@given(seed=st.integers(0, 2**64), student=st.from_regex(r"[a-z]{1,12}", fullmatch=True))
def test_no_two_numbers_coincide(tmp_path_factory, seed, student):
    path = tmp_path_factory.getbasetemp() / "coincidences.toml"
    if not path.exists():
        path.write_text(PLANAR)
    try:
        values = Variants.load(path).of(student, seed).values
    except AnswerError:  # a name that systems reserve, such as con
        with pytest.raises(AnswerError):
            student_id(student)
        return
    numbers = {name: Fraction(value) for name, value in values.items()}
    numbers["g"] = Fraction("9.81")
    drawn = list(values)
    assert all(Fraction(3, 10) <= numbers[name] <= Fraction(6, 10) for name in ("l1", "l2"))
    assert all(len(value.partition(".")[2]) <= 2 for value in values.values())
    for k, name in enumerate(drawn):
        assert numbers[name] not in (0, 1)
        for other in [*drawn[:k], "g"]:
            ratio = numbers[name] / numbers[other]
            assert ratio not in (1, 2, 3, 4) and 1 / ratio not in (2, 3, 4)
    l1, l2, m1, m2 = (numbers[name] for name in drawn)
    assert l1 + m1 != l2 + m2 and l1 * m2 != l2 * m1 and l1 * m1 != l2 * m2
    assert m1 + m2 != numbers["g"]


@pytest.mark.parametrize(
    "values",
    [
        {"x": "0"},
        {"x": "1"},
        {"x": "0.5"},
        {"x": "-0.25"},
        {"x": "0.3", "y": "0.3"},
        {"x": "0.3", "y": "-0.3"},
        {"x": "0.3", "y": "0.6"},
        {"x": "0.3", "y": "1.2"},
        {"x": "0.3", "y": "0.7", "z": "1.0"},
        {"x": "0.3", "y": "0.41", "z": "0.71"},
        {"x": "0.3", "y": "0.7", "z": "0.21"},
        {"x": "0.3", "y": "0.35", "z": "0.4"},
        {"x": "0.31", "y": "0.37", "z": "0.43", "w": "0.49"},
    ],
)
def test_coincidences_are_known(values):
    numbers = {name: Fraction(value) for name, value in values.items()}
    assert not is_generic(numbers, tuple(numbers))
    assert not is_generic(numbers, ("x",)) or len(numbers) > 1
    assert is_generic(numbers, ()), "numbers of the robot file are the instructor's"


@pytest.mark.parametrize("robot", ["planar2r", "planar3r", "polar_rp"])
def test_answers_have_the_same_size_for_all_students(varied, robot):
    """In letters and in numbers: no coincidence makes terms vanish."""
    parameters = [name for name in library_robot(robot).parameters if name != "g"]
    ranges = "\n".join(f"{name} = [0.3, 2.5, 0.001]" for name in parameters)
    variants = varied(f'robot = "{robot}"\n[variants.parameters]\n{ranges}\n')
    sizes = set()
    for student in STUDENTS[:12]:
        truth = truth_of(variants.of(student, 1).description)
        count = []
        for quantity in ("M", "h", "g"):
            letters = truth.of(quantity)
            numbers = truth.with_numbers(quantity, letters, [*parameters, "g"])
            for array in (letters, numbers):
                count.append(sum(len(element.terms) for element in array.flat))
        sizes.add(tuple(count))
    (size,) = sizes
    assert list(variants.sizes().values()) == [size[0] + size[2] + size[4]]


@given(
    low=st.decimals("0.001", "50", places=3),
    width=st.decimals("0.001", "50", places=3),
    digits=st.integers(1, 4),
)
def test_values_of_a_range_are_multiples_of_its_step_inside_it(low, width, digits):
    step = step_of(low, low + width, digits)
    numbers = Range(low, low + width, step)
    values = list(numbers)
    assert len(values) == len(numbers)
    assert all(low <= value <= low + width and value % step == 0 for value in values)
    assert values == sorted(set(values))
    assert len(values) >= int(width / step)
    largest = str((low + width).quantize(step)).replace(".", "").lstrip("0")
    assert len(largest) <= digits + 1  # one more where rounding carries


def test_steps_have_the_digits_of_the_task(varied):
    assert step_of(Decimal("0.3"), Decimal("0.6"), 2) == Decimal("0.01")
    assert step_of(Decimal(1), Decimal(3), 2) == Decimal("0.1")
    fine = varied(
        PLANAR.replace("[variants.parameters]", "[variants]\ndigits = 3\n[variants.parameters]")
    )
    assert len(fine.of("ada", 1).values["l1"]) == len("0.453")
    coarse = varied(PLANAR.replace("[0.3, 0.6]", "[0.3, 0.6, 0.05]"))
    assert Decimal(coarse.of("ada", 1).values["l1"]) % Decimal("0.05") == 0


def test_distinct_variants_are_counted(varied):
    few = varied('robot = "planar2r"\n[variants.parameters]\nl1 = [0.43, 0.46]\n')
    assert few.distinct(100) == 4 and few.distinct(3) == 3
    assert varied().distinct(100) == 100
    arms = varied(
        '[variants]\nrobots = ["planar2r", "planar3r"]\nconventions = ["standard", "modified"]\n'
    )
    assert arms.distinct(100) == 4
    assert arms.sizes()["planar2r, standard DH"] < arms.sizes()["planar3r, standard DH"]


def test_ranges_of_which_nearly_all_numbers_coincide_are_refused(varied):
    with pytest.raises(AnswerError, match=r"10,000 draws have equal numbers.*wider ranges"):
        varied(
            'robot = "planar2r"\n[variants.parameters]\nl1 = [0.49, 0.5]\nl2 = [0.98, 1.0, 0.02]\n'
        ).of("a", 1)


# Arms


def test_a_payload_is_a_parameter(varied):
    variants = varied(f'robot = "planar2r"\n[variants]\npayload = [0.5, 1.5]\n{RANGES}')
    variant = variants.of("ada", 1)
    arm = variant.description
    assert arm.joints[-1].bodies[-1].is_payload
    assert float(arm.parameters["mp"]) == float(variant.values["mp"])
    report = grade_answers(
        arm, {"g": ["(m1/2 + m2 + mp)*g*l1*c1 + (m2/2 + mp)*g*l2*c12", "(m2/2 + mp)*g*l2*c12"]}
    )
    assert report.verdict.value == "correct"


def test_each_student_has_one_of_the_robots_and_conventions(varied):
    variants = varied(
        '[variants]\nrobots = ["planar2r", "polar_rp"]\nconventions = ["standard", "modified"]\n'
        "[variants.parameters]\nl1 = [0.3, 0.6]\n"
    )
    found = {variants.of(student, 3).numbers[:2] for student in STUDENTS}
    assert len(found) == 4
    names = {
        variants.of(student, 3).robot: set(variants.of(student, 3).values) for student in STUDENTS
    }
    assert names["planar2r"] == {"l1"}, "a robot without the parameter keeps its numbers"


@pytest.mark.parametrize(
    "robot", ["planar2r", "polar_rp", "puma560", "stanford", "panda", "ur5", "cart_pendulum"]
)
def test_an_arm_in_the_other_convention_is_the_same_arm(robot):
    arm = library_robot(robot)
    there = in_convention(
        arm, Convention.MODIFIED if arm.convention is Convention.STANDARD else Convention.STANDARD
    )
    back = in_convention(there, arm.convention)
    assert there.convention is not arm.convention and back.convention is arm.convention
    for q in np.random.default_rng(1).uniform(-1, 1, (5, arm.n)):
        for other in (there, back):
            assert world_to_tool(other, q) == pytest.approx(world_to_tool(arm, q), abs=ROUNDING)
            if all(joint.bodies for joint in arm.joints):
                M = mass_matrix(arm, q)
                assert mass_matrix(other, q) == pytest.approx(M, abs=ROUNDING * np.abs(M).max())
                g = gravity_torque(arm, q)
                scale = ROUNDING * (1 + np.abs(g).max())
                assert gravity_torque(other, q) == pytest.approx(g, abs=scale)


# Tables that are wrong


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"nothing varies; expected a table \[variants\]"),
        ("[variants]\ndigits = 2", "variants: nothing varies; expected parameters, robots"),
        ("[variants]\nrobot = 1", "unknown key 'variants.robot'; expected parameters, robots"),
        ("variants = 3", "variants: found 3; expected a table"),
        ("[variants.parameters]\nl4 = [1, 2]", "planar2r has no parameter 'l4'; it has g, l1"),
        ("[variants.parameters]\nl1 = [0.6, 0.3]", r"l1: found \[0.6, 0.3\]; .*the range is empty"),
        ("[variants.parameters]\nl1 = [0.31, 0.319]", "at least 2 values; there is 1 at a step of"),
        ("[variants.parameters]\nl1 = [0.3, 0.6, 0.5]", "at least 2 values; there is 1 at a step"),
        ("[variants.parameters]\nl1 = [0.3, 0.6, 0]", "a step above 0"),
        ("[variants.parameters]\nl1 = [0, 0]", "numbers other than 0"),
        ("[variants.parameters]\nl1 = [0.3, 0.6, 1e-9]", "at most 1,000,000 values"),
        ("[variants.parameters]\nl1 = [0.3, 1e300]", "numbers of at most 15 digits"),
        ("[variants.parameters]\nl1 = [0.3, inf]", "numbers of at most 15 digits"),
        ("[variants.parameters]\nl1 = [0.3, nan]", "numbers of at most 15 digits"),
        ("[variants.parameters]\nl1 = 0.3", r"expected \[lowest, highest\]"),
        ('[variants.parameters]\nl1 = ["0.3", "0.6"]', r"expected \[lowest, highest\]"),
        ("[variants.parameters]\nm1 = [-2.1, 2.1]", r"planar2r with m1 = -2.1: .*mass"),
        ("[variants]\nparameters = [1]", "variants.parameters: found .*expected a table"),
        ("[variants]\nrobots = []", "variants.robots: found .*expected a list"),
        ('[variants]\nrobots = ["planar2r", "planar2r"]', "each one once"),
        ('[variants]\nrobots = ["../robot.toml"]', "leaves the sheet's folder"),
        ('[variants]\nrobots = ["planar9r"]', "planar9r"),
        ('[variants]\nconventions = ["craig"]', "conventions: found craig; expected standard"),
        ("[variants]\npayload = [-1.1, 1.1]", "masses above 0"),
        ("[variants]\npayload = [0, 1]", "masses above 0"),
        (
            "[variants]\npayload = [1, 2]\n[variants.parameters]\nmp = [1, 2]",
            "masses above 0, kg, once",
        ),
        ("[variants]\ndigits = true\n[variants.parameters]\nl1 = [1, 2]", "digits: found True"),
    ],
)
def test_a_wrong_table_is_refused_in_one_line(varied, tmp_path, text, message):
    with pytest.raises(DhkitError, match=message) as refused:
        varied(f'robot = "planar2r"\n{text}' if text[:1] != "v" else f"{text}\n")
    assert str(tmp_path / "task.toml") in str(refused.value) and "\n" not in str(refused.value)


def test_parameters_that_are_made_of_others_are_not_drawn(varied, tmp_path):
    arm = to_toml(library_robot("planar2r")).replace("l2 = 0.4", 'l2 = "l1/3"')
    (tmp_path / "robot.toml").write_text(arm)
    with pytest.raises(AnswerError, match="planar2r makes l2 of others, l1/3"):
        varied(f'robot = "robot.toml"\n{RANGES}')
    assert varied('robot = "robot.toml"\n[variants.parameters]\nl1 = [0.4, 0.6]').of("ada", 1)


# Students


@pytest.mark.parametrize(
    ("name", "text", "ids", "column"),
    [
        ("list.txt", "ada\n\n bob \r\ncleo", ["ada", "bob", "cleo"], ""),
        ("list.csv", "ada\nbob\n", ["ada", "bob"], ""),
        ("list.csv", "student\nada\nbob\n", ["ada", "bob"], "student"),
        ("own.csv", "student,email\nada,ada@x.org\n", ["ada"], "student"),
        ("own.csv", "matricule;name\n123;Ada\n", ["123"], "matricule"),
        (
            "canvas.csv",
            'Student,ID,SIS Login ID,Section\n    Points Possible,,,\n"Lovelace, Ada",7,ada1,A\n',
            ["ada1"],
            "SIS Login ID",
        ),
        (
            "moodle.csv",
            "\ufeffFirst name,Last name,ID number,Email address\nAda,L,17,ada@x.org\n",
            ["ada@x.org"],
            "Email address",
        ),
        ("users.csv", "Last name,Username,Email\nL,ada,ada@x.org\n", ["ada"], "Username"),
        ("gradescope.csv", "Name,SID,Email,Sections\nAda,5,ada@x.org,\n", ["ada@x.org"], "Email"),
        (
            "names.txt",
            "Zoë O'Brien\nŁukasz\n李雷\nराज\n",
            ["Zoë O'Brien", "Łukasz", "李雷", "राज"],
            "",
        ),
    ],
)
def test_a_list_of_students_is_read(tmp_path, name, text, ids, column):
    path = tmp_path / name
    path.write_bytes(text.encode())
    found = read_students(path)
    assert (list(found.ids), found.column) == (ids, column)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.txt", "", "no student; expected an id a line"),
        ("a.csv", "student,email\n", "no student"),
        ("a.txt", "ada\nbob\nada", "line 3: student ada twice"),
        ("a.txt", "Ada\nada", "line 2: student ada is also there as Ada"),
        ("a.txt", "e\u0301va\n\u00e9va", "line 2: student éva twice"),
        ("a.txt", "Lovelace, Ada", "line 1: student 'Lovelace, Ada': not an id"),
        ("a.csv", 'student,mail\n"Lovelace, Ada",x', "line 2: student 'Lovelace, Ada': not an id"),
        ("a.csv", "student,mail\n,x", "line 2: no id in the column 'student'"),
        ("a.csv", "name,Username\nx", "line 2: no id in the column 'Username'"),
        ("a.csv", 'student,mail\n"' + "x" * 200_000, "field larger than field limit"),
        *(
            ("a.txt", f"bob\n{unsafe}", "line 2: student .*: not an id")
            for unsafe in (
                "../x", "a/b", "a\\b", "..", ".", ".hidden", "a.", "C:", "a\0b", "-rf", "~", "con",
                "NUL.txt", "a\u202eb", "a\tb", "x" * 81, "é" * 41, "<b>", "$(x)", "a;b", "a|b",
            )
        ),
    ],
)  # fmt: skip
def test_a_wrong_list_of_students_is_refused_in_one_line(tmp_path, name, text, message):
    path = tmp_path / name
    path.write_bytes(text.encode())
    with pytest.raises(AnswerError, match=message) as refused:
        read_students(path)
    assert str(refused.value).isprintable() and len(str(refused.value)) < 400


def test_a_list_that_is_no_text_or_too_long_is_refused(tmp_path, monkeypatch):
    (tmp_path / "a.txt").write_bytes(b"\xff\xfe")
    with pytest.raises(AnswerError, match="not UTF-8 at byte 0"):
        read_students(tmp_path / "a.txt")
    with pytest.raises(AnswerError, match="no such file"):
        read_students(tmp_path / "b.txt")
    (tmp_path / "c.txt").write_text("\n".join(f"s{k}" for k in range(10_001)))
    with pytest.raises(AnswerError, match="more than 10000 students"):
        read_students(tmp_path / "c.txt")


@given(st.text(max_size=40))
def test_an_id_names_one_folder(text):
    try:
        name = student_id(text)
    except AnswerError:
        return
    assert student_id(name) == name and name.isprintable()
    assert Path(name).name == name and name not in (".", "..")
    assert not set(name) & set('/\\:*?"<>|,')


# The key


@pytest.fixture
def key(varied, tmp_path):
    """The key of three students, as a folder."""
    variants = varied()
    drawn = [variants.of(student, 7) for student in ("ada", "Zoë", "bob.b")]
    for name, content in key_files(variants, tmp_path / "task.toml", drawn, 7).items():
        (tmp_path / "key" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "key" / name).write_bytes(content)
    return tmp_path / "key"


def test_a_key_has_the_arm_of_each_student(key, varied):
    read = VariantKey.read(key)
    assert read == VariantKey.read(key / "variants.json")
    assert (read.seed, read.digest) == (7, varied().digest)
    for student in ("ada", "Zoë", "bob.b"):
        assert read.robot_of(student) == varied().of(student, 7).description
    assert read.robot_of("ADA") == read.robot_of("ada")
    assert read.robot_of("Zoe\u0308") == read.robot_of("Zoë"), "as file systems of macOS spell it"
    assert "ada" in read and "mallory" not in read
    with pytest.raises(AnswerError, match=r"student 'mallory' has no variant in .*key; not judged"):
        read.robot_of("mallory")
    assert read.changed([varied().of("ada", 7)]) == []
    assert read.changed([varied().of("ada", 8), varied().of("new", 8)]) == ["ada"]


def test_a_robot_file_of_the_key_that_was_changed_is_refused(key):
    file = key / "robots" / "ada.toml"
    file.write_text(file.read_text().replace("9.81", "9.80"))
    with pytest.raises(AnswerError, match="not the robot file that was written"):
        VariantKey.read(key).robot_of("ada")
    file.unlink()
    with pytest.raises(AnswerError, match=r"ada\.toml"):
        VariantKey.read(key).robot_of("ada")


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data | {"format": 2},
        lambda data: data | {"seed": "7"},
        lambda data: data | {"task_sha256": None},
        lambda data: data | {"students": ["ada"]},
        lambda data: data | {"students": {"ada": 3}},
        lambda data: data | {"students": {"../ada": {}}},
        lambda data: [data],
    ],
)
def test_what_is_not_a_key_is_refused(key, change):
    file = key / "variants.json"
    file.write_text(json.dumps(change(json.loads(file.read_text("utf-8")))))
    with pytest.raises(AnswerError, match=r"variants.json: not the key|not an id"):
        VariantKey.read(key)


def test_a_folder_without_a_key_is_refused(tmp_path):
    with pytest.raises(AnswerError, match="no such file"):
        VariantKey.read(tmp_path)
    (tmp_path / "variants.json").write_text("[" * 100_000)
    with pytest.raises(AnswerError, match="not the key"):
        VariantKey.read(tmp_path)
