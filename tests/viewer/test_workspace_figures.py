"""Facts of the figures of workspaces and ellipsoids: what is drawn is what was sampled, in metres."""

import io

import numpy as np
import pytest

import dhkit
from acceptance import different_robots_first
from dhkit.description import from_dh, library_robot, robots, world_to_tool
from dhkit.kinematics.manipulability import Ellipsoid, velocity_ellipsoid
from dhkit.kinematics.workspace import workspace
from dhkit.viewer.overlays import heat_colors
from dhkit.viewer.scene import first_configuration
from dhkit.viewer.workspace_figures import plot_ellipsoid, plot_workspace

ON_LINE = 1e-12  # m


def drawn(figure):
    """Render a figure: what is wrong with its text or its layout is a warning, and so an error."""
    figure.savefig(io.BytesIO(), format="png", dpi=40)
    return figure


@pytest.mark.slow
@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_every_robot_has_a_figure_of_its_workspace(name):
    space = workspace(library_robot(name), 2_000)
    figure = drawn(dhkit.plot(space))
    views, (bar,) = figure.axes[:-1], figure.axes[-1:]
    assert len(views) == (1 if len(space.grid.axes) == 2 else 2)
    for view in views:
        assert view.get_aspect() == 1
        assert "[m]" in view.get_xlabel()
        assert "[m]" in view.get_ylabel()
    assert "manipulability" in bar.get_ylabel()
    assert name in figure.get_suptitle()


def test_a_planar_arm_is_seen_in_its_plane():
    arm = library_robot("planar2r")
    space = workspace(arm, 20_000)
    view, _ = drawn(plot_workspace(space)).axes
    assert (view.get_xlabel(), view.get_ylabel()) == ("x [m]", "y [m]")
    tool = world_to_tool(arm, first_configuration(arm))[:2, 3]
    assert np.abs(view.lines[1].get_xydata()[-1] - tool).max() < ON_LINE
    best = world_to_tool(arm, space.best)[:2, 3]
    assert np.abs(view.lines[2].get_xydata()[0] - best).max() < ON_LINE
    (mesh,) = [c for c in view.collections if c.get_array() is not None and c.get_array().ndim == 2]
    # The middle of the ring is empty, and nothing in it is better than l1 l2.
    values = mesh.get_array()
    assert np.ma.getmaskarray(values)[values.shape[0] // 2, values.shape[1] // 2]
    assert values.max() == space.manipulability.max() <= 0.2 + 1e-12


def test_a_section_shows_distance_and_height():
    arm = library_robot("puma560")
    space = workspace(arm, 5_000)
    section, above, _ = drawn(plot_workspace(space)).axes
    x, y, z = world_to_tool(arm, first_configuration(arm))[:3, 3]
    assert np.abs(section.lines[1].get_xydata()[-1] - (np.hypot(x, y), z)).max() < ON_LINE
    assert np.abs(above.lines[1].get_xydata()[-1] - (x, y)).max() < ON_LINE
    assert "distance from axis 1" in section.get_xlabel()


@pytest.mark.parametrize(
    ("rows", "kinds"),
    [
        ([(0, 0.5, 0, 0)], "R"),
        ([(0, 0, 0, 0)], "P"),
        ([(0, 0, 1, 0)], "R"),
        ([(0, 0, 0, 0)] * 2, "PR"),
    ],
)
def test_points_lines_and_circles_have_figures_too(rows, kinds):
    drawn(plot_workspace(workspace(from_dh(rows, kinds=kinds), 500)))


@pytest.mark.parametrize("name", ["planar2r", "puma560", "cart_pendulum", "pan_tilt"])
def test_an_ellipsoid_is_drawn_with_its_arm(name):
    arm = library_robot(name)
    q = first_configuration(arm) + 0.3
    figure = drawn(plot_ellipsoid(arm, q))
    assert f"{velocity_ellipsoid(arm, q).lengths[0]:.3g} m/s" in figure.axes[0].get_title()


def test_ellipsoids_of_a_batch_are_drawn_together_without_the_missing_ones():
    arm = library_robot("panda")
    q = np.random.default_rng(0).uniform(-1, 1, (3, arm.n))
    q[1] = np.nan
    (axes,) = drawn(dhkit.plot(velocity_ellipsoid(arm, q))).axes
    assert len(axes.collections) == 2 * 2  # a surface and its lines each
    with pytest.raises(ValueError, match="no ellipsoid is finite"):
        dhkit.plot(Ellipsoid(np.full(3, np.nan), np.eye(3), np.full(3, np.nan)))


@pytest.mark.parametrize(
    ("q", "complaint"),
    [(np.zeros((2, 6)), r"expected \(6,\)"), (np.full(6, np.nan), "expected finite values")],
)
def test_wrong_states_are_named(q, complaint):
    with pytest.raises(ValueError, match=complaint):
        plot_ellipsoid(library_robot("puma560"), q)


def test_heat_goes_from_dark_to_bright():
    colors = heat_colors([0.0, 0.5, 1.0, np.nan])
    assert colors.shape == (4, 3)
    assert np.all((colors >= 0) & (colors <= 1))
    brightness = colors @ (0.2126, 0.7152, 0.0722)
    assert brightness[0] < brightness[1] < brightness[2]
    assert np.array_equal(colors[3], colors[0])
    assert np.array_equal(heat_colors(np.zeros(3)), np.tile(colors[0], (3, 1)))
