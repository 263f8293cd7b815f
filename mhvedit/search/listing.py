"""Solutions as they are handed on: where B's capture stands in A's, and what the paper names a pose by."""

from typing import NamedTuple

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import rotation
from mhvedit.search.poses import PoseGrid


class Listing(NamedTuple):
    """Columns with one row a solution, by the names that they are written under; a tuple, since a kernel takes it."""

    x: FloatArray  # (S,) m
    y: FloatArray  # (S,) m
    yaw: FloatArray  # (S,) rad in [-pi, pi)
    distance: FloatArray  # (S,) m, as in `SolutionGroup`
    theta_a: FloatArray  # (S,) rad, likewise
    theta_b: FloatArray  # (S,) rad


def listed(
    grid: PoseGrid, cells: IntArray, *, facing: tuple[float, float], left: FloatArray, right: FloatArray
) -> Listing:
    """List solutions by the millions, with nothing in memory but the columns.

    Args:
        grid: candidate poses, in canonical frames.
        cells: (S,) of the flattened grid.
        facing: of A and B over the segment, rad in their canonical frames.
        left: (3,) pose of A's canonical frame in A's capture frame.
        right: (3,) pose of B's capture frame in B's canonical frame.

    Returns:
        With left @ pose @ right for each pose.
    """
    turned_b = rotation(grid.yaws) @ grid.root_b
    turned = turned_b - grid.root_a
    rows = Listing(*np.empty((len(Listing._fields), len(cells))))
    _list(cells, grid.size, grid.base, grid.step, grid.yaws, turned, np.array(facing), left, right, rows)
    return rows


@njit(cache=True, nogil=True)
def _list(
    cells: IntArray,
    size: int,
    base: IntArray,
    step: float,
    yaws: FloatArray,
    turned: FloatArray,
    facing: FloatArray,
    left: FloatArray,
    right: FloatArray,
    out: Listing,
) -> None:
    """Fill in the columns; `turned` is B's turned root less A's root, for each yaw."""
    x, y, yaw, distance, theta_a, theta_b = out
    c, s = np.cos(left[2]), np.sin(left[2])
    turns = left[2] + yaws
    cosines, sines = np.cos(turns), np.sin(turns)
    for n in range(cells.shape[0]):
        row, k = divmod(np.int64(cells[n]), yaws.shape[0])
        at_x, at_y = (base[k, 0] + row // size) * step, (base[k, 1] + row % size) * step
        x[n] = left[0] + c * at_x - s * at_y + cosines[k] * right[0] - sines[k] * right[1]
        y[n] = left[1] + s * at_x + c * at_y + sines[k] * right[0] + cosines[k] * right[1]
        yaw[n] = (turns[k] + right[2] + np.pi) % (2 * np.pi) - np.pi
        along, across = at_x + turned[k, 0], at_y + turned[k, 1]
        bearing = np.arctan2(across, along)
        distance[n] = np.sqrt(along * along + across * across)
        theta_a[n] = (bearing - facing[0] + np.pi) % (2 * np.pi) - np.pi
        theta_b[n] = (bearing - facing[1] - yaws[k]) % (2 * np.pi) - np.pi
