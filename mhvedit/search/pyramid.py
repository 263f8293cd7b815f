"""Columns pooled over square blocks, so that blocks of shifts can be settled as a whole.

A cell of level L is 2^L x 2^L columns, from lattice index zero. Shifted by all of a block of 2^L x 2^L shifts, a cell
of B stays within a *window* of 2^(L+1) - 1 columns of A each way, and a cell of A within such a window of B. So A's
window pooled by OR says which bits of B's cell may be met, and pooled by AND which are met whatever the shift; B's
window pooled by AND says the same of A's cell. Three by three windows of one level make a window of the next.

All rows are eight words long, a line of the processor's cache, whatever the volume: what is looked at again and again
has to stay near, and loops of a known length compile to a few instructions.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import Int32Array, IntArray, Words
from mhvedit.geometry.uncounted import uncounted
from mhvedit.search.columns import EMPTY, Columns, TurnedColumns, aligned, turned
from mhvedit.search.scratch import Scratch

SLABS = 8  # words in a row
TOP = 4  # the coarsest level
SETTLING = 2  # the finest level whose blocks are settled as a whole
LEVELS = np.arange(TOP + 1)[:, None]
MARGIN = 2  # empty columns around A's, so that windows of level 1 need no look at borders


@dataclass(frozen=True, slots=True, eq=False)
class Pools:
    """Words of those cells or windows of all levels that hold anything; level 0 has none. Row EMPTY is zero."""

    rows: Words  # (R, SLABS)
    row_of: Int32Array  # (N,) index into the rows, one level after the other
    first: IntArray  # (TOP + 1,) where a level begins
    shape: IntArray  # (TOP + 1, 2) cells of a level along x and y

    @property
    def arrays(self) -> tuple[IntArray, IntArray, Int32Array, Words]:
        """As kernels take them."""
        return self.first, self.shape, self.row_of, self.rows


@dataclass(frozen=True, slots=True, eq=False)
class Pyramid:
    """The volume at rest; cell (x, y) of level L is (lattice index >> L) - starts[L], a column a cell of level 0."""

    columns: Columns
    column_of: Int32Array  # (X, Y) as the columns' own, with MARGIN empty ones before and after
    own: Pools  # what some column of a cell holds
    some: Pools  # what some column of the window that starts with a cell holds
    sure: Pools  # what all columns of that window hold
    starts: IntArray  # (TOP + 1, 2)


@dataclass(frozen=True, slots=True, eq=False)
class TurnedPyramid:
    """The volume that is turned and shifted; cell (x, y) of level L is (lattice index >> L) - starts[L]."""

    turned: TurnedColumns
    some: Pools  # what some column of a cell holds
    sure: Pools  # what all columns of the window that ends with a cell hold
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
    own, some, sure = (_blank(column_of, 1, Scratch(), "pools") for _ in range(3))
    return Pyramid(
        columns=columns,
        column_of=column_of,
        own=_cut(own, _pool_cells(column_of, columns.some, 1, *own.arrays)),
        some=_cut(some, _pool_windows(column_of, columns.some, 0, False, *some.arrays)),
        sure=_cut(sure, _pool_windows(column_of, columns.every, 0, True, *sure.arrays)),
        starts=np.where(LEVELS > 0, (start >> LEVELS) - 1, start - MARGIN),
    )


def is_solid(columns: Columns) -> bool:
    """Whether some window that settles blocks holds anything in all of its columns, as the volume stands."""
    return bool(level_of(turned_pyramid(turned(columns, 0.0)).sure, SETTLING).any())


def turned_pyramid(b: TurnedColumns, scratch: Scratch | None = None, *, solid: bool = True) -> TurnedPyramid:
    """Pool a turned volume.

    Args:
        b: the volume.
        scratch: to lay the result into; what was laid there before is lost.
        solid: whether to look for windows that all columns fill; without them fewer blocks are settled early.
    """
    scratch = scratch or Scratch()
    columns, column_of = b.columns, b.column_of
    some, sure = _blank(column_of, 0, scratch, "some"), _blank(column_of, 0, scratch, "sure")
    n_some = _pool_cells(column_of, columns.some, 0, *some.arrays)
    if solid:
        n_sure = _pool_windows(column_of, columns.every, 1, True, *sure.arrays)
    else:
        n_sure, sure.row_of[:], sure.rows[EMPTY] = EMPTY + 1, EMPTY, 0
    return TurnedPyramid(b, _cut(some, n_some), _cut(sure, n_sure), b.start >> LEVELS)


def _blank(column_of: Int32Array, grown: int, scratch: Scratch, name: str) -> Pools:
    """Pools with room for all cells, on levels that are larger by so many cells."""
    first, shape = _levels(column_of.shape[0], column_of.shape[1], grown)
    count = int(first[-1] + shape[-1, 0] * shape[-1, 1])
    rows = scratch.array(f"{name}, rows", (count + 1, SLABS), np.uint64)
    row_of = scratch.array(f"{name}, numbers", (count,), np.int32)
    return Pools(rows, row_of, first, shape)


def _cut(pools: Pools, n_rows: int) -> Pools:
    """Pools without the room that was not needed."""
    return Pools(pools.rows[:n_rows], pools.row_of, pools.first, pools.shape)


@njit(cache=True)
def _levels(n_x: int, n_y: int, grown: int) -> tuple[IntArray, IntArray]:
    """Where each level begins, and its cells along x and y, if columns have MARGIN empty ones for each cell grown."""
    first, shape = np.zeros(TOP + 1, np.int64), np.zeros((TOP + 1, 2), np.int64)
    for level in range(1, TOP + 1):
        first[level] = first[level - 1] + shape[level - 1, 0] * shape[level - 1, 1]
        shape[level, 0] = ((n_x - 2 * MARGIN * grown) >> level) + grown
        shape[level, 1] = ((n_y - 2 * MARGIN * grown) >> level) + grown
    return first, shape


@njit(cache=True, nogil=True)
def _pool_cells(
    column_of: Int32Array, words: Words, behind: int, first: IntArray, shape: IntArray, row_of: Int32Array, rows: Words
) -> int:
    """Pool columns by two and two by OR, and the cells again; how many rows there are.

    Cell x of a level pools cells 2 x - `behind` and the next of the one below.
    """
    words, rows = uncounted(words), uncounted(rows)
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
    return n


@njit(cache=True, nogil=True)
def _pool_windows(
    column_of: Int32Array,
    words: Words,
    behind: int,
    all_of_them: bool,
    first: IntArray,
    shape: IntArray,
    row_of: Int32Array,
    rows: Words,
) -> int:
    """Pool three by three columns by AND or OR, and the windows again; how many rows there are.

    Window x of level 1 begins with column 2 x - `behind`, that of another level with window 2 x - 1 of the one below.
    """
    words, rows = uncounted(words), uncounted(rows)
    flat = column_of.ravel()
    rows[EMPTY] = 0
    n = EMPTY + 1
    for level in range(1, TOP + 1):
        below, source, fine = (flat, words, 0) if level == 1 else (row_of, rows, first[level - 1])
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
    return n


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
