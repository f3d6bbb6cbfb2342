"""Worked solution: a robot's equations of motion and its inverse kinematics, derived step by step."""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dhkit.description import Description
from dhkit.errors import DescriptionError
from dhkit.grading.reports.html import STYLE
from dhkit.grading.reports.mathml import mathml
from dhkit.page_style import page
from dhkit.symbolic import InverseDerivation, Lagrangian, inverse_derivation, lagrangian
from dhkit.symbolic.equations import latex_text, plain_text
from dhkit.symbolic.exact.compact import shortened
from dhkit.symbolic.ring import Element, Elements, element_array
from dhkit.symbolic.textbook import BodyMotion, TextbookDerivation, derive
from dhkit.symbolic.textbook_kinematics import derive_kinematics


class StepResult(NamedTuple):
    """One entry of a quantity that a step derives."""

    name: str
    """Name as text: M[1,2]."""
    latex_name: str
    """Name in LaTeX."""
    element: Element
    """Value, in the sums of angles that make it shortest."""


@dataclass(frozen=True, eq=False)
class SolutionStep:
    """A step of a derivation.

    Attributes
    ----------
    title
        Result of the step.
    method
        How the result is derived, in a sentence.
    results
        Entries that are not zero.
    """

    title: str
    method: str
    results: tuple[StepResult, ...]


def _worked_solution(description: Description) -> list[SolutionStep]:
    """Return the steps from the table to the joint torques.

    Raises
    ------
    DescriptionError
        A link has no body.
    """
    return list(_Solution(description).steps())


def explanation_text(description: Description) -> str:
    """Return the worked solution as text, with inverse kinematics where there is a closed form.

    Raises
    ------
    DescriptionError
        A link has no body, and there is no closed form.
    """
    inverse = _inverse(description)
    if inverse is not None and not _has_bodies(description):
        return inverse.text()
    lines = [f"{description.name}: the equations of motion, step by step", ""]
    for number, step in enumerate(_worked_solution(description), start=1):
        lines += [f"{number}. {step.title}", f"   {step.method}", ""]
        results = [f"   {result.name} = {plain_text(result.element)}" for result in step.results]
        lines += results or ["   all zero"]
        lines.append("")
    return "\n".join(lines) + (f"\n{inverse.text()}" if inverse is not None else "")


def explanation_html(description: Description) -> str:
    """Return the worked solution as an HTML page without other files, as :func:`explanation_text`."""
    inverse = _inverse(description)
    if inverse is not None and not _has_bodies(description):
        return inverse.html()
    body = [f"<h1>{html.escape(description.name)}: the equations of motion, step by step</h1>"]
    for number, step in enumerate(_worked_solution(description), start=1):
        body += [
            f"<h2>{number}. {html.escape(step.title)}</h2>",
            f"<p>{html.escape(step.method)}</p>",
        ]
        for result in step.results:
            formula = mathml(f"{result.latex_name} = {latex_text(result.element)}")
            text = f"{result.name} = {plain_text(result.element)}"
            body.append(f"<p>{formula or html.escape(text)}</p>")
    if inverse is not None:
        body.append(f"<h1>{html.escape(description.name)}: inverse kinematics, step by step</h1>")
        body.append(inverse._repr_html_())
    return page(f"{description.name}: worked solution", "".join(body), STYLE)


def _inverse(description: Description) -> InverseDerivation | None:
    """Return the derivation of inverse kinematics; None without a closed form."""
    try:
        return inverse_derivation(description)
    except DescriptionError:
        return None


def _has_bodies(description: Description) -> bool:
    return all(joint.bodies for joint in description.joints)


class _Solution:
    def __init__(self, description: Description) -> None:
        self.description = description
        self.textbook: TextbookDerivation = derive(description)
        self.lag: Lagrangian = lagrangian(description)

    def steps(self) -> Iterator[SolutionStep]:
        n = self.description.n
        lag = self.lag
        kind = "R_z(theta) T_z(d) T_x(a) R_x(alpha)"
        if not lag.arm.is_standard:
            kind = "R_x(alpha) T_x(a) R_z(theta) T_z(d), with the alpha and a of the row"
        kinematics = derive_kinematics(self.description)
        yield self._step(
            "Link transforms",
            f"A_i = {kind}, a row of the table each.",
            [(f"A{i + 1}", A) for i, A in enumerate(kinematics.A)],
        )
        for i, link in enumerate(self.textbook.links, start=1):
            for k, body in enumerate(link.bodies, start=1):
                several = len(link.bodies) > 1
                name = f"Link {i}, {body.body.name}" if several else f"Link {i}"
                yield from self._body(name, i, f"{i}{k}" if several else f"{i}", body)
        yield self._step(
            "Energies of the arm",
            self._energies_method(),
            [("K", element_array(self.textbook.K)), ("V", element_array(self.textbook.V))],
        )
        yield self._step(
            "Mass matrix", "M_ij is the second derivative of K by qd_i and qd_j.", [("M", lag.M)]
        )
        yield self._step(
            "Coriolis matrix",
            "Christoffel symbols c_ijk = (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i)/2, and C_ij = sum of c_ijk qd_k.",
            [("C", lag.C)],
        )
        yield self._step("Coriolis and centrifugal torques", "h = C qd.", [("h", lag.h)])
        yield self._step("Gravity torques", "g_i = dV/dq_i.", [("g", lag.g)])
        if n <= 3:
            yield self._step("Joint torques", "tau = M qdd + h + g.", [("tau", lag.tau)])

    def _energies_method(self) -> str:
        coupled = "; couplings of drives: b qd_i qd_j each" if self.lag.arm.couplings else ""
        return f"Sums over the links, and over the drives' rotors: G^2 J qd^2/2 each{coupled}."

    def _body(self, name: str, i: int, number: str, body: BodyMotion) -> Iterator[SolutionStep]:
        """Yield the steps for a body of link i, from 1, whose quantities have this number."""
        yield self._step(
            f"{name}: where its centre of mass is",
            f"In frame 0: p_{number} = o_{i} + R_{i} c_{number}.",
            [(f"p{number}", body.com)],
        )
        yield self._step(
            f"{name}: its velocities",
            "The time derivative of p, and the sum of the revolute joints' axes times their rates, both resolved in "
            "the link's own axes.",
            [(f"v{number}", body.velocity), (f"w{number}", body.omega)],
        )
        yield self._step(
            f"{name}: its energies",
            "K = m v.v/2 + w.I w/2, V = -m g.p, with I about the centre of mass.",
            [(f"K{number}", element_array(body.K)), (f"V{number}", element_array(body.V))],
        )

    def _step(
        self, title: str, method: str, quantities: Sequence[tuple[str, Elements]]
    ) -> SolutionStep:
        results = []
        for name, array in quantities:
            stem = name.rstrip("0123456789")
            letter = {"w": r"\omega", "tau": r"\tau"}.get(stem, stem)
            number = name[len(stem) :]
            for index, element in np.ndenumerate(shortened(self.lag.arm, element_array(array))):
                if element:
                    indices = [str(k + 1) for k in index]
                    subscript = ",".join(filter(None, (number, "".join(indices))))
                    latex = f"{letter}_{{{subscript}}}" if subscript else letter
                    text = f"{name}[{','.join(indices)}]" if index else name
                    results.append(StepResult(text, latex, element))
        return SolutionStep(title, method, tuple(results))
