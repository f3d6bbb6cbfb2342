"""Meshes for tests, made without the code under test: solids by their corners, files by their formats' words."""

import numpy as np

from dhkit.model.triangle_mesh import TriangleMesh


def box(size=(1.0, 2.0, 3.0), centre=(0.0, 0.0, 0.0)):
    """A box of twelve triangles, counterclockwise seen from outside."""
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return TriangleMesh(signs * np.array(size) / 2 + np.array(centre), np.array(faces))


def sphere(rings=24, sides=48, radius=1.0):
    """A sphere's polyhedron whose vertices lie on it."""
    latitude = np.pi * (np.arange(1, rings) / rings - 0.5)
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = [
        (np.cos(p) * np.cos(t), np.cos(p) * np.sin(t), np.sin(p)) for p in latitude for t in turn
    ]
    vertices = radius * np.array([(0, 0, -1), *ring, (0, 0, 1)])
    top, faces = len(vertices) - 1, []
    for j in range(sides):
        k = (j + 1) % sides
        faces.append((0, 1 + k, 1 + j))
        for i in range(rings - 2):
            a, b = 1 + i * sides, 1 + (i + 1) * sides
            faces += [(a + j, a + k, b + k), (a + j, b + k, b + j)]
        faces.append((top, top - sides + j, top - sides + k))
    return TriangleMesh(vertices, np.array(faces))


def prism(sides=96, radius=1.0, length=2.0):
    """A cylinder's prism along z whose edges lie on it."""
    turn = 2 * np.pi * np.arange(sides) / sides
    rim = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    low, high = (np.column_stack([rim, np.full(sides, z)]) for z in (-length / 2, length / 2))
    vertices = np.concatenate([low, high, [(0, 0, -length / 2), (0, 0, length / 2)]])
    faces = []
    for j in range(sides):
        k = (j + 1) % sides
        faces += [
            (j, k, sides + k),
            (j, sides + k, sides + j),
            (2 * sides, k, j),
            (2 * sides + 1, sides + j, sides + k),
        ]
    return TriangleMesh(vertices, np.array(faces))


def pose(rng):
    """A random rigid transform."""
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    Q *= np.sign(np.diag(R))
    Q[:, 0] *= np.linalg.det(Q)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Q, rng.uniform(-2, 2, 3)
    return T


def stl_header(count, text=b"made by a test"):
    return text.ljust(80, b"\0") + count.to_bytes(4, "little")


def dae(
    points="0 0 0 1 0 0 0 1 0",
    indices="0 1 2",
    *,
    unit="1",
    up="Z_UP",
    before="",
    node="",
    tail="</COLLADA>",
):
    """A COLLADA file of one geometry."""
    return f"""<?xml version="1.0"?>{before}
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="{unit}"/><up_axis>{up}</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><technique sid="c"><lambert><diffuse><color>1 0.5 0 1</color></diffuse>
</lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="9">{points}</float_array>
<technique_common><accessor source="#pa" count="3" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1" material="paint"><input semantic="VERTEX" source="#v" offset="0"/><p>{indices}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node>{node}<instance_geometry url="#g"><bind_material><technique_common>
<instance_material symbol="paint" target="#m"/></technique_common></bind_material>
</instance_geometry></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene>{tail}"""


def ply(vertices=4, faces=4, content=None):
    """An ASCII PLY of a tetrahedron, with counts that may lie."""
    if content is None:
        content = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n"
    return (
        f"ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {faces}\nproperty list uchar int vertex_indices\nend_header\n{content}"
    )


ONE_LINK_WITH_A_MESH = """format = 1
name = "one_link"
convention = "standard"

[[joint]]
name = "turn"
type = "revolute"
a = 0.5
alpha = 0
d = 0
theta = 0
shape = { mesh = "link.stl" }
"""
"""A robot file; its mesh lies beside it."""
