import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.geometry.planar import apply_pose
from mhvedit.search.groups import clearances, connected_regions, solution_group
from mhvedit.search.poses import pose_grid
from mhvedit.search.solve import ACCEPTED, OUTSIDE, ReasonMap
from tests import oracles

SEEDS = st.integers(0, 2**32 - 1)
SOME = settings(max_examples=40, derandomize=True)


def random_map(rng: np.random.Generator) -> BoolArray:
    shape = rng.integers(1, 8, 3)
    return np.asarray(rng.random(shape) < rng.choice([0.0, 0.1, 0.25, 0.7, 1.0]))


@given(seed=SEEDS)
@SOME
def test_regions_are_what_a_flood_fill_finds_largest_first_with_yaw_a_circle(seed: int) -> None:
    accepted = random_map(np.random.default_rng(seed))
    found = connected_regions(accepted)
    expected = np.full(accepted.shape, -1, np.int32)
    for number, region in enumerate(oracles.flood_regions(accepted)):
        expected[tuple(np.array(sorted(region)).T)] = number
    np.testing.assert_array_equal(found, expected[accepted])


def test_regions_of_equal_size_are_numbered_by_their_first_cell() -> None:
    accepted = np.zeros((9, 1, 6), np.bool_)
    accepted[[0, 4, 4, 8], 0, [3, 5, 0, 1]] = True  # the two at x = 4 touch across the seam of yaw
    assert np.argwhere(accepted)[:, [0, 2]].tolist() == [[0, 3], [4, 0], [4, 5], [8, 1]]
    assert connected_regions(accepted).tolist() == [1, 0, 0, 2]


@given(seed=SEEDS)
@SOME
def test_clearance_is_the_distance_to_the_nearest_rejected_pose(seed: int) -> None:
    rng = np.random.default_rng(seed)
    accepted, step, yaw_step = random_map(rng), float(rng.uniform(0.01, 0.1)), float(rng.uniform(0.001, 0.1))
    found = clearances(accepted, step=step, yaw_step=yaw_step)
    cells = [(int(x), int(y), int(k)) for x, y, k in np.argwhere(accepted)]
    assert found == pytest.approx([oracles.clearance(accepted, cell, step=step, yaw_step=yaw_step) for cell in cells])


@pytest.mark.parametrize("lever", [0.0, 1e-9])
def test_where_a_turn_counts_for_nothing_a_pose_is_as_clear_as_the_worst_of_its_turns(lever: float) -> None:
    accepted = np.ones((7, 5, 4), np.bool_)
    accepted[2, 2, 3] = False
    expected = [[min(x + 1, 7 - x, y + 1, 5 - y, np.hypot(x - 2, y - 2)) for y in range(5)] for x in range(7)]
    found = clearances(accepted, step=0.1, yaw_step=lever)
    assert found == pytest.approx(0.1 * np.repeat(np.array(expected)[:, :, None], 4, axis=2)[accepted], abs=1e-8)


@given(seed=SEEDS)
@SOME
def test_distance_and_angles_are_those_between_the_placed_roots_and_facings(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root_a, root_b = rng.normal(size=2), rng.normal(size=2)
    facing_a, facing_b = rng.uniform(-4, 4, 2)
    grid = pose_grid(root_a, root_b, pitch=0.05, stride=2, n_yaw=11, window=0.8)
    reason = np.where(rng.random((grid.size, grid.size, 11)) < 0.1, ACCEPTED, OUTSIDE).astype(np.uint8)
    group = solution_group(
        ReasonMap(grid, reason, ("accepted", "outside the window")), facing_a=facing_a, facing_b=facing_b, lever=0.3
    )
    assert len(group) == (reason == ACCEPTED).sum()
    for s, pose in enumerate(group.poses):
        placed_b = apply_pose(pose, root_b)
        assert group.distance[s] == pytest.approx(np.linalg.norm(placed_b - root_a))
        assert turned_by(facing_a, group.theta_a[s]) == pytest.approx(unit(placed_b - root_a))
        assert turned_by(facing_b + pose[2], group.theta_b[s]) == pytest.approx(unit(root_a - placed_b))
    assert (np.abs(group.theta_a) <= np.pi).all() and (np.abs(group.theta_b) <= np.pi).all()


def test_rows_of_a_group_belong_together() -> None:
    grid = pose_grid(np.zeros(2), np.array([0.4, 0.1]), pitch=0.05, stride=2, n_yaw=8, window=1.0)
    reason = np.full((grid.size, grid.size, 8), OUTSIDE, np.uint8)
    reason[1:4, 2, [7, 0]] = ACCEPTED
    reason[6, 6, 4] = ACCEPTED
    group = solution_group(ReasonMap(grid, reason, ("accepted", "outside")), facing_a=0, facing_b=0, lever=0.5)
    np.testing.assert_allclose(group.poses[:, :2], group.keys[:, :2] * 0.1)
    np.testing.assert_allclose(group.poses[:, 2], group.keys[:, 2] * np.pi / 4)
    assert sorted(group.region.tolist()) == sorted(connected_regions(reason == ACCEPTED).tolist())
    assert group.clearance == pytest.approx(0.1)


def test_an_empty_map_gives_an_empty_group() -> None:
    grid = pose_grid(np.zeros(2), np.zeros(2), pitch=0.05, stride=1, n_yaw=3, window=0.2)
    reason = np.full((grid.size, grid.size, 3), OUTSIDE, np.uint8)
    group = solution_group(ReasonMap(grid, reason, ("accepted", "outside")), facing_a=0, facing_b=0, lever=0.3)
    assert len(group) == 0 and group.poses.shape == (0, 3) and group.theta_b.shape == (0,)


def unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v))


def turned_by(facing: float, theta: float) -> FloatArray:
    return np.array([np.cos(facing + theta), np.sin(facing + theta)])
