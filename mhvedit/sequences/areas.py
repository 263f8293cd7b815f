"""Where a mesh lies: its bounds, and its area, which counts as vertices and faces are others in every frame."""

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray, Int32Array
from mhvedit.sequences.meshes import Mesh


def area_shares(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """How the area of a mesh is spread; `share @ middles` is its centroid.

    Args:
        mesh: one frame.

    Returns:
        (F,) share of each face in the area, all 0 where there is none, and (F, 3) m, the middle of each face.
    """
    areas, middles = np.empty(len(mesh.faces)), np.empty((len(mesh.faces), 3))
    _measure(mesh.vertices, mesh.faces, areas, middles)
    total = areas.sum()
    return (areas / total if total > 0 else np.zeros(len(areas))), middles


def place_of(mesh: Mesh) -> FloatArray:
    """Where a mesh is.

    Args:
        mesh: one frame.

    Returns:
        (8,) m: its centre of area in plan, NaN where it has no area; its lowest and its highest coordinates.
    """
    share, middles = area_shares(mesh)
    centre = share @ middles[:, :2] if share.any() else np.full(2, np.nan)
    return np.concatenate([centre, *bounds(mesh.vertices)])


@njit(cache=True, nogil=True)
def bounds(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest coordinates.

    Args:
        points: (N, 3), finite, at least one.

    Returns:
        (3,) and (3,).
    """
    low, high = points[0].copy(), points[0].copy()
    for i in range(1, len(points)):
        for k in range(3):
            low[k] = min(low[k], points[i, k])
            high[k] = max(high[k], points[i, k])
    return low, high


@njit(cache=True, nogil=True)
def _measure(points: FloatArray, faces: Int32Array, areas: FloatArray, middles: FloatArray) -> None:
    """Area and middle of each face."""
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
        vx, vy, vz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        areas[f] = np.sqrt(x * x + y * y + z * z)
        for k in range(3):
            middles[f, k] = (points[a, k] + points[b, k] + points[c, k]) / 3.0
