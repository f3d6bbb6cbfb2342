"""`dhkit equations`: what it prints and writes."""

import html
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from dhkit import Arm
from dhkit.cli import main
from dhkit.cli.equations import FORMATS
from dhkit.cli.equations_page import equations_page
from dhkit.symbolic.equations import readable


@pytest.fixture
def dhkit(capsys, tmp_path, monkeypatch):
    """Run `dhkit equations` in an empty folder; return its status, stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        with pytest.raises(SystemExit) as exit:
            main(("equations", *arguments))
        out, err = capsys.readouterr()
        return exit.value.code, out, err

    return run


def test_text(dhkit):
    status, out, err = dhkit("planar2r", "--what", "M")
    assert (status, err) == (0, "")
    assert out.splitlines()[0] == "M11 = m1*l1^2/3 + m2*(l1^2 + l2^2/3 + l1*l2*c2)"


def test_numbers_that_are_symbols_are_told(dhkit):
    _, out, _ = dhkit("al5d", "--what", "g", "--symbols", "none")
    assert "note: cos(0.0427) and sin(0.0427) are symbols" in out


@pytest.mark.parametrize(
    ("form", "sign"),
    [
        ("text", "M11 = "),
        ("latex", r"\begin{document}"),
        ("python", "def mass_matrix(q, p=PARAMETERS):"),
        ("c", "void planar2r_M(const double q[2], double M[4])"),
        ("matlab", "function M = planar2r_M(q, p)"),
        ("html", "<math"),
    ],
)
def test_formats(dhkit, tmp_path, form, sign):
    status, out, err = dhkit("planar2r", "--format", form)
    assert (status, err) == (0, "")
    assert sign in out
    if form != "matlab":
        assert dhkit("planar2r", "--format", form, "--output", "here.txt") == (
            0,
            "wrote here.txt\n",
            "",
        )
        assert (tmp_path / "here.txt").read_text("utf-8") == out


def test_matlab_writes_a_file_for_each_function(dhkit, tmp_path):
    status, out, _ = dhkit("planar2r", "--format", "matlab", "--output", ".", "--json")
    assert status == 0
    names = ["planar2r_C.m", "planar2r_M.m", "planar2r_g.m", "planar2r_parameters.m"]
    assert (
        sorted(path.name for path in tmp_path.iterdir())
        == sorted(json.loads(out)["files"])
        == names
    )
    status, _, err = dhkit("planar2r", "--format", "matlab", "--output", "file.m")
    assert (status, err) == (
        2,
        "dhkit: file.m: expected a folder; MATLAB wants a file for every function\n",
    )


def test_machines_are_told(dhkit):
    status, out, _ = dhkit("planar2r", "--what", "M g", "--json")
    facts = json.loads(out)
    assert status == 0
    assert facts["what"] == ["M", "g"]
    assert facts["constants"]["l1"] == 0.5
    assert facts["terms"] == {"M": [4, 2, 2, 1], "g": [3, 1]}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--what", "M,X"], "no quantity 'X'; expected some of M, C, h, g, tau, K, V"),
        (["--format", "word"], f"--format: found 'word'; expected {', '.join(FORMATS)}"),
        (["--symbols", "all"], "--symbols: found 'all'; expected none, file, inertial"),
        (["--output", "/dev/null/where.tex"], "/dev/null: a file; expected a folder"),
        (["--output", "."], ". is a folder; expected the name of a file"),
        (
            ["--output", "robot.toml"],
            "robot.toml: equations would overwrite a robot file; expected another name",
        ),
    ],
)
def test_bad_input_is_refused_in_one_line(dhkit, arguments, message):
    assert dhkit("planar2r", *arguments) == (2, "", f"dhkit: {message}\n")


@pytest.mark.slow
def test_what_is_too_long_to_read_names_the_alternatives(dhkit):
    status, out, err = dhkit("puma560", "--symbols", "inertial", "--what", "tau")
    assert (status, out) == (2, "")
    assert re.fullmatch(
        r"dhkit: tau1 has \d+ terms, .*code \(python, c, matlab\) has no limit.*\n", err
    )


def test_a_page_is_whole_and_harmless(dhkit, tmp_path):
    (tmp_path / "wicked.toml").write_text(
        'format = 1\nname = "wicked"\nconvention = "standard"\nsource = "<script>alert(1)</script>"\n'
        '[parameters]\nmass_1 = 1\n[[joint]]\nname = "a"\ntype = "revolute"\na = 0.4\nalpha = 90\nd = 0\ntheta = 0\n'
        'body = { mass = "mass_1", com = [0.1, 0, 0] }\n'
    )
    status, out, _ = dhkit("wicked.toml", "--what", "M,g", "--format", "html")
    assert status == 0
    assert "<script" not in out
    assert html.escape("<script>alert(1)</script>") in out
    assert not re.search(
        r"(src|href)=|url\((?!data:font/woff2;)|@import|https?://(?!www\.w3\.org/1998/Math/MathML)",
        out,
    )
    assert "Denavit-Hartenberg table" in out
    assert "<td>mass_1</td>" in out


def test_units_of_our_own_symbols(dhkit):
    _, out, _ = dhkit("stanford", "--what", "g", "--symbols", "inertial", "--format", "html")
    assert "<td>kg m</td>" in out
    assert "<td>m/s²</td>" in out


def test_a_browser_shows_the_page(dhkit, tmp_path, chromium):
    """Every equation has a size and none is wider than the page; nothing else is asked for."""
    dhkit("planar2r", "--what", "M,C,g,tau", "--format", "html", "--output", "page.html")
    page = chromium.page(1200, 900)
    address = (tmp_path / "page.html").as_uri()
    page.call("Page.navigate", url=address)
    page.until("document.readyState === 'complete' && document.querySelector('math')")
    sizes = "[...document.querySelectorAll('.display math')].map(m => m.getBoundingClientRect())"
    assert page.evaluate(
        f"{sizes}.every(r => r.width > 50 && r.height > 10 && r.right < innerWidth)"
    )
    assert page.evaluate(f"{sizes}.length") == 6
    # The font for mathematics is inside the page.
    asked = [request for request in page.requests if not request.startswith("data:font/woff2;")]
    assert (asked, page.errors) == ([address], [])
    assert page.evaluate("document.fonts.check('16px \"dhkit math\"')")
    page.close()


def test_listing_commands_needs_no_sympy():
    code = (
        "import sys, dhkit.cli; sys.exit('sympy' in sys.modules or 'latex2mathml' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_base_parameters_on_every_kind_of_paper(dhkit, tmp_path):
    for form in ("text", "latex", "html", "python", "c"):
        status, out, err = dhkit("planar2r", "--what", "M,g", "--base-parameters", "--format", form)
        assert (status, err) == (0, "")
        assert "MX" in out
    assert (
        "l_{1} (m_{1} + m_{2})"
        in dhkit("planar2r", "--base-parameters", "--what", "g", "--format", "latex")[1]
    )
    status, _, err = dhkit("planar2r", "--base-parameters", "--symbols", "none")
    assert (status, err) == (
        2,
        "dhkit: --symbols none: base parameters are made of symbols; leave one of the two out\n",
    )


def test_a_page_has_an_equation_for_each_entry_and_the_symbols_that_occur():
    lag = Arm.load("planar2r").lagrangian
    page = equations_page(lag, readable(lag, "M,g"))
    assert page.count("<math") > 5
    symbols = re.findall(r"<td>(\w+)</td>", page)
    assert {"m1", "m2", "l1", "l2"} <= set(symbols)
    assert "qd1" not in equations_page(lag, readable(lag, "g"))


def test_long_decimals_are_rounded_unless_all_are_asked_for(dhkit, tmp_path):
    """Products of a CAD program's numbers have 70 digits."""
    file = tmp_path / "arm.toml"
    file.write_text(
        'format = 1\nname = "cad"\nconvention = "standard"\n[[joint]]\ntype = "revolute"\n'
        "a = 0.2512345678901\nalpha = 0\nd = 0\n"
        "theta = 0\nbody = { mass = 1.3173724319540, com = [-0.0960719135381, 0, 0], "
        "inertia = { xx = 0.0009098584633, yy = 0.0009406760040, zz = 0.0018250767915 } }\n"
    )
    status, text, _ = dhkit(str(file), "--what", "M")
    assert status == 0
    assert re.search(r"^M11 = 0\.\d{5,7}$", text, re.MULTILINE)
    assert "--digits 0 prints them exactly" in text
    for form in ("latex", "html"):  # whoever has the file alone learns it too
        dhkit(str(file), "--what", "M", "--format", form, "--output", f"page.{form}")
        assert "rounded to 6 significant digits" in Path(f"page.{form}").read_text("utf-8")
    _, facts, _ = dhkit(str(file), "--what", "M", "--json")
    assert "rounded to 6 significant digits" in json.loads(facts)["notes"][-1]
    _, exact, _ = dhkit(str(file), "--what", "M", "--digits", "0")
    assert re.search(r"^M11 = 0\.\d{30,}$", exact, re.MULTILINE)
    _, symbolic, _ = dhkit("planar2r", "--what", "M")
    assert "significant digits" not in symbolic
    status, _, complaint = dhkit("planar2r", "--format", "c", "--digits", "3")
    assert status == 2
    assert "leave it out" in complaint
