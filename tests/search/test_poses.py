import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.geometry.arrays import BoolArray
from mhvedit.geometry.planar import apply_pose
from mhvedit.search.poses import CellSet, PoseGrid, cells_of_keys, pose_grid
from tests import oracles

SMALL = st.floats(-0.5, 0.5)


def inside(grid: PoseGrid) -> BoolArray:
    """(n_yaw, size, size) which cells have B's root in the window."""
    x, y = grid.reach()
    return np.asarray(x[:, :, None] & y[:, None])


@given(a=st.tuples(SMALL, SMALL), b=st.tuples(SMALL, SMALL), stride=st.integers(1, 3), window=st.floats(0, 0.4))
@settings(max_examples=40, derandomize=True)
def test_the_grid_holds_every_lattice_pose_in_the_window_and_no_other(
    a: tuple[float, float], b: tuple[float, float], stride: int, window: float
) -> None:
    root_a, root_b = np.array(a), np.array(b)
    grid = pose_grid(root_a, root_b, pitch=0.02, stride=stride, n_yaw=7, window=window)
    for k in range(7):
        cells = np.argwhere(inside(grid)[k])
        expected = oracles.window_shifts(
            root_a, root_b, float(grid.yaws[k]), pitch=0.02, stride=stride, window=window
        )  # fmt: skip
        assert [tuple(shift) for shift in (grid.base[k] + cells).tolist()] == expected


def test_poses_put_the_root_of_b_where_the_grid_says() -> None:
    grid = pose_grid(np.array([0.3, -0.1]), np.array([1.2, 0.7]), pitch=0.01, stride=2, n_yaw=36, window=0.5)
    cells = np.argwhere(np.moveaxis(inside(grid), 0, -1))
    for cell, pose in list(zip(cells, grid.poses(cells), strict=True))[::97]:
        offset = apply_pose(pose, grid.root_b) - grid.root_a
        x, y = grid.roots()[int(cell[2])]
        np.testing.assert_allclose(offset, (x[cell[0]], y[cell[1]]), atol=1e-12)
        assert np.abs(offset).max() <= 0.25 + 1e-9
        assert np.abs(offset - grid.offsets[cell[:2]]).max() <= grid.step / 2 + 1e-9


def test_segments_with_other_roots_share_one_lattice_of_poses() -> None:
    """So that one and the same relative pose is a candidate of every segment of two subjects."""

    def poses(root: float) -> set[tuple[float, ...]]:
        grid = pose_grid(np.array([root, 0.1]), np.array([0.2, root]), pitch=0.01, stride=3, n_yaw=12, window=0.6)
        cells = np.argwhere(np.moveaxis(inside(grid), 0, -1))
        return {tuple(np.round(pose, 9)) for pose in grid.poses(cells).tolist()}

    here, there = poses(0.0), poses(0.0701)
    assert len(here & there) > 0.5 * len(here)


def test_the_paper_samples_10_mm_and_2_degrees() -> None:
    grid = pose_grid(np.zeros(2), np.zeros(2), pitch=0.01, stride=1, n_yaw=180, window=4.0)
    assert inside(grid)[0].sum() == 401**2
    np.testing.assert_allclose(np.rad2deg(np.diff(grid.yaws)), 2)


@given(seed=st.integers(0, 10**6), n_yaw=st.integers(1, 7))
@settings(max_examples=40, derandomize=True)
def test_cells_and_lattice_poses_find_each_other(seed: int, n_yaw: int) -> None:
    rng = np.random.default_rng(seed)
    grid = pose_grid(*rng.uniform(-1, 1, (2, 2)), pitch=0.05, stride=1, n_yaw=n_yaw, window=0.4)
    cells = np.flatnonzero(rng.random(grid.size**2 * n_yaw) < rng.choice([0.02, 0.5]))
    narrow = cells.astype(np.int32) if seed % 2 else cells
    places = CellSet(narrow, grid.size, grid.base)
    i, j, k = np.unravel_index(cells, (grid.size, grid.size, n_yaw))
    keys = np.column_stack([grid.base[k] + np.column_stack([i, j]), k]).reshape(-1, 3)
    rows = rng.permutation(len(cells))
    assert places.keys(rows).tolist() == keys[rows].tolist()
    assert places.rows_at(keys[rows]).tolist() == rows.tolist()
    for away in ((50, 0, 0), (0, -50, 0), (0, 0, n_yaw)):
        assert (places.rows_at(keys + np.array(away)) == -1).all()
    if len(keys):
        ordered = keys[np.lexsort(keys.T[::-1])]
        same = cells_of_keys(ordered)
        assert (np.diff(same.cells) > 0).all() and same.keys(np.arange(len(keys))).tolist() == ordered.tolist()
