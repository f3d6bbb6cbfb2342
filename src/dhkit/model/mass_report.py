"""Mass properties that a CAD program reports, as a CSV table or as SolidWorks' text, in assembly coordinates."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dhkit.description.files import read_bounded
from dhkit.display import repr_line
from dhkit.errors import DescriptionError, ModelError
from dhkit.model.shape_inertia import MassProperties
from dhkit.model.solidworks_report import REPORT, SolidWorksReport

MAX_BYTES = 1_000_000
MAX_ROWS = 200
COLUMNS = ("link", "mass", "com_x", "com_y", "com_z", "Ixx", "Iyy", "Izz", "Ixy", "Iyz", "Ixz")
HEADING = re.compile(r"\s*(\w+)\s*(?:\[([^\]]*)\])?\s*")
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
SIGN = re.compile(r"#\s*products\s*=\s*([-+])\s*integral\s*", re.IGNORECASE)
MASSES = {"kg": 1.0, "g": 1e-3, "lb": 0.45359237}
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254}
MOMENTS = {f"{mass} {length}^2": (mass, length) for mass in MASSES for length in LENGTHS}
EXAMPLE = "link,mass [kg],com_x [mm],com_y [mm],com_z [mm],Ixx [kg mm^2],Iyy [kg mm^2],..."


@dataclass(frozen=True, eq=False)
class ReportedMass:
    """What a report says of one part."""

    part: str
    """The link's number or the part's name, as the report has it."""
    properties: MassProperties
    """In the report's own coordinates, SI."""
    notes: tuple[str, ...]
    """The block and the sign of products that were read."""
    source: str
    """File and line."""

    def __repr__(self) -> str:
        return repr_line("ReportedMass", self.part, f"{self.properties.mass:.4g} kg, {self.source}")


def read_mass_report(path: str | Path) -> tuple[ReportedMass, ...]:
    """Read a report of mass properties: ``.csv`` as a table, anything else as the text of SolidWorks.

    The table has a heading ``link, mass [kg], com_x [mm], com_y, com_z, Ixx [kg mm^2], Iyy, Izz, Ixy, Iyz, Ixz`` with
    the unit of every quantity in brackets, moments about the centre of mass in the axes of the assembly, and, where a
    product is not 0, a line ``# products = -integral`` (the tensor's entries, xy = -integral of x y dm) or
    ``# products = +integral`` above it. Of SolidWorks' text the block "Taken at the center of mass and aligned with
    the output coordinate system" is read.

    Raises
    ------
    ModelError
        It cannot be read: one line with file, line, what was found and what was expected.
    """
    path = Path(path)
    try:
        content = read_bounded(path, MAX_BYTES, "a report of mass properties")
        text = content.decode("utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except DescriptionError as error:
        raise ModelError(str(error)) from None
    except UnicodeDecodeError:
        raise ModelError(f"{path}: not UTF-8 text; expected a report of mass properties") from None
    if path.suffix.lower() == ".csv":
        return _Table(path, text).parts()
    starts = [match.start() for match in REPORT.finditer(text)] or [0]
    if len(starts) > MAX_ROWS:
        raise ModelError(f"{path}: {len(starts)} reports; expected at most {MAX_ROWS}")
    reports = []
    for start, end in zip(starts, [*starts[1:], len(text)], strict=True):
        first = text.count("\n", 0, start) + 1
        report = SolidWorksReport.of(text[start:end], str(path), first)
        reports.append(ReportedMass(report.part or path.stem, report.properties, report.notes, f"{path}, line {first}"))
    return tuple(reports)


class _Table:
    """A CSV file, its lines known by number."""

    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        self.sign: str | None = None
        lines: list[tuple[int, str]] = []
        for number, line in enumerate(text.splitlines(), start=1):
            if found := SIGN.fullmatch(line.strip()):
                self.sign = found[1]
            elif line.strip() and not line.lstrip().startswith("#"):
                lines.append((number, line))
        if len(lines) < 2 or len(lines) > MAX_ROWS:
            raise ModelError(f"{path}: {len(lines)} lines; expected a heading and 1 to {MAX_ROWS - 1} rows")
        self.separator = ";" if ";" in lines[0][1] else ","
        self.heading, self.rows = lines[0], lines[1:]

    def parts(self) -> tuple[ReportedMass, ...]:
        number, line = self.heading
        units: dict[str, str] = {}
        order: list[str] = []
        for cell in self._cells(number, line):
            found = HEADING.fullmatch(cell)
            name = {key.lower(): key for key in COLUMNS}.get(found[1].lower()) if found else None
            if name is None or found is None or name in order:
                raise ModelError(f"{self.path}, line {number}: column {cell[:40]!r}; expected {EXAMPLE}")
            order.append(name)
            units[name] = " ".join((found[2] or "").replace("*", " ").replace("²", "^2").split())
        if missing := [name for name in COLUMNS if name not in order]:
            raise ModelError(f"{self.path}, line {number}: no column {', '.join(missing)}; expected {EXAMPLE}")
        factors = {name: self._factor(number, name, units[name]) for name in COLUMNS[1:]}
        return tuple(self._part(row, text, order, factors) for row, text in self.rows)

    def _factor(self, line: int, name: str, unit: str) -> float:
        """Return what takes a column's numbers to SI."""
        if name == "mass":
            known = MASSES
        elif name.startswith("com"):
            known = LENGTHS
        else:
            known = {text: MASSES[mass] * LENGTHS[length] ** 2 for text, (mass, length) in MOMENTS.items()}
        if unit not in known:
            raise ModelError(
                f"{self.path}, line {line}: {name} has the unit {unit[:30]!r}; expected one of "
                f"{', '.join(known)} in brackets"
            )
        return known[unit]

    def _cells(self, number: int, line: str) -> list[str]:
        try:
            return [cell.strip() for cell in next(csv.reader([line], delimiter=self.separator, strict=True))]
        except (csv.Error, StopIteration) as error:
            raise ModelError(f"{self.path}, line {number}: no row of a table ({error})") from None

    def _part(self, number: int, line: str, order: Sequence[str], factors: dict[str, float]) -> ReportedMass:
        cells = self._cells(number, line)
        where = f"{self.path}, line {number}"
        if len(cells) != len(order):
            hint = "; decimal commas? write 1.5, not 1,5" if len(cells) > len(order) else ""
            raise ModelError(f"{where}: {len(cells)} entries; expected {len(order)}{hint}")
        row = dict(zip(order, cells, strict=True))
        values = {name: factors[name] * plain_number(row[name], f"{where}: {name}") for name in COLUMNS[1:]}
        products = [values[name] for name in ("Ixy", "Iyz", "Ixz")]
        if any(products) and self.sign is None:
            raise ModelError(
                f"{where}: products of inertia without their sign; expected a line '# products = -integral' "
                "(entries of the tensor) or '# products = +integral' above the heading"
            )
        sign = -1.0 if self.sign == "+" else 1.0
        xy, yz, xz = (sign * product for product in products)
        xx, yy, zz = (values[name] for name in ("Ixx", "Iyy", "Izz"))
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        com = np.array([values[name] for name in ("com_x", "com_y", "com_z")])
        if not values["mass"] > 0:
            raise ModelError(f"{where}: mass is {row['mass']}; expected a positive number")
        said = f"products as {self.sign}integral" if self.sign else "no products"
        return ReportedMass(row["link"], MassProperties(values["mass"], com, tensor), (said,), where)


def plain_number(text: str, where: str) -> float:
    """Return a decimal with a point, nothing evaluated.

    Raises
    ------
    ModelError
        Something else; where it has a comma, with a hint.
    """
    if not NUMBER.fullmatch(text) or not math.isfinite(float(text)):
        hint = "; decimal commas are not read, write 1.5 for 1,5" if "," in text else ""
        raise ModelError(f"{where}: found {text[:40]!r}; expected a number{hint}")
    return float(text)
