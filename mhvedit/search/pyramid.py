"""Volumes arranged for the search: columns of words, and their pools over square blocks.

Poses move and turn on the floor, so what lies over one voxel of the floor stays together: a column. Columns are cut
into slabs. A volume of one moment has slabs of 64 voxels, one bit each; a volume of several has slabs of 8 voxels that
pool their bits, and its voxels beside them for the last word. Two columns share a bit, or may share one, where an AND
of their words is not zero.

A cell of level L pools 2^L x 2^L columns, from lattice index zero. Shifted by all of a block of 2^L x 2^L shifts, a
cell of B stays within four cells of A, and a cell of A within four of B. So A's four pooled by OR say which bits of B's
cell may be met, and pooled by AND which are met whatever the shift; B's four pooled by AND say the same of A's cell. B
is turned about z by looking up, for every column of the lattice, the column of the untouched volume that its centre
falls into.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray, Int32Array, IntArray, Words
from mhvedit.geometry.uncounted import uncounted
from mhvedit.search.scratch import Scratch
from mhvedit.volumes.history import MotionHistoryVolume

TOP = 4  # the coarsest level
BLOCK = 1 << TOP
MOMENT_SLAB = 64  # voxels in a slab of a volume of one moment
SLAB = 8  # voxels in a slab of a volume of several
LEVELS = np.arange(TOP + 1)[:, None]
OWN, ANY, ALL = 0, 1, 2  # how cells are pooled: not at all, by OR, by AND


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """The occupied columns of a volume."""

    column_of: Int32Array  # (X, Y) index into the words; -1 where the column is empty
    start: IntArray  # (2,) lattice index of column (0, 0)
    words: Words  # (C, S W) what occurs in each slab
    voxels: Words  # (C, 8 S W) what occurs in each voxel; the slabs' words for a volume of one moment
    every: Words  # (C, S W) what occurs in every voxel of a slab; bits are voxels for a volume of one moment
    first: int  # lattice index along z of the first slab, in slabs
    n_words: int  # W, words in a slab
    slab: int  # voxels in a slab
    outline: FloatArray  # (N, 2) lattice indices of the first and the last occupied column of each row


@dataclass(frozen=True, slots=True, eq=False)
class Pools:
    """Words of those cells of all levels that hold anything; level 0 has none."""

    words: Words  # (R, S W)
    row_of: Int32Array  # (N,) index into the words of each cell, one level after the other; -1 where it holds nothing
    first: IntArray  # (TOP + 1,) where a level begins
    shape: IntArray  # (TOP + 1, 2) cells of a level along x and y


@dataclass(frozen=True, slots=True, eq=False)
class Pyramid:
    """The volume at rest, and its pools; cell (x, y) of level L is (lattice index >> L) - starts[L]."""

    columns: Columns
    own: Pools  # words of some column of a cell; shifted by one cell, so as to stand beside the next two
    some: Pools  # words of some column of a cell, the next along x, along y and along both
    sure: Pools  # words of every column of these four
    starts: IntArray  # (TOP + 1, 2)


@dataclass(frozen=True, slots=True, eq=False)
class TurnedColumns:
    """A volume turned about z, and its pools."""

    columns: Columns  # untouched
    column_of: Int32Array  # (X, Y) index into the columns' words; -1 where empty; X and Y multiples of BLOCK
    some: Pools  # words of some column of a cell
    sure: Pools  # words of every column of a cell, the one before along x, along y and along both
    starts: IntArray  # (TOP + 1, 2), as in Pyramid


def level_of(pools: Pools, level: int) -> Words:
    """(X, Y, S W) the words of one level."""
    x, y = pools.shape[level].tolist()
    rows = pools.row_of[pools.first[level] : pools.first[level] + x * y]
    words = np.zeros((x * y, pools.words.shape[1]), np.uint64)
    words[rows >= 0] = pools.words[rows[rows >= 0]]
    return words.reshape(x, y, -1)


def columns_of(volume: MotionHistoryVolume) -> Columns:
    """Collect the occupied columns of a volume."""
    n_words = volume.frames.shape[3]
    slab = MOMENT_SLAB if volume.n_frames == 1 else SLAB
    column_of, cells = _occupied(volume.frames)
    low = volume.grid.start[2]
    first = low // slab
    n_slabs = -(-(low + volume.grid.shape[2]) // slab) - first
    pack = _packed if slab == MOMENT_SLAB else _stacked
    words, voxels, every = pack(volume.frames, cells, low - first * slab, n_slabs)
    start = np.array(volume.grid.start[:2])
    ends = np.flatnonzero(np.diff(cells[:, 0], prepend=-1, append=-1))
    outline = np.concatenate([cells[ends[:-1]], cells[ends[1:] - 1]]) + start
    return Columns(column_of, start, words, voxels, every, first, n_words, slab, outline.astype(np.float64))


def pyramid_of(volume: MotionHistoryVolume) -> Pyramid:
    """Pool the volume that stays at rest."""
    columns = columns_of(volume)
    start, shape = _aligned(columns.start, columns.column_of.shape)
    column_of = np.full(shape, -1, np.int32)
    low = columns.start - start
    high = low + columns.column_of.shape
    column_of[low[0] : high[0], low[1] : high[1]] = columns.column_of
    some, every = _pools(column_of, columns, Scratch())
    own, four, sure = (
        _fours(pools, Scratch(), grown=1, how=how) for pools, how in ((some, OWN), (some, ANY), (every, ALL))
    )
    return Pyramid(columns, own, four, sure, (start >> LEVELS) - 1)


def turned(columns: Columns, yaw: float, scratch: Scratch | None = None) -> TurnedColumns:
    """Turn a volume about z.

    Args:
        columns: of the volume.
        yaw: rad, counter-clockwise.
        scratch: to lay the result into; what was laid there before is lost.
    """
    scratch = scratch or Scratch()
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = columns.outline.T if len(columns.outline) else np.zeros((2, 1))
    xy = np.stack([c * x - s * y, s * x + c * y])
    low, high = np.floor(xy.min(1) - 1).astype(np.int64), np.ceil(xy.max(1) + 2).astype(np.int64)
    start, shape = _aligned(low, tuple(high - low))
    column_of = scratch.array("columns", (int(shape[0]), int(shape[1])), np.int32)
    _turn(columns.column_of, columns.start, c, s, start, column_of)
    some, every = _pools(column_of, columns, scratch)
    return TurnedColumns(columns, column_of, some, _fours(every, scratch, grown=0, how=ALL), start >> LEVELS)


def _pools(column_of: Int32Array, columns: Columns, scratch: Scratch) -> tuple[Pools, Pools]:
    """Words of some column of each cell, and words of every column of it."""
    shape = np.array(column_of.shape) >> LEVELS
    some, every = (_blank(shape, columns.words.shape[1], scratch, name) for name in ("some", "every"))
    n_some, n_every = _pool(
        column_of, columns.words, columns.every,
        some.first, some.shape, some.row_of, some.words, every.row_of, every.words,
    )  # fmt: skip
    return _cut(some, n_some), _cut(every, n_every)


def _fours(pools: Pools, scratch: Scratch, *, grown: int, how: int) -> Pools:
    """Each cell with the one before along x, y and both, on levels that may be larger by a cell."""
    out = _blank(pools.shape + grown, pools.words.shape[1], scratch, "fours")
    rows = _pool_fours(
        pools.first, pools.shape, pools.row_of, pools.words, how, out.first, out.shape, out.row_of, out.words
    )
    return _cut(out, rows)


def _blank(shape: IntArray, n_words: int, scratch: Scratch, name: str) -> Pools:
    """Pools with room for all cells."""
    shape = np.where(LEVELS > 0, shape, 0)
    ends = np.cumsum(shape[:, 0] * shape[:, 1])
    words = scratch.array(f"{name}, words", (int(ends[-1]), n_words), np.uint64)
    row_of = scratch.array(f"{name}, rows", (int(ends[-1]),), np.int32)
    return Pools(words, row_of, np.append(0, ends[:-1]), shape)


def _cut(pools: Pools, n_rows: int) -> Pools:
    """Pools without the room that was not needed."""
    return Pools(pools.words[:n_rows], pools.row_of, pools.first, pools.shape)


def _aligned(start: IntArray, shape: tuple[int, ...]) -> tuple[IntArray, IntArray]:
    """The rectangle grown to multiples of BLOCK."""
    low = start // BLOCK * BLOCK
    high = -(-(start + shape) // BLOCK) * BLOCK
    return low, np.maximum(high - low, BLOCK)


@njit(cache=True, nogil=True)
def _occupied(frames: Words) -> tuple[Int32Array, Int32Array]:
    """Number the columns that hold anything: (X, Y) index, -1 where empty, and (C, 2) x, y."""
    column_of = np.full(frames.shape[:2], -1, np.int32)
    cells = np.empty((frames.shape[0] * frames.shape[1], 2), np.int32)
    n = 0
    for x in range(frames.shape[0]):
        for y in range(frames.shape[1]):
            if frames[x, y].any():
                column_of[x, y] = n
                cells[n, 0], cells[n, 1] = x, y
                n += 1
    return column_of, cells[:n].copy()


@njit(cache=True, nogil=True)
def _packed(frames: Words, cells: Int32Array, low: int, n_slabs: int) -> tuple[Words, Words, Words]:
    """Columns of a volume of one moment, a bit a voxel."""
    out = np.zeros((cells.shape[0], n_slabs), np.uint64)
    for n in range(cells.shape[0]):
        column = frames[cells[n, 0], cells[n, 1]]
        for z in range(column.shape[0]):
            out[n, (low + z) // MOMENT_SLAB] |= (column[z, 0] & np.uint64(1)) << np.uint64((low + z) % MOMENT_SLAB)
    return out, out, out


@njit(cache=True, nogil=True)
def _stacked(frames: Words, cells: Int32Array, low: int, n_slabs: int) -> tuple[Words, Words, Words]:
    """Columns of a volume of several moments: pooled over slabs by OR, in full, and pooled by AND."""
    n_words = frames.shape[3]
    some = np.zeros((cells.shape[0], n_slabs * n_words), np.uint64)
    every = np.zeros((cells.shape[0], n_slabs * n_words), np.uint64)
    voxels = np.zeros((cells.shape[0], n_slabs * SLAB * n_words), np.uint64)
    for n in range(cells.shape[0]):
        column = frames[cells[n, 0], cells[n, 1]]
        for z in range(column.shape[0]):
            for w in range(n_words):
                voxels[n, (low + z) * n_words + w] = column[z, w]
        for at in range(n_slabs):
            for w in range(n_words):
                union, common = np.uint64(0), ~np.uint64(0)
                for z in range(at * SLAB, (at + 1) * SLAB):
                    union |= voxels[n, z * n_words + w]
                    common &= voxels[n, z * n_words + w]
                some[n, at * n_words + w], every[n, at * n_words + w] = union, common
    return some, voxels, every


@njit(cache=True, nogil=True)
def _turn(column_of: Int32Array, start: IntArray, c: float, s: float, first: IntArray, out: Int32Array) -> None:
    """The column that each turned column's centre falls into."""
    last_u, last_v = column_of.shape[0], column_of.shape[1]
    start_u, start_v = start
    for i in range(out.shape[0]):
        x = float(first[0] + i)
        for j in range(out.shape[1]):
            y = float(first[1] + j)
            u = int(np.floor(c * x + s * y + 0.5)) - start_u
            v = int(np.floor(c * y - s * x + 0.5)) - start_v
            inside = 0 <= u < last_u and 0 <= v < last_v
            out[i, j] = column_of[np.uint64(u), np.uint64(v)] if inside else np.int32(-1)


@njit(cache=True, nogil=True)
def _pool(
    column_of: Int32Array,
    words: Words,
    every_word: Words,
    first: IntArray,
    shape: IntArray,
    some_row: Int32Array,
    some: Words,
    every_row: Int32Array,
    every: Words,
) -> tuple[int, int]:
    """Pool columns by two and two, and the cells again; how many rows there are of either kind."""
    words, every_word = uncounted(words), uncounted(every_word)
    some, every = uncounted(some), uncounted(every)
    n, m = 0, 0
    for x in range(shape[1, 0]):
        for y in range(shape[1, 1]):
            a, b = column_of[2 * x, 2 * y], column_of[2 * x, 2 * y + 1]
            c, d = column_of[2 * x + 1, 2 * y], column_of[2 * x + 1, 2 * y + 1]
            cell = x * shape[1, 1] + y
            some_row[cell] = n if _any_of(a, b, c, d, words, some, n) else -1
            n += some_row[cell] >= 0
            every_row[cell] = m if _all_of(a, b, c, d, every_word, every, m) else -1
            m += every_row[cell] >= 0
    for level in range(2, TOP + 1):
        fine, n_fine = first[level - 1], shape[level - 1, 1]
        for x in range(shape[level, 0]):
            for y in range(shape[level, 1]):
                at = fine + 2 * x * n_fine + 2 * y
                cell = first[level] + x * shape[level, 1] + y
                a, b, c, d = some_row[at], some_row[at + 1], some_row[at + n_fine], some_row[at + n_fine + 1]
                some_row[cell] = n if _any_of(a, b, c, d, some, some, n) else -1
                n += some_row[cell] >= 0
                a, b, c, d = every_row[at], every_row[at + 1], every_row[at + n_fine], every_row[at + n_fine + 1]
                every_row[cell] = m if _all_of(a, b, c, d, every, every, m) else -1
                m += every_row[cell] >= 0
    return n, m


@njit(cache=True, nogil=True)
def _pool_fours(
    first: IntArray,
    shape: IntArray,
    row_of: Int32Array,
    words: Words,
    how: int,
    out_first: IntArray,
    out_shape: IntArray,
    out_row: Int32Array,
    out: Words,
) -> int:
    """Cell (x, y) of `out` takes cells x - 1, x by y - 1, y, or the first of these alone; how many rows there are."""
    words, out = uncounted(words), uncounted(out)
    n = 0
    for level in range(1, TOP + 1):
        n_x, n_y = shape[level]
        for x in range(out_shape[level, 0]):
            for y in range(out_shape[level, 1]):
                at = first[level] + (x - 1) * n_y + y - 1
                low_x, low_y, high_x, high_y = x > 0, y > 0, x < n_x, y < n_y
                a = row_of[at] if low_x and low_y else -1
                b = row_of[at + 1] if low_x and high_y else -1
                c = row_of[at + n_y] if high_x and low_y else -1
                d = row_of[at + n_y + 1] if high_x and high_y else -1
                if how == ALL:
                    there = _all_of(a, b, c, d, words, out, n)
                elif how == ANY:
                    there = _any_of(a, b, c, d, words, out, n)
                else:
                    there = _any_of(a, -1, -1, -1, words, out, n)
                out_row[out_first[level] + x * out_shape[level, 1] + y] = n if there else -1
                n += there
    return n


@njit(cache=True, nogil=True, inline="always")
def _any_of(a: int, b: int, c: int, d: int, words: Words, out: Words, n: int) -> bool:
    """Pool up to four rows by OR into another; whether there are any (-1: none)."""
    some = max(a, b, c, d)
    if some < 0:
        return False
    a, b, c, d = a if a >= 0 else some, b if b >= 0 else some, c if c >= 0 else some, d if d >= 0 else some
    of_a, of_b, of_c, of_d, into = words[a], words[b], words[c], words[d], out[n]
    for w in range(into.shape[0]):
        into[w] = of_a[w] | of_b[w] | of_c[w] | of_d[w]
    return True


@njit(cache=True, nogil=True, inline="always")
def _all_of(a: int, b: int, c: int, d: int, words: Words, out: Words, n: int) -> bool:
    """Pool four rows by AND into another; whether they have anything in common."""
    if min(a, b, c, d) < 0:
        return False
    of_a, of_b, of_c, of_d, into = words[a], words[b], words[c], words[d], out[n]
    common = np.uint64(0)
    for w in range(into.shape[0]):
        into[w] = of_a[w] & of_b[w] & of_c[w] & of_d[w]
        common |= into[w]
    return bool(common != 0)
