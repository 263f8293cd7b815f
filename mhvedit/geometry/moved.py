"""Millions of planar poses moved at once."""

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray


@njit(cache=True, nogil=True)
def moved_poses(poses: FloatArray, left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Left @ pose @ right for millions of poses.

    Args:
        poses: (N, 3).
        left: (3,).
        right: (3,).

    Returns:
        (N,) x, (N,) y, and (N,) yaw in [-pi, pi).
    """
    x, y, yaw = np.empty(len(poses)), np.empty(len(poses)), np.empty(len(poses))
    c, s = np.cos(left[2]), np.sin(left[2])
    for n in range(len(poses)):
        turn = left[2] + poses[n, 2]
        cos_turn, sin_turn = np.cos(turn), np.sin(turn)
        x[n] = left[0] + c * poses[n, 0] - s * poses[n, 1] + cos_turn * right[0] - sin_turn * right[1]
        y[n] = left[1] + s * poses[n, 0] + c * poses[n, 1] + sin_turn * right[0] + cos_turn * right[1]
        yaw[n] = (turn + right[2] + np.pi) % (2 * np.pi) - np.pi
    return x, y, yaw
