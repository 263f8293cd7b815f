"""A mesh as a few hundred oriented points, one for each cell of a lattice that its surface passes through.

Sums over area make the points independent of the order of vertices and faces and of how densely a surface is meshed.
"""

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray, Int32Array, IntArray
from mhvedit.geometry.planar import apply_pose
from mhvedit.sequences.areas import area_shares
from mhvedit.sequences.meshes import Mesh

DIGITS = 8  # coordinates are rounded so that float noise from turning a capture decides nothing further on
LEAST_AGREEMENT = 0.2  # of a cell's area: below, its normals contradict each other
# the cells of a subject with more than that (wrong units?) grow
MOST_CELLS = 64  # along an axis
MOST_POINTS = 1500  # the surface's area in cells' sides


def surface_cloud(mesh: Mesh, frame_from_capture: FloatArray, *, cell: float) -> FloatArray:
    """Area-weighted mean points and normals of the surface in each cell.

    Args:
        mesh: one frame.
        frame_from_capture: (3,) pose x, y m and yaw rad of the lattice's frame.
        cell: m, side of the lattice's cells.

    Returns:
        (N, 7) m, points, unit normals, and weights that sum to 1; none where the mesh has no area.
    """
    if not len(mesh.faces):
        return np.zeros((0, 7))
    points = np.round(apply_pose(frame_from_capture, mesh.vertices), DIGITS)
    used = points[mesh.faces.ravel()] if len(points) > 3 * len(mesh.faces) else points
    low, high = used.min(axis=0), used.max(axis=0)
    cell = max(cell, float((high - low).max()) / MOST_CELLS, np.sqrt(_area(points, mesh.faces) / MOST_POINTS))
    first = np.floor(low / cell + 0.5).astype(np.int64)
    shape = np.floor(high / cell + 0.5).astype(np.int64) - first + 1
    sums = np.zeros((int(shape.prod()), 7))
    volume = _add_faces(points, mesh.faces, cell, first, shape, sums)
    sums = sums[sums[:, 6] > 0]
    normals = sums[:, 3:6] if volume >= 0 else -sums[:, 3:6]  # inside out
    length = np.linalg.norm(normals, axis=1)
    keep = length > LEAST_AGREEMENT * sums[:, 6]
    length, normals, sums = length[keep], normals[keep], sums[keep]
    rows = [sums[:, :3] / sums[:, 6:], normals / length[:, None], length / max(float(length.sum()), 1e-300)]
    return np.asarray(np.round(np.column_stack(rows), DIGITS + 1))


def own_frame(mesh: Mesh) -> FloatArray:
    """The planar pose that takes a capture to its first frame's own axes, so that nothing depends on the world's.

    Args:
        mesh: the first frame.

    Returns:
        (3,) own_from_capture: centre of area to the origin, longest horizontal axis to x, its longer tails to +x.
    """
    share, middles = area_shares(mesh)
    if not share.any():
        return np.zeros(3)
    flat = middles[:, :2]
    centre = share @ flat
    flat = flat - centre
    spread = (share[:, None] * flat).T @ flat
    axis = np.linalg.eigh(spread)[1][:, 1]
    tails = share @ (flat @ np.array([[axis[0], -axis[1]], [axis[1], axis[0]]])) ** 3
    if tails[0] + tails[1] / 2 < 0:  # one whose left mirrors the right has a tail to the front or back only
        axis = -axis
    yaw = -np.arctan2(axis[1], axis[0])
    turn = apply_pose(np.array([0.0, 0.0, yaw]), centre[None])[0]
    return np.array([-turn[0], -turn[1], yaw])


@njit(cache=True, nogil=True)
def _area(points: FloatArray, faces: Int32Array) -> float:
    """Area of the surface."""
    total = 0.0
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        square = 0.0
        for k in range(3):
            i, m = (k + 1) % 3, (k + 2) % 3
            part = (points[b, i] - points[a, i]) * (points[c, m] - points[a, m])
            part -= (points[b, m] - points[a, m]) * (points[c, i] - points[a, i])
            square += part * part
        total += 0.5 * np.sqrt(square)
    return total


@njit(cache=True, nogil=True)
def _add_faces(
    points: FloatArray, faces: Int32Array, cell: float, first: IntArray, shape: IntArray, sums: FloatArray
) -> float:
    """Add area times centre, area vector and area of each small triangle to its cell; returns the signed volume."""
    volume = 0.0
    area = np.empty(3)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        edge = max(_square(points, a, b), _square(points, b, c), _square(points, c, a))
        n = max(1, int(np.ceil(np.sqrt(edge) / cell)))  # n^2 equal triangles
        for k in range(3):
            i, m = (k + 1) % 3, (k + 2) % 3
            area[k] = 0.5 * (
                (points[b, i] - points[a, i]) * (points[c, m] - points[a, m])
                - (points[b, m] - points[a, m]) * (points[c, i] - points[a, i])
            )
            volume += area[k] * (points[a, k] - points[0, k])
        for k in range(3):
            area[k] /= n * n
        size = np.sqrt(area[0] * area[0] + area[1] * area[1] + area[2] * area[2])
        for row in range(n):
            for column in range(2 * (n - row) - 1):
                odd = column % 2
                u, v = (column // 2 + (1.0 + odd) / 3.0) / n, (row + (1.0 + odd) / 3.0) / n
                x = _inside(points[a, 0], points[b, 0], points[c, 0], u, v)
                y = _inside(points[a, 1], points[b, 1], points[c, 1], u, v)
                z = _inside(points[a, 2], points[b, 2], points[c, 2], u, v)
                place = _cell(x, cell, first[0], shape[0])
                place = place * shape[1] + _cell(y, cell, first[1], shape[1])
                place = place * shape[2] + _cell(z, cell, first[2], shape[2])
                sums[place, 0] += size * x
                sums[place, 1] += size * y
                sums[place, 2] += size * z
                for k in range(3):
                    sums[place, 3 + k] += area[k]
                sums[place, 6] += size
    return volume


@njit(cache=True, nogil=True)
def _square(points: FloatArray, a: int, b: int) -> float:
    """Squared distance of two points."""
    x, y, z = points[a, 0] - points[b, 0], points[a, 1] - points[b, 1], points[a, 2] - points[b, 2]
    return float(x * x + y * y + z * z)


@njit(cache=True, nogil=True)
def _inside(a: float, b: float, c: float, u: float, v: float) -> float:
    """One coordinate of the point of a triangle that lies u along one edge and v along the other."""
    return a + u * (b - a) + v * (c - a)


@njit(cache=True, nogil=True)
def _cell(at: float, cell: float, first: int, limit: int) -> int:
    """Number of the cell along one axis."""
    return min(max(int(np.floor(at / cell + 0.5)) - first, 0), limit - 1)
