"""Folders of outputs are made; a view opened for a script waits for Ctrl-C."""

import pytest

from dhkit import Arm
from dhkit.cli import main
from dhkit.viewer import View, view

ASKED = {
    "build planar2r -o {}.urdf": ".urdf",
    "equations planar2r -o {}.txt": ".txt",
    "verify planar2r --samples 3 -o {}.md": ".md",
    "plan planar2r --to 1 1 --intervals 12 -o {}.npz --html {}.html --figure {}.png": ".npz .html .png",
    "simulate planar2r --duration 0.1 -o {}.npz --html {}.html --figure {}.png": ".npz .html .png",
    "compare planar2r --controllers pid --duration 0.1 --figure {}.png": ".png",
    "picture planar2r -o {}.png": ".png",
    "view planar2r --html {}.html": ".html",
    "grade --template planar2r -o {}.toml": ".toml",
    "grade --explain planar2r -o {}.md": ".md",
}


@pytest.mark.parametrize("command", ASKED)
@pytest.mark.slow
def test_folders_are_made(command, tmp_path, capsys):
    path = tmp_path / "new" / "folder" / "out"
    with pytest.raises(SystemExit) as ended:
        main([word.replace("{}", str(path)) for word in command.split()])
    assert ended.value.code == 0, capsys.readouterr().err
    for suffix in ASKED[command].split():
        assert path.with_suffix(suffix).stat().st_size > 0


def test_files_of_python_make_their_folders(tmp_path):
    arm = Arm.load("planar2r")
    place = tmp_path / "a" / "b"
    arm.write_urdf(place / "arm.urdf")
    arm.save(place / "c" / "arm.toml")
    arm.quintic([0, 0], [1, 1], 1.0).save(place / "d" / "motion.csv")
    arm.export_c(place / "e" / "code")
    assert sum(1 for file in place.rglob("*") if file.is_file()) >= 4


def test_an_open_view_waits_for_ctrl_c(monkeypatch):
    opened, waited = [], []

    def sleep(seconds):
        waited.append(seconds)
        if len(waited) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr(view.time, "sleep", sleep)
    with View(Arm.load("planar2r")) as shown:
        assert shown.open() == shown.url and not waited
        assert shown.open(block=True) == shown.url and len(waited) == 3
    assert len(opened) == 2
