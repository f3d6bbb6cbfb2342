"""The tool's path from above, in least time: free, and around a post from which the links keep 2 cm of distance."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import dhkit

arm = dhkit.Arm.load("puma560")
post = dhkit.Obstacle.box((0.08, 0.08, 1.2), (0.62, 0.0, 0.6), name="post")
start, goal = [0.8, 0.8, -2.8, 0, 0.6, 0], [-0.8, 0.8, -2.8, 0, 0.6, 0]
free = arm.plan(start, goal, compare=False)
around = arm.plan(start, goal, obstacles=[post], clearance=0.02)

picture = Figure(figsize=(7, 6), layout="constrained")
axes = picture.add_subplot(aspect="equal", xlabel="x [m]", ylabel="y [m]")
axes.add_patch(Rectangle((0.58, -0.04), 0.08, 0.08, color="#3a4252", label="post"))
for motion, color, label in ((free, "#8fb6ff", "free"), (around, "#d9480f", "around the post")):
    t = np.linspace(0, motion.duration, 200)
    x, y = arm.fk(motion.q(t))[:, :2, 3].T
    axes.plot(x, y, color=color, lw=2, label=f"{label}: {motion.duration:.2f} s")
axes.set_xlim(0, 0.9)
axes.legend(frameon=False, loc="center left")
axes.grid(alpha=0.3)
