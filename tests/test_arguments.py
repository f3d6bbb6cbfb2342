"""What public functions accept: an arm wherever a description goes, a configuration's name wherever joint values go."""

from __future__ import annotations

import importlib
import inspect
import os
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import argument_table
import dhkit
from dhkit import (
    Arm,
    control,
    description,
    dynamics,
    grading,
    kinematics,
    model,
    planning,
    programs,
    symbolic,
    trajectories,
    verification,
)
from dhkit.errors import DescriptionError
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
    odd = [
        name
        for name, one in listed.items()
        if not hasattr(one, "takes_robot") and name.split(".")[1] not in WITHIN
    ]
    assert odd == []


Q = [0.3, 0.4]
MOTION = Path(tempfile.mkdtemp()) / "motion.npz"
Arm.load("planar2r").quintic([0, 0], [1, 1], 1.0).save(MOTION)
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
    "trajectory": lambda arm: (
        trajectories.Trajectory(arm, [0, 1], np.zeros((1, 2, 2))).description.name
    ),
    "urdf": model.urdf_text,
    "pinocchio": lambda arm: model.pinocchio_model(arm).nq,
    "joint array": lambda arm: description.joint_array(arm, Q),
    "Limits.of": lambda arm: trajectories.Limits.of(arm).velocity,
    "DHTable.of": lambda arm: str(description.DHTable.of(arm)),
    "symbolic table": lambda arm: repr(symbolic.SymbolicTable.of(arm)),
    "moving plant": lambda arm: Arm.load("planar2r").simulate(plant=arm, duration=0.01).q,
    "plants": lambda arm: (
        Arm.load("planar2r").simulate_batch(plant=[arm], duration=0.01).peak_error
    ),
    "replace": lambda arm: View(Arm.load("puma560")).replace(arm, [0.1, 0.2]) or 0,
    "read_motion": lambda arm: trajectories.read_motion(MOTION, arm).duration,
    "lab": lambda arm: dhkit.lab.Lab(arm).desk.arm.name,
}


@pytest.mark.parametrize("name", CALLS)
def test_an_arm_and_its_description_give_the_same(name):
    arm = Arm.load("planar2r")
    for_arm = CALLS[name](arm)
    assert np.array_equal(
        np.asarray(for_arm), np.asarray(CALLS[name](arm.description if name != "ik" else arm))
    )


def test_what_is_no_robot_is_said():
    with pytest.raises(TypeError, match="found str; expected an arm or its description"):
        kinematics.forward_kinematics("puma560", Q)


LINE = dhkit.pose((0, 0, 0.02))
CENTRE = Arm.load("puma560").fk("nominal")[:3, 3] + [0, 0, 0.05]
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
    "link transforms": lambda arm, q: description.link_transforms(arm, q),
    "within_limits": lambda arm, q: arm.ik(arm.fk("ready")).within_limits(q),
    "nearest": lambda arm, q: arm.ik(arm.fk("ready")).nearest(q),
    "require": lambda arm, q: arm.ik(arm.fk("ready")).require(q),
    "ik_chunks": lambda arm, q: next(arm.ik_chunks(arm.fk("ready")[None], seed=q))[1].q,
    "spline": lambda arm, q: arm.spline([q, "ready"]).q(0.2),
    "straight_line": lambda arm, q: arm.straight_line(
        arm.fk("nominal"), LINE @ arm.fk("nominal"), q
    ).q(0.1),
    "circle": lambda arm, q: arm.circle(arm.fk("nominal"), CENTRE, [1, 0, 0], 0.3, q0=q).q(0.1),
    "joint path": lambda arm, q: dhkit.JointPath.straight(arm.description, q, np.zeros(6)).q(0.5),
    "plan": lambda arm, q: arm.plan(q, "ready", intervals=12, compare=False).q(0.1),
    "plan via": lambda arm, q: arm.plan("zero", "ready", via=[q], intervals=12, compare=False).q(
        0.3
    ),
    "compare": lambda arm, q: (
        arm.compare(arm.quintic(q, "ready", 1.0), ("pid",), q0=q, duration=0.01).results["pid"].q
    ),
    "simulate_batch": lambda arm, q: (
        arm.simulate_batch(q0=q, duration=0.01, friction=False).peak_error
    ),
    "hold": lambda arm, q: arm.simulate(reference=q, duration=0.01).q,
    "LQR": lambda arm, q: dhkit.LQR(arm, q).K,
    "PID.tuned": lambda arm, q: dhkit.PID.tuned(arm, q=q).kp,
    "ToolPoses": lambda arm, q: dhkit.ToolPoses(
        arm, [arm.fk("nominal"), LINE @ arm.fk("nominal")], [0, 1], q0=q
    ).sampled(np.array([0.5]))[0],
    "ellipsoid": lambda arm, q: kinematics.velocity_ellipsoid(arm, q).axes,
    "regressor": lambda arm, q: dynamics.regressor(arm, q, np.ones(6), np.ones(6)),
}


@pytest.mark.parametrize("name", POSITIONS)
def test_joint_values_may_be_a_configurations_name(name):
    arm = Arm.load("puma560")
    # From here on kernels are compiled, or not, in all calls: both differ by rounding.
    POSITIONS[name](arm, "nominal")
    named = POSITIONS[name](arm, "nominal")
    assert np.array_equal(
        named, POSITIONS[name](arm, arm.configurations["nominal"]), equal_nan=True
    )
    with pytest.raises(
        (ValueError, dhkit.DhkitError), match="puma560 has no configuration 'nomnal'; it has"
    ):
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
        if argument.kind is argument.VAR_KEYWORD
        and not str(argument.annotation).startswith("Unpack[")
        and name not in ("grade", "with_parameters")
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
    options, own = (
        inspect.signature(function).parameters,
        inspect.signature(getattr(Arm, method)).parameters,
    )
    for name, option in options.items():
        if option.kind is option.KEYWORD_ONLY and name not in ("plant", "compare"):
            assert own[name].default == option.default, name


def test_no_public_function_takes_a_thing_otherwise_than_the_others():
    odd = {row.name: row.odd for row in argument_table.rows() if row.odd}
    assert odd == {}


def test_the_table_of_arguments_is_that_of_the_signatures():
    """To bring it up to date: DHKIT_WRITE_TABLES=1 pytest tests/test_arguments.py."""
    path = Path(__file__).parent.parent / "docs" / "arguments.md"
    if os.environ.get("DHKIT_WRITE_TABLES"):
        path.write_text(argument_table.table(), "utf-8")
    assert path.read_text("utf-8") == argument_table.table()


@pytest.mark.parametrize("path", [str, Path])
def test_files_are_named_by_text_or_path(path, tmp_path):
    arm = Arm.load("planar2r")
    file = path(tmp_path / "arm.toml")
    arm.save(file)
    assert Arm.load(file) == arm
    motion = arm.quintic([0, 0], [1, 1], 1.0)
    assert trajectories.Trajectory.load(motion.save(path(tmp_path / "motion.npz")), arm) == motion
    (tmp_path / "rubric.toml").write_text("points = 10")
    assert grading.Rubric.read(path(tmp_path / "rubric.toml")).points == 10
    (tmp_path / "masses.csv").write_text("link, mass [kg]\n1, 2\n2, 3\n")
    with suppress(dhkit.ModelError):  # what is in it is not the question here
        model.read_mass_report(path(tmp_path / "masses.csv"))
    (tmp_path / "mine.py").write_text("def fk(q):\n    return q\n")
    assert programs.Program(path(tmp_path / "mine.py")).name == "mine.py"
    (tmp_path / "answer.toml").write_text('format = 1\n[answer]\ng2 = "m2*g*l2*c12/2"\n')
    for robot in (arm, arm.description):
        assert grading.grade(path(tmp_path / "answer.toml"), robot).verdict.value == "incomplete"


def test_batches_take_arms_too():
    arm = Arm.load("planar2r")
    heavy = arm.with_payload(1.0)
    both = control.simulate_batch(arm, plant=[arm, heavy], duration=0.02, friction=False)
    assert both.arms == (arm.description, heavy.description)


def test_a_rubric_decides_how_many_digits_count():
    from dhkit.grading import Rubric

    arm = Arm.load("planar2r")
    loose, strict = (
        arm.grade(M22="0.333*m2*l2^2", rubric=Rubric(digits=digits)) for digits in (3, 5)
    )
    # Right, as far as it goes.
    assert (loose.verdict.value, strict.verdict.value) == (
        "incomplete",
        "wrong",
    )


def test_what_an_arm_returns_is_exported():
    """A reader can write the type of everything that the front door gives."""
    import re

    returned = set()
    for name, one in inspect.getmembers(Arm):
        function = one.fget if isinstance(one, property) else getattr(one, "func", one)
        if not name.startswith("_") and callable(function) and not inspect.isclass(function):
            returned |= set(
                re.findall(r"[A-Z]\w+", str(inspect.signature(function).return_annotation))
            )
    foreign = {"Array", "Iterator", "Mapping", "None", "Path", "PinocchioModel"}
    assert returned - foreign <= set(dhkit.__all__)
    assert all(hasattr(dhkit, name) for name in dhkit.__all__)


def test_a_robot_where_a_description_or_gains_are_expected_gets_the_cure(tmp_path, caplog):
    arm = dhkit.Arm.load("planar2r")
    with pytest.raises(TypeError, match=r"found 'puma560'; .* Arm.load\('puma560'\) reads a robot"):
        dhkit.Arm("puma560")
    with pytest.raises(TypeError, match="found a Arm; expected a Description"):
        dhkit.Arm(arm)
    with pytest.raises(
        TypeError, match=r"kp is a robot; expected gains, which PID.tuned\(arm\) computes"
    ):
        dhkit.PID(arm)
    (tmp_path / "bare.csv").write_text("0,0.1,0.2\n0.1,0.2,0.3\n")
    with pytest.raises(DescriptionError, match="no header: the first line has numbers"):
        dhkit.Trajectory.read(tmp_path / "bare.csv", arm)
    (tmp_path / "degrees.csv").write_text("t,q1,q2\n0,10,20\n0.1,20,30\n0.2,35,40\n")
    dhkit.Trajectory.read(tmp_path / "degrees.csv", arm)
    assert (
        "were degrees meant?" in caplog.text
        and "degrees=True (--degrees) reads them" in caplog.text
    )
    caplog.clear()
    dhkit.Trajectory.read(tmp_path / "degrees.csv", arm, degrees=True)
    assert caplog.text == ""
