"""Arms on a screen: a meshcat scene live in a browser or as one offline page, and figures.

The only folder that imports meshcat and matplotlib, and only where they are needed.
"""

from __future__ import annotations

from dhkit.viewer.figures import plot, plot_arm, plot_motion
from dhkit.viewer.overlays import heat_colors
from dhkit.viewer.simulation_figures import plot_comparison, plot_simulation
from dhkit.viewer.trajectory_figures import plot_trajectory, plot_uses
from dhkit.viewer.view import View
from dhkit.viewer.workspace_figures import plot_ellipsoid, plot_workspace

__all__ = [
    "View",
    "heat_colors",
    "plot",
    "plot_arm",
    "plot_comparison",
    "plot_ellipsoid",
    "plot_motion",
    "plot_simulation",
    "plot_trajectory",
    "plot_uses",
    "plot_workspace",
]
