"""Units of what the command prints: keys name them, and `--degrees` is honoured in answers, warnings and errors."""

import json

import numpy as np
import pytest

from dhkit import Arm
from dhkit.cli import main


@pytest.fixture
def dhkit(capsys):
    """Run the command; return its status, what it prints and what it says on stderr."""

    def run(*arguments):
        with pytest.raises(SystemExit) as ended:
            main([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        return ended.value.code, printed.out, printed.err

    return run


def test_joint_values_and_angles_are_told_in_the_unit_that_was_asked_for(dhkit):
    q = np.array([30.0, 40.0, 0.25, 10.0, 20.0, 30.0])  # the stanford arm's third joint slides
    arm = Arm.load("stanford")
    said = json.loads(dhkit("fk", "stanford", *q, "--degrees", "--json")[1])
    assert said["q_deg"] == pytest.approx(q)
    radians = np.where(arm.description.numbers.prismatic, q, np.radians(q))
    again = json.loads(dhkit("fk", "stanford", *radians, "--json")[1])
    assert again["q_rad"] == pytest.approx(radians)
    assert np.radians(said["euler_XYZ_deg"]) == pytest.approx(again["euler_XYZ_rad"])
    assert said["xyz_m"] == pytest.approx(arm.fk(radians)[:3, 3])
    found = json.loads(
        dhkit("ik", "stanford", "--like", *q, "--near", *q, "--degrees", "--json")[1]
    )
    nearest = next(branch for branch in found["branches"] if branch["name"] == found["nearest"])
    assert nearest["q_deg"] == pytest.approx(q)


@pytest.mark.parametrize(
    ("command", "units"),
    [
        (
            ["info", "stanford"],
            {"theta_rad", "d_m", "lower_rad", "upper_m", "velocity_m_s", "effort_N_m", "mass_kg"},
        ),
        (["extract", "example"], {"theta_rad", "d_m", "a_m", "alpha_rad"}),
        (["verify", "planar2r", "--samples", "3"], {"q_rad", "qd_rad_s", "qdd_rad_s2"}),
        (["robots"], {"reach_m"}),
        (
            ["workspace", "planar2r", "--samples", "200"],
            {"distances_m", "radii_m", "bounds_m", "q_rad", "xyz_m"},
        ),
        (
            ["simulate", "planar2r", "--duration", "0.5", "--degrees"],
            {"duration_s", "peak_error_deg", "tool_error_m"},
        ),
        (
            ["compare", "planar2r", "--controllers", "pid", "--duration", "0.5"],
            {"duration_s", "rms_error_rad"},
        ),
    ],
)
def test_keys_name_their_units(dhkit, command, units, tmp_path, monkeypatch):
    from dhkit.description import asset

    monkeypatch.chdir(tmp_path)
    command = [str(asset("urdf/puma560.urdf")) if word == "example" else word for word in command]
    status, out, _ = dhkit(*command, "--json")
    assert status == 0

    def keys(value):
        if isinstance(value, dict):
            return set(value) | {key for entry in value.values() for key in keys(entry)}
        return {key for entry in value for key in keys(entry)} if isinstance(value, list) else set()

    found = keys(json.loads(out))
    assert units <= found
    bare = {
        "q",
        "qd",
        "qdd",
        "position",
        "theta",
        "alpha",
        "lower",
        "upper",
        "duration",
        "peak_error",
        "radii",
        "mass",
    }
    assert not found & bare


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("plan puma560 --to 300 0 0 0 0 0", "is at 300°, above its upper limit, 160°"),
        (
            "plan puma560 --xyz 0.3 0 0.9 --velocity 10 --from 0 0 300 0 0 0",
            "is at 300°, above its upper limit, 45°",
        ),
        ("plan stanford --to 0 0 9 0 0 0", "is at 9 m, above its upper limit, 1.27 m"),
        ("simulate puma560 --from 0 0 0 0 0 0 --to 0 0 0 0 300 0 --duration 1", "100°"),
        ("simulate puma560 --from 0 0 0 0 0 500 --to 0 0 0 0 0 0", "266°"),
        (
            "fk puma560 170 0 0 0 0 0",
            "warning: joint values: waist is 170°, above its upper limit, 160°",
        ),
        ("fk planar2r 100 170", "elbow is 170°, above its upper limit, 160°"),
    ],
)
def test_degrees_are_honoured_in_errors_and_warnings(dhkit, arguments, words):
    _, _, err = dhkit(*arguments.split(), "--degrees")
    assert words in err
    assert " rad" not in err
    _, _, err = dhkit(*arguments.split())
    assert "°" not in err


@pytest.mark.parametrize(
    "arguments",
    [
        "fk planar2r 90 0",
        "ik planar2r --like 90 0",
        "ik planar2r --like 1 0 --near 90 0",
        "plan planar2r --to 90 0",
        "simulate planar2r --to 90 0",
        "picture planar2r --at 90 0 -o arm.png",
    ],
)
@pytest.mark.slow
def test_bare_degrees_are_noticed(dhkit, arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, _, err = dhkit(*arguments.split())
    assert "90 rad (14.3 turns; were degrees meant?)" in err
    assert err.count("\n") == 1
    assert "were degrees meant" not in dhkit(*arguments.split(), "--degrees")[2]


def test_values_within_the_limits_and_a_turn_are_not_talked_about(dhkit):
    for words in (
        "fk puma560 ready",
        "fk ur5 6.28 0 0 0 0 0",
        "ik puma560 --like ready --near ready",
    ):
        assert dhkit(*words.split())[2] == ""


def test_a_configuration_outside_the_limits_is_told_by_name(dhkit):
    assert "warning: zero: " in dhkit("fk", "panda", "zero")[2]
    assert "warning: configurations.zero: " in dhkit("info", "panda")[1]


def test_a_table_in_degrees_that_is_read_as_radians_is_noticed():
    rows = [(0, 0, 0.4, 90), (0, 0, 0.3, 0)]
    (warning,) = Arm.from_dh(rows).description.warnings
    assert "alpha is 90 rad, 14.3 turns; are angles in degrees?" in warning
    assert not Arm.from_dh(rows, angle="deg").description.warnings
    limited = Arm.from_dh([(0, 0, 0.4, 0)], limits=[(-90, 90)])
    assert len(limited.description.warnings) == 2
    assert not Arm.from_dh([(0, 0, 0.4, 0)], limits=[(-6.3, 6.3)]).description.warnings
    assert not Arm.from_dh([(0, 0, 0.4, 0)], kinds="P", limits=[(-90, 90)]).description.warnings
    assert "are angles in degrees?" in Arm.from_dh(rows)._repr_html_()


@pytest.mark.parametrize("value", ["90deg", "90*deg", "pi/2", "90°"])
def test_units_beside_degrees_are_refused(dhkit, value):
    status, _, err = dhkit("fk", "planar2r", value, "0", "--degrees")
    assert (status, err.count("\n")) == (2, 1)
    assert "expected bare numbers, which are degrees with --degrees" in err


def test_comparisons_and_the_names_of_motions_are_in_degrees(dhkit):
    words = ("compare", "planar2r", "--from", "zero", "--controllers", "pd", "--duration", "1")
    degrees, radians = (
        dhkit(*words, "--to", *to)[1]
        for to in (("20", "20", "--degrees"), ("0.349066", "0.349066"))
    )
    assert "to (20°, 20°)" in degrees and "largest error [°]" in degrees
    assert "to (0.3491 rad, 0.3491 rad)" in radians and "largest error [rad]" in radians
    errors = [float(text.split("\npd")[1].split()[0]) for text in (degrees, radians)]
    assert errors[0] == pytest.approx(np.degrees(errors[1]), rel=0.1)
