"""Solutions as they are handed on: where B's capture stands in A's, and what the paper names a pose by.

There are millions, so their columns are made piece by piece, while they are written.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mhvedit.files import Column
from mhvedit.geometry.arrays import ByteArray, FloatArray, Int32Array, IntArray
from mhvedit.geometry.planar import rotation, wrap_angle
from mhvedit.geometry.uncounted import uncounted
from mhvedit.search.groups import seen_from
from mhvedit.search.poses import PoseGrid
from mhvedit.search.solve import ReasonMap

Lattice = tuple[int, IntArray, float]  # size, base and step of a grid


def listed(
    grid: PoseGrid,
    cells: IntArray | Int32Array,
    *,
    facing: tuple[float, float],
    left: FloatArray,
    right: FloatArray,
) -> dict[str, Column]:
    """What there is to say about solutions, one row each.

    Args:
        grid: candidate poses, in canonical frames.
        cells: (S,) of the flattened grid.
        facing: of A and B over the segment, rad in their canonical frames.
        left: (3,) pose of A's canonical frame in A's capture frame.
        right: (3,) pose of B's capture frame in B's canonical frame.

    Returns:
        (S,) `x`, `y` (m) and `yaw` (rad in [-pi, pi)) of left @ pose @ right; `distance` (m), `theta_a` and `theta_b`
        (rad) as in `SolutionGroup`.
    """
    turn = left[2] + grid.yaws
    c, s = float(np.cos(left[2])), float(np.sin(left[2]))
    roots = rotation(grid.yaws) @ grid.root_b - grid.root_a
    lattice = grid.size, grid.base, grid.step

    def column(fill: Callable[..., None], *terms: object) -> Column:
        return Column((len(cells),), partial(_filled, fill, cells, terms))

    return {
        "x": column(_fill_place, lattice, left[0], c, s, np.cos(turn) * right[0], np.sin(turn) * right[1]),
        "y": column(_fill_place, lattice, left[1], s, -c, np.sin(turn) * right[0], -np.cos(turn) * right[1]),
        "yaw": column(_fill_yaw, wrap_angle(turn + right[2])),
        "distance": column(_fill_distance, lattice, roots),
        "theta_a": column(_fill_theta, lattice, roots, facing[0], np.full(grid.n_yaw, np.pi)),
        "theta_b": column(_fill_theta, lattice, roots, facing[1], -grid.yaws),
    }


def rounded(numbers: FloatArray) -> Column:
    """(S,) numbers as 32-bit ones."""

    def fill(first: int, out: NDArray[np.float32]) -> None:
        out[:] = numbers[first : first + len(out)]

    return Column(numbers.shape, fill, np.float32)


def reasons_listed(found: ReasonMap) -> Column:
    """(X, Y, Yaw) the reasons of a map, which lie in memory yaw by yaw."""
    planes = found.by_yaw

    def fill(first: int, out: ByteArray) -> None:
        _lay_rows(planes, first, out)

    return Column(found.reason.shape, fill, np.uint8)


def _filled(
    fill: Callable[..., None], cells: IntArray | Int32Array, terms: tuple[object, ...], first: int, out: FloatArray
) -> None:
    """Fill in the rows from the first on."""
    fill(cells[first : first + len(out)], *terms, out)


@njit(cache=True, nogil=True, inline="always")
def _moved_on(before: int, cell: int, i: int, j: int, k: int, size: int, n_yaw: int) -> tuple[int, int, int]:
    """From one cell's indices to those of a later one, which most often is the next yaw: division takes longest."""
    k += cell - before
    if k < n_yaw:
        return i, j, k
    row, yaw = divmod(cell, n_yaw)
    return row // size, row % size, yaw


@njit(cache=True, nogil=True)
def _fill_place(
    cells: IntArray,
    lattice: Lattice,
    origin: float,
    by_x: float,
    by_y: float,
    by_yaw: FloatArray,
    less_by_yaw: FloatArray,
    out: FloatArray,
) -> None:
    size, base, step = lattice[0], uncounted(lattice[1]), lattice[2]
    i, j, k = 0, 0, len(base)
    for n in range(cells.shape[0]):
        i, j, k = _moved_on(cells[max(n - 1, 0)], cells[n], i, j, k, size, len(base))
        x, y = (base[k, 0] + i) * step, (base[k, 1] + j) * step
        out[n] = origin + by_x * x - by_y * y + by_yaw[k] - less_by_yaw[k]


@njit(cache=True, nogil=True)
def _fill_yaw(cells: IntArray, yaws: FloatArray, out: FloatArray) -> None:
    for n in range(cells.shape[0]):
        out[n] = yaws[cells[n] % yaws.shape[0]]


@njit(cache=True, nogil=True)
def _fill_distance(cells: IntArray, lattice: Lattice, roots: FloatArray, out: FloatArray) -> None:
    size, base, step = lattice[0], uncounted(lattice[1]), lattice[2]
    i, j, k = 0, 0, len(base)
    for n in range(cells.shape[0]):
        i, j, k = _moved_on(cells[max(n - 1, 0)], cells[n], i, j, k, size, len(base))
        x, y = (base[k, 0] + i) * step, (base[k, 1] + j) * step
        x, y = x + roots[k, 0], y + roots[k, 1]
        out[n] = np.sqrt(x * x + y * y)


@njit(cache=True, nogil=True)
def _fill_theta(
    cells: IntArray, lattice: Lattice, roots: FloatArray, facing: float, turns: FloatArray, out: FloatArray
) -> None:
    size, base, step = lattice[0], uncounted(lattice[1]), lattice[2]
    i, j, k = 0, 0, len(base)
    for n in range(cells.shape[0]):
        i, j, k = _moved_on(cells[max(n - 1, 0)], cells[n], i, j, k, size, len(base))
        x, y = (base[k, 0] + i) * step, (base[k, 1] + j) * step
        out[n] = seen_from(np.arctan2(y + roots[k, 1], x + roots[k, 0]), facing, turns[k])


@njit(cache=True, nogil=True)
def _lay_rows(planes: ByteArray, first: int, out: ByteArray) -> None:
    """Lay rows of (Yaw, X, Y) from the first on out as (X, Y, Yaw)."""
    for x in range(np.uint64(out.shape[0])):
        for k in range(np.uint64(out.shape[2])):
            for y in range(np.uint64(out.shape[1])):
                out[x, y, k] = planes[k, first + x, y]
