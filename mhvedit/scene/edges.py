"""Edges of triangle meshes: which there are, and how near those of one mesh come to those of another."""

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray, Int32Array, IntArray


def unique_edges(faces: Int32Array) -> IntArray:
    """Every edge once: (E, 2) vertex indices, the smaller first, in ascending order."""
    pairs = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).astype(np.int64)
    base = int(pairs.max(initial=0)) + 1
    keys = np.unique(pairs[:, 0] * base + pairs[:, 1])
    return np.stack([keys // base, keys % base], 1)


def closest_between_edges(ends_a: FloatArray, ends_b: FloatArray, *, below: float) -> tuple[float, FloatArray]:
    """The smallest distance between two sets of straight edges, where it is below a bound.

    Args:
        ends_a: (E, 2, 3) m.
        ends_b: (F, 2, 3) m.
        below: m.

    Returns:
        The distance, or `below`; and (3,) m midway between the closest points, NaN where nothing is nearer.
    """
    if len(ends_a) == 0 or len(ends_b) == 0:
        return below, np.full(3, np.nan)
    distance, point = _closest(np.ascontiguousarray(ends_a), np.ascontiguousarray(ends_b), below)
    return float(distance), np.asarray(point)


@njit(cache=True, nogil=True)
def _closest(ends_a: FloatArray, ends_b: FloatArray, below: float) -> tuple[float, FloatArray]:
    best = below
    point = np.full(3, np.nan)
    for e in range(ends_a.shape[0]):
        for f in range(ends_b.shape[0]):
            if _apart(ends_a[e], ends_b[f], best):
                continue
            s, t = _parameters(ends_a[e], ends_b[f])
            squared = 0.0
            middle = np.empty(3)
            for c in range(3):
                p = ends_a[e, 0, c] + s * (ends_a[e, 1, c] - ends_a[e, 0, c])
                q = ends_b[f, 0, c] + t * (ends_b[f, 1, c] - ends_b[f, 0, c])
                squared += (p - q) * (p - q)
                middle[c] = 0.5 * (p + q)
            if squared < best * best:
                best = np.sqrt(squared)
                point = middle
    return best, point


@njit(cache=True, nogil=True, inline="always")
def _apart(a: FloatArray, b: FloatArray, bound: float) -> bool:
    """Whether the boxes of two edges are further apart than a bound along some axis."""
    for c in range(3):
        if min(a[0, c], a[1, c]) - max(b[0, c], b[1, c]) >= bound:
            return True
        if min(b[0, c], b[1, c]) - max(a[0, c], a[1, c]) >= bound:
            return True
    return False


@njit(cache=True, nogil=True)
def _parameters(a: FloatArray, b: FloatArray) -> tuple[float, float]:
    """Where along each of two edges, 0 to 1, they are closest (Ericson, Real-Time Collision Detection, 5.1.9)."""
    u, v, w = a[1] - a[0], b[1] - b[0], a[0] - b[0]
    uu, vv, uv = (u * u).sum(), (v * v).sum(), (u * v).sum()
    uw, vw = (u * w).sum(), (v * w).sum()
    if uu <= 0.0:
        return 0.0, (min(max(vw / vv, 0.0), 1.0) if vv > 0.0 else 0.0)
    if vv <= 0.0:
        return min(max(-uw / uu, 0.0), 1.0), 0.0
    across = uu * vv - uv * uv
    s = min(max((uv * vw - uw * vv) / across, 0.0), 1.0) if across > 1e-12 * uu * vv else 0.0
    t = (uv * s + vw) / vv
    if t < 0.0:
        return min(max(-uw / uu, 0.0), 1.0), 0.0
    if t > 1.0:
        return min(max((uv - uw) / uu, 0.0), 1.0), 1.0
    return s, t
