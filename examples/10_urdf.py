"""A URDF from a table, and the table from the URDF."""

from pathlib import Path

import numpy as np

import dhkit

folder = Path("out")
folder.mkdir(exist_ok=True)
arm = dhkit.Arm.load("ur5")
arm.write_urdf(folder / "10_ur5.urdf")

read = dhkit.Arm.load(folder / "10_ur5.urdf")
print(read.dh)
q = np.random.default_rng(0).uniform(-1.0, 1.0, (100, 6))
print("largest difference of the tool's pose:", np.abs(read.fk(q) - arm.fk(q)).max())

with read.view(frames=True) as view:
    view.show(arm.configurations["ready"])
    view.save_png(folder / "10_urdf.png")
