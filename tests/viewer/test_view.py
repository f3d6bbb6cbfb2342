"""Facts of a view that need no browser."""

import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest

from dhkit.description import from_dh, library_robot, pose, with_payload
from dhkit.errors import DescriptionError, ModelError
from dhkit.kinematics.manipulability import force_ellipsoid, velocity_ellipsoid
from dhkit.planning import Floor, Obstacle
from dhkit.viewer import View
from dhkit.viewer.exports import Exportable
from dhkit.viewer.scene import node_transforms, scene_size
from dhkit.viewer.session import Slot
from simulation_results import swinging
from viewer.messages import (
    decode_animation,
    decode_ellipsoids,
    decode_ghosts,
    decode_obstacles,
    decode_points,
    decode_pose,
    decode_trace,
)

FLOAT32 = 1e-6
TABLE_DRAWN = 1_500_000  # bytes
WITHIN = 2.0  # s of processor time


def motion(arm, duration=2.0, seed=0):
    """Return a smooth motion between two random states."""
    start, goal = np.random.default_rng(seed).uniform(-1, 1, (2, arm.n))
    s = np.linspace(0, 1, 40)
    return duration * s, start + (goal - start) * (s**3 * (10 - 15 * s + 6 * s**2))[:, None]


@pytest.mark.parametrize("name", ["planar2r", "stanford", "puma560"])
def test_what_is_sent_is_the_kinematics(name):
    arm = library_robot(name)
    times, q = motion(arm)
    with View(arm) as view:
        view.show(q[3])
        pose = decode_pose(view._state[Slot.MOTION])
        view.play((times, q))
        played = decode_animation(view._state[Slot.MOTION])
    assert np.abs(pose.transforms - node_transforms(arm, q[3])[:, :3]).max() < FLOAT32
    assert np.abs(played.transforms - node_transforms(arm, played.q)[:, :, :3]).max() < 2 * FLOAT32
    assert played.times[-1] == times[-1]
    assert played.trace


@pytest.mark.parametrize("name", ["planar2r", "stanford", "panda"])
def test_a_simulation_plays_with_its_reference_as_a_ghost(name):
    arm = library_robot(name)
    result = swinging(arm, error=0.3)
    with View(arm) as view:
        view.play(result, trace=False)
        played = decode_animation(view._state[Slot.MOTION])
        view.play((result.t, result.q))
        alone = decode_animation(view._state[Slot.MOTION])
    assert played.times[-1] == result.t[-1]
    assert not played.trace
    assert np.array_equal(played.q, alone.q)
    assert np.array_equal(played.transforms, alone.transforms)
    assert alone.ghost is None
    between = np.stack(
        [np.interp(played.times, result.t, column) for column in result.reference_q.T], axis=1
    )
    assert np.abs(played.ghost - node_transforms(arm, between)[:, :, :3]).max() < 2 * FLOAT32
    assert np.abs(played.ghost - played.transforms).max() > 0.05


def test_a_simulation_of_the_arm_with_a_payload_plays_and_one_of_another_arm_does_not():
    arm = library_robot("puma560")
    loaded = swinging(with_payload(arm, 2.5))
    with View(arm) as view:
        view.play(loaded)
        assert decode_animation(view._state[Slot.MOTION]).ghost is not None
        for other in ("planar2r", "ur5"):
            with pytest.raises(
                DescriptionError, match=rf"simulation is one of {other} .*; expected one of puma560"
            ):
                view.play(swinging(library_robot(other)))
        with pytest.raises(
            ValueError, match=r"times has shape \(1,\); expected \(N,\) with N >= 2"
        ):
            view.play(swinging(arm, states=1))


def test_a_view_begins_ready():
    arm = library_robot("puma560")
    with View(arm) as view:
        ready = [float(x) for x in arm.configurations["ready"]]
        assert np.allclose(decode_pose(view._state[Slot.MOTION]).q, ready, rtol=0, atol=FLOAT32)


def test_a_trace_is_kept_and_taken_away():
    points = np.random.default_rng(0).uniform(-1, 1, (50, 3))
    with View(library_robot("planar2r")) as view:
        view.trace(points)
        assert np.abs(decode_trace(view._state[Slot.TRACE]) - points).max() < FLOAT32
        view.trace(None)
        assert len(decode_trace(view._state[Slot.TRACE])) == 0


def test_points_are_kept_with_their_colors_and_taken_away():
    points, colors = np.random.default_rng(0).uniform(0, 1, (2, 50, 3))
    with View(library_robot("planar2r")) as view:
        view.points(points, colors)
        cloud = decode_points(view._state[Slot.POINTS])
        assert np.abs(cloud.points - points).max() < FLOAT32
        assert np.abs(cloud.colors / 255 - colors).max() <= 0.5 / 255 + FLOAT32
        view.points(points, (1, 0, 0))
        assert np.array_equal(
            decode_points(view._state[Slot.POINTS]).colors, np.tile([255, 0, 0], (50, 1))
        )
        view.points(None)
        assert len(decode_points(view._state[Slot.POINTS]).points) == 0


def test_an_ellipsoid_is_drawn_to_scale():
    arm = library_robot("puma560")
    q = np.random.default_rng(0).uniform(-1, 1, (3, arm.n))
    q[1, 2] = np.nan
    ellipsoid = velocity_ellipsoid(arm, q)
    with View(arm) as view:
        view.ellipsoid(ellipsoid, scale=0.5)
        drawn = decode_ellipsoids(view._state[Slot.ELLIPSOIDS])
        assert len(drawn) == 2  # without the NaN
        expected = 0.5 * ellipsoid.axes[[0, 2]] * ellipsoid.lengths[[0, 2], None, :]
        assert np.abs(drawn[:, :, :3] - expected).max() < FLOAT32
        assert np.abs(drawn[:, :, 3] - ellipsoid.center[[0, 2]]).max() < FLOAT32
        view.ellipsoid(ellipsoid)
        drawn = decode_ellipsoids(view._state[Slot.ELLIPSOIDS])
        longest = np.linalg.norm(drawn[:, :, :3], axis=1).max()
        assert longest == pytest.approx(scene_size(arm) / 4, rel=1e-6)
        view.ellipsoid(None)
        assert len(decode_ellipsoids(view._state[Slot.ELLIPSOIDS])) == 0


def test_a_flat_ellipsoid_is_drawn_thin_and_one_without_lengths_not_at_all():
    arm = library_robot("planar2r")
    with View(arm) as view:
        view.ellipsoid(velocity_ellipsoid(arm, [0.3, 1.0]))
        lengths = np.linalg.norm(decode_ellipsoids(view._state[Slot.ELLIPSOIDS])[0, :, :3], axis=0)
        assert 0 < lengths[2] < 0.02 * lengths[0]
    wrist = from_dh([(0, 0, 0, "pi/2"), (0, 0, 0, 0)])
    with View(wrist) as view:
        view.ellipsoid(velocity_ellipsoid(wrist, [0.3, 1.0]))
        assert len(decode_ellipsoids(view._state[Slot.ELLIPSOIDS])) == 0


def test_ghosts_stand_where_the_kinematics_say_each_in_a_tint_of_its_own():
    arm = library_robot("puma560")
    q = np.random.default_rng(0).uniform(-1, 1, (8, arm.n))
    q[3] = np.nan
    with View(arm) as view:
        view.ghosts(q)
        ghosts = decode_ghosts(view._state[Slot.GHOSTS])
        shown = np.delete(q, 3, axis=0)
        assert np.abs(ghosts.transforms - node_transforms(arm, shown)[:, :, :3]).max() < FLOAT32
        assert len({tuple(tint) for tint in ghosts.tints.tolist()}) == 7
        for nothing in (None, q[:0]):
            view.ghosts(nothing)
            assert len(decode_ghosts(view._state[Slot.GHOSTS]).transforms) == 0


def test_obstacles_are_drawn_as_they_stand_and_taken_away():
    arm = library_robot("puma560")
    T = pose(xyz=(0.5, -0.4, 0.2), euler=(0.1, 0.2, 0.5))
    scene = [
        Obstacle.box((0.2, 0.3, 0.4), T),
        Obstacle.sphere(0.15, (0.5, 0.4, 0.3)),
        Obstacle.capsule(0.07, (-0.4, 0.2, 0.1), (-0.4, 0.5, 0.6)),
        Floor(-0.3),
    ]
    with View(arm) as view:
        view.obstacles(scene)
        drawn = decode_obstacles(view._state[Slot.OBSTACLES])
        assert np.abs(drawn.transforms[0] - T[:3]).max() < FLOAT32
        assert np.abs(drawn.half_edges[:2] - [[0.1, 0.15, 0.2], [0, 0, 0]]).max() < FLOAT32
        assert np.abs(drawn.radii - [0, 0.15, 0.07, 0]).max() < FLOAT32
        axis = drawn.half_edges[2, 2] * drawn.transforms[2, :, 2]
        ends = drawn.transforms[2, :, 3] + np.array([[-1], [1]]) * axis
        assert np.abs(ends - [[-0.4, 0.2, 0.1], [-0.4, 0.5, 0.6]]).max() < FLOAT32
        assert drawn.transforms[3, 2, 3] == pytest.approx(-0.3)
        assert drawn.half_edges[3, 0] > scene_size(arm)
        assert drawn.half_edges[3, 2] == 0
        view.obstacles(None)
        assert len(decode_obstacles(view._state[Slot.OBSTACLES]).radii) == 0


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda v: v.show([0, 0, 0]), r"q has shape \(3,\); expected \(\.\.\., 2\)"),
        (lambda v: v.show([[0, 0]]), r"q has shape \(1, 2\); expected \(2,\)"),
        (lambda v: v.show([0, np.nan]), r"q is \[0.0, nan\]; expected finite"),
        (lambda v: v.play(([0, 1], [[0, 0]])), r"q has shape \(1, 2\); expected \(2, 2\)"),
        (lambda v: v.play(([1, 0], np.zeros((2, 2)))), "times do not increase"),
        (lambda v: v.trace([[0, 0]]), r"points has shape \(1, 2\); expected \(N, 3\)"),
        (lambda v: v.trace([[0, 0, np.inf]]), "not finite"),
        (lambda v: v.points([0, 0, 0]), r"positions has shape \(3,\); expected \(N, 3\)"),
        (lambda v: v.points([[0, 0, np.nan]]), "positions has values that are not finite"),
        (
            lambda v: v.points(np.zeros((4, 3)), np.zeros((3, 3))),
            r"colors has shape \(3, 3\); expected \(3,\) or \(4, 3\)",
        ),
        (
            lambda v: v.points([[0, 0, 0]], [[0, 0, 255]]),
            "colors has values that are not from 0 to 1",
        ),
        (lambda v: v.ghosts([0, 0]), r"q has shape \(2,\); expected \(k, 2\)"),
        (lambda v: v.ghosts([[0, 0]], (0, 0, -1)), "tints has values"),
        (lambda v: v.ellipsoid(force_ellipsoid(v.description, [0, 1])), "infinite in a direction"),
        (
            lambda v: v.ellipsoid(velocity_ellipsoid(v.description, [0, 1]), scale=0),
            "scale is 0; expected a positive",
        ),
    ],
)
def test_wrong_arrays_are_named(call, complaint):
    with View(library_robot("planar2r")) as view, pytest.raises(ValueError, match=complaint):
        call(view)


def test_one_offline_file_is_small(tmp_path):
    arm = library_robot("ur5")
    with View(arm) as view:
        view.play(motion(arm, duration=5.0))
        file = view.save_html(tmp_path / "arm.html")
        assert view._server is None
    assert file.stat().st_size < TABLE_DRAWN
    assert [path.name for path in tmp_path.iterdir()] == ["arm.html"]


def test_equal_views_are_equal_files():
    arm = library_robot("planar3r")
    assert View(arm).html() == View(arm).html()


def test_a_closed_view_says_so_at_once():
    view = View(library_robot("planar2r"))
    assert view.url
    started = time.process_time()
    view.close()
    view.close()
    for call in (
        lambda: view.show([0, 0]),
        lambda: view.url,
        lambda: view.wait(60),
        lambda: view.frames(True),
    ):
        with pytest.raises(ModelError, match="closed"):
            call()
    assert time.process_time() - started < WITHIN


def test_opening_shows_the_page_in_the_browser(monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    with View(library_robot("planar2r")) as view:
        assert opened == []
        url = view.open()
        assert url == view.url
    # The address has a token, and others can read a browser's arguments: it stands in a file that they cannot read.
    file = Path(unquote(urlsplit(opened[0]).path))
    assert urlsplit(opened[0]).scheme == "file" and len(opened) == 1
    assert f'content="0; url={url}"' in file.read_text()
    assert file.stat().st_mode & 0o077 == 0 and file.parent.stat().st_mode & 0o077 == 0


def test_a_view_needs_neither_matplotlib_nor_a_server_to_be_imported():
    code = "import sys, dhkit.viewer.view; print([m for m in ('matplotlib', 'meshcat', 'tornado') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_snapshot_has_what_is_drawn_and_a_new_arm_has_none_of_it():
    view = View(library_robot("planar2r"), frames=True)
    assert isinstance(view, Exportable)
    points = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.1]])
    view.trace(points)
    view.ghosts([[0.1, 0.2], [np.nan, 0.0]], tints=(1.0, 0.0, 0.0))
    shown = view.snapshot()
    assert shown.frames and np.array_equal(shown.trace, points)
    assert [ghost.color for ghost in shown.ghosts] == [(255, 0, 0)]
    view.replace(library_robot("planar3r"))
    shown = view.snapshot()
    assert shown.trace is None and shown.ghosts == () and shown.frames
