"""Where do two volumes meet? Exact, for every shift of B in a window, with work that grows with the boundary of the
answer.

Two volumes meet at a shift if some voxel of A and some voxel of shifted B coincide and have a bit in common (or, where
bits are asked for by name, if all of these occur somewhere). The window is halved again and again into square blocks
of shifts; for a block only those cells of B are looked at again, finer, whose pooled bits can still meet A's pooled
bits for some shift of the block. A block is settled as a whole if nothing is left that can meet, or if something meets
whatever the shift; single shifts are decided voxel by voxel.
"""

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, Int32Array, IntArray, Words
from mhvedit.search.pyramid import TOP, Pyramid, TurnedColumns

SETTLED = -1  # a block that meets whatever the shift


def meets(
    a: Pyramid, b: TurnedColumns, *, base: IntArray, stride: int, asked: BoolArray, every: Words | None = None
) -> BoolArray:
    """At which shifts A and turned B meet.

    Args:
        a: the volume at rest.
        b: the volume that is shifted, already turned.
        base: (2,) shift of cell (0, 0), in strides.
        stride: voxels between shifts.
        asked: (X, Y) which shifts to decide; the others come back False.
        every: (W,) bits that must all occur in common; None: any bit.

    Returns:
        (X, Y).
    """
    out = np.zeros(asked.shape, np.bool_)
    if asked.any() and b.levels[TOP].any():
        need = np.zeros(a.levels[0].shape[3], np.uint64) if every is None else every
        buffers = tuple(np.empty((max(1, int(np.count_nonzero(level.any(-1)))), 3), np.int32) for level in b.levels)
        _search(
            a.levels, a.sure, a.starts, b.levels, b.starts, b.column_of, b.bits, buffers,
            base * stride, stride, asked, every is None, need, out,
        )  # fmt: skip
    return out


@njit(cache=True, nogil=True)  # one loop with its own stack: compiled recursion does not survive the cache
def _search(  # noqa: C901
    a_levels: tuple[Words, ...],
    a_sure: tuple[Words, ...],
    a_starts: IntArray,
    b_levels: tuple[Words, ...],
    b_starts: IntArray,
    column_of: Int32Array,
    bits: Words,
    lists: tuple[Int32Array, ...],
    base: IntArray,
    stride: int,
    asked: BoolArray,
    any_bit: bool,
    need: Words,
    out: BoolArray,
) -> None:
    """Descend through the blocks of shifts, depth first; `lists` holds what is left of B on the way down."""
    counts = np.zeros(TOP + 2, np.int64)
    child = np.zeros(TOP + 2, np.int64)
    block = np.zeros((TOP + 2, 2), np.int64)
    roots = _all_cells(b_levels[TOP])
    seen, sure = np.zeros(need.shape[0], np.uint64), np.zeros(need.shape[0], np.uint64)
    last_x = base[0] + (asked.shape[0] - 1) * stride
    last_y = base[1] + (asked.shape[1] - 1) * stride
    for top_x in range(base[0] >> TOP, (last_x >> TOP) + 1):
        for top_y in range(base[1] >> TOP, (last_y >> TOP) + 1):
            if not _any_asked(asked, base, stride, TOP, top_x, top_y):
                continue
            offset = b_starts[TOP] - a_starts[TOP]
            counts[TOP] = _sift(
                a_levels[TOP], a_sure[TOP], b_levels[TOP], roots, roots.shape[0], 1,
                offset[0] + top_x, offset[1] + top_y, offset[2], lists[TOP], any_bit, need, seen, sure,
            )  # fmt: skip
            if counts[TOP] == SETTLED:
                _settle(asked, base, stride, TOP, top_x, top_y, out)
            if counts[TOP] <= 0:
                continue
            level = TOP
            child[TOP] = 0
            block[TOP, 0], block[TOP, 1] = top_x, top_y
            while level <= TOP:
                if child[level] == 4:
                    level += 1
                    continue
                x = 2 * block[level, 0] + (child[level] & 1)
                y = 2 * block[level, 1] + (child[level] >> 1)
                child[level] += 1
                finer = level - 1
                offset = b_starts[finer] - a_starts[finer]
                if not _any_asked(asked, base, stride, finer, x, y):
                    continue
                if finer == 0:
                    if _meet_at(
                        a_levels[0], column_of, bits, lists[1], counts[1],
                        offset[0] + x, offset[1] + y, offset[2], any_bit, need, seen,
                    ):  # fmt: skip
                        _settle(asked, base, stride, 0, x, y, out)
                    continue
                counts[finer] = _sift(
                    a_levels[finer], a_sure[finer], b_levels[finer], lists[level], counts[level], 2,
                    offset[0] + x, offset[1] + y, offset[2], lists[finer], any_bit, need, seen, sure,
                )  # fmt: skip
                if counts[finer] == SETTLED:
                    _settle(asked, base, stride, finer, x, y, out)
                elif counts[finer] > 0:
                    block[finer, 0], block[finer, 1] = x, y
                    child[finer] = 0
                    level = finer


@njit(cache=True, nogil=True)
def _all_cells(level: Words) -> Int32Array:
    cells = np.empty((level.shape[0] * level.shape[1] * level.shape[2], 3), np.int32)
    n = 0
    for x, y, z in np.ndindex(level.shape[:3]):
        for w in range(level.shape[3]):
            if level[x, y, z, w] != 0:
                cells[n, 0], cells[n, 1], cells[n, 2] = x, y, z
                n += 1
                break
    return cells[:n]


@njit(cache=True, nogil=True, inline="always")
def _cells_of_block(n: int, base: int, stride: int, level: int, x: int) -> tuple[int, int]:
    """First and past-the-last cell of the window along one axis whose shift lies in a block."""
    first = -((base - (x << level)) // stride)
    stop = -((base - ((x + 1) << level)) // stride)
    return max(0, first), min(n, stop)


@njit(cache=True, nogil=True)
def _any_asked(asked: BoolArray, base: IntArray, stride: int, level: int, x: int, y: int) -> bool:
    """Whether a block of shifts contains one that is asked for."""
    i0, i1 = _cells_of_block(asked.shape[0], base[0], stride, level, x)
    j0, j1 = _cells_of_block(asked.shape[1], base[1], stride, level, y)
    for i in range(i0, i1):
        for j in range(j0, j1):
            if asked[i, j]:
                return True
    return False


@njit(cache=True, nogil=True)
def _settle(asked: BoolArray, base: IntArray, stride: int, level: int, x: int, y: int, out: BoolArray) -> None:
    """All shifts of a block meet: say so of those that are asked for."""
    i0, i1 = _cells_of_block(asked.shape[0], base[0], stride, level, x)
    j0, j1 = _cells_of_block(asked.shape[1], base[1], stride, level, y)
    for i in range(i0, i1):
        for j in range(j0, j1):
            if asked[i, j]:
                out[i, j] = True


@njit(cache=True, nogil=True)
def _sift(
    a: Words,
    a_sure: Words,
    b: Words,
    cells: Int32Array,
    n_cells: int,
    split: int,
    dx: int,
    dy: int,
    dz: int,
    kept: Int32Array,
    any_bit: bool,
    need: Words,
    seen: Words,
    sure: Words,
) -> int:
    """Keep the cells (split: 1) or the children of cells (split: 2) that can meet A.

    Returns:
        How many; 0 if the block cannot meet, SETTLED if it does whatever the shift.
    """
    n = 0
    seen[:] = 0
    sure[:] = 0
    for c in range(n_cells):
        for part in range(split * split * split):
            x = split * cells[c, 0] + (part & 1)
            y = split * cells[c, 1] + ((part >> 1) & 1)
            z = split * cells[c, 2] + (part >> 2)
            i, j, k = x + dx, y + dy, z + dz
            if i < 0 or j < 0 or k < 0 or i >= a.shape[0] or j >= a.shape[1] or k >= a.shape[2]:
                continue
            found = False
            for w in range(need.shape[0]):
                common = a[i, j, k, w] & b[x, y, z, w]
                if common != 0:
                    found = True
                    seen[w] |= common
                    sure[w] |= a_sure[i, j, k, w] & b[x, y, z, w]
                    if any_bit and sure[w] != 0:
                        return SETTLED
            if found:
                kept[n, 0], kept[n, 1], kept[n, 2] = x, y, z
                n += 1
    if any_bit:
        return n
    if _has_all(sure, need):
        return SETTLED
    return n if _has_all(seen, need) else 0


@njit(cache=True, nogil=True, inline="always")
def _has_all(seen: Words, need: Words) -> bool:
    for w in range(need.shape[0]):
        if need[w] & ~seen[w] != 0:
            return False
    return True


@njit(cache=True, nogil=True)
def _meet_at(
    a: Words,
    column_of: Int32Array,
    bits: Words,
    cells: Int32Array,
    n_cells: int,
    dx: int,
    dy: int,
    dz: int,
    any_bit: bool,
    need: Words,
    seen: Words,
) -> bool:
    """Whether A and B meet at one shift, voxel by voxel."""
    seen[:] = 0
    for c in range(n_cells):
        for part in range(4):
            x = 2 * cells[c, 0] + (part & 1)
            y = 2 * cells[c, 1] + (part >> 1)
            column = column_of[x, y]
            i, j = x + dx, y + dy
            if column < 0 or i < 0 or j < 0 or i >= a.shape[0] or j >= a.shape[1]:
                continue
            for z in range(2 * cells[c, 2], 2 * cells[c, 2] + 2):
                k = z + dz
                if k < 0 or k >= a.shape[2]:
                    continue
                for w in range(need.shape[0]):
                    common = a[i, j, k, w] & bits[column, z, w]
                    if common != 0:
                        if any_bit:
                            return True
                        seen[w] |= common
        if not any_bit and _has_all(seen, need):
            return True
    return False
