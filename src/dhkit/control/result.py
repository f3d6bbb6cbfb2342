"""Result of a simulation: states, torques, errors and the energy balance."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dhkit.description import Array, Description, Robot, description_of
from dhkit.description.joint_text import joint_unit
from dhkit.display import counted, html_block, html_table, repr_line
from dhkit.formats import format_function
from dhkit.kinematics import forward_kinematics


@dataclass(frozen=True)
class EnergyAudit:
    """Energy balance of a run, J; ``remains`` would be 0 without rounding and integration errors."""

    change: float
    """Change of kinetic plus potential energy from the first state to the last."""
    drives: float
    """Work of the applied torques."""
    pushes: float
    """Work of external wrenches."""
    friction: float
    """Work lost to friction."""
    impacts: float
    """Kinetic energy lost in impacts at stops."""
    turnover: float
    """Integral of the drives' absolute power plus the largest kinetic energy: the scale of ``error``."""

    @property
    def remains(self) -> float:
        """Change of energy minus all works: the part that integration errors explain."""
        return self.change - (self.drives + self.pushes - self.friction - self.impacts)

    def __str__(self) -> str:
        parts = "change {change:.4g}, drives {drives:.4g}, pushes {pushes:.4g}, friction {friction:.4g}, impacts"
        parts += " {impacts:.4g}"
        return f"{parts.format(**vars(self))} J; residual {self.remains:.1e} J, {self.error:.1e} of the turnover"

    @property
    def error(self) -> float:
        """``remains`` divided by ``turnover``; NaN if the run failed, 0 if nothing moved."""
        if not self.remains:
            return 0.0
        return abs(self.remains) / self.turnover if self.turnover != 0 else float("inf")

    def __repr__(self) -> str:
        summary = f"{self.turnover:.4g} J turned over, residual {self.remains:.1e} J"
        return repr_line("EnergyAudit", summary=summary)

    def _repr_html_(self) -> str:
        names = ("change", "drives", "pushes", "friction", "impacts", "remains", "turnover")
        return html_table(
            names, [tuple(f"{getattr(self, name):.4g}" for name in names)], "Energy [J]", align="r"
        )


class ErrorNorms(NamedTuple):
    """Norms of an error over time, in the error's unit."""

    peak: float
    """Largest value."""
    rms: float
    """Root mean square over all states."""
    final: float
    """Value at the last state."""


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """A simulated run of N steps: N+1 states, the first at time 0."""

    description: Description
    """The arm that moved."""
    t: Array
    """Times of the states, shape (N+1,), s."""
    q: Array
    """Joint values, shape (N+1, n), rad and m."""
    qd: Array
    qdd: Array
    """Accelerations right after each time, under the torques from then on, shape (N+1, n), rad/s^2 and m/s^2."""
    tau: Array
    """Torques of the drives from each time on, shape (N+1, n), N m and N; those of the last row have not acted."""
    tau_asked: Array
    """Torques that the controller commanded, shape (N+1, n), N m and N."""
    reference_q: Array
    """Joint values of the reference, shape (N+1, n), rad and m."""
    reference_qd: Array
    audit: EnergyAudit
    reference_poses: Array = field(default_factory=lambda: np.zeros((0, 12)), kw_only=True)
    """Poses of the tool in the reference, upper three rows, shape (N+1, 12), if the robot that the reference and the
    controller know has another geometry than the arm that moved; otherwise shape (0, 12)."""
    controller: str = field(default="", kw_only=True)
    """The controller's name, for figures; files do not keep it."""
    saturated: Array = field(default_factory=lambda: np.zeros(0))
    """Share of steps in which each joint's drive was at its limit, shape (n,), 0 to 1."""

    @property
    def error(self) -> Array:
        """Reference minus joint values, shape (N+1, n), rad and m."""
        return self.reference_q - self.q

    @property
    def peak_error(self) -> Array:
        """Largest absolute error of each joint, shape (n,), rad and m."""
        peak: Array = np.abs(self.error).max(axis=0)
        return peak

    @property
    def rms_error(self) -> Array:
        """Root mean square error of each joint, shape (n,), rad and m."""
        rms: Array = np.sqrt(np.mean(self.error**2, axis=0))
        return rms

    @property
    def final_error(self) -> Array:
        """Error of each joint at the end, shape (n,), rad and m."""
        final: Array = self.error[-1]
        return final

    @cached_property
    def T(self) -> Array:
        """Poses of the tool in the world, shape (N+1, 4, 4)."""
        return forward_kinematics(self.description, self.q)

    @cached_property
    def reference_T(self) -> Array:
        """Poses of the tool in the reference, in the world, shape (N+1, 4, 4)."""
        if not len(self.reference_poses):
            return forward_kinematics(self.description, self.reference_q)
        T = np.tile(np.eye(4), (len(self.reference_poses), 1, 1))
        T[:, :3] = self.reference_poses.reshape(-1, 3, 4)
        return T

    @cached_property
    def tool_error(self) -> Array:
        """Distance of the tool's origin from that of the reference, shape (N+1,), m."""
        distance: Array = np.linalg.norm(self.T[:, :3, 3] - self.reference_T[:, :3, 3], axis=1)
        return distance

    @cached_property
    def tool_rotation_error(self) -> Array:
        """Angle of the rotation from the tool's orientation to that of the reference, shape (N+1,), rad, 0 to pi.

        Computed from both the sine and the cosine of the angle, which is accurate for small angles.
        """
        # R = T^T T_reference turns by phi about a unit vector u. Its skew entries are 2 sin(phi) u, and its trace is
        # 1 + 2 cos(phi).
        R = np.swapaxes(self.T[:, :3, :3], 1, 2) @ self.reference_T[:, :3, :3]
        skew = np.stack(
            [R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1
        )
        angle: Array = np.arctan2(np.linalg.norm(skew, axis=1), np.trace(R, axis1=1, axis2=2) - 1)
        return angle

    @property
    def tool_norms(self) -> ErrorNorms:
        """Norms of :attr:`tool_error`, m."""
        return _norms(self.tool_error)

    @property
    def tool_rotation_norms(self) -> ErrorNorms:
        """Norms of :attr:`tool_rotation_error`, rad."""
        return _norms(self.tool_rotation_error)

    def save(self, path: str | Path) -> Path:
        """Write a file by its suffix and return its path; see :func:`dhkit.control.result_files.save_result`.

        Parameters
        ----------
        path
            File that ends in ``.npz``, ``.mat`` or ``.csv``.
        """
        saved: Path = format_function("save_result")(self, path)
        return saved

    @classmethod
    def load(cls, path: str | Path, robot: Robot | None = None) -> SimulationResult:
        """Read a file of :meth:`save`; see :func:`dhkit.control.result_files.load_result`. A robot may be an arm.

        Parameters
        ----------
        path
            File of :meth:`save`.
        robot
            Robot, or arm, of the run; the one that the file holds unless given.
        """
        result: SimulationResult = format_function("load_result")(
            path, None if robot is None else description_of(robot)
        )
        return result

    def __repr__(self) -> str:
        unit = joint_unit(self.description.numbers.prismatic)
        error = f"largest error {self.peak_error.max(initial=0.0):.3g} {unit}"
        return repr_line("SimulationResult", self.description.name, f"{span_text(self.t)}, {error}")

    def _repr_html_(self) -> str:
        joints = self.description.joints
        peak = self.peak_error
        rms = self.rms_error
        final = self.final_error
        saturated = (
            self.saturated if len(self.saturated) else np.mean(self.tau != self.tau_asked, axis=0)
        )
        rows = []
        for i, joint in enumerate(joints):
            errors = [f"{error[i]:.3g}" for error in (peak, rms, final)]
            unit = joint_unit([not joint.is_revolute])
            largest_torque = (
                f"{np.abs(self.tau[:, i]).max():.4g} {'N m' if joint.is_revolute else 'N'}"
            )
            rows.append((joint.name, *errors, unit, largest_torque, f"{100 * saturated[i]:.3g} %"))
        headings = (
            "joint",
            "largest error",
            "RMS",
            "at the end",
            "",
            "largest torque",
            "saturated",
        )
        by = f" under {self.controller}" if self.controller else ""
        return html_block(
            f"{self.description.name}{by}: {span_text(self.t)}",
            html_table(headings, rows, align="lrrrlr"),
            self.audit._repr_html_(),
        )


def span_text(t: Array) -> str:
    """Return the duration and the number of steps of a run, from the times of its rows, shape (N+1,), s."""
    return f"{t[-1]:g} s in {counted(len(t) - 1, 'step')}"


def _norms(error: Array) -> ErrorNorms:
    return ErrorNorms(float(error.max()), float(np.sqrt(np.mean(error**2))), float(error[-1]))
