"""Joint centres of tables whose lengths are not sizes of the arm."""

import numpy as np
import pytest

from dhkit import Arm
from dhkit.description import library_robot, robots
from dhkit.description.joint_centres import link_ends
from dhkit.planning import Obstacle

CALIBRATED = [
    (-1e-5, 0.089, 0.00028, 1.5703),
    (-1.437, 574.2, -0.0567, -0.000734),
    (2.0254, -507.4, -0.3265, 0.003256),
    (-0.5883, -66.77, 0, 1.5704),
    (0, 0.095, 0, -1.571),
    (0, 0.0826, 0, 0),
]
"""The form of a calibrated UR5: axes 2 to 4 are 1e-3 rad from parallel. theta, d, a, alpha, rad and m."""


@pytest.mark.parametrize("name", robots())
def test_links_begin_where_the_one_before_ends_at_all_joint_values(name):
    """On both axes of each link, in either convention, and no longer than along the table."""
    arm = library_robot(name)
    numbers = arm.numbers
    ends = link_ends(
        numbers.a,
        numbers.d,
        numbers.cos_alpha,
        numbers.sin_alpha,
        is_standard=arm.convention.value == "standard",
        tool=numbers.T_last_tool[:3, 3],
    )
    whole = Arm(arm)
    q = np.where(numbers.prismatic, 0.0, np.random.default_rng(0).uniform(-2, 2, arm.n))
    frames = whole.frames(q)
    for i in range(arm.n):
        end = frames[i] @ np.append(ends.end[i], 1)
        begin = frames[i + 1] @ np.append(ends.begin[i + 1], 1)
        assert np.abs(end - begin).max() < 1e-12
    assert np.abs(frames[0][:3, 3] - (frames[0] @ np.append(ends.begin[0], 1))[:3]).max() == 0
    along_table = numbers.table_length + np.linalg.norm(numbers.T_last_tool[:3, 3])
    assert ends.lengths.sum() <= np.sqrt(arm.n + 1) * along_table + 1e-12
    assert numbers.link_ends is None


def test_sizes_of_a_calibrated_arm_are_those_of_the_arm():
    arm = Arm.from_dh(CALIBRATED).with_uniform_links()
    assert 0.9 < arm.description.reach < 1.2
    q = np.array([0.3, -1, 1, 0.4, 0.5, 0.6])
    assert arm.mass_matrix(q)[0, 0] < 2.0
    assert np.linalg.norm(arm.fk(q)[:3, 3]) < 1.0
    assert arm.verify(samples=50).ok
    far = Obstacle.sphere(0.5, (3.0, 0.0, 0.0))
    assert arm.distance(q, [far]).distance > 1.4
    assert arm.ik_numeric(arm.fk(q)).valid.any()


def test_where_centres_lie_on_a_line_the_heights_are_in_the_middle():
    """Of two parallel axes the second has no height of its own: that of the centre before, and of the tool."""
    ends = link_ends(
        np.array([1.0, 0.0]),
        np.zeros(2),
        np.ones(2),
        np.zeros(2),
        is_standard=True,
        tool=np.array([1.0, 0.0, 0.3]),
    )
    assert ends.end[0] == pytest.approx([0, 0, 0.1])
    assert ends.begin[1] == pytest.approx([-1, 0, 0.1])
    assert ends.end[1] == pytest.approx([0, 0, 0.2])
