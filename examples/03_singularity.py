"""Manipulability of a PUMA 560 on the way through the singularity of its wrist."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import dhkit

arm = dhkit.Arm.load("puma560")
print(arm.singularities())

q = np.tile(arm.configurations["nominal"], (200, 1))
q[:, 4] = np.linspace(-1.0, 1.0, 200)
det_J = np.linalg.det(arm.jacobian(q))

figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.plot(np.degrees(q[:, 4]), np.abs(det_J), label="|det J|")
axes.plot(np.degrees(q[:, 4]), arm.manipulability(q), label="translational manipulability")
axes.axvline(0.0, color="grey", linestyle=":")
axes.set(xlabel="q5 [°]", title="Axes 4 and 6 coincide at q5 = 0")
axes.legend()
Path("out").mkdir(exist_ok=True)
figure.savefig("out/03_singularity.png", dpi=150)
