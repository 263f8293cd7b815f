"""Do two triangles meet, and where (Liu et al., A4.3; Moeller 1997, Guigue and Devillers 2003).

All decisions are signs of determinants. A determinant that is smaller than what rounding can make of it counts as 0,
and 0 means touching, which counts as meeting: two triangles that meet are never missed, and two that are called
separate are. Where no determinant is 0, the intervals on the line common to both planes decide (Guigue and
Devillers); everything else, coplanar triangles and those that are a segment or a point included, goes through the
six tests of an edge against a triangle, each a closed set.

The compiled functions take six points in one array, the corners of the first triangle and then of the second, and
name them by their rows.
"""

from typing import Final

import numpy as np
from numba import njit

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray

_ROUNDING: Final = 2.0**-53
_ERROR_3: Final = 8.0 * _ROUNDING  # of a determinant of differences, relative to its permanent (Shewchuk 1997)
_ERROR_2: Final = 4.0 * _ROUNDING


def triangles_meet(a: FloatArray, b: FloatArray) -> BoolArray:
    """Whether pairs of triangles have a point in common.

    Args:
        a: (..., 3, 3) corners.
        b: (..., 3, 3) corners.

    Returns:
        (...) touching included.
    """
    corners = _pairs(a, b)
    out = np.empty(len(corners), np.bool_)
    _meet_all(corners, out)
    return out.reshape(a.shape[:-2])


def triangle_intersections(a: FloatArray, b: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Where pairs of triangles meet.

    Args:
        a: (..., 3, 3) corners.
        b: (..., 3, 3) corners.

    Returns:
        (...) whether they do, and (..., 2, 3) the ends of the common segment; of a coplanar pair two points of the
        common polygon that are farthest apart; NaN where there is none.
    """
    corners = _pairs(a, b)
    hit, ends = np.empty(len(corners), np.bool_), np.full((len(corners), 2, 3), np.nan)
    _intersect_all(corners, hit, ends)
    return hit.reshape(a.shape[:-2]), ends.reshape(*a.shape[:-2], 2, 3)


def _pairs(a: FloatArray, b: FloatArray) -> FloatArray:
    """(N, 6, 3) both triangles of each pair."""
    if a.shape[-2:] != (3, 3) or a.shape != b.shape:
        raise ShapeError("triangles", (a.shape, b.shape), "(..., 3, 3) twice")
    return np.ascontiguousarray(np.concatenate([a, b], -2), np.float64).reshape(-1, 6, 3)


@njit(cache=True, nogil=True, error_model="numpy")
def meet(p: FloatArray) -> bool:
    """Whether the triangles in rows 0-2 and 3-5 meet."""
    d3, d4, d5 = _side(p, 0, 1, 2, 3), _side(p, 0, 1, 2, 4), _side(p, 0, 1, 2, 5)
    if (d3 > 0 and d4 > 0 and d5 > 0) or (d3 < 0 and d4 < 0 and d5 < 0):
        return False
    d0, d1, d2 = _side(p, 3, 4, 5, 0), _side(p, 3, 4, 5, 1), _side(p, 3, 4, 5, 2)
    if (d0 > 0 and d1 > 0 and d2 > 0) or (d0 < 0 and d1 < 0 and d2 < 0):
        return False
    if d0 * d1 * d2 * d3 * d4 * d5 == 0:
        return bool(_edges_meet(p))
    a, b, c, swap_b = _apex_first(0, d0, d1, d2)
    d, e, f, swap_a = _apex_first(3, d3, d4, d5)
    if swap_a:  # so that the plane of each has the other's apex on its positive side
        b, c = c, b
    if swap_b:
        e, f = f, e
    return bool(_side(p, a, b, d, e) <= 0 and _side(p, a, c, f, d) <= 0)


@njit(cache=True, nogil=True, error_model="numpy")
def intersection_into(p: FloatArray, ends: FloatArray) -> bool:
    """Whether the triangles meet, and (2, 3) the two ends of what they have in common."""
    if not meet(p):
        return False
    found = np.empty((30, 3))  # 6 edges: 2 own ends and 3 crossings each
    n = 0
    for side in range(2):
        mine, other = 3 * side, 3 - 3 * side
        for e in range(3):
            n = _edge_points(p, mine + e, mine + (e + 1) % 3, other, found, n)
    _farthest_apart(found, n, ends)
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _apex_first(start: int, d0: int, d1: int, d2: int) -> tuple[int, int, int, bool]:
    """Rows of a triangle with the corner that is alone on its side first, and whether that side is the negative."""
    if d0 == d1:
        return start + 2, start, start + 1, d2 < 0
    if d0 == d2:
        return start + 1, start + 2, start, d1 < 0
    return start, start + 1, start + 2, d0 < 0


@njit(cache=True, nogil=True, error_model="numpy")
def _side(p: FloatArray, i: int, j: int, k: int, m: int) -> int:
    """On which side of the plane through i, j, k point m is: 1 where they turn left seen from it, 0 near it."""
    ax, ay, az = p[j, 0] - p[i, 0], p[j, 1] - p[i, 1], p[j, 2] - p[i, 2]
    bx, by, bz = p[k, 0] - p[i, 0], p[k, 1] - p[i, 1], p[k, 2] - p[i, 2]
    cx, cy, cz = p[m, 0] - p[i, 0], p[m, 1] - p[i, 1], p[m, 2] - p[i, 2]
    x1, x2, y1, y2, z1, z2 = ay * bz, az * by, az * bx, ax * bz, ax * by, ay * bx
    value = (x1 - x2) * cx + (y1 - y2) * cy + (z1 - z2) * cz
    permanent = (abs(x1) + abs(x2)) * abs(cx) + (abs(y1) + abs(y2)) * abs(cy) + (abs(z1) + abs(z2)) * abs(cz)
    if abs(value) <= _ERROR_3 * permanent:
        return 0
    return 1 if value > 0 else -1


@njit(cache=True, nogil=True, error_model="numpy")
def _side_2(p: FloatArray, i: int, j: int, k: int, u: int, v: int) -> int:
    """Whether points i, j, k turn left (1), right (-1) or lie on a line, seen in coordinates u and v."""
    left = (p[j, u] - p[i, u]) * (p[k, v] - p[i, v])
    right = (p[j, v] - p[i, v]) * (p[k, u] - p[i, u])
    if abs(left - right) <= _ERROR_2 * (abs(left) + abs(right)):
        return 0
    return 1 if left > right else -1


@njit(cache=True, nogil=True, error_model="numpy")
def _edges_meet(p: FloatArray) -> bool:
    """Whether an edge of one meets the other triangle."""
    for side in range(2):
        mine, other = 3 * side, 3 - 3 * side
        for e in range(3):
            if _segment_meets_triangle(p, mine + e, mine + (e + 1) % 3, other):
                return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def _segment_meets_triangle(p: FloatArray, i: int, j: int, t: int) -> bool:
    """Whether a segment meets the triangle that starts at row t; both may be degenerate."""
    axis = _projection(p, t, t + 1, t, t + 2)
    if axis < 0:
        return bool(
            _segments_meet(p, i, j, t, t + 1)
            or _segments_meet(p, i, j, t + 1, t + 2)
            or _segments_meet(p, i, j, t + 2, t)
        )
    above, below = _side(p, t, t + 1, t + 2, i), _side(p, t, t + 1, t + 2, j)
    if above * below > 0:
        return False
    if above == 0 and below == 0:
        return bool(_segment_meets_coplanar(p, i, j, t, axis))
    s0, s1, s2 = _side(p, i, j, t, t + 1), _side(p, i, j, t + 1, t + 2), _side(p, i, j, t + 2, t)
    return bool((s0 >= 0 and s1 >= 0 and s2 >= 0) or (s0 <= 0 and s1 <= 0 and s2 <= 0))


@njit(cache=True, nogil=True, error_model="numpy")
def _segment_meets_coplanar(p: FloatArray, i: int, j: int, t: int, axis: int) -> bool:
    """The same within the triangle's plane, seen along an axis."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    if _inside_coplanar(p, i, t, u, v):
        return True
    for e in range(3):
        if _cross_2(p, i, j, t + e, t + (e + 1) % 3, u, v):
            return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def _inside_coplanar(p: FloatArray, i: int, t: int, u: int, v: int) -> bool:
    """Whether a point of the triangle's plane is in it."""
    s0, s1, s2 = _side_2(p, t, t + 1, i, u, v), _side_2(p, t + 1, t + 2, i, u, v), _side_2(p, t + 2, t, i, u, v)
    return bool((s0 >= 0 and s1 >= 0 and s2 >= 0) or (s0 <= 0 and s1 <= 0 and s2 <= 0))


@njit(cache=True, nogil=True, error_model="numpy")
def _projection(p: FloatArray, i: int, j: int, k: int, m: int) -> int:
    """The axis along which segments i-j and k-m span the largest area, -1 if they are parallel."""
    best, axis = 0.0, -1
    for a in range(3):
        u, v = (a + 1) % 3, (a + 2) % 3
        left = (p[j, u] - p[i, u]) * (p[m, v] - p[k, v])
        right = (p[j, v] - p[i, v]) * (p[m, u] - p[k, u])
        area = abs(left - right)
        if area > _ERROR_2 * (abs(left) + abs(right)) and area > best:
            best, axis = area, a
    return axis


@njit(cache=True, nogil=True, error_model="numpy")
def _segments_meet(p: FloatArray, i: int, j: int, k: int, m: int) -> bool:
    """Whether two segments in space meet; both may be points."""
    axis = _projection(p, i, j, k, m)
    if axis >= 0:
        return bool(_side(p, i, j, k, m) == 0 and _cross_2(p, i, j, k, m, (axis + 1) % 3, (axis + 2) % 3))
    for a in range(3):  # parallel: on one line, and overlapping in every coordinate
        u, v = (a + 1) % 3, (a + 2) % 3
        if not _cross_2(p, i, j, k, m, u, v):
            return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _cross_2(p: FloatArray, i: int, j: int, k: int, m: int, u: int, v: int) -> bool:
    """Whether two segments meet, seen in coordinates u and v."""
    s0, s1 = _side_2(p, i, j, k, u, v), _side_2(p, i, j, m, u, v)
    s2, s3 = _side_2(p, k, m, i, u, v), _side_2(p, k, m, j, u, v)
    if s0 * s1 > 0 or s2 * s3 > 0:
        return False
    if s0 == 0 and s1 == 0 and s2 == 0 and s3 == 0:
        return bool(_overlap(p, i, j, k, m, u) and _overlap(p, i, j, k, m, v))
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _overlap(p: FloatArray, i: int, j: int, k: int, m: int, u: int) -> bool:
    """Whether the ranges of two segments in one coordinate overlap."""
    low, high = max(min(p[i, u], p[j, u]), min(p[k, u], p[m, u])), min(max(p[i, u], p[j, u]), max(p[k, u], p[m, u]))
    return bool(low <= high)


@njit(cache=True, nogil=True, error_model="numpy")
def _edge_points(p: FloatArray, i: int, j: int, t: int, found: FloatArray, n: int) -> int:
    """Append where a segment enters and leaves the triangle at row t; how many there are then."""
    if not _segment_meets_triangle(p, i, j, t):
        return n
    axis = _projection(p, t, t + 1, t, t + 2)
    above, below = _side(p, t, t + 1, t + 2, i), _side(p, t, t + 1, t + 2, j)
    if axis < 0 or (above == 0 and below == 0):
        return int(_shared_points(p, i, j, t, found, n))
    height_i, height_j = _height(p, t, i), _height(p, t, j)
    s = 0.0 if above == 0 else 1.0 if below == 0 else height_i / (height_i - height_j)
    for r in range(3):
        found[n, r] = p[i, r] + s * (p[j, r] - p[i, r])
    return n + 1


@njit(cache=True, nogil=True, error_model="numpy")
def _shared_points(p: FloatArray, i: int, j: int, t: int, found: FloatArray, n: int) -> int:
    """Append the ends of what a segment and a triangle in one plane share: own ends inside, and crossed edges."""
    for end in (i, j):
        if _segment_meets_triangle(p, end, end, t):
            for r in range(3):
                found[n, r] = p[end, r]
            n += 1
    for e in range(3):
        k, m = t + e, t + (e + 1) % 3
        axis = _projection(p, i, j, k, m)
        if axis >= 0 and _segments_meet(p, i, j, k, m):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            span = (p[j, u] - p[i, u]) * (p[m, v] - p[k, v]) - (p[j, v] - p[i, v]) * (p[m, u] - p[k, u])
            s = ((p[k, u] - p[i, u]) * (p[m, v] - p[k, v]) - (p[k, v] - p[i, v]) * (p[m, u] - p[k, u])) / span
            for r in range(3):
                found[n, r] = p[i, r] + min(max(s, 0.0), 1.0) * (p[j, r] - p[i, r])
            n += 1
    return n


@njit(cache=True, nogil=True, error_model="numpy")
def _height(p: FloatArray, t: int, i: int) -> float:
    """Height of a point over a triangle's plane, times twice its area."""
    ax, ay, az = p[t + 1, 0] - p[t, 0], p[t + 1, 1] - p[t, 1], p[t + 1, 2] - p[t, 2]
    bx, by, bz = p[t + 2, 0] - p[t, 0], p[t + 2, 1] - p[t, 1], p[t + 2, 2] - p[t, 2]
    x, y, z = p[i, 0] - p[t, 0], p[i, 1] - p[t, 1], p[i, 2] - p[t, 2]
    return float((ay * bz - az * by) * x + (az * bx - ax * bz) * y + (ax * by - ay * bx) * z)


@njit(cache=True, nogil=True, error_model="numpy")
def _farthest_apart(found: FloatArray, n: int, ends: FloatArray) -> None:
    """The two points of a few that are farthest apart."""
    best, first, second = -1.0, 0, 0
    for i in range(n):
        for j in range(i, n):
            far = 0.0
            for r in range(3):
                far += (found[i, r] - found[j, r]) ** 2
            if far > best:
                best, first, second = far, i, j
    for r in range(3):
        ends[0, r], ends[1, r] = found[first, r], found[second, r]


@njit(cache=True, nogil=True, error_model="numpy")
def _meet_all(corners: FloatArray, out: BoolArray) -> None:
    """`meet` for many pairs."""
    for i in range(corners.shape[0]):
        out[i] = meet(corners[i])


@njit(cache=True, nogil=True, error_model="numpy")
def _intersect_all(corners: FloatArray, hit: BoolArray, ends: FloatArray) -> None:
    """`intersection_into` for many pairs."""
    for i in range(corners.shape[0]):
        hit[i] = intersection_into(corners[i], ends[i])
