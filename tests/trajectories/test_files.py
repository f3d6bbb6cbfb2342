"""Files come back as they were, and damaged ones are refused in one line."""

import io
import zipfile

import numpy as np
import pytest
from hypothesis import given, strategies as st

from acceptance import different_robots_first
from dhkit.description import Payload, from_dh, library_robot, robots, with_payload
from dhkit.dynamics import Friction, inverse_dynamics
from dhkit.errors import DescriptionError
from dhkit.trajectories import Trajectory, cubic
from dhkit.trajectories.archives import archive_bytes, mat_bytes, npz_bytes, read_archive
from dhkit.trajectories.files import TRAJECTORY
from file_checks import check_damaged, check_refused
from trajectories_reference import continuous_motion

ARM, PUMA = library_robot("planar2r"), library_robot("puma560")
TABLES = (".csv", ".yaml", ".yml")
BETWEEN = 1e-11  # rad and m: quintics through samples of a smooth motion, every ms


@pytest.mark.parametrize("suffix", [".npz", ".mat"])
@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_archives_hold_every_bit_and_the_robot(name, suffix, tmp_path):
    motion = continuous_motion(library_robot(name))
    path = motion.save(tmp_path / f"motion{suffix}")
    again = Trajectory.load(path)
    assert again == motion
    assert again.breaks.tobytes() == motion.breaks.tobytes()
    assert again.coefficients.tobytes() == motion.coefficients.tobytes()
    assert again.description is library_robot(name)
    assert Trajectory.load(str(path), library_robot(name)) == motion


@pytest.mark.parametrize("suffix", [".npz", ".mat"])
@pytest.mark.parametrize("kinds", ["R", "PR"])
def test_archives_hold_robots_that_nobody_knows(kinds, suffix, tmp_path):
    arm = from_dh([(0, 0.3, 0.1, "pi/7")] * len(kinds), kinds=kinds, name="mine")
    arm = with_payload(library_robot("pan_tilt"), 0.1) if kinds == "PR" else arm
    for pieces in (1, 3):
        motion = continuous_motion(arm, pieces)
        again = Trajectory.load(motion.save(tmp_path / f"motion{suffix}"))
        assert again == motion
        assert again.description == arm


def test_numpy_and_scipy_read_the_archives(tmp_path):
    from scipy.io import loadmat

    motion = continuous_motion(PUMA)
    with np.load(motion.save(tmp_path / "motion.npz"), allow_pickle=False) as archive:
        assert np.array_equal(archive["coefficients"], motion.coefficients)
        assert str(archive["robot"]) == "puma560"
    archive = loadmat(motion.save(tmp_path / "motion.mat"))
    assert np.array_equal(archive["coefficients"], motion.coefficients)
    assert archive["digest"][0] == PUMA.digest


def test_what_matlab_saves_again_is_read(tmp_path):
    """MATLAB compresses what it saves."""
    from scipy.io import loadmat, savemat

    motion = continuous_motion(PUMA)
    path = motion.save(tmp_path / "motion.mat")
    values = {key: value for key, value in loadmat(path).items() if not key.startswith("__")}
    savemat(path, {"extra": np.zeros(3), **values}, do_compression=True)
    assert Trajectory.load(path) == motion


@pytest.mark.parametrize("suffix", TABLES)
@pytest.mark.parametrize("name", ["puma560", "cobra600", "planar2r"])
def test_tables_hold_samples_of_every_bit(name, suffix, tmp_path):
    arm = library_robot(name)
    motion = cubic(arm, np.zeros(arm.n), np.full(arm.n, 0.1), duration=0.5)
    again = Trajectory.load(motion.save(tmp_path / f"motion{suffix}"))
    samples = motion.sample(rate=1000)
    assert np.allclose(again.breaks, samples.times, rtol=0, atol=1e-9 if suffix != ".csv" else 0)
    for ours, theirs in ((again.q, samples.q), (again.qd, samples.qd)):
        assert np.array_equal(ours(again.breaks)[:-1], theirs[:-1])
    t = np.linspace(0, motion.duration, 3001)
    assert np.abs(again.q(t) - motion.q(t)).max() < BETWEEN
    assert np.abs(again.qd(t) - motion.qd(t)).max() < 1e3 * BETWEEN
    assert again.description is arm


def test_a_table_begins_as_promised(tmp_path):
    motion = cubic(ARM, [0, 0], [1, 1], duration=1.0)
    lines = motion.save(tmp_path / "motion.csv", rate=2).read_text().splitlines()
    assert lines[:2] == ["# dhkit trajectory", f"# robot: planar2r {ARM.digest}"]
    assert lines[2].startswith("# content: ")
    assert lines[3] == "t,q1,q2,qd1,qd2,qdd1,qdd2"
    assert lines[5] == "0.5,0.5,0.5,1.5,1.5,0,0"
    assert len(lines) == 7


def test_pyyaml_reads_what_is_written(tmp_path):
    yaml = pytest.importorskip("yaml")
    motion = continuous_motion(PUMA)
    message = yaml.safe_load(motion.save(tmp_path / "motion.yaml", rate=100).read_text())
    assert message["joint_names"] == [joint.name for joint in PUMA.joints]
    samples = motion.sample(rate=100)
    assert len(message["points"]) == len(samples.times)
    for k in (0, 7):
        point = message["points"][k]
        assert point["positions"] == samples.q[k].tolist()
        assert point["accelerations"] == samples.qdd[k].tolist()
        time = point["time_from_start"]
        assert time["sec"] + time["nanosec"] / 1e9 == pytest.approx(samples.times[k], abs=1e-9)


@pytest.mark.parametrize("suffix", [".npz", ".mat", *TABLES])
def test_another_robots_file_is_refused_and_leaves_no_trace(suffix, tmp_path):
    path = continuous_motion(PUMA).save(tmp_path / f"motion{suffix}")
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    with pytest.raises(DescriptionError, match=rf"puma560 \((digest )?{PUMA.digest}\)") as error:
        Trajectory.load(path, ARM)
    assert ARM.digest in str(error.value)
    assert str(path) in str(error.value)


@pytest.mark.parametrize("suffix", TABLES)
def test_a_table_of_an_unknown_robot_asks_for_it(suffix, tmp_path):
    arm = with_payload(PUMA, 1)
    motion = cubic(arm, np.zeros(6), np.ones(6) / 10, duration=0.1)
    path = motion.save(tmp_path / f"motion{suffix}")
    with pytest.raises(
        DescriptionError, match=r"its robot puma560 \(.*\) is not the library's; give the robot"
    ):
        Trajectory.load(path)
    assert Trajectory.load(path, arm).description is arm


GOOD = {
    "format": "dhkit trajectory 1",
    "robot": "planar2r",
    "digest": ARM.digest,
    "content": "0" * 16,
}


def values(**changed):
    from dhkit.description import to_toml

    base = {
        **GOOD,
        "toml": to_toml(ARM),
        "breaks": np.array([0.0, 1.0]),
        "coefficients": np.ones((1, 2, 2)),
    }
    return {key: value for key, value in {**base, **changed}.items() if value is not None}


BAD_VALUES = [
    ({"breaks": None}, r"no breaks in it: found .*; expected a trajectory that dhkit saved"),
    (
        {"format": "dhkit trajectory 9"},
        r"format is 'dhkit trajectory 9'; expected 'dhkit trajectory 1'",
    ),
    ({"digest": "0" * 12}, r"its robot is not the 'planar2r' that it names; the file is damaged"),
    ({"robot": "puma560"}, r"its robot is not the 'puma560' that it names"),
    ({"toml": "format = 1\nname = "}, r"its robot"),
    ({"breaks": np.array([0.0, -1.0])}, r"breaks do not increase"),
    ({"breaks": np.array([0.0, np.nan])}, r"breaks has nan"),
    (
        {"coefficients": np.ones((1, 2, 3))},
        r"coefficients has shape \(1, 2, 3\); expected \(1, p\+1, 2\)",
    ),
    ({"coefficients": np.full((1, 2, 2), np.inf)}, r"coefficients has inf"),
    ({"content": None}, r"no content in it"),
    ({}, r"its numbers differ from those that were written; the file is damaged"),
    ({"payload": np.ones(9)}, r"payload: numbers has shape \(9,\); expected \(10,\)"),
    ({"payload": np.r_[-1.0, np.zeros(9)]}, r"payload: mass is -1 kg; expected none below 0"),
    ({"payload": np.r_[np.nan, np.zeros(9)]}, r"payload: mass is nan; expected finite numbers"),
    ({"friction": np.ones(2)}, r"friction has 2 numbers; expected its width alone"),
    ({"friction": np.array([-1.0])}, r"friction: width is -1.0; expected 0, or a finite number"),
]


@pytest.mark.parametrize(("changed", "complaint"), BAD_VALUES)
@pytest.mark.parametrize("suffix", [".npz", ".mat"])
def test_wrong_values_are_refused(suffix, changed, complaint, tmp_path):
    path = tmp_path / f"bad{suffix}"
    path.write_bytes((npz_bytes if suffix == ".npz" else mat_bytes)(values(**changed)))
    refused(path, complaint)


def test_a_cell_or_a_number_in_place_of_text_is_refused(tmp_path):
    for toml in (np.array([1, 2], dtype=object), 7.0, {"a": 1.0}):
        path = tmp_path / "bad.mat"
        path.write_bytes(mat_bytes(values(toml=toml)))
        refused(path, r"toml: found (a cell|a struct|numbers); expected")


def test_pickled_members_are_never_read(tmp_path):
    class Bomb:
        def __reduce__(self):
            return (pytest.fail, ("unpickled",))

    path = tmp_path / "bad.npz"
    np.savez(path, **values(breaks=np.array([Bomb()], dtype=object)))
    refused(path, r"breaks: found type object; expected float64")
    np.savez(path, **values(coefficients=np.ones((1, 2, 2), dtype=np.float32)))
    refused(path, r"coefficients: found type float32; expected float64")


@pytest.mark.slow
def test_bombs_are_not_unpacked(tmp_path):
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for key in values():
            with archive.open(f"{key}.npy", "w", force_zip64=True) as member:
                for _ in range(60):
                    member.write(bytes(1_000_000))
    refused(path, r"unpacks to 420 MB; expected at most 200 MB")
    import struct
    import zlib

    packer = zlib.compressobj()
    packed = b"".join(packer.compress(bytes(1_000_000)) for _ in range(201)) + packer.flush()
    header = mat_bytes(values())[:128]
    path = tmp_path / "bomb.mat"
    path.write_bytes(header + struct.pack("<II", 15, len(packed)) + packed)
    refused(path, r"unpacks to more than .* 200 MB")


def test_headers_that_promise_too_much_are_refused(tmp_path):
    member = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        member, {"descr": "<f8", "fortran_order": False, "shape": (10**9, 10**9, 2)}
    )
    path = tmp_path / "bad.npz"
    with (
        zipfile.ZipFile(path, "w") as archive,
        zipfile.ZipFile(io.BytesIO(npz_bytes(values()))) as good,
    ):
        for name in good.namelist():
            archive.writestr(
                name, member.getvalue() if name == "coefficients.npy" else good.read(name)
            )
    refused(path, r"coefficients: 0 bytes for shape .*; the file is damaged")


@pytest.mark.parametrize("suffix", [".npz", ".mat", *TABLES])
def test_no_file_and_no_trajectory_are_named(suffix, tmp_path):
    path = tmp_path / f"motion{suffix}"
    refused(path, "no such file")
    for content in (b"", b"PK\x03\x04", b"hello\nworld\nhere\n", bytes(range(256))):
        path.write_bytes(content)
        refused(path, "expected|damaged|does not begin with|not UTF-8|no .mat file")


def test_other_suffixes_are_named(tmp_path):
    motion = continuous_motion(ARM)
    with pytest.raises(
        ValueError, match=r"found suffix '.json'; expected one of .npz, .mat, .csv, .yaml, .yml"
    ):
        motion.save(tmp_path / "motion.json")
    refused(tmp_path / "motion", r"found suffix ''")
    with pytest.raises(ValueError, match=r"rate is 10: .npz holds no samples"):
        motion.save(tmp_path / "motion.npz", rate=10)


@pytest.mark.parametrize("suffix", [".npz", ".mat", ".csv", ".yaml"])
@given(data=st.data())
def test_no_damaged_byte_leads_anywhere_else(data, suffix, tmp_path_factory):
    folder = tmp_path_factory.mktemp("damaged")
    path = continuous_motion(ARM, pieces=2, duration=0.02).save(folder / f"motion{suffix}")
    check_damaged(data.draw, Trajectory.load, path)


def refused(path, complaint):
    check_refused(Trajectory.load, path, complaint)


@pytest.mark.parametrize("suffix", [".npz", ".mat"])
@pytest.mark.parametrize(("order", "what"), [(0, "value"), (1, "speed")])
def test_a_file_whose_motion_jumps_is_refused(suffix, order, what, tmp_path):
    arm = library_robot("planar2r")
    coefficients = np.zeros((2, 4, 2))
    coefficients[1, order, 1] = 1e-3
    Trajectory(arm, [0.0, 1.0, 2.0], coefficients).save(tmp_path / f"jump{suffix}")
    with pytest.raises(
        DescriptionError, match=rf"jump\{suffix}: joint 2: its {what} jumps from 0 to 0.001 at 1 s"
    ):
        Trajectory.load(tmp_path / f"jump{suffix}")


LOADS = [
    Payload(2.0, (0.01, 0.0, 0.05)),
    Payload(1.5, (0, 0, 0.1), np.diag([0.01, 0.02, 0.025])),
    Payload(0.3),
]


@pytest.mark.parametrize("suffix", [".npz", ".mat", ".csv", ".yaml"])
@pytest.mark.parametrize("payload", LOADS)
@pytest.mark.parametrize("friction", [None, Friction(0.05), Friction()])
def test_payload_and_friction_stand_in_the_file(suffix, payload, friction, tmp_path):
    motion = cubic(PUMA, np.zeros(6), np.full(6, 0.2), duration=0.4).carrying(payload, friction)
    again = Trajectory.load(motion.save(tmp_path / f"motion{suffix}"))
    assert (again.payload, again.friction) == (payload, friction)
    assert again.description is PUMA
    t = np.linspace(0, 0.4, 9)[1:-1]
    loaded = payload.carried(PUMA)
    expected = inverse_dynamics(
        loaded, motion.q(t), motion.qd(t), motion.qdd(t), friction=friction or False
    )
    assert np.abs(again.tau(t) - expected).max() < 1e-5


@pytest.mark.parametrize("suffix", [".npz", ".mat", ".csv", ".yaml"])
def test_a_changed_number_is_noticed(suffix, tmp_path):
    motion = cubic(ARM, [0, 0], [1, 1], duration=1.0).carrying(Payload(1.5))
    path = motion.save(tmp_path / f"motion{suffix}")
    if suffix in TABLES:
        path.write_text(path.read_text().replace("payload: 1.5", "payload: 1.25"))
        complaint = "changed since dhkit wrote it: its digest differs; Trajectory.read takes samples from elsewhere"
    else:
        archive = read_archive(suffix, path.read_bytes(), TRAJECTORY)
        archive["payload"] = np.r_[1.25, np.zeros(9)]
        path.write_bytes(archive_bytes(suffix, archive))
        complaint = "its numbers differ from those that were written"
    refused(path, complaint)
    if suffix in TABLES:
        path.write_bytes(motion.save(path).read_bytes().replace(b"\n", b"\r\n"))
        assert Trajectory.load(path).payload == motion.payload
    if suffix == ".csv":
        text = path.read_text().splitlines()
        path.write_text("\n".join(text[:-1]) + "\n")
        assert Trajectory.read(path, ARM).duration <= 1.0  # a shortened table is one from elsewhere
