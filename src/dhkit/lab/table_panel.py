"""The panel of the Denavit-Hartenberg table: edits that the arm follows, both conventions, undo and files."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, Convention, Description, to_toml
from dhkit.description.table_rows import quantity
from dhkit.errors import DhkitError
from dhkit.kinematics import classify
from dhkit.lab.desk import Desk
from dhkit.lab.fields import Fields
from dhkit.viewer.interactive import COLUMNS, table_texts

MOST_STEPS = 200
"""Of undo."""
LARGEST = 1e4
"""rad or m of an entry."""


@dataclass(frozen=True, eq=False)
class Table:
    """A table as it is typed, and the last good arm that it meant."""

    texts: tuple[tuple[str, ...], ...]
    """Of each row theta, d, a and alpha."""
    description: Description
    errors: dict[tuple[int, int], str] = field(default_factory=dict)
    """What is wrong with an entry, by row and column."""

    @classmethod
    def of(cls, description: Description) -> Table:
        """Return the table of an arm."""
        return cls(table_texts(description), description)


class TablePanel:
    """Requests ``table.…``."""

    def __init__(self, desk: Desk) -> None:
        self.desk = desk
        self._first = self._now = Table.of(desk.arm.description)
        self._before: list[Table] = []
        self._after: list[Table] = []
        self._own = False
        desk.changed.append(self._replaced)

    def edit(self, data: dict[str, Any]) -> dict[str, Any]:
        """Change an entry; an impossible one is marked and leaves the last good arm standing."""
        fields = Fields("table.edit", data, ["row", "column", "text"])
        row = fields.whole("row", 0, self.desk.arm.n - 1)
        column = COLUMNS.index(fields.choice("column", COLUMNS))
        text = typed(fields.text("text").strip())
        texts = [list(entries) for entries in self._now.texts]
        texts[row][column] = text
        table = self._read(tuple(map(tuple, texts)), self._now.description)
        self._take(table)
        error = table.errors.get((row, column))
        return {"error": error}

    def convention(self, data: dict[str, Any]) -> dict[str, Any]:
        """Read the same entries by another convention."""
        name = Fields("table.convention", data, ["convention"]).choice("convention", [c.value for c in Convention])
        description = _drawn(replace(self._now.description, convention=Convention(name)))
        self._take(replace(self._now, description=description))
        return {}

    def undo(self, data: dict[str, Any]) -> dict[str, Any]:
        """Go back by one change."""
        Fields("table.undo", data, [])
        if not self._before:
            raise ValueError("table.undo: nothing was changed")
        self._after.append(self._now)
        self._show(self._before.pop())
        return {}

    def redo(self, data: dict[str, Any]) -> dict[str, Any]:
        """Make the change again that was gone back on."""
        Fields("table.redo", data, [])
        if not self._after:
            raise ValueError("table.redo: no change was gone back on")
        self._before.append(self._now)
        self._show(self._after.pop())
        return {}

    def reset(self, data: dict[str, Any]) -> dict[str, Any]:
        """Go back to the arm that the lab was opened with; this too can be undone."""
        Fields("table.reset", data, [])
        self._take(self._first)
        return {}

    def steps(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return the frames between a row's four elementary transforms, in the world."""
        row = Fields("table.steps", data, ["row"]).whole("row", 0, self.desk.arm.n - 1)
        arm, q = self.desk.arm, self.desk.q
        T = arm.frames(q)[row]
        A = np.eye(4)
        steps = [{"title": f"frame {row}", "T": T.ravel().tolist()}]
        for title, step in _elementary(arm.description, q, row):
            A = A @ step
            steps.append({"title": title, "T": (T @ A).ravel().tolist()})
        return {"steps": steps, "A": A.ravel().tolist()}

    def download(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return the arm as a robot file or a URDF."""
        kind = Fields("table.download", data, ["format"]).choice("format", ("toml", "urdf"))
        arm = self.desk.arm
        return {"name": f"{arm.name}.{kind}", "text": to_toml(arm.description) if kind == "toml" else arm.urdf()}

    def publish(self) -> None:
        """Tell the pages the table."""
        table = self._now
        description = table.description
        numbers = description.numbers
        self.desk.view.panel(
            "table",
            {
                "convention": description.convention.value,
                "rows": [
                    {"joint": joint.name, "kind": "R" if joint.is_revolute else "P"}
                    | dict(zip(COLUMNS, texts, strict=True))
                    for joint, texts in zip(description.joints, table.texts, strict=True)
                ],
                "values": np.stack([numbers.theta, numbers.d, numbers.a, numbers.alpha], axis=1).tolist(),
                "errors": [
                    {"row": row, "column": COLUMNS[k], "error": text} for (row, k), text in table.errors.items()
                ],
                "undo": bool(self._before),
                "redo": bool(self._after),
                "changed": table.texts != self._first.texts
                or description.convention is not self._first.description.convention,
                "note": self._note(),
            },
        )

    def _note(self) -> str | None:
        before, now = (classify(x).fit for x in (self._first.description, self._now.description))
        if before is not None and now is None:
            return "this table has no closed form: the tool is followed by iteration"
        meshes, drawn = (any(j.shapes for j in table.description.joints) for table in (self._first, self._now))
        if meshes and not drawn:
            return "drawn from the table: the arm's meshes fit its own lengths alone"
        return None

    def _read(self, texts: tuple[tuple[str, ...], ...], last: Description) -> Table:
        """Return a table of texts, with the last good arm where an entry is impossible."""
        errors: dict[tuple[int, int], str] = {}
        rows = []
        for i, entries in enumerate(texts):
            values = {}
            for k, (name, text) in enumerate(zip(COLUMNS, entries, strict=True)):
                try:
                    values[name] = quantity(name, text, last.parameters)
                except (DhkitError, ValueError) as error:
                    errors[i, k] = str(error)
            rows.append(values)
        if errors:
            return Table(texts, last, errors)
        joints = tuple(
            replace(joint, theta=x["theta"], d=x["d"], a=x["a"], alpha=x["alpha"], shapes=())
            for joint, x in zip(last.joints, rows, strict=True)
        )
        try:
            description = replace(last, joints=joints)
            numbers = description.numbers
            beyond = np.argwhere(~(np.abs([getattr(numbers, name) for name in COLUMNS]) <= LARGEST))
            if len(beyond):
                return Table(texts, last, {(int(i), int(k)): f"{COLUMNS[k]}: beyond {LARGEST:g}" for k, i in beyond})
            first = self._first.description  # whoever types the first arm's numbers again has it again, meshes and all
            return Table(texts, first if description == _drawn(first) else description)
        except (DhkitError, ValueError) as error:
            changed = [(i, k) for i, row in enumerate(texts) for k in range(4) if row[k] != self._now.texts[i][k]]
            return Table(texts, last, dict.fromkeys(changed or [(0, 0)], str(error)))

    def _take(self, table: Table) -> None:
        self._before = [*self._before[1 - MOST_STEPS :], self._now]
        self._after = []
        self._show(table)

    def _show(self, table: Table) -> None:
        same = table.description == self._now.description
        before, self._now = self._now, table
        if same:
            self.publish()
            return
        self._own = True
        arm = Arm(table.description)
        try:
            self.desk.replace(arm.with_uniform_links() if self.desk.assumed_bodies else arm)
        except BaseException:
            self._now = before
            raise
        finally:
            self._own = False
        self.publish()

    def _replaced(self) -> None:
        """Take an arm of the same table that has got other bodies; begin anew with any other."""
        if self._own:
            return
        table = Table.of(self.desk.arm.description)
        if table.texts != self._now.texts:
            self._first = self._now = table
            self._before, self._after = [], []
        self.publish()


def typed(text: str) -> str:
    """Return an entry as expressions are written: 90° is 90*deg, π is pi, and a decimal comma a point.

    Where something is called, as in ``atan2(1,2)``, a comma stands between values.
    """
    plain = text.replace("°", "*deg").replace("π", "pi").replace("−", "-")
    return plain if "(" in plain else re.sub(r"(?<=\d),(?=\d)", ".", plain)


def _drawn(description: Description) -> Description:
    """Return a description whose links are drawn from the table: meshes do not fit other lengths."""
    joints = tuple(replace(joint, shapes=()) for joint in description.joints)
    return replace(description, joints=joints)


def _elementary(description: Description, q: Array, row: int) -> list[tuple[str, Array]]:
    """Return a row's four transforms in their order, with titles."""
    numbers = description.numbers
    slides = bool(numbers.prismatic[row])
    theta = float(numbers.theta[row] + (0.0 if slides else q[row]))
    d = float(numbers.d[row] + (q[row] if slides else 0.0))
    a, alpha = float(numbers.a[row]), float(numbers.alpha[row])
    about_z = (f"turn about z by {np.degrees(theta):.4g}°", turned(2, theta))
    along_z = (f"move along z by {d:.4g} m", moved(2, d))
    along_x = (f"move along x by {a:.4g} m", moved(0, a))
    about_x = (f"turn about x by {np.degrees(alpha):.4g}°", turned(0, alpha))
    if description.convention is Convention.STANDARD:
        return [about_z, along_z, along_x, about_x]
    return [about_x, along_x, about_z, along_z]


def turned(axis: int, angle: float) -> Array:
    """Return a rotation about x, y or z (0, 1, 2), rad, shape (4, 4)."""
    T = np.eye(4)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    T[i, i] = T[j, j] = np.cos(angle)
    T[i, j], T[j, i] = -np.sin(angle), np.sin(angle)
    return T


def moved(axis: int, length: float) -> Array:
    """Return a translation along x, y or z (0, 1, 2), m, shape (4, 4)."""
    T = np.eye(4)
    T[axis, 3] = length
    return T
