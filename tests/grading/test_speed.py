"""How long judging takes, once everything is imported: figures that `make accept` holds to their limits."""

import subprocess
import sys
import time

import pytest

from acceptance import ACCEPTING, only_accepting
from dhkit.description import library_robot
from dhkit.grading import grade_answers
from dhkit.grading.judging import truth as truths
from dhkit.grading.judging.truth import truth_of
from dhkit.grading.mistakes.diagnosis import _mistakes_of, variants_of
from dhkit.symbolic.mistakes import MadeAt
from dhkit.symbolic.textbook import _motion, _places, derive
from grading_answers import SHEETS, written

pytestmark = pytest.mark.slow

DYNAMICS = ("M", "C", "g", "tau")


def forget():
    for cache in (truths.truth_of, variants_of, _mistakes_of, _motion, _places):
        cache.cache_clear()


def timed(description, answers):
    begin = time.perf_counter()
    report = grade_answers(description, answers)
    return time.perf_counter() - begin, report


def with_mistakes(description, quantities, mistakes):
    truth = truth_of(description)
    wrong = derive(description, mistakes)
    found = {}
    for quantity in quantities:
        value = 2 * truth.lagrangian.C if quantity == "C" else getattr(wrong, quantity)
        found[quantity] = written(value, truth.arm(quantity))
    return found


@pytest.fixture(scope="module", autouse=True)
def _started():
    grade_answers(library_robot("polar_rp"), {"g": ["0.3333*q2", "sqrt(q2)"]})


@only_accepting
def test_a_right_entry(law):
    description = library_robot("planar2r")
    truth = truth_of(description)
    answers = {
        quantity: written(truth.of(quantity), truth.arm(quantity)) for quantity in ("M", "g", "tau")
    }
    seconds, report = min((timed(description, answers) for _ in range(5)), key=lambda pair: pair[0])
    law.takes("a verdict, ms an entry", 1e3 * seconds / len(report.entries), 20)


@pytest.mark.parametrize(
    ("robot", "quantities", "mistakes", "first", "then"),
    [
        ("planar2r", DYNAMICS, {MadeAt("half_forgotten", 2), "gravity_sign"}, 1.0, 0.1),
        (
            "planar3r",
            DYNAMICS,
            {MadeAt("inertia_forgotten", 2), MadeAt("height_at_joint", 3)},
            5.0,
            5.0,
        ),
        ("puma560", ("M",), {MadeAt("inertia_forgotten", 3)}, 30.0, 30.0),
    ],
)
def test_a_sheet_with_its_full_diagnosis(robot, quantities, mistakes, first, then, law):
    description = library_robot(robot)
    answers = with_mistakes(description, quantities, mistakes)
    forget()
    seconds, report = timed(description, answers)
    law.takes(f"{robot}, {', '.join(quantities)}, first, s", seconds, first)
    assert report.verdict.value == "wrong" and all(found.mistake for found in report.diagnosis)
    if ACCEPTING:
        seconds = min(timed(description, answers)[0] for _ in range(3))
        law.takes(f"{robot}, {', '.join(quantities)}, variants known, s", seconds, then)


def command_line(*arguments):
    """Run `dhkit grade` in a new process; return the seconds that it takes, and the process."""
    command = [
        sys.executable,
        "-c",
        "from dhkit.cli import main; main()",
        "grade",
        *map(str, arguments),
    ]
    begin = time.perf_counter()
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    return time.perf_counter() - begin, result


def test_a_class_of_two_hundred(law, tmp_path):
    """Of planar2r, right and wrong, by two processes."""
    sheets = sorted((SHEETS / "planar2r").glob("*.toml"))
    count = law.samples(200)
    for k in range(count):
        (tmp_path / f"s{k:04}.toml").write_text(sheets[k % len(sheets)].read_text())
    seconds, result = command_line(tmp_path, "--jobs", "2", "-o", tmp_path / "out")
    law.takes("200 planar2r sheets by two jobs, s", seconds * 200 / count, 30)
    assert result.returncode in (1, 2), result.stderr
    assert len((tmp_path / "out" / "marks.csv").read_text().splitlines()) >= count + 1


@only_accepting
@pytest.mark.parametrize("sheet", ["python_all", "absolute_tau_latex", "g2_doubled", "dh"])
def test_one_cold_sheet(law, sheet):
    runs = [command_line(SHEETS / "planar2r" / f"{sheet}.toml") for _ in range(3)]
    seconds, result = min(runs, key=lambda run: run[0])
    law.takes("one sheet in a new process, s", seconds, 1.5, sheet)
    assert result.returncode in (0, 1), result.stderr
