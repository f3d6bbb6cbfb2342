"""CasADi functions: named, differentiable, of use to optimizers, and equal to the kernels."""

import pickle
import time

import casadi
import numpy as np
import pytest
from hypothesis import given, settings

from acceptance import sample_size
from dhkit import Arm, DescriptionError, Friction
from dhkit.description import with_base, with_tool
from dhkit.description.poses import pose
from dynamics_reference import motions, tilted_arms

NAMES = {
    "fk": (["q"], ["T"]),
    "jacobian": (["q"], ["J"]),
    "mass_matrix": (["q"], ["M"]),
    "coriolis_matrix": (["q", "qd"], ["C"]),
    "gravity_torque": (["q"], ["g"]),
    "bias": (["q", "qd"], ["h"]),
    "inverse_dynamics": (["q", "qd", "qdd"], ["tau"]),
    "forward_dynamics": (["q", "qd", "tau"], ["qdd"]),
    "kinetic_energy": (["q", "qd"], ["K"]),
    "potential_energy": (["q"], ["V"]),
    "lagrange": (["q", "qd", "qdd"], ["tau"]),
}
ROUNDINGS = 1e-12


@pytest.fixture(scope="module")
def arm():
    return Arm.load("puma560")


@pytest.fixture(scope="module")
def placed(arm):
    turned = with_base(arm.description, pose((0.1, -0.2, 0.4), euler=(10, 20, 30), degrees=True))
    return Arm(with_tool(turned, pose((0.05, 0.02, 0.1), euler=(0, 45, 20), degrees=True)))


def close(a, b):
    a, b = np.array(a), np.array(b)
    return np.abs(a.ravel() - b.ravel()).max() <= ROUNDINGS * max(1.0, np.abs(b).max())


def test_functions_have_names_and_equal_the_kernels(arm):
    states = [state[0] for state in motions(arm.description, 1)]
    for name, (inputs, outputs) in NAMES.items():
        function = getattr(arm.casadi, name)
        assert (function.name(), function.name_in(), function.name_out()) == (name, inputs, outputs)
        kernel = "inverse_dynamics" if name == "lagrange" else name
        expected = getattr(arm, kernel)(*states[: len(inputs)])
        assert close(function(*states[: len(inputs)]), expected)
        assert function.size_out(0) == {0: (1, 1), 1: (6, 1)}.get(expected.ndim, expected.shape)
    assert arm.casadi is arm.casadi
    assert arm.casadi.fk is arm.casadi.fk


def test_deriving_everything_takes_little(law):
    seconds = []
    for _ in range(3):
        functions = Arm.load("puma560").casadi.layered()
        start = time.perf_counter()
        for name in NAMES:
            getattr(functions, name)
        seconds.append(time.perf_counter() - start)
    law.takes("seconds to derive the dynamics of the PUMA", min(seconds), 0.5)


@pytest.mark.slow
@settings(max_examples=max(5, sample_size(100)))
@given(tilted_arms(least=1))
def test_layers_of_any_arm(law, description):
    law.samples(100)
    arm = Arm(description)
    q, qd, x = (state[0] for state in motions(description, 1))
    mass, com, inertia = 1.7, [0.1, -0.2, 0.3], [0.02, 0.03, 0.025, 0.001, -0.002, 0.003]
    xx, yy, zz, xy, yz, xz = inertia
    loaded = arm.with_payload(mass, com, [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    wrench = np.array([1.0, 2.0, -3.0, 0.4, -0.5, 0.6])
    functions = arm.casadi.layered(friction=Friction(0.1), payload=True, wrench=True)
    load, more = (mass, com, inertia), {"wrench": wrench, "friction": Friction(0.1)}
    scale = np.abs(loaded.inverse_dynamics(q, qd, x, **more)).max()
    tau = functions.inverse_dynamics(q, qd, x, *load, wrench)
    error = np.abs(np.array(tau).ravel() - loaded.inverse_dynamics(q, qd, x, **more)).max() / max(
        scale, 1e-3
    )
    law.holds("tau with friction, payload and wrench", error, 1e-11, description)
    back = np.array(functions.forward_dynamics(q, qd, tau, *load, wrench)).ravel()
    cond = np.linalg.cond(loaded.mass_matrix(q))
    error = np.abs(back - x).max() / max(1.0, np.abs(back).max(), scale) / max(1.0, cond * 1e-3)
    law.holds("forward of inverse with all layers", error, 1e-11, description)
    for name in (
        "mass_matrix",
        "gravity_torque",
        "potential_energy",
        "coriolis_matrix",
        "kinetic_energy",
        "bias",
    ):
        states = (q, qd)[: len(NAMES[name][0])]
        found, expected = getattr(functions, name)(*states, *load), getattr(loaded, name)(*states)
        assert np.abs(np.array(found).ravel() - np.ravel(expected)).max() <= 1e-11 * max(
            1.0, np.abs(expected).max()
        )


def test_a_payload_on_a_placed_arm(placed):
    q = motions(placed.description, 1)[0][0]
    V = placed.casadi.layered(payload=True).potential_energy
    assert V.name_in() == ["q", "payload_mass", "payload_com", "payload_inertia"]
    lifted = float(V(q, 2.0, [0.1, 0, 0.2], np.zeros(6)) - V(q, 0.0, np.zeros(3), np.zeros(6)))
    point = placed.fk(q) @ [0.1, 0, 0.2, 1]
    assert lifted == pytest.approx(2.0 * 9.81 * point[2], rel=1e-12)


def test_friction_is_smooth_and_a_step(arm):
    q, qd, x = (state[0] for state in motions(arm.description, 1))
    for friction in (Friction(), Friction(0.2)):
        tau = arm.casadi.layered(friction=friction).inverse_dynamics(q, qd, x)
        assert close(tau, arm.inverse_dynamics(q, qd, x, friction=friction))
        at_rest = arm.casadi.layered(friction=friction).inverse_dynamics(q, 0 * qd, x)
        assert close(at_rest, arm.inverse_dynamics(q, 0 * qd, x))


def test_derivatives_of_functions(arm):
    q, qd, x = (state[0] for state in motions(arm.description, 1))
    symbols = [casadi.SX.sym(name, 6) for name in ("q", "qd", "qdd")]
    tau = arm.casadi.inverse_dynamics(*symbols)
    M = casadi.Function("M", symbols, [casadi.jacobian(tau, symbols[2])])
    assert close(M(q, qd, x), arm.mass_matrix(q))
    slope = arm.casadi.forward_dynamics.jacobian()
    assert slope.numel_out(0) == 36
    g = casadi.gradient(arm.casadi.potential_energy(symbols[0]), symbols[0])
    assert close(casadi.Function("g", [symbols[0]], [g])(q), arm.gravity_torque(q))


def test_an_optimizer_finds_where_gravity_pulls_least(arm):
    opti = casadi.Opti()
    q = opti.variable(6)
    opti.minimize(arm.casadi.potential_energy(q))
    opti.subject_to(opti.bounded(-1, q, 1))
    opti.solver("ipopt", {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"})
    found = opti.solve().value(q)
    assert arm.potential_energy(found) < arm.potential_energy(np.zeros(6))


def test_functions_can_be_stored(arm):
    functions = arm.casadi.layered(friction=Friction(0.3), wrench=True)
    assert repr(functions) == "<CasADi functions of puma560: Friction(width=0.3), wrench>"
    again = pickle.loads(pickle.dumps(functions))
    states = [state[0] for state in motions(arm.description, 1)]
    expected = functions.inverse_dynamics(*states, np.ones(6))
    assert close(again.inverse_dynamics(*states, np.ones(6)), expected)
    stored = pickle.loads(pickle.dumps(functions.inverse_dynamics))
    assert close(stored(*states, np.ones(6)), expected)
    assert close(casadi.Function.deserialize(stored.serialize())(*states, np.ones(6)), expected)


def test_an_arm_without_bodies_has_kinematics():
    functions = Arm.from_dh([(0, 0.1, 0.2, 0)] * 2).casadi
    assert functions.fk.size_out(0) == (4, 4)
    assert functions.jacobian.size_out(0) == (6, 2)
    with pytest.raises(DescriptionError, match="with_uniform_links"):
        _ = functions.mass_matrix
