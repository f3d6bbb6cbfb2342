"""Samples out of .mat files as MATLAB and Simulink users save them; what is wrong is named with its variable."""

import struct

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.io import savemat

from dhkit.description import from_dh, library_robot
from dhkit.errors import DescriptionError
from dhkit.trajectories import Trajectory
from dhkit.trajectories.matlab_samples import matlab_choices
from file_checks import check_damaged, check_refused

ARM, COBRA = library_robot("planar2r"), library_robot("cobra600")
T = np.array([5.0, 5.5, 6.0, 7.0])
Q, QD, QDD = np.random.default_rng(0).uniform(-1, 1, (3, 4, 2))
EXPORT = (
    r"save arrays by save\('log.mat', 't', 'q', '-v7'\), a timeseries ts as \[ts.Time, ts.Data\]"
)


def read(folder, values, arm=ARM, packed=False, **options):
    savemat(folder / "log.mat", values, do_compression=packed)
    return Trajectory.read(folder / "log.mat", arm, **options)


def timed(matrix):
    """Return a matrix as [ts.Time, ts.Data] makes it."""
    return np.column_stack([T, matrix])


AS_SAVED = {
    "a matrix": {"t": T, "q": Q},
    "a column of times": {"time": T[:, None], "q": Q},
    "Simulink's time": {"tout": T[:, None], "q": Q},
    "times in the matrix": {"q": timed(Q)},
    "both": {"t": T, "q": timed(Q)},
    "vectors": {"t": T, "q1": Q[:, 0], "q2": Q[:, 1, None]},
    "the joints' names": {"t": T, "Shoulder": Q[:, 0], "elbow": Q[:, 1]},
    "more than is needed": {
        "t": T,
        "q": Q,
        "Q": np.eye(6),
        "gains": {"kp": 1.0},
        "note": "run 7",
        "names": ["a", "b"],
    },
    "single precision": {"t": T, "q": Q.astype(np.float32)},
}


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("name", AS_SAVED)
def test_arrays_are_read_as_they_are_saved(name, packed, tmp_path):
    motion = read(tmp_path, AS_SAVED[name], packed=packed)
    q = Q.astype(np.float32) if name == "single precision" else Q
    assert motion == Trajectory.from_samples(ARM, T, q)


@pytest.mark.parametrize("names", [("qd", "qdd"), ("dq", "ddq"), ("vel", "acc")])
@pytest.mark.parametrize("as_matrices", [True, False])
def test_rates_and_accelerations_are_used_where_they_are(names, as_matrices, tmp_path):
    rates, accelerations = names
    if as_matrices:
        values = {"q": Q, rates: timed(QD), accelerations: QDD}
    else:
        arrays = {"q": Q, rates: QD, accelerations: QDD}
        values = {f"{name}{i + 1}": array[:, i] for name, array in arrays.items() for i in range(2)}
    assert read(tmp_path, {"t": T, **values}) == Trajectory.from_samples(ARM, T, Q, QD, QDD)
    values = {name: array for name, array in values.items() if not name.startswith(accelerations)}
    assert read(tmp_path, {"t": T, **values}) == Trajectory.from_samples(ARM, T, Q, QD)


def test_names_are_mapped(tmp_path):
    logged = {
        "clock": T,
        "simout": Q,
        "rates": QD,
        "a1": Q[:, 0],
        "a2": Q[:, 1],
        "q": np.zeros((4, 2)),
    }
    expected = Trajectory.from_samples(ARM, T, Q)
    assert read(tmp_path, logged, columns={"t": "clock", "q": "simout"}) == expected
    assert read(tmp_path, logged, columns={"t": "CLOCK", "shoulder": "a1", "q2": "a2"}) == expected
    motion = read(tmp_path, logged, columns={"t": "clock", "q": "simout", "qd": "rates"})
    assert motion == Trajectory.from_samples(ARM, T, Q, QD)


def test_names_may_be_exchanged(tmp_path):
    motion = read(
        tmp_path, {"t": T, "q1": Q[:, 1], "q2": Q[:, 0]}, columns={"q1": "q2", "q2": "q1"}
    )
    assert motion == Trajectory.from_samples(ARM, T, Q)


def test_degrees_are_those_of_angles_alone(tmp_path):
    q = np.tile([90.0, 0.0, 0.1, 180.0], (3, 1))
    motion = read(tmp_path, {"t": [0, 1, 2], "q": q}, COBRA, degrees=True)
    assert motion.q(0.0) == pytest.approx([np.pi / 2, 0, 0.1, np.pi])


@pytest.mark.parametrize("q", [T[:, None], T[None], np.column_stack([T, T])])
def test_one_joint_is_a_column_or_a_row(q, tmp_path):
    arm = from_dh([(0, 0.3, 0.1, "pi/7")])
    assert read(tmp_path, {"t": T, "q": q}, arm) == Trajectory.from_samples(arm, T, T[:, None])


BAD = {
    "no times": ({"q": Q}, r"no times: found q; expected a vector t or time"),
    "no joint values": ({"t": T, "x": Q}, r"no joint values: found t, x; expected q or q1 ..."),
    "nothing": ({}, r"no times: found nothing"),
    "one joint of two": ({"t": T, "q1": Q[:, 0]}, r"no column q2 or elbow: found t, q1"),
    "rates of one joint": ({"t": T, "q": Q, "qd1": QD[:, 0]}, r"no column qd2 or elbow_velocity"),
    "rates alone": ({"t": T, "qd": QD}, r"no column q1 or shoulder"),
    "rows and columns exchanged": (
        {"t": T, "q": Q.T},
        r"q has shape \(2, 4\); expected \(N, 2\), .*; q' in MATLAB has",
    ),
    "another arm": ({"t": T, "q": np.zeros((4, 6))}, r"q has shape \(4, 6\); expected \(N, 2\)"),
    "three axes": (
        {"t": T, "q": np.zeros((2, 1, 4))},
        r"q has shape \(2, 1, 4\); expected \(N, 2\)",
    ),
    "fewer samples than times": (
        {"t": T, "q": Q[:3]},
        r"q1 has 3 values; expected 4, one for each time",
    ),
    "a vector of another length": ({"t": T, "q1": T, "q2": T[:2]}, r"q2 has 2 values; expected 4"),
    "a matrix of times": ({"t": Q, "q": Q}, r"t has shape \(4, 2\); expected a vector"),
    "other times in a matrix": ({"t": T + 1, "q": timed(Q)}, r"q has times that are not those"),
    "one sample": (
        {"t": T[:1], "q": Q[:1]},
        r"times has shape \(1,\); expected \(N,\) with N >= 2",
    ),
    "times that do not increase": (
        {"t": T[::-1], "q": Q},
        r"times do not increase: times\[0\] is 7 s",
    ),
    "NaN": (
        {"t": T, "q": np.where(Q[2, 1] == Q, np.nan, Q)},
        r"q has values that are not finite, the first in row 2",
    ),
    "an infinite time": ({"t": [0, 1, 2, np.inf], "q": Q}, r"times\[3\] is not finite"),
    "text": ({"t": T, "q": "see appendix"}, r"q: found text; expected numbers"),
    "complex numbers": ({"t": T, "q": Q + 1j}, rf"q: found a complex matrix; {EXPORT}"),
    "a cell": ({"t": T, "q": np.array([1, "a"], dtype=object)}, rf"q: found a cell; {EXPORT}"),
    "a structure without signals": (
        {"q": {"time": T, "values": Q}},
        rf"q: found a struct; {EXPORT}",
    ),
    "a structure of another name": (
        {"out": {"q": Q}},
        rf"no times: found out \(struct\); .*; {EXPORT}",
    ),
    "empty": ({"t": np.zeros((0, 0)), "q": np.zeros((0, 2))}, r"times has shape \(0,\)"),
}


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("name", BAD)
def test_what_is_wrong_is_named(name, packed, tmp_path):
    values, complaint = BAD[name]
    savemat(tmp_path / "log.mat", values, do_compression=packed)
    check_refused(lambda file: Trajectory.read(file, ARM), tmp_path / "log.mat", complaint)


def test_sparse_matrices_are_refused(tmp_path):
    from scipy.sparse import csc_array

    with pytest.raises(DescriptionError, match=rf"q: found a sparse matrix; {EXPORT}"):
        read(tmp_path, {"t": T, "q": csc_array(Q)})


@pytest.mark.parametrize(
    ("columns", "complaint"),
    [
        ({"q": "simout"}, r"no variable 'simout': found t, q, QA, qa"),
        ({"q": "Qa"}, r"no variable 'Qa': found"),
        ({"q": "note"}, r"note: found text; expected numbers"),
        ({"t": "q"}, r"q has shape \(4, 2\); expected a vector"),
    ],
)
def test_names_of_the_file_that_are_not_there_are_named(columns, complaint, tmp_path):
    with pytest.raises(DescriptionError, match=complaint):
        read(tmp_path, {"t": T, "q": Q, "QA": Q, "qa": Q, "note": "x"}, columns=columns)


@pytest.mark.parametrize(
    ("columns", "error", "complaint"),
    [
        (
            {"q3": "a"},
            ValueError,
            r"columns: found 'q3'; expected each at most once of t, q, qd, qdd, q1 ... q2",
        ),
        ({"wrist": "a"}, ValueError, r"columns: found 'wrist'; expected .*, shoulder, elbow"),
        (
            {"q1": "a", "shoulder": "b"},
            ValueError,
            r"columns: found 'shoulder'; expected each at most once",
        ),
        (
            {"q1": 1},
            TypeError,
            r"columns is .*; expected a mapping of our names to those of the file",
        ),
        (["q1"], TypeError, r"columns is .*; expected a mapping"),
        ("t", TypeError, r"columns is 't'; expected a mapping"),
    ],
)
def test_our_names_that_do_not_exist_are_named(columns, error, complaint, tmp_path):
    with pytest.raises(error, match=complaint):
        read(tmp_path, {"t": T, "q": Q}, columns=columns)


# What SciPy does not write


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def opaque(name, kind):
    """Return a variable of a class written in MATLAB, as MATLAB lays it out; its content lies elsewhere."""
    flags = element(6, struct.pack("<II", 17, 0))
    texts = b"".join(element(1, text.encode()) for text in (name, "MCOS", kind))
    content = element(
        14,
        element(6, struct.pack("<II", 13, 0))
        + element(5, struct.pack("<ii", 1, 1))
        + element(1, b""),
    )
    return element(14, flags + texts + content)


def with_opaque(folder, values, name, kind):
    path = folder / "log.mat"
    savemat(path, values)
    path.write_bytes(path.read_bytes() + opaque(name, kind))
    return path


@pytest.mark.parametrize(
    ("values", "name"), [({"t": T}, "q"), ({"q": Q}, "t"), ({"t": T, "q1": T}, "q2")]
)
def test_a_timeseries_is_refused_with_what_to_do(values, name, tmp_path):
    path = with_opaque(tmp_path, values, name, "timeseries")
    check_refused(
        lambda file: Trajectory.read(file, ARM), path, rf"{name}: found a timeseries; {EXPORT}"
    )


def test_a_name_of_several_lines_is_shown_in_one(tmp_path):
    path = with_opaque(tmp_path, {}, "one\ntwo", "three\nfour")
    with pytest.raises(DescriptionError, match=r"found one\\ntwo \(three\\nfour\)"):
        Trajectory.read(path, ARM)


def test_objects_of_other_names_are_named_where_nothing_else_is_there(tmp_path):
    path = with_opaque(tmp_path, {}, "out", "Simulink.SimulationOutput")
    with pytest.raises(
        DescriptionError, match=rf"found out \(Simulink.SimulationOutput\); .*; {EXPORT}"
    ):
        Trajectory.read(path, ARM)
    path = with_opaque(tmp_path, {"t": T, "q": Q}, "out", "Simulink.SimulationOutput")
    assert Trajectory.read(path, ARM) == Trajectory.from_samples(ARM, T, Q)


HDF5 = b"\x89HDF\r\n\x1a\n"


@pytest.mark.parametrize(
    "content",
    [
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124)
        + b"\x00\x02IM"
        + bytes(384)
        + HDF5
        + bytes(100),
        b"MATLAB 7.3 MAT-file",
        bytes(512) + HDF5,
        HDF5 + bytes(600),
    ],
)
def test_format_7_3_is_refused_with_what_to_do(content, tmp_path):
    path = tmp_path / "log.mat"
    path.write_bytes(content)
    complaint = rf"format 7.3 \(HDF5\), which is not read; {EXPORT}"
    check_refused(lambda file: Trajectory.read(file, ARM), path, complaint)


@pytest.mark.parametrize("content", [b"", b"MATLAB 5.0 MAT-file", bytes(200), b"t,q1,q2\n0,1,2\n"])
def test_what_is_no_mat_file_is_named(content, tmp_path):
    path = tmp_path / "log.mat"
    path.write_bytes(content)
    with pytest.raises(DescriptionError, match=r"no .mat file of format 5"):
        Trajectory.read(path, ARM)


@pytest.mark.parametrize("packed", [False, True])
@given(data=st.data())
def test_no_damaged_byte_leads_anywhere_else(data, packed, tmp_path_factory):
    path = tmp_path_factory.mktemp("damaged") / "log.mat"
    savemat(path, {"t": T, "q": Q, "gains": {"kp": 1.0}, "note": "x"}, do_compression=packed)
    path.write_bytes(path.read_bytes() + opaque("out", "timeseries"))
    check_damaged(data.draw, lambda file: Trajectory.read(file, ARM), path)


# Structures of Simulink


def structure(values, labels=("",), times=T):
    """What "To Workspace" writes as a structure, with time unless ``times`` is empty."""
    signals = np.zeros(
        (1, len(labels)), dtype=[(name, object) for name in ("values", "dimensions", "label")]
    )
    for k, label in enumerate(labels):
        each = values[k] if len(labels) > 1 else values
        signals[0, k] = (each, float(np.shape(each)[1]), label)
    return {"time": np.reshape(times, (-1, 1)), "signals": signals, "blockName": "arm/To Workspace"}


SHAPES = {
    "array and tout": {"tout": T, "yout": Q},
    "structure with time": {"q": structure(Q)},
    "structure with time, of any name": {"simout": structure(Q)},
    "structure without time": {"tout": T, "q": structure(Q, times=[])},
    "structure with a label": {"ScopeData": structure(Q, ("q",))},
    "structure with labels of joints": {"ScopeData": structure([Q[:, :1], Q[:, 1:]], ("q1", "q2"))},
    "values with time last": {"q": structure(Q.T[:, None, :])},
}


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_of_simulink_are_read(name, tmp_path):
    assert read(tmp_path, SHAPES[name]) == Trajectory.from_samples(ARM, T, Q)


def test_rates_of_a_structure_are_used(tmp_path):
    values = {"ScopeData": structure([Q, QD], ("q", "qd"))}
    assert read(tmp_path, values) == Trajectory.from_samples(ARM, T, Q, QD)


def test_structures_of_other_times_are_refused(tmp_path):
    savemat(tmp_path / "log.mat", {"q": structure(Q), "qd": structure(QD, times=T + 1)})
    with pytest.raises(DescriptionError, match="qd has times"):
        Trajectory.read(tmp_path / "log.mat", ARM)


def test_columns_of_a_matrix_are_chosen(tmp_path):
    values = {"log": np.column_stack([T, Q, QD])}
    savemat(tmp_path / "log.mat", values)
    content = (tmp_path / "log.mat").read_bytes()
    choices = matlab_choices(ARM, content, 10**6)
    assert choices == {"t": ["log(:,1)"], "q": ["log(:,2:3)", "log(:,4:5)"]}
    columns = {"t": "log(:,1)", "q": "log(:,2:3)", "qd": "log(:,4:5)"}
    assert read(tmp_path, values, columns=columns) == Trajectory.from_samples(ARM, T, Q, QD)
    for wrong in ("log(:,5:9)", "log(:,0:1)", "log(:,3:2)"):
        with pytest.raises(DescriptionError, match=r"log has shape"):
            read(tmp_path, values, columns=columns | {"q": wrong})


@pytest.mark.parametrize("name", SHAPES)
def test_each_choice_can_be_read(name, tmp_path):
    savemat(tmp_path / "log.mat", SHAPES[name])
    choices = matlab_choices(ARM, (tmp_path / "log.mat").read_bytes(), 10**6)
    if name == "structure with labels of joints":
        assert choices["q"] == []  # each joint has a signal of its own
        return
    columns = {"t": choices["t"][0], "q": choices["q"][0]}
    assert read(tmp_path, SHAPES[name], columns=columns) == Trajectory.from_samples(ARM, T, Q)


@pytest.mark.parametrize("other", [np.eye(4), 0.01, T * 5 + 3])
def test_a_capital_T_is_not_the_time(other, tmp_path):
    assert read(tmp_path, {"T": other, "time": T, "q": Q}) == Trajectory.from_samples(ARM, T, Q)
