"""How deep one limb lies inside another: the vertex of either that is farthest below the other's skin.

Inside means that the surface of the other limb, with its holes capped, goes round the vertex at least once: the sum
of signed crossings of a ray, which is the generalised winding number of a closed surface without its arctangents.
Depth is the distance to the skin, never to a cap: a hand that enters a thigh near the hip is as deep as its way out
is long.

The compiled functions take the arrays of `LimbArrays` and `Posture` one by one under their names there: tuples of
arrays are slow to hand on.
"""

import numpy as np
from numba import njit

from mhvedit.collision.boxes import Nine, Three
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.geometry.nearest import nearest_weights

STACK = 512  # boxes that wait


@njit(cache=True, nogil=True, error_model="numpy")
def deepest_into(
    faces: IntArray,
    caps: IntArray,
    first: IntArray,
    size: IntArray,
    leaf: BoolArray,
    local: FloatArray,
    centre: FloatArray,
    half: FloatArray,
    root: int,
    exempt: BoolArray,
    start: int,
    stop: int,
    r: Nine,
    t: Three,
    least: float,
    nearest: FloatArray,
) -> tuple[float, int]:
    """The vertex of one limb, the inner, that is deepest in another, the outer.

    Args:
        faces: of all limbs.
        caps: (c, 3) of the outer limb.
        first: of all boxes.
        size: of all boxes.
        leaf: of all boxes.
        local: of all vertices.
        centre: of all boxes.
        half: of all boxes.
        root: box of the outer limb.
        exempt: (N,) vertices that do not count.
        start: first vertex of the inner limb.
        stop: past its last.
        r: outer_from_inner, with t.
        t: see r.
        least: m, look only for what is deeper.
        nearest: (3,) m, out: the nearest point of the outer limb's skin, in its box frame.

    Returns:
        depth m and vertex (of the N), or `least` and -1.
    """
    p, q, stack = np.empty(3), np.empty(3), np.empty(STACK, np.int64)
    best, vertex = least, -1
    for v in range(start, stop):
        x, y, z, within = local[v, 0], local[v, 1], local[v, 2], not exempt[v]
        p[0] = t[0] + r[0] * x + r[1] * y + r[2] * z
        p[1] = t[1] + r[3] * x + r[4] * y + r[5] * z
        p[2] = t[2] + r[6] * x + r[7] * y + r[8] * z
        for c in range(3):
            within = within and abs(p[c] - centre[root, c]) <= half[root, c]
        if not within or winding(faces, caps, first, size, leaf, local, centre, half, root, p, stack) < 1:
            continue
        depth = skin_distance_into(faces, first, size, leaf, local, centre, half, root, p, best, stack, q)
        if depth > best:
            best, vertex = depth, v
            nearest[:] = q
    return best, vertex


@njit(cache=True, nogil=True, error_model="numpy")
def winding(
    faces: IntArray,
    caps: IntArray,
    first: IntArray,
    size: IntArray,
    leaf: BoolArray,
    local: FloatArray,
    centre: FloatArray,
    half: FloatArray,
    root: int,
    p: FloatArray,
    stack: IntArray,
) -> int:
    """How often a limb's capped surface goes round a point (3,) m in its box frame; see `deepest_into`.

    Signed crossings of the ray towards the box's second axis. Triangles are seen along it; each edge decides the same
    way for both triangles that have it, so that nothing is crossed twice or slips through.
    """
    total = 0
    for f in range(caps.shape[0]):
        total += _crossed(local, caps, f, p)
    stack[0], top = root, 1
    while top > 0:
        top -= 1
        node = stack[top]
        if (
            abs(p[0] - centre[node, 0]) > half[node, 0]
            or abs(p[2] - centre[node, 2]) > half[node, 2]
            or p[1] > centre[node, 1] + half[node, 1]
        ):
            continue
        for i in range(first[node], first[node] + size[node]):
            if leaf[node]:
                total += _crossed(local, faces, i, p)
            else:
                stack[top] = i
                top += 1
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def _crossed(local: FloatArray, faces: IntArray, f: int, p: FloatArray) -> int:
    """1 where the ray leaves through a triangle, -1 where it enters, 0 where it misses."""
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    turns = _passes(local, a, b, p) + _passes(local, b, c, p) + _passes(local, c, a, p)
    if turns == 0:
        return 0
    ux, uy, uz = local[b, 0] - local[a, 0], local[b, 1] - local[a, 1], local[b, 2] - local[a, 2]
    vx, vy, vz = local[c, 0] - local[a, 0], local[c, 1] - local[a, 1], local[c, 2] - local[a, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    if ny == 0.0:
        return 0
    height = local[a, 1] - (nx * (p[0] - local[a, 0]) + nz * (p[2] - local[a, 2])) / ny
    return turns if height > p[1] else 0


@njit(cache=True, nogil=True, error_model="numpy")
def _passes(local: FloatArray, i: int, j: int, p: FloatArray) -> int:
    """1 or -1 where an edge, seen along the ray, passes beyond the point; round a ring they sum to its turns."""
    low, high, sign = (i, j, 1) if local[i, 2] <= local[j, 2] else (j, i, -1)
    if local[low, 2] > p[2] or local[high, 2] <= p[2]:
        return 0
    along = (p[2] - local[low, 2]) / (local[high, 2] - local[low, 2])
    return -sign if local[low, 0] + along * (local[high, 0] - local[low, 0]) > p[0] else 0


@njit(cache=True, nogil=True, error_model="numpy")
def skin_distance_into(
    faces: IntArray,
    first: IntArray,
    size: IntArray,
    leaf: BoolArray,
    local: FloatArray,
    centre: FloatArray,
    half: FloatArray,
    root: int,
    p: FloatArray,
    enough: float,
    stack: IntArray,
    nearest: FloatArray,
) -> float:
    """Distance m of a point (3,) m in its box frame from a limb's skin; see `deepest_into`.

    Stops when no more than `enough` is known: the result is then too large, but not more than that. `nearest` (3,) m
    is the nearest point.
    """
    best, point = np.inf, np.empty(3)
    stack[0], top = root, 1
    while top > 0:
        top -= 1
        node = stack[top]
        if _box_distance(centre, half, node, p) >= best:
            continue
        if leaf[node]:
            for f in range(first[node], first[node] + size[node]):
                _nearest_on_triangle(local, faces, f, p, point)
                square = (point[0] - p[0]) ** 2 + (point[1] - p[1]) ** 2 + (point[2] - p[2]) ** 2
                if square < best:
                    best = square
                    nearest[:] = point
            if best <= enough * enough:
                return float(np.sqrt(best))
        else:
            top = _push_children(first, size, centre, half, node, p, stack, top)
    return float(np.sqrt(best))


@njit(cache=True, nogil=True, error_model="numpy")
def _push_children(
    first: IntArray,
    size: IntArray,
    centre: FloatArray,
    half: FloatArray,
    node: int,
    p: FloatArray,
    stack: IntArray,
    top: int,
) -> int:
    """Put the children of a box on the stack, the nearest on top."""
    closest, which = np.inf, -1
    for child in range(first[node], first[node] + size[node]):
        far = _box_distance(centre, half, child, p)
        if far < closest:
            closest, which = far, top
        stack[top] = child
        top += 1
    stack[which], stack[top - 1] = stack[top - 1], stack[which]
    return top


@njit(cache=True, nogil=True, error_model="numpy")
def _box_distance(centre: FloatArray, half: FloatArray, node: int, p: FloatArray) -> float:
    """Squared distance of a point from a box."""
    total = 0.0
    for x in range(3):
        beyond = abs(p[x] - centre[node, x]) - half[node, x]
        if beyond > 0.0:
            total += beyond * beyond
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def _nearest_on_triangle(local: FloatArray, faces: IntArray, f: int, p: FloatArray, out: FloatArray) -> None:
    """The point of a triangle that is nearest to another (Ericson, Real-Time Collision Detection, 5.1.5)."""
    i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
    d1, d2, d3, d4, d5, d6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for x in range(3):
        ab, ac = local[j, x] - local[i, x], local[k, x] - local[i, x]
        d1 += ab * (p[x] - local[i, x])
        d2 += ac * (p[x] - local[i, x])
        d3 += ab * (p[x] - local[j, x])
        d4 += ac * (p[x] - local[j, x])
        d5 += ab * (p[x] - local[k, x])
        d6 += ac * (p[x] - local[k, x])
    v, w = nearest_weights(d1, d2, d3, d4, d5, d6)
    for x in range(3):
        out[x] = local[i, x] + v * (local[j, x] - local[i, x]) + w * (local[k, x] - local[i, x])
