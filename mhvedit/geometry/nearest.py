"""The point of a triangle that is nearest to another point (Ericson, Real-Time Collision Detection, 5.1.5)."""

from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_weights(d1: float, d2: float, d3: float, d4: float, d5: float, d6: float) -> tuple[float, float]:
    """Weights of the second and third corner of the nearest point: regions of the corners, edges, and the inside.

    Args:
        d1: of the vectors from the first corner to the point and to the second corner, the inner product.
        d2: likewise, the point and the third corner.
        d3: as d1, the point seen from the second corner.
        d4: as d2, the point seen from the second corner.
        d5: as d1, the point seen from the third corner.
        d6: as d2, the point seen from the third corner.
    """
    if d1 <= 0.0 and d2 <= 0.0:
        return 0.0, 0.0
    if d3 >= 0.0 and d4 <= d3:
        return 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return d1 / (d1 - d3), 0.0
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return 0.0, d2 / (d2 - d6)
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 1.0 - w, w
    total = va + vb + vc
    return vb / total, vc / total
