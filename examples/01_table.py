"""An arm from the rows of its table: a SCARA with its lengths as parameters."""

from pathlib import Path

import dhkit

arm = dhkit.Arm.from_dh(
    [("q1", 0.4, "l1", 0), ("q2", 0, "l2", "pi"), (0, "q3", 0, 0), ("q4", 0.1, 0, 0)],
    order=("theta", "d", "a", "alpha"),
    kinds="RRPR",
    parameters={"l1": 0.35, "l2": 0.25},
    limits=[(-2.4, 2.4), (-2.6, 2.6), (0, 0.2), None],
    name="my_scara",
)
print(arm.dh)
print(arm.family)

q = [0.4, 0.8, 0.1, 0.0]  # rad, rad, m, rad
xyz, angles = dhkit.pose_parts(arm.fk(q), degrees=True)
print("tool:", xyz.round(4), "m;", angles.round(2), "degrees about x, y', z''")

folder = Path("out")
folder.mkdir(exist_ok=True)
with arm.view(frames=True) as view:
    view.show(q)
    view.save_png(folder / "01_table.png")
