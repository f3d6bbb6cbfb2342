"""Reports of robots: their sections, numbers, files, bounds, and what a robot or an installation lacks."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace

import numpy as np
import pytest

import dhkit
from dhkit import Arm
from dhkit.cli import main
from dhkit.description import library_robot
from dhkit.errors import DescriptionError, MissingPackageError
from dhkit.kinematics.closed_form import classify
from dhkit.report import article, write_report
from dhkit.report.article import MOST_PAGES
from dhkit.report.document import Formulas, Heading, Paragraph, Prompt, Table
from dhkit.report.document.pdf import Pdf
from dhkit.report.sections.inverse import inverse_section
from dhkit.report.words import Attachments
from report.report_checks import check_html, check_latex, without_verbatim
from symbolic.equations.latex_width import latex_width

SECTIONS = [
    "Abstract",
    "Introduction",
    "The robot",
    "Forward kinematics",
    "Inverse kinematics",
    "Jacobian, singularities and workspace",
    "Dynamics",
    "Verification",
    "Motion",
    "Control",
    "Conclusions",
    "References",
]
HOSTILE = r'x</title>$\end{document}#panic("1")"' + "\\"


@pytest.fixture(scope="module")
def planar():
    """The report of a planar arm."""
    return article(Arm.load("planar2r"))


def headings(content, level=1):
    return [
        block.text
        for block in content.document.blocks
        if isinstance(block, Heading) and block.level == level
    ]


def words(content):
    """Return all paragraphs as text."""
    paragraphs = [block for block in content.document.blocks if isinstance(block, Paragraph)]
    return "\n".join("".join(map(str, block.parts)) for block in paragraphs)


def matrices(content, head):
    """Return the matrices of numbers whose equation has this left side in typst."""
    found = []
    for block in content.document.blocks:
        if not isinstance(block, Formulas):
            continue
        for row in block.rows:
            match = re.fullmatch(r'mat\(delim: "\(", (.*)\)', row.right.typst)
            if row.left is None or row.left.typst != head or match is None:
                continue
            text = re.sub(r" times 10\^\((-?\d+)\)", r"e\1", match[1])
            if not re.search("[a-df-z]", text):
                found.append(
                    np.array([[float(x) for x in line.split(",")] for line in text.split(";")])
                )
    return found


def near(values):
    return pytest.approx(np.asarray(values), rel=6e-4, abs=1e-9)


def test_the_sections_are_those_of_the_course(planar):
    assert headings(planar) == SECTIONS
    prompts = [block for block in planar.document.blocks if isinstance(block, Prompt)]
    assert len(prompts) >= 8 and all(prompt.text.endswith(".") for prompt in prompts)


def test_numbers_are_those_of_the_api(planar):
    arm = Arm.load("planar2r")
    q = arm.configurations["ready"]
    qd = np.full(2, 0.5)
    (M,) = matrices(planar, "M (q)")
    (C,) = matrices(planar, "C (q, dot(q))")
    (g,) = matrices(planar, "g (q)")
    (T,) = matrices(planar, 'T (q_"ready")')
    (J,) = matrices(planar, "J")
    assert near(arm.mass_matrix(q)) == M
    assert near(arm.coriolis_matrix(q, qd)) == C
    assert near(arm.gravity_torque(q)) == g[:, 0]
    assert near(arm.fk(q)) == T
    assert near(arm.jacobian(q)) == J


def test_the_branches_of_the_example_reach_its_pose(planar):
    arm = Arm.load("planar2r")
    (T,) = matrices(planar, "T")
    (table,) = (
        block
        for block in planar.document.blocks
        if isinstance(block, Table) and block.caption.startswith("Branches")
    )
    assert len(table.rows) == 2
    for row in table.rows:
        q = np.radians([float(cell.replace("−", "-")) for cell in row[1:3]])
        assert np.abs(arm.fk(q) - T)[:3, 3].max() < 2e-3  # two joints reach a position


def test_all_of_the_equations_of_a_small_arm_are_printed(planar):
    text = words(planar)
    assert "M, C and g in the parameters of the robot's file" in text
    assert "not printed" not in text
    assert "proved in exact arithmetic" in text


@pytest.mark.parametrize(
    "name", ["planar2r", *(pytest.param(x, marks=pytest.mark.slow) for x in ("puma560", "ur5"))]
)
def test_lines_of_latex_fit_the_page(name):
    """A line of an article of 12 points between margins of 25 mm is 38 em wide."""
    for block in article(Arm.load(name)).document.blocks:
        if not isinstance(block, Formulas):
            continue
        left = max(latex_width(row.left.latex) if row.left else 2.0 for row in block.rows)
        for row in block.rows:
            if "pmatrix" not in row.right.latex:
                assert left + 1.25 + latex_width(row.right.latex) < 38, row.right.latex


def test_programs_beside_the_report_run(planar):
    arm = Arm.load("planar2r")
    q = np.array([0.3, 0.4])
    scope: dict[str, object] = {"__name__": "equations"}
    sys.modules["equations"] = type(sys)("equations")  # dataclasses look their module up
    exec(planar.programs["equations.py"], scope)
    assert np.allclose(scope["mass_matrix"](q), arm.mass_matrix(q), atol=1e-12)
    del sys.modules["equations"]


@pytest.mark.parametrize("form", ["html", "tex"])
def test_html_and_latex_are_whole(form, tmp_path):
    report = Arm.load("planar2r").report(tmp_path / "new" / "folder", format=form)
    text = report.path.read_text("utf-8")
    assert report.path.name == f"report.{form}" and report.pages is None
    assert all(path.exists() for path in report.files)
    assert not list(tmp_path.rglob(".*"))
    if form == "html":
        tags, shown = check_html(text)
        assert tags.count("img") == 6
        assert set(re.findall(r"https?://\S*?(?=[\"<])", text)) <= {
            "http://www.w3.org/1998/Math/MathML"
        }
        assert "2 Jacobian" not in shown and "5 Jacobian, singularities and workspace" in shown
    else:
        environments = check_latex(text)
        assert environments.count("figure") == 5 and environments.count("align*") > 20
        for name in re.findall(r"\\includegraphics\[[^]]*\]\{([^}]*)\}", without_verbatim(text)):
            assert (report.path.parent / name).read_bytes().startswith(b"\x89PNG")


def test_a_pdf_keeps_the_pages(tmp_path):
    pytest.importorskip("typst")
    report = Arm.load("planar2r").report(tmp_path)
    assert report.path.read_bytes().startswith(b"%PDF")
    assert 5 < report.pages <= MOST_PAGES


@pytest.mark.slow
def test_too_many_pages_are_told_in_one_line(tmp_path, monkeypatch, caplog):
    """Where no appendix at all is short enough, the report is written, and a line says so."""
    module = sys.modules[article.__module__]
    tried = []

    def long_pdf(document):
        tried.append(document)
        return Pdf(b"%PDF", MOST_PAGES + 1)

    monkeypatch.setattr(module, "pdf", long_pdf)
    monkeypatch.setattr(module, "require_typst", lambda: None)
    report = Arm.load("planar2r").report(tmp_path)
    (line,) = [record.getMessage() for record in caplog.records if "pages" in record.getMessage()]
    assert (report.pages, len(tried)) == (MOST_PAGES + 1, 4)
    assert line.endswith("31 pages, more than 30, even without programs in the appendix")
    monkeypatch.setattr(module, "pdf", lambda document: Pdf(b"%PDF", MOST_PAGES))
    caplog.clear()
    Arm.load("planar2r").report(tmp_path)
    assert not [record for record in caplog.records if "pages" in record.getMessage()]


@pytest.mark.parametrize("name", ["puma560", "ur5", "planar2r", "stanford"])
def test_the_family_of_inverse_kinematics_is_named_once(name):
    description = library_robot(name)
    paragraphs = [
        block
        for block in inverse_section(description, Attachments())
        if isinstance(block, Paragraph)
    ]
    text = "\n".join("".join(map(str, block.parts)) for block in paragraphs).lower()
    assert text.count(classify(description).fit.geometry.lower()) == 1


def test_hostile_texts_are_shown_as_they_are(tmp_path):
    """Names are letters and digits; the source of a robot's data is free text."""
    plain = Arm.from_dh([(0, 0, 0.5, 0), (0, 0, 0.3, 0)])
    arm = Arm(replace(plain.description, source=HOSTILE))
    for form in ("html", "tex"):
        text = arm.report(tmp_path, format=form).path.read_text("utf-8")
        if form == "html":
            _, shown = check_html(text)
            assert HOSTILE in shown
        else:
            check_latex(text)
    assert {path.name for path in tmp_path.iterdir()} == {
        "report.html",
        "report.tex",
        "figures",
        "programs",
    }


def test_an_arm_without_bodies_says_so():
    content = article(Arm.from_dh([(0, 0, 0.5, 0), (0, 0, 0.3, 0)], name="bare"))
    assert headings(content) == SECTIONS
    text = words(content)
    assert "Links 1, 2 of this robot have no body" in text
    assert "nothing can be simulated" in text
    assert "equations.py" not in content.programs


def test_an_arm_without_closed_form_has_an_example_by_iteration():
    rows = [(0, 0.3, 0.1, "pi/2"), (0, 0.1, 0.4, 0.3), (0, 0.05, 0.3, "pi/3"), (0, 0, 0.2, 0)]
    content = article(Arm.from_dh(rows, name="odd"))
    text = words(content)
    assert "no derivation in closed form" in text and "by iteration" in text
    captions = [b.caption for b in content.document.blocks if isinstance(b, Table)]
    assert any(caption.startswith("Solutions of the pose") for caption in captions)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("jaco", "the real roots of a polynomial in its angle give 8 solutions"),
        ("panda", "infinitely many solutions; at joint 7 = "),
    ],
)
def test_an_arm_without_derivation_has_all_solutions_of_a_pose(name, sentence):
    blocks = list(inverse_section(library_robot(name), Attachments()))
    text = " ".join(str(block) for block in blocks)
    assert sentence in text and "no derivation in closed form" in text
    table = next(block for block in blocks if isinstance(block, Table))
    assert len(table.rows) >= 4


@pytest.mark.slow
def test_a_motion_and_a_run_are_shown(tmp_path):
    arm = Arm.load("planar2r")
    motion = arm.quintic([0, 0], [0.5, 0.4], 1.0)
    run = arm.simulate(dhkit.PID.tuned(arm, 20.0, 1.0), motion)
    motion.save(tmp_path / "motion.npz")
    run.save(tmp_path / "run.npz")
    report = arm.report(
        tmp_path / "out", tmp_path / "motion.npz", str(tmp_path / "run.npz"), format="html"
    )
    _, shown = check_html(report.path.read_text("utf-8"))
    assert "the one that was given; it takes 1 s" in shown
    assert "The joint that errs most is off by" in shown


@pytest.mark.slow
def test_a_run_of_locked_joints_is_a_simplified_model(tmp_path):
    arm = Arm.load("puma560_cao")
    q = arm.configurations["ready"]
    two = arm.lock({i: float(q[i]) for i in (0, 3, 4, 5)})
    motion = two.quintic([0, 0], [0.5, 0.4], 2.0)
    run = two.simulate(dhkit.PID.tuned(two, 20.0, 1.0), motion)
    content = article(arm, run=run)
    assert headings(content)[9:11] == ["Simplified model for control", "Control"]
    assert {"equations.py", "model_equations.py"} <= set(content.programs)
    _, M = matrices(content, "M (q)")
    assert near(two.mass_matrix(two.configurations["ready"])) == M
    assert "C is not printed" in words(content)  # of six joints


@pytest.mark.slow
@pytest.mark.parametrize("name", ["puma560", "panda", "stanford"])
def test_six_and_seven_joints_keep_the_pages(name, tmp_path):
    pytest.importorskip("typst")
    report = Arm.load(name).report(tmp_path)
    assert 10 < report.pages <= MOST_PAGES
    assert (tmp_path / "programs" / "equations.py").stat().st_size > 3_000


def test_unusable_input_is_one_line(tmp_path, monkeypatch):
    arm = Arm.load("planar2r")
    with pytest.raises(ValueError, match=r"format is 'doc'; expected pdf, html, tex"):
        arm.report(tmp_path, format="doc")
    (tmp_path / "file").write_text("x")
    with pytest.raises(DescriptionError, match="is a file; expected a folder"):
        arm.report(tmp_path / "file", format="html")
    with pytest.raises(DescriptionError, match=r"nowhere\.npz"):
        arm.report(tmp_path, tmp_path / "nowhere.npz", format="html")
    other = Arm.load("planar3r").quintic([0, 0, 0], [1, 1, 1], 2.0)
    with pytest.raises(DescriptionError):
        write_report(arm.description, tmp_path, other, format="html")
    monkeypatch.setitem(sys.modules, "typst", None)
    with pytest.raises(MissingPackageError, match="typst"):
        arm.report(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.slow
def test_the_command_writes_and_lists_its_files(tmp_path, capsys, monkeypatch):
    folder = tmp_path / "report"
    with pytest.raises(SystemExit) as status:
        main(["report", "planar2r", "-o", str(folder), "--format", "html", "--json"])
    assert status.value.code == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["robot"] == "planar2r" and printed["pages"] is None
    assert printed["files"][0] == str(folder / "report.html")

    with pytest.raises(SystemExit) as status:
        main(["report", "planar2r", "-o", str(folder), "--format", "docx"])
    assert status.value.code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "--format" in error

    monkeypatch.setitem(sys.modules, "typst", None)
    with pytest.raises(SystemExit) as status:
        main(["report", "planar2r", "-o", str(folder)])
    assert status.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.slow
def test_equations_that_are_too_long_leave_their_values():
    """Seven joints at odd angles: M has more terms than the ring allows."""
    rng = np.random.default_rng(1)
    sizes = rng.uniform([0.1, 0.1, -1.5], [0.4, 0.4, 1.5], (7, 3)).round(2)
    rows = [(0, *map(float, row)) for row in sizes]
    arm = Arm.from_dh(rows, name="odd").with_uniform_links()
    content = article(arm)
    assert headings(content) == SECTIONS
    assert "too long to be derived in symbols" in words(content)
    (M,) = matrices(content, "M (q)")
    assert near(arm.mass_matrix(np.zeros(7))) == M
