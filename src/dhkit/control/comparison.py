"""Controllers by name, tuned alike and compared on one motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control.adaptive import Adaptive
from dhkit.control.controller import Controller
from dhkit.control.joint_controllers import PID
from dhkit.control.linear import LQR
from dhkit.control.model_controllers import ComputedTorque, FeedForward, PDGravity
from dhkit.control.operational_space import OperationalSpace
from dhkit.control.options import SimulationKeywords, SimulationOptions
from dhkit.control.references import Reference, reference_of
from dhkit.control.result import SimulationResult
from dhkit.control.simulation import simulate
from dhkit.description import Array, Description, takes_robot
from dhkit.description.joint_text import joint_unit
from dhkit.display import counted, html_block, html_lines, html_table, repr_line
from dhkit.errors import DhkitError
from dhkit.trajectories import Trajectory

STYLES = ("text", "markdown", "latex")
LARGE = 10.0
"""Position error of the tool (mm) from which it is printed without decimals."""
Tuned = Callable[[Description, float, float, Array], Controller]
CONTROLLERS: Mapping[str, Tuned] = {
    "pd": lambda arm, w, z, q: PID.tuned(arm, w, z, integral=0.0),
    "pid": lambda arm, w, z, q: PID.tuned(arm, w, z),
    "pd-gravity": lambda arm, w, z, q: PDGravity.tuned(arm, w, z),
    "feed-forward": lambda arm, w, z, q: FeedForward.tuned(arm, w, z),
    "computed-torque": lambda arm, w, z, q: ComputedTorque.tuned(arm, w, z),
    "operational-space": lambda arm, w, z, q: OperationalSpace.tuned(arm, w, z),
    "adaptive": lambda arm, w, z, q: Adaptive.tuned(arm, w, max(z, 1.0)),
    "lqr": lambda arm, w, z, q: LQR(arm, q),
}
"""Constructors by name: functions of a robot, a bandwidth (rad/s), a damping, and joint values (n,) for the LQR."""


def make_controller(
    name: str,
    description: Description,
    bandwidth: float = 20.0,
    damping: float = 1.0,
    q: Array | None = None,
) -> Controller:
    """Return a tuned controller by its name.

    Parameters
    ----------
    name
        One of ``CONTROLLERS``.
    description
        The robot that the controller knows.
    bandwidth, damping
        Bandwidth, rad/s, and damping ratio, as for the controllers' ``tuned``. An adaptive controller has a damping of
        at least 1; an LQR ignores both and has its default weights.
    q
        Joint values at which an LQR is linearized, shape (n,), rad and m; zero unless given.

    Returns
    -------
    Controller
        A new controller with gains for the bandwidth.

    Raises
    ------
    ValueError
        No such controller.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> make_controller("computed-torque", library_robot("planar2r"), bandwidth=10.0)
    <ComputedTorque of planar2r: kp 100, kd 20>
    """
    _require_known(name)
    return CONTROLLERS[name](
        description, bandwidth, damping, np.zeros(description.n) if q is None else q
    )


def _require_known(name: str) -> None:
    if name not in CONTROLLERS:
        raise ValueError(f"controller is {name!r}; expected one of {', '.join(CONTROLLERS)}")


@dataclass(frozen=True, eq=False)
class Comparison:
    """Simulations of several controllers on the same motion; prints as a table."""

    results: Mapping[str, SimulationResult]
    """Runs by controller's name, of those that reached the end of the motion."""
    failures: Mapping[str, str]
    """Reasons by controller's name, of those that did not reach the end."""

    def rows(self, *, degrees: bool = False) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Return the headings and the rows of the table: errors of the joint that errs most, the tool's, torques.

        Parameters
        ----------
        degrees
            Whether errors of angles are in degrees.
        """
        unit = self._unit.replace("rad", "°") if degrees else self._unit
        headings = (
            "controller",
            f"largest error [{unit}]",
            "RMS",
            "at the end",
            "tool's largest [mm]",
            "torque [%]",
        )
        return headings, [(name, *_row(result, degrees)) for name, result in self.results.items()]

    def table(self, style: str = "text") -> str:
        """Return the table as ``text``, ``markdown`` or ``latex``; torques are shares of the drives' limits.

        Parameters
        ----------
        style
            ``"text"``, ``"markdown"`` or ``"latex"``.

        Raises
        ------
        ValueError
            Another style.
        """
        if style not in STYLES:
            raise ValueError(f"style is {style!r}; expected one of {', '.join(STYLES)}")
        headings, rows = self.rows()
        lines = [headings, *rows]
        if style == "markdown":
            ruled = [headings, ("---",) * len(headings), *rows]
            return "\n".join(f"| {' | '.join(line)} |" for line in ruled)
        if style == "latex":
            body = []
            for line in lines:
                cells = [cell.replace("%", r"\%") for cell in line]
                body.append(" & ".join(cells) + r" \\")
            begin = rf"\begin{{tabular}}{{l{'r' * (len(headings) - 1)}}}"
            return "\n".join([begin, body[0], r"\hline", *body[1:], r"\end{tabular}"])
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]

        def aligned(line: Sequence[str]) -> str:
            cells = zip(line[1:], widths[1:], strict=True)
            return "  ".join(
                [line[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in cells)]
            )

        failed = [f"{name}: {reason}" for name, reason in self.failures.items()]
        return "\n".join([*map(aligned, lines), *failed])

    def __str__(self) -> str:
        return self.table()

    def __repr__(self) -> str:
        peaks = {
            name: float(result.peak_error.max(initial=0.0)) for name, result in self.results.items()
        }
        best = min(peaks, key=peaks.__getitem__, default=None)
        summary = [] if best is None else [f"least error {peaks[best]:.2g} {self._unit} by {best}"]
        summary += [f"{len(self.failures)} failed"] if self.failures else []
        count = len(self.results) + len(self.failures)
        return repr_line("Comparison", counted(count, "controller"), ", ".join(summary))

    def _repr_html_(self) -> str:
        headings, rows = self.rows()
        failed = [f"{name}: {reason}" for name, reason in self.failures.items()]
        return html_block("Comparison", html_table(headings, rows, align="lr"), html_lines(failed))

    @property
    def _unit(self) -> str:
        """Unit of the joints' errors."""
        first = next(iter(self.results.values()), None)
        return joint_unit([] if first is None else first.description.numbers.prismatic)


def _row(result: SimulationResult, degrees: bool) -> tuple[str, ...]:
    scale = np.where(result.description.numbers.prismatic | (not degrees), 1.0, 180 / np.pi)
    # Largest |tau_i| / limit_i over all joints; a joint without limit has the share 0.
    effort = result.description.numbers.effort
    share = 100 * float((np.abs(result.tau).max(axis=0) / effort).max())
    errors = [
        float((scale * np.abs(x)).max())
        for x in (result.peak_error, result.rms_error, result.final_error)
    ]
    tool = 1000 * result.tool_norms.peak
    torque = f"{share:.0f}" if np.isfinite(effort).any() else "no limit"
    return (
        *(f"{error:.2g}" for error in errors),
        f"{tool:.0f}" if tool >= LARGE else f"{tool:.2g}",
        torque,
    )


@takes_robot
def compare(
    description: Description,
    reference: Reference | Trajectory,
    controllers: Sequence[str] | Mapping[str, str | Controller] | None = None,
    bandwidth: float = 20.0,
    damping: float = 1.0,
    done: Callable[[str], None] | None = None,
    *,
    duration: float | None = None,
    q0: ArrayLike | None = None,
    qd0: ArrayLike | None = None,
    options: SimulationOptions | None = None,
    **keywords: Unpack[SimulationKeywords],
) -> Comparison:
    """Simulate several controllers on one motion, each starting on it.

    Parameters
    ----------
    description
        The robot that the controllers know.
    reference
        The motion.
    controllers
        Names from ``CONTROLLERS``, tuned alike, all of them unless given; or a mapping of names of your own to
        controllers or such names: ``{"mine": my_controller, "pid": "pid"}``.
    bandwidth, damping
        As for :func:`make_controller`, for controllers given by name.
    done
        Called with each controller's name when its run ends.
    duration, q0, qd0, options, **keywords
        As for :func:`simulate`.

    Returns
    -------
    Comparison
        The runs by name, and the messages of those that failed.

    Raises
    ------
    ValueError
        No such controller.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.trajectories import quintic
    >>> arm = library_robot("planar2r")
    >>> runs = compare(arm, quintic(arm, [0, 0], [0.5, 1.0], duration=1.0), ["pd-gravity", "computed-torque"])
    >>> list(runs.results)
    ['pd-gravity', 'computed-torque']
    """
    checked = SimulationOptions.of(options, keywords)
    chosen: Mapping[str, Any]
    if isinstance(controllers, Mapping):
        chosen = controllers
    else:
        chosen = {name: name for name in (CONTROLLERS if controllers is None else controllers)}
        for name in chosen:
            if not isinstance(name, str):
                raise TypeError(
                    f"controllers: found {type(name).__name__} in a list; expected names, or a mapping such as "
                    '{"mine": controller}'
                )
    for given in chosen.values():
        if isinstance(given, str):
            _require_known(given)
    wanted = reference_of(description, reference)
    middle = wanted.sampled(np.array([(wanted.duration or 0.0) / 2]))[0][0]
    results = {}
    failures = {}
    for name, given in chosen.items():
        try:
            controller: Any = given
            if isinstance(given, str):
                controller = make_controller(given, description, bandwidth, damping, middle)
            results[name] = simulate(
                description, controller, wanted, duration, q0, qd0, options=checked
            )
        except DhkitError as error:
            failures[name] = str(error)
        if done is not None:
            done(name)
    return Comparison(results, failures)
