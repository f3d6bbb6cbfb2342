"""The schemas of sheets, tasks and rubrics: what the readers accept fits, and what does not fit the readers refuse."""

import copy
import json
import tomllib
from pathlib import Path

import jsonschema
import pytest
import tomlkit

from acceptance import slow_if
from dhkit.cli.grade import rubric_of
from dhkit.description import library_robot, robots
from dhkit.errors import AnswerError, DhkitError
from dhkit.grading import LIBRARY, Rubric, Verdict, grade, robot_of
from dhkit.grading.answers.sheet import read_sheet, read_task
from dhkit.grading.empty_sheet import template
from dhkit.grading.marks import marks
from dhkit.grading.schema import rubric_schema, sheet_schema, task_schema
from dhkit.grading.variants import Variants
from grading import test_docs, test_rubric

HERE = Path(__file__).parent
ARM = library_robot("planar2r")
VALIDATORS = {
    "sheet": jsonschema.Draft202012Validator(sheet_schema()),
    "task": jsonschema.Draft202012Validator(task_schema()),
    "rubric": jsonschema.Draft202012Validator(rubric_schema()),
}
RUBRIC = """points = 20
digits = 4
feedback = "hint"
weights = { M = 4, M21 = 0 }
credit = { rounding = 1.0, undecided = 1, follow_on = 0.5, other_frames = 0.5, mistakes = { gravity_sign = 0.5 } }
"""
TASK = f"""format = 1
robot = "planar2r"
[names]
q = ["a", "b"]
qd = ["va", "vb"]
qdd = ["wa", "wb"]
angles = "relative"
parameters = {{ lc1 = "l1/2", two = 2 }}
[task]
friction = false
total_derivative = false
asked = ["V", "A1", "dh"]
proof = "optional"
frames = "free"
zero = "free"
[rubric]
{RUBRIC}"""
SHEET = f"""student = "ada"
{TASK}
[answer]
V = "m1*g"
K = 0
g = ["m1*g", 0.5]
h_1 = "0"
dh = {{ convention = "standard", rows = [["pi/2", 0, "l1", 0], [0, "0", "l2", 0.0]] }}
ik = {{ branches = [["atan2(py, px)", 1]] }}
"""
VARIED_TASK = f"""{TASK}
[variants]
robots = ["planar2r", "planar3r"]
conventions = ["standard", "modified"]
payload = [0.5, 2.5]
digits = 3
[variants.parameters]
l1 = [0.3, 0.6]
m1 = [1, 3, 0.05]
"""
WHOLE = {"sheet": SHEET, "task": VARIED_TASK, "rubric": RUBRIC}
"""A file of each kind with every key."""


def fits(kind, text):
    return VALIDATORS[kind].is_valid(tomllib.loads(text))


def read_whole_sheet(path):
    """Read a sheet as for `dhkit grade SHEET --robot planar2r`; an answer that is unreadable is an error."""
    Rubric.from_data(read_sheet(path).rubric).require_mistakes(LIBRARY)
    report = grade(path, ARM, explain=False)
    for entry in report.entries:
        if entry.verdict is Verdict.UNREADABLE:
            raise AnswerError(entry.statement)


def read_whole_task(path):
    """Read a task as for `dhkit grade SHEET --task TASK --robot planar2r`."""
    task = read_task(path)
    Rubric.from_data(task.rubric).require_mistakes(LIBRARY)
    if task.robot:
        robot_of(task, path.parent)
    sheet = path.with_name("answer.toml")
    sheet.write_text("answer = { V = 0 }")
    grade(sheet, ARM, task=task, explain=False)
    if task.variants:
        Variants.load(path)


READERS = {"sheet": read_whole_sheet, "task": read_whole_task, "rubric": rubric_of}


@pytest.fixture
def is_read(tmp_path):
    def is_read(kind, text):
        path = tmp_path / f"{kind}.toml"
        path.write_text(text)
        try:
            READERS[kind](path)
        except DhkitError:
            return False
        return True

    return is_read


# The schemas


def described(schema):
    """Yield the names of keys with their schemas, at every depth."""
    for part in (
        schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ()
    ):
        yield from described(part)
    if isinstance(schema, dict) and schema.get("type") == "object":
        yield from schema.get("properties", {}).items()


@pytest.mark.parametrize("kind", VALIDATORS)
def test_a_schema_is_one_and_tells_what_every_key_means(kind):
    schema = VALIDATORS[kind].schema
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["$schema"].endswith("2020-12/schema") and kind in schema["title"]
    assert json.loads(json.dumps(schema)) == schema
    assert [name for name, key in described(schema) if not key.get("description")] == []


# Files that are right


def corpus():
    """Return the sheets of the tests, right and wrong ones, by name."""
    files = {str(path): path.read_text("utf-8") for path in (HERE / "sheets").rglob("*.toml")}
    rows = map(json.loads, (HERE / "data" / "heldout.jsonl").read_text("utf-8").splitlines())
    sheets = files | {row["name"]: row["text"] for row in rows if row["suffix"] == ".toml"}
    return {name: text for name, text in sheets.items() if "[[joint]]" not in text}


def test_every_sheet_of_the_corpus_fits():
    sheets = corpus()
    assert len(sheets) > 1000
    assert [name for name, text in sheets.items() if not fits("sheet", text)] == []


@pytest.mark.parametrize("name", robots())
def test_an_empty_sheet_fits(name):
    assert fits("sheet", template(library_robot(name)))


def test_steps_of_an_empty_sheet_are_those_to_fill_in(tmp_path):
    text = template(library_robot("puma560"))
    path = tmp_path / "sheet.toml"
    head, steps = text.split("# [answer.ik]")
    path.write_text(
        head
        + "\n".join(line.removeprefix("# ") for line in ("# [answer.ik]" + steps).splitlines()),
        "utf-8",
    )
    assert fits("sheet", path.read_text("utf-8"))
    assert "joint = 6" in path.read_text("utf-8")
    with pytest.raises(AnswerError, match="every entry is empty"):
        grade(path)
    path.write_text(
        path.read_text("utf-8").replace('1, equation = ""', '1, equation = "px*s1 - py*c1 = d3"'),
        "utf-8",
    )
    report = grade(path)
    assert report.verdict is Verdict.INCOMPLETE
    earned = marks(report, Rubric())
    assert earned.points == pytest.approx(earned.most / 6, abs=0.51)  # rounded
    assert "[answer.ik]" not in template(library_robot("panda"))


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("sheet", test_docs.SHEET),
        ("task", test_docs.TASK),
        ("rubric", test_docs.RUBRIC),
        ("rubric", test_rubric.RUBRIC),
        *WHOLE.items(),
        ("task", ""),
        ("rubric", ""),
        ("sheet", "answer = { V = 0 }"),
        (
            "sheet",
            "answer = { tau = '[0; 0]', G_2 = '0', m12 = 0, J_1_2 = 0, A1_14 = 'l1*c1', 'C_{11}' = 0 }",
        ),
        (
            "sheet",
            "answer = { A2 = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], V = [['m1']], g = [] }",
        ),
        ("sheet", "answer = { dh = { rows = [[0, 0, 0, 0], ['q2', '0', 0.5, 'pi/2']] } }"),
        ("task", "task = { asked = ['dh', 'ik', 'A1', 'A1'] }"),
        ("rubric", "points = 0.5\nweights = { A1 = 1, A1_14 = 0, tau = 1e6 }"),
    ],
)
def test_a_right_file_fits_and_is_read(kind, text, is_read):
    VALIDATORS[kind].validate(tomllib.loads(text))
    assert is_read(kind, text)


# Files that are wrong

BAD_NAMES_AND_TASK = [
    ("robot =", "robt ="),
    ("q = [", "Q = ["),
    ("angles =", "angle ="),
    ("friction =", "frction ="),
    ("proof =", "prof ="),
    ("format = 1", "format = 2"),
    ("format = 1", 'format = "1"'),
    ('robot = "planar2r"', "robot = 2"),
    ('q = ["a", "b"]', 'q = "a, b"'),
    ('q = ["a", "b"]', "q = [1, 2]"),
    ('q = ["a", "b"]', 'q = [true, "b"]'),
    ('angles = "relative"', 'angles = "Relative"'),
    ('angles = "relative"', "angles = 0"),
    ('{ lc1 = "l1/2", two = 2 }', '["l1/2"]'),
    ("two = 2", "two = true"),
    ("two = 2", "two = [2]"),
    ("two = 2", ", ".join(f"p{k} = {k}" for k in range(100))),
    ("friction = false", 'friction = "no"'),
    ("total_derivative = false", "total_derivative = 0"),
    ('["V", "A1", "dh"]', '"V"'),
    ('["V", "A1", "dh"]', '["W"]'),
    ('["V", "A1", "dh"]', '["A0"]'),
    ('["V", "A1", "dh"]', '["M11"]'),
    ('proof = "optional"', 'proof = "require"'),
    ('proof = "optional"', "proof = true"),
    ('frames = "free"', 'frames = "fixed"'),
    ('zero = "free"', 'zero = "0"'),
    ("points = 20", "points = -20"),
    ("points = 20", "pionts = 20"),
]
BAD_ANSWERS = [
    ("student =", "studnet ="),
    ('student = "ada"', "student = 7"),
    ("[answer]", "[answers]"),
    ("h_1 =", "h1x ="),
    ("h_1 =", "h_0 ="),
    ("g =", "G ="),
    ("K = 0", "K = true"),
    ("K = 0", "K = { value = 0 }"),
    ("K = 0", "K = 2026-01-01"),
    ("0.5]", "true]"),
    ('h_1 = "0"', 'h_1 = ["0"]'),
    ("convention =", "convenion ="),
    ('"standard"', '"craig"'),
    ("rows =", "row ="),
    ('"l2", 0.0]', '"l2"]'),
    ('"l2", 0.0]', '"l2", 0.0, 0]'),
    ('"l2", 0.0]', '"l2", false]'),
    ('rows = [["pi/2", 0, "l1", 0], [0, "0", "l2", 0.0]]', "rows = []"),
    ('convention = "standard", rows = [["pi/2", 0, "l1", 0], [0, "0", "l2", 0.0]]', "row = []"),
    ("branches =", "branch ="),
    ('branches = [["atan2(py, px)", 1]]', "branches = []"),
    ('branches = [["atan2(py, px)", 1]]', 'branches = ["atan2(py, px)", 1]'),
    ('branches = [["atan2(py, px)", 1]]', f"branches = {[[0, 1]] * 65}"),
]
BAD_RUBRIC = [
    ("points =", "ponts ="),
    ("points = 20", "points = 0"),
    ("points = 20", "points = -1"),
    ("points = 20", 'points = "20"'),
    ("points = 20", "points = true"),
    ("points = 20", "points = 2e6"),
    ("digits = 4", "digits = 2"),
    ("digits = 4", "digits = 16"),
    ("digits = 4", "digits = 4.5"),
    ('"hint"', '"hints"'),
    ('"hint"', "1"),
    ("M = 4", "M = -4"),
    ("M = 4", 'M = "4"'),
    ("M = 4", "G = 4"),
    ("M21 =", "M2_1_1 ="),
    ("{ M = 4, M21 = 0 }", "4"),
    ("rounding =", "roundign ="),
    ("rounding = 1.0", "rounding = 1.1"),
    ("undecided = 1", "undecided = false"),
    ("gravity_sign =", "gravity_sine ="),
    ("gravity_sign = 0.5", "gravity_sign = -0.5"),
    ("{ gravity_sign = 0.5 }", '["gravity_sign"]'),
]
BAD = [
    *(("task", old, new) for old, new in BAD_NAMES_AND_TASK),
    ("task", "[names]", 'student = "ada"\n[names]'),
    ("task", "[task]", "[answer]\nV = 0\n[task]"),
    ("task", "robots =", "robot ="),
    ("task", '["planar2r", "planar3r"]', "[]"),
    ("task", '["planar2r", "planar3r"]', '"planar2r"'),
    ("task", '["planar2r", "planar3r"]', '["planar2r", "planar2r"]'),
    ("task", '"standard", "modified"', '"craig"'),
    ("task", "[0.5, 2.5]", "0.5"),
    ("task", "[0.5, 2.5]", "[0.5]"),
    ("task", "[0.5, 2.5]", '["0.5", 2.5]'),
    ("task", "digits = 3", "digits = 0"),
    ("task", "digits = 3", "digits = 7"),
    ("task", "digits = 3", "digits = 2.5"),
    ("task", "[0.3, 0.6]", "[0.3, 0.6, 0.01, 0]"),
    ("task", "[0.3, 0.6]", "[0.3, true]"),
    ("task", "[0.3, 0.6]", "{ low = 0.3 }"),
    *(("sheet", old, new) for old, new in BAD_NAMES_AND_TASK + BAD_ANSWERS),
    *(("rubric", old, new) for old, new in BAD_RUBRIC),
]


@pytest.mark.parametrize(("kind", "old", "new"), BAD)
def test_a_wrong_file_neither_fits_nor_is_read(kind, old, new, is_read):
    text = WHOLE[kind].replace(old, new, 1)
    assert text != WHOLE[kind]
    assert not fits(kind, text)
    assert not is_read(kind, text)


def test_a_sheet_without_answers_neither_fits_nor_is_read(is_read):
    for text in (TASK, "answer = {}", "answer = 'V = 0'"):
        assert not fits("sheet", text)
        assert not is_read("sheet", text)


# At every place


def places(document, above=()):
    """Yield the paths of all keys and entries."""
    entries = document.items() if isinstance(document, dict) else enumerate(document)
    for key, value in entries:
        yield (*above, key)
        if isinstance(value, dict | list):
            yield from places(value, (*above, key))


def changed(document, path, change):
    document = copy.deepcopy(document)
    table = document
    for key in path[:-1]:
        table = table[key]
    change(table, path[-1])
    return tomlkit.dumps(document)


def misspell(table, key):
    table[f"{key}x"] = table.pop(key)


def delete(table, key):
    del table[key]


@pytest.mark.slow
@pytest.mark.parametrize("change", [misspell, delete])
@pytest.mark.parametrize("kind", WHOLE)
def test_a_key_that_is_misspelt_or_missing_is_wrong_for_both_or_for_neither(kind, change, is_read):
    document = tomllib.loads(WHOLE[kind])
    for path in places(document):
        if path[:2] == ("variants", "parameters") and path[2:] and change is misspell:
            continue  # the schema does not know the robot's parameters
        if isinstance(path[-1], str):
            text = changed(document, path, change)
            assert fits(kind, text) == is_read(kind, text), path


@pytest.mark.parametrize("kind", [slow_if(kind == "sheet", kind) for kind in WHOLE])
def test_the_schema_raises_no_false_alarm(kind, is_read):
    """A value of another type or size, at whichever place: what does not fit is not read either."""
    document = tomllib.loads(WHOLE[kind])
    for path in places(document):
        for value in (True, -1, 0.5, "text", [], {}):
            if path == ("format",) and value is True:
                continue  # true equals 1 in Python, and not in JSON

            def put(table, key, value=value):
                table[key] = value

            text = changed(document, path, put)
            assert fits(kind, text) or not is_read(kind, text), (path, value)
