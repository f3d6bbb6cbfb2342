"""Ctrl-C at any time: one line and status 130 from the command, KeyboardInterrupt from Python, never a motion."""

import signal
import subprocess
import sys

import pytest

PLANNING = """
import os, signal, sys, threading
from dhkit import Arm
arm = Arm.load("puma560")
signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs of a shell ignore it
try:
    threading.Timer(float(sys.argv[1]), lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    arm.plan("ready", "nominal", intervals=96)
    arm.plan("nominal", "ready", intervals=96)
    print("finished")
except KeyboardInterrupt:
    print("interrupted")
"""


COMMAND = """
import os, signal, sys, threading
from dhkit.cli import main
signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs of a shell ignore it
timer = threading.Timer(float(sys.argv[1]), lambda: os.kill(os.getpid(), signal.SIGINT))
timer.daemon = True
timer.start()
main(sys.argv[2:])
"""


@pytest.mark.parametrize(
    "command", ["plan puma560 --to nominal --via zero --intervals 240", "simulate puma560 --duration 300"]
)
@pytest.mark.parametrize("seconds", [0.005, 0.05, 0.25, 0.5, 0.8, 1.2])
def test_a_command_ends_in_one_line(command, seconds):
    done = subprocess.run(
        [sys.executable, "-c", COMMAND, str(seconds), *command.split()],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("", "dhkit: interrupted\n")
    # Python itself may end by the signal where an extension was being imported; a shell shows 130 for both.
    assert done.returncode in (130, -signal.SIGINT)


@pytest.mark.parametrize("seconds", [0.0, 0.01, 0.05, 0.3, 0.6, 0.9])
def test_planning_is_interrupted_while_programs_are_made_and_solved(seconds):
    done = subprocess.run(
        [sys.executable, "-c", PLANNING, str(seconds)], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout == "interrupted\n", done.stderr
