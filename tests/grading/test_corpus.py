"""Answer sheets of our own formulas, each labelled with what is right or which mistake was made."""

import re
from collections import Counter
from pathlib import Path

import pytest

from dhkit.grading import grade

SHEETS = Path(__file__).parent / "sheets"
LABEL = re.compile(r"# expected: (correct within rounding|correct|undecided|wrong)(?:: (.*))?")


def label(path):
    match = LABEL.fullmatch(path.read_text().splitlines()[0].strip())
    assert match, f"{path}: the first line is not a label"
    return match[1], [] if match[2] in (None, "-") else match[2].split(" + ")


CORPUS = {
    str(path.relative_to(SHEETS)): path
    for path in sorted(SHEETS.rglob("*.toml"))
    if path.read_text().startswith("# expected")
}


SLOW = {
    "puma560/kin_alpha4_sign.toml",
    "planar2r/half_angles.toml",
    "planar2r/half_angle_slip.toml",
    "planar2r/root_of_square.toml",
    "planar2r/tan_half_angle.toml",
    "planar3r/com3_at_tip.toml",
    "cobra600/kin_column_not_d.toml",
}
"""Sheets that take about a second or more."""


def named(report):
    """Return the mistakes that a report names, and those that give the same answers."""
    found = {one.mistake for one in report.diagnosis if one.mistake}
    return found | {other.partition(" ")[0] for one in report.diagnosis for other in one.equivalent}


def test_the_corpus_is_large_enough():
    verdicts = Counter(label(path)[0] == "wrong" for path in CORPUS.values())
    robots = {path.parent.name for path in CORPUS.values()}
    assert verdicts[False] >= 60 and verdicts[True] >= 90 and sum(verdicts.values()) >= 150
    assert robots >= {
        "planar2r",
        "planar3r",
        "polar_rp",
        "cart_pendulum",
        "pan_tilt",
        "cobra600",
        "puma3",
    }


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in CORPUS],
)
def test_no_wrong_answer_is_accepted_and_no_right_one_rejected(name):
    expected, _ = label(CORPUS[name])
    report = grade(CORPUS[name], explain=False)
    assert report.verdict.value == expected, str(report)


@pytest.mark.slow
def test_single_mistakes_are_named(law):
    """At least 90 % of the mistakes that are a derivation's are named as what they were."""
    single = {name: label(path)[1][0] for name, path in CORPUS.items() if len(label(path)[1]) == 1}
    missed = [name for name, mistake in single.items() if mistake not in named(grade(CORPUS[name]))]
    law.size = len(single)
    law.holds("share of single mistakes that are not named", len(missed) / len(single), 0.1, missed)
