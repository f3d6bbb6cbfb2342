"""An optimal control problem of your own: the least effort with which two links swing up, by direct collocation."""

from pathlib import Path

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np

import dhkit

arm = dhkit.Arm.load("planar2r")
N = 40  # intervals
h = 1.5 / N  # s

opti = ca.Opti()
q = opti.variable(2, N + 1)
qd = opti.variable(2, N + 1)
tau = opti.variable(2, N + 1)
qdd = [arm.casadi.forward_dynamics(q[:, k], qd[:, k], tau[:, k]) for k in range(N + 1)]
for k in range(N):
    # Trapezoidal collocation: x_(k+1) - x_k = h/2 (f_k + f_(k+1)).
    opti.subject_to(q[:, k + 1] - q[:, k] == h / 2 * (qd[:, k] + qd[:, k + 1]))
    opti.subject_to(qd[:, k + 1] - qd[:, k] == h / 2 * (qdd[k] + qdd[k + 1]))
opti.subject_to(q[:, 0] == [-np.pi / 2, 0.0])  # hanging
opti.subject_to(q[:, N] == [np.pi / 2, 0.0])  # upright
opti.subject_to(qd[:, 0] == 0)
opti.subject_to(qd[:, N] == 0)
opti.minimize(h * ca.sumsqr(tau))
opti.set_initial(q, np.linspace([-np.pi / 2, 0.0], [np.pi / 2, 0.0], N + 1).T)
opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
solution = opti.solve()

times = h * np.arange(N + 1)
print("integral of tau^2:", solution.value(opti.f), "N^2 m^2 s")
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.5), layout="constrained")
left.plot(times, solution.value(q).T, label=["q1", "q2"])
left.set(xlabel="t [s]", ylabel="joint angles [rad]")
left.legend()
right.plot(times, solution.value(tau).T, label=["tau1", "tau2"])
right.set(xlabel="t [s]", ylabel="torques [N m]")
right.legend()
Path("out").mkdir(exist_ok=True)
figure.savefig("out/11_optimal_control.png", dpi=150)
