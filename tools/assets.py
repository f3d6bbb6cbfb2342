"""`make assets`: what is generated and checked in.

The library's URDFs in urdf/, the PUMA's meshes in meshes/, and in docs/ derivations of inverse kinematics and README's
moving picture.
"""

import logging
from pathlib import Path

from dhkit.arm import Arm
from dhkit.cli.demo_motions import tour
from dhkit.description import library_robot, robots, write_atomically
from dhkit.model.urdf import urdf_text
from dhkit.symbolic import inverse_derivation
from dhkit.viewer.picture_files import write_motion_gif
from tools.puma560_meshes import write_puma560_meshes

log = logging.getLogger(__name__)


def library_urdf(name: str) -> str:
    """Return the text of urdf/NAME.urdf; its meshes are in meshes/ beside urdf/."""
    return urdf_text(library_robot(name), mesh_path=lambda path: f"../meshes/{path}")


GIF_RATE = 10.0
"""Pictures a second, Hz: 400 kB for 12 s."""
WORKED_OUT = ("puma560", "ur5")
"""Robots whose inverse kinematics is worked out in docs/."""


def inverse_page(name: str) -> str:
    """Return the text of docs/ik-NAME.md."""
    derivation = inverse_derivation(library_robot(name))
    return (
        f"# {name}: inverse kinematics worked out\n"
        f"Printed by `dhkit equations {name} --what ik`, with the proof of `derivation.prove()` as its last line; "
        "`make assets` writes this file. "
        "[inverse-kinematics.md](inverse-kinematics.md) says what is proved of it.\n"
        f"```text\n{derivation.text()}\n{derivation.prove()}\n```\n"
    )


def write_assets(root: Path) -> None:
    """Write urdf/, meshes/, docs/ik-NAME.md and docs/puma560.gif below a folder."""
    meshes = write_puma560_meshes(root / "meshes" / "puma560")
    for name in robots():
        write_atomically(root / "urdf" / f"{name}.urdf", library_urdf(name))
    for name in WORKED_OUT:
        write_atomically(root / "docs" / f"ik-{name}.md", inverse_page(name))
    arm = Arm.load("puma560")
    write_motion_gif(arm.description, tour(arm), root / "docs/puma560.gif", rate=GIF_RATE)
    log.info("wrote %d files below %s", len(meshes) + len(robots()), root)


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    write_assets(Path.cwd())
