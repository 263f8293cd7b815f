import numpy as np
import pytest

from mhvedit.files import Column
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import compose, rotation
from mhvedit.search.groups import described
from mhvedit.search.listing import listed, reasons_listed
from mhvedit.search.poses import pose_grid
from mhvedit.search.solve import map_by_yaw

FACING = (0.4, -2.9)


def made(column: Column) -> FloatArray:
    """A column as a whole, made in pieces."""
    out = np.empty(column.shape, column.dtype)
    for first in range(0, len(out), 190):
        column.fill(first, out[first : first + 190])
    return out


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_a_list_says_what_the_group_says_seen_from_the_captures(dtype: type) -> None:
    grid = pose_grid(np.array([0.31, -0.2]), np.array([-0.12, 0.4]), pitch=0.02, stride=2, n_yaw=24, window=1.6)
    cells: IntArray = np.sort(np.random.default_rng(3).choice(grid.size**2 * grid.n_yaw, 500, replace=False))
    cells = cells.astype(dtype)
    left, right = np.array([1.5, -0.7, 2.8]), np.array([-0.4, 0.9, -3.0])
    group = described(grid, cells, np.zeros(500, np.int32), np.zeros(500), facing=FACING)
    columns = listed(grid, cells, facing=FACING, left=left, right=right)
    rows = {name: made(column) for name, column in columns.items()}
    expected = compose(compose(left, group.poses), right)
    np.testing.assert_allclose(np.stack([rows["x"], rows["y"]], 1), expected[:, :2], atol=1e-12)
    np.testing.assert_allclose(rotation(rows["yaw"]), rotation(expected[:, 2]), atol=1e-12)
    assert (rows["yaw"] >= -np.pi).all() and (rows["yaw"] < np.pi).all()
    for column in ("distance", "theta_a", "theta_b"):
        np.testing.assert_array_equal(rows[column], getattr(group, column))


def test_reasons_are_listed_as_the_map_has_them() -> None:
    grid = pose_grid(np.zeros(2), np.zeros(2), pitch=0.02, stride=1, n_yaw=5, window=4.2)
    reason = np.random.default_rng(4).integers(0, 9, (grid.n_yaw, grid.size, grid.size)).astype(np.uint8)
    found = map_by_yaw(grid, reason, ("accepted", "outside the window"))
    np.testing.assert_array_equal(made(reasons_listed(found)), found.reason)
    np.testing.assert_array_equal(found.reason, np.moveaxis(reason, 0, -1))
    assert np.shares_memory(found.by_yaw, reason)
