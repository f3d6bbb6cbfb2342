"""The desk: the one arm and state that all pages of a lab show, with the numbers that are known about it."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, pose_parts
from dhkit.kinematics import freedoms, singular_values
from dhkit.lab.contacts import Contacts
from dhkit.viewer import View
from dhkit.viewer.interactive import arm_state
from dhkit.viewer.scene import first_configuration

if TYPE_CHECKING:
    from dhkit.control import SimulationResult
    from dhkit.planning import Scene
    from dhkit.trajectories import Trajectory

EULER_TOLERANCE = 1e-6
"""The first and third Euler angles are not unique where the cosine (or sine) of the second is at most this."""
START_TURN = 0.4
"""Turn of every joint, rad, where an arm has no regular configuration with a name."""
START_STROKE = 0.2
"""Stroke of every prismatic joint likewise, as a share of the reach."""
SINGULAR_RATIO = 1e-3
"""A state is shown as singular where the smallest over the largest singular value of the Jacobian (rad and m) is below
this."""


def file_content(result: Trajectory | SimulationResult, kind: str) -> str:
    """Return a motion or a run as the content of a file that ends in ``kind``, in base64."""
    with tempfile.TemporaryDirectory(prefix="dhkit-lab-") as folder:
        return base64.b64encode(result.save(Path(folder) / f"file.{kind}").read_bytes()).decode()


def has_bodies(arm: Arm) -> bool:
    """Return whether every link of an arm has a mass."""
    return all(joint.bodies for joint in arm.description.joints)


def start_configuration(arm: Arm) -> Array:
    """Return the joint values at which an arm is shown first, shape (n,), rad and m.

    They are ``ready``, or the first named configuration that is regular, or else a small turn or stroke of every joint
    inside its limits: at a singular configuration the tool cannot be moved in every direction.
    """
    first = first_configuration(arm.description)
    for q in (first, *arm.configurations.values()):
        if not is_singular(arm, np.asarray(q)):
            return np.array(q, dtype=float)
    numbers = arm.description.numbers
    moved = np.where(numbers.prismatic, START_STROKE * arm.description.reach, START_TURN)
    bent: Array = np.clip(moved, numbers.lower, numbers.upper)
    return bent if not is_singular(arm, bent) else first


def is_singular(arm: Arm, q: Array) -> bool:
    """Return whether the tool cannot move in one of its directions at joint values, shape (n,), rad and m."""
    sigma = singular_values(arm.description, q, "whole")
    rank = freedoms(arm.description, "whole")
    return bool(rank >= 1 and sigma[rank - 1] < SINGULAR_RATIO * sigma[0])


class Desk:
    """One arm in one state on all pages.

    Parameters
    ----------
    arm
        The arm.
    view
        The view that shows it; its pages have panels.
    """

    def __init__(self, arm: Arm, view: View) -> None:
        self.arm = arm
        self.view = view
        self.assumed_bodies = False
        """Whether the links' masses are assumed, as uniform rods."""
        self.order = "XYZ"
        """Convention of the tool's Euler angles."""
        self.q = start_configuration(arm)
        """Joint values on show, shape (n,), rad and m."""
        self.running = False
        """Whether a simulation moves the arm."""
        self.steer: Callable[[Array, int | None], None] = lambda q, joint: self.show(q)
        """Called with the joint values, shape (n,), that a person asks for, and the joint, from 0, if only one is
        moved. A simulation replaces it, and takes the values as its setpoint."""
        self.target_q: Array | None = None
        """Joint values, shape (n,), at which the tool is at its target; a simulation may follow them."""
        self.scene: Scene = ()
        """Obstacles in the world."""
        self.on_place: list[Callable[[], None]] = []
        """Called after the obstacles have changed."""
        self.on_show: list[Callable[[Array], None]] = []
        """Called with the joint values, shape (n,), of every state that is shown."""
        self.before_replace: list[Callable[[], None]] = []
        """Called before another arm replaces this one."""
        self.on_replace: list[Callable[[], None]] = []
        """Called after another arm has replaced this one."""
        self._contacts = Contacts()

    def replace(self, arm: Arm, q: Array | None = None) -> None:
        """Show another arm instead of this one; if the pages cannot show it, the old arm stays.

        Parameters
        ----------
        arm
            The new arm.
        q
            Its joint values, shape (n,), rad and m. By default those on show, if the kinds of joints are the same, and
            otherwise :func:`start_configuration`.
        """
        if q is None:
            same_kinds = arm.description.kinds == self.arm.description.kinds
            q = self.q if same_kinds else start_configuration(arm)
        for call in self.before_replace:
            call()
        previous = self.arm, self.q, self.target_q
        self.arm = arm
        self.q = q
        self.target_q = None
        try:
            self.view.replace(arm.description, q)
            self.publish()
        except BaseException:
            self.arm, self.q, self.target_q = previous
            self.view.replace(self.arm.description, self.q)
            self.publish()
            raise
        for call in self.on_replace:
            call()

    def place(self, scene: Scene) -> None:
        """Show obstacles instead of the present ones."""
        self.scene = scene
        self.view.obstacles(scene)
        self.publish_state()
        for call in self.on_place:
            call()

    def show(self, q: Array) -> None:
        """Show joint values, shape (n,), rad and m."""
        self.q = q.copy()
        self.view.show(self.q)
        self.publish_state()
        for call in self.on_show:
            call(self.q)

    def publish(self) -> None:
        """Send the arm and its state to the pages."""
        self.view.panel("arm", arm_state(self.arm.description, assumed_bodies=self.assumed_bodies))
        self._contacts.prepare(self.arm, self.publish_state)
        self.show(self.q)

    def publish_state(self) -> None:
        """Send the numbers of the state on show to the pages."""
        arm, q = self.arm, self.q  # another thread may replace them meanwhile
        numbers = arm.description.numbers
        outside = np.flatnonzero((q < numbers.lower) | (q > numbers.upper)).tolist()
        nearest = self._contacts.nearest(arm, q, self.scene)
        self.view.panel(
            "joints",
            {"q": q.tolist(), "within": not outside, "outside": outside, "nearest": nearest},
        )
        self.view.panel("tool", self.tool_state(arm, q))

    def tool_state(self, arm: Arm, q: Array) -> dict[str, object]:
        """Return the numbers of the tool of an arm at joint values, shape (n,), rad and m, as pages show them."""
        T = arm.fk(q)
        xyz, euler = pose_parts(T, order=self.order)
        # Where this is 0 the second angle is at an end of its range: only the sum or difference of the others counts.
        uniqueness = np.cos(euler[1]) if self.order[0] != self.order[2] else np.sin(euler[1])
        return {
            "T": T.ravel().tolist(),
            "xyz": xyz.tolist(),
            "euler": euler.tolist(),
            "order": self.order,
            "unique": bool(abs(uniqueness) > EULER_TOLERANCE),
            "manipulability": float(arm.manipulability(q)),
            "singular": "singular: the tool cannot move in one of its directions here"
            if is_singular(arm, q)
            else None,
        }

    def close(self) -> None:
        """End the background work."""
        self._contacts.close()
