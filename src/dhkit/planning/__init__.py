"""Optimal trajectories: objectives, constraints, the planner, and certificates of the limits of a motion.

The way from a request to a motion, through rooms (folders) and files::

    Planner.solve (planner.py, many.py)              along_path (along/)
          │ start, goal, via, options                     │ path, options
          └───────────────────────┬───────────────────────┘
                                  v
    request/         places and the routes through them, options, ─────────────> PlanningError:
                     reasons why no motion can exist                             which limit or place
                                  │ task: the configurations of one route, with
                                  │       objective, limits, constraints, obstacles
                                  v
    search/    ┌────────> solve one program         program/: a motion as variables on a mesh and
               │                  │                           blocks of rows, and Ipopt, which solves it
               │                  v
               │          certify its motion        certificate/: limits on a dense grid by Pinocchio,
        tighten the limits        │                               distances at its states and between them
        in their intervals        │
               │   some exceeded  │  all kept
               └──────────────────┤
                                  v
    plan_report.py   cost, certificate, other branches, classical motions to compare with
                                  │
                                  v
                     Trajectory with its report

    Around obstacles, search/avoiding.py repeats this loop from sampled paths, with planes that keep pairs apart.

    Under all of them:
    criteria/        objectives and constraints: in symbols for program/, in numbers for certificate/
    obstacles/       scenes, capsules around links, exact distances, separating planes
    second_check/    other code, which searches a certified motion for violations that the certificate overlooked

A room imports only rooms below it: planner and along > report > search and request > program > certificate >
second_check > criteria and obstacles.
"""

from dhkit.description import Payload
from dhkit.planning.along import along_path
from dhkit.planning.certificate import Certificate, certify
from dhkit.planning.criteria import (
    Constraint,
    Effort,
    Energy,
    Jerk,
    MotorPower,
    Objective,
    ObjectiveLike,
    Time,
    ToolAcceleration,
    ToolDirection,
    ToolOrientation,
    ToolSpeed,
    TorqueSpeedLine,
)
from dhkit.planning.obstacles import Distances, Floor, Obstacle, Scene, distance
from dhkit.planning.plan_report import BranchReport, PlanReport
from dhkit.planning.planner import Planner
from dhkit.planning.program import Progress
from dhkit.planning.request import PathOptions, PlanOptions

__all__ = [
    "BranchReport",
    "Certificate",
    "Constraint",
    "Distances",
    "Effort",
    "Energy",
    "Floor",
    "Jerk",
    "MotorPower",
    "Objective",
    "ObjectiveLike",
    "Obstacle",
    "PathOptions",
    "Payload",
    "PlanOptions",
    "PlanReport",
    "Planner",
    "Progress",
    "Scene",
    "Time",
    "ToolAcceleration",
    "ToolDirection",
    "ToolOrientation",
    "ToolSpeed",
    "TorqueSpeedLine",
    "along_path",
    "certify",
    "distance",
]
