"""The panels of dynamics, workspace, transforms and answers: their numbers are the API's, and pages show them."""

import json
from contextlib import suppress

import numpy as np
import psutil
import pytest
import trimesh

from dhkit import Arm
from dhkit.description import pose
from dhkit.errors import ModelError
from dhkit.lab import Lab
from dhkit.lab.transforms_panel import MAX_TRIANGLES, Solid
from dhkit.lab.workspace_panel import boundary_distance
from waiting import wait_for

PRINTED = 5.1e-5
"""Half of the last digit of an entry of M on the page, and rounding."""
CHORD = 5e-5
"""m: a boundary is a line of 180 pieces."""


def state(lab, name):
    """Return the state of a panel as pages are told it."""
    server = lab.view._live()
    return json.loads(server._state[server._panels[name]][1][16:])["data"]


def wait(lab, name, condition):
    wait_for(lambda: condition(state(lab, name)), name)
    return state(lab, name)


# Dynamics


@pytest.mark.parametrize("name", ["puma560", "cobra600", "planar2r"])
def test_dynamics_are_pinocchios(open_lab, name):
    import pinocchio as pin

    lab = open_lab(name)
    arm, q = lab.desk.arm, np.random.default_rng(3).uniform(-1, 1, lab.desk.arm.n)
    found = lab.answer("dynamics.read", {"q": q.tolist()})
    model = arm.model
    data = model.createData()
    M = pin.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    assert np.abs(np.array(found["M"]) - M).max() < 1e-9
    assert np.abs(np.array(found["g"]) - pin.computeGeneralizedGravity(model, data, q)).max() < 1e-9
    J = arm.jacobian(q)[:3]
    sigma = np.zeros(3)
    values = np.linalg.svd(J, compute_uv=False)
    sigma[: len(values)] = values
    assert np.array(found["lengths"], dtype=float) == pytest.approx(sigma, abs=1e-9)


def test_an_arm_without_masses_has_no_torques_and_says_so(open_lab):
    lab = open_lab(Arm.from_dh([[0, 0.4, 0, "pi/2"], [0, 0, 0.3, 0]]))
    q = [0.1] * lab.desk.arm.n
    found = lab.answer("dynamics.read", {"q": q})
    assert found["M"] is None
    assert found["g"] is None
    with pytest.raises(ValueError, match="no masses"):
        lab.answer("dynamics.entry", {"name": "M11"})


def test_an_entry_is_derived_as_a_formula(open_lab):
    lab = open_lab("planar2r")
    lab.answer("dynamics.entry", {"name": "M12"})
    found = wait(lab, "entry", lambda entry: entry and not entry["deriving"])
    assert found["error"] is None
    assert all(line.startswith("<math") for line in found["lines"])
    for name in ("M13", "x11", "M1", "g3", "tau1"):
        with pytest.raises(ValueError, match=r"expected M11 to M22, or g1 to g2|text of at most"):
            lab.answer("dynamics.entry", {"name": name})


def test_the_ellipsoid_follows_the_arm_until_it_is_taken_away(open_lab):
    from dhkit.viewer.session import Slot
    from viewer.messages import decode_ellipsoids

    lab = open_lab("puma560")
    drawn = lambda: decode_ellipsoids(lab.view._state[Slot.ELLIPSOIDS])  # noqa: E731 - read anew each time
    lab.answer("dynamics.ellipsoid", {"on": True})
    for q in ([0.1, 0.5, -0.5, 0, 0.5, 0], [1.0, 0.2, -0.9, 0, 0.5, 0]):
        lab.answer("joints.set", {"q": q})
        assert drawn()[0, :, 3] == pytest.approx(lab.desk.arm.fk(q)[:3, 3], abs=1e-6)
    lab.answer("dynamics.ellipsoid", {"on": False})
    assert len(drawn()) == 0


# Workspace


def test_the_distance_of_a_planar_arm_is_that_of_two_circles():
    arm = Arm.load("planar2r")
    l1, l2 = arm.description.numbers.a
    for q in np.random.default_rng(1).uniform(-3, 3, (50, 2)):
        radius = np.linalg.norm(arm.fk(q)[:3, 3])
        distance, boundary, point = boundary_distance(arm, q)
        inner = abs(radius - abs(l1 - l2)) if abs(l1 - l2) > 1e-6 * (l1 + l2) else np.inf
        assert distance == pytest.approx(min(l1 + l2 - radius, inner), abs=1e-9)
        assert point == "tool"
        assert boundary == ("inner" if inner < l1 + l2 - radius else "outer")


def test_a_stretched_puma_is_at_its_outer_boundary_and_no_state_is_beyond():
    arm = Arm.load("puma560")
    n = arm.description.numbers
    # The wrist's centre in line with the upper arm.
    straight = -np.pi / 2 + np.arctan2(n.a[2], n.d[3])
    distance, boundary, point = boundary_distance(arm, [0.4, 0.3, straight, 0, 0, 0])
    assert point == "wrist centre"
    assert (distance < CHORD) or boundary != "outer"
    best = min(
        boundary_distance(arm, [0.4, 0.3, q3, 0, 0, 0])[0] for q3 in np.linspace(-np.pi, np.pi, 721)
    )
    assert best < CHORD + 1e-4
    rng = np.random.default_rng(0)
    distances = [boundary_distance(arm, q)[0] for q in rng.uniform(-3, 3, (300, 6))]
    assert max(distances) < arm.description.reach
    # Joint 1 and the wrist change nothing.
    q = rng.uniform(-2, 2, 6)
    other = np.concatenate([[q[0] + 1.0], q[1:3], rng.uniform(-2, 2, 3)])
    assert boundary_distance(arm, q)[0] == pytest.approx(boundary_distance(arm, other)[0], abs=1e-9)


def test_points_and_a_slice_are_sampled_in_the_background(open_lab):
    from dhkit.viewer.session import Slot
    from viewer.messages import decode_points

    lab = open_lab("stanford")
    lab.answer("workspace.show", {"kind": "points"})
    found = wait(lab, "workspace", lambda space: space["progress"] is None)
    assert found["count"] == 10_000
    lab.answer("joints.set", {"q": [0.7, 1.0, 0.8, 0, 0.5, 0]})
    lab.answer("workspace.show", {"kind": "slice"})
    found = wait(
        lab, "workspace", lambda space: space["progress"] is None and space["kind"] == "slice"
    )
    points = decode_points(lab.view._state[Slot.POINTS]).points
    assert len(points) == found["count"] > 1000
    tool = lab.desk.arm.fk(lab.desk.q)[:3, 3]
    normal = np.array([-tool[1], tool[0], 0]) / np.hypot(tool[0], tool[1])
    assert np.abs(points @ normal).max() < 0.021 * lab.desk.arm.description.reach
    lab.answer("table.edit", {"row": 0, "column": "d", "text": "0.5"})
    assert state(lab, "workspace")["kind"] == "none"


# Transforms


def step(kind, axis, amount, about):
    return {"kind": kind, "axis": axis, "amount": amount, "about": about}


def test_a_chain_about_current_axes_is_the_reversed_chain_about_fixed_ones(open_lab):
    lab = open_lab("planar2r")
    chain = [
        ("turn", "z", "30°"),
        ("move", "x", "0.2"),
        ("turn", "x", "pi/2"),
        ("turn", "y", "-1.1"),
        ("move", "z", "2*inch"),
    ]
    current = lab.answer("transforms.apply", {"steps": [step(*one, "current") for one in chain]})[
        "steps"
    ]
    fixed = lab.answer(
        "transforms.apply", {"steps": [step(*one, "fixed") for one in reversed(chain)]}
    )["steps"]
    assert np.abs(np.array(current[-1]["T"]) - fixed[-1]["T"]).max() < 1e-15
    expected = (
        pose(euler=(np.pi / 6, 0, 0), order="ZYX")
        @ pose((0.2, 0, 0))
        @ pose(euler=(np.pi / 2, 0, 0), order="XYZ")
    )
    assert np.abs(np.reshape(current[2]["T"], (4, 4)) - expected).max() < 1e-15
    assert all(text.startswith("<math") for one in current for text in one["formulas"])


def test_the_operator_of_a_step_takes_vertices_to_where_they_are_told(open_lab):
    lab = open_lab("planar2r")
    solid = state(lab, "solid")
    vertices = np.array(solid["vertices"])
    steps = [
        step("turn", "z", "0.4", "fixed"),
        step("move", "y", "0.1", "current"),
        step("turn", "x", "1.2", "current"),
    ]
    found = lab.answer("transforms.apply", {"steps": steps})
    before, E, T = (
        np.reshape(x, (4, 4))
        for x in (found["steps"][1]["T"], found["steps"][2]["E"], found["steps"][2]["T"])
    )
    operator = before @ E @ np.linalg.inv(before)
    assert np.abs(operator @ before - T).max() < 1e-12
    homogeneous = np.hstack([vertices, np.ones((len(vertices), 1))])
    assert np.abs((homogeneous @ T.T)[:, :3] - found["vertices"]).max() < 1e-12
    assert len(vertices) == 8


@pytest.mark.parametrize(
    ("steps", "complaint"),
    [
        (None, "expected a list of at most 30 steps"),
        ([step("turn", "z", "1", "fixed")] * 31, "expected a list of at most 30 steps"),
        (["turn"], "step 1: expected kind, axis, amount and about"),
        ([step("turn", "w", "1", "fixed")], "step 1: axis is 'w'"),
        (
            [step("turn", "z", "1", "fixed"), step("shear", "z", "1", "fixed")],
            "step 2: kind is 'shear'",
        ),
        ([step("turn", "z", "__import__('os')", "fixed")], "step 1: amount"),
        ([step("turn", "z", "1/0", "fixed")], "step 1: amount"),
        ([step("turn", "z", "1e99", "fixed")], "step 1: amount is beyond"),
        ([step("turn", "z", "1" * 300, "fixed")], "step 1: amount"),
        ([step("turn", "z", "1", "fixed") | {"extra": 1}], "step 1: found field 'extra'"),
    ],
)
def test_a_step_that_is_none_is_named(open_lab, steps, complaint):
    with pytest.raises(ValueError, match=complaint.replace("(", r"\(")):
        open_lab("planar2r").answer("transforms.apply", {"steps": steps})


def test_solids_of_files_have_each_vertex_once(tmp_path):
    cube = trimesh.creation.box((1, 2, 3))
    for name, content in (
        ("binary", trimesh.exchange.stl.export_stl(cube)),
        ("text", trimesh.exchange.stl.export_stl_ascii(cube).encode()),
    ):
        path = tmp_path / f"{name}.stl"
        path.write_bytes(content)
        solid = Solid.read(path)
        assert (solid.name, solid.vertices.shape, solid.faces.shape) == (name, (8, 3), (12, 3))
        mesh = trimesh.Trimesh(solid.vertices, solid.faces)
        assert abs(mesh.volume) == pytest.approx(6.0)


@pytest.mark.parametrize(("unit", "size"), [("m", 0.3), ("mm", 300.0), ("in", 12.0)])
def test_the_unit_of_a_solid_is_found_by_its_size_and_chosen(tmp_path, unit, size):
    path = tmp_path / "part.stl"
    path.write_bytes(
        trimesh.exchange.stl.export_stl(trimesh.creation.box((size, size / 2, size / 3)))
    )
    with Lab(Arm.load("puma560"), solid=path) as lab:
        assert state(lab, "solid")["unit"] == unit
        edges = np.ptp(state(lab, "solid")["vertices"], axis=0)
        assert edges.max() == pytest.approx(0.3, rel=0.02)
        lab.answer("transforms.unit", {"unit": "cm"})
        assert np.ptp(state(lab, "solid")["vertices"], axis=0).max() == pytest.approx(size / 100)
        lab.answer("transforms.unit", {"unit": unit})
        assert np.ptp(state(lab, "solid")["vertices"], axis=0) == pytest.approx(edges, abs=1e-9)
        with pytest.raises(ValueError, match="expected one of m, mm, in, cm"):
            lab.answer("transforms.unit", {"unit": "ft"})


def test_the_box_without_a_file_has_no_unit(open_lab):
    lab = open_lab("planar2r")
    with pytest.raises(ValueError, match="the box has no file"):
        lab.answer("transforms.unit", {"unit": "mm"})


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("a.obj", b"", "expected .stl"),
        ("missing.stl", None, "No such file"),
        ("empty.stl", b"", "no STL|no triangles|empty file"),
        (
            "short.stl",
            b"x" * 80 + (100).to_bytes(4, "little") + b"\0" * 50,
            "no STL|no triangles|empty file",
        ),
        ("words.stl", b"solid of nothing", "no STL|no triangles|empty file"),
        ("large.stl", b"\0" * 5_000_001, "expected a file of at most"),
        (
            "many.stl",
            trimesh.exchange.stl.export_stl(trimesh.creation.icosphere(5)),
            f"expected at most {MAX_TRIANGLES}",
        ),
        (
            "nan.stl",
            b"\0" * 80 + (1).to_bytes(4, "little") + np.full(12, np.nan, "<f4").tobytes() + b"\0\0",
            "not finite|no triangles",
        ),
    ],
)
def test_files_that_are_no_solids_are_refused_in_a_line(tmp_path, name, content, complaint):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ModelError, match=complaint) as error:
        Solid.read(tmp_path / name)
    assert "\n" not in str(error.value)


# Answers


def judged(lab, kind, text):
    lab.answer("answers.grade", {"kind": kind, "text": text})
    return wait(lab, "verdict", lambda verdict: verdict and not verdict["running"])


RIGHT = "M22 = m2*l2^2/3\ng2 = m2*g*l2*c12/2"


@pytest.mark.slow
def test_answers_are_read_judged_and_explained(open_lab):
    lab = open_lab("planar2r")
    right = judged(lab, "lines", RIGHT)
    assert {entry["name"]: entry["verdict"] for entry in right["entries"]} == {
        "M22": "correct",
        "g2": "correct",
    }
    assert right["missing"] == ["M11", "M12", "M21", "g1"]
    wrong = judged(lab, "lines", "g2 = m2*g*l2\n   *c2/2")
    (entry,) = wrong["entries"]
    assert entry["verdict"] == "wrong"
    assert entry["read"].startswith("<math")
    assert entry["difference"].startswith("<math")
    assert "q1" in entry["witness"]
    assert any("angle" in one["sentence"] for one in wrong["diagnosis"])
    assert (
        judged(lab, "latex", r"\[ g_2 = \frac12 m_2 g l_2 \cos(q_1+q_2) \]")["entries"][0][
            "verdict"
        ]
        == "correct"
    )


def test_programs_are_read_and_never_run(open_lab, tmp_path):
    lab, trap = open_lab("planar2r"), tmp_path / "trap"
    report = judged(lab, "python", f"open({str(trap)!r}, 'w')\nV = 1\n")
    assert report["error"] or report["verdict"]
    assert not trap.exists()


@pytest.mark.parametrize(
    ("kind", "text", "complaint"),
    [
        ("lines", "", "the answer is empty"),
        ("lines", "so it is\nM11 = 1", "line 1: found 'so it is'"),
        ("lines", "M11 = 1\nM11 = 2", "line 2: M11 is there twice"),
        ("word", "M11 = 1", "kind is 'word'"),
        ("lines", "x" * 60_001, "a text of at most 60000"),
        ("lines", 3, "a text of at most 60000"),
    ],
)
def test_an_answer_that_cannot_be_sent_is_refused_at_once(open_lab, kind, text, complaint):
    with pytest.raises(ValueError, match=complaint):
        open_lab("planar2r").answer("answers.grade", {"kind": kind, "text": text})


@pytest.mark.slow
def test_an_answer_that_cannot_be_read_is_said_in_a_line(open_lab):
    lab = open_lab("planar2r")
    for kind, text in (
        ("sheet", "= = ="),
        ("lines", "Q77 = 1"),
        ("latex", "nothing here"),
        ("lines", "M11 = '; import os'"),
    ):
        found = judged(lab, kind, text)
        said = found["error"] or [entry["verdict"] for entry in found["entries"]]
        assert said
        assert "/tmp" not in str(said)
        assert "\n" not in str(said)


def test_judging_is_ended_with_the_lab_and_when_it_is_cancelled():
    with Lab(Arm.load("puma560")) as lab:
        lab.answer(
            "answers.grade",
            {
                "kind": "lines",
                "text": "M11 = " + " + ".join(f"c{k % 3 + 1}^{k}" for k in range(1, 60)),
            },
        )
        wait_for(judges)
        lab.answer("answers.cancel", {})
        assert state(lab, "verdict") is None
        wait_for(lambda: not judges())
        lab.answer("answers.grade", {"kind": "lines", "text": RIGHT})
        wait_for(judges)
    wait_for(lambda: not judges())


def judges():
    """Return the processes of this one that judge an answer."""
    found = []
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            found += [child] * ("grade" in child.cmdline())
    return found


def test_the_end_of_a_slide_is_a_boundary():
    arm = Arm.load("cobra600")
    n = arm.description.numbers
    for quill in (n.lower[2], n.upper[2]):
        distance, boundary, point = boundary_distance(arm, [0.3, 1.5, quill, 0.0])
        assert distance < 1e-9
        assert boundary in ("upper", "lower")
        assert point == "tool"
    middle = (n.lower[2] + n.upper[2]) / 2
    assert boundary_distance(arm, [0.3, 1.5, middle, 0.0])[0] > 0.05


@pytest.mark.slow
def test_a_sheet_about_another_robot_is_refused_and_no_verdict_stays(open_lab):
    lab = open_lab("planar2r")
    judged(lab, "lines", RIGHT)
    with pytest.raises(ValueError, match="the sheet is about 'puma560'; the arm here is planar2r"):
        lab.answer(
            "answers.grade", {"kind": "sheet", "text": 'robot = "puma560"\n[answer]\nV = "0"\n'}
        )
    assert state(lab, "verdict") is None
    judged(lab, "lines", RIGHT)
    with pytest.raises(ValueError, match="empty"):
        lab.answer("answers.grade", {"kind": "lines", "text": "  "})
    assert state(lab, "verdict") is None


def test_the_first_numbers_typed_again_are_the_first_arm_again(open_lab):
    lab = open_lab("puma560")
    first = lab.desk.arm.description
    for text in ("0.8", "0.4318"):
        lab.answer("table.edit", {"row": 1, "column": "a", "text": text})
    assert lab.desk.arm.description == first
    assert any(joint.shapes for joint in lab.desk.arm.description.joints)


def test_turns_of_more_than_a_turn_are_asked_about(open_lab):
    lab = open_lab("planar2r")
    far = lab.answer("transforms.apply", {"steps": [step("turn", "z", "90", "fixed")]})
    assert far["note"].startswith("step 1: 90 rad are 5157°")
    steps = [step("turn", "z", "90°", "fixed"), step("move", "x", "90", "fixed")]
    assert lab.answer("transforms.apply", {"steps": steps})["note"] is None
