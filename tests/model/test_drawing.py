"""Laws of arms drawn from tables: drawn links do not overlap where a real arm's links have room."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from dhkit.description import Convention
from dhkit.description.library import library_robot, robots
from dhkit.description.table_rows import from_dh
from dhkit.expressions import exact
from dhkit.planning.obstacles.capsules import LinkBody
from dhkit.planning.obstacles.solids import shape_distances

pytest.importorskip("coal")

STATES = 100
"""Number of random states in which the shapes of two links are measured."""
ELBOW = 1.5
"""Largest angle of an elbow, rad: beyond, a real quill meets the column of its own arm too."""
COAXIAL = 0.02
"""Largest distance of two parallel axes that are drawn as one, relative to the reach: less than a drum's radius."""
LIBRARY = [library_robot(name) for name in robots()]
DRAWN = [arm for arm in LIBRARY if not any(joint.shapes for joint in arm.joints)]


def random_states(arm):
    numbers = arm.numbers
    return np.random.default_rng(7).uniform(numbers.lower, numbers.upper, (STATES, arm.n))


def touching(arm, pairs):
    """Return the pairs of links of which the shapes overlap in some random states."""
    q = random_states(arm)
    found = []
    for i, j in pairs:
        distances = shape_distances(arm, q, (LinkBody(i), LinkBody(j)), enough=0.0)
        if (distances < 0).any():
            found.append((i, j))
    return found


def carried_by_rods(arm):
    """Return pairs of a link with a block and a link after the rod in it, where a coaxial joint is on the rod's end."""
    numbers = arm.numbers
    # The axes of joints k and k + 1 coincide where a is about 0 and sin(alpha) = 0 between them. In the modified
    # convention the row of joint k + 1 has these.
    shift = 0 if arm.convention is Convention.STANDARD else 1
    pairs = []
    for k in range(1, arm.n - 1):
        is_near = abs(numbers.a[k + shift]) < COAXIAL * arm.reach
        coaxial = is_near and numbers.sin_alpha[k + shift] == 0
        if numbers.prismatic[k] and coaxial and not numbers.prismatic[k + 1]:
            pairs += [(k, after) for after in range(k + 2, arm.n + 1)]
    return pairs


def apart(arm):
    """Return all pairs of links that no joint connects."""
    return [(i, j) for i, j in combinations(range(arm.n + 1), 2) if j - i > 1]


def with_limits(arm, limits):
    joints = []
    for joint, (low, high) in zip(arm.joints, limits, strict=True):
        joints.append(replace(joint, limits=(exact(low), exact(high))))
    return replace(arm, joints=tuple(joints))


@st.composite
def scaras(draw):
    """SCARA arms of any proportions: the quill goes down from the head, its z axis down or up, or both ways."""
    a1 = draw(st.sampled_from([0.25, 0.4, 0.6]))
    a2 = draw(st.sampled_from([0.25, 0.4, 0.6]))
    height = draw(st.sampled_from([0.4, 0.6, 0.8]))
    stroke = draw(st.sampled_from([0.0, 0.1, 0.3]))
    begin = draw(st.sampled_from([0.0, 0.02, 0.2, -0.1]))
    is_down = draw(st.booleans())
    alpha = "pi" if is_down else 0
    low, high = (begin, begin + stroke) if is_down else (-begin - stroke, -begin)
    limits = [(-3, 3), (-ELBOW, ELBOW), (low, high), (-3, 3)]
    if draw(st.booleans()):
        table = [(0, height, a1, 0), (0, 0, a2, alpha), (0, 0, 0, 0), (0, 0, 0, 0)]
        return with_limits(from_dh(table, kinds="RRPR"), limits)
    table = [(0, height, 0, 0), (0, 0, a1, 0), (0, 0, a2, alpha), (0, 0, 0, 0)]
    return with_limits(from_dh(table, kinds="RRPR", convention="modified"), limits)


def test_no_links_of_the_librarys_scara_touch_in_any_state():
    arm = library_robot("cobra600")
    assert not touching(arm, apart(arm))


@pytest.mark.parametrize(
    "arm", [arm for arm in DRAWN if carried_by_rods(arm)], ids=lambda arm: arm.name
)
def test_a_joint_on_a_rods_end_does_not_meet_the_rods_block(arm):
    assert not touching(arm, carried_by_rods(arm))


@settings(max_examples=15, deadline=None)
@given(scaras())
def test_no_links_of_a_scara_of_any_proportions_touch(arm):
    assert not touching(arm, apart(arm))


@settings(max_examples=6, deadline=None)
@given(st.sampled_from([0.3, 0.5]), st.sampled_from([0.1, 0.3]))
def test_a_spin_on_a_rod_across_a_vertical_axis_does_not_meet_the_rods_block(a, stroke):
    table = [(0, 0.5, a, "pi/2"), (0, 0, 0, 0), (0, 0, 0, 0)]
    arm = with_limits(from_dh(table, kinds="RPR"), [(-3, 3), (0, stroke), (-3, 3)])
    assert carried_by_rods(arm) == [(1, 3)]
    assert not touching(arm, carried_by_rods(arm))
