"""A PUMA 560 with its Denavit-Hartenberg frames."""

import dhkit

arm = dhkit.Arm.load("puma560")
with arm.view(frames=True) as view:
    view.show(arm.configurations["nominal"])
    picture = view.picture(size=(800, 600))
