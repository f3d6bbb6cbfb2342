"""Make the STL files that docs/cad.md imports: a small arm's parts, as a CAD program exports its assembly.

python docs/examples/cad_arm.py FOLDER
"""

import sys
from pathlib import Path

import numpy as np
import trimesh

from dhkit.description import read_robot, world_to_frames
from dhkit.model.stl import ascii_stl

TABLE = Path(__file__).with_name("cad_arm.toml")
MM = 1000.0


def box(size, centre):
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(centre))


def drum(radius, length, centre, axis="z"):
    turn = {"z": np.eye(4), "y": trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0))}[
        axis
    ]
    cylinder = trimesh.creation.cylinder(radius, length, sections=64)
    return cylinder.apply_transform(trimesh.transformations.translation_matrix(centre) @ turn)


def parts():
    """Return each link's solid in its DH frame, m."""
    return {
        "base": [drum(0.08, 0.02, (0, 0, 0.01)), drum(0.045, 0.12, (0, 0, 0.08))],
        "link1": [drum(0.04, 0.04, (0, -0.04, 0), axis="y"), drum(0.03, 0.06, (0, 0, 0))],
        "link2": [box((0.25, 0.05, 0.03), (-0.125, 0, -0.05)), drum(0.03, 0.04, (0, 0, -0.015))],
        "link3": [box((0.18, 0.04, 0.02), (-0.09, 0, 0.02))],
    }


def main(folder):
    arm = read_robot(TABLE)
    frames = world_to_frames(arm, arm.numbers.configurations["ready"])
    folder.mkdir(parents=True, exist_ok=True)
    for (name, solids), frame in zip(parts().items(), frames, strict=True):
        # One surface: where two solids overlapped, their mass would count twice.
        solid = trimesh.boolean.union(solids).apply_transform(frame)
        path = folder / f"arm assembly - {name}-1.STL"
        path.write_text(ascii_stl(name, MM * np.asarray(solid.triangles)))
        sys.stdout.write(f"wrote {path}\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
