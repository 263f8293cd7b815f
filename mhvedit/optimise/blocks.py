"""Blocks of the pose lattice, each cut into smaller ones down to single poses.

The solutions of a stage are sorted once along a curve that fills the lattice, on which every block of every size is one
run. A block knows the box in which the vectors from A's root to B's root of all its solutions lie.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, ComplexArray, FloatArray, Int32Array, IntArray
from mhvedit.optimise.chains import StageCosts, vectors
from mhvedit.search.poses import CellSet

COARSEST = 5  # level of the largest blocks: 32 steps of x and y
YAW_LEVEL = 2  # levels up to this one hold a single step of yaw
MAPPED = 3  # level of the blocks of maps


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """The solutions of one stage along the curve."""

    codes: IntArray  # (S,) place on the curve, ascending
    rows: Int32Array  # (S,) of the stage
    first: ComplexArray  # (S,) m, from A's to B's first root, A standing as it was
    last: ComplexArray  # (S,) m, and between the last roots
    yaws: FloatArray  # (S,) rad
    half: complex = 0j  # m, half of the sides of boxes around first and last, where rows stand for several solutions
    half_yaw: float = 0.0  # rad, likewise


@dataclass(frozen=True, slots=True, eq=False)
class BlockMap:
    """In which blocks of level `MAPPED` there are solutions of one stage."""

    origin: IntArray  # (2,) the least x and y that any may have, in steps
    there: BoolArray  # (X, Y, Yaw)


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """Blocks of one level, of all stages one after the other."""

    level: int
    stage: Int32Array  # (N,)
    run: Int32Array  # (N, 2) start and stop along the stage's curve
    first: ComplexArray  # (N,) m, middle of the vectors between the stage's first roots
    last: ComplexArray  # (N,) m, and between its last
    half: ComplexArray  # (N,) m, half of the sides of the boxes around both
    yaw: FloatArray  # (N,) rad, middle of the yaws
    half_yaw: FloatArray  # (N,) rad

    def __len__(self) -> int:
        return len(self.stage)


def curve_of(stage: StageCosts) -> Curve:
    """Sort the solutions of a stage along the curve."""
    keys = stage.keys - np.array([*stage.keys[:, :2].min(0), 0])
    codes = _codes(np.ascontiguousarray(keys))
    rows = np.argsort(codes, kind="stable")
    first, last = (vectors(stage, rows, which) for which in (0, -1))
    return Curve(
        codes[rows], rows.astype(np.int32), first, first if np.array_equal(first, last) else last, stage.yaws[rows]
    )


def block_map(places: CellSet) -> BlockMap:
    """The blocks in which there are solutions.

    Args:
        places: of the solutions, at least one.
    """
    origin, n_yaw = places.base.min(0), len(places.base)
    n_x, n_y = ((places.base.max(0) - origin + places.size - 1) >> MAPPED) + 1
    there = np.zeros((n_x, n_y, ((n_yaw - 1) >> (MAPPED - YAW_LEVEL)) + 1), np.bool_)
    _mark(places.cells, places.size, places.base - origin, there)
    return BlockMap(origin, there)


def marked(places: CellSet, flags: BoolArray) -> BoolArray:
    """(N,) which solutions are in flagged blocks.

    Args:
        places: of the solutions.
        flags: (X, Y, Yaw) as in the `BlockMap` of these.
    """
    return np.asarray(_looked_up(places.cells, places.size, places.base - places.base.min(0), flags))


def curve_of_map(blocks: BlockMap, stage: StageCosts, *, step: float, n_yaw: int) -> Curve:
    """Blocks in place of their solutions along the curve; `rows` are indices into the flattened map.

    Args:
        blocks: of the stage.
        stage: for its roots; its solutions may be some of them only.
        step: of x and y between poses, m.
        n_yaw: yaw steps in a full turn.
    """
    places = np.argwhere(blocks.there)
    sides = np.array([1 << MAPPED, 1 << MAPPED, 1 << (MAPPED - YAW_LEVEL)])
    codes = _codes(places * sides)
    order = np.argsort(codes, kind="stable")
    half = (sides - 1) / 2
    middle = places[order] * sides + half
    yaws = middle[:, 2] * (2 * np.pi / n_yaw)
    spin, half_yaw = np.exp(1j * yaws), float(half[2] * 2 * np.pi / n_yaw)
    at = ((middle[:, 0] + blocks.origin[0]) + 1j * (middle[:, 1] + blocks.origin[1])) * step
    first, last = (at + spin * (stage.middle_b + root_b) - (stage.middle_a + root_a)
                   for root_a, root_b in zip(stage.roots_a, stage.roots_b, strict=True))  # fmt: skip
    swept = 2 * np.sin(half_yaw / 2) * np.abs(stage.middle_b + stage.roots_b).max()
    rows = np.flatnonzero(blocks.there)[order].astype(np.int32)
    return Curve(codes[order], rows, first, last, yaws, complex(*(half[:2] * step + swept)), half_yaw)


def coarsest_blocks(curves: Sequence[Curve], pool: ThreadPoolExecutor) -> Blocks:
    """The largest blocks of all stages.

    Args:
        curves: of all stages.
        pool: of threads.
    """
    runs = []
    for curve in curves:
        starts = np.flatnonzero(np.diff(curve.codes >> _bits(COARSEST), prepend=-1))
        runs.append(np.column_stack([starts, np.append(starts[1:], len(curve.codes))]).astype(np.int32))
    return _described(curves, pool, COARSEST, runs)


def smaller_blocks(
    curves: Sequence[Curve], blocks: Blocks, used: IntArray, pool: ThreadPoolExecutor
) -> tuple[Blocks, IntArray]:
    """Cut some blocks into those of the next level.

    Args:
        curves: of all stages.
        blocks: not of single poses.
        used: (N,) rows of the blocks, ascending.
        pool: of threads.

    Returns:
        The smaller ones, and (B + 1,) where those of each block start; those not used have none.
    """
    bits = _bits(blocks.level - 1)
    own = [used[blocks.stage[used] == g] for g in range(len(curves))]
    cut = list(pool.map(lambda curve, mine: _cut(curve.codes, blocks.run[mine], bits), curves, own))
    count = np.zeros(len(blocks) + 1, np.int64)
    for mine, (_, per_block) in zip(own, cut, strict=True):
        count[mine + 1] = per_block
    return _described(curves, pool, blocks.level - 1, [run for run, _ in cut]), np.cumsum(count)


def _described(curves: Sequence[Curve], pool: ThreadPoolExecutor, level: int, runs: Sequence[Int32Array]) -> Blocks:
    parts = pool.map(lambda curve, run: _boxes(curve.first, curve.last, curve.yaws, run), curves, runs)
    first, last, half, yaw, half_yaw = (np.concatenate(column) for column in zip(*parts, strict=True))
    stage = np.repeat(np.arange(len(curves), dtype=np.int32), [len(run) for run in runs])
    half += np.array([curve.half for curve in curves])[stage]
    half_yaw += np.array([curve.half_yaw for curve in curves])[stage]
    if all(curve.last is curve.first for curve in curves):
        last = first
    return Blocks(level, stage, np.concatenate(runs), first, last, half, yaw, half_yaw)


def _bits(level: int) -> int:
    """How many bits of a code tell apart what is inside a block."""
    return 2 * level + max(level - YAW_LEVEL, 0)


@njit(cache=True, nogil=True)
def _mark(cells: IntArray, size: int, base: IntArray, out: BoolArray) -> None:
    """Flag the blocks that some cells are in; `base` from the origin of the blocks on."""
    row = 0, 0, 0
    for n in range(cells.shape[0]):
        row = _row_of(np.int64(cells[n]), row, size, base)
        out[_block_of(np.int64(cells[n]), row, base)] = True


@njit(cache=True, nogil=True)
def _looked_up(cells: IntArray, size: int, base: IntArray, flags: BoolArray) -> BoolArray:
    """The flag of the block that each cell is in; as `_mark`."""
    out = np.empty(cells.shape[0], np.bool_)
    row = 0, 0, 0
    for n in range(cells.shape[0]):
        row = _row_of(np.int64(cells[n]), row, size, base)
        out[n] = flags[_block_of(np.int64(cells[n]), row, base)]
    return out


@njit(cache=True, nogil=True)
def _row_of(cell: int, before: tuple[int, int, int], size: int, base: IntArray) -> tuple[int, int, int]:
    """The first cell of the row of yaws that a cell is in, and the row's x and y in the grid.

    Cells ascend, and most are in one row with the one before.
    """
    if cell < before[0] + base.shape[0]:
        return before
    row = cell // base.shape[0]
    return row * base.shape[0], row // size, row % size


@njit(cache=True, nogil=True)
def _block_of(cell: int, row: tuple[int, int, int], base: IntArray) -> tuple[int, int, int]:
    """The block that a cell of a row is in."""
    k = cell - row[0]
    return (base[k, 0] + row[1]) >> MAPPED, (base[k, 1] + row[2]) >> MAPPED, k >> (MAPPED - YAW_LEVEL)


@njit(cache=True, nogil=True)
def _codes(keys: IntArray) -> IntArray:
    """Place on the curve of poses (S, 3) that are not negative."""
    codes = np.empty(keys.shape[0], np.int64)
    for i in range(keys.shape[0]):
        x, y, k = keys[i, 0], keys[i, 1], keys[i, 2]
        code = ((x >> COARSEST) << 20 | (y >> COARSEST)) << 12 | (k >> (COARSEST - YAW_LEVEL))
        for bit in range(COARSEST - 1, -1, -1):
            if bit >= YAW_LEVEL:
                code = code << 1 | (k >> (bit - YAW_LEVEL) & 1)
            code = code << 2 | (x >> bit & 1) << 1 | (y >> bit & 1)
        codes[i] = code
    return codes


@njit(cache=True, nogil=True)
def _cut(codes: IntArray, run: Int32Array, bits: int) -> tuple[Int32Array, IntArray]:
    """Where codes change within runs: the smaller runs, and how many each has."""
    per_block = np.zeros(run.shape[0], np.int64)
    for n in range(run.shape[0]):
        for i in range(run[n, 0], run[n, 1]):
            per_block[n] += i == run[n, 0] or codes[i] >> bits != codes[i - 1] >> bits
    out = np.empty((per_block.sum(), 2), np.int32)
    at = 0
    for n in range(run.shape[0]):
        for i in range(run[n, 0], run[n, 1]):
            if i == run[n, 0] or codes[i] >> bits != codes[i - 1] >> bits:
                out[at, 0] = i
                at += 1
            out[at - 1, 1] = i + 1
    return out, per_block


@njit(cache=True, nogil=True)
def _boxes(
    first: ComplexArray, last: ComplexArray, yaws: FloatArray, run: Int32Array
) -> tuple[ComplexArray, ComplexArray, ComplexArray, FloatArray, FloatArray]:
    """Middles of first and last, half of the sides of the boxes around both, yaw and half yaw of runs of solutions."""
    count = run.shape[0]
    middles = np.empty((2, count), np.complex128)
    sides, yaw, half = np.zeros(count, np.complex128), np.empty(count), np.empty(count)
    for n in range(count):
        start, stop = run[n, 0], run[n, 1]
        least, most = yaws[start], yaws[start]
        for i in range(start, stop):
            least, most = min(least, yaws[i]), max(most, yaws[i])
        yaw[n], half[n] = 0.5 * (least + most), 0.5 * (most - least)
        for which in range(2):
            own = first if which == 0 else last
            low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
            for i in range(start, stop):
                low_x, high_x = min(low_x, own[i].real), max(high_x, own[i].real)
                low_y, high_y = min(low_y, own[i].imag), max(high_y, own[i].imag)
            middles[which, n] = complex(0.5 * (low_x + high_x), 0.5 * (low_y + high_y))
            sides[n] = complex(max(sides[n].real, 0.5 * (high_x - low_x)), max(sides[n].imag, 0.5 * (high_y - low_y)))
    return middles[0], middles[1], sides, yaw, half
