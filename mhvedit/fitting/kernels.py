"""What is compiled: posing a subject's own surface by its bones, and the normal equations of laying it into another.

A pose is the rotations of all joints, bind frame to posed frame, and where the pelvis is. A step turns joint j, with
all that hangs on it, by a small vector in the world; a step of the shape moves joint j in the bind frame.
"""

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray, IntArray


@njit(cache=True, nogil=True)
def chain_into(parents: IntArray, rest: FloatArray, rotations: FloatArray, pelvis: FloatArray, out: FloatArray) -> None:
    """Places of the joints (J, 3) m of a pose."""
    for k in range(3):
        out[0, k] = pelvis[k]
    for j in range(1, len(parents)):
        p = parents[j]
        for k in range(3):
            out[j, k] = out[p, k]
            for m in range(3):
                out[j, k] += rotations[p, k, m] * (rest[j, m] - rest[p, m])


@njit(cache=True, nogil=True)
def pose_into(
    points: FloatArray,
    normals: FloatArray,
    bones: IntArray,
    shares: FloatArray,
    rest: FloatArray,
    rotations: FloatArray,
    places: FloatArray,
    out: FloatArray,
    out_normals: FloatArray,
) -> None:
    """Points and normals (N, 3) of the bind frame in a pose; normals are not of unit length."""
    for i in range(len(points)):
        for k in range(3):
            out[i, k] = out_normals[i, k] = 0.0
        for b in range(bones.shape[1]):
            j, share = bones[i, b], shares[i, b]
            if share == 0.0:
                continue
            for k in range(3):
                at, turned = places[j, k], 0.0
                for m in range(3):
                    at += rotations[j, k, m] * (points[i, m] - rest[j, m])
                    turned += rotations[j, k, m] * normals[i, m]
                out[i, k] += share * at
                out_normals[i, k] += share * turned


@njit(cache=True, nogil=True, error_model="numpy")
def add_surface(
    points: FloatArray,
    bones: IntArray,
    shares: FloatArray,
    parents: IntArray,
    rest: FloatArray,
    rotations: FloatArray,
    places: FloatArray,
    gaps: FloatArray,
    hessian: FloatArray,
    gradient: FloatArray,
) -> None:
    """Add the residuals `gap` = normal . (posed point - target), one a point; a row of `gaps` is normal, gap, weight.

    The unknowns are 3 for the pelvis, 3 J for turns and 3 J for the shape; only the lower triangle is written.
    """
    n_joints = len(parents)
    carried, touched = np.zeros((n_joints, 4)), np.empty(n_joints, np.int64)
    row, index = np.empty(3 + 6 * n_joints), np.empty(3 + 6 * n_joints, np.int64)
    for i in range(len(points)):
        n_touched = _carry(points[i], bones[i], shares[i], parents, rest, rotations, places, carried, touched)
        n = _derive(gaps[i], touched[:n_touched], parents, rotations, places, carried, row, index)
        for a in range(n):
            value = gaps[i, 4] * row[a]
            gradient[index[a]] += value * gaps[i, 3]
            for b in range(a + 1):
                hessian[max(index[a], index[b]), min(index[a], index[b])] += value * row[b]


@njit(cache=True, nogil=True, error_model="numpy")
def _carry(
    point: FloatArray, bones: IntArray, shares: FloatArray, parents: IntArray, rest: FloatArray, rotations: FloatArray,
    places: FloatArray, carried: FloatArray, touched: IntArray,
) -> int:  # fmt: skip
    """For each joint that moves a point: how much of it, times where that much of it is; returns how many joints do.

    `carried` (J, 4) has share times place and share, `touched` the joints; what is there before is 0.
    """
    n_touched = 0
    for b in range(len(bones)):
        share, j = shares[b], bones[b]
        if share == 0.0:
            continue
        x, y, z = places[j, 0], places[j, 1], places[j, 2]
        for m in range(3):
            away = point[m] - rest[j, m]
            x += rotations[j, 0, m] * away
            y += rotations[j, 1, m] * away
            z += rotations[j, 2, m] * away
        while j >= 0:
            if carried[j, 3] == 0.0:
                touched[n_touched] = j
                n_touched += 1
            carried[j, 0] += share * x
            carried[j, 1] += share * y
            carried[j, 2] += share * z
            carried[j, 3] += share
            j = parents[j]
    return n_touched


@njit(cache=True, nogil=True, error_model="numpy")
def _derive(
    gap: FloatArray, touched: IntArray, parents: IntArray, rotations: FloatArray, places: FloatArray,
    carried: FloatArray, row: FloatArray, index: IntArray,
) -> int:  # fmt: skip
    """Derivatives of a gap into `row`, and which unknowns they belong to; returns how many. `carried` is 0 again."""
    n_joints = len(parents)
    nx, ny, nz = gap[0], gap[1], gap[2]
    for k in range(3):
        index[k], row[k] = k, gap[k]
    n = 3
    for j in touched:
        ride = carried[j, 3]
        x = carried[j, 0] - ride * places[j, 0]
        y = carried[j, 1] - ride * places[j, 1]
        z = carried[j, 2] - ride * places[j, 2]
        index[n], row[n] = 3 + 3 * j, y * nz - z * ny
        index[n + 1], row[n + 1] = 4 + 3 * j, z * nx - x * nz
        index[n + 2], row[n + 2] = 5 + 3 * j, x * ny - y * nx
        n += 3
        p = parents[j]
        for m in range(3 if j > 0 else 0):
            index[n] = 3 + 3 * n_joints + 3 * j + m
            row[n] = ride * (
                nx * (rotations[p, 0, m] - rotations[j, 0, m])
                + ny * (rotations[p, 1, m] - rotations[j, 1, m])
                + nz * (rotations[p, 2, m] - rotations[j, 2, m])
            )
            n += 1
        for k in range(4):
            carried[j, k] = 0.0
    return n
