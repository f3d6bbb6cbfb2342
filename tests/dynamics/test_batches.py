"""Batches of dynamics: one rule of shapes, NaN rows, out=, threads=, and errors that say what was expected."""

import numpy as np
import pytest

from dhkit.description import from_dh, library_robot, with_uniform_links
from dhkit.dynamics import (
    Friction,
    bias,
    coriolis_matrix,
    forward_dynamics,
    friction_torque,
    gravity_torque,
    inverse_dynamics,
    kinetic_energy,
    mass_matrix,
    potential_energy,
    power,
    wrench_torque,
)
from dhkit.errors import DescriptionError
from dhkit.kernels.kernel import MIN_ITEMS_PER_THREAD
from dynamics_reference import motions

FUNCTIONS = {
    mass_matrix: (1, (6, 6)),
    coriolis_matrix: (2, (6, 6)),
    gravity_torque: (1, (6,)),
    bias: (2, (6,)),
    inverse_dynamics: (3, (6,)),
    forward_dynamics: (3, (6,)),
    kinetic_energy: (2, ()),
    potential_energy: (1, ()),
}
"""How many joint vectors each takes, and the shape of its result."""

every = pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)


@pytest.fixture
def arm():
    return library_robot("puma560")


@every
def test_a_batch_is_its_elements(function, arm):
    count, tail = FUNCTIONS[function]
    states = [state.reshape(3, 4, 6) for state in motions(arm, 12)][:count]
    batch = function(arm, *states)
    assert batch.shape == (3, 4, *tail)
    one = function(arm, *(state[1, 2] for state in states))
    assert one.shape == tail
    assert np.abs(batch[1, 2] - one).max() <= 1e-14 * np.abs(batch).max()
    assert function(arm, *(state[:0] for state in states)).shape == (0, 4, *tail)


@every
def test_batch_axes_broadcast(function, arm):
    count, tail = FUNCTIONS[function]
    states = motions(arm, 5)[:count]
    first, *others = states
    result = function(arm, first[:, None], *(state[0] for state in others))
    assert result.shape == (5, 1, *tail)
    if others:
        assert function(arm, first[0], *others).shape == (5, *tail)


@every
def test_threads_and_arrays_of_the_caller(function, arm):
    count, _ = FUNCTIONS[function]
    states = motions(arm, 2 * MIN_ITEMS_PER_THREAD + 7)[:count]
    expected = function(arm, *states)
    out = np.full_like(expected, 7.0)
    assert function(arm, *states, out=out, threads=3) is out
    assert np.abs(out - expected).max() <= 1e-13 * np.abs(expected).max()
    with pytest.raises(ValueError, match="out has shape"):
        function(arm, *states, out=out[:-1])


@pytest.mark.parametrize("function", [gravity_torque, bias, inverse_dynamics, forward_dynamics])
def test_out_may_be_an_input(function, arm):
    states = [state.copy() for state in motions(arm, 40)][: FUNCTIONS[function][0]]
    more = {"friction": True} if function in (inverse_dynamics, forward_dynamics) else {}
    expected = function(arm, *states, **more)
    assert np.array_equal(function(arm, *states, **more, out=states[-1]), expected)


def test_out_may_be_the_state_and_a_row_lost(arm, caplog):
    q, qd, tau = (state.copy() for state in motions(arm, 4))
    q[1, 2] = np.nan
    expected = forward_dynamics(arm, q, qd, tau)
    assert np.array_equal(forward_dynamics(arm, q, qd, tau, out=q), expected, equal_nan=True)
    assert not caplog.records


@every
def test_a_state_that_is_not_finite_spoils_only_its_row(function, arm, caplog):
    count, _ = FUNCTIONS[function]
    states = [state.copy() for state in motions(arm, 6)][:count]
    expected = function(arm, *states)
    for k in range(count):
        for bad in (np.nan, np.inf):
            spoilt = [state.copy() for state in states]
            spoilt[k][2, 3] = bad
            found = function(arm, *spoilt)
            assert np.all(np.isnan(found[2]))
            assert np.array_equal(np.delete(found, 2, axis=0), np.delete(expected, 2, axis=0))
    assert not [record for record in caplog.records if record.levelname == "WARNING"]


@every
def test_arguments_of_the_wrong_kind_are_refused(function, arm):
    count, _ = FUNCTIONS[function]
    good = [np.zeros(6)] * count
    for k in range(count):
        with pytest.raises(ValueError, match=r"expected \(..., 6\) for puma560"):
            function(arm, *good[:k], np.zeros(5), *good[k + 1 :])
        with pytest.raises(TypeError, match="expected numbers"):
            function(arm, *good[:k], [None] * 6, *good[k + 1 :])


@every
def test_an_arm_without_bodies_says_what_to_do(function):
    arm = from_dh([(0, 0.1, 0.2, 0)] * 6)
    states = [np.zeros(6)] * FUNCTIONS[function][0]
    with pytest.raises(
        DescriptionError, match=r"joints 1 \(joint1\), .* have no body.*with_uniform_links"
    ) as caught:
        function(arm, *states)
    assert "\n" not in str(caught.value)
    assert function(with_uniform_links(arm), *states).shape == FUNCTIONS[function][1]


def test_loads_broadcast(arm):
    q, qd, qdd = (state[0] for state in motions(arm, 1))
    wrench = np.ones((4, 6))
    for function in (inverse_dynamics, forward_dynamics):
        result = function(arm, q, qd, qdd, wrench=wrench, friction=Friction(0.1))
        assert result.shape == (4, 6)
        assert np.all(result == result[0])
    assert wrench_torque(arm, q, wrench).shape == (4, 6)
    with pytest.raises(ValueError, match=r"wrench has shape \(3,\); expected \(..., 6\)"):
        inverse_dynamics(arm, q, qd, qdd, wrench=np.ones(3))
    with pytest.raises(TypeError, match="expected False, True or a Friction"):
        inverse_dynamics(arm, q, qd, qdd, friction=0.5)
    with pytest.raises(ValueError, match="width is -1"):
        Friction(-1)


def test_power_and_friction(arm):
    qd, tau = motions(arm, 5)[1:]
    out = np.empty(5)
    assert power(arm, qd, tau, out=out) is out
    assert np.allclose(out, (qd * tau).sum(axis=1), rtol=1e-14)
    assert power(arm, qd[0], tau).shape == (5,)
    numbers = arm.numbers
    step = np.where(qd > 0, numbers.coulomb[:, 0], numbers.coulomb[:, 1])
    assert np.allclose(friction_torque(arm, qd), numbers.viscous * qd + step, rtol=1e-14)
    moving = inverse_dynamics(arm, qd, qd, tau, friction=True) - inverse_dynamics(arm, qd, qd, tau)
    assert np.allclose(moving, friction_torque(arm, qd), rtol=0, atol=1e-12)
    back = forward_dynamics(
        arm, qd, qd, inverse_dynamics(arm, qd, qd, tau, friction=True), friction=True
    )
    assert np.allclose(back, tau, rtol=1e-10)
