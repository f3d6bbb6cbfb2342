"""MATLAB's files of format 5: what SciPy writes is read to the bit, and damaged files are refused in a line."""

import contextlib
import io

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.io import savemat
from scipy.sparse import csc_matrix

from dhkit.description.bounds import BOUNDS
from dhkit.description.mat_files import read_mat
from dhkit.errors import DescriptionError

MOST = 1_000_000
RECORDS = np.array([[(1.0, "a"), (2.0, "b")]], dtype=[("x", object), ("y", object)])


def saved(packed=False, **values):
    file = io.BytesIO()
    savemat(file, values, do_compression=packed)
    return file.getvalue()


def read(content):
    return read_mat(content, MOST, advice="save it anew")


WHOLE = {
    "t": np.linspace(0, 1, 5),
    "q": np.random.default_rng(0).normal(size=(4, 3)),
    "i": np.arange(6, dtype=np.int16).reshape(2, 3),
    "note": "äöü",
    "s": {"V": np.eye(3), "inner": {"deep": 1.0}},
    "many": RECORDS,
}


@pytest.mark.parametrize("packed", [False, True])
def test_what_scipy_writes_is_read_to_the_bit(packed):
    found = read(saved(packed, **WHOLE))
    assert list(found) == list(WHOLE)
    for name in ("t", "q", "i"):
        assert found[name].readable
        np.testing.assert_array_equal(found[name].value, np.atleast_2d(WHOLE[name]))
    assert found["note"].value == "äöü"


def test_structs_are_records_of_named_variables():
    found = read(saved(**WHOLE))
    (record,) = found["s"].value
    assert not found["s"].readable
    np.testing.assert_array_equal(record["V"].value, np.eye(3))
    assert record["V"].name == "s.V"
    assert record["inner"].value[0]["deep"].value == 1.0
    assert [(record["x"].value.item(), record["y"].value) for record in found["many"].value] == [
        (1.0, "a"),
        (2.0, "b"),
    ]


@pytest.mark.parametrize(
    ("value", "kind"),
    [
        (1j * np.eye(2), "complex matrix"),
        (csc_matrix(np.eye(2)), "sparse matrix"),
        ([1, "a"], "cell"),
    ],
)
def test_what_is_not_read_says_what_it_is(value, kind):
    variable = read(saved(x=np.array(value, dtype=object) if kind == "cell" else value))["x"]
    assert variable.kind == kind
    with pytest.raises(DescriptionError, match=f"x: found a {kind}; expected"):
        _ = variable.value


def test_depth_is_bounded():
    value = {"x": 1.0}
    for _ in range(BOUNDS.mat_nesting):
        value = {"x": value}
    with pytest.raises(DescriptionError, match="nested too deep"):
        read_all(read(saved(s=value)).values())


def read_all(variables):
    for variable in variables:
        if variable.parts and isinstance(value := variable.value, tuple):
            read_all(field for record in value for field in record.values())


@pytest.mark.parametrize("packed", [False, True])
@given(data=st.data())
def test_no_damaged_byte_leads_anywhere_else(data, packed):
    content = bytearray(saved(packed, **WHOLE))
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    end = data.draw(st.integers(0, len(content)))
    for changed in (bytes(content), bytes(content[:end])):
        with contextlib.suppress(DescriptionError):
            read_all(read(changed).values())
