"""`dhkit workspace`: the workspace of an arm in numbers, as a figure and as a page."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from dhkit.arm import Arm
from dhkit.cli.options import Json, Robot, Seed, load_arm
from dhkit.cli.output import output_folder, print_json, print_table, say, say_written, write_figure
from dhkit.cli.progress import ProgressBar
from dhkit.cli.units import joint_entry
from dhkit.errors import ModelError
from dhkit.kinematics.manipulability import velocity_ellipsoid
from dhkit.kinematics.singularities import Singularities, singularities
from dhkit.kinematics.workspace import Workspace

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
MAX_SAMPLES = 10**12
MAX_POINTS = 12_000
"""Most points on the page: more are slow without a graphics processor."""

app = typer.Typer(rich_markup_mode=None)


def whole_number(text: object) -> int:
    """Return a number of samples: digits, or such as 1e9.

    Raises
    ------
    typer.BadParameter
        Not a whole number from 1 to 10^12.
    """
    try:
        number = Fraction(str(text))
    except (ValueError, ZeroDivisionError):
        number = Fraction(0)
    if number.denominator != 1 or not 1 <= number <= MAX_SAMPLES:
        raise typer.BadParameter(
            f"{text!r} is not a whole number from 1 to {MAX_SAMPLES:.0e}, such as 100000 or 1e9"
        )
    return int(number)


@app.command()
def workspace(
    robot: Robot,
    samples: Annotated[
        int,
        typer.Option(
            parser=whole_number, metavar="NUMBER", help="Number of random states, such as 1e9."
        ),
    ] = 100_000,
    seed: Seed = 0,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder to write; default: out/NAME.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Scheduler of dask whose workers compute: tcp://HOST:PORT; local, or local:4 for four processes here.",
        ),
    ] = None,
    zarr: Annotated[
        Path | None,
        typer.Option(help="Zarr group to write: samples and best manipulability in each cell."),
    ] = None,
    json: Json = False,
) -> None:
    """Show where a robot's tool can be and how well it moves there, in numbers, a figure and a page."""
    from dhkit.scale import connected, save_workspace, workspace as sample
    from dhkit.scale.workspaces import check_zarr_place
    from dhkit.viewer import plot

    arm = load_arm(robot)
    folder = output_folder(output, arm.name)
    if zarr is not None:
        check_zarr_place(zarr)
    with ProgressBar("sampling") as bar:
        if scheduler is None:
            space = arm.workspace(samples, seed, progress=bar.show)
        else:
            with connected(scheduler) as client:
                space = sample(client, arm, samples, seed, progress=bar.show)
    folder.mkdir(parents=True, exist_ok=True)
    files = [
        write_figure(plot(space), folder / "workspace.png"),
        _page(arm, space, folder / "workspace.html"),
    ]
    if zarr is not None:
        files.append(save_workspace(space, zarr))
    if json:
        print_json(_facts(arm, space) | {"files": [str(file) for file in files]})
        return
    _print(arm, space)
    say("")
    say_written(files)


def _print(arm: Arm, space: Workspace) -> None:
    say(f"{arm.name}: what {space.samples} random states reach", "bold")
    for note in space.assumed:
        say(f"assumed: {note}", "yellow")
    rows = [
        ("distance from frame 0 [m]", *space.distances),
        ("distance from axis 1 [m]", *space.radii),
    ]
    rows += [
        (f"{axis} [m]", *span) for axis, span in zip("xyz", space.bounds.T.tolist(), strict=True)
    ]
    say("")
    print_table(
        ("tool", "least", "most"),
        [(name, f"{low + 0.0:.4f}", f"{high + 0.0:.4f}") for name, low, high in rows],
    )
    say(f"\n{_size(space)}")
    shares = ", ".join(
        f"{w:.4g} ({100 * q:.0f} %)" for q, w in zip(QUANTILES, _quantiles(space), strict=True)
    )
    say(f"manipulability (translational, SI): {shares}")
    q = ", ".join(_value(arm, i, x) for i, x in enumerate(space.best))
    place = ", ".join(f"{x + 0.0:.4f}" for x in arm.fk(space.best)[:3, 3])
    say(f"best {space.largest_manipulability:.4g} with the tool at ({place}) m, joints ({q})")
    singular = _singularities(arm)
    if singular is not None:
        say("\nsingular where, limits aside")
        say("\n".join(f"  {line}" for line in str(singular).splitlines()))


def _singularities(arm: Arm) -> Singularities | None:
    """Return the singularities of the arm; None if they are not known in closed form."""
    try:
        return singularities(arm.description)
    except ModelError:
        return None


def _size(space: Workspace) -> str:
    if space.estimate is None or space.grid is None:
        extent = (
            "one point"
            if space.grid is None
            else ("one point", "a curve", "a curved surface")[space.freedoms]
        )
        return f"the tool keeps to {extent}, which has no volume"
    kind = ("length", "area", "volume")[space.estimate.dimension - 1]
    return (
        f"{kind} reached: about {space.estimate}, an estimate by cells of {space.grid.edge:.3g} m"
    )


def _quantiles(space: Workspace) -> list[float]:
    return [space.quantile(share) for share in QUANTILES]


def _value(arm: Arm, i: int, x: float) -> str:
    return f"{x:.4g} m" if arm.description.numbers.prismatic[i] else f"{np.degrees(x):.4g}°"


def _facts(arm: Arm, space: Workspace) -> dict[str, Any]:
    estimate = space.estimate
    singular = _singularities(arm)
    return {
        "robot": arm.name,
        "samples": space.samples,
        "seed": space.seed,
        "assumed": list(space.assumed),
        "reach_m": space.radii[1],
        "length_sum_m": arm.description.reach,
        "distances_m": list(space.distances),
        "radii_m": list(space.radii),
        "bounds_m": space.bounds.tolist(),
        "freedoms": space.freedoms,
        "estimate": None
        if estimate is None
        else vars(estimate) | {"edge_m": space.grid and space.grid.edge},
        "manipulability": {
            f"{q:.0%}": w for q, w in zip(QUANTILES, _quantiles(space), strict=True)
        },
        "best": {
            "manipulability": space.largest_manipulability,
            **joint_entry(arm, "q", space.best),
            "xyz_m": arm.fk(space.best)[:3, 3].tolist(),
        },
        "singularities": None if singular is None else _singular_facts(singular),
    }


def _singular_facts(found: Singularities) -> dict[str, Any]:
    """Return the joint of each kind of singularity, from 1, its singular values, rad or m, and its description."""
    joints = {kind: None if joint is None else joint + 1 for kind, joint in found.joints.items()}
    return {
        kind: {
            "joint": joints[kind],
            "values_rad": list(found.values[kind]),
            "words": found.words[kind],
        }
        for kind in found.kinds
    }


def _page(arm: Arm, space: Workspace, path: Path) -> Path:
    """Write a page with the arm in its first configuration, its ellipsoid there, and points that the tool reaches."""
    from dhkit.viewer import heat_colors
    from dhkit.viewer.scene import first_configuration

    shown = _shown_points(space)
    with arm.view() as view:
        view.points(space.positions[shown], heat_colors(space.manipulability[shown]))
        view.ellipsoid(velocity_ellipsoid(arm.description, first_configuration(arm.description)))
        view.save_html(
            path,
            interactive=True,
            caption="Points that the tool reaches; brighter: it moves more easily there.",
        )
    return path


def _shown_points(space: Workspace) -> NDArray[np.intp]:
    """Return the points to show: of a volume only those with y above frame 0's, behind the arm, to see inside."""
    kept = len(space.positions)
    behind = np.flatnonzero(space.positions[:, 1] >= space.description.numbers.T_world_base[1, 3])
    if space.grid is None or len(space.grid.axes) < 3 or len(behind) < kept / 10:
        return np.arange(min(MAX_POINTS, kept), dtype=np.intp)
    return behind[:MAX_POINTS]
