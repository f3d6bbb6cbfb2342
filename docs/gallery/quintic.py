"""A quintic motion: positions, rates, accelerations and torques, with the limits."""

import dhkit

arm = dhkit.Arm.load("puma560")
picture = dhkit.plot(arm.quintic("nominal", "ready"))
