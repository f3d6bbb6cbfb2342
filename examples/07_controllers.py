"""Controllers compared on one motion, with a payload that they do not know of."""

from pathlib import Path

import dhkit
from dhkit.viewer import plot_comparison

arm = dhkit.Arm.load("puma560")
motion = arm.quintic("nominal", "ready", duration=2.0)
compared = arm.compare(
    motion, ("pid", "pd-gravity", "computed-torque"), plant=arm.with_payload(2.5)
)
print(compared)

Path("out").mkdir(exist_ok=True)
plot_comparison(compared.results).savefig("out/07_controllers.png", dpi=150)
