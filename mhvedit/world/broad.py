"""Which pieces may touch: boxes along the axes, sorted and swept (Schmidl and Lin, C1.4; Cohen et al. 1995)."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.world.pieces import Piece


@dataclass(frozen=True, slots=True, eq=False)
class Colliders:
    """All pieces of a world, the frame that carries each, and which of them may meet."""

    pieces: tuple[Piece, ...]  # P
    carrier: IntArray  # (P,) frame: a body or a joint
    may_meet: BoolArray  # (P, P) symmetric
    points: FloatArray  # (N, 3) m, of all pieces one after the other
    starts: IntArray  # (P + 1,)
    radii: FloatArray  # (P,) m
    extent: FloatArray  # (F,) m, farthest point of each frame's pieces from its origin


def colliders_of(pieces: tuple[Piece, ...], carrier: IntArray, may_meet: BoolArray) -> Colliders:
    """Pieces with their points in one array."""
    starts = np.cumsum([0] + [len(piece.points) for piece in pieces])
    points = np.concatenate([piece.points for piece in pieces])
    radii = np.array([piece.radius for piece in pieces])
    owner = np.repeat(np.arange(len(pieces)), np.diff(starts))
    extent = np.zeros(int(carrier.max(initial=-1)) + 1)
    np.maximum.at(extent, carrier[owner], np.linalg.norm(points, axis=1) + radii[owner])
    return Colliders(pieces, carrier, may_meet & may_meet.T, points, starts, radii, extent)


def boxes(colliders: Colliders, rotations: FloatArray, positions: FloatArray) -> FloatArray:
    """(P, 2, 3) m, lowest and highest coordinates of each piece.

    Args:
        colliders: P pieces.
        rotations: (F, 3, 3) world_from_frame.
        positions: (F, 3) m.
    """
    found = np.empty((len(colliders.pieces), 2, 3))
    c = colliders
    _boxes_into(c.points, c.starts, c.radii, c.carrier, rotations, positions, found)
    return found


def near_pairs(colliders: Colliders, rotations: FloatArray, positions: FloatArray, *, reach: float) -> IntArray:
    """Pairs of pieces that may meet and whose boxes come within a distance of each other.

    Args:
        colliders: P pieces.
        rotations: (F, 3, 3) world_from_frame.
        positions: (F, 3) m.
        reach: m.

    Returns:
        (K, 2) the lower piece first, in ascending order; no pair that is nearer than `reach` is missing.
    """
    return np.asarray(overlapping(boxes(colliders, rotations, positions), colliders.may_meet, reach))


@njit(cache=True, nogil=True)
def overlapping(boxes: FloatArray, may_meet: BoolArray, reach: float) -> IntArray:
    """(K, 2) pairs of boxes (P, 2, 3) m that may meet and are within reach: sorted and swept along x."""
    n = boxes.shape[0]
    order = np.argsort(boxes[:, 0, 0], kind="mergesort")
    found = np.zeros((n, n), np.bool_)
    count = 0
    for i in range(n):
        a = order[i]
        for j in range(i + 1, n):
            b = order[j]
            if boxes[b, 0, 0] > boxes[a, 1, 0] + reach:
                break
            if (
                may_meet[a, b]
                and boxes[a, 0, 1] <= boxes[b, 1, 1] + reach
                and boxes[b, 0, 1] <= boxes[a, 1, 1] + reach
                and boxes[a, 0, 2] <= boxes[b, 1, 2] + reach
                and boxes[b, 0, 2] <= boxes[a, 1, 2] + reach
            ):
                found[min(a, b), max(a, b)] = True
                count += 1
    pairs = np.empty((count, 2), np.int64)
    k = 0
    for a in range(n):
        for b in range(a + 1, n):
            if found[a, b]:
                pairs[k, 0], pairs[k, 1] = a, b
                k += 1
    return pairs


@njit(cache=True, nogil=True)
def _boxes_into(
    points: FloatArray,
    starts: IntArray,
    radii: FloatArray,
    carrier: IntArray,
    rotations: FloatArray,
    positions: FloatArray,
    found: FloatArray,
) -> None:
    """See `boxes`."""
    for p in range(radii.shape[0]):
        turn, at = rotations[carrier[p]], positions[carrier[p]]
        for r in range(3):
            low, high = np.inf, -np.inf
            for i in range(starts[p], starts[p + 1]):
                value = turn[r, 0] * points[i, 0] + turn[r, 1] * points[i, 1] + turn[r, 2] * points[i, 2]
                low, high = min(low, value), max(high, value)
            found[p, 0, r], found[p, 1, r] = at[r] + low - radii[p], at[r] + high + radii[p]
