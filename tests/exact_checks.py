"""What tests of the exact equations share: errors against Pinocchio, and sines and cosines of sums."""

from __future__ import annotations

import numpy as np

from dhkit.description import Description
from dhkit.model import pinocchio_model
from dhkit.symbolic.ring import translated
from dhkit.verification import random_states
from dhkit.verification.measure import Floors, relative_error


def states(description: Description, samples: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    q = random_states(description, samples, seed)
    return q, rng.normal(size=q.shape), rng.normal(size=q.shape) * 3


def errors(
    lag, samples: int, quantities=("M", "C", "h", "g", "tau", "K", "V"), seed: int = 0
) -> dict[str, float]:
    """Return the worst error of each quantity against Pinocchio, by the measure of verification."""
    import pinocchio as pin

    description = lag.description
    model = pinocchio_model(description)
    data = model.createData()
    q, qd, qdd = states(description, samples, seed)
    n = description.n
    B = description.numbers.coupling  # which Pinocchio does not know
    reference = {name: [] for name in ("M", "C", "h", "g", "tau", "K", "V")}
    for state in zip(q, qd, qdd, strict=True):
        M = np.reshape(pin.crba(model, data, state[0]), (n, n))
        reference["M"].append(np.triu(M) + np.triu(M, 1).T + B)
        C = np.reshape(pin.computeCoriolisMatrix(model, data, *state[:2]), (n, n)).copy()
        reference["C"].append(C)
        reference["h"].append(C @ state[1])
        reference["g"].append(
            np.array(pin.computeGeneralizedGravity(model, data, state[0])).reshape(n)
        )
        reference["tau"].append(np.array(pin.rnea(model, data, *state)).reshape(n) + B @ state[2])
        reference["K"].append(
            pin.computeKineticEnergy(model, data, *state[:2]) + state[1] @ B @ state[1] / 2
        )
        reference["V"].append(pin.computePotentialEnergy(model, data, state[0]))
    reference = {name: np.array(values) for name, values in reference.items()}
    floors = Floors.of(description, reference["M"], qd, qdd, reference["tau"])
    floor = {
        "M": 0.0,
        "C": floors.C,
        "h": floors.h,
        "g": floors.g,
        "tau": floors.tau,
        "K": floors.h,
        "V": floors.g,
    }
    found = {}
    for name in quantities:
        ours = lag.evaluate(getattr(lag, name), q, qd, qdd)
        found[name] = float(np.max(relative_error(ours, reference[name], floor[name])))
    return found


def restored(element, arm):
    """Return an element in sums of angles as one of the arm's own ring."""
    ring = arm.ring
    places = {}
    for sine, cosine, joints in element.ring.turning:
        s, c = ring.zero, ring.one
        for i in joints:
            s, c = s * ring.cosine(i) + c * ring.sine(i), c * ring.cosine(i) - s * ring.sine(i)
        places[sine], places[cosine] = s, c
    return translated(element, ring, places)
