"""The generalised winding number: how often a surface goes round a point, holes or not (Jacobson et al. 2013)."""

import numpy as np
from numba import njit

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray, Int32Array


def winding_numbers(vertices: FloatArray, faces: Int32Array, points: FloatArray) -> FloatArray:
    """Sum of the solid angles of all triangles seen from each point, over 4 pi.

    1 inside a closed mesh wound outwards, -1 inside one wound inwards, 0 outside, in between near holes.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3).
        points: (P, 3) m.

    Returns:
        (P,).
    """
    if points.ndim != 2 or points.shape[1] != 3:
        raise ShapeError("points", points.shape, "(P, 3)")
    corners = np.ascontiguousarray(vertices, np.float64)
    return np.asarray(_winding(corners, np.ascontiguousarray(faces), np.ascontiguousarray(points, np.float64)))


@njit(cache=True, nogil=True, error_model="numpy")
def _winding(vertices: FloatArray, faces: Int32Array, points: FloatArray) -> FloatArray:
    """The formula of van Oosterom and Strackee, triangle by triangle; vectors and lengths once for each vertex."""
    out = np.zeros(points.shape[0])
    n = vertices.shape[0]
    x, y, z, far = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for p in range(points.shape[0]):
        for v in range(n):
            x[v] = vertices[v, 0] - points[p, 0]
            y[v] = vertices[v, 1] - points[p, 1]
            z[v] = vertices[v, 2] - points[p, 2]
            far[v] = np.sqrt(x[v] * x[v] + y[v] * y[v] + z[v] * z[v])
        total = 0.0
        for f in range(faces.shape[0]):
            i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
            volume = (
                x[i] * (y[j] * z[k] - z[j] * y[k])
                + y[i] * (z[j] * x[k] - x[j] * z[k])
                + z[i] * (x[j] * y[k] - y[j] * x[k])
            )
            ij = x[i] * x[j] + y[i] * y[j] + z[i] * z[j]
            jk = x[j] * x[k] + y[j] * y[k] + z[j] * z[k]
            ki = x[k] * x[i] + y[k] * y[i] + z[k] * z[i]
            total += np.arctan2(volume, far[i] * far[j] * far[k] + ij * far[k] + jk * far[i] + ki * far[j])
        out[p] = total / (2 * np.pi)
    return out
