"""The panel of transforms: a solid that is turned and moved step by step, about its own axes or those of the world."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.description.table_rows import quantity
from dhkit.errors import DhkitError, ModelError
from dhkit.grading.reports.mathml import mathml
from dhkit.lab.desk import Desk
from dhkit.lab.requests import Fields, JsonObject, Panel, answers
from dhkit.lab.table_panel import plain_expression, rotation_about, translation_along
from dhkit.model.mesh_reader import read_mesh

BOX_EDGES = (0.36, 0.24, 0.12)
"""Edges of the box that is shown where no file is given, as shares of the arm's reach."""
MAX_FILE_BYTES = 5_000_000
"""Largest size of a solid's file, bytes: the page gets it as text."""
MAX_TRIANGLES = 5_000
"""Largest number of triangles of a solid."""
UNITS = {"m": 1.0, "mm": 1e-3, "in": 0.0254, "cm": 1e-2}
"""Units of a solid's file, m, in the order in which they are tried."""
SMALLEST_SHARE = 0.02
"""Size of a solid, as a share of the arm's reach, below which its unit is another one."""
LARGEST_SHARE = 1.5
"""Size above which it is."""
MAX_STEPS = 30
LISTED_VERTICES = 24
"""Vertices whose coordinates are listed, and whose numbers are drawn."""
MAX_AMOUNT = 1e4
"""Largest amount of a step, rad or m."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A solid: triangles between numbered vertices."""

    name: str
    vertices: Array
    """Shape (k, 3), m."""
    faces: NDArray[np.intp]
    """Numbers of the vertices of each triangle, from 0, shape (m, 3)."""
    unit: str | None = None
    """Unit in which the file is read: one of :data:`UNITS`; None for a solid without a file."""

    def scaled(self, unit: str) -> Solid:
        """Return the solid with its file's numbers in another unit."""
        factor = UNITS[unit] / UNITS[self.unit or "m"]
        return replace(self, vertices=factor * self.vertices, unit=unit)

    def beside(self, reach: float) -> Solid:
        """Return the solid in the first unit in which it is not larger than an arm of this reach, m, nor tiny.

        STL files have no unit: most are in mm, some in m or inches.
        """
        for unit in UNITS:
            solid = self.scaled(unit)
            size = float(np.ptp(solid.vertices, axis=0).max())
            if SMALLEST_SHARE * reach <= size <= LARGEST_SHARE * reach:
                return solid
        return self

    @classmethod
    def box(cls, edges: tuple[float, float, float]) -> Solid:
        """Return a box with one corner at the origin and these edges, m; its lower vertices come first."""
        x, y, z = edges
        bottom = np.array([(0.0, 0.0, 0.0), (x, 0.0, 0.0), (x, y, 0.0), (0.0, y, 0.0)])
        vertices = np.concatenate([bottom, bottom + np.array([0.0, 0.0, z])])
        sides = [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
        quads = [(0, 3, 2, 1), (4, 5, 6, 7), *sides]
        faces = []
        for a, b, c, d in quads:
            faces += [(a, b, c), (a, c, d)]
        return cls("box", vertices, np.array(faces))

    @classmethod
    def read(cls, path: Path) -> Solid:
        """Read an STL file; equal vertices become one.

        Raises
        ------
        ModelError
            There is no such file, or it is too large, no STL file, without triangles, or has numbers that are not
            finite.
        """
        if path.suffix.lower() != ".stl":
            raise ModelError(f"{path}: ends in {path.suffix!r}; expected .stl")
        try:
            size = path.stat().st_size
        except OSError as error:
            raise ModelError(f"{path}: {error.strerror}") from None
        if size > MAX_FILE_BYTES:
            raise ModelError(f"{path}: {size} bytes; expected a file of at most {MAX_FILE_BYTES}")
        corners = read_mesh(path, max_triangles=MAX_TRIANGLES, max_bytes=MAX_FILE_BYTES).corners
        vertices, faces = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        return cls(path.stem, vertices, faces.reshape(-1, 3), "m")


class TransformsPanel(Panel):
    """Requests ``transforms.…``."""

    def __init__(self, desk: Desk, solid: Solid | None = None) -> None:
        super().__init__(desk)
        reach = desk.arm.description.reach or 1.0
        x, y, z = (float(f"{edge * reach:.2g}") for edge in BOX_EDGES)
        self.solid = solid.beside(reach) if solid is not None else Solid.box((x, y, z))

    @answers("transforms.unit", "unit")
    def set_unit(self, fields: Fields) -> None:
        """Read the numbers of the solid's file in another unit."""
        unit = fields.choice("unit", UNITS)
        if self.solid.unit is None:
            raise ValueError(
                "transforms.unit: the box has no file; expected a lab with --solid FILE"
            )
        self.solid = self.solid.scaled(unit)
        self.publish()

    @answers("transforms.apply", "steps")
    def apply(self, fields: Fields) -> JsonObject:
        """Return the poses of the solid after each step, their formulas, and the vertices after the last step."""
        steps = fields.data.get("steps")
        if not isinstance(steps, list) or len(steps) > MAX_STEPS:
            raise ValueError(f"transforms.apply: expected a list of at most {MAX_STEPS} steps")
        T = np.eye(4)
        results: list[dict[str, object]] = []
        note = None
        for k, data in enumerate(steps, start=1):
            place = f"transforms.apply: step {k}"
            if not isinstance(data, dict):
                raise ValueError(f"{place}: expected kind, axis, amount and about")
            step = Fields(place, data, ["kind", "axis", "amount", "about"])
            kind = step.choice("kind", ("turn", "move"))
            axis = step.choice("axis", ("x", "y", "z"))
            about = step.choice("about", ("current", "fixed"))
            amount = _amount(step)
            E = (rotation_about if kind == "turn" else translation_along)("xyz".index(axis), amount)
            T = T @ E if about == "current" else E @ T
            formulas = [mathml(latex) for latex in _formulas(k, kind, axis, amount, about)]
            results.append(
                {
                    "amount": amount,
                    "E": E.ravel().tolist(),
                    "T": T.ravel().tolist(),
                    "formulas": formulas,
                }
            )
            # Who types more than a full turn may have meant degrees.
            if note is None and kind == "turn" and abs(amount) > math.tau:
                degrees = f"{amount:.4g} rad are {np.degrees(amount):.4g}°"
                note = f"step {k}: {degrees}; degrees are written 90*deg or 90°"
        vertices = self.solid.vertices[:LISTED_VERTICES] @ T[:3, :3].T + T[:3, 3]
        return {"steps": results, "vertices": vertices.tolist(), "note": note}

    def publish(self) -> None:
        """Send the solid to the pages."""
        solid = self.solid
        state = {
            "name": solid.name,
            "unit": solid.unit,
            "vertices": np.round(solid.vertices, 9).tolist(),
            "faces": solid.faces.tolist(),
            "listed": min(LISTED_VERTICES, len(solid.vertices)),
        }
        self.desk.view.panel("solid", state)


def _amount(step: Fields) -> float:
    """Return the amount of a step, rad or m, which is an expression."""
    try:
        value = float(quantity("amount", plain_expression(step.text("amount").strip()), {}))
    except (DhkitError, ValueError) as error:
        raise ValueError(f"{step.request}: {error}") from None
    if not abs(value) <= MAX_AMOUNT:
        raise ValueError(f"{step.request}: amount is beyond {MAX_AMOUNT:g}")
    return value


def _formulas(k: int, kind: str, axis: str, amount: float, about: str) -> tuple[str, str]:
    """Return the pose after step k, and its effect on points in the world, as LaTeX."""
    size = (
        f"{np.degrees(amount):.4g}^{{\\circ}}" if kind == "turn" else rf"{amount:.4g}\,\mathrm{{m}}"
    )
    E = f"{'R' if kind == 'turn' else 'D'}_{{{axis}}}({size})"
    if about == "fixed":
        return f"T_{{{k}}} = {E} T_{{{k - 1}}}", f"p' = {E} p"
    return f"T_{{{k}}} = T_{{{k - 1}}} {E}", f"p' = T_{{{k - 1}}} {E} T_{{{k - 1}}}^{{-1}} p"
