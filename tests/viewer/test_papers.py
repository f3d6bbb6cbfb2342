"""Figures for papers: the asked width, text of print's size that is all on the figure, diagrams below each other."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from mpl_toolkits.mplot3d.art3d import Text3D

from dhkit import Arm, PDGravity, plot
from dhkit.kinematics import velocity_ellipsoid

MM = 25.4
"""Millimetres in an inch."""
CUT = 1.5
"""Pixels by which text may be outside: rounding of its box."""


def values():
    arm = Arm.load("puma560")
    goal = arm.configurations["nominal"]
    gentle = arm.simulate(PDGravity(arm, kp=100, kd=20), goal, 0.2, q0=np.zeros(6))
    return {
        "arm": arm,
        "motion": arm.plan(np.zeros(6), goal),
        "simulation": gentle,
        "controllers": {
            "gentle": gentle,
            "the same, with a name as long as students like to write them in a report": gentle,
        },
        "workspace": arm.workspace(),
        "ellipsoid": velocity_ellipsoid(arm, goal),
    }


def labels(figure):
    """Return titles, entries of legends and names of axes. Not those of ticks, some of which are never drawn."""
    texts = [text for legend in figure.legends for text in legend.get_texts()]
    texts += figure.texts
    for axes in figure.axes:
        texts += [axes.title, *(axis.label for axis in axes._axis_map.values())]
        texts += [text for text in axes.texts if not isinstance(text, Text3D)]
    return texts


@pytest.fixture(scope="module")
def all_values():
    return values()


@pytest.mark.parametrize("width", [60, 88, 180])
@pytest.mark.parametrize(
    "name", ["arm", "motion", "simulation", "controllers", "workspace", "ellipsoid"]
)
def test_all_text_is_on_the_figure(all_values, name, width):
    figure = plot(all_values[name], width=width)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    assert figure.get_size_inches()[0] * MM == pytest.approx(width)
    renderer = canvas.get_renderer()
    page = figure.bbox
    shown = [text for text in labels(figure) if text.get_text().strip()]
    assert len(shown) >= len(figure.axes)
    for text in shown:
        assert text.get_fontsize() <= 8.0
        box = text.get_window_extent(renderer)
        assert box.x0 >= -CUT and box.x1 <= page.x1 + CUT, text.get_text()
        assert box.y0 >= -CUT and box.y1 <= page.y1 + CUT, text.get_text()


def test_in_a_column_diagrams_are_below_each_other(all_values):
    wide = plot(all_values["simulation"])
    narrow = plot(all_values["simulation"], width=88)
    assert len({axes.get_position().x0 for axes in wide.axes}) > 1
    assert len({axes.get_subplotspec().colspan.start for axes in narrow.axes}) == 1
    assert len(narrow.axes) == len(wide.axes)
    # The scale of rotations shares its diagram with that of positions.
    assert len({axes.get_subplotspec().rowspan.start for axes in narrow.axes}) == 4


@pytest.mark.parametrize("width", [3.5, 0, -88, 1000, float("nan")])
def test_other_widths_are_refused(width):
    with pytest.raises(ValueError, match="expected 60 to 500 mm"):
        plot(Arm.load("planar2r"), width=width)
