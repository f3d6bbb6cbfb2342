"""Facts of figures: what is drawn is where the kinematics say, and no display is needed."""

import io
import os
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

import dhkit
from dhkit.description import library_robot, robots, world_to_frames, world_to_tool
from dhkit.viewer.figures import plot, plot_arm, plot_motion
from dhkit.viewer.scene import first_configuration

ON_LINE = 1e-12  # m


def lines(axes):
    """Return the points of every line in a 3D plot, each (k, 3)."""
    return [np.stack(line.get_data_3d(), axis=1) for line in axes.lines]


@pytest.mark.parametrize("name", robots())
@pytest.mark.slow
def test_every_robot_has_a_figure_whose_line_goes_through_its_frames(name):
    arm = library_robot(name)
    figure = plot(arm)
    assert isinstance(figure, Figure)
    figure.savefig(io.BytesIO(), format="png", dpi=40)
    (axes,) = figure.axes
    q = first_configuration(arm)
    skeleton = lines(axes)[0]
    for point in [*world_to_frames(arm, q)[:, :3, 3], world_to_tool(arm, q)[:3, 3]]:
        assert np.abs(skeleton - point).max(axis=1).min() < ON_LINE
    spans = [np.ptp(limits) for limits in (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())]
    # One metre is one length.
    assert np.allclose(spans / np.max(spans), axes._box_aspect / np.max(axes._box_aspect))
    assert "[m]" in axes.get_xlabel()


def test_a_motion_is_drawn_with_its_units_and_its_path():
    arm = library_robot("stanford")
    times = np.linspace(0, 1, 20)
    q = 0.3 + np.outer(times, np.arange(1, 7) / 10)
    angles, offsets, space = plot_motion(arm, times, q).axes
    assert angles.get_ylabel() == "angle [deg]"
    assert offsets.get_ylabel() == "offset [m]"
    assert np.allclose(angles.lines[1].get_ydata(), np.degrees(q[:, 1]))
    assert np.allclose(offsets.lines[0].get_ydata(), q[:, 2])
    path = lines(space)[-1]
    assert np.array_equal(path, world_to_tool(arm, q)[:, :3, 3])


def test_unknown_types_are_named():
    with pytest.raises(
        TypeError, match="no figure of dict; expected one of Comparison, Description"
    ):
        plot({})


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda arm: plot_arm(arm, [0, 0]), r"q has shape \(2,\)"),
        (lambda arm: plot_arm(arm, np.zeros((2, 6))), r"q has shape \(2, 6\); expected \(6,\)"),
        (
            lambda arm: plot_motion(arm, [0, 1], np.zeros((3, 6))),
            r"q has shape \(3, 6\); expected \(2, 6\)",
        ),
    ],
)
def test_wrong_arrays_are_named(call, complaint):
    with pytest.raises(ValueError, match=complaint):
        call(library_robot("puma560"))


@pytest.mark.slow
def test_a_figure_needs_no_display():
    code = (
        "import sys; from dhkit.viewer import plot; from dhkit.description import library_robot;"
        "plot(library_robot('planar2r')).savefig('/dev/null', format='png'); print('matplotlib.pyplot' in sys.modules)"
    )
    environment = {
        k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY", "MPLBACKEND")
    }
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    )
    assert done.stdout.strip() == "False"


def test_a_figure_shows_itself_in_a_notebook_and_an_arm_at_joint_values():
    arm = dhkit.Arm.load("puma560")
    figure = dhkit.plot(arm, q="nominal")
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert dhkit.plot(arm, q=arm.configurations["nominal"])._repr_png_() == figure._repr_png_()
    assert dhkit.plot(arm)._repr_png_() != figure._repr_png_()
    with pytest.raises(ValueError, match="puma560 has no configuration 'up'"):
        dhkit.plot(arm, q="up")
    with pytest.raises(TypeError, match="unexpected keyword argument 'q'"):
        dhkit.plot(arm.quintic("zero", "nominal", 1.0), q="zero")
