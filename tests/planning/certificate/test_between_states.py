"""Between the states of a certificate: thin links and obstacles that pass through each other are found."""

import numpy as np
import pytest

from dhkit import Arm, Floor, Limits, Obstacle
from dhkit.description import from_toml
from dhkit.errors import PlanningError
from dhkit.planning.certificate import Checker
from dhkit.planning.certificate.between_states import SMALLEST_TRAVEL, smallest_between
from dhkit.planning.criteria import loaded
from dhkit.planning.obstacles import distance
from dhkit.trajectories import JointPath, Trajectory

ROD = """
format = 1
name = "rod"
convention = "standard"
"""
JOINT = """
[[joint]]
type = "revolute"
a = 1
alpha = {alpha}
d = 0
theta = 0
velocity = 50
effort = 30
body = {{ mass = 1, com = [-0.5, 0, 0], inertia = {{ xx = 0.04, yy = 0.08, zz = 0.08 }} }}
shape = {{ capsule = {{ radius = 0.002, length = 0.9 }}, xyz = [-0.5, 0, 0], rpy = [0, "pi/2", 0] }}
"""
SLIDE = """
[[joint]]
type = "prismatic"
a = 0
alpha = 0
d = 0.5
theta = 0
limits = [0, 0.24]
velocity = 1
effort = 100
body = { mass = 1, com = [0, 0, 0], inertia = { xx = 0.01, yy = 0.01, zz = 0.01 } }
shape = { sphere = { radius = 0.25 } }
"""
ONE, TWO = (
    from_toml(ROD + JOINT.format(alpha=0)),
    from_toml(ROD + JOINT.format(alpha='"pi/2"') + JOINT.format(alpha=0)),
)
BALL = from_toml(ROD + SLIDE)


@pytest.mark.parametrize("arm", [ONE, TWO], ids=["one joint", "two"])
def test_a_contact_of_any_depth_is_found_from_few_states(arm, law):
    """Whatever a dense sampling finds below the least distance, refining eight states finds too."""
    rng = np.random.default_rng(0)
    missed = seen = 0
    for _ in range(law.samples(150)):
        ends, rates = rng.uniform(-1.5, 1.5, (2, arm.n)), rng.uniform(-4, 4, (2, arm.n))
        motion = Trajectory.from_samples(arm, [0, 0.7], ends, rates)
        size, share = 10 ** rng.uniform(-4, -1.5), rng.uniform(0.3, 0.95)
        point = Arm(arm).frames(motion.q(rng.uniform(0.1, 0.6)))[-1]
        near = (
            point[:3, 3]
            - (1 - share) * point[:3, 0]
            + rng.normal(size=3) * (0.002 + size) * rng.choice([0.3, 1.5])
        )
        scene = [Obstacle.sphere(size, near)]
        least = np.full((8, 1), rng.choice([0.0, 0.003]))

        def gaps(q, scene=scene):
            return np.asarray(distance(arm, q, scene).distance)[:, None]

        states = Checker(loaded(arm), Limits.of(arm), points=8).states(motion)
        found = min(
            gaps(states.q).min(), smallest_between(states, gaps(states.q), gaps, least).min()
        )
        truth = gaps(motion.q(np.linspace(0, 0.7, 20_001))).min()
        seen += truth < least[0, 0] - SMALLEST_TRAVEL
        missed += truth < least[0, 0] - SMALLEST_TRAVEL and found >= least[0, 0]
        assert found >= truth - 1e-4
    assert seen
    law.holds("contacts missed", missed, 0)


def test_far_away_nothing_is_measured_again():
    calls = []

    def gaps(q):
        calls.append(len(q))
        return np.full((len(q), 1), 2.0)

    motion = Trajectory.from_samples(ONE, [0, 1], [[0], [1]], [[0], [0]])
    states = Checker(loaded(ONE), Limits.of(ONE), points=9).states(motion)
    assert np.isinf(smallest_between(states, np.full((9, 1), 2.0), gaps, np.zeros((9, 1)))).all()
    assert not calls


@pytest.mark.parametrize("intervals", [12, 24])
@pytest.mark.parametrize("angle", [0.7, 1.1, 1.9])
def test_a_needle_in_the_way_of_a_rod_is_not_passed(intervals, angle):
    needle = [Obstacle.sphere(0.0005, (0.85 * np.cos(angle), 0.85 * np.sin(angle), 0))]
    options = {"obstacles": needle, "clearance": 0.0005}
    with pytest.raises(PlanningError, match="sphere"):
        Arm(ONE).plan(
            [0.0], [3.0], intervals=intervals, max_iterations=50, compare=False, **options
        )
    with pytest.raises(PlanningError, match=r"path at s = .* sphere"):
        Arm(ONE).plan_path(JointPath.straight(ONE, [0.0], [3.0]), intervals=intervals, **options)


def test_a_link_that_moves_less_than_its_radius_is_checked():
    arm = Arm(BALL)
    with pytest.raises(PlanningError, match="goal: link 1 is 40 mm inside ball"):
        arm.plan([0.0], [0.24], obstacles=[Obstacle.sphere(0.05, (0, 0, 1.0), name="ball")])
    with pytest.raises(PlanningError, match="goal: link 1 is 50 mm inside floor"):
        arm.plan([0.24], [0.0], obstacles=[Floor(0.3)])
    # What it stands in, it stands in everywhere.
    assert np.isinf(arm.distance([0.1], [Obstacle.box((1, 1, 0.6), (0, 0, 0.3))]).distance)
    assert np.isinf(arm.distance([0.1], [Floor(0.6)]).distance)
    assert arm.plan([0.0], [0.2], obstacles=[Floor(0.6)]).report.certificate.ok
