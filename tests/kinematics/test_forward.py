"""Batches of frames: one rule of shapes, NaN rows, out=, threads=; and published poses."""

import numpy as np
import pytest
from hypothesis import given

from dhkit.description import library_robot, link_transforms
from dhkit.kernels.kernel import MIN_ITEMS_PER_THREAD
from dhkit.kinematics import forward_kinematics, frames, jacobian, jacobian_dot
from random_arms import states, tables

FUNCTIONS = (forward_kinematics, frames, jacobian)


@given(tables())
def test_frames_are_rigid_and_their_product_is_the_tool(arm):
    q = states(arm, 4)
    T = frames(arm, q)
    R = T[..., :3, :3]
    assert np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max() < 1e-14
    A = link_transforms(arm, q)
    assert np.allclose(T[:, :-1] @ A, T[:, 1:], rtol=0, atol=1e-14)
    assert np.allclose(
        T[:, -1] @ arm.numbers.T_last_tool, forward_kinematics(arm, q), rtol=0, atol=1e-14
    )


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("name", ["puma560", "panda", "stanford"])
def test_a_batch_is_its_elements(function, name):
    arm = library_robot(name)
    q = states(arm, 12).reshape(3, 4, arm.n)
    batch = function(arm, q)
    assert batch.shape[:2] == (3, 4)
    # Vector registers fuse products into sums, what is left over of a block may not: a rounding or two.
    assert np.abs(batch[1, 2] - function(arm, q[1, 2])).max() < 1e-15
    assert function(arm, q[:0]).shape == (0, *batch.shape[1:])
    rates = np.ones(arm.n)
    assert jacobian_dot(arm, q, rates).shape == (3, 4, 6, arm.n)
    assert jacobian_dot(arm, q[0, 0], np.stack([rates, 2 * rates])).shape == (2, 6, arm.n)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_large_batches_on_threads_and_into_arrays_of_the_caller(function):
    arm = library_robot("puma560")
    q = states(arm, 2 * MIN_ITEMS_PER_THREAD + 7)
    expected = function(arm, q)
    out = np.full_like(expected, 7.0)
    assert function(arm, q, out=out, threads=3) is out
    assert np.abs(out - expected).max() < 1e-15


@pytest.mark.parametrize("function", FUNCTIONS)
def test_arrays_of_any_layout_are_read_and_never_written(function):
    arm = library_robot("puma560")
    q = states(arm, 10)
    expected = function(arm, q)
    frozen = q.copy()
    frozen.flags.writeable = False
    for layout in (
        frozen,
        np.asfortranarray(q),
        np.repeat(q, 2, axis=1)[:, ::2],
        q.tolist(),
        q.astype(np.float32),
    ):
        assert np.abs(function(arm, layout) - expected).max() < 1e-6
    assert function(arm, arm.numbers.configurations["ready"]).shape == expected.shape[1:]
    assert function(arm, np.zeros(6, dtype=int)).shape == expected.shape[1:]


@pytest.mark.parametrize("function", FUNCTIONS)
def test_nan_in_gives_nan_out_of_that_row_and_no_other(function):
    arm = library_robot("stanford")
    q = states(arm, 5)
    expected = function(arm, q)
    for missing in (np.nan, np.inf):
        q[2, 3] = missing
        result = function(arm, q)
        assert np.isnan(result[2]).all()
        assert np.array_equal(np.delete(result, 2, axis=0), np.delete(expected, 2, axis=0))
    assert np.isnan(function(arm, np.full(6, np.nan))).all()


@pytest.mark.parametrize(
    ("call", "error", "complaint"),
    [
        (
            lambda arm: forward_kinematics(arm, np.zeros(5)),
            ValueError,
            r"q has shape \(5,\); expected \(\.\.\., 6\)",
        ),
        (lambda arm: forward_kinematics(arm, 1.0), ValueError, r"q has shape \(\)"),
        (lambda arm: forward_kinematics(arm, "raedy"), ValueError, "no configuration 'raedy'"),
        (lambda arm: forward_kinematics(arm, [[1, 2], [3]]), TypeError, "expected numbers"),
        (lambda arm: forward_kinematics(arm, ["1"] * 6), ValueError, "no configuration '1'"),
        (lambda arm: forward_kinematics(arm, np.zeros(6) + 1j), TypeError, "expected numbers"),
        (lambda arm: forward_kinematics(arm, [None] * 6), TypeError, "expected numbers"),
        (lambda arm: forward_kinematics(arm, np.zeros(6), out=[1]), ValueError, "out is list"),
        (
            lambda arm: jacobian(arm, np.zeros(6), frame="base"),
            ValueError,
            "expected 'world' or 'tool'",
        ),
        (lambda arm: jacobian_dot(arm, np.zeros(6), np.zeros(5)), ValueError, "qd has shape"),
        (
            lambda arm: forward_kinematics(arm, np.zeros(6), out=np.zeros((3, 3))),
            ValueError,
            r"expected \(4, 4\)",
        ),
        (
            lambda arm: forward_kinematics(arm, np.zeros(6), out=np.zeros((4, 4), np.float32)),
            ValueError,
            "float64",
        ),
        (lambda arm: forward_kinematics(arm, np.zeros(6), threads=0), ValueError, "threads is 0"),
    ],
)
def test_arguments_of_the_wrong_shape_or_type_are_said(call, error, complaint):
    with pytest.raises(error, match=complaint):
        call(library_robot("puma560"))


def test_corkes_published_poses():
    """Robotics Toolbox: the PUMA's wrist at qz and qr, with the waist's height 0.67183 m added."""
    arm = library_robot("puma560")
    zero, ready = arm.numbers.configurations["zero"], arm.numbers.configurations["ready"]
    assert np.allclose(
        forward_kinematics(arm, zero)[:3, 3], [0.4521, -0.15005, 0.4318 + 0.67183], atol=1e-15
    )
    assert np.allclose(
        forward_kinematics(arm, ready)[:3, 3], [0.0203, -0.15005, 0.8636 + 0.67183], atol=1e-15
    )


def test_the_pandas_published_ready_pose():
    """Franka's documented ready configuration holds the flange upright in front of the arm, pointing down."""
    arm = library_robot("panda")
    T = forward_kinematics(arm, [0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4])
    assert np.allclose(T[:3, 2], [0, 0, -1], atol=1e-12)
    assert np.allclose(T[:3, 3], [0.3069, 0, 0.59], atol=2e-3)
