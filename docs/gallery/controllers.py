"""All controllers of dhkit on one motion of two rods, with an unknown load of 0.3 kg."""

import dhkit

arm = dhkit.Arm.load("planar2r")
motion = arm.quintic([0.0, 0.5], [1.2, 1.0], duration=1.0)
picture = dhkit.plot(arm.compare(motion, plant=arm.with_payload(0.3)))
