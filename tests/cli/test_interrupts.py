"""Ctrl-C at any time: one line and status 130 from the command, KeyboardInterrupt from Python, never a motion.

Module: endings.
"""

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from acceptance import ACCEPTING, slow_if
from dhkit.cli import _reliable_interrupts
from dhkit.planning.program import delayed_interrupts
from dhkit.programs import find_isolation
from waiting import HANGS, wait_for

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


PLAN, SIMULATE = (
    "plan puma560 --to nominal --via zero --intervals 240",
    "simulate puma560 --duration 300",
)
SECONDS = [0.005, 0.05, 0.25, 0.5, 0.8, 1.2]
"""At first what both commands import, then their work."""
TIMES = (
    [(command, seconds) for command in (PLAN, SIMULATE) for seconds in SECONDS]
    if ACCEPTING
    else [
        *((PLAN, seconds) for seconds in SECONDS[::2]),
        *((SIMULATE, seconds) for seconds in SECONDS[1::2]),
    ]
)


@pytest.mark.slow
@pytest.mark.parametrize(("command", "seconds"), TIMES)
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


WAITS = """
import subprocess
def fk(q):
    subprocess.Popen(["sleep", "MARK"])
    while True:
        pass
"""


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows runs no programs")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGKILL"])
@pytest.mark.slow
def test_a_check_that_is_ended_leaves_nothing(name, tmp_path):
    mark = f"{10**6 + os.getpid()}"

    def sleeping():
        return [
            one
            for one in psutil.process_iter(["cmdline"])
            if (one.info["cmdline"] or [])[-1:] == [mark]
        ]

    (tmp_path / "student.py").write_text(WAITS.replace("MARK", mark))
    command = [
        sys.executable,
        "-m",
        "dhkit",
        "check",
        "planar2r",
        str(tmp_path / "student.py"),
        "--seconds",
        "3600",
    ]
    process = subprocess.Popen(
        command,
        env=os.environ | {"TMPDIR": str(tmp_path)},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # Tests under nohup ignore it.
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    )
    try:
        wait_for(sleeping, "the call of the program")
        process.send_signal(getattr(signal, name))
        _, err = process.communicate(timeout=HANGS)
    finally:
        process.kill()
    if name != "SIGKILL":
        assert (process.returncode, err) == (130, "dhkit: interrupted\n")
        assert not list(tmp_path.glob("dhkit-program-*"))
    wait_for(lambda: not sleeping(), "the end of the program and of what it has started")
    assert not list(tmp_path.glob("dhkit-program-*")) or not find_isolation()


@pytest.mark.parametrize(
    "seconds",
    [slow_if(seconds not in {0.0, 0.05}, seconds) for seconds in (0.0, 0.01, 0.05, 0.3, 0.6, 0.9)],
)
def test_planning_is_interrupted_while_programs_are_made_and_solved(seconds):
    done = subprocess.run(
        [sys.executable, "-c", PLANNING, str(seconds)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.stdout == "interrupted\n", done.stderr


@pytest.fixture
def interrupted_in_casadi():
    """Return a function that gets SIGINT in a frame of CasADi's module, which discards exceptions."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    space = {"__name__": "casadi.casadi", "call": lambda: None, "signal": signal}
    exec("def interrupted():\n    signal.raise_signal(signal.SIGINT)\n    call()", space)
    yield space["interrupted"]
    signal.signal(signal.SIGINT, before)


def wait(seconds):
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        pass


def test_an_interrupt_is_raised_where_casadi_does_not_discard_it(interrupted_in_casadi):
    with _reliable_interrupts():
        interrupted_in_casadi()
        with pytest.raises(KeyboardInterrupt):
            wait(2.0)


@pytest.mark.parametrize("begin_inside", [True, False])
def test_an_interrupt_waits_for_the_end_of_a_solution(interrupted_in_casadi, begin_inside):
    passed = []
    with _reliable_interrupts(), pytest.raises(KeyboardInterrupt):
        if not begin_inside:
            interrupted_in_casadi()
        with delayed_interrupts() as arrived:
            if begin_inside:
                interrupted_in_casadi()
            wait(0.05)
            passed.append(len(arrived))
    assert passed == [1]
