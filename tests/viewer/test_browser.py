"""The page in a headless Chromium: it shows the arm, where it should be, offline and live, and serves a person."""

import time
from dataclasses import replace

import numpy as np
import pytest

from acceptance import in_time
from dhkit.description import library_robot, world_to_tool
from dhkit.kinematics.manipulability import velocity_ellipsoid
from dhkit.model.shapes import link_parts
from dhkit.planning import Floor, Obstacle
from dhkit.viewer import View
from dhkit.viewer.drawables import part_transform
from dhkit.viewer.page import offline_page
from dhkit.viewer.protocol import encode_pose, encode_scene
from dhkit.viewer.scene import build_scene, node_transforms
from simulation_results import swinging
from viewer.pictures import MINIMUM, centre, green, orange, shows_the_arm
from viewer.test_view import motion

PIXELS = 4.0  # a ball's outline is a little off its centre in perspective
FLOAT32 = 2e-6  # m, on an arm of 2 m
BETWEEN_PANELS = slice(70, 620)  # rows: the panels have the trace's color too
LOST = 2.0  # s until a page says that the connection is lost
MAX_PANEL_MESSAGES = [(0.4, 0.2), (-0.9, 0.9), (0.9, -0.4)]
"""In each of them the ball is in front of the column, seen from where the page looks."""


@pytest.fixture
def page(chromium):
    opened = chromium.page()
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def live_page(chromium, signal_arm):
    """A view of the signal arm and a page on it, for tests that show things there and take them away."""
    opened = chromium.page()
    with View(signal_arm) as view:
        opened.open(view.url)
        yield view, opened
    opened.close()


@pytest.fixture
def live(live_page):
    """That view and page, with the arm alone in its first pose; the page must have met no error."""
    view, opened = live_page
    for take_away in (view.points, view.ghosts, view.obstacles):
        take_away(None)
    view.show(MAX_PANEL_MESSAGES[0])
    view.wait()
    assert (
        opened.evaluate("dhkit.stage.overlays.empty && document.getElementById('overlays').hidden")
        is True
    )
    yield view, opened
    errors, opened.errors = opened.errors, []
    assert errors == []


def open_offline(page, view, folder):
    page.open(f"file://{view.save_html(folder / 'arm.html')}")


def hosts(page):
    """Return the addresses that a page has asked for outside itself."""
    return [url for url in page.requests if not url.startswith(("file:///", "data:", "blob:"))]


def projected(page, point):
    """Return where a point of the world is on the picture, from the camera's matrices alone; px."""
    camera = page.evaluate(
        "(c => [c.projectionMatrix.elements, c.matrixWorldInverse.elements])(dhkit.stage.viewer.camera)"
    )
    projection, view = (np.reshape(matrix, (4, 4)).T for matrix in camera)
    x, y, z = point
    clip = projection @ view @ (x, z, -y, 1)
    width, height = page.evaluate("[innerWidth, innerHeight]")
    return np.array([(1 + clip[0] / clip[3]) * width / 2, (1 - clip[1] / clip[3]) * height / 2])


def check_tool(page, picture, arm, q):
    expected = projected(page, world_to_tool(arm, q)[:3, 3])
    assert np.linalg.norm(centre(green(picture)) - expected) < PIXELS


def test_an_offline_file_shows_the_arm_and_asks_nobody(page, signal_arm, tmp_path):
    view = View(signal_arm)
    view.show(MAX_PANEL_MESSAGES[0])
    open_offline(page, view, tmp_path)
    picture = page.screenshot()
    assert shows_the_arm(picture)
    check_tool(page, picture, signal_arm, MAX_PANEL_MESSAGES[0])
    assert hosts(page) == []
    assert page.errors == []


def test_an_empty_scene_shows_no_arm(page, signal_arm, tmp_path):
    scene, q = build_scene(signal_arm, ()), np.zeros(2)
    messages = [encode_scene(scene), encode_pose(q, node_transforms(signal_arm, q))]
    (tmp_path / "empty.html").write_text(offline_page(messages, "empty"))
    page.open(f"file://{tmp_path}/empty.html")
    picture = page.screenshot()
    assert not shows_the_arm(picture)
    assert green(picture).sum() < MINIMUM / 10


def test_a_live_page_follows(live, signal_arm):
    view, page = live
    for q in MAX_PANEL_MESSAGES:
        view.show(q)
        view.wait()
        picture = page.screenshot()
        assert shows_the_arm(picture)
        check_tool(page, picture, signal_arm, q)
    own = view.url.removeprefix("http://").split("/")[0]
    assert {url.split("/")[2] for url in hosts(page)} == {own}


@pytest.mark.parametrize("name", ["puma560", "stanford"])
def test_every_drawn_part_stands_where_python_says_and_the_page_invents_no_nodes(page, name):
    arm, in_view = (
        library_robot(name),
        np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]]),
    )
    q = np.random.default_rng(1).uniform(-1, 1, arm.n)
    parts = link_parts(arm)
    with View(arm) as view:
        view.show(q)
        page.open(view.url)
        view.wait()
        drawn = page.evaluate(
            "dhkit.stage.nodes.map(node => { node.updateMatrixWorld(true); return node.children"
            ".filter(c => c.name.startsWith('part')).map(c => [c.name, c.matrixWorld.elements]); })"
        )
        names = page.evaluate("Object.keys(dhkit.stage.viewer.scene_tree.children.dhkit.children)")
    assert sorted(names) == ["grid", *(f"link{k}" for k in range(arm.n + 1)), "tool"]
    nodes, count = node_transforms(arm, q), {}
    for part in parts:
        k = count[part.link] = count.get(part.link, -1) + 1
        seen = np.reshape(dict(drawn[part.link])[f"part{k}"], (4, 4)).T
        assert np.abs(seen - in_view @ nodes[part.link] @ part_transform(part)).max() < FLOAT32
    assert sum(map(len, drawn)) == len(parts)


def test_a_motion_plays_pauses_and_draws_its_path(page, signal_arm, tmp_path):
    view = View(signal_arm)
    view.play(([0, 4], [(0.3, 0.0), (1.8, 0.9)]))
    open_offline(page, view, tmp_path)
    page.until("dhkit.player.time > 0.1")
    page.press(" ")
    assert page.evaluate("dhkit.player.playing") is False
    seen = []
    for time_ in (0.0, 1.0, 2.5, 4.0):
        page.evaluate(f"dhkit.player.seek({time_})")
        picture = page.screenshot()
        q = np.array([0.3, 0.0]) + time_ / 4 * np.array([1.5, 0.9])
        check_tool(page, picture, signal_arm, q)
        seen.append(orange(picture)[BETWEEN_PANELS].sum())
        degrees = page.evaluate(
            "[...document.querySelectorAll('#joints td')].map(cell => cell.textContent)"
        )
        assert [float(x[:-1].replace("\u2212", "-")) for x in degrees] == pytest.approx(
            np.degrees(q), abs=0.051
        )
    assert seen == sorted(seen)
    assert seen[0] < 50 < seen[1] < seen[2] < seen[3]
    page.press("t")
    assert orange(page.screenshot())[BETWEEN_PANELS].sum() < 50
    page.press(" ")  # from the end: once more
    page.until("dhkit.player.playing && dhkit.player.time < 3.5")
    assert hosts(page) == []


def test_the_whole_motion_is_in_view(page, tmp_path):
    arm = library_robot("stanford")
    view = View(arm)
    view.play(motion(arm, seed=4))
    open_offline(page, view, tmp_path)
    page.press(" ")
    for time_ in np.linspace(0, 2, 5):
        page.evaluate(f"dhkit.player.seek({time_})")
        page.settle()
        places = page.evaluate("dhkit.stage.nodes.map(node => dhkit.stage.project(node.position))")
        for place in places:
            assert 0 < place["x"] < 900
            assert 0 < place["y"] < 700


def test_someone_who_asked_for_less_motion_gets_a_still(page, signal_arm, tmp_path):
    page.scheme("light", motion="reduce")
    view = View(signal_arm)
    view.play(([0, 1], [[0, 0], [1, 1]]))
    open_offline(page, view, tmp_path)
    page.settle()
    assert page.evaluate("dhkit.player.playing") is False
    assert page.evaluate("dhkit.player.time") == 0


def test_frames_and_labels_come_on_request(page):
    with View(library_robot("puma560")) as view:
        page.open(view.url)
        shown = "[...document.querySelectorAll('#labels span')].filter(s => s.offsetWidth).map(s => s.textContent)"
        triads = "dhkit.stage.triads.filter(triad => triad && triad.visible).length"
        assert page.evaluate(shown) == []
        assert page.evaluate(triads) == 0
        view.frames(True)
        view.wait()
        assert page.evaluate(shown) == ["0", "1", "2", "3", "4, 5, 6 = tool"]
        assert page.evaluate(triads) == 7  # 6 is the tool's
        page.press("f")
        assert page.evaluate(shown) == []


def test_a_lost_page_comes_back_with_the_latest_state(page, signal_arm):
    with View(signal_arm) as view:
        page.open(view.url)
        server = view._server
        for connected in tuple(server.pages):
            server._loop.call_soon_threadsafe(connected.close)
        view.show(MAX_PANEL_MESSAGES[1])
        page.until("!document.getElementById('banner').hidden")
        page.until("document.getElementById('banner').hidden")
        view.wait()
        check_tool(page, page.screenshot(), signal_arm, MAX_PANEL_MESSAGES[1])


def test_a_page_says_when_python_is_gone(page, signal_arm):
    view = View(signal_arm)
    page.open(view.url)
    started = time.monotonic()
    view.close()
    page.until("/lost/.test(document.getElementById('banner').textContent)")
    in_time(time.monotonic() - started, LOST)


@pytest.mark.parametrize(
    "layouts",
    [
        [((390, 844), False), ((390, 844), True), ((844, 390), True)],
        [((768, 1024), True), ((1200, 800), False)],
    ],
    ids=["small", "large"],
)
def test_nothing_is_clipped_or_covered_and_every_control_has_a_name(
    page, signal_arm, tmp_path, layouts
):
    """Whether the readout is open is decided once, by the size of the page that is loaded."""
    page.resize(*layouts[0][0])
    view = View(signal_arm, frames=True)
    view.play(([0, 1], [MAX_PANEL_MESSAGES[0], MAX_PANEL_MESSAGES[1]]))
    open_offline(page, view, tmp_path)
    page.press(" ")
    page.press("Home")
    for size, dark in layouts:
        page.resize(*size)
        page.scheme("dark" if dark else "light")
        page.settle()
        check_layout(page, size, dark)


def check_layout(page, size, dark):
    """Check that nothing is clipped or covered and every control has a name, at a size in a scheme."""
    where = f"{size}, {'dark' if dark else 'light'}"
    panels = page.evaluate(
        "['readout', 'tools', 'player'].map(id => document.getElementById(id).getBoundingClientRect().toJSON())"
    )
    for panel in panels:
        assert 0 <= panel["left"] < panel["right"] <= size[0], where
        assert 0 <= panel["top"] < panel["bottom"] <= size[1], where
    for k, a in enumerate(panels):
        for b in panels[:k]:
            across = a["left"] < b["right"] and b["left"] < a["right"]
            assert not (across and a["top"] < b["bottom"] and b["top"] < a["bottom"]), where
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0], where
    edges = page.evaluate(
        "[...document.querySelectorAll('#labels span')].map(s => s.getBoundingClientRect().right)"
    )
    assert len(edges) == 3, where
    assert max(edges) <= size[0], where
    unnamed = page.evaluate(
        "[...document.querySelectorAll('input, select, button, summary')]"
        ".filter(e => !(e.ariaLabel || e.textContent.trim())).map(e => e.outerHTML)"
    )
    assert unnamed == [], where
    picture = page.screenshot()
    assert shows_the_arm(picture), where
    assert (picture[size[1] // 2, 2].mean() < 80) == dark, where


def test_the_whole_page_works_by_keyboard(page, signal_arm, tmp_path):
    view = View(signal_arm)
    view.play(([0, 1], [MAX_PANEL_MESSAGES[0], MAX_PANEL_MESSAGES[1]]))
    open_offline(page, view, tmp_path)
    page.press("End")
    assert page.evaluate("dhkit.player.time") == 1
    page.press("ArrowLeft")
    assert page.evaluate("dhkit.player.time") == pytest.approx(1 - 1 / 30)
    page.press("Home")
    assert page.evaluate("dhkit.player.time") == 0
    page.press("l")
    assert page.evaluate("dhkit.player.loop") is True
    names = []
    for _ in range(10):
        page.call(
            "Input.dispatchKeyEvent", type="keyDown", key="Tab", code="Tab", windowsVirtualKeyCode=9
        )
        names.append(page.evaluate("document.activeElement.id || document.activeElement.localName"))
    assert names == [
        "summary",
        "frames",
        "trace",
        "person",
        "reset",
        "play",
        "time",
        "speed",
        "loop",
        "body",
    ]


BLUE = (0.0, 0.0, 1.0)
CROSS = 0.03 * np.concatenate([np.eye(3), -np.eye(3), np.zeros((1, 3))])  # m


def blue(picture):
    """Return which pixels are a pure blue that nothing else has."""
    r, g, b = np.moveaxis(picture, -1, 0)
    return (b > 150) & (r < 60) & (g < 60)


def test_a_cloud_of_points_is_where_it_should_be_until_it_is_taken_away(live):
    view, page = live
    point = (0.5, -0.3, 0.4)
    view.points(np.array(point) + CROSS, BLUE)
    view.wait()
    picture = page.screenshot()
    assert blue(picture).sum() > 4
    assert np.linalg.norm(centre(blue(picture)) - projected(page, point)) < PIXELS
    page.press("o")
    assert blue(page.screenshot()).sum() == 0
    page.press("o")
    assert blue(page.screenshot()).sum() > 4
    view.points(None)
    view.wait()
    assert blue(page.screenshot()).sum() == 0
    assert page.evaluate("document.getElementById('overlays').hidden") is True


def test_a_large_cloud_is_all_in_view(page, signal_arm, tmp_path):
    view = View(signal_arm)
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0, 1.5)]
    view.points(corners, BLUE)
    open_offline(page, view, tmp_path)
    for corner in corners:
        x, y = projected(page, corner)
        assert 0 < x < 900
        assert 0 < y < 700


def test_an_ellipsoid_is_seen_around_the_tool(page, signal_arm, tmp_path):
    q = MAX_PANEL_MESSAGES[0]
    ellipsoid, tool = velocity_ellipsoid(signal_arm, q), world_to_tool(signal_arm, q)[:3, 3]
    view = View(signal_arm)
    view.show(q)
    view.ellipsoid(ellipsoid)
    open_offline(page, view, tmp_path)
    picture = page.screenshot()
    page.evaluate("dhkit.stage.touched = true")  # so that the camera stays
    page.press("o")
    seen = (np.abs(picture - page.screenshot()).max(axis=-1) > 10)[BETWEEN_PANELS]
    assert seen.sum() > 5000  # px
    assert (
        np.linalg.norm(centre(seen) + np.array([0, BETWEEN_PANELS.start]) - projected(page, tool))
        < PIXELS
    )
    # What the page draws maps the unit ball as Python says, and its middle is the tool.
    drawn = page.evaluate(
        "dhkit.stage.overlays.layers.ellipsoids.group.children[0].matrix.elements"
    )
    T = np.reshape(drawn, (4, 4)).T
    assert np.abs(T[:3, 3] - tool).max() < FLOAT32
    lengths = np.linalg.norm(T[:3, :3], axis=0)
    assert lengths[1] / lengths[0] == pytest.approx(
        ellipsoid.lengths[1] / ellipsoid.lengths[0], rel=1e-5
    )
    check_tool(page, picture, signal_arm, q)
    assert hosts(page) == []
    assert page.errors == []


def check_copies(page, layer, transforms):
    """Check that a layer's copies of the nodes stand where transforms, shape (..., n + 2, 4, 4), have them."""
    copies = page.evaluate(
        f"dhkit.stage.overlays.layers.{layer}.group.children"
        ".map(copy => { copy.updateMatrixWorld(true); return copy.matrixWorld.elements; })"
    )
    in_view = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    expected = transforms[..., 1:, :, :].reshape(-1, 4, 4)  # without the base
    assert len(copies) == len(expected)
    for copy, T in zip(copies, expected, strict=True):
        assert np.abs(np.reshape(copy, (4, 4)).T - in_view @ T).max() < FLOAT32


def test_ghosts_are_copies_that_come_and_go_with_the_arm_left_alone(live, signal_arm):
    view, page = live
    view.ghosts([MAX_PANEL_MESSAGES[1], MAX_PANEL_MESSAGES[2]], BLUE)
    view.wait()
    check_copies(
        page, "ghosts", node_transforms(signal_arm, [MAX_PANEL_MESSAGES[1], MAX_PANEL_MESSAGES[2]])
    )
    picture = page.screenshot()
    assert shows_the_arm(picture)
    check_tool(page, picture, signal_arm, MAX_PANEL_MESSAGES[0])
    # A bluish ball where each ghost's tool is.
    for q in (
        MAX_PANEL_MESSAGES[1],
        MAX_PANEL_MESSAGES[2],
    ):
        x, y = projected(page, world_to_tool(signal_arm, q)[:3, 3]).astype(int)
        r, g, b = picture[y, x]
        assert b > r + 25
        assert b > g + 25
    view.show(MAX_PANEL_MESSAGES[2])
    view.ghosts(None)
    view.wait()
    check_tool(page, page.screenshot(), signal_arm, MAX_PANEL_MESSAGES[2])
    assert page.evaluate("dhkit.stage.overlays.empty") is True


def apart(arm, seconds=3.0):
    """Return a result whose reference is far from its motion; both are straight lines between joint values."""
    result = swinging(arm, states=31, seconds=seconds)
    share = (result.t / seconds)[:, None]
    wanted = np.array([0.4, 0.2]) + share * np.array([-1.3, 0.7])
    return replace(result, q=wanted + np.array([0.5, -0.6]), reference_q=wanted)


@pytest.mark.parametrize("live", [False, True])
def test_a_simulation_plays_with_its_reference_as_a_ghost(page, signal_arm, tmp_path, live):
    result = apart(signal_arm)
    with View(signal_arm) as view:
        view.play(result)
        if live:
            page.open(view.url)
        else:
            open_offline(page, view, tmp_path)
        page.until("dhkit.player.time > 0.1")
        page.press(" ")
        tools = []
        for time_ in (0.0, 1.2, 3.0):
            page.evaluate(f"dhkit.player.seek({time_})")
            picture = page.screenshot()
            share = time_ / 3.0
            q, wanted = (
                (1 - share) * states[0] + share * states[-1]
                for states in (result.q, result.reference_q)
            )
            check_copies(page, "companion", node_transforms(signal_arm, wanted))
            check_tool(page, picture, signal_arm, q)
            tools.append(projected(page, world_to_tool(signal_arm, wanted)[:3, 3]))
            r, g, b = picture[int(tools[-1][1]), int(tools[-1][0])]
            assert b > r + 15  # a bluish ball at the ghost's tool
            assert b > g
            assert ((tools[-1] > 0) & (tools[-1] < (900, 700))).all()
        assert np.linalg.norm(tools[-1] - tools[0]) > 50  # px
        page.press("o")
        assert page.evaluate("dhkit.stage.overlays.layers.companion.group.visible") is False
        assert page.errors == []


def test_the_ghost_of_a_simulation_goes_with_it(live, signal_arm):
    view, page = live
    for replay in (
        lambda: view.play(([0, 1], MAX_PANEL_MESSAGES[:2])),
        lambda: view.show(MAX_PANEL_MESSAGES[0]),
    ):
        view.play(apart(signal_arm))
        view.wait()
        assert page.evaluate("dhkit.stage.overlays.layers.companion.group.children.length") == 3
        assert page.evaluate("document.getElementById('overlays').hidden") is False
        replay()
        view.wait()
        assert page.evaluate("dhkit.stage.overlays.layers.companion.group.children.length") == 0
        assert page.evaluate("document.getElementById('overlays').hidden") is True
    check_tool(page, page.screenshot(), signal_arm, MAX_PANEL_MESSAGES[0])


def test_a_ghost_behind_the_arm_does_not_flicker_through_it(page, signal_arm, tmp_path):
    view = View(signal_arm)
    close = replace(apart(signal_arm), reference_q=apart(signal_arm).q + 1e-6)
    view.play(close, trace=False)
    open_offline(page, view, tmp_path)
    page.press(" ")
    page.evaluate("dhkit.player.seek(1)")
    beside = page.screenshot()[BETWEEN_PANELS]
    page.press("o")
    alone = page.screenshot()[BETWEEN_PANELS]
    arm = green(alone)
    changed = (np.abs(beside - alone).max(axis=-1) > 10) & arm
    assert changed.sum() < 0.03 * arm.sum()  # on the outline


def test_obstacles_stand_where_they_are_and_their_sizes_are_true(page, signal_arm, tmp_path):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.diag([-1, -1, 1]), (0.5, -0.4, 0.2)
    scene = [
        Obstacle.box((0.2, 0.3, 0.4), T),
        Obstacle.sphere(0.15, (0.5, 0.4, 0.3)),
        Obstacle.capsule(0.1, (-0.4, 0.5, 0.3), (-0.4, 0.5, 0.6)),
        Floor(-0.2),
    ]
    view = View(signal_arm)
    view.obstacles(scene)
    open_offline(page, view, tmp_path)
    boxes = page.evaluate(
        "dhkit.stage.overlays.layers.obstacles.group.children.map(child => {"
        " const box = child.geometry.boundingBox.clone().applyMatrix4(child.matrix);"
        " return [...box.min.toArray(), ...box.max.toArray()]; })"
    )
    expected = [
        (0.4, -0.55, 0, 0.6, -0.25, 0.4),
        (0.35, 0.25, 0.15, 0.65, 0.55, 0.45),
        (-0.5, 0.4, 0.2, -0.3, 0.6, 0.7),
    ]
    assert np.abs(np.array(boxes[:3]) - expected).max() < FLOAT32
    assert np.array(boxes[3])[[2, 5]] == pytest.approx([-0.2, -0.2])
    # Violet where it was the colour of the ground, and the arm is still there.
    x, y = projected(page, (0.5, 0.4, 0.3)).astype(int)
    picture = page.screenshot()
    r, g, b = picture[y, x]
    assert b > g + 20
    assert shows_the_arm(picture)
    # The floor has no end: it is not what the camera takes in.
    reach = page.evaluate("dhkit.stage.overlays.layers.obstacles.box.max.toArray()")
    assert np.abs(np.array(reach) - [0.65, 0.6, 0.7]).max() < FLOAT32
    page.evaluate("dhkit.stage.touched = true")  # so that the camera stays
    page.press("o")
    assert page.evaluate("dhkit.stage.overlays.layers.obstacles.group.visible") is False
    assert not np.array_equal((r, g, b), page.screenshot()[y, x])
    assert page.errors == []


def test_what_lies_below_the_ground_is_seen(page, signal_arm, tmp_path):
    view = View(signal_arm)
    view.obstacles([Obstacle.sphere(0.12, (0.7, -0.5, -0.4))])
    open_offline(page, view, tmp_path)
    x, y = projected(page, (0.7, -0.5, -0.4)).astype(int)
    _, g, b = page.screenshot()[y, x]
    assert b > g + 20


def test_live_obstacles_come_and_go(live):
    view, page = live
    view.obstacles([Obstacle.sphere(0.1, (0.5, 0.4, 0.3))])
    view.wait()
    assert page.evaluate("document.getElementById('overlays').hidden") is False
    view.obstacles(None)
    view.wait()
    assert page.evaluate("dhkit.stage.overlays.empty") is True
    assert page.evaluate("document.getElementById('overlays').hidden") is True
