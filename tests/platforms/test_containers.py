"""Gradescope and PrairieLearn: packages laid out as the platforms document it, and their scripts run there."""

import json
import os
import subprocess
import sys
import zipfile

import jsonschema
import pytest

from dhkit import Arm
from dhkit.description import to_toml
from dhkit.errors import AnswerError
from dhkit.grading.variants import Variants
from dhkit.grading.variants.key import key_files
from dhkit.platforms import pack
from dhkit.platforms.running import grade_submission

from .conftest import PROGRAM, RIGHT_G, TASK, WRONG_G, M

# Gradescope, Autograder Specifications, "Output Format".
GRADESCOPE_RESULTS = {
    "type": "object",
    "required": ["score", "tests"],
    "additionalProperties": False,
    "properties": {
        "score": {"type": "number", "minimum": 0},
        "execution_time": {"type": "number", "minimum": 0},
        "output": {"type": "string"},
        "output_format": {"enum": ["text", "html", "simple_format", "md", "ansi"]},
        "test_output_format": {"enum": ["text", "html", "simple_format", "md", "ansi"]},
        "visibility": {"enum": ["hidden", "after_due_date", "after_published", "visible"]},
        "stdout_visibility": {"enum": ["hidden", "after_due_date", "after_published", "visible"]},
        "extra_data": {"type": "object"},
        "tests": {
            "type": "array",
            "items": {
                "type": "object",
                "required": ["name", "score", "max_score"],
                "additionalProperties": False,
                "properties": {
                    "name": {"type": "string"},
                    "score": {"type": "number", "minimum": 0},
                    "max_score": {"type": "number", "minimum": 0},
                    "status": {"enum": ["passed", "failed"]},
                    "output": {"type": "string"},
                    "output_format": {"enum": ["text", "html", "simple_format", "md", "ansi"]},
                    "visibility": {
                        "enum": ["hidden", "after_due_date", "after_published", "visible"]
                    },
                },
            },
        },
    },
}
# PrairieLearn, External Grading, "Grading results".
PRAIRIELEARN_RESULTS = {
    "type": "object",
    "properties": {
        "gradable": {"type": "boolean"},
        "score": {"type": "number", "minimum": 0, "maximum": 1},
        "message": {"type": "string"},
        "output": {"type": "string"},
        "format_errors": {"type": "array", "items": {"type": "string"}},
        "tests": {
            "type": "array",
            "items": {
                "type": "object",
                "required": ["name", "points", "max_points"],
                "properties": {
                    "name": {"type": "string"},
                    "points": {"type": "number", "minimum": 0},
                    "max_points": {"type": "number", "minimum": 0},
                    "message": {"type": "string"},
                    "output": {"type": "string"},
                },
            },
        },
    },
    "if": {"properties": {"gradable": {"const": True}}},
    "then": {"required": ["score"]},
    "else": {"required": ["format_errors"]},
}
MOST_BYTES = 1_000_000
"""Of PrairieLearn's results."""


def environment():
    """Return what a container's script finds: the Python that has dhkit, and little else."""
    keep = ("PATH", "HOME", "TMPDIR", "PYTHONPATH", "LD_LIBRARY_PATH")
    return {name: os.environ[name] for name in keep if name in os.environ} | {
        "DHKIT_PYTHON": sys.executable
    }


def run(script, platform):
    """Run a package's script as the container does."""
    root = script.parent if platform == "gradescope" else script.parents[1]
    subprocess.run([script], check=True, env=environment(), cwd=root.parent, timeout=120)


def judge(script, platform):
    """Do what the script does, in this process, which takes a tenth of the time."""
    grade_submission(platform, script.parent if platform == "gradescope" else script.parents[1])


def on_gradescope(folder, task, files, users=(), execute=judge):
    """Return the results of an autograder that gets these files, of these users."""
    archive = folder / "autograder.zip"
    pack("gradescope", task).write(archive)
    root = folder / "autograder"
    (root / "submission").mkdir(parents=True)
    (root / "results").mkdir()
    with zipfile.ZipFile(archive) as zipped:
        zipped.extractall(root / "source")
        assert zipped.getinfo("setup.sh").external_attr >> 16 & 0o111
    script = root / "run_autograder"
    script.write_bytes((root / "source" / "run_autograder").read_bytes())
    script.chmod(0o755)
    (root / "submission_metadata.json").write_text(json.dumps({"id": 7, "users": list(users)}))
    for name, text in files.items():
        (root / "submission" / name).write_text(text)
    execute(script, "gradescope")
    results = json.loads((root / "results" / "results.json").read_text())
    jsonschema.validate(results, GRADESCOPE_RESULTS)
    return results


def on_prairielearn(folder, task, files, execute=judge):
    """Return the results of an external grader that gets these files."""
    question = folder / "question"
    pack("prairielearn", task).write(question)
    root = folder / "grade"
    (root / "student").mkdir(parents=True)
    (question / "tests").rename(root / "tests")
    for name, text in files.items():
        (root / "student" / name).write_text(text)
    execute(root / "tests" / "run.sh", "prairielearn")
    content = (root / "results" / "results.json").read_text()
    assert len(content) < MOST_BYTES
    results = json.loads(content)
    jsonschema.validate(results, PRAIRIELEARN_RESULTS)
    return results


def test_gradescope_judges_a_submission(tmp_path, task):
    results = on_gradescope(
        tmp_path, task, {"answer.py": PROGRAM, "report.pdf": "%PDF"}, execute=run
    )
    assert results["score"] == pytest.approx(20 - 10 / 3)
    failed = [test["name"] for test in results["tests"] if test["status"] == "failed"]
    assert failed == ["g2"]
    assert sum(test["max_score"] for test in results["tests"]) == pytest.approx(20)


@pytest.mark.parametrize(
    ("files", "reason"),
    [
        ({}, "no answer sheet"),
        ({"answer.py": "M = 3 +"}, "answer.py: line 1: no Python"),
        (
            {"a.py": PROGRAM, "b.py": PROGRAM},
            "found several answer files: a.py, b.py; expected one",
        ),
        ({"report.docx": "?"}, "no answer sheet"),
    ],
    ids=["nothing", "unreadable", "several", "another kind"],
)
def test_what_cannot_be_judged_gets_a_reason_and_no_paths(tmp_path, task, files, reason):
    gradescope = on_gradescope(tmp_path / "a", task, files)
    assert gradescope["score"] == 0
    assert reason in gradescope["output"]
    prairielearn = on_prairielearn(tmp_path / "b", task, files)
    assert prairielearn["gradable"] is False
    assert reason in prairielearn["format_errors"][0]
    for text in (gradescope["output"], *prairielearn["format_errors"]):
        assert str(tmp_path) not in text


def test_prairielearn_judges_a_submission(tmp_path, task):
    results = on_prairielearn(tmp_path, task, {"answer.py": PROGRAM}, execute=run)
    assert results["score"] == pytest.approx((20 - 10 / 3) / 20)
    assert [test["name"] for test in results["tests"] if not test["points"]] == ["g2"]


def test_a_robot_beside_the_task_goes_along_and_the_students_does_not_count(tmp_path, task):
    heavy = to_toml(Arm.load("planar2r").description).replace("m2 = 1.5", "m2 = 9")
    (tmp_path / "arms").mkdir()
    (tmp_path / "arms" / "own.toml").write_text(heavy)
    task.write_text(TASK.replace('"planar2r"', '"arms/own.toml"'))
    files = {
        "answer.toml": f'format = 1\nrobot = "arms/own.toml"\n[answer]\nM = "{M}"\ng = "{RIGHT_G}"\n'
    }
    results = on_gradescope(tmp_path / "a", task, files)
    assert results["score"] == 20


def test_a_question_of_prairielearn_has_what_its_schema_requires(task):
    package = pack("prairielearn", task, image="university/dhkit")
    info = json.loads(package.files["info.json"])
    assert info["type"] == "v3"
    assert info["gradingMethod"] == "External"
    assert info["externalGradingOptions"]["image"] == "university/dhkit"
    assert info["externalGradingOptions"]["entrypoint"] == "/grade/tests/run.sh"
    assert len(info["uuid"]) == 36
    assert json.loads(pack("prairielearn", task).files["info.json"])["uuid"] == info["uuid"]
    page = package.files["question.html"].decode()
    assert '<pl-file-editor file-name="answer.toml"' in page
    assert "<pl-external-grader-results>" in page
    assert "dhkit-robotics==" in package.files["image/Dockerfile"].decode()


def test_a_wheel_is_packed_and_installed(tmp_path, task):
    wheel = tmp_path / "dhkit_robotics-0.2.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("dhkit/__init__.py", "")
    package = pack("gradescope", task, wheel=wheel)
    assert package.files[wheel.name] == wheel.read_bytes()
    assert f'install --no-cache-dir "./{wheel.name}"' in package.files["setup.sh"].decode()
    question = pack("prairielearn", task, wheel=wheel)
    assert f"COPY {wheel.name} ./" in question.files["image/Dockerfile"].decode()


def test_the_same_task_gives_the_same_bytes(tmp_path, task):
    assert pack("gradescope", task).zipped() == pack("gradescope", task).zipped()
    pack("otter", task).write(tmp_path / "out")
    with pytest.raises(AnswerError, match="exists"):
        pack("otter", task).write(tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("planar2r", "planar9r"), "planar9r"),
        (lambda text: text.replace('robot = "planar2r"\n', ""), "robot: missing"),
        (
            lambda text: text.replace('"planar2r"', '"../planar2r.toml"'),
            "leaves the sheet's folder",
        ),
        (lambda text: text + "[answer]\n", "answer"),
        (lambda text: text.replace("points = 20", "points = -1"), "points"),
    ],
)
def test_a_bad_task_is_refused_in_one_line(task, change, message):
    task.write_text(change(TASK))
    for platform in ("gradescope", "otter", "moodle"):
        with pytest.raises(AnswerError, match=message) as caught:
            pack(platform, task).zipped()
        assert "\n" not in str(caught.value)


def test_two_tasks_have_two_identities(tmp_path):
    identities = set()
    for name, asked in (("week1", '["M", "g"]'), ("week2", '["M", "g"]'), ("week3", '["g"]')):
        (tmp_path / name).mkdir()
        path = tmp_path / name / "task.toml"
        path.write_text(TASK.replace('["M", "g"]', asked))
        info = json.loads(pack("prairielearn", path).files["info.json"])
        assert info["title"].startswith(f"{name}: planar2r")
        quiz = next(file for file in pack("canvas", path).files if file != "imsmanifest.xml")
        identities |= {info["uuid"], quiz}
        assert f"source/{name}/{name}.ipynb" in pack("nbgrader", path).files
    assert len(identities) == 6


def test_a_table_that_is_asked_for_is_not_shown(tmp_path):
    path = tmp_path / "table.toml"
    path.write_text('robot = "puma560_cao"\n[task]\nasked = ["dh"]\n')
    page = pack("prairielearn", path).files["question.html"].decode()
    assert "Denavit-Hartenberg table" in page
    assert "-0.41" not in page and "16.39" not in page


def test_a_wheel_of_something_else_is_refused(tmp_path, task):
    other = tmp_path / "numpy-2.0-py3-none-any.whl"
    other.write_bytes(b"")
    with pytest.raises(AnswerError, match="expected a wheel of dhkit"):
        pack("gradescope", task, wheel=other)
    with pytest.raises(AnswerError, match="expected gradescope, prairielearn"):
        pack("blackboard", task)


VARIED = TASK.replace("[rubric]", "values = true\n[variants.parameters]\nm2 = [1.0, 3.0]\n[rubric]")


def key_of(folder, students):
    """Write the key of a task's variants, and return its folder and each student's mass of link 2."""
    task = folder / "varied.toml"
    task.write_text(VARIED)
    variants = Variants.load(task)
    drawn = [variants.of(student, 3) for student in students]
    for name, content in key_files(variants, task, drawn, 3).items():
        path = folder / "key" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return folder / "key", {one.student: one.values["m2"] for one in drawn}


def test_each_student_of_gradescope_is_judged_by_the_own_numbers(tmp_path):
    key, masses = key_of(tmp_path, ["ada", "1815"])
    assert masses["ada"] != masses["1815"]
    in_numbers = PROGRAM.replace(WRONG_G, RIGHT_G)
    for name, number in (("m1", "2.0"), ("l1", "0.5"), ("l2", "0.4"), ("m2", masses["ada"])):
        in_numbers = in_numbers.replace(name, number)
    ada = {"email": "ada@example.edu", "id": 1, "name": "Ada Lovelace"}
    charles = {"email": "cb@example.edu", "id": 2, "name": "Charles Babbage", "sid": "1815"}
    files = {"answer.py": in_numbers}
    assert on_gradescope(tmp_path / "ada", key, files, [ada])["score"] == 20
    assert on_gradescope(tmp_path / "charles", key, files, [charles])["score"] < 10
    stranger = on_gradescope(tmp_path / "stranger", key, files, [{"email": "x@example.edu"}])
    assert stranger["score"] == 0
    assert "no variant for x@example.edu" in stranger["output"]


def test_variants_are_packed_by_their_key_alone(tmp_path):
    key, _ = key_of(tmp_path, ["ada"])
    with pytest.raises(AnswerError, match="has variants"):
        pack("gradescope", tmp_path / "varied.toml")
    with pytest.raises(AnswerError, match="only Gradescope says who hands in"):
        pack("otter", key)
    (key / "robots" / "ada.toml").write_text("changed")
    with pytest.raises(AnswerError, match="not the robot file that was written"):
        pack("gradescope", key)
