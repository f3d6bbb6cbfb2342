"""`dhkit extract`: the table on the screen, as JSON and as a robot file; what is unusable ends in one line."""

from __future__ import annotations

import json

import pytest

from dhkit import Arm
from dhkit.cli import main
from dhkit.description import asset
from dhkit.model import write_urdf


def run(capsys, *arguments: str):
    with pytest.raises(SystemExit) as stopped:
        main(list(arguments))
    said = capsys.readouterr()
    return stopped.value.code, said.out, said.err


def test_the_table_is_printed_and_written_with_its_meshes(tmp_path, capsys):
    urdf = tmp_path / "puma.urdf"
    write_urdf(Arm.load("puma560").description, urdf)
    (tmp_path / "out").mkdir()
    code, out, err = run(capsys, "extract", str(urdf), "-o", str(tmp_path / "out" / "puma.toml"))
    assert (code, err) == (0, "")
    assert "0.4318" in out
    assert "differs from the file by tool" in out
    assert "wrote" in out
    again = Arm.load(tmp_path / "out" / "puma.toml")
    puma = Arm.load("puma560")
    assert again.fk([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]) == pytest.approx(
        puma.fk([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]), abs=1e-9
    )
    assert not any("mesh" in warning for warning in again.description.warnings)
    assert len(list((tmp_path / "out" / "meshes").rglob("*.stl"))) == 7


@pytest.mark.parametrize("digits", [3, 5, 9])
def test_rounded_angles_bring_a_line_about_as_designed(digits, tmp_path, capsys):
    """Also where the table as designed has no fewer lengths."""
    urdf = tmp_path / "arm.urdf"
    write_urdf(Arm.load("puma560").description, urdf)
    exact = run(capsys, "extract", str(urdf))[1]
    assert "--as-designed" not in exact
    text = urdf.read_text()
    assert "1.5707963267948966" in text
    urdf.write_text(text.replace("1.5707963267948966", str(round(1.5707963267948966, digits))))
    _, out, _ = run(capsys, "extract", str(urdf))
    (line,) = [line for line in out.split("\n\n")[-1].splitlines() if "--as-designed" in line]
    assert "reads them as right angles" in line or "smaller table" in line
    facts = json.loads(run(capsys, "extract", str(urdf), "--json")[1])
    assert sum("--as-designed" in note for note in facts["notes"]) == 1
    assert "--as-designed" not in run(capsys, "extract", str(urdf), "--as-designed")[1]


def test_json_has_the_table_and_the_residual(capsys):
    code, out, _ = run(capsys, "extract", str(asset("urdf/panda.urdf")), "--modified", "--json")
    facts = json.loads(out)
    assert code == 0
    assert facts["convention"] == "modified"
    assert [round(joint["d_m"], 6) for joint in facts["joints"]] == [
        0.333,
        0,
        0.316,
        0,
        0.384,
        0,
        0,
    ]
    assert facts["residual"]["tool"] < 1e-9


def test_a_urdf_works_wherever_a_robot_does(capsys):
    code, out, _ = run(capsys, "info", f"{asset('urdf/ur5.urdf')}#tool")
    assert code == 0
    assert "parallel" in out or "UR" in out


def test_unusable_input_ends_in_one_line(tmp_path, capsys):
    bad = tmp_path / "bad.urdf"
    bad.write_text("<robot/>")
    for arguments in (
        ["extract", str(bad)],
        ["extract", str(tmp_path / "none.urdf")],
        ["extract", str(asset("urdf/ur5.urdf")), "--tip", "x"],
        ["extract", str(asset("urdf/ur5.urdf")), "-o", str(tmp_path / "x.yaml")],
        ["extract", str(asset("urdf/ur5.urdf")), "-o", "/dev/null/x.toml"],
        ["extract", str(asset("urdf/ur5.urdf")), "--package-dir", str(tmp_path / "none")],
        ["extract", "example:r2d2"],
        ["info", str(bad)],
    ):
        code, _, err = run(capsys, *arguments)
        assert code == 2, arguments
        assert err.count("\n") == 1
        assert "Traceback" not in err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.urdf"]
