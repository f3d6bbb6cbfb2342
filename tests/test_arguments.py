"""What public functions accept: an arm wherever a description goes, a configuration's name wherever joint values go."""

from __future__ import annotations

import importlib
import inspect

import numpy as np
import pytest

import dhkit
from dhkit import (
    Arm,
    control,
    description,
    dynamics,
    kinematics,
    model,
    planning,
    symbolic,
    trajectories,
    verification,
)
from dhkit.viewer import View

PACKAGES = [
    "description",
    "kinematics",
    "dynamics",
    "symbolic",
    "verification",
    "trajectories",
    "planning",
    "control",
    "viewer",
    "model",
    "grading",
]
WITHIN = {"exact_arm", "joint_array", "joint_vector"}
"""Functions that look for themselves whether they were given an arm: they are called for every batch."""


def functions_of_descriptions():
    """Return the public functions whose first argument is a description, by name."""
    for package in PACKAGES:
        module = importlib.import_module(f"dhkit.{package}")
        for name in module.__all__:
            one = getattr(module, name)
            if not inspect.isroutine(inspect.unwrap(one)):
                continue
            arguments = list(inspect.signature(one).parameters.values())
            if arguments and arguments[0].name == "description":
                yield f"{package}.{name}", one


def test_every_function_of_a_description_takes_an_arm():
    listed = dict(functions_of_descriptions())
    assert len(listed) > 60
    odd = [name for name, one in listed.items() if not hasattr(one, "takes_robot") and name.split(".")[1] not in WITHIN]
    assert odd == []


Q = [0.3, 0.4]
CALLS = {
    "fk": lambda arm: kinematics.forward_kinematics(arm, Q),
    "ik": lambda arm: kinematics.inverse_kinematics(arm, arm.fk(Q)).q,
    "classify": lambda arm: kinematics.classify(arm).words,
    "M": lambda arm: dynamics.mass_matrix(arm, Q),
    "tau": lambda arm: dynamics.inverse_dynamics(description=arm, q=Q, qd=Q, qdd=Q),
    "lagrangian": lambda arm: symbolic.lagrangian(arm).text(),
    "exact arm": lambda arm: symbolic.exact_arm(arm).description.name,
    "random states": lambda arm: verification.random_states(arm, 3),
    "quintic": lambda arm: trajectories.quintic(arm, [0, 0], [1, 1], 1.0).q(0.3),
    "linearize": lambda arm: control.linearize(arm, Q)[0],
    "toml": description.to_toml,
    "with tool": lambda arm: description.with_tool(arm, np.eye(4)).name,
    "planner": lambda arm: planning.Planner(arm).limits.velocity,
    "view": lambda arm: View(arm).description.name,
    "casadi": lambda arm: float(symbolic.CasadiFunctions(arm).mass_matrix(Q)[0, 0]),
    "plant": lambda arm: control.Plant(arm).description.name,
    "trajectory": lambda arm: trajectories.Trajectory(arm, [0, 1], np.zeros((1, 2, 2))).description.name,
    "urdf": model.urdf_text,
    "pinocchio": lambda arm: model.pinocchio_model(arm).nq,
    "joint array": lambda arm: description.joint_array(arm, Q),
}


@pytest.mark.parametrize("name", CALLS)
def test_an_arm_and_its_description_give_the_same(name):
    arm = Arm.load("planar2r")
    for_arm = CALLS[name](arm)
    assert np.array_equal(np.asarray(for_arm), np.asarray(CALLS[name](arm.description if name != "ik" else arm)))


def test_what_is_no_robot_is_said():
    with pytest.raises(TypeError, match="found str; expected an arm or its description"):
        kinematics.forward_kinematics("puma560", Q)


POSITIONS = {
    "fk": lambda arm, q: arm.fk(q),
    "frames": lambda arm, q: arm.frames(q),
    "jacobian": lambda arm, q: arm.jacobian(q),
    "jacobian_dot": lambda arm, q: arm.jacobian_dot(q, np.ones(6)),
    "mass_matrix": lambda arm, q: arm.mass_matrix(q),
    "coriolis_matrix": lambda arm, q: arm.coriolis_matrix(q, np.ones(6)),
    "gravity_torque": lambda arm, q: arm.gravity_torque(q),
    "bias": lambda arm, q: arm.bias(q, np.ones(6)),
    "inverse_dynamics": lambda arm, q: arm.inverse_dynamics(q, np.ones(6), np.ones(6)),
    "forward_dynamics": lambda arm, q: arm.forward_dynamics(q, np.ones(6), np.ones(6)),
    "kinetic_energy": lambda arm, q: arm.kinetic_energy(q, np.ones(6)),
    "potential_energy": lambda arm, q: arm.potential_energy(q),
    "manipulability": lambda arm, q: arm.manipulability(q),
    "linearize": lambda arm, q: arm.linearize(q)[0],
    "ik_numeric": lambda arm, q: arm.ik_numeric(arm.fk(np.full(6, 0.3)), q).q,
    "ik seed": lambda arm, q: arm.ik(arm.fk(np.full(6, 0.3)), q).q,
    "ik_path": lambda arm, q: arm.ik_path(np.repeat(arm.fk("nominal")[None], 3, axis=0), q).q,
    "distance": lambda arm, q: arm.distance(q, self_collision=True).distance,
    "quintic": lambda arm, q: arm.quintic(q, np.zeros(6), 1.0).q(0.4),
    "cubic": lambda arm, q: arm.cubic(np.zeros(6), q, 1.0).q(0.4),
    "trapezoidal": lambda arm, q: arm.trapezoidal(q, np.zeros(6), 2.0).q(0.4),
    "simulate": lambda arm, q: arm.simulate(q0=q, duration=0.01).q,
    "frames of the description": lambda arm, q: description.world_to_frames(arm, q),
}


@pytest.mark.parametrize("name", POSITIONS)
def test_joint_values_may_be_a_configurations_name(name):
    arm = Arm.load("puma560")
    named = POSITIONS[name](arm, "nominal")
    assert np.array_equal(named, POSITIONS[name](arm, arm.configurations["nominal"]), equal_nan=True)
    with pytest.raises((ValueError, dhkit.DhkitError), match="puma560 has no configuration 'nomnal'; it has"):
        POSITIONS[name](arm, "nomnal")


def test_speeds_and_torques_have_no_names():
    arm = Arm.load("puma560")
    with pytest.raises(TypeError, match="qd: found 'ready'; expected numbers"):
        arm.bias("ready", "ready")
    with pytest.raises(TypeError, match="tau: found 'ready'; expected numbers"):
        arm.forward_dynamics("ready", np.zeros(6), "ready")


def test_methods_of_an_arm_have_signatures():
    """A misspelt option is an error at the front door, and an editor shows what there is."""
    free = [
        name
        for name, one in inspect.getmembers(Arm, inspect.isfunction)
        if not name.startswith("_")
        for argument in inspect.signature(one).parameters.values()
        if argument.kind is argument.VAR_KEYWORD and name not in ("grade", "with_parameters")
    ]
    assert free == []


@pytest.mark.parametrize(
    ("method", "function"),
    [
        ("ik_numeric", kinematics.solve_numerically),
        ("workspace", kinematics.workspace),
        ("plan", planning.Planner.solve),
        ("plan_path", planning.along_path),
        ("compare", control.compare),
        ("simulate", control.simulate),
    ],
)
def test_a_method_has_the_options_and_defaults_of_its_function(method, function):
    options, own = inspect.signature(function).parameters, inspect.signature(getattr(Arm, method)).parameters
    for name, option in options.items():
        if option.kind is option.KEYWORD_ONLY and name not in ("plant", "compare"):
            assert own[name].default == option.default, name


def test_a_rubric_decides_how_many_digits_count():
    from dhkit.grading import Rubric

    arm = Arm.load("planar2r")
    loose, strict = (arm.grade(M22="0.333*m2*l2^2", rubric=Rubric(digits=digits)) for digits in (3, 5))
    assert (loose.verdict.value, strict.verdict.value) == ("incomplete", "wrong")  # right, as far as it goes


def test_what_an_arm_returns_is_exported():
    """A reader can write the type of everything that the front door gives."""
    import re

    returned = set()
    for name, one in inspect.getmembers(Arm):
        function = one.fget if isinstance(one, property) else getattr(one, "func", one)
        if not name.startswith("_") and callable(function) and not inspect.isclass(function):
            returned |= set(re.findall(r"[A-Z]\w+", str(inspect.signature(function).return_annotation)))
    foreign = {"Array", "Iterator", "Mapping", "None", "Path", "PinocchioModel"}
    assert returned - foreign <= set(dhkit.__all__)
    assert all(hasattr(dhkit, name) for name in dhkit.__all__)
