"""A hundred thousand poses at once: all branches of inverse kinematics, and how many are inside the limits."""

import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import dhkit

arm = dhkit.Arm.load("puma560")
arm.compile()
limits = arm.description.numbers
q = np.random.default_rng(0).uniform(limits.lower, limits.upper, (100_000, 6))

start = time.perf_counter()
T = arm.fk(q)
middle = time.perf_counter()
solutions = arm.ik(T)
end = time.perf_counter()
print(f"forward kinematics {1e9 * (middle - start) / len(q):.0f} ns a pose")
print(f"inverse kinematics {1e9 * (end - middle) / len(q):.0f} ns a pose, all eight branches")

counts = np.bincount(solutions.allowed.sum(axis=1), minlength=9)
figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.bar(range(9), 100 * counts / len(q))
axes.set(xlabel="branches inside the joint limits", ylabel="share of poses [%]")
Path("out").mkdir(exist_ok=True)
figure.savefig("out/12_batches.png", dpi=150)
