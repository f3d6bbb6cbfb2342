"""The same motion in least time: some limit is active at almost every time."""

import dhkit

arm = dhkit.Arm.load("puma560")
picture = dhkit.plot(arm.plan("nominal", "ready", compare=False))
