"""Laws of manipulability: published formulas, agreement with the singular values, and ellipsoids that fit J."""

import pickle

import numpy as np
import pytest

from dhkit.description import from_dh, library_robot
from dhkit.kinematics import forward_kinematics, jacobian
from dhkit.kinematics.manipulability import (
    condition_number,
    force_ellipsoid,
    freedoms,
    isotropy,
    manipulability,
    singular_values,
    velocity_ellipsoid,
)
from random_arms import states

ROUNDING = 1e-14  # of products of lengths up to 2 m
ON_SURFACE = 1e-10  # of u^T (J J^T)^-1 u, which squares a condition number of up to some 100
ARMS = [
    "puma560",
    "planar2r",
    "planar3r",
    "stanford",
    "cobra600",
    "panda",
    "cart_pendulum",
    "pan_tilt",
    "polar_rp",
]


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("motion", ["translational", "rotational", "whole"])
def test_it_is_the_product_of_as_many_singular_values_as_there_are_freedoms(name, motion):
    arm = library_robot(name)
    q = states(arm, 50)
    rank = freedoms(arm, motion)
    sigma = singular_values(arm, q, motion)
    assert np.allclose(
        manipulability(arm, q, motion), np.prod(sigma[:, :rank], axis=1), rtol=0, atol=ROUNDING
    )
    assert sigma[:, rank:].max(initial=0.0) < ROUNDING


def test_that_of_a_planar_arm_is_published():
    """Yoshikawa 1985, eq. 15: l1 l2 abs(sin q2), greatest at a right angle whatever the lengths."""
    arm = library_robot("planar2r")
    l1, l2 = arm.numbers.a
    q = states(arm, 100)
    assert np.allclose(
        manipulability(arm, q), l1 * l2 * np.abs(np.sin(q[:, 1])), rtol=0, atol=ROUNDING
    )


def test_that_of_a_wrist_is_published():
    """A spherical wrist turns as well as the sine of its middle joint says (Yoshikawa 1985, section 5.4)."""
    wrist = from_dh([(0, 0, 0, "pi/2"), (0, 0, 0, "-pi/2"), (0, 0, 0, 0)])
    q = states(wrist, 50)
    assert np.allclose(
        manipulability(wrist, q, "rotational"), np.abs(np.sin(q[:, 1])), rtol=0, atol=ROUNDING
    )
    assert freedoms(wrist) == 0
    assert np.array_equal(manipulability(wrist, q), np.zeros(50))


def test_that_of_a_cartesian_arm_is_one_everywhere():
    gantry = from_dh([(0, 0, 0, "pi/2"), ("pi/2", 0, 0, "pi/2"), (0, 0, 0, 0)], kinds="PPP")
    q = states(gantry, 20)
    assert np.allclose(manipulability(gantry, q), 1, rtol=0, atol=ROUNDING)
    assert np.allclose(isotropy(gantry, q), 1, rtol=0, atol=ROUNDING)
    assert freedoms(gantry, "rotational") == 0
    assert np.array_equal(isotropy(gantry, q, "rotational"), np.zeros(20))


def test_no_digits_are_lost_near_a_singularity():
    arm = library_robot("planar2r")
    l1, l2 = arm.numbers.a
    for off in (1e-4, 1e-8, 1e-12):
        assert manipulability(arm, [0.3, off]) == pytest.approx(l1 * l2 * off, rel=1e-3, abs=1e-16)


def test_a_stretched_arm_is_singular_and_an_isotropic_one_is_not():
    """Salisbury and Craig 1982: l1 = sqrt(2) l2 and q2 = 135 degrees make a planar arm isotropic."""
    arm = from_dh([(0, 0, np.sqrt(2), 0), (0, 0, 1, 0)])
    assert isotropy(arm, [0.4, 3 * np.pi / 4]) == pytest.approx(1, abs=1e-12)
    assert condition_number(arm, [0.4, 3 * np.pi / 4]) == pytest.approx(1, abs=1e-12)
    assert isotropy(arm, [0.4, 0.0]) == 0
    assert condition_number(arm, [0.4, 0.0]) == np.inf


@pytest.mark.parametrize("name", ["puma560", "stanford", "panda", "cobra600"])
@pytest.mark.parametrize("shape", [(), (5,), (2, 3)])
def test_the_ellipsoids_fit_the_jacobian(name, shape):
    arm = library_robot(name)
    q = states(arm, int(np.prod(shape))).reshape(*shape, arm.n)
    J = jacobian(arm, q)[..., :3, :]
    velocity, force = velocity_ellipsoid(arm, q), force_ellipsoid(arm, q)
    gram = J @ np.swapaxes(J, -1, -2)
    for ellipsoid, inner in ((velocity, np.linalg.inv(gram)), (force, gram)):
        assert ellipsoid.lengths.shape == (*shape, 3)
        assert np.array_equal(ellipsoid.center, forward_kinematics(arm, q)[..., :3, 3])
        assert np.allclose(np.linalg.det(ellipsoid.axes), 1, rtol=0, atol=ROUNDING)
        assert np.all(np.diff(ellipsoid.lengths, axis=-1) <= 0)
        for u in np.random.default_rng(1).normal(size=(10, 3)):
            v = (ellipsoid.axes @ (ellipsoid.lengths * u / np.linalg.norm(u))[..., None])[..., 0]
            assert np.allclose(
                np.einsum("...i,...ij,...j", v, inner, v), 1, rtol=0, atol=ON_SURFACE
            )
    assert np.allclose(velocity.lengths, 1 / force.lengths[..., ::-1])
    assert np.allclose(velocity.lengths.prod(-1), manipulability(arm, q), rtol=0, atol=ROUNDING)


def test_joint_rates_of_unit_norm_stay_in_the_velocity_ellipsoid():
    arm = library_robot("panda")
    q = states(arm, 1)[0]
    rates = np.random.default_rng(0).normal(size=(500, arm.n))
    v = rates / np.linalg.norm(rates, axis=1, keepdims=True) @ jacobian(arm, q)[:3].T
    ellipsoid = velocity_ellipsoid(arm, q)
    assert np.linalg.norm(v @ ellipsoid.axes / ellipsoid.lengths, axis=1).max() <= 1 + ROUNDING


def test_an_arm_in_a_plane_has_a_flat_ellipsoid_and_holds_any_force_across():
    arm = library_robot("planar3r")
    q = states(arm, 4)
    assert np.array_equal(velocity_ellipsoid(arm, q).lengths[:, 2], np.zeros(4))
    assert np.allclose(
        np.abs(velocity_ellipsoid(arm, q).axes[:, :, 2]), (0, 0, 1), rtol=0, atol=ROUNDING
    )
    assert np.array_equal(force_ellipsoid(arm, q).lengths[:, 0], np.full(4, np.inf))


def test_a_single_joint_moves_its_tool_along_a_line():
    arm = from_dh([(0, 0, 0.7, 0)])
    ellipsoid = velocity_ellipsoid(arm, [0.0])
    assert freedoms(arm) == 1
    assert manipulability(arm, [0.2]) == pytest.approx(0.7)
    assert isotropy(arm, [0.2]) == 1
    assert ellipsoid.lengths == pytest.approx([0.7, 0, 0])
    assert np.abs(ellipsoid.axes[:, 0]) == pytest.approx([0, 1, 0])


@pytest.mark.parametrize("motion", ["translational", "rotational", "whole"])
def test_nan_in_gives_nan_out_of_that_row_and_no_other(motion):
    arm = library_robot("stanford")
    q = states(arm, 5)
    broken = q.copy()
    broken[2, 3] = np.nan
    rest = [0, 1, 3, 4]
    for measure in (manipulability, isotropy, condition_number, singular_values):
        result = measure(arm, broken, motion)
        assert np.isnan(result[2]).all()
        assert np.array_equal(result[rest], measure(arm, q, motion)[rest])
    assert np.isnan(manipulability(arm, broken[2], motion))
    if motion != "whole":
        ellipsoid = velocity_ellipsoid(arm, broken, motion)
        for key, array in vars(ellipsoid).items():
            assert np.isnan(array[2]).all()
            assert np.array_equal(
                array[rest], getattr(velocity_ellipsoid(arm, q, motion), key)[rest]
            )


def test_batches_keep_their_shape_and_ellipsoids_travel():
    arm = library_robot("planar2r")
    q = states(arm, 6).reshape(2, 3, 2)
    assert manipulability(arm, q).shape == isotropy(arm, q).shape == (2, 3)
    assert manipulability(arm, q[:0]).shape == (0, 3)
    assert np.ndim(manipulability(arm, q[0, 0])) == 0
    ellipsoid = velocity_ellipsoid(arm, q)
    back = pickle.loads(pickle.dumps(ellipsoid))
    assert all(
        np.array_equal(a, b)
        for a, b in zip(vars(ellipsoid).values(), vars(back).values(), strict=True)
    )


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda arm: manipulability(arm, np.zeros(5)), r"q has shape \(5,\)"),
        (
            lambda arm: manipulability(arm, np.zeros(6), "linear"),
            "motion is 'linear'; expected 'translational'",
        ),
        (
            lambda arm: velocity_ellipsoid(arm, np.zeros(6), "whole"),
            "motion is 'whole'; expected 'translational' or",
        ),
        (lambda arm: isotropy(arm, np.zeros((2, 7))), r"q has shape \(2, 7\)"),
    ],
)
def test_wrong_arguments_are_named(call, complaint):
    with pytest.raises(ValueError, match=complaint):
        call(library_robot("puma560"))
