"""Reports written down: every text of a stranger's stays text, and what was written can be read back."""

import csv
import html.parser
import io
import json
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest
from hypothesis import given, strategies as st
from rich.console import Console

from dhkit.errors import AnswerError
from dhkit.grading.grade_report import Entry, GradeReport, Verdict
from dhkit.grading.marks import marks
from dhkit.grading.reports import (
    gradescope,
    html_class,
    html_report,
    json_report,
    junit,
    marks_csv,
    read_reports,
    report_of,
    terminal_class,
    terminal_report,
    with_feedback,
)
from dhkit.grading.reports.mathml import mathml
from dhkit.grading.rubric import Rubric
from grading.judged import REPORT, SIGN, anything, reports

MARKS = marks(REPORT, Rubric())
BROKEN = GradeReport(
    sheet="class/bob.toml", student="bob", error="class/bob.toml: no TOML", version="0.1.0"
)
HOSTILE = "<script>alert(1)</script>\"'&\x1b[31m[bold red]\u202e=cmd()"
TAGS = re.compile(
    "html|head|meta|title|style|body|h1|h2|h3|p|span|div|ul|li|svg|rect|line|text|table|tr|th|td|section|article|details|summary|a|i|code|"
    "math|mrow|mi|mn|mo|mtext|mspace|mfrac|msqrt|mroot|msub|msup|msubsup|munder|mover|munderover|mtable|mtr|mtd|mstyle"
)


def rendered(renderable):
    file = io.StringIO()
    Console(file=file, width=150, color_system=None, highlight=False).print(renderable)
    return file.getvalue()


class Tags(html.parser.HTMLParser):
    def __init__(self, page):
        super().__init__()
        self.seen, self.open, self.attributes = set(), [], []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.seen.add(tag)
        self.attributes += attributes
        if tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def hostile(report):
    """The report with a hostile text wherever a text may be."""
    return report_of(
        json.dumps(report.data())
        .replace('"m1*l1^2/3"', json.dumps(HOSTILE))
        .replace('"ada"', json.dumps(HOSTILE))
    )


def test_the_terminal_shows_what_is_wrong():
    text = rendered(terminal_report(REPORT, MARKS))
    assert "class/ada.toml" in text
    assert "answer: -m1*g*cos(q1)" in text
    assert "answer less the truth: -2*m1*g*cos(q1)" in text
    assert "at q1 = 0.5, m1 = 1: answer -8.6, truth 8.6" in text
    assert "g1: gravity has the wrong sign" in text
    assert "follows from V: 50 %" in text
    assert "dhkit 0.1.0, planar2r, digest abc123" in text


@given(reports(anything))
def test_nothing_commands_the_terminal(report):
    given = marks(report, Rubric())
    for text in (
        rendered(terminal_report(report, given)),
        rendered(terminal_class([report], [given])),
    ):
        assert all(character.isprintable() or character == "\n" for character in text)


def test_markup_stays_text():
    assert "[bold red]" in rendered(terminal_report(hostile(REPORT), MARKS))


@given(reports())
def test_json_is_read_back(report):
    given = marks(report, Rubric())
    assert report_of(json.dumps(json_report(report, given))) == report


def test_json_has_what_was_promised():
    data = json.loads(json.dumps(json_report(REPORT, MARKS)))
    assert data["verdict"] == "wrong"
    assert data["points"] == 62.5
    assert {"quantity", "index", "verdict", "difference", "witness"} <= data["entries"][4].keys()
    assert data["entries"][4]["index"] == [0]
    assert {"mistake", "sentence", "where"} <= data["diagnosis"][0].keys()


@pytest.mark.parametrize(
    "text",
    [
        "[]",
        "1",
        "{",
        '{"entries": 3}',
        '{"robot": ["x"]}',
        '{"seconds": "soon"}',
        '{"seconds": NaN}',
        '{"seconds": 1e999}',
        '{"student": "\\ud800"}',
        '{"entries": [{"quantity": "M", "index": ["x"], "verdict": "correct"}]}',
        '{"entries": [{"quantity": "M", "index": [0], "verdict": "excellent"}]}',
        "[" * 100_000,
    ],
)
def test_what_is_no_report_is_refused(text):
    with pytest.raises(ValueError):  # noqa: PT011 - of many kinds
        report_of(text)


def test_files_of_reports(tmp_path):
    path = tmp_path / "reports.json"
    one = json.dumps(json_report(REPORT, MARKS))
    path.write_text(f"{one}\n{one}\n")
    assert list(read_reports(path)) == [REPORT, REPORT]
    path.write_text(json.dumps(json_report(REPORT, MARKS), indent=2))
    assert list(read_reports(path)) == [REPORT]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("nonsense", "no JSON"),
        ('{"entries": 3}', "entries: Input should be a valid tuple"),
        ('{}\n{"robot": 3}', "line 2: robot: Input should be a valid string"),
        (json.dumps(json_report(REPORT, MARKS, "hint")), "feedback: found 'hint'; expected 'full'"),
    ],
)
def test_files_that_cannot_be_marked_again(tmp_path, text, complaint):
    path = tmp_path / "reports.json"
    path.write_text(text)
    with pytest.raises(AnswerError, match=re.escape(complaint)):
        list(read_reports(path))


def test_gradescope():
    data = gradescope(REPORT, marks(REPORT, Rubric(weights={"M": 1, "g": 1, "V": 2})))
    assert data["score"] == pytest.approx(sum(test["score"] for test in data["tests"]))
    assert sum(test["max_score"] for test in data["tests"]) == pytest.approx(100)
    assert [test["status"] for test in data["tests"]] == ["passed"] * 4 + ["failed"] * 3
    assert data["tests"][-1]["output"] == "not on the sheet"
    assert "gravity has the wrong sign" in data["tests"][4]["output"]
    assert json.loads(json.dumps(data)) == data


def test_junit():
    suites = ET.fromstring(junit([REPORT, BROKEN], [MARKS, marks(BROKEN, Rubric())]))
    ada, bob = suites.findall("testsuite")
    assert {key: ada.get(key) for key in ("tests", "failures", "errors", "skipped")} == {
        "tests": "6",
        "failures": "2",
        "errors": "0",
        "skipped": "1",
    }
    assert (
        ada.find("testcase[@name='g1']/failure").get("message") == "g1: gravity has the wrong sign"
    )
    assert bob.get("errors") == "1"
    assert ada.find("properties/property[@name='digest']").get("value") == "abc123"


@given(reports(anything))
def test_junit_is_xml_whatever_a_sheet_holds(report):
    ET.fromstring(junit([report], [marks(report, Rubric())]).encode())


@given(
    st.lists(reports(anything), min_size=1, max_size=2),
    st.sampled_from(("full", "hint", "verdict")),
)
def test_pages_hold_known_elements_alone(several, level):
    told = [with_feedback(report, level) for report in several]
    given = [marks(report, Rubric()) for report in several]
    for page in (html_class(told, given), html_report(told[0], given[0])):
        tags = Tags(page)
        assert all(map(TAGS.fullmatch, tags.seen))
        assert not tags.open
        page.encode()


def test_a_page_is_one_file_without_scripts():
    page = html_class([hostile(REPORT), BROKEN], [MARKS, marks(BROKEN, Rubric())])
    tags = Tags(page)
    assert all(map(TAGS.fullmatch, tags.seen))
    assert "mfrac" in tags.seen
    assert "&lt;script&gt;" in page
    names = {name for name, _ in tags.attributes}
    assert not names & {"src", "onclick", "onload"}
    assert all(value.startswith("#sheet-") for name, value in tags.attributes if name == "href")
    assert "http" not in re.sub(r'<meta http-equiv="[^>]*>', "", page)


@pytest.mark.parametrize(
    "latex",
    [
        r"\text{<script>alert(1)</script>}",
        r"\text{&lt;script&gt;}",
        r"\text{&#60;script&#62;}",
        r"\href{javascript:alert(1)}{x}",
        r"\style{background:url(http://x)}{x}",
        r"\class{x}{y}",
        r"\left(",
        "{",
        "a_b_c",
        "",
        9000 * "x",
    ],
)
def test_mathml_is_mathematics_or_nothing(latex):
    made = mathml(latex) or ""
    assert all(map(TAGS.fullmatch, Tags(made).seen))
    assert not {name for name, _ in Tags(made).attributes} & {"href", "style", "class"}


@given(reports(anything))
def test_csv_holds_no_formula(report):
    rows = list(
        csv.reader(io.StringIO(marks_csv([report, REPORT], [marks(report, Rubric()), MARKS])))
    )
    assert len({len(row) for row in rows}) == 1
    for text in (text for row in rows for text in row):
        assert not text.startswith(("=", "+", "-", "@", "\t", "\r")) or re.fullmatch(
            r"[+-]?\d.*", text
        )


def test_csv():
    rows = list(
        csv.DictReader(io.StringIO(marks_csv([REPORT, BROKEN], [MARKS, marks(BROKEN, Rubric())])))
    )
    assert rows[0]["student"] == "ada"
    assert (rows[0]["points"], rows[0]["M"], rows[0]["g"]) == ("62.5", "50", "12.5")
    assert (rows[1]["points"], rows[1]["M"], rows[1]["error"]) == (
        "0",
        "",
        "class/bob.toml: no TOML",
    )
    assert (rows[0]["robot"], rows[0]["digest"], rows[0]["version"]) == (
        "planar2r",
        "abc123",
        "0.1.0",
    )


def class_of(*verdicts, **changes):
    """Return a report of every verdict, a student each."""
    return [
        replace(
            REPORT,
            student=f"student{k}",
            entries=(Entry("V", (), verdict, "x"),),
            diagnosis=(),
            **changes,
        )
        for k, verdict in enumerate(verdicts)
    ]


def order_of(page, *texts):
    places = [page.index(text) for text in texts]
    return places == sorted(places)


def test_the_class_page_says_what_needs_a_person_in_order():
    several = class_of(Verdict.CORRECT, Verdict.UNDECIDED)
    refused = replace(several[0], student="carl", left_out=("not read: scan.pdf",))
    page = html_class(
        [refused, *several, BROKEN], [marks(one, Rubric()) for one in (refused, *several, BROKEN)]
    )
    assert order_of(
        page,
        "What needs a person",
        "Could not be read",
        'href="#sheet-4"',
        "Neither proved nor refuted",
        'href="#sheet-3"',
        "not read as answers",
        'href="#sheet-1"',
        "Marks",
    )
    fine = class_of(Verdict.CORRECT, Verdict.CORRECT)
    assert "Nothing: all was read and decided." in html_class(
        fine, [marks(one, Rubric()) for one in fine]
    )


def test_the_class_page_groups_mistakes_the_most_frequent_first():
    other = replace(SIGN, mistake="inertia_about_joint")
    named = [replace(REPORT, student=name, diagnosis=(SIGN,)) for name in ("ada", "bob")]
    named.append(replace(REPORT, student="cleo", diagnosis=(other,)))
    named.append(replace(REPORT, student="dora", diagnosis=()))
    page = html_class(named, [marks(one, Rubric()) for one in named])
    wrong = page[page.index("What went wrong") : page.index('id="marks"')]
    assert order_of(
        wrong,
        "gravity_sign",
        '2 of 4 sheets: <a href="#sheet-1">ada</a>, <a href="#sheet-2">bob</a>',
        "inertia_about_joint",
        '1 of 4 sheets: <a href="#sheet-3">cleo</a>',
        "no mistake that has a name",
        "dora",
    )


def test_the_class_page_has_the_distribution_of_points():
    verdicts = [Verdict.CORRECT] * 3 + [Verdict.WRONG] * 2
    several = class_of(*verdicts)
    page = html_class(
        several, [marks(one, Rubric(points=20)) for one in several], table="marks.csv"
    )
    assert 'aria-label="2 sheets from 0 to 2; 3 sheets from 18 to 20"' in page
    assert "5 sheets: 3 correct, 2 wrong." in page
    assert "12 on average; half of them have 20 or more" in page
    assert '<a href="marks.csv">marks.csv</a>' in page
