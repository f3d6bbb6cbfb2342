"""Tables of samples as CSV: comments, one line of column names, one line a sample."""

from __future__ import annotations

import numpy as np

from dhkit.description import Array, Description
from dhkit.errors import DescriptionError

__all__ = ["Table", "read_table", "select_columns", "table_text"]

MOST_COLUMNS = 1000
TIMES = ("t", "time", "time_s", "time [s]", "t [s]", "timestamp")
PREFIXES = (("q", "pos", "position"), ("qd", "dq", "vel", "velocity"), ("qdd", "ddq", "acc", "acceleration"))
"""What columns of values, rates and accelerations begin with, before a joint's number, or end with, behind its name."""

Table = tuple[tuple[str, ...], Array]
"""Column names, and numbers, shape (N, columns)."""


def table_text(columns: tuple[str, ...], rows: Array, comments: tuple[str, ...]) -> str:
    """Return a CSV with 17 digits; comments begin with '# '."""
    lines = [*(f"# {comment}" for comment in comments), ",".join(columns)]
    lines += [",".join(f"{value:.17g}" for value in row) for row in rows.tolist()]
    return "\n".join(lines) + "\n"


def read_table(text: str) -> Table:
    """Return a CSV's column names and numbers.

    Raises
    ------
    DescriptionError
        No header, a row of another length, or what is no finite number: names line and column.
    """
    names: tuple[str, ...] | None = None
    rows: list[list[float]] = []
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if not line or line.startswith("#"):
            continue
        cells = [cell.strip().strip('"') for cell in line.split(",", MOST_COLUMNS)]
        if names is None:
            if len(cells) > MOST_COLUMNS:
                raise DescriptionError(f"line {number}: more than {MOST_COLUMNS} columns")
            if len(set(cells)) < len(cells):
                raise DescriptionError(f"line {number}: a column's name stands there twice; expected different names")
            names = tuple(cells)
            continue
        if len(cells) != len(names):
            raise DescriptionError(f"line {number}: {len(cells)} values; expected {len(names)}, as in the header")
        try:
            rows.append([float(cell) for cell in cells])
        except ValueError:
            k = next(k for k, cell in enumerate(cells) if not _is_number(cell))
            raise DescriptionError(f"line {number}: {names[k]} is {cells[k][:40]!r}; expected a number") from None
        if not np.isfinite(rows[-1]).all():
            k = int(np.flatnonzero(~np.isfinite(rows[-1]))[0])
            raise DescriptionError(f"line {number}: {names[k]} is {cells[k][:40]}; expected a finite number")
    if names is None or not rows:
        raise DescriptionError("no samples in it; expected a line of column names and one line a sample")
    return names, np.array(rows)


def select_columns(description: Description, table: Table) -> tuple[Array, list[Array]]:
    """Return times (N,) and one to three arrays (N, n): values, rates and accelerations as far as they are there.

    Columns are t or time, then for joint i ``q1``, ``qd1`` or ``dq1``, ``qdd1`` or ``ddq1``; or the joints' names,
    with ``_velocity`` or ``_vel`` and ``_acceleration`` or ``_acc`` behind. Capitals count as small letters; columns
    of other names are left out.

    Raises
    ------
    DescriptionError
        A column is missing; names it.
    """
    names = {name.lower(): k for k, name in enumerate(table[0])}
    time = next((names[name] for name in TIMES if name in names), None)
    if time is None:
        raise DescriptionError(f"no column of times: found {', '.join(table[0])[:80]}; expected t or time")
    chosen: list[Array] = []
    for order, prefixes in enumerate(PREFIXES):
        places = [_place(names, i, joint.name, order, prefixes) for i, joint in enumerate(description.joints, start=1)]
        known = [place is not None for place in places]
        if not any(known) and order:
            break
        if not all(known):
            i = known.index(False)
            wanted = f"{prefixes[0]}{i + 1} or {description.joints[i].name}{'_' + prefixes[-1] if order else ''}"
            raise DescriptionError(f"no column {wanted}: found {', '.join(table[0])[:80]}")
        chosen.append(table[1][:, np.array(places, dtype=np.intp)])
    return table[1][:, time], chosen


def _place(names: dict[str, int], number: int, joint: str, order: int, prefixes: tuple[str, ...]) -> int | None:
    wanted = [f"{prefix}{joiner}{number}" for prefix in prefixes for joiner in ("", "_")]
    wanted += [f"{joint.lower()}_{prefix}" for prefix in prefixes]
    wanted += [joint.lower()] if not order else []
    return next((names[name] for name in wanted if name in names), None)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
