"""The panel of the Denavit-Hartenberg table: edits that the arm follows, both conventions, undo and files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from dhkit.arm import Arm
from dhkit.cached_property import cached_property
from dhkit.description import Array, Convention, Description, Joint, pose_parts, to_toml
from dhkit.description.table_rows import quantity
from dhkit.errors import DhkitError
from dhkit.expressions import Expression
from dhkit.kinematics import classify
from dhkit.kinematics.polynomial.six_joints import has_two_parallel
from dhkit.lab.desk import Desk
from dhkit.lab.requests import Fields, JsonObject, Panel, answers
from dhkit.viewer.interactive import COLUMNS, table_texts

MAX_UNDO_STEPS = 200
MAX_ENTRY = 1e4
"""Largest entry of a table, rad or m."""


@dataclass(frozen=True, eq=False)
class Table:
    """A table as it is typed, and the last valid arm that it described."""

    texts: tuple[tuple[str, ...], ...]
    """theta, d, a and alpha of each row."""
    description: Description
    errors: dict[tuple[int, int], str] = field(default_factory=dict)
    """Error of an entry, by row and column."""

    @classmethod
    def of(cls, description: Description) -> Table:
        """Return the table of an arm."""
        return cls(table_texts(description), description)

    @property
    def has_shapes(self) -> bool:
        """Whether meshes of the arm are known."""
        return any(joint.shapes for joint in self.description.joints)

    @cached_property
    def description_without_meshes(self) -> Description:
        """The arm with its links drawn from the table."""
        return _without_meshes(self.description)


@dataclass(frozen=True, eq=False)
class WholeArm:
    """An arm before some of its joints were locked, with the changes of its table."""

    arm: Arm
    first: Table
    table: Table
    undo: list[Table]
    redo: list[Table]
    locked: tuple[int, ...]
    """Places of the locked joints, from 0; all are locked at zero."""

    @property
    def values(self) -> dict[int | str, float]:
        """The values of the locked joints, as :meth:`dhkit.Arm.lock` takes them."""
        return dict.fromkeys(self.locked, 0)


class TablePanel(Panel):
    """Requests ``table.…``."""

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        self._first = self._table = Table.of(desk.arm.description)
        self._undo: list[Table] = []
        self._redo: list[Table] = []
        self.whole: WholeArm | None = None
        """The arm that this one was made from by locking joints, if it was."""
        self._is_replacing = False
        """Whether this panel itself puts another arm on the desk."""
        desk.on_replace.append(self._take_replaced_arm)

    @answers("table.edit", "row", "column", "text")
    def edit(self, fields: Fields) -> JsonObject:
        """Change an entry; one that is not valid is marked, and the last valid arm stays."""
        row = fields.integer("row", 0, self.desk.arm.n - 1)
        column = COLUMNS.index(fields.choice("column", COLUMNS))
        texts = [list(entries) for entries in self._table.texts]
        texts[row][column] = plain_expression(fields.text("text").strip())
        table = self._read(tuple(map(tuple, texts)), self._table.description)
        self._take(table)
        return {"error": table.errors.get((row, column))}

    @answers("table.convention", "convention")
    def set_convention(self, fields: Fields) -> None:
        """Read the same entries by another convention."""
        convention = Convention(fields.choice("convention", [c.value for c in Convention]))
        description = _without_meshes(replace(self._table.description, convention=convention))
        self._take(replace(self._table, description=description))

    @answers("table.undo")
    def undo(self, _: Fields) -> None:
        """Take the last change back."""
        if not self._undo:
            raise ValueError("table.undo: nothing was changed")
        self._redo.append(self._table)
        self._show(self._undo.pop())

    @answers("table.redo")
    def redo(self, _: Fields) -> None:
        """Make the change again that was taken back last."""
        if not self._redo:
            raise ValueError("table.redo: no change was gone back on")
        self._undo.append(self._table)
        self._show(self._redo.pop())

    @answers("table.reset")
    def reset(self, _: Fields) -> None:
        """Go back to the arm that the lab was opened with; this too can be undone."""
        self._take(self._first)

    @answers("table.steps", "row")
    def elementary_steps(self, fields: Fields) -> JsonObject:
        """Return the frames between a row's four elementary transforms, in the world."""
        row = fields.integer("row", 0, self.desk.arm.n - 1)
        arm = self.desk.arm
        q = self.desk.q
        T = arm.frames(q)[row]
        A = np.eye(4)
        steps = [{"title": f"frame {row}", "T": T.ravel().tolist()}]
        for title, step in _elementary_transforms(arm.description, q, row):
            A = A @ step
            steps.append({"title": title, "T": (T @ A).ravel().tolist()})
        return {"steps": steps, "A": A.ravel().tolist()}

    @answers("table.lock", "free")
    def lock_others(self, fields: Fields) -> None:
        """Make an arm of some joints, from 0, with all others locked at zero: its own table, dynamics and answers."""
        arm = self.desk.arm
        free = fields.data.get("free")
        if not isinstance(free, list) or not all(type(i) is int and 0 <= i < arm.n for i in free):
            raise ValueError(
                f"table.lock: free is {str(free)[:40]}; expected numbers of joints, 1 to {arm.n}"
            )
        if self.whole is not None:
            raise ValueError(
                "table.lock: joints are locked already; expected all joints to be freed first"
            )
        if not 0 < len(set(free)) < arm.n:
            raise ValueError(f"table.lock: {len(set(free))} joints move; expected 1 to {arm.n - 1}")
        locked = tuple(i for i in range(arm.n) if i not in free)
        # The table's arm has no assumed bodies: those of the shorter arm are assumed anew, for each of its links.
        whole = WholeArm(
            Arm(self._table.description), self._first, self._table, self._undo, self._redo, locked
        )
        shorter = whole.arm.lock(whole.values)
        table = Table.of(shorter.description)
        self._replace(shorter, self.desk.q[sorted(set(free))])
        self._first = self._table = table
        self._undo = []
        self._redo = []
        self.whole = whole
        self.publish()

    @answers("table.free")
    def free_all(self, _: Fields) -> None:
        """Show the whole arm again, with the changes of its table."""
        whole = self.whole
        if whole is None:
            raise ValueError("table.free: no joint is locked")
        q = np.zeros(whole.arm.n)
        q[[i for i in range(whole.arm.n) if i not in whole.locked]] = self.desk.q
        self._replace(whole.arm, q)
        self.whole = None
        self._first = whole.first
        self._table = whole.table
        self._undo = whole.undo
        self._redo = whole.redo
        self.publish()

    @answers("table.download", "format")
    def download(self, fields: Fields) -> JsonObject:
        """Return the arm as a robot file or a URDF."""
        kind = fields.choice("format", ("toml", "urdf"))
        arm = self.desk.arm
        return {
            "name": f"{arm.name}.{kind}",
            "text": to_toml(arm.description) if kind == "toml" else arm.urdf(),
        }

    def publish(self) -> None:
        """Send the table to the pages."""
        table = self._table
        first = self._first
        description = table.description
        numbers = description.numbers
        rows = [
            {
                "joint": joint.name,
                "kind": "R" if joint.is_revolute else "P",
                **dict(zip(COLUMNS, texts, strict=True)),
            }
            for joint, texts in zip(description.joints, table.texts, strict=True)
        ]
        errors = [
            {"row": row, "column": COLUMNS[k], "error": text}
            for (row, k), text in table.errors.items()
        ]
        same_convention = description.convention is first.description.convention
        self.desk.view.panel(
            "table",
            {
                "convention": description.convention.value,
                "rows": rows,
                "values": np.stack([getattr(numbers, name) for name in COLUMNS], axis=1).tolist(),
                "errors": errors,
                "undo": bool(self._undo),
                "redo": bool(self._redo),
                "changed": table.texts != first.texts or not same_convention,
                "base": placement_state(numbers.T_world_base),
                "tool": placement_state(numbers.T_last_tool),
                "note": self._note(),
                "joints": self.desk.arm.n if self.whole is None else self.whole.arm.n,
                "locked": None if self.whole is None else list(self.whole.locked),
            },
        )

    def _note(self) -> str | None:
        first_fit, fit = (classify(table.description).fit for table in (self._first, self._table))
        if first_fit is not None and fit is None:
            by = "elimination" if has_two_parallel(self._table.description) else "iteration"
            return f"this table has no closed form: the tool is followed by {by}"
        if self._first.has_shapes and not self._table.has_shapes:
            return "drawn from the table: the arm's meshes fit its own lengths alone"
        return None

    def _read(self, texts: tuple[tuple[str, ...], ...], last: Description) -> Table:
        """Return the table of texts; where an entry is not valid, with the errors and the last valid arm."""
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
        try:
            joints = tuple(map(_with_entries, last.joints, rows))
            description = replace(last, joints=joints)
            numbers = description.numbers
            beyond = np.argwhere(
                ~(np.abs([getattr(numbers, name) for name in COLUMNS]) <= MAX_ENTRY)
            )
            if len(beyond):
                too_large = {
                    (int(i), int(k)): f"{COLUMNS[k]}: beyond {MAX_ENTRY:g}" for k, i in beyond
                }
                return Table(texts, last, too_large)
            # Who types the first arm's numbers again has it again, with its meshes.
            first = self._first
            again = description == first.description_without_meshes
            return Table(texts, first.description if again else description)
        except (DhkitError, ValueError) as error:
            changed = np.argwhere(np.array(texts) != np.array(self._table.texts))
            cells = [(int(i), int(k)) for i, k in changed] or [(0, 0)]
            return Table(texts, last, dict.fromkeys(cells, str(error)))

    def _take(self, table: Table) -> None:
        """Show a table, as a change that can be undone."""
        self._undo = [*self._undo[1 - MAX_UNDO_STEPS :], self._table]
        self._redo = []
        self._show(table)

    def _show(self, table: Table) -> None:
        previous = self._table
        self._table = table
        if table.description != previous.description:
            try:
                self._replace(Arm(table.description))
            except BaseException:
                self._table = previous
                raise
        self.publish()

    def _replace(self, arm: Arm, q: Array | None = None) -> None:
        """Put another arm on the desk, with assumed bodies where those of the present one are."""
        self._is_replacing = True
        try:
            self.desk.replace(arm.with_uniform_links() if self.desk.assumed_bodies else arm, q)
        finally:
            self._is_replacing = False

    def _take_replaced_arm(self) -> None:
        """Keep the table of an arm that has only got other bodies; begin anew with any other arm."""
        if self._is_replacing:
            return
        table = Table.of(self.desk.arm.description)
        if table.texts != self._table.texts:
            self._first = self._table = table
            self._undo = []
            self._redo = []
            self.whole = None
        self.publish()


def placement_state(T: Array) -> list[float] | None:
    """Return the position, m, and the Euler angles about fixed x, y, z, rad, of a pose; None for the identity."""
    if np.array_equal(T, np.eye(4)):
        return None
    position, angles = pose_parts(T, order="xyz")
    return [*position.tolist(), *angles.tolist()]


def plain_expression(text: str) -> str:
    """Return an entry as expressions are written: 90° is 90*deg, π is pi, and a decimal comma a point.

    In a call such as ``atan2(1,2)`` a comma separates values, and stays.
    """
    plain = text.replace("°", "*deg").replace("π", "pi").replace("−", "-")
    return plain if "(" in plain else re.sub(r"(?<=\d),(?=\d)", ".", plain)


def _with_entries(joint: Joint, entries: Mapping[str, Expression]) -> Joint:
    """Return a joint with these entries, without meshes; itself where nothing differs, as it was checked before."""
    same = all(
        getattr(joint, name) == value and getattr(joint, name).written == value.written
        for name, value in entries.items()
    )
    if same and not joint.shapes:
        return joint
    theta, d, a, alpha = (entries[name] for name in COLUMNS)
    return replace(joint, theta=theta, d=d, a=a, alpha=alpha, shapes=())


def _without_meshes(description: Description) -> Description:
    """Return a description whose links are drawn from the table: meshes do not fit other lengths."""
    return replace(
        description, joints=tuple(replace(joint, shapes=()) for joint in description.joints)
    )


def _elementary_transforms(description: Description, q: Array, row: int) -> list[tuple[str, Array]]:
    """Return a row's four transforms, shape (4, 4), m, in their order and with titles, at joint values, shape (n,)."""
    numbers = description.numbers
    is_prismatic = bool(numbers.prismatic[row])
    theta = float(numbers.theta[row] + (0.0 if is_prismatic else q[row]))
    d = float(numbers.d[row] + (q[row] if is_prismatic else 0.0))
    a = float(numbers.a[row])
    alpha = float(numbers.alpha[row])
    about_z = (f"turn about z by {np.degrees(theta):.4g}°", rotation_about(2, theta))
    along_z = (f"move along z by {d:.4g} m", translation_along(2, d))
    along_x = (f"move along x by {a:.4g} m", translation_along(0, a))
    about_x = (f"turn about x by {np.degrees(alpha):.4g}°", rotation_about(0, alpha))
    if description.convention is Convention.STANDARD:
        return [about_z, along_z, along_x, about_x]
    return [about_x, along_x, about_z, along_z]


def rotation_about(axis: int, angle: float) -> Array:
    """Return a rotation by an angle, rad, about x, y or z (0, 1, 2), shape (4, 4)."""
    T = np.eye(4)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    T[i, i] = T[j, j] = np.cos(angle)
    T[i, j] = -np.sin(angle)
    T[j, i] = np.sin(angle)
    return T


def translation_along(axis: int, length: float) -> Array:
    """Return a translation by a length, m, along x, y or z (0, 1, 2), shape (4, 4)."""
    T = np.eye(4)
    T[axis, 3] = length
    return T
