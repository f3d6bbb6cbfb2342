"""Arms on a screen: a meshcat scene live in a browser or as one offline page, and figures.

The only folder that imports meshcat and matplotlib, and only where they are needed.
"""

from __future__ import annotations

from dhkit.viewer.figures import plot, plot_arm, plot_motion
from dhkit.viewer.view import View

__all__ = ["View", "plot", "plot_arm", "plot_motion"]
