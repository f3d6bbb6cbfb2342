"""What all pages of a lab show: one arm in one state, and what is known about it."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, pose_parts
from dhkit.kinematics import freedoms, singular_values
from dhkit.lab.contacts import Contacts
from dhkit.viewer import View
from dhkit.viewer.interactive import arm_state

if TYPE_CHECKING:
    from dhkit.control import SimulationResult
    from dhkit.trajectories import Trajectory

UNIQUE = 1e-6
"""Cosine (or sine) of the second Euler angle below which the first and third are not unique."""
SINGULAR = 1e-3
"""Smallest over largest singular value of the Jacobian (m and rad): below it a state is told as singular."""


def file_content(result: Trajectory | SimulationResult, kind: str) -> str:
    """Return a motion or a run as the content of a file that ends in ``kind``, in base64."""
    with tempfile.TemporaryDirectory(prefix="dhkit-lab-") as folder:
        return base64.b64encode(result.save(Path(folder) / f"file.{kind}").read_bytes()).decode()


class Desk:
    """One arm in one state on all pages.

    Parameters
    ----------
    arm
        The arm.
    view
        Where it is shown; its pages have panels.
    """

    def __init__(self, arm: Arm, view: View) -> None:
        self.arm, self.view = arm, view
        self.assumed_bodies = False
        self.order = "XYZ"
        self.q = self.first(arm)
        self.running = False
        """Whether a simulation moves the arm."""
        self.steer: Callable[[Array, int | None], None] = lambda q, joint: self.show(q)
        """What is done with the joint values, shape (n,), that a person asks for; the joint, from 0, if it is one."""
        self._contacts = Contacts()
        self.aimed: Array | None = None
        """Joint values at the target of the tool, which a simulation may follow, shape (n,)."""
        self.shown: list[Callable[[Array], None]] = []
        """Called with the joint values, shape (n,), of every state that is shown."""
        self.changed: list[Callable[[], None]] = []
        """Called after another arm has taken this one's place."""

    @staticmethod
    def first(arm: Arm) -> Array:
        """Return the joint values that an arm is first shown in, shape (n,)."""
        ready = arm.configurations.get("ready")
        return np.zeros(arm.n) if ready is None else np.array(ready)

    def replace(self, arm: Arm, q: Array | None = None) -> None:
        """Put another arm in the place of this one."""
        kept = (
            q if q is not None else self.q if arm.description.kinds == self.arm.description.kinds else self.first(arm)
        )
        before = self.arm, self.q, self.aimed
        self.arm, self.q, self.aimed = arm, kept, None
        try:
            self.view.replace(arm.description, kept)
            self.publish()
        except BaseException:
            self.arm, self.q, self.aimed = before
            self.view.replace(self.arm.description, self.q)
            self.publish()
            raise
        for call in self.changed:
            call()

    def show(self, q: Array) -> None:
        """Show joint values, shape (n,)."""
        self.q = q.copy()
        self.view.show(self.q)
        self.publish_state()
        for call in self.shown:
            call(self.q)

    def publish(self) -> None:
        """Tell the pages everything about the arm, and its state."""
        self.view.panel("arm", arm_state(self.arm.description, assumed_bodies=self.assumed_bodies))
        self._contacts.prepare(self.arm, self.publish_state)
        self.show(self.q)

    def publish_state(self) -> None:
        """Tell the pages the numbers of the state on show."""
        arm, q = self.arm, self.q  # another thread may replace them meanwhile
        numbers = arm.description.numbers
        outside = np.flatnonzero((q < numbers.lower) | (q > numbers.upper))
        self.view.panel(
            "joints",
            {
                "q": q.tolist(),
                "within": not len(outside),
                "outside": outside.tolist(),
                "touching": self._contacts.links(arm, q),
            },
        )
        self.view.panel("tool", self.tool(arm, q))

    def tool(self, arm: Arm, q: Array) -> dict[str, Any]:
        """Return the numbers of the tool at joint values, shape (n,)."""
        T = arm.fk(q)
        xyz, euler = pose_parts(T, order=self.order)
        # Where the second angle is at the end of its range only the sum or difference of the others counts.
        ends = np.cos(euler[1]) if self.order[0] != self.order[2] else np.sin(euler[1])
        return {
            "T": T.ravel().tolist(),
            "xyz": xyz.tolist(),
            "euler": euler.tolist(),
            "order": self.order,
            "unique": bool(abs(ends) > UNIQUE),
            "manipulability": float(arm.manipulability(q)),
            "singular": _singular(arm, q),
        }

    def close(self) -> None:
        """End what runs in the background."""
        self._contacts.close()


def _singular(arm: Arm, q: Array) -> str | None:
    """Return what is said of a state that is singular, or None."""
    sigma = singular_values(arm.description, q, "whole")
    rank = freedoms(arm.description, "whole")
    if rank < 1 or sigma[rank - 1] >= SINGULAR * sigma[0]:
        return None
    return "singular: the tool cannot move in one of its directions here"
