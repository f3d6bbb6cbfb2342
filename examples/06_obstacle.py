"""A motion around an obstacle, and what its certificate says."""

from pathlib import Path

import numpy as np

import dhkit

arm = dhkit.Arm.load("puma560")
start = np.array([-0.7, 0.5, -2.6, 0.0, 0.5, 0.0])
goal = np.array([0.7, 0.5, -2.6, 0.0, 0.5, 0.0])
direct = arm.quintic(start, goal)
ball = dhkit.Obstacle.sphere(0.08, arm.fk(direct.q(direct.duration / 2))[:3, 3], name="ball")
print("the quintic is", arm.distance(direct.q(direct.duration / 2), [ball]).distance, "m away")

motion = arm.plan(start, goal, obstacles=[ball], clearance=0.02, compare=False)
print(motion.report.certificate)

Path("out").mkdir(exist_ok=True)
times = np.linspace(0.0, motion.duration, 9)
with arm.view() as view:
    view.show(motion.q(times[4]))
    view.obstacles([ball])
    view.trace(arm.fk(motion.q(np.linspace(0.0, motion.duration, 100)))[:, :3, 3])
    view.save_png("out/06_obstacle.png")
