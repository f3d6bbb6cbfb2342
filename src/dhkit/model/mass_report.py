"""Mass properties that a CAD program reports, as a CSV table or as SolidWorks' text, in assembly coordinates."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from dhkit.description.files import read_bounded
from dhkit.display import repr_line
from dhkit.errors import ModelError
from dhkit.model.bounds import BOUNDS
from dhkit.model.cad_units import UNITS
from dhkit.model.shape_inertia import MassProperties
from dhkit.model.solidworks_report import REPORT, read_solidworks_report

COLUMNS = ("link", "mass", "com_x", "com_y", "com_z", "Ixx", "Iyy", "Izz", "Ixy", "Iyz", "Ixz")
_HEADING = re.compile(r"\s*(\w+)\s*(?:\[([^\]]*)\])?\s*")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_PRODUCT_SIGN = re.compile(r"#\s*products\s*=\s*([-+])\s*integral\s*", re.IGNORECASE)
_MASSES = {"kg": 1.0, "g": 1e-3, "lb": 0.45359237}
"""Mass units by name, kg."""
_MOMENTS = {
    f"{mass_unit} {length_unit}^2": mass * length**2
    for (mass_unit, mass), (length_unit, length) in product(_MASSES.items(), UNITS.items())
}
"""Units of moments of inertia by name, kg m^2."""
_EXAMPLE = "link,mass [kg],com_x [mm],com_y [mm],com_z [mm],Ixx [kg mm^2],Iyy [kg mm^2],..."


@dataclass(frozen=True, eq=False)
class ReportedMass:
    """A report's mass properties of one part."""

    part: str
    """The link's number or the part's name, as the report has it."""
    properties: MassProperties
    """Mass properties in the report's own coordinates, SI."""
    notes: tuple[str, ...]
    """The block and the sign of products that were read."""
    source: str
    """File and line."""

    def __repr__(self) -> str:
        return repr_line("ReportedMass", self.part, f"{self.properties.mass:.4g} kg, {self.source}")


def read_mass_report(path: str | Path) -> tuple[ReportedMass, ...]:
    r"""Read a report of mass properties: ``.csv`` as a table, anything else as the text of SolidWorks.

    The table has a heading ``link, mass [kg], com_x [mm], com_y, com_z, Ixx [kg mm^2], Iyy, Izz, Ixy, Iyz, Ixz`` with
    the unit of every quantity in brackets, moments about the centre of mass in the axes of the assembly, and, where a
    product is not 0, a line ``# products = -integral`` (the tensor's entries, xy = -integral of x y dm) or
    ``# products = +integral`` above it. Of SolidWorks' text the block "Taken at the center of mass and aligned with
    the output coordinate system" is read.

    Parameters
    ----------
    path
        Report of a CAD program as text, or a CSV file.

    Returns
    -------
    tuple[ReportedMass, ...]
        Mass, kg, centre of mass, m, and inertia, kg m^2, of each link that is named.

    Raises
    ------
    ModelError
        It cannot be read: one line with file, line, the value found and the value expected.

    Examples
    --------
    >>> from pathlib import Path
    >>> moments = [f"I{axes} [kg mm^2]" for axes in ("xx", "yy", "zz", "xy", "yz", "xz")]
    >>> heading = ", ".join(["link", "mass [kg]", "com_x [mm]", "com_y [mm]", "com_z [mm]", *moments])
    >>> size = Path("masses.csv").write_text(heading + "\n1, 2.0, 100, 0, 0, 500, 6000, 6000, 0, 0, 0\n")
    >>> [report.properties.mass for report in read_mass_report("masses.csv")]
    [2.0]
    """
    path = Path(path)
    content = read_bounded(path, BOUNDS.report_bytes, "a report of mass properties", ModelError)
    try:
        text = content.decode(
            "utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
        )
    except UnicodeDecodeError:
        raise ModelError(f"{path}: not UTF-8 text; expected a report of mass properties") from None
    if path.suffix.lower() == ".csv":
        return _table_parts(path, text)
    starts = [match.start() for match in REPORT.finditer(text)] or [0]
    if len(starts) > BOUNDS.report_rows:
        raise ModelError(f"{path}: {len(starts)} reports; expected at most {BOUNDS.report_rows}")
    reports = []
    for start, end in zip(starts, [*starts[1:], len(text)], strict=True):
        first_line = text.count("\n", 0, start) + 1
        part, properties, notes = read_solidworks_report(text[start:end], str(path), first_line)
        reports.append(
            ReportedMass(part or path.stem, properties, notes, f"{path}, line {first_line}")
        )
    return tuple(reports)


def _table_parts(path: Path, text: str) -> tuple[ReportedMass, ...]:
    """Return the rows of a CSV table."""
    sign: str | None = None
    lines: list[tuple[str, str]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if match := _PRODUCT_SIGN.fullmatch(line.strip()):
            sign = match[1]
        elif line.strip() and not line.lstrip().startswith("#"):
            lines.append((f"{path}, line {number}", line))
    if len(lines) < 2 or len(lines) > BOUNDS.report_rows:
        raise ModelError(
            f"{path}: {len(lines)} lines; expected a heading and 1 to {BOUNDS.report_rows - 1} rows"
        )
    separator = ";" if ";" in lines[0][1] else ","
    factors: Mapping[str, float] = {}
    parts = []
    for where, line in lines:
        try:
            cells = [
                cell.strip() for cell in next(csv.reader([line], delimiter=separator, strict=True))
            ]
        except (csv.Error, StopIteration) as error:
            raise ModelError(f"{where}: no row of a table ({error})") from None
        if factors:
            parts.append(_table_part(where, cells, factors, sign))
        else:
            factors = _column_factors(where, cells)
    return tuple(parts)


def _column_factors(where: str, cells: Sequence[str]) -> dict[str, float]:
    """Return the columns of a heading in their order, with the factors that convert their numbers to SI."""
    names = {key.lower(): key for key in COLUMNS}
    units: dict[str, str] = {}
    for cell in cells:
        heading = _HEADING.fullmatch(cell)
        name = names.get(heading[1].lower()) if heading else None
        if heading is None or name is None or name in units:
            raise ModelError(f"{where}: column {cell[:40]!r}; expected {_EXAMPLE}")
        units[name] = " ".join((heading[2] or "").replace("*", " ").replace("²", "^2").split())
    if missing := [name for name in COLUMNS if name not in units]:
        raise ModelError(f"{where}: no column {', '.join(missing)}; expected {_EXAMPLE}")
    for name in COLUMNS[1:]:
        known = _known_units(name)
        if units[name] not in known:
            raise ModelError(
                f"{where}: {name} has the unit {units[name][:30]!r}; expected one of {', '.join(known)} in brackets"
            )
    return {
        name: 1.0 if name == "link" else _known_units(name)[unit] for name, unit in units.items()
    }


def _known_units(column: str) -> Mapping[str, float]:
    if column == "mass":
        return _MASSES
    return UNITS if column.startswith("com") else _MOMENTS


def _table_part(
    where: str, cells: Sequence[str], factors: Mapping[str, float], sign: str | None
) -> ReportedMass:
    if len(cells) != len(factors):
        hint = "; decimal commas? write 1.5, not 1,5" if len(cells) > len(factors) else ""
        raise ModelError(f"{where}: {len(cells)} entries; expected {len(factors)}{hint}")
    row = dict(zip(factors, cells, strict=True))
    numbers = [factors[name] * _plain_number(row[name], f"{where}: {name}") for name in COLUMNS[1:]]
    mass = numbers[0]
    com = numbers[1:4]
    xx, yy, zz = numbers[4:7]
    products = numbers[7:]
    if any(products) and sign is None:
        raise ModelError(
            f"{where}: products of inertia without their sign; expected a line '# products = -integral' "
            "(entries of the tensor) or '# products = +integral' above the heading"
        )
    xy, yz, xz = (-product if sign == "+" else product for product in products)
    if not mass > 0:
        raise ModelError(f"{where}: mass is {row['mass']}; expected a positive number")
    note = f"products as {sign}integral" if sign else "no products"
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return ReportedMass(row["link"], MassProperties(mass, np.array(com), tensor), (note,), where)


def _plain_number(text: str, where: str) -> float:
    """Return a decimal number with a point; no expression is evaluated.

    Raises
    ------
    ModelError
        Something else; if it has a comma, with a hint.
    """
    if not _NUMBER.fullmatch(text) or not math.isfinite(float(text)):
        hint = "; decimal commas are not read, write 1.5 for 1,5" if "," in text else ""
        raise ModelError(f"{where}: found {text[:40]!r}; expected a number{hint}")
    return float(text)
