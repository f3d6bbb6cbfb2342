"""Laws of trajectories: exact derivatives, what holds at breaks and ends, and motions made from motions."""

import pickle

import numpy as np
import pytest
from hypothesis import given, strategies as st

from dhkit.description import library_robot, with_payload
from dhkit.errors import DescriptionError
from dhkit.trajectories import Trajectory
from dhkit.trajectories.pieces import Pieces
from trajectories_reference import random_motion, reference_torques

ARM, PUMA = library_robot("planar2r"), library_robot("puma560")
STEP = 1e-5
NUMERIC = 1e-7  # central differences with that step, and rounding over it
ROUNDING = 1e-12
TORQUES = 1e-12  # of the largest


@given(st.integers(0, 1000), st.integers(1, 6), st.integers(0, 9))
def test_derivatives_are_those_of_differences(seed, pieces, degree):
    motion = random_motion(ARM, pieces, degree, seed)
    # Between breaks, so that differences see one polynomial.
    t = (motion.breaks[:-1] + motion.breaks[1:]) / 2
    for low, high in ((motion.q, motion.qd), (motion.qd, motion.qdd), (motion.qdd, motion.jerk)):
        difference = (low(t + STEP) - low(t - STEP)) / (2 * STEP)
        assert np.abs(difference - high(t)).max() <= NUMERIC * max(1.0, np.abs(high(t)).max() * 100)


@given(st.integers(0, 1000))
def test_a_side_decides_at_a_break_and_the_inner_one_counts_at_the_ends(seed):
    motion = random_motion(ARM, 3, 4, seed)
    inside = motion.breaks[1:-1]
    width = np.diff(motion.breaks)[:, None]
    ends = sum(motion.coefficients[:, j] * width**j for j in range(5))
    assert np.array_equal(motion.q(inside), motion.coefficients[1:, 0])
    assert np.abs(motion.q(inside, side="left") - ends[:-1]).max() < ROUNDING
    for side in ("left", "right"):
        assert np.array_equal(motion.qd(0.0, side), motion.coefficients[0, 1])
        assert np.abs(motion.q(motion.duration, side) - ends[-1]).max() < ROUNDING


def test_outside_the_arm_stands_still():
    motion = random_motion(ARM)
    assert np.array_equal(motion.q([-1.0, 99.0]), motion.q([0.0, motion.duration]))
    for derivative in (motion.qd, motion.qdd, motion.jerk):
        assert not derivative([-1e-12, motion.duration + 1e-12]).any()
        assert derivative([0.0, motion.duration]).all()


def test_shapes_follow_times_and_nan_stays_in_its_row():
    motion = random_motion(PUMA)
    assert motion.q(0.5).shape == (6,)
    assert motion.qdd(np.zeros((2, 3))).shape == (2, 3, 6)
    for function in (motion.q, motion.qd, motion.qdd, motion.jerk, motion.tau):
        values = function([0.3, np.nan, 0.5])
        assert np.isnan(values[1]).all()
        assert np.isfinite(values[[0, 2]]).all()
    still = Trajectory(ARM, [0, 1], np.ones((1, 1, 2)))
    assert np.isnan(still.qd([np.nan])).all()
    assert not still.qd(0.5).any()


@pytest.mark.parametrize("name", ["puma560", "stanford", "panda"])
def test_torques_are_pinocchios(name):
    arm = library_robot(name)
    motion = random_motion(arm)
    t = np.linspace(0, motion.duration, 200)
    expected = reference_torques(arm)(motion.q(t), motion.qd(t), motion.qdd(t))
    assert np.abs(motion.tau(t) - expected).max() < TORQUES * np.abs(expected).max()
    samples = motion.sample(n=200)
    assert np.array_equal(samples.tau, motion.tau(samples.times))


def test_friction_is_added_on_request():
    motion = random_motion(PUMA)
    numbers = PUMA.numbers
    qd = motion.qd(0.7)
    coulomb = np.where(qd > 0, numbers.coulomb[:, 0], numbers.coulomb[:, 1])
    assert np.allclose(
        motion.tau(0.7, friction=True) - motion.tau(0.7), numbers.viscous * qd + coulomb
    )


@given(st.floats(0.05, 20), st.integers(0, 100))
def test_slowing_scales_derivatives(c, seed):
    motion = random_motion(ARM, seed=seed)
    slow, t = motion.slowed(c), np.linspace(0.01, motion.duration - 0.01, 30)
    scale = np.abs(motion.qdd(t)).max()
    assert slow.duration == pytest.approx(c * motion.duration)
    assert np.abs(slow.q(c * t) - motion.q(t)).max() < 1e-9
    assert np.abs(slow.qd(c * t) * c - motion.qd(t)).max() < 1e-9 * scale
    assert np.abs(slow.qdd(c * t) * c**2 - motion.qdd(t)).max() < 1e-9 * scale


def test_slowing_by_a_power_of_two_is_exact_and_comes_back():
    motion = random_motion(PUMA)
    assert motion.slowed(2).slowed(0.5) == motion


@given(st.integers(0, 1000))
def test_reversed_is_the_way_back(seed):
    motion = random_motion(ARM, 3, 5, seed)
    t = np.linspace(0, motion.duration, 41)[1:-1]
    back = motion.reversed()
    assert np.abs(back.q(t) - motion.q(motion.duration - t)).max() < 1e-11
    assert np.abs(back.qd(t) + motion.qd(motion.duration - t)).max() < 1e-10
    assert np.abs(back.qdd(t) - motion.qdd(motion.duration - t)).max() < 1e-9


def test_joined_motions_follow_each_other():
    there = Trajectory(ARM, [0, 1, 2], [[[0, 0], [1, 2]], [[1, 2], [0, 0]]])
    back = there.reversed()
    both = there.then(back)
    assert both.duration == 4
    t = np.linspace(0, 2, 9)
    assert np.allclose(both.q(t), there.q(t))
    assert np.allclose(both.q(2 + t), back.q(t))
    high = Trajectory(ARM, [0, 1], [[[1, 2], [0, 0], [0, 0], [1, 1]]])
    assert there.then(high).q(3.0) == pytest.approx([2, 3])
    with pytest.raises(
        ValueError, match=r"shoulder ends at 1 rad and goes on from 0 rad; expected the same value"
    ):
        there.then(there)


def test_equality_is_that_of_robot_and_numbers():
    motion = random_motion(PUMA)
    again = Trajectory(PUMA, motion.breaks, motion.coefficients, report="found quickly")
    assert again == motion
    assert hash(again) == hash(motion)
    assert motion != motion.slowed(2)
    assert motion != Trajectory(with_payload(PUMA, 1), motion.breaks, motion.coefficients)
    assert motion != "motion"


def test_a_pickled_copy_is_equal_and_read_only():
    motion = Trajectory(PUMA, *_parts(random_motion(PUMA)), report={"found": 1})
    copy = pickle.loads(pickle.dumps(motion))
    assert copy == motion
    assert copy.report == {"found": 1}
    for array in (copy.breaks, copy.coefficients):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    with pytest.raises(AttributeError):
        motion.breaks = np.zeros(2)


def test_what_is_given_is_copied():
    breaks, coefficients = np.array([0.0, 1.0]), np.ones((1, 2, 2))
    motion = Trajectory(ARM, breaks, coefficients)
    coefficients[:] = 7
    assert motion.q(0.0) == pytest.approx([1, 1])


def test_samples_at_a_rate_end_with_the_end():
    motion = random_motion(ARM, duration=0.25)
    assert motion.sample(rate=10).times == pytest.approx([0, 0.1, 0.2, 0.25])
    assert motion.sample(rate=8).times == pytest.approx([0, 0.125, 0.25])
    assert motion.sample(rate=0.1).times == pytest.approx([0, 0.25])
    assert motion.sample(n=3).q.shape == (3, 2)


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (
            lambda: Trajectory(ARM, [0], np.ones((1, 2, 2))),
            r"breaks has shape \(1,\); expected \(K\+1,\)",
        ),
        (
            lambda: Trajectory(ARM, [0, 1], np.ones((2, 2, 2))),
            r"coefficients has shape \(2, 2, 2\); expected \(1, p\+1, 2\)",
        ),
        (lambda: Trajectory(ARM, [0, 1], np.ones((1, 2, 3))), r"expected \(1, p\+1, 2\)"),
        (lambda: Trajectory(ARM, [0, 1], np.ones((1, 0, 2))), r"expected \(1, p\+1, 2\)"),
        (
            lambda: Trajectory(ARM, [0.5, 1], np.ones((1, 2, 2))),
            r"breaks begin with 0.5; expected 0",
        ),
        (
            lambda: Trajectory(ARM, [0, 1, 1], np.ones((2, 2, 2))),
            r"breaks\[1\] is 1, breaks\[2\] is 1",
        ),
        (lambda: Trajectory(ARM, [0, np.inf], np.ones((1, 2, 2))), r"breaks has inf at \(1,\)"),
        (
            lambda: Trajectory(ARM, [0, 1], np.full((1, 2, 2), np.nan)),
            r"coefficients has nan at \(0, 0, 0\)",
        ),
        (lambda: random_motion(ARM).sample(), r"rate=None and n=None; expected one of them"),
        (lambda: random_motion(ARM).sample(rate=1, n=2), r"rate=1 and n=2; expected one of them"),
        (lambda: random_motion(ARM).sample(rate=0), r"rate is 0; expected a positive number"),
        (lambda: random_motion(ARM).sample(rate=np.inf), r"rate is inf"),
        (lambda: random_motion(ARM).sample(n=1), r"n is 1; expected a whole number, 2 or more"),
        (lambda: random_motion(ARM).slowed(0), r"c is 0; expected a number from 1e-12 to 1e12"),
        (lambda: random_motion(ARM).q(0.0, side="up"), r"side is 'up'; expected 'right' or 'left'"),
        (lambda: Trajectory.from_samples(ARM, [0], [[0, 0]]), r"times has shape \(1,\)"),
        (
            lambda: Trajectory.from_samples(ARM, [0, 1], [[0, 0]]),
            r"q has shape \(1, 2\); expected \(2, 2\)",
        ),
        (lambda: Trajectory.from_samples(ARM, [0, 0], np.ones((2, 2))), r"times do not increase"),
        (
            lambda: Trajectory.from_samples(ARM, [0, 1], np.full((2, 2), np.nan)),
            r"q has values that are not finite",
        ),
        (
            lambda: Trajectory.from_samples(ARM, [0, 1], np.ones((2, 2)), qdd=np.ones((2, 2))),
            r"qdd is given without qd",
        ),
    ],
)
def test_what_is_no_trajectory_is_named(call, complaint):
    with pytest.raises(ValueError, match=complaint):
        call()


def test_what_are_no_numbers_is_named():
    with pytest.raises(TypeError, match=r"coefficients: found 'fast'; expected numbers"):
        Trajectory(ARM, [0, 1], "fast")


@given(st.integers(2, 8), st.integers(0, 1000))
def test_samples_are_met_with_their_derivatives(count, seed):
    rng = np.random.default_rng(seed)
    times = 3.0 + np.cumsum(rng.uniform(0.2, 1, count))
    q, qd, qdd = rng.uniform(-2, 2, (3, count, 2))
    t = times - times[0]
    through = [
        Trajectory.from_samples(ARM, times, *given) for given in ((q,), (q, qd), (q, qd, qdd))
    ]
    for motion in through:
        for side in ("left", "right"):
            assert np.abs(motion.q(t, side) - q).max() < 1e-11
    for side in ("left", "right"):
        assert np.abs(through[1].qd(t, side) - qd).max() < 1e-10
        assert np.abs(through[2].qd(t, side) - qd).max() < 1e-10
        assert np.abs(through[2].qdd(t, side) - qdd).max() < 1e-9
    spline = through[0]
    assert np.abs(spline.qdd(t[1:-1]) - spline.qdd(t[1:-1], "left")).max(initial=0) < 1e-9


def test_samples_of_a_quintic_give_it_back():
    """Hermite interpolation of degree 5 reproduces polynomials of degree 5 (an independent construction)."""
    motion = random_motion(PUMA, pieces=1, degree=5)
    samples = motion.sample(n=4)
    again = Trajectory.from_samples(PUMA, samples.times, samples.q, samples.qd, samples.qdd)
    t = np.linspace(0, motion.duration, 50)
    assert np.abs(again.q(t) - motion.q(t)).max() < 1e-12


def test_another_robots_motion_is_refused_by_names():
    motion = random_motion(PUMA)
    motion.require(PUMA)
    loaded = with_payload(PUMA, 2)
    assert motion.matches(PUMA)
    assert not motion.matches(loaded)
    with pytest.raises(
        DescriptionError,
        match=rf"one of puma560 \({PUMA.digest}\); expected one of planar2r \({ARM.digest}\)",
    ):
        motion.require(ARM)
    with pytest.raises(DescriptionError, match="puma560"):
        motion.then(random_motion(ARM))


def _parts(motion):
    return motion.breaks, motion.coefficients


@given(st.integers(0, 1000), st.integers(1, 6), st.integers(0, 9), st.integers(1, 5))
def test_divided_pieces_are_the_same_function_between_their_bernstein_coefficients(
    seed, pieces, degree, parts
):
    whole = random_motion(ARM, pieces, degree, seed).pieces
    divided = whole.divided(parts)
    assert len(divided.coefficients) == parts * len(whole.coefficients)
    t, values = divided.inside(20)
    largest = max(1.0, float(np.abs(divided.bernstein).max()))
    np.testing.assert_allclose(values[:, 1:-1], whole(t[:, 1:-1]), atol=ROUNDING * largest)
    low = divided.bernstein.min(axis=1)[:, None]
    high = divided.bernstein.max(axis=1)[:, None]
    assert (values > low - ROUNDING * largest).all() and (values < high + ROUNDING * largest).all()


def test_bounds_of_polynomials_are_proved_and_tight(law):
    rng = np.random.default_rng(0)
    for _ in range(law.samples(300, quick=20)):
        degree, pieces = int(rng.integers(0, 8)), int(rng.integers(1, 6))
        breaks = np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 2.0, pieces))])
        f = Pieces.of(breaks, rng.normal(size=(pieces, degree + 1, 3)), 3)
        found = f.bounds(1e-9)
        _, sampled = f.inside(4001)
        beyond = np.maximum(
            sampled.max(axis=(0, 1)) - found.highest, found.lowest - sampled.min(axis=(0, 1))
        )
        law.holds("sample beyond its bound", float(beyond.max()), 1e-12)
        for bound, place, choose in (
            (found.highest, found.at_highest, max),
            (found.lowest, found.at_lowest, min),
        ):
            reached = [choose(f(place[i], "left")[i], f(place[i], "right")[i]) for i in range(3)]
            law.holds(
                "bound beyond the value at its place", float(np.abs(bound - reached).max()), 1.1e-9
            )
