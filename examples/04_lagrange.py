"""Equations of motion of two links, proved; and a wrong answer explained."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import dhkit

arm = dhkit.Arm.load("planar2r")
print(arm.lagrangian.text(("M", "g")))
print(arm.lagrangian.prove_euler_lagrange())

# The height of link 2 with its own joint angle in place of the sum of the angles.
answer = ["(m1/2 + m2)*g*l1*c1 + m2*g*l2*c2/2", "m2*g*l2*c2/2"]
print(arm.grade(g=answer))

q2 = np.linspace(-np.pi, np.pi, 181)
right = arm.gravity_torque(np.column_stack([np.full_like(q2, 0.5), q2]))[:, 1]
m2, g, l2 = (arm.description.parameters[name] for name in ("m2", "g", "l2"))
wrong = float(m2) * float(g) * float(l2) * np.cos(q2) / 2

figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.plot(np.degrees(q2), right, label="g2 of the arm")
axes.plot(np.degrees(q2), wrong, "--", label="the answer")
axes.set(xlabel="q2 [°] at q1 = 0.5 rad", ylabel="torque [N m]")
axes.legend()
Path("out").mkdir(exist_ok=True)
figure.savefig("out/04_lagrange.png", dpi=150)
