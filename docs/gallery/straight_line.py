"""The tool of a PUMA 560 on a straight line: the arm at both ends and in the middle, and the path."""

import numpy as np

import dhkit

arm = dhkit.Arm.load("puma560")
T0 = dhkit.pose((0, -0.25, 0)) @ arm.fk("nominal")
T1 = dhkit.pose((0, 0.5, -0.1)) @ T0
motion = arm.straight_line(T0, T1)
t = np.linspace(0, motion.duration, 100)
with arm.view() as view:
    view.show(motion.q(motion.duration / 2))
    view.ghosts(motion.q([0, motion.duration]))
    view.trace(arm.fk(motion.q(t))[:, :3, 3])
    picture = view.picture(size=(800, 600))
