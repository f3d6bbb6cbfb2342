"""Sheets written by an examiner: truths by energies, in `data/`, and one labelled mistake in each wrong one.

``data/make_corpus.py`` writes them without dhkit, and holds every formula against its truth in 50 digits before it is
written down. All are graded under DHKIT_ACCEPT; otherwise every sixth.
"""

import json
import shutil
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import pytest

import acceptance
from dhkit.description import library_robot, read_robot
from dhkit.errors import AnswerError
from dhkit.grading import grade

pytestmark = pytest.mark.slow

DATA = Path(__file__).parent / "data"
CORPUS = [json.loads(line) for line in (DATA / "heldout.jsonl").read_text().splitlines()]
SHARE = 6
PASSES = {"correct", "correct within rounding", "undecided"}


@dataclass(frozen=True)
class Judged:
    """A sheet and what was said of it.

    Attributes
    ----------
    sheet
        The corpus's row.
    report
        None where the sheet was refused.
    verdict, message
        In words.
    """

    sheet: dict
    report: object
    verdict: str
    message: str

    @property
    def label(self):
        """The mistake, None for a right answer or one without a single name."""
        return self.sheet["label"]

    @property
    def line(self):
        """What a list of failures says of it."""
        return f"{self.sheet['name']}: {self.verdict}: {self.message}"[:400]

    @property
    def named(self):
        """Names of mistakes given for the quantities that are wrong."""
        found = set()
        for one in self.report.diagnosis:
            place = one.where.replace(",", " ").split()
            about = places(one.entries) & places(self.label["entries"])
            if one.mistake and (about or quantities(place) & set(self.label["quantities"])):
                found |= {one.mistake} | {other.partition(" ")[0] for other in one.equivalent}
        return found

    @property
    def blamed(self):
        """Right entries that a diagnosis accuses."""
        accused = {entry for one in self.report.diagnosis for entry in places(one.entries)}
        return accused - places(self.label["entries"])

    @property
    def misjudged(self):
        """Entries judged wrong that are right, and the reverse."""
        spoiled = places(self.label["entries"])
        found = []
        for entry in self.report.entries:
            wrong = bool(places([entry.name]) & spoiled)
            if wrong and entry.quantity != "C" and entry.verdict.value in PASSES:
                found.append(f"{entry.name} passes")
            if not wrong and entry.verdict.value not in PASSES:
                found.append(f"{entry.name} {entry.verdict.value}")
        return found


def places(names):
    """Entries by name; those of C by their row, since C is judged by C qd."""
    return {name[:2] if name[0] == "C" else name for name in names}


def quantities(words):
    """The quantities among some words: M of M11."""
    return set(words) | {word.rstrip("0123456789") for word in words}


def judged(sheet, folder):
    """Grade one sheet as a file."""
    own = DATA / "robots" / f"{sheet['robot']}.toml"
    path = folder / (sheet["name"] + sheet["suffix"])
    path.write_text(sheet["text"])
    robot = None
    if sheet["suffix"] != ".toml":
        robot = read_robot(own) if own.exists() else library_robot(sheet["robot"])
    try:
        report = grade(path, robot)
    except AnswerError as error:
        return Judged(sheet, None, "unreadable", str(error))
    verdict = report.verdict.value
    return Judged(sheet, report, verdict, report.fault if verdict == "unreadable" else str(report))


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Every sheet that this run takes, graded."""
    folder = tmp_path_factory.mktemp("heldout")
    for robot in (DATA / "robots").glob("*.toml"):
        shutil.copy(robot, folder)
    share = 1 if acceptance.ACCEPTING else SHARE
    return [judged(sheet, folder) for sheet in CORPUS if crc32(sheet["name"].encode()) % share == 0]


def at_most(share, count):
    """Return a share, or what two sheets are of a sixth of the corpus."""
    return share if acceptance.ACCEPTING else max(share, 2 / count)


def listed(found):
    return "\n".join(["", *(one if isinstance(one, str) else one.line for one in found)])


def single(results):
    """The wrong sheets that were judged wrong and have one label."""
    return [one for one in results if one.label and one.verdict == "wrong"]


def test_the_corpus_is_large_enough():
    wrong = sum(one["label"] is not None for one in CORPUS)
    suffixes = Counter(one["suffix"] for one in CORPUS)
    assert len(CORPUS) >= 420 and 0.4 <= wrong / len(CORPUS) <= 0.6
    assert len({one["robot"] for one in CORPUS}) >= 12
    assert sum(suffixes.values()) - suffixes[".toml"] >= 60
    assert len({one["label"]["mistake"] for one in CORPUS if one["label"]}) >= 90


def test_no_verdict_is_false(results, law):
    """No wrong sheet passes, no right one is called wrong or incomplete."""
    false = [
        one
        for one in results
        if one.verdict != "unreadable" and one.verdict not in one.sheet["expected"]
    ]
    law.size = len(results)
    law.holds("false verdicts", len(false), 0, listed(false))


def test_no_entry_is_misjudged(results, law):
    """On wrong sheets too, each entry by itself."""
    found = [f"{one.line} {one.misjudged}" for one in single(results) if one.misjudged]
    law.size = len(results)
    law.holds("sheets with a misjudged entry", len(found), 0, listed(found))


def test_hardly_a_sheet_is_unreadable(results, law):
    unread = [
        one
        for one in results
        if one.verdict == "unreadable" and "unreadable" not in one.sheet["expected"]
    ]
    law.size = len(results)
    law.holds(
        "share of sheets that are not read",
        len(unread) / len(results),
        at_most(0.02, len(results)),
        listed(unread),
    )


def test_mistakes_are_named(results, law):
    wrong = single(results)
    unnamed = [one for one in wrong if not one.named]
    law.size = len(wrong)
    law.holds(
        "share of mistakes that are not named",
        len(unnamed) / len(wrong),
        at_most(0.1, len(wrong)),
        listed(unnamed),
    )


def test_the_names_are_right(results, law):
    named = [one for one in single(results) if one.named]
    other = [one for one in named if not one.named & set(one.label["accept"])]
    law.size = len(named)
    required = at_most(0.02, len(named))
    law.holds(
        "share of names that are another mistake's",
        len(other) / len(named),
        required,
        listed(other),
    )


def test_no_right_formula_is_blamed(results, law):
    blamed = [f"{one.line} {sorted(one.blamed)}" for one in single(results) if one.blamed]
    law.size = len(results)
    law.holds("sheets on which a right entry is blamed", len(blamed), 0, listed(blamed))
