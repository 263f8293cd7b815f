"""Volumes arranged for the search: bits pooled over blocks of 2, 4, 8 and 16 voxels, at rest for A and turned for B.

Level 0 are voxels; a cell of level L pools the bits of 2^L voxels along each axis, from lattice index zero. A's pools
also take in the next cell along x, along y and along both, so that one look at a pool answers for a whole block of 2^L
x 2^L shifts: pooled by OR they say where a bit may be met, pooled by AND where it is met whatever the shift. B is
turned about z by looking up, for every voxel of the lattice, the voxel of the untouched volume that its centre falls
into.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray, Int32Array, IntArray, Words
from mhvedit.volumes.history import MotionHistoryVolume

TOP = 4  # the coarsest level
BLOCK = 1 << TOP


@dataclass(frozen=True, slots=True, eq=False)
class Pyramid:
    """A volume and its pools; level L is indexed by (lattice index >> L) - starts[L]."""

    levels: tuple[Words, ...]  # TOP + 1 of (X, Y, Z, W): bits of some voxel
    sure: tuple[Words, ...]  # the same: bits of every voxel
    starts: IntArray  # (TOP + 1, 3)


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """The occupied columns of a volume, ready to be turned about z."""

    column_of: Int32Array  # (X, Y) index into bits; -1 where the column is empty
    start: IntArray  # (2,) lattice index of column (0, 0)
    bits: Words  # (C, Z, W)
    z_start: int  # lattice index of the columns' first voxel, a multiple of BLOCK
    occupied: FloatArray  # (C, 2) lattice indices of the occupied columns


@dataclass(frozen=True, slots=True, eq=False)
class TurnedColumns:
    """A volume turned about z, and its pools; level 0 is the columns."""

    column_of: Int32Array  # (X, Y) index into bits; -1 where empty; X and Y multiples of BLOCK
    bits: Words  # (C, Z, W)
    levels: tuple[Words, ...]  # TOP + 1 of (X, Y, Z, W); level 0 is a stand-in of one cell
    starts: IntArray  # (TOP + 1, 3), as in Pyramid


def pyramid_of(volume: MotionHistoryVolume) -> Pyramid:
    """Pool the volume that stays at rest."""
    start, shape = _aligned(volume.grid.start, volume.grid.shape)
    fine = np.zeros((*shape, volume.frames.shape[3]), np.uint64)
    low = np.array(volume.grid.start) - start
    high = low + volume.grid.shape
    fine[low[0] : high[0], low[1] : high[1], low[2] : high[2]] = volume.frames
    levels, sure, starts = [fine], [fine], [start]
    some = every = fine
    for level in range(1, TOP + 1):
        some, every = _pool(some), ~_pool(~every)
        levels.append(_with_next(some, np.uint64(0)))
        sure.append(~_with_next(~every, ~np.uint64(0)))
        starts.append((start >> level) - np.array([1, 1, 0]))
    return Pyramid(tuple(levels), tuple(sure), np.array(starts))


def columns_of(volume: MotionHistoryVolume) -> Columns:
    """Collect the occupied columns of the volume that is to be turned."""
    occupied = volume.filled.any(2)
    column_of = np.full(occupied.shape, -1, np.int32)
    column_of[occupied] = np.arange(occupied.sum())
    start, shape = _aligned(volume.grid.start, volume.grid.shape)
    bits = np.zeros((int(occupied.sum()), shape[2], volume.frames.shape[3]), np.uint64)
    low = volume.grid.start[2] - start[2]
    bits[:, low : low + volume.grid.shape[2]] = volume.frames[occupied]
    first = np.array(volume.grid.start[:2])
    return Columns(column_of, first, bits, int(start[2]), np.asarray(np.argwhere(occupied) + first, np.float64))


def turned(columns: Columns, yaw: float) -> TurnedColumns:
    """Turn a volume about z.

    Args:
        columns: of the volume.
        yaw: rad, counter-clockwise.
    """
    c, s = np.cos(yaw), np.sin(yaw)
    xy = columns.occupied @ np.array([[c, s], [-s, c]]) if len(columns.occupied) else np.zeros((1, 2))
    low, high = np.floor(xy.min(0) - 1).astype(np.int64), np.ceil(xy.max(0) + 2).astype(np.int64)
    first = (low // BLOCK) * BLOCK
    shape = np.maximum(-(-(high - first) // BLOCK) * BLOCK, BLOCK)
    column_of = _turned_columns(columns.column_of, columns.start, c, s, first, shape[0], shape[1])
    levels = [np.zeros((1, 1, 1, columns.bits.shape[2]), np.uint64), _pool_columns(column_of, columns.bits)]
    for _ in range(2, TOP + 1):
        levels.append(_pool(levels[-1]))
    start = np.array([first[0], first[1], columns.z_start])
    return TurnedColumns(column_of, columns.bits, tuple(levels), np.array([start >> lv for lv in range(TOP + 1)]))


def _aligned(start: tuple[int, int, int], shape: tuple[int, int, int]) -> tuple[IntArray, IntArray]:
    """The box grown to multiples of BLOCK."""
    low = np.array(start) // BLOCK * BLOCK
    high = -(-(np.array(start) + shape) // BLOCK) * BLOCK
    return low, high - low


@njit(cache=True, nogil=True)
def _pool(fine: Words) -> Words:
    n_x, n_y, n_z, n_words = fine.shape
    out = np.zeros((n_x // 2, n_y // 2, n_z // 2, n_words), np.uint64)
    for x in range(n_x):
        for y in range(n_y):
            for z in range(n_z):
                for w in range(n_words):
                    out[x >> 1, y >> 1, z >> 1, w] |= fine[x, y, z, w]
    return out


@njit(cache=True, nogil=True)
def _with_next(pooled: Words, outside: np.uint64) -> Words:
    """Each cell pooled, by OR, with the next along x, y and both; the array gains one cell at its low x and y sides."""
    n_x, n_y, n_z, n_words = pooled.shape
    out = np.zeros((n_x + 1, n_y + 1, n_z, n_words), np.uint64)
    for x in range(-1, n_x):
        for y in range(-1, n_y):
            for z in range(n_z):
                for w in range(n_words):
                    word = np.uint64(0)
                    for i in range(x, x + 2):
                        for j in range(y, y + 2):
                            word |= pooled[i, j, z, w] if 0 <= i < n_x and 0 <= j < n_y else outside
                    out[x + 1, y + 1, z, w] = word
    return out


@njit(cache=True, nogil=True)
def _turned_columns(
    column_of: Int32Array, start: IntArray, c: float, s: float, first: IntArray, n_x: int, n_y: int
) -> Int32Array:
    out = np.full((n_x, n_y), -1, np.int32)
    for i in range(n_x):
        for j in range(n_y):
            x, y = float(first[0] + i), float(first[1] + j)
            u = int(np.floor(c * x + s * y + 0.5)) - start[0]
            v = int(np.floor(c * y - s * x + 0.5)) - start[1]
            if 0 <= u < column_of.shape[0] and 0 <= v < column_of.shape[1]:
                out[i, j] = column_of[u, v]
    return out


@njit(cache=True, nogil=True)
def _pool_columns(column_of: Int32Array, bits: Words) -> Words:
    n_x, n_y = column_of.shape
    n_z, n_words = bits.shape[1], bits.shape[2]
    out = np.zeros((n_x // 2, n_y // 2, n_z // 2, n_words), np.uint64)
    for x in range(n_x):
        for y in range(n_y):
            column = column_of[x, y]
            if column >= 0:
                for z in range(n_z):
                    for w in range(n_words):
                        out[x >> 1, y >> 1, z >> 1, w] |= bits[column, z, w]
    return out
