"""Tables of samples as CSV: comments, one line of column names, one line a sample."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any, TypeAlias

import numpy as np

from dhkit.description import Array, Description
from dhkit.description.quantities import is_plain_number
from dhkit.errors import DescriptionError
from dhkit.trajectories.bounds import BOUNDS

TIMES = ("t", "time", "time_s", "time [s]", "t [s]", "timestamp", "tout")
"""Names of a column of times; the last is Simulink's."""
PREFIXES = (
    ("q", "pos", "position"),
    ("qd", "dq", "vel", "velocity"),
    ("qdd", "ddq", "acc", "acceleration"),
)
"""Prefixes of columns of values, rates and accelerations before a joint's number, or suffixes after its name."""

_NO_HEADER = "no header: the first line has numbers; expected the names of the columns in it, such as t,q1,q2"
Table: TypeAlias = tuple[tuple[str, ...], Array]
"""Column names, and numbers, shape (N, columns)."""


def table_text(columns: tuple[str, ...], rows: Array, comments: tuple[str, ...]) -> str:
    """Return a CSV of rows (N, columns), in any units, with 17 digits; comments begin with '# '."""
    lines = [f"# {comment}" for comment in comments]
    lines.append(",".join(columns))
    for row in rows.tolist():
        cells = [f"{value:.17g}" for value in row]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def read_table(text: str) -> Table:
    """Return a CSV's column names and numbers.

    Raises
    ------
    DescriptionError
        No header, a row of another length, or an entry that is not a finite number; names line and column.
    """
    names: tuple[str, ...] | None = None
    rows: list[list[float]] = []
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if not line or line.startswith("#"):
            continue
        cells = [cell.strip().strip('"') for cell in line.split(",", BOUNDS.columns)]

        # The first line that is not a comment has the names.
        if names is None:
            if len(cells) > BOUNDS.columns:
                raise DescriptionError(f"line {number}: more than {BOUNDS.columns} columns")
            if all(map(_is_number, cells)):
                raise DescriptionError(_NO_HEADER)
            if len(set(cells)) < len(cells):
                raise DescriptionError(
                    f"line {number}: a column's name stands there twice; expected different names"
                )
            names = tuple(cells)
            continue

        if len(cells) != len(names):
            raise DescriptionError(
                f"line {number}: {len(cells)} values; expected {len(names)}, as in the header"
            )
        try:
            rows.append([float(cell) for cell in cells])
        except ValueError:
            k = next(k for k, cell in enumerate(cells) if not _is_number(cell))
            raise DescriptionError(
                f"line {number}: {names[k]} is {cells[k][:40]!r}; expected a number"
            ) from None
        if not np.isfinite(rows[-1]).all():
            k = int(np.flatnonzero(~np.isfinite(rows[-1]))[0])
            raise DescriptionError(
                f"line {number}: {names[k]} is {cells[k][:40]}; expected a finite number"
            )
    if names is None or not rows:
        raise DescriptionError(
            "no samples in it; expected a line of column names and one line a sample"
        )
    return names, np.array(rows)


def check_columns(
    description: Description, columns: Mapping[str, str] | None, matrices: Collection[str] = ()
) -> dict[str, str]:
    """Return a mapping from our names of columns to a file's, with ``q1`` ... instead of the joints' names.

    Parameters
    ----------
    description
        The robot.
    columns
        Our names are ``t``, ``q1``, ``qd1``, ``qdd1`` and so on, a joint's name for its values, and those of matrices.
    matrices
        Names for all joints at once, where a file may have them.

    Raises
    ------
    ValueError
        Another of our names, or one that is there twice.
    TypeError
        Not a mapping of texts to texts.
    """
    given: Any = {} if columns is None else columns
    if not isinstance(given, Mapping) or not all(
        isinstance(name, str) for name in (*given, *given.values())
    ):
        raise TypeError(
            f"columns is {columns!r:.60}; expected a mapping of our names to those of the file"
        )

    # Our names by the names that stand for them: a joint's name for its values, unless it is one of our names.
    joints = [joint.name for joint in description.joints]
    own = {joint: f"q{i}" for i, joint in enumerate(joints, start=1)}
    for prefix, *_ in PREFIXES:
        for i in range(1, len(joints) + 1):
            own[f"{prefix}{i}"] = f"{prefix}{i}"
    own |= {name: name for name in ("t", *matrices)}
    checked: dict[str, str] = {}
    for ours, theirs in given.items():
        if ours not in own or own[ours] in checked:
            expected = ", ".join(
                ("t", *matrices, f"q1 ... q{len(joints)}", "qd1 ...", "qdd1 ...", *joints)
            )
            raise ValueError(f"columns: found {ours!r}; expected each at most once of {expected}")
        checked[own[ours]] = theirs
    return checked


def place_of_name(wanted: str, names: Collection[str], what: str = "column") -> str:
    """Return the file's name that equals the wanted one, or equals it up to case.

    Raises
    ------
    DescriptionError
        There is no such name; lists those found.
    """
    alike = [name for name in names if name.lower() == wanted.lower()]
    if wanted not in alike and len(alike) != 1:
        raise DescriptionError(
            f"no {what} {wanted[:40]!r}: found {', '.join(names)[:80] or 'none'}"
        )
    return wanted if wanted in alike else alike[0]


def select_columns(
    description: Description, table: Table, columns: Mapping[str, str] | None = None
) -> tuple[Array, list[Array]]:
    """Return times (N,) and one to three arrays (N, n): values, rates and accelerations as far as they are there.

    Columns are t or time, then for joint i ``q1``, ``qd1`` or ``dq1``, ``qdd1`` or ``ddq1``; or the joints' names,
    with ``_velocity`` or ``_vel`` and ``_acceleration`` or ``_acc`` appended. Capitals count as small letters; columns
    of other names are left out. ``columns`` gives, for our names, those of the file: see :func:`check_columns`.

    Raises
    ------
    DescriptionError
        A column is missing; names it.
    """
    header, numbers = table

    # Index of each column by its names: case is ignored, but a name that is equal goes first, and given ones before.
    index = {name.lower(): k for k, name in reversed(list(enumerate(header)))}
    index |= {name: k for k, name in enumerate(header)}
    for ours, theirs in (columns or {}).items():
        index[ours] = header.index(place_of_name(theirs, header))

    def first_known(candidates: Iterable[str]) -> int | None:
        return next((index[name] for name in candidates if name in index), None)

    time = first_known(TIMES)
    if time is None and all(is_plain_number(name) for name in header):
        raise DescriptionError(_NO_HEADER)
    if time is None:
        raise DescriptionError(
            f"no column of times: found {', '.join(header)[:80]}; expected t or time"
        )

    chosen: list[Array] = []
    for order, prefixes in enumerate(PREFIXES):
        places = [first_known(candidates) for candidates in joint_columns(description, order)]
        known = [place is not None for place in places]
        if not any(known) and order:
            break
        if not all(known):
            i = known.index(False)
            suffix = f"_{prefixes[-1]}" if order else ""
            wanted = f"{prefixes[0]}{i + 1} or {description.joints[i].name}{suffix}"
            raise DescriptionError(f"no column {wanted}: found {', '.join(header)[:80]}")
        chosen.append(numbers[:, np.array(places, dtype=np.intp)])
    return numbers[:, time], chosen


def _first_known(candidates: Iterable[str], places: Mapping[str, int]) -> int | None:
    """Return the place of the first name that is known; None if none is."""
    return next((places[name] for name in candidates if name in places), None)


def joint_columns(description: Description, order: int) -> list[list[str]]:
    """Return for each joint the names that a column of its values (order 0), rates or accelerations may have."""
    found = []
    for i, joint in enumerate(description.joints, start=1):
        name = joint.name.lower()
        candidates: list[str] = []
        for prefix in PREFIXES[order]:
            candidates += [f"{prefix}{i}", f"{prefix}_{i}"]
        candidates += [f"{name}_{prefix}" for prefix in PREFIXES[order]]
        if order == 0:
            candidates.append(name)
        found.append(candidates)
    return found


def _is_number(text: str) -> bool:
    """Return whether a text is that of a float."""
    try:
        float(text)
    except ValueError:
        return False
    return True
