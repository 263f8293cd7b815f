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
from mhvedit.volumes.history import MotionHistoryVolume

TOP = 4  # the coarsest level
BLOCK = 1 << TOP
MOMENT_SLAB = 64  # voxels in a slab of a volume of one moment
SLAB = 8  # voxels in a slab of a volume of several


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
    """Words of the cells of all levels, one level after the other; level 0 has none."""

    words: Words  # (N,)
    first: IntArray  # (TOP + 1,) where a level begins
    shape: IntArray  # (TOP + 1, 3) X, Y, S W of a level


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
    shape = pools.shape[level]
    first = pools.first[level]
    return pools.words[first : first + shape.prod()].reshape(shape)


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
    own, every = _pools(column_of, columns.words), _pools_of_all(column_of, columns.every)
    starts = np.array([(start >> level) - 1 for level in range(TOP + 1)])
    return Pyramid(columns, _beside(own), _four(own, every=False), _four(every, every=True), starts)


def turned(columns: Columns, yaw: float) -> TurnedColumns:
    """Turn a volume about z.

    Args:
        columns: of the volume.
        yaw: rad, counter-clockwise.
    """
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = columns.outline.T if len(columns.outline) else np.zeros((2, 1))
    xy = np.stack([c * x - s * y, s * x + c * y])
    low, high = np.floor(xy.min(1) - 1).astype(np.int64), np.ceil(xy.max(1) + 2).astype(np.int64)
    start, shape = _aligned(low, tuple(high - low))
    column_of = _turned_columns(columns.column_of, columns.start, c, s, start, shape[0], shape[1])
    starts = np.array([start >> level for level in range(TOP + 1)])
    some, every = _pools(column_of, columns.words), _pools_of_all(column_of, columns.every)
    return TurnedColumns(columns, column_of, some, _four_before(every), starts)


def _pools(column_of: Int32Array, words: Words) -> Pools:
    """Words of some column of each cell."""
    out = _blank(column_of, words)
    _pool_columns(column_of, words, level_of(out, 1))
    for level in range(2, TOP + 1):
        _pool(level_of(out, level - 1), level_of(out, level))
    return out


def _pools_of_all(column_of: Int32Array, words: Words) -> Pools:
    """Words of every column of each cell."""
    out = _blank(column_of, words)
    _pool_all_columns(column_of, words, level_of(out, 1))
    for level in range(2, TOP + 1):
        _pool_all(level_of(out, level - 1), level_of(out, level))
    return out


def _blank(column_of: Int32Array, words: Words) -> Pools:
    shape = [(column_of.shape[0] >> level, column_of.shape[1] >> level, words.shape[1]) for level in range(TOP + 1)]
    return _of_shape(np.array([(0, 0, words.shape[1]), *shape[1:]]))


def _of_shape(shape: IntArray) -> Pools:
    ends = np.cumsum(shape.prod(1))
    return Pools(np.zeros(ends[-1], np.uint64), np.append(0, ends[:-1]), shape)


def _grown(pools: Pools) -> Pools:
    """Empty pools with one cell more at the low x and y sides of each level."""
    shape = pools.shape + np.array([1, 1, 0])
    shape[0] = pools.shape[0]
    return _of_shape(shape)


def _beside(pools: Pools) -> Pools:
    out = _grown(pools)
    for level in range(1, TOP + 1):
        level_of(out, level)[1:, 1:] = level_of(pools, level)
    return out


def _four(pools: Pools, *, every: bool) -> Pools:
    """Each cell with the next along x, y and both."""
    out = _grown(pools)
    for level in range(1, TOP + 1):
        _pool_four(level_of(pools, level), every, level_of(out, level))
    return out


def _four_before(pools: Pools) -> Pools:
    """Each cell with the one before along x, y and both."""
    out = _of_shape(pools.shape)
    for level in range(1, TOP + 1):
        _pool_four(level_of(pools, level), True, level_of(out, level))
    return out


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
def _turned_columns(
    column_of: Int32Array, start: IntArray, c: float, s: float, first: IntArray, n_x: int, n_y: int
) -> Int32Array:
    out = np.full((n_x, n_y), -1, np.int32)
    last_u, last_v = column_of.shape[0], column_of.shape[1]
    start_u, start_v = start
    for i in range(n_x):
        x = float(first[0] + i)
        for j in range(n_y):
            y = float(first[1] + j)
            u = int(np.floor(c * x + s * y + 0.5)) - start_u
            v = int(np.floor(c * y - s * x + 0.5)) - start_v
            if 0 <= u < last_u and 0 <= v < last_v:
                out[i, j] = column_of[np.uint64(u), np.uint64(v)]
    return out


@njit(cache=True, nogil=True)
def _pool_columns(column_of: Int32Array, words: Words, out: Words) -> None:
    for x in range(column_of.shape[0]):
        for y in range(column_of.shape[1]):
            column = column_of[x, y]
            if column >= 0:
                for w in range(words.shape[1]):
                    out[x >> 1, y >> 1, w] |= words[column, w]


@njit(cache=True, nogil=True)
def _pool_all_columns(column_of: Int32Array, words: Words, out: Words) -> None:
    for x in range(out.shape[0]):
        for y in range(out.shape[1]):
            a, b = column_of[2 * x, 2 * y], column_of[2 * x, 2 * y + 1]
            c, d = column_of[2 * x + 1, 2 * y], column_of[2 * x + 1, 2 * y + 1]
            if a >= 0 and b >= 0 and c >= 0 and d >= 0:
                for w in range(out.shape[2]):
                    out[x, y, w] = words[a, w] & words[b, w] & words[c, w] & words[d, w]


@njit(cache=True, nogil=True)
def _pool(fine: Words, out: Words) -> None:
    for x in range(out.shape[0]):
        for y in range(out.shape[1]):
            for w in range(out.shape[2]):
                low = fine[2 * x, 2 * y, w] | fine[2 * x, 2 * y + 1, w]
                out[x, y, w] = low | fine[2 * x + 1, 2 * y, w] | fine[2 * x + 1, 2 * y + 1, w]


@njit(cache=True, nogil=True)
def _pool_all(fine: Words, out: Words) -> None:
    for x in range(out.shape[0]):
        for y in range(out.shape[1]):
            for w in range(out.shape[2]):
                low = fine[2 * x, 2 * y, w] & fine[2 * x, 2 * y + 1, w]
                out[x, y, w] = low & fine[2 * x + 1, 2 * y, w] & fine[2 * x + 1, 2 * y + 1, w]


@njit(cache=True, nogil=True)
def _pool_four(pooled: Words, every: bool, out: Words) -> None:
    """Cell (x, y) of `out` pools cells x - 1, x by y - 1, y; outside is nothing."""
    n_x, n_y, n_words = pooled.shape
    for x in range(out.shape[0]):
        for y in range(out.shape[1]):
            i0, j0 = x - 1, y - 1
            if every:
                if i0 >= 0 and j0 >= 0 and i0 + 1 < n_x and j0 + 1 < n_y:
                    for w in range(n_words):
                        low = pooled[i0, j0, w] & pooled[i0, j0 + 1, w]
                        out[x, y, w] = low & pooled[i0 + 1, j0, w] & pooled[i0 + 1, j0 + 1, w]
            else:
                for i in range(max(i0, 0), min(i0 + 2, n_x)):
                    for j in range(max(j0, 0), min(j0 + 2, n_y)):
                        for w in range(n_words):
                            out[x, y, w] |= pooled[i, j, w]
