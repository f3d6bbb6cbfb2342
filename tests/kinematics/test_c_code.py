"""The C code compiles without a warning and computes what dhkit computes."""

import ctypes
import subprocess

import numpy as np
import pytest

from acceptance import slow_if
from conftest import require
from dhkit import Arm
from dhkit.kinematics.solutions import IKFlag, IKStatus
from random_arms import states

STRICT = ["-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror", "-shared", "-fPIC"]


def compiled(arm, folder):
    gcc = require("gcc", "the compiler of Debian's gcc")
    source, header = arm.export_c(folder)
    library = folder / f"{arm.name}.so"
    subprocess.run([gcc, *STRICT, str(source), "-o", str(library), "-lm"], check=True)
    probe = folder / "probe.cpp"
    probe.write_text(f'#include "{header.name}"\nint main() {{ return 0; }}\n')
    subprocess.run([gcc, "-x", "c++", "-fsyntax-only", str(probe)], check=True)
    return ctypes.CDLL(str(library))


def call(function, *arrays):
    function(*(array.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for array in arrays))


ARMS = ["puma560", "cobra600", "panda", "ur5", "stanford", "al5d"]


@pytest.mark.parametrize("name", [slow_if(k > 2, name) for k, name in enumerate(ARMS)])
def test_c_computes_the_same(name, tmp_path):
    arm = Arm.load(name)
    library = compiled(arm, tmp_path)
    for q in states(arm.description, 20):
        T, J = np.empty((4, 4)), np.empty((6, arm.n))
        call(library[f"{name}_forward_kinematics"], q, T)
        call(library[f"{name}_jacobian"], q, J)
        assert np.abs(T - arm.fk(q)).max() < 1e-14
        assert np.abs(J - arm.jacobian(q)).max() < 1e-14
        if name != "panda":
            ours = arm.ik(T)
            B = len(ours)
            found, distance, valid, flags, status = (
                np.empty((B, arm.n)),
                *(np.empty(k) for k in (1, B, B, 1)),
            )
            call(
                library[f"{name}_inverse_kinematics"],
                T,
                np.zeros(2),
                found,
                distance,
                valid,
                flags,
                status,
            )
            assert np.array_equal(valid.astype(bool), ours.valid)
            assert np.array_equal(flags, ours.flags)
            assert np.nanmax(np.abs(np.angle(np.exp(1j * (found - ours.q))))) < 1e-9


def test_the_header_explains_flags_and_status(tmp_path):
    """The numbers are those of IKFlag and IKStatus, all that a closed form returns."""
    _, header = Arm.load("puma560").export_c(tmp_path)
    text = header.read_text()
    assert " *    1 singular: reached, and a branch is at a singularity: see flags\n" in text
    for number in (
        IKFlag.shoulder,
        IKFlag.elbow,
        IKFlag.wrist,
        IKFlag.clamped,
        IKFlag.out_of_limits,
    ):
        assert f" *   {number.value:2} {number.name}: " in text
    for status in IKStatus:
        explained = f" *   {status.value:2} {status.name}: " in text
        assert explained == (status is not IKStatus.not_found)
    assert "the second that of joint 4 where two axes of the wrist" in text


def test_a_name_that_is_no_identifier_is_refused(tmp_path):
    with pytest.raises(ValueError, match="identifier of C"):
        Arm.load("puma560").export_c(tmp_path, "../escape")
    with pytest.raises(ValueError, match="identifier of C"):
        Arm.load("puma560").export_c(tmp_path, "two words")
