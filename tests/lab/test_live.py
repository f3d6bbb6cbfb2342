"""Controllers that are unstable since they are sampled: found by their torques, beside the limit of a linear joint."""

import numpy as np
import pytest

from dhkit import Arm
from dhkit.control.gains import effective_inertia
from dhkit.errors import SimulationError
from dhkit.lab.live import AlternationWatch, Live

RATE = 500.0


def run(kd, seconds=0.5, law=None):
    """Damp the last joint of an arm without gravity in the lab's loop."""
    arm = Arm.load("cobra600")
    q = np.array([0.3, 0.4, 0.1, 0.0])
    live = Live(arm, arm, None, q, RATE)
    m = effective_inertia(arm.description, q)[3]

    def controller(t, q, qd, setpoint):
        g = arm.gravity_torque(q)
        tau = law(q, qd) if law is not None else -kd * m * RATE * (qd - 1e-3)
        return g + np.array([0.0, 0.0, 0.0, tau[3]])

    live.take(controller)
    for _ in range(int(seconds * RATE)):
        live.advance()
    return live


@pytest.mark.parametrize("kd", [0.5, 1.5, 1.9])
def test_damping_below_twice_the_inertia_times_the_rate_is_let_be(kd):
    assert run(kd).t == pytest.approx(0.5)


@pytest.mark.parametrize("kd", [2.2, 3.0, 10.0])
def test_damping_above_it_is_stopped_with_the_reason(kd):
    with pytest.raises(
        SimulationError,
        match=r"changes its sign at every sample and grows; at 500 Hz its damping kd",
    ):
        run(kd)


def test_a_sliding_mode_that_chatters_is_let_be():
    assert run(
        0.0, law=lambda q, qd: -0.2 * np.sign(q - [0.3, 0.4, 0.1, 0.001] + 0.01 * qd)
    ).t == pytest.approx(0.5)


def test_rounding_alone_and_a_constant_alternation_are_let_be():
    watch = AlternationWatch(2)
    sizes = [1e-9 * 1.5**k for k in range(15)]
    assert all(
        watch.unstable_joint(np.array([size, -size]) * (-1) ** k) is None
        for k, size in enumerate(sizes)
    )
    watch = AlternationWatch(1)
    assert all(watch.unstable_joint(np.array([(-1.0) ** k])) is None for k in range(200))
    watch = AlternationWatch(3)
    found = [watch.unstable_joint(np.array([1.0, 0.1 * (-1.2) ** k, 0.0])) for k in range(30)]
    assert found[10] is None and found[-1] == 1
