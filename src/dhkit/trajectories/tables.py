"""Tables of samples as CSV: comments, one line of column names, one line a sample."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from itertools import chain
from typing import Any

import numpy as np

from dhkit.description import Array, Description
from dhkit.description.quantities import is_plain_number
from dhkit.errors import DescriptionError
from dhkit.trajectories.bounds import BOUNDS

TIMES = ("t", "time", "time_s", "time [s]", "t [s]", "timestamp", "tout")
"""Names of a column of times; the last is Simulink's."""
PREFIXES = (("q", "pos", "position"), ("qd", "dq", "vel", "velocity"), ("qdd", "ddq", "acc", "acceleration"))
"""Prefixes of columns of values, rates and accelerations, before a joint's number; suffixes after a joint's name."""

_NO_HEADER = "no header: the first line has numbers; expected the names of the columns in it, such as t,q1,q2"
Table = tuple[tuple[str, ...], Array]
"""Column names, and numbers, shape (N, columns)."""


def table_text(columns: tuple[str, ...], rows: Array, comments: tuple[str, ...]) -> str:
    """Return a CSV of rows (N, columns), in any units, with 17 digits; comments begin with '# '."""
    lines = [*(f"# {comment}" for comment in comments), ",".join(columns)]
    lines += [",".join(f"{value:.17g}" for value in row) for row in rows.tolist()]
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
        if names is None:
            if len(cells) > BOUNDS.columns:
                raise DescriptionError(f"line {number}: more than {BOUNDS.columns} columns")
            if all(map(_is_number, cells)):
                raise DescriptionError(_NO_HEADER)
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
        No mapping of texts to texts.
    """
    given: Any = {} if columns is None else columns
    is_mapping = isinstance(given, Mapping)
    if not is_mapping or not all(isinstance(name, str) for name in chain(given, given.values())):
        raise TypeError(f"columns is {columns!r:.60}; expected a mapping of our names to those of the file")
    joints = [joint.name for joint in description.joints]
    own = {name: f"q{i}" for i, name in enumerate(joints, start=1)}
    for i in range(1, len(joints) + 1):
        for symbol, *_ in PREFIXES:
            own[f"{symbol}{i}"] = f"{symbol}{i}"
    own |= {name: name for name in ("t", *matrices)}
    checked: dict[str, str] = {}
    for ours, theirs in given.items():
        if ours not in own or own[ours] in checked:
            expected = ", ".join(("t", *matrices, f"q1 ... q{len(joints)}", "qd1 ...", "qdd1 ...", *joints))
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
        raise DescriptionError(f"no {what} {wanted[:40]!r}: found {', '.join(names)[:80] or 'none'}")
    return wanted if wanted in alike else alike[0]


def select_columns(
    description: Description, table: Table, columns: Mapping[str, str] | None = None
) -> tuple[Array, list[Array]]:
    """Return times (N,) and one to three arrays (N, n): values, rates and accelerations as far as they are there.

    Columns are t or time, then for joint i ``q1``, ``qd1`` or ``dq1``, ``qdd1`` or ``ddq1``; or the joints' names,
    with ``_velocity`` or ``_vel`` and ``_acceleration`` or ``_acc`` behind. Capitals count as small letters; columns
    of other names are left out. ``columns`` gives, for our names, those of the file: see :func:`check_columns`.

    Raises
    ------
    DescriptionError
        A column is missing; names it.
    """
    # Case is ignored, but a name that is equal goes first.
    names = {name.lower(): k for k, name in reversed(list(enumerate(table[0])))}
    names |= {name: k for k, name in enumerate(table[0])}
    names |= {ours: table[0].index(place_of_name(theirs, table[0])) for ours, theirs in (columns or {}).items()}
    time = _first_known(TIMES, names)
    if time is None and all(is_plain_number(name) for name in table[0]):
        raise DescriptionError(_NO_HEADER)
    if time is None:
        raise DescriptionError(f"no column of times: found {', '.join(table[0])[:80]}; expected t or time")
    chosen: list[Array] = []
    for order, prefixes in enumerate(PREFIXES):
        places = [_first_known(candidates, names) for candidates in joint_columns(description, order)]
        known = [place is not None for place in places]
        if not any(known) and order:
            break
        if not all(known):
            i = known.index(False)
            wanted = f"{prefixes[0]}{i + 1} or {description.joints[i].name}{'_' + prefixes[-1] if order else ''}"
            raise DescriptionError(f"no column {wanted}: found {', '.join(table[0])[:80]}")
        chosen.append(table[1][:, np.array(places, dtype=np.intp)])
    return table[1][:, time], chosen


def _first_known(candidates: Iterable[str], places: Mapping[str, int]) -> int | None:
    """Return the place of the first name that is known; None if none is."""
    return next((places[name] for name in candidates if name in places), None)


def joint_columns(description: Description, order: int) -> list[list[str]]:
    """Return for each joint the names that a column of its values (order 0), rates or accelerations may have."""
    found = []
    for i, joint in enumerate(description.joints, start=1):
        name = joint.name.lower()
        candidates = []
        for prefix in PREFIXES[order]:
            candidates += [f"{prefix}{i}", f"{prefix}_{i}"]
        candidates += [f"{name}_{prefix}" for prefix in PREFIXES[order]]
        found.append(candidates + ([name] if not order else []))
    return found


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
