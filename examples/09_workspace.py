"""Where the tool of a Stanford arm can be, and how well it moves there."""

from pathlib import Path

import dhkit

arm = dhkit.Arm.load("stanford")
space = arm.workspace(samples=20_000)
print("distance of the tool from axis 1:", [round(r, 3) for r in space.radii], "m")

Path("out").mkdir(exist_ok=True)
dhkit.plot(space).savefig("out/09_workspace.png", dpi=150)
