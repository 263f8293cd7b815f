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
        lists = tuple(np.empty((1 + int(level.any(-1).sum()), 3), np.int32) for level in b.levels)
        _search(
            (a.levels, a.sure, a.starts),
            (b.levels, b.starts, b.column_of, b.bits),
            (base * stride, stride, asked, every is None, need),
            (lists, np.zeros_like(need), np.zeros_like(need)),
            out,
        )
    return out


Resting = tuple[tuple[Words, ...], tuple[Words, ...], IntArray]  # levels, sure, starts
Shifted = tuple[tuple[Words, ...], IntArray, Int32Array, Words]  # levels, starts, columns, bits
Question = tuple[IntArray, int, BoolArray, bool, Words]  # base, stride, asked, whether any bit will do, bits needed
Scratch = tuple[tuple[Int32Array, ...], Words, Words]  # what is left of B at each level, bits seen, bits sure


@njit(cache=True, nogil=True)
def _search(a: Resting, b: Shifted, question: Question, scratch: Scratch, out: BoolArray) -> None:
    """Settle the coarsest blocks of shifts one by one."""
    base, stride, asked = question[:3]
    roots = _all_cells(b[0][TOP])
    last_x = base[0] + (asked.shape[0] - 1) * stride
    last_y = base[1] + (asked.shape[1] - 1) * stride
    for x in range(base[0] >> TOP, (last_x >> TOP) + 1):
        for y in range(base[1] >> TOP, (last_y >> TOP) + 1):
            _descend(TOP, x, y, roots, roots.shape[0], 1, a, b, question, scratch, out)


@njit(cache=True, nogil=True)
def _descend(
    level: int,
    x: int,
    y: int,
    cells: Int32Array,
    n_cells: int,
    split: int,
    a: Resting,
    b: Shifted,
    question: Question,
    scratch: Scratch,
    out: BoolArray,
) -> None:
    """Settle a block of shifts, or its quarters; `cells` are what of B can still meet A, `split` times as coarse."""
    base, stride, asked, any_bit, need = question
    if not _any_asked(asked, base, stride, level, x, y):
        return
    lists, seen, sure = scratch
    dx = b[1][level, 0] - a[2][level, 0] + x
    dy = b[1][level, 1] - a[2][level, 1] + y
    dz = b[1][level, 2] - a[2][level, 2]
    if level == 0:
        if _meet_at(a[0][0], b[2], b[3], cells, n_cells, dx, dy, dz, any_bit, need, seen):
            _settle(asked, base, stride, 0, x, y, out)
        return
    kept = lists[level]
    n = _sift(a[0][level], a[1][level], b[0][level], cells, n_cells, split, dx, dy, dz, kept, any_bit, need, seen, sure)
    if n == SETTLED:
        _settle(asked, base, stride, level, x, y, out)
    elif n > 0:
        for quarter in range(4):
            child_x, child_y = 2 * x + (quarter & 1), 2 * y + (quarter >> 1)
            _descend(level - 1, child_x, child_y, kept, n, 2, a, b, question, scratch, out)


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
