"""Files that describe no robot: one line that says what and where, soon, and nothing written."""

import os
import time

import pytest

from bad_robot_files import BAD, BAD_BYTES, BODY, GOOD
from dhkit.cli import main
from dhkit.description import from_toml, read_robot
from dhkit.errors import DescriptionError
from dhkit.model import link_parts


def test_the_file_that_the_others_are_made_from_is_good():
    assert from_toml(GOOD + BODY).n == 1


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line(name, tmp_path, law):
    text, complaint = BAD[name]
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    refuse(path, complaint, law)


@pytest.mark.parametrize("name", BAD_BYTES)
def test_bytes_that_are_no_text_are_refused_in_one_line(name, tmp_path, law):
    content, complaint = BAD_BYTES[name]
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    refuse(path, complaint, law)


def test_a_byte_order_mark_is_no_harm(tmp_path):
    (tmp_path / "good.toml").write_bytes(b"\xef\xbb\xbf" + GOOD.encode())
    assert read_robot(tmp_path / "good.toml").n == 1


@pytest.mark.parametrize("content", [b"", b"garbage", b"\0" * 84, b"solid but no more"])
def test_a_mesh_that_is_none_is_a_warning_and_the_link_is_drawn_from_the_table(content, tmp_path):
    (tmp_path / "bad.stl").write_bytes(content)
    (tmp_path / "good.toml").write_text(GOOD + 'shape = { mesh = "bad.stl" }')
    arm = read_robot(tmp_path / "good.toml")
    assert "is not a mesh that can be read" in arm.warnings[0]
    assert all(part.file is None for part in link_parts(arm))


def test_a_file_of_200_mb_is_not_read(tmp_path, law):
    path = tmp_path / "bad.toml"
    with path.open("wb") as file:
        file.write(GOOD.encode())
        file.truncate(200_000_000)
    refuse(path, "more than 1 MB", law)


def test_what_is_no_file_is_refused(tmp_path, law):
    refuse(tmp_path, "not a regular file", law, folder=tmp_path)
    refuse(tmp_path / "none.toml", "no such file", law)
    os.mkfifo(tmp_path / "pipe.toml")
    refuse(tmp_path / "pipe.toml", "not a regular file", law)


def test_a_mesh_by_a_link_that_leaves_the_folder_is_refused(tmp_path, law):
    (tmp_path / "robot").mkdir()
    (tmp_path / "secret.stl").write_text("x")
    (tmp_path / "robot" / "innocent.stl").symlink_to(tmp_path / "secret.stl")
    path = tmp_path / "robot" / "bad.toml"
    path.write_text(GOOD + 'shape = { mesh = "innocent.stl" }')
    refuse(path, "a link that leaves", law)


def test_a_mesh_of_200_mb_and_a_missing_one_are_warnings(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(GOOD + 'shape = { mesh = "huge.stl" }')
    assert "'huge.stl' is not there" in read_robot(path).warnings[0]
    with (tmp_path / "huge.stl").open("wb") as file:
        file.truncate(200_000_000)
    assert "more than 50 MB" in read_robot(path).warnings[0]


def refuse(path, complaint, law, folder=None):
    start = time.process_time()
    with pytest.raises(DescriptionError, match=complaint) as error:
        read_robot(path)
    law.takes("seconds to refuse a robot file", time.process_time() - start, 1.0, path)
    message = str(error.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert len(message) < 600


@pytest.mark.parametrize(
    "name", ["negative mass", "import", "10,000 brackets", "deeply nested TOML", "zero joints"]
)
def test_the_command_says_so_with_status_2_and_writes_nothing(name, tmp_path, monkeypatch, capsys):
    (tmp_path / "bad.toml").write_text(BAD[name][0])
    monkeypatch.chdir(tmp_path)
    for command in (["info"], ["build"], ["fk"], ["demo", "--robot"]):
        with pytest.raises(SystemExit) as exit:
            main([*command, "bad.toml", *(["0"] if command == ["fk"] else [])])
        out, err = capsys.readouterr()
        assert exit.value.code == 2
        assert out == ""
        assert err.startswith("dhkit: bad.toml: ")
        assert err.count("\n") == 1
        assert [file.name for file in tmp_path.iterdir()] == ["bad.toml"]
