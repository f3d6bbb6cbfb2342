"""Peers that know nothing of our formulas find the same sets of solutions."""

from dataclasses import replace

import numpy as np
import pytest

import ssik_peer
from dhkit import Arm
from dhkit.bench.contenders import Workload
from dhkit.bench.peers import eaik
from dhkit.description import library_robot
from dhkit.kinematics import forward_kinematics, inverse_kinematics, solve_numerically
from ik_checks import FAMILY_A, FAMILY_B, gaps, measures
from random_arms import states

SAME = 1e-6
"""rad: two solutions are one, away from singularities."""
REGULAR = 0.02


def regular_states(arm, count):
    q = states(arm, 3 * count, seed=11)
    return q[np.min(list(measures(arm, q).values()), axis=0) > REGULAR][:count]


def away(ours, theirs):
    """Return how far the sets (k, n) and (m, n) of angles are from each other, both ways."""
    gaps = np.abs(np.remainder(ours[:, None] - theirs + np.pi, 2 * np.pi) - np.pi).max(axis=-1)
    return max(gaps.min(axis=0).max(), gaps.min(axis=1).max())


def solutions_of(contender, arm, q):
    task = contender.setup(Workload(arm, q, q, q))
    return task.answers(len(q))


@pytest.mark.parametrize("name", [*FAMILY_A, *FAMILY_B])
def test_eaik_finds_the_same_solutions(name, law):
    pytest.importorskip("eaik", reason="the extra `bench` has EAIK")
    arm = Arm.load(name)
    q = regular_states(arm.description, law.samples(1000))
    T = arm.fk(q)
    solutions = arm.ik(T)
    contender = next(x for x in eaik.contenders() if x.name == eaik.SINGLE)
    for k, theirs in enumerate(solutions_of(contender, arm, q)):
        ours = solutions.q[k][solutions.valid[k]]
        law.holds(
            "distance of the sets of solutions to EAIK's", away(ours, theirs), SAME, (name, q[k])
        )


def test_ssik_finds_the_same_solutions(law):
    """The Stanford arm's prismatic joint is beyond both; another solver for one PUMA and one UR."""
    pytest.importorskip("ssik", reason="the extra `ik` has ssik")
    for name in ("puma560", "ur5"):
        arm = Arm.load(name)
        q = regular_states(arm.description, law.samples(1000) // 10)
        T = arm.fk(q)
        solutions = arm.ik(T)
        for k, found in enumerate(ssik_peer.solutions_of(arm.description, T)):
            ours = solutions.q[k][solutions.valid[k]]
            law.holds(
                "distance of the sets of solutions to ssik's", away(ours, found), SAME, (name, q[k])
            )


def test_stanford_has_no_solution_that_newton_steps_find_beside_ours(law):
    """No peer takes its slide: many starts of an iteration must end in our branches, and reach all of them."""
    arm = library_robot("stanford")
    free = replace(arm, joints=tuple(replace(joint, limits=None) for joint in arm.joints))
    q = regular_states(free, max(2, law.samples(1000) // 25))
    T = forward_kinematics(free, q)
    solutions = inverse_kinematics(free, T)
    reached = np.zeros(solutions.valid.shape, dtype=bool)
    for start in range(40):
        found = solve_numerically(free, T, states(free, len(q), seed=100 + start), restarts=0)
        solved = found.valid[:, 0]
        gap = gaps(free, solutions.q[solved], found.q[solved])
        law.holds("an iteration's solution away from ours", gap.min(axis=1).max(), SAME)
        reached[solved] |= gap < SAME
    assert reached.mean() > 0.9
