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

from mhvedit.geometry.arrays import BoolArray, ByteArray, FloatArray, Int32Array, IntArray
from mhvedit.geometry.grid import VoxelGrid, grid_around
from mhvedit.sequences.meshes import Mesh

SNAP = 65536  # sub-voxel positions along an axis
VOTES_NEEDED = 4  # of six rays


def solid_voxels(mesh: Mesh, pitch: float) -> tuple[VoxelGrid, BoolArray]:
    """Voxels whose centres lie inside a mesh (Shi et al., section 3.1: D).

    Args:
        mesh: faces wound outwards; holes, flipped faces and loose pieces are survived (see the module).
        pitch: m.

    Returns:
        The box around the mesh, and (X, Y, Z) which of its voxels are filled.
    """
    grid = grid_around(mesh.vertices.min(0), mesh.vertices.max(0), pitch)
    scaled = mesh.vertices / pitch - np.array(grid.start)
    if has_no_boundary(mesh.faces):
        votes = ray_votes(scaled, mesh.faces, grid.shape, axis=2)
        return grid, votes == 2
    votes = np.sum([ray_votes(scaled, mesh.faces, grid.shape, axis=axis) for axis in range(3)], axis=0, dtype=np.uint8)
    return grid, np.asarray(votes >= VOTES_NEEDED)


def has_no_boundary(faces: Int32Array) -> bool:
    """Whether every edge is run through equally often in both directions.

    The boundary chain of the mesh is summed with a 64-bit pseudo-random weight per edge: it is zero for every closed
    mesh, and for an open one with a chance of 2^-64.
    """
    return bool(_boundary_sum(faces) == 0)


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
    order = [(axis + 1) % 3, (axis + 2) % 3, axis]
    turned = np.ascontiguousarray(scaled[:, order])
    snapped = np.rint(turned * SNAP).astype(np.int64)
    columns = (shape[order[0]], shape[order[1]])
    starts = _count_crossings(snapped, faces, columns[0], columns[1])
    heights, signs = _record_crossings(snapped, snapped[:, 2] / SNAP, faces, columns[0], columns[1], starts)
    votes = np.zeros((*columns, shape[axis]), np.uint8)
    _vote(starts, heights, signs, votes)
    return np.ascontiguousarray(votes.transpose(np.argsort(order)))


@njit(cache=True, nogil=True)
def _boundary_sum(faces: Int32Array) -> np.uint64:
    total = np.uint64(0)
    for f in range(faces.shape[0]):
        for e in range(3):
            a, b = faces[f, e], faces[f, (e + 1) % 3]
            if a == b:
                continue
            low, high = np.uint64(min(a, b)), np.uint64(max(a, b))
            mixed = (low << np.uint64(32)) | high
            mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
            mixed ^= mixed >> np.uint64(31)
            if a < b:
                total += mixed
            else:
                total -= mixed
    return total


@njit(cache=True, nogil=True, inline="always")
def _side(au: int, av: int, bu: int, bv: int, pu: int, pv: int) -> int:
    """On which side of the directed edge a -> b a lattice point lies; a point on the line is nudged by (eps, eps^2)."""
    value = (bu - au) * (pv - av) - (bv - av) * (pu - au)
    if value == 0:
        value = av - bv
        if value == 0:
            value = bu - au
    return 1 if value > 0 else (-1 if value < 0 else 0)


@njit(cache=True, nogil=True, inline="always")
def _covers(p: IntArray, i: int, j: int, k: int, u: int, v: int) -> int:
    """Whether the projected triangle covers column (u, v): the sign of its winding, else 0."""
    pu, pv = u * SNAP, v * SNAP
    side = _side(p[i, 0], p[i, 1], p[j, 0], p[j, 1], pu, pv)
    if side == 0 or _side(p[j, 0], p[j, 1], p[k, 0], p[k, 1], pu, pv) != side:
        return 0
    return side if _side(p[k, 0], p[k, 1], p[i, 0], p[i, 1], pu, pv) == side else 0


@njit(cache=True, nogil=True, inline="always")
def _columns_of(p: IntArray, i: int, j: int, k: int, axis: int, limit: int) -> tuple[int, int]:
    """First and past-the-last column that a projected triangle can cover along one axis."""
    low = min(p[i, axis], p[j, axis], p[k, axis])
    high = max(p[i, axis], p[j, axis], p[k, axis])
    return max(0, low // SNAP), min(limit, high // SNAP + 2)


@njit(cache=True, nogil=True)
def _count_crossings(p: IntArray, faces: Int32Array, n_u: int, n_v: int) -> IntArray:
    """Where each column's crossings start: (n_u * n_v + 1,)."""
    counts = np.zeros(n_u * n_v + 1, np.int64)
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        u0, u1 = _columns_of(p, i, j, k, 0, n_u)
        v0, v1 = _columns_of(p, i, j, k, 1, n_v)
        for u in range(u0, u1):
            for v in range(v0, v1):
                if _covers(p, i, j, k, u, v) != 0:
                    counts[u * n_v + v + 1] += 1
    return np.cumsum(counts)


@njit(cache=True, nogil=True)
def _record_crossings(
    p: IntArray, height: FloatArray, faces: Int32Array, n_u: int, n_v: int, starts: IntArray
) -> tuple[FloatArray, IntArray]:
    """Height (voxels) and sign (+1 enters going up, -1 leaves) of each crossing, by column."""
    heights = np.empty(starts[-1], np.float64)
    signs = np.empty(starts[-1], np.int64)
    place = starts[:-1].copy()
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        u0, u1 = _columns_of(p, i, j, k, 0, n_u)
        v0, v1 = _columns_of(p, i, j, k, 1, n_v)
        for u in range(u0, u1):
            for v in range(v0, v1):
                side = _covers(p, i, j, k, u, v)
                if side == 0:
                    continue
                at = place[u * n_v + v]
                place[u * n_v + v] += 1
                signs[at] = -side
                heights[at] = _height_at(p, height, i, j, k, u, v)
    return heights, signs


@njit(cache=True, nogil=True, inline="always")
def _height_at(p: IntArray, height: FloatArray, i: int, j: int, k: int, u: int, v: int) -> float:
    """Height of a triangle over column (u, v), kept within the triangle's own span."""
    ju, jv = float(p[j, 0] - p[i, 0]), float(p[j, 1] - p[i, 1])
    ku, kv = float(p[k, 0] - p[i, 0]), float(p[k, 1] - p[i, 1])
    pu, pv = float(u * SNAP - p[i, 0]), float(v * SNAP - p[i, 1])
    area = ju * kv - jv * ku
    low = min(height[i], height[j], height[k])
    high = max(height[i], height[j], height[k])
    if area == 0.0:
        return float(0.5 * (low + high))
    s, t = (pu * kv - pv * ku) / area, (ju * pv - jv * pu) / area
    at = height[i] + s * (height[j] - height[i]) + t * (height[k] - height[i])
    return float(min(max(at, low), high))


@njit(cache=True, nogil=True)
def _vote(starts: IntArray, heights: FloatArray, signs: IntArray, votes: ByteArray) -> None:
    n_v, n_w = votes.shape[1], votes.shape[2]
    for column in range(starts.shape[0] - 1):
        a, b = starts[column], starts[column + 1]
        if a == b:
            continue
        _sort_crossings(heights[a:b], signs[a:b])
        balanced = _balances(signs[a:b])
        out = votes[column // n_v, column % n_v]
        winding, crossed = 0, 0
        w = 0
        for c in range(b - a):
            stop = min(n_w, max(0, int(np.ceil(heights[a + c]))))
            vote = _ray_pair_vote(balanced, winding, crossed, b - a)
            while w < stop:
                out[w] = vote
                w += 1
            winding += signs[a + c]
            crossed += 1
        vote = _ray_pair_vote(balanced, winding, crossed, b - a)
        while w < n_w:
            out[w] = vote
            w += 1


@njit(cache=True, nogil=True, inline="always")
def _sort_crossings(heights: FloatArray, signs: IntArray) -> None:
    """Sort the few crossings of one column by height, in place; equals keep their order."""
    for c in range(1, heights.shape[0]):
        height, sign, at = heights[c], signs[c], c
        while at > 0 and heights[at - 1] > height:
            heights[at], signs[at] = heights[at - 1], signs[at - 1]
            at -= 1
        heights[at], signs[at] = height, sign


@njit(cache=True, nogil=True, inline="always")
def _balances(signs: IntArray) -> bool:
    """Whether the crossings add up to nothing and the winding number never changes its sign on the way."""
    winding, least, most = 0, 0, 0
    for sign in signs:
        winding += sign
        least, most = min(least, winding), max(most, winding)
    return winding == 0 and (least == 0 or most == 0)


@njit(cache=True, nogil=True, inline="always")
def _ray_pair_vote(balanced: bool, winding: int, crossed: int, total: int) -> int:
    """Votes of the ray from below and the ray from above at a point with `crossed` of `total` crossings below it."""
    if balanced:
        return 2 if winding != 0 else 0
    return crossed % 2 + (total - crossed) % 2
