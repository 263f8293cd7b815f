"""Volumes arranged for the search: columns of words over the floor, and columns turned about z.

Poses move and turn on the floor, so what lies over one voxel of the floor stays together: a column. A range of heights
is cut into a few slabs, a word each. A word has one bit for each frame, and where frames leave room, several lanes of
such bits, one for each of equal stretches of the slab: a volume of one moment has 64 lanes. Two columns may share a
voxel in some frame only where an AND of their slabs is not zero. Below a slab lie the words of its voxels, one of each
lane to a word, so that OR and AND over a slab's voxels keep lanes apart.

A volume is turned about z by looking up, for every column of the lattice, the column of the untouched volume that its
centre falls into.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray, Words
from mhvedit.volumes.history import Volume

WORD = 64  # bits
BLOCK = 16  # turned columns come in multiples of so many
EMPTY = 0  # number of the column that holds nothing
Place = tuple[slice, slice]  # along x and y


@dataclass(frozen=True, slots=True)
class Layout:
    """Where in the words of a column the frames of a voxel are: voxel `low + (s lanes + l) tall + v` is lane l of word
    v of slab s.
    """

    low: int  # lattice index along z of the first voxel
    n_slabs: int  # S
    lanes: int  # stretches of a slab, a power of two
    tall: int  # voxels in a stretch

    @property
    def high(self) -> int:
        """Lattice index along z past the last voxel."""
        return self.low + self.n_slabs * self.lanes * self.tall


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """The occupied columns of a volume; column EMPTY holds nothing."""

    layout: Layout
    column_of: Int32Array  # (X, Y) index into the words
    start: IntArray  # (2,) lattice index of column (0, 0)
    some: Words  # (C, S) what occurs in some voxel of each stretch
    every: Words  # (C, S) what occurs in every voxel of each stretch
    voxels: Words  # (C, S tall) what occurs in each voxel
    outline: FloatArray  # (N, 2) lattice indices of the first and the last occupied column of each row


@dataclass(frozen=True, slots=True, eq=False)
class TurnedColumns:
    """A volume turned about z."""

    columns: Columns  # untouched
    column_of: Int32Array  # (X, Y) index into the columns' words; X and Y multiples of BLOCK
    start: IntArray  # (2,) lattice index of column (0, 0), multiples of BLOCK


def lanes_of(n_frames: int) -> int:
    """How many lanes of so many frames fit into a word.

    >>> [lanes_of(n) for n in (1, 16, 23, 33, 64)]
    [64, 4, 2, 1, 1]
    """
    return 1 << (WORD // n_frames).bit_length() - 1


def fitted_layout(low: int, high: int, *, n_frames: int, n_slabs: int) -> Layout:
    """The layout of a range of heights in so many slabs, as fine as they allow.

    Args:
        low: lattice index along z of the first voxel.
        high: past the last.
        n_frames: bits of a voxel, at most 64.
        n_slabs: words of a column.
    """
    lanes = lanes_of(n_frames)
    return Layout(low, n_slabs, lanes, max(1, -(-(high - low) // (n_slabs * lanes))))


def columns_of(volume: Volume, layout: Layout, *, word: int = 0) -> Columns:
    """Collect the columns of a volume that hold anything.

    Args:
        volume: of a subject.
        layout: of the heights that matter; what lies outside them is left out.
        word: which of the volume's words of 64 frames.
    """
    low, box, parts = layout.low, volume.grid, []
    for piece in volume.pieces:
        z = piece.grid.start[2]
        first, past = (min(max(at - z, 0), piece.grid.shape[2]) for at in (low, layout.high))
        parts.append((piece.grid.slices_in(box)[:2], piece.frames[:, :, first:past, word], z + first - low))
    column_of, cells = occupied(box.shape[:2], [(where, frames) for where, frames, _ in parts])
    voxels = np.zeros((len(cells) + 1, layout.n_slabs * layout.tall), np.uint64)
    for where, frames, height in parts:
        _pack(frames, height, layout.lanes, layout.tall, column_of[where], voxels)
    some, every = (voxels, voxels) if layout.tall == 1 else _pooled(voxels, layout.tall)
    start = np.array(box.start[:2])
    return Columns(layout, column_of, start, some, every, voxels, outline_of(cells, start))


def occupied(shape: tuple[int, int], parts: Sequence[tuple[Place, Words]]) -> tuple[Int32Array, Int32Array]:
    """Number the columns that hold anything, from EMPTY + 1 on, row by row.

    Args:
        shape: columns along x and y.
        parts: of each piece, where it lies among them, and its (X, Y, Z) words.

    Returns:
        (X, Y) the number of each column, and (C - 1, 2) x and y of those that have one.
    """
    some = np.zeros(shape, np.bool_)
    for where, words in parts:
        _mark_occupied(words, some[where])
    cells = np.argwhere(some).astype(np.int32)
    column_of = np.full(shape, EMPTY, np.int32)
    column_of[some] = np.arange(EMPTY + 1, EMPTY + 1 + len(cells))
    return column_of, cells


def outline_of(cells: Int32Array, start: IntArray) -> FloatArray:
    """What `Columns.outline` is.

    Args:
        cells: (C, 2) x and y of the occupied columns, row by row.
        start: (2,) lattice index of column (0, 0).
    """
    ends = np.flatnonzero(np.diff(cells[:, 0], prepend=-1, append=-1))
    return np.asarray(np.concatenate([cells[ends[:-1]], cells[ends[1:] - 1]]) + start, np.float64)


def turned(columns: Columns, yaw: float) -> TurnedColumns:
    """Turn a volume about z.

    Args:
        columns: of the volume.
        yaw: rad, counter-clockwise.
    """
    c, s = float(np.cos(yaw)), float(np.sin(yaw))
    low_x, high_x, low_y, high_y = turned_box(columns.outline, c, s)
    column_of = np.empty((high_x - low_x, high_y - low_y), np.int32)
    lay_turned(columns.column_of, columns.start, c, s, low_x, low_y, column_of)
    return TurnedColumns(columns, column_of, np.array([low_x, low_y]))


@njit(cache=True, nogil=True)
def aligned(low: int, high: int) -> tuple[int, int]:
    """A range grown to multiples of BLOCK, one at least."""
    first = low // BLOCK * BLOCK
    return first, max((high + BLOCK - 1) // BLOCK * BLOCK, first + BLOCK)


@njit(cache=True, nogil=True)
def _mark_occupied(words: Words, some: BoolArray) -> None:
    """Mark the columns that hold anything."""
    for x in range(words.shape[0]):
        for y in range(words.shape[1]):
            found = np.uint64(0)
            for z in range(words.shape[2]):
                found |= words[x, y, z]
            some[x, y] |= found != 0


@njit(cache=True, nogil=True)
def _pack(frames: Words, low: int, lanes: int, tall: int, column_of: Int32Array, voxels: Words) -> None:
    """Add what columns hold to the words of their voxels; `low` is the height of voxel 0 in the layout."""
    at, shift = np.empty(frames.shape[2], np.int64), np.empty(frames.shape[2], np.uint64)
    for z in range(frames.shape[2]):
        stretch, voxel = divmod(low + z, tall)
        slab, lane = divmod(stretch, lanes)
        at[z], shift[z] = slab * tall + voxel, np.uint64(lane * (WORD // lanes))
    for x in range(frames.shape[0]):
        for y in range(frames.shape[1]):
            n = column_of[x, y]
            if n != EMPTY:
                for z in range(frames.shape[2]):
                    voxels[n, at[z]] |= frames[x, y, z] << shift[z]


@njit(cache=True, nogil=True)
def _pooled(voxels: Words, tall: int) -> tuple[Words, Words]:
    """(C, S) OR and AND over the voxels of each slab."""
    n_slabs = voxels.shape[1] // tall
    some = np.zeros((voxels.shape[0], n_slabs), np.uint64)
    every = np.full((voxels.shape[0], n_slabs), ~np.uint64(0))
    for n in range(voxels.shape[0]):
        for slab in range(n_slabs):
            for v in range(slab * tall, (slab + 1) * tall):
                some[n, slab] |= voxels[n, v]
                every[n, slab] &= voxels[n, v]
    return some, every


@njit(cache=True, nogil=True)
def turned_box(outline: FloatArray, c: float, s: float) -> tuple[int, int, int, int]:
    """First and past-the-last lattice index along x, and along y, that turned columns can have, in whole blocks.

    Args:
        outline: as in `Columns`.
        c: cosine of the yaw.
        s: its sine.
    """
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    for n in range(outline.shape[0]):
        x, y = c * outline[n, 0] - s * outline[n, 1], s * outline[n, 0] + c * outline[n, 1]
        low_x, high_x, low_y, high_y = min(low_x, x), max(high_x, x), min(low_y, y), max(high_y, y)
    if outline.shape[0] == 0:
        low_x, high_x, low_y, high_y = 0.0, 0.0, 0.0, 0.0
    first_x, past_x = aligned(int(np.floor(low_x - 1)), int(np.ceil(high_x + 2)))
    first_y, past_y = aligned(int(np.floor(low_y - 1)), int(np.ceil(high_y + 2)))
    return first_x, past_x, first_y, past_y


@njit(cache=True, nogil=True)
def lay_turned(
    column_of: Int32Array, start: IntArray, c: float, s: float, first_x: int, first_y: int, out: Int32Array
) -> None:
    """Find the column that each turned column's centre falls into.

    Args:
        column_of: as in `Columns`.
        start: likewise.
        c: cosine of the yaw.
        s: its sine.
        first_x: lattice index of the first turned column along x.
        first_y: along y.
        out: (X, Y) is overwritten.
    """
    last_u, last_v = column_of.shape[0], column_of.shape[1]
    start_u, start_v = start
    out[:] = EMPTY
    for i in range(out.shape[0]):
        x = float(first_x + i)
        low, high = _crossing(s, c * x - start_u, last_u, first_y, out.shape[1])
        low_v, high_v = _crossing(c, -s * x - start_v, last_v, first_y, out.shape[1])
        for j in range(max(low, low_v), min(high, high_v)):
            y = float(first_y + j)
            u = int(np.floor(c * x + s * y + 0.5)) - start_u
            v = int(np.floor(c * y - s * x + 0.5)) - start_v
            if 0 <= u < last_u and 0 <= v < last_v:
                out[i, j] = column_of[np.uint64(u), np.uint64(v)]


@njit(cache=True, nogil=True, inline="always")
def _crossing(slope: float, at_zero: float, size: int, first: int, n: int) -> tuple[int, int]:
    """A range of j within n outside which slope (first + j) + at_zero does not round to an index of `size`; wide by a
    column or so.
    """
    if abs(slope) < 1e-6:
        return 0, n
    one, other = (-1.0 - at_zero) / slope - first, (size - at_zero) / slope - first
    low, high = min(one, other), max(one, other)
    return int(max(0.0, min(low, float(n)))), int(min(float(n), max(high + 2.0, 0.0)))
