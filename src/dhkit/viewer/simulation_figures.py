"""Figures of simulations: joint values with their reference, errors and torques; errors of controllers compared."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dhkit.control import Comparison, SimulationResult
from dhkit.description import Array, Description
from dhkit.viewer.figures import PATH_COLOR, plot
from dhkit.viewer.notebook_figure import new_figure
from dhkit.viewer.panels import (
    LIMIT_STYLE,
    SHARED_COLOR,
    Panel,
    draw_curves,
    draw_panel,
    joint_color,
    joint_style,
    kinds_of_joints,
    name_joints,
    plain_axes,
    torque_panel,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CONTROLLER_COLORS = (
    "#332288",
    "#cc6677",
    "#117733",
    "#ddaa33",
    "#88ccee",
    "#aa4499",
    "#44aa99",
    "#882255",
    "#999933",
    "#777777",
)
"""Tol's muted scheme (SRON/EPS/TN/09-002, 2021), its yellow darkened: as many as there are controllers."""
STYLES = ("-", "-.", ":")

BUCKETS = 800
"""Stretches of time of which a curve's least and largest values are drawn: about as many as a diagram has pixels."""
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"), (1e-12, "p"))
REFERENCE_STYLE: dict[str, Any] = {"ls": (0, (4, 2.5)), "lw": 1.1}
REFERENCE_SHADE = 0.45
"""Brightness of a reference's colour, of that of its joint, so that it is seen on the joint's own curve."""
SATURATED_STYLE: dict[str, Any] = {"lw": 3.0, "capstyle": "projecting"}
SATURATED_STEP = 0.06
"""Distance between the bars of joints that are saturated, and from the limit to the first, of the limit."""
LEAST_ERROR = 1e-17
"""rad and m: what an error of 0 is drawn as on a logarithmic scale."""
SMALL_TEXT = 9
BETWEEN = 0.12
"""Room beside the diagrams of a comparison, inches: the controllers' names stand between them."""


@plot.register(SimulationResult)
def plot_simulation(result: SimulationResult) -> Figure:
    """Return a simulation over time: joint values and torques beside the errors of the joints and of the tool.

    The reference is dashed. Torques are shares of the joints' limits where all have one; bars beyond a limit are drawn
    while a joint's drive gives less than the controller asked for. Errors are the reference less the joint values.

    Parameters
    ----------
    result
        The simulation.
    """
    description, kinds = result.description, kinds_of_joints(result.description)
    rows = len(kinds) + 1
    figure = new_figure(figsize=(11.5, 1.6 + 2.2 * rows), layout="constrained")
    under = f"{result.controller}, " if result.controller else ""
    figure.suptitle(f"{description.name}: {under}{result.t[-1]:.3g} s simulated", fontsize=13, fontweight="bold")
    grid = figure.subplots(rows, 2, sharex=True, squeeze=False)
    for (values, errors), (joints, unit, label, _) in zip(grid, kinds, strict=False):
        _draw_values(values, result, joints, unit, label)
        _draw_errors(errors, result, joints)
    saturated = _draw_torques(grid[-1, 0], result)
    _draw_tool_errors(grid[-1, 1], result)
    grid[0, 0].set_xlim(0.0, float(result.t[-1]) or 1.0)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    name_joints(figure, description, _handles(saturated))
    return figure


def plot_comparison(results: Mapping[str, SimulationResult], title: str | None = None) -> Figure:
    """Return the largest joint error of several simulations over time, and its root mean square, on logarithmic scales.

    Parameters
    ----------
    results
        By the controllers' names; of arms with the same kinds of joints.
    title
        Above the figure; the arm's name unless given.

    Raises
    ------
    ValueError
        No result, or arms with other joints.
    """
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    if not results:
        raise ValueError("results is empty; expected simulations by their names")
    first = next(iter(results.values())).description
    for name, result in results.items():
        if result.description.kinds != first.kinds:
            raise ValueError(f"{name} has joints {result.description.kinds}; expected {first.kinds}")
    layout = ConstrainedLayoutEngine(w_pad=BETWEEN)
    figure = new_figure(figsize=(11.5, max(3.8, 1.6 + 0.42 * len(results))), layout=layout)
    text = title or f"{first.name}: errors of {len(results)} controllers"
    figure.suptitle(text, fontsize=13, fontweight="bold")
    curves, bars = figure.subplots(1, 2, width_ratios=(1.5, 1))
    unit = _unit(first, np.arange(first.n))
    _draw_largest_errors(curves, results)
    plain_axes(curves, f"largest joint error [{unit}]")
    curves.set_xlabel("time [s]")
    _draw_bars(bars, results)
    bars.set_xlabel(f"RMS of the joint that errs most [{unit}]")
    return figure


@plot.register(Comparison)
def _(value: Comparison) -> Figure:
    return plot_comparison(value.results)


@plot.register(Mapping)
def _(value: Mapping[str, SimulationResult]) -> Figure:
    if not value or not all(isinstance(result, SimulationResult) for result in value.values()):
        return plot.dispatch(object)(value)  # refuses it
    return plot_comparison(value)


def _draw_values(axes: Axes, result: SimulationResult, joints: NDArray[np.intp], unit: float, label: str) -> None:
    numbers = result.description.numbers
    both = unit * np.concatenate([result.q[:, joints], result.reference_q[:, joints]], axis=1)
    rows = _telling_rows(both)
    panel = Panel(label, joints, both[rows, : len(joints)], unit * numbers.lower[joints], unit * numbers.upper[joints])
    draw_panel(axes, panel, result.t[rows])
    low, high = axes.get_ylim()
    for k, i in enumerate(joints):
        values = both[rows, len(joints) + k]
        axes.plot(result.t[rows], values, color=_shade(joint_color(i)), **REFERENCE_STYLE)
        low, high = min(low, float(values.min())), max(high, float(values.max()))
    axes.set_ylim(low, high)


def _draw_errors(axes: Axes, result: SimulationResult, joints: NDArray[np.intp]) -> None:
    error = result.error[:, joints]
    factor, prefix = _prefix(float(np.abs(error).max()))
    rows = _telling_rows(error)
    unit = f"{prefix}{_unit(result.description, joints)}"
    none = np.full(len(joints), np.inf)
    draw_curves(axes, Panel(f"joint error [{unit}]", joints, error[rows] / factor, -none, none), result.t[rows])
    rms = float(result.rms_error[joints].max())
    _remark(axes, f"largest {np.abs(error).max() / factor:.3g} {unit}, RMS {rms / factor:.3g} {unit}")


def _draw_torques(axes: Axes, result: SimulationResult) -> bool:
    """Draw torques, and return whether one is saturated."""
    description = result.description
    rows = _telling_rows(result.tau)
    draw_panel(axes, torque_panel(description, result.tau[rows]), result.t[rows])
    limited = result.tau != result.tau_asked
    joints = np.flatnonzero(limited.any(axis=0))
    shown = torque_panel(description, result.tau).values
    low, high = axes.get_ylim()
    for rank, i in enumerate(joints.tolist(), start=1):
        lines = _bars_of(result.t, shown[:, i] * (1 + SATURATED_STEP * rank), limited[:, i])
        axes.hlines(*lines, color=joint_color(i), ls=joint_style(i), **SATURATED_STYLE)
        low, high = min(low, float(lines[0].min())), max(high, float(lines[0].max()))
    room = SATURATED_STEP / 2 * (high - low) if len(joints) else 0.0
    axes.set_ylim(low - room, high + room)
    if len(joints):
        i = int(joints[np.argmax(limited[:, joints].mean(axis=0))])
        _remark(axes, f"saturated: {description.joints[i].name} {_percent(float(limited[:, i].mean()))} of the time")
    return bool(len(joints))


def _draw_tool_errors(axes: Axes, result: SimulationResult) -> None:
    """Draw the tool's position error, and on a second axis its rotation error."""
    remarks = []
    right = axes.twinx()
    position = (axes, result.tool_error, "m", SHARED_COLOR)
    rotation = (right, result.tool_rotation_error, "rad", PATH_COLOR)
    for side, error, unit, color in (position, rotation):
        factor, prefix = _prefix(float(error.max()))
        rows = _telling_rows(error[:, None])
        side.plot(result.t[rows], error[rows] / factor, color=color, lw=1.8)
        side.set_ylim(0.0, 1.08 * float(error.max()) / factor or 1.0)
        remarks.append(f"{error.max() / factor:.3g} {prefix}{unit}")
        side.set_ylabel(f"{'position' if unit == 'm' else 'rotation'} [{prefix}{unit}]", color=color)
        side.tick_params(axis="y", colors=color)
    plain_axes(axes, axes.get_ylabel())
    right.spines[["top"]].set_visible(False)
    _remark(axes, f"tool error, largest {' and '.join(remarks)}")


def _draw_largest_errors(axes: Axes, results: Mapping[str, SimulationResult]) -> None:
    least, largest = np.inf, LEAST_ERROR
    for k, (name, result) in enumerate(results.items()):
        error = np.maximum(np.abs(result.error).max(axis=1), LEAST_ERROR)
        rows = _telling_rows(error[:, None])
        style = STYLES[k // len(CONTROLLER_COLORS) % len(STYLES)]
        axes.plot(
            result.t[rows], error[rows], style, color=CONTROLLER_COLORS[k % len(CONTROLLER_COLORS)], lw=1.6, label=name
        )
        # A run that begins on its reference would otherwise stretch the scale down to 0.
        least, largest = min(least, float(np.quantile(error, 0.02))), max(largest, float(error.max()))
    axes.set_yscale("log")
    axes.set_ylim(least / 3, 3 * largest)
    axes.set_xlim(0.0, max(float(result.t[-1]) for result in results.values()) or 1.0)


def _draw_bars(axes: Axes, results: Mapping[str, SimulationResult]) -> None:
    rms = np.array([float(result.rms_error.max()) for result in results.values()])
    drawn = np.maximum(rms, LEAST_ERROR)
    places, least = list(range(len(rms))), float(drawn.min()) / 3
    colors = [CONTROLLER_COLORS[k % len(CONTROLLER_COLORS)] for k in places]
    axes.barh(places, drawn - least, left=least, color=colors, height=0.6)
    for place, value in zip(places, rms, strict=True):
        axes.text(max(value, LEAST_ERROR) * 1.15, place, f"{value:.1e}", va="center", fontsize=SMALL_TEXT)
    axes.set_xscale("log")
    axes.set_xlim(least, float(drawn.max()) * (drawn.max() / least) ** 0.25)
    axes.set_yticks(places, list(results))
    axes.set_ylim(len(rms) - 0.4, -0.6)
    plain_axes(axes, "")
    axes.grid(visible=False, axis="y")
    axes.set_axisbelow(True)


def _telling_rows(values: Array) -> NDArray[np.intp]:
    """Return the rows of values, shape (N, m), that a diagram needs: the extremes of each curve in each stretch."""
    count = len(values)
    if count <= 2 * BUCKETS:
        return np.arange(count)
    edges = np.linspace(0, count, BUCKETS + 1).astype(int)
    found = [
        [begin + part.argmin(axis=0), begin + part.argmax(axis=0)]
        for begin, part in ((begin, values[begin:end]) for begin, end in pairwise(edges))
    ]
    return np.unique(np.append(np.ravel(found), [0, count - 1]))


def _bars_of(times: Array, levels: Array, chosen: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Return levels, beginnings and ends of the stretches of time that are chosen, of one sign each."""
    signs = np.where(chosen, np.sign(levels), 0.0)
    changes = np.flatnonzero(np.diff(signs)) + 1
    begins, ends = np.append(0, changes), np.append(changes, len(signs))
    shown = signs[begins] != 0
    begins, ends = begins[shown], ends[shown]
    return levels[begins], times[begins], times[np.minimum(ends, len(times) - 1)]


def _handles(saturated: bool) -> tuple[Any, ...]:
    from matplotlib.lines import Line2D

    reference = Line2D([], [], color="#000000", label="reference", **REFERENCE_STYLE)
    limit = Line2D([], [], color=SHARED_COLOR, label="limit", **LIMIT_STYLE)
    if not saturated:
        return (reference, limit)
    return (reference, limit, Line2D([], [], color=SHARED_COLOR, lw=SATURATED_STYLE["lw"], label="saturated"))


def _remark(axes: Axes, text: str) -> None:
    axes.set_title(text, fontsize=SMALL_TEXT, color=SHARED_COLOR, loc="right")


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 0.995 else "100 %"


def _prefix(largest: float) -> tuple[float, str]:
    """Return the factor and the letter of the unit in which a number is 1 or more, or that of the smallest."""
    return next((prefix for prefix in PREFIXES if largest >= prefix[0]), PREFIXES[-1 if largest > 0 else 0])


def _unit(description: Description, joints: NDArray[np.intp]) -> str:
    sliding = description.numbers.prismatic[joints]
    return "m" if sliding.all() else "rad, m" if sliding.any() else "rad"


def _shade(color: str) -> tuple[float, ...]:
    from matplotlib.colors import to_rgb

    return tuple(REFERENCE_SHADE * part for part in to_rgb(color))
