"""The eight solutions of inverse kinematics for one pose of the tool."""

import dhkit

arm = dhkit.Arm.load("puma560")
q = arm.configurations["nominal"]
solutions = arm.ik(arm.fk(q))
with arm.view() as view:
    view.show(q)
    view.ghosts(solutions.q[solutions.valid])
    picture = view.picture(size=(800, 600))
