"""Bodies of imported links: from density and shape, from a stated mass and shape, or from a CAD program's report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array
from dhkit.errors import ModelError
from dhkit.model.cad_files import link_number
from dhkit.model.mass_report import ReportedMass, read_mass_report
from dhkit.model.shape_inertia import MassProperties, shape_inertia
from dhkit.model.triangle_mesh import TriangleMesh, common_bounds

_MESH_DIGITS = 11
"""Significant digits of mass properties from a mesh: text files have coordinates of up to nine."""
_MESH_NOISE = 3e-10
"""Coordinates and products below this share of a link's size and moments are rounding of the mesh's coordinates."""
_MOMENT_TOLERANCE = 0.01
"""Share by which reported moments may exceed the possible ones: reports are rounded."""
_USUAL_DENSITIES = (20.0, 25_000.0)
"""kg/m^3: foam, and platinum metals; a density outside is probably in another unit."""
_COM_TOLERANCE = 0.1
"""Distance of a reported centre of mass outside its link's box without a warning, as a share of the link's size."""


@dataclass(frozen=True, eq=False)
class LinkBody:
    """A link's mass properties in its DH frame, SI, with notes on their source."""

    properties: MassProperties
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class StatedMasses:
    """The user's statements about masses: a density for all links, masses of some links, reports of some.

    A report takes precedence over a mass, a mass over the density; a link may not have both a mass and a report.
    """

    density: float | None
    """Density of all parts, kg/m^3; None if it is not stated."""
    masses: Mapping[int, float]
    """Masses by link, kg."""
    reports: Mapping[int, ReportedMass]
    """Mass properties by link, in assembly coordinates, SI."""

    @classmethod
    def of(
        cls,
        links: int,
        density: float | None,
        masses: Mapping[int, float] | None,
        reports: Sequence[Path],
    ) -> StatedMasses:
        """Read reports, and check everything against the number of joints.

        Raises
        ------
        ModelError
            A number that is not positive, a link that does not exist, stated twice, or a report of no known link.
        """
        masses = dict(masses or {})
        for what, value in (
            ("density", density),
            *((f"mass of link {i}", mass) for i, mass in masses.items()),
        ):
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ModelError(f"{what} is {value:g}; expected a positive number")
        reported: dict[int, ReportedMass] = {}
        for part in chain.from_iterable(map(read_mass_report, reports)):
            number = link_number(part.part)
            if number is None:
                raise ModelError(
                    f"{part.source}: part {part.part[:60]!r} has no link number; expected such as link3"
                )
            if number in reported:
                raise ModelError(
                    f"{part.source}: link {number} is reported twice, in {reported[number].source} too"
                )
            reported[number] = part
        for number in (*masses, *reported):
            if not 0 <= number <= links:
                raise ModelError(f"a mass of link {number}; the table has links 0 to {links}")
        if both := sorted(set(masses) & set(reported)):
            raise ModelError(
                f"link {both[0]} has a stated mass and the report {reported[both[0]].source}; expected one of them"
            )
        return cls(density, masses, reported)

    @property
    def notes(self) -> tuple[str, ...]:
        """A warning about a density that no material of arms has."""
        if self.density is None or _USUAL_DENSITIES[0] <= self.density <= _USUAL_DENSITIES[1]:
            return ()
        hint = (
            "g/cm^3 meant? then times 1000"
            if self.density < _USUAL_DENSITIES[0]
            else "steel has 7850"
        )
        return (f"warning: the density is {self.density:g} kg/m^3; {hint}",)

    def body(
        self, link: int, meshes: Sequence[TriangleMesh], T_frame_world: Array
    ) -> LinkBody | None:
        """Return the body of a link, None if nothing is stated about it.

        Parameters
        ----------
        link
            Its number.
        meshes
            In the link's DH frame, m; several are one body.
        T_frame_world
            Assembly coordinates to the link's DH frame, shape (4, 4), m.

        Raises
        ------
        ModelError
            A mesh without volume; names the link.
        """
        if link in self.reports:
            return _reported_body(self.reports[link], meshes, T_frame_world)
        stated = self.masses.get(link)
        if stated is None and self.density is None:
            return None
        try:
            unit_body = shape_inertia(meshes, density=1.0)
        except ModelError as error:
            raise ModelError(f"link {link}: {error}") from None
        density = stated / unit_body.volume if stated is not None else self.density
        if density is None:
            raise ModelError(f"link {link}: neither a density nor a mass")
        size = max(mesh.size for mesh in meshes)
        properties = MassProperties(
            density * unit_body.mass, unit_body.com, density * unit_body.inertia
        )
        basis = f"{density:.6g} kg/m^3" if stated is None else f"{stated:.6g} kg"
        notes = (f"body from {unit_body.method.value} and {basis}", *unit_body.notes)
        return LinkBody(_to_mesh_accuracy(properties, size), notes)


def _reported_body(
    report: ReportedMass, meshes: Sequence[TriangleMesh], T_frame_world: Array
) -> LinkBody:
    """Return the body of a report in a link's DH frame, with warnings about unlikely numbers."""
    body = report.properties.moved(T_frame_world)
    notes = [f"body from the report of {report.part[:60]!r}, {report.source}", *report.notes]

    # I_1 + I_2 - I_3 = 2 integral of x_3^2 dm >= 0 in principal axes.
    moments = np.linalg.eigvalsh(body.inertia)
    if moments[0] + moments[1] < (1 - _MOMENT_TOLERANCE) * moments[2]:
        listed = ", ".join(f"{moment:.3g}" for moment in moments)
        notes.append(
            f"warning: no body has its principal moments {listed} kg m^2: one is larger than the sum of the others"
        )
    if meshes:
        low, high = common_bounds(meshes)
        extent = high - low
        # Points within an extent of s have a variance of s^2/4 at most (Popoviciu 1935).
        largest = body.mass * float(extent @ extent) / 4
        if moments[2] > (1 + _MOMENT_TOLERANCE) * largest:
            notes.append(
                f"warning: its largest moment is {moments[2]:.3g} kg m^2, a body of its mass within the link's box has "
                f"{largest:.3g} at most; are the units of the report right?"
            )
        distance = np.linalg.norm(np.maximum(np.maximum(low - body.com, body.com - high), 0))
        if distance > _COM_TOLERANCE * np.linalg.norm(extent):
            notes.append(
                f"warning: its centre of mass lies {distance:.3g} m outside the link; was the report "
                "made in the coordinates of the assembly?"
            )
    return LinkBody(body, tuple(notes))


def _to_mesh_accuracy(body: MassProperties, size: float) -> MassProperties:
    """Return mass properties rounded to what the coordinates of a mesh can tell; ``size`` is the link's, m.

    People read the file; and equations lose the terms that only rounding had made.
    """
    com = np.where(np.abs(body.com) < _MESH_NOISE * size, 0.0, body.com)
    trace = float(np.trace(body.inertia))
    is_noise = (np.abs(body.inertia) < _MESH_NOISE * trace) & ~np.eye(3, dtype=bool)
    inertia = np.where(is_noise, 0.0, body.inertia)
    return MassProperties(
        _rounded(body.mass, body.mass).item(), _rounded(com, size), _rounded(inertia, trace)
    )


def _rounded(values: ArrayLike, largest: float) -> Array:
    """Return values rounded at the last significant digit of the largest; 0 without a sign."""
    decimals = _MESH_DIGITS - 1 - math.floor(math.log10(largest))
    return np.round(np.asarray(values, dtype=float), decimals) + 0.0
