"""Pictures drawn without a browser: each pixel is the nearest triangle's, the whole arm is in view, files are whole."""

import numpy as np
import pytest
from PIL import Image

from acceptance import different_robots_first
from dhkit import Arm, robots
from dhkit.control import PDGravity
from dhkit.description import library_robot
from dhkit.planning import Floor, Obstacle
from dhkit.viewer import View
from dhkit.viewer.picture_files import write_motion_gif, write_motion_pngs
from dhkit.viewer.pictures import GROUND_COLOR, Ghost, _rasterize, picture, pictures
from dhkit.viewer.scene import node_transforms


def by_pixel(corners, colors, image):
    """Return the same image, pixel by pixel and triangle by triangle, by the sides of the edges."""
    drawn, height, width = image.copy(), *image.shape[:2]
    nearest = np.zeros((height, width))
    for y in range(height):
        for x in range(width):
            for triangle, color in zip(corners, colors, strict=True):
                p = np.array([x + 0.5, y + 0.5])
                (a, b, c), depths = triangle[:, :2], triangle[:, 2]
                whole = np.linalg.det([b - a, c - a])
                weights = np.array(
                    [
                        np.linalg.det([b - p, c - p]),
                        np.linalg.det([c - p, a - p]),
                        np.linalg.det([a - p, b - p]),
                    ]
                )
                weights = weights / whole
                if (weights > 1e-9).all() and weights @ (1 / depths) > nearest[y, x]:
                    nearest[y, x] = weights @ (1 / depths)
                    drawn[y, x] = np.rint(color)
    return drawn


def test_each_pixel_has_the_color_of_the_nearest_triangle():
    rng = np.random.default_rng(4)
    corners = np.concatenate(
        [rng.uniform(-8, 32, (12, 3, 2)), rng.uniform(1, 5, (12, 3, 1))], axis=2
    )
    colors, image = rng.integers(0, 255, (12, 3)).astype(float), np.full((20, 24, 3), 250, np.uint8)
    assert np.array_equal(_rasterize(corners, colors, image), by_pixel(corners, colors, image))


def test_neighbours_leave_no_gap_between_them():
    points = np.array([[3.5, 2.5], [17.25, 4.0], [16.0, 15.5], [2.0, 14.0]])
    corners = np.array(
        [
            [*points[0], 2],
            [*points[1], 2],
            [*points[2], 2],
            [*points[0], 2],
            [*points[2], 2],
            [*points[3], 2],
        ]
    )
    drawn = _rasterize(
        corners.reshape(2, 3, 3), np.zeros((2, 3)), np.full((20, 20, 3), 255, np.uint8)
    )
    for row in drawn[..., 0]:
        dark = np.flatnonzero(row == 0)
        assert len(dark) == 0 or len(dark) == dark[-1] - dark[0] + 1


@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_the_whole_arm_is_in_view_and_fills_it(name):
    image = np.asarray(picture(Arm.load(name).description, size=(200, 150), frames=True)).astype(
        int
    )
    differs = np.abs(image - GROUND_COLOR).max(axis=-1) > 60  # the grid differs by less
    rows, columns = np.flatnonzero(differs.any(axis=1)), np.flatnonzero(differs.any(axis=0))
    assert rows[0] > 0
    assert rows[-1] < 149
    assert columns[0] > 0
    assert columns[-1] < 199
    assert max((rows[-1] - rows[0]) / 150, (columns[-1] - columns[0]) / 200) > 0.5


def test_a_picture_is_that_of_its_state():
    arm = Arm.load("planar2r")
    one, same, other = (
        np.asarray(picture(arm.description, q, size=(160, 120)))
        for q in ([0.2, 0.4], [0.2, 0.4], [1.2, 0.4])
    )
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_a_ghost_is_paler_than_the_arm_and_behind_it():
    arm = Arm.load("planar2r")
    q = np.array([0.2, 0.4])
    here = node_transforms(arm.description, q)
    plain = np.asarray(picture(arm.description, q, size=(160, 120)))
    hidden = np.asarray(
        picture(arm.description, q, size=(160, 120), ghosts=[Ghost(here, (255, 0, 0))])
    )
    assert np.abs(plain.astype(int) - hidden).max() < 60  # only its smoothed edges are seen
    there = node_transforms(arm.description, q + 1.0)
    seen = np.asarray(
        picture(arm.description, q, size=(160, 120), ghosts=[Ghost(there, (255, 0, 0))])
    ).astype(int)
    assert ((seen[..., 0] - seen[..., 1] > 40) & (seen[..., 1] > 120)).sum() > 30


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda d: picture(d, [0.0]), "q has shape|joint"),
        (lambda d: picture(d, [np.nan, 0]), "finite"),
        (lambda d: picture(d, size=(5, 5)), "expected 16 to 4000 px"),
        (lambda d: next(pictures(d, np.zeros((2, 2)), size=(99999, 9))), "expected 16 to 4000 px"),
        (
            lambda d: write_motion_gif(d, ([0, 100.0], np.zeros((2, 2))), "x.gif"),
            "are 1501 pictures; expected at most 900",
        ),
        (lambda d: write_motion_gif(d, ([0, 1.0], np.zeros((2, 2))), "x.gif", rate=0), "rate is 0"),
        (lambda d: View(d).save_gif("x.gif"), "no motion is on show"),
    ],
)
def test_what_cannot_be_drawn_is_said(call, complaint, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=complaint):
        call(Arm.load("planar2r").description)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("rate", [15.0, 40.0, 7.0])
def test_a_gif_lasts_as_long_as_its_motion_though_its_times_are_whole_hundredths(tmp_path, rate):
    arm = library_robot("planar2r")
    times = np.linspace(0, 1.0, 101)
    path = write_motion_gif(
        arm,
        (times, np.stack([times, -times], axis=1)),
        tmp_path / "a.gif",
        rate=rate,
        size=(64, 48),
    )
    with Image.open(path) as gif:
        shown = [gif.seek(k) or gif.info["duration"] for k in range(gif.n_frames)]
    assert sum(shown) == pytest.approx(1000 * (round(rate) + 1) / rate, abs=10)


def test_a_motion_shorter_than_a_picture_has_two(tmp_path):
    path = write_motion_gif(
        library_robot("planar2r"), ([0, 0.01], [[0, 0], [1, 1]]), tmp_path / "a.gif", size=(64, 48)
    )
    with Image.open(path) as gif:
        assert gif.n_frames == 2


def test_a_gif_plays_the_motion_in_real_time(tmp_path):
    arm = Arm.load("planar2r")
    motion = arm.quintic([0.0, 0.2], [1.0, 0.9], 1.2)
    view = arm.view()
    view.play(motion)
    one, same = (
        view.save_gif(tmp_path / "a.gif", (160, 120), rate=10),
        view.save_gif(tmp_path / "b.gif", (160, 120), rate=10),
    )
    assert one.read_bytes() == same.read_bytes()
    with Image.open(one) as gif:
        assert (gif.n_frames, gif.info["duration"], gif.info["loop"]) == (13, 100, 0)
        last = gif.seek(12) or np.asarray(gif.convert("RGB")).astype(int)
    expected = np.asarray(
        list(pictures(arm.description, motion.q(np.array([0.0, 1.2])), size=(160, 120)))[-1]
    ).astype(int)
    assert np.median(np.abs(last - expected)) < 8  # of 128 colors


def test_the_reference_of_a_simulation_moves_along(tmp_path):
    arm = Arm.load("planar2r")
    run = arm.simulate(PDGravity.tuned(arm, 4.0), arm.quintic([0.0, 0.2], [1.5, 0.9], 0.5))
    with_ghost = write_motion_gif(
        arm.description, run, tmp_path / "run.gif", rate=10, size=(160, 120)
    )
    without = write_motion_gif(
        arm.description, (run.t, run.q), tmp_path / "plain.gif", rate=10, size=(160, 120)
    )
    with Image.open(with_ghost) as one, Image.open(without) as other:
        one.seek(3), other.seek(3)
        assert (
            np.any(
                np.abs(
                    np.asarray(one.convert("RGB")).astype(int) - np.asarray(other.convert("RGB"))
                )
                > 25,
                axis=-1,
            ).sum()
            > 30
        )


def test_pictures_of_a_motion_are_numbered(tmp_path):
    arm = Arm.load("planar2r")
    paths = write_motion_pngs(
        arm.description, ([0, 1], [[0, 0], [1, 1]]), tmp_path / "m.png", count=11, size=(80, 60)
    )
    assert [path.name for path in paths] == [f"m-{k:02}.png" for k in range(1, 12)]
    first, last = (np.asarray(Image.open(path)) for path in (paths[0], paths[-1]))
    assert not np.array_equal(first, last)


def test_a_view_is_drawn_with_its_ghosts_path_and_frames(tmp_path):
    view = Arm.load("puma560").view()
    plain = np.asarray(view.picture((160, 120)))
    pictures_of = []
    for change in (
        lambda: view.frames(True),
        lambda: view.ghosts([[1, 0.5, 0, 0, 0, 0]]),
        lambda: view.trace([[0, 0, 1], [1, 0, 1]]),
    ):
        change()
        pictures_of.append(np.asarray(Image.open(view.save_png(tmp_path / "view.png", (160, 120)))))
    for one, other in zip([plain, *pictures_of], pictures_of, strict=False):
        assert (np.abs(one.astype(int) - other).max(axis=-1) > 30).sum() > 50


@pytest.mark.parametrize("length", [1e-5, 0.005, 0.3, 50.0, 1e4])
def test_arms_of_every_size_are_drawn_and_fill_the_picture(length):
    arm = Arm.from_dh([[0, 0, length, 0], [0, 0, length, 0]])
    image = np.asarray(picture(arm.description, [0.3, 0.5], size=(120, 90))).astype(int)
    differs = np.abs(image - GROUND_COLOR).max(axis=-1) > 60
    assert np.ptp(np.flatnonzero(differs.any(axis=0))) > 40


@pytest.mark.slow
def test_many_large_triangles_behind_each_other_take_no_memory():
    import tracemalloc

    corners = np.tile(np.array([[0, 0, 1.0], [1200, 0, 1.0], [0, 900, 1.0]]), (60, 1, 1))
    corners[..., 2] += np.linspace(1, 0, 60)[:, None]
    colors = np.zeros((60, 3))
    colors[-1] = 200
    tracemalloc.start()
    drawn = _rasterize(corners, colors, np.zeros((900, 1200, 3), np.uint8))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1e9  # all at once would need 4e9
    assert (drawn[10, 10] == 200).all()  # the last is the nearest


def test_obstacles_are_drawn_and_in_view():
    arm = library_robot("planar2r")
    ball = Obstacle.sphere(0.3, (0.0, -2.0, 0.0), name="ball")
    alone = np.asarray(picture(arm, [0.3, 0.4]))
    beside = np.asarray(picture(arm, [0.3, 0.4], obstacles=[ball, Floor()]))
    # Violet, as in the viewer: more blue than green; nothing else in the picture is.
    violet = beside[..., 2].astype(int) - beside[..., 1] > 12
    assert not (alone[..., 2].astype(int) - alone[..., 1] > 12).any()
    rows, columns = np.nonzero(violet)
    # A ball looks nearly round, and the whole of it is in the picture.
    height, width = np.ptp(rows), np.ptp(columns)
    assert 0.9 < height / width < 1.1
    assert rows.min() > 0 and rows.max() < beside.shape[0] - 1
    assert columns.min() > 0 and columns.max() < beside.shape[1] - 1
    assert violet.sum() == pytest.approx(np.pi / 4 * height * width, rel=0.05)
