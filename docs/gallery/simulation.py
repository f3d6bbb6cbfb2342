"""A PID controller on a PUMA 560 that carries 2.5 kg of which the controller does not know."""

import dhkit

arm = dhkit.Arm.load("puma560")
motion = arm.quintic("nominal", "ready", duration=2.0)
run = arm.simulate(dhkit.PID.tuned(arm), motion, plant=arm.with_payload(2.5))
picture = dhkit.plot(run)
