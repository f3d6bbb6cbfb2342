"""Dynamics by Pinocchio, from the URDF that dhkit writes, and how far ours are from them."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pinocchio as pin
from hypothesis import strategies as st

from acceptance import ACCEPTING
from dhkit.description import Coupling
from dhkit.expressions import exact
from dhkit.model import pinocchio_model
from dhkit.verification import random_states
from dhkit.verification.measure import Floors, forward_tolerance, relative_error
from random_arms import arms

TOLERANCE = 1e-12
ARMS = 1000 if ACCEPTING else 8
"""Random arms of laws for which everything is derived anew, by differentiation too."""


@st.composite
def tilted_arms(draw, least=3, most=7):
    """Draw an arm with bodies and drives, some of which two joints turn, in a field of gravity of any direction."""
    arm = coupled(draw, draw(arms(least, most)))
    gravity = tuple(exact(round(draw(st.floats(-10, 10)), 3)) for _ in range(3))
    return replace(arm, gravity=gravity)


def coupled(draw, arm):
    """Return an arm with couplings of drives of any sign, below what rotors can have."""
    couplings = []
    for i, j in combinations(range(arm.n), 2):
        most = float(np.sqrt(arm.numbers.armature[i] * arm.numbers.armature[j])) / arm.n
        share = draw(st.sampled_from([0.0, 0.0, -0.9, 0.5]))
        if share * most:
            couplings.append(Coupling((i + 1, j + 1), exact(share * most)))
    return replace(arm, couplings=tuple(couplings))


def motions(arm, count, seed=0):
    """Return random q, qd and a third vector for accelerations or torques, each (count, n)."""
    rng = np.random.default_rng(seed)
    return (
        random_states(arm, count, seed),
        rng.uniform(-3, 3, (count, arm.n)),
        rng.uniform(-5, 5, (count, arm.n)),
    )


def reference(arm, q, qd, x):
    """Return every quantity by Pinocchio at N states; x is acceleration for tau, and torque for qdd."""
    model = pinocchio_model(arm)
    data, n = model.createData(), arm.n

    def mass_matrix(state):
        # eigenpy hands a matrix of one column over as a vector; older crba fills one triangle.
        M = np.array(pin.crba(model, data, state)).reshape(n, n)
        return np.triu(M) + np.triu(M, 1).T

    def each(function, *arrays):
        return np.array(
            [np.array(function(model, data, *rows)) for rows in zip(*arrays, strict=True)]
        )

    # Pinocchio knows no couplings: B is written down from the description's own list.
    B = np.zeros((n, n))
    for coupling in arm.couplings:
        i, j = (number - 1 for number in coupling.joints)
        B[i, j] = B[j, i] = float(coupling.inertia)
    M, bias = np.array([mass_matrix(state) + B for state in q]), each(pin.nonLinearEffects, q, qd)
    C = each(lambda m, d, *s: np.reshape(pin.computeCoriolisMatrix(m, d, *s), (n, n)), q, qd)
    return {
        "M": M,
        "C": C,
        "g": each(pin.computeGeneralizedGravity, q),
        "h": np.einsum("kij,kj->ki", C, qd),  # the bias less g would have lost digits
        "bias": bias,
        "tau": each(pin.rnea, q, qd, x) + x @ B,
        "qdd": np.linalg.solve(M, (x - bias)[..., None])[..., 0]
        if B.any()
        else each(pin.aba, q, qd, x),
        "K": each(pin.computeKineticEnergy, q, qd) + np.einsum("ki,ij,kj->k", qd, B, qd) / 2,
        "V": each(pin.computePotentialEnergy, q),
    }


def hold(law, arm, ours, q, qd, x, path):
    """Hold what we computed, by the names of ``reference``, against Pinocchio."""
    theirs = reference(arm, q, qd, x)
    floors = Floors.of(arm, theirs["M"], qd, x, x)
    floor = {
        "M": 0.0,
        "C": floors.C,
        "g": floors.g,
        "h": floors.h,
        "bias": floors.bias,
        "tau": floors.tau,
    }
    floor |= {"qdd": floors.qdd, "K": floors.h, "V": floors.g}
    scale = forward_tolerance(theirs["M"]) / TOLERANCE
    for name, values in ours.items():
        quantity = name.split(" ")[0]
        error = relative_error(values, theirs[quantity], floor[quantity])
        if quantity == "qdd":
            error = error / scale
        worst = int(np.argmax(np.where(np.isnan(error), np.inf, error)))
        law.holds(f"{name} {path} against Pinocchio", error[worst], TOLERANCE, (arm.name, q[worst]))
