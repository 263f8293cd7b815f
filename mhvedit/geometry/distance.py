"""Exact distances, inside a set of cells, to what is not in the set; the last axis is a circle.

Squares of distances are made one axis at a time. Only rows along the last axis that hold any cell of the set are kept;
of all others every cell is outside. A row looks at the rows beside it for as long as they can still be nearer.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray

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
    with ThreadPoolExecutor(workers) as pool:
        shares = np.array_split(np.arange(len(inside)), min(len(inside), 8 * workers))
        count = np.concatenate(list(pool.map(lambda share: _count(inside, share), shares)))
        rows = np.where(count > 0, np.cumsum(count.ravel() > 0).reshape(count.shape) - 1, -1)
        starts = np.concatenate([[0], np.cumsum(count)])
        squared = np.empty((int((count > 0).sum()), inside.shape[2]))
        out = np.empty(int(starts[-1]))
        list(pool.map(lambda share: _along_rows(inside, rows, share, spacing, squared), shares))
        list(pool.map(lambda share: _across_rows(inside, rows, starts, share, spacing[0], squared, out), shares))
    return out


@njit(cache=True, nogil=True)
def _count(inside: BoolArray, share: IntArray) -> IntArray:
    """(K, Y) cells inside, of each row of some planes."""
    count = np.zeros((share.shape[0], inside.shape[1]), np.int64)
    for n in range(share.shape[0]):
        for y in range(inside.shape[1]):
            total = 0
            for z in range(inside.shape[2]):
                total += inside[share[n], y, z]
            count[n, y] = total
    return count


@njit(cache=True, nogil=True)
def _along_rows(
    inside: BoolArray, rows: IntArray, share: IntArray, spacing: tuple[float, float, float], squared: FloatArray
) -> None:
    """Squared distances within some planes."""
    n_y, n_z = inside.shape[1], inside.shape[2]
    plane = np.zeros((n_y, n_z))
    for x in share:
        for y in range(n_y):
            if rows[x, y] >= 0:
                _along_circle(inside[x, y], spacing[2], plane[y])
        for y in range(n_y):
            row = rows[x, y]
            if row >= 0:
                squared[row] = plane[y]
                away = 1
                while (away * spacing[1]) ** 2 < squared[row].max():
                    least = (away * spacing[1]) ** 2
                    for other in (y - away, y + away):
                        if 0 <= other < n_y and rows[x, other] >= 0:
                            _lower(squared[row], plane[other], least)
                        else:
                            _cut(squared[row], least)
                    away += 1


@njit(cache=True, nogil=True)
def _across_rows(
    inside: BoolArray,
    rows: IntArray,
    starts: IntArray,
    share: IntArray,
    spacing: float,
    squared: FloatArray,
    out: FloatArray,
) -> None:
    """Distances of the cells of some planes, from the squared ones within all planes."""
    n_x, n_y, n_z = inside.shape
    line = np.empty(n_z)
    for x in share:
        for y in range(n_y):
            if rows[x, y] < 0:
                continue
            line[:] = squared[rows[x, y]]
            away = 1
            while (away * spacing) ** 2 < line.max():
                least = (away * spacing) ** 2
                for other in (x - away, x + away):
                    if 0 <= other < n_x and rows[other, y] >= 0:
                        _lower(line, squared[rows[other, y]], least)
                    else:
                        _cut(line, least)
                away += 1
            at = starts[x * n_y + y]
            for z in range(n_z):
                if inside[x, y, z]:
                    out[at] = np.sqrt(line[z])
                    at += 1


@njit(cache=True, nogil=True)
def _along_circle(inside: BoolArray, spacing: float, out: FloatArray) -> None:
    """Squared distance to the nearest outside along a circle; FAR where there is none."""
    n = inside.shape[0]
    steps = n
    for sweep in range(2 * n):  # upwards, twice around
        z = sweep if sweep < n else sweep - n
        steps = steps + 1 if inside[z] else 0
        out[z] = steps
    steps = n
    for sweep in range(2 * n - 1, -1, -1):  # and downwards
        z = sweep if sweep < n else sweep - n
        steps = steps + 1 if inside[z] else 0
        out[z] = min(out[z], steps)
    for z in range(n):
        out[z] = FAR if out[z] >= n else (out[z] * spacing) ** 2


@njit(cache=True, nogil=True)
def _lower(line: FloatArray, other: FloatArray, offset: float) -> None:
    for z in range(line.shape[0]):
        line[z] = min(line[z], other[z] + offset)


@njit(cache=True, nogil=True)
def _cut(line: FloatArray, most: float) -> None:
    for z in range(line.shape[0]):
        line[z] = min(line[z], most)
