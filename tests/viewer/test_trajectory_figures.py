"""Facts of a trajectory's figure: curves are the motion's, limits are dashed, and breaks are upright."""

import io

import numpy as np
import pytest

from acceptance import slow_if
from dhkit.description import from_dh, library_robot, world_to_tool
from dhkit.errors import DescriptionError
from dhkit.trajectories import Trajectory, cubic, trapezoidal
from dhkit.viewer import View, plot
from dhkit.viewer.session import Slot
from dhkit.viewer.trajectory_figures import plot_uses
from viewer.messages import decode_animation

FLOAT32 = 1e-6


def solid(axes):
    return [line for line in axes.lines if len(line.get_xdata()) > 2]


@pytest.mark.parametrize(
    "name", ["puma560", "planar2r", slow_if(True, "cobra600"), slow_if(True, "panda")]
)
def test_curves_are_the_motions(name):
    arm = library_robot(name)
    lower, upper = np.maximum(arm.numbers.lower, -1), np.minimum(arm.numbers.upper, 1)
    motion = trapezoidal(arm, 0.7 * lower + 0.3 * upper, 0.3 * lower + 0.7 * upper)
    figure = plot(motion)
    figure.savefig(io.BytesIO(), format="png", dpi=40)
    panels = {axes.get_ylabel(): axes for axes in figure.axes[:-1]}
    revolute = np.flatnonzero(~arm.numbers.prismatic)
    for line, i in zip(solid(panels["angle [deg]"]), revolute, strict=True):
        assert np.allclose(line.get_ydata(), np.degrees(motion.q(line.get_xdata())[:, i]))
    shares = solid(panels["torque / limit [%]"])
    t = shares[0].get_xdata()
    inside = ~np.isin(t, motion.breaks)
    for line, i in zip(shares, range(arm.n), strict=True):
        expected = 100 * motion.tau(t)[:, i] / arm.numbers.effort[i]
        assert np.allclose(line.get_ydata()[inside], expected[inside])
    # At a break torques jump, and both are drawn, one above the other.
    for k in motion.breaks[1:-1]:
        places = np.flatnonzero(t == k)
        assert len(places) == 2
        assert np.allclose(
            shares[0].get_ydata()[places[0]],
            100 * motion.tau(k, side="left")[0] / arm.numbers.effort[0],
        )
    path = np.stack(figure.axes[-1].lines[-1].get_data_3d(), axis=1)
    assert np.allclose(path, world_to_tool(arm, motion.q(t))[:, :3, 3])


def test_near_limits_are_dashed_and_far_ones_left_out():
    arm = library_robot("planar2r")
    motion = cubic(arm, [0, 0], [3.0, 0.1])
    angles = plot(motion).axes[0]
    dashed = [line for line in angles.lines if len(line.get_xdata()) == 2]
    assert [line.get_ydata()[0] for line in dashed] == pytest.approx(
        [np.degrees(arm.numbers.upper[0])]
    )
    assert dashed[0].get_color() == solid(angles)[0].get_color()


def test_an_arm_without_bodies_has_no_torques():
    arm = from_dh([(0, 0, 1, 0), (0, 0, 1, 0)])
    figure = plot(Trajectory(arm, [0, 1], [[[0, 0], [1, 1]]]))
    assert [axes.get_ylabel() for axes in figure.axes[:-1]] == ["angle [deg]", "rate [deg/s]"]


def test_a_view_plays_a_trajectory_of_its_arm_alone():
    arm = library_robot("puma560")
    motion = cubic(arm, np.zeros(6), np.full(6, 0.5), duration=2.0)
    with View(arm) as view:
        view.play(motion)
        played = decode_animation(view._state[Slot.MOTION])
        with (
            pytest.raises(DescriptionError, match=r"one of puma560 .* expected one of planar2r"),
            View(library_robot("planar2r")) as other,
        ):
            other.play(motion)
    assert played.times[-1] == 2
    assert np.abs(played.q - motion.q(played.times)).max() < FLOAT32


def test_motions_are_compared_over_the_same_time():
    arm = library_robot("planar2r")
    slow, fast = cubic(arm, [0, 0], [1.0, 0.5], 2.0), trapezoidal(arm, [0, 0], [1.0, 0.5])
    figure = plot_uses({"slow": slow, "fast": fast})
    figure.savefig(io.BytesIO(), format="png", dpi=40)
    assert len(figure.axes) == 4
    assert {axes.get_xlim() for axes in figure.axes} == {(0.0, 2.0)}
    for k, motion in enumerate((slow, fast)):
        rates, torques = (solid(axes) for axes in figure.axes[2 * k : 2 * k + 2])
        assert figure.axes[2 * k].get_title("left").endswith(f": {motion.duration:.3f} s")
        t = rates[0].get_xdata()
        inside = ~np.isin(t, motion.breaks)
        for i in range(2):
            assert np.allclose(
                rates[i].get_ydata(), 100 * motion.qd(t)[:, i] / arm.numbers.velocity[i]
            )
            expected = 100 * motion.tau(t)[:, i] / arm.numbers.effort[i]
            assert np.allclose(torques[i].get_ydata()[inside], expected[inside])


def test_a_comparison_needs_limits_and_one_robot():
    arm, other = library_robot("planar2r"), from_dh([(0, 0, 1, 0), (0, 0, 1, 0)])
    with pytest.raises(ValueError, match="motions is empty"):
        plot_uses({})
    with pytest.raises(ValueError, match="has no speed limit"):
        plot_uses({"one": cubic(other, [0, 0], [1, 1], 1.0)})
    with pytest.raises(DescriptionError, match="the trajectory is one of"):
        plot_uses(
            {"one": cubic(arm, [0, 0], [1, 1], 1.0), "two": cubic(other, [0, 0], [1, 1], 1.0)}
        )
