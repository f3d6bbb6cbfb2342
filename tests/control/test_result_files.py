"""Simulations come back from files as they were; results that are not results are refused in one line."""

import io
import re
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from dhkit.control import SimulationResult
from dhkit.control.result_files import ROWS, SIMULATION
from dhkit.description import from_dh, library_robot, with_payload
from dhkit.errors import DescriptionError
from dhkit.trajectories import cubic
from dhkit.trajectories.archives import archive_bytes, read_archive
from file_checks import check_damaged, check_refused
from simulation_results import swinging

ARM = library_robot("planar2r")
SUFFIXES = (".npz", ".mat", ".csv")
NUMBERS = ("t", *ROWS, "saturated", "reference_poses")


def check_equal(again, result):
    """Check that two results agree to the last bit."""
    assert again.description.digest == result.description.digest
    assert again.audit == result.audit
    for name in NUMBERS:
        ours, theirs = getattr(again, name), getattr(result, name)
        assert ours.shape == theirs.shape
        assert ours.tobytes() == np.ascontiguousarray(theirs).tobytes(), name


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("name", ["planar2r", "puma560", "stanford", "panda"])
def test_files_hold_every_bit(name, suffix, tmp_path):
    result = swinging(library_robot(name))
    path = result.save(tmp_path / f"run{suffix.upper()}")
    again = SimulationResult.load(path)
    check_equal(again, result)
    assert again.description is library_robot(name)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    for ours, theirs in zip(again.tool_norms, result.tool_norms, strict=True):
        # Interpreted and compiled kernels round differently.
        assert ours == pytest.approx(theirs, abs=1e-14)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("states", [1, 2, 5])
@pytest.mark.parametrize("n", [1, 2])
def test_few_states_and_joints_keep_their_shapes(n, states, suffix, tmp_path):
    arm = from_dh([(0, 0.3, 0.1, "pi/7")] * n, kinds="R" * n, name="mine")
    result = swinging(arm, states)
    check_equal(SimulationResult.load(result.save(tmp_path / f"run{suffix}"), arm), result)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_shares_of_saturation_may_be_unknown(suffix, tmp_path):
    result = replace(swinging(ARM), saturated=np.zeros(0))
    check_equal(SimulationResult.load(result.save(tmp_path / f"run{suffix}")), result)


def test_an_archive_holds_a_robot_that_nobody_knows_and_a_table_asks_for_it(tmp_path):
    arm = with_payload(ARM, 0.5)
    result = swinging(arm)
    for suffix in (".npz", ".mat"):
        assert SimulationResult.load(result.save(tmp_path / f"run{suffix}")).description == arm
    path = result.save(tmp_path / "run.csv")
    with pytest.raises(
        DescriptionError, match=r"its robot planar2r \(.*\) is not the library's; give the robot"
    ):
        SimulationResult.load(path)
    assert SimulationResult.load(path, arm).description is arm


def test_a_table_begins_as_promised(tmp_path):
    lines = swinging(ARM, 3).save(tmp_path / "run.csv").read_text().splitlines()
    assert lines[:2] == ["# dhkit simulation", f"# robot: planar2r {ARM.digest}"]
    assert lines[2].startswith("# content: ")
    assert [line.split(":")[0] for line in lines[3:10]] == [
        f"# {name}" for name in SIMULATION.arrays[8:] if name != "reference_poses"
    ]
    header = "t,q1,q2,qd1,qd2,qdd1,qdd2,tau1,tau2,tau_asked1,tau_asked2,reference_q1,reference_q2"
    assert lines[10] == f"{header},reference_qd1,reference_qd2"
    assert len(lines) == 14


def test_numpy_and_scipy_read_the_archives(tmp_path):
    from scipy.io import loadmat

    result = swinging(ARM)
    with np.load(result.save(tmp_path / "run.npz"), allow_pickle=False) as archive:
        assert np.array_equal(archive["tau_asked"], result.tau_asked)
        assert float(archive["audit_turnover"]) == result.audit.turnover
    archive = loadmat(result.save(tmp_path / "run.mat"))
    assert np.array_equal(archive["q"], result.q)
    assert archive["robot"][0] == "planar2r"


def test_what_matlab_saves_again_is_read(tmp_path):
    """MATLAB compresses what it saves."""
    from scipy.io import loadmat, savemat

    result = swinging(ARM)
    path = result.save(tmp_path / "run.mat")
    values = {key: value for key, value in loadmat(path).items() if not key.startswith("__")}
    savemat(path, {"extra": {"a": 1.0}, **values}, do_compression=True)
    check_equal(SimulationResult.load(path), result)


# Results that are not results


def values(**changed):
    result = swinging(ARM, 5)
    audit = {f"audit_{name}": np.float64(value) for name, value in vars(result.audit).items()}
    base = SIMULATION.archived(ARM, {name: getattr(result, name) for name in NUMBERS} | audit)
    return {key: value for key, value in {**base, **changed}.items() if value is not None}


def spoiled(value, row=3):
    """Return rates of which one is another value."""
    array = np.ones((5, 2))
    array[row, 1] = value
    return array


BAD_VALUES = {
    "no torques": (
        {"tau": None},
        r"no tau in it: found .*; expected a simulation that dhkit saved",
    ),
    "a later version": (
        {"format": "dhkit simulation 9"},
        "format is 'dhkit simulation 9'; expected 'dhkit simulation",
    ),
    "a trajectory's label": ({"format": "dhkit trajectory 1"}, "format is 'dhkit trajectory 1'"),
    "another digest": (
        {"digest": "0" * 12},
        "its robot is not the 'planar2r' that it names; the file is damaged",
    ),
    "another name": ({"robot": "puma560"}, "its robot is not the 'puma560' that it names"),
    "a robot cut short": ({"toml": "format = 1\nname = "}, "its robot"),
    "too few rows": ({"qd": np.ones((4, 2))}, r"qd has shape \(4, 2\); expected \(5, 2\)"),
    "another arm's columns": (
        {"reference_q": np.ones((5, 6))},
        r"reference_q has shape \(5, 6\); expected \(5, 2\)",
    ),
    "rows and columns exchanged": (
        {"q": np.ones((2, 5))},
        r"q has shape \(2, 5\); expected \(5, 2\)",
    ),
    "times as a matrix": ({"t": np.ones((5, 2))}, r"t has shape \(5, 2\); expected \(10,\)"),
    "no state": ({"t": np.zeros((1, 0))}, "t has no values"),
    "NaN": (
        {"tau_asked": spoiled(np.nan)},
        "tau_asked has values that are not finite, the first in row 3",
    ),
    "infinite": (
        {"qdd": spoiled(-np.inf, 0)},
        "qdd has values that are not finite, the first in row 0",
    ),
    "times that do not increase": (
        {"t": np.array([0, 1, 2, 2, 3.0])},
        r"t\[2\] is 2 s, t\[3\] is 2 s",
    ),
    "times that begin late": ({"t": np.arange(1.0, 6.0)}, "t begins with 1 s; expected 0"),
    "an audit that is not a number": (
        {"audit_drives": np.float64(np.nan)},
        "audit_drives has values that are not finite",
    ),
    "an audit of two numbers": (
        {"audit_drives": np.ones(2)},
        r"audit_drives has shape .*; expected \(\)",
    ),
    "a share beyond 1": (
        {"saturated": np.array([0.5, 1.5])},
        r"saturated is \[0.5, 1.5\]; expected shares",
    ),
    "shares of another arm": (
        {"saturated": np.ones(3)},
        r"saturated has shape .*; expected \(2,\)",
    ),
    "text for numbers": ({"tau": "none"}, "tau: found (text|type <U4); expected (numbers|float64)"),
}


@pytest.mark.parametrize("name", BAD_VALUES)
@pytest.mark.parametrize("suffix", [".npz", ".mat"])
def test_an_archive_of_wrong_values_is_refused(suffix, name, tmp_path):
    changed, complaint = BAD_VALUES[name]
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(archive_bytes(suffix, values(**changed)))
    refused(path, complaint)


BAD_LINES = {
    "another title": (
        r"# dhkit simulation",
        "# dhkit trajectory",
        "does not begin with '# dhkit simulation'",
    ),
    "no robot": (r"# robot: .*\n", "", "does not begin with .* and '# robot: NAME DIGEST'"),
    "no audit": (
        r"# audit_drives.*\n",
        "",
        "no comment '# audit_drives: ...'; expected a simulation that dhkit saved",
    ),
    "an audit of words": (
        r"(# audit_drives:).*",
        r"\1 much",
        "audit_drives is 'much'; expected numbers",
    ),
    "an audit of nothing": (
        r"(# audit_drives:).*",
        r"\1",
        r"audit_drives has shape \(0,\); expected \(\)",
    ),
    "an infinite audit": (
        r"(# audit_drives:).*",
        r"\1 inf",
        "audit_drives has values that are not finite",
    ),
    "one share": (r"(# saturated:).*", r"\1 0.5", r"saturated has shape \(1,\); expected \(2,\)"),
    "other columns": (
        "tau_asked1",
        "tau_wanted1",
        "columns t, q1, .*; expected t, q1, q2, .*tau_asked1",
    ),
    "a column too few": (",reference_qd2", "", "line 12: 15 values; expected 14, as in the header"),
    "a word": (r"\n0,[^,]*,", "\n0,fast,", "line 12: q1 is 'fast'; expected a number"),
    "NaN": (r"\n0,[^,]*,", "\n0,nan,", "line 12: q1 is nan; expected a finite number"),
    "times that begin late": (r"\n0,", "\n0.1,", "t begins with 0.1 s; expected 0"),
    "another number": (
        r"\n0,[^,]*,",
        "\n0,0.25,",
        "changed since dhkit wrote it: its digest differs",
    ),
    "no digest": (r"# content: .*\n", "", "no comment '# content: DIGEST' in its third line"),
    "no states": (r"\n[-\d][^#]*\Z", "\n", "no samples in it"),
}


@pytest.mark.parametrize("name", BAD_LINES)
def test_a_table_of_wrong_lines_is_refused(name, tmp_path):
    old, new, complaint = BAD_LINES[name]
    path = swinging(ARM, 5).save(tmp_path / "bad.csv")
    text = path.read_text()
    changed = re.sub(old, new, text, count=1)
    assert changed != text
    path.write_text(changed)
    refused(path, complaint)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_another_robots_file_is_refused(suffix, tmp_path):
    path = swinging(library_robot("puma560")).save(tmp_path / f"run{suffix}")
    refused(
        path,
        rf"made for the robot puma560 \(.*\); expected one for planar2r \(digest {ARM.digest}\)",
        ARM,
    )


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_no_file_and_no_simulation_are_named(suffix, tmp_path):
    path = tmp_path / f"run{suffix}"
    refused(path, "no such file")
    for content in (b"", b"PK\x03\x04", b"hello\nworld\nhere\n", bytes(range(256))):
        path.write_bytes(content)
        refused(path, "expected|damaged|does not begin with|not UTF-8|no .mat file")
    cubic(ARM, [0, 0], [1, 1], 1.0).save(path)
    refused(path, "no t in it|does not begin with '# dhkit simulation'")


def test_other_suffixes_are_named(tmp_path):
    with pytest.raises(ValueError, match=r"found suffix '.yaml'; expected one of .npz, .mat, .csv"):
        swinging(ARM).save(tmp_path / "run.yaml")
    refused(tmp_path / "run", "found suffix ''")
    assert list(tmp_path.iterdir()) == []


def test_pickled_members_are_never_read(tmp_path):
    class Bomb:
        def __reduce__(self):
            return (pytest.fail, ("unpickled",))

    path = tmp_path / "bad.npz"
    np.savez(path, **values(q=np.array([Bomb()], dtype=object)))
    refused(path, "q: found type object; expected float64")


@pytest.mark.parametrize(
    ("suffix", "complaint"), [(".npz", "unpacks to 0 MB"), (".mat", "unpacks to more than the")]
)
def test_an_archive_is_not_unpacked_beyond_its_bound(suffix, complaint, tmp_path):
    from scipy.io import savemat

    small, path = replace(SIMULATION, most=2_000), tmp_path / f"bomb{suffix}"
    if suffix == ".npz":
        np.savez_compressed(path, **values(q=np.zeros((10_000, 2))))
    else:
        savemat(path, values(q=np.zeros((10_000, 2))), do_compression=True)
    assert path.stat().st_size < 20_000
    with pytest.raises(DescriptionError, match=complaint):
        read_archive(suffix, path.read_bytes(), small)


def test_headers_that_promise_too_much_are_refused(tmp_path):
    member = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        member, {"descr": "<f8", "fortran_order": False, "shape": (10**9, 10**9, 2)}
    )
    path = tmp_path / "bad.npz"
    good = io.BytesIO(archive_bytes(".npz", values()))
    with zipfile.ZipFile(path, "w") as archive, zipfile.ZipFile(good) as source:
        for name in source.namelist():
            archive.writestr(name, member.getvalue() if name == "q.npy" else source.read(name))
    refused(path, "q: 0 bytes for shape .*; the file is damaged")


@pytest.mark.parametrize(("name", "value"), [("q", np.nan), ("tau", np.inf)])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_could_not_be_read_is_not_written(suffix, name, value, tmp_path):
    result = replace(swinging(ARM, 5), **{name: spoiled(value)})
    with pytest.raises(
        ValueError, match=f"{name} has values that are not finite, the first in row 3"
    ):
        result.save(tmp_path / f"run{suffix}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(data=st.data())
def test_no_damaged_byte_leads_anywhere_else(data, suffix, tmp_path_factory):
    path = swinging(ARM, 4).save(tmp_path_factory.mktemp("damaged") / f"run{suffix}")
    check_damaged(data.draw, SimulationResult.load, path)


def refused(path, complaint, description=None):
    check_refused(lambda file: SimulationResult.load(file, description), path, complaint)
