"""Exact distances, inside a set of cells, to what is not in the set; the last axis is a circle.

Squares of distances are made one axis at a time, run by run of cells along the last axis. Only rows along that axis
that hold any cell of the set are kept; of all others every cell is outside. A run looks at the rows beside it, further
and further away, with what is left of it once its ends know that no row further away can be nearer.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.geometry.runs import runs_along_rows
from mhvedit.geometry.uncounted import uncounted

FAR = 1e18  # m^2


def distance_to_outside(inside: BoolArray, *, spacing: tuple[float, float, float], workers: int = 2) -> FloatArray:
    """Distance of each cell that is inside to the nearest that is not; all beyond the first two axes is not inside.

    Args:
        inside: (X, Y, Z); the last axis is a circle.
        spacing: of the cells along each axis; more than 0, but for the last, along which 0 makes all cells one place.
        workers: threads; the result does not depend on it.

    Returns:
        (S,) in the order of `np.argwhere(inside)`.
    """
    runs, starts = runs_along_rows(inside.view(np.uint8), 1)
    return distance_in_runs(runs, starts, inside.shape, spacing=spacing, workers=workers)


def distance_in_runs(
    runs: IntArray,
    starts: IntArray,
    shape: tuple[int, ...],
    *,
    spacing: tuple[float, float, float],
    workers: int = 2,
) -> FloatArray:
    """The same of a set that is told by its runs (see `runs_along_rows`).

    Args:
        runs: (R, 2) start and stop of each run.
        starts: (X * Y + 1,) where the runs of each row start.
        shape: (X, Y, Z) of the box of cells.
        spacing: as above.
        workers: as above.
    """
    n_x, n_y, n_z = shape
    held = (np.diff(starts) > 0).reshape(n_x, n_y)
    rows = np.where(held, np.cumsum(held).reshape(n_x, n_y) - 1, -1)
    cells = np.concatenate([[0], np.cumsum(runs[:, 1] - runs[:, 0])])
    squared, out = np.empty((int(held.sum()), n_z)), np.empty(int(cells[-1]))
    shares, across = (np.array_split(np.arange(n), min(n, 8 * workers)) for n in (n_x, n_y))
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(lambda share: _along_rows(runs, starts, rows, share, spacing, _plane(n_y, n_z), squared), shares))
        list(pool.map(lambda share: _across_rows(runs, starts, rows, share, spacing[0], squared, cells, out), across))
    return out


def _plane(n_y: int, n_z: int) -> FloatArray:
    """(Y + 1, Z) room for a plane, and a row that is empty."""
    return np.zeros((n_y + 1, n_z))


@njit(cache=True, nogil=True)
def _along_rows(
    runs: IntArray,
    starts: IntArray,
    rows: IntArray,
    share: IntArray,
    spacing: tuple[float, float, float],
    plane: FloatArray,
    squared: FloatArray,
) -> None:
    """Squared distances within some planes."""
    runs, starts, rows = uncounted(runs), uncounted(starts), uncounted(rows)
    plane, squared = uncounted(plane), uncounted(squared)
    n_y = rows.shape[1]
    empty = plane[n_y]
    for x in share:
        for y in range(n_y):
            if rows[x, y] >= 0:
                _along_circle(runs[starts[x * n_y + y] : starts[x * n_y + y + 1]], spacing[2], plane[y])
        for y in range(n_y):
            if rows[x, y] < 0:
                continue
            line = squared[rows[x, y]]
            _copy(plane[y], line)
            for run in range(starts[x * n_y + y], starts[x * n_y + y + 1]):
                low, high, away = runs[run, 0], runs[run, 1], 1
                while low < high:
                    one = plane[y - away] if y >= away and rows[x, y - away] >= 0 else empty
                    other = plane[y + away] if y + away < n_y and rows[x, y + away] >= 0 else empty
                    _lower(line[low:high], one[low:high], other[low:high], (away * spacing[1]) ** 2)
                    away += 1
                    low, high = _left(line, low, high, (away * spacing[1]) ** 2)


@njit(cache=True, nogil=True)
def _across_rows(
    runs: IntArray,
    starts: IntArray,
    rows: IntArray,
    share: IntArray,
    spacing: float,
    squared: FloatArray,
    cells: IntArray,
    out: FloatArray,
) -> None:
    """Distances of the cells of some rows of planes, from the squared ones within all planes; one y after another,
    so that the rows beside a row are still at hand.
    """
    runs, starts, rows = uncounted(runs), uncounted(starts), uncounted(rows)
    squared, cells, out = uncounted(squared), uncounted(cells), uncounted(out)
    n_x, n_y = rows.shape
    empty = np.zeros(squared.shape[1])
    for y in share:
        for x in range(n_x):
            for run in range(starts[x * n_y + y], starts[x * n_y + y + 1]):
                first, line = runs[run, 0], out[cells[run] : cells[run + 1]]
                _copy(squared[rows[x, y], first : runs[run, 1]], line)
                low, high, away = 0, line.shape[0], 1
                while low < high:
                    one = squared[rows[x - away, y]] if x >= away and rows[x - away, y] >= 0 else empty
                    other = squared[rows[x + away, y]] if x + away < n_x and rows[x + away, y] >= 0 else empty
                    start, stop = first + low, first + high
                    _lower(line[low:high], one[start:stop], other[start:stop], (away * spacing) ** 2)
                    away += 1
                    low, high = _left(line, low, high, (away * spacing) ** 2)
                for z in range(len(line)):
                    line[z] = np.sqrt(line[z])


@njit(cache=True, nogil=True, inline="always")
def _along_circle(runs: IntArray, spacing: float, out: FloatArray) -> None:
    """Squared distance to the nearest outside along a circle; FAR where there is none, 0 outside the row's runs."""
    n, last = out.shape[0], runs.shape[0] - 1
    seam = runs[0, 0] == 0 and runs[last, 1] == n  # the last run goes on in the first
    out[:] = 0.0
    for run in range(last + 1):
        low, high = runs[run, 0], runs[run, 1]
        if high - low == n:
            out[:] = FAR
            return
        below = runs[last, 1] - runs[last, 0] if seam and run == 0 else 0
        above = runs[0, 1] if seam and run == last else 0
        for z in range(low, high):
            out[z] = (float(min(z - low + 1 + below, high - z + above)) * spacing) ** 2


@njit(cache=True, nogil=True, inline="always")
def _copy(line: FloatArray, out: FloatArray) -> None:
    """As `out[:] = line`, which takes seconds to compile: it could tell in words what lengths do not fit."""
    for z in range(line.shape[0]):
        out[z] = line[z]


@njit(cache=True, nogil=True, inline="always")
def _lower(line: FloatArray, one: FloatArray, other: FloatArray, offset: float) -> None:
    """Lower squared distances to those by way of two rows, which are further by an offset."""
    for z in range(line.shape[0]):
        nearer = one[z] if one[z] < other[z] else other[z]
        nearer += offset
        line[z] = nearer if nearer < line[z] else line[z]


@njit(cache=True, nogil=True, inline="always")
def _left(line: FloatArray, low: int, high: int, beyond: float) -> tuple[int, int]:
    """What is left of a stretch of squared distances without those at its ends that are not above `beyond`."""
    while low < high and line[low] <= beyond:
        low += 1
    while low < high and line[high - 1] <= beyond:
        high -= 1
    return low, high
