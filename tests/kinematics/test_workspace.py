"""Laws of sampled workspaces: points inside the reach, areas that are known, seeds, and arms without limits."""

import pickle
from importlib import import_module

import numpy as np
import pytest

from dhkit import Arm
from dhkit.description import from_dh, library_robot, pose, robots, with_base
from dhkit.description.robot_file import from_toml
from dhkit.kinematics import forward_kinematics
from dhkit.kinematics.manipulability import manipulability
from dhkit.kinematics.workspace import (
    CHUNK,
    Grid,
    distributed_workspace,
    workspace,
)

ROUNDING = 1e-12  # m
RARE = 1e-3  # m: how near 100,000 random elbows come to stretched, and to folded
FEW = 3_000


def planar(l1, l2):
    return from_dh([(0, 0, l1, 0), (0, 0, l2, 0)])


@pytest.mark.parametrize("name", robots())
def test_points_lie_inside_the_reach_and_the_limits(name):
    arm = library_robot(name)
    space = workspace(arm, FEW)
    offsets = np.linalg.norm(
        [arm.numbers.T_world_base[:3, 3], arm.numbers.T_last_tool[:3, 3]], axis=1
    ).sum()
    assert np.linalg.norm(space.positions, axis=1).max() <= arm.reach + offsets + ROUNDING
    assert space.distances[0] <= space.distances[1] <= arm.reach + offsets + ROUNDING
    assert space.radii[1] <= space.distances[1] + ROUNDING
    limited = np.isfinite(arm.numbers.lower)
    assert np.array_equal(space.lower[limited], arm.numbers.lower[limited])
    assert np.array_equal(space.upper[limited], arm.numbers.upper[limited])
    assert np.all((space.best >= space.lower) & (space.best <= space.upper))
    assert space.manipulability.max() == pytest.approx(
        float(manipulability(arm, space.best)), rel=1e-12
    )
    assert space.grid.counts.sum() == space.samples == FEW


@pytest.mark.parametrize("lengths", [(1.0, 1.0), (1.0, 0.5), (0.3, 0.7)])
@pytest.mark.parametrize("tilted", [False, True])
def test_the_area_of_a_planar_arm_is_a_ring(lengths, tilted):
    """pi ((l1 + l2)^2 - (l1 - l2)^2), in whatever plane the arm stands."""
    arm, (l1, l2) = planar(*lengths), lengths
    if tilted:
        arm = with_base(arm, pose((0.1, 0.2, 0.3), euler=(0.3, 0.4, 0.5)))
    space = workspace(arm, 100_000)
    ring = np.pi * ((l1 + l2) ** 2 - (l1 - l2) ** 2)
    assert space.estimate.dimension == 2
    assert abs(space.estimate.value - ring) < space.estimate.margin
    # 20 samples a cell leave few holes.
    assert space.estimate.value == pytest.approx(ring, rel=0.02)
    assert "m²" in str(space.estimate)
    base = arm.numbers.T_world_base[:3, 3]
    assert np.allclose(
        np.linalg.norm(space.positions - base, axis=1).max(), space.distances[1], atol=ROUNDING
    )
    assert space.distances == pytest.approx((abs(l1 - l2), l1 + l2), abs=RARE)


def test_the_volume_of_an_arm_with_two_equal_links_is_a_ball():
    space = workspace(from_dh([(0, 0, 0, "pi/2"), (0, 0, 1, 0), (0, 0, 1, 0)]), 100_000)
    ball = 4 / 3 * np.pi * 2**3
    assert space.freedoms == space.estimate.dimension == 3
    assert abs(space.estimate.value - ball) < space.estimate.margin
    assert space.estimate.value == pytest.approx(ball, rel=0.06)


def test_more_samples_and_finer_cells_make_the_margin_smaller():
    arm = planar(1, 0.5)
    few, many = workspace(arm, 5_000), workspace(arm, 100_000)
    assert many.grid.edge < few.grid.edge
    assert many.estimate.margin < few.estimate.margin / 3


def test_limits_are_kept():
    arm = from_toml(
        'format = 1\nname = "part"\nconvention = "standard"\n'
        '[[joint]]\ntype = "revolute"\na = 1\nalpha = 0\nd = 0\ntheta = 0\nlimits = [0, "pi/2"]\n'
        '[[joint]]\ntype = "prismatic"\na = 0\nalpha = 0\nd = 0\ntheta = 0\nlimits = [0.1, 0.4]\n',
        file="part.toml",
    )
    space = workspace(arm, FEW)
    x, y, z = space.positions.T
    assert np.allclose(np.hypot(x, y), 1, rtol=0, atol=ROUNDING)
    assert min(x.min(), y.min()) > -ROUNDING
    assert z.min() >= 0.1
    assert z.max() <= 0.4
    assert space.freedoms == 2
    assert space.estimate is None  # a piece of a cylinder


@pytest.mark.parametrize(
    ("rows", "kinds", "freedoms", "dimension"),
    [
        ([(0, 0, 0.7, 0)], "R", 1, None),  # a circle
        ([(0, 0.5, 0, 0)], "R", 0, None),  # a point
        ([(0, 0, 0, 0)], "P", 1, 1),
        ([(0, 0.3, 0.2, "pi/2")], "P", 1, 1),
        ([(0, 0, 0, "pi/2"), (0, 0, 0, 0)], "PP", 2, 2),
        ([(0, 0, 0, "pi/2"), ("pi/2", 0, 0, "pi/2"), (0, 0, 0, 0)], "PPP", 3, 3),
    ],
)
def test_small_arms(rows, kinds, freedoms, dimension):
    arm = from_dh(rows, kinds=kinds)
    space = workspace(arm, FEW)
    assert space.freedoms == freedoms
    assert space.samples == FEW
    if dimension is None:
        assert space.estimate is None
        return
    # Each slider is given the reach, or 1 m where there is none, to both sides; and is told of.
    room = 2 * (arm.reach or 1.0)
    assert space.estimate.dimension == dimension
    assert abs(space.estimate.value - room**dimension) <= space.estimate.margin + 0.01 * room
    assert len(space.assumed) == len(kinds)
    assert "joint 1 joint1 has no limits: it was moved" in space.assumed[0]


def test_an_unlimited_slider_is_given_the_reach():
    arm = from_dh([(0, 0, 0.4, 0), (0, 0.1, 0, 0)], kinds="RP")
    space = workspace(arm, FEW)
    assert space.lower.tolist() == [-np.pi, -0.5]
    assert space.upper.tolist() == [np.pi, 0.5]
    assert len(space.assumed) == 1


def test_a_seed_gives_the_same_and_another_something_else():
    arm = library_robot("puma560")
    Arm(arm).compile()  # a kernel that is compiled between two calls rounds otherwise
    one, again, other = (
        workspace(arm, FEW, 5),
        workspace(arm, FEW, 5, threads=2),
        workspace(arm, FEW, 6),
    )
    for key in ("positions", "manipulability", "best"):
        assert np.array_equal(getattr(one, key), getattr(again, key))
        assert not np.array_equal(getattr(one, key), getattr(other, key))


def test_fewer_samples_are_the_first_of_more_whatever_the_chunks():
    arm = library_robot("planar2r")
    calls = []
    many = workspace(arm, CHUNK + 100, progress=lambda done, total: calls.append((done, total)))
    few = workspace(arm, 200)
    assert np.array_equal(many.positions[:200], few.positions)
    # A first pass over the two chunks measures the box, a quarter of the work, and a second one counts.
    total = CHUNK + 100
    assert [done for done, _ in calls] == [
        CHUNK // 4,
        total // 4,
        (total + 3 * CHUNK) // 4,
        total,
    ]
    assert {whole for _, whole in calls} == {total}
    # The last chunk is worked on like the first.
    rng = np.random.default_rng(0)
    q = many.lower + (many.upper - many.lower) * rng.random((CHUNK + 100, 2))
    assert np.allclose(
        many.positions[-100:], forward_kinematics(arm, q[-100:])[:, :3, 3], rtol=0, atol=ROUNDING
    )


def test_radii_are_measured_from_the_first_axis_in_either_convention():
    """An arm written twice: what the modified table puts before the first joint is the standard one's base."""
    modified = from_dh(
        [("pi/2", 0.2, 0, 0), (0, 0.5, 0.1, 0)],
        order=("alpha", "a", "d", "theta"),
        convention="modified",
    )
    standard = with_base(
        from_dh([(0, 0, 0.5, 0), (0, 0.1, 0, 0)]), pose((0.2, 0, 0), euler=(np.pi / 2, 0, 0))
    )
    assert workspace(modified, FEW).radii == pytest.approx((0.5, 0.5), abs=ROUNDING)
    assert workspace(standard, FEW).radii == pytest.approx((0.5, 0.5), abs=ROUNDING)


@pytest.mark.parametrize("samples", [FEW, CHUNK + FEW])
@pytest.mark.parametrize(
    "arm",
    [
        library_robot("puma560"),
        with_base(planar(1, 0.5), pose((0.1, 0.2, 0.3), euler=(0.3, 0.4, 0.5))),
        from_dh([(0, 0.3, 0.2, "pi/2")], kinds="P"),
    ],
)
def test_a_grid_finds_its_points_again(arm, samples):
    space = workspace(arm, samples)
    grid = space.grid
    cells = np.floor((space.positions - grid.origin) @ grid.axes.T / grid.edge + 1e-9).astype(int)
    cells = tuple(np.clip(cells, 0, np.array(grid.counts.shape) - 1).T)
    counts = np.zeros_like(grid.counts)
    np.add.at(counts, cells, 1)
    # Rounding moves a point at the border between two cells.
    assert np.abs(counts - grid.counts).sum() <= 4
    assert np.allclose(grid.axes @ grid.axes.T, np.eye(len(grid.axes)), rtol=0, atol=1e-14)
    best = np.full(counts.shape, -np.inf)
    np.maximum.at(best, cells, space.manipulability)
    assert np.array_equal(np.isnan(grid.manipulability), grid.counts == 0)
    assert np.mean(best[grid.counts > 0] == grid.manipulability[grid.counts > 0]) > 0.99


def test_the_estimate_of_a_full_box_is_between_its_inner_and_its_outer_cells():
    ones = np.ones((5, 5, 5), dtype=np.int64)
    estimate = Grid(np.zeros(3), np.eye(3), 1.0, ones, ones.astype(float)).estimate
    assert (estimate.value, estimate.margin) == ((5**3 + 3**3) / 2, (5**3 - 3**3) / 2)


def test_quantiles_are_those_of_the_samples_but_for_the_bins():
    space = workspace(library_robot("puma560"), CHUNK + FEW)
    for share in (0.0, 0.05, 0.5, 0.95, 1.0):
        exact = np.quantile(space.manipulability, share, method="inverted_cdf")
        assert space.quantile(share) == pytest.approx(exact, rel=1 / 8192)
    assert workspace(from_dh([(0, 0.5, 0, 0)]), 10).quantile(0.5) == 0.0  # a point
    assert workspace(from_dh([(0, 0, 0, 0)], kinds="P"), 10).quantile(0.5) == 1.0


def assert_same(one, other):
    """Hold all arrays of two workspaces to the same digits."""
    for name in ("positions", "manipulability", "bounds", "best", "histogram"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    assert (one.distances, one.radii) == (other.distances, other.radii)
    assert one.largest_manipulability == other.largest_manipulability
    for mine, theirs in [(one.grid, other.grid), *zip(one.maps, other.maps, strict=True)]:
        assert mine.edge == theirs.edge
        assert np.array_equal(mine.manipulability, theirs.manipulability, equal_nan=True)
    assert np.array_equal(one.grid.counts, other.grid.counts)


@pytest.mark.parametrize("longest", [1, 3, 100])
def test_no_digit_depends_on_the_runs_of_chunks_or_on_their_order(longest):
    arm = library_robot("planar2r")
    samples = 6 * CHUNK + 17

    def in_any_order(function, chunks):
        rng = np.random.default_rng(longest)
        runs = []
        while chunks:
            size = rng.integers(1, longest + 1)
            runs.append(chunks[:size])
            chunks = chunks[size:]
        for k in rng.permutation(len(runs)):
            yield runs[k], pickle.loads(pickle.dumps(function))(runs[k])

    other = distributed_workspace(
        arm, samples, 2, edge=None, threads=1, progress=None, distribute=in_any_order
    )
    assert_same(workspace(arm, samples, 2), other)


def test_what_is_known_of_samples_beyond_those_kept(monkeypatch):
    arm = library_robot("planar2r")
    many = workspace(arm, 3 * CHUNK)
    module = import_module("dhkit.kinematics.workspace")  # the package's attribute is the function
    monkeypatch.setattr(module, "KEPT_CHUNKS", 1)
    few = workspace(arm, 3 * CHUNK)
    assert len(few.positions) == len(few.manipulability) == CHUNK
    assert np.array_equal(few.positions, many.positions[:CHUNK])
    assert few.samples == few.grid.counts.sum() == few.histogram.sum() == 3 * CHUNK
    assert few.largest_manipulability == many.manipulability.max()
    assert np.array_equal(few.bounds, [many.positions.min(axis=0), many.positions.max(axis=0)])
    assert few.radii == many.radii


def test_a_workspace_travels():
    space = workspace(library_robot("planar2r"), 100)
    back = pickle.loads(pickle.dumps(space))
    assert back.description == space.description
    assert np.array_equal(back.positions, space.positions)
    assert np.array_equal(back.grid.counts, space.grid.counts)
    with pytest.raises(AttributeError):
        space.seed = 1


def test_very_few_samples_are_no_error():
    for samples in (1, 2, 3):
        space = workspace(library_robot("puma560"), samples)
        assert space.samples == samples
        assert space.bounds.shape == (2, 3)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"samples": 0}, "samples is 0; expected 1 or more"),
        ({"edge": 0.0}, "edge is 0.0 m; expected a positive length"),
        ({"edge": float("nan")}, "edge is nan m"),
        ({"edge": 1e-5}, "makes more than 16777216 cells; expected about"),
    ],
)
def test_wrong_arguments_are_named(options, complaint):
    with pytest.raises(ValueError, match=complaint):
        workspace(library_robot("puma560"), **{"samples": 50} | options)
