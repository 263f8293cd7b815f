"""Solid voxels of a mesh: which lattice points lie inside, for closed meshes and for captures with holes.

What counts as inside. A ray along an axis through a voxel's centre crosses the surface; each crossing enters or
leaves, and the sum up to the centre is the winding number seen by that ray. A ray whose crossings balance votes
"inside" where its winding number is not zero; one whose crossings do not balance (holes, flipped or missing faces), or
whose winding number changes sign, votes by parity, counted from either end. A mesh without boundary (every edge is run
through equally often both ways) needs the rays along z only; any other takes the six rays along x, y and z, and a
voxel is inside where at least four agree.

Exact: corners are snapped to 1/65536 of a voxel, ray-triangle incidence is decided in integers, and a ray that passes
through an edge or a corner counts for exactly one of the triangles that meet there.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mhvedit.geometry.arrays import BoolArray, ByteArray, FloatArray, Int32Array, IntArray
from mhvedit.geometry.closed import has_no_boundary
from mhvedit.geometry.grid import VoxelGrid, grid_around
from mhvedit.sequences.areas import bounds
from mhvedit.sequences.meshes import Mesh

SNAP = 65536  # sub-voxel positions along an axis
VOTES_NEEDED = 4  # of six rays
NONE = -1  # no crossing
SignArray = NDArray[np.int8]


def solid_voxels(mesh: Mesh, pitch: float) -> tuple[VoxelGrid, BoolArray]:
    """Voxels whose centres lie inside a mesh (Shi et al., section 3.1: D).

    Args:
        mesh: faces wound outwards; holes, flipped faces and loose pieces are survived (see the module).
        pitch: m.

    Returns:
        The box around the mesh, and (X, Y, Z) which of its voxels are filled.
    """
    low, high = bounds(mesh.vertices)
    grid = grid_around(low, high, pitch)
    points = _snapped(mesh.vertices / pitch - np.array(grid.start))
    votes = np.zeros(grid.shape, np.uint8)
    if has_no_boundary(mesh.faces):
        _add_votes(points, mesh.faces, votes, axis=2)
        return grid, votes == 2
    for axis in range(3):
        _add_votes(points, mesh.faces, votes, axis=axis)
    return grid, votes >= VOTES_NEEDED


def ray_votes(scaled: FloatArray, faces: Int32Array, shape: tuple[int, int, int], *, axis: int) -> ByteArray:
    """How many of the two rays along an axis (up and down) see each voxel's centre inside.

    Args:
        scaled: (V, 3) corners in voxels, voxel (0, 0, 0) centred at the origin.
        faces: (F, 3).
        shape: voxels of the box.
        axis: along which the rays run.

    Returns:
        (X, Y, Z) 0, 1 or 2.
    """
    votes = np.zeros(shape, np.uint8)
    _add_votes(_snapped(scaled), faces, votes, axis=axis)
    return votes


def _snapped(scaled: FloatArray) -> IntArray:
    """Corners in sub-voxel steps."""
    return np.rint(scaled * SNAP).astype(np.int64)


def _add_votes(points: IntArray, faces: Int32Array, votes: ByteArray, *, axis: int) -> None:
    """Cast the rays along an axis; columns run through the other two in cyclic order."""
    order = np.array([(axis + 1) % 3, (axis + 2) % 3, axis])
    shape, steps = np.array(votes.shape)[order], np.array(votes.strides)[order]
    _cast(points, faces, order, shape, steps, votes.reshape(-1))


@njit(cache=True, nogil=True)
def _cast(
    points: IntArray, faces: Int32Array, order: IntArray, shape: IntArray, steps: IntArray, votes: ByteArray
) -> None:
    """Add the votes of all rays along axis order[2]; shape and steps are those of the votes, in that order."""
    n_u, n_v, n_w = shape
    room = _most_crossings(points, faces, order, n_u, n_v)
    first = np.full(n_u * n_v, NONE, np.int64)  # crossing of each column
    following, heights, signs = np.empty(room, np.int64), np.empty(room), np.empty(room, np.int8)
    _cross(points, faces, order, n_u, n_v, first, following, heights, signs)
    for column in range(n_u * n_v):
        if first[column] == NONE:
            continue
        start = column // n_v * steps[0] + column % n_v * steps[1]
        _vote(first[column], following, heights, signs, n_w, start, steps[2], votes)


@njit(cache=True, nogil=True)
def _columns_of(a: int, b: int, c: int, limit: int) -> tuple[int, int]:
    """First and past-the-last column that a projected triangle with these corners can cover along one axis."""
    low, high = min(a, b, c), max(a, b, c)
    return max(0, -(-low // SNAP)), min(limit, high // SNAP + 1)


@njit(cache=True, nogil=True)
def _most_crossings(points: IntArray, faces: Int32Array, order: IntArray, n_u: int, n_v: int) -> int:
    """How many columns the boxes around all projected triangles hold."""
    total = 0
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        u0, u1 = _columns_of(points[i, order[0]], points[j, order[0]], points[k, order[0]], n_u)
        v0, v1 = _columns_of(points[i, order[1]], points[j, order[1]], points[k, order[1]], n_v)
        total += max(0, u1 - u0) * max(0, v1 - v0)
    return total


@njit(cache=True, nogil=True)
def _edge(au: int, av: int, bu: int, bv: int, u: int, v: int) -> tuple[int, int, int]:
    """Twice the side of the directed edge a -> b on which column (u, v) lies, and how it grows with u and v.

    The sign says the side; a point on the line is nudged by (eps, eps^2), so that 0 is left to edges of no length.
    """
    grow_u, grow_v = 2 * (av - bv), 2 * (bu - au)
    nudge = grow_u if grow_u != 0 else grow_v
    side = grow_v * (v * SNAP - av) + grow_u * (u * SNAP - au) + (1 if nudge > 0 else -1 if nudge < 0 else 0)
    return side, grow_u * SNAP, grow_v * SNAP


@njit(cache=True, nogil=True)
def _cross(
    points: IntArray, faces: Int32Array, order: IntArray, n_u: int, n_v: int,
    first: IntArray, following: IntArray, heights: FloatArray, signs: SignArray,
) -> None:  # fmt: skip
    """Chain up the crossings of every column from below: height (voxels) and sign (+1 enters going up, -1 leaves)."""
    n, (a, b, c) = 0, order
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        iu, ju, ku = points[i, a], points[j, a], points[k, a]
        u0, u1 = _columns_of(iu, ju, ku, n_u)
        iv, jv, kv = points[i, b], points[j, b], points[k, b]
        v0, v1 = _columns_of(iv, jv, kv, n_v)
        area = (ju - iu) * (kv - iv) - (jv - iv) * (ku - iu)
        if u0 >= u1 or v0 >= v1 or area == 0:
            continue
        sign = 1 if area > 0 else -1
        ij, ij_u, ij_v = _edge(iu, iv, ju, jv, u0, v0)
        jk, jk_u, jk_v = _edge(ju, jv, ku, kv, u0, v0)
        ki, ki_u, ki_v = _edge(ku, kv, iu, iv, u0, v0)
        for u in range(u0, u1):
            for v in range(v0, v1):
                du, dv = u - u0, v - v0
                if sign * (ij + du * ij_u + dv * ij_v) <= 0 or sign * (jk + du * jk_u + dv * jk_v) <= 0:
                    continue
                if sign * (ki + du * ki_u + dv * ki_v) <= 0:
                    continue
                s, t = _weights(ju - iu, jv - iv, ku - iu, kv - iv, u * SNAP - iu, v * SNAP - iv)
                heights[n] = _height(points[i, c] / SNAP, points[j, c] / SNAP, points[k, c] / SNAP, s, t)
                signs[n] = -sign
                _chain(u * n_v + v, n, first, following, heights)
                n += 1


@njit(cache=True, nogil=True)
def _weights(ju: int, jv: int, ku: int, kv: int, pu: int, pv: int) -> tuple[float, float]:
    """How much of two edges from one corner leads to a point."""
    j_u, j_v, k_u, k_v, p_u, p_v = float(ju), float(jv), float(ku), float(kv), float(pu), float(pv)
    area = j_u * k_v - j_v * k_u
    if area == 0.0:  # lost to rounding
        return 0.5, 0.0
    return (p_u * k_v - p_v * k_u) / area, (j_u * p_v - j_v * p_u) / area


@njit(cache=True, nogil=True)
def _height(i: float, j: float, k: float, s: float, t: float) -> float:
    """Height of a triangle whose corners have three heights, kept within their span."""
    return min(max(i + s * (j - i) + t * (k - i), min(i, j, k)), max(i, j, k))


@njit(cache=True, nogil=True, inline="always")
def _chain(column: int, crossing: int, first: IntArray, following: IntArray, heights: FloatArray) -> None:
    """Put a crossing in its place in the column's chain: by height, equals in the order of their faces."""
    after, before = first[column], NONE
    while after != NONE and heights[after] <= heights[crossing]:
        before, after = after, following[after]
    following[crossing] = after
    if before == NONE:
        first[column] = crossing
    else:
        following[before] = crossing


@njit(cache=True, nogil=True, inline="always")
def _vote(
    first: int, following: IntArray, heights: FloatArray, signs: SignArray, n_w: int, start: int, step: int,
    votes: ByteArray,
) -> None:  # fmt: skip
    """Add the votes of one column, of which the first voxel is at `start`."""
    balanced, total = _balance(first, following, signs)
    winding, crossed, w, crossing = 0, 0, 0, first
    while w < n_w:
        stop = n_w if crossing == NONE else min(n_w, max(w, int(np.ceil(heights[crossing]))))
        vote = _ray_pair_vote(balanced, winding, crossed, total)
        if vote > 0:
            for at in range(w, stop):
                votes[start + at * step] += vote
        w = stop
        if crossing == NONE:
            break
        winding += signs[crossing]
        crossed += 1
        crossing = following[crossing]


@njit(cache=True, nogil=True, inline="always")
def _balance(first: int, following: IntArray, signs: SignArray) -> tuple[bool, int]:
    """Whether a column's signs add up to nothing without the winding number ever changing its sign; and how many."""
    winding, least, most, total, crossing = 0, 0, 0, 0, first
    while crossing != NONE:
        winding += signs[crossing]
        least, most = min(least, winding), max(most, winding)
        total += 1
        crossing = following[crossing]
    return winding == 0 and (least == 0 or most == 0), total


@njit(cache=True, nogil=True)
def _ray_pair_vote(balanced: bool, winding: int, crossed: int, total: int) -> int:
    """Votes of the ray from below and the ray from above at a point with `crossed` of `total` crossings below it."""
    if balanced:
        return 2 if winding != 0 else 0
    return crossed % 2 + (total - crossed) % 2
