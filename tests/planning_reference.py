"""What plans are held against: Pinocchio on grids of our own choice, toppra, and arms of textbooks' problems."""

import numpy as np
import pinocchio as pin

from dhkit.description import description_of, from_dh, from_toml
from dhkit.model import pinocchio_model

SLIDE = """
format = 1
name = "slide"
convention = "standard"
gravity = [0, 0, 0]
[[joint]]
type = "prismatic"
a = 0
alpha = 0
d = 0
theta = 0
body = { mass = 1, com = [0, 0, 0] }
"""
"""Force is acceleration: the double integrator."""

PENDULUM = """
format = 1
name = "pendulum"
convention = "standard"
gravity = [0, -1, 0]
[[joint]]
type = "revolute"
a = 1
alpha = 0
d = 0
theta = "-pi/2"
body = { mass = 1, com = [0, 0, 0] }
"""
"""x'' = u - sin x."""

LUUS = """
format = 1
name = "luus"
convention = "standard"
gravity = [0, 0, -9.81]
[[joint]]
type = "revolute"
a = 1
alpha = 0
d = 0
theta = 0
body = { mass = 1, com = [-0.5, 0, 0], inertia = { zz = "1/12", yy = "1/12" } }
[[joint]]
type = "revolute"
a = 1
alpha = 0
d = 0
theta = 0
body = { mass = 2, com = [-0.25, 0, 0], inertia = { zz = "1/12 + 1/8", yy = "1/12 + 1/8" } }
"""
"""Two horizontal uniform rods of 1 m and 1 kg, 1 kg at the tip: rod and tip together are 2 kg at a quarter."""


def slide():
    return from_toml(SLIDE)


def two_slides():
    """Return two slides at right angles without gravity, 1 kg on each."""
    link = SLIDE.split("[[joint]]")[1].strip()
    return from_toml(SLIDE.replace("alpha = 0", 'alpha = "pi/2"') + "\n[[joint]]\n" + link)


def pendulum():
    return from_toml(PENDULUM)


def luus():
    return from_toml(LUUS)


def bare(n=2):
    """Return an arm without bodies or limits."""
    return from_dh([(0, 0, 0.3, 0)] * n)


def random_pairs(arm, count, seed=0):
    """Return configurations inside the limits in which the arm can hold itself, (count, 2, n)."""
    numbers, rng = arm.numbers, np.random.default_rng(seed)
    model = pinocchio_model(arm)
    data = model.createData()
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -np.pi)
    upper = np.where(np.isfinite(numbers.upper), numbers.upper, np.pi)
    found = []
    while len(found) < 2 * count:
        q = rng.uniform(lower, upper)
        if (np.abs(pin.computeGeneralizedGravity(model, data, q)) < 0.95 * numbers.effort).all():
            found.append(q)
    return np.array(found).reshape(count, 2, arm.n)


def grids(motion, rate=1000.0, points=20):
    """Return q, qd and qdd at 1 kHz, and at so many points an interval, both sides of each break, (N, n) each."""
    t = np.arange(0.0, motion.duration, 1 / rate)
    s = np.linspace(0, 1, points)
    inside = (motion.breaks[:-1, None] + np.diff(motion.breaks)[:, None] * s[:-1]).ravel()
    ends = motion.breaks[1:]
    rows = []
    for name in ("q", "qd", "qdd"):
        value = getattr(motion, name)
        rows.append(
            np.concatenate(
                [value(t), value(inside), value(ends, side="left"), value(motion.duration)[None]]
            )
        )
    return rows


def worst_excess(arm, motion, limits):
    """Return by what share of a limit a motion exceeds it at worst, with Pinocchio's torques, and which limit."""
    q, qd, qdd = grids(motion)
    model = pinocchio_model(arm)
    data = model.createData()
    tau = np.array([np.ravel(pin.rnea(model, data, *row)) for row in zip(q, qd, qdd, strict=True)])
    tau = tau + qdd @ description_of(arm).numbers.coupling
    size = np.maximum(np.abs(limits.lower), np.abs(limits.upper))
    with np.errstate(invalid="ignore"):
        position = np.maximum(limits.lower - q, q - limits.upper) / np.where(
            np.isfinite(size), size, 1.0
        )
    return {
        "position": float(np.max(position)),
        "velocity": float(np.max(np.abs(qd) / limits.velocity) - 1),
        "acceleration": float(np.max(np.abs(qdd) / limits.acceleration) - 1),
        "torque": float(np.max(np.abs(tau) / limits.torque) - 1),
    }


def toppra_duration(arm, start, goal, limits, gridpoints=501):
    """Return the duration of toppra's motion along the straight joint path, 500 intervals, Interpolation scheme."""
    import logging

    import toppra
    import toppra.algorithm
    import toppra.constraint
    from toppra.constraint import DiscretizationType

    logging.getLogger("toppra").setLevel(logging.ERROR)
    model = pinocchio_model(arm)
    data = model.createData()

    def torque(q, qd, qdd):
        return np.ravel(pin.rnea(model, data, *(np.asarray(x, dtype=float) for x in (q, qd, qdd))))

    path = toppra.SplineInterpolator([0, 1], np.array([start, goal]))
    speed = toppra.constraint.JointVelocityConstraint(
        np.stack([-limits.velocity, limits.velocity], axis=1)
    )
    effort = toppra.constraint.JointTorqueConstraint(
        torque,
        np.stack([-limits.torque, limits.torque], axis=1),
        np.zeros(arm.n),
        discretization_scheme=DiscretizationType.Interpolation,
    )
    instance = toppra.algorithm.TOPPRA(
        [speed, effort], path, gridpoints=np.linspace(0, 1, gridpoints), solver_wrapper="seidel"
    )
    motion = instance.compute_trajectory(0, 0)
    return np.inf if motion is None else float(motion.duration)
