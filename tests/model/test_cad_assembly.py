"""Assemblies come back as they were: vertices, inertias, units; and what is not clear is refused in a line."""

import contextlib
import time
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import savemat

from acceptance import ACCEPTING
from dhkit.description import from_dh, library_robot, read_robot, world_to_frames
from dhkit.errors import DhkitError, ModelError
from dhkit.model import mat_parts, pinocchio_model
from dhkit.model.bounds import BOUNDS
from dhkit.model.cad_assembly import import_cad
from dhkit.model.cad_files import link_number
from dhkit.model.mesh_reader import read_mesh
from dhkit.model.shape_inertia import shape_inertia
from dhkit.model.shapes import link_parts
from dhkit.model.stl import ascii_stl, binary_stl
from dhkit.model.triangle_mesh import TriangleMesh, joined_meshes
from mesh_shapes import box, dae, prism, sphere

SINGLE = 1e-6
"""Relative to the assembly's size: single precision of an STL file."""
IN_MEMORY = 1e-12
"""Relative, of the course's formula in double precision."""
INERTIA = 1e-9
"""Relative, of the mesh's integral."""
UNITS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 0.0254}


def planar():
    return from_dh(
        [(0, 0.2, 0, "pi/2"), (0, 0, 0.3, 0), (0, 0, 0.25, 0)],
        name="three",
        order=("theta", "d", "a", "alpha"),
    )


def random_table(rng, n):
    """An arm of turning and prismatic joints with any twists, in either convention."""
    rows = np.column_stack(
        [
            rng.uniform(-3, 3, n),
            *rng.uniform(-0.5, 0.5, (2, n)),
            rng.choice([0, np.pi / 2, -1.1], n),
        ]
    )
    convention = "standard" if rng.random() < 0.5 else "modified"
    kinds = "".join(rng.choice(["R", "R", "P"], n))
    return from_dh(rows.tolist(), kinds=kinds, convention=convention, name="random")


def links(arm):
    """A mesh for each link in its DH frame, m: about the common normal, as links lie."""
    numbers, reach = arm.numbers, arm.reach or 1.0
    made = [box((0.1 * reach, 0.1 * reach, 0.06 * reach), (0, 0, 0.01 * reach))]
    for i in range(arm.n):
        size = np.array([abs(numbers.a[i]), 0.05 * reach, 0.05 * reach]) + 0.04 * reach
        made.append(box(size, (-numbers.a[i] / 2, 0, 0)))
    return made


def export(folder, arm, meshes, q, unit="mm", *, text=False, name="Assem1 - link{}-1.STL"):
    """Write links as a CAD program exports its assembly."""
    folder.mkdir(exist_ok=True)
    for i, (mesh, T) in enumerate(zip(meshes, world_to_frames(arm, q), strict=True)):
        corners = mesh.moved(T).scaled(1 / UNITS[unit]).corners
        file = folder / name.format(i)
        if text:
            file.write_text(ascii_stl(f"link{i}", corners))
        else:
            file.write_bytes(binary_stl("solid exported", corners))
    return folder


def apart(found, expected):
    """Largest distance of corners, triangle by triangle."""
    return np.abs(found.corners - expected.corners).max()


def test_an_assembly_comes_back(tmp_path, law):
    """Random arms of 1 to 6 joints, random poses of the export, units and formats."""
    rng = np.random.default_rng(0)
    for k in range(law.samples(200)):
        arm = random_table(rng, int(rng.integers(1, 7)))
        q = rng.uniform(-1, 1, arm.n)
        meshes, unit = links(arm), ("m", "mm", "cm", "in")[k % 4]
        folder = export(tmp_path / str(k), arm, meshes, q, unit, text=k % 3 == 0)
        found = import_cad(folder, arm, q=q, unit=unit, density=2700.0)
        frames = world_to_frames(arm, q)
        size = max(np.linalg.norm(frames[:, :3, 3], axis=1).max(), arm.reach, 1e-3)
        for i, mesh in enumerate(meshes):
            law.holds(
                "vertices, of the assembly's size", apart(found.meshes[i], mesh) / size, SINGLE
            )
            # The seed's formula on what was read: (T_i^0)^-1 v.
            read = read_mesh(next(folder.glob(f"*link{i}-1.STL"))).scaled(UNITS[unit])
            columns = np.column_stack([read.corners.reshape(-1, 3), np.ones(3 * len(read.faces))]).T
            seed = (np.linalg.inv(frames[i]) @ columns).T[:, :3]
            law.holds(
                "the seed's formula",
                np.abs(found.meshes[i].corners.reshape(-1, 3) - seed).max() / size,
                IN_MEMORY,
            )
            if i:  # integrated where the part stood in the assembly, and then moved
                integral = shape_inertia(read, density=2700.0).moved(np.linalg.inv(frames[i]))
                miss = np.abs(found.description.numbers.inertia[i - 1] - integral.inertia).max()
                law.holds("inertia, relative", miss / np.abs(integral.inertia).max(), INERTIA)
                law.holds(
                    "centre of mass, of the size",
                    np.abs(found.description.numbers.com[i - 1] - integral.com).max() / size,
                    INERTIA,
                )


def test_the_pumas_own_meshes_come_back_and_its_table_stays(tmp_path):
    arm = library_robot("puma560")
    q = arm.numbers.configurations["ready"]
    meshes = [read_mesh(part.file) for part in link_parts(arm)]
    found = import_cad(export(tmp_path / "parts", arm, meshes, q), arm, density=2700.0)
    assert (
        "the configuration ready" in found.notes[1] and "unit: mm, found by size" in found.notes[2]
    )
    for i, mesh in enumerate(meshes):
        assert apart(found.meshes[i], mesh) < SINGLE * arm.reach
    assert [joint.a for joint in found.description.joints] == [joint.a for joint in arm.joints]
    files = found.write(tmp_path / "robot")
    assert sorted(path.name for path in (tmp_path / "robot").iterdir()) == [
        "meshes",
        "robot.toml",
        "robot.urdf",
    ]
    again = read_robot(files[0])
    assert again == found.description and again.warnings == ()
    assert again.joints[1].a.text == arm.joints[1].a.text
    assert pinocchio_model(again).inertias[2].mass == pytest.approx(
        float(again.joints[1].body.mass)
    )
    urdf = files[1].read_text()
    assert (
        urdf.count('filename="meshes/link3.stl"')
        == urdf.count('filename="meshes/link3_hull.stl"')
        == 1
    )
    with pytest.raises(
        ModelError,
        match=r"is not empty; expected a new folder; --force .* replaces an earlier import",
    ):
        found.write(tmp_path / "robot")
    (tmp_path / "robot" / "meshes" / "link9.stl").write_bytes(b"of an earlier import")
    found.write(tmp_path / "robot", force=True)
    assert read_robot(files[0]) == found.description
    assert not (tmp_path / "robot" / "meshes" / "link9.stl").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["parts", "robot"]


def test_force_never_replaces_a_folder_with_other_files(tmp_path):
    arm = library_robot("puma560")
    meshes = [read_mesh(part.file) for part in link_parts(arm)]
    found = import_cad(
        export(tmp_path / "parts", arm, meshes, arm.numbers.configurations["ready"]), arm
    )
    found.write(tmp_path / "robot")
    thesis = tmp_path / "robot" / "thesis.tex"
    thesis.write_text("three years")
    with pytest.raises(ModelError, match="files that an import does not make"):
        found.write(tmp_path / "robot", force=True)
    assert thesis.read_text() == "three years"


def test_a_mat_file_of_faces_and_vertices_is_the_same_assembly(tmp_path):
    arm, q = planar(), np.zeros(3)
    meshes = [
        mesh.moved(T).scaled(1000)
        for mesh, T in zip(links(arm), world_to_frames(arm, q), strict=True)
    ]

    def fields(mesh, suffix):
        ones = np.ones((len(mesh.vertices), 1))
        return {
            f"F{suffix}": mesh.faces + 1,
            f"V{suffix}": np.hstack([mesh.vertices, ones]),
            f"C{suffix}": [[1.0, 0.5, 0.0]],
        }

    kinds = {
        "structs": {f"s{i}": fields(mesh, i) for i, mesh in enumerate(meshes, start=1)},
        "one": {
            "s": {
                k: v for i, mesh in enumerate(meshes, start=1) for k, v in fields(mesh, i).items()
            }
        },
    }
    array = np.empty((1, 4), dtype=[(name, object) for name in "FVC"])
    for i, mesh in enumerate(meshes):
        array[0, i] = tuple(np.array(value) for value in fields(mesh, "").values())
    kinds["array"] = {"s": array}
    words = {"F": "faces", "V": "Vertices", "C": "facevertexcdata"}
    kinds["patches"] = {
        f"s{i}": {words[k]: v for k, v in fields(mesh, "").items()}
        for i, mesh in enumerate(meshes, start=1)
    }
    for name, content in kinds.items():
        for compressed in (True, False):
            savemat(tmp_path / f"{name}.mat", content, do_compression=compressed)
            found = import_cad(tmp_path / f"{name}.mat", arm, mass={1: 2.0})
            assert "part 1 is the base" in found.notes[0]
            for i, mesh in enumerate(links(arm)):
                assert apart(found.meshes[i], mesh) < IN_MEMORY
            assert found.description.joints[0].shapes[0].color == "#ff8000"
            assert float(found.description.joints[0].body.mass) == pytest.approx(2.0)
            assert not found.description.joints[1].bodies
    (tmp_path / "folder").mkdir()
    (tmp_path / "structs.mat").rename(tmp_path / "folder" / "my robot.mat")
    assert import_cad(tmp_path / "folder", arm).meshes.keys() == {0, 1, 2, 3}


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("link0", 0),
        ("base", 0),
        ("Base_link", 0),
        ("link3", 3),
        ("Link 3", 3),
        ("PUMA560 assembly - link3-1", 3),
        ("Assem1 - Part2-1", 2),
        ("Assem1 - base-1", 0),
        ("PUMA560_link4", 4),
        ("part-5", 5),
        ("s6", 6),
        ("3", 3),
        ("forearm", None),
        ("arm 1 of 2", None),
        ("database", None),
    ],
)
def test_names_say_the_link(name, number):
    assert link_number(name) == number


def test_several_files_of_one_link_are_one_body(tmp_path):
    arm, q = planar(), np.zeros(3)
    folder = export(tmp_path / "parts", arm, links(arm), q)
    motor = box((0.02, 0.02, 0.04), (0, 0.1, 0)).moved(world_to_frames(arm, q)[3]).scaled(1000)
    (folder / "motor.obj").write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in motor.vertices)
        + "".join("f {} {} {}\n".format(*(f + 1)) for f in motor.faces)
    )
    with pytest.raises(
        ModelError, match=r"no single link number in motor.obj; found Assem1.*--map"
    ):
        import_cad(folder, arm)
    files = {3: ["Assem1 - link3-1.STL", "motor.obj"]}
    found = import_cad(folder, arm, files=files, density=1000.0)
    body, parts = (
        found.description.joints[2].body,
        [links(arm)[3], box((0.02, 0.02, 0.04), (0, 0.1, 0))],
    )
    assert len(found.meshes[3].faces) == 24
    volume = sum(shape_inertia(part, density=1.0).volume for part in parts)
    assert float(body.mass) == pytest.approx(1000 * volume, rel=1e-6)


@pytest.mark.parametrize("unit", ["m", "mm", "cm", "in"])
def test_the_unit_is_found_by_size(tmp_path, unit):
    arm, q = planar(), np.array([0.2, 0.5, -0.3])
    folder = export(tmp_path / "parts", arm, links(arm), q, unit)
    found = import_cad(folder, arm, q=q)
    assert f"unit: {unit}, found by size" in found.notes[2]
    wrong = import_cad(folder, arm, q=q, unit="m" if unit != "m" else "mm")
    assert wrong.notes[2].startswith("warning: ") or unit in ("cm", "in")


def test_parts_in_a_wrong_place_are_warned_of(tmp_path):
    arm, q = planar(), np.array([0.0, 1.2, -1.0])
    folder = export(tmp_path / "parts", arm, links(arm), q)
    assert not any(note.startswith("warning") for note in import_cad(folder, arm, q=q).notes)
    bent = import_cad(folder, arm).notes  # all joint values 0: not the pose of the export
    assert any(
        "link 3: its part lies" in note and "beside the axis of joint 3" in note for note in bent
    )


def test_collada_states_its_own_unit(tmp_path):
    arm = from_dh([(0, 0, 0.3, 0)], name="one")
    mesh = box((0.3, 0.05, 0.05), (0.15, 0, 0))
    text = dae(
        " ".join(map(str, (1000 * mesh.vertices).ravel())),
        " ".join(map(str, mesh.faces.ravel())),
        unit="0.001",
    )
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "link1.dae").write_text(text)
    found = import_cad(tmp_path / "parts", arm, q=[0.0])
    across = "the assembly is 0.3082 m across, the arm 0.3 m long"
    assert found.notes[2] == f"unit: 0.001 m, as the files state it: {across}"
    assert found.meshes[1].bounds[:, 0] == pytest.approx([-0.3, 0.0], abs=1e-12)


def collada_arm(folder, unit):
    """Files of the planar arm in mm whose unit is stated as given, or not at all."""
    arm, q = planar(), np.zeros(3)
    folder.mkdir()
    for i, (mesh, T) in enumerate(zip(links(arm), world_to_frames(arm, q), strict=True)):
        points = 1000 * mesh.moved(T).vertices
        text = dae(
            " ".join(map(repr, points.ravel().tolist())),
            " ".join(map(str, mesh.faces.ravel())),
            unit=unit,
        )
        (folder / f"link{i}.dae").write_text(text.replace('<unit meter=""/>', ""))
    return arm, links(arm)


def test_collada_without_a_unit_is_judged_by_size_and_a_stated_unit_is_held_against_the_arm(
    tmp_path,
):
    arm, expected = collada_arm(tmp_path / "none", "")
    found = import_cad(tmp_path / "none", arm)
    assert "unit: mm, found by size" in found.notes[2]
    assert apart(found.meshes[3], expected[3]) < IN_MEMORY
    collada_arm(tmp_path / "metres", "1")  # mm, of which the files say m
    with pytest.raises(
        ModelError,
        match=r"by the unit that the files state the assembly is [0-9.]+ m across.*--unit mm",
    ):
        import_cad(tmp_path / "metres", arm)
    forced = import_cad(tmp_path / "metres", arm, unit="mm")
    assert (
        "unit: mm, as stated, for all files instead of the 1 m that files state" in forced.notes[2]
    )
    assert apart(forced.meshes[3], expected[3]) < IN_MEMORY
    collada_arm(tmp_path / "inches", "0.0254")
    with pytest.raises(ModelError, match="state the unit of all files"):
        import_cad(tmp_path / "inches", arm)


def planar_small(length):
    """An arm of two links in a plane above a base, whose axes stand upright."""
    return from_dh([(0, 0, length / 2, 0), (0, 0, length / 2, 0)], name="small")


class UnitNotClearError(Exception):
    """An import was refused with a hint to state the unit."""


def imported_if_clear(folder, arm):
    try:
        return import_cad(folder, arm, q=np.zeros(arm.n))
    except ModelError as error:
        raise (UnitNotClearError if "--unit" in str(error) else AssertionError)(error) from None


@pytest.mark.parametrize("unit", ["m", "cm", "mm", "in"])
@pytest.mark.parametrize(
    ("length", "extra"),
    [
        (0.1, ("base", 1.0)),
        (0.2, ("base", 0.8)),
        (0.2, ("tool", 2.0)),
        (0.1, ("tool", 1.0)),
        (0.2, ("base", 1.2)),
    ],
)
def test_a_small_arm_with_a_large_base_or_tool_is_never_taken_in_a_wrong_unit(
    tmp_path, length, extra, unit
):
    where, size = extra
    for arm in (
        planar_small(length),
        from_dh([(0, 0, length / 2, 0), (0, 0, length / 2, "pi/2"), (0, 0, 0, 0)]),
    ):
        meshes = links(arm)
        if where == "base":
            meshes[0] = box((0.3 * size, 0.3 * size, size), (0, 0, -size / 2))
        else:
            meshes[-1] = joined_meshes(
                [meshes[-1], box((size, 0.02, 0.02), (size / 2 - 0.01, 0, 0))]
            )
        folder = export(tmp_path / f"{arm.n}", arm, meshes, np.zeros(arm.n), unit)
        with contextlib.suppress(UnitNotClearError):
            assert f"unit: {unit}," in imported_if_clear(folder, arm).notes[2]
        assert import_cad(folder, arm, q=np.zeros(arm.n), unit=unit).meshes[1].size > 0


def test_parts_moved_into_positive_space_are_recognised(tmp_path):
    arm = planar()
    folder = tmp_path / "parts"
    folder.mkdir()
    for i, mesh in enumerate(links(arm)):
        own = mesh.scaled(1000)
        corners = TriangleMesh(own.vertices - own.bounds[0], own.faces).corners
        (folder / f"link{i}.stl").write_bytes(binary_stl("x", corners))
    with pytest.raises(
        ModelError,
        match=r"4 of 4 parts .* 'Do not translate STL output data to positive space' ticked",
    ):
        import_cad(folder, arm)


def test_masses_from_reports_masses_and_density(tmp_path):
    arm, q = planar(), np.zeros(3)
    folder = export(tmp_path / "parts", arm, links(arm), q)
    frames = world_to_frames(arm, q)
    body = shape_inertia(links(arm)[2], density=7800.0)
    seen = body.moved(frames[2])
    products = seen.inertia[[0, 1, 0], [1, 2, 2]]
    numbers = [seen.mass, *(1000 * seen.com), *np.diag(seen.inertia), *products]
    heading = "link,mass [kg],com_x [mm],com_y [mm],com_z [mm]," + ",".join(
        f"I{k} [kg m^2]" for k in ("xx", "yy", "zz", "xy", "yz", "xz")
    )
    report = tmp_path / "masses.csv"
    report.write_text(
        f"# products = -integral\n{heading}\nlink2,"
        + ",".join(map(repr, map(float, numbers)))
        + "\n"
    )
    found = import_cad(folder, arm, reports=[report], mass={3: 1.5}, density=2700.0)
    numbers = found.description.numbers
    assert numbers.mass[1:] == pytest.approx([body.mass, 1.5])
    assert numbers.com[1] == pytest.approx(body.com, abs=1e-12)
    assert np.abs(numbers.inertia[1] - body.inertia).max() < INERTIA * np.abs(body.inertia).max()
    assert not any("outside the link" in note for note in found.notes)
    report.write_text(report.read_text().replace("link2,", "link1,"))
    elsewhere = import_cad(folder, arm, reports=[report])
    assert any(
        "outside the link; was the report made in the coordinates" in note
        for note in elsewhere.notes
    )


def report_of(path, link, mass, moments):
    heading = "link,mass [kg],com_x [mm],com_y [mm],com_z [mm]," + ",".join(
        f"I{k} [kg m^2]" for k in ("xx", "yy", "zz", "xy", "yz", "xz")
    )
    path.write_text(
        f"{heading}\n{link},{mass},450,0,200," + ",".join(map(str, moments)) + ",0,0,0\n"
    )
    return path


def test_impossible_moments_of_a_report_are_warned_of(tmp_path):
    arm = planar()
    folder = export(tmp_path / "parts", arm, links(arm), np.zeros(3))

    def notes(*moments):
        report = report_of(tmp_path / "masses.csv", "link3", 1.0, moments)
        return import_cad(folder, arm, reports=[report]).notes[-1]

    assert "warning" not in notes(0.001, 0.004, 0.004) and "the report of 'link3'" in notes(
        0.001, 0.004, 0.004
    )
    assert "no body has its principal moments 0.001, 0.002, 0.009 kg m^2" in notes(
        0.001, 0.002, 0.009
    )
    assert "its largest moment is 40 kg m^2, a body of its mass" in notes(40, 40, 40)


def test_hidden_files_are_not_seen_and_parts_can_be_left_out(tmp_path):
    arm = planar()
    folder = export(tmp_path / "parts", arm, links(arm), np.zeros(3))
    (folder / "._Assem1 - link2-1.STL").write_bytes(b"a fork of resources")
    assert sorted(import_cad(folder, arm).meshes) == [0, 1, 2, 3]
    for name in ("gripper.stl", "cover link2.stl"):
        (folder / name).write_bytes(binary_stl("x", box().corners))
    with pytest.raises(ModelError, match=r'--map "-=Assem1'):
        import_cad(folder, arm)
    with pytest.raises(ModelError, match=r'--map "2=Assem1 - link2-1.STL,cover link2.stl"'):
        import_cad(folder, arm, files={-1: ["gripper.stl"]})
    found = import_cad(folder, arm, files={-1: ["gripper.stl", "cover link2.stl"]})
    assert (
        found.notes[0]
        == "parts by the numbers in their names; left out: gripper.stl, cover link2.stl"
    )
    assert len(found.meshes[2].faces) == 12


def test_overlaps_and_cavities_are_found_across_the_files_of_a_link(tmp_path):
    arm, frames = planar(), world_to_frames(planar(), np.zeros(3))
    folder = export(tmp_path / "parts", arm, links(arm), np.zeros(3))
    files = {3: ["Assem1 - link3-1.STL", "second.stl"]}

    def with_second(mesh):
        (folder / "second.stl").write_bytes(
            binary_stl("x", mesh.moved(frames[3]).scaled(1000).corners)
        )
        found = import_cad(folder, arm, files=files, density=1000.0)
        return float(found.description.joints[2].body.mass), found.notes[-1]

    whole = 1000 * shape_inertia(links(arm)[3], density=1.0).volume
    mass, note = with_second(links(arm)[3])
    assert mass == pytest.approx(2 * whole, rel=1e-5) and "counts twice" in note
    mass, note = with_second(box((0.02, 0.02, 0.02), (-0.1, 0, 0)).turned())
    assert (
        mass == pytest.approx(whole - 0.008, rel=1e-4)
        and "1 cavity inside" in note
        and "warning" not in note
    )


def test_odd_densities_and_enormous_bodies_say_what_may_be_meant(tmp_path):
    arm = planar()
    folder = export(tmp_path / "parts", arm, links(arm), np.zeros(3))
    for density, hint in ((2.7, "g/cm^3 meant"), (2.7e6, "steel has 7850")):
        notes = import_cad(folder, arm, density=density).notes
        assert any(note.startswith("warning: the density is") and hint in note for note in notes)
    assert not any("density is" in note for note in import_cad(folder, arm, density=2700.0).notes)
    with pytest.raises(ModelError, match=r"expected at most 1e\+12 \(unit: m, as stated: "):
        import_cad(folder, arm, density=7.8e6, unit="m")


def test_the_pose_is_printed(tmp_path):
    arm = planar()
    folder = export(tmp_path / "parts", arm, links(arm), np.array([0.1, 0.0, -1.0]))
    assert (
        import_cad(folder, arm, q=[0.1, 0, -1]).notes[1]
        == "pose of the export: as given: q = 0.1, 0, -1"
    )


def stated(**options):
    return lambda folder, arm: import_cad(folder, arm, **options)


def renamed(old, new):
    def act(folder, arm):
        (folder / f"Assem1 - link{old}-1.STL").rename(folder / new)
        return import_cad(folder, arm)

    return act


def removed(folder, arm):
    (folder / "Assem1 - link2-1.STL").unlink()
    return import_cad(folder, arm)


def broken(folder, arm):
    (folder / "Assem1 - link2-1.STL").write_bytes(b"solid x\nfacet")
    return import_cad(folder, arm)


def resized(factor):
    def act(folder, arm):
        for path in folder.iterdir():
            path.write_bytes(binary_stl("x", factor * read_mesh(path).corners))
        return import_cad(folder, arm)

    return act


REFUSED = {
    "no folder": (lambda folder, arm: import_cad(folder / "none", arm), "no such folder"),
    "a file for a folder": (
        lambda folder, arm: import_cad(folder / "Assem1 - link1-1.STL", arm),
        "not a folder",
    ),
    "an empty folder": (lambda folder, arm: import_cad(folder.parent, arm), "no mesh files"),
    "a missing link": (removed, "no part for link 2; found Assem1 - link0-1.STL, .*--map"),
    "a link twice": (renamed(2, "another link3.stl"), "have the same link number"),
    "a link too many": (renamed(0, "link9.stl"), "for link 9; the table has links 0 to 3"),
    "no number": (renamed(1, "shoulder.stl"), "no single link number in shoulder.stl"),
    "a mapped file that is not there": (
        stated(files={1: ["none.stl"]}),
        "the mapping names 'none.stl'",
    ),
    "a mapped link that is none": (
        stated(files={7: ["Assem1 - link1-1.STL"]}),
        "the mapping names link 7",
    ),
    "a file mapped twice": (
        stated(files={1: ["Assem1 - link1-1.STL"], 2: ["Assem1 - link1-1.STL"]}),
        "names 'Assem1 - link1-1.STL' twice",
    ),
    "a link mapped and numbered": (
        stated(files={1: ["Assem1 - link2-1.STL"]}),
        "link 1 is mapped, and",
    ),
    "a broken part": (broken, "link2-1.STL: truncated"),
    "parts a thousand times too small": (resized(1e-6), "no unit of .* fits"),
    "parts ten times too small": (resized(0.06), "cm and in fit.*state the unit"),
    "an unknown unit": (stated(unit="km"), "unit is 'km'"),
    "no density": (stated(density=0.0), "density is 0"),
    "a negative mass": (stated(mass={1: -1.0}), "mass of link 1 is -1"),
    "a mass of no link": (stated(mass={9: 1.0}), "a mass of link 9"),
    "a report that is not there": (stated(reports=["none.txt"]), "none.txt: no such file"),
    "too few triangles": (stated(simplify=1), "simplify is 1"),
    "another pose": (stated(q=[0, 0]), r"q has shape \(2,\)"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_clear_is_refused_in_a_line(tmp_path, case):
    act, complaint = REFUSED[case]
    arm = planar()
    folder = export(tmp_path / "parts", arm, links(arm), np.zeros(3))
    start = time.process_time()
    with pytest.raises((DhkitError, ValueError), match=complaint) as error:
        act(folder, arm)
    assert "\n" not in str(error.value) and time.process_time() - start < 5


def cell(**variables):
    return lambda path: savemat(path, variables)


BOMB = 480_000_000 if ACCEPTING else 4_800_000
"""Bytes of a file that unpacks to too many; outside `make accept` the limit is lowered with it."""
TRIANGLE = {"F1": [[1, 2, 3]], "V1": np.eye(3)}
BAD_MATS = {
    "no MAT file": (lambda path: path.write_bytes(b"x" * 500), "no .mat file of format 5"),
    "HDF5": (
        lambda path: path.write_bytes(b"MATLAB 7.3 MAT-file" + b" " * 493 + b"\x89HDF\r\n\x1a\n"),
        "format 7.3",
    ),
    "empty": (lambda path: path.write_bytes(b""), "no .mat file of format 5"),
    "no structs": (cell(x=np.eye(3)), "no struct with fields F, V"),
    "faces of nothing": (
        cell(s1=TRIANGLE | {"F1": [[1, 2, 4]]}),
        "a face with a vertex that is none of 1 to 3",
    ),
    "index 0": (cell(s1=TRIANGLE | {"F1": [[0, 1, 2]]}), "none of 1 to 3"),
    "half an index": (cell(s1=TRIANGLE | {"F1": [[1, 2, 2.5]]}), "not whole numbers"),
    "NaN": (cell(s1=TRIANGLE | {"V1": np.full((3, 3), np.nan)}), "not finite"),
    "words": (cell(s1=TRIANGLE | {"V1": "vertices"}), "not a matrix of real numbers"),
    "cells": (
        cell(s1=TRIANGLE | {"V1": np.array([[1, "a"]], dtype=object)}),
        "not a matrix of real numbers",
    ),
    "complex": (cell(s1=TRIANGLE | {"V1": 1j * np.eye(3)}), "not a matrix of real numbers"),
    "two parts of one name": (
        cell(s=TRIANGLE | {"F2": [[1, 2, 3]], "V2": np.eye(3)}, s1=TRIANGLE),
        "s1: two parts of this name",
    ),
    "flat vertices": (cell(s1=TRIANGLE | {"V1": np.eye(2)}), r"shape \(2, 2\)"),
    "a bomb": (
        lambda path: savemat(
            path, {"s1": {"V1": np.zeros((BOMB // 8000, 1000))}}, do_compression=True
        ),
        "unpacks to more than",
    ),
}


@pytest.mark.parametrize("case", BAD_MATS)
def test_a_bad_mat_file_is_refused_in_a_line(tmp_path, monkeypatch, case):
    if not ACCEPTING:
        monkeypatch.setattr(mat_parts, "BOUNDS", replace(BOUNDS, mat_unpacked_bytes=BOMB - 1))
    write, complaint = BAD_MATS[case]
    path = tmp_path / "robot.mat"
    write(path)
    with pytest.raises(ModelError, match=complaint) as error:
        import_cad(path, from_dh([(0, 0, 0.3, 0)]))
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)


def test_damaged_mat_files_never_crash(tmp_path):
    path = tmp_path / "robot.mat"
    arm = from_dh([(0, 0, 0.3, 0)])
    rng = np.random.default_rng(0)
    for compressed in (False, True):
        savemat(path, {"s1": TRIANGLE}, do_compression=compressed)
        whole = path.read_bytes()
        for k in range(150):
            content = bytearray(
                whole[: int(rng.integers(130, len(whole)))] if k % 3 == 0 else whole
            )
            for at in rng.integers(128, len(content), 3):
                content[at] = int(rng.integers(256))
            path.write_bytes(bytes(content))
            with contextlib.suppress(ModelError):
                import_cad(path, arm, unit="m", files={1: ["s1"]})


def test_nothing_is_written_half(tmp_path, monkeypatch):
    arm = planar()
    found = import_cad(export(tmp_path / "parts", arm, links(arm), np.zeros(3)), arm)
    monkeypatch.setattr("dhkit.model.cad_assembly.urdf_text", lambda *_, **__: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        found.write(tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["parts"]
    monkeypatch.undo()
    assert found.write(tmp_path / "none" / "out")


def test_round_parts_are_drawn_and_weighed(tmp_path):
    arm = from_dh([(0, 0.4, 0, 0)], name="one")
    folder = export(
        tmp_path / "parts", arm, [prism(32, 0.1, 0.1), sphere(12, 16, 0.2)], np.zeros(1)
    )
    found = import_cad(folder, arm, density=1000.0, simplify=60)
    assert len(found.meshes[1].faces) <= 60 and len(found.meshes[0].faces) <= 60
    whole = shape_inertia(sphere(12, 16, 0.2), density=1000.0)
    assert float(found.description.joints[0].body.mass) == pytest.approx(whole.mass, rel=1e-6)
    assert "of 352" in found.notes[-1]
