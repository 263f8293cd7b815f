"""Rotations by vectors: their length is the angle, their direction the axis."""

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray

SMALL = 1e-12


@njit(cache=True, nogil=True)
def turn(vector: FloatArray) -> FloatArray:
    """(3, 3) rotation by a vector (3,) rad (Rodrigues)."""
    x, y, z = vector[0], vector[1], vector[2]
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    s = np.sin(angle) / angle if angle > SMALL else 1.0
    v = 2.0 * (np.sin(0.5 * angle) / angle) ** 2 if angle > SMALL else 0.5
    c = 1.0 - v * square
    found = np.empty((3, 3))
    found[0, 0], found[0, 1], found[0, 2] = c + v * x * x, v * x * y - s * z, v * x * z + s * y
    found[1, 0], found[1, 1], found[1, 2] = v * x * y + s * z, c + v * y * y, v * y * z - s * x
    found[2, 0], found[2, 1], found[2, 2] = v * x * z - s * y, v * y * z + s * x, c + v * z * z
    return found


@njit(cache=True, nogil=True)
def turn_vector(rotation: FloatArray) -> FloatArray:
    """(3,) rad, the vector of a rotation (3, 3), no longer than pi."""
    r = rotation
    odd = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / 2
    sine, cosine = np.sqrt((odd**2).sum()), (r[0, 0] + r[1, 1] + r[2, 2] - 1) / 2
    angle = np.arctan2(sine, cosine)
    if sine > 1e-6:
        return np.asarray(odd * (angle / sine))
    if cosine > 0:
        return odd
    # half a turn: the axis is in the symmetric part
    axis = np.sqrt(np.maximum((np.diag(r) + 1) / 2, 0.0))
    k = int(np.argmax(axis))
    for i in range(3):
        if i != k:
            axis[i] = (r[i, k] + r[k, i]) / (4 * axis[k])
    return np.asarray(axis * (angle / np.sqrt((axis**2).sum())))


def between(first: FloatArray, last: FloatArray, share: float) -> FloatArray:
    """(3, 3) the rotation a share of the shortest way from one to another."""
    return np.asarray(first @ turn(share * turn_vector(np.ascontiguousarray(first.T @ last))))


@njit(cache=True, nogil=True)
def straightened(rotation: FloatArray) -> FloatArray:
    """(3, 3) the rotation near a matrix that rounding has bent a little: one step of Newton's polar iteration."""
    return rotation @ (1.5 * np.eye(3) - 0.5 * rotation.T @ rotation)
