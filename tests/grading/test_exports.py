"""Submissions as Canvas, Moodle and Gradescope export them: whose they are, when they came, and which counts."""

import shutil
import zipfile
from pathlib import Path

import pytest

from dhkit.errors import AnswerError
from dhkit.grading.exports import ExportKind, last_attempts, opened_submissions, with_ids
from dhkit.grading.variants.students import read_students

METADATA = """---
submission_111:
  :submitters:
  - :name: Ada Lovelace
    :sid: '1815'
    :email: ada@example.edu
  :created_at: 2026-11-19 20:08:23.584540000 Z
  :score: 10.0
  :status: processed
  :results: !ruby/hash:ActiveSupport::HashWithIndifferentAccess
    tests:
    - output: "a: b\\n- c"
  :history: []
submission_205:
  :submitters:
  - :name: Charles Babbage
    :sid:
    :email: bab@example.edu
  - :name: Ada Lovelace
    :sid: '1815'
    :email: ada@example.edu
  :created_at: 2026-11-20 23:08:23 Z
  :score: 4.0
  :history:
  - :id: 199
    :created_at: 2026-11-18 10:00:00.000000000 Z
    :score: 0.0
"""
EXPORTS = {
    ExportKind.CANVAS: {
        "lovelaceada_101_5001_answer.py": "a",
        "lovelaceada_LATE_101_5009_answer-1.py": "a1",
        "lovelaceada_101_5003_scan.pdf": "pdf",
        "babbagecharles_102_5002_lab-1.py": "b1",
        "babbagecharles_102_5004_lab-2.py": "b2",
        "babbagecharles_103_5005_my_own answer.toml": "[answer]",
    },
    ExportKind.MOODLE: {
        "Lovelace Ada_4711_assignsubmission_file_/answer.py": "a",
        "Lovelace Ada_4711_assignsubmission_file_/notes.txt": "n",
        "Müller-Lüdenscheidt Élodie_4712_assignsubmission_file/part/answer.m": "m",
    },
    ExportKind.GRADESCOPE: {
        "assignment_7_export/submission_metadata.yml": METADATA,
        "assignment_7_export/submission_111/answer.py": "a",
        "assignment_7_export/submission_205/answer.py": "both",
        "assignment_7_export/submission_199/answer.py": "early",
        "assignment_7_export/submission_300/answer.py": "nobody's",
    },
    ExportKind.PLAIN: {
        "class/ada/answer.py": "a",
        "class/bob.py": "b",
        "class/robot.toml": "[[joint]]\n",
    },
}
FLAT_MOODLE = {
    "Lovelace Ada_4711_assignsubmission_file_answer.py": "a",
    "Babbage Charles_4712_assignsubmission_file_answer-final.py": "b",
}


def written(folder, files):
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
    return folder


def packed(path, files):
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return path


def read(path, **options):
    """Return the notes, and what a sheet says beside its file, by the file's content."""
    with opened_submissions([path], **options) as found:
        return found.notes, {sheet.path.read_text("utf-8"): sheet for sheet in found.sheets}


@pytest.mark.parametrize("kind", EXPORTS)
def test_a_zip_a_tar_and_a_folder_are_read_alike(tmp_path, kind, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(Path("files"), EXPORTS[kind])
    shutil.make_archive("one", "zip", "files")
    shutil.make_archive("two", "gztar", "files")
    top = (
        next(Path("files").iterdir())
        if kind in (ExportKind.PLAIN, ExportKind.GRADESCOPE)
        else Path("files")
    )
    seen = []
    for path in (Path("one.zip"), Path("two.tar.gz"), top):
        with opened_submissions([path]) as found:
            seen.append({(s.student, s.path.name, s.attempt, s.error) for s in found.sheets})
            assert all(str(path) in sheet.name for sheet in found.sheets)
            if kind is not ExportKind.PLAIN:
                assert f"read as a {kind.sentence}" in found.notes[0]
    assert seen[0] == seen[1] == seen[2]


def test_canvas(tmp_path):
    notes, sheets = read(packed(tmp_path / "c.zip", EXPORTS[ExportKind.CANVAS]))
    assert notes[0].endswith("read as a Canvas export: 3 students, 1 of them handed in again")
    assert "1 file marked LATE by Canvas, which does not say by how much" in notes[1]
    assert {text: (s.student, s.attempt) for text, s in sheets.items()} == {
        "a": ("lovelaceada_101", 0),
        "a1": ("lovelaceada_101", 1),
        "b1": ("babbagecharles_102", 0),
        "b2": ("babbagecharles_102", 0),
        "[answer]": ("babbagecharles_103", 0),
    }
    assert sheets["a"].beside == ("lovelaceada_101_5003_scan.pdf",)
    assert sheets["a1"].is_marked_late
    assert sheets["b1"].aliases == ("102", "babbagecharles")
    # The student's own numbers do not make one file a later version of another.
    assert {s.path.name for s in last_attempts(list(sheets.values()))} == {
        name for name in EXPORTS[ExportKind.CANVAS] if "answer.py" not in name and "pdf" not in name
    }


def test_moodle(tmp_path):
    _, sheets = read(packed(tmp_path / "m.zip", EXPORTS[ExportKind.MOODLE]))
    assert sheets["a"].student == "Lovelace Ada_4711"
    assert sheets["a"].beside == ("notes.txt",)
    assert sheets["m"].aliases == ("4712", "Müller-Lüdenscheidt Élodie")
    notes, sheets = read(packed(tmp_path / "f.zip", FLAT_MOODLE))
    assert "Moodle export: 2 students" in notes[0]
    assert sheets["b"].student == "Babbage Charles_4712"


def test_gradescope(tmp_path):
    notes, _ = read(packed(tmp_path / "g.zip", EXPORTS[ExportKind.GRADESCOPE]))
    assert "Gradescope export: 3 students, 2 of them handed in again" in notes[0]
    with opened_submissions([tmp_path / "g.zip"]) as found:
        seen = [(s.student, s.path.parent.name, s.attempt, str(s.time)[:19]) for s in found.sheets]
        assert sorted(seen) == [
            ("1815", "submission_111", 1, "2026-11-19 20:08:23"),
            ("1815", "submission_199", 0, "2026-11-18 10:00:00"),
            ("1815", "submission_205", 2, "2026-11-20 23:08:23"),
            ("bab@example.edu", "submission_199", 0, "2026-11-18 10:00:00"),
            ("bab@example.edu", "submission_205", 1, "2026-11-20 23:08:23"),
            ("submission_300", "submission_300", 0, "None"),
        ]
        last = last_attempts(found.sheets)
        assert {(s.student, s.path.parent.name) for s in last} == {
            ("1815", "submission_205"),
            ("bab@example.edu", "submission_205"),
            ("submission_300", "submission_300"),
        }
        assert "not named in submission_metadata.yml" in [s.error for s in found.sheets]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("- a", "found no submissions"),
        ("submission_1: 3", "submission_1: no submitters"),
        ("submission_1:\n  :submitters:\n  - {}\n", "a submitter without name, email and sid"),
        ("a: [", "not YAML: "),
        ("a: &a [*a]", "a: no submitters"),
        ("a: !!python/object/apply:os.system [id]", "not YAML: "),
    ],
)
def test_metadata_that_is_none_is_a_line(tmp_path, text, line):
    written(tmp_path / "g", {"submission_metadata.yml": text, "submission_1/a.py": ""})
    with pytest.raises(AnswerError) as caught:
        read(tmp_path / "g")
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'g'}: submission_metadata.yml: ")
    assert line in message
    assert "\n" not in message


def test_the_layout_can_be_given(tmp_path):
    path = packed(tmp_path / "c.zip", EXPORTS[ExportKind.CANVAS] | {"notes.py": "n"})
    notes, sheets = read(path)
    assert "plain folder" in notes[0]
    assert sheets["a"].student == "lovelaceada_101_5001_answer"
    _, sheets = read(path, kind=ExportKind.CANVAS)
    assert sheets["a"].student == "lovelaceada_101"
    assert "not the name of a file of Canvas" in sheets["n"].error


def test_no_sheet_at_all_names_the_archive(tmp_path):
    path = packed(tmp_path / "c.zip", {"lovelaceada_101_5001_answer.pdf": ""})
    with pytest.raises(AnswerError, match=r"c\.zip: no answer sheet; expected files that end in"):
        read(path)


def test_an_archive_with_the_folder_of_one_student(tmp_path):
    _, sheets = read(packed(tmp_path / "c.zip", {"ada/answer.py": "a"}))
    assert sheets["a"].student == "ada"
    _, sheets = read(packed(tmp_path / "d.zip", {"class/ada.py": "a", "class/bob.py": "b"}))
    assert [sheets[text].student for text in "ab"] == ["ada", "bob"]


BY_NUMBER = 'Student,ID,SIS Login ID\n"Lovelace, Ada",101,ada@x\n"Babbage, C",102,bab@x\n'
BY_NAME = 'Student,SIS Login ID\n"Lovelace, Ada",ada@x\n"Babbage, Charles",bab@x\n'


@pytest.mark.parametrize(
    ("table", "ids"),
    [
        (BY_NUMBER, {"ada@x", "bab@x", "babbagecharles_103"}),
        (BY_NAME, {"ada@x", "babbagecharles_102", "babbagecharles_103"}),
    ],
)
def test_rows_get_the_ids_of_a_list_of_students(tmp_path, table, ids):
    """By Canvas's number; by the name where only one student has it: here two are called Babbage."""
    (tmp_path / "students.csv").write_text(table)
    path = packed(tmp_path / "c.zip", EXPORTS[ExportKind.CANVAS])
    with opened_submissions([path]) as found:
        named, unknown = with_ids(found.sheets, read_students(tmp_path / "students.csv"))
    assert {sheet.student for sheet in named} == ids
    assert set(unknown) == {student for student in ids if "@" not in student}


def test_nested_aliases_of_yaml_are_no_names(tmp_path):
    folder = tmp_path / "export"
    (folder / "submission_1").mkdir(parents=True)
    (folder / "submission_1" / "answer.py").write_text("g1 = 0")
    (folder / "submission_metadata.yml").write_text(
        "submission_1:\n  :submitters:\n  - :sid: &a0 x\n"
        + "".join(f"  - :name: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]\n" for k in range(1, 12))
    )
    with pytest.raises(AnswerError, match="a submitter without name"), opened_submissions([folder]):
        pass
