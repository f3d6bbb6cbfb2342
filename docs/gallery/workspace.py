"""Positions that the tool of a PUMA 560 reaches, with the manipulability there: 20,000 random states."""

import dhkit

arm = dhkit.Arm.load("puma560")
picture = dhkit.plot(arm.workspace(samples=20_000))
