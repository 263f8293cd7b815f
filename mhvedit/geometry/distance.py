"""Exact distance transform of a box whose last axis is a circle (lower envelopes of parabolas, Felzenszwalb 2012)."""

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, FloatArray

FAR = 1e18


def distance_to_outside(inside: BoolArray, *, spacing: tuple[float, float, float]) -> FloatArray:
    """Distance of each cell to the nearest that is not inside; all beyond the first two axes is not inside.

    Args:
        inside: (X, Y, Z); the last axis is a circle.
        spacing: of the cells along each axis, more than 0.

    Returns:
        (X, Y, Z), 0 outside.
    """
    padded = np.pad(inside, ((1, 1), (1, 1), (0, 0)))
    squared = _along_circle(padded, spacing[2])
    _along_middle(squared, spacing[1])
    swapped = np.ascontiguousarray(squared.transpose(1, 0, 2))
    _along_middle(swapped, spacing[0])
    return np.asarray(np.sqrt(swapped.transpose(1, 0, 2)[1:-1, 1:-1]))


@njit(cache=True, nogil=True)
def _along_circle(inside: BoolArray, spacing: float) -> FloatArray:
    """Squared distance to the nearest outside along the last axis; FAR where there is none."""
    n_x, n_y, n_z = inside.shape
    out = np.empty(inside.shape, np.float64)
    for x in range(n_x):
        for y in range(n_y):
            steps = n_z
            for sweep in range(2 * n_z):  # upwards, twice around
                steps = steps + 1 if inside[x, y, sweep % n_z] else 0
                out[x, y, sweep % n_z] = steps
            for sweep in range(2 * n_z - 1, -1, -1):  # and downwards
                steps = steps + 1 if inside[x, y, sweep % n_z] else 0
                nearest = min(out[x, y, sweep % n_z], steps)
                out[x, y, sweep % n_z] = nearest
            for z in range(n_z):
                out[x, y, z] = FAR if out[x, y, z] >= n_z else (out[x, y, z] * spacing) ** 2
    return out


@njit(cache=True, nogil=True)
def _along_middle(squared: FloatArray, spacing: float) -> None:
    """Replace every line along the middle axis by its lower envelope of parabolas."""
    n_x, n_y, n_z = squared.shape
    vertex = np.empty(n_y, np.int64)
    border = np.empty(n_y + 1, np.float64)
    line = np.empty(n_y, np.float64)
    unit = spacing * spacing
    for x in range(n_x):
        for z in range(n_z):
            for y in range(n_y):
                line[y] = squared[x, y, z] / unit
            k = 0
            vertex[0] = 0
            border[0], border[1] = -FAR, FAR
            for q in range(1, n_y):
                cross = _crossing(line, q, vertex[k])
                while cross <= border[k]:
                    k -= 1
                    cross = _crossing(line, q, vertex[k])
                k += 1
                vertex[k] = q
                border[k], border[k + 1] = cross, FAR
            k = 0
            for y in range(n_y):
                while border[k + 1] < y:
                    k += 1
                away = y - vertex[k]
                squared[x, y, z] = (away * away + line[vertex[k]]) * unit


@njit(cache=True, nogil=True, inline="always")
def _crossing(line: FloatArray, q: int, v: int) -> float:
    """Where the parabola rooted at q comes below the one rooted at v < q."""
    return float((line[q] + q * q) - (line[v] + v * v)) / (2.0 * (q - v))
