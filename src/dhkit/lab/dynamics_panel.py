"""The panel of dynamics: mass matrix, gravity torques and manipulability of the state on show, entries as formulas."""

from __future__ import annotations

import re
from contextlib import AbstractContextManager

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.grading.reports.mathml import mathml
from dhkit.kinematics import condition_number, velocity_ellipsoid
from dhkit.lab.desk import Desk, has_bodies
from dhkit.lab.jobs import Job, Jobs, JobState
from dhkit.lab.requests import Fields, JsonObject, Panel, answers
from dhkit.symbolic.equations import latex_lines
from dhkit.symbolic.equations.quantities import quantities
from dhkit.viewer.interactive import listed

LINE_WIDTH = 21.0
"""Longest line of a formula, em: the width of the panel."""
MAX_LINES = 60
"""Lines of the longest formula that is shown."""
ENTRY = re.compile(r"(M)([1-9])([1-9])|(g)([1-9])")


class DynamicsPanel(Panel):
    """Requests ``dynamics.…``."""

    def __init__(self, desk: Desk, lock: AbstractContextManager[object]) -> None:
        super().__init__(desk)
        self.jobs: Jobs = Jobs(self._publish_failure, lock)
        self._shows_ellipsoid = False
        desk.on_replace.append(self._forget)
        desk.on_show.append(self._draw_ellipsoid)

    @answers("dynamics.read", "q")
    def read(self, fields: Fields) -> JsonObject:
        """Return the numbers of a state; those that depend on masses are null for an arm without bodies."""
        arm = self.desk.arm
        q = fields.joint_values("q", arm.n)
        self._draw_ellipsoid(q)
        ellipsoid = velocity_ellipsoid(arm.description, q)
        condition = float(condition_number(arm.description, q))
        with_bodies = has_bodies(arm)
        return {
            "M": arm.mass_matrix(q).tolist() if with_bodies else None,
            "g": arm.gravity_torque(q).tolist() if with_bodies else None,
            "effort": listed(arm.description.numbers.effort),
            "lengths": listed(np.sort(ellipsoid.lengths)[::-1]),
            "manipulability": float(arm.manipulability(q)),
            "condition": condition if np.isfinite(condition) else None,
        }

    @answers("dynamics.ellipsoid", "on")
    def show_ellipsoid(self, fields: Fields) -> None:
        """Show or hide the ellipsoid of the tool's velocities."""
        self._shows_ellipsoid = fields.flag("on")
        if self._shows_ellipsoid:
            self._draw_ellipsoid(self.desk.q)
        else:
            self.desk.view.ellipsoid(None)
        self.publish()

    @answers("dynamics.entry", "name")
    def derive_entry(self, fields: Fields) -> None:
        """Derive an entry of the mass matrix or of the gravity torques as a formula, in the background."""
        name = fields.text("name", 3)
        arm = self.desk.arm
        view = self.desk.view
        if not ENTRY.fullmatch(name) or any(int(digit) > arm.n for digit in name[1:]):
            raise ValueError(
                f"dynamics.entry: name is {name!r}; expected M11 to M{arm.n}{arm.n}, or g1 to g{arm.n}"
            )
        if not has_bodies(arm):
            raise ValueError(
                "dynamics.entry: the arm has no masses; expected uniform links to be assumed (Control)"
            )
        view.panel("entry", {"name": name, "deriving": True})
        self.jobs.start(
            name, lambda job: _formula(arm, name, job), lambda formula: view.panel("entry", formula)
        )

    def publish(self) -> None:
        """Tell the pages whether the ellipsoid is drawn."""
        self.desk.view.panel("dynamics", {"ellipsoid": self._shows_ellipsoid})

    def _draw_ellipsoid(self, q: Array) -> None:
        if self._shows_ellipsoid:
            self.desk.view.ellipsoid(velocity_ellipsoid(self.desk.arm.description, q))

    def _publish_failure(self, state: JobState | None) -> None:
        if state is not None and state["error"]:
            self.desk.view.panel(
                "entry", {"name": state["title"], "deriving": False, "error": state["error"]}
            )

    def _forget(self) -> None:
        self.jobs.cancel()
        self.desk.view.panel("entry", None)


def _formula(arm: Arm, name: str, job: Job) -> JsonObject:
    """Return an entry as lines of MathML; one that has too many lines, as an error that says so."""
    job.progress("deriving")
    (quantity,) = quantities(arm.lagrangian, name[0])
    element = quantity.elements[tuple(int(digit) - 1 for digit in name[1:])]
    first, *others = latex_lines(element, LINE_WIDTH) if element else ["0"]
    latex = (f"{name[0]}_{{{name[1:]}}} = {first}", *(rf"\quad {line}" for line in others))
    formulas = [mathml(line) for line in latex]
    terms = len(element)
    fits = len(formulas) <= MAX_LINES and all(formulas)
    return {
        "name": name,
        "deriving": False,
        "lines": formulas if fits else [],
        "terms": terms,
        "error": None
        if fits
        else f"{name} has {terms} terms, too many to show; dhkit equations writes them to a file",
    }
