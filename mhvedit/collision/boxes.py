"""Oriented boxes: the separating axis test, and trees of boxes that follow what is in them (Liu et al., A3.2-A4.2).

All boxes of one limb are parallel to each other. A pair of limbs therefore has one relative rotation for all its box
pairs, and a box that is refitted to moved vertices only changes its centre and its half widths.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray

PARALLEL: Final = 1e-9  # added to |cosines|: of nearly parallel edges the cross product says nothing (Gottschalk 1996)
Three = tuple[float, float, float]
Nine = tuple[float, float, float, float, float, float, float, float, float]

SLAB: Final = 0.060  # m, length of a sub-box along the bone
SLABS: Final = (2, 8)  # least and most sub-boxes of a limb
LEAF: Final = 4  # triangles


@dataclass(frozen=True, slots=True, eq=False)
class BoxTree:
    """Which boxes contain which: a root, its sub-boxes along the bone, and halves of these down to few triangles."""

    first: IntArray  # (M,) first child; of a leaf its first triangle
    size: IntArray  # (M,) children, one after the other and after their parent; of a leaf its triangles
    leaf: BoolArray  # (M,)
    order: IntArray  # (F,) triangles in the order in which leaves have them


def box_tree(corners: FloatArray) -> BoxTree:
    """Build the tree of one limb (A3.5): k = length / 60 mm sub-boxes along its first axis, then halves.

    Triangles go where their centroids are; boxes are grown to their corners when they are fitted.

    Args:
        corners: (F, 3, 3) m, triangles in the limb's box frame, bone along the first axis.
    """
    centroids = corners.mean(1)
    first, size, leaf, order = [0], [0], [False], np.arange(len(corners))
    waiting = [(0, 0, len(corners))]  # node, its triangles
    while waiting:
        node, start, stop = waiting.pop(0)
        parts = _slabs(corners, centroids, order) if node == 0 else _halves(centroids, order, start, stop)
        if stop - start <= LEAF:
            first[node], size[node], leaf[node] = start, stop - start, True
            continue
        first[node], size[node] = len(first), len(parts)
        for piece in parts:
            waiting.append((len(first), start, start + len(piece)))
            order[start : start + len(piece)] = piece
            start += len(piece)
            first, size, leaf = [*first, 0], [*size, 0], [*leaf, False]
    return BoxTree(np.array(first), np.array(size), np.array(leaf), order)


def _slabs(corners: FloatArray, centroids: FloatArray, order: IntArray) -> list[IntArray]:
    """Triangles in slices of equal length along the bone, without empty ones."""
    low, high = corners[..., 0].min(), corners[..., 0].max()
    k = int(np.clip(round((high - low) / SLAB), *SLABS))
    which = np.clip(((centroids[:, 0] - low) / max(high - low, 1e-12) * k).astype(int), 0, k - 1)
    return [order[which == i] for i in range(k) if (which == i).any()]


def _halves(centroids: FloatArray, order: IntArray, start: int, stop: int) -> list[IntArray]:
    """Triangles in two halves along their longest extent."""
    mine = order[start:stop]
    axis = int(np.argmax(np.ptp(centroids[mine], axis=0)))
    ranked = mine[np.argsort(centroids[mine, axis], kind="stable")]
    return [ranked[: len(ranked) // 2].copy(), ranked[len(ranked) // 2 :].copy()]


def boxes_overlap(
    centre_a: FloatArray,
    half_a: FloatArray,
    turn_a: FloatArray,
    centre_b: FloatArray,
    half_b: FloatArray,
    turn_b: FloatArray,
) -> BoolArray:
    """Whether pairs of oriented boxes overlap, by 15 separating axes; touching counts (A4.1).

    Args:
        centre_a: (N, 3) m.
        half_a: (N, 3) m, half widths along the box axes.
        turn_a: (N, 3, 3) world_from_box.
        centre_b: (N, 3) m.
        half_b: (N, 3) m.
        turn_b: (N, 3, 3) world_from_box.

    Returns:
        (N,) never False for boxes that have a point in common.
    """
    out = np.empty(len(centre_a), np.bool_)
    turn = np.swapaxes(turn_a, 1, 2) @ turn_b
    offset = (np.swapaxes(turn_a, 1, 2) @ (centre_b - centre_a)[..., None])[..., 0]
    _overlap_all(turn, offset, half_a, half_b, out)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def apart(r: Nine, s: Nine, x: float, y: float, z: float, a: Three, b: Three) -> bool:
    """Whether one of 15 axes separates two boxes.

    Args:
        r: a_from_b, row by row.
        s: its absolute values plus PARALLEL.
        x: centre of b seen from that of a, in a's frame, with y and z.
        y: see x.
        z: see x.
        a: half widths.
        b: half widths.
    """
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = r
    s00, s01, s02, s10, s11, s12, s20, s21, s22 = s
    a0, a1, a2 = a
    b0, b1, b2 = b
    return (
        abs(x) > a0 + b0 * s00 + b1 * s01 + b2 * s02
        or abs(y) > a1 + b0 * s10 + b1 * s11 + b2 * s12
        or abs(z) > a2 + b0 * s20 + b1 * s21 + b2 * s22
        or abs(x * r00 + y * r10 + z * r20) > b0 + a0 * s00 + a1 * s10 + a2 * s20
        or abs(x * r01 + y * r11 + z * r21) > b1 + a0 * s01 + a1 * s11 + a2 * s21
        or abs(x * r02 + y * r12 + z * r22) > b2 + a0 * s02 + a1 * s12 + a2 * s22
        or abs(z * r10 - y * r20) > a1 * s20 + a2 * s10 + b1 * s02 + b2 * s01
        or abs(z * r11 - y * r21) > a1 * s21 + a2 * s11 + b0 * s02 + b2 * s00
        or abs(z * r12 - y * r22) > a1 * s22 + a2 * s12 + b0 * s01 + b1 * s00
        or abs(x * r20 - z * r00) > a0 * s20 + a2 * s00 + b1 * s12 + b2 * s11
        or abs(x * r21 - z * r01) > a0 * s21 + a2 * s01 + b0 * s12 + b2 * s10
        or abs(x * r22 - z * r02) > a0 * s22 + a2 * s02 + b0 * s11 + b1 * s10
        or abs(y * r00 - x * r10) > a0 * s10 + a1 * s00 + b1 * s22 + b2 * s21
        or abs(y * r01 - x * r11) > a0 * s11 + a1 * s01 + b0 * s22 + b2 * s20
        or abs(y * r02 - x * r12) > a0 * s12 + a1 * s02 + b0 * s21 + b1 * s20
    )


@njit(cache=True, nogil=True, error_model="numpy")
def widened(r: Nine) -> Nine:
    """Absolute values of a rotation plus PARALLEL, for `apart`."""
    return (
        abs(r[0]) + PARALLEL,
        abs(r[1]) + PARALLEL,
        abs(r[2]) + PARALLEL,
        abs(r[3]) + PARALLEL,
        abs(r[4]) + PARALLEL,
        abs(r[5]) + PARALLEL,
        abs(r[6]) + PARALLEL,
        abs(r[7]) + PARALLEL,
        abs(r[8]) + PARALLEL,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def refit_into(
    local: FloatArray,
    faces: IntArray,
    first: IntArray,
    size: IntArray,
    leaf: BoolArray,
    centre: FloatArray,
    half: FloatArray,
) -> None:
    """Fit all boxes to vertices (N, 3) m in the box frames of their limbs: centre and half widths (M, 3) m."""
    low, high = np.empty(3), np.empty(3)
    for node in range(first.shape[0] - 1, -1, -1):
        low[:], high[:] = np.inf, -np.inf
        for i in range(first[node], first[node] + size[node]):
            if leaf[node]:
                for k in range(3):
                    v = faces[i, k]
                    for r in range(3):
                        low[r], high[r] = min(low[r], local[v, r]), max(high[r], local[v, r])
            else:
                for r in range(3):
                    low[r] = min(low[r], centre[i, r] - half[i, r])
                    high[r] = max(high[r], centre[i, r] + half[i, r])
        for r in range(3):
            centre[node, r], half[node, r] = 0.5 * (low[r] + high[r]), 0.5 * (high[r] - low[r]) * (1.0 + PARALLEL)


@njit(cache=True, nogil=True, error_model="numpy")
def _overlap_all(turn: FloatArray, offset: FloatArray, half_a: FloatArray, half_b: FloatArray, out: BoolArray) -> None:
    """`apart` for many pairs."""
    for i in range(out.shape[0]):
        w, a, b = turn[i], half_a[i], half_b[i]
        r = (w[0, 0], w[0, 1], w[0, 2], w[1, 0], w[1, 1], w[1, 2], w[2, 0], w[2, 1], w[2, 2])
        x, y, z = offset[i, 0], offset[i, 1], offset[i, 2]
        out[i] = not apart(r, widened(r), x, y, z, (a[0], a[1], a[2]), (b[0], b[1], b[2]))
