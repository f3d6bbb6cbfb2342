"""The panel of dynamics: mass matrix, gravity torques and manipulability of the state on show, entries as formulas."""

from __future__ import annotations

import re
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.grading.reports.mathml import mathml
from dhkit.kinematics import condition_number, velocity_ellipsoid
from dhkit.lab.desk import Desk
from dhkit.lab.fields import LARGEST_JOINT_VALUE, Fields
from dhkit.lab.jobs import Job, Jobs
from dhkit.symbolic.equations import latex_lines
from dhkit.symbolic.equations.quantities import quantities
from dhkit.viewer.interactive import listed

ROOM = 21.0
"""em of a line of a formula: what the panel is wide."""
MOST_LINES = 60
ENTRY = re.compile(r"(M)([1-9])([1-9])|(g)([1-9])")


class DynamicsPanel:
    """Requests ``dynamics.…``."""

    def __init__(self, desk: Desk, lock: AbstractContextManager[Any]) -> None:
        self.desk = desk
        self._jobs = Jobs(self._failed, lock)
        self._ellipsoid = False
        desk.changed.append(self._replaced)
        desk.shown.append(self._draw)

    def read(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return the numbers of a state; those of masses are null for an arm without bodies."""
        arm = self.desk.arm
        q = Fields("dynamics.read", data, ["q"]).vector("q", arm.n, LARGEST_JOINT_VALUE)
        self._draw(q)
        ellipsoid = velocity_ellipsoid(arm.description, q)
        condition = float(condition_number(arm.description, q))
        bodies = all(joint.bodies for joint in arm.description.joints)
        return {
            "M": arm.mass_matrix(q).tolist() if bodies else None,
            "g": arm.gravity_torque(q).tolist() if bodies else None,
            "effort": listed(arm.description.numbers.effort),
            "lengths": listed(np.sort(ellipsoid.lengths)[::-1]),
            "manipulability": float(arm.manipulability(q)),
            "condition": condition if np.isfinite(condition) else None,
        }

    def ellipsoid(self, data: dict[str, Any]) -> dict[str, Any]:
        """Draw the ellipsoid of the tool's velocities, or no longer."""
        self._ellipsoid = Fields("dynamics.ellipsoid", data, ["on"]).flag("on")
        if self._ellipsoid:
            self._draw(self.desk.q)
        else:
            self.desk.view.ellipsoid(None)
        self.publish()
        return {}

    def entry(self, data: dict[str, Any]) -> dict[str, Any]:
        """Derive an entry of the mass matrix or of the gravity torques as a formula, in the background."""
        name = Fields("dynamics.entry", data, ["name"]).text("name", 3)
        found, arm = ENTRY.fullmatch(name), self.desk.arm
        if found is None or any(int(digit) > arm.n for digit in name[1:]):
            raise ValueError(f"dynamics.entry: name is {name!r}; expected M11 to M{arm.n}{arm.n}, or g1 to g{arm.n}")
        if not all(joint.bodies for joint in arm.description.joints):
            raise ValueError("dynamics.entry: the arm has no masses; expected uniform links to be assumed (Control)")
        self.desk.view.panel("entry", {"name": name, "deriving": True})
        self._jobs.start(name, lambda job: _formula(arm, name, job), lambda found: self.desk.view.panel("entry", found))
        return {}

    def publish(self) -> None:
        """Tell the pages what is drawn."""
        self.desk.view.panel("dynamics", {"ellipsoid": self._ellipsoid})

    def close(self) -> None:
        """End what runs."""
        self._jobs.close()

    def _draw(self, q: Array) -> None:
        if self._ellipsoid:
            self.desk.view.ellipsoid(velocity_ellipsoid(self.desk.arm.description, q))

    def _failed(self, state: dict[str, Any] | None) -> None:
        if state is not None and state.get("error"):
            self.desk.view.panel("entry", {"name": state["title"], "deriving": False, "error": state["error"]})

    def _replaced(self) -> None:
        self._jobs.cancel()
        self.desk.view.panel("entry", None)


def _formula(arm: Arm, name: str, job: Job) -> dict[str, Any]:
    """Return an entry as MathML, or what is said in its place."""
    job.progress("deriving")
    (quantity,) = quantities(arm.lagrangian, name[0])
    place = tuple(int(digit) - 1 for digit in name[1:])
    element = quantity.elements[place]
    head = f"{name[0]}_{{{name[1:]}}}"
    first, *others = latex_lines(element, ROOM) if element else ["0"]
    formulas = [mathml(line) for line in (f"{head} = {first}", *(rf"\quad {line}" for line in others))]
    terms, shown = len(element), len(formulas) <= MOST_LINES and all(formulas)
    return {
        "name": name,
        "deriving": False,
        "lines": formulas if shown else [],
        "terms": terms,
        "error": None if shown else f"{name} has {terms} terms: dhkit equations writes them to a file",
    }
