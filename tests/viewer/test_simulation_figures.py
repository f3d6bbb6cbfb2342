"""Facts of a simulation's figures: curves are the result's, the reference is dashed, and saturation is marked."""

import io

import numpy as np
import pytest

import dhkit
from acceptance import ACCEPTING, slow_if
from dhkit.description import from_dh, library_robot
from dhkit.viewer.diagrams import CURVE_COLORS, joint_color, joint_kinds, joint_style
from dhkit.viewer.simulation_figures import CONTROLLER_COLORS, plot_comparison
from simulation_results import swinging

LARGE = 1_000_000 if ACCEPTING else 200_000  # states: up to a thousand seconds at 1 kHz
MOST_DRAWN = 20_000  # points of a curve


def drawn(figure):
    """Draw a figure, and return its axes by their labels."""
    figure.savefig(io.BytesIO(), format="png", dpi=40)
    return {axes.get_ylabel(): axes for axes in figure.axes}


def curves(axes, color=None):
    """Return the lines that are not limits, of one colour if given."""
    lines = [line for line in axes.lines if len(line.get_xdata()) > 2]
    return [line for line in lines if color is None or line.get_color() == color]


@pytest.mark.parametrize(
    "name", ["planar2r", "puma560", slow_if(True, "panda"), slow_if(True, "stanford")]
)
def test_curves_are_the_results(name):
    arm = library_robot(name)
    result = swinging(arm)
    axes = drawn(dhkit.plot(result))
    kinds = {
        "angle [deg]": (~arm.numbers.prismatic, 180 / np.pi),
        "offset [m]": (arm.numbers.prismatic, 1.0),
    }
    for label, (chosen, unit) in kinds.items():
        joints = np.flatnonzero(chosen)
        assert (label in axes) == bool(len(joints))
        lines = curves(axes[label]) if len(joints) else []
        values, references = lines[: len(joints)], lines[len(joints) :]
        for line, reference, i in zip(values, references, joints, strict=True):
            assert np.allclose(line.get_ydata(), unit * result.q[:, i])
            assert np.allclose(reference.get_ydata(), unit * result.reference_q[:, i])
            assert reference.is_dashed()
    assert ("joint error [mm]" in axes) == bool(arm.numbers.prismatic.any())
    revolute = np.flatnonzero(~arm.numbers.prismatic)
    for line, i in zip(curves(axes["joint error [mrad]"]), revolute, strict=True):
        assert np.allclose(line.get_ydata(), 1e3 * result.error[:, i])
    for line, i in zip(curves(axes["torque / limit [%]"]), range(arm.n), strict=True):
        assert np.allclose(line.get_ydata(), 100 * result.tau[:, i] / arm.numbers.effort[i])
    assert np.allclose(curves(axes["position [mm]"])[0].get_ydata(), 1e3 * result.tool_error)
    assert np.allclose(
        curves(axes["rotation [mrad]"])[0].get_ydata(), 1e3 * result.tool_rotation_error
    )


@pytest.mark.slow
def test_bars_beyond_the_limit_cover_the_saturated_times():
    arm = library_robot("puma560")
    result = swinging(arm)
    axes = drawn(dhkit.plot(result))["torque / limit [%]"]
    saturated = result.tau != result.tau_asked
    low, high = axes.get_ylim()
    for bars, i in zip(axes.collections, np.flatnonzero(saturated.any(axis=0)), strict=True):
        segments = bars.get_segments()
        inside = np.zeros(len(result.t), dtype=bool)
        for (begin, level), (end, _) in segments:
            inside |= (result.t >= begin) & (result.t < end)
            assert abs(level) > 100
            assert low < level < high
        assert np.array_equal(inside[:-1], saturated[:-1, i])
        share = sum(end[0] - begin[0] for begin, end in segments) / result.t[-1]
        assert share == pytest.approx(result.saturated[i], abs=2 / len(result.t))
    assert "saturated: " in axes.get_title("right")


def test_torques_below_the_limits_have_no_bars():
    figure = dhkit.plot(swinging(library_robot("puma560"), most=0.4))
    axes = drawn(figure)["torque / limit [%]"]
    assert not axes.collections
    assert axes.get_title("right") == ""
    assert "saturated" not in [text.get_text() for text in figure.legends[0].get_texts()]


def test_torques_without_limits_are_in_newton_metres():
    arm = from_dh([(0, 0, 1, 0), (0, 0, 1, 0)])
    assert "torque [N m]" in drawn(dhkit.plot(swinging(arm)))


@pytest.mark.parametrize(
    ("error", "unit"),
    [(1e-10, "prad"), slow_if(True, 3e-5, "µrad"), slow_if(True, 0.3, "mrad"), (2.5, "rad")],
)
def test_errors_are_in_units_that_are_read_easily(error, unit):
    result = swinging(library_robot("planar2r"), error=error, seconds=5.0)
    assert f"joint error [{unit}]" in drawn(dhkit.plot(result))


@pytest.mark.slow
def test_a_run_without_error_and_one_of_a_single_state_have_figures():
    for result in (
        swinging(library_robot("stanford"), error=0.0),
        swinging(library_robot("planar2r"), states=1),
    ):
        assert "joint error [rad]" in drawn(dhkit.plot(result))
        drawn(plot_comparison({"perfect": result}))


@pytest.mark.slow
def test_a_long_run_is_drawn_by_few_points_that_keep_every_peak():
    result = swinging(library_robot("planar2r"), states=LARGE, seconds=1e-3 * LARGE)
    result.q[123_456, 1] += 0.5
    axes = drawn(dhkit.plot(result))
    line = curves(axes["joint error [mrad]"])[1]
    assert len(line.get_xdata()) < MOST_DRAWN
    assert line.get_ydata().min() == 1e3 * result.error[:, 1].min() < -480


@pytest.mark.slow
def test_controllers_are_compared_by_their_largest_errors():
    arm = library_robot("puma560")
    results = {
        f"law {k}": swinging(arm, error=10.0**-k, seed=k, seconds=2.0 - 0.1 * k)
        for k in range(1, 9)
    }
    figure = plot_comparison(results)
    axes = drawn(figure)
    over_time = axes["largest joint error [rad]"]
    assert over_time.get_yscale() == "log"
    assert over_time.get_xlim() == (0.0, results["law 1"].t[-1])
    looks = set()
    for line, result in zip(over_time.lines, results.values(), strict=True):
        assert np.allclose(line.get_ydata()[1:], np.abs(result.error).max(axis=1)[1:])
        looks.add((line.get_color(), line.get_linestyle()))
    assert len(looks) == len(results)
    bars = figure.axes[1]
    assert [tick.get_text() for tick in bars.get_yticklabels()] == list(results)
    ends = [bar.get_x() + bar.get_width() for bar in bars.patches]
    assert ends == pytest.approx([result.rms_error.max() for result in results.values()])
    assert [bar.get_facecolor()[:3] for bar in bars.patches[:1]] == [
        tuple(int(CONTROLLER_COLORS[0][k : k + 2], 16) / 255 for k in (1, 3, 5))
    ]


def test_mixed_joints_are_named_by_both_units():
    assert "largest joint error [rad, m]" in drawn(
        plot_comparison({"one": swinging(library_robot("stanford"))})
    )


def test_a_comparison_needs_results_of_the_same_joints():
    with pytest.raises(ValueError, match="results is empty; expected simulations by their names"):
        plot_comparison({})
    with pytest.raises(ValueError, match="two has joints RRRRRR; expected RR"):
        plot_comparison(
            {"one": swinging(library_robot("planar2r")), "two": swinging(library_robot("puma560"))}
        )


def test_joints_have_colours_and_line_styles_of_their_own():
    assert len({(joint_color(i), joint_style(i)) for i in range(3 * len(CURVE_COLORS))}) == 3 * len(
        CURVE_COLORS
    )
    kinds = joint_kinds(library_robot("stanford"))
    assert [(list(joints), factor) for joints, factor, *_ in kinds] == [
        ([0, 1, 3, 4, 5], 180 / np.pi),
        ([2], 1.0),
    ]
