"""Columns pooled over square blocks, so that blocks of shifts can be settled as a whole.

A cell of level L is 2^L x 2^L columns, from lattice index zero. Shifted by all of a block of 2^L x 2^L shifts, a cell
of B stays within a *window* of 2^(L+1) - 1 columns of A each way, and a cell of A within such a window of B. So A's
window pooled by OR says which bits of B's cell may be met, and pooled by AND which are met whatever the shift; B's
window pooled by AND says the same of A's cell. Three by three windows of one level make a window of the next.

All rows are eight words long, a line of the processor's cache, whatever the volume: what is looked at again and again
has to stay near, and loops of a known length compile to a few instructions.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray, Int32Array, IntArray, Words
from mhvedit.geometry.uncounted import uncounted
from mhvedit.search.columns import BLOCK, EMPTY, Columns, aligned, lay_turned, turned_box

SLABS = 8  # words in a row
TOP = 4  # the coarsest level
SETTLING = 2  # the finest level whose blocks are settled as a whole
LEVELS = np.arange(TOP + 1)[:, None]
MARGIN = 2  # empty columns around A's, so that windows of level 1 need no look at borders


class Pools(NamedTuple):
    """Words of those cells or windows of all levels that hold anything; level 0 has none. Row EMPTY is zero."""

    rows: Words  # (R, SLABS), the last of which may be room that was not needed
    row_of: Int32Array  # (N,) index into the rows, one level after the other; likewise
    first: IntArray  # (TOP + 1,) where a level begins
    shape: IntArray  # (TOP + 1, 2) cells of a level along x and y


class Pyramid(NamedTuple):
    """The volume at rest; cell (x, y) of level L is (lattice index >> L) - starts[L], a column a cell of level 0."""

    column_of: Int32Array  # (X, Y) as the columns' own, with MARGIN empty ones before and after
    words: Words  # (C, SLABS) `some` of the columns
    voxels: Words  # (C, SLABS tall) as the columns' own
    tall: int  # as in the columns' layout
    lanes: int  # likewise
    own: Pools  # what some column of a cell holds
    some: Pools  # what some column of the window that starts with a cell holds
    sure: Pools  # what all columns of that window hold
    starts: IntArray  # (TOP + 1, 2)


class TurnedPyramid(NamedTuple):
    """The volume that is turned and shifted; cell (x, y) of level L is (lattice index >> L) - starts[L]."""

    column_of: Int32Array  # (X, Y) index into the columns' words; X and Y multiples of BLOCK
    words: Words  # (C, SLABS) `some` of the columns
    voxels: Words  # (C, SLABS tall) as the columns' own
    some: Pools  # what some column of a cell holds
    sure: Pools  # what all columns of the window that ends with a cell hold
    starts: IntArray  # (TOP + 1, 2)


class Room(NamedTuple):
    """Memory for a volume turned by one yaw after the other."""

    column_of: Int32Array  # (N,)
    some: Pools
    sure: Pools  # with the same `first` and `shape`
    starts: IntArray  # (TOP + 1, 2)


def level_of(pools: Pools, level: int) -> Words:
    """(X, Y, SLABS) the words of one level."""
    x, y = pools.shape[level].tolist()
    return pools.rows[pools.row_of[pools.first[level] : pools.first[level] + x * y]].reshape(x, y, SLABS)


def pyramid_of(columns: Columns) -> Pyramid:
    """Pool the volume that stays at rest."""
    ends = [aligned(int(low), int(low) + n) for low, n in zip(columns.start, columns.column_of.shape, strict=True)]
    start = np.array([first for first, _ in ends])
    column_of = np.full([past - first + 2 * MARGIN for first, past in ends], EMPTY, np.int32)
    low = columns.start - start + MARGIN
    high = low + columns.column_of.shape
    column_of[low[0] : high[0], low[1] : high[1]] = columns.column_of
    own, some, sure = (_pools(*_levels(*column_of.shape, 1)) for _ in range(3))
    _pool_cells(column_of, columns.some, 1, own)
    _pool_windows(column_of, columns.some, 0, False, some)
    _pool_windows(column_of, columns.every, 0, True, sure)
    return Pyramid(
        column_of=column_of,
        words=columns.some,
        voxels=columns.voxels,
        tall=columns.layout.tall,
        lanes=columns.layout.lanes,
        own=own,
        some=some,
        sure=sure,
        starts=np.where(LEVELS > 0, (start >> LEVELS) - 1, start - MARGIN),
    )


def is_solid(columns: Columns) -> bool:
    """Whether some window that settles blocks holds anything in all of its columns, as the volume stands."""
    return bool(level_of(turned_pyramid(columns, 0.0).sure, SETTLING).any())


def room_for(columns: Columns) -> Room:
    """Memory for a volume, whatever the yaw that it is turned by."""
    reach = np.ptp(columns.outline, axis=0) if len(columns.outline) else np.zeros(2)
    side = int(np.ceil(np.hypot(*reach))) + 2 * BLOCK + 6  # the box is rounded outwards, then to whole blocks
    levels = _levels(side, side, 0)
    return Room(np.empty(side * side, np.int32), _pools(*levels), _pools(*levels), np.zeros((TOP + 1, 2), np.int64))


def turned_pyramid(columns: Columns, yaw: float, room: Room | None = None, *, solid: bool = True) -> TurnedPyramid:
    """Turn a volume about z, and pool it.

    Args:
        columns: of the volume.
        yaw: rad, counter-clockwise.
        room: of the volume, to lay the result into; what was laid there before is lost.
        solid: whether to look for windows that all columns fill; without them fewer blocks are settled early.
    """
    room = room or room_for(columns)
    c, s = float(np.cos(yaw)), float(np.sin(yaw))
    n_x, n_y = _lay(columns.column_of, columns.start, columns.outline, columns.some, columns.every, c, s, solid, room)
    column_of = room.column_of[: n_x * n_y].reshape(n_x, n_y)
    return TurnedPyramid(column_of, columns.some, columns.voxels, room.some, room.sure, room.starts)


def _pools(first: IntArray, shape: IntArray) -> Pools:
    """Pools with room for all cells of such levels."""
    count = int(first[-1] + shape[-1, 0] * shape[-1, 1])
    return Pools(np.empty((count + 1, SLABS), np.uint64), np.empty(count, np.int32), first, shape)


@njit(cache=True, nogil=True)
def _levels(n_x: int, n_y: int, grown: int) -> tuple[IntArray, IntArray]:
    """Where each level begins, and its cells along x and y, if columns have MARGIN empty ones for each cell grown."""
    first, shape = np.zeros(TOP + 1, np.int64), np.zeros((TOP + 1, 2), np.int64)
    for level in range(1, TOP + 1):
        first[level] = first[level - 1] + shape[level - 1, 0] * shape[level - 1, 1]
        shape[level, 0] = ((n_x - 2 * MARGIN * grown) >> level) + grown
        shape[level, 1] = ((n_y - 2 * MARGIN * grown) >> level) + grown
    return first, shape


@njit(cache=True, nogil=True)
def _lay(
    column_of: Int32Array,
    start: IntArray,
    outline: FloatArray,
    words: Words,
    every: Words,
    c: float,
    s: float,
    solid: bool,
    room: Room,
) -> tuple[int, int]:
    """Lay turned columns and their pools into a room; how many columns there are along x and y.

    Numbers are told with their types: as plain ones they would have kernels compiled for each of them.
    """
    low_x, high_x, low_y, high_y = turned_box(outline, c, s)
    n_x, n_y = high_x - low_x, high_y - low_y
    out = room.column_of[: n_x * n_y].reshape((n_x, n_y))
    lay_turned(column_of, start, c, s, low_x, low_y, out)
    first, shape = _levels(n_x, n_y, np.int64(0))
    for level in range(TOP + 1):
        room.starts[level, 0], room.starts[level, 1] = low_x >> level, low_y >> level
        room.some.first[level] = first[level]
        room.some.shape[level, 0], room.some.shape[level, 1] = shape[level]
    _pool_cells(out, words, np.int64(0), room.some)
    if solid:
        _pool_windows(out, every, np.int64(1), np.bool_(True), room.sure)
    else:
        room.sure.row_of[:], room.sure.rows[EMPTY] = EMPTY, 0
    return n_x, n_y


@njit(cache=True, nogil=True)
def _pool_cells(column_of: Int32Array, words: Words, behind: int, out: Pools) -> None:
    """Pool columns by two and two by OR, and the cells again.

    Cell x of a level pools cells 2 x - `behind` and the next of the one below.
    """
    column_of, words, rows, row_of = uncounted(column_of), uncounted(words), uncounted(out.rows), uncounted(out.row_of)
    first, shape = uncounted(out.first), uncounted(out.shape)
    rows[EMPTY] = 0
    n = EMPTY + 1
    for x in range(shape[1, 0]):
        for y in range(shape[1, 1]):
            a, b = column_of[2 * x, 2 * y], column_of[2 * x, 2 * y + 1]
            c, d = column_of[2 * x + 1, 2 * y], column_of[2 * x + 1, 2 * y + 1]
            row_of[first[1] + x * shape[1, 1] + y] = n if _any_of(a, b, c, d, words, rows, n) else EMPTY
            n += row_of[first[1] + x * shape[1, 1] + y] != EMPTY
    for level in range(2, TOP + 1):
        fine, n_x, n_y = first[level - 1], shape[level - 1, 0], shape[level - 1, 1]
        for x in range(shape[level, 0]):
            for y in range(shape[level, 1]):
                u, v = 2 * x - behind, 2 * y - behind
                a = row_of[fine + u * n_y + v] if u >= 0 and v >= 0 else EMPTY
                b = row_of[fine + u * n_y + v + 1] if u >= 0 and v + 1 < n_y else EMPTY
                c = row_of[fine + (u + 1) * n_y + v] if u + 1 < n_x and v >= 0 else EMPTY
                d = row_of[fine + (u + 1) * n_y + v + 1] if u + 1 < n_x and v + 1 < n_y else EMPTY
                cell = first[level] + x * shape[level, 1] + y
                row_of[cell] = n if _any_of(a, b, c, d, rows, rows, n) else EMPTY
                n += row_of[cell] != EMPTY


@njit(cache=True, nogil=True)
def _pool_windows(column_of: Int32Array, words: Words, behind: int, all_of_them: bool, out: Pools) -> None:
    """Pool three by three columns by AND or OR, and the windows again.

    Window x of level 1 begins with column 2 x - `behind`, that of another level with window 2 x - 1 of the one below.
    """
    columns, words, rows, row_of = (
        uncounted(column_of.ravel()), uncounted(words), uncounted(out.rows), uncounted(out.row_of),
    )  # fmt: skip
    first, shape = uncounted(out.first), uncounted(out.shape)
    rows[EMPTY] = 0
    n = EMPTY + 1
    for level in range(1, TOP + 1):
        below, source, fine = (columns, words, 0) if level == 1 else (row_of, rows, first[level - 1])
        n_x, n_y = column_of.shape if level == 1 else (shape[level - 1, 0], shape[level - 1, 1])
        back = behind if level == 1 else 1
        for x in range(shape[level, 0]):
            for y in range(shape[level, 1]):
                u, v = 2 * x - back, 2 * y - back
                if all_of_them:
                    there = _all_of_nine(below, fine, n_x, n_y, u, v, source, rows, n)
                else:
                    there = _any_of_nine(below, fine, n_x, n_y, u, v, source, rows, n)
                row_of[first[level] + x * shape[level, 1] + y] = n if there else EMPTY
                n += there


@njit(cache=True, nogil=True, inline="always")
def _any_of(a: int, b: int, c: int, d: int, words: Words, out: Words, n: int) -> bool:
    """Pool four rows by OR into another; whether any holds anything."""
    if a == EMPTY and b == EMPTY and c == EMPTY and d == EMPTY:
        return False
    i, j, k, m, to = np.uint64(a), np.uint64(b), np.uint64(c), np.uint64(d), np.uint64(n)
    for w in range(np.uint64(SLABS)):
        out[to, w] = words[i, w] | words[j, w] | words[k, w] | words[m, w]
    return True


@njit(cache=True, nogil=True, inline="always")
def _any_of_nine(
    below: Int32Array, fine: int, n_x: int, n_y: int, u: int, v: int, words: Words, out: Words, n: int
) -> bool:
    """Pool three by three rows by OR into another; whether any holds anything."""
    there = False
    for i in range(max(u, 0), min(u + 3, n_x)):
        for j in range(max(v, 0), min(v + 3, n_y)):
            row = below[fine + i * n_y + j]
            if row == EMPTY:
                continue
            for w in range(SLABS):
                out[n, w] = words[row, w] | (out[n, w] if there else np.uint64(0))
            there = True
    return there


@njit(cache=True, nogil=True, inline="always")
def _all_of_nine(
    below: Int32Array, fine: int, n_x: int, n_y: int, u: int, v: int, words: Words, out: Words, n: int
) -> bool:
    """Pool three by three rows by AND into another; whether they have anything in common."""
    if u < 0 or v < 0 or u + 3 > n_x or v + 3 > n_y:
        return False
    for i in range(u, u + 3):
        for j in range(v, v + 3):
            if below[fine + i * n_y + j] == EMPTY:
                return False
    to, common = np.uint64(n), np.uint64(0)
    for w in range(np.uint64(SLABS)):
        out[to, w] = ~np.uint64(0)
    for i in range(u, u + 3):
        for j in range(v, v + 3):
            row = np.uint64(below[fine + i * n_y + j])
            for w in range(np.uint64(SLABS)):
                out[to, w] &= words[row, w]
    for w in range(np.uint64(SLABS)):
        common |= out[to, w]
    return bool(common != 0)
