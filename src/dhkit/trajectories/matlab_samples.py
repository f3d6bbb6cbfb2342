"""Samples of a motion from a .mat file of plain arrays, as MATLAB and Simulink users save them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dhkit.description import Array, Description
from dhkit.description.mat_files import MatVariable, read_mat
from dhkit.errors import DescriptionError
from dhkit.trajectories.tables import PREFIXES, TIMES, Table, joint_columns, place_of_name

_ARRAY_EXPORT = "save arrays by save('log.mat', 't', 'q', '-v7'), a timeseries ts as [ts.Time, ts.Data]"
"""Advice for variables that are not read."""
MATRICES = tuple(prefixes[0] for prefixes in PREFIXES)
"""Our names of matrices with a column for each joint: values, rates, accelerations."""


def matlab_table(description: Description, content: bytes, most: int, columns: Mapping[str, str]) -> Table:
    """Return the samples of a .mat file as a table whose columns have our names.

    Parameters
    ----------
    description
        The robot.
    content
        The file. Times are a vector, ``t`` or ``time``; joint values are a matrix ``q``, shape (N, n), or vectors
        ``q1`` ... or of the joints' names, and rates and accelerations likewise. A matrix of n+1 columns has the times
        in its first. Variables of other names are left out.
    most
        Largest size of the unpacked variables, bytes.
    columns
        The file's names by our names.

    Raises
    ------
    DescriptionError
        No such file, a variable that is not an array of real numbers, or arrays that do not fit together; names it.
    """
    variables = read_mat(content, most, advice=_ARRAY_EXPORT)
    names = _chosen(description, variables, columns)
    n = description.n
    found: dict[str, Array] = {}
    for ours, variable in names.items():
        array = _numbers(variable)
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
        raise DescriptionError(f"no times: found {_listed(variables)}; expected a vector t or time; {_ARRAY_EXPORT}")
    if len(found) == 1:
        expected = "expected q or q1 ..., or columns={'q': ...} that says which they are"
        raise DescriptionError(f"no joint values: found {_listed(variables)}; {expected}; {_ARRAY_EXPORT}")
    for ours, column in found.items():
        if len(column) != len(found["t"]):
            raise DescriptionError(f"{ours} has {len(column)} values; expected {len(found['t'])}, one for each time")
    return tuple(found), np.stack(list(found.values()), axis=1)


def _chosen(
    description: Description, variables: Mapping[str, MatVariable], columns: Mapping[str, str]
) -> dict[str, MatVariable]:
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

    spelled = {name.lower(): name for name in variables} | {name: name for name in variables}
    chosen: dict[str, MatVariable] = {}
    for ours, known in candidates.items():
        if ours in columns:
            chosen[ours] = variables[place_of_name(columns[ours], variables, "variable")]
        elif ours.rstrip("0123456789") not in chosen:
            found = next((name for name in known if name in spelled), None)
            if found is not None:
                chosen[ours] = variables[spelled[found]]
    return chosen


def _numbers(variable: MatVariable) -> Array:
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
    """Add the times of a matrix, or check that they are those of the other variables."""
    if not np.array_equal(found.setdefault("t", times), times):
        raise DescriptionError(f"{name} has times in its first column that are not those of the other variables")


def _listed(variables: Mapping[str, MatVariable]) -> str:
    """Return the names of variables for a message, with the kinds of those that are not read."""
    kinds = [name if each.readable else f"{name} ({each.kind})" for name, each in variables.items()]
    return ", ".join(kinds)[:120] or "nothing"
