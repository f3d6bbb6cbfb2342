"""Reports of comparisons between two computations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dhkit.display import html_block, html_lines, html_table, repr_line

_MAX_SHOWN = 20
"""Largest number of quantities that a notebook shows; an arm's own report has fewer."""
_MEASURE = (
    "Each error is the largest difference of an entry at one state. Positions and linear rows of Jacobians are divided "
    "by the lengths of the table (at least 1 m); rotations are not scaled. All other quantities are divided by the "
    "largest entry of the reference, or by a natural size where that is larger (for torques: weight of all links times "
    "reach, plus the largest entry of M times those of the accelerations and of the squared rates)."
)


@dataclass(frozen=True)
class Agreement:
    """The worst disagreement seen in one quantity.

    Attributes
    ----------
    quantity
        The quantity that was compared.
    error
        Error at the sample where error / tolerance is largest; NaN if a value there is NaN, inf if one is infinite.
    tolerance
        Largest error that counts as agreement at that state.
    q, qd, qdd
        The state with this error, rad, m and seconds.
    """

    quantity: str
    error: float
    tolerance: float
    q: tuple[float, ...]
    qd: tuple[float, ...] = ()
    qdd: tuple[float, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the two agree."""
        return self.error <= self.tolerance

    @property
    def state(self) -> str:
        """The state as text, such as ``q = [0.1, 0.2]``, with six significant digits; empty vectors are left out."""
        parts = []
        for name, vector in (("q", self.q), ("qd", self.qd), ("qdd", self.qdd)):
            if vector:
                rounded = [float(f"{x:.6g}") for x in vector]
                parts.append(f"{name} = {rounded}")
        return ", ".join(parts)

    def __repr__(self) -> str:
        verdict = "agrees" if self.ok else "DISAGREES"
        most = f"{self.tolerance:.0e}"
        return repr_line(
            "Agreement", self.quantity, f"{verdict}, error {self.error:.1e} of at most {most}"
        )


@dataclass(frozen=True)
class VerificationReport:
    """Errors of dhkit's kinematics and dynamics relative to a reference, Pinocchio or a URDF, at random states.

    Attributes
    ----------
    robot
        Its name.
    reference
        Name and version of the reference.
    samples, seed
        Number and seed of random states.
    agreements
        Worst error of each quantity.
    notes
        Sentences about quantities that were not compared, with the reason, and about differences.
    """

    robot: str
    reference: str
    samples: int
    seed: int
    agreements: tuple[Agreement, ...]
    notes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether every quantity agrees."""
        return all(agreement.ok for agreement in self.agreements)

    def __bool__(self) -> bool:
        return self.ok

    def __str__(self) -> str:
        width = max(len(agreement.quantity) for agreement in self.agreements)
        lines = [self._title]
        for agreement in self.agreements:
            verdict = "agrees" if agreement.ok else f"DISAGREES at {agreement.state}"
            figures = f"{agreement.error:8.1e}  of at most {agreement.tolerance:.0e}"
            lines.append(f"  {agreement.quantity:{width}}  {figures}  {verdict}")
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])

    def __repr__(self) -> str:
        wrong = [agreement.quantity for agreement in self.agreements if not agreement.ok]
        summary = (
            f"DISAGREES in {', '.join(wrong)}"
            if wrong
            else f"{len(self.agreements)} quantities agree"
        )
        return repr_line("VerificationReport", self.robot, f"{summary}, {self.samples} states")

    def _repr_html_(self) -> str:
        # Disagreements first, because the table is bounded.
        worst = sorted(self.agreements, key=lambda agreement: agreement.ok)
        rows = [
            (
                one.quantity,
                f"{one.error:.1e}",
                f"{one.tolerance:.0e}",
                "agrees" if one.ok else f"DISAGREES at {one.state}",
            )
            for one in worst
        ]
        table = html_table(
            ("quantity", "worst error", "at most", ""), rows, align="lrrl", most=_MAX_SHOWN
        )
        return html_block(self._title, table, html_lines(self.notes))

    @property
    def _title(self) -> str:
        return f"{self.robot} against {self.reference}, {self.samples} states, seed {self.seed}"

    def json(self) -> dict[str, object]:
        """Return everything as plain data for JSON."""
        # Keys name the units of revolute joints; those of prismatic joints are m, m/s, m/s^2.
        keys = {"q": "q_rad", "qd": "qd_rad_s", "qdd": "qdd_rad_s2"}
        agreements = []
        for agreement in self.agreements:
            data = {keys.get(key, key): value for key, value in vars(agreement).items()}
            data["ok"] = agreement.ok
            agreements.append(data)
        return vars(self) | {"agreements": agreements, "ok": self.ok}

    def markdown(self) -> str:
        """Return the report as Markdown."""
        lines = [f"# {_plain(self._title)}", ""]
        for row in [
            ("quantity", "worst error", "at most", "", "worst state"),
            ("---",) * 5,
            *self._rows,
        ]:
            cells = [_plain(cell) for cell in row]
            lines.append(f"| {' | '.join(cells)} |")
        lines.append("")
        if self.notes:
            lines += [f"- {_plain(note)}" for note in self.notes]
            lines.append("")
        lines += [_MEASURE, ""]
        return "\n".join(lines)

    def latex(self) -> str:
        """Return a table for a paper's appendix: booktabs, with a caption that names the measurements."""
        rows = []
        for agreement in self.agreements:
            figures = f"${_power(agreement.error)}$ & ${_power(agreement.tolerance)}$"
            verdict = "yes" if agreement.ok else "no"
            state = f"\\scriptsize {_escaped(agreement.state)}"
            rows.append(f"{_escaped(agreement.quantity)} & {figures} & {verdict} & {state} \\\\")
        caption = f"{_escaped(self._title)}. {_escaped(' '.join([*self.notes, _MEASURE]))}"
        return "\n".join(
            [
                "% needs \\usepackage{booktabs}",
                "\\begin{table}",
                "  \\centering",
                f"  \\caption{{{caption}}}",
                "  \\begin{tabular}{lcccp{0.42\\linewidth}}",
                "    \\toprule",
                "    quantity & worst error & at most & agrees & worst state \\\\",
                "    \\midrule",
                *(f"    {row}" for row in rows),
                "    \\bottomrule",
                "  \\end{tabular}",
                "\\end{table}",
                "",
            ]
        )

    @property
    def _rows(self) -> Sequence[tuple[str, ...]]:
        """The rows of a table: quantity, worst error, tolerance, verdict and worst state."""
        return [
            (
                agreement.quantity,
                f"{agreement.error:.1e}",
                f"{agreement.tolerance:.0e}",
                "agrees" if agreement.ok else "DISAGREES",
                agreement.state,
            )
            for agreement in self.agreements
        ]


def printable(text: str) -> str:
    """Return text from a file with characters replaced that break lines or control terminals."""
    return "".join(character if character.isprintable() else "?" for character in text)


_SPECIAL = {character: f"\\{character}" for character in "&%$#_{}"} | {
    "\\": "\\textbackslash{}",
    "~": "\\textasciitilde{}",
    "^": "\\textasciicircum{}",
}
"""LaTeX of characters that have a meaning there."""


def _plain(text: str) -> str:
    """Return text escaped for a Markdown table."""
    return text.replace("|", "\\|").replace("<", "&lt;")


def _escaped(text: str) -> str:
    """Return text escaped for LaTeX."""
    return "".join(_SPECIAL.get(character, character) for character in text)


def _power(number: float) -> str:
    r"""Return a number that is not negative in LaTeX: 1.2e-13 is 1.2 \times 10^{-13}."""
    if math.isnan(number):
        return "\\mathrm{NaN}"
    if math.isinf(number):
        return "\\infty"
    if number == 0:
        return "0"
    mantissa, exponent = f"{number:.1e}".split("e")
    return f"{mantissa} \\times 10^{{{int(exponent)}}}"
