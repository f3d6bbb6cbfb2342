"""Simulation results made up for tests of what is done with them: files, figures and the viewer."""

import numpy as np

from dhkit.control import EnergyAudit, SimulationResult


def swinging(description, states=400, error=0.02, seconds=2.0, seed=0, most=None):
    """Return a result whose joints swing around a reference; torques are cut off at the drives' limits.

    Parameters
    ----------
    description
        The robot.
    states
        N+1.
    error
        Largest difference from the reference, rad and m.
    seconds
        Duration.
    seed
        Of the phases.
    most
        Largest torque asked for, as a share of the limits.
    """
    rng, n = np.random.default_rng(seed), description.n
    t = np.linspace(0.0, seconds, states) if states > 1 else np.zeros(1)
    phase, rate = rng.uniform(0, 2, n), rng.uniform(1, 3, n)
    lower, upper = (
        np.clip(limit, -2.0, 2.0)
        for limit in (description.numbers.lower, description.numbers.upper)
    )
    centre, swing = (lower + upper) / 2, 0.35 * (upper - lower)
    angle = phase + rate * t[:, None]
    reference_q, reference_qd = centre + swing * np.sin(angle), rate * swing * np.cos(angle)
    off = error * (1 - np.exp(-3 * t[:, None])) * np.cos(7 * angle) / np.sqrt(1 + np.arange(n))
    effort = np.where(np.isfinite(description.numbers.effort), description.numbers.effort, 50.0)
    tau_asked = (1.2 if most is None else most) * effort * np.sin(2 * angle)
    tau = np.clip(tau_asked, -effort, effort)
    return SimulationResult(
        description=description,
        t=t,
        q=reference_q + off,
        qd=reference_qd + rng.normal(0, 0.01, (states, n)),
        qdd=rng.normal(0, 1, (states, n)),
        tau=tau,
        tau_asked=tau_asked,
        reference_q=reference_q,
        reference_qd=reference_qd,
        audit=EnergyAudit(*rng.normal(0, 1, 5), turnover=3.7),
        saturated=np.mean(tau != tau_asked, axis=0),
    )
