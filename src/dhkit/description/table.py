"""The Denavit-Hartenberg table of a robot for printing: in a terminal, in a notebook, in LaTeX."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from dhkit.description.robot_data import Robot, data_of
from dhkit.description.values import Convention, Joint, Units
from dhkit.display import counted, html_table, repr_line
from dhkit.expressions import Expression

COLUMNS = ("theta", "d", "a", "alpha")
_MAX_CELL_LENGTH = 400
"""Longest entry in a notebook's table, in characters."""


def length(value: Expression, units: Units) -> str:
    """Return a length as text in these units: a number, or the expression of an unknown length."""
    bare = (value / units.metres).rational
    return str(value) if bare is None else _short_number(bare)


def angle(value: Expression) -> str:
    """Return an angle as text: degrees, rad for other numbers, or the expression of an unknown angle."""
    if value.half_turns is not None:
        return f"{_short_number(value.half_turns * 180)}°"
    number = value.rational
    return value.text if number is None else f"{_short_number(number)} rad"


def _short_number(number: Fraction) -> str:
    exact_text = Expression.number(number).text
    return exact_text if len(exact_text) <= 12 and "/" not in exact_text else f"{float(number):.6g}"


@dataclass(frozen=True)
class DHTable:
    """A description's Denavit-Hartenberg table; prints as one, in a terminal and in a notebook.

    Attributes
    ----------
    convention
        Which table: in the modified one the columns a and alpha are those of the link before.
    headings
        Column titles, with units.
    rows
        The entries as text, one row a joint.
    latex_rows
        The entries as LaTeX, one row a joint.
    """

    convention: Convention
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    latex_rows: tuple[tuple[str, ...], ...]

    @classmethod
    def of(cls, description: Robot) -> DHTable:
        """Return a robot's table, in the units of its file."""
        description = data_of(description)
        # Expressions are in metres, so a table with expressions is in metres as a whole.
        symbolic = any(joint.a.symbols or joint.d.symbols for joint in description.joints)
        units = Units() if symbolic else description.units
        shift = "₋₁" if description.convention is Convention.MODIFIED else ""
        headings = ("joint", "θ", f"d [{units.length}]", f"a{shift} [{units.length}]", f"α{shift}")
        rows = []
        latex_rows = []
        for i, joint in enumerate(description.joints, start=1):
            texts = (
                angle(joint.theta),
                length(joint.d, units),
                length(joint.a, units),
                angle(joint.alpha),
            )
            row = [f"{i} {joint.name}"]
            latex_row = [str(i)]
            for column, text in zip(COLUMNS, texts, strict=True):
                row.append(_with_variable(column, text, joint, f"q{i}"))
                latex_row.append(_latex(_with_variable(column, text, joint, f"q_{{{i}}}")))
            rows.append(tuple(row))
            latex_rows.append(tuple(latex_row))
        return cls(description.convention, headings, tuple(rows), tuple(latex_rows))

    def __str__(self) -> str:
        table = (self.headings, *self.rows)
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        lines = []
        for row in table:
            cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=True)]
            lines.append("  ".join(cells).rstrip())
        rule = "  ".join("-" * width for width in widths)
        return "\n".join([f"{self.convention.value} DH", lines[0], rule, *lines[1:]])

    def __repr__(self) -> str:
        return repr_line("DHTable", counted(len(self.rows), "joint"), f"{self.convention.value} DH")

    def _repr_html_(self) -> str:
        caption = f"{self.convention.value} DH"
        return html_table(
            self.headings, self.rows, caption, most=len(self.rows), longest=_MAX_CELL_LENGTH
        )

    def latex(self) -> str:
        """Return the table as a LaTeX ``tabular``."""
        shift = "_{i-1}" if self.convention is Convention.MODIFIED else "_i"
        unit = self.headings[2].partition(" ")[2]
        titles = ["$i$", r"$\theta_i$", f"$d_i$ {unit}", f"$a{shift}$ {unit}", rf"$\alpha{shift}$"]
        lines = [
            " & ".join(titles) + r" \\ \hline",
            *(" & ".join(row) + r" \\" for row in self.latex_rows),
        ]
        return "\n".join([r"\begin{tabular}{ccccc}", *lines, r"\end{tabular}"])


def _with_variable(column: str, entry: str, joint: Joint, variable: str) -> str:
    """Return an entry with the joint variable added in the column that it belongs to."""
    if column != ("theta" if joint.is_revolute else "d"):
        return entry
    if entry in ("0°", "0"):
        return variable
    return f"{variable} - {entry[1:]}" if entry.startswith("-") else f"{variable} + {entry}"


def _latex(entry: str) -> str:
    text = entry.replace("°", r"^\circ").replace("*", " ").replace(" rad", r"\,\mathrm{rad}")
    return f"${text}$"
