"""Planar poses `(x, y, yaw)`: how people move who stand on one floor. Right-handed, z up, metres and radians."""

import numpy as np

from mhvedit.geometry.arrays import FloatArray


def wrap_angle(angle: FloatArray | float) -> FloatArray:
    """The same angle in [-pi, pi)."""
    return np.asarray((np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi)


def rotation(yaw: FloatArray | float) -> FloatArray:
    """Rotations about z acting on (x, y).

    Args:
        yaw: (...) rad.

    Returns:
        (..., 2, 2) matrices.
    """
    c, s = np.cos(yaw), np.sin(yaw)
    return np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)


def apply_pose(pose: FloatArray, points: FloatArray) -> FloatArray:
    """Place points: p' = Rz(yaw) p + (x, y, 0).

    Args:
        pose: (3,) x, y m and yaw rad.
        points: (..., 2) or (..., 3) m.

    Returns:
        Points of the same shape.
    """
    placed = np.array(points, np.float64)
    placed[..., :2] = points[..., :2] @ rotation(pose[2]).T + pose[:2]
    return placed


def compose(world_from_a: FloatArray, a_from_b: FloatArray) -> FloatArray:
    """world_from_b = world_from_a @ a_from_b, for (..., 3) poses that broadcast; yaw stays unwrapped."""
    world_from_a, a_from_b = np.broadcast_arrays(world_from_a, a_from_b)
    xy = (rotation(world_from_a[..., 2]) @ a_from_b[..., :2, None])[..., 0] + world_from_a[..., :2]
    return np.concatenate([xy, world_from_a[..., 2:] + a_from_b[..., 2:]], -1)


def invert(world_from_a: FloatArray) -> FloatArray:
    """a_from_world, for (..., 3) poses."""
    xy = -(rotation(-world_from_a[..., 2]) @ world_from_a[..., :2, None])[..., 0]
    return np.concatenate([xy, -world_from_a[..., 2:]], -1)
