"""Descriptions from Denavit-Hartenberg tables that are given row by row in Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from typing import Any, TypeAlias

from dhkit.description.bodies import INERTIA_PLACES, Body, Inertia
from dhkit.description.named import Named
from dhkit.description.parameters import check_parameter_name
from dhkit.description.quantities import parse_quantity, without_variable
from dhkit.description.robot import Description
from dhkit.description.table import COLUMNS
from dhkit.description.values import ONE, Convention, Joint, JointType, Units
from dhkit.errors import DescriptionError, ExpressionError
from dhkit.expressions import Expression, exact, exact_angle

Quantity: TypeAlias = float | Fraction | Decimal | str | Expression
"""A number, or text: ``0.4318``, ``"17*inch"``, ``"l1/2"``."""


def quantity(
    where: str, value: object, names: Mapping[str, object], unit: Expression | None = None
) -> Expression:
    """Return an argument's exact value; numbers are in ``unit``, expressions are in SI and may use these ``names``.

    Raises
    ------
    DescriptionError
        Not a finite number or expression; begins with ``where``.
    """
    try:
        if isinstance(value, str):
            return parse_quantity(value, tuple(names), ONE if unit is None else unit)
        number = exact(value)
        return number if unit is None or isinstance(value, Expression) else number * unit
    except ExpressionError as error:
        raise DescriptionError(f"{where}: {error}") from None


def from_dh(
    rows: Sequence[Sequence[Quantity] | Mapping[str, Quantity]],
    *,
    order: Sequence[str] = COLUMNS,
    kinds: str | Sequence[str] | None = None,
    convention: str = "standard",
    angle: str = "rad",
    length: str = "m",
    name: str = "arm",
    parameters: Mapping[str, Quantity] | None = None,
    limits: Sequence[Sequence[Quantity] | None] | None = None,
    bodies: Sequence[Body | Mapping[str, object] | None] | None = None,
) -> Description:
    """Return the description of a Denavit-Hartenberg table.

    Parameters
    ----------
    rows
        One row a joint: four numbers, in the units given, or expressions as text, in metres and radians; in a row by
        names, ``{"theta": 0, "d": 0.3, "a": 0, "alpha": "pi/2"}``, zeros may be left out. The joint variable may be
        written where ``arm.dh`` prints it: ``"q1"`` or ``"q1 + pi/2"`` for theta of a revolute joint 1.
    order
        Names of the columns, in their order.
    kinds
        One letter a joint: R or P; all revolute if not given.
    convention
        ``"standard"`` or ``"modified"`` (row i then holds alpha_(i-1) and a_(i-1)).
    angle, length
        Units of bare numbers: rad or deg; m, mm, cm or in.
    name
        The robot's name.
    parameters
        Values of the names that occur in text.
    limits
        Of each joint: its lowest and highest value, in the units given, or None.
    bodies
        Of each link: a :class:`Body`, or ``{"mass": 2.0, "com": (x, y, z), "inertia": ((…), (…), (…))}`` in kg, m and
        kg m^2, about the centre of mass in the axes of the link's own DH frame; or None.

    Returns
    -------
    Description
        The arm; without bodies its kinematics work and its dynamics say what is missing.

    Raises
    ------
    DescriptionError
        Another number of columns, an unknown kind, unit or convention, or a value that is not a finite number.

    Examples
    --------
    >>> arm = from_dh([(0, 0.3, 0, "pi/2"), (0, 0, "l", 0)], kinds="RR", parameters={"l": 0.5})
    >>> arm.n, float(arm.numbers.a[1])
    (2, 0.5)
    """
    if sorted(order) != sorted(COLUMNS):
        raise DescriptionError(
            f"order is {tuple(order)}; expected {', '.join(COLUMNS)} in some order"
        )
    for what, value, known in (
        ("convention", convention, [c.value for c in Convention]),
        ("angle", angle, list(Units.ANGLES)),
        ("length", length, list(Units.LENGTHS)),
    ):
        if value not in known:
            raise DescriptionError(f"{what} is {value!r}; expected one of {', '.join(known)}")
    rows = list(rows)
    given = kinds or "R" * len(rows)
    letters = "".join(map(str, given)).upper() if hasattr(given, "__len__") else ""
    if len(letters) != len(rows) or set(letters) - {"R", "P"}:
        raise DescriptionError(
            f"kinds is {kinds!r}; expected {len(rows)} letters, R or P, one a row"
        )
    units = Units(length, angle)
    names = dict(parameters or {})
    for key in names:
        check_parameter_name(key)
    joints = [
        _joint(i, row, order, letters[i - 1], units, names) for i, row in enumerate(rows, start=1)
    ]
    for what, several in (("limits", limits), ("bodies", bodies)):
        if several is not None and len(several) != len(joints):
            raise DescriptionError(
                f"{what}: {len(several)} entries; expected {len(joints)}, one a joint"
            )
    for i, pair in enumerate(limits or ()):
        if pair is not None:
            joints[i] = replace(joints[i], limits=_limits(i + 1, pair, joints[i], units, names))
    for i, body in enumerate(bodies or ()):
        if body is not None:
            joints[i] = replace(joints[i], bodies=(_body(i + 1, body, names),))
    return Description(
        name=name,
        convention=Convention(convention),
        joints=tuple(joints),
        parameters=Named(
            {key: quantity(f"parameters.{key}", value, names) for key, value in names.items()}
        ),
        units=units,
    )


def _has_length(value: object, length: int) -> bool:
    return not isinstance(value, str) and hasattr(value, "__len__") and len(value) == length


def _joint(
    number: int,
    row: Sequence[Quantity] | Mapping[str, Quantity],
    order: Sequence[str],
    letter: str,
    units: Units,
    names: Mapping[str, object],
) -> Joint:
    kind = JointType.REVOLUTE if letter == "R" else JointType.PRISMATIC
    entries = {
        key: quantity(
            f"row {number}: {key}", value, names, units.metres if key in "da" else units.radians
        )
        for key, value in _named_entries(number, row, order, kind).items()
    }
    theta, alpha = (exact_angle(entries[key]) for key in ("theta", "alpha"))
    return Joint(kind, entries["a"], alpha, entries["d"], theta)


def _named_entries(
    number: int,
    row: Sequence[Quantity] | Mapping[str, Quantity],
    order: Sequence[str],
    kind: JointType,
) -> dict[str, Quantity]:
    """Return the entries of a row by their names, without the joint variable."""
    if isinstance(row, Mapping):
        if unknown := set(row) - set(COLUMNS):
            found = sorted(map(str, unknown))[0][:40]
            raise DescriptionError(f"row {number}: found {found!r}; expected {', '.join(COLUMNS)}")
        entries = dict.fromkeys(COLUMNS, 0) | dict(row)
    elif _has_length(row, len(COLUMNS)):
        entries = dict(zip(order, row, strict=True))
    else:
        raise DescriptionError(f"row {number}: found {row!r}; expected {', '.join(order)}")
    column = "theta" if kind is JointType.REVOLUTE else "d"
    entries[column] = without_variable(entries[column], number)
    return entries


def _limits(
    number: int, pair: Sequence[Quantity], joint: Joint, units: Units, names: Mapping[str, object]
) -> tuple[Expression, Expression]:
    if not _has_length(pair, 2):
        raise DescriptionError(
            f"limits of joint {number}: found {pair!r}; expected lowest and highest value, or None"
        )
    unit = units.radians if joint.is_revolute else units.metres
    low, high = (quantity(f"limits of joint {number}", value, names, unit) for value in pair)
    return low, high


def _body(number: int, body: object, names: Mapping[str, object]) -> Body:
    if isinstance(body, Body):
        return body
    where = f"body of link {number}"
    if (
        not isinstance(body, Mapping)
        or "mass" not in body
        or set(body) - {"mass", "com", "inertia"}
    ):
        raise DescriptionError(
            f"{where}: found {str(body)[:80]}; expected a Body, or mass, com and inertia by name"
        )
    com = tuple(quantity(f"{where}: com", value, names) for value in body.get("com", (0, 0, 0)))
    if len(com) != 3:
        raise DescriptionError(f"{where}: com has {len(com)} numbers; expected 3")
    inertia = _body_inertia(f"{where}: inertia", body.get("inertia", {}), names)
    return Body(quantity(f"{where}: mass", body["mass"], names), (com[0], com[1], com[2]), inertia)


def _body_inertia(where: str, given: Any, names: Mapping[str, object]) -> Inertia:
    """Return an inertia given as a 3x3 matrix, or by its entries ``xx`` to ``yz`` as robot files have it, kg m^2."""
    expected = "expected a symmetric 3x3 matrix, or entries xx, yy, zz, xy, yz, xz; kg m^2 about the centre of mass"
    if isinstance(given, Mapping):
        if unknown := set(given) - set(INERTIA_PLACES):
            raise DescriptionError(f"{where}: found {sorted(map(str, unknown))[0]}; {expected}")
        return Inertia(**{key: quantity(where, given.get(key, 0), names) for key in INERTIA_PLACES})
    if not _has_length(given, 3) or not all(_has_length(row, 3) for row in given):
        raise DescriptionError(f"{where}: found {str(given)[:80]}; {expected}")
    rows = []
    for row in given:
        entries = [quantity(where, value, names) for value in row]
        rows.append(entries)
    if any(rows[i][j] != rows[j][i] for i, j in ((0, 1), (0, 2), (1, 2))):
        raise DescriptionError(f"{where}: {expected}")
    return Inertia(**{key: rows[i][j] for key, (i, j) in INERTIA_PLACES.items()})
