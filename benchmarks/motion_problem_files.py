"""Scenes of the files of problems: obstacles between two states, and the shortest motion that is known."""

from __future__ import annotations

from itertools import islice
from typing import Any

import numpy as np

from benchmarks.peers.ompl import SampledPaths
from benchmarks.scenes import CLEARANCE, PEER_SECONDS, Scene, SceneKind, along_path, scenes
from dhkit import Arm
from dhkit.bench.motion_problems import MotionProblems
from dhkit.description import Box, Sphere
from dhkit.errors import PlanningError
from dhkit.planning import Obstacle
from dhkit.planning.obstacles.capsules import link_capsules
from dhkit.trajectories import Trajectory

SCENES = 3
OBSTACLES = (2, 5)
"""Smallest and largest number of obstacles."""
STARTS = 4
"""Paths of OMPL from which motions are started, beside dhkit's own."""
MOST_TRIED = 40
"""Random scenes among which those that can be solved are looked for."""
DIGITS = 6
"""Digits behind the point of states and sizes."""


def motions_of(arm: Arm, table: dict[str, Any]) -> dict[str, Any]:
    """Return the links as capsules, the limits, and scenes with the shortest duration of several motions."""
    numbers = arm.description.numbers
    capsules = [one for one in link_capsules(arm.description) if one.link]
    content: dict[str, Any] = {
        "capsules": [
            {
                "link": one.link,
                "start": one.start.tolist(),
                "end": one.end.tolist(),
                "radius": one.radius,
            }
            for one in capsules
        ],
        "clearance": CLEARANCE,
        "speed": numbers.velocity.tolist(),
        "torque": numbers.effort.tolist(),
        "scenes": [],
    }
    kind = SceneKind(arm.name, OBSTACLES)
    for scene in islice(scenes(kind, sum(arm.name.encode())), MOST_TRIED):
        entry = _entry(scene)
        problem = MotionProblems.read({"arm": table, "motions": {**content, "scenes": [entry]}})
        duration = _shortest(arm, problem)
        if duration is not None:
            content["scenes"].append({**entry, "duration": duration})
        if len(content["scenes"]) == SCENES:
            return content
    raise ValueError(f"{arm.name}: fewer than {SCENES} scenes of {MOST_TRIED} can be solved")


def _entry(scene: Scene) -> dict[str, Any]:
    """Return a scene in plain, rounded numbers, with a duration that is not known yet."""
    solids = []
    for obstacle in scene.obstacles:
        at = np.round(np.array(obstacle.placement)[:3, 3], DIGITS).tolist()
        solids.append({**_shape(obstacle), "at": at})
    return {
        "solids": solids,
        "start": np.round(scene.start, DIGITS).tolist(),
        "goal": np.round(scene.goal, DIGITS).tolist(),
        "duration": 0.0,
    }


def _shape(obstacle: Obstacle) -> dict[str, Any]:
    geometry = obstacle.geometry
    if isinstance(geometry, Box):
        return {"shape": "box", "size": [round(float(edge), DIGITS) for edge in geometry.size]}
    if isinstance(geometry, Sphere):
        return {"shape": "sphere", "radius": round(float(geometry.radius), DIGITS)}
    raise TypeError(f"{geometry!r}; expected a box or a sphere")


def _shortest(arm: Arm, problem: MotionProblems) -> float | None:
    """Return the shortest duration of motions from several starts, all judged; None if none is found, or only one."""
    (scene,) = problem.scenes
    solids = [solid.obstacle for solid in scene.solids]
    sampled = SampledPaths(arm.description, solids, problem.clearance)
    starts: list[Trajectory | None] = [None]
    for _ in range(STARTS):
        path = sampled.path(scene.start, scene.goal, PEER_SECONDS)
        if path is not None:
            starts.append(along_path(arm.description, path))
    durations = []
    for warm in starts:
        try:
            motion = arm.plan(
                scene.start,
                scene.goal,
                obstacles=solids,
                clearance=problem.clearance,
                warm=warm,
                compare=False,
            )
        except PlanningError:
            continue
        faults = problem.faults(arm, scene, motion)
        if all(fault <= 0 for fault in faults.values()):
            durations.append(motion.duration)
    return round(min(durations), DIGITS) if len(durations) > 1 else None
