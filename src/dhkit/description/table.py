"""The Denavit-Hartenberg table of a robot as people read it: in a terminal, in a notebook, in LaTeX."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from dhkit.description.robot_data import Robot, data_of
from dhkit.description.values import Convention, Joint, Units
from dhkit.display import counted, html_table, repr_line
from dhkit.expressions import Expression

COLUMNS = ("theta", "d", "a", "alpha")
LONGEST_ENTRY = 400
"""Characters of an entry in a notebook and on a page of equations."""


def length(value: Expression, units: Units) -> str:
    """Return a length as text in these units: a number, or the expression that it is."""
    bare = (value / units.metres).rational
    return str(value) if bare is None else _short(bare)


def angle(value: Expression) -> str:
    """Return an angle as text: degrees where it is a number, else the expression that it is."""
    if value.half_turns is not None:
        return f"{_short(value.half_turns * 180)}°"
    number = value.rational
    return value.text if number is None else f"{_short(number)} rad"


def _short(number: Fraction) -> str:
    exactly = Expression.number(number).text
    return exactly if len(exactly) <= 12 and "/" not in exactly else f"{float(number):.6g}"


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
    """

    convention: Convention
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    latex_rows: tuple[tuple[str, ...], ...]

    @classmethod
    def of(cls, description: Robot) -> DHTable:
        """Read a robot's table, in the units of its file."""
        description = data_of(description)
        # An expression is in metres, and then so is the whole table.
        symbolic = any(joint.a.symbols or joint.d.symbols for joint in description.joints)
        units = Units() if symbolic else description.units
        shift = "₋₁" if description.convention is Convention.MODIFIED else ""
        headings = ("joint", "θ", f"d [{units.length}]", f"a{shift} [{units.length}]", f"α{shift}")
        rows, latex_rows = [], []
        for i, joint in enumerate(description.joints, start=1):
            entries = {
                "theta": angle(joint.theta),
                "d": length(joint.d, units),
                "a": length(joint.a, units),
                "alpha": angle(joint.alpha),
            }
            rows.append((f"{i} {joint.name}", *(_with_variable(key, entries[key], joint, f"q{i}") for key in COLUMNS)))
            latex_rows.append(
                (str(i), *(_latex(_with_variable(key, entries[key], joint, f"q_{{{i}}}")) for key in COLUMNS))
            )
        return cls(description.convention, headings, tuple(rows), tuple(latex_rows))

    def __str__(self) -> str:
        table = (self.headings, *self.rows)
        widths = [max(len(row[k]) for row in table) for k in range(len(self.headings))]
        lines = [
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in table
        ]
        return "\n".join([f"{self.convention.value} DH", lines[0], "  ".join("-" * w for w in widths), *lines[1:]])

    def __repr__(self) -> str:
        return repr_line("DHTable", counted(len(self.rows), "joint"), f"{self.convention.value} DH")

    def _repr_html_(self) -> str:
        caption = f"{self.convention.value} DH"
        return html_table(self.headings, self.rows, caption, most=len(self.rows), longest=LONGEST_ENTRY)

    def latex(self) -> str:
        """Return the table as a LaTeX ``tabular``."""
        shift = "_{i-1}" if self.convention is Convention.MODIFIED else "_i"
        unit = self.headings[2].partition(" ")[2]
        titles = ["$i$", r"$\theta_i$", f"$d_i$ {unit}", f"$a{shift}$ {unit}", rf"$\alpha{shift}$"]
        lines = [" & ".join(titles) + r" \\ \hline", *(" & ".join(row) + r" \\" for row in self.latex_rows)]
        return "\n".join([r"\begin{tabular}{ccccc}", *lines, r"\end{tabular}"])


def _with_variable(column: str, entry: str, joint: Joint, variable: str) -> str:
    """Add the joint variable to the entry that it belongs to."""
    if column != ("theta" if joint.is_revolute else "d"):
        return entry
    if entry in ("0°", "0"):
        return variable
    return f"{variable} - {entry[1:]}" if entry.startswith("-") else f"{variable} + {entry}"


def _latex(entry: str) -> str:
    text = entry.replace("°", r"^\circ").replace("*", " ").replace(" rad", r"\,\mathrm{rad}")
    return f"${text}$"
