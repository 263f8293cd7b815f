"""Do the surfaces of two limbs cross: boxes, sub-boxes, triangles (Liu et al., A4.1-A4.3).

Limbs are in a `Posture`: vertices and boxes in the box frames of the limbs, and where these frames are. Everything
here works in the frame of the first limb of a pair. Triangles that share a vertex of the body always touch and do
not count.
"""

from typing import Final, NamedTuple

import numpy as np
from numba import njit

from mhvedit.collision.boxes import Nine, Three, apart, widened
from mhvedit.collision.triangles import intersection_into, meet
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray

STACK: Final = 2048  # pairs of boxes that wait; each step down adds at most SLABS[1]


class Posture(NamedTuple):
    """Limbs in one posture."""

    local: FloatArray  # (N, 3) m, vertices in their limbs' box frames
    centre: FloatArray  # (M, 3) m, boxes
    half: FloatArray  # (M, 3) m
    turns: FloatArray  # (L, 3, 3) world_from_box
    places: FloatArray  # (L, 3) m


@njit(cache=True, nogil=True, error_model="numpy")
def relative(turns: FloatArray, places: FloatArray, a: int, b: int) -> tuple[Nine, Three]:
    """a_from_b: rotation, row by row, and translation m. Tuples of numbers cost nothing to hand on, arrays do."""
    a00, a01, a02 = turns[a, 0, 0], turns[a, 0, 1], turns[a, 0, 2]
    a10, a11, a12 = turns[a, 1, 0], turns[a, 1, 1], turns[a, 1, 2]
    a20, a21, a22 = turns[a, 2, 0], turns[a, 2, 1], turns[a, 2, 2]
    b00, b01, b02 = turns[b, 0, 0], turns[b, 0, 1], turns[b, 0, 2]
    b10, b11, b12 = turns[b, 1, 0], turns[b, 1, 1], turns[b, 1, 2]
    b20, b21, b22 = turns[b, 2, 0], turns[b, 2, 1], turns[b, 2, 2]
    x, y, z = places[b, 0] - places[a, 0], places[b, 1] - places[a, 1], places[b, 2] - places[a, 2]
    r = (
        a00 * b00 + a10 * b10 + a20 * b20,
        a00 * b01 + a10 * b11 + a20 * b21,
        a00 * b02 + a10 * b12 + a20 * b22,
        a01 * b00 + a11 * b10 + a21 * b20,
        a01 * b01 + a11 * b11 + a21 * b21,
        a01 * b02 + a11 * b12 + a21 * b22,
        a02 * b00 + a12 * b10 + a22 * b20,
        a02 * b01 + a12 * b11 + a22 * b21,
        a02 * b02 + a12 * b12 + a22 * b22,
    )
    return r, (a00 * x + a10 * y + a20 * z, a01 * x + a11 * y + a21 * z, a02 * x + a12 * y + a22 * z)


@njit(cache=True, nogil=True, error_model="numpy")
def boxes_apart(centre: FloatArray, half: FloatArray, r: Nine, s: Nine, t: Three, i: int, j: int) -> bool:
    """Whether box i of the first limb and box j of the second are separated."""
    u, v, w = centre[j, 0], centre[j, 1], centre[j, 2]
    x = t[0] + r[0] * u + r[1] * v + r[2] * w - centre[i, 0]
    y = t[1] + r[3] * u + r[4] * v + r[5] * w - centre[i, 1]
    z = t[2] + r[6] * u + r[7] * v + r[8] * w - centre[i, 2]
    a, b = (half[i, 0], half[i, 1], half[i, 2]), (half[j, 0], half[j, 1], half[j, 2])
    return bool(apart(r, s, x, y, z, a, b))


@njit(cache=True, nogil=True, error_model="numpy")
def crossings_into(
    faces: IntArray,
    vertex: IntArray,
    first: IntArray,
    size: IntArray,
    leaf: BoolArray,
    local: FloatArray,
    centre: FloatArray,
    half: FloatArray,
    r: Nine,
    t: Three,
    root_a: int,
    root_b: int,
    found: IntArray,
) -> int:
    """Pairs of triangles of two limbs that meet; as many as there is room for.

    Args:
        faces: of all limbs, with vertex, first, size and leaf: see LimbArrays.
        vertex: see faces.
        first: see faces.
        size: see faces.
        leaf: see faces.
        local: of the posture, with centre and half: see Posture.
        centre: see local.
        half: see local.
        r: a_from_b of `relative`, with t.
        t: see r.
        root_a: box of the first limb.
        root_b: box of the second limb.
        found: (room, 2) out: triangles of the first and of the second.

    Returns:
        How many were found.
    """
    s = widened(r)
    stack, corners, n = np.empty((STACK, 2), np.int64), np.empty((6, 3)), 0
    stack[0, 0], stack[0, 1], top = root_a, root_b, 1
    while top > 0:
        top -= 1
        i, j = stack[top, 0], stack[top, 1]
        if boxes_apart(centre, half, r, s, t, i, j):
            continue
        if leaf[i] and leaf[j]:
            n = _leaves(faces, vertex, first, size, local, r, t, i, j, corners, found, n)
            if n >= found.shape[0]:
                return int(n)
        elif leaf[j] or (not leaf[i] and _size(half, i) > _size(half, j)):
            for child in range(first[i], first[i] + size[i]):
                stack[top, 0], stack[top, 1] = child, j
                top += 1
        else:
            for child in range(first[j], first[j] + size[j]):
                stack[top, 0], stack[top, 1] = i, child
                top += 1
    return n


@njit(cache=True, nogil=True, error_model="numpy")
def _size(half: FloatArray, i: int) -> float:
    """What decides which of two boxes is opened."""
    return float(half[i, 0] + half[i, 1] + half[i, 2])


@njit(cache=True, nogil=True, error_model="numpy")
def _leaves(
    faces: IntArray,
    vertex: IntArray,
    first: IntArray,
    size: IntArray,
    local: FloatArray,
    r: Nine,
    t: Three,
    i: int,
    j: int,
    corners: FloatArray,
    found: IntArray,
    n: int,
) -> int:
    """Append the pairs of triangles of two leaves that meet; how many there are then."""
    for fb in range(first[j], first[j] + size[j]):
        for k in range(3):
            v = faces[fb, k]
            x, y, z = local[v, 0], local[v, 1], local[v, 2]
            corners[3 + k, 0] = t[0] + r[0] * x + r[1] * y + r[2] * z
            corners[3 + k, 1] = t[1] + r[3] * x + r[4] * y + r[5] * z
            corners[3 + k, 2] = t[2] + r[6] * x + r[7] * y + r[8] * z
        for fa in range(first[i], first[i] + size[i]):
            for k in range(3):
                v = faces[fa, k]
                for c in range(3):
                    corners[k, c] = local[v, c]
            if _ranges_overlap(corners) and meet(corners) and not _share_vertex(vertex, faces, fa, fb):
                found[n, 0], found[n, 1] = fa, fb
                n += 1
                if n >= found.shape[0]:
                    return n
    return n


@njit(cache=True, nogil=True, error_model="numpy")
def _ranges_overlap(p: FloatArray) -> bool:
    """Whether two triangles overlap in every coordinate."""
    for x in range(3):
        if max(p[0, x], p[1, x], p[2, x]) < min(p[3, x], p[4, x], p[5, x]):
            return False
        if min(p[0, x], p[1, x], p[2, x]) > max(p[3, x], p[4, x], p[5, x]):
            return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _share_vertex(vertex: IntArray, faces: IntArray, fa: int, fb: int) -> bool:
    """Whether two triangles have a vertex of the body in common."""
    for i in range(3):
        for j in range(3):
            if vertex[faces[fa, i]] == vertex[faces[fb, j]]:
                return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def common_segment_into(faces: IntArray, posture: Posture, pair: IntArray, which: IntArray, ends: FloatArray) -> None:
    """(2, 3) m in the world: the ends of what two triangles have in common."""
    corners = np.empty((6, 3))
    for side in range(2):
        limb = pair[side]
        for k in range(3):
            v = faces[which[side], k]
            for x in range(3):
                turned = posture.places[limb, x]
                for y in range(3):
                    turned += posture.turns[limb, x, y] * posture.local[v, y]
                corners[3 * side + k, x] = turned
    if not intersection_into(corners, ends):  # they did in the frame of the limb: they touch
        for x in range(3):
            ends[0, x] = ends[1, x] = (corners[3, x] + corners[4, x] + corners[5, x]) / 3.0
