"""Where output goes: pipes that lack letters, named pipes and devices; and what help says."""

import contextlib
import io
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import numpy as np
import pytest

from dhkit import Arm, Limits
from dhkit.cli import app as app_module, main
from dhkit.cli.app import load_command
from dhkit.cli.output import print_json
from dhkit.cli.streams import _plain
from dhkit.description.files import write_atomically

COMMANDS = {name: load_command(name) for name in app_module.COMMANDS}


@pytest.mark.parametrize("encoding", ["cp1252", "ascii"])
@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("info puma560", "theta"),
        ("ik puma560 --like ready --near ready", "-> nearest"),
        ("ik --help", "Print every way"),
        ("info puma560 --json", '"name": "puma560"'),
    ],
)
def test_letters_that_a_pipe_lacks_are_replaced(encoding, command, words, monkeypatch):
    out, err = (
        io.TextIOWrapper(io.BytesIO(), encoding=encoding, write_through=True) for _ in range(2)
    )
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(sys, "stderr", err)
    with pytest.raises(SystemExit) as ended:
        main(command.split())
    assert (ended.value.code, err.buffer.getvalue()) == (0, b"")
    text = out.buffer.getvalue().decode(encoding)
    assert words in text
    if "--json" in command:
        assert json.loads(text)["source"] == Arm.load("puma560").description.source


def test_letters_that_a_pipe_of_a_process_lacks_are_replaced():
    env = os.environ | {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    command = [sys.executable, "-m", "dhkit", "info", "puma560"]
    done = subprocess.run(command, capture_output=True, env=env, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, b"")
    assert "theta" in done.stdout.decode("ascii")


def test_letters_become_plain_ones():
    assert (
        "".join(map(_plain, "θ α Θ → ² ½ é ─│ 90° 関")) == "theta alpha Theta -> 2 12 e -| 90 deg ?"
    )


HOSTILE = "\x1b]0;title\x07\x1b[2J\x9b1m\u202egnp."
"""A title, a cleared screen, bold by a C1 character, and text that runs from right to left."""


@pytest.mark.parametrize(
    "words", [["check", "planar2r", "{}.py"], ["info", "{}.toml"], ["info", "{}.urdf"]]
)
def test_names_of_files_reach_a_terminal_without_control_characters(
    words, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    names = [word.format(HOSTILE) for word in words]
    Path(names[-1]).write_text("nonsense")
    with pytest.raises(SystemExit):
        main(names)
    written = "".join(capsys.readouterr())
    assert r"\x1b]0;title" in written
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]", written)


def test_json_has_control_characters_as_escapes(capsys):
    print_json({"name": HOSTILE})
    written = capsys.readouterr().out
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]", written)
    assert json.loads(written) == {"name": HOSTILE}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
@pytest.mark.parametrize("command", ["build planar2r", "equations planar2r"])
def test_a_named_pipe_is_written_through_and_stays(command, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
    reader.start()
    subprocess.run(
        [sys.executable, "-m", "dhkit", *command.split(), "-o", str(pipe)], check=True, timeout=60
    )
    reader.join(10)
    assert len(read[0]) > 100
    assert pipe.is_fifo()
    assert list(tmp_path.iterdir()) == [pipe]


def test_a_stream_that_goes_into_a_file_is_written_through(tmp_path):
    path = tmp_path / "both.txt"
    command = f"'{sys.executable}' -m dhkit equations planar2r -o /dev/stdout"
    with path.open("w") as file:
        file.write("before\n")
        file.flush()
        subprocess.run(shlex.split(command), stdout=file, check=True, timeout=60)
    text = path.read_text()
    assert text.startswith("before\nM11 = ")
    assert text.endswith("wrote /dev/stdout\n")


def test_a_device_is_written_through():
    done = subprocess.run(
        [sys.executable, "-m", "dhkit", "equations", "planar2r", "-o", "/dev/stdout"],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    assert "M22 = m2*l2^2/3" in done.stdout


def test_summaries_are_whole():
    done = subprocess.run(
        [sys.executable, "-m", "dhkit", "--help"], capture_output=True, text=True, check=True
    )
    listed = " ".join(done.stdout.split("Commands:")[1].split())
    assert "..." not in listed
    for name, command in COMMANDS.items():
        assert f"{name} {' '.join(command.help.split(chr(10) * 2)[0].split())}" in listed


def test_options_of_one_meaning_have_one_name():
    for name, command in COMMANDS.items():
        for option in command.params:
            if option.name == "output":
                assert option.opts == ["--output", "-o"], name
            assert not set(option.opts) & {
                "--out",
                "--outfile",
                "--file",
                "--deg",
                "--n-samples",
            }, name
            if option.name == "form":
                assert option.opts == ["--format"], name
            if "--json" in option.opts:
                assert option.help == "Print JSON for machines.", name


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals")
@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("plan puma560 --to nominal --intervals 48", "of the search's limit"),
        ("simulate puma560 --duration 3", "simulating"),
    ],
)
@pytest.mark.slow
def test_a_bar_shows_how_far_it_is(command, words):
    """On a terminal of its own; the bar is there from the beginning, so that the work need not last."""
    ours, theirs = os.openpty()
    at_once = "from dhkit.cli import main, progress; progress.DELAY = 0.0; main()"
    program = [sys.executable, "-c", at_once, *command.split()]
    process = subprocess.Popen(program, stdout=subprocess.DEVNULL, stderr=theirs)
    os.close(theirs)
    shown = b""
    with contextlib.suppress(OSError):  # the terminal's end
        while part := os.read(ours, 65536):
            shown += part
    os.close(ours)
    assert process.wait(60) == 0
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.decode())
    assert words in text
    assert "━" in text


def test_what_is_not_limited_is_said(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["plan", "planar2r", "--to", "1", "1", "--intervals", "12"])
    assert "\nnot limited: acceleration, jerk\n" in capsys.readouterr().out
    arm = Arm.load("planar2r")
    slow = Limits.of(arm.description, acceleration=[5, np.inf], jerk=100)
    motion = arm.plan([0, 0], [1, 1], limits=slow, intervals=12)
    assert motion.report.unlimited == ("acceleration of joint 2",)
    assert "not limited: acceleration of joint 2" in str(motion.report)


SHELL = f"'{sys.executable}' -m dhkit"


@pytest.mark.parametrize(
    ("command", "status", "words"),
    [
        ("fk puma560 nominal >&-", 0, ""),
        ("fk puma560 99 0 0 0 0 0 2>&-", 0, "tool "),
        ("fk puma560 99 0 0 0 0 0 2>/dev/full", 0, "tool "),
        ("fk puma560 nowhere 2>/dev/full", 2, ""),
        ("equations planar2r -o /dev/full", 2, ""),
    ],
)
@pytest.mark.slow
def test_streams_that_take_nothing_lose_nothing_else(command, status, words):
    done = subprocess.run(
        ["/bin/sh", "-c", f"{SHELL} {command}"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == status
    assert words in done.stdout
    assert "Traceback" not in done.stderr
    if "equations" in command:
        assert done.stderr == "dhkit: /dev/full: No space left on device\n"


@pytest.mark.parametrize("command", ["robots", "robots --json", "info puma560"])
@pytest.mark.slow
def test_a_reader_that_goes_away_is_no_answer_of_no(command):
    first = subprocess.Popen(
        [sys.executable, "-m", "dhkit", *command.split()], stdout=subprocess.PIPE
    )
    first.stdout.close()
    assert first.wait(60) == 141


@pytest.mark.skipif(not os.access("/dev/shm", os.W_OK), reason="no /dev/shm")
def test_files_below_dev_are_replaced_whole():
    with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
        path = Path(folder) / "out.txt"
        for text in ("long before", "now"):
            write_atomically(path, text)
        assert path.read_text() == "now"
