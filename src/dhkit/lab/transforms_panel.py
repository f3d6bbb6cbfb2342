"""The panel of transforms: a solid that is turned and moved step by step, about its own axes or those of the world."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.description.table_rows import quantity
from dhkit.errors import DhkitError, ModelError
from dhkit.grading.reports.mathml import mathml
from dhkit.lab.desk import Desk
from dhkit.lab.fields import Fields
from dhkit.lab.table_panel import moved, turned, typed
from dhkit.model.mesh_reader import read_mesh

EDGES = (0.36, 0.24, 0.12)
"""Of the box that is shown where no file is given, shares of the arm's reach."""
MOST_BYTES, MOST_TRIANGLES = 5_000_000, 5_000
"""Of a solid's file: the page gets it as text."""
MOST_STEPS = 30
LISTED = 24
"""Vertices whose coordinates are listed, and whose numbers are drawn."""
TURN = 2 * np.pi
"""rad: who turns further has perhaps meant degrees."""
LARGEST = 1e4
"""rad or m of a step."""


@dataclass(frozen=True, eq=False)
class Solid:
    """Triangles between numbered vertices."""

    name: str
    vertices: Array
    """Shape (k, 3), m."""
    faces: NDArray[np.intp]
    """Vertices of each triangle, from 0, shape (m, 3)."""

    @classmethod
    def box(cls, edges: tuple[float, float, float]) -> Solid:
        """Return a box with one corner at the origin, its vertices those below before those above."""
        x, y, z = edges
        bottom = [(0.0, 0.0), (x, 0.0), (x, y), (0.0, y)]
        vertices = np.array([(a, b, height) for height in (0.0, z) for a, b in bottom])
        sides = [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
        quads = [(0, 3, 2, 1), (4, 5, 6, 7), *sides]
        faces = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
        return cls("box", vertices, np.array(faces))

    @classmethod
    def read(cls, path: Path) -> Solid:
        """Read an STL file; its equal vertices become one.

        Raises
        ------
        ModelError
            No such file, too large, no STL, without triangles, or with numbers that are not finite.
        """
        if path.suffix.lower() != ".stl":
            raise ModelError(f"{path}: ends in {path.suffix!r}; expected .stl")
        try:
            size = path.stat().st_size
        except OSError as error:
            raise ModelError(f"{path}: {error.strerror}") from None
        if size > MOST_BYTES:
            raise ModelError(f"{path}: {size} bytes; expected a file of at most {MOST_BYTES}")
        corners = read_mesh(path, max_triangles=MOST_TRIANGLES, max_bytes=MOST_BYTES).corners
        vertices, faces = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        return cls(path.stem, vertices, faces.reshape(-1, 3))


class TransformsPanel:
    """Requests ``transforms.…``."""

    def __init__(self, desk: Desk, solid: Solid | None = None) -> None:
        self.desk = desk
        reach = desk.arm.description.reach or 1.0
        x, y, z = (float(f"{edge * reach:.2g}") for edge in EDGES)
        self.solid = solid or Solid.box((x, y, z))

    def apply(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return the poses of the solid after each step, their formulas, and the vertices after the last."""
        steps = Fields("transforms.apply", data, ["steps"]).data.get("steps")
        if not isinstance(steps, list) or len(steps) > MOST_STEPS:
            raise ValueError(f"transforms.apply: expected a list of at most {MOST_STEPS} steps")
        T = np.eye(4)
        told: list[dict[str, Any]] = []
        for k, step in enumerate(steps, start=1):
            where = f"transforms.apply: step {k}"
            if not isinstance(step, dict):
                raise ValueError(f"{where}: expected kind, axis, amount and about")
            fields = Fields(where, step, ["kind", "axis", "amount", "about"])
            kind, axis = fields.choice("kind", ("turn", "move")), fields.choice("axis", ("x", "y", "z"))
            about = fields.choice("about", ("current", "fixed"))
            amount = _amount(where, fields.text("amount"))
            E = (turned if kind == "turn" else moved)("xyz".index(axis), amount)
            T = T @ E if about == "current" else E @ T
            formulas = [mathml(latex) for latex in _formulas(k, kind, axis, amount, about)]
            told.append({"amount": amount, "E": E.ravel().tolist(), "T": T.ravel().tolist(), "formulas": formulas})
        corners = self.solid.vertices[:LISTED] @ T[:3, :3].T + T[:3, 3]
        turns = [step["amount"] if steps[k]["kind"] == "turn" else 0.0 for k, step in enumerate(told)]
        far = next((k for k, amount in enumerate(turns, start=1) if abs(amount) > TURN), None)
        note = None
        if far is not None:
            amount = told[far - 1]["amount"]
            note = f"step {far}: {amount:.4g} rad are {np.degrees(amount):.4g}°; degrees are written 90*deg or 90°"
        return {"steps": told, "vertices": corners.tolist(), "note": note}

    def publish(self) -> None:
        """Tell the pages the solid."""
        solid = self.solid
        self.desk.view.panel(
            "solid",
            {
                "name": solid.name,
                "vertices": np.round(solid.vertices, 9).tolist(),
                "faces": solid.faces.tolist(),
                "listed": min(LISTED, len(solid.vertices)),
            },
        )


def _amount(where: str, text: str) -> float:
    try:
        value = float(quantity("amount", typed(text.strip()), {}))
    except (DhkitError, ValueError) as error:
        raise ValueError(f"{where}: {error}") from None
    if not abs(value) <= LARGEST:
        raise ValueError(f"{where}: amount is beyond {LARGEST:g}")
    return value


def _formulas(k: int, kind: str, axis: str, amount: float, about: str) -> tuple[str, str]:
    """Return the pose after step k, and what the step does to points in the world, as LaTeX."""
    size = f"{np.degrees(amount):.4g}^{{\\circ}}" if kind == "turn" else rf"{amount:.4g}\,\mathrm{{m}}"
    E = f"{'R' if kind == 'turn' else 'D'}_{{{axis}}}({size})"
    if about == "fixed":
        return f"T_{{{k}}} = {E} T_{{{k - 1}}}", f"p' = {E} p"
    return f"T_{{{k}}} = T_{{{k - 1}}} {E}", f"p' = T_{{{k - 1}}} {E} T_{{{k - 1}}}^{{-1}} p"
