"""`make assets`: the library's URDFs in urdf/ and the PUMA's meshes in meshes/, generated and checked in."""

import logging
from pathlib import Path

from dhkit.description import library_robot, robots, write_atomically
from dhkit.model.urdf import urdf_text
from tools.puma560_meshes import write_puma560_meshes

log = logging.getLogger(__name__)


def library_urdf(name: str) -> str:
    """Return the text of urdf/NAME.urdf; its meshes are in meshes/ beside urdf/."""
    return urdf_text(library_robot(name), mesh_path=lambda path: f"../meshes/{path}")


def write_assets(root: Path) -> None:
    """Write urdf/ and meshes/ below a folder."""
    meshes = write_puma560_meshes(root / "meshes" / "puma560")
    for name in robots():
        write_atomically(root / "urdf" / f"{name}.urdf", library_urdf(name))
    log.info("wrote %d files below %s", len(meshes) + len(robots()), root)


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    write_assets(Path.cwd())
