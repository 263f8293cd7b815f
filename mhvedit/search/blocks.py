"""Blocks of shifts that contain one that is asked for, on all levels."""

from functools import lru_cache

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, IntArray
from mhvedit.geometry.uncounted import uncounted
from mhvedit.search.pyramid import TOP


@lru_cache(maxsize=64)
def most_blocks(n_x: int, n_y: int, stride: int) -> int:
    """How many blocks of all levels so many shifts along x and y can lie in."""
    return sum(((n_x * stride >> level) + 2) * ((n_y * stride >> level) + 2) for level in range(1, TOP + 1))


@njit(cache=True, nogil=True)
def mark_blocks(
    asked: BoolArray, base_x: int, base_y: int, stride: int, blocks: BoolArray
) -> tuple[IntArray, IntArray]:
    """Mark the blocks of 2^L x 2^L shifts, L from 1 on, that contain a shift that is asked for.

    Args:
        asked: (X, Y) shifts.
        base_x: shift of cell (0, 0), voxels; block b of level L holds the shifts s with s >> L = b.
        base_y: likewise.
        stride: voxels between shifts.
        blocks: (N,) takes the marks, one level after the other, from the block of cell (0, 0) on.

    Returns:
        (TOP + 1,) where each level begins; (TOP + 1, 2) its size.
    """
    asked, blocks = uncounted(asked), uncounted(blocks)
    first, sizes = np.zeros(TOP + 1, np.int64), np.zeros((TOP + 1, 2), np.int64)
    last_x, last_y = base_x + (asked.shape[0] - 1) * stride, base_y + (asked.shape[1] - 1) * stride
    past = 0
    for level in range(1, TOP + 1):
        first[level] = past
        sizes[level, 0] = (last_x >> level) - (base_x >> level) + 1
        sizes[level, 1] = (last_y >> level) - (base_y >> level) + 1
        past += sizes[level, 0] * sizes[level, 1]
    blocks[:past] = False
    for i in range(asked.shape[0]):
        row = (((base_x + i * stride) >> 1) - (base_x >> 1)) * sizes[1, 1]
        if stride == 1:
            _mark_pairs(asked[i], base_y & 1, blocks[row : row + sizes[1, 1]])
            continue
        for j in range(asked.shape[1]):
            blocks[row + ((base_y + j * stride) >> 1) - (base_y >> 1)] |= asked[i, j]
    for level in range(2, TOP + 1):
        low_x, low_y = base_x >> level - 1, base_y >> level - 1
        fine = blocks[first[level - 1] : first[level - 1] + sizes[level - 1, 0] * sizes[level - 1, 1]]
        for x in range(sizes[level - 1, 0]):
            row = first[level] + (((low_x + x) >> 1) - (low_x >> 1)) * sizes[level, 1]
            own = fine[x * sizes[level - 1, 1] : (x + 1) * sizes[level - 1, 1]]
            _mark_pairs(own, low_y & 1, blocks[row : row + sizes[level, 1]])
    return first, sizes


@njit(cache=True, nogil=True, inline="always")
def _mark_pairs(row: BoolArray, odd: int, out: BoolArray) -> None:
    """Mark each pair of which one is marked; `odd`: the first has no partner."""
    if odd:
        out[0] |= row[0]
    for k in range((row.shape[0] - odd) // 2):
        out[k + odd] |= row[2 * k + odd] | row[2 * k + 1 + odd]
    if (row.shape[0] - odd) % 2:
        out[out.shape[0] - 1] |= row[row.shape[0] - 1]
