"""Facts of a view that need no browser."""

import subprocess
import sys
import time

import numpy as np
import pytest

from dhkit.description import library_robot
from dhkit.errors import ModelError
from dhkit.viewer import View
from dhkit.viewer.protocol import decode_animation, decode_pose, decode_trace
from dhkit.viewer.scene import node_transforms
from dhkit.viewer.session import Slot

FLOAT32 = 1e-6
TABLE_DRAWN = 1_500_000  # bytes
WITHIN = 2.0  # s: no call may hang


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


def test_a_notebook_gets_the_state_or_the_live_page():
    with View(library_robot("planar2r")) as view:
        assert 'srcdoc="&lt;!doctype html&gt;' in view._repr_html_()
        assert f'src="{view.url}"' in view._repr_html_()


def test_a_closed_view_says_so_at_once():
    view = View(library_robot("planar2r"))
    assert view.url
    started = time.monotonic()
    view.close()
    view.close()
    for call in (lambda: view.show([0, 0]), lambda: view.url, lambda: view.wait(60), lambda: view.frames(True)):
        with pytest.raises(ModelError, match="closed"):
            call()
    assert time.monotonic() - started < WITHIN


def test_opening_shows_the_page_in_the_browser(monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    with View(library_robot("planar2r")) as view:
        assert opened == []
        assert [view.open()] == opened == [view.url]


def test_a_view_needs_neither_matplotlib_nor_a_server_to_be_imported():
    code = "import sys, dhkit.viewer.view; print([m for m in ('matplotlib', 'meshcat', 'tornado') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
