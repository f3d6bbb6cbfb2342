"""Coordinates of a CAD export: their unit, chosen by size, and whether each part was moved on export."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from dhkit.description import Array, Description
from dhkit.description.frames import carrying
from dhkit.errors import ModelError
from dhkit.model.triangle_mesh import TriangleMesh, common_bounds

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254}
"""Length units by name, m."""
_SIZE_RANGE = (0.25, 6.0)
"""Smallest and largest plausible size of an assembly, as a share of the arm's length.

The size is the diagonal of the box around the assembly in the pose of the export; the length sums |a| and |d|."""
_WIDE_SIZE_RANGE = (0.05, 40.0)
"""Sizes, likewise, of a small arm on a large base, at which the joints' axes can still decide for a unit."""
_CORNER_TOLERANCE = 1e-5
"""Distance of a part's lowest corner from the origin, as a share of its size, if it was moved there on export.

Text files have six digits."""
_MAX_MEAN_AXIS_DISTANCE = 0.05
"""Largest mean distance of the axes from their links' boxes in the right unit, as a share of the arm's length."""
_MIN_DISTANCE_RATIO = 2.0
"""Least ratio of the mean distances of axes from boxes in the second best unit and in the best one."""
_MAX_AXIS_DISTANCE = 0.1
"""Largest distance of an axis from a link's box without a warning, as a share of the arm's length."""
_MIN_DECISIVE_AXES = 2
"""Joints that are needed to decide by axes: one axis through the origin passes through a part of any size."""
_AXIS_POINTS = 401
"""Number of points of an axis whose distances from a box are computed."""


@dataclass(frozen=True, eq=False)
class Assembly:
    """An arm in the pose of the export, and the meshes of its links in assembly coordinates.

    Attributes
    ----------
    description
        The arm.
    frames
        DH frames 0 to n in the world, shape (n + 1, 4, 4), m.
    meshes
        Meshes of each link, all in one unit.
    where
        Folder, for messages.
    """

    description: Description
    frames: Array
    meshes: Mapping[int, Sequence[TriangleMesh]]
    where: str

    @property
    def arm_length(self) -> float:
        """The arm's length in this pose, m; a prismatic joint without limits may be extended far beyond the reach."""
        steps = np.linalg.norm(np.diff(self.frames[:, :3, 3], axis=0), axis=1)
        return max(self.description.reach, float(steps.sum()))

    @property
    def size(self) -> float:
        """The diagonal of the box around all meshes, in their unit."""
        low, high = common_bounds(chain.from_iterable(self.meshes.values()))
        return float(np.linalg.norm(high - low))

    @property
    def sizes_text(self) -> str:
        """The sizes of assembly and arm, for meshes in m."""
        return f"the assembly is {self.size:.4g} m across, the arm {self.arm_length:.4g} m long"

    def axis_distances(self, metres: float) -> dict[tuple[int, int], float]:
        """Return the distance of each joint's axis from the boxes of its two links, m, by joint and link.

        ``metres`` is the meshes' unit, m.
        """
        along = np.linspace(-2, 2, _AXIS_POINTS) * self.description.reach
        distances = {}
        for joint, frame in enumerate(carrying(self.description.convention, self.frames), start=1):
            points = frame[:3, 3] + along[:, None] * frame[:3, 2]
            for link in (joint - 1, joint):
                if meshes := self.meshes.get(link):
                    low, high = (metres * bound for bound in common_bounds(meshes))
                    # The distance of a point from a box is the length of its part outside: max(low - p, p - high, 0).
                    outside = np.maximum(np.maximum(low - points, points - high), 0)
                    distances[joint, link] = float(np.linalg.norm(outside, axis=1).min())
        return distances

    def mean_axis_distance(self, metres: float) -> float:
        """Return the mean of :meth:`axis_distances`, m; infinite if there are none."""
        distances = self.axis_distances(metres)
        return float(np.mean(list(distances.values()))) if distances else np.inf


def check_positions(parts: Mapping[str, TriangleMesh], where: str) -> None:
    """Refuse parts that were each moved into positive space, which loses their positions in the assembly.

    Raises
    ------
    ModelError
        All parts but one, and two at least, have their own lowest corner at the origin.
    """
    moved = [
        name
        for name, part in parts.items()
        if np.abs(part.bounds[0]).max() <= _CORNER_TOLERANCE * part.size
    ]
    if len(moved) >= max(2, len(parts) - 1):
        raise ModelError(
            f"{where}: {len(moved)} of {len(parts)} parts have their own corner at the origin: each was moved into "
            "positive space on export, so that their places in the assembly are lost; export again with the box 'Do "
            "not translate STL output data to positive space' ticked (SolidWorks: Save As, STL, Options)"
        )


def unit_of(assembly: Assembly) -> str:
    """Return the unit of an assembly's coordinates: m, cm, mm or in.

    The assembly must be about as large as the arm. If two units pass, which only cm and in and their neighbours
    can, the boxes around the links decide: the axis of each joint passes those of the two links that it joins.

    Raises
    ------
    ModelError
        No unit fits, or more than one; names the option that states it.
    """
    where = assembly.where
    length = assembly.arm_length
    size = assembly.size
    if length == 0:
        raise ModelError(
            f"{where}: the table has no lengths to compare with; state the unit, such as --unit mm"
        )
    fitting = [
        unit
        for unit, metres in UNITS.items()
        if _SIZE_RANGE[0] <= size * metres / length <= _SIZE_RANGE[1]
    ]
    sizes = f"the assembly is {size:.4g} across, the arm of the table {length:.4g} m long"
    if len(fitting) == 1:
        _check_other_units(assembly, fitting[0], f"{where}: {sizes}")
        return fitting[0]
    if not fitting:
        raise ModelError(
            f"{where}: {sizes}: no unit of {', '.join(UNITS)} fits; is it the same arm? else state --unit"
        )
    distances = {unit: assembly.mean_axis_distance(UNITS[unit]) / length for unit in fitting}
    best, second = sorted(distances, key=distances.__getitem__)[:2]
    if distances[best] > _MAX_MEAN_AXIS_DISTANCE:
        raise ModelError(
            f"{where}: {sizes}: {' and '.join(fitting)} fit, but in all of them the parts lie beside the joints' axes; "
            "is the pose of the export the table's? else state the unit, such as --unit mm"
        )
    clear_distance = _MIN_DISTANCE_RATIO * distances[best] + _MAX_MEAN_AXIS_DISTANCE / 5
    if assembly.description.n < _MIN_DECISIVE_AXES or distances[second] < clear_distance:
        raise ModelError(
            f"{where}: {sizes}: {' and '.join(fitting)} fit; state the unit, such as --unit {best}"
        )
    return best


def _check_other_units(assembly: Assembly, unit: str, sizes: str) -> None:
    """Refuse the only unit that fits by size if the parts lie beside the axes in it, and not in another one.

    This happens with a small arm on a large base, or with a large tool: it seems a large arm in a smaller unit.
    """
    length = assembly.arm_length
    size = assembly.size
    allowed = _MAX_MEAN_AXIS_DISTANCE * length
    if (
        assembly.description.n < _MIN_DECISIVE_AXES
        or assembly.mean_axis_distance(UNITS[unit]) <= allowed
    ):
        return
    low, high = _WIDE_SIZE_RANGE
    possible = [
        other for other in UNITS if other != unit and low <= size * UNITS[other] / length <= high
    ]
    others = [other for other in possible if assembly.mean_axis_distance(UNITS[other]) <= allowed]
    if others:
        raise ModelError(
            f"{sizes}: {unit} fits by size, but in it the parts lie beside the joints' axes, and in "
            f"{' and '.join(others)} they do not; state the unit, such as --unit {others[0]}"
        )


def check_size(assembly: Assembly) -> None:
    """Refuse an assembly, meshes in m as their files state, that is far smaller or larger than the arm.

    Raises
    ------
    ModelError
        Names the option that states the unit.
    """
    length = assembly.arm_length
    size = assembly.size
    if length and not _SIZE_RANGE[0] <= size / length <= _SIZE_RANGE[1]:
        raise ModelError(
            f"{assembly.where}: by the unit that the files state the assembly is {size:.4g} m across, the arm of the "
            f"table {length:.4g} m long; is it the same arm? else state the unit of all files, such as --unit mm"
        )


def distant_part_warnings(assembly: Assembly) -> tuple[str, ...]:
    """Return a warning for each link, meshes in m, whose parts lie far from the axis of one of its joints.

    Causes are a pose that is not that of the export, another origin, or a lost placement in the CAD program.
    """
    allowed = _MAX_AXIS_DISTANCE * assembly.description.reach
    return tuple(
        f"warning: link {link}: its part lies {distance:.3g} m beside the axis of joint {joint}; is the pose of the "
        "export the table's, the assembly's origin frame 0, and the unit right?"
        for (joint, link), distance in assembly.axis_distances(1.0).items()
        if distance > allowed
    )
