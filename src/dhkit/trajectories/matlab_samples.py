"""Samples of a motion from a .mat file: plain arrays, and the structures that Simulink's blocks write.

Simulink's "To Workspace" and its outputs are saved as an array beside ``tout``, as a structure (``signals``, an array
of structures with ``values`` and ``label``), or as a structure with ``time``. Its datasets and timeseries are objects
of MATLAB's own classes, whose form in a file is not documented: they are named, with lines that make arrays of them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from dhkit.description import Array, Description
from dhkit.description.mat_files import MatVariable, read_mat
from dhkit.errors import DescriptionError
from dhkit.trajectories.tables import PREFIXES, TIMES, Table, joint_columns, place_of_name

_ARRAY_EXPORT = (
    "save arrays by save('log.mat', 't', 'q', '-v7'), a timeseries ts as [ts.Time, ts.Data]"
)
"""Advice for variables that are not read."""
_OUTPUTS = ("yout", "simout")
"""Simulink's names of outputs; they are joint values where nothing else is."""
_COLUMNS = re.compile(r"(.+)\(:,\s*(\d{1,6})(?::(\d{1,6}))?\)")
"""Columns of a matrix as MATLAB writes them: ``yout(:,1:6)``."""
MATRICES = tuple(prefixes[0] for prefixes in PREFIXES)
"""Our names of matrices with a column for each joint: values, rates, accelerations."""


@dataclass(frozen=True, eq=False)
class Signal:
    """An array of numbers out of a structure of Simulink, or columns of a matrix."""

    name: str
    value: Array
    """Shape (N, k)."""
    times: Array | None = None
    """Times of the rows, shape (N,), s; None if the structure has none."""

    readable = True
    kind = "double"


Variable: TypeAlias = MatVariable | Signal


def matlab_choices(description: Description, content: bytes, most: int) -> dict[str, list[str]]:
    """Return the names that a file's times and joint values may have, for ``columns`` of :func:`matlab_table`.

    Parameters
    ----------
    description, content, most
        As for :func:`matlab_table`.

    Returns
    -------
    dict
        For ``t`` all vectors and first columns, for ``q`` all matrices of n columns and all runs of n columns in larger
        ones, from the first column or, beside a column of times, from the second.

    Raises
    ------
    DescriptionError
        Not a .mat file that is read, or a damaged one.
    """
    n = description.n
    times: list[str] = []
    values: list[str] = []
    for name, variable in _with_signals(read_mat(content, most, advice=_ARRAY_EXPORT)).items():
        array = variable.value if variable.readable else None
        if not isinstance(array, np.ndarray) or array.ndim != 2 or array.size < 2:
            continue
        if isinstance(variable, Signal) and variable.times is not None:
            times.append(name)
        if array.size == max(array.shape):
            times.append(name)
            values += [name] if n == 1 else []
            continue
        width = array.shape[1]
        times.append(f"{name}(:,1)")
        if width == n:
            values.append(name)
            continue
        first = 2 if width % n == 1 else 1
        for begin in range(first, width - n + 2, n):
            values.append(f"{name}(:,{begin}:{begin + n - 1})" if n > 1 else f"{name}(:,{begin})")
    return {"t": list(dict.fromkeys(times)), "q": values}


def matlab_table(
    description: Description, content: bytes, most: int, columns: Mapping[str, str]
) -> Table:
    """Return the samples of a .mat file as a table whose columns have our names.

    Parameters
    ----------
    description
        The robot.
    content
        The file. Times are a vector, ``t`` or ``time``; joint values are a matrix ``q``, shape (N, n), or vectors
        ``q1`` ... or of the joints' names, and rates and accelerations likewise. A matrix of n+1 columns has the times
        in its first. A structure of Simulink counts as matrices of its labels' names, or of its own. Variables of other
        names are left out; ``yout`` and ``simout`` are joint values where nothing else is.
    most
        Largest size of the unpacked variables, bytes.
    columns
        The file's names by our names; ``yout(:,1:6)`` are columns of a matrix.

    Raises
    ------
    DescriptionError
        No such file, a variable that is not an array of real numbers, or arrays that do not fit together; names it.
    """
    variables = _with_signals(read_mat(content, most, advice=_ARRAY_EXPORT))
    names = _chosen(description, variables, columns)
    n = description.n
    found: dict[str, Array] = {}
    for ours, variable in names.items():
        array = _numbers(variable)
        times = variable.times if isinstance(variable, Signal) else None
        if ours == "t" and times is not None:
            array = times
        elif times is not None:
            _add_times(found, variable.name, times)
        if ours not in MATRICES:
            found[ours] = _vector(variable.name, array)
            continue
        if n == 1 and array.size == max(array.shape):
            array = array.reshape(-1, 1)
        _check_matrix(variable.name, array, n)
        if array.shape[1] == n + 1:
            _add_times(found, variable.name, array[:, 0])
        found |= {f"{ours}{i + 1}": column for i, column in enumerate(array[:, -n:].T)}
    if "t" not in found:
        raise DescriptionError(
            f"no times: found {_listed(variables)}; expected a vector t or time; {_ARRAY_EXPORT}"
        )
    if len(found) == 1:
        expected = "expected q or q1 ..., or columns={'q': ...} that says which they are"
        raise DescriptionError(
            f"no joint values: found {_listed(variables)}; {expected}; {_ARRAY_EXPORT}"
        )
    for ours, column in found.items():
        if len(column) != len(found["t"]):
            raise DescriptionError(
                f"{ours} has {len(column)} values; expected {len(found['t'])}, one for each time"
            )
    return tuple(found), np.stack(list(found.values()), axis=1)


def _chosen(
    description: Description, variables: Mapping[str, Variable], columns: Mapping[str, str]
) -> dict[str, Variable]:
    """Return variables by our names: times first, then matrices, then the joints' vectors that no matrix has.

    Case is ignored except in names of matrices: beside q, Q is often a weight.
    """
    # The file's names that each of ours may have.
    candidates: dict[str, list[str]] = {"t": list(TIMES)}
    for prefixes in PREFIXES:
        candidates[prefixes[0]] = [name for name in prefixes if name in variables]
    for order, ours in enumerate(MATRICES):
        for i, names in enumerate(joint_columns(description, order), start=1):
            candidates[f"{ours}{i}"] = names

    # T beside t is a pose or a sample period, and Q a weight: names of one letter have their own case.
    spelled = {name.lower(): name for name in variables if len(name) > 1} | {
        name: name for name in variables
    }
    chosen: dict[str, Variable] = {}
    for ours, known in candidates.items():
        if ours in columns:
            chosen[ours] = _named(columns[ours], variables)
        elif ours.rstrip("0123456789") not in chosen:
            found = next((name for name in known if name in spelled), None)
            if found is not None:
                chosen[ours] = variables[spelled[found]]
    if not chosen.keys() - {"t"}:
        output = next((name for name in _OUTPUTS if name in spelled), None)
        if output is not None:
            chosen[MATRICES[0]] = variables[spelled[output]]
    return chosen


def _named(text: str, variables: Mapping[str, Variable]) -> Variable:
    """Return a variable, or columns of one: ``yout`` or ``yout(:,1:6)``."""
    match = None if text in variables else _COLUMNS.fullmatch(text.strip())
    if match is None:
        return variables[place_of_name(text, variables, "variable")]
    variable = variables[place_of_name(match[1].strip(), variables, "variable")]
    array = _numbers(variable)
    first = int(match[2])
    last = int(match[3] or first)
    if array.ndim != 2 or not 1 <= first <= last <= array.shape[1]:
        found = f"{variable.name} has shape {array.shape}"
        raise DescriptionError(
            f"{text[:40]}: {found}; expected columns from 1 to {array.shape[-1]}"
        )
    return Signal(
        text, array[:, first - 1 : last], variable.times if isinstance(variable, Signal) else None
    )


def _with_signals(variables: Mapping[str, MatVariable]) -> dict[str, Variable]:
    """Return variables with those of Simulink's structures replaced by their signals."""
    found: dict[str, Variable] = {}
    for name, variable in variables.items():
        signals = _signals_of(variable)
        if signals is None:
            found[name] = variable
            continue
        for k, signal in enumerate(signals, start=1):
            label = signal.name if signal.name and signal.name not in variables else ""
            own = name if len(signals) == 1 else f"{name}.signals({k})"
            key = label if label and label not in found else own
            found[key] = replace(signal, name=key)
    return found


def _signals_of(variable: MatVariable) -> list[Signal] | None:
    """Return the signals of a structure of Simulink, with their labels as names; None for another variable."""
    record = _record(variable)
    if record is None or "signals" not in record:
        return None
    times = _plain(record.get("time"))
    fields = record["signals"].value if record["signals"].parts else ()
    signals = []
    for signal in fields if isinstance(fields, tuple) else ():
        values = _plain(signal.get("values"))
        if values is None:
            continue
        # Simulink puts time last in values of three axes, (a, b, N).
        rows = (
            values if values.ndim == 2 else np.moveaxis(values, -1, 0).reshape(values.shape[-1], -1)
        )
        label = signal["label"].value if "label" in signal and signal["label"].readable else ""
        name = label.strip() if isinstance(label, str) else ""
        signals.append(Signal(name, rows, None if times is None else times.ravel()))
    return signals or None


def _record(variable: MatVariable) -> dict[str, MatVariable] | None:
    """Return the fields of a variable that is one structure; None for any other."""
    if variable.kind != "struct" or not variable.parts:
        return None
    records = variable.value
    return records[0] if isinstance(records, tuple) and len(records) == 1 else None


def _plain(variable: MatVariable | None) -> Array | None:
    """Return the array of a variable; None for one that is empty, or not an array of real numbers."""
    if variable is None or not variable.readable:
        return None
    value = variable.value
    return value if isinstance(value, np.ndarray) and value.size else None


def _numbers(variable: Variable) -> Array:
    """Return the array of a variable."""
    value = variable.value if variable.readable else None
    if isinstance(value, str):
        raise DescriptionError(f"{variable.name}: found text; expected numbers")
    if not isinstance(value, np.ndarray):
        raise DescriptionError(f"{variable.name}: found a {variable.kind}; {_ARRAY_EXPORT}")
    return value


def _vector(name: str, array: Array) -> Array:
    """Return a row or a column as a vector."""
    if array.size != max(array.shape):
        raise DescriptionError(f"{name} has shape {array.shape}; expected a vector")
    return array.ravel()


def _check_matrix(name: str, array: Array, n: int) -> None:
    """Check that a matrix has a column for each joint, and perhaps one of times before them."""
    if array.ndim == 2 and array.shape[1] in (n, n + 1):
        return
    is_transposed = array.ndim == 2 and array.shape[0] in (n, n + 1)
    advice = f"; {name}' in MATLAB has" if is_transposed else ""
    raise DescriptionError(
        f"{name} has shape {array.shape}; expected (N, {n}), a row for each time, or (N, {n + 1}) with times in the"
        f" first column{advice}"
    )


def _add_times(found: dict[str, Array], name: str, times: Array) -> None:
    """Add the times of a matrix or a structure, or check that they are those of the other variables."""
    if not np.array_equal(found.setdefault("t", times), times):
        raise DescriptionError(f"{name} has times that are not those of the other variables")


def _listed(variables: Mapping[str, Variable]) -> str:
    """Return the names of variables for a message, with the kinds of those that are not read."""
    kinds = [name if each.readable else f"{name} ({each.kind})" for name, each in variables.items()]
    return ", ".join(kinds)[:120] or "nothing"
