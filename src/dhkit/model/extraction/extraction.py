"""A chain of a URDF as a description, with notes on the extraction and the residual against the file."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from dhkit.description import Array, Convention, Description, Mesh, Shape
from dhkit.description.assets import inside
from dhkit.description.bounds import BOUNDS as ROBOT_BOUNDS
from dhkit.description.mesh_files import check_mesh_file
from dhkit.description.table import DHTable
from dhkit.description.validation import SHAPE_LEFT_OUT
from dhkit.display import html_block, html_lines, html_table, repr_line
from dhkit.errors import DhkitError, ModelError
from dhkit.model.bounds import BOUNDS
from dhkit.model.extraction.axes import Axes
from dhkit.model.extraction.draft import UNROUNDED, Draft, Rounding, allowed_name
from dhkit.model.extraction.residual import Original, Residual
from dhkit.model.extraction.table import (
    Table,
    chain_axes,
    nearly_parallel,
    tidiest_table,
    with_parallel_axes,
)
from dhkit.model.mesh_paths import MeshFinder
from dhkit.model.urdf_chain import Chain, Side, chain_of, only_tip, read_chain
from dhkit.model.urdf_reader import read_urdf

_DECIMALS = (9, 10, 11, 12, 13)
"""Decimals that numbers are rounded to, the coarsest first."""
_MAX_ROUNDING_ERROR = 5e-10
"""Largest relative difference of M and g from the URDF after rounding: half of the error that is asked of a table."""
_MAX_TOOL_ROUNDING_ERROR = 5e-11
"""The same for the tool's pose, m and rotation entries."""
_MAX_LISTED_MESHES = 5
"""Largest number of omitted meshes that are named one by one."""
_SAME_ERROR = 1.5
"""Factor up to which the errors of two tables count as equal."""
_LENGTH_RESOLUTION = 1e-9
"""Lengths of a table up to this, m, count as 0 where two tables are compared; tables are written to this decimal."""
_ANGLE_RESOLUTION = 1e-12
"""Differences of angles up to this, rad, are those of doubles: a number that differs by more was rounded."""
_MAX_TABLE_ERROR = 1e-6
"""Largest error of a table, as a share of the arm's size: axis tilts below the resolution of doubles give 3e-8."""


@dataclass(frozen=True)
class Extraction:
    """A description taken from a URDF.

    Attributes
    ----------
    description
        The robot: table, base, tool, bodies, limits, friction and shapes. Joint values mean the same as in the URDF.
    residual
        The differences of its tool, M and g from the file's, over random states.
    notes
        Unusual elements of the file and their treatment; also in ``description.notes``.
    changes
        Numbers that ``as_designed`` read differently from how they are written.
    decimals
        Decimals that its numbers are rounded to; None: they are kept as computed.
    turned
        Sum of the angles by which axes were turned to be parallel, rad.
    """

    description: Description
    residual: Residual
    notes: tuple[str, ...]
    changes: tuple[str, ...]
    decimals: int | None
    turned: float = 0.0

    def __repr__(self) -> str:
        text = f"{self.description.kinds}, {self.description.convention.value} DH, off by {self.residual.largest:.1e}"
        return repr_line("Extraction", self.description.name, text)

    def _repr_html_(self) -> str:
        rounding = (
            "as computed" if self.decimals is None else f"rounded to {self.decimals} decimals"
        )
        facts = [("residual", str(self.residual)), ("numbers", rounding)]
        lines = html_lines([*self.changes, *self.notes])
        title = f"{self.description.name} from a URDF"
        return html_block(
            title, html_table((), facts), DHTable.of(self.description)._repr_html_(), lines
        )


def extract_dh(
    path: str | Path,
    base: str | None = None,
    tip: str | None = None,
    *,
    convention: Literal["standard", "modified"] = "standard",
    side: Side = "freeze",
    as_designed: bool = False,
    exact: bool = False,
    package_dirs: Sequence[str | Path] = (),
    name: str | None = None,
) -> Extraction:
    """Return the Denavit-Hartenberg table of a chain of a URDF, with bodies, limits and shapes.

    Neighbouring axes that are parallel to within the rounding of the file's angles (1.5708, for example) are made
    parallel: their common normals would be kilometres away. Notes say which, and what that costs.

    Parameters
    ----------
    path
        The URDF. Its text is never trusted, and no mesh is opened.
    base, tip
        The chain's first and last link: the root, and the end of the only chain, if not given. The base is the world;
        gravity is the root's (0, 0, -9.81) m/s^2 seen from it.
    convention
        Which table.
    side
        Treatment of links that hang on moving joints beside the chain: ``"freeze"`` carries them along with those
        joints at zero, ``"drop"`` leaves them out.
    as_designed
        Read rounded angles such as 1.5708 as the right angles that they stand for; the result lists the changes.
    exact
        Keep the file's axes to the last digit; lengths of the table may then be large.
    package_dirs
        Folders with the packages that ``package://NAME/...`` names.
    name
        The robot's name; the URDF's, with the tip's where it has several chains, if not given.

    Returns
    -------
    Extraction
        The description, its differences from the file in tool, M and g at random states, and notes.

    Raises
    ------
    ModelError
        The file is refused, or has no such chain.

    Examples
    --------
    >>> from dhkit.description import asset
    >>> extraction = extract_dh(asset("urdf/puma560.urdf"))
    >>> extraction.description.n
    6
    """
    known = [value.value for value in Convention]
    if convention not in known:
        raise ModelError(f"convention is {convention!r}; expected one of {', '.join(known)}")
    chain = read_chain(path, base, tip, side=side, as_designed=as_designed)
    # The file as written is checked too: changes must not hide a wrong reading.
    if chain.tree.changes:
        Original(read_chain(path, chain.base, chain.tip, side=side)).check_reading()
    return extracted(
        chain, convention=Convention(convention), exact=exact, package_dirs=package_dirs, name=name
    )


def extracted(
    chain: Chain,
    *,
    convention: Convention = Convention.STANDARD,
    exact: bool = False,
    package_dirs: Sequence[str | Path] = (),
    name: str | None = None,
) -> Extraction:
    """Return the table of a chain of a URDF that was read; see :func:`extract_dh`.

    Raises
    ------
    ModelError
        The chain makes no description.
    """
    if not 1 <= len(chain.joints) <= ROBOT_BOUNDS.joints:
        raise ModelError(
            f"{chain.path}: {len(chain.joints)} joints; expected 1 to {ROBOT_BOUNDS.joints}"
        )
    notes = [*chain.notes]
    original = Original(chain)
    changes = chain.tree.changes
    if not changes:
        original.check_reading()
    meshes = MeshFinder(chain.path, package_dirs)
    draft = Draft(
        chain,
        convention,
        _shapes(chain, meshes, notes),
        meshes.mesh_folder,
        name or _robot_name(chain),
    )
    try:
        table, turned = _best_table(chain, convention, draft, original, notes, exact=exact)
        description, residual, decimals = _rounded(draft, table, original, turned)
    except DhkitError as error:
        raise ModelError(f"{chain.path}: {error}") from None
    if original.model is None:
        notes.append("M and g not compared with the file: Pinocchio is not installed")

    if changes:
        notes.append(
            f"read as designed: {len(changes)} numbers; the file as written differs by {residual}"
        )
    else:
        notes.append(f"differs from the file by {residual}")
        lengths = np.concatenate([description.numbers.a, description.numbers.d])
        if recommendation := _advice_on_rounded_numbers(
            chain, convention, int(np.count_nonzero(lengths))
        ):
            notes.append(recommendation)
    description = replace(description, notes="\n".join(notes)[: BOUNDS.notes_characters])
    return Extraction(description, residual, tuple(notes), changes, decimals, turned)


def _robot_name(chain: Chain) -> str:
    """Return the URDF's name, with the tip's if the file has several chains."""
    name = chain.tree.name or chain.path.stem
    is_only_chain = chain.base == chain.tree.root and chain.tip == only_tip(chain.tree, chain.base)
    return allowed_name(name if is_only_chain else f"{name}_{chain.tip}", "robot")


def _shapes(
    chain: Chain, meshes: MeshFinder, notes: list[str]
) -> tuple[tuple[tuple[Shape, Array], ...], ...]:
    """Return the shapes of each group of links with their poses in the base; unreadable meshes are noted."""
    link_names = itertools.chain.from_iterable(chain.groups)
    has_visuals = any(chain.tree.links[link].visuals for link in link_names)
    left_out: list[str] = []
    groups = []
    for group in chain.groups:
        shapes: list[tuple[Shape, Array]] = []
        for link in group:
            shapes += _link_shapes(chain, link, meshes, left_out, has_visuals)
        if len(shapes) > ROBOT_BOUNDS.shapes:
            notes.append(
                f"link {group[0]!r}: shape {ROBOT_BOUNDS.shapes + 1} of {len(shapes)} and all after it{SHAPE_LEFT_OUT}"
            )
        groups.append(tuple(shapes[: ROBOT_BOUNDS.shapes]))
    notes += left_out[:_MAX_LISTED_MESHES]
    if len(left_out) > _MAX_LISTED_MESHES:
        notes.append(f"{len(left_out) - _MAX_LISTED_MESHES} more meshes, as above{SHAPE_LEFT_OUT}")
    return tuple(groups)


def _link_shapes(
    chain: Chain, name: str, meshes: MeshFinder, left_out: list[str], has_visuals: bool
) -> Iterator[tuple[Shape, Array]]:
    """Yield a link's visual shapes, or its collision shapes if no link has visual ones."""
    link = chain.tree.links[name]
    folder = meshes.mesh_folder
    for shape in link.visuals if has_visuals else link.collisions:
        geometry = shape.geometry
        if isinstance(geometry, Mesh):
            try:
                path = meshes.path(geometry.path)
                inside(folder, path, "shape.mesh")
                check_mesh_file(folder / path)
            except DhkitError as error:
                # Folders are left out of paths: others read the notes of a robot file.
                is_root = folder == folder.parent
                text = (
                    str(error)
                    if is_root
                    else str(error).replace(f"{folder}/", "").replace(str(folder), folder.name)
                )
                left_out.append(f"link {name!r}: {text}{SHAPE_LEFT_OUT}")
                continue
            geometry = replace(geometry, path=path)
        yield Shape(geometry, color=shape.color), chain.zero_poses[name] @ shape.T_link_shape


class _Candidate(NamedTuple):
    """A table that takes some nearly parallel axes as parallel."""

    error: float
    """Largest difference of its tool from the file's, m and entries of the rotation."""
    parallel_below: float
    """Sine of the largest angle between neighbouring axes that it takes as parallel."""
    table: Table


def _best_table(
    chain: Chain,
    convention: Convention,
    draft: Draft,
    original: Original,
    notes: list[str],
    *,
    exact: bool,
) -> tuple[Table, float]:
    """Return the tidiest table, and the sum of the angles by which axes were turned to be parallel, rad.

    Of nearly parallel axes, taken as parallel or as skew, the table nearer to the file is returned; of two that are as
    near, the one with shorter lengths.
    """
    axes = _axes(chain)
    turned = 0.0
    if not exact:
        in_file = axes.directions
        axes, made = with_parallel_axes(axes, _roundings(chain))
        turned = float(np.sum(np.linalg.norm(np.cross(in_file, axes.directions), axis=1)))
        if made:
            table = tidiest_table(axes, convention)
            error = original.residual(draft.description(table, UNROUNDED)).tool
            names = ", ".join(
                f"{one.first} and {one.first + 1} ({one.angle:.1e} rad)" for one in made
            )
            notes.append(
                f"axes that are parallel to within the rounding of the file's angles were made parallel: {names};"
                f" the tool differs by up to {error:.1e} m or rad"
            )
    nearly = nearly_parallel(axes)
    if not nearly:
        return tidiest_table(axes, convention), turned

    # Twice the sine of each nearly parallel pair: that pair, and all that are closer to parallel, are taken as such.
    candidates: list[_Candidate] = []
    for parallel_below in (axes.parallel_below, *(2 * sine for _, sine in nearly)):
        table = tidiest_table(replace(axes, parallel_below=parallel_below), convention)
        error = original.residual(draft.description(table, UNROUNDED)).tool
        candidates.append(_Candidate(error, parallel_below, table))
    same_error = _SAME_ERROR * min(candidate.error for candidate in candidates)

    def preference(candidate: _Candidate) -> tuple[bool, float]:
        """Return the key that sorts the best first: as near as the nearest, by length; then the others, by error."""
        is_as_near = candidate.error <= same_error
        return not is_as_near, _longest(candidate.table) if is_as_near else candidate.error

    best, second, *_ = sorted(candidates, key=preference)
    for i, sine in nearly:
        treatment = "as parallel" if sine <= best.parallel_below else "with their own common normal"
        notes.append(
            f"axes {i} and {i + 1} are {sine:.2g} rad from parallel; taken {treatment}: tool within {best.error:.1e}; "
            f"otherwise {second.error:.1e}"
        )
    return best.table, turned


def _longest(table: Table) -> float:
    """Return the largest of a table's lengths, m."""
    return float(np.abs(table.rows[:, 1:3]).max())


def _advice_on_rounded_numbers(chain: Chain, convention: Convention, lengths: int) -> str | None:
    """Return a recommendation of ``as_designed`` if angles or axes of the chain look rounded; None if none does.

    Parameters
    ----------
    chain
        The chain as it is written.
    convention
        That of the table.
    lengths
        Number of lengths a and d of its table that are not 0.
    """
    tree = read_urdf(chain.path, as_designed=True)
    if not tree.changes:
        return None
    designed_chain = chain_of(tree, chain.base, chain.tip)
    table = tidiest_table(_axes(designed_chain), convention)
    designed = int(np.count_nonzero(np.abs(table.rows[:, 1:3]) > _LENGTH_RESOLUTION))
    if designed >= lengths:
        difference = _largest_difference(chain, designed_chain)
        if difference <= _ANGLE_RESOLUTION:
            return None
        return (
            f"the file's angles look rounded: as_designed=True (--as-designed) reads them as right angles, which turns "
            f"axes and frames by up to {difference:.1g} rad"
        )
    return (
        "as_designed=True (--as-designed) gives a smaller table: "
        f"{designed} lengths a and d that are not 0, not {lengths}"
    )


def _largest_difference(chain: Chain, other: Chain) -> float:
    """Return the largest difference of the rotations and the axes of two readings of one chain, rad to first order."""
    differences = [0.0]
    for joint, twin in zip(chain.joints, other.joints, strict=True):
        differences.append(float(np.abs(joint.axis - twin.axis).max()))
        for link in (joint.child, chain.tip):
            turn = chain.zero_poses[link][:3, :3] - other.zero_poses[link][:3, :3]
            differences.append(float(np.abs(turn).max()))
    return max(differences)


def _axes(chain: Chain) -> Axes:
    """Return the joint axes of a chain in its base, with all joints at zero."""
    poses = np.array([chain.zero_poses[joint.child] for joint in chain.joints])
    directions = np.array(
        [T[:3, :3] @ joint.axis for T, joint in zip(poses, chain.joints, strict=True)]
    )
    return chain_axes(
        poses,
        directions,
        [joint.is_prismatic for joint in chain.joints],
        chain.zero_poses[chain.tip],
    )


def _roundings(chain: Chain) -> list[float]:
    """Return bounds on the rounding error of the angle between each axis of a chain and the next, n - 1 numbers, rad.

    It is the sum of the rounding errors of both axes and of all transforms between them.
    """
    found: list[float] = []
    since_last_axis = 0.0
    for joint in chain.tree.joints_to(chain.tip, chain.base) or ():
        since_last_axis += joint.rounding
        if joint in chain.joints:
            found.append(since_last_axis + joint.axis_rounding)
            since_last_axis = joint.axis_rounding
    return found[1:]


def _rounded(
    draft: Draft, table: Table, original: Original, turned: float
) -> tuple[Description, Residual, int | None]:
    """Return the description with the shortest numbers that keep tool, M and g.

    Axes that were turned by angles with the sum ``turned``, rad, move the tool by as much times the arm's size.
    """
    unrounded = draft.description(table, UNROUNDED)
    error = original.residual(unrounded)
    # A turn about an axis that is off by an angle is off by up to twice the angle, at a lever of up to twice the size.
    allowed = (_MAX_TABLE_ERROR + 4 * turned) * max(original.size, 1.0)
    if not original.chain.tree.changes and error.tool > allowed:
        raise ModelError(
            f"no table within {_MAX_TABLE_ERROR:g} of the file: the tool differs by {error.tool:.2g}"
        )

    # With changes as designed or nearly parallel axes the error may exceed the bounds; rounding may then double it.
    max_tool_error = _MAX_TOOL_ROUNDING_ERROR * min(original.size, 1.0)
    if error.tool > max_tool_error:
        max_tool_error += error.tool
    max_error = _MAX_ROUNDING_ERROR * max(original.size, 1.0)
    if error.largest > max_error:
        max_error += error.largest
    for decimals in _DECIMALS:
        description = draft.description(table, Rounding(decimals))
        residual = original.residual(description)
        if residual.tool <= max_tool_error and residual.largest <= max_error:
            return description, residual, decimals
    return unrounded, error, None
