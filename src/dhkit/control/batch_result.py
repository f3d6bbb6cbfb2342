"""Results of a batch of simulations, one row for each run."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dhkit.control.result import EnergyAudit, SimulationResult, span_text
from dhkit.description import Array, Description, write_atomically
from dhkit.description.joint_text import joint_unit
from dhkit.display import counted, html_block, html_table, repr_line
from dhkit.dynamics import Friction, forward_dynamics, kinetic_energy, potential_energy


@dataclass(frozen=True, eq=False)
class History:
    """All states of a batch: arrays of shape (B, N+1, n), rad and m, per second, N m and N."""

    q: Array
    qd: Array
    tau: Array
    tau_asked: Array
    reference_q: Array
    """Joint values of the reference, broadcast over the batch, shape (B, N+1, n)."""
    reference_qd: Array

    def __repr__(self) -> str:
        return repr_line("History", f"{len(self.q)} runs", counted(self.q.shape[1], "state"))


@dataclass(frozen=True, eq=False)
class BatchResult:
    """B simulated runs of N steps. A run whose state became NaN stays NaN; the other runs are not affected."""

    arms: tuple[Description, ...]
    """The arm that moved in all runs, or one arm for each run."""
    friction: Friction | None
    t: Array
    """Times of the states, shape (N+1,), s."""
    q0: Array
    """Joint values at the start, shape (B, n), rad and m."""
    qd0: Array
    q: Array
    """Joint values at the end, shape (B, n), rad and m."""
    qd: Array
    final_error: Array
    """Reference minus joint values at the end, shape (B, n), rad and m."""
    peak_error: Array | None
    """Largest absolute error of each joint, shape (B, n), rad and m; None with ``keep="final"``."""
    rms_error: Array | None
    """Root mean square error of each joint, shape (B, n), rad and m; None with ``keep="final"``."""
    saturated: Array | None
    """Share of steps in which a joint's drive was at its limit, shape (B, n), 0 to 1; None with ``keep="final"``."""
    outside: NDArray[np.bool_] | None
    """Runs that passed a joint limit in some state, shape (B,): a batch has no stops. None with ``keep="final"``."""
    works: Array
    """Work of the drives, the integral of its absolute power, and work lost to friction, shape (B, 3), J."""
    history: History | None = None
    """All states; None unless ``keep="all"``."""

    def __len__(self) -> int:
        return len(self.q)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Whether a run ended in a state that is not finite, shape (B,)."""
        failed: NDArray[np.bool_] = np.any(~np.isfinite(self.q) | ~np.isfinite(self.qd), axis=1)
        return failed

    def arm(self, index: int) -> Description:
        """Return the arm of one run.

        Parameters
        ----------
        index
            Number of the run, from 0.
        """
        return self.arms[0] if len(self.arms) == 1 else self.arms[index]

    def audit(self, index: int) -> EnergyAudit:
        """Return the energy balance of one run.

        Parameters
        ----------
        index
            Number of the run, from 0.
        """
        arm = self.arm(index)
        q, qd = (
            np.stack([first[index], last[index]])
            for first, last in ((self.q0, self.q), (self.qd0, self.qd))
        )
        kinetic = kinetic_energy(arm, q, qd)
        energy = kinetic + potential_energy(arm, q)
        drives, turnover, friction = self.works[index].tolist()
        return EnergyAudit(
            change=float(energy[1] - energy[0]),
            drives=drives,
            pushes=0.0,
            friction=friction,
            impacts=0.0,
            turnover=turnover + float(kinetic.max()),
        )

    def __getitem__(self, index: int) -> SimulationResult:
        """Return one run.

        Raises
        ------
        ValueError
            The batch did not keep all states.
        IndexError
            There is no such run.
        """
        if self.history is None:
            raise ValueError('the states of single runs were not kept; expected keep="all"')
        if not isinstance(index, int | np.integer):
            raise TypeError(f"run {index!r}; expected the number of one run")
        if not -len(self) <= index < len(self):
            raise IndexError(f"run {index} of {len(self)}")
        arm = self.arm(index)
        history = self.history
        q, qd, tau, asked = (
            x[index] for x in (history.q, history.qd, history.tau, history.tau_asked)
        )
        return SimulationResult(
            description=arm,
            t=self.t,
            q=q,
            qd=qd,
            qdd=forward_dynamics(
                arm, q, qd, tau, friction=False if self.friction is None else self.friction
            ),
            tau=tau,
            tau_asked=asked,
            reference_q=np.array(history.reference_q[index]),
            reference_qd=np.array(history.reference_qd[index]),
            audit=self.audit(index),
            saturated=np.mean(tau != asked, axis=0),
        )

    def save(self, path: str | Path) -> Path:
        """Write the arrays as ``.npz``, for :func:`numpy.load`, and return the path.

        Parameters
        ----------
        path
            File that ends in ``.npz``.

        Raises
        ------
        ValueError
            Another suffix.
        OSError
            The file cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() != ".npz":
            raise ValueError(f"{path}: found suffix {path.suffix!r}; expected .npz")
        names = (
            "t",
            "q0",
            "qd0",
            "q",
            "qd",
            "final_error",
            "peak_error",
            "rms_error",
            "saturated",
            "outside",
            "works",
        )
        arrays = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        if self.history is not None:
            arrays |= {f"history_{name}": value for name, value in vars(self.history).items()}
        file = io.BytesIO()
        np.savez(file, **arrays)
        write_atomically(path, file.getvalue())
        return path

    def __repr__(self) -> str:
        summary = [span_text(self.t)]
        unit = joint_unit(self.arms[0].numbers.prismatic)
        if self.peak_error is not None:
            summary.append(f"largest error {np.nanmax(self.peak_error, initial=0.0):.3g} {unit}")
        return repr_line(
            "BatchResult",
            f"{len(self)} x {self.arms[0].name}",
            ", ".join([*summary, *self._remarks]),
        )

    def _repr_html_(self) -> str:
        known = {
            "peak error": self.peak_error,
            "RMS": self.rms_error,
            "at the end": self.final_error,
        }
        columns = {
            name: np.abs(values[~self.failed])
            for name, values in known.items()
            if values is not None
        }
        rows = []
        for i, joint in enumerate(self.arms[0].joints):
            largest = [f"{np.max(values[:, i], initial=0.0):.3g}" for values in columns.values()]
            rows.append((joint.name, *largest, joint_unit([not joint.is_revolute])))
        headings = ("joint", *columns, "")
        align = "l" + "r" * len(columns) + "l"
        title = (
            f"{len(self)} x {self.arms[0].name}: {', '.join([span_text(self.t), *self._remarks])}"
        )
        return html_block(
            title, html_table(headings, rows, "Largest of all runs that did not fail", align)
        )

    @property
    def _remarks(self) -> list[str]:
        """Numbers of runs that failed or passed their limits, as texts; those that are 0 are left out."""
        outside = 0 if self.outside is None else int(self.outside.sum())
        counts = {"failed": int(self.failed.sum()), "outside their limits": outside}
        return [f"{count} {what}" for what, count in counts.items() if count]
