"""What a prompt and a notebook show of every value that the public API hands out: a line, and a small table."""

from __future__ import annotations

import enum
import importlib
import inspect
import tempfile
import typing
import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from benchmarks.motion_report import MeshBuild, MotionReport, MotionRow
from benchmarks.simulation_report import BatchRow, SimulationReport, Timing

import dhkit
from dhkit import (
    bench,
    control,
    description,
    grading,
    kinematics,
    lab,
    model,
    planning,
    programs,
    report,
    symbolic,
    trajectories as motions,
)
from dhkit.control.batch_result import History
from dhkit.display import LONGEST_LINE, MOST_ROWS, html_table, plain, repr_line
from dhkit.dynamics import (
    ForwardDynamicsDerivatives,
    InverseDynamicsDerivatives,
    ParameterGrouping,
    dynamics_graph,
    parameter_grouping,
)
from dhkit.execution.isolation import Kind
from dhkit.expressions import Atom, Budget, Expression, parse
from dhkit.kernels import Kernel, SingleCall
from dhkit.kinematics.descent_program import descent_program
from dhkit.kinematics.polynomial.two_parallel_pose import pose_program
from dhkit.kinematics.programs import kinematic_kernels
from dhkit.lab.assignment import Goal, JointsAt, MotionBetween, OwnScore, Step, ToolAt
from dhkit.planning.certificate.checker import Check
from dhkit.symbolic import Loop, Pipeline, PipelineStep
from dhkit.symbolic.exact.regressor import regressor
from dhkit.symbolic.textbook_kinematics import TextbookKinematics
from dhkit.trajectories.pieces import Pieces
from dhkit.verification import Agreement, JointStates, VerificationReport, random_motions

LARGEST = 20_000
"""Bytes of HTML: a notebook keeps them with every cell."""
MANY = 100_000
HOSTILE = "<script>alert('1')</script>&amp;\x1b[31m\u202e\nnext \"line\" " * 40
"""From a file or a student: markup, controls, several lines, far too long."""
PACKAGES = (
    "bench",
    "control",
    "description",
    "dynamics",
    "execution",
    "expressions",
    "grading",
    "kernels",
    "kinematics",
    "lab",
    "model",
    "planning",
    "platforms",
    "programs",
    "report",
    "symbolic",
    "trajectories",
    "verification",
    "viewer",
)
ASSIGNMENT = """
kind = "assignment"
format = 1
title = "Stretch the arm"
robot = "planar2r"
[[step]]
title = "With the sliders"
[[step.goal]]
text = "The arm straight up"
joints = ["pi/2", 0]
"""


# What the values below are made of, each made once.


@cache
def folder():
    return tempfile.TemporaryDirectory(prefix="dhkit-reprs-")


def written(name, text):
    path = Path(folder().name) / name
    path.write_text(text)
    return path


@cache
def planar():
    return dhkit.Arm.load("planar2r")


@cache
def puma():
    return dhkit.Arm.load("puma560")


@cache
def long_arm():
    name = "l" * 64
    rows = [(0, 0.1, name, "pi/2")] * 32
    return dhkit.Arm.from_dh(rows, parameters={name: 1}, name="a" * 64)


@cache
def pose():
    return puma().fk("nominal")


@cache
def solutions():
    return puma().ik(pose())


def poses(*shape):
    return puma().ik(np.broadcast_to(pose(), (*shape, 4, 4)))


@cache
def space():
    return puma().workspace(1000)


@cache
def quintic():
    return planar().quintic([0.0, 0.0], [1.0, 0.5])


@cache
def plan():
    return planar().planner(intervals=12).solve([0.0, 0.0], [1.0, 0.5]).report


@cache
def run():
    return planar().simulate(dhkit.PID.tuned(planar()), quintic(), duration=0.02)


@cache
def runs():
    controller, q0 = dhkit.PDGravity.tuned(planar()), np.zeros((3, 2))
    return planar().simulate_batch(controller, quintic(), q0=q0, duration=0.02, keep="all")


@cache
def comparison():
    pids = {
        name: dhkit.PID.tuned(planar(), bandwidth)
        for name, bandwidth in (("slow", 5.0), (HOSTILE, 20.0))
    }
    return planar().compare(quintic(), pids, duration=0.02)


@cache
def grade():
    return planar().grade(g=["(m1/2 + m2)*g*l1*c1", "m2*g*l2*c2/2"])


def varied():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "task.toml")
        path.write_text('robot = "planar2r"\n[variants.parameters]\nl1 = [0.3, 0.6]\n')
        return grading.Variants.load(path)


def hostile_grade():
    wrong = [
        grading.Entry(
            "M", (0, k), grading.Verdict.WRONG, HOSTILE, statement=HOSTILE, difference=HOSTILE
        )
        for k in range(40)
    ]
    found = grading.Diagnosis(None, HOSTILE, "M", tuple(one.name for one in wrong), HOSTILE)
    return grading.GradeReport(
        "planar2r", entries=tuple(wrong), diagnosis=(found,) * 20, sheet=HOSTILE, student=HOSTILE
    )


@cache
def extraction():
    return model.extract_dh(written("planar2r.urdf", planar().urdf()), tip="tool")


@cache
def mesh():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    return model.TriangleMesh(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))


@cache
def mass():
    return model.shape_inertia(mesh(), density=6.0)


@cache
def assignment():
    return lab.Assignment.read(written("wave.toml", ASSIGNMENT))


def hostile_step():
    goal = Goal(HOSTILE, 1 / 3, OwnScore("fk", 1.0))
    return Step(HOSTILE, HOSTILE, None, (goal,) * 50)


@cache
def check():
    parts = (
        programs.Part("closes", 55.5, 60.0, "closes 925 of 1000 poses"),
        programs.Part("time", 10, 10, HOSTILE),
    )
    return programs.CheckReport("puma560", HOSTILE, {"ik": parts}, (HOSTILE,) * 9, 7)


@cache
def verification():
    fine = tuple(
        Agreement(f"quantity {k}", 1e-15, 1e-9, (1 / 3,) * 7, (0.2,) * 7) for k in range(30)
    )
    worst = Agreement("C qd", float("nan"), 1e-9, (1 / 3,) * 7)
    return VerificationReport(
        "puma560", f"Pinocchio {HOSTILE}", 1000, 0, (*fine, worst), (HOSTILE,) * 9
    )


@cache
def graph():
    return dynamics_graph("inverse_dynamics", planar().description)


@cache
def machine():
    return bench.Machine.here()


def row(contender, own, seconds):
    verdict = bench.Verdict(1.2345678901234567e-16, 7.999)
    return bench.Row(
        "fk",
        contender,
        bench.Mode.BATCH,
        own,
        1000,
        9,
        seconds,
        seconds,
        seconds,
        verdict,
        1.0,
        0.01,
    )


@cache
def timed():
    return bench.BenchReport(
        robot="puma560",
        batch=1000,
        threads=1,
        seed=0,
        rows=(row("dhkit fk(out=)", True, 1e-8), row(HOSTILE, False, 6e-7)),
        missing=(bench.Missing("ik", "EAIK", f"not installed: {HOSTILE}"),),
        outcomes=(
            bench.Outcome("fk", bench.Ending.COMPLETE),
            bench.Outcome("ik", bench.Ending.PEERS_FAILED, (HOSTILE,)),
        ),
        scaling=(bench.ThreadScaling("fk", 1.9, 1.95),),
        memory=(bench.PeakMemory("fk", "out=", 4_800_000, 12_800_000, 65_536),),
        starts=(bench.FirstCall("fk", 0.5123456789, 0.112345678),),
        requirements=(bench.Requirement("fk", "peer over dhkit", 10.0, False, 60.0),),
        machine=machine(),
    )


@cache
def timed_motions():
    found = MotionRow(1.0, HOSTILE, 100, 98, 1.1, 1.5, -0.001, 0.02, 0.04)
    return MotionReport("puma560", 100, 0, (found,) * 20, (MeshBuild(48, 1.5),), (), machine())


@cache
def timed_simulation():
    batch = BatchRow(HOSTILE, 1000, Timing(1e-6, 9e-7, 2e-6), 1.0, None)
    return SimulationReport(
        "puma560", 0, 9, (), (batch,) * 20, (), (), timed().requirements, (), machine()
    )


def long_sum():
    names = [f"parameter_{k}" for k in range(60)]
    return parse(" + ".join(names), names)


VALUES = {
    dhkit.Arm: puma,
    dhkit.View: lambda: dhkit.View(planar().description),
    # report
    report.Report: lambda: report.Report(Path("out/report.pdf"), (Path("out/report.pdf"),), 21),
    # bench
    bench.BenchReport: timed,
    bench.Contender: lambda: bench.Contender(
        "dhkit fk", "fk", bench.Mode.BATCH, lambda workload: None
    ),
    bench.Derivation: lambda: bench.Derivation(
        "puma560", "dhkit, CasADi functions, all of them", 1 / 3, 60.0
    ),
    bench.FirstCall: lambda: timed().starts[0],
    bench.Machine: machine,
    bench.Missing: lambda: timed().missing[0],
    bench.Operations: lambda: bench.Operations("inverse dynamics", 140, 162, 12),
    bench.Outcome: lambda: timed().outcomes[1],
    bench.PeakMemory: lambda: timed().memory[0],
    bench.Requirement: lambda: timed().requirements[0],
    bench.Row: lambda: timed().rows[1],
    bench.Task: lambda: bench.Task(lambda items: lambda: None, lambda count: []),
    bench.ThreadScaling: lambda: timed().scaling[0],
    bench.Verdict: lambda: timed().rows[0].verdict,
    bench.Workload: lambda: bench.Workload.of(planar(), 10, 1, 0),
    MotionReport: timed_motions,
    SimulationReport: timed_simulation,
    # control
    control.Adaptive: lambda: control.Adaptive.tuned(planar()),
    control.BatchResult: runs,
    control.Comparison: comparison,
    control.ComputedTorque: lambda: control.ComputedTorque.tuned(puma()),
    control.EnergyAudit: lambda: run().audit,
    control.ErrorNorms: lambda: run().tool_norms,
    control.FeedForward: lambda: control.FeedForward.tuned(puma()),
    control.FrictionCompensation: lambda: control.FrictionCompensation(
        control.PDGravity.tuned(puma())
    ),
    control.Held: lambda: control.Held(np.arange(6.0) / 3),
    control.LQR: lambda: control.LQR(planar(), np.zeros(2)),
    control.OperationalSpace: lambda: control.OperationalSpace.tuned(planar()),
    control.PDGravity: lambda: control.PDGravity.tuned(puma(), np.array([5.0, 10.0, 20.0])),
    control.PID: lambda: control.PID.tuned(puma()),
    control.Plant: lambda: control.Plant(puma().description, pushes=(control.Push((0, 0, -10)),)),
    control.Push: lambda: control.Push((0, 0, -10 / 3), link=3, begin=0.1, end=0.2),
    control.BatchOptions: lambda: control.BatchOptions(keep="all", threads=2),
    control.SimulationOptions: lambda: control.SimulationOptions(rate=500.0, plant=planar()),
    control.Sensors: lambda: control.Sensors(noise=np.full(6, 1e-4), differences=True),
    control.Setpoint: lambda: control.Setpoint(puma().description, *np.full((3, 6), 1 / 3)),
    control.SimulationResult: run,
    control.Sine: lambda: control.Sine(np.zeros(7), np.full(7, 1 / 3)),
    control.Step: lambda: control.Step(np.zeros(7), np.full(7, 1 / 3), time=0.5),
    control.ToolPoses: lambda: control.ToolPoses(
        planar(), [[0.6, 0.3, 0], [0.3, 0.6, 0]], [0.0, 1.0], [0.1, 0.9]
    ),
    History: lambda: runs().history,
    # description
    description.Base: lambda: puma().description.base,
    description.Body: lambda: puma().description.joints[1].bodies[0],
    description.Box: lambda: description.Box((long_sum(), long_sum(), long_sum())),
    description.Capsule: lambda: description.Capsule(long_sum(), parse("1/3")),
    description.Cylinder: lambda: description.Cylinder(parse("1/7"), parse("1/3")),
    description.DHTable: lambda: puma().dh,
    description.Description: lambda: puma().description,
    description.Coupling: lambda: dhkit.Arm.load("manutec_r3").description.couplings[0],
    description.Drive: lambda: puma().description.joints[0].drive,
    description.Inertia: lambda: puma().description.joints[1].body.inertia,
    description.Joint: lambda: puma().description.joints[0],
    description.Mesh: lambda: description.Mesh(f"meshes/{'a' * 120}.stl"),
    description.Named: lambda: puma().configurations,
    description.Numbers: lambda: puma().description.numbers,
    description.Payload: lambda: description.Payload(2.5, (1 / 3, 0, 0), np.eye(3) / 3),
    description.Placement: lambda: puma().description.base.placement,
    description.Shape: lambda: puma().description.joints[0].shapes[0],
    description.Sphere: lambda: description.Sphere(parse("1/3")),
    description.Tool: lambda: puma().description.tool,
    description.Units: lambda: puma().description.units,
    # dynamics, expressions, kernels
    Atom: lambda: Atom("sin", (long_sum(),)),
    Budget: Budget,
    Expression: long_sum,
    Kernel: lambda: kinematic_kernels(planar().description)[0],
    Loop: lambda: descent_program(planar().description, 3),
    Pipeline: lambda: pose_program((5, 6)),
    PipelineStep: lambda: pose_program((5, 6)).steps[-1],
    SingleCall: lambda: planar()._calls.fk,
    ForwardDynamicsDerivatives: lambda: planar().forward_dynamics_derivatives(
        [0, 0], [0, 0], [0, 0]
    ),
    InverseDynamicsDerivatives: lambda: planar().inverse_dynamics_derivatives(
        [0, 0], [0, 0], [0, 0]
    ),
    ParameterGrouping: lambda: parameter_grouping(puma().description),
    # grading
    grading.Credit: grading.Credit,
    grading.Diagnosis: lambda: grade().diagnosis[0],
    grading.Entry: lambda: grade().entries[1],
    grading.GradeOptions: lambda: grading.GradeOptions(seed=3, explain=False),
    grading.GradeReport: grade,
    grading.Mark: lambda: grading.Mark(
        "g2", 0.0, 100 / 3, "wrong by a mistake that has a long name " * 5
    ),
    grading.Marks: lambda: grading.marks(grade(), grading.Rubric()),
    grading.Note: lambda: grading.Note(grading.NoteKind.AGREES, "C", ("M", "g")),
    grading.Rubric: lambda: grading.Rubric(weights={f"A{k}": 1.0 for k in range(1, 90)}),
    grading.Variant: lambda: varied().of("ada", 1),
    grading.VariantKey: lambda: grading.VariantKey(Path("key"), 7, "0" * 64, {HOSTILE: {}}),
    grading.Variants: varied,
    grading.Witness: lambda: grade().entries[1].witness,
    # kinematics
    kinematics.Boundary: lambda: kinematics.boundaries(puma().description)[0],
    kinematics.Classification: lambda: puma().family,
    kinematics.Ellipsoid: lambda: kinematics.velocity_ellipsoid(puma(), np.full(6, 0.1)),
    kinematics.Estimate: lambda: space().estimate,
    kinematics.Grid: lambda: space().grid,
    kinematics.IKPath: lambda: puma().ik_path(np.repeat(pose()[None], 5, 0), "nominal"),
    kinematics.IKSolutions: solutions,
    kinematics.Singularities: lambda: puma().singularities(),
    kinematics.Workspace: space,
    # lab
    lab.Assignment: assignment,
    lab.Lab: lambda: lab.Lab(planar()),
    Goal: lambda: assignment().steps[0].goals[0],
    JointsAt: lambda: JointsAt(np.full(6, 1 / 3), 0.01),
    MotionBetween: lambda: MotionBetween(np.zeros(7), np.full(7, 1 / 3), 0.01, 2.0),
    OwnScore: lambda: OwnScore("ik", 1 / 3),
    Step: lambda: assignment().steps[0],
    ToolAt: lambda: ToolAt(pose(), True, 0.01, 0.1),
    # model
    model.CadImport: lambda: model.CadImport(
        planar().description, dict.fromkeys(range(30), mesh()), (HOSTILE,) * 9
    ),
    model.ExampleChain: lambda: model.ExampleChain(
        "example:ur5", Path("ur5.urdf"), None, "tool0", ("a",) * 6
    ),
    model.Extraction: extraction,
    model.MassProperties: lambda: mass().moved(np.eye(4)),
    model.Part: lambda: model.link_parts(planar().description)[0],
    model.ReportedMass: lambda: model.ReportedMass(HOSTILE, mass(), (), "report.txt, line 3"),
    model.Residual: lambda: model.Residual(
        1.2345678901234e-16, 2.3456789012345e-16, 3.4567890123456e-16, 100
    ),
    model.ShapeInertia: mass,
    model.TriangleMesh: mesh,
    # planning
    planning.BranchReport: lambda: planning.BranchReport(
        "right up flip", float("inf"), False, reason=HOSTILE
    ),
    planning.Certificate: lambda: plan().certificate,
    planning.Constraint: lambda: planning.ToolSpeed(0.5),
    planning.Distances: lambda: planar().distance(
        [0.0, 0.0], [planning.Obstacle.sphere(0.1, (0.4, 0.2, 0.9))]
    ),
    planning.Effort: planning.Effort,
    planning.Energy: lambda: planning.Energy(
        motor_constants=tuple(np.linspace(0.1, 0.3, 7).tolist())
    ),
    planning.Floor: lambda: planning.Floor(-0.1, HOSTILE),
    planning.Jerk: planning.Jerk,
    planning.MotorPower: lambda: planning.MotorPower(tuple(np.linspace(100, 300, 7) / 3)),
    planning.Objective: lambda: (
        planning.Time() + 0.01 * planning.Effort() + planning.Jerk() + planning.Energy()
    ),
    planning.Obstacle: lambda: planning.Obstacle.box((0.1, 0.2, 0.3), pose(), HOSTILE),
    planning.PathOptions: lambda: planning.PathOptions(
        obstacles=[planning.Obstacle.sphere(0.1, (1, 1, 1))] * 20
    ),
    planning.PlanOptions: lambda: planning.PlanOptions(via=[[0.1, 0.2]] * 20, clearance=0.02),
    planning.PlanReport: plan,
    planning.Planner: lambda: planar().planner(),
    planning.Progress: lambda: planning.Progress(12, 2 / 3, 1.2345678901234567e-8, 1 / 7, 1 / 3),
    planning.Time: planning.Time,
    planning.ToolAcceleration: lambda: planning.ToolAcceleration(5.0),
    planning.ToolDirection: lambda: planning.ToolDirection((1, 1, 1), (0.1, 0.2, 0.3)),
    planning.ToolOrientation: planning.ToolOrientation,
    planning.ToolSpeed: lambda: planning.ToolSpeed(0.5),
    planning.TorqueSpeedLine: lambda: planning.TorqueSpeedLine((1 / 3,) * 7, (2 / 3,) * 7),
    Check: lambda: Check("jump of velocity", -0.12345678901234567, 5, 0.98765432109876543),
    # programs
    programs.CheckReport: check,
    programs.CheckRubric: programs.CheckRubric,
    programs.Isolation: lambda: programs.Isolation(Kind.NONE, HOSTILE),
    programs.Limits: programs.Limits,
    programs.Part: lambda: check().functions["ik"][1],
    programs.Program: lambda: programs.Program(written("mine.py", "def fk(q):\n    return q\n")),
    # symbolic
    symbolic.BaseColumn: lambda: planar().base_parameters().columns[0],
    symbolic.BaseParameters: lambda: planar().base_parameters(),
    symbolic.CasadiFunctions: lambda: planar().casadi,
    symbolic.Element: lambda: planar().lagrangian.K,
    symbolic.ExactArm: lambda: planar().lagrangian.arm,
    symbolic.Friction: lambda: symbolic.Friction(0.3),
    symbolic.Graph: graph,
    symbolic.InverseDerivation: lambda: planar().symbolic.ik,
    symbolic.InverseProof: lambda: planar().symbolic.ik.prove(3),
    symbolic.InertialTable: lambda: symbolic.InertialTable.of(planar().description),
    symbolic.Lagrangian: lambda: planar().lagrangian,
    symbolic.MadeAt: lambda: symbolic.MadeAt("com_velocity", 2, "motor"),
    symbolic.Mistake: lambda: next(iter(symbolic.MISTAKES.values())),
    symbolic.Moments: lambda: symbolic.InertialTable.of(planar().description).links[0],
    symbolic.Node: lambda: graph().nodes[-1],
    symbolic.Proof: lambda: symbolic.Proof(
        HOSTILE, np.array([planar().lagrangian.K], dtype=object)
    ),
    symbolic.Regressor: lambda: regressor(planar().derive("inertial")),
    symbolic.SymbolicKinematics: lambda: planar().symbolic,
    symbolic.SymbolicMatrix: lambda: planar().symbolic.T,
    symbolic.SymbolicTable: lambda: symbolic.SymbolicTable.of(puma().description),
    symbolic.TextbookDerivation: lambda: symbolic.derive(planar().description),
    symbolic.Variable: lambda: graph().inputs[0],
    TextbookKinematics: lambda: planar().symbolic.derivation,
    # trajectories
    motions.JointPath: lambda: motions.JointPath.straight(planar().description, [0, 1], [1, 3]),
    motions.Limits: lambda: puma().limits,
    motions.Samples: lambda: quintic().sample(n=50),
    motions.ToolCircle: lambda: motions.tool_circle(pose(), pose()[:3, 3] + [0.1, 0, 0], (0, 0, 1)),
    motions.ToolLine: lambda: motions.tool_line(pose(), puma().fk("ready")),
    motions.Trajectory: quintic,
    Pieces: lambda: quintic().pieces,
    # verification
    Agreement: lambda: verification().agreements[0],
    JointStates: lambda: random_motions(puma().description, 10),
    VerificationReport: verification,
}
"""A value of every class that somebody gets from the public API, and of some that these hold."""

VARIANTS = {
    "arm of 32 joints": long_arm,
    "limits of 32 joints": lambda: long_arm().limits,
    "samples of 32 joints": lambda: (
        long_arm().quintic(np.zeros(32), np.ones(32), duration=1.0).sample(n=50)
    ),
    "100,000 poses": lambda: poses(MANY),
    "poses in a grid": lambda: poses(2, 3),
    "no poses": lambda: poses(0),
    "pose out of reach": lambda: puma().ik(dhkit.pose((3, 0, 0))),
    "no pose": lambda: puma().ik(np.full((4, 4), np.nan)),
    "singular pose": lambda: puma().ik(puma().fk(np.zeros(6))),
    "numeric solution": lambda: puma().ik_numeric(pose()),
    "hostile branches": lambda: replace(
        solutions(), branches=tuple(f"{k} {HOSTILE}" for k in range(8))
    ),
    "path of 100,000 poses, lost": lambda: kinematics.IKPath(
        np.zeros((MANY, 6)), (HOSTILE,) * MANY, (5,), tuple(range(MANY)), 0.0, tuple(range(MANY))
    ),
    "empty path": lambda: kinematics.IKPath(np.zeros((0, 6)), (), (), (), 0.0, ()),
    "100,000 samples": lambda: quintic().sample(n=MANY),
    "workspace that is a point": lambda: dhkit.Arm.from_dh([(0, 0, 0, 0)]).workspace(10),
    "ellipsoids": lambda: kinematics.velocity_ellipsoid(puma(), np.zeros((5, 6))),
    "hostile sheet": hostile_grade,
    "hostile entry": lambda: hostile_grade().entries[0],
    "hostile diagnosis": lambda: hostile_grade().diagnosis[0],
    "hostile note": lambda: grading.Note(grading.NoteKind.PROGRAM, HOSTILE, (HOSTILE,)),
    "hostile marks": lambda: grading.Marks(
        0.0, 10.0, (), (grading.Mark(HOSTILE, 0.0, 1.0, HOSTILE),) * 40
    ),
    "unreadable sheet": lambda: grading.GradeReport(sheet=HOSTILE, error=HOSTILE),
    "empty sheet": grading.GradeReport,
    "hostile assignment": lambda: lab.Assignment(HOSTILE, planar(), None, None, (hostile_step(),)),
    "hostile extraction": lambda: model.Extraction(
        planar().description, extraction().residual, (HOSTILE,) * 30, (HOSTILE,) * 30, None
    ),
    "empty mesh": lambda: model.TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=int)),
    "run that failed": lambda: replace(run(), q=np.full_like(run().q, np.nan), controller=HOSTILE),
    "runs that failed": lambda: replace(runs(), q=np.full_like(runs().q, np.nan)),
    "nothing compared": lambda: control.Comparison({}, {HOSTILE: HOSTILE}),
    "hostile plan": lambda: replace(
        plan(),
        objective=HOSTILE,
        tightened=(HOSTILE,),
        branches=(planning.BranchReport(HOSTILE, 1.0, False, reason=HOSTILE),) * 20,
    ),
    "nothing limited": lambda: planning.Certificate((), 24, "Pinocchio", (), 0.0),
    "nothing to check": lambda: planar().distance([0.0, 0.0]),
    "distances with NaN": lambda: planar().distance(
        [[0.0, 0.0], [np.nan, 0.0]], [planning.Obstacle.sphere(0.1, (0.4, 0.2, 0.9), HOSTILE)]
    ),
    "long equations": lambda: puma().lagrangian,
    "long element": lambda: puma().lagrangian.M[0, 0],
    "long matrix": lambda: puma().symbolic.J,
    "more base parameters": lambda: symbolic.base_parameters(
        dhkit.Arm.load("planar3r").description
    ),
}
"""The same classes at their edges: batches, nothing at all, and texts that are not meant well."""


@cache
def value(key):
    return {**VALUES, **VARIANTS}[key]()


def named(key):
    return (
        key
        if isinstance(key, str)
        else f"{key.__module__.removeprefix('dhkit.')}.{key.__qualname__}"
    )


@pytest.fixture(scope="module", autouse=True)
def _closed():
    yield
    for cls in (dhkit.View, lab.Lab):
        value(cls).close()
    folder().cleanup()


def exported():
    """Return every class that the public API names, but exceptions, enumerations and protocols."""
    found = set()
    for package in ("dhkit", *(f"dhkit.{name}" for name in PACKAGES)):
        module = importlib.import_module(package)
        found |= {one for name in module.__all__ if inspect.isclass(one := getattr(module, name))}
    special = (BaseException, enum.Enum)
    found = {one for one in found - {typing.Any} if not issubclass(one, special)}
    return {one for one in found if not getattr(one, "_is_protocol", False)}


def test_every_class_of_the_public_api_is_here():
    assert {named(one) for one in exported()} - {named(one) for one in VALUES} == set()


def test_every_package_is_searched():
    folders = {path.parent.name for path in Path(dhkit.__file__).parent.glob("*/__init__.py")}
    assert folders - set(PACKAGES) == {"cli", "scale"}, "these have functions alone"


@pytest.mark.parametrize("key", [*VALUES, *VARIANTS], ids=named)
def test_a_repr_is_one_short_line(key):
    found = value(key)
    assert isinstance(key, str) or isinstance(found, key)
    line = repr(found)
    assert line.isprintable() and 0 < len(line) <= LONGEST_LINE, line
    assert "array(" not in line, line


MARKUP = {"body", "div", "b", "table", "caption", "thead", "tbody", "tr", "th", "td", "ul", "li"}


@pytest.mark.parametrize(
    "key", [key for key in [*VALUES, *VARIANTS] if key is not dhkit.View], ids=named
)
def test_what_a_notebook_shows_is_small_well_formed_and_escaped(key):
    found = value(key)  # but a view, which shows a page
    assert len(getattr(found, "_repr_latex_", str)() or "") < LARGEST
    html = getattr(found, "_repr_html_", str)()
    assert len(html.encode()) < LARGEST
    root = ET.fromstring(f"<body>{html}</body>")
    assert {node.tag for node in root.iter()} <= MARKUP
    assert "".join(root.itertext()).isprintable()
    attributes = {
        value for node in root.iter() for key, value in node.attrib.items() if key != "colspan"
    }
    assert attributes <= {"text-align:left", "text-align:right", "mathjax_ignore tex2jax_ignore"}
    assert all(len(table.findall("tbody/tr")) <= 33 for table in root.iter("table"))


@pytest.mark.parametrize(
    "cls",
    [
        dhkit.Arm,
        bench.BenchReport,
        MotionReport,
        SimulationReport,
        control.BatchResult,
        control.Comparison,
        control.EnergyAudit,
        control.SimulationResult,
        description.DHTable,
        description.Description,
        grading.Entry,
        grading.GradeReport,
        grading.Marks,
        kinematics.IKPath,
        kinematics.IKSolutions,
        kinematics.Singularities,
        kinematics.Workspace,
        lab.Assignment,
        model.CadImport,
        model.Extraction,
        motions.Limits,
        motions.Samples,
        planning.Certificate,
        planning.PlanReport,
        programs.CheckReport,
        symbolic.BaseParameters,
        symbolic.InverseDerivation,
        VerificationReport,
    ],
    ids=named,
)
def test_what_has_more_to_tell_has_html(cls):
    assert value(cls)._repr_html_()


def cells(html):
    """Return the texts of the cells of a piece of HTML's last table, row by row, its headings first."""
    *_, table = ET.fromstring(f"<body>{html}</body>").iter("table")
    return [["".join(cell.itertext()) for cell in row] for row in table.iter("tr")]


def test_solutions_show_their_branches_in_degrees():
    found = solutions()
    headings, *rows = cells(found._repr_html_())
    assert headings == ["branch", *(f"q{i} [°]" for i in range(1, 7)), "limits", "special"]
    assert [row[0] for row in rows] == list(found.branches)
    assert np.allclose(
        [[float(x) for x in row[1:7]] for row in rows], np.degrees(found.q), rtol=0, atol=0.00501
    )
    assert [row[7] == "inside" for row in rows] == found.allowed.tolist()


def test_solutions_of_arms_that_slide_show_metres():
    arm = dhkit.Arm.load("stanford")
    q = arm.configurations["nominal"]
    found = arm.ik(arm.fk(q))
    headings, *rows = cells(found._repr_html_())
    assert headings[3] == "q3 [m]"
    assert any(abs(float(row[3]) - q[2]) < 1e-4 for row in rows)


def test_branches_that_do_not_reach_have_no_numbers():
    arm = dhkit.Arm.load("irb140")
    # Far in front: beyond reach for an arm that leans back over.
    found = arm.ik(arm.fk([0, 1.5, -1.4, 0, 0.5, 0]))
    assert 0 < found.valid.sum() < len(found)
    rows = [
        row
        for row, reached in zip(cells(found._repr_html_())[1:], found.valid, strict=True)
        if not reached
    ]
    assert {row[1] for row in rows} == {"–"} and {row[-1] for row in rows} == {"not reached"}
    assert "<table>" not in value("pose out of reach")._repr_html_()


def test_special_branches_are_said_to_be():
    *_, special = zip(*cells(value("singular pose")._repr_html_())[1:], strict=True)
    assert any("elbow" in one or "wrist" in one or "shoulder" in one for one in special)


def test_a_batch_shows_counts_and_its_first_poses():
    rows = cells(value("100,000 poses")._repr_html_())
    assert rows[1][:4] == ["0", "ok", "8", "3"]
    assert rows[-1] == [f"… and {MANY - 5} more"]


def test_poses_of_a_path_share_a_line_where_the_same_is_to_be_said():
    names = ("up", "up", "down", "", "", "up")
    path = kinematics.IKPath(np.zeros((6, 2)), names, (2,), (3, 4), 0.0, (0, 1))
    assert cells(path._repr_html_())[1:] == [
        ["0 to 1", "near a singularity", "up"],
        ["2", "switched", "down"],
        ["3 to 4", "lost", "–"],
    ]


def test_a_grade_shows_what_is_wrong_first():
    rows = cells(
        planar().grade(g=["(m1/2 + m2)*g*l1*c1 + m2*g*l2*c12/2", "m2*g*l2*c2/2"])._repr_html_()
    )
    assert [row[:2] for row in rows[1:]] == [["g2", "wrong"], ["g1", "correct"]]


def test_limits_that_are_not_there_are_unlimited():
    headings, *rows = cells(planar().limits._repr_html_())
    assert headings[4] == "acceleration"
    assert {row[4] for row in rows} == {"unlimited"}


def test_a_closed_view_and_a_token_are_not_shown():
    with dhkit.View(planar().description, token="a-secret-token") as view:
        assert "a-secret-token" in view.url and "a-secret-token" not in repr(view)
    assert repr(view) == "<View of planar2r: closed>"


def test_a_long_name_gives_way_to_what_is_said():
    line = repr_line("Samples", "a" * 500, "50 times from 0 to 2 s")
    assert len(line) == LONGEST_LINE
    assert line.endswith("a…: 50 times from 0 to 2 s>")
    assert repr_line("Samples", "a" * 500, "b" * 500).startswith(f"<Samples of {'a' * 39}…: bbb")


def test_text_is_one_line_that_commands_nothing():
    assert plain("two\nlines\x1b[31m \u202e\ud800", 40) == "two lines?[31m ??"
    assert plain("a" * 1_000_000, 10) == "aaaaaaaaa…"


def test_a_table_says_how_many_rows_it_leaves_out():
    rows = cells(html_table(("row",), [(str(k),) for k in range(30)]))
    assert len(rows) == MOST_ROWS + 2
    assert rows[-1] == [f"… and {30 - MOST_ROWS} more"]
