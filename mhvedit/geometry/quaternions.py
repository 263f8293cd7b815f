"""Rotations as unit quaternions x, y, z, w, as files hold them."""

import numpy as np

from mhvedit.geometry.arrays import FloatArray


def rotation_matrices(quaternions: FloatArray) -> FloatArray:
    """(..., 3, 3) of unit quaternions (..., 4).

    >>> rotation_matrices(np.array([0.0, 0.0, 1.0, 0.0])).tolist()
    [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    x, y, z, w = np.moveaxis(np.asarray(quaternions, np.float64), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def quaternions_of(rotations: FloatArray) -> FloatArray:
    """(N, 4) of rotations (N, 3, 3), each of the sign that is nearer to the one before.

    Each is the eigenvector of the largest eigenvalue of Bar-Itzhack's matrix (2000), so no case is singular.
    """
    r = np.moveaxis(rotations, 0, -1)
    upper = [
        [r[0, 0] - r[1, 1] - r[2, 2], r[1, 0] + r[0, 1], r[2, 0] + r[0, 2], r[2, 1] - r[1, 2]],
        [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], r[2, 1] + r[1, 2], r[0, 2] - r[2, 0]],
        [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
        [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]],
    ]
    found = np.linalg.eigh(np.moveaxis(np.array(upper), -1, 0))[1][:, :, -1]
    found[0] *= -1.0 if found[0, 3] < 0 else 1.0
    turned = np.cumprod(np.sign((found[1:] * found[:-1]).sum(1)) + ((found[1:] * found[:-1]).sum(1) == 0))
    found[1:] *= turned[:, None]
    return np.asarray(found)


def slerp(first: FloatArray, last: FloatArray, share: FloatArray) -> FloatArray:
    """(N, 4) a share (N,) of the shortest way from rotations (N, 4) to others (N, 4)."""
    cosine = (first * last).sum(1)
    last = np.where(cosine[:, None] < 0, -last, last)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))[:, None]
    sine, t = np.sin(angle), share[:, None]
    flat = sine < 1e-9
    safe = np.where(flat, 1.0, sine)
    a = np.where(flat, 1 - t, np.sin((1 - t) * angle) / safe)
    b = np.where(flat, t, np.sin(t * angle) / safe)
    mixed = a * first + b * last
    return np.asarray(mixed / np.linalg.norm(mixed, axis=1, keepdims=True))
