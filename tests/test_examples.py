"""The scripts and notebooks of examples/ run, and draw."""

import re
import runpy
from pathlib import Path

import matplotlib as mpl
import pytest
from PIL import Image

EXAMPLES = Path(__file__).parents[1] / "examples"
SCRIPTS = sorted(path.name for path in EXAMPLES.glob("*.py"))
NOTEBOOKS = sorted(path.name for path in EXAMPLES.glob("*.ipynb"))


@pytest.fixture
def scratch(tmp_path, monkeypatch):
    """Work in an empty folder, without windows."""
    mpl.use("Agg")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_runs_and_writes_its_picture(name, scratch, capsys):
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    picture = Image.open(scratch / "out" / name.replace(".py", ".png"))
    assert min(picture.size) > 300
    assert len(picture.convert("RGB").getcolors(2**24)) > 50  # not blank
    assert "Error" not in capsys.readouterr().out


def test_the_list_of_examples_is_whole():
    listed = re.findall(r"^\| `(.+?)` \|", (EXAMPLES / "README.md").read_text(), re.MULTILINE)
    assert listed == SCRIPTS
    assert len(SCRIPTS) == 12


@pytest.mark.slow
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_is_executed_and_rendered(name, scratch):
    import nbformat
    from nbclient import NotebookClient
    from nbconvert import HTMLExporter

    notebook = nbformat.read(EXAMPLES / name, as_version=4)
    assert all(not cell.get("outputs") for cell in notebook.cells)  # outputs are made, not kept
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(scratch)}}).execute()
    body, _ = HTMLExporter().from_notebook_node(notebook)
    assert "Traceback" not in body
    assert body.count("<iframe") + body.count("<table") + body.count("<img") >= 2
