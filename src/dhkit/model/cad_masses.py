"""Bodies of imported links: from density and shape, from a stated mass and shape, or from a CAD program's report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dhkit.description import Array
from dhkit.errors import ModelError
from dhkit.model.cad_files import link_number
from dhkit.model.mass_report import ReportedMass, read_mass_report
from dhkit.model.shape_inertia import MassProperties, shape_inertia
from dhkit.model.triangle_mesh import TriangleMesh

ROUNDING = 1e-13
"""Coordinates and products below this share of a link's size and moments are 0: integrals are exact to some 1e-15."""
IMPOSSIBLE = 0.01
"""How far moments may be beyond what is possible, as a share: reports are rounded."""
USUAL = (20.0, 25_000.0)
"""kg/m^3: foam, and platinum metals; a density beyond is probably in another unit."""
OUTSIDE = 0.1
"""How far a reported centre of mass may lie outside the box around its link, as a share of the link's size."""


@dataclass(frozen=True, eq=False)
class LinkBody:
    """A link's mass properties in its DH frame, SI, and what they rest on."""

    properties: MassProperties
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class StatedMasses:
    """What the user states about masses: a density for all links, masses of some, reports of some.

    A report goes before a mass, and a mass before the density; a link may not have both a mass and a report.
    """

    density: float | None
    """kg/m^3."""
    masses: Mapping[int, float]
    """kg, by link."""
    reports: Mapping[int, ReportedMass]
    """By link, in assembly coordinates."""

    @classmethod
    def of(
        cls, links: int, density: float | None, masses: Mapping[int, float] | None, reports: Sequence[Path]
    ) -> StatedMasses:
        """Read reports, and check everything against the number of joints.

        Raises
        ------
        ModelError
            A number that is not positive, a link that is none, stated twice, or a report of no known link.
        """
        masses = dict(masses or {})
        for what, value in (("density", density), *((f"mass of link {i}", mass) for i, mass in masses.items())):
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ModelError(f"{what} is {value:g}; expected a positive number")
        found: dict[int, ReportedMass] = {}
        for path in reports:
            parts = read_mass_report(path)
            for part in parts:
                number = link_number(part.part)
                if number is None:
                    raise ModelError(
                        f"{part.source}: part {part.part[:60]!r} has no link number; expected such as link3"
                    )
                if number in found:
                    raise ModelError(f"{part.source}: link {number} is reported twice, in {found[number].source} too")
                found[number] = part
        for number in (*masses, *found):
            if not 0 <= number <= links:
                raise ModelError(f"a mass of link {number}; the table has links 0 to {links}")
        if both := sorted(set(masses) & set(found)):
            raise ModelError(
                f"link {both[0]} has a stated mass and the report {found[both[0]].source}; expected one of them"
            )
        return cls(density, masses, found)

    @property
    def notes(self) -> tuple[str, ...]:
        """A warning about a density that no material of arms has."""
        if self.density is None or USUAL[0] <= self.density <= USUAL[1]:
            return ()
        hint = "g/cm^3 meant? then times 1000" if self.density < USUAL[0] else "steel has 7850"
        return (f"warning: the density is {self.density:g} kg/m^3; {hint}",)

    def body(self, link: int, meshes: Sequence[TriangleMesh], T_frame_world: Array) -> LinkBody | None:
        """Return the body of a link, None where nothing is stated about it.

        Parameters
        ----------
        link
            Its number.
        meshes
            In the link's DH frame, m; several are one body.
        T_frame_world
            Assembly coordinates to the link's DH frame, shape (4, 4).

        Raises
        ------
        ModelError
            A mesh without volume; names the link.
        """
        if link in self.reports:
            return self._reported(self.reports[link], meshes, T_frame_world)
        if link not in self.masses and self.density is None:
            return None
        try:
            one = shape_inertia(meshes, density=1.0)
        except ModelError as error:
            raise ModelError(f"link {link}: {error}") from None
        stated = self.masses.get(link)
        density = self.density if stated is None else stated / one.volume
        if density is None:
            raise ModelError(f"link {link}: neither a density nor a mass")
        size = max(mesh.size for mesh in meshes)
        properties = _without_rounding(MassProperties(density * one.mass, one.com, density * one.inertia), size)
        basis = f"{density:.6g} kg/m^3" if stated is None else f"{stated:.6g} kg"
        return LinkBody(properties, (f"body from {one.method.value} and {basis}", *one.notes))

    @staticmethod
    def _reported(report: ReportedMass, meshes: Sequence[TriangleMesh], T_frame_world: Array) -> LinkBody:
        properties = report.properties.moved(T_frame_world)
        notes = [f"body from the report of {report.part[:60]!r}, {report.source}", *report.notes]
        notes += _impossible(properties, meshes)
        if meshes:
            low = np.min([mesh.bounds[0] for mesh in meshes], axis=0)
            high = np.max([mesh.bounds[1] for mesh in meshes], axis=0)
            beyond = np.maximum(np.maximum(low - properties.com, properties.com - high), 0)
            if np.linalg.norm(beyond) > OUTSIDE * np.linalg.norm(high - low):
                notes.append(
                    f"warning: its centre of mass lies {np.linalg.norm(beyond):.3g} m outside the link; was the report "
                    "made in the coordinates of the assembly?"
                )
        return LinkBody(properties, tuple(notes))


def _impossible(body: MassProperties, meshes: Sequence[TriangleMesh]) -> list[str]:
    """Return warnings about moments that no body has, or none that fits into the box around the link."""
    moments, notes = np.linalg.eigvalsh(body.inertia), []
    if moments[0] + moments[1] < (1 - IMPOSSIBLE) * moments[2]:
        listed = ", ".join(f"{moment:.3g}" for moment in moments)
        notes.append(
            f"warning: no body has its principal moments {listed} kg m^2: one is larger than the sum of the others"
        )
    if meshes:
        # Points within an extent of s have a variance of s^2/4 at most (Popoviciu 1935).
        extent = np.ptp(np.concatenate([mesh.bounds for mesh in meshes]), axis=0)
        most = body.mass * float(extent @ extent) / 4
        if moments[2] > (1 + IMPOSSIBLE) * most:
            notes.append(
                f"warning: its largest moment is {moments[2]:.3g} kg m^2, a body of its mass within the link's box has "
                f"{most:.3g} at most; are the units of the report right?"
            )
    return notes


def _without_rounding(body: MassProperties, size: float) -> MassProperties:
    """Return mass properties with 0 for coordinates and products that are rounding alone: people read the file."""
    com = np.where(np.abs(body.com) < ROUNDING * size, 0.0, body.com)
    products = (np.abs(body.inertia) < ROUNDING * np.trace(body.inertia)) & ~np.eye(3, dtype=bool)
    return MassProperties(body.mass, com, np.where(products, 0.0, body.inertia))
