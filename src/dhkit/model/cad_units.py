"""What coordinates of a CAD export mean: their unit, found by size, and whether each part was moved on export."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from dhkit.description import Array, Description
from dhkit.description.frames import carrying
from dhkit.errors import ModelError
from dhkit.model.triangle_mesh import TriangleMesh

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254}
SMALLEST, LARGEST = 0.25, 6.0
"""Diagonal of the box around an arm in its READY pose, as a share of its length, the sum of |a| and |d|."""
AT_ORIGIN = 1e-5
"""Distance from the origin to the corner of a part that was moved there, share of its size: texts have six digits."""
NEAR = 0.05
"""How far the axes of the joints pass the boxes around their links, on average, as a share of the arm's length."""
CLEARER = 2.0
"""The second best unit must miss the axes by this factor more."""
WIDEST = (0.05, 40.0)
"""Sizes as for SMALLEST and LARGEST, of a small arm on a large base too, at which the axes can speak for a unit."""
FAR = 0.1
"""How far a joint's axis may pass the box around a link of it without a warning, as a share of the arm's length."""
FEWEST_AXES = 2
"""Joints from which on axes decide: one axis through the origin passes a part of any size."""
AXIS_POINTS = 401


def check_positions(parts: Mapping[str, TriangleMesh], where: str) -> None:
    """Refuse parts that were each moved into positive space, so that their places in the assembly are lost.

    Raises
    ------
    ModelError
        All parts but one, and two at least, have their own lowest corner at the origin.
    """
    moved = [name for name, part in parts.items() if np.abs(part.bounds[0]).max() <= AT_ORIGIN * part.size]
    if len(moved) >= max(2, len(parts) - 1):
        raise ModelError(
            f"{where}: {len(moved)} of {len(parts)} parts have their own corner at the origin: each was moved into "
            "positive space on export, so that their places in the assembly are lost; export again with the box 'Do "
            "not translate STL output data to positive space' ticked (SolidWorks: Save As, STL, Options)"
        )


def unit_of(description: Description, frames: Array, links: Mapping[int, Sequence[TriangleMesh]], where: str) -> str:
    """Return the unit of an assembly's coordinates: m, cm, mm or in.

    The assembly must be about as large as the arm. Where two units pass, which only cm and in and their neighbours
    can, the boxes around the links decide: the axis of each joint passes those of the two links that it joins.

    Parameters
    ----------
    description
        The arm.
    frames
        DH frames 0 to n in the world in the pose of the export, shape (n + 1, 4, 4).
    links
        Meshes of each link in assembly coordinates.
    where
        Folder, for messages.

    Raises
    ------
    ModelError
        No unit fits, or more than one; names the option that states it.
    """
    length, size = arm_length(description, frames), size_of(links)
    if length == 0:
        raise ModelError(f"{where}: the table has no lengths to compare with; state the unit, such as --unit mm")
    fitting = [unit for unit, metres in UNITS.items() if SMALLEST <= size * metres / length <= LARGEST]
    found = f"the assembly is {size:.4g} across, the arm of the table {length:.4g} m long"
    if len(fitting) == 1:
        _check_others(description, frames, links, fitting[0], f"{where}: {found}")
        return fitting[0]
    if not fitting:
        raise ModelError(f"{where}: {found}: no unit of {', '.join(UNITS)} fits; is it the same arm? else state --unit")
    missed = {unit: _missed(description, frames, links, UNITS[unit]) / length for unit in fitting}
    best, second = sorted(missed, key=missed.__getitem__)[:2]
    if missed[best] > NEAR:
        raise ModelError(
            f"{where}: {found}: {' and '.join(fitting)} fit, but in all of them the parts lie beside the joints' axes; "
            "is the pose of the export the table's? else state the unit, such as --unit mm"
        )
    if description.n < FEWEST_AXES or missed[second] < CLEARER * missed[best] + NEAR / 5:
        raise ModelError(f"{where}: {found}: {' and '.join(fitting)} fit; state the unit, such as --unit {best}")
    return best


def _check_others(
    description: Description, frames: Array, links: Mapping[int, Sequence[TriangleMesh]], unit: str, found: str
) -> None:
    """Refuse the only unit that fits by size where the parts lie beside the axes in it, and not in another one.

    So it is with a small arm on a large base, or with a large tool, which is taken for a large arm in a smaller unit.
    """
    length, size = arm_length(description, frames), size_of(links)
    if description.n < FEWEST_AXES or _missed(description, frames, links, UNITS[unit]) <= NEAR * length:
        return
    possible = [u for u in UNITS if u != unit and WIDEST[0] <= size * UNITS[u] / length <= WIDEST[1]]
    others = [u for u in possible if _missed(description, frames, links, UNITS[u]) <= NEAR * length]
    if others:
        raise ModelError(
            f"{found}: {unit} fits by size, but in it the parts lie beside the joints' axes, and in "
            f"{' and '.join(others)} they do not; state the unit, such as --unit {others[0]}"
        )


def arm_length(description: Description, frames: Array) -> float:
    """Return the length of an arm in a pose, m; a sliding joint without limits may stand far beyond the reach."""
    return max(description.reach, float(np.linalg.norm(np.diff(frames[:, :3, 3], axis=0), axis=1).sum()))


def size_of(links: Mapping[int, Sequence[TriangleMesh]]) -> float:
    """Return the diagonal of the box around all meshes, in their unit."""
    bounds = np.array([mesh.bounds for meshes in links.values() for mesh in meshes])
    return float(np.linalg.norm(bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)))


def check_size(description: Description, frames: Array, links: Mapping[int, Sequence[TriangleMesh]], where: str) -> str:
    """Return the sizes of an assembly whose files state their unit, meshes in m, and of the arm, in words.

    Raises
    ------
    ModelError
        The assembly is far smaller or larger than the arm; names the option that states the unit.
    """
    length, size = arm_length(description, frames), size_of(links)
    if length and not SMALLEST <= size / length <= LARGEST:
        raise ModelError(
            f"{where}: by the unit that the files state the assembly is {size:.4g} m across, the arm of the table "
            f"{length:.4g} m long; is it the same arm? else state the unit of all files, such as --unit mm"
        )
    return f"the assembly is {size:.4g} m across, the arm {length:.4g} m long"


def far_from_axes(
    description: Description, frames: Array, links: Mapping[int, Sequence[TriangleMesh]]
) -> tuple[str, ...]:
    """Return a warning for each link whose parts lie far from the axis of a joint that it is joined by.

    So a part in a wrong place shows: a pose that is not that of the export, another origin, or a CAD program that has
    lost a placement.

    Parameters
    ----------
    description, frames
        As for :func:`unit_of`.
    links
        Meshes of each link in the world, m.
    """
    allowed = FAR * description.reach
    missed = {key: miss for key, miss in _misses(description, frames, links, 1.0).items() if miss > allowed}
    return tuple(
        f"warning: link {link}: its part lies {miss:.3g} m beside the axis of joint {joint}; is the pose of the export "
        "the table's, the assembly's origin frame 0, and the unit right?"
        for (joint, link), miss in missed.items()
    )


def _missed(
    description: Description, frames: Array, links: Mapping[int, Sequence[TriangleMesh]], metres: float
) -> float:
    """Return how far the joints' axes pass the boxes around the links that they join, on average, m."""
    missed = _misses(description, frames, links, metres)
    return float(np.mean(list(missed.values()))) if missed else np.inf


def _misses(
    description: Description, frames: Array, links: Mapping[int, Sequence[TriangleMesh]], metres: float
) -> dict[tuple[int, int], float]:
    """Return how far each joint's axis passes the box around each of its two links, m, by joint and link."""
    along = np.linspace(-2, 2, AXIS_POINTS) * description.reach
    missed = {}
    for joint, frame in enumerate(carrying(description.convention, frames), start=1):
        points = frame[:3, 3] + along[:, None] * frame[:3, 2]
        for link in (joint - 1, joint):
            if meshes := links.get(link):
                low = metres * np.min([mesh.bounds[0] for mesh in meshes], axis=0)
                high = metres * np.max([mesh.bounds[1] for mesh in meshes], axis=0)
                outside = np.maximum(np.maximum(low - points, points - high), 0)
                missed[joint, link] = float(np.linalg.norm(outside, axis=1).min())
    return missed
