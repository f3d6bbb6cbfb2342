"""A motion in least time between two poses, and back: every limit of speed and torque holds."""

import dhkit

arm = dhkit.Arm.load("puma560")
there = arm.plan("nominal", [1.2, 0.3, -0.8, 0.5, -0.6, 1.0], compare=False)
back = arm.plan(there.q(there.duration), "nominal", compare=False)
with arm.view() as view:
    film = []
    for motion in (there, back):
        view.play(motion.slowed(1.6))
        film.append(view.save_gif(f"film{len(film)}.gif", size=(560, 440), rate=15))
