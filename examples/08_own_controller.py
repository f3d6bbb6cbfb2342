"""A controller of your own: a function of time, joint values, rates and the setpoint."""

from pathlib import Path

import numpy as np

import dhkit

arm = dhkit.Arm.load("planar2r")
omega = 15.0  # rad/s, bandwidth of the errors


def controller(t, q, qd, setpoint):
    """Return computed torques: M (qdd_d + 2 omega e' + omega^2 e) + h."""
    error = setpoint.q - q
    rate_error = setpoint.qd - qd
    acceleration = setpoint.qdd + 2 * omega * rate_error + omega**2 * error
    return arm.inverse_dynamics(q, qd, acceleration)


motion = arm.quintic([0.0, 0.3], [1.2, -0.8], duration=1.5)
run = arm.simulate(controller, motion, q0=[0.1, 0.3])
print("error at the end:", np.abs(run.q[-1] - motion.q(motion.duration)).max(), "rad")

Path("out").mkdir(exist_ok=True)
dhkit.plot(run).savefig("out/08_own_controller.png", dpi=150)
