"""The pages of docs/: Python runs as doctests, commands run, files are read, links lead somewhere.

Pages that pyproject.toml's testpaths name are collected by pytest itself; here only their links are looked at.
"""

from __future__ import annotations

import ast
import doctest
import importlib
import importlib.util
import inspect
import re
import runpy
import shlex
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace
from urllib.error import HTTPError
from urllib.request import urlopen

import nbformat
import pytest

import dhkit
from acceptance import slow_if
from dhkit.cli import main
from dhkit.cli.docs import built_folder, served

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PYTEST_PATHS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["pytest"]
COLLECTED = set(PYTEST_PATHS["ini_options"]["testpaths"])
PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for path in DOCS.rglob("*.md")
    if "_generated" not in path.parts
)
OWN_PAGES = [page for page in PAGES if page not in COLLECTED]
BLOCK = re.compile(r"^```(\S*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
ANY_BLOCK = re.compile(r"^```[^\n]*\n.*?^```$", re.DOTALL | re.MULTILINE)
"""A block of any kind, includes with arguments too."""
FILE_NAME = re.compile(r"(?:#|%|//) ([\w-]+\.(?:py|toml|m|c|csv))\n")
"""First line of a block that is a file: its name, as a comment."""
OTHER_COMMANDS = {"make", "pip", "git", "source", "ros2", "colcon", "octave", "gcc", "python"}
"""Programs in console blocks that are not dhkit's; such lines are shown and not run."""
SLOW_PAGES = {
    "docs/report.md",
    "docs/how-to/identify-parameters.md",
    "docs/how-to/scale.md",
    "docs/how-to/without-pinocchio.md",
    "docs/tutorials/08-trajectories.md",
    "docs/tutorials/09-control.md",
    "docs/tutorials/11-own-robot.md",
    "docs/tutorials/12-course-project.md",
}
"""Pages that take seconds."""
GALLERY = sorted(path.stem for path in (DOCS / "gallery").glob("*.py"))
QUICK_PICTURES = {"puma_frames", "ellipsoid", "quintic", "rotating_box", "workspace"}


def press_ctrl_c(seconds: float) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("page", [slow_if(page in SLOW_PAGES, page) for page in OWN_PAGES])
def test_the_blocks_of_a_page_run(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs").symlink_to(DOCS)
    monkeypatch.setattr("webbrowser.open", lambda url: True)
    monkeypatch.setattr("dhkit.cli.browser.time", SimpleNamespace(sleep=press_ctrl_c))
    names: dict[str, object] = {"__name__": "__main__"}
    for language, text in BLOCK.findall((ROOT / page).read_text("utf-8")):
        name = FILE_NAME.match(text)
        if name is not None:
            (tmp_path / name[1]).write_text(text)
        elif language == "python":
            run_doctest(page, text, names)
        elif language == "console":
            run_commands(text, capsys)


class SignOfZeroIgnored(doctest.OutputChecker):
    """Takes -0. for 0.: a number that rounds to zero has a sign that differs between compiled and interpreted code."""

    def check_output(self, want: str, got: str, optionflags: int) -> bool:
        plain = [re.sub(r"-0\.(?![0-9])", " 0.", text) for text in (want, got)]
        return super().check_output(*plain, optionflags)


def run_doctest(page: str, text: str, names: dict[str, object]) -> None:
    """Run the examples of a block with the names of the page's earlier blocks."""
    assert ">>> " in text, f"{page} has Python that is neither a doctest nor a named file:\n{text}"
    test = doctest.DocTestParser().get_doctest(text.rstrip("\n") + "\n", names, page, page, 0)
    test.globs = names
    output: list[str] = []
    runner = doctest.DocTestRunner(SignOfZeroIgnored(), verbose=False)
    runner.run(test, out=output.append, clear_globs=False)
    assert runner.failures == 0, "".join(output)


def run_commands(text: str, capsys) -> None:
    """Run the lines that call dhkit; each must end with status 0, or with the one that its comment states."""
    for line in text.splitlines():
        if not line.startswith("$ "):
            continue
        words = shlex.split(line[2:], comments=True)
        if words[0] in OTHER_COMMANDS:
            continue
        assert words[0] == "dhkit", f"{line}: expected a command of dhkit"
        stated = re.search(r"# exit status (\d)", line)
        with pytest.raises(SystemExit) as exit:
            main(words[1:])
        expected = int(stated[1]) if stated else 0
        assert exit.value.code == expected, (line, capsys.readouterr())


def anchors(path: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub and the site name them."""
    text = ANY_BLOCK.sub("", path.read_text("utf-8"))
    return {
        re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-")
        for title in re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    }


@pytest.mark.parametrize("page", PAGES)
def test_the_links_of_a_page_lead_somewhere(page):
    path = ROOT / page
    text = ANY_BLOCK.sub("", path.read_text("utf-8"))
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        file, _, anchor = target.partition("#")
        if file.startswith(("http", "/_generated/")) or "_generated" in file:
            continue
        there = path if not file else (path.parent / file).resolve()
        if not re.fullmatch(r"[\w./-]+", file or "x") or (
            "." not in file and "/" not in file and file
        ):
            continue  # mathematics, such as [...](t)
        if there.suffix == ".html" or "reference/" in target:
            continue  # made at the build, which checks it
        assert there.exists(), f"{page} links to {target}"
        if anchor and there.suffix == ".md" and there.name != "gallery.md":
            assert anchor in anchors(there), f"{page} links to {target}"


@pytest.mark.parametrize("name", [slow_if(name not in QUICK_PICTURES, name) for name in GALLERY])
def test_a_script_of_the_gallery_makes_a_picture(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = runpy.run_path(str(DOCS / "gallery" / f"{name}.py"))
    if "film" in found:
        assert all(path.stat().st_size for path in found["film"])
    else:
        assert hasattr(found["picture"], "save") or hasattr(found["picture"], "savefig")


def documentation_module(name: str):
    """Return a module of docs/, which is not a package."""
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def test_the_reference_has_every_public_name():
    made = documentation_module("make_reference")
    page = made.arm_page()
    for name in vars(dhkit.Arm):
        assert name.startswith("_") or f":: Arm.{name}\n" in page, name
    places = set(made.home_places().values())
    for (package, name), home in made.home_places().items():
        assert home in places, (package, name)
    undocumented = {
        name
        for name in dhkit.__all__
        if name not in {"Arm", "__version__"} and not any(x.endswith(f".{name}") for x in places)
    }
    assert undocumented == set()


PUBLIC_METHODS = [
    name
    for name, member in inspect.getmembers(dhkit.Arm)
    if not name.startswith("_") and (inspect.isfunction(member) or inspect.ismethod(member))
]


@pytest.mark.parametrize("name", PUBLIC_METHODS)
def test_a_method_of_arm_explains_its_parameters_and_has_an_example(name):
    method = getattr(dhkit.Arm, name)
    text = inspect.getdoc(method)
    parameters = set(inspect.signature(method).parameters) - {"self"}
    assert parameters == explained_parameters(text), name
    assert ">>> " in text, name


def explained_parameters(docstring: str) -> set[str]:
    """Return the names in a docstring's section of parameters."""
    section = docstring.partition("Parameters\n----------\n")[2].partition("\n\n")[0]
    names: list[str] = []
    for line in section.splitlines():
        if line and not line.startswith(" "):
            names += line.split(",")
    return {name.strip("* ") for name in names}


def public_functions():
    """Yield the functions that the reference documents, by the path under which it does."""
    made = documentation_module("make_reference")
    for (package, name), home in made.home_places().items():
        value = getattr(importlib.import_module(f"dhkit.{package}"), name)
        if made.kind_of(value) == "function" and home == f"dhkit.{package}.{name}":
            yield home, value


def test_public_functions_explain_their_parameters_and_results():
    functions = dict(public_functions())
    assert len(functions) > 180
    for name, function in functions.items():
        text = inspect.getdoc(function)
        signature = inspect.signature(function)
        named = {parameter for parameter in signature.parameters if not parameter.startswith("_")}
        assert explained_parameters(text) == named, name
        if signature.return_annotation != "None":
            assert "Returns\n-------\n" in text or "Yields\n------\n" in text, name


def test_the_tutorials_are_notebooks_too():
    made = documentation_module("make_notebooks")
    pages = sorted((DOCS / "tutorials").glob("[0-9]*.md"))
    assert len(pages) == 12
    for page in pages:
        text = page.read_text("utf-8")
        content = made.notebook(text)
        nbformat.validate(content)
        sources = [cell["source"] for cell in content["cells"] if cell["cell_type"] == "code"]
        for source in sources:
            ast.parse(source)
        assert len(sources) == len(re.findall(r"^```python$", text, re.MULTILINE))


def test_pages_show_the_outputs_of_notebooks(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    made = documentation_module("make_examples")
    pages = {path.stem for path in (DOCS / "notebooks").glob("*.md")}
    assert pages == set(made.NOTEBOOKS) == {path.stem for path in made.EXAMPLES.glob("*.ipynb")}

    monkeypatch.setattr(made, "PAGES", tmp_path)
    monkeypatch.setattr(made, "BESIDE", tmp_path)
    frame = (
        '<iframe sandbox="allow-scripts" srcdoc="&lt;p&gt;an arm" title="t"></iframe><p>A copy</p>'
    )
    data = [
        {"text/html": frame, "text/plain": "<View>"},
        {"image/png": "iVBORw0KGgo=", "text/plain": "<Figure>"},
        {"text/latex": "\\begin{align*}\nq\n\\end{align*}\n\\begin{align*}\n1\n\\end{align*}"},
        {"text/plain": "1 < 2"},
    ]
    outputs = [nbformat.v4.new_output("display_data", data=x) for x in data]
    cell = nbformat.v4.new_code_cell("view", outputs=outputs)
    text = made.page("mine", [nbformat.v4.new_markdown_cell("# Mine"), cell])
    assert '<iframe sandbox="allow-scripts" src="mine-1.html" loading="lazy" title="t">' in text
    assert (tmp_path / "mine-1.html").read_text() == "<p>an arm"
    assert "(/_generated/notebooks/mine-2.png)" in text
    assert "\\end{align*}\n\n\\begin{align*}" in text
    assert "1 &lt; 2" in text
    error = nbformat.v4.new_output("error", ename="ValueError", evalue="no", traceback=[])
    with pytest.raises(RuntimeError, match="ValueError: no"):
        made.output_block(error, "mine-5")


def test_the_tables_are_made_of_the_results_of_benchmarks():
    made = documentation_module("make_tables")
    tables = made.comparison()
    assert "pin.forwardKinematics" in tables["comparison-single"]
    assert "roboticstoolbox ik_LM" in tables["comparison-panda"]
    assert "toppra" in tables["comparison-planning"]
    assert len(made.accuracy().splitlines()) == 2 + sum(map(len, made.ACCURACY.values()))
    assert made.library().count("\n") == 2 + len(dhkit.robots())
    assert made.duration(2.5e-8) == "25 ns"


def test_llms_txt_names_every_method_of_arm():
    text = documentation_module("make_tables").llms()
    for name in vars(dhkit.Arm):
        assert name.startswith("_") or f"- `{name}`: " in text, name


def test_broken_links_of_the_site_are_found(tmp_path):
    made = documentation_module("check_links")
    (tmp_path / "one.html").write_text(
        '<p id="here"><a href="two.html#there"></a><a href="#here"></a>'
    )
    (tmp_path / "two.html").write_text('<script src="https://cdn.example/x.js"></script>')
    assert made.faults(tmp_path) == [
        "one.html: two.html#there has no such anchor",
        "two.html: loads https://cdn.example/x.js",
    ]


def test_the_modules_of_the_site_are_python():
    for path in DOCS.glob("*.py"):
        ast.parse(path.read_text("utf-8"))


def test_the_built_folder_is_served_on_this_machine_alone(tmp_path):
    (tmp_path / "index.html").write_text("hello")
    (tmp_path / "sub").mkdir()
    with served(built_folder(tmp_path)) as url:
        assert url.startswith("http://127.0.0.1:")
        assert urlopen(url, timeout=10).read() == b"hello"
        with pytest.raises(HTTPError):
            urlopen(f"{url}sub/", timeout=10)


def test_docs_names_the_folder_that_is_missing(tmp_path, capsys):
    with pytest.raises(SystemExit) as exit:
        main(["docs", str(tmp_path / "none")])
    assert exit.value.code == 2
    assert "make docs" in capsys.readouterr().err


def test_docs_ends_with_ctrl_c(tmp_path, monkeypatch, capsys):
    (tmp_path / "index.html").write_text("hello")
    monkeypatch.setattr("dhkit.cli.browser.time", SimpleNamespace(sleep=press_ctrl_c))
    with pytest.raises(SystemExit) as exit:
        main(["docs", str(tmp_path), "--no-browser"])
    assert exit.value.code == 0
    assert "http://127.0.0.1:" in capsys.readouterr().out
