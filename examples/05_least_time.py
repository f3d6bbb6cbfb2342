"""A motion in least time beside a quintic between the same states, under the same limits."""

from pathlib import Path

import dhkit

arm = dhkit.Arm.load("puma560")
best = arm.plan("nominal", "ready")
print(best.report)

Path("out").mkdir(exist_ok=True)
best.save("out/05_least_time.npz")
dhkit.plot(best).savefig("out/05_least_time.png", dpi=150)
