"""Figures of simulations: joint values with their reference, errors and torques; errors of controllers compared."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dhkit.control import Comparison, SimulationResult
from dhkit.description import Array, Description
from dhkit.packages import imported
from dhkit.viewer.diagrams import (
    LINE_STYLES,
    SHARED_COLOR,
    Diagram,
    draw_curves,
    draw_diagram,
    draw_legend,
    joint_color,
    joint_kinds,
    joint_style,
    limit_handle,
    style_axes,
    torque_diagram,
)
from dhkit.viewer.figures import PATH_COLOR, figure_of
from dhkit.viewer.notebook import new_figure

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
_INTERVALS = 800
"""Time intervals of which a curve's smallest and largest value are drawn: about as many as a diagram has pixels."""
_PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"), (1e-12, "p"))
_REFERENCE_STYLE: dict[str, Any] = {"ls": (0, (4, 2.5)), "lw": 1.1}
_REFERENCE_BRIGHTNESS = 0.45
"""Brightness of a reference's colour, as a share of its joint's, so that it is seen on the joint's curve."""
_SATURATED_STYLE: dict[str, Any] = {"lw": 3.0, "capstyle": "projecting"}
_SATURATED_STEP = 0.06
"""Distance between the bars of saturated joints, and from the limit to the first bar, as a share of the limit."""
_MIN_ERROR = 1e-17
"""Error that smaller ones are drawn as on a logarithmic scale, rad and m."""
_SMALL_TEXT = 9
"""Size of small text, points."""
_DIAGRAM_MARGIN = 0.12
"""Room beside the diagrams of a comparison, inches: the controllers' names stand between them."""


@figure_of.register(SimulationResult)
def plot_simulation(result: SimulationResult) -> Figure:
    """Return a simulation over time: joint values and torques beside the errors of the joints and of the tool.

    The reference is dashed. Torques are drawn as shares of their limits if all joints have one; a bar beyond a limit
    shows when a joint's drive gives less than the controller asked for. Errors are references minus joint values.

    Parameters
    ----------
    result
        The simulation.

    Returns
    -------
    Figure
        A figure of matplotlib; a notebook shows it, ``savefig`` writes it.

    Examples
    --------
    >>> from dhkit import Arm, PDGravity
    >>> arm = Arm.load("planar2r")
    >>> run = arm.simulate(PDGravity(arm, kp=50, kd=10), [0.5, 0.2], 0.5, q0=[0, 0])
    >>> len(plot_simulation(run).axes)
    5
    """
    description = result.description
    kinds = joint_kinds(result.description)
    rows = len(kinds) + 1
    figure = new_figure(figsize=(11.5, 1.6 + 2.2 * rows), layout="constrained")
    controller = f"{result.controller}, " if result.controller else ""
    figure.suptitle(
        f"{description.name}: {controller}{result.t[-1]:.3g} s simulated",
        fontsize=13,
        fontweight="bold",
    )
    grid = figure.subplots(rows, 2, sharex=True, squeeze=False)
    for (values, errors), (joints, unit, label, _) in zip(grid, kinds, strict=False):
        _draw_values(values, result, joints, unit, label)
        _draw_errors(errors, result, joints)
    saturated = _draw_torques(grid[-1, 0], result)
    _draw_tool_errors(grid[-1, 1], result)
    grid[0, 0].set_xlim(0.0, float(result.t[-1]) or 1.0)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    draw_legend(figure, description, _legend_handles(saturated))
    return figure


def plot_comparison(results: Mapping[str, SimulationResult], title: str | None = None) -> Figure:
    """Return the largest joint error of several simulations over time, and its root mean square, on logarithmic scales.

    Parameters
    ----------
    results
        Simulations by the names of their controllers, of arms with the same kinds of joints.
    title
        Title of the figure; the arm's name and the number of controllers if not given.

    Returns
    -------
    Figure
        A figure of matplotlib; a notebook shows it, ``savefig`` writes it.

    Raises
    ------
    ValueError
        There is no result, or the arms have different kinds of joints.

    Examples
    --------
    >>> from dhkit import Arm, PDGravity
    >>> arm = Arm.load("planar2r")
    >>> gains = {"soft": 20, "stiff": 80}
    >>> runs = {
    ...     name: arm.simulate(PDGravity(arm, kp=kp, kd=10), [0.5, 0.2], 0.5, q0=[0, 0])
    ...     for name, kp in gains.items()
    ... }
    >>> [axes.get_xlabel() for axes in plot_comparison(runs).axes]
    ['time [s]', 'RMS of the joint that errs most [rad]']
    """
    layout_engine = imported("matplotlib.layout_engine", "a figure")

    if not results:
        raise ValueError("results is empty; expected simulations by their names")
    first = next(iter(results.values())).description
    for name, result in results.items():
        if result.description.kinds != first.kinds:
            raise ValueError(
                f"{name} has joints {result.description.kinds}; expected {first.kinds}"
            )
    layout = layout_engine.ConstrainedLayoutEngine(w_pad=_DIAGRAM_MARGIN)
    figure = new_figure(figsize=(11.5, max(3.8, 1.6 + 0.42 * len(results))), layout=layout)
    figure.suptitle(
        title or f"{first.name}: errors of {len(results)} controllers",
        fontsize=13,
        fontweight="bold",
    )
    curves, bars = figure.subplots(1, 2, width_ratios=(1.5, 1))
    unit = _unit(first, np.arange(first.n))
    _draw_largest_errors(curves, results)
    style_axes(curves, f"largest joint error [{unit}]")
    curves.set_xlabel("time [s]")
    _draw_bars(bars, results)
    bars.set_xlabel(f"RMS of the joint that errs most [{unit}]")
    return figure


@figure_of.register(Comparison)
def _(value: Comparison) -> Figure:
    return plot_comparison(value.results)


@figure_of.register(Mapping)
def _(value: Mapping[str, SimulationResult]) -> Figure:
    if not value or not all(isinstance(result, SimulationResult) for result in value.values()):
        return figure_of.dispatch(object)(value)  # refuses it
    return plot_comparison(value)


def _draw_values(
    axes: Axes, result: SimulationResult, joints: NDArray[np.intp], unit: float, label: str
) -> None:
    numbers = result.description.numbers
    both = unit * np.concatenate([result.q[:, joints], result.reference_q[:, joints]], axis=1)
    rows = _extreme_rows(both)
    diagram = Diagram(
        label,
        joints,
        both[rows, : len(joints)],
        unit * numbers.lower[joints],
        unit * numbers.upper[joints],
    )
    draw_diagram(axes, diagram, result.t[rows])
    low, high = axes.get_ylim()
    for k, i in enumerate(joints):
        values = both[rows, len(joints) + k]
        axes.plot(result.t[rows], values, color=_darken(joint_color(i)), **_REFERENCE_STYLE)
        low = min(low, float(values.min()))
        high = max(high, float(values.max()))
    axes.set_ylim(low, high)


def _draw_errors(axes: Axes, result: SimulationResult, joints: NDArray[np.intp]) -> None:
    error = result.error[:, joints]
    factor, prefix = _prefix(float(np.abs(error).max()))
    rows = _extreme_rows(error)
    unit = f"{prefix}{_unit(result.description, joints)}"
    none = np.full(len(joints), np.inf)
    draw_curves(
        axes,
        Diagram(f"joint error [{unit}]", joints, error[rows] / factor, -none, none),
        result.t[rows],
    )
    rms = float(result.rms_error[joints].max())
    _remark(
        axes, f"largest {np.abs(error).max() / factor:.3g} {unit}, RMS {rms / factor:.3g} {unit}"
    )


def _draw_torques(axes: Axes, result: SimulationResult) -> bool:
    """Draw torques, and return whether a drive is saturated."""
    description = result.description
    rows = _extreme_rows(result.tau)
    draw_diagram(axes, torque_diagram(description, result.tau[rows]), result.t[rows])
    limited = result.tau != result.tau_asked
    joints = np.flatnonzero(limited.any(axis=0))
    shown = torque_diagram(description, result.tau).values
    low, high = axes.get_ylim()
    for rank, i in enumerate(joints.tolist(), start=1):
        bars = _bars(result.t, shown[:, i] * (1 + _SATURATED_STEP * rank), limited[:, i])
        axes.hlines(*bars, color=joint_color(i), ls=joint_style(i), **_SATURATED_STYLE)
        low = min(low, float(bars[0].min()))
        high = max(high, float(bars[0].max()))
    margin = _SATURATED_STEP / 2 * (high - low) if len(joints) else 0.0
    axes.set_ylim(low - margin, high + margin)
    if len(joints):
        i = int(joints[np.argmax(limited[:, joints].mean(axis=0))])
        share = 100 * float(limited[:, i].mean())
        percent = f"{share:.2g}" if share < 99.5 else "100"
        _remark(axes, f"saturated: {description.joints[i].name} {percent} % of the time")
    return bool(len(joints))


def _draw_tool_errors(axes: Axes, result: SimulationResult) -> None:
    """Draw the tool's position error, and on a second axis its rotation error."""
    remarks = []
    right = axes.twinx()
    position = (axes, result.tool_error, "m", SHARED_COLOR)
    rotation = (right, result.tool_rotation_error, "rad", PATH_COLOR)
    for side, error, unit, color in (position, rotation):
        factor, prefix = _prefix(float(error.max()))
        rows = _extreme_rows(error[:, None])
        side.plot(result.t[rows], error[rows] / factor, color=color, lw=1.8)
        side.set_ylim(0.0, 1.08 * float(error.max()) / factor or 1.0)
        remarks.append(f"{error.max() / factor:.3g} {prefix}{unit}")
        side.set_ylabel(
            f"{'position' if unit == 'm' else 'rotation'} [{prefix}{unit}]", color=color
        )
        side.tick_params(axis="y", colors=color)
    style_axes(axes, axes.get_ylabel())
    right.spines[["top"]].set_visible(False)
    _remark(axes, f"tool error, largest {' and '.join(remarks)}")


def _draw_largest_errors(axes: Axes, results: Mapping[str, SimulationResult]) -> None:
    least = np.inf
    largest = _MIN_ERROR
    for k, (name, result) in enumerate(results.items()):
        error = np.maximum(np.abs(result.error).max(axis=1), _MIN_ERROR)
        rows = _extreme_rows(error[:, None])
        style = LINE_STYLES[k // len(CONTROLLER_COLORS) % len(LINE_STYLES)]
        axes.plot(
            result.t[rows],
            error[rows],
            style,
            color=CONTROLLER_COLORS[k % len(CONTROLLER_COLORS)],
            lw=1.6,
            label=name,
        )
        # A run that begins on its reference would otherwise stretch the scale down to 0.
        least = min(least, float(np.quantile(error, 0.02)))
        largest = max(largest, float(error.max()))
    axes.set_yscale("log")
    axes.set_ylim(least / 3, 3 * largest)
    axes.set_xlim(0.0, max(float(result.t[-1]) for result in results.values()) or 1.0)


def _draw_bars(axes: Axes, results: Mapping[str, SimulationResult]) -> None:
    rms = np.array([float(result.rms_error.max()) for result in results.values()])
    drawn = np.maximum(rms, _MIN_ERROR)
    places = list(range(len(rms)))
    least = float(drawn.min()) / 3
    colors = [CONTROLLER_COLORS[k % len(CONTROLLER_COLORS)] for k in places]
    axes.barh(places, drawn - least, left=least, color=colors, height=0.6)
    for place, value in zip(places, rms, strict=True):
        axes.text(
            max(value, _MIN_ERROR) * 1.15, place, f"{value:.1e}", va="center", fontsize=_SMALL_TEXT
        )
    axes.set_xscale("log")
    axes.set_xlim(least, float(drawn.max()) * (drawn.max() / least) ** 0.25)
    axes.set_yticks(places, list(results))
    axes.set_ylim(len(rms) - 0.4, -0.6)
    style_axes(axes, "")
    axes.grid(visible=False, axis="y")
    axes.set_axisbelow(True)


def _extreme_rows(values: Array) -> NDArray[np.intp]:
    """Return the rows of m curves, shape (N, m), that a diagram needs: the extremes of each curve in each interval."""
    count = len(values)
    if count <= 2 * _INTERVALS:
        return np.arange(count)
    edges = np.linspace(0, count, _INTERVALS + 1).astype(int)
    extremes = []
    for begin, end in pairwise(edges):
        part = values[begin:end]
        extremes += [begin + part.argmin(axis=0), begin + part.argmax(axis=0)]
    return np.unique(np.append(np.ravel(extremes), [0, count - 1]))


def _bars(times: Array, levels: Array, chosen: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Return levels, beginnings and ends, s, of the chosen intervals of times, shape (N,); levels keep their sign."""
    signs = np.where(chosen, np.sign(levels), 0.0)
    changes = np.flatnonzero(np.diff(signs)) + 1
    begins = np.append(0, changes)
    ends = np.append(changes, len(signs))
    shown = signs[begins] != 0
    begins = begins[shown]
    ends = ends[shown]
    return levels[begins], times[begins], times[np.minimum(ends, len(times) - 1)]


def _legend_handles(saturated: bool) -> tuple[Any, ...]:
    from matplotlib.lines import Line2D

    reference = Line2D([], [], color="#000000", label="reference", **_REFERENCE_STYLE)
    limit = limit_handle()
    if not saturated:
        return (reference, limit)
    return (
        reference,
        limit,
        Line2D([], [], color=SHARED_COLOR, lw=_SATURATED_STYLE["lw"], label="saturated"),
    )


def _remark(axes: Axes, text: str) -> None:
    axes.set_title(text, fontsize=_SMALL_TEXT, color=SHARED_COLOR, loc="right")


def _prefix(largest: float) -> tuple[float, str]:
    """Return the factor and the letter of the largest unit in which a number is at least 1, or of the smallest unit."""
    return next(
        (prefix for prefix in _PREFIXES if largest >= prefix[0]),
        _PREFIXES[-1 if largest > 0 else 0],
    )


def _unit(description: Description, joints: NDArray[np.intp]) -> str:
    sliding = description.numbers.prismatic[joints]
    if sliding.all():
        return "m"
    return "rad, m" if sliding.any() else "rad"


def _darken(color: str) -> tuple[float, ...]:
    from matplotlib.colors import to_rgb

    return tuple(_REFERENCE_BRIGHTNESS * part for part in to_rgb(color))
