"""Optima that are known, through the same planner as any arm."""

import numpy as np
import pytest

from dhkit.description import library_robot
from dhkit.planning import Effort, Energy, Jerk, Planner, Time
from dhkit.planning.along import along_path
from dhkit.planning.criteria import Objective, cost_of, size_of
from dhkit.trajectories import JointPath, Limits, cubic, quintic, trapezoidal
from planning_reference import luus, pendulum, slide, two_slides

ODD = 161
"""Intervals whose knots are nowhere near the switches."""
ROUNDING = 1e-13
"""Of integrals: the quadrature is exact for these polynomials."""


def relative(seen, known):
    return abs(seen / known - 1)


@pytest.mark.parametrize("intervals", [None, ODD])
@pytest.mark.parametrize("distance", [0.7, -0.03, 11.0])
def test_double_integrator(law, intervals, distance):
    motion = Planner(slide(), limits=Limits.of(slide(), torque=2.0), intervals=intervals).solve(
        [0], [distance]
    )
    law.holds(
        "bang-bang: 2 sqrt(d / a)",
        relative(motion.duration, 2 * np.sqrt(abs(distance) / 2.0)),
        1e-4,
    )


@pytest.mark.parametrize("limited", ["torque", "acceleration"])
def test_double_integrator_with_a_speed_limit(law, limited):
    arm = slide()
    limits = Limits.of(arm, velocity=0.5, **{limited: 2.0})
    motion = Planner(arm, limits=limits).solve([0], [0.7])
    law.holds(
        "bang, cruise, bang: d / v + v / a", relative(motion.duration, 0.7 / 0.5 + 0.5 / 2.0), 1e-4
    )


@pytest.mark.slow
def test_triple_integrator(law):
    motion = Planner(slide(), limits=Limits.of(slide(), jerk=3.0)).solve([0], [0.7])
    law.holds(
        "limited jerk: (32 d / J)^(1/3)",
        relative(motion.duration, (32 * 0.7 / 3.0) ** (1 / 3)),
        1e-4,
    )
    assert np.abs(motion.qdd([0.0, motion.duration])).max() < 1e-9


def test_minimum_effort(law):
    motion = Planner(slide(), "effort").solve([0], [0.7], duration=1.3)
    law.holds("effort: 12 d^2 / T^3", relative(motion.report.cost, 12 * 0.7**2 / 1.3**3), 1e-6)
    t = np.linspace(0, motion.duration, 50)
    # A cost is flat at its least.
    assert np.allclose(motion.qdd(t)[:, 0], 6 * 0.7 / 1.3**2 * (1 - 2 * t / 1.3), atol=1e-4)


def test_minimum_jerk(law):
    motion = Planner(slide(), "jerk").solve([0], [0.7], duration=1.3)
    law.holds("jerk: 720 d^2 / T^5", relative(motion.report.cost, 720 * 0.7**2 / 1.3**5), 1e-6)
    x = np.linspace(0, 1, 50)
    assert np.allclose(motion.q(1.3 * x)[:, 0], 0.7 * (10 * x**3 - 15 * x**4 + 6 * x**5), atol=1e-6)


@pytest.mark.parametrize("shape", [cubic, quintic])
def test_costs_of_the_classical_motions(shape):
    """Of 1 kg over d in T: the cubic is the motion of least effort, 12 d^2 / T^3, the quintic that of least jerk."""
    d, T, w = 0.7, 1.3, 0.2
    motion = shape(slide(), [0], [d], T)
    term, known = {cubic: (Effort(), 12 * d**2 / T**3), quintic: (Jerk(), 720 * d**2 / T**5)}[shape]
    assert relative(cost_of(Time() + w * term, motion, slide()), T + w * known) < ROUNDING


def test_braking_gives_back_the_work_of_speeding_up():
    """Of 1 kg: half of the way speeds it up to 2 d / T, the other half brakes it."""
    d, T = 0.7, 1.3
    motion, power = (
        trapezoidal(slide(), [0], [d], T, blend=0.5),
        Objective.of(Energy(regenerates=True)),
    )
    twice_the_kinetic_energy = (2 * d / T) ** 2
    assert relative(size_of(power, motion, slide()), twice_the_kinetic_energy) < ROUNDING
    assert abs(cost_of(power, motion, slide())) < ROUNDING * twice_the_kinetic_energy


@pytest.mark.parametrize("most", [1 / 9, 0.1, 1 / 16])
def test_bryson_denham(law, most):
    """Least integral of u^2 / 2 from 0 back to 0 in 1 s, from speed 1 to -1, below a wall (Bryson & Ho 1975, 3.11)."""
    arm = slide()
    planner = Planner(arm, "effort", limits=Limits.of(arm, lower=-1.0, upper=most))
    motion = planner.solve([0], [0], duration=1.0, start_velocity=[1.0], goal_velocity=[-1.0])
    law.holds(
        "Bryson and Denham: 4 / (9 l)", relative(motion.report.cost / 2, 4 / (9 * most)), 1e-4
    )
    law.holds("height above the wall", motion.q(np.linspace(0, 1, 10_001)).max() - most, 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("most", "known"),
    [(1.0, 4.030018688), (1.5, 3.027339520), (2.0, 2.566590758), (5.0, 1.590961069)],
)
def test_pendulum(law, most, known):
    arm = pendulum()
    motion = Planner(arm, limits=Limits.of(arm, torque=most)).solve([0.0], [np.pi])
    law.holds("pendulum x'' = u - sin x from 0 to pi", relative(motion.duration, known), 2e-4)


@pytest.mark.slow
def test_luus(law):
    """Luus 2000, Iterative Dynamic Programming; the way there is by a bent elbow that the straight path has not."""
    arm = luus()
    motion = Planner(arm, limits=Limits.of(arm, torque=1.0)).solve([0.0, 0.5], [0.522, 0.5])
    law.holds("two-link arm of Luus: 2.9823", abs(motion.duration - 2.9823), 5e-4)


def test_time_and_effort_together():
    """With T free, T + w 12 d^2 / T^3 is least at T = (36 w d^2)^(1/4)."""
    w, d = 0.2, 0.7
    motion = Planner(slide(), Time() + w * Effort()).solve([0], [d])
    assert relative(motion.duration, (36 * w * d**2) ** 0.25) < 1e-3


def test_weights_of_effort_choose_between_joints(law):
    # Slides at right angles, 2 kg on the first and 1 kg on the second: each has its own cubic.
    arm = two_slides()
    limits = Limits.of(arm)
    motion = Planner(arm, Effort(joint_weights=(3.0, 0.5)), limits).solve(
        [0, 0], [0.7, 0.4], duration=1.3
    )
    least = (3.0 * (2 * 0.7) ** 2 + 0.5 * 0.4**2) * 12 / 1.3**3
    law.holds("weighed effort", relative(motion.report.cost, least), 1e-6)
    with pytest.raises(ValueError, match="Effort: 3 joint weights; expected 1 or 2"):
        Planner(arm, Effort(joint_weights=(1.0, 2.0, 3.0)), limits).solve(
            [0, 0], [0.7, 0.4], duration=1.3
        )
    with pytest.raises(TypeError, match="joint weights are 'abc'"):
        Effort(joint_weights="abc")


def bang_coast_bang(distance, duration, acceleration):
    """Return the least energy (J) that 1 kg needs over a way, with drives that get nothing back: of v = a T - d / T."""
    a, T = acceleration, duration
    v = (a * T - np.sqrt((a * T) ** 2 - 4 * a * distance)) / 2
    return v * v / 2


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.1, 2.0, 4.0, 10.0, 100.0])
@pytest.mark.parametrize("intervals", [None, ODD])
def test_least_energy_is_a_short_push_a_long_glide_and_a_short_brake(law, factor, intervals):
    arm, d, a = slide(), 0.7, 2.0
    duration = factor * 2 * np.sqrt(d / a)
    planner = Planner(arm, "energy", limits=Limits.of(arm, torque=a), intervals=intervals)
    motion = planner.solve([0], [d], duration=duration)
    law.holds(
        "energy: bang, coast, bang",
        relative(motion.report.cost, bang_coast_bang(d, duration, a)),
        3e-3,
    )
    path = JointPath.straight(arm, [0], [d])
    timed = along_path(arm, path, objective="energy", limits=planner.limits, duration=duration)
    law.holds(
        "energy along a path: bang, coast, bang",
        relative(timed.report.cost, motion.report.cost),
        3e-3,
    )


def test_least_energy_with_a_free_duration(law):
    arm, d, a, weight = slide(), 0.7, 2.0, 10.0
    motion = Planner(arm, Time() + weight * Energy(), limits=Limits.of(arm, torque=a)).solve(
        [0], [d]
    )
    durations = np.linspace(1.0001 * 2 * np.sqrt(d / a), 20, 100_001)
    least = np.min(durations + weight * bang_coast_bang(d, durations, a))
    law.holds("time and energy: bang, coast, bang", relative(motion.report.cost, least), 5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("intervals", [None, 28, 40, 56, 72])
def test_the_manutec_r3s_least_energy(law, intervals):
    """The published optimal control problem of an arm with drives that two joints turn, on meshes of all sizes."""
    arm = library_robot("manutec_r3")
    voltage = 1 / np.array([126.0, 252.0, 72.0])  # V per N m
    ends = (arm.numbers.configurations[name] for name in ("start", "goal"))
    motion = Planner(arm, Effort(joint_weights=voltage**2), intervals=intervals).solve(
        *ends, duration=0.53
    )
    law.holds(
        "least energy of the Manutec r3: 20.4044 V^2 s", relative(motion.report.cost, 20.4044), 1e-3
    )
