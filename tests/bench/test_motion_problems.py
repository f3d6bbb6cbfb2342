"""Motions of the files of problems: their distances by another library, and what counts as found."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import coal
import numpy as np
import pytest

from dhkit import Arm
from dhkit.bench.motion_problems import MotionProblems, plan_problems
from dhkit.bench.problems import files_in
from dhkit.errors import DescriptionError
from dhkit.trajectories import Trajectory

FILES = files_in(Path(__file__).parents[2] / "benchmarks" / "problems")


def problems_of(file):
    return MotionProblems.read(json.loads(file.read_text()))


def random_states(problems, count=15):
    low = np.maximum(problems.lower, -np.pi)
    high = np.minimum(problems.upper, np.pi)
    return np.random.default_rng(1).uniform(low, high, (count, len(low)))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_scenes_have_free_ends_and_something_between(file):
    problems = problems_of(file)
    arm = Arm.load(file.stem)
    assert len(problems.scenes) == 3
    for scene in problems.scenes:
        ends = np.array([scene.start, scene.goal])
        assert (ends >= problems.lower).all() and (ends <= problems.upper).all()
        assert problems.clearances(arm, ends, scene.solids).min() > problems.clearance
        share = np.linspace(0.0, 1.0, 100)[:, None]
        straight = scene.start + share * (scene.goal - scene.start)
        assert problems.clearances(arm, straight, scene.solids).min() < problems.clearance
        # No joint is faster than its limit on average.
        assert (np.abs(scene.goal - scene.start) <= problems.speed * scene.duration).all()


def by_coal(capsule, frame, solid):
    """Return coal's distance of a link from a solid, m; at most 0 where they overlap."""
    start, end = (frame[:3, :3] @ end + frame[:3, 3] for end in (capsule.start, capsule.end))
    along = end - start
    length = np.linalg.norm(along)
    z = along / length if length else np.array([0.0, 0.0, 1.0])
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    R = np.column_stack([x, np.cross(z, x), z])
    link = coal.Capsule(capsule.radius, length)
    other = coal.Sphere(solid.radius) if solid.size is None else coal.Box(*solid.size)
    at = coal.Transform3s(R, (start + end) / 2)
    result = coal.DistanceResult()
    there = coal.Transform3s(np.eye(3), solid.centre)
    return coal.distance(link, at, other, there, coal.DistanceRequest(), result)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_distances_are_those_of_coal(file):
    """Where links overlap solids, ours are less deep: points inside a box are at the distance 0."""
    problems = problems_of(file)
    arm = Arm.load(file.stem)
    q = random_states(problems)
    frames = arm.frames(q)
    for scene in problems.scenes:
        ours = problems.clearances(arm, q, scene.solids)
        theirs = np.array(
            [
                min(
                    by_coal(capsule, of_state[capsule.link], solid)
                    for capsule in problems.capsules
                    for solid in scene.solids
                )
                for of_state in frames
            ]
        )
        is_apart = theirs > 1e-4
        assert is_apart.sum() > 3
        assert np.abs(ours - theirs)[is_apart].max() < 1e-7
        assert (ours[~is_apart] < 2e-4).all()


@pytest.mark.slow
def test_motions_are_found_and_motions_that_miss_something_are_not():
    (file,) = [one for one in FILES if one.stem == "puma560"]
    problems = problems_of(file)
    one_scene = replace(problems, scenes=problems.scenes[:1])
    row = plan_problems(one_scene)
    assert row.is_right and row.found == 1 and not row.reason
    assert row.nearest >= -1e-6
    assert 0.99 < row.longest < 1.05

    arm = Arm.load("puma560")
    (scene,) = one_scene.scenes
    x = np.linspace(0.0, 1.0, 400)
    smooth = (x**3 * (10 - 15 * x + 6 * x * x))[:, None]
    straight = scene.start + smooth * (scene.goal - scene.start)

    def faults(duration):
        times = duration * x
        qd = np.gradient(straight, times, axis=0)
        qd[[0, -1]] = 0.0
        return problems.faults(
            arm, scene, Trajectory.from_samples(arm.description, times, straight, qd)
        )

    slow = faults(10 * scene.duration)
    assert slow["clearance"] > 0 and slow["speed"] <= 0 and slow["torque"] <= 0
    fast = faults(0.2 * scene.duration)
    assert fast["speed"] > 0 and fast["torque"] > 0
    elsewhere = replace(scene, goal=scene.goal + 0.01)
    held = Trajectory.from_samples(arm.description, 10 * x, straight, np.zeros_like(straight))
    assert problems.faults(arm, elsewhere, held)["ends"] == pytest.approx(0.01, rel=1e-3)


def test_another_arm_than_the_librarys_is_refused():
    (file,) = [one for one in FILES if one.stem == "ur5"]
    problems = problems_of(file)
    wide = replace(problems.capsules[0], radius=problems.capsules[0].radius + 0.01)
    with pytest.raises(DescriptionError, match="ur5: the links' shapes are not those"):
        plan_problems(replace(problems, capsules=(wide, *problems.capsules[1:])))


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("capsules", [{"link": 1, "start": [0, 0], "end": [0, 0, 1], "radius": 1}], "shape"),
        ("scenes", [{"solids": [{"shape": "cone", "at": [0, 0, 0]}]}], "cone"),
        ("speed", ["fast"], "float"),
    ],
)
def test_bad_motions_are_refused(key, value, message):
    data = json.loads(FILES[0].read_text())
    data["motions"][key] = value
    with pytest.raises((ValueError, TypeError, KeyError), match=message):
        MotionProblems.read(data)
