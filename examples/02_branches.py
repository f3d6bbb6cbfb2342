"""All configurations of a PUMA 560 that reach one pose."""

from pathlib import Path

import dhkit

arm = dhkit.Arm.load("puma560")
T = arm.fk("nominal")
solutions = arm.ik(T)
for name, q, allowed in zip(solutions.branches, solutions.q, solutions.allowed, strict=True):
    print(f"{name:<20} {q.round(3)}", "" if allowed else " beyond a limit")

# Configurations that differ in the wrist alone look the same from afar: four of the eight are shown.
shown = [k for k, name in enumerate(solutions.branches) if name.endswith("no-flip")]
folder = Path("out")
folder.mkdir(exist_ok=True)
with arm.view() as view:
    view.show(solutions.q[shown[0]])
    view.ghosts(solutions.q[shown[1:]], names=[solutions.branches[k] for k in shown[1:]])
    view.save_png(folder / "02_branches.png")
