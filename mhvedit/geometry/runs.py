"""Maps of bytes as runs of equal values: a map of reasons is a hundred times smaller so, and as quickly read."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import ByteArray, IntArray

THREADS = 2
PORTIONS = 16  # in which a map is handed to the threads
PIECE = 1 << 20  # values that are looked at together
LANES = 64  # values that are compared with one together


def run_lengths(values: ByteArray) -> tuple[ByteArray, IntArray]:
    """The runs of equal values in a row of bytes.

    Args:
        values: (N,).

    Returns:
        (R,) their values, and (R,) how long they are; `np.repeat` makes the row of them again.
    """
    changes = [np.zeros(min(len(values), 1), np.int64)]
    for first in range(0, len(values) - 1, PIECE):
        piece = values[first : first + PIECE + 1]
        changes.append(np.flatnonzero(piece[1:] != piece[:-1]) + (first + 1))
    starts = np.concatenate(changes)
    return values[starts], np.diff(starts, append=len(values))


def byte_counts(values: ByteArray, kinds: int) -> IntArray:
    """How often each of the first so many values comes.

    Args:
        values: of any shape, however they lie in memory.
        kinds: at most 256.

    Returns:
        (kinds,).
    """
    return np.asarray(_counted(values.ravel("K"), kinds))


def runs_along_rows(values: ByteArray, value: int) -> tuple[IntArray, IntArray]:
    """The runs of one value along the last axis.

    Args:
        values: (X, Y, Z); quickest where the first two axes lie together in memory, as of a map a plane for each z.
        value: of the cells that are wanted.

    Returns:
        (R, 2) start and stop of each run, row by row, and (X * Y + 1,) where those of each row start.
    """
    with ThreadPoolExecutor(THREADS) as pool:
        portions = np.array_split(values, min(len(values), PORTIONS))
        parts = list(pool.map(lambda planes: _runs_of_planes(planes, value), portions))
    starts = np.concatenate([[0], np.cumsum(np.concatenate([count for _, count in parts]))])
    return np.concatenate([run for run, _ in parts]), starts


@njit(cache=True, nogil=True)
def _counted(values: ByteArray, kinds: int) -> IntArray:
    """(kinds,) how often each byte comes: one kind after the other, in lanes that are compared together and that never
    count beyond a byte.
    """
    counts, lanes = np.zeros(kinds, np.int64), np.empty(LANES, np.uint8)
    for first in range(0, len(values), 255 * LANES):
        part = values[first : first + 255 * LANES]
        whole = len(part) // LANES * LANES
        for kind in range(kinds):
            lanes[:] = 0
            for start in range(0, whole, LANES):
                for i in range(LANES):
                    lanes[i] += np.uint8(part[start + i] == np.uint8(kind))
            for i in range(LANES):
                counts[kind] += lanes[i]
            for i in range(whole, len(part)):
                counts[kind] += part[i] == np.uint8(kind)
    return counts


@njit(cache=True, nogil=True)
def _runs_of_planes(values: ByteArray, value: int) -> tuple[IntArray, IntArray]:
    """Runs in some planes, and how many each row has."""
    n_x, n_y, n_z = values.shape
    count = np.zeros((n_x, n_y), np.int64)
    plane = np.zeros((n_y, n_z + 1), np.uint8)
    runs = np.empty((n_y, 2), np.int64)
    at = 0
    for x in range(n_x):
        _lay_plane(values[x], value, plane, count[x])
        more = at + count[x].sum()
        if more > len(runs):
            runs = np.concatenate((runs, np.empty((more, 2), np.int64)))
        for y in range(n_y):
            if count[x, y] > 0:
                at = _list_runs(plane[y], runs, at)
    return runs[:at], count.reshape(-1)


@njit(cache=True, nogil=True, inline="always")
def _lay_plane(values: ByteArray, value: int, plane: ByteArray, count: IntArray) -> None:
    """Say where in a plane a value is, rows in one piece with a cell more that is none, and how many runs each has."""
    n_y, n_z = values.shape
    for z in range(n_z):
        for y in range(n_y):
            plane[y, z] = values[y, z] == value
    for y in range(n_y):
        edges = np.int64(plane[y, 0])
        for z in range(n_z):
            edges += plane[y, z] ^ plane[y, z + 1]
        count[y] = edges // 2


@njit(cache=True, nogil=True, inline="always")
def _list_runs(row: ByteArray, runs: IntArray, at: int) -> int:
    """List the runs of a row from place `at` on; where the next goes."""
    before = np.uint8(0)
    for z in range(row.shape[0]):
        if row[z] > before:
            runs[at, 0] = z
        elif row[z] < before:
            runs[at, 1] = z
            at += 1
        before = row[z]
    return at
